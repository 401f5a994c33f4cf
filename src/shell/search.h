/* shell/search.h: the exact first root of one shell, whatever its shape, by height alone.
 *
 * The ray's curve (shell/curve.h) is halved where the range of heights over its rectangle of texels does
 * not clear it, and marched when it is a few texels long (shell/march.h): one-dimensional height
 * intervals in place of boxes. Folded shells, and rays that no curve follows, go to shell_subdivide(). */
#ifndef KNURL_SRC_SHELL_SEARCH_H
#define KNURL_SRC_SHELL_SEARCH_H

#include "shell/curve.h"

/* First root with t in [tmin, tmax] of the ray; `any` of them if asked so. *steps grows by the work. */
bool shell_search(const shell_space *space, const height_lod *lod, knurl_bounds_kind kind,
                  const triangle_frame *frame, const knurl_ray *ray, bool any, shell_root *root,
                  uint32_t *steps);

#endif
