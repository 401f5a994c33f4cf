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
#include "methods/method.h"
#include "shell/segment_walk.h"

static const knurl_method_parameter PARAMETERS[] = {{0}};

static knurl_status texel_walk_build(const shell_space *space, const double *values, void **data,
                                     knurl_error *error)
{
    (void)space;
    (void)values;
    (void)error;
    *data = NULL;
    return KNURL_OK;
}

static bool texel_walk_intersect(const void *data, const method_query *q)
{
    (void)data;
    shell_segments segments;
    if (!shell_segments_make(q->frame, q->ray, &segments))
        return shell_subdivide(q->space, q->lod, KNURL_BOUNDS_RMIP, q->frame, q->ray, q->any, q->root,
                               q->steps);
    segment_walk walk = {
        .space = q->space, .lod = q->lod, .frame = q->frame, .ray = q->ray, .segments = &segments};
    bool found = false;
    for (int i = 0; i < segments.count && !found; i++) {
        walk.segment = &segments.list[i];
        walk.have_g = false;
        found = segment_walk_cells(&walk, 0.0, 1.0);
    }
    *q->steps += walk.steps;
    if (found) *q->root = walk.root;
    return found;
}

static uint64_t texel_walk_bytes(const void *data)
{
    (void)data;
    return 0;
}

static void texel_walk_destroy(const shell_space *space, void *data)
{
    (void)space;
    (void)data;
}

const method method_texel_walk = {
    .name = "texel-walk",
    .summary = "walk over centre lines (Baboud and Decoret 2006); exact on planes, boxes and frusta",
    .flags = 0,
    .parameters = PARAMETERS,
    .build = texel_walk_build,
    .intersect = texel_walk_intersect,
    .bytes = texel_walk_bytes,
    .destroy = texel_walk_destroy,
};
