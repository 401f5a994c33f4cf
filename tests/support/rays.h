/* support/rays.h: repeatable families of rays that aim at what breaks intersection methods. */
#ifndef KNURL_TESTS_RAYS_H
#define KNURL_TESTS_RAYS_H

#include "scenes.h"

typedef enum ray_family {
    RAYS_TO_SURFACE = 0, /* from outside towards points of the displaced surface */
    RAYS_CHORD,          /* between random points of a sphere around the scene */
    RAYS_GRAZE_BASE,     /* along the base triangle at an angle of 0.1 down to 1e-9 */
    RAYS_GRAZE_SURFACE,  /* along the displaced surface at an angle of 0.1 down to 1e-9 */
    RAYS_AXIS,           /* parallel to an axis, towards the surface */
    RAYS_AXIS_PLANE,     /* parallel to an axis, two coordinates taken from a base vertex */
    RAYS_SHELL,          /* starting between the lowest and the highest height of a triangle */
    RAYS_INSIDE,         /* starting near the centre */
    RAYS_VERTEX,         /* at displaced base vertices */
    RAYS_EDGE,           /* at displaced base edges */
    RAYS_TEXEL,          /* at displaced corners of texel cells */
    RAYS_WINDOW,         /* with a random [tmin, tmax] */
    RAYS_LENGTH,         /* direction of length 1e-6 to 1e6 */
    RAYS_FAMILIES
} ray_family;

const char *ray_family_name(ray_family family);
/* Ray `index` of a family; the same for the same arguments on every machine and thread. */
oracle_ray ray_make(const truth_scene *scene, const oracle *o, ray_family family, uint64_t index);

#endif
