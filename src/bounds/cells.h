/* bounds/cells.h: ranges of square cells of samples, the input of both bound structures. */
#ifndef KNURL_SRC_BOUNDS_CELLS_H
#define KNURL_SRC_BOUNDS_CELLS_H

#include "base/base.h"
#include "bounds/codes.h"
#include "data/height.h"

/* A grid of ceil(width / B) x ceil(height / B) cells, B = 1 << shift. Cell k of an axis holds samples
 * kB to (k + 1)B, both included, so that it bounds the bilinear signal over [kB, (k + 1)B]. The last
 * cell ends at sample 0 of the next period instead, which repeated maps need and others only lose
 * tightness by. */
typedef struct cell_grid {
    int32_t width, height, shift;
    uint32_t *codes;
} cell_grid;

/* How codes become heights, and the exact range of all samples. */
typedef struct cell_scale {
    double range_min, range_max;
    double step; /* float maps only */
} cell_scale;

/* Cells of 1 << shift samples of a level; *grid owns its codes. shift is at most 5. */
knurl_status cell_grid_build(knurl_context *context, const height_level *level, int32_t shift,
                             cell_grid *grid, cell_scale *scale, knurl_error *error);

/* Cells of twice the size: width = ceil(fine->width / 2), and so on. `codes` has room for them. */
void cell_grid_reduce(knurl_context *context, const cell_grid *fine, cell_grid *coarse, uint32_t *codes);

/* Number of cells along an axis of `size` samples. */
static inline int32_t cell_count(int32_t size, int32_t shift)
{
    return (size + (1 << shift) - 1) >> shift;
}

#endif
