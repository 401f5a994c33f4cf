/* shell/march.h: the exact leaf, and texel marching along a ray curve (RMIP 2023, section 4.4). */
#ifndef KNURL_SRC_SHELL_MARCH_H
#define KNURL_SRC_SHELL_MARCH_H

#include "shell/curve.h"

/* One ray against one shell. */
typedef struct shell_walk {
    const shell_space *space;
    const height_lod *lod;
    const triangle_frame *frame;
    const ray_curve *curve;
    const knurl_ray *ray;
    const curve_interval *stretch; /* the stretch being walked */
    shell_root root;               /* the hit, once found */
    uint32_t steps;                /* grows by one per texel visited */
} shell_walk;

/* Finds the first root of g = s |N| - h along the curve from parameter `in` to `out`, a stretch
 * where x and y are monotone, with t in the ray's [tmin, tmax]. Visits the texels that the curve
 * crosses in order. Both ends are closed: where g is zero within rounding there, at a side of the prism
 * within the zone that the side lies in, that is a hit, because what comes next may see the other sign. */
bool shell_march(shell_walk *walk, double in, double out);

/* Whether the curve keeps away from every surface with heights in `h` from `in` to `out`, by its height
 * alone: no box, no inverse of (u, v). x and y are monotone between the two. */
bool shell_curve_clears(const shell_walk *walk, double in, double out, knurl_range h);

#endif
