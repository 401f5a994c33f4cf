/* scene/scene.h: the parts of a scene. */
#ifndef KNURL_SRC_SCENE_SCENE_H
#define KNURL_SRC_SCENE_SCENE_H

#include "accel/object.h"

#include <knurl/scene.h>

/* Up to this many instances are sorted by where a ray enters them; more get a hierarchy. */
enum { SCENE_FEW_INSTANCES = 4 };

typedef struct scene_instance {
    uint32_t object, mask;
    bool identity;
    /* Object to world: x = M p + translation. The inverse is kept apart from the translation, so
     * that far from the origin rays are moved before they are turned: O' = M^-1 (O - translation). */
    affine to_world, inverse; /* the inverse's own translation is 0 */
    vec3 translation;
    double sign;          /* -1 if it mirrors */
    double norm;          /* bound on the stretch of any vector (Frobenius norm of M) */
    double inverse_norm;  /* the same of the inverse */
    double inverse_scale; /* 1 / cube root of |det M|: what a world length is in the object's space */
    accel_box box;        /* in the world */
} scene_instance;

struct knurl_scene {
    knurl_context *context;
    accel_device *device;
    accel_object *objects;
    scene_instance *instances;
    uint32_t object_count, object_capacity;
    uint32_t instance_count, instance_capacity;
    accel_bvh *top; /* over instances, if there are more than a few */
    accel_box box;
    bool committed;
};

/* Fills all but object, mask and box; false if the transform is not finite or not invertible. */
bool scene_instance_place(scene_instance *instance, const double transform[12]);
/* World box of an object's box; empty for an empty one. */
accel_box scene_instance_box(const scene_instance *instance, const accel_box *box);
/* Takes a world ray into the instance's space; t is shared. */
void scene_instance_move_ray(const scene_instance *instance, knurl_ray *ray);
/* Takes a hit back to the world. */
void scene_instance_move_hit(const scene_instance *instance, knurl_hit *hit);

/* What is written for a miss. A constant to copy from: compilers clear structs of this size slowly. */
static const knurl_hit scene_no_hit = {.triangle = KNURL_NO_HIT};

/* Whether the scene is ready and the ray has direction and range. */
static inline bool scene_can_trace(const knurl_scene *scene, const knurl_ray *ray)
{
    const double *o = ray->origin, *d = ray->direction;
    /* x - x is 0 for finite x, else NaN, which is not >= 0 */
    const double finite =
        (o[0] - o[0]) + (o[1] - o[1]) + (o[2] - o[2]) + (d[0] - d[0]) + (d[1] - d[1]) + (d[2] - d[2]);
    return scene->committed && finite >= 0.0 && fabs(d[0]) + fabs(d[1]) + fabs(d[2]) > 0.0 &&
           ray->tmin >= 0.0 && ray->tmin <= ray->tmax;
}

/* The ray in an instance's space; false if it is masked out or misses the object's bounds. */
static inline bool scene_prepare(const knurl_scene *scene, uint32_t number, const knurl_ray *ray,
                                 knurl_ray *local, accel_segment *segment)
{
    const scene_instance *instance = &scene->instances[number];
    if (!(instance->mask & ray->mask)) return false;
    *local = *ray;
    if (!instance->identity) scene_instance_move_ray(instance, local);
    const accel_object *object = &scene->objects[instance->object];
    if (scene->instance_count == 1 && object->whole && !(ray->cone_width > 0.0f || ray->cone_spread > 0.0f)) {
        /* Nothing to put in order: the surface clips rays to its bounds itself. */
        segment->t0 = ray->tmin;
        segment->t1 = ray->tmax;
        return true;
    }
    return accel_object_prepare(&scene->objects[instance->object], local, segment);
}

/* Makes a hit in the space of its instance one in the world. */
static inline void scene_finish_hit(const knurl_scene *scene, uint32_t number, knurl_hit *hit)
{
    const scene_instance *instance = &scene->instances[number];
    if (!instance->identity) scene_instance_move_hit(instance, hit);
    hit->instance = number;
    hit->object = instance->object;
}

/* Up to ACCEL_GROUP rays against a scene without a top level; hits and answers as ray by ray. `order`: the
 * rays' numbers in all three arrays; NULL: 0, 1, ... */
void scene_intersect_group(const knurl_scene *scene, const knurl_ray *rays, const uint32_t *order,
                           size_t count, knurl_hit *hits);
void scene_occluded_group(const knurl_scene *scene, const knurl_ray *rays, const uint32_t *order,
                          size_t count, uint8_t *occluded);

/* Numbers of `count` rays in an order in which neighbours go alike; NULL if they are in one already. It is
 * kept in `scratch`, which has room for twice as many numbers. */
const uint32_t *scene_order(const knurl_scene *scene, const knurl_ray *rays, size_t count, uint64_t *scratch);

/* Adds an instance that nothing sees, to keep numbers in step. */
knurl_status scene_add_hidden_instance(knurl_scene *scene, uint32_t object, knurl_error *error);

#endif
