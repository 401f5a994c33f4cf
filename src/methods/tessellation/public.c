/* knurl/tessellation.h. */
#include "methods/method.h"
#include "methods/tessellation/plan.h"

#include <knurl/tessellation.h>

#include <string.h>

struct knurl_tessellation {
    knurl_surface *surface;
    tessellation_plan plan;
};

static const double LEAST_RATE = 0.001, MOST_RATE = 64.0;

knurl_tessellation_def knurl_tessellation_def_default(void)
{
    return (knurl_tessellation_def){.cookie = KNURL_COOKIE, .rate = 1.0};
}

knurl_status knurl_tessellation_create(knurl_surface *surface, const knurl_tessellation_def *def,
                                       knurl_tessellation **out, knurl_error *error)
{
    if (!out) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "tessellation is NULL");
    *out = NULL;
    if (!surface || !def || def->cookie != KNURL_COOKIE)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "surface is NULL, or the definition was not made by "
                          "knurl_tessellation_def_default()");
    if (!(def->rate >= LEAST_RATE && def->rate <= MOST_RATE))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "tessellation rate is %g, expected %g to %g",
                          def->rate, LEAST_RATE, MOST_RATE);
    const shell_space *space = knurl_surface_space(surface);
    knurl_tessellation *made = knurl_alloc_zero(space->context, sizeof *made);
    if (!made) return knurl_fail_memory(error, sizeof *made, "a tessellation");
    made->surface = knurl_surface_retain(surface);
    knurl_status status = plan_make(space, def->rate, (double)def->max_triangles, &made->plan, error);
    if (status == KNURL_OK && plan_vertices(&made->plan) >= UINT32_MAX)
        status =
            knurl_fail(error, KNURL_ERROR_LIMIT,
                       "tessellation: %.0f vertices at rate %g, expected fewer than 2^32 - 1; lower the rate",
                       (double)plan_vertices(&made->plan), made->plan.rate);
    if (status != KNURL_OK) {
        knurl_tessellation_release(made);
        return status;
    }
    *out = made;
    return KNURL_OK;
}

void knurl_tessellation_release(knurl_tessellation *t)
{
    if (!t) return;
    knurl_surface *surface = t->surface;
    plan_free(&t->plan);
    knurl_free(knurl_surface_space(surface)->context, t);
    knurl_surface_release(surface);
}

double knurl_tessellation_rate(const knurl_tessellation *t)
{
    return t->plan.rate;
}

uint64_t knurl_tessellation_vertices(const knurl_tessellation *t)
{
    return plan_vertices(&t->plan);
}

uint64_t knurl_tessellation_triangles(const knurl_tessellation *t)
{
    return plan_triangles(&t->plan);
}

static uint32_t clamp_base(const knurl_tessellation *t, uint32_t base)
{
    uint32_t count = t->plan.space->mesh.triangle_count;
    return base < count ? base : count;
}

uint64_t knurl_tessellation_first_vertex(const knurl_tessellation *t, uint32_t base)
{
    return t->plan.first_vertex[clamp_base(t, base)];
}

uint64_t knurl_tessellation_first_triangle(const knurl_tessellation *t, uint32_t base)
{
    return t->plan.first_triangle[clamp_base(t, base)];
}

typedef struct vertex_job {
    const knurl_tessellation *t;
    uint64_t begin;
    double *positions;
    float *normals, *texcoords;
} vertex_job;

static void store_vertex(void *user, const plan_vertex *v)
{
    const vertex_job *job = user;
    const plan_piece *piece = v->piece;
    const tessellation_plan *plan = piece->plan;
    size_t at = (size_t)(v->number - job->begin);
    if (job->positions) v3_store(job->positions + 3 * at, plan_piece_point(piece, v->code));
    if (!job->normals && !job->texcoords) return;
    double b[2];
    shell_root root;
    knurl_hit hit;
    const knurl_ray ray = {.direction = {0.0}}; /* matters to the error bound only */
    lattice_barycentrics(&piece->lattice, v->code, b);
    shell_root_at(plan->space, &plan->lod, &piece->frame, b[0], b[1], 0.0, &root);
    shell_hit_fill(plan->space, &plan->lod, &piece->frame, piece->triangle, &ray, &root, &hit);
    for (size_t i = 0; job->normals && i < 3; i++) job->normals[3 * at + i] = (float)hit.ns[i];
    for (size_t i = 0; job->texcoords && i < 2; i++) job->texcoords[2 * at + i] = (float)hit.st[i];
}

static void store_range(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const vertex_job *job = user;
    plan_walk(&job->t->plan, job->begin + begin, job->begin + end, store_vertex, user);
}

void knurl_tessellation_get_vertices(const knurl_tessellation *t, uint64_t begin, uint64_t count,
                                     double *positions, float *normals, float *texcoords)
{
    uint64_t all = plan_vertices(&t->plan);
    if (begin >= all) return;
    if (count > all - begin) count = all - begin;
    vertex_job job = {t, begin, positions, normals, texcoords};
    knurl_parallel_for(t->plan.space->context, count, 2048, store_range, &job);
}

/* Triangles [begin, end) of one base triangle, cells first; `first` is its first vertex. */
typedef struct index_job {
    const lattice *l;
    uint32_t first;
    uint64_t begin, end, next; /* next: number of the stitch about to come */
    uint32_t *out;
} index_job;

static void store_stitch(void *user, const lattice_corner corners[3])
{
    index_job *job = user;
    uint64_t number = job->next++;
    if (number < job->begin || number >= job->end) return;
    for (int i = 0; i < 3; i++) *job->out++ = job->first + (uint32_t)lattice_number(job->l, corners[i].code);
}

/* One of the two triangles of each cell in [begin, end) / 2. */
static void store_cells(index_job *job)
{
    const lattice *l = job->l;
    uint32_t row = lattice_row_of_cell(l, job->begin / 2);
    uint64_t row_first = lattice_cells_before(l, row), vertex = job->first + lattice_row(l, row);
    for (uint64_t at = job->begin; at < job->end; row++) {
        uint32_t cells = lattice_last(l, row + 1), above = lattice_last(l, row) + 1;
        for (; at < job->end && at / 2 < row_first + cells; at++, job->out += 3) {
            uint32_t v00 = (uint32_t)(vertex + (at / 2 - row_first)), v01 = v00 + above;
            const uint32_t pair[6] = {v00, v00 + 1, v01, v01 + 1, v01, v00 + 1};
            memcpy(job->out, pair + 3 * (at % 2), 3 * sizeof *pair);
        }
        row_first += cells;
        vertex += above;
    }
}

static void store_triangles(const knurl_tessellation *t, uint32_t base, uint64_t begin, uint64_t end,
                            uint32_t *out)
{
    const lattice *l = &t->plan.lattices[base];
    uint64_t cells = 2 * lattice_cells(l);
    index_job job = {.l = l, .first = (uint32_t)t->plan.first_vertex[base], .begin = begin, .out = out};
    job.end = end < cells ? end : cells;
    if (job.begin < job.end) store_cells(&job);
    job.end = end;
    job.next = cells;
    if (end > cells) lattice_stitch(l, store_stitch, &job);
}

void knurl_tessellation_get_triangles(const knurl_tessellation *t, uint64_t begin, uint64_t count,
                                      uint32_t *indices)
{
    uint64_t all = plan_triangles(&t->plan);
    if (begin >= all) return;
    uint64_t end = count < all - begin ? begin + count : all;
    uint32_t bases = t->plan.space->mesh.triangle_count;
    const uint64_t *first = t->plan.first_triangle;
    for (uint32_t base = plan_base_of(first, bases, begin); begin < end; base++) {
        uint64_t stop = first[base + 1] < end ? first[base + 1] : end;
        if (stop <= begin) continue;
        store_triangles(t, base, begin - first[base], stop - first[base], indices);
        indices += 3 * (stop - begin);
        begin = stop;
    }
}
