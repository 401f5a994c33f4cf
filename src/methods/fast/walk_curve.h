/* methods/fast/walk_curve.h: a ray's curve over a part, in floats. A part of walk.h.
 *
 * Of a part's curve three points are found by iteration; the quadratics through them are x, y (texels from
 * the part's corner) and z (height over that of code 0) as functions of u in [0, 1], with bounds on how far
 * the curve is from them. See fast.h for the maths. */
#ifndef KNURL_SRC_METHODS_FAST_WALK_CURVE_H
#define KNURL_SRC_METHODS_FAST_WALK_CURVE_H

#include "methods/fast/fast.h"
#include "methods/fast/lanes.h"

typedef struct kernel {
    fast_ray *ray;
    const fast_data *data;
    float tau_min, tau_max; /* rounded outwards */
    /* The ray in the part that is looked at: q = q0 + (tau - shift) q1. */
    double shift;
    vf4 q0, q1;
} kernel;

/* A curve over a part. */
typedef struct part_curve {
    const fast_part *part;
    const fast_patch *patch;
    vf4 c0, c1, c2;      /* lanes x, y, s, z */
    vf4 bow;             /* how far it is from its chord, at most */
    vf4 error;           /* and from the quadratics; lane 3 is that of z against heights */
    float start, length; /* tau - shift at u = 0, and from there to u = 1 */
    float u0, u1;        /* where it is over the part, inside the triangle */
} part_curve;

/* Of the lanes in `set`, not empty, the one with the least number. */
LANES_INLINE int first_lane(uint32_t set, const float *numbers)
{
    int first = __builtin_ctz(set);
    for (uint32_t rest = set & (set - 1); rest; rest &= rest - 1)
        if (numbers[__builtin_ctz(rest)] < numbers[first]) first = __builtin_ctz(rest);
    return first;
}

/* Floats at or below and at or above x, without the care for the last bit that float_up() takes. */
LANES_INLINE float float_below(double x)
{
    return (float)(x - 2.5e-7 * fabs(x));
}
LANES_INLINE float float_above(double x)
{
    return (float)(x + 2.5e-7 * fabs(x));
}

LANES_INLINE void enter_part(kernel *k, const fast_part *p)
{
    const fast_ray *r = k->ray;
    vec3 direction = v3_load(r->direction), to = v3_sub(v3_loadf(p->origin), v3_load(r->origin));
    k->shift = v3_dot(to, direction) * r->inverse_square;
    vec3 near = v3_sub(v3_scale(direction, k->shift), to);
    vf4 ix = load4(p->inverse[0]), iy = load4(p->inverse[1]), iz = load4(p->inverse[2]);
    k->q0 = mad4(ix, set4((float)near.x), mad4(iy, set4((float)near.y), iz * set4((float)near.z)));
    k->q1 =
        mad4(ix, set4((float)direction.x), mad4(iy, set4((float)direction.y), iz * set4((float)direction.z)));
}

/* Points of the curve at tau, from the part's centre: q = d + d_s (K_x d_x + K_y d_y) in two steps, d_x and
 * d_y from d_s by a 2 x 2 system, d_s from d_x and d_y by iteration. */
LANES_INLINE void curve_points(const kernel *k, const fast_part *p, vf4 tau, vf4 *x, vf4 *y, vf4 *s)
{
    vf4 qx = mad4(set4(k->q1[0]), tau, set4(k->q0[0]));
    vf4 qy = mad4(set4(k->q1[1]), tau, set4(k->q0[1]));
    vf4 qs = mad4(set4(k->q1[2]), tau, set4(k->q0[2]));
    vf4 dx = qx, dy = qy, ds = qs;
    const vf4 one = set4(1.0f);
    for (uint32_t i = 0; i < p->iterations; i++) {
        vf4 a = mad4(ds, set4(p->bend_x[0]), one), b = ds * set4(p->bend_y[0]);
        vf4 c = ds * set4(p->bend_x[1]), d = mad4(ds, set4(p->bend_y[1]), one);
        vf4 inverse = one / (a * d - b * c);
        dx = (d * qx - b * qy) * inverse;
        dy = (a * qy - c * qx) * inverse;
        ds = qs - ds * mad4(set4(p->bend_x[2]), dx, set4(p->bend_y[2]) * dy);
    }
    *x = dx;
    *y = dy;
    *s = ds;
}

/* |N| at the points. */
LANES_INLINE vf4 normal_lengths(const fast_patch *p, vf4 x, vf4 y)
{
    vf4 square = set4(0.0f);
    for (int i = 0; i < 3; i++) {
        vf4 n = mad4(set4(p->normal[1][i]), x, mad4(set4(p->normal[2][i]), y, set4(p->normal[0][i])));
        square = mad4(n, n, square);
    }
    return sqrt4(square);
}

/* How far the curve is from the quadratics through its points at u = 0, 1/2, 1: at most 0.0642 of the third
 * derivative of a function of 2 u - 1. With S, X, Y the half movements along the axes and w that of |N|,
 *     d'''  <= 6 (m_s b + S (|K_x| b_x + |K_y| b_y)),   b the bow, m_s = |K_x,s| X + |K_y,s| Y,
 *     |N|'' <= 2 w^2 + 2 |N_x| (b_x + b_y),   |N|''' <= 12 w (w^2 + |N_x| (b_x + b_y)),
 * by up to 1 / (1 - 0.6) more for the 2 x 2 system that d_x and d_y are from, and for |N| >= 1/2. */
static void set_error(part_curve *c, const fast_data *data, vf4 ends)
{
    const fast_patch *p = c->patch;
    vf4 bow = c->bow, half = mad4(set4(0.5f), abs4(ends), bow);
    vf4 bx = abs4(load4(c->part->bend_x)), by = abs4(load4(c->part->bend_y));
    float ms = bx[2] * half[0] + by[2] * half[1], across = bow[0] + bow[1];
    vf4 third = set4(ms) * bow + set4(half[2]) * (bx * set4(bow[0]) + by * set4(bow[1]));
    const vf4 texel_rounding = {4e-6f, 4e-6f, 0.0f, 0.0f};
    float side = (float)(16 << (2 * c->part->level));
    vf4 error = load4(c->part->error) + set4(1.7f) * third + texel_rounding * set4(side);
    float lower = c->part->s_min < 0.0f ? -c->part->s_min : c->part->s_min;
    float upper = c->part->s_max < 0.0f ? -c->part->s_max : c->part->s_max;
    float most = lower > upper ? lower : upper, move = p->normal_move;
    float w = move * (half[0] + half[1]), second = w * w + move * across;
    float z = 0.3f * (6.0f * bow[2] * w + 6.0f * half[2] * second + 12.0f * most * w * second);
    z += error[2] * p->normal_most + most * move * (error[0] + error[1]);
    error[3] = z + 0x1p-20f * most * p->normal_most + data->height_error;
    c->error = error;
}

/* Where the triangle is on a part: texels from the corner, and s from its middle. */
LANES_INLINE void part_extent(const fast_part *part, vf4 *lower, vf4 *upper)
{
    float unit = (float)(16 << (2 * part->level)) * (1.0f / 255.0f),
          middle = 0.5f * (part->s_min + part->s_max);
    *lower = (vf4){unit * (float)part->from_x, unit * (float)part->from_y, part->s_min - middle, -1.0f};
    *upper = (vf4){unit * (float)part->to_x, unit * (float)part->to_y, part->s_max - middle, 1.0f};
}

/* Clips u to where the chord, widened by the bow and the errors, is over the part and inside the triangle. */
static bool clip_to_part(part_curve *c, vf4 first, vf4 last)
{
    const fast_part *part = c->part;
    const fast_patch *p = c->patch;
    vf4 pad = c->bow + c->error, inverse = safe_inverse4(last - first), lower, upper;
    part_extent(part, &lower, &upper);
    vf4 a = (lower - pad - first) * inverse, b = (upper + pad - first) * inverse;
    vf4 in = min4(a, b), out = max4(a, b);
    /* Barycentrics at both ends. */
    vf4 e0 = load4(p->edge[0]), ex = load4(p->edge[1]), ey = load4(p->edge[2]);
    vf4 slack = mad4(abs4(ex), set4(pad[0]), mad4(abs4(ey), set4(pad[1]), load4(p->edge_error)));
    float cx = (float)part->corner_x, cy = (float)part->corner_y;
    vf4 f0 = mad4(ex, set4(first[0] + cx), mad4(ey, set4(first[1] + cy), e0 + slack));
    vf4 f1 = mad4(ex, set4(last[0] + cx), mad4(ey, set4(last[1] + cy), e0 + slack));
    const vf4 zero = set4(0.0f), one = set4(1.0f);
    if (mask4((f0 < zero) & (f1 < zero))) return false;
    vf4 cross = f0 / (f0 - f1);
    in = max4(select4(f0 < zero, cross, zero), in);
    out = min4(select4(f1 < zero, cross, one), out);
    float u0 = most3(in), u1 = least3(out);
    u0 = u0 > 0.0f ? u0 - 2e-6f : 0.0f;
    u1 = u1 < 1.0f ? u1 + 2e-6f : 1.0f;
    c->u0 = u0 > 0.0f ? u0 : 0.0f;
    c->u1 = u1;
    return u0 <= u1;
}

LANES_INLINE vf4 curve_value(const part_curve *c, float u)
{
    return mad4(mad4(c->c2, set4(u), c->c1), set4(u), c->c0);
}

LANES_INLINE double curve_tau(const kernel *k, const part_curve *c, float u)
{
    return k->shift + (double)c->start + (double)c->length * (double)u;
}

#endif
