/* bounds/blocks.h: the samples of level 0 as 16-bit codes in small tiles, and a minmax pyramid of 4 x 4
 * blocks over their texel cells. One cache line holds 8 x 4 samples, or the ranges of sixteen children. */
#ifndef KNURL_SRC_BOUNDS_BLOCKS_H
#define KNURL_SRC_BOUNDS_BLOCKS_H

#include "base/base.h"
#include "data/levels.h"

/* 4 x 4 children; child (i, j) is number 4 * j + i. One cache line. An empty child has min 65535, max 0. */
typedef struct block_node {
    uint16_t min[16], max[16];
} block_node;

enum { BLOCKS_MAX_LEVELS = 9, BLOCK_TILE_WIDTH = 8, BLOCK_TILE_HEIGHT = 4 };

/* Cell k of an axis, k = 0 .. size - 1, is the bilinear signal between samples k and k + 1. The last cell
 * of an axis holds both continuations: sample 0 of the next period for repeat, and sample size - 1 itself
 * for clamp and mirror. A child of n cells from cell k0 on bounds samples k0 .. k0 + n, both included, as
 * far as they exist, and sample 0 where it has the last cell. Children wholly outside the map are empty. */
typedef struct height_blocks {
    int32_t width, height; /* samples of level 0 */
    double origin, step;   /* code c stands for the map value origin + c * step */
    double code_error;     /* at least |value - (origin + c * step)| of every sample, evaluated in double; 0
                              for integer maps (there the two differ by roundings of the product only),
                              whose 8-bit samples become 257 * sample and whose step is 1 / 65535 */
    int32_t tile_columns, tile_rows;
    /* Tiles of 8 x 4 samples, 64 bytes each, 64-byte aligned, row-major inside, tiles row by row. There is
     * at least one more column and row of samples than the map has, so that cell width - 1 can be read:
     * places outside the map hold the sample at the clamped position. */
    uint16_t *tiles;
    int32_t level_count;                                         /* at least 1 */
    int32_t columns[BLOCKS_MAX_LEVELS], rows[BLOCKS_MAX_LEVELS]; /* nodes */
    /* 64-byte aligned. Level 0: a node is 16 x 16 texel cells, its children are 4 x 4 cells. Level l:
     * children are the nodes of level l - 1. Last level: 1 x 1 nodes. */
    block_node *nodes[BLOCKS_MAX_LEVELS];
    size_t bytes; /* all that the blocks hold */
} height_blocks;

/* `range_min` and `range_max` contain all samples; only float maps use them, for their scale. */
knurl_status height_blocks_build(knurl_context *context, const height_level *level, double range_min,
                                 double range_max, height_blocks **blocks, knurl_error *error);
/* Brings tiles and nodes up to date after samples were replaced. Float samples must be inside the range
 * that the blocks were made for, else height_blocks_rescale() comes first and `samples` is the whole map. */
void height_blocks_update(knurl_context *context, height_blocks *blocks, const height_level *level,
                          height_rect samples);
/* Another scale, for a float map. */
void height_blocks_rescale(height_blocks *blocks, double range_min, double range_max);
void height_blocks_destroy(knurl_context *context, height_blocks *blocks);

/* Sample (x, y), x in [0, 8 * tile_columns), y in [0, 4 * tile_rows). */
static inline uint32_t height_blocks_code(const height_blocks *blocks, int32_t x, int32_t y)
{
    size_t tile = (size_t)(y >> 2) * (size_t)blocks->tile_columns + (size_t)(x >> 3);
    return blocks->tiles[tile * 32 + (size_t)((y & 3) * 8 + (x & 7))];
}

#endif
