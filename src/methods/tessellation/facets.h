/* methods/tessellation/facets.h: the arrays that the method tessellation keeps. */
#ifndef KNURL_SRC_METHODS_TESSELLATION_FACETS_H
#define KNURL_SRC_METHODS_TESSELLATION_FACETS_H

#include "methods/native.h"
#include "methods/tessellation/plan.h"

/* Triangles or quads (which hold stitches as triangles, their last vertex twice). */
typedef struct facets {
    float *vertices;
    lattice_code *codes;
    uint32_t *indices;
    const uint64_t *first_vertex; /* per base triangle, and the sum */
} facets;

/* Where a grid is in its base triangle. */
typedef struct facet_grid {
    uint32_t triangle;
    uint16_t i, j;
} facet_grid;

typedef struct tessellation {
    native_mesh mesh;
    tessellation_plan plan;
    facets facets; /* everything, or what grids leave: the stitches */
    /* Grids only. */
    float *grid_vertices;
    native_grid *grids;
    facet_grid *grid_places;
    uint64_t *stitch_first; /* facets.first_vertex points here */
    uint64_t bytes;
} tessellation;

/* How much a tessellation takes. */
typedef struct facet_sizes {
    uint64_t vertices, primitives;           /* of `facets` */
    uint64_t grid_vertices, grids, subgrids; /* a subgrid is 2 x 2 cells or less */
} facet_sizes;

/* The centre and scale for a box. */
void facets_set_frame(native_mesh *mesh);
void facets_store(const native_mesh *mesh, vec3 p, float *out);

facet_sizes facets_sizes(const tessellation_plan *plan, native_kind kind);
knurl_status facets_fill(tessellation *t, native_kind kind, const facet_sizes *sizes, knurl_error *error);

/* Grids (grids.c). Sums over one base triangle; and making them all. */
void grids_count(const lattice *l, facet_sizes *sizes);
knurl_status grids_fill(tessellation *t, const facet_sizes *sizes, knurl_error *error);

#endif
