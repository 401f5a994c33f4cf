/* methods/tfdm/leaf.h: the exact leaf: the part of the ray curve inside a node, marched. */
#ifndef KNURL_SRC_METHODS_TFDM_LEAF_H
#define KNURL_SRC_METHODS_TFDM_LEAF_H

#include "shell/march.h"

enum { LEAF_MAX_PIECES = 5 * CURVE_MAX_INTERVALS };

/* A piece of the curve along which x and y are monotone. */
typedef struct leaf_piece {
    double in, out, x_in, x_out, y_in, y_out;
    const curve_interval *stretch;
} leaf_piece;

typedef struct leaf_pieces {
    leaf_piece piece[LEAF_MAX_PIECES]; /* front to back */
    int count;
    double near, far; /* range of t that holds them all */
} leaf_pieces;

/* The pieces of a curve in the ray's [tmin, tmax]. Refers to the curve. */
void leaf_pieces_make(const ray_curve *curve, const knurl_ray *ray, leaf_pieces *pieces);

/* First root in [x0, x1] x [y0, y1], whole texels, in [tmin, tmax] of walk->ray. */
bool leaf_intersect(shell_walk *walk, const leaf_pieces *pieces, double x0, double x1, double y0, double y1);

#endif
