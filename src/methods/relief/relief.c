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

bool relief_intersect(const method_query *q, relief_search *search, const void *data)
{
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
        found = search(data, &walk);
    }
    *q->steps += walk.steps;
    if (found) *q->root = walk.root;
    return found;
}
