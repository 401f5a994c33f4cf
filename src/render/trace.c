#include "render/trace.h"

#include "render/warp.h"

/* Clocks cost as much as short rays: only some calls are timed. */
enum { TIME_EVERY = 64, MAX_HOLES = 256 };

static double start_timing(const trace_stats *stats, ray_class kind)
{
    return stats->count[kind] % TIME_EVERY == 0 ? knurl_seconds() : -1.0;
}

static void stop_timing(trace_stats *stats, ray_class kind, double started)
{
    stats->count[kind]++;
    if (started < 0.0) return;
    stats->seconds[kind] += knurl_seconds() - started;
    stats->timed[kind]++;
}

static bool intersect(trace *t, ray_class kind, const knurl_ray *ray, knurl_hit *hit)
{
    double started = start_timing(t->stats, kind);
    bool found = knurl_scene_intersect(t->world->scene, ray, hit);
    stop_timing(t->stats, kind, started);
    return found;
}

/* Holes are decided by a number that belongs to the sample, so that any thread decides alike. */
static bool passes(const trace *t, const knurl_hit *hit, uint32_t piece)
{
    const knurl_description_material *m = world_material(t->world, hit->object);
    if (m->alpha_mode == KNURL_ALPHA_OPAQUE) return false;
    double coverage = light_coverage(t->world->textures, m, hit->st);
    return coverage < 1.0 && sampler_hash(&t->sampler, t->segment, piece) >= coverage;
}

bool trace_nearest(trace *t, ray_class kind, knurl_ray *ray, knurl_hit *hit)
{
    uint32_t steps = 0;
    vec3 direction = v3_load(ray->direction);
    bool found = false;
    t->segment++;
    for (uint32_t i = 0; i < MAX_HOLES; i++) {
        found = intersect(t, kind, ray, hit);
        steps += hit->steps;
        if (!found || !t->world->any_alpha || !passes(t, hit, i)) break;
        found = false;
        double tmax = ray->tmax - hit->t;
        if (!(tmax > 0.0)) break;
        *ray = trace_leave(t->world, hit, direction, direction, trace_cone_width(t->world, ray, hit),
                           (double)ray->cone_spread);
        ray->tmax = tmax;
    }
    hit->steps = steps;
    if (kind == RAY_PRIMARY) t->stats->primary_steps += steps;
    return found;
}

bool trace_occluded(trace *t, knurl_ray *ray)
{
    if (t->world->any_alpha) {
        knurl_hit hit;
        return trace_nearest(t, RAY_SHADOW, ray, &hit);
    }
    double started = start_timing(t->stats, RAY_SHADOW);
    bool occluded = knurl_scene_occluded(t->world->scene, ray);
    stop_timing(t->stats, RAY_SHADOW, started);
    return occluded;
}

/* Where the ray enters a box, not before `tmin`. */
static double box_entry(const world_instance *instance, const knurl_ray *ray)
{
    vec3 o = affine_point(&instance->inverse, v3_load(ray->origin));
    vec3 d = affine_vector(&instance->inverse, v3_load(ray->direction));
    double origin[3], direction[3], lower[3], upper[3], entry = ray->tmin;
    v3_store(origin, o);
    v3_store(direction, d);
    v3_store(lower, instance->lower);
    v3_store(upper, instance->upper);
    for (int axis = 0; axis < 3; axis++) {
        if (direction[axis] == 0.0) continue;
        double a = (lower[axis] - origin[axis]) / direction[axis];
        double b = (upper[axis] - origin[axis]) / direction[axis];
        entry = fmax(entry, fmin(a, b));
    }
    return entry;
}

double trace_cone_width(const world *w, const knurl_ray *ray, const knurl_hit *hit)
{
    if (!w->auto_lod) return 0.0;
    const world_instance *instance = &w->instances[hit->instance];
    double t = instance->displaced ? box_entry(instance, ray) : hit->t;
    return (double)ray->cone_width + t * (double)ray->cone_spread;
}

knurl_ray trace_leave(const world *w, const knurl_hit *hit, vec3 side, vec3 direction, double cone_width,
                      double cone_spread)
{
    vec3 ng = v3_load(hit->ng);
    double offset = 2.0 * hit->error + w->instances[hit->instance].lod_offset;
    if (v3_dot(side, ng) < 0.0) offset = -offset;
    double origin[3], along[3];
    v3_store(origin, v3_mad(v3_load(hit->position), offset, ng));
    v3_store(along, direction);
    knurl_ray ray = knurl_ray_make(origin, along);
    ray.lod = w->fixed_lod;
    if (w->auto_lod) {
        ray.cone_width = (float)cone_width;
        ray.cone_spread = (float)cone_spread;
    }
    return ray;
}
