/* bounds/minmax.h: the minmax pyramid. */
#ifndef KNURL_SRC_BOUNDS_MINMAX_H
#define KNURL_SRC_BOUNDS_MINMAX_H

#include "bounds/cells.h"

enum { MINMAX_MAX_LEVELS = 17 }; /* 65,536 cells to 1 */

/* Level 0 holds one range code per cell, level l + 1 the unions of 2 x 2 of level l (sizes rounded up,
 * down to 1 x 1), one after the other, row-major. */
typedef struct minmax_pyramid {
    int32_t level_count, shift; /* a cell is 1 << shift texels */
    int32_t width[MINMAX_MAX_LEVELS], height[MINMAX_MAX_LEVELS];
    size_t offset[MINMAX_MAX_LEVELS];
    uint32_t *codes;
    size_t bytes; /* all that the pyramid holds */
} minmax_pyramid;

/* From cells of 1 << shift samples, shift at most 5. */
knurl_status minmax_build(knurl_context *context, const height_level *level, int32_t shift,
                          const cell_scale *scale, minmax_pyramid **pyramid, knurl_error *error);
/* Brings up to date what depends on a rectangle of samples. */
void minmax_update(knurl_context *context, minmax_pyramid *pyramid, const height_level *level,
                   const cell_scale *scale, height_rect samples);
void minmax_destroy(knurl_context *context, minmax_pyramid *pyramid);

/* The cells of one level. */
static inline cell_grid minmax_level(const minmax_pyramid *pyramid, int32_t level)
{
    return (cell_grid){pyramid->width[level], pyramid->height[level], pyramid->shift + level,
                       (size_t)pyramid->width[level], pyramid->codes + pyramid->offset[level]};
}

/* Adds to the running union the bound of texel cells [x0, x1] x [y0, y1]: the finest level at which
 * they touch at most 2 x 2 nodes (Greene et al. 1993, as RMIP's section 6 describes it). */
static inline void minmax_query(const minmax_pyramid *pyramid, int32_t x0, int32_t x1, int32_t y0, int32_t y1,
                                uint32_t *high, uint32_t *low)
{
    uint32_t left = (uint32_t)x0 >> pyramid->shift, right = (uint32_t)x1 >> pyramid->shift;
    uint32_t top = (uint32_t)y0 >> pyramid->shift, bottom = (uint32_t)y1 >> pyramid->shift;
    uint32_t span = right - left > bottom - top ? right - left : bottom - top;
    /* Spans of 2^l to 2^(l+1) - 1 cells touch two or three nodes of level l. */
    int32_t level = 31 - __builtin_clz(span | 1u);
    level += (right >> level) - (left >> level) > 1 || (bottom >> level) - (top >> level) > 1;
    const uint32_t *codes = pyramid->codes + pyramid->offset[level];
    size_t width = (size_t)pyramid->width[level];
    const uint32_t *first = codes + (top >> level) * width, *second = codes + (bottom >> level) * width;
    left >>= level;
    right >>= level;
    const uint32_t found[4] = {first[left], first[right], second[left], second[right]};
    for (int32_t i = 0; i < 4; i++) {
        *high = found[i] > *high ? found[i] : *high;
        *low = (found[i] & 0xffffu) > *low ? found[i] & 0xffffu : *low;
    }
}

#endif
