/* methods/tfdm/boxes.h: four sibling nodes against the triangle's outline and a ray at once. What
 * depends on the column or the row alone, and the range of |N|, is worked out once for all. */
#ifndef KNURL_SRC_METHODS_TFDM_BOXES_H
#define KNURL_SRC_METHODS_TFDM_BOXES_H

#include "methods/tfdm/tree.h"
#include "shell/cell_box.h"

/* One axis of space: P, N and their derivatives along texel coordinates, divided by the ray direction's
 * component, so that they are in units of t. */
typedef struct box_axis {
    pair p, n; /* at vertex 0, P relative to the ray's origin */
    pair px, py, nx, ny;
    pair nx_size, ny_size, rounding;
} box_axis;

/* One ray and one triangle. */
typedef struct quad_boxes {
    cell_boxes cell;
    box_axis axis[3];
    pair slope[3][2];      /* of the barycentrics b0, b1, b2 along x and y */
    pair side_rounding;    /* bound on the rounding of barycentrics over the nodes */
    double x0, x1, y0, y1; /* the triangle's box in texels */
    double pad;            /* texels by which nodes grow on each side */
    double height_pad;     /* how far h may leave a node's range over that */
} quad_boxes;

/* Boxes are turned to the triangle's mean normal, or else aligned with the world's axes. `pad` bounds the
 * error in texels of the points that roots are sought at. */
void quad_boxes_make(const shell_space *space, const triangle_frame *frame, const knurl_ray *ray, bool turned,
                     double pad, quad_boxes *boxes);

/* Part of a quad inside the triangle's box, grown by the pad: centres, relative to vertex 0, and half
 * sizes of columns and rows. */
typedef struct quad_cut {
    pair cx, rx, cy, ry;
} quad_cut;

/* The nodes that touch the triangle in texture space, a bit each, and in *inside those that it holds
 * whole. Where `parent_inside` nothing needs to be tested. */
unsigned quad_in_triangle(const quad_boxes *boxes, const quad *quad, bool parent_inside, quad_cut *cut,
                          unsigned *inside);

/* Those of the nodes in `wanted` whose 3D boxes the ray meets in [tmin, tmax], and where it enters. */
unsigned quad_clip(const quad_boxes *boxes, const quad *quad, const quad_cut *cut, unsigned wanted,
                   double tmin, double tmax, pair entry[2]);

#endif
