/* What a scene holds, by structure. */
#include "methods/method.h"
#include "scene/scene.h"

/* Whether an earlier object is the same surface. Quadratic in the worst case, but it is pointers. */
static bool surface_seen(const knurl_scene *scene, uint32_t object)
{
    for (uint32_t i = 0; i < object; i++)
        if (scene->objects[i].surface == scene->objects[object].surface) return true;
    return false;
}

static bool map_seen(const knurl_scene *scene, uint32_t object)
{
    const knurl_heightmap *map = knurl_surface_map(scene->objects[object].surface);
    for (uint32_t i = 0; i < object; i++) {
        const knurl_surface *surface = scene->objects[i].surface;
        if (surface && knurl_surface_map(surface) == map) return true;
    }
    return false;
}

knurl_scene_memory knurl_scene_get_memory(const knurl_scene *scene)
{
    knurl_scene_memory memory = {0};
    if (!scene) return memory;
    for (uint32_t i = 0; i < scene->object_count; i++) {
        const accel_object *object = &scene->objects[i];
        if (object->mesh) memory.mesh += object->mesh->bytes;
        if (!object->surface || surface_seen(scene, i)) continue;
        knurl_surface_info info;
        knurl_surface_get_info(object->surface, &info);
        memory.mesh += info.mesh_bytes;
        memory.shells += info.shell_bytes;
        if (map_seen(scene, i)) continue;
        memory.maps += info.map_bytes;
        knurl_heightmap_bytes parts = knurl_heightmap_memory(knurl_surface_map(object->surface));
        memory.map_parts.samples += parts.samples;
        memory.map_parts.levels += parts.levels;
        memory.map_parts.minmax += parts.minmax;
        memory.map_parts.rmip += parts.rmip;
        memory.map_parts.blocks += parts.blocks;
    }
    memory.bvh = accel_device_bytes(scene->device);
    return memory;
}
