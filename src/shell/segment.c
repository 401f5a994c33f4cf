/* Straight segments of a ray in texture space; see segment.h. */
#include "shell/segment.h"
#include "shell/pieces.h"

#include <float.h>

/* k of N = c - k P by least squares over the edges; 0 if N is not of that form within the rounding of
 * directions stored as floats. */
static double convergence(const triangle_frame *f)
{
    if (f->flags & SHELL_CONSTANT_NORMAL) return 0.0;
    double edges = v3_dot(f->pe, f->pe) + v3_dot(f->pf, f->pf);
    double k = -(v3_dot(f->ne, f->pe) + v3_dot(f->nf, f->pf)) / edges;
    double off = max_d(v3_length(v3_mad(f->ne, k, f->pe)), v3_length(v3_mad(f->nf, k, f->pf)));
    double longest = max_d(v3_length(f->n[0]), max_d(v3_length(f->n[1]), v3_length(f->n[2])));
    return off <= 8.0 * (double)FLT_EPSILON * longest ? k : 0.0;
}

static segment_point point_at(const ray_curve *c, double p, double k)
{
    curve_point at = curve_at(c, p);
    return (segment_point){.t = curve_depth(c, p),
                           .b1 = at.b1,
                           .b2 = at.b2,
                           .x = at.x,
                           .y = at.y,
                           .h = at.s * frame_normal_scale(c->frame, at.b1, at.b2),
                           .weight = 1.0 - k * at.s};
}

/* Weights of one sign, made positive: all that (1) reads are their ratios. */
static bool settle_weights(shell_segment *s)
{
    double least = 1e-9 * (fabs(s->in.weight) + fabs(s->out.weight));
    if (s->in.weight < 0.0 && s->out.weight < 0.0) {
        s->in.weight = -s->in.weight;
        s->out.weight = -s->out.weight;
    }
    return s->in.weight > least && s->out.weight > least;
}

static double height_rounding(const ray_curve *c)
{
    const triangle_frame *f = c->frame;
    double s = max_d(fabs(f->s0), fabs(f->s1)), longest = 1.0, turn = 0.0;
    if (!f->unnormalised) {
        longest = max_d(v3_length(f->n[0]), max_d(v3_length(f->n[1]), v3_length(f->n[2])));
        turn = v3_length(f->ne) + v3_length(f->nf);
    }
    return longest * c->height_rounding + turn * s * c->barycentric_rounding +
           32.0 * DBL_EPSILON * s * longest;
}

bool shell_segments_make(const triangle_frame *f, const knurl_ray *ray, shell_segments *out)
{
    ray_curve curve;
    out->count = 0;
    out->exact = false;
    out->texel_rounding = out->height_rounding = 0.0;
    if (f->flags & SHELL_FOLDED) return false;
    ray_curve_make(f, ray, &curve);
    if (curve.unreliable) return false;
    if (curve.interval_count == 0) return true;
    double k = convergence(f);
    out->exact = (f->flags & SHELL_CONSTANT_NORMAL) || (f->unnormalised && k != 0.0);
    out->texel_rounding = curve.texel_rounding;
    out->height_rounding = height_rounding(&curve);
    for (int i = 0; i < curve.interval_count; i++) {
        curve_interval stretch = curve.intervals[i];
        if (!curve_clip_to_ray(&curve, ray, &stretch)) continue;
        shell_segment *s = &out->list[out->count];
        *s = (shell_segment){point_at(&curve, stretch.in, k), point_at(&curve, stretch.out, k)};
        if (!settle_weights(s)) {
            out->count = 0;
            return false;
        }
        out->count++;
    }
    return true;
}
