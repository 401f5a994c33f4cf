/* methods/pdm/prism.h: the prism that bounds the displaced surface over one base triangle, and where a ray
 * enters and leaves it (Hoetzlein 2025, section 4 and 4.1). */
#ifndef KNURL_SRC_METHODS_PDM_PRISM_H
#define KNURL_SRC_METHODS_PDM_PRISM_H

#include "shell/shell.h"

/* Three bilinear sides and two triangles; a ray crosses a side at most twice. */
enum { PRISM_MAX_STRETCHES = 5 };

typedef struct prism {
    vec3 ng;              /* unit geometric normal, on the side of the vertex normals */
    double k[3];          /* N_i . Ng > 0 */
    vec3 lean[3];         /* N_i / (N_i . Ng): what an offset by 1 along Ng adds to vertex i (Eq. 6) */
    vec3 low[3], high[3]; /* negative and positive extents, relative to vertex 0 */
    double size;          /* a length scale */
    double winding;       /* -1 if Ng is against the order of the vertices */
} prism;

/* Where a ray is inside the prism, front to back. */
typedef struct prism_stretch {
    double in, out;
} prism_stretch;

/* The parallel offset prism of Eq. 4 to 6. Its extents are tight: w is the height range of this triangle
 * (section 5.4). An extent's length is at most offset_limit times the largest height: where a vertex
 * normal is far from Ng the division would send it away (section 5.4, figure 6). offset_limit 0: the
 * same height at every vertex, the standard prism of Eq. 3, whose sides are shared by neighbours. That one is
 * also made where extents past the surface's heights would cross each other.
 * false if Ng is undefined or a vertex normal is not on its side: no such prism exists. */
bool prism_make(const triangle_frame *frame, double offset_limit, prism *out);

/* Stretches of the ray, for any t from -infinity on, so that a ray that starts inside has its entry at
 * t < 0. Origin is relative to vertex 0. */
int prism_intersect(const prism *p, vec3 origin, vec3 direction,
                    prism_stretch stretches[PRISM_MAX_STRETCHES]);

#endif
