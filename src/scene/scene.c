/* Making a scene: objects, instances, commit, and what can be asked about it. */
#include "scene/scene.h"

knurl_status knurl_scene_create(knurl_context *context, knurl_scene **out, knurl_error *error)
{
    if (!out) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "scene is NULL");
    *out = NULL;
    if (!context) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "context is NULL");
    knurl_scene *scene = knurl_alloc_zero(context, sizeof *scene);
    if (!scene) return knurl_fail_memory(error, sizeof *scene, "a scene");
    scene->context = knurl_context_retain(context);
    scene->box = accel_box_empty();
    knurl_status status = accel_device_create(context, &scene->device, error);
    if (status != KNURL_OK) {
        knurl_scene_release(scene);
        return status;
    }
    *out = scene;
    return KNURL_OK;
}

void knurl_scene_release(knurl_scene *scene)
{
    if (!scene) return;
    knurl_context *context = scene->context;
    accel_bvh_release(scene->top);
    for (uint32_t i = 0; i < scene->object_count; i++) accel_object_clear(&scene->objects[i]);
    knurl_free(context, scene->objects);
    knurl_free(context, scene->instances);
    accel_device_release(scene->device);
    knurl_free(context, scene);
    knurl_context_release(context);
}

/* Whether the scene may still be added to. */
static knurl_status check_open(const knurl_scene *scene, knurl_error *error)
{
    if (!scene) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "scene is NULL");
    if (scene->committed) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "scene is committed already");
    return KNURL_OK;
}

/* Room for one more element of `size` bytes. */
static knurl_status grow(knurl_scene *scene, void **array, uint32_t count, uint32_t *capacity, size_t size,
                         const char *what, knurl_error *error)
{
    if (count < *capacity) return KNURL_OK;
    if (count >= UINT32_MAX / 2)
        return knurl_fail(error, KNURL_ERROR_LIMIT, "scene has %u %s already", count, what);
    uint32_t larger = count < 8 ? 8 : count * 2;
    void *moved = knurl_realloc(scene->context, *array, larger * size);
    if (!moved) return knurl_fail_memory(error, larger * size, what);
    *array = moved;
    *capacity = larger;
    return KNURL_OK;
}

static knurl_status add_object(knurl_scene *scene, const accel_object *object, uint32_t *number,
                               knurl_error *error)
{
    void *array = scene->objects;
    knurl_status status =
        grow(scene, &array, scene->object_count, &scene->object_capacity, sizeof *object, "objects", error);
    scene->objects = array;
    if (status != KNURL_OK) return status;
    if (number) *number = scene->object_count;
    scene->objects[scene->object_count++] = *object;
    return KNURL_OK;
}

knurl_status knurl_scene_add_surface(knurl_scene *scene, knurl_surface *surface, uint32_t *number,
                                     knurl_error *error)
{
    knurl_status status = check_open(scene, error);
    if (status != KNURL_OK) return status;
    if (!surface) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "surface is NULL");
    accel_object object = {.surface = surface};
    status = add_object(scene, &object, number, error);
    if (status == KNURL_OK) (void)knurl_surface_retain(surface);
    return status;
}

knurl_status knurl_scene_add_mesh(knurl_scene *scene, const knurl_mesh_view *mesh, uint32_t *number,
                                  knurl_error *error)
{
    knurl_status status = check_open(scene, error);
    if (status != KNURL_OK) return status;
    accel_object object = {0};
    status = accel_mesh_create(scene->context, mesh, &object.mesh, error);
    if (status == KNURL_OK) status = add_object(scene, &object, number, error);
    if (status != KNURL_OK) accel_mesh_release(object.mesh);
    return status;
}

static knurl_status add_instance(knurl_scene *scene, const scene_instance *instance, uint32_t *number,
                                 knurl_error *error)
{
    void *array = scene->instances;
    knurl_status status = grow(scene, &array, scene->instance_count, &scene->instance_capacity,
                               sizeof *instance, "instances", error);
    scene->instances = array;
    if (status != KNURL_OK) return status;
    if (number) *number = scene->instance_count;
    scene->instances[scene->instance_count++] = *instance;
    return KNURL_OK;
}

knurl_status knurl_scene_add_instance(knurl_scene *scene, uint32_t object, const double transform[12],
                                      uint32_t mask, uint32_t *number, knurl_error *error)
{
    knurl_status status = check_open(scene, error);
    if (status != KNURL_OK) return status;
    if (object >= scene->object_count)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "instance %u: object is %u, expected under %u",
                          scene->instance_count, object, scene->object_count);
    scene_instance instance = {.object = object, .mask = mask};
    if (!scene_instance_place(&instance, transform))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "instance %u: transform is singular or not finite, expected an invertible one "
                          "(first row %g %g %g %g)",
                          scene->instance_count, transform[0], transform[1], transform[2], transform[3]);
    return add_instance(scene, &instance, number, error);
}

knurl_status scene_add_hidden_instance(knurl_scene *scene, uint32_t object, knurl_error *error)
{
    return knurl_scene_add_instance(scene, object, NULL, 0, NULL, error);
}

static bool instance_bounds(const void *user, uint32_t number, accel_box *box)
{
    const knurl_scene *scene = user;
    const scene_instance *instance = &scene->instances[number];
    *box = instance->box;
    return instance->mask != 0 && !accel_box_is_empty(box);
}

/* Instances' boxes, those of one object or of all (UINT32_MAX), and what is above them. */
static knurl_status place_instances(knurl_scene *scene, uint32_t object, knurl_error *error)
{
    scene->box = accel_box_empty();
    for (uint32_t i = 0; i < scene->instance_count; i++) {
        scene_instance *instance = &scene->instances[i];
        if (object == UINT32_MAX || instance->object == object) {
            accel_box box = accel_object_bounds(&scene->objects[instance->object]);
            instance->box = scene_instance_box(instance, &box);
        }
        if (instance->mask) scene->box = accel_box_union(&scene->box, &instance->box);
    }
    accel_bvh_release(scene->top);
    scene->top = NULL;
    if (scene->instance_count <= SCENE_FEW_INSTANCES) return KNURL_OK;
    return accel_bvh_create(scene->device, scene->instance_count, instance_bounds, scene,
                            "the hierarchy of instances", &scene->top, error);
}

knurl_status knurl_scene_commit(knurl_scene *scene, knurl_error *error)
{
    knurl_status status = check_open(scene, error);
    if (status != KNURL_OK) return status;
    for (uint32_t i = 0; i < scene->object_count; i++) {
        accel_object *object = &scene->objects[i];
        if (object->bvh) continue; /* from a commit that failed further on */
        status = accel_object_build(object, scene->device, i, error);
        if (status != KNURL_OK) return status;
    }
    status = place_instances(scene, UINT32_MAX, error);
    scene->committed = status == KNURL_OK;
    return status;
}

knurl_status knurl_scene_update(knurl_scene *scene, uint32_t number, knurl_error *error)
{
    if (!scene) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "scene is NULL");
    if (number >= scene->object_count)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "scene update: object is %u, expected under %u",
                          number, scene->object_count);
    accel_object *object = &scene->objects[number];
    if (!object->surface || !object->bvh) return KNURL_OK; /* never changes; or the commit will see to it */
    accel_box before = accel_object_bounds(object);
    accel_bvh_release(object->bvh);
    object->bvh = NULL;
    bool committed = scene->committed;
    scene->committed = false;
    knurl_status status = accel_object_build(object, scene->device, number, error);
    if (status != KNURL_OK || !committed) return status;
    accel_box after = accel_object_bounds(object);
    if (!accel_box_equal(&before, &after)) status = place_instances(scene, number, error);
    scene->committed = status == KNURL_OK;
    return status;
}

void knurl_scene_bounds(const knurl_scene *scene, double lower[3], double upper[3])
{
    accel_box box = scene ? scene->box : accel_box_empty();
    v3_store(lower, box.lower);
    v3_store(upper, box.upper);
}

uint32_t knurl_scene_object_count(const knurl_scene *scene)
{
    return scene ? scene->object_count : 0;
}
uint32_t knurl_scene_instance_count(const knurl_scene *scene)
{
    return scene ? scene->instance_count : 0;
}

const knurl_surface *knurl_scene_surface(const knurl_scene *scene, uint32_t object)
{
    return scene && object < scene->object_count ? scene->objects[object].surface : NULL;
}
