/* Cutting a lattice's cells into rectangles for Embree's grids, each with vertices of its own.
 *
 * Bands of 16 rows give one rectangle as wide as their last row; what the band's lower half reaches beyond
 * it gives rectangles of 8 rows, and so on. Embree cuts grids into 2 x 2 cells itself, so that their shape
 * does not matter to it. */
#include "methods/tessellation/facets.h"

enum { BAND_ROWS = 16, MOST_COLUMNS = 256 };

typedef struct grid_rectangle {
    uint32_t i, j, columns, rows; /* in cells */
} grid_rectangle;

typedef void rectangle_fn(void *user, const grid_rectangle *r);

/* Cells of rows [j, j + rows) from column i on. */
static void cut_band(const lattice *l, uint32_t i, uint32_t j, uint32_t rows, rectangle_fn *emit, void *user)
{
    if (j + 1u >= l->n2) return;
    uint32_t width = lattice_last(l, j + rows);
    for (uint32_t at = i; at < width; at += MOST_COLUMNS) {
        uint32_t columns = width - at < MOST_COLUMNS ? width - at : MOST_COLUMNS;
        emit(user, &(grid_rectangle){at, j, columns, rows});
    }
    if (width > i) i = width;
    if (rows == 1) return;
    cut_band(l, i, j, rows / 2, emit, user);
    cut_band(l, i, j + rows / 2, rows / 2, emit, user);
}

static void cut_all(const lattice *l, rectangle_fn *emit, void *user)
{
    for (uint32_t j = 0; j + 1u < l->n2; j += BAND_ROWS) cut_band(l, 0, j, BAND_ROWS, emit, user);
}

static void count_rectangle(void *user, const grid_rectangle *r)
{
    facet_sizes *sizes = user;
    sizes->grids++;
    sizes->grid_vertices += (uint64_t)(r->columns + 1) * (r->rows + 1);
    sizes->subgrids += (uint64_t)((r->columns + 1) / 2) * ((r->rows + 1) / 2);
}

void grids_count(const lattice *l, facet_sizes *sizes)
{
    cut_all(l, count_rectangle, sizes);
}

typedef struct place_job {
    tessellation *t;
    uint32_t triangle;
    uint32_t grid, vertex;
} place_job;

static void place_rectangle(void *user, const grid_rectangle *r)
{
    place_job *job = user;
    job->t->grids[job->grid] =
        (native_grid){job->vertex, r->columns + 1, (uint16_t)(r->columns + 1), (uint16_t)(r->rows + 1)};
    job->t->grid_places[job->grid] = (facet_grid){job->triangle, (uint16_t)r->i, (uint16_t)r->j};
    job->grid++;
    job->vertex += (r->columns + 1) * (r->rows + 1);
}

static void fill_grid(const tessellation *t, const plan_piece *piece, size_t number)
{
    const native_grid *grid = &t->grids[number];
    const facet_grid *place = &t->grid_places[number];
    float *out = t->grid_vertices + 3 * (size_t)grid->first;
    for (uint32_t j = 0; j < grid->height; j++)
        for (uint32_t i = 0; i < grid->width; i++, out += 3) {
            lattice_code code = {(uint16_t)(place->i + i), (uint16_t)(place->j + j)};
            facets_store(&t->mesh, plan_piece_point(piece, code), out);
        }
}

static void fill_range(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const tessellation *t = user;
    plan_piece piece;
    for (size_t i = begin; i < end; i++) {
        uint32_t triangle = t->grid_places[i].triangle;
        if (i == begin || piece.triangle != triangle) plan_piece_load(&t->plan, triangle, &piece);
        fill_grid(t, &piece, i);
    }
}

knurl_status grids_fill(tessellation *t, const facet_sizes *sizes, knurl_error *error)
{
    knurl_context *context = t->plan.space->context;
    size_t bytes[3] = {sizes->grid_vertices * 12 + 4, sizes->grids * sizeof *t->grids,
                       sizes->grids * sizeof *t->grid_places};
    t->grid_vertices = knurl_alloc(context, bytes[0]);
    t->grids = knurl_alloc(context, bytes[1]);
    t->grid_places = knurl_alloc(context, bytes[2]);
    if (!t->grid_vertices || !t->grids || !t->grid_places)
        return knurl_fail_memory(error, bytes[0] + bytes[1] + bytes[2], "grids");
    t->grid_vertices[3 * sizes->grid_vertices] = 0.0f;
    t->bytes += bytes[0] + bytes[1] + bytes[2];
    place_job job = {.t = t};
    for (; job.triangle < t->plan.space->mesh.triangle_count; job.triangle++)
        if (t->plan.lattices[job.triangle].n1)
            cut_all(&t->plan.lattices[job.triangle], place_rectangle, &job);
    knurl_parallel_for(context, sizes->grids, 16, fill_range, t);
    native_part *part = &t->mesh.parts[t->mesh.part_count++];
    *part = (native_part){NATIVE_GRIDS, t->grid_vertices, (uint32_t)sizes->grid_vertices, t->grids,
                          (uint32_t)sizes->grids};
    return KNURL_OK;
}
