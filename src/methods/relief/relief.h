/* methods/relief/relief.h: what the methods of Baboud and Decoret 2006 share. */
#ifndef KNURL_SRC_METHODS_RELIEF_RELIEF_H
#define KNURL_SRC_METHODS_RELIEF_RELIEF_H

#include "methods/method.h"
#include "shell/segment_walk.h"

/* Halves [from, to] of the walk's segment `halvings` times and takes the middle as the hit; the ray is
 * above the surface at `from` or not, and the other way round at `to`. False if t is out of the ray's range.
 */
bool relief_bisect(segment_walk *walk, double from, double to, bool above, int halvings);

/* First root on one segment of the ray; `data` is the method's. */
typedef bool relief_search(const void *data, segment_walk *walk);
/* A method's whole query: its search on each segment in turn, front to back. Segments do not end at the ray's
 * tmax: neither places of samples nor the chord on a curved base may depend on what was hit before, or the
 * order in which shells are tried would show. A search ends where t is past tmax. */
bool relief_intersect(const method_query *query, relief_search *search, const void *data);

/* Safety radii: for each texel of level 0, how many texels the square around it may reach to each side so
 * that a ray in it that starts above the map (or below it) meets it at most once. */
typedef struct safety_radii {
    int32_t width, height;
    uint8_t *above, *below; /* width * height; for rays above and below the map's values */
} safety_radii;

enum { SAFETY_LARGEST = 32 };

/* `allowance`: how deep a ray may pass under the surface and out again unseen, as a part of the range of the
 * map's samples; 0: not at all. */
knurl_status safety_radii_make(const shell_space *space, double allowance, safety_radii *radii,
                               knurl_error *error);
void safety_radii_free(knurl_context *context, safety_radii *radii);

#endif
