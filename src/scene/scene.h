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
knurl_ray scene_instance_ray(const scene_instance *instance, const knurl_ray *ray);
/* Takes a hit back to the world. */
void scene_instance_hit(const scene_instance *instance, knurl_hit *hit);

/* Adds an instance that nothing sees, to keep numbers in step. */
knurl_status scene_add_hidden_instance(knurl_scene *scene, uint32_t object, knurl_error *error);

#endif
