/* Baboud, Decoret: "Rendering Geometry with Relief Textures", Graphics Interface 2006, section 3.3: the ray's
 * segment inside the box is walked from centre line to centre line.
 *
 * What differs from the paper:
 * - heights between two centre lines are the exact polynomial, not linear (shell/segment_walk.h), so that on
 *   planes, boxes and frusta every first hit is found; on a curved base the segment is a chord, and its error
 *   is the method's;
 * - the box is the prism of a base triangle, and its frustum needs no matrix: shell/segment.h carries the
 *   projective weight that section 4 puts into one;
 * - rays may start on either side of the surface; both sides are hit;
 * - any level of detail, blended ones included: the walk stops at the centre lines of both levels;
 * - folded shells, and rays that cannot be followed, go to shell_subdivide(). */
#include "methods/relief/relief.h"

static const knurl_method_parameter PARAMETERS[] = {{0}};

static bool walk_segment(const void *data, segment_walk *walk)
{
    (void)data;
    const shell_segment *s = walk->segment;
    double end = (walk->ray->tmax - s->in.t) / (s->out.t - s->in.t) + 1e-9; /* t is affine */
    return segment_walk_cells(walk, 0.0, end < 1.0 ? end : 1.0);
}

static bool texel_walk_intersect(const void *data, const method_query *q)
{
    return relief_intersect(q, walk_segment, data);
}

const method method_texel_walk = {
    .name = "texel-walk",
    .summary = "walk over centre lines (Baboud and Decoret 2006); exact on planes, boxes and frusta",
    .flags = 0,
    .needs = HEIGHT_NEED_RMIP,
    .parameters = PARAMETERS,
    .intersect = texel_walk_intersect,
};
