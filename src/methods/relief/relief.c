/* See relief.h. */
#include "methods/relief/relief.h"

bool relief_bisect(segment_walk *walk, double from, double to, bool above, int halvings)
{
    segment_point point;
    height_patch patch;
    for (int i = 0; i < halvings; i++) {
        double middle = 0.5 * (from + to);
        if ((segment_sample(walk, middle, &point, &patch) > 0.0) == above)
            from = middle;
        else
            to = middle;
    }
    return segment_accept(walk, 0.5 * (from + to));
}

/* Walks and searches take time in proportion to the texels of a segment. Triangles with more than this, whose
 * map coordinates are tiled absurdly often, are left to the box search, which is not. */
static const double MOST_TEXELS = 0x1p24;

static bool too_long(const shell_segments *segments)
{
    double texels = 0.0;
    for (int i = 0; i < segments->count; i++) {
        const shell_segment *s = &segments->list[i];
        texels += fabs(s->out.x - s->in.x) + fabs(s->out.y - s->in.y);
    }
    return texels > MOST_TEXELS;
}

bool relief_intersect(const method_query *q, relief_search *search, const void *data)
{
    shell_segments segments;
    knurl_ray line = *q->ray;
    line.tmax = INFINITY;
    if (!shell_segments_make(q->frame, &line, &segments) || too_long(&segments))
        return shell_subdivide(q->space, q->lod, KNURL_BOUNDS_RMIP, q->frame, q->ray, q->any, q->root,
                               q->steps);
    segment_walk walk = {
        .space = q->space, .lod = q->lod, .frame = q->frame, .ray = q->ray, .segments = &segments};
    bool found = false;
    for (int i = 0; i < segments.count && !found; i++) {
        walk.segment = &segments.list[i];
        walk.have_g = false;
        if (walk.segment->in.t > q->ray->tmax) break;
        found = search(data, &walk);
    }
    *q->steps += walk.steps;
    if (found) *q->root = walk.root;
    return found;
}
