/* bake_glb_material.c: materials of a baked glTF file: factors, and the pictures of base colour, metal and
 * roughness where they are PNG or JPEG files, whose bytes are taken over. */
#include "bake_glb.h"
#include "json_file.h"

#include <stdlib.h>
#include <string.h>

static int *numbers(uint32_t count)
{
    int *array = malloc(((size_t)count + 1) * sizeof *array);
    for (uint32_t i = 0; array && i < count; i++) array[i] = -1;
    return array;
}

bool glb_begin(glb_document *g, const bake_job *job)
{
    const knurl_description *d = job->description;
    memset(g, 0, sizeof *g);
    g->job = job;
    g->meshes = numbers(d->mesh_count);
    g->materials = numbers(d->material_count);
    g->textures = numbers(d->image_count);
    g->order = malloc(((size_t)d->mesh_count + 1) * sizeof *g->order);
    g->images = calloc((size_t)d->image_count + 1, sizeof *g->images);
    return g->meshes && g->materials && g->textures && g->order && g->images;
}

void glb_end(glb_document *g)
{
    for (uint32_t i = 0; i < g->image_count; i++) free(g->images[i].bytes);
    free(g->images);
    free(g->meshes);
    free(g->materials);
    free(g->textures);
    free(g->order);
    json_decref(g->scene_nodes);
    json_decref(g->root);
}

/* The encoded bytes of an image; false if they cannot be had. */
static bool load_bytes(const knurl_description_image *from, glb_image *image)
{
    if (!from->path) {
        image->size = from->size;
        image->bytes = malloc(from->size + 1);
        if (image->bytes && from->size) memcpy(image->bytes, from->bytes, from->size);
        return image->bytes != NULL;
    }
    FILE *file = fopen(from->path, "rb");
    if (!file) return false;
    long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    if (size > 0 && fseek(file, 0, SEEK_SET) == 0) image->bytes = malloc((size_t)size);
    image->size = image->bytes ? fread(image->bytes, 1, (size_t)size, file) : 0;
    (void)fclose(file);
    return image->bytes && image->size == (size_t)size;
}

static bool recognise(glb_image *image)
{
    static const unsigned char png[] = {0x89, 'P', 'N', 'G'}, jpeg[] = {0xff, 0xd8, 0xff};
    image->png = image->size > 4 && memcmp(image->bytes, png, sizeof png) == 0;
    return image->png || (image->size > 4 && memcmp(image->bytes, jpeg, sizeof jpeg) == 0);
}

static json_t *list(glb_document *g, const char *key)
{
    if (!json_object_get(g->root, key)) (void)json_object_set_new(g->root, key, json_array());
    return json_object_get(g->root, key);
}

/* The picture of an image of the description, its number in g->images; -2 if it cannot be kept. */
static int find_image(glb_document *g, int32_t image)
{
    int *number = &g->textures[image];
    if (*number != -1) return *number;
    const knurl_description_image *from = &g->job->description->images[image];
    glb_image *made = &g->images[g->image_count];
    if (load_bytes(from, made) && recognise(made)) return *number = (int)g->image_count++;
    free(made->bytes);
    memset(made, 0, sizeof *made);
    session_note(g->job->session, "knurl: %s: is no PNG or JPEG file, so it is left out",
                 from->name ? from->name : "an image");
    return *number = -2;
}

static int wrap_code(knurl_wrap wrap)
{
    return wrap == KNURL_WRAP_CLAMP ? 33071 : wrap == KNURL_WRAP_MIRROR ? 33648 : 10497;
}

/* A texture reference, or NULL. */
static json_t *describe_texture(glb_document *g, const knurl_texture_ref *texture)
{
    if (texture->image < 0) return NULL;
    int source = find_image(g, texture->image);
    if (source < 0) return NULL;
    json_t *samplers = list(g, "samplers"), *textures = list(g, "textures");
    int filter = texture->nearest ? 9728 : 9729, index = (int)json_array_size(textures);
    (void)json_array_append_new(samplers,
                                json_pack("{s:i, s:i, s:i}", "magFilter", filter, "wrapS",
                                          wrap_code(texture->wrap_u), "wrapT", wrap_code(texture->wrap_v)));
    (void)json_array_append_new(textures, json_pack("{s:i, s:i}", "source", source, "sampler", index));
    json_t *reference = json_pack("{s:i}", "index", index);
    bool plain = texture->uv_offset[0] == 0.0 && texture->uv_offset[1] == 0.0 &&
                 texture->uv_scale[0] == 1.0 && texture->uv_scale[1] == 1.0 && texture->uv_rotation == 0.0;
    if (plain) return reference;
    (void)json_object_set_new(reference, "extensions",
                              json_pack("{s:{s:o, s:o, s:f}}", "KHR_texture_transform", "offset",
                                        json_numbers(texture->uv_offset, 2), "scale",
                                        json_numbers(texture->uv_scale, 2), "rotation",
                                        texture->uv_rotation));
    if (!json_object_get(g->root, "extensionsUsed"))
        (void)json_object_set_new(g->root, "extensionsUsed", json_pack("[s]", "KHR_texture_transform"));
    return reference;
}

int glb_material(glb_document *g, int32_t material)
{
    int *number = &g->materials[material];
    if (*number >= 0) return *number;
    static const char *const modes[] = {"OPAQUE", "MASK", "BLEND"};
    const knurl_description_material *m = &g->job->description->materials[material];
    json_t *surface = json_pack("{s:o, s:f, s:f}", "baseColorFactor", json_numbers(m->base_color, 4),
                                "metallicFactor", m->metallic, "roughnessFactor", m->roughness);
    json_t *texture = describe_texture(g, &m->base_color_texture);
    if (texture) (void)json_object_set_new(surface, "baseColorTexture", texture);
    texture = describe_texture(g, &m->metallic_roughness_texture);
    if (texture) (void)json_object_set_new(surface, "metallicRoughnessTexture", texture);
    json_t *made = json_pack("{s:o, s:o, s:b, s:s}", "name", json_text(m->name), "pbrMetallicRoughness",
                             surface, "doubleSided", (int)m->double_sided, "alphaMode", modes[m->alpha_mode]);
    if (m->alpha_mode == KNURL_ALPHA_MASK)
        (void)json_object_set_new(made, "alphaCutoff", json_real(m->alpha_cutoff));
    json_t *materials = list(g, "materials");
    *number = (int)json_array_size(materials);
    (void)json_array_append_new(materials, made);
    return *number;
}

void glb_images(glb_document *g)
{
    for (uint32_t i = 0; i < g->image_count; i++) {
        const glb_image *image = &g->images[i];
        int view = glb_view(g, image->size, 0, 0);
        (void)json_array_append_new(list(g, "images"), json_pack("{s:i, s:s}", "bufferView", view, "mimeType",
                                                                 image->png ? "image/png" : "image/jpeg"));
    }
}
