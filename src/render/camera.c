#include "render/camera.h"

#include "base/base.h"
#include "render/warp.h"

knurl_status camera_from_description(const knurl_description_camera *source, int32_t width, int32_t height,
                                     camera *out, knurl_error *error)
{
    const double *m = source->transform;
    camera c = {.width = width, .height = height, .orthographic = source->orthographic};
    c.origin = v3(m[3], m[7], m[11]);
    c.forward = v3_normalize(v3(-m[2], -m[6], -m[10]));
    c.right = v3_normalize(v3_cross(c.forward, v3(m[1], m[5], m[9])));
    c.up = v3_cross(c.right, c.forward);
    const char *name = source->name ? source->name : "?";
    if (!v3_finite(c.origin) || !(v3_length(c.right) > 0.5))
        return knurl_fail(error, KNURL_ERROR_INPUT, "camera %s: its transform has no axes", name);
    if (source->orthographic) {
        if (!(source->ymag > 0.0))
            return knurl_fail(error, KNURL_ERROR_INPUT, "camera %s: ymag is %g, expected > 0", name,
                              source->ymag);
        c.half_height = source->ymag;
    } else {
        if (!(source->yfov > 0.0) || !(source->yfov < WARP_PI))
            return knurl_fail(error, KNURL_ERROR_INPUT, "camera %s: yfov is %g, expected 0 to pi", name,
                              source->yfov);
        c.half_height = tan(0.5 * source->yfov);
    }
    c.half_width = c.half_height * width / height;
    c.lens_radius = source->lens_radius > 0.0 && source->focus_distance > 0.0 ? source->lens_radius : 0.0;
    c.focus_distance = source->focus_distance;
    *out = c;
    return KNURL_OK;
}

/* Distance from `centre` at which every corner of the box is inside the frustum. */
static double framing_distance(const camera *c, vec3 half, double margin)
{
    double distance = 0.0;
    for (int corner = 0; corner < 8; corner++) {
        vec3 p =
            v3(corner & 1 ? half.x : -half.x, corner & 2 ? half.y : -half.y, corner & 4 ? half.z : -half.z);
        double x = fabs(v3_dot(p, c->right)) / (c->half_width * margin);
        double y = fabs(v3_dot(p, c->up)) / (c->half_height * margin);
        distance = fmax(distance, fmax(x, y) - v3_dot(p, c->forward));
    }
    return distance;
}

void camera_frame(const double lower[3], const double upper[3], int32_t width, int32_t height, camera *out)
{
    vec3 low = v3_load(lower), high = v3_load(upper);
    if (!v3_finite(low) || !v3_finite(high) || low.x > high.x) {
        low = v3(-1, -1, -1);
        high = v3(1, 1, 1);
    }
    vec3 centre = v3_scale(v3_add(low, high), 0.5), half = v3_scale(v3_sub(high, low), 0.5);
    camera c = {.width = width, .height = height};
    c.forward = v3_normalize(v3(-0.55, -0.48, -1.0));
    c.right = v3_normalize(v3_cross(c.forward, v3(0, 1, 0)));
    c.up = v3_cross(c.right, c.forward);
    c.half_height = tan(0.5 * 35.0 * WARP_PI / 180.0);
    c.half_width = c.half_height * width / height;
    double distance = framing_distance(&c, half, 0.92);
    if (!(distance > 0.0)) distance = 1.0;
    c.origin = v3_mad(centre, -distance, c.forward);
    *out = c;
}

knurl_status camera_choose(const knurl_description *description, const knurl_scene *scene, int32_t index,
                           int32_t width, int32_t height, camera *out, knurl_error *error)
{
    if (index >= 0 || description->camera_count > 0)
        return camera_from_description(&description->cameras[index < 0 ? 0 : index], width, height, out,
                                       error);
    double lower[3], upper[3];
    knurl_scene_bounds(scene, lower, upper);
    camera_frame(lower, upper, width, height, out);
    return KNURL_OK;
}

knurl_ray camera_make_ray(const camera *c, double x, double y, double u, double v)
{
    double px = (2.0 * x / c->width - 1.0) * c->half_width, py = (1.0 - 2.0 * y / c->height) * c->half_height;
    double pixel = 2.0 * c->half_height / c->height;
    vec3 plane = v3_add(v3_scale(c->right, px), v3_scale(c->up, py));
    vec3 origin = c->orthographic ? v3_add(c->origin, plane) : c->origin;
    vec3 direction = c->orthographic ? c->forward : v3_add(c->forward, plane);
    if (c->lens_radius > 0.0) {
        vec3 focus = v3_mad(origin, c->focus_distance, direction);
        vec2 lens = warp_disk(u, v);
        origin = v3_mad(origin, c->lens_radius * lens.x, c->right);
        origin = v3_mad(origin, c->lens_radius * lens.y, c->up);
        direction = v3_sub(focus, origin);
    }
    direction = v3_normalize(direction);
    double o[3], d[3];
    v3_store(o, origin);
    v3_store(d, direction);
    knurl_ray ray = knurl_ray_make(o, d);
    if (c->orthographic)
        ray.cone_width = (float)pixel;
    else
        ray.cone_spread = (float)(pixel * v3_dot(direction, c->forward));
    return ray;
}

knurl_status knurl_camera_rays(const knurl_description *description, const knurl_scene *scene,
                               int32_t camera_index, int32_t width, int32_t height, knurl_ray *rays,
                               knurl_error *error)
{
    if (!description || !scene || !rays)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "description, scene or rays is NULL");
    if (width < 1 || width > 65536 || height < 1 || height > 65536)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "image is %d x %d pixels, expected 1 to 65536 per side", width, height);
    if (camera_index < -1 || (camera_index >= 0 && (uint32_t)camera_index >= description->camera_count))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "camera is %d, the scene has %u", camera_index,
                          description->camera_count);
    camera c;
    knurl_status status = camera_choose(description, scene, camera_index, width, height, &c, error);
    for (int32_t y = 0; y < height && status == KNURL_OK; y++) {
        for (int32_t x = 0; x < width; x++) {
            knurl_ray *ray = &rays[(size_t)y * (size_t)width + (size_t)x];
            *ray = camera_make_ray(&c, x + 0.5, y + 0.5, 0.5, 0.5);
            ray->cone_width = ray->cone_spread = 0.0f;
        }
    }
    return status;
}

/* Integral of the 4-term Blackman-Harris window on [-1, 1], from -1, normalised. */
static double blackman_harris_cumulative(double x)
{
    double p = WARP_PI * (x + 1.0);
    double sum = 0.35875 * p - 0.48829 * sin(p) + 0.14128 / 2.0 * sin(2.0 * p) - 0.01168 / 3.0 * sin(3.0 * p);
    return sum / (0.35875 * 2.0 * WARP_PI);
}

void pixel_filter_build(pixel_filter *f)
{
    for (int i = 0; i <= FILTER_STEPS; i++) {
        double target = (double)i / FILTER_STEPS, low = -1.0, high = 1.0;
        for (int step = 0; step < 50; step++) {
            double middle = 0.5 * (low + high);
            if (blackman_harris_cumulative(middle) < target)
                low = middle;
            else
                high = middle;
        }
        f->inverse[i] = FILTER_RADIUS * 0.5 * (low + high);
    }
}

double pixel_filter_offset(const pixel_filter *f, double u)
{
    double scaled = u * FILTER_STEPS;
    int i = (int)scaled;
    if (i > FILTER_STEPS - 1) i = FILTER_STEPS - 1;
    return warp_lerp(f->inverse[i], f->inverse[i + 1], scaled - i);
}
