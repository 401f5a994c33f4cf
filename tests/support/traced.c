/* support/traced.c: oracle_def to knurl_scene. */
#include "traced.h"

#include <stdio.h>
#include <string.h>

static knurl_wrap wrap_of(oracle_wrap wrap)
{
    return wrap == ORACLE_REPEAT   ? KNURL_WRAP_REPEAT
           : wrap == ORACLE_MIRROR ? KNURL_WRAP_MIRROR
                                   : KNURL_WRAP_CLAMP;
}

static knurl_status make_map(traced *t, const oracle_def *def, knurl_heightmap **map, knurl_error *error)
{
    knurl_image *image = NULL;
    knurl_pixel_format format = def->format == ORACLE_U8    ? KNURL_PIXEL_U8
                                : def->format == ORACLE_U16 ? KNURL_PIXEL_U16
                                                            : KNURL_PIXEL_F32;
    knurl_status status =
        knurl_image_create(t->context, def->width, def->height, 1, format, def->samples, &image, error);
    if (status != KNURL_OK) return status;
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    status = knurl_heightmap_create(t->context, &map_def, map, error);
    knurl_image_release(image);
    return status;
}

static knurl_status make_surface(traced *t, const oracle_def *def, const char *method, knurl_heightmap *map,
                                 knurl_error *error)
{
    knurl_surface_def surface = knurl_surface_def_default();
    surface.mesh = (knurl_mesh_view){
        def->positions,      def->normals, def->texcoords, def->vertex_count, def->triangles,
        def->triangle_count, NULL};
    knurl_displacement *d = &surface.displacement;
    *d = knurl_displacement_default();
    d->map = map;
    d->factor = def->factor;
    d->offset = def->offset;
    d->wrap_u = wrap_of(def->wrap_u);
    d->wrap_v = wrap_of(def->wrap_v);
    memcpy(d->uv_offset, def->uv_offset, sizeof d->uv_offset);
    memcpy(d->uv_scale, def->uv_scale, sizeof d->uv_scale);
    d->uv_rotation = def->uv_rotation;
    d->unnormalised = def->unnormalised;
    surface.method = method;
    return knurl_surface_create(t->context, &surface, &t->surface, error);
}

static knurl_status make_scene(traced *t, knurl_error *error)
{
    uint32_t object = 0, instance = 0;
    knurl_status status = knurl_scene_create(t->context, &t->scene, error);
    if (status == KNURL_OK) status = knurl_scene_add_surface(t->scene, t->surface, &object, error);
    if (status == KNURL_OK)
        status = knurl_scene_add_instance(t->scene, object, NULL, UINT32_MAX, &instance, error);
    if (status == KNURL_OK) status = knurl_scene_commit(t->scene, error);
    return status;
}

bool traced_make(const oracle_def *def, const char *method, int threads, traced *out)
{
    knurl_error error = {.message = ""};
    knurl_heightmap *map = NULL;
    knurl_context_def context = knurl_context_def_default();
    memset(out, 0, sizeof *out);
    out->lod = (float)def->lod;
    context.threads = threads;
    knurl_status status = knurl_context_create(&context, &out->context, &error);
    if (status == KNURL_OK) status = make_map(out, def, &map, &error);
    if (status == KNURL_OK) status = make_surface(out, def, method, map, &error);
    if (status == KNURL_OK) status = make_scene(out, &error);
    knurl_heightmap_release(map);
    if (status == KNURL_OK) return true;
    printf("knurl: %s: %s\n", knurl_status_name(status), error.message);
    traced_free(out);
    return false;
}

void traced_free(traced *t)
{
    knurl_scene_release(t->scene);
    knurl_surface_release(t->surface);
    knurl_context_release(t->context);
    memset(t, 0, sizeof *t);
}

knurl_ray traced_ray(const traced *t, const oracle_ray *ray)
{
    knurl_ray out = knurl_ray_make(ray->origin, ray->direction);
    out.tmin = ray->tmin;
    out.tmax = ray->tmax;
    out.lod = t->lod;
    return out;
}
