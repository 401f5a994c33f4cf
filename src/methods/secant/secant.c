/* Secant: Yerex, Jagersand: "Displacement Mapping with Ray-casting in Hardware", 2004.
 *
 * N samples of the map at equal distances along the ray, between its entry into the shell and its exit; the
 * first pair of neighbours with the ray on different sides of the surface; and the point where the secant
 * between them meets the ray.
 *
 * What the paper leaves open, and what this file does:
 * - The paper has planes only. Here entry and exit are those of the shell's prism over a triangle, and the
 * ray between them is the straight line of shell/segment.h in texture space: the ray itself on planes, boxes
 *   and frusta, a chord of its curve on other bases. That part of the error stays, however many samples.
 * - In the paper the number of samples is per polygon, which may be many map tiles wide; here it is per base
 *   triangle. Entry and exit are two of the samples.
 * - Passes (section 3): each handles an equal part of the ray, with N samples of its own; the last sample of
 *   one is the first of the next. The first pass with a crossing wins.
 * - The paper looks for the first sample under the surface. Here a ray may start under it, so that a hit is a
 *   change of sign, from either side.
 *
 * Samples depend on the ray's line and its tmin, but not on tmax, so that the order in which shells are tried
 * does not matter. Folded shells, and the few rays whose stretch has no straight line, go to
 * shell_subdivide(). A triangle without area in texture space needs nothing. */
#include "methods/method.h"
#include "shell/evaluate.h"
#include "shell/segment.h"

static const knurl_method_parameter PARAMETERS[] = {
    {"samples", "samples in each pass, entry and exit included", 15.0, 2.0, 4096.0, NULL, true},
    {"passes", "equal parts that the ray is split into", 1.0, 1.0, 256.0, NULL, true},
    {0}};

typedef struct secant_parameters {
    int samples, passes;
} secant_parameters;

static knurl_status secant_build(const shell_space *space, const double *values, void **data,
                                 knurl_error *error)
{
    secant_parameters *p = knurl_alloc_zero(space->context, sizeof *p);
    *data = p;
    if (!p) return knurl_fail_memory(error, sizeof *p, "method secant");
    *p = (secant_parameters){(int)values[0], (int)values[1]};
    return KNURL_OK;
}

typedef struct sample {
    double f; /* fraction of the segment */
    double g; /* height of the ray over the surface */
} sample;

static sample take_sample(const method_query *q, const shell_segment *s, double f, shell_root *root)
{
    segment_point at = segment_at(s, f);
    shell_root_at(q->space, q->lod, q->frame, at.b1, at.b2, at.t, root);
    ++*q->steps;
    return (sample){f, at.h - height_patch_at(&root->patch, root->x, root->y)};
}

/* Where the secant between two samples meets the ray. */
static bool take_root(const method_query *q, const shell_segment *s, sample a, sample b)
{
    shell_root root;
    take_sample(q, s, a.f + (b.f - a.f) * (a.g / (a.g - b.g)), &root);
    if (!(root.t >= q->ray->tmin && root.t <= q->ray->tmax)) return false;
    *q->root = root;
    return true;
}

static bool search(const secant_parameters *p, const method_query *q, const shell_segment *s)
{
    shell_root unused;
    int steps = p->passes * (p->samples - 1);
    sample last = take_sample(q, s, 0.0, &unused);
    for (int i = 1; i <= steps; i++) {
        sample next = take_sample(q, s, (double)i / (double)steps, &unused);
        if ((last.g <= 0.0) != (next.g <= 0.0) && take_root(q, s, last, next)) return true;
        if (unused.t > q->ray->tmax) return false;
        last = next;
    }
    return false;
}

static bool secant_intersect(const void *data, const method_query *q)
{
    const secant_parameters *parameters = data;
    shell_segments segments;
    knurl_ray line = *q->ray;
    line.tmax = INFINITY;
    if (!shell_segments_make(q->frame, &line, &segments))
        return shell_subdivide(q->space, q->lod, KNURL_BOUNDS_RMIP, q->frame, q->ray, q->any, q->root,
                               q->steps);
    for (int i = 0; i < segments.count; i++) {
        if (segments.list[i].in.t > q->ray->tmax) break;
        if (search(parameters, q, &segments.list[i])) return true;
    }
    return false;
}

const method method_secant = {
    .name = "secant",
    .summary = "uniform samples and one secant step (Yerex and Jagersand 2004)",
    .flags = 0,
    .needs = HEIGHT_NEED_RMIP,
    .parameters = PARAMETERS,
    .build = secant_build,
    .intersect = secant_intersect,
};
