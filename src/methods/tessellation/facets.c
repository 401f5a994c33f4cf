/* Filling vertex and index arrays, in parallel over vertices: each writes its own cell. */
#include "methods/tessellation/facets.h"

#include <string.h>

enum { VERTICES_PER_CHUNK = 8192 };

void facets_set_frame(native_mesh *mesh)
{
    vec3 middle = v3_mad(v3_scale(mesh->lower, 0.5), 0.5, mesh->upper);
    mesh->centre = v3((double)to_float(middle.x), (double)to_float(middle.y), (double)to_float(middle.z));
    vec3 half = v3_max(v3_sub(mesh->upper, mesh->centre), v3_sub(mesh->centre, mesh->lower));
    int exponent = 0;
    double radius = v3_length(half);
    (void)frexp(radius, &exponent);
    mesh->scale = radius > 0.0 ? ldexp(1.0, exponent < -1000 ? 1000 : -exponent) : 1.0;
}

void facets_store(const native_mesh *mesh, vec3 p, float *out)
{
    vec3 q = v3_scale(v3_sub(p, mesh->centre), mesh->scale);
    out[0] = to_float(q.x);
    out[1] = to_float(q.y);
    out[2] = to_float(q.z);
}

facet_sizes facets_sizes(const tessellation_plan *plan, native_kind kind)
{
    facet_sizes sizes = {0};
    if (kind == NATIVE_TRIANGLES) {
        sizes.vertices = plan_vertices(plan);
        sizes.primitives = plan_triangles(plan);
        return sizes;
    }
    for (uint32_t t = 0; t < plan->space->mesh.triangle_count; t++) {
        const lattice *l = &plan->lattices[t];
        if (l->n1 == 0) continue;
        if (kind == NATIVE_GRIDS) {
            grids_count(l, &sizes);
            sizes.vertices += lattice_stair(l) + l->n3 + 1u;
            sizes.primitives += lattice_stitches(l);
        } else {
            sizes.vertices += lattice_vertices(l);
            sizes.primitives += lattice_cells(l) + lattice_stitches(l);
        }
    }
    return sizes;
}

typedef struct fill_job {
    tessellation *t;
    bool quads;
    uint64_t *first; /* primitive of each base triangle */
} fill_job;

/* Stitches of one base triangle, behind its cells. */
typedef struct stitch_job {
    const fill_job *job;
    const plan_piece *piece;
    uint64_t first; /* vertex */
    uint32_t *out;
    bool by_place; /* vertices are numbered by their place, and written with the stitches */
} stitch_job;

static void write_stitch(void *user, const lattice_corner corners[3])
{
    stitch_job *s = user;
    for (int i = 0; i < 3; i++)
        *s->out++ =
            (uint32_t)(s->first + (s->by_place ? corners[i].place
                                               : lattice_number(&s->piece->lattice, corners[i].code)));
    if (!s->job->quads) return;
    s->out[0] = s->out[-1];
    s->out++;
}

static void write_cell(const fill_job *job, const plan_vertex *v, uint32_t triangle)
{
    uint32_t v00 = (uint32_t)v->number, v10 = v00 + 1, v01 = (uint32_t)v->above, v11 = v01 + 1;
    if (job->quads) {
        const uint32_t quad[4] = {v00, v10, v11, v01};
        memcpy(job->t->facets.indices + 4 * (job->first[triangle] + v->cell), quad, sizeof quad);
        return;
    }
    const uint32_t pair[6] = {v00, v10, v01, v11, v01, v10}; /* as Embree cuts a quad */
    memcpy(job->t->facets.indices + 3 * (job->first[triangle] + 2 * v->cell), pair, sizeof pair);
}

static void write_vertex(const fill_job *job, const plan_piece *piece, uint64_t number, lattice_code code)
{
    facets_store(&job->t->mesh, plan_piece_point(piece, code), job->t->facets.vertices + 3 * number);
    job->t->facets.codes[number] = code;
}

static void fill_vertex(void *user, const plan_vertex *v)
{
    const fill_job *job = user;
    const plan_piece *piece = v->piece;
    write_vertex(job, piece, v->number, v->code);
    if (v->has_cell) write_cell(job, v, piece->triangle);
    if (!v->starts_border) return;
    stitch_job s = {.job = job, .piece = piece, .first = job->t->facets.first_vertex[piece->triangle]};
    uint64_t first = job->first[piece->triangle], cells = lattice_cells(&piece->lattice);
    s.out = job->t->facets.indices + (job->quads ? 4 * (first + cells) : 3 * (first + 2 * cells));
    lattice_stitch(&piece->lattice, write_stitch, &s);
}

static void fill_range(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const fill_job *job = user;
    plan_walk(&job->t->plan, begin, end, fill_vertex, user);
}

/* ---- the stitches alone, beside grids ---- */

static void write_strip(void *user, const lattice_corner corners[3])
{
    stitch_job *s = user;
    /* A step of the stair brings its first corner, a step of the border its last. */
    const lattice_corner *fresh = &corners[corners[1].code.j == LATTICE_BORDER ? 2 : 0];
    write_vertex(s->job, s->piece, s->first + fresh->place, fresh->code);
    write_stitch(s, corners);
}

static void strip_range(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const fill_job *job = user;
    const tessellation *t = job->t;
    for (size_t triangle = begin; triangle < end; triangle++) {
        const lattice *l = &t->plan.lattices[triangle];
        if (l->n1 == 0) continue;
        plan_piece piece;
        plan_piece_load(&t->plan, (uint32_t)triangle, &piece);
        stitch_job s = {.job = job, .piece = &piece, .first = t->stitch_first[triangle], .by_place = true};
        s.out = t->facets.indices + 3 * job->first[triangle];
        write_vertex(job, &piece, s.first, (lattice_code){(uint16_t)lattice_last(l, 0), 0});
        write_vertex(job, &piece, s.first + lattice_stair(l), (lattice_code){0, LATTICE_BORDER});
        lattice_stitch(l, write_strip, &s);
    }
}

/* ---- all of it ---- */

/* First primitive of each base triangle, and for strips the first vertex. */
static knurl_status number_primitives(tessellation *t, native_kind kind, uint64_t **first, knurl_error *error)
{
    const tessellation_plan *plan = &t->plan;
    uint32_t count = plan->space->mesh.triangle_count;
    size_t bytes = ((size_t)count + 1) * sizeof **first;
    *first = knurl_alloc(plan->space->context, bytes);
    if (kind == NATIVE_GRIDS) t->stitch_first = knurl_alloc(plan->space->context, bytes);
    if (!*first || (kind == NATIVE_GRIDS && !t->stitch_first))
        return knurl_fail_memory(error, 2 * bytes, "facet numbers");
    uint64_t primitives = 0, vertices = 0, per_cell = kind == NATIVE_TRIANGLES ? 2 : kind == NATIVE_QUADS;
    for (uint32_t i = 0; i <= count; i++) {
        (*first)[i] = primitives;
        if (t->stitch_first) t->stitch_first[i] = vertices;
        if (i == count) break;
        const lattice *l = &plan->lattices[i];
        primitives += per_cell * lattice_cells(l) + lattice_stitches(l);
        if (l->n1) vertices += lattice_stair(l) + l->n3 + 1u;
    }
    return KNURL_OK;
}

static knurl_status allocate(tessellation *t, native_kind kind, const facet_sizes *sizes, knurl_error *error)
{
    knurl_context *context = t->plan.space->context;
    facets *f = &t->facets;
    size_t per_primitive = kind == NATIVE_QUADS ? 16 : 12;
    size_t bytes[3] = {sizes->vertices * 12 + 4, sizes->vertices * sizeof *f->codes,
                       sizes->primitives * per_primitive};
    f->vertices = knurl_alloc(context, bytes[0]);
    f->codes = knurl_alloc(context, bytes[1]);
    f->indices = knurl_alloc(context, bytes[2]);
    if (!f->vertices || !f->codes || !f->indices)
        return knurl_fail_memory(error, bytes[0] + bytes[1] + bytes[2], "facets");
    f->vertices[3 * sizes->vertices] = 0.0f; /* Embree reads 16 bytes at the last vertex */
    t->bytes += bytes[0] + bytes[1] + bytes[2];
    return KNURL_OK;
}

knurl_status facets_fill(tessellation *t, native_kind kind, const facet_sizes *sizes, knurl_error *error)
{
    knurl_context *context = t->plan.space->context;
    fill_job job = {.t = t, .quads = kind == NATIVE_QUADS};
    knurl_status status = allocate(t, kind, sizes, error);
    if (status == KNURL_OK) status = number_primitives(t, kind, &job.first, error);
    if (status == KNURL_OK) {
        t->facets.first_vertex = t->stitch_first ? t->stitch_first : t->plan.first_vertex;
        if (kind == NATIVE_GRIDS)
            knurl_parallel_for(context, t->plan.space->mesh.triangle_count, 16, strip_range, &job);
        else
            knurl_parallel_for(context, plan_vertices(&t->plan), VERTICES_PER_CHUNK, fill_range, &job);
        native_part *part = &t->mesh.parts[t->mesh.part_count++];
        *part = (native_part){kind == NATIVE_QUADS ? NATIVE_QUADS : NATIVE_TRIANGLES, t->facets.vertices,
                              (uint32_t)sizes->vertices, t->facets.indices, (uint32_t)sizes->primitives};
    }
    knurl_free(context, job.first);
    return status;
}
