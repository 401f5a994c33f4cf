/* methods/tfdm/tree.h: the quad-tree over the minmax mipmap, in the plane of unwrapped texels.
 *
 * Nodes are squares of 2^k texels aligned to the map. So that they stay aligned in every tile of a map
 * whose size is no power of two, a tile is counted as if it had 2^m >= size texels: number
 * (tile << m) + i stands for texel tile * size + min(i, size), and nodes are squares of numbers. What lies
 * past the tile's last texel is empty. Nodes larger than a tile hold whole tiles. */
#ifndef KNURL_SRC_METHODS_TFDM_TREE_H
#define KNURL_SRC_METHODS_TFDM_TREE_H

#include "bounds/minmax.h"
#include "math/pair.h"
#include "shell/shell.h"

/* Numbers stay under 2^39: |u| < 2^20 tiles (checked when the surface is built) of at most 2^16 texels,
 * counted as 2^17 at most, and some to spare. */
enum { TREE_MAX_LEVEL = 40 };

typedef struct tree_axis {
    int32_t size;    /* texels per tile */
    int32_t padding; /* log2 of the numbers per tile */
    bool even;       /* no number is empty */
    bool aligned;    /* nodes are the pyramid's in every tile */
    int64_t origin;  /* texel that positions are relative to */
    knurl_wrap wrap;
} tree_axis;

typedef struct tree {
    const shell_space *space;
    const height_lod *lod;
    const triangle_frame *frame;
    const minmax_pyramid *pyramid; /* NULL: not of this level of detail, bounds come from queries */
    tree_axis x, y;
    double base, scale, rounding; /* h = base + scale * code, to within `rounding` */
} tree;

/* 2 x 2 sibling nodes; node (i, j) has number i + 2 j. */
typedef struct quad {
    pair x0, x1, y0, y1; /* borders of columns and rows in the frame's texels; empty ones are equal */
    pair min[2], max[2]; /* range of h by row */
} quad;

/* `pyramid` is one of level 0. */
void tree_make(const shell_space *space, const height_lod *lod, const triangle_frame *frame,
               const minmax_pyramid *pyramid, tree *tree);

/* Number of the texel at a position; positions between texels belong to the one below. */
int64_t tree_number(const tree_axis *axis, double position);

/* Where a number lies. */
double tree_position(const tree_axis *axis, int64_t number);

/* Borders of the nodes of level `level` (2^level texels) that start at numbers x and y. */
void tree_borders(const tree *tree, int64_t x, int64_t y, int level, quad *quad);
/* Height ranges of the nodes named in `wanted`, a bit each. */
void tree_heights(const tree *tree, int64_t x, int64_t y, int level, unsigned wanted, quad *quad);

#endif
