/* capture_gltf.c: the glTF document of a capture. */
#include "capture.h"
#include "capture_gltf.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FLOAT = 5126, UNSIGNED_INT = 5125, VERTICES = 34962, INDICES = 34963, LINEAR = 9729, CLAMP = 33071 };

void capture_put(capture_gltf *g, json_t *object, const char *key, json_t *value)
{
    if (json_object_set_new(object, key, value) != 0) g->failed = true;
}

void capture_push(capture_gltf *g, json_t *array, json_t *value)
{
    if (json_array_append_new(array, value) != 0) g->failed = true;
}

json_t *capture_numbers(capture_gltf *g, const double *values, int count)
{
    json_t *array = json_array();
    for (int i = 0; i < count; i++) capture_push(g, array, json_real(values[i]));
    return array;
}

int capture_append(capture_gltf *g, const char *key, json_t *value)
{
    json_t *array = json_object_get(g->root, key);
    if (!array) {
        capture_put(g, g->root, key, json_array());
        array = json_object_get(g->root, key);
    }
    capture_push(g, array, value);
    return (int)json_array_size(array) - 1;
}

json_t *capture_add_node(capture_gltf *g, const char *name, const double axes[3][3], const double origin[3])
{
    double matrix[16] = {[15] = 1};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) matrix[4 * k + i] = axes[k][i];
        matrix[12 + i] = origin[i];
    }
    json_t *node = json_object();
    capture_put(g, node, "name", json_string(name));
    capture_put(g, node, "matrix", capture_numbers(g, matrix, 16));
    int index = capture_append(g, "nodes", node);
    capture_push(g, g->nodes, json_integer(index));
    return node;
}

static int add_view(capture_gltf *g, const void *data, size_t size, int target)
{
    capture_document *d = g->document;
    unsigned char *grown = realloc(d->bytes, d->size + size);
    if (!grown) {
        g->failed = true;
        return 0;
    }
    d->bytes = grown;
    memcpy(d->bytes + d->size, data, size);
    json_t *view = json_pack("{s:i, s:I, s:I, s:i}", "buffer", 0, "byteOffset", (json_int_t)d->size,
                             "byteLength", (json_int_t)size, "target", target);
    d->size += size;
    return capture_append(g, "bufferViews", view);
}

static int add_accessor(capture_gltf *g, int view, int type, const char *shape, uint32_t count)
{
    return capture_append(g, "accessors",
                          json_pack("{s:i, s:i, s:I, s:s}", "bufferView", view, "componentType", type,
                                    "count", (json_int_t)count, "type", shape));
}

/* glTF wants the range of POSITION. */
static void add_range(capture_gltf *g, int accessor, const float *positions, uint32_t count)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * (size_t)count; i++) {
        low[i % 3] = fmin(low[i % 3], (double)positions[i]);
        high[i % 3] = fmax(high[i % 3], (double)positions[i]);
    }
    json_t *entry = json_array_get(json_object_get(g->root, "accessors"), (size_t)accessor);
    capture_put(g, entry, "min", capture_numbers(g, low, 3));
    capture_put(g, entry, "max", capture_numbers(g, high, 3));
}

static int add_mesh(capture_gltf *g, const capture_base *base, const char *name, int material)
{
    size_t n = base->vertex_count, row = 3 * sizeof(float);
    int position =
        add_accessor(g, add_view(g, base->positions, n * row, VERTICES), FLOAT, "VEC3", base->vertex_count);
    add_range(g, position, base->positions, base->vertex_count);
    int direction =
        add_accessor(g, add_view(g, base->directions, n * row, VERTICES), FLOAT, "VEC3", base->vertex_count);
    int texcoord = add_accessor(g, add_view(g, base->texcoords, n * 2 * sizeof(float), VERTICES), FLOAT,
                                "VEC2", base->vertex_count);
    uint32_t corners = 3 * base->triangle_count;
    int indices = add_accessor(g, add_view(g, base->triangles, corners * sizeof(uint32_t), INDICES),
                               UNSIGNED_INT, "SCALAR", corners);
    return capture_append(g, "meshes",
                          json_pack("{s:s, s:[{s:{s:i, s:i, s:i}, s:i, s:i}]}", "name", name, "primitives",
                                    "attributes", "POSITION", position, "_DIRECTION", direction, "TEXCOORD_0",
                                    texcoord, "indices", indices, "material", material));
}

static json_t *texture_info(capture_gltf *g, const char *file)
{
    int image = capture_append(g, "images", json_pack("{s:s}", "uri", file));
    int texture = capture_append(g, "textures", json_pack("{s:i, s:i}", "source", image, "sampler", 0));
    return json_pack("{s:i}", "index", texture);
}

static bool has_holes(const capture_view *view, const capture_maps *maps)
{
    size_t count = (size_t)view->color_width * (size_t)view->color_height;
    for (size_t i = 0; i < count; i++)
        if (maps->colors[4 * i + 3] < 255) return true;
    return false;
}

bool capture_has_surfaces(const capture_result *result)
{
    return result->roughness[1] - result->roughness[0] > 1e-6 ||
           result->metallic[1] - result->metallic[0] > 1e-6;
}

static int add_material(capture_gltf *g, const capture_options *options, const capture_result *result, int k,
                        const char *name)
{
    const capture_view *view = &result->views[k];
    char file[64];
    bool surfaces = capture_has_surfaces(result);
    capture_file_name(options, view, "color", file);
    json_t *color = texture_info(g, file);
    capture_file_name(options, view, "height", file);
    json_t *height = texture_info(g, file);
    json_t *material = json_pack(
        "{s:s, s:{s:o, s:f, s:f}, s:b, s:{s:{s:o, s:f, s:f}}}", "name", name, "pbrMetallicRoughness",
        "baseColorTexture", color, "metallicFactor", surfaces ? 1.0 : result->metallic[0], "roughnessFactor",
        surfaces ? 1.0 : result->roughness[0], "doubleSided", 1, "extensions", "KHR_materials_displacement",
        "displacementGeometryTexture", height, "displacementGeometryFactor", result->factor,
        "displacementGeometryOffset", result->offset);
    if (surfaces) {
        capture_file_name(options, view, "surface", file);
        capture_put(g, json_object_get(material, "pbrMetallicRoughness"), "metallicRoughnessTexture",
                    texture_info(g, file));
    }
    if (has_holes(view, &result->maps[k])) {
        capture_put(g, material, "alphaMode", json_string("MASK"));
        capture_put(g, material, "alphaCutoff", json_real(0.5));
    }
    return capture_append(g, "materials", material);
}

static void add_capture(capture_gltf *g, const capture_options *options, capture_result *result, int k)
{
    const capture_view *view = &result->views[k];
    if (result->maps[k].hits == 0) return;
    char name[64];
    (void)snprintf(name, sizeof name, "relief%s%s", view->name[0] ? "-" : "", view->name);
    capture_base base;
    if (!capture_base_make(view, &result->maps[k], options->cell, &base)) {
        g->failed = true;
        return;
    }
    if (base.triangle_count > 0) {
        int material = add_material(g, options, result, k, name);
        int mesh = add_mesh(g, &base, name, material);
        double axes[3][3];
        memcpy(axes[0], view->right, sizeof axes[0]);
        memcpy(axes[1], view->up, sizeof axes[1]);
        memcpy(axes[2], view->out, sizeof axes[2]);
        json_t *node = capture_add_node(g, name, (const double(*)[3])axes, view->origin);
        capture_put(g, node, "mesh", json_integer(mesh));
        result->triangles += base.triangle_count;
    }
    capture_base_release(&base);
}

static void finish(capture_gltf *g)
{
    capture_put(g, g->root, "scene", json_integer(0));
    capture_append(g, "scenes", json_pack("{s:O}", "nodes", g->nodes));
    capture_append(g, "samplers",
                   json_pack("{s:i, s:i, s:i, s:i}", "magFilter", LINEAR, "minFilter", LINEAR, "wrapS", CLAMP,
                             "wrapT", CLAMP));
    json_t *used = json_array();
    capture_push(g, used, json_string("KHR_materials_displacement"));
    if (g->lights) {
        capture_push(g, used, json_string("KHR_lights_punctual"));
        capture_put(g, g->root, "extensions",
                    json_pack("{s:{s:O}}", "KHR_lights_punctual", "lights", g->lights));
    }
    capture_put(g, g->root, "extensionsUsed", used);
    capture_append(
        g, "buffers",
        json_pack("{s:s, s:I}", "uri", "capture.bin", "byteLength", (json_int_t)g->document->size));
}

bool capture_document_make(const capture_options *options, const loaded_scene *loaded, capture_result *result,
                           capture_document *document)
{
    *document = (capture_document){0};
    capture_gltf g = {.root = json_object(), .nodes = json_array(), .document = document};
    result->triangles = 0;
    capture_put(&g, g.root, "asset",
                json_pack("{s:s, s:s}", "version", "2.0", "generator", "knurl " KNURL_VERSION_STRING));
    for (int k = 0; k < result->count; k++) add_capture(&g, options, result, k);
    capture_add_cameras(&g, loaded);
    capture_add_lights(&g, loaded->description);
    finish(&g);
    /* 17 digits give every double back: faces of a cube must meet exactly. */
    if (!g.failed) document->text = json_dumps(g.root, JSON_INDENT(2) | JSON_REAL_PRECISION(17));
    json_decref(g.lights);
    json_decref(g.nodes);
    json_decref(g.root);
    if (document->text && document->bytes) return true;
    free(document->text);
    free(document->bytes);
    *document = (capture_document){0};
    return false;
}
