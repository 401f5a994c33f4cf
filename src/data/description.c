/* Life of a description: elements, warnings, final checks, and the command line's changes. */
#include "data/description.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { MAX_WARNINGS = 200, MAX_SHARED_IMAGES = 16384 };

static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

knurl_description *description_new(knurl_context *context, const char *path)
{
    knurl_description *d = knurl_alloc_zero(context, sizeof *d);
    if (!d) return NULL;
    d->context = knurl_context_retain(context);
    d->environment = description_no_texture();
    d->environment_intensity = 1.0;
    d->path = knurl_strdup(context, path);
    if (!d->path) {
        knurl_description_release(d);
        return NULL;
    }
    return d;
}

void description_clear_mesh(knurl_context *context, knurl_description_mesh *mesh)
{
    knurl_free(context, mesh->name);
    knurl_free(context, mesh->positions);
    knurl_free(context, mesh->normals);
    knurl_free(context, mesh->texcoords);
    knurl_free(context, mesh->directions);
    knurl_free(context, mesh->triangles);
    *mesh = (knurl_description_mesh){.material = -1};
}

void knurl_description_release(knurl_description *d)
{
    if (!d) return;
    knurl_context *context = d->context;
    for (uint32_t i = 0; i < d->mesh_count; i++) description_clear_mesh(context, &d->meshes[i]);
    for (uint32_t i = 0; i < d->image_count; i++) {
        knurl_free(context, d->images[i].name);
        knurl_free(context, d->images[i].path);
        knurl_free(context, d->images[i].bytes);
    }
    for (uint32_t i = 0; i < d->material_count; i++) knurl_free(context, d->materials[i].name);
    for (uint32_t i = 0; i < d->instance_count; i++) knurl_free(context, d->instances[i].name);
    for (uint32_t i = 0; i < d->camera_count; i++) knurl_free(context, d->cameras[i].name);
    for (uint32_t i = 0; i < d->light_count; i++) knurl_free(context, d->lights[i].name);
    for (uint32_t i = 0; i < d->warning_count; i++) knurl_free(context, d->warnings[i]);
    knurl_free(context, d->meshes);
    knurl_free(context, d->images);
    knurl_free(context, d->materials);
    knurl_free(context, d->instances);
    knurl_free(context, d->cameras);
    knurl_free(context, d->lights);
    knurl_free(context, d->warnings);
    knurl_free(context, d->path);
    knurl_free(context, d);
    knurl_context_release(context);
}

/* Room for one more element. The public struct has no capacities: arrays hold a power of two. */
static void *grow(knurl_description *d, void *array, uint32_t count, size_t size)
{
    if (count != 0 && (count & (count - 1)) != 0) return array;
    size_t bytes;
    if (count > INT32_MAX / 2 || knurl_mul_overflow(count ? (size_t)count * 2 : 1, size, &bytes)) return NULL;
    return knurl_realloc(d->context, array, bytes);
}

knurl_texture_ref description_no_texture(void)
{
    return (knurl_texture_ref){.image = -1, .uv_scale = {1.0, 1.0}};
}

knurl_description_mesh *description_append_mesh(knurl_description *d)
{
    knurl_description_mesh *array = grow(d, d->meshes, d->mesh_count, sizeof *array);
    if (!array) return NULL;
    d->meshes = array;
    array[d->mesh_count] = (knurl_description_mesh){.material = -1};
    return &array[d->mesh_count++];
}

knurl_description_image *description_append_image(knurl_description *d)
{
    knurl_description_image *array = grow(d, d->images, d->image_count, sizeof *array);
    if (!array) return NULL;
    d->images = array;
    array[d->image_count] = (knurl_description_image){0};
    return &array[d->image_count++];
}

knurl_description_material *description_append_material(knurl_description *d)
{
    knurl_description_material *array = grow(d, d->materials, d->material_count, sizeof *array);
    if (!array) return NULL;
    d->materials = array;
    array[d->material_count] = (knurl_description_material){
        .base_color = {0.8, 0.8, 0.8, 1.0},
        .base_color_texture = description_no_texture(),
        .roughness = 1.0,
        .metallic_roughness_texture = description_no_texture(),
        .emissive_texture = description_no_texture(),
        .ior = 1.5,
        .attenuation_color = {1.0, 1.0, 1.0},
        .attenuation_distance = INFINITY,
        .alpha_cutoff = 0.5,
        .double_sided = true,
        .displacement = description_no_texture(),
        .displacement_factor = 1.0,
    };
    return &array[d->material_count++];
}

knurl_description_instance *description_append_instance(knurl_description *d)
{
    knurl_description_instance *array = grow(d, d->instances, d->instance_count, sizeof *array);
    if (!array) return NULL;
    d->instances = array;
    array[d->instance_count] = (knurl_description_instance){0};
    memcpy(array[d->instance_count].transform, identity, sizeof identity);
    return &array[d->instance_count++];
}

knurl_description_camera *description_append_camera(knurl_description *d)
{
    knurl_description_camera *array = grow(d, d->cameras, d->camera_count, sizeof *array);
    if (!array) return NULL;
    d->cameras = array;
    array[d->camera_count] = (knurl_description_camera){.yfov = 0.7853981633974483, .ymag = 1.0};
    memcpy(array[d->camera_count].transform, identity, sizeof identity);
    return &array[d->camera_count++];
}

knurl_description_light *description_append_light(knurl_description *d)
{
    knurl_description_light *array = grow(d, d->lights, d->light_count, sizeof *array);
    if (!array) return NULL;
    d->lights = array;
    array[d->light_count] = (knurl_description_light){
        .color = {1.0, 1.0, 1.0}, .intensity = 1.0, .range = INFINITY, .outer_cone = 0.7853981633974483};
    memcpy(array[d->light_count].transform, identity, sizeof identity);
    return &array[d->light_count++];
}

void description_warn(knurl_description *d, const char *format, ...)
{
    if (d->warning_count > MAX_WARNINGS) return;
    char text[1024];
    if (d->warning_count == MAX_WARNINGS) {
        (void)snprintf(text, sizeof text, "more than %d warnings, the rest is not shown", MAX_WARNINGS);
    } else {
        va_list args;
        va_start(args, format);
        (void)vsnprintf(text, sizeof text, format, args);
        va_end(args);
    }
    knurl_log(d->context, KNURL_LOG_WARNING, "%s", text);
    /* A warning that does not fit in memory was at least logged. */
    char **array = grow(d, d->warnings, d->warning_count, sizeof *array);
    if (!array) return;
    d->warnings = array;
    array[d->warning_count] = knurl_strdup(d->context, text);
    if (array[d->warning_count]) d->warning_count++;
}

int32_t knurl_description_add_image(knurl_description *d, const char *path)
{
    if (!d || !path) return -1;
    /* One image for one file, so that a map used by many materials is loaded once. The bound keeps
     * hostile scenes with a million names from taking quadratic time. */
    for (uint32_t i = 0; i < d->image_count && i < MAX_SHARED_IMAGES; i++)
        if (d->images[i].path && strcmp(d->images[i].path, path) == 0) return (int32_t)i;
    knurl_description_image *image = description_append_image(d);
    if (!image) return -1;
    image->path = knurl_strdup(d->context, path);
    image->name = knurl_strdup(d->context, path);
    if (!image->path || !image->name) {
        knurl_free(d->context, image->path);
        knurl_free(d->context, image->name);
        d->image_count--;
        return -1;
    }
    return (int32_t)d->image_count - 1;
}

/* First value that is not finite, or count. A sum of products with 0 is NaN exactly when one is not
 * finite, which the compiler turns into vector code; the slow search runs for bad blocks only. */
static size_t first_not_finite(const float *values, size_t count)
{
    for (size_t begin = 0; begin < count; begin += 4096) {
        size_t end = count - begin < 4096 ? count : begin + 4096;
        float sum = 0.0f;
        for (size_t i = begin; i < end; i++) sum += values[i] * 0.0f;
        if (sum == 0.0f) continue;
        for (size_t i = begin; i < end; i++)
            if (!isfinite(values[i])) return i;
    }
    return count;
}

/* There is no length to fall back on, so a bad direction is an error and not a warning as with normals. */
static knurl_status check_directions(const knurl_description *d, uint32_t index, knurl_error *error)
{
    const knurl_description_mesh *m = &d->meshes[index];
    for (size_t i = 0; m->directions && i < m->vertex_count; i++) {
        const float *p = m->directions + 3 * i;
        bool finite = isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
        if (finite && (p[0] != 0.0f || p[1] != 0.0f || p[2] != 0.0f)) continue;
        return knurl_fail(
            error, KNURL_ERROR_INPUT,
            "%s: mesh %u (\"%s\"), vertex %zu: direction is (%g, %g, %g), expected finite numbers, not all 0",
            d->path, index, m->name ? m->name : "", i, (double)p[0], (double)p[1], (double)p[2]);
    }
    return KNURL_OK;
}

static knurl_status check_mesh(knurl_description *d, uint32_t index, knurl_error *error)
{
    knurl_description_mesh *m = &d->meshes[index];
    const char *name = m->name ? m->name : "";
    size_t n = m->vertex_count, at;
    if (n && (at = first_not_finite(m->positions, 3 * n)) < 3 * n) {
        const float *p = m->positions + at / 3 * 3;
        return knurl_fail(
            error, KNURL_ERROR_INPUT,
            "%s: mesh %u (\"%s\"), vertex %zu: position is (%g, %g, %g), expected finite numbers", d->path,
            index, name, at / 3, (double)p[0], (double)p[1], (double)p[2]);
    }
    if (n && m->texcoords && (at = first_not_finite(m->texcoords, 2 * n)) < 2 * n) {
        const float *p = m->texcoords + at / 2 * 2;
        return knurl_fail(
            error, KNURL_ERROR_INPUT,
            "%s: mesh %u (\"%s\"), vertex %zu: texture coordinates are (%g, %g), expected finite numbers",
            d->path, index, name, at / 2, (double)p[0], (double)p[1]);
    }
    if (n && m->normals && (at = first_not_finite(m->normals, 3 * n)) < 3 * n) {
        description_warn(d, "%s: mesh %u (\"%s\"), vertex %zu: normal is not finite; smooth normals are made",
                         d->path, index, name, at / 3);
        knurl_free(d->context, m->normals);
        m->normals = NULL;
    }
    knurl_status status = check_directions(d, index, error);
    if (status != KNURL_OK) return status;
    for (size_t i = 0; i < 3 * (size_t)m->triangle_count; i++) {
        if (m->triangles[i] < m->vertex_count) continue;
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s: mesh %u (\"%s\"), triangle %zu: vertex index %u, expected less than %u",
                          d->path, index, name, i / 3, m->triangles[i], m->vertex_count);
    }
    return KNURL_OK;
}

static knurl_status add_default_material(knurl_description *d, knurl_error *error)
{
    int32_t added = -1;
    for (uint32_t i = 0; i < d->mesh_count; i++) {
        int32_t *material = &d->meshes[i].material;
        if (*material >= 0 && (uint32_t)*material < d->material_count) continue;
        if (added < 0) {
            knurl_description_material *made = description_append_material(d);
            if (!made) return knurl_fail_memory(error, sizeof *made, "the default material");
            made->name = knurl_strdup(d->context, "default");
            if (!made->name) return knurl_fail_memory(error, 8, "the default material");
            added = (int32_t)d->material_count - 1;
        }
        *material = added;
    }
    return KNURL_OK;
}

knurl_status description_finish(knurl_description *d, knurl_error *error)
{
    for (uint32_t i = 0; i < d->mesh_count; i++) {
        knurl_status status = check_mesh(d, i, error);
        if (status != KNURL_OK) return status;
    }
    return add_default_material(d, error);
}

knurl_displacement_override knurl_displacement_override_default(void)
{
    return (knurl_displacement_override){.cookie = KNURL_COOKIE,
                                         .factor = NAN,
                                         .offset = NAN,
                                         .tile_u = NAN,
                                         .tile_v = NAN,
                                         .wrap_u = -1,
                                         .wrap_v = -1,
                                         .unnormalised = -1};
}

static knurl_status check_override(const knurl_displacement_override *o, knurl_error *error)
{
    if (!o || o->cookie != KNURL_COOKIE)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "override was not made by knurl_displacement_override_default()");
    const struct {
        const char *name;
        double value;
    } numbers[] = {
        {"factor", o->factor}, {"offset", o->offset}, {"tile_u", o->tile_u}, {"tile_v", o->tile_v}};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (isinf(numbers[i].value))
            return knurl_fail(error, KNURL_ERROR_ARGUMENT, "override: %s is %g, expected a finite number",
                              numbers[i].name, numbers[i].value);
    if (o->wrap_u < -1 || o->wrap_u > KNURL_WRAP_CLAMP || o->wrap_v < -1 || o->wrap_v > KNURL_WRAP_CLAMP)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "override: wrap is %d, %d, expected -1 to %d",
                          o->wrap_u, o->wrap_v, KNURL_WRAP_CLAMP);
    if (o->unnormalised < -1 || o->unnormalised > 1)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "override: unnormalised is %d, expected -1 to 1",
                          o->unnormalised);
    return KNURL_OK;
}

static void override_sampling(const knurl_displacement_override *o, knurl_texture_ref *ref)
{
    if (!isnan(o->tile_u)) ref->uv_scale[0] = o->tile_u;
    if (!isnan(o->tile_v)) ref->uv_scale[1] = o->tile_v;
    if (o->wrap_u >= 0) ref->wrap_u = (knurl_wrap)o->wrap_u;
    if (o->wrap_v >= 0) ref->wrap_v = (knurl_wrap)o->wrap_v;
}

static void override_material(const knurl_displacement_override *o, int32_t map, int32_t color,
                              knurl_description_material *m)
{
    if (o->remove) {
        m->displacement = description_no_texture();
        m->displacement_factor = 1.0;
        m->displacement_offset = 0.0;
        m->displacement_unnormalised = false;
    }
    if (map >= 0) m->displacement.image = map;
    if (!isnan(o->factor)) m->displacement_factor = o->factor;
    if (!isnan(o->offset)) m->displacement_offset = o->offset;
    if (o->unnormalised >= 0) m->displacement_unnormalised = o->unnormalised == 1;
    override_sampling(o, &m->displacement);
    if (color < 0) return;
    /* A colour map and a height map of one scan lie on each other: same tiling. */
    m->base_color_texture = description_no_texture();
    m->base_color_texture.image = color;
    override_sampling(o, &m->base_color_texture);
    for (int i = 0; i < 3; i++) m->base_color[i] = 1.0;
}

knurl_status knurl_description_override(knurl_description *d, const knurl_displacement_override *o,
                                        knurl_error *error)
{
    if (!d) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "description is NULL");
    knurl_status status = check_override(o, error);
    if (status != KNURL_OK) return status;
    int32_t map = -1, color = -1;
    if (o->map && (map = knurl_description_add_image(d, o->map)) < 0)
        return knurl_fail_memory(error, strlen(o->map), "the displacement map's name");
    if (o->color_map && (color = knurl_description_add_image(d, o->color_map)) < 0)
        return knurl_fail_memory(error, strlen(o->color_map), "the colour map's name");
    for (uint32_t i = 0; i < d->material_count; i++) override_material(o, map, color, &d->materials[i]);
    for (uint32_t i = 0; i < d->mesh_count; i++) {
        if (d->meshes[i].texcoords || map < 0) continue;
        description_warn(d,
                         "%s: mesh %u (\"%s\") has no texture coordinates: the displacement map's value at "
                         "(0, 0) displaces all of it",
                         d->path, i, d->meshes[i].name ? d->meshes[i].name : "");
    }
    return KNURL_OK;
}
