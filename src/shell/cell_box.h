/* shell/cell_box.h: 3D boxes of the surface over rectangles of texels, against one ray.
 *
 * Over a rectangle with centre c and half sizes (rx, ry), with s in sc +- sr, the point P + s N is
 * within |Px + sc Nx| rx + |Py + sc Ny| ry + (|N| + |Nx| rx + |Ny| ry) sr of P(c) + sc N(c), component
 * by component: affine arithmetic (Thonat et al. 2021) with the products of noise symbols taken
 * together. */
#ifndef KNURL_SRC_SHELL_CELL_BOX_H
#define KNURL_SRC_SHELL_CELL_BOX_H

#include "shell/shell.h"

/* One ray and one triangle; not for SHELL_FLAT_UV. Refers to the frame. */
typedef struct cell_boxes {
    const triangle_frame *frame;
    vec3 origin, inverse; /* ray relative to vertex 0, reciprocal direction */
    vec3 px, py, nx, ny;  /* derivatives of P and N along texel coordinates x and y */
    double nx_length, ny_length;
    double rounding; /* bound on the rounding of a box, object-space length */
} cell_boxes;

void cell_boxes_make(const triangle_frame *frame, const knurl_ray *ray, cell_boxes *boxes);

/* Bounds of |N| over a rectangle with half sizes (rx, ry) and N = n at its centre; 1 and 1 where the
 * surface is unnormalised. */
void cell_normal_range(const cell_boxes *boxes, vec3 n, double rx, double ry, double *low, double *high);

/* The ray's range in a box, widened by `slack` for rounding; in > out if the ray misses it. */
typedef struct box_span {
    double in, out, slack;
} box_span;

/* Box of the surface over [x0, x1] x [y0, y1] in the frame's texels, where h is in the given range. */
box_span cell_box_clip(const cell_boxes *boxes, double x0, double x1, double y0, double y1, knurl_range h);

#endif
