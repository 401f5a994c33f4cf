/* Ambient occlusion, and the headlight view without secondary rays. */
#include "render/integrator.h"

vec3 integrator_background(const world *w, vec3 direction)
{
    if (w->def->environment_hidden || !w->environment) return v3_load(w->def->background);
    return environment_radiance(w->environment, direction);
}

/* Unoccluded share of the cosine-weighted hemisphere, one direction per sample. */
vec3 ambient_occlusion(trace *t, const knurl_ray *ray, const knurl_hit *hit)
{
    if (!hit) return v3_load(t->world->def->background);
    surface_point s = surface_make(t->world, hit, v3_load(ray->direction));
    sample4 u = sampler_get(&t->sampler, 1);
    vec3 direction = v3_normalize(frame_to_world(&s.shading, warp_cosine_hemisphere(u.u[0], u.u[1])));
    if (!(v3_dot(direction, s.ng) > 0.0)) return v3(0, 0, 0);
    double width = trace_cone_width(t->world, ray, hit);
    knurl_ray shadow =
        trace_leave(t->world, hit, direction, direction, width, (double)ray->cone_spread + 0.25);
    shadow.tmax = t->world->ao_distance;
    return trace_occluded(t, &shadow) ? v3(0, 0, 0) : v3(1, 1, 1);
}

vec3 primary_radiance(trace *t, const knurl_ray *ray, const knurl_hit *hit)
{
    if (!hit) return v3_load(t->world->def->background);
    surface_point s = surface_make(t->world, hit, v3_load(ray->direction));
    return v3_add(s.emission, v3_scale(s.parameters.base, s.wo.z));
}
