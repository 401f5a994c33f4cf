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
