/* Rays against a scene. */
#include "scene/scene.h"

typedef struct scene_trace {
    const knurl_scene *scene;
    const knurl_ray *ray;
    knurl_hit *hit; /* nearest so far, in its instance's space */
    double t;
    uint32_t instance; /* of that hit, or KNURL_NO_HIT */
    uint32_t steps;
} scene_trace;

static bool is_traceable(const knurl_scene *scene, const knurl_ray *ray)
{
    if (!scene || !scene->committed || !ray) return false;
    vec3 o = v3_load(ray->origin), d = v3_load(ray->direction);
    return v3_finite(o) && v3_finite(d) && v3_max_component(v3_abs(d)) > 0.0 && ray->tmin >= 0.0 &&
           ray->tmin <= ray->tmax;
}

/* The ray in an instance's space; false if it is masked out or misses the object's bounds. */
static bool prepare(const scene_trace *s, uint32_t number, double tmax, accel_local_ray *local)
{
    const scene_instance *instance = &s->scene->instances[number];
    if (!(instance->mask & s->ray->mask)) return false;
    local->ray = scene_instance_ray(instance, s->ray);
    local->ray.tmax = tmax;
    return accel_object_prepare(&s->scene->objects[instance->object], local);
}

static void intersect_instance(scene_trace *s, uint32_t number, const accel_local_ray *local)
{
    const accel_object *object = &s->scene->objects[s->scene->instances[number].object];
    knurl_hit hit;
    if (!accel_object_intersect(object, local, s->t, &hit, &s->steps)) return;
    /* The order of instances must not matter, so of two at the same t the lower number counts. */
    if (hit.t == s->t && number >= s->instance) return;
    s->t = hit.t;
    s->instance = number;
    *s->hit = hit;
}

static double visit_instance(void *user, uint32_t number, double tmax)
{
    scene_trace *s = user;
    accel_local_ray local;
    if (prepare(s, number, tmax, &local)) intersect_instance(s, number, &local);
    return fmin(tmax, s->t);
}

/* A few instances: near to far. */
static void intersect_few(scene_trace *s)
{
    accel_local_ray local[SCENE_FEW_INSTANCES];
    uint32_t order[SCENE_FEW_INSTANCES], count = 0;
    for (uint32_t i = 0; i < s->scene->instance_count; i++) {
        if (!prepare(s, i, s->ray->tmax, &local[i])) continue;
        uint32_t at = count++;
        for (; at > 0 && local[order[at - 1]].segment.t0 > local[i].segment.t0; at--)
            order[at] = order[at - 1];
        order[at] = i;
    }
    for (uint32_t k = 0; k < count && local[order[k]].segment.t0 <= s->t; k++)
        intersect_instance(s, order[k], &local[order[k]]);
}

bool knurl_scene_intersect(const knurl_scene *scene, const knurl_ray *ray, knurl_hit *hit)
{
    *hit = (knurl_hit){.triangle = KNURL_NO_HIT};
    if (!is_traceable(scene, ray)) return false;
    scene_trace s = {.scene = scene, .ray = ray, .hit = hit, .t = ray->tmax, .instance = KNURL_NO_HIT};
    if (!scene->top) {
        intersect_few(&s);
    } else {
        accel_segment segment;
        if (accel_bvh_clip(scene->top, v3_load(ray->origin), v3_load(ray->direction), ray->tmin, ray->tmax,
                           &segment))
            accel_bvh_traverse(scene->top, &segment, ray->tmax, false, visit_instance, &s);
    }
    hit->steps = s.steps;
    if (s.instance == KNURL_NO_HIT) return false;
    scene_instance_hit(&scene->instances[s.instance], hit);
    hit->instance = s.instance;
    hit->object = scene->instances[s.instance].object;
    return true;
}

static bool occludes(const scene_trace *s, uint32_t number)
{
    accel_local_ray local;
    return prepare(s, number, s->ray->tmax, &local) &&
           accel_object_occluded(&s->scene->objects[s->scene->instances[number].object], &local);
}

static double visit_occluder(void *user, uint32_t number, double tmax)
{
    scene_trace *s = user;
    if (!occludes(s, number)) return tmax;
    s->instance = number;
    return -INFINITY;
}

bool knurl_scene_occluded(const knurl_scene *scene, const knurl_ray *ray)
{
    if (!is_traceable(scene, ray)) return false;
    scene_trace s = {.scene = scene, .ray = ray, .instance = KNURL_NO_HIT};
    if (!scene->top) {
        for (uint32_t i = 0; i < scene->instance_count; i++)
            if (occludes(&s, i)) return true;
        return false;
    }
    accel_segment segment;
    if (accel_bvh_clip(scene->top, v3_load(ray->origin), v3_load(ray->direction), ray->tmin, ray->tmax,
                       &segment))
        accel_bvh_traverse(scene->top, &segment, ray->tmax, true, visit_occluder, &s);
    return s.instance != KNURL_NO_HIT;
}
