/* Images, samplers, textures and materials of glTF files. */
#include <math.h>
#include <string.h>

#include "data/description.h"
#include "io/gltf.h"

enum { FILTER_NEAREST = 9728, WRAP_CLAMP = 33071, WRAP_MIRRORED = 33648, WRAP_REPEAT = 10497 };

static void embed_image(gltf_reader *g, const gltf_at *at, knurl_description_image *image)
{
    gltf_report *r = &g->report;
    gltf_at views = gltf_array(r, &g->root, "bufferViews");
    int64_t index = gltf_index(r, at, "bufferView", gltf_count(&views), true);
    if (r->status != KNURL_OK || index < 0) return;
    gltf_at view = gltf_element_object(r, &views, (size_t)index);
    const unsigned char *bytes;
    size_t size, stride;
    if (!gltf_buffer_view(g, &view, &bytes, &size, &stride) || !gltf_take(g, at, size)) return;
    image->bytes = knurl_alloc(g->context, size);
    if (!image->bytes) {
        gltf_fail_memory(g, at, size);
        return;
    }
    if (size) memcpy(image->bytes, bytes, size);
    image->size = size;
}

static void read_image(gltf_reader *g, const gltf_at *at, size_t index)
{
    knurl_description_image *image = description_append_image(g->description);
    if (!image) {
        gltf_fail_memory(g, at, sizeof *image);
        return;
    }
    const char *uri = gltf_string(&g->report, at, "uri", NULL);
    if (uri && !gltf_is_data_uri(uri)) {
        gltf_at place = gltf_member(at, "uri");
        image->path = gltf_uri_path(g, &place, uri);
        image->name = image->path ? knurl_strdup(g->context, image->path) : NULL;
    } else {
        char pointer[256];
        image->name =
            knurl_format(g->context, "%s: %s", g->report.file, gltf_pointer(at, pointer, sizeof pointer));
        if (uri) {
            gltf_at place = gltf_member(at, "uri");
            gltf_read_uri(g, &place, uri, &image->bytes, &image->size);
        } else {
            embed_image(g, at, image);
        }
    }
    if (!image->name) gltf_fail_memory(g, at, index);
}

void gltf_read_images(gltf_reader *g)
{
    gltf_at images = gltf_array(&g->report, &g->root, "images");
    for (size_t i = 0; i < gltf_count(&images) && g->report.status == KNURL_OK; i++) {
        gltf_at at = gltf_element_object(&g->report, &images, i);
        if (at.value) read_image(g, &at, i);
    }
}

static knurl_wrap read_wrap(gltf_reader *g, const gltf_at *sampler, const char *key)
{
    uint64_t mode = gltf_integer(&g->report, sampler, key, WRAP_REPEAT, UINT32_MAX);
    if (mode == WRAP_MIRRORED) return KNURL_WRAP_MIRROR;
    if (mode == WRAP_CLAMP) return KNURL_WRAP_CLAMP;
    if (mode != WRAP_REPEAT) {
        gltf_at place = gltf_member(sampler, key);
        gltf_fail(&g->report, &place, KNURL_ERROR_INPUT, "found %llu, expected 10497, 33648 or 33071",
                  (unsigned long long)mode);
    }
    return KNURL_WRAP_REPEAT;
}

static void read_texture(gltf_reader *g, size_t index, knurl_texture_ref *ref)
{
    gltf_report *r = &g->report;
    gltf_at textures = gltf_array(r, &g->root, "textures"), samplers = gltf_array(r, &g->root, "samplers");
    gltf_at texture = gltf_element_object(r, &textures, index);
    int64_t source = gltf_index(r, &texture, "source", g->description->image_count, false);
    if (source < 0 && r->status == KNURL_OK) {
        char pointer[256];
        description_warn(g->description, "%s: %s has no image that knurl can read", r->file,
                         gltf_pointer(&texture, pointer, sizeof pointer));
    }
    ref->image = (int32_t)source;
    int64_t sampler = gltf_index(r, &texture, "sampler", gltf_count(&samplers), false);
    if (sampler < 0) return;
    gltf_at at = gltf_element_object(r, &samplers, (size_t)sampler);
    ref->wrap_u = read_wrap(g, &at, "wrapS");
    ref->wrap_v = read_wrap(g, &at, "wrapT");
    ref->nearest = gltf_integer(r, &at, "magFilter", 0, UINT32_MAX) == FILTER_NEAREST;
}

/* A textureInfo member. *uv_set: UINT32_MAX while the material's textures have named none; the first
 * one read decides which TEXCOORD_n the material's meshes load. */
static void read_texture_ref(gltf_reader *g, const gltf_at *at, const char *key, uint32_t *uv_set,
                             knurl_texture_ref *ref)
{
    gltf_report *r = &g->report;
    gltf_at info = gltf_object(r, at, key);
    if (!info.value) return;
    gltf_at textures = gltf_array(r, &g->root, "textures");
    int64_t index = gltf_index(r, &info, "index", gltf_count(&textures), true);
    if (r->status != KNURL_OK || index < 0) return;
    read_texture(g, (size_t)index, ref);
    uint32_t set = (uint32_t)gltf_integer(r, &info, "texCoord", 0, 1000);
    gltf_extension transform;
    gltf_extension_open(r, &info, "KHR_texture_transform", &transform);
    if (transform.at.value) {
        gltf_numbers(r, &transform.at, "offset", 2, ref->uv_offset);
        gltf_numbers(r, &transform.at, "scale", 2, ref->uv_scale);
        ref->uv_rotation = gltf_number(r, &transform.at, "rotation", 0.0, -1e9, 1e9);
        set = (uint32_t)gltf_integer(r, &transform.at, "texCoord", set, 1000);
    }
    if (*uv_set == UINT32_MAX) *uv_set = set;
    if (*uv_set == set || r->status != KNURL_OK) return;
    char pointer[256];
    description_warn(g->description,
                     "%s: %s: texCoord is %u, but the material's first texture uses %u, which is used",
                     r->file, gltf_pointer(&info, pointer, sizeof pointer), set, *uv_set);
}

static void read_displacement(gltf_reader *g, const gltf_at *at, uint32_t *uv_set,
                              knurl_description_material *m)
{
    gltf_report *r = &g->report;
    gltf_extension e;
    gltf_extension_open(r, at, "KHR_materials_displacement", &e);
    if (!e.at.value) return;
    read_texture_ref(g, &e.at, "displacementGeometryTexture", uv_set, &m->displacement);
    m->displacement_factor = gltf_number(r, &e.at, "displacementGeometryFactor", 1.0, -1e30, 1e30);
    m->displacement_offset = gltf_number(r, &e.at, "displacementGeometryOffset", 0.0, -1e30, 1e30);
    gltf_at extras = gltf_member(&e.at, "extras");
    if (json_is_object(extras.value))
        m->displacement_unnormalised = gltf_bool(r, &extras, "unnormalised", false);
}

/* For what changes how a scene looks elsewhere and not here. */
static void warn_if_there(gltf_reader *g, const gltf_at *at, const char *key)
{
    char pointer[256];
    if (at->value && gltf_member(at, key).value)
        description_warn(g->description, "%s: %s: %s is ignored", g->report.file,
                         gltf_pointer(at, pointer, sizeof pointer), key);
}

static void read_surface(gltf_reader *g, const gltf_at *at, uint32_t *uv_set, knurl_description_material *m)
{
    gltf_report *r = &g->report;
    gltf_at pbr = gltf_object(r, at, "pbrMetallicRoughness");
    for (int i = 0; i < 4; i++) m->base_color[i] = 1.0;
    gltf_numbers(r, &pbr, "baseColorFactor", 4, m->base_color);
    m->metallic = gltf_number(r, &pbr, "metallicFactor", 1.0, 0.0, 1.0);
    m->roughness = gltf_number(r, &pbr, "roughnessFactor", 1.0, 0.0, 1.0);
    read_texture_ref(g, &pbr, "baseColorTexture", uv_set, &m->base_color_texture);
    read_texture_ref(g, &pbr, "metallicRoughnessTexture", uv_set, &m->metallic_roughness_texture);
    gltf_numbers(r, at, "emissiveFactor", 3, m->emissive);
    read_texture_ref(g, at, "emissiveTexture", uv_set, &m->emissive_texture);
    warn_if_there(g, at, "normalTexture");
    m->double_sided = gltf_bool(r, at, "doubleSided", false);
    m->alpha_cutoff = gltf_number(r, at, "alphaCutoff", 0.5, 0.0, INFINITY);
    const char *mode = gltf_string(r, at, "alphaMode", "OPAQUE");
    if (strcmp(mode, "MASK") == 0)
        m->alpha_mode = KNURL_ALPHA_MASK;
    else if (strcmp(mode, "BLEND") == 0)
        m->alpha_mode = KNURL_ALPHA_BLEND;
    else if (strcmp(mode, "OPAQUE") != 0) {
        gltf_at place = gltf_member(at, "alphaMode");
        gltf_fail(r, &place, KNURL_ERROR_INPUT, "found \"%.20s\", expected OPAQUE, MASK or BLEND", mode);
    }
}

static void read_extensions(gltf_reader *g, const gltf_at *at, knurl_description_material *m)
{
    gltf_report *r = &g->report;
    gltf_extension e;
    gltf_extension_open(r, at, "KHR_materials_emissive_strength", &e);
    double strength = gltf_number(r, &e.at, "emissiveStrength", 1.0, 0.0, 1e30);
    for (int i = 0; i < 3; i++) m->emissive[i] *= strength;
    gltf_extension_open(r, at, "KHR_materials_transmission", &e);
    m->transmission = gltf_number(r, &e.at, "transmissionFactor", 0.0, 0.0, 1.0);
    warn_if_there(g, &e.at, "transmissionTexture");
    gltf_extension_open(r, at, "KHR_materials_ior", &e);
    m->ior = gltf_number(r, &e.at, "ior", 1.5, 0.0, 100.0);
    /* The extension's 0 stands for an infinite index (full reflection). */
    if (m->ior < 1.0) m->ior = m->ior > 0.0 ? 1.0 : 100.0;
    gltf_extension_open(r, at, "KHR_materials_volume", &e);
    gltf_numbers(r, &e.at, "attenuationColor", 3, m->attenuation_color);
    m->attenuation_distance = gltf_number(r, &e.at, "attenuationDistance", INFINITY, 0.0, INFINITY);
}

static void read_material(gltf_reader *g, const gltf_at *at, size_t index)
{
    knurl_description_material *m = description_append_material(g->description);
    if (!m || !(m->name = gltf_name(g, at, "material", index))) {
        gltf_fail_memory(g, at, sizeof *m);
        return;
    }
    /* Displacement first: its coordinates shape the surface, the others only colour it. */
    uint32_t uv_set = UINT32_MAX;
    read_displacement(g, at, &uv_set, m);
    read_surface(g, at, &uv_set, m);
    read_extensions(g, at, m);
    g->uv_sets[index] = uv_set == UINT32_MAX ? 0 : uv_set;
}

void gltf_read_materials(gltf_reader *g)
{
    gltf_at materials = gltf_array(&g->report, &g->root, "materials");
    size_t count = gltf_count(&materials);
    g->uv_sets = knurl_alloc_zero(g->context, count * sizeof *g->uv_sets);
    if (!g->uv_sets) gltf_fail_memory(g, &materials, count);
    for (size_t i = 0; i < count && g->report.status == KNURL_OK; i++) {
        gltf_at at = gltf_element_object(&g->report, &materials, i);
        if (at.value) read_material(g, &at, i);
    }
    g->file_material_count = g->description->material_count;
}
