/* See near.h. */
#include "shell/near.h"

/* Origins further away than this many radii are moved. Rounding of the distance is 1e-10 of the radius here.
 */
static const double FAR = 0x1p20;

/* Methods form products of several direction components, so that very long and very short directions
 * would overflow. A power of two takes the length out of the direction and into t, without rounding. */
static void scale_direction(near_ray *n)
{
    double longest = v3_max_component(v3_abs(v3_load(n->ray->direction)));
    if ((longest >= 0x1p-64 && longest <= 0x1p64) || !(longest > 0.0) || !isfinite(longest)) return;
    n->exponent = ilogb(longest);
    n->copy = *n->ray;
    for (int i = 0; i < 3; i++) n->copy.direction[i] = ldexp(n->ray->direction[i], -n->exponent);
    n->copy.tmin = ldexp(n->ray->tmin, n->exponent);
    n->copy.tmax = ldexp(n->ray->tmax, n->exponent);
    n->ray = &n->copy;
}

bool near_ray_make(const knurl_ray *ray, vec3 centre, double radius, near_ray *n)
{
    n->ray = ray;
    n->t0 = 0.0;
    n->exponent = 0;
    scale_direction(n);
    vec3 to = v3_sub(centre, v3_load(n->ray->origin)), d = v3_load(n->ray->direction);
    if (v3_max_component(v3_abs(to)) <= FAR * radius) return true;
    double t0 = v3_dot(to, d) / v3_dot(d, d);
    vec3 start =
        v3(near_point(n->ray->origin[0], d.x, centre.x, t0), near_point(n->ray->origin[1], d.y, centre.y, t0),
           near_point(n->ray->origin[2], d.z, centre.z, t0));
    /* The ray's point nearest to the centre; t0 is rounded, which moves it along the ray. */
    double along = fabs(t0) * v3_length(d) * 0x1p-50;
    if (!isfinite(t0) || !(v3_length(start) <= 2.0 * radius + along)) return false;
    n->copy = *n->ray;
    n->ray = &n->copy;
    n->t0 = t0;
    v3_store(n->copy.origin, v3_add(centre, start));
    n->copy.tmin -= t0;
    n->copy.tmax -= t0;
    return n->copy.tmin <= n->copy.tmax;
}
