/* render/integrator.h: radiance along one camera ray, per integrator. */
#ifndef KNURL_SRC_RENDER_INTEGRATOR_H
#define KNURL_SRC_RENDER_INTEGRATOR_H

#include "render/surface.h"

/* `hit` is NULL when the camera ray met nothing. */
typedef vec3 integrator_fn(trace *t, const knurl_ray *ray, const knurl_hit *hit);

vec3 path_radiance(trace *t, const knurl_ray *ray, const knurl_hit *hit);
vec3 ambient_occlusion(trace *t, const knurl_ray *ray, const knurl_hit *hit);
vec3 primary_radiance(trace *t, const knurl_ray *ray, const knurl_hit *hit);

/* What a camera ray sees behind everything: the environment, or the background that hides it. */
vec3 integrator_background(const world *w, vec3 direction);

#endif
