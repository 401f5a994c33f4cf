/* render/warp.h: maps from the unit square, and small vector helpers for shading. */
#ifndef KNURL_SRC_RENDER_WARP_H
#define KNURL_SRC_RENDER_WARP_H

#include "math/vec.h"

#define WARP_PI 3.14159265358979323846

static inline double warp_clamp(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}
static inline double warp_lerp(double a, double b, double t)
{
    return a + (b - a) * t;
}
static inline vec3 warp_mix(vec3 a, vec3 b, double t)
{
    return v3_add(v3_scale(a, 1.0 - t), v3_scale(b, t));
}
/* Rec. 709 */
static inline double warp_luminance(vec3 c)
{
    return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
}
static inline bool warp_is_black(vec3 c)
{
    return !(c.x > 0.0 || c.y > 0.0 || c.z > 0.0);
}

/* Orthonormal frame; z is the normal. */
typedef struct frame {
    vec3 x, y, z;
} frame;

/* Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017. */
static inline frame frame_from_normal(vec3 n)
{
    double sign = copysign(1.0, n.z);
    double a = -1.0 / (sign + n.z), b = n.x * n.y * a;
    return (frame){{1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}
static inline vec3 frame_to_local(const frame *f, vec3 v)
{
    return v3(v3_dot(f->x, v), v3_dot(f->y, v), v3_dot(f->z, v));
}
static inline vec3 frame_to_world(const frame *f, vec3 v)
{
    return v3_add(v3_add(v3_scale(f->x, v.x), v3_scale(f->y, v.y)), v3_scale(f->z, v.z));
}

/* Concentric map to the unit disk [Shirley and Chiu 1997]; keeps the strata together. */
static inline vec2 warp_disk(double u, double v)
{
    double a = 2.0 * u - 1.0, b = 2.0 * v - 1.0;
    if (a == 0.0 && b == 0.0) return (vec2){0.0, 0.0};
    double r, phi;
    if (fabs(a) > fabs(b)) {
        r = a;
        phi = WARP_PI / 4.0 * (b / a);
    } else {
        r = b;
        phi = WARP_PI / 2.0 - WARP_PI / 4.0 * (a / b);
    }
    return (vec2){r * cos(phi), r * sin(phi)};
}

/* Density cos / pi around +z. */
static inline vec3 warp_cosine_hemisphere(double u, double v)
{
    vec2 d = warp_disk(u, v);
    return v3(d.x, d.y, sqrt(fmax(0.0, 1.0 - d.x * d.x - d.y * d.y)));
}

#endif
