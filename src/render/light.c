#include "render/light.h"

#include "render/warp.h"

#include <knurl/scene.h>

static const knurl_description_material *instance_material(const knurl_description *d, uint32_t instance)
{
    return &d->materials[d->meshes[d->instances[instance].mesh].material];
}

/* Importance of a material's emission, its texture left out. */
static double emission_power(const knurl_description_material *m)
{
    double e = fmax(m->emissive[0], fmax(m->emissive[1], m->emissive[2]));
    return e > 0.0 && isfinite(e) ? e : 0.0;
}

bool light_description_shines(const knurl_description *d)
{
    if (d->light_count > 0) return true;
    for (uint32_t i = 0; i < d->instance_count; i++)
        if (emission_power(instance_material(d, i)) > 0.0) return true;
    return false;
}

vec3 light_emission(const texture_set *textures, const knurl_description_material *m, const double st[2])
{
    vec3 e = v3_load(m->emissive);
    if (warp_is_black(e) || m->emissive_texture.image < 0) return e;
    return v3_mul(e, texture_lookup(textures, &m->emissive_texture, st, true).color);
}

double light_coverage(const texture_set *textures, const knurl_description_material *m, const double st[2])
{
    if (m->alpha_mode == KNURL_ALPHA_OPAQUE) return 1.0;
    double alpha = m->base_color[3];
    if (m->base_color_texture.image >= 0)
        alpha *= texture_lookup(textures, &m->base_color_texture, st, true).alpha;
    if (m->alpha_mode == KNURL_ALPHA_MASK) return alpha < m->alpha_cutoff ? 0.0 : 1.0;
    return warp_clamp(alpha, 0.0, 1.0);
}

static void triangle_corners(const knurl_description *d, light_triangle t, vec3 corner[3])
{
    const knurl_description_instance *instance = &d->instances[t.instance];
    const knurl_description_mesh *mesh = &d->meshes[instance->mesh];
    const affine *to_world = (const affine *)(const void *)instance->transform;
    for (int i = 0; i < 3; i++) {
        uint32_t vertex = mesh->triangles[3 * (size_t)t.triangle + (size_t)i];
        corner[i] = affine_point(to_world, v3_loadf(mesh->positions + 3 * (size_t)vertex));
    }
}

static bool is_area_light(const light_set *lights, const knurl_scene *scene, uint32_t instance)
{
    uint32_t object = (uint32_t)lights->description->instances[instance].mesh;
    return emission_power(instance_material(lights->description, instance)) > 0.0 &&
           knurl_scene_surface(scene, object) == NULL;
}

static void list_triangles(light_set *lights)
{
    const knurl_description *d = lights->description;
    size_t n = 0;
    lights->cumulative[0] = 0.0;
    for (uint32_t i = 0; i < d->instance_count; i++) {
        if (!lights->sampled[i]) continue;
        double power = emission_power(instance_material(d, i));
        for (uint32_t k = 0; k < d->meshes[d->instances[i].mesh].triangle_count; k++, n++) {
            vec3 p[3];
            lights->triangles[n] = (light_triangle){i, k};
            triangle_corners(d, lights->triangles[n], p);
            double area = 0.5 * v3_length(v3_cross(v3_sub(p[1], p[0]), v3_sub(p[2], p[0])));
            lights->cumulative[n + 1] = lights->cumulative[n] + (isfinite(area) ? area * power : 0.0);
        }
    }
    lights->total_power = lights->cumulative[n];
}

static knurl_status collect_triangles(light_set *lights, const knurl_scene *scene, knurl_error *error)
{
    const knurl_description *d = lights->description;
    lights->sampled = knurl_alloc_zero(lights->context, d->instance_count * sizeof(bool));
    if (!lights->sampled) return knurl_fail_memory(error, d->instance_count, "lights");
    for (uint32_t i = 0; i < d->instance_count; i++) {
        lights->sampled[i] = is_area_light(lights, scene, i);
        if (lights->sampled[i]) lights->triangle_count += d->meshes[d->instances[i].mesh].triangle_count;
    }
    if (lights->triangle_count == 0) return KNURL_OK;
    lights->triangles = knurl_alloc_array(lights->context, lights->triangle_count, sizeof(light_triangle));
    lights->cumulative = knurl_alloc_array(lights->context, lights->triangle_count + 1, sizeof(double));
    if (!lights->triangles || !lights->cumulative)
        return knurl_fail_memory(error, lights->triangle_count * 16, "emissive triangles");
    list_triangles(lights);
    return KNURL_OK;
}

knurl_status light_set_create(const knurl_description *description, const texture_set *textures,
                              const environment *sky, const knurl_scene *scene, light_set **out,
                              knurl_error *error)
{
    *out = NULL;
    light_set *lights = knurl_alloc_zero(description->context, sizeof *lights);
    if (!lights) return knurl_fail_memory(error, sizeof *lights, "lights");
    lights->context = description->context;
    lights->description = description;
    lights->textures = textures;
    lights->environment = sky;
    knurl_status status = collect_triangles(lights, scene, error);
    if (status != KNURL_OK) {
        light_set_release(lights);
        return status;
    }
    int groups = (sky != NULL) + (lights->total_power > 0.0) + (description->light_count > 0);
    lights->group_probability = groups ? 1.0 / groups : 0.0;
    *out = lights;
    return KNURL_OK;
}

void light_set_release(light_set *lights)
{
    if (!lights) return;
    knurl_free(lights->context, lights->triangles);
    knurl_free(lights->context, lights->cumulative);
    knurl_free(lights->context, lights->sampled);
    knurl_free(lights->context, lights);
}

static bool draw_environment(const light_set *lights, const double u[4], light_sample *sample)
{
    double pdf;
    sample->direction = environment_draw(lights->environment, u[0], u[1], &pdf);
    sample->distance = INFINITY;
    sample->radiance = environment_radiance(lights->environment, sample->direction);
    sample->pdf = pdf * lights->group_probability;
    sample->delta = false;
    return sample->pdf > 0.0;
}

static size_t find_triangle(const light_set *lights, double u)
{
    double target = u * lights->total_power;
    size_t low = 0, high = lights->triangle_count;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (lights->cumulative[middle] <= target)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static bool draw_triangle(const light_set *lights, vec3 point, const double u[4], light_sample *sample)
{
    const knurl_description *d = lights->description;
    light_triangle t = lights->triangles[find_triangle(lights, u[3])];
    vec3 p[3];
    triangle_corners(d, t, p);
    /* Uniform over the triangle. */
    double root = sqrt(u[0]), b1 = root * (1.0 - u[1]), b2 = root * u[1];
    vec3 e1 = v3_sub(p[1], p[0]), e2 = v3_sub(p[2], p[0]);
    vec3 to_light = v3_sub(v3_mad(v3_mad(p[0], b1, e1), b2, e2), point);
    sample->distance = v3_length(to_light);
    sample->direction = v3_normalize(to_light);
    sample->delta = false;
    vec3 normal = v3_normalize(v3_cross(e1, e2));
    sample->pdf = light_triangle_pdf(lights, t.instance, sample->distance, v3_dot(normal, sample->direction));
    if (!(sample->pdf > 0.0) || !isfinite(sample->pdf)) return false;
    const knurl_description_mesh *mesh = &d->meshes[d->instances[t.instance].mesh];
    const knurl_description_material *material = &d->materials[mesh->material];
    double st[2] = {0.0, 0.0}, weight[3] = {1.0 - b1 - b2, b1, b2};
    for (size_t i = 0; mesh->texcoords && i < 3; i++) {
        size_t vertex = mesh->triangles[3 * (size_t)t.triangle + i];
        st[0] += weight[i] * (double)mesh->texcoords[2 * vertex];
        st[1] += weight[i] * (double)mesh->texcoords[2 * vertex + 1];
    }
    sample->radiance = v3_scale(light_emission(lights->textures, material, st),
                                light_coverage(lights->textures, material, st));
    return true;
}

/* KHR_lights_punctual: range window and spot cone as the extension recommends. */
static double punctual_falloff(const knurl_description_light *light, double distance, vec3 direction,
                               vec3 axis)
{
    double falloff = 1.0 / (distance * distance);
    if (light->range > 0.0 && isfinite(light->range))
        falloff *= warp_clamp(1.0 - pow(distance / light->range, 4.0), 0.0, 1.0);
    if (light->kind != KNURL_LIGHT_SPOT) return falloff;
    double outer = cos(light->outer_cone), scale = 1.0 / fmax(1e-3, cos(light->inner_cone) - outer);
    double cone = warp_clamp((v3_dot(v3_neg(direction), axis) - outer) * scale, 0.0, 1.0);
    return falloff * cone * cone;
}

static bool evaluate_punctual(const knurl_description_light *light, vec3 point, light_sample *sample)
{
    const double *m = light->transform;
    vec3 axis = v3_normalize(v3(-m[2], -m[6], -m[10]));
    double falloff = 1.0;
    if (light->kind == KNURL_LIGHT_DIRECTIONAL) {
        sample->direction = v3_neg(axis);
        sample->distance = INFINITY;
    } else {
        vec3 to_light = v3_sub(v3(m[3], m[7], m[11]), point);
        sample->distance = v3_length(to_light);
        if (!(sample->distance > 0.0)) return false;
        sample->direction = v3_normalize(to_light);
        falloff = punctual_falloff(light, sample->distance, sample->direction, axis);
    }
    sample->radiance = v3_scale(v3_load(light->color), light->intensity * falloff);
    sample->delta = true;
    return v3_finite(sample->radiance) && !warp_is_black(sample->radiance);
}

static bool draw_punctual(const light_set *lights, vec3 point, const double u[4], light_sample *sample)
{
    const knurl_description *d = lights->description;
    double total = 0.0;
    for (uint32_t i = 0; i < d->light_count; i++)
        if (evaluate_punctual(&d->lights[i], point, sample)) total += v3_max_component(sample->radiance);
    if (!(total > 0.0)) return false;
    double target = u[3] * total, running = 0.0;
    light_sample candidate;
    for (uint32_t i = 0; i < d->light_count; i++) {
        if (!evaluate_punctual(&d->lights[i], point, &candidate)) continue;
        double importance = v3_max_component(candidate.radiance);
        *sample = candidate;
        sample->pdf = lights->group_probability * importance / total;
        running += importance;
        if (running > target) break;
    }
    return true;
}

bool light_draw(const light_set *lights, vec3 point, const double u[4], light_sample *sample)
{
    if (lights->group_probability == 0.0) return false;
    int group = (int)(u[2] / lights->group_probability);
    if (lights->environment && group-- == 0) return draw_environment(lights, u, sample);
    if (lights->total_power > 0.0 && group-- == 0) return draw_triangle(lights, point, u, sample);
    if (lights->description->light_count > 0) return draw_punctual(lights, point, u, sample);
    return false;
}

double light_environment_pdf(const light_set *lights, vec3 direction)
{
    return lights->group_probability * environment_pdf(lights->environment, direction);
}

double light_triangle_pdf(const light_set *lights, uint32_t instance, double distance, double cosine)
{
    if (!lights->sampled[instance] || !(lights->total_power > 0.0)) return 0.0;
    /* power = area * emission, so the density over area is emission / total. */
    double area_pdf = emission_power(instance_material(lights->description, instance)) / lights->total_power;
    return lights->group_probability * area_pdf * distance * distance / fabs(cosine);
}
