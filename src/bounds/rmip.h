/* bounds/rmip.h: the rectangular minmax image pyramid (RMIP). Layout and proofs are in rmip.c. */
#ifndef KNURL_SRC_BOUNDS_RMIP_H
#define KNURL_SRC_BOUNDS_RMIP_H

#include "bounds/cells.h"

enum { RMIP_MAX_LAYERS = 17 }; /* windows of 1 to 65,536 cells */

/* One axis: windows of 2^p cells start at multiples of 2^rmip_spacing(p), at entries base[p] onwards. */
typedef struct rmip_axis {
    int32_t cells, layers;
    uint32_t base[RMIP_MAX_LAYERS + 1]; /* the last is the number of entries */
} rmip_axis;

typedef struct rmip_table {
    rmip_axis x, y;
    int32_t shift; /* a cell is 1 << shift texels */
    size_t stride; /* entries from row to row */
    uint32_t *codes;
    size_t bytes; /* all that the table holds */
} rmip_table;

/* Room for the table of a grid of cells, whose ranges then go into rmip_cells(); rmip_fill() does the rest,
 * and again after cells changed. */
knurl_status rmip_create(knurl_context *context, int32_t width, int32_t height, int32_t shift,
                         rmip_table **table, knurl_error *error);
void rmip_fill(knurl_context *context, rmip_table *table);
void rmip_destroy(knurl_context *context, rmip_table *table);

/* Windows of one cell come first on both axes: they are the cells. */
static inline cell_grid rmip_cells(const rmip_table *table)
{
    return (cell_grid){table->x.cells, table->y.cells, table->shift, table->stride, table->codes};
}

/* log2 of the distance between windows of 2^p cells. */
static inline int32_t rmip_spacing(int32_t p)
{
    return p > 2 ? p - 2 : 0;
}

/* Entries of two windows that cover cells [first, last] (rmip.c, proofs 1 to 3). */
static inline void rmip_windows(const rmip_axis *axis, int32_t first, int32_t last, size_t entry[2])
{
    /* w - 1 = last - first; smallest p with w <= 2^(p+1) - s(p) + 1, that is 4 (w - 1) <= 7 * 2^p. */
    uint32_t span = (uint32_t)(last - first);
    int32_t p = 31 - __builtin_clz(span | 1u);
    p += 4 * span > 7u << p;
    int32_t spacing = rmip_spacing(p), second = last + 1 - (1 << p);
    second = second > 0 ? second + (1 << spacing) - 1 : 0;
    entry[0] = axis->base[p] + (size_t)(first >> spacing);
    entry[1] = axis->base[p] + (size_t)(second >> spacing);
}

/* Adds to the running union the bound of texel cells [x0, x1] x [y0, y1]: Eq. 5. */
static inline void rmip_query(const rmip_table *table, int32_t x0, int32_t x1, int32_t y0, int32_t y1,
                              uint32_t *high, uint32_t *low)
{
    size_t column[2], row[2];
    rmip_windows(&table->x, x0 >> table->shift, x1 >> table->shift, column);
    rmip_windows(&table->y, y0 >> table->shift, y1 >> table->shift, row);
    const uint32_t *top = table->codes + row[0] * table->stride,
                   *bottom = table->codes + row[1] * table->stride;
    const uint32_t found[4] = {top[column[0]], top[column[1]], bottom[column[0]], bottom[column[1]]};
    for (int32_t i = 0; i < 4; i++) {
        *high = found[i] > *high ? found[i] : *high;
        *low = (found[i] & 0xffffu) > *low ? found[i] & 0xffffu : *low;
    }
}

#endif
