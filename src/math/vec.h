/* math/vec.h: small double-precision vectors. Plain expressions, no contraction. */
#ifndef KNURL_SRC_MATH_VEC_H
#define KNURL_SRC_MATH_VEC_H

#include <math.h>
#include <stdbool.h>

/* Rounds to float. Through memory, because GCC 12 at -O2 may drop the rounding of (double)(float)x when
 * it vectorises a group of them. */
static inline float to_float(double x)
{
    volatile float f = (float)x;
    return f;
}

/* The nearest floats not above and not below x. */
static inline float float_down(double x)
{
    float f = to_float(x);
    return (double)f > x ? nextafterf(f, -INFINITY) : f;
}
static inline float float_up(double x)
{
    float f = to_float(x);
    return (double)f < x ? nextafterf(f, INFINITY) : f;
}

/* One instruction each, unlike fmin and fmax, which must tell NaN apart: if one argument is NaN the
 * result is b. */
static inline double min_d(double a, double b)
{
    return a < b ? a : b;
}
static inline double max_d(double a, double b)
{
    return a > b ? a : b;
}

/* floor and ceil for |x| < 2^62, without the library call that they are where SSE 4.1 cannot be assumed. */
static inline double floor_d(double x)
{
    double whole = (double)(long long)x;
    return whole > x ? whole - 1.0 : whole;
}
static inline double ceil_d(double x)
{
    return -floor_d(-x);
}

typedef struct vec2 {
    double x, y;
} vec2;
typedef struct vec3 {
    double x, y, z;
} vec3;

static inline vec3 v3(double x, double y, double z)
{
    return (vec3){x, y, z};
}
static inline vec3 v3_load(const double p[3])
{
    return v3(p[0], p[1], p[2]);
}
static inline vec3 v3_loadf(const float *p)
{
    return v3((double)p[0], (double)p[1], (double)p[2]);
}
static inline void v3_store(double p[3], vec3 a)
{
    p[0] = a.x;
    p[1] = a.y;
    p[2] = a.z;
}
static inline vec3 v3_add(vec3 a, vec3 b)
{
    return v3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline vec3 v3_sub(vec3 a, vec3 b)
{
    return v3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline vec3 v3_mul(vec3 a, vec3 b)
{
    return v3(a.x * b.x, a.y * b.y, a.z * b.z);
}
static inline vec3 v3_scale(vec3 a, double s)
{
    return v3(a.x * s, a.y * s, a.z * s);
}
static inline vec3 v3_neg(vec3 a)
{
    return v3(-a.x, -a.y, -a.z);
}
/* a + s * b */
static inline vec3 v3_mad(vec3 a, double s, vec3 b)
{
    return v3(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z);
}
static inline double v3_dot(vec3 a, vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline vec3 v3_cross(vec3 a, vec3 b)
{
    return v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline double v3_det(vec3 a, vec3 b, vec3 c)
{
    return v3_dot(a, v3_cross(b, c));
}
static inline double v3_length(vec3 a)
{
    return sqrt(v3_dot(a, a));
}
/* 1 / a, finite where a component is zero or so small that its reciprocal would overflow. */
static inline vec3 v3_reciprocal(vec3 a)
{
    double x = fabs(a.x) < 1e-300 ? copysign(1e-300, a.x) : a.x;
    double y = fabs(a.y) < 1e-300 ? copysign(1e-300, a.y) : a.y;
    double z = fabs(a.z) < 1e-300 ? copysign(1e-300, a.z) : a.z;
    return v3(1.0 / x, 1.0 / y, 1.0 / z);
}
static inline vec3 v3_abs(vec3 a)
{
    return v3(fabs(a.x), fabs(a.y), fabs(a.z));
}
static inline vec3 v3_min(vec3 a, vec3 b)
{
    return v3(min_d(a.x, b.x), min_d(a.y, b.y), min_d(a.z, b.z));
}
static inline vec3 v3_max(vec3 a, vec3 b)
{
    return v3(max_d(a.x, b.x), max_d(a.y, b.y), max_d(a.z, b.z));
}
static inline double v3_max_component(vec3 a)
{
    return max_d(a.x, max_d(a.y, a.z));
}
static inline bool v3_finite(vec3 a)
{
    return isfinite(a.x) && isfinite(a.y) && isfinite(a.z);
}
/* Unit vector; a zero vector stays zero. */
static inline vec3 v3_normalize(vec3 a)
{
    /* Scaled first: squares of lengths under 1e-154 would vanish. */
    double m = max_d(fabs(a.x), max_d(fabs(a.y), fabs(a.z)));
    if (!(m > 0.0) || !isfinite(m)) return v3(0.0, 0.0, 0.0);
    a = v3(a.x / m, a.y / m, a.z / m);
    return v3_scale(a, 1.0 / v3_length(a));
}

/* 3 rows of 4, row-major: x' = M x + t. */
typedef struct affine {
    double m[12];
} affine;
static inline affine affine_identity(void)
{
    return (affine){{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
}
static inline vec3 affine_point(const affine *a, vec3 p)
{
    const double *m = a->m;
    return v3(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
              m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]);
}
static inline vec3 affine_vector(const affine *a, vec3 p)
{
    const double *m = a->m;
    return v3(m[0] * p.x + m[1] * p.y + m[2] * p.z, m[4] * p.x + m[5] * p.y + m[6] * p.z,
              m[8] * p.x + m[9] * p.y + m[10] * p.z);
}
/* Normals: multiply by the transpose of `inverse`, the inverse of the point transform. */
static inline vec3 affine_normal(const affine *inverse, vec3 n)
{
    const double *m = inverse->m;
    return v3(m[0] * n.x + m[4] * n.y + m[8] * n.z, m[1] * n.x + m[5] * n.y + m[9] * n.z,
              m[2] * n.x + m[6] * n.y + m[10] * n.z);
}
static inline double affine_det(const affine *a)
{
    const double *m = a->m;
    return v3_det(v3(m[0], m[4], m[8]), v3(m[1], m[5], m[9]), v3(m[2], m[6], m[10]));
}
/* false if not invertible. */
static inline bool affine_invert(const affine *a, affine *inverse)
{
    const double *m = a->m;
    vec3 c0 = v3(m[0], m[4], m[8]), c1 = v3(m[1], m[5], m[9]), c2 = v3(m[2], m[6], m[10]);
    double det = v3_det(c0, c1, c2);
    if (!(fabs(det) > 0.0) || !isfinite(det)) return false;
    vec3 r0 = v3_scale(v3_cross(c1, c2), 1.0 / det), r1 = v3_scale(v3_cross(c2, c0), 1.0 / det),
         r2 = v3_scale(v3_cross(c0, c1), 1.0 / det), t = v3(m[3], m[7], m[11]);
    *inverse = (affine){{r0.x, r0.y, r0.z, -v3_dot(r0, t), r1.x, r1.y, r1.z, -v3_dot(r1, t), r2.x, r2.y, r2.z,
                         -v3_dot(r2, t)}};
    return v3_finite(r0) && v3_finite(r1) && v3_finite(r2);
}

#endif
