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

static const accel_object *object_of(const knurl_scene *scene, uint32_t number)
{
    return &scene->objects[scene->instances[number].object];
}

static void intersect_instance(scene_trace *s, uint32_t number, knurl_ray *ray, const accel_segment *segment)
{
    knurl_hit hit;
    ray->tmax = s->t;
    if (!accel_object_intersect(object_of(s->scene, number), ray, segment, &hit, &s->steps)) return;
    /* The order of instances must not matter, so of two at the same t the lower number counts. */
    if (hit.t == s->t && number >= s->instance) return;
    s->t = hit.t;
    s->instance = number;
    *s->hit = hit;
}

static double visit_instance(void *user, uint32_t number, double tmax)
{
    scene_trace *s = user;
    knurl_ray ray;
    accel_segment segment;
    knurl_ray world = *s->ray;
    world.tmax = tmax;
    if (scene_prepare(s->scene, number, &world, &ray, &segment))
        intersect_instance(s, number, &ray, &segment);
    return fmin(tmax, s->t);
}

/* A few instances: near to far. */
static void intersect_few(scene_trace *s)
{
    knurl_ray rays[SCENE_FEW_INSTANCES];
    accel_segment segments[SCENE_FEW_INSTANCES];
    uint32_t order[SCENE_FEW_INSTANCES], count = 0;
    for (uint32_t i = 0; i < s->scene->instance_count; i++) {
        if (!scene_prepare(s->scene, i, s->ray, &rays[i], &segments[i])) continue;
        uint32_t at = count++;
        for (; at > 0 && segments[order[at - 1]].t0 > segments[i].t0; at--) order[at] = order[at - 1];
        order[at] = i;
    }
    for (uint32_t k = 0; k < count && segments[order[k]].t0 <= s->t; k++)
        intersect_instance(s, order[k], &rays[order[k]], &segments[order[k]]);
}

/* The common case of one instance: the hit goes to its place at once. */
static bool intersect_only(const knurl_scene *scene, const knurl_ray *ray, knurl_hit *hit)
{
    knurl_ray local;
    accel_segment segment;
    uint32_t steps = 0;
    bool found = scene_prepare(scene, 0, ray, &local, &segment) &&
                 accel_object_intersect(object_of(scene, 0), &local, &segment, hit, &steps);
    if (found)
        scene_finish_hit(scene, 0, hit);
    else
        *hit = scene_no_hit;
    hit->steps = steps;
    return found;
}

static void intersect_all(scene_trace *s)
{
    const knurl_ray *ray = s->ray;
    accel_segment segment;
    if (accel_bvh_clip(s->scene->top, v3_load(ray->origin), v3_load(ray->direction), ray->tmin, ray->tmax,
                       &segment))
        accel_bvh_traverse(s->scene->top, &segment, ray->tmax, false, visit_instance, s);
}

bool knurl_scene_intersect(const knurl_scene *scene, const knurl_ray *ray, knurl_hit *hit)
{
    if (!scene || !ray || !scene_can_trace(scene, ray)) {
        *hit = scene_no_hit;
        return false;
    }
    if (scene->instance_count == 1) return intersect_only(scene, ray, hit);
    scene_trace s = {.scene = scene, .ray = ray, .hit = hit, .t = ray->tmax, .instance = KNURL_NO_HIT};
    *hit = scene_no_hit;
    if (scene->top)
        intersect_all(&s);
    else
        intersect_few(&s);
    hit->steps = s.steps;
    if (s.instance == KNURL_NO_HIT) return false;
    scene_finish_hit(scene, s.instance, hit);
    return true;
}

static bool occludes(const scene_trace *s, uint32_t number)
{
    knurl_ray ray;
    accel_segment segment;
    return scene_prepare(s->scene, number, s->ray, &ray, &segment) &&
           accel_object_occluded(object_of(s->scene, number), &ray, &segment);
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
    if (!scene || !ray || !scene_can_trace(scene, ray)) return false;
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
