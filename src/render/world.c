#include "render/world.h"

static bool has_holes(const knurl_description *d)
{
    for (uint32_t i = 0; i < d->material_count; i++)
        if (d->materials[i].alpha_mode != KNURL_ALPHA_OPAQUE) return true;
    return false;
}

/* The light comes from, in this order: the definition, the scene file, and, only where nothing shines,
 * the studio sky. */
static knurl_status make_environment(world *w, knurl_error *error)
{
    const knurl_render_def *def = w->def;
    const knurl_description *d = w->description;
    if (def->environment)
        return environment_create(w->context, (knurl_image *)def->environment, def->environment_intensity,
                                  def->environment_rotation, &w->environment, error);
    if (d->environment.image >= 0) {
        knurl_image *image = NULL;
        knurl_status status = knurl_description_load_image(d, d->environment.image, &image, error);
        if (status != KNURL_OK) return knurl_fail_prefix(error, status, "environment");
        status =
            environment_create(w->context, image, d->environment_intensity * def->environment_intensity,
                               d->environment_rotation + def->environment_rotation, &w->environment, error);
        knurl_image_release(image);
        return status;
    }
    if (light_description_shines(d)) return KNURL_OK;
    return environment_create_studio(w->context, def->environment_intensity, def->environment_rotation,
                                     &w->environment, error);
}

/* The level of detail that a ray's cone gives is repeated by the rays that leave its hit, but only up to
 * the rounding of float cones and boxes: a few 1e-7 levels. Between two levels the surface moves by at
 * most its height range. */
static double lod_offset(const affine *to_world, const knurl_surface_info *info)
{
    double stretch = 0.0;
    for (int i = 0; i < 12; i++)
        if (i % 4 != 3) stretch += to_world->m[i] * to_world->m[i];
    return 4e-6 * (info->height_max - info->height_min) * sqrt(stretch);
}

static knurl_status describe_instances(world *w, knurl_error *error)
{
    const knurl_description *d = w->description;
    w->instances = knurl_alloc_zero(w->context, d->instance_count * sizeof *w->instances);
    if (!w->instances) return knurl_fail_memory(error, d->instance_count * sizeof *w->instances, "instances");
    for (uint32_t i = 0; i < d->instance_count; i++) {
        world_instance *instance = &w->instances[i];
        const affine *to_world = (const affine *)(const void *)d->instances[i].transform;
        if (!affine_invert(to_world, &instance->inverse))
            return knurl_fail(error, KNURL_ERROR_INPUT, "instance %u: its transform has no inverse", i);
        instance->mirrored = affine_det(to_world) < 0.0;
        const knurl_surface *surface = knurl_scene_surface(w->scene, (uint32_t)d->instances[i].mesh);
        instance->displaced = surface != NULL;
        if (!surface) continue;
        knurl_surface_info info;
        knurl_surface_get_info(surface, &info);
        instance->lower = v3_load(info.lower);
        instance->upper = v3_load(info.upper);
        if (w->auto_lod) instance->lod_offset = lod_offset(to_world, &info);
    }
    return KNURL_OK;
}

static double occlusion_distance(const world *w)
{
    if (w->def->ao_distance > 0.0) return w->def->ao_distance;
    double lower[3], upper[3];
    knurl_scene_bounds(w->scene, lower, upper);
    double diagonal = v3_length(v3_sub(v3_load(upper), v3_load(lower)));
    return isfinite(diagonal) ? 0.1 * diagonal : 1.0;
}

knurl_status world_create(const knurl_description *description, const knurl_scene *scene,
                          const knurl_render_def *def, world **out, knurl_error *error)
{
    *out = NULL;
    world *w = knurl_alloc_zero(description->context, sizeof *w);
    if (!w) return knurl_fail_memory(error, sizeof *w, "the renderer");
    w->description = description;
    w->scene = scene;
    w->def = def;
    w->context = description->context;
    w->any_alpha = has_holes(description);
    w->ao_distance = occlusion_distance(w);
    w->auto_lod = def->lod_mode == KNURL_LOD_AUTO;
    w->fixed_lod = def->lod_mode == KNURL_LOD_FIXED ? (float)def->lod : 0.0f;
    pixel_filter_build(&w->filter);
    albedo_build(w->context, &w->albedo);
    knurl_status status =
        camera_choose(description, scene, def->camera, def->width, def->height, &w->camera, error);
    if (status == KNURL_OK) status = describe_instances(w, error);
    if (status == KNURL_OK) status = texture_set_create(description, &w->textures, error);
    if (status == KNURL_OK) status = make_environment(w, error);
    if (status == KNURL_OK)
        status = light_set_create(description, w->textures, w->environment, scene, &w->lights, error);
    if (status != KNURL_OK) {
        world_release(w);
        return status;
    }
    *out = w;
    return KNURL_OK;
}

void world_release(world *w)
{
    if (!w) return;
    light_set_release(w->lights);
    environment_release(w->environment);
    texture_set_release(w->textures);
    knurl_free(w->context, w->instances);
    knurl_free(w->context, w);
}
