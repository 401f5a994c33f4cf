/* The studio sky, baked to a small image so that it is sampled like any environment. */
#include "render/environment.h"
#include "render/warp.h"

enum { SKY_WIDTH = 512, SKY_HEIGHT = 256 };

static double smoothstep(double a, double b, double x)
{
    double t = warp_clamp((x - a) / (b - a), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

/* A round soft box: radiance inside `inner`, fading to none at `outer` (radians from its centre). */
static vec3 soft_box(vec3 direction, vec3 centre, double inner, double outer, vec3 radiance)
{
    double angle = acos(warp_clamp(v3_dot(direction, v3_normalize(centre)), -1.0, 1.0));
    return v3_scale(radiance, 1.0 - smoothstep(inner, outer, angle));
}

static vec3 studio_radiance(vec3 d)
{
    vec3 zenith = v3(0.14, 0.20, 0.32), horizon = v3(0.58, 0.59, 0.60), ground = v3(0.085, 0.080, 0.076);
    vec3 sky = warp_mix(horizon, zenith, pow(warp_clamp(d.y, 0.0, 1.0), 0.45));
    vec3 backdrop = warp_mix(v3(0.40, 0.39, 0.385), ground, pow(warp_clamp(-d.y, 0.0, 1.0), 0.6));
    vec3 light = warp_mix(backdrop, sky, smoothstep(-0.12, 0.12, d.y));
    /* Key: upper left, in front of the subject (the default camera looks from +z). */
    light = v3_add(light, soft_box(d, v3(-0.85, 0.80, 0.60), 0.14, 0.34, v3(24.0, 20.0, 15.2)));
    /* Fill from the right, and a rim from behind that draws the outline. */
    light = v3_add(light, soft_box(d, v3(1.0, 0.30, 0.40), 0.25, 0.80, v3(0.38, 0.50, 0.70)));
    return v3_add(light, soft_box(d, v3(0.55, 0.55, -1.0), 0.12, 0.34, v3(4.6, 5.2, 6.2)));
}

knurl_status environment_create_studio(knurl_context *context, double intensity, double rotation,
                                       environment **out, knurl_error *error)
{
    *out = NULL;
    size_t bytes = (size_t)SKY_WIDTH * SKY_HEIGHT * 3 * sizeof(float);
    float *samples = knurl_alloc(context, bytes);
    if (!samples) return knurl_fail_memory(error, bytes, "the studio sky");
    for (int y = 0; y < SKY_HEIGHT; y++)
        for (int x = 0; x < SKY_WIDTH; x++) {
            double phi = ((x + 0.5) / SKY_WIDTH - 0.5) * 2.0 * WARP_PI,
                   theta = (y + 0.5) / SKY_HEIGHT * WARP_PI;
            vec3 c = studio_radiance(v3(sin(theta) * sin(phi), cos(theta), -sin(theta) * cos(phi)));
            float *pixel = samples + 3 * ((size_t)y * SKY_WIDTH + (size_t)x);
            pixel[0] = (float)c.x;
            pixel[1] = (float)c.y;
            pixel[2] = (float)c.z;
        }
    knurl_image *image = NULL;
    knurl_status status =
        knurl_image_create(context, SKY_WIDTH, SKY_HEIGHT, 3, KNURL_PIXEL_F32, samples, &image, error);
    knurl_free(context, samples);
    if (status == KNURL_OK) status = environment_create(context, image, intensity, rotation, out, error);
    knurl_image_release(image);
    return status;
}
