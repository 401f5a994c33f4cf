/* capture_stage.c: cameras and lights, so that a capture can be looked at as its model was. */
#include "capture_gltf.h"

#include <math.h>

/* Columns of a 3 x 4 transform. */
static void split_transform(const double transform[12], double axes[3][3], double origin[3])
{
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) axes[k][i] = transform[4 * i + k];
        origin[i] = transform[4 * i + 3];
    }
}

static const char *name_or(const char *name, const char *other)
{
    return name && name[0] ? name : other;
}

static void add_camera(capture_gltf *g, const knurl_description_camera *c)
{
    double axes[3][3], origin[3];
    split_transform(c->transform, axes, origin);
    json_t *json = c->orthographic
                       ? json_pack("{s:s, s:{s:f, s:f, s:f, s:f}}", "type", "orthographic", "orthographic",
                                   "xmag", c->ymag, "ymag", c->ymag, "znear", 0.0, "zfar", 1e6)
                       : json_pack("{s:s, s:{s:f, s:f}}", "type", "perspective", "perspective", "yfov",
                                   c->yfov, "znear", 0.001);
    if (c->lens_radius > 0)
        capture_put(
            g, json, "extras",
            json_pack("{s:f, s:f}", "lens_radius", c->lens_radius, "focus_distance", c->focus_distance));
    const char *name = name_or(c->name, "camera");
    json_t *text = json_string(name);
    capture_put(g, json, "name", text ? text : json_string("camera"));
    int index = capture_append(g, "cameras", json);
    json_t *node = capture_add_node(g, text ? name : "camera", (const double(*)[3])axes, origin);
    capture_put(g, node, "camera", json_integer(index));
}

/* The camera of knurl_render for a scene without one, from its rays: those of the picture's corners. */
static bool framing_camera(const loaded_scene *loaded, knurl_description_camera *camera)
{
    enum { WIDTH = 48, HEIGHT = 27 }; /* 16 : 9, as the default picture */
    knurl_ray rays[WIDTH * HEIGHT];
    if (knurl_camera_rays(loaded->description, loaded->scene, -1, WIDTH, HEIGHT, rays, NULL) != KNURL_OK)
        return false;
    const double *a = rays[0].direction, *b = rays[WIDTH - 1].direction;
    const double *c = rays[WIDTH * (HEIGHT - 1)].direction, *d = rays[WIDTH * HEIGHT - 1].direction;
    double axes[3][3], lengths[3] = {0}; /* right, up, back */
    for (int i = 0; i < 3; i++) {
        axes[0][i] = b[i] + d[i] - a[i] - c[i];
        axes[1][i] = a[i] + b[i] - c[i] - d[i];
        axes[2][i] = -(a[i] + b[i] + c[i] + d[i]);
        for (int k = 0; k < 3; k++) lengths[k] += axes[k][i] * axes[k][i];
    }
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) camera->transform[4 * i + k] = axes[k][i] / sqrt(lengths[k]);
        camera->transform[4 * i + 3] = rays[0].origin[i];
    }
    camera->yfov = 2 * atan(sqrt(lengths[1] / lengths[2]) * HEIGHT / (HEIGHT - 1));
    return lengths[0] > 0 && lengths[1] > 0 && lengths[2] > 0;
}

void capture_add_cameras(capture_gltf *g, const loaded_scene *loaded)
{
    const knurl_description *d = loaded->description;
    for (uint32_t i = 0; i < d->camera_count; i++) add_camera(g, &d->cameras[i]);
    knurl_description_camera camera = {0};
    if (d->camera_count == 0 && framing_camera(loaded, &camera)) add_camera(g, &camera);
}

void capture_add_lights(capture_gltf *g, const knurl_description *description)
{
    static const char *const kinds[] = {"point", "spot", "directional"};
    for (uint32_t i = 0; i < description->light_count; i++) {
        const knurl_description_light *l = &description->lights[i];
        json_t *json = json_pack("{s:s, s:f}", "type", kinds[l->kind], "intensity", l->intensity);
        capture_put(g, json, "color", capture_numbers(g, l->color, 3));
        if (isfinite(l->range) && l->range > 0) capture_put(g, json, "range", json_real(l->range));
        if (l->kind == KNURL_LIGHT_SPOT)
            capture_put(
                g, json, "spot",
                json_pack("{s:f, s:f}", "innerConeAngle", l->inner_cone, "outerConeAngle", l->outer_cone));
        if (!g->lights) g->lights = json_array();
        capture_push(g, g->lights, json);
        double axes[3][3], origin[3];
        split_transform(l->transform, axes, origin);
        json_t *node = capture_add_node(g, "light", (const double(*)[3])axes, origin);
        capture_put(g, node, "extensions", json_pack("{s:{s:i}}", "KHR_lights_punctual", "light", (int)i));
    }
}
