/* Primitives of glTF files. Accessors are read here: assimp turns v around twice (1 - (1 - v) loses
 * bits) and drops what the messages need to name. */
#include <stdio.h>
#include <string.h>

#include "data/description.h"
#include "io/gltf.h"

enum { MODE_TRIANGLES = 4, MODE_STRIP = 5, MODE_FAN = 6, UNSIGNED_INT = 5125, FLOAT = 5126 };

/* What a primitive is made of, before vertices that no triangle uses are left out. */
typedef struct primitive {
    gltf_accessor position, normal, texcoord, direction, index;
    bool has_normal, has_texcoord, has_direction, has_index;
    uint64_t mode;
    uint32_t *corners; /* 3 per triangle */
    size_t triangle_count;
} primitive;

/* Opens the accessor that member `key` of `at` names; false if there is none or after an error. */
static bool open_member(gltf_reader *g, const gltf_at *at, const char *key, uint32_t components, size_t count,
                        gltf_accessor *accessor)
{
    gltf_report *r = &g->report;
    if (!gltf_member(at, key).value) return false;
    gltf_at accessors = gltf_array(r, &g->root, "accessors");
    int64_t index = gltf_index(r, at, key, gltf_count(&accessors), true);
    if (r->status != KNURL_OK || index < 0) return false;
    gltf_at place = gltf_element_object(r, &accessors, (size_t)index);
    if (!gltf_open_accessor(g, &place, accessor)) return false;
    gltf_at from = gltf_member(at, key);
    if (accessor->components != components)
        gltf_fail(r, &from, KNURL_ERROR_INPUT, "accessor %lld has %u components, expected %u",
                  (long long)index, accessor->components, components);
    else if (count && accessor->count != count)
        gltf_fail(r, &from, KNURL_ERROR_INPUT, "accessor %lld has %zu elements, expected %zu as POSITION",
                  (long long)index, accessor->count, count);
    return r->status == KNURL_OK;
}

static void check_index_type(gltf_reader *g, const gltf_at *at, const gltf_accessor *a)
{
    if (a->type == 5121 || a->type == 5123 || a->type == UNSIGNED_INT) return;
    gltf_at place = gltf_member(at, "indices");
    gltf_fail(&g->report, &place, KNURL_ERROR_INPUT,
              "componentType of the accessor is %u, expected 5121, 5123 or 5125", a->type);
}

/* Our own attribute, so that no other type need be read: lengths count, and integers would round them. */
static void check_direction_type(gltf_reader *g, const gltf_at *attributes, const gltf_accessor *a)
{
    if (a->type == FLOAT) return;
    gltf_at place = gltf_member(attributes, "_DIRECTION");
    gltf_fail(&g->report, &place, KNURL_ERROR_INPUT, "componentType of the accessor is %u, expected 5126",
              a->type);
}

static void open_primitive(gltf_reader *g, const gltf_at *at, uint32_t uv_set, primitive *p)
{
    gltf_report *r = &g->report;
    gltf_at attributes = gltf_object(r, at, "attributes");
    if (!open_member(g, &attributes, "POSITION", 3, 0, &p->position)) return;
    p->has_normal = open_member(g, &attributes, "NORMAL", 3, p->position.count, &p->normal);
    char key[32];
    (void)snprintf(key, sizeof key, "TEXCOORD_%u", uv_set);
    if (uv_set != 0 && !gltf_member(&attributes, key).value && r->status == KNURL_OK) {
        char pointer[256];
        description_warn(g->description, "%s: %s has no %s; TEXCOORD_0 is used", r->file,
                         gltf_pointer(&attributes, pointer, sizeof pointer), key);
        (void)snprintf(key, sizeof key, "TEXCOORD_0");
    }
    p->has_texcoord = open_member(g, &attributes, key, 2, p->position.count, &p->texcoord);
    p->has_direction = open_member(g, &attributes, "_DIRECTION", 3, p->position.count, &p->direction);
    if (p->has_direction) check_direction_type(g, &attributes, &p->direction);
    p->has_index = open_member(g, at, "indices", 1, 0, &p->index);
    if (p->has_index) check_index_type(g, at, &p->index);
}

/* Triangle i of a strip or fan, or three indices in a row. */
static void triangle_corners(uint64_t mode, size_t i, size_t corner[3])
{
    if (mode == MODE_TRIANGLES) {
        for (size_t c = 0; c < 3; c++) corner[c] = 3 * i + c;
    } else if (mode == MODE_STRIP) {
        corner[0] = i;
        corner[1] = i + 1 + i % 2;
        corner[2] = i + 2 - i % 2;
    } else {
        corner[0] = i + 1;
        corner[1] = i + 2;
        corner[2] = 0;
    }
}

static void make_triangles(gltf_reader *g, const gltf_at *at, primitive *p)
{
    size_t n = p->has_index ? p->index.count : p->position.count;
    p->triangle_count = p->mode == MODE_TRIANGLES ? n / 3 : n < 3 ? 0 : n - 2;
    size_t bytes = p->triangle_count * 3 * sizeof(uint32_t) + n * sizeof(uint32_t);
    if (!gltf_take(g, at, bytes)) return;
    uint32_t *indices = knurl_alloc_array(g->context, n, sizeof *indices);
    p->corners = knurl_alloc_array(g->context, p->triangle_count * 3, sizeof(uint32_t));
    if (!indices || !p->corners) {
        knurl_free(g->context, indices);
        gltf_fail_memory(g, at, bytes);
        return;
    }
    if (p->has_index)
        gltf_accessor_indices(&p->index, indices);
    else
        for (size_t i = 0; i < n; i++) indices[i] = (uint32_t)i;
    for (size_t i = 0; i < p->triangle_count && g->report.status == KNURL_OK; i++) {
        size_t corner[3];
        triangle_corners(p->mode, i, corner);
        for (size_t c = 0; c < 3; c++) {
            uint32_t index = indices[corner[c]];
            p->corners[3 * i + c] = index;
            if (index >= p->position.count) {
                gltf_at place = gltf_member(at, "indices");
                gltf_fail(&g->report, &place, KNURL_ERROR_INPUT, "index %zu is %u, expected less than %zu",
                          corner[c], index, p->position.count);
                break;
            }
        }
    }
    if (p->mode == MODE_TRIANGLES && n % 3 != 0) {
        char pointer[256];
        description_warn(g->description, "%s: %s: %zu indices, not a multiple of 3; the last are left out",
                         g->report.file, gltf_pointer(at, pointer, sizeof pointer), n);
    }
    knurl_free(g->context, indices);
}

/* Rows of `width` floats whose `number` is not UINT32_MAX, in order. Null if out of memory. */
static float *used_rows(gltf_reader *g, const gltf_accessor *a, const uint32_t *number, size_t used)
{
    size_t width = a->components;
    float *all = knurl_alloc_array(g->context, a->count, width * sizeof *all);
    if (!all) return NULL;
    gltf_accessor_floats(a, all);
    if (used == a->count) return all;
    float *rows = knurl_alloc_array(g->context, used, width * sizeof *rows);
    for (size_t i = 0; rows && i < a->count; i++)
        if (number[i] != UINT32_MAX) memcpy(rows + number[i] * width, all + i * width, width * sizeof *rows);
    knurl_free(g->context, all);
    return rows;
}

/* Fills the mesh with the vertices that triangles use, in the file's order. Primitives that share one
 * set of vertices would else carry all of it each. */
static void fill_mesh(gltf_reader *g, const gltf_at *at, primitive *p, knurl_description_mesh *mesh)
{
    size_t n = p->position.count, row = (p->has_direction ? 11 : 8) * sizeof(float);
    if (!gltf_take(g, at, n * row)) return;
    uint32_t *number = knurl_alloc_array(g->context, n, sizeof *number);
    if (!number) {
        gltf_fail_memory(g, at, n * sizeof *number);
        return;
    }
    memset(number, 0xff, n * sizeof *number);
    for (size_t i = 0; i < 3 * p->triangle_count; i++) number[p->corners[i]] = 0;
    uint32_t used = 0;
    for (size_t i = 0; i < n; i++)
        if (number[i] == 0) number[i] = used++;
    for (size_t i = 0; i < 3 * p->triangle_count; i++) p->corners[i] = number[p->corners[i]];
    mesh->vertex_count = used;
    mesh->triangle_count = (uint32_t)p->triangle_count;
    mesh->triangles = p->corners;
    p->corners = NULL;
    mesh->positions = used_rows(g, &p->position, number, used);
    if (p->has_normal) mesh->normals = used_rows(g, &p->normal, number, used);
    if (p->has_texcoord) mesh->texcoords = used_rows(g, &p->texcoord, number, used);
    if (p->has_direction) mesh->directions = used_rows(g, &p->direction, number, used);
    if (!mesh->positions || (p->has_normal && !mesh->normals) || (p->has_texcoord && !mesh->texcoords) ||
        (p->has_direction && !mesh->directions))
        gltf_fail_memory(g, at, n * row);
    knurl_free(g->context, number);
    /* What unused vertices would have taken was not taken after all; one byte each pays for the time
     * that went into them. */
    g->budget += (n - used) * (row - 1);
}

static void warn_left_out(gltf_reader *g, const gltf_at *at, bool *warned, const char *what)
{
    char pointer[256];
    if (!*warned)
        description_warn(g->description, "%s: %s: %s", g->report.file,
                         gltf_pointer(at, pointer, sizeof pointer), what);
    *warned = true;
}

static void read_primitive(gltf_reader *g, const gltf_at *at, const char *mesh_name, size_t index,
                           size_t count)
{
    gltf_report *r = &g->report;
    primitive p = {.mode = gltf_integer(r, at, "mode", MODE_TRIANGLES, 6)};
    int64_t material = gltf_index(r, at, "material", g->file_material_count, false);
    if (r->status != KNURL_OK) return;
    if (p.mode < MODE_TRIANGLES) {
        warn_left_out(g, at, &g->warned_primitives, "points and lines are left out");
        return;
    }
    if (gltf_member(at, "targets").value) warn_left_out(g, at, &g->warned_morph, "morph targets are ignored");
    gltf_extension draco;
    gltf_extension_open(r, at, "KHR_draco_mesh_compression", &draco);
    open_primitive(g, at, material < 0 ? 0 : g->uv_sets[material], &p);
    if (r->status != KNURL_OK) return;
    if (p.position.count == 0) {
        warn_left_out(g, at, &g->warned_primitives, "a primitive without POSITION is left out");
        return;
    }
    knurl_description_mesh *mesh = description_append_mesh(g->description);
    if (mesh)
        mesh->name = count > 1 ? knurl_format(g->context, "%s/%zu", mesh_name, index)
                               : knurl_strdup(g->context, mesh_name);
    if (!mesh || !mesh->name) {
        gltf_fail_memory(g, at, sizeof *mesh);
        return;
    }
    mesh->material = (int32_t)material;
    make_triangles(g, at, &p);
    if (r->status == KNURL_OK) fill_mesh(g, at, &p, mesh);
    knurl_free(g->context, p.corners);
    if (r->status == KNURL_OK && mesh->triangle_count == 0) {
        warn_left_out(g, at, &g->warned_primitives, "a primitive without triangles is left out");
        description_clear_mesh(g->context, mesh);
        g->description->mesh_count--;
    }
}

static void read_mesh(gltf_reader *g, const gltf_at *at, size_t index)
{
    gltf_mesh_range *range = &g->mesh_ranges[index];
    range->first = g->description->mesh_count;
    char *name = gltf_name(g, at, "mesh", index);
    if (!name) {
        gltf_fail_memory(g, at, 64);
        return;
    }
    gltf_at primitives = gltf_array(&g->report, at, "primitives");
    size_t count = gltf_count(&primitives);
    for (size_t i = 0; i < count && g->report.status == KNURL_OK; i++) {
        gltf_at primitive_at = gltf_element_object(&g->report, &primitives, i);
        if (primitive_at.value) read_primitive(g, &primitive_at, name, i, count);
    }
    knurl_free(g->context, name);
    range->count = g->description->mesh_count - range->first;
}

void gltf_read_meshes(gltf_reader *g)
{
    gltf_at meshes = gltf_array(&g->report, &g->root, "meshes");
    size_t count = gltf_count(&meshes);
    g->mesh_ranges = knurl_alloc_zero(g->context, count * sizeof *g->mesh_ranges);
    if (!g->mesh_ranges) gltf_fail_memory(g, &meshes, count * sizeof *g->mesh_ranges);
    g->mesh_range_count = count;
    for (size_t i = 0; i < count && g->report.status == KNURL_OK; i++) {
        gltf_at at = gltf_element_object(&g->report, &meshes, i);
        if (at.value) read_mesh(g, &at, i);
    }
}
