/* The search that Baboud and Decoret 2006 (section 3.2) take from Policarpo, Oliveira and Comba 2005, and
 * improve upon: a fixed number of uniform steps finds a stretch where the ray passes through the surface,
 * and a fixed number of halvings narrows it. Features thinner than a step are missed, as they say.
 *
 * Where the papers are silent: the steps divide each stretch of the ray inside the prism of one base triangle
 * (equal in t), so that a mesh of many triangles is sampled more densely than a box; rays may start below the
 * surface, and then the first sample above it ends the steps. The presets, 32 and 6, are the numbers that
 * Kolb and Rezk-Salama 2005 (section 2.2) report. The hit is the middle of the last bracket, not moved onto
 * the surface. Level of detail: samples read any, blended ones included. Folded shells, and rays that cannot
 * be followed, go to shell_subdivide(). */
#include "methods/relief/relief.h"

static const knurl_method_parameter PARAMETERS[] = {
    {"linear", "uniform steps per stretch of the ray inside a prism", 32.0, 1.0, 4096.0, NULL, true},
    {"binary", "halvings of the step that passed through the surface", 6.0, 0.0, 52.0, NULL, true},
    {0}};

typedef struct binary_parameters {
    int linear, binary;
} binary_parameters;

static knurl_status binary_build(const shell_space *space, const double *values, void **data,
                                 knurl_error *error)
{
    binary_parameters *p = knurl_alloc_zero(space->context, sizeof *p);
    *data = p;
    if (!p) return knurl_fail_memory(error, sizeof *p, "method binary");
    *p = (binary_parameters){(int)values[0], (int)values[1]};
    return KNURL_OK;
}

static bool search_segment(const void *data, segment_walk *walk)
{
    const binary_parameters *p = data;
    segment_point point;
    height_patch patch;
    double at = 0.0, g = segment_sample(walk, 0.0, &point, &patch);
    bool above = g > 0.0;
    for (int i = 1; i <= p->linear; i++) {
        double to = (double)i / (double)p->linear;
        g = segment_sample(walk, to, &point, &patch);
        if ((g > 0.0) != above) {
            if (relief_bisect(walk, at, to, above, p->binary)) return true;
            above = !above; /* behind the ray's start: what comes next may not be */
        }
        if (point.t > walk->ray->tmax) return false;
        at = to;
    }
    return false;
}

static bool binary_intersect(const void *data, const method_query *q)
{
    return relief_intersect(q, search_segment, data);
}

const method method_binary = {
    .name = "binary",
    .summary = "uniform steps, then binary search (Policarpo et al. 2005; Baboud and Decoret 2006)",
    .flags = 0,
    .needs = HEIGHT_NEED_RMIP,
    .parameters = PARAMETERS,
    .build = binary_build,
    .intersect = binary_intersect,
};
