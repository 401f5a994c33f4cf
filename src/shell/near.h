/* shell/near.h: rays whose numbers methods would choke on, made into ordinary ones without a change of line.
 */
#ifndef KNURL_SRC_SHELL_NEAR_H
#define KNURL_SRC_SHELL_NEAR_H

#include "math/vec.h"

#include <knurl/surface.h>

/* a - b in two parts whose sum is exact (Knuth 1969, TwoSum). */
static inline double near_difference(double a, double b, double *rest)
{
    double sum = a - b, bb = sum - a;
    *rest = (a - (sum - bb)) + (-b - bb);
    return sum;
}

/* One coordinate of the ray's point at parameter t relative to `base`: rounded once, and relative to the
 * result, however far away the origin is. */
static inline double near_point(double origin, double direction, double base, double t)
{
    double rest, relative = near_difference(origin, base, &rest);
    return fma(t, direction, relative) + rest;
}

/* A ray that starts near the surface and has a direction of ordinary length. It is the caller's with
 * t_caller = (t0 + t) * 2^-exponent. */
typedef struct near_ray {
    knurl_ray copy;
    const knurl_ray *ray; /* &copy, or the caller's where nothing had to be changed */
    double t0;
    int exponent;
} near_ray;

/* False if the ray passes the ball (centre, radius) by, or is beyond numbers. All shells of a surface give
 * the same centre and radius, so that they see the same ray. */
bool near_ray_make(const knurl_ray *ray, vec3 centre, double radius, near_ray *out);

static inline double near_ray_caller_t(const near_ray *near, double t)
{
    t += near->t0;
    return near->exponent != 0 ? ldexp(t, -near->exponent) : t;
}

#endif
