/* math/poly.h: quadratics c[0] + c[1] p + c[2] p^2 and their real roots. */
#ifndef KNURL_SRC_MATH_POLY_H
#define KNURL_SRC_MATH_POLY_H

#include <float.h>
#include <math.h>

typedef struct quadratic {
    double c[3];
} quadratic;

static inline double quadratic_at(const quadratic *q, double p)
{
    return q->c[0] + p * (q->c[1] + p * q->c[2]);
}

static inline double quadratic_slope(const quadratic *q, double p)
{
    return q->c[1] + 2.0 * p * q->c[2];
}

/* Real roots, cancellation-free (the larger in magnitude first by q = -(b + sign(b) sqrt(disc)) / 2,
 * the other from the product of roots). Returns 0, 1 or 2; an identically zero quadratic has none. */
static inline int quadratic_roots(const quadratic *q, double roots[2])
{
    double a = q->c[2], b = q->c[1], c = q->c[0];
    double discriminant = b * b - 4.0 * a * c;
    if (!(discriminant >= 0.0)) return 0;
    double s = -0.5 * (b + copysign(sqrt(discriminant), b));
    int count = 0;
    if (a != 0.0) {
        double r = s / a;
        if (isfinite(r)) roots[count++] = r;
    }
    if (s != 0.0) roots[count++] = c / s;
    return count;
}

/* Bernstein coefficients of q over [lo, hi]: the values of q there lie between their extremes. */
static inline void quadratic_bernstein(const quadratic *q, double lo, double hi, double b[3])
{
    b[0] = quadratic_at(q, lo);
    b[2] = quadratic_at(q, hi);
    b[1] = b[0] + 0.5 * (hi - lo) * quadratic_slope(q, lo);
}

#endif
