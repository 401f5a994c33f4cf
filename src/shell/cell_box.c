/* Boxes of the surface over rectangles of texels; see cell_box.h. */
#include "shell/cell_box.h"

#include <float.h>

void cell_boxes_make(const triangle_frame *f, const knurl_ray *ray, cell_boxes *t)
{
    const double *m = f->inverse_uv;
    t->frame = f;
    t->origin = v3_sub(v3_load(ray->origin), f->base);
    t->inverse = v3_reciprocal(v3_load(ray->direction));
    t->px = v3_mad(v3_scale(f->pe, m[0]), m[2], f->pf);
    t->py = v3_mad(v3_scale(f->pe, m[1]), m[3], f->pf);
    t->nx = v3_mad(v3_scale(f->ne, m[0]), m[2], f->nf);
    t->ny = v3_mad(v3_scale(f->ne, m[1]), m[3], f->nf);
    t->nx_length = v3_length(t->nx);
    t->ny_length = v3_length(t->ny);
    double s = max_d(fabs(f->s0), fabs(f->s1));
    t->rounding = 1e-12 * (f->size + s) + 16.0 * DBL_EPSILON * v3_max_component(v3_abs(t->origin));
}

/* |N|^2 is convex, so it is bounded below by its tangent plane and above by adding the square of N's
 * movement. */
void cell_normal_range(const cell_boxes *t, vec3 n, double rx, double ry, double *low, double *high)
{
    *low = *high = 1.0;
    if (t->frame->unnormalised) return;
    double square = v3_dot(n, n);
    double drift = 2.0 * (fabs(v3_dot(n, t->nx)) * rx + fabs(v3_dot(n, t->ny)) * ry);
    double move = t->nx_length * rx + t->ny_length * ry;
    double floor_square = max_d(square - drift, 0.0), lowest = sqrt(square) - move;
    *low = sqrt(max_d(floor_square, lowest > 0.0 ? lowest * lowest : 0.0)) * (1.0 - 1e-15);
    *high = sqrt(square + drift + move * move) * (1.0 + 1e-15);
    *low = max_d(*low, 1e-3);
}

box_span cell_box_clip(const cell_boxes *t, double x0, double x1, double y0, double y1, knurl_range h)
{
    const triangle_frame *f = t->frame;
    double cx = 0.5 * (x0 + x1) - f->x[0], cy = 0.5 * (y0 + y1) - f->y[0], rx = 0.5 * (x1 - x0),
           ry = 0.5 * (y1 - y0);
    vec3 n = v3_mad(v3_mad(f->n[0], cx, t->nx), cy, t->ny), p = v3_mad(v3_scale(t->px, cx), cy, t->py);
    double low, high;
    cell_normal_range(t, n, rx, ry, &low, &high);
    double s0 = h.min < 0.0 ? h.min / low : h.min / high, s1 = h.max > 0.0 ? h.max / low : h.max / high;
    double sc = 0.5 * (s0 + s1), sr = 0.5 * (s1 - s0);
    vec3 center = v3_mad(p, sc, n);
    vec3 half = v3_scale(v3_abs(v3_mad(t->px, sc, t->nx)), rx);
    half = v3_mad(half, ry, v3_abs(v3_mad(t->py, sc, t->ny)));
    half = v3_mad(half, sr, v3_mad(v3_mad(v3_abs(n), rx, v3_abs(t->nx)), ry, v3_abs(t->ny)));
    half = v3_add(half, v3(t->rounding, t->rounding, t->rounding));
    vec3 to = v3_sub(center, t->origin);
    vec3 a = v3_mul(v3_sub(to, half), t->inverse), c = v3_mul(v3_add(to, half), t->inverse);
    vec3 near = v3_min(a, c), far = v3_max(a, c);
    double in = max_d(near.x, max_d(near.y, near.z)), out = min_d(far.x, min_d(far.y, far.z));
    double slack = 1e-14 * (fabs(in) + fabs(out));
    return (box_span){in - slack, out + slack, slack};
}
