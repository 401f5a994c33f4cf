/* Baboud and Decoret 2006, sections 3.4 and 3.5: steps as long as the safety radius allows, until the ray is
 * on the other side of the surface, and a binary search there.
 *
 * What differs from the paper:
 * - radii are proved, not sampled, and for rays from both sides (radius.c); they hold wherever in the square
 *   a ray starts, so that a step goes to the square's border and never back to a centre line first;
 * - a texel of radius 0 is handled in either of the two ways of section 3.4: exactly (its cell is walked as
 *   in texel-walk), or by a step of one texel with the error of Figure 7;
 * - in a frustum the ray bends in (x, y, h) (shell/segment.h). From its hollow side, concave height for a ray
 *   above the surface, the radii hold all the same; from the other side cells are walked one by one.
 * On a curved base the segment is a chord, and its error adds to the method's. Level of detail: radii are
 * those of level 0; at any other level all radii count as 0. Folded shells, and rays that cannot be followed,
 * go to shell_subdivide(). */
#include "methods/relief/relief.h"

#include <float.h>

static const knurl_method_parameter PARAMETERS[] = {
    {"allowance", "depth of surface that may be passed unseen, as a part of the map's range (Figure 12)",
     0.004, 0.0, 1.0, NULL, false},
    {"zero", "what is done where the safety radius is 0: walk the cell, or step one texel (section 3.4)", 0.0,
     0.0, 1.0, "exact|clamp", false},
    {"binary", "halvings of the step that passed through the surface", 20.0, 0.0, 52.0, NULL, true},
    {0}};

typedef struct robust_data {
    safety_radii radii;
    bool clamp;
    int binary;
} robust_data;

static void robust_destroy(const shell_space *space, void *data)
{
    robust_data *d = data;
    safety_radii_free(space->context, &d->radii);
    knurl_free(space->context, d);
}

static knurl_status robust_build(const shell_space *space, const double *values, void **data,
                                 knurl_error *error)
{
    robust_data *d = knurl_alloc_zero(space->context, sizeof *d);
    *data = d;
    if (!d) return knurl_fail_memory(error, sizeof *d, "method robust-binary");
    d->clamp = values[1] != 0.0;
    d->binary = (int)values[2];
    return safety_radii_make(space, values[0], &d->radii, error);
}

static uint64_t robust_bytes(const void *data)
{
    const robust_data *d = data;
    return d ? sizeof *d + 2 * (uint64_t)d->radii.width * (uint64_t)d->radii.height : 0;
}

/* Integer texel that a position belongs to. */
static double nearest_texel(double x)
{
    return floor_d(x + 0.5);
}

/* Radius around a point for a ray on that side of the surface; 0 where radii do not hold. */
static int32_t radius_at(const robust_data *d, const segment_walk *w, const segment_point *p, bool above)
{
    const shell_space *space = w->space;
    double bend = segment_bend(w->segment);
    if (w->lod->lod > 0.0 || (above ? bend > 0.0 : bend < 0.0)) return 0;
    int64_t i = w->frame->origin_x + (int64_t)nearest_texel(p->x),
            j = w->frame->origin_y + (int64_t)nearest_texel(p->y);
    size_t at = (size_t)height_wrap(j, d->radii.height, space->wrap_v) * (size_t)d->radii.width +
                (size_t)height_wrap(i, d->radii.width, space->wrap_u);
    bool above_map = space->factor < 0.0 ? !above : above;
    return above_map ? d->radii.above[at] : d->radii.below[at];
}

/* Fraction where the segment leaves [center - r, center + r] along one axis; at most 1. */
static double leave(const shell_segment *s, double in, double out, double center, double r)
{
    double border = out > in ? center + r : center - r;
    if (in == out || (out > in ? out <= border : out >= border)) return 1.0;
    return segment_cross(s, in, out, border);
}

/* Fraction where the square of radius r around the point's texel ends. */
static double square_end(const segment_walk *w, const segment_point *p, int32_t r)
{
    const shell_segment *s = w->segment;
    double x = leave(s, s->in.x, s->out.x, nearest_texel(p->x), (double)r);
    double y = leave(s, s->in.y, s->out.y, nearest_texel(p->y), (double)r);
    return min_d(min_d(x, y), 1.0);
}

/* Each step moves by half a texel at least, but for rounding. */
static uint64_t most_steps(const shell_segment *s)
{
    double texels = fabs(s->out.x - s->in.x) + fabs(s->out.y - s->in.y);
    return (uint64_t)min_d(64.0 + 4.0 * texels, 0x1p40);
}

static bool touches(const segment_walk *w, const height_patch *patch, double g)
{
    double rounding = patch->slope * w->segments->texel_rounding + w->segments->height_rounding +
                      32.0 * DBL_EPSILON * max_d(fabs(patch->min), fabs(patch->max));
    return fabs(g) <= rounding;
}

static bool step_along(const void *data, segment_walk *w)
{
    const robust_data *d = data;
    segment_point p;
    height_patch patch;
    double at = 0.0, g = segment_sample(w, 0.0, &p, &patch);
    if (touches(w, &patch, g) && segment_accept(w, 0.0)) return true;
    uint64_t limit = most_steps(w->segment);
    for (uint64_t n = 0; n < limit && at < 1.0; n++) {
        bool above = g > 0.0;
        if (p.t > w->ray->tmax) return false;
        int32_t r = radius_at(d, w, &p, above);
        if (r == 0 && !d->clamp) {
            double to = segment_next_line(w, at);
            w->g = g;
            w->have_g = true;
            if (segment_walk_cells(w, at, to)) return true;
            at = to;
            p = segment_at(w->segment, at);
            if (w->have_g) {
                g = w->g;
                continue;
            }
        } else {
            double to = square_end(w, &p, r > 1 ? r : 1);
            double next = segment_sample(w, to, &p, &patch);
            if ((next > 0.0) != above && relief_bisect(w, at, to, above, d->binary)) return true;
            at = to;
            g = next;
            if (at == 1.0 && touches(w, &patch, g) && segment_accept(w, at)) return true;
            continue;
        }
        g = segment_sample(w, at, &p, &patch);
    }
    return false;
}

static bool robust_intersect(const void *data, const method_query *q)
{
    return relief_intersect(q, step_along, data);
}

const method method_robust_binary = {
    .name = "robust-binary",
    .summary = "steps by precomputed safety radius, then binary search (Baboud and Decoret 2006)",
    .flags = 0,
    .needs = HEIGHT_NEED_RMIP,
    .parameters = PARAMETERS,
    .build = robust_build,
    .intersect = robust_intersect,
    .bytes = robust_bytes,
    .destroy = robust_destroy,
};
