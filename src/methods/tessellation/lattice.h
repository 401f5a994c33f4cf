/* methods/tessellation/lattice.h: how one base triangle is cut: counts and numbers, no geometry.
 *
 * Corner A faces the longest edge (in texels). AB is cut into n1 pieces, AC into n2, BC into n3, counts that
 * follow from the edges alone, so that neighbours agree. Vertices are
 *   lattice (i, j): A + i / n1 (B - A) + j / n2 (C - A), for j < n2 and i up to lattice_last(j): those that
 *                   lie at least half a cell inside BC, with all of AB and AC but B and C;
 *   border k:       B + k / n3 (C - B), k from 0 to n3,
 * numbered row by row, then along the border. Cells with four lattice vertices become two triangles each;
 * the stair that the lattice ends in is stitched to the border. With a right angle at A that makes two
 * triangles per texel at one vertex per texel; in general 1 / sin A times as many. */
#ifndef KNURL_SRC_METHODS_TESSELLATION_LATTICE_H
#define KNURL_SRC_METHODS_TESSELLATION_LATTICE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { LATTICE_MOST = 65535, LATTICE_BORDER = 65535 };

/* A triangle without vertices has n1 = 0. */
typedef struct lattice {
    uint16_t n1, n2, n3; /* n3 >= n1, n2 */
    uint16_t corner;     /* which of the base triangle's vertices is A */
} lattice;

/* A vertex: i and j, or k and LATTICE_BORDER. */
typedef struct lattice_code {
    uint16_t i, j;
} lattice_code;

/* Largest i in row j; 0 for rows past the last. */
static inline uint32_t lattice_last(const lattice *l, uint32_t j)
{
    if (j >= l->n2) return 0;
    uint32_t margin = (l->n1 < l->n2 ? l->n1 : l->n2) / 2u;
    if (margin == 0) margin = 1;
    return ((uint32_t)l->n1 * l->n2 - margin - j * l->n1) / l->n2;
}

/* Number of the first vertex of row j <= n2; the border begins at row n2. */
uint64_t lattice_row(const lattice *l, uint32_t j);
/* The row that a lattice vertex number is in. */
uint32_t lattice_row_of(const lattice *l, uint64_t vertex);
/* Cells in rows before row j. */
uint64_t lattice_cells_before(const lattice *l, uint32_t j);
/* The row that a cell number is in. */
uint32_t lattice_row_of_cell(const lattice *l, uint64_t cell);

static inline uint64_t lattice_vertices(const lattice *l)
{
    return l->n1 ? lattice_row(l, l->n2) + l->n3 + 1u : 0;
}
/* Triangles of the stitching alone. */
static inline uint64_t lattice_stitches(const lattice *l)
{
    return l->n1 ? (uint64_t)l->n1 + l->n2 + l->n3 - 2u : 0;
}
static inline uint64_t lattice_cells(const lattice *l)
{
    return l->n1 ? lattice_cells_before(l, l->n2) : 0;
}
static inline uint64_t lattice_number(const lattice *l, lattice_code code)
{
    return code.j == LATTICE_BORDER ? lattice_row(l, l->n2) + code.i : lattice_row(l, code.j) + code.i;
}

/* Weights of the base triangle's vertices 1 and 2. */
void lattice_barycentrics(const lattice *l, lattice_code code, double b[2]);

/* A corner of a stitch: besides its code its place in the stair (from B's side, all of them
 * lattice_stair() many) or, for border vertices, behind it. */
typedef struct lattice_corner {
    lattice_code code;
    uint32_t place;
} lattice_corner;
static inline uint32_t lattice_stair(const lattice *l)
{
    return (uint32_t)l->n1 + l->n2 - 1u;
}

/* Calls back for every stitching triangle, wound like the base triangle. */
typedef void lattice_stitch_fn(void *user, const lattice_corner corners[3]);
void lattice_stitch(const lattice *l, lattice_stitch_fn *emit, void *user);

#endif
