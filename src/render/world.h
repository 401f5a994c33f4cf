/* render/world.h: everything a render reads, made once and then shared by all threads. */
#ifndef KNURL_SRC_RENDER_WORLD_H
#define KNURL_SRC_RENDER_WORLD_H

#include "render/albedo.h"
#include "render/camera.h"
#include "render/environment.h"
#include "render/light.h"
#include "render/texture.h"

#include <knurl/render.h>

/* Object-space bounds of a displaced instance, where its level of detail is decided. */
typedef struct world_instance {
    affine inverse;
    vec3 lower, upper;
    double lod_offset; /* metres: see trace_leave */
    bool displaced;
    bool mirrored; /* the transform turns the winding around */
} world_instance;

typedef struct world {
    const knurl_description *description;
    const knurl_scene *scene;
    const knurl_render_def *def;
    knurl_context *context;
    camera camera;
    pixel_filter filter;
    albedo_table albedo;
    texture_set *textures;
    environment *environment; /* NULL: none */
    light_set *lights;
    world_instance *instances;
    bool any_alpha; /* some hit may let a ray pass */
    double ao_distance;
    float fixed_lod;
    bool auto_lod;
} world;

knurl_status world_create(const knurl_description *description, const knurl_scene *scene,
                          const knurl_render_def *def, world **out, knurl_error *error);
void world_release(world *w);

static inline const knurl_description_material *world_material(const world *w, uint32_t object)
{
    return &w->description->materials[w->description->meshes[object].material];
}

#endif
