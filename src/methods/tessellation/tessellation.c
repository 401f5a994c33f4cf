/* What users do today: the surface cut into triangles, quads or grids at a chosen rate, for Embree.
 *
 * Vertices lie on S, to the last bit of a float relative to the object's size. Neighbours share the vertices
 * on their edge bit for bit wherever both sides read the same texels and normals; elsewhere S itself is
 * open, and so is the tessellation. */
#include "methods/method.h"
#include "methods/tessellation/facets.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const knurl_method_parameter PARAMETERS[] = {
    {"primitive", "what Embree gets; grids take the least memory", 0.0, 0.0, 2.0, "triangles|quads|grids",
     false},
    {"rate", "vertices per texel along edges", 1.0, 0.001, 64.0, NULL, false},
    {"budget", "most triangles in millions, reached by lowering the rate; 0: none", 0.0, 0.0, 1e6, NULL,
     false},
    {0}};

/* Bytes that Embree 3.13 was measured to hold at most while it builds its hierarchy, per primitive (for
 * grids: per 2 x 2 cells). */
static const double BUILD_BYTES[3] = {128.0, 160.0, 160.0};

/* Memory of the machine that is free or can be freed, in bytes; 0 if it cannot be told. */
static double free_memory(void)
{
    double found = 0.0;
    FILE *file = fopen("/proc/meminfo", "r");
    char line[256];
    unsigned long long kilobytes;
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, "MemAvailable: %llu", &kilobytes) == 1) found = 1024.0 * (double)kilobytes;
    if (file) (void)fclose(file);
    if (found == 0.0) found = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    return found;
}

static double bytes_needed(const facet_sizes *sizes, native_kind kind)
{
    double vertices = (double)sizes->vertices * 16.0,
           primitives = (double)sizes->primitives * (kind == NATIVE_QUADS ? 16.0 : 12.0);
    double own = vertices + primitives + (double)sizes->grid_vertices * 12.0 + (double)sizes->grids * 20.0;
    if (kind == NATIVE_GRIDS)
        return own + (double)sizes->primitives * BUILD_BYTES[NATIVE_TRIANGLES] +
               (double)sizes->subgrids * BUILD_BYTES[NATIVE_GRIDS];
    return own + (double)sizes->primitives * BUILD_BYTES[kind];
}

static knurl_status check_memory(const tessellation_plan *plan, const facet_sizes *sizes, native_kind kind,
                                 knurl_error *error)
{
    static const double GIB = 1024.0 * 1024.0 * 1024.0;
    knurl_context *context = plan->space->context;
    double needed = bytes_needed(sizes, kind), limit = (double)knurl_context_get_def(context)->memory_limit;
    double used = (double)knurl_context_bytes(context), triangles = (double)plan_triangles(plan);
    if (limit > 0.0 && used + needed > limit)
        return knurl_fail(error, KNURL_ERROR_MEMORY,
                          "method tessellation: %.0f triangles need %.0f bytes (%.2f GiB), but of the memory "
                          "limit of %.0f bytes only %.0f are left; lower the rate (now %g)",
                          triangles, needed, needed / GIB, limit, max_d(limit - used, 0.0), plan->rate);
    double machine = free_memory();
    if (machine > 0.0 && needed > machine)
        return knurl_fail(error, KNURL_ERROR_MEMORY,
                          "method tessellation: %.0f triangles need %.0f bytes (%.2f GiB), but the machine "
                          "has only %.0f (%.2f GiB) available; lower the rate (now %g)",
                          triangles, needed, needed / GIB, machine, machine / GIB, plan->rate);
    uint64_t most = UINT32_MAX - 1;
    if (sizes->vertices > most || sizes->primitives > most || sizes->grid_vertices > most)
        return knurl_fail(error, KNURL_ERROR_LIMIT,
                          "method tessellation: %.0f triangles, expected under 2^32 vertices and primitives; "
                          "lower the rate (now %g)",
                          triangles, plan->rate);
    return KNURL_OK;
}

/* All vertices are in their shells, so the shells bound them. */
static void find_bounds(const shell_space *space, native_mesh *mesh)
{
    mesh->lower = v3(INFINITY, INFINITY, INFINITY);
    mesh->upper = v3_neg(mesh->lower);
    for (uint32_t t = 0; t < space->mesh.triangle_count; t++) {
        double lower[3], upper[3];
        if (!shell_box(space, t, lower, upper)) continue;
        mesh->lower = v3_min(mesh->lower, v3_load(lower));
        mesh->upper = v3_max(mesh->upper, v3_load(upper));
    }
    mesh->centre = v3(0.0, 0.0, 0.0);
    mesh->scale = 1.0;
    if (mesh->lower.x <= mesh->upper.x) facets_set_frame(mesh);
}

static knurl_status tessellation_build(const shell_space *space, const double *values, void **data,
                                       knurl_error *error)
{
    tessellation *t = knurl_alloc_zero(space->context, sizeof *t);
    *data = t;
    if (!t) return knurl_fail_memory(error, sizeof *t, "method tessellation");
    native_kind kind = (native_kind)values[0];
    find_bounds(space, &t->mesh);
    knurl_status status = plan_make(space, values[1], 1e6 * values[2], &t->plan, error);
    if (status != KNURL_OK) return status;
    facet_sizes sizes = facets_sizes(&t->plan, kind);
    status = check_memory(&t->plan, &sizes, kind, error);
    if (status == KNURL_OK && sizes.primitives > 0) status = facets_fill(t, kind, &sizes, error);
    if (status == KNURL_OK && sizes.grids > 0) status = grids_fill(t, &sizes, error);
    if (status != KNURL_OK || !(values[2] > 0.0)) return status;
    if ((double)plan_triangles(&t->plan) > 1e6 * values[2])
        knurl_log(space->context, KNURL_LOG_WARNING,
                  "method tessellation: the base mesh alone has more triangles than the budget of %g million",
                  values[2]);
    else if (t->plan.rate < values[1])
        knurl_log(space->context, KNURL_LOG_INFO, "method tessellation: rate %g keeps to the budget",
                  t->plan.rate);
    return status;
}

static void tessellation_destroy(const shell_space *space, void *data)
{
    tessellation *t = data;
    knurl_context *context = space->context;
    plan_free(&t->plan);
    knurl_free(context, t->facets.vertices);
    knurl_free(context, t->facets.codes);
    knurl_free(context, t->facets.indices);
    knurl_free(context, t->grid_vertices);
    knurl_free(context, t->grids);
    knurl_free(context, t->grid_places);
    knurl_free(context, t->stitch_first);
    knurl_free(context, t);
}

static uint64_t tessellation_bytes(const void *data)
{
    const tessellation *t = data;
    uint64_t count = t->plan.space ? t->plan.space->mesh.triangle_count : 0;
    return sizeof *t + t->bytes + (t->plan.space ? plan_bytes(&t->plan) : 0) +
           (t->stitch_first ? (count + 1) * sizeof *t->stitch_first : 0);
}

/* Callers that go from shell to shell themselves get the surface that the facets stand for. */
static bool tessellation_intersect(const void *data, const method_query *q)
{
    (void)data;
    return shell_subdivide(q->space, q->lod, KNURL_BOUNDS_MINMAX, q->frame, q->ray, q->any, q->root,
                           q->steps);
}

static const native_mesh *tessellation_native(const void *data)
{
    return &((const tessellation *)data)->mesh;
}

/* Weights of a triangle's or quad's vertices, as Embree parametrises them: a quad is the triangles 0 1 3 and
 * 2 3 1. */
static void corner_weights(bool quad, double u, double v, double weight[4])
{
    bool far = quad && u + v > 1.0;
    weight[0] = far ? 0.0 : 1.0 - u - v;
    weight[1] = far ? 1.0 - v : u;
    weight[2] = far ? u + v - 1.0 : quad ? 0.0 : v;
    weight[3] = far ? 1.0 - u : quad ? v : 0.0;
}

static void locate_facet(const tessellation *t, const native_part *part, const native_hit *hit,
                         native_place *place)
{
    const facets *f = &t->facets;
    bool quad = part->kind == NATIVE_QUADS;
    size_t corners = quad ? 4 : 3;
    const uint32_t *index = f->indices + corners * hit->primitive;
    place->triangle = plan_base_of(f->first_vertex, t->plan.space->mesh.triangle_count, index[0]);
    const lattice *l = &t->plan.lattices[place->triangle];
    double weight[4];
    corner_weights(quad, (double)hit->u, (double)hit->v, weight);
    place->b1 = place->b2 = 0.0;
    for (size_t i = 0; i < corners; i++) {
        double b[2];
        lattice_barycentrics(l, f->codes[index[i]], b);
        place->b1 += weight[i] * b[0];
        place->b2 += weight[i] * b[1];
    }
}

/* A grid is affine in its base triangle, so its u and v are enough. */
static void locate_grid(const tessellation *t, const native_hit *hit, native_place *place)
{
    const native_grid *grid = &t->grids[hit->primitive];
    const facet_grid *at = &t->grid_places[hit->primitive];
    const lattice *l = &t->plan.lattices[at->triangle];
    double weight[3];
    weight[1] = ((double)at->i + (double)hit->u * (double)(grid->width - 1)) / (double)l->n1;
    weight[2] = ((double)at->j + (double)hit->v * (double)(grid->height - 1)) / (double)l->n2;
    weight[0] = 1.0 - weight[1] - weight[2];
    place->triangle = at->triangle;
    place->b1 = weight[(4u - l->corner) % 3u];
    place->b2 = weight[(5u - l->corner) % 3u];
}

static void tessellation_locate(const void *data, const native_hit *hit, native_place *place)
{
    const tessellation *t = data;
    const native_part *part = &t->mesh.parts[hit->part];
    if (part->kind == NATIVE_GRIDS)
        locate_grid(t, hit, place);
    else
        locate_facet(t, part, hit, place);
    /* u and v are floats: near an edge they may step over it. */
    place->b1 = min_d(max_d(place->b1, 0.0), 1.0);
    place->b2 = min_d(max_d(place->b2, 0.0), 1.0 - place->b1);
}

const method method_tessellation = {
    .name = "tessellation",
    .summary = "triangles, quads or grids at a chosen rate, traced by Embree (what users do today)",
    .flags = KNURL_METHOD_NATIVE,
    .parameters = PARAMETERS,
    .build = tessellation_build,
    .intersect = tessellation_intersect,
    .bytes = tessellation_bytes,
    .destroy = tessellation_destroy,
    .native = tessellation_native,
    .locate = tessellation_locate,
};
