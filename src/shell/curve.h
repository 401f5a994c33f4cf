/* shell/curve.h: a ray inside the shell of one base triangle, as an explicit curve.
 *
 * For a fixed unnormalised height s the shell is the planar triangle V_i(s) = P_i + s N_i, which the
 * ray's line meets in one point. With V_i seen along the ray (two coordinates across it) that point's
 * barycentrics are b_i = q_i / W, q_i = V_j x V_k and W = q_0 + q_1 + q_2, all quadratic in s. So the
 * ray projected into texture space (RMIP 2023, section 4.2, there in the implicit form of Eq. 3) is
 * a rational quadratic curve of the parameter s; the prism's bilinear sides are the roots of q_i,
 * and turning points are the roots of x' W - x W', which is quadratic too.
 *
 * Where the ray nearly lies in an offset plane (W close to 0 along all of it), s is a bad
 * parameter and the depth t a good one: there b and s are quadratics of t up to a small remainder, and
 * W = 1. Triangles with one constant normal always use t: shell space is then affine, the curve a line.
 *
 * Where either form is not exact to rounding (a remainder, or a small W that amplifies rounding), the
 * quadratics only say where to look, and a Newton step of the inversion at the parameter's t says what is
 * there. */
#ifndef KNURL_SRC_SHELL_CURVE_H
#define KNURL_SRC_SHELL_CURVE_H

#include "math/poly.h"
#include "shell/shell.h"

enum { CURVE_MAX_INTERVALS = 8 };

/* A stretch of the curve inside the prism. in -> out follows the ray (t grows); in may be the
 * larger parameter. An end at a side of the prism lies past the side by the rounding of the side's
 * place. */
typedef struct curve_interval {
    double in, out;
    double t_in, t_out;
} curve_interval;

typedef struct ray_curve {
    quadratic w, b1, b2;           /* b = (b1, b2) / w */
    quadratic x, y;                /* texel coordinates times w */
    quadratic s;                   /* unnormalised height; used only when by_depth */
    bool by_depth;                 /* parameter is the depth from depth_origin in object lengths, else s */
    bool refine;                   /* points take a Newton step */
    const triangle_frame *frame;   /* for the step */
    vec3 origin, direction;        /* the ray, relative to vertex 0 */
    double depth_p[3], depth_n[3]; /* depth of P_i - O and N_i along the ray, in ray parameter units */
    double depth_origin;           /* by_depth: t = depth_origin + parameter * depth_scale */
    double depth_scale;
    double barycentric_rounding;                   /* bound on the error of b along the intervals */
    double height_rounding;                        /* the same for s */
    double texel_rounding;                         /* bound on the error of x and y at a parameter */
    double texel_remainder;                        /* how far the quadratics x and y may be from that */
    double height_remainder;                       /* the same for s at a parameter */
    curve_interval intervals[CURVE_MAX_INTERVALS]; /* front to back */
    int interval_count;
    bool unreliable; /* could not be followed: use shell_subdivide() */
} ray_curve;

typedef struct curve_point {
    double b1, b2, s, x, y;
} curve_point;

/* A cheap test before: whether the ray surely passes the prism by, and with it every point of S. True of
 * folded shells too: a point of S at barycentrics b and height s has q_i(s) = b_i W(s). */
bool ray_misses_prism(const triangle_frame *frame, const knurl_ray *ray);

/* Finds the curve and its stretches inside the prism. The curve refers to the frame. */
void ray_curve_make(const triangle_frame *frame, const knurl_ray *ray, ray_curve *curve);

/* How far from one of its ends, as a signed parameter step inwards, the side that ends a stretch may
 * truly be; 0 if that end is not at a side. */
double curve_end_zone(const ray_curve *curve, const curve_interval *stretch, bool first);

curve_point curve_at_refined(const ray_curve *curve, double p);

static inline curve_point curve_at(const ray_curve *c, double p)
{
    if (c->refine) return curve_at_refined(c, p);
    double inverse = c->by_depth ? 1.0 : 1.0 / quadratic_at(&c->w, p);
    return (curve_point){quadratic_at(&c->b1, p) * inverse, quadratic_at(&c->b2, p) * inverse,
                         c->by_depth ? quadratic_at(&c->s, p) : p, quadratic_at(&c->x, p) * inverse,
                         quadratic_at(&c->y, p) * inverse};
}

static inline double curve_depth(const ray_curve *c, double p)
{
    if (c->by_depth) return c->depth_origin + p * c->depth_scale;
    double inverse = 1.0 / quadratic_at(&c->w, p);
    double b1 = quadratic_at(&c->b1, p) * inverse, b2 = quadratic_at(&c->b2, p) * inverse;
    double d0 = c->depth_p[0] + p * c->depth_n[0];
    return d0 + b1 * (c->depth_p[1] + p * c->depth_n[1] - d0) + b2 * (c->depth_p[2] + p * c->depth_n[2] - d0);
}

/* Parameter between in and out where the curve reaches ray parameter t: point-wise inversion
 * (RMIP 2023, section 4.1), a cubic in s solved by guarded Newton steps. Clamped to the stretch. */
double curve_invert(const ray_curve *curve, double in, double out, double t);

/* Parameter between a and b where `coordinate` (curve->x or curve->y) equals k, knowing that it is
 * monotone there: the curve against a texel line (RMIP 2023, section 4.3). Always in [a, b]. */
double curve_cross(const ray_curve *curve, const quadratic *coordinate, double k, double a, double b);

/* Turning points of a coordinate strictly between a and b, in the order from a to b; at most 2. */
int curve_turning_points(const ray_curve *curve, const quadratic *coordinate, double a, double b,
                         double turning[2]);

#endif
