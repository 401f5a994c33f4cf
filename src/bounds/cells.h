/* bounds/cells.h: ranges of square cells of samples, the input of both bound structures. */
#ifndef KNURL_SRC_BOUNDS_CELLS_H
#define KNURL_SRC_BOUNDS_CELLS_H

#include "base/base.h"
#include "bounds/codes.h"
#include "data/height.h"
#include "data/levels.h"

/* A grid of ceil(width / B) x ceil(height / B) cells, B = 1 << shift. Cell k of an axis holds samples
 * kB to (k + 1)B, both included, so that it bounds the bilinear signal over [kB, (k + 1)B]. The last
 * cell ends at sample 0 of the next period instead, which repeated maps need and others only lose
 * tightness by. */
typedef struct cell_grid {
    int32_t width, height, shift;
    size_t stride; /* codes from row to row */
    uint32_t *codes;
} cell_grid;

/* How codes become heights: see codes.h. The range contains all samples. */
typedef struct cell_scale {
    double range_min, range_max;
    double step; /* float maps only */
} cell_scale;

/* The scale of a float map. */
cell_scale cell_scale_make(double range_min, double range_max);

/* Number of cells along an axis of `size` samples. */
static inline int32_t cell_count(int32_t size, int32_t shift)
{
    return (size + (1 << shift) - 1) >> shift;
}

/* Cells that hold any sample of a rectangle: `cells` gets up to four disjoint rectangles, since cells at
 * the far border hold samples of the near one. Returns how many. */
int32_t cell_holders(const height_level *level, int32_t shift, height_rect samples, height_rect cells[4]);

/* Makes the codes of `cells` from the samples. shift is at most 5. `scale` matters for float maps. */
void cell_grid_fold(knurl_context *context, const height_level *level, const cell_scale *scale,
                    const cell_grid *grid, height_rect cells);

/* Makes the codes of `cells` of a grid of twice the cell size: width = ceil(fine->width / 2), and so on. */
void cell_grid_reduce(knurl_context *context, const cell_grid *fine, const cell_grid *coarse,
                      height_rect cells);

#endif
