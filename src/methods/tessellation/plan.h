/* methods/tessellation/plan.h: how a whole surface is cut, and walking over its vertices. */
#ifndef KNURL_SRC_METHODS_TESSELLATION_PLAN_H
#define KNURL_SRC_METHODS_TESSELLATION_PLAN_H

#include "methods/tessellation/lattice.h"
#include "shell/evaluate.h"

/* Numbers run through the base triangles; empty shells have none. Immutable. */
typedef struct tessellation_plan {
    const shell_space *space;                /* not owned */
    height_lod lod;                          /* level 0 */
    double rate;                             /* vertices per texel along edges */
    lattice *lattices;                       /* per base triangle */
    uint64_t *first_vertex, *first_triangle; /* one more than base triangles: the last is the sum */
} tessellation_plan;

/* Lowers the rate until no more than `most` triangles are left (0: as many as it takes), which always
 * leaves at least one per base triangle. */
knurl_status plan_make(const shell_space *space, double rate, double most, tessellation_plan *plan,
                       knurl_error *error);
void plan_free(tessellation_plan *plan);
uint64_t plan_bytes(const tessellation_plan *plan);

static inline uint64_t plan_vertices(const tessellation_plan *plan)
{
    return plan->first_vertex[plan->space->mesh.triangle_count];
}
static inline uint64_t plan_triangles(const tessellation_plan *plan)
{
    return plan->first_triangle[plan->space->mesh.triangle_count];
}
/* The base triangle that a vertex number belongs to, of `count`, by their first vertices. */
uint32_t plan_base_of(const uint64_t *first, uint32_t count, uint64_t vertex);

/* One base triangle, loaded. */
typedef struct plan_piece {
    const tessellation_plan *plan;
    lattice lattice;
    uint32_t triangle;
    triangle_frame frame;
    shell_edge ab, ac, bc;
} plan_piece;

void plan_piece_load(const tessellation_plan *plan, uint32_t triangle, plan_piece *piece);
/* S at a vertex. */
vec3 plan_piece_point(const plan_piece *piece, lattice_code code);

/* A vertex on a walk. A lattice vertex with a cell has it on its side of larger i and j. */
typedef struct plan_vertex {
    const plan_piece *piece;
    uint64_t number; /* in the whole surface */
    lattice_code code;
    uint64_t above; /* number of the vertex (i, j + 1), if has_cell */
    uint64_t cell;  /* number of the cell in its base triangle */
    bool has_cell;
    bool starts_border; /* border vertex 0 */
} plan_vertex;

typedef void plan_visit_fn(void *user, const plan_vertex *vertex);
/* Visits vertices begin to end - 1 in order. */
void plan_walk(const tessellation_plan *plan, uint64_t begin, uint64_t end, plan_visit_fn *visit, void *user);

#endif
