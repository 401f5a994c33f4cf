/* glTF 2.0: containers (.gltf, .glb), the checks that come first, and the order of reading. */
#include "io/gltf.h"

#include <string.h>

#include "data/description.h"
#include "io/scene.h"

enum { GLB_HEADER = 12, CHUNK_HEADER = 8 };
#define CHUNK_JSON 0x4e4f534au
#define CHUNK_BIN  0x004e4942u

static const char *const known_extensions[] = {
    "KHR_materials_displacement", "KHR_texture_transform", "KHR_materials_emissive_strength",
    "KHR_materials_transmission", "KHR_materials_ior",     "KHR_materials_volume",
    "KHR_lights_punctual",        "KHR_mesh_quantization",
};

static bool is_known(const char *name)
{
    for (size_t i = 0; i < sizeof known_extensions / sizeof *known_extensions; i++)
        if (strcmp(name, known_extensions[i]) == 0) return true;
    return false;
}

static uint32_t read_u32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* Finds the JSON and BIN chunks. */
static knurl_status open_glb(gltf_reader *g, const unsigned char *bytes, size_t size,
                             const unsigned char **json, size_t *json_size)
{
    const char *file = g->report.file;
    knurl_error *error = g->report.error;
    if (size < GLB_HEADER + CHUNK_HEADER)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: GLB of %zu bytes, expected at least %d", file, size,
                          GLB_HEADER + CHUNK_HEADER);
    uint32_t version = read_u32(bytes + 4), length = read_u32(bytes + 8);
    if (version != 2)
        return knurl_fail(error, KNURL_ERROR_UNSUPPORTED, "%s: GLB header: version %u, expected 2", file,
                          version);
    if (length > size)
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s: GLB header: length is %u, but the file ends after %zu bytes", file, length,
                          size);
    size_t at = GLB_HEADER;
    for (uint32_t chunk = 0; at + CHUNK_HEADER <= length; chunk++) {
        uint32_t chunk_length = read_u32(bytes + at), type = read_u32(bytes + at + 4);
        at += CHUNK_HEADER;
        if (chunk_length > length - at)
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "%s: GLB chunk %u: length is %u, expected at most %zu", file, chunk,
                              chunk_length, length - at);
        if (chunk == 0 && type != CHUNK_JSON)
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "%s: GLB chunk 0: type is 0x%08x, expected JSON (0x%08x)", file, type,
                              CHUNK_JSON);
        if (chunk == 0) {
            *json = bytes + at;
            *json_size = chunk_length;
        } else if (chunk == 1 && type == CHUNK_BIN) {
            g->binary = bytes + at;
            g->binary_size = chunk_length;
        }
        at += chunk_length;
    }
    if (!*json)
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s: GLB header: length is %u, expected room for a JSON chunk", file, length);
    return KNURL_OK;
}

static void check_version(gltf_reader *g)
{
    gltf_report *r = &g->report;
    gltf_at asset = gltf_object(r, &g->root, "asset");
    if (!asset.value) gltf_fail(r, &asset, KNURL_ERROR_INPUT, "not there, expected an object with a version");
    const char *version = gltf_string(r, &asset, "version", ""),
               *least = gltf_string(r, &asset, "minVersion", "2.0");
    gltf_at place = gltf_member(&asset, "version");
    if (strncmp(version, "2.", 2) != 0)
        gltf_fail(r, &place, KNURL_ERROR_UNSUPPORTED, "found \"%.20s\", expected 2.0", version);
    place = gltf_member(&asset, "minVersion");
    if (strcmp(least, "2.0") != 0)
        gltf_fail(r, &place, KNURL_ERROR_UNSUPPORTED, "found \"%.20s\", expected 2.0", least);
}

static void check_extensions(gltf_reader *g, const char *key, bool required)
{
    gltf_at list = gltf_array(&g->report, &g->root, key);
    for (size_t i = 0; i < gltf_count(&list) && g->report.status == KNURL_OK; i++) {
        gltf_at place = gltf_element(&list, i);
        const char *name = json_string_value(place.value);
        if (!name) {
            gltf_fail(&g->report, &place, KNURL_ERROR_INPUT, "expected a string");
        } else if (required && !is_known(name)) {
            gltf_fail(&g->report, &place, KNURL_ERROR_UNSUPPORTED,
                      "knurl does not know the required extension %.100s", name);
        } else if (!is_known(name)) {
            description_warn(g->description, "%s: extension %.100s is ignored", g->report.file, name);
        }
    }
}

static void read_document(gltf_reader *g)
{
    check_version(g);
    check_extensions(g, "extensionsRequired", true);
    check_extensions(g, "extensionsUsed", false);
    gltf_at animations = gltf_array(&g->report, &g->root, "animations");
    if (gltf_count(&animations))
        description_warn(g->description, "%s: animations are ignored", g->report.file);
    void (*const steps[])(gltf_reader *) = {gltf_read_buffers, gltf_read_images, gltf_read_materials,
                                            gltf_read_meshes, gltf_read_scene};
    for (size_t i = 0; i < sizeof steps / sizeof *steps && g->report.status == KNURL_OK; i++) steps[i](g);
}

knurl_status gltf_read(knurl_description *d, unsigned char *bytes, size_t size, bool files,
                       knurl_error *error)
{
    gltf_reader g = {.report = {KNURL_OK, error, d->path},
                     .description = d,
                     .context = d->context,
                     .files = files,
                     .budget = (UINT64_C(64) << 20) + 64 * (uint64_t)size};
    const unsigned char *text = NULL;
    size_t text_size = 0;
    if (size >= 4 && memcmp(bytes, "glTF", 4) == 0) {
        knurl_status status = open_glb(&g, bytes, size, &text, &text_size);
        if (status != KNURL_OK) return status;
    } else {
        bool mark = size >= 3 && memcmp(bytes, "\xef\xbb\xbf", 3) == 0;
        text = mark ? bytes + 3 : bytes;
        text_size = mark ? size - 3 : size;
    }
    json_error_t wrong;
    json_t *root = json_loadb((const char *)text, text_size, JSON_REJECT_DUPLICATES, &wrong);
    if (!root) {
        knurl_status status =
            json_error_code(&wrong) == json_error_out_of_memory ? KNURL_ERROR_MEMORY : KNURL_ERROR_INPUT;
        return knurl_fail(error, status, "%s:%d:%d: JSON: %s", d->path, wrong.line, wrong.column, wrong.text);
    }
    g.root = (gltf_at){.value = root};
    if (!json_is_object(root))
        (void)knurl_fail(error, g.report.status = KNURL_ERROR_INPUT, "%s: the JSON is not an object",
                         d->path);
    else
        read_document(&g);
    gltf_free_buffers(&g);
    knurl_free(g.context, g.uv_sets);
    knurl_free(g.context, g.mesh_ranges);
    json_decref(root);
    return g.report.status;
}
