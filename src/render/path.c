/* Unidirectional path tracing: at every vertex one light is sampled and one direction is scattered,
 * weighted by the power heuristic [Veach and Guibas 1995]. */
#include "render/integrator.h"

typedef struct path {
    trace *trace;
    vec3 throughput, radiance;
    knurl_ray ray;
    vec3 last_vertex;   /* where the ray scattered last */
    double scatter_pdf; /* of the ray's direction; 0 after the camera and after delta scattering */
    int32_t depth;      /* scattering events so far */
} path;

/* Sobol groups per vertex; group 0 belongs to the camera. */
enum { GROUPS_PER_VERTEX = 2, GROUP_LIGHT = 1, GROUP_SCATTER = 2, ROULETTE_DEPTH = 4 };

static sample4 vertex_sample(const path *p, uint32_t group)
{
    return sampler_get(&p->trace->sampler, (uint32_t)p->depth * GROUPS_PER_VERTEX + group);
}

static double power_heuristic(double a, double b)
{
    if (!(b > 0.0)) return 1.0;
    double r = b / a;
    return 1.0 / (1.0 + r * r);
}

/* `bounces`: scattering events between the camera and the light. Light that came by more than one is
 * what the clamp is for. */
static void add_light(path *p, vec3 light, int32_t bounces)
{
    light = v3_mul(light, p->throughput);
    double limit = p->trace->world->def->clamp, most = v3_max_component(light);
    if (!v3_finite(light)) return;
    if (bounces > 1 && limit > 0.0 && most > limit) light = v3_scale(light, limit / most);
    p->radiance = v3_add(p->radiance, light);
}

static void add_environment(path *p)
{
    const world *w = p->trace->world;
    vec3 direction = v3_load(p->ray.direction);
    if (p->depth == 0) {
        add_light(p, integrator_background(w, direction), 0);
        return;
    }
    if (!w->environment) return;
    double weight = 1.0;
    if (p->scatter_pdf > 0.0)
        weight = power_heuristic(p->scatter_pdf, light_environment_pdf(w->lights, direction));
    add_light(p, v3_scale(environment_radiance(w->environment, direction), weight), p->depth);
}

static void add_emission(path *p, const surface_point *s, const knurl_hit *hit)
{
    if (warp_is_black(s->emission)) return;
    double weight = 1.0;
    if (p->scatter_pdf > 0.0) {
        double distance = v3_length(v3_sub(s->position, p->last_vertex));
        double cosine = v3_dot(s->ng, v3_load(p->ray.direction));
        weight = power_heuristic(
            p->scatter_pdf, light_triangle_pdf(p->trace->world->lights, hit->instance, distance, cosine));
    }
    add_light(p, v3_scale(s->emission, weight), p->depth);
}

/* Beer and Lambert: a ray that hits a transmissive surface from behind went through its medium. */
static void attenuate(path *p, const surface_point *s)
{
    const knurl_description_material *m = s->material;
    if (s->outside || !(m->transmission > 0.0)) return;
    if (!(m->attenuation_distance > 0.0) || !isfinite(m->attenuation_distance)) return;
    double exponent = v3_length(v3_sub(s->position, p->last_vertex)) / m->attenuation_distance;
    vec3 c = v3_load(m->attenuation_color);
    p->throughput = v3_mul(p->throughput, v3(pow(warp_clamp(c.x, 0.0, 1.0), exponent),
                                             pow(warp_clamp(c.y, 0.0, 1.0), exponent),
                                             pow(warp_clamp(c.z, 0.0, 1.0), exponent)));
}

/* Directions must agree on the side about both normals: what is reflected by the shading normal but
 * goes through the surface, or the reverse, is dropped. */
static bool sides_agree(const surface_point *s, vec3 direction, double local_z)
{
    return v3_dot(s->ng, direction) * local_z > 0.0;
}

static void sample_light(path *p, const surface_point *s, const bsdf *b, const knurl_hit *hit,
                         double cone_width)
{
    const world *w = p->trace->world;
    sample4 u = vertex_sample(p, GROUP_LIGHT);
    light_sample light;
    if (!light_draw(w->lights, s->position, u.u, &light) || warp_is_black(light.radiance)) return;
    vec3 wi = frame_to_local(&s->shading, light.direction);
    if (!sides_agree(s, light.direction, wi.z)) return;
    double pdf;
    vec3 f = bsdf_evaluate(b, wi, &pdf);
    if (warp_is_black(f)) return;
    knurl_ray shadow =
        trace_leave(w, hit, light.direction, light.direction, cone_width, (double)p->ray.cone_spread);
    if (isfinite(light.distance)) {
        /* From the ray's own origin, which is a little off the surface. */
        vec3 target = v3_mad(s->position, light.distance, light.direction);
        vec3 way = v3_sub(target, v3_load(shadow.origin));
        v3_store(shadow.direction, v3_normalize(way));
        shadow.tmax = v3_length(way) * (1.0 - 1e-9);
    }
    if (trace_occluded(p->trace, &shadow)) return;
    double weight = light.delta ? 1.0 : power_heuristic(light.pdf, pdf);
    add_light(p, v3_scale(v3_mul(f, light.radiance), weight / light.pdf), p->depth + 1);
}

/* Cones widen by the spread of the lobe: Akenine-Moller et al., "Improved Shader and Texture Level of
 * Detail Using Ray Cones", JCGT 10(1), 2021, approximate it from curvature and roughness; here a lobe of
 * GGX alpha adds alpha / 4 radians, a quarter radian for diffuse, and curvature adds nothing. */
static double lobe_spread(const bsdf *b, const bsdf_sample *sample)
{
    if (sample->delta) return 0.0;
    if (sample->wi.z < 0.0) return 0.25 * b->glass_alpha;
    bool even = v3_max_component(b->diffuse) > 0.0;
    return 0.25 * (even ? 1.0 : b->alpha);
}

static bool scatter(path *p, const surface_point *s, const bsdf *b, const knurl_hit *hit, double cone_width)
{
    sample4 u = vertex_sample(p, GROUP_SCATTER);
    bsdf_sample sample;
    if (!bsdf_draw(b, u.u[2], u.u[0], u.u[1], &sample)) return false;
    vec3 direction = v3_normalize(frame_to_world(&s->shading, sample.wi));
    if (!sides_agree(s, direction, sample.wi.z)) return false;
    p->throughput = v3_mul(p->throughput, sample.weight);
    double spread = (double)p->ray.cone_spread + lobe_spread(b, &sample);
    p->ray = trace_leave(p->trace->world, hit, direction, direction, cone_width, spread);
    p->last_vertex = s->position;
    p->scatter_pdf = sample.delta ? 0.0 : sample.pdf;
    p->depth++;
    if (p->depth > ROULETTE_DEPTH) {
        double survival = fmin(0.95, v3_max_component(p->throughput));
        if (!(u.u[3] < survival)) return false;
        p->throughput = v3_scale(p->throughput, 1.0 / survival);
    }
    return true;
}

vec3 path_radiance(trace *t, const knurl_ray *ray, const knurl_hit *first)
{
    path p = {.trace = t, .throughput = v3(1, 1, 1), .ray = *ray, .last_vertex = v3_load(ray->origin)};
    knurl_hit hit;
    bool found = first != NULL;
    if (found) hit = *first;
    for (;;) {
        if (!found) {
            add_environment(&p);
            break;
        }
        surface_point s = surface_make(t->world, &hit, v3_load(p.ray.direction));
        attenuate(&p, &s);
        add_emission(&p, &s, &hit);
        if (p.depth >= t->world->def->max_depth) break;
        bsdf b = bsdf_make(&t->world->albedo, &s.parameters, s.wo, s.outside);
        double cone_width = trace_cone_width(t->world, &p.ray, &hit);
        sample_light(&p, &s, &b, &hit, cone_width);
        if (!scatter(&p, &s, &b, &hit, cone_width)) break;
        found = trace_nearest(t, RAY_SCATTERED, &p.ray, &hit);
    }
    return p.radiance;
}
