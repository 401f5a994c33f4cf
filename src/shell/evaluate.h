/* shell/evaluate.h: points of S without a ray, for meshes whose vertices lie on it.
 *
 * Triangles that share an edge must make the same points of it, bit for bit. So points on an edge, and at
 * its ends, come from the two vertices alone, in an order that does not depend on the triangle. */
#ifndef KNURL_SRC_SHELL_EVALUATE_H
#define KNURL_SRC_SHELL_EVALUATE_H

#include "shell/shell.h"

/* The root that barycentrics (b1, b2) and a depth stand for; every field is filled. */
void shell_root_at(const shell_space *space, const height_lod *lod, const triangle_frame *frame, double b1,
                   double b2, double t, shell_root *root);

/* S at barycentrics inside a triangle. */
vec3 shell_point(const shell_space *space, const height_lod *lod, const triangle_frame *frame, double b1,
                 double b2);

/* An edge between two vertices. Texel coordinates are those of lod->level[0], moved by whole periods of
 * the map, so that edges which read the same texels through another tile give the same bits. */
typedef struct shell_edge {
    vec3 p[2], n[2];
    vec2 uv[2]; /* as they are */
    double x[2], y[2];
    double length; /* texels */
    bool swapped;  /* p[0] is the second vertex */
} shell_edge;

/* Depends on the values at the two vertices only, not on their numbers; exchanging them changes `swapped`
 * alone. */
void shell_edge_make(const shell_space *space, const height_lod *lod, uint32_t first, uint32_t second,
                     shell_edge *edge);
/* S at k / n of the way from the first vertex to the second, 0 <= k <= n. The ends are those of every
 * other edge there that reads the same texels. */
vec3 shell_edge_point(const shell_space *space, const height_lod *lod, const shell_edge *edge, uint32_t k,
                      uint32_t n);

#endif
