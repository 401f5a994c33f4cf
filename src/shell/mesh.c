/* Copying and checking a base mesh; angle-weighted normals; seams. */
#include "shell/shell.h"

#include <float.h>
#include <string.h>

static knurl_status check_indices(const knurl_mesh_view *view, knurl_error *error)
{
    for (size_t i = 0; i < 3 * (size_t)view->triangle_count; i++)
        if (view->triangles[i] >= view->vertex_count)
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "triangle %zu: vertex index %u, expected less than %u", i / 3,
                              view->triangles[i], view->vertex_count);
    return KNURL_OK;
}

static knurl_status check_finite(const float *values, uint32_t count, int width, const char *what,
                                 knurl_error *error)
{
    for (size_t i = 0; values && i < (size_t)count * (size_t)width; i++)
        if (!isfinite(values[i]) || fabsf(values[i]) > 1e18f)
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "vertex %zu: %s component %zu is %g, expected a finite number below 1e18",
                              i / (size_t)width, what, i % (size_t)width, (double)values[i]);
    return KNURL_OK;
}

static uint32_t hash_position(const float *p)
{
    uint32_t h = 2166136261u;
    for (int i = 0; i < 3; i++) {
        float value = p[i] == 0.0f ? 0.0f : p[i]; /* -0 equals 0 */
        uint32_t bits;
        memcpy(&bits, &value, sizeof bits);
        h = (h ^ bits) * 16777619u;
        h ^= h >> 15;
    }
    return h;
}

static bool same_position(const float *a, const float *b)
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* first[v]: the lowest vertex at the same position as v (open addressing). */
static bool weld(knurl_context *context, const float *positions, uint32_t count, uint32_t *first)
{
    size_t capacity = 16;
    while (capacity < 2 * (size_t)count) capacity *= 2;
    uint32_t *table = knurl_alloc_array(context, capacity, sizeof *table);
    if (!table) return false;
    memset(table, 0xff, capacity * sizeof *table);
    for (uint32_t v = 0; v < count; v++) {
        size_t slot = hash_position(positions + 3 * (size_t)v) & (capacity - 1);
        while (table[slot] != UINT32_MAX &&
               !same_position(positions + 3 * (size_t)table[slot], positions + 3 * (size_t)v))
            slot = (slot + 1) & (capacity - 1);
        if (table[slot] == UINT32_MAX) table[slot] = v;
        first[v] = table[slot];
    }
    knurl_free(context, table);
    return true;
}

static double corner_angle(vec3 a, vec3 b)
{
    return atan2(v3_length(v3_cross(a, b)), v3_dot(a, b));
}

/* Angle-weighted face normals, summed over all vertices at one position (Thuermer and Wuethrich 1998). */
static void sum_normals(const base_mesh *mesh, const uint32_t *first, double *sums)
{
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *v = mesh->triangles + 3 * t;
        vec3 p[3];
        for (int i = 0; i < 3; i++) p[i] = v3_loadf(mesh->positions + 3 * (size_t)v[i]);
        vec3 normal = v3_normalize(v3_cross(v3_sub(p[1], p[0]), v3_sub(p[2], p[0])));
        for (int i = 0; i < 3; i++) {
            vec3 a = v3_sub(p[(i + 1) % 3], p[i]), b = v3_sub(p[(i + 2) % 3], p[i]);
            vec3 weighted = v3_scale(normal, corner_angle(a, b));
            double *sum = sums + 3 * (size_t)first[v[i]];
            sum[0] += weighted.x;
            sum[1] += weighted.y;
            sum[2] += weighted.z;
        }
    }
}

static void store_normal(float *out, vec3 n)
{
    out[0] = (float)n.x;
    out[1] = (float)n.y;
    out[2] = (float)n.z;
}

/* Unit normals from the given ones; where there is none, the smooth one; where that is zero too
 * (an isolated vertex, or faces that cancel), the y axis. */
static knurl_status make_normals(knurl_context *context, const float *given, base_mesh *mesh,
                                 uint64_t *replaced, knurl_error *error)
{
    size_t count = mesh->vertex_count;
    bool need = !given;
    *replaced = 0;
    for (size_t v = 0; given && v < count; v++) {
        vec3 n = v3_normalize(v3_loadf(given + 3 * v));
        bool good = v3_finite(n) && v3_dot(n, n) > 0.0;
        store_normal(mesh->normals + 3 * v, good ? n : v3(0.0, 0.0, 0.0));
        *replaced += !good;
        need |= !good;
    }
    if (!need) return KNURL_OK;
    uint32_t *first = knurl_alloc_array(context, count, sizeof *first);
    double *sums = knurl_alloc_array(context, 3 * count, sizeof *sums);
    bool good = first && sums && weld(context, mesh->positions, mesh->vertex_count, first);
    if (good) {
        memset(sums, 0, 3 * count * sizeof *sums);
        sum_normals(mesh, first, sums);
        for (size_t v = 0; v < count; v++) {
            float *out = mesh->normals + 3 * v;
            if (given && (out[0] != 0.0f || out[1] != 0.0f || out[2] != 0.0f)) continue;
            vec3 n = v3_normalize(v3_load(sums + 3 * (size_t)first[v]));
            store_normal(out, v3_dot(n, n) > 0.0 ? n : v3(0.0, 1.0, 0.0));
        }
    }
    knurl_free(context, first);
    knurl_free(context, sums);
    return good ? KNURL_OK : knurl_fail_memory(error, count * 28, "smooth normals");
}

static knurl_status copy_directions(const knurl_mesh_view *view, base_mesh *mesh, uint64_t *replaced,
                                    knurl_error *error)
{
    *replaced = 0;
    knurl_status status = check_finite(view->directions, view->vertex_count, 3, "direction", error);
    for (size_t v = 0; status == KNURL_OK && v < view->vertex_count; v++) {
        const float *d = view->directions + 3 * v;
        if (d[0] == 0.0f && d[1] == 0.0f && d[2] == 0.0f)
            status = knurl_fail(error, KNURL_ERROR_INPUT, "vertex %zu: direction is 0, expected a length", v);
    }
    if (status == KNURL_OK && view->vertex_count)
        memcpy(mesh->normals, view->directions, (size_t)view->vertex_count * 3 * sizeof(float));
    return status;
}

knurl_status base_mesh_copy(knurl_context *context, const knurl_mesh_view *view, base_mesh *mesh,
                            uint64_t *replaced_normals, knurl_error *error)
{
    *mesh = (base_mesh){.vertex_count = view->vertex_count, .triangle_count = view->triangle_count};
    if ((view->vertex_count && !view->positions) || (view->triangle_count && !view->triangles))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "mesh has counts but no positions or triangles");
    knurl_status status = check_indices(view, error);
    if (status == KNURL_OK) status = check_finite(view->positions, view->vertex_count, 3, "position", error);
    if (status == KNURL_OK) status = check_finite(view->texcoords, view->vertex_count, 2, "texcoord", error);
    if (status != KNURL_OK) return status;
    size_t vertices = view->vertex_count, corners = 3 * (size_t)view->triangle_count;
    mesh->positions = knurl_alloc_array(context, vertices, 3 * sizeof(float));
    mesh->normals = knurl_alloc_array(context, vertices, 3 * sizeof(float));
    mesh->texcoords = knurl_alloc_array(context, vertices, 2 * sizeof(float));
    mesh->triangles = knurl_alloc_array(context, corners, sizeof(uint32_t));
    if (!mesh->positions || !mesh->normals || !mesh->texcoords || !mesh->triangles) {
        base_mesh_free(context, mesh);
        return knurl_fail_memory(error, vertices * 32 + corners * 4, "a base mesh");
    }
    if (vertices) memcpy(mesh->positions, view->positions, vertices * 3 * sizeof(float));
    if (corners) memcpy(mesh->triangles, view->triangles, corners * sizeof(uint32_t));
    if (view->texcoords)
        memcpy(mesh->texcoords, view->texcoords, vertices * 2 * sizeof(float));
    else
        memset(mesh->texcoords, 0, vertices * 2 * sizeof(float));
    status = view->directions ? copy_directions(view, mesh, replaced_normals, error)
                              : make_normals(context, view->normals, mesh, replaced_normals, error);
    if (status != KNURL_OK) base_mesh_free(context, mesh);
    return status;
}

void base_mesh_free(knurl_context *context, base_mesh *mesh)
{
    knurl_free(context, mesh->positions);
    knurl_free(context, mesh->normals);
    knurl_free(context, mesh->texcoords);
    knurl_free(context, mesh->triangles);
    *mesh = (base_mesh){0};
}

/* An inner edge: its two welded ends, and the map coordinates there. */
typedef struct edge_entry {
    uint32_t low, high;
    vec2 uv[2];
    uint32_t uses;
} edge_entry;

/* Whether two coordinates read the same column of the map: repeat wraps by 1, mirrored repeat by 2. */
static bool same_coordinate(double a, double b, knurl_wrap wrap)
{
    double period = wrap == KNURL_WRAP_REPEAT ? 1.0 : 2.0, d = fabs(a - b);
    if (wrap != KNURL_WRAP_CLAMP) d = fabs(d - period * round(d / period));
    return d <= 4.0 * DBL_EPSILON * (fabs(a) + fabs(b));
}

static bool same_edge(const shell_space *space, const edge_entry *a, const edge_entry *b)
{
    bool same = true;
    for (int i = 0; i < 2; i++)
        same = same && same_coordinate(a->uv[i].x, b->uv[i].x, space->wrap_u) &&
               same_coordinate(a->uv[i].y, b->uv[i].y, space->wrap_v);
    return same;
}

static uint64_t add_edge(const shell_space *space, edge_entry *table, size_t capacity, const edge_entry *edge)
{
    size_t slot = (edge->low * 2654435761u ^ edge->high * 40503u * 65537u) & (capacity - 1);
    while (table[slot].uses && (table[slot].low != edge->low || table[slot].high != edge->high))
        slot = (slot + 1) & (capacity - 1);
    if (!table[slot].uses) {
        table[slot] = *edge;
        table[slot].uses = 1;
        return 0;
    }
    table[slot].uses++;
    return table[slot].uses == 2 && !same_edge(space, &table[slot], edge);
}

uint64_t shell_seam_edges(const shell_space *space)
{
    const base_mesh *mesh = &space->mesh;
    size_t capacity = 16;
    while (capacity < 6 * (size_t)mesh->triangle_count) capacity *= 2;
    uint32_t *first = knurl_alloc_array(space->context, mesh->vertex_count, sizeof *first);
    edge_entry *table = knurl_alloc_array(space->context, capacity, sizeof *table);
    uint64_t seams = 0;
    if (first && table && weld(space->context, mesh->positions, mesh->vertex_count, first)) {
        memset(table, 0, capacity * sizeof *table);
        for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++) {
            uint32_t v[2] = {mesh->triangles[i], mesh->triangles[i % 3 == 2 ? i - 2 : i + 1]};
            if (first[v[0]] > first[v[1]]) {
                uint32_t swap = v[0];
                v[0] = v[1];
                v[1] = swap;
            }
            edge_entry edge = {.low = first[v[0]], .high = first[v[1]]};
            for (int k = 0; k < 2; k++) {
                const float *st = mesh->texcoords + 2 * (size_t)v[k];
                edge.uv[k] = shell_uv(space, (double)st[0], (double)st[1]);
            }
            if (edge.low != edge.high) seams += add_edge(space, table, capacity, &edge);
        }
    }
    knurl_free(space->context, first);
    knurl_free(space->context, table);
    return seams;
}
