/* Parts of the renderer: environments, textures, cameras. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "render/camera.h"
#include "render/environment.h"
#include "render/sampler.h"
#include "render/texture.h"
#include "render/warp.h"

#include <string.h>

static knurl_context *context;

static int set_up(void **state)
{
    (void)state;
    knurl_context_def def = knurl_context_def_default();
    return knurl_context_create(&def, &context, NULL) == KNURL_OK ? 0 : 1;
}

static int tear_down(void **state)
{
    (void)state;
    bool clean = knurl_context_bytes(context) == 0;
    knurl_context_release(context);
    return clean ? 0 : 1;
}

/* A dim sky with a small sun. */
static environment *make_sunny(double rotation)
{
    enum { W = 24, H = 12 };
    float samples[W * H * 3];
    for (int i = 0; i < W * H * 3; i++) samples[i] = 0.2f + 0.01f * (float)(i % 7);
    for (int c = 0; c < 3; c++) samples[(3 * W + 5) * 3 + c] = 500.0f;
    knurl_image *image;
    environment *e;
    assert_int_equal(knurl_image_create(context, W, H, 3, KNURL_PIXEL_F32, samples, &image, NULL), KNURL_OK);
    assert_int_equal(environment_create(context, image, 2.0, rotation, &e, NULL), KNURL_OK);
    knurl_image_release(image);
    return e;
}

static vec3 sphere_direction(double u, double v)
{
    double y = 1.0 - 2.0 * v, ring = sqrt(fmax(0.0, 1.0 - y * y));
    return v3(ring * cos(2.0 * WARP_PI * u), y, ring * sin(2.0 * WARP_PI * u));
}

static void test_environment_density(void **state)
{
    (void)state;
    environment *e = make_sunny(0.7);
    /* The density integrates to 1, and the light to the same by uniform and by importance sampling. */
    enum { N = 1 << 18, M = 1 << 12 };
    double total = 0.0, uniform = 0.0, important = 0.0, most = 0.0;
    for (uint32_t i = 0; i < N; i++) {
        sampler s = sampler_make(1, 0, 0, i);
        sample4 u = sampler_get(&s, 0);
        vec3 d = sphere_direction(u.u[0], u.u[1]);
        total += environment_pdf(e, d) * 4.0 * WARP_PI / N;
        uniform += environment_radiance(e, d).y * 4.0 * WARP_PI / N;
    }
    for (uint32_t i = 0; i < M; i++) {
        sampler s = sampler_make(2, 0, 0, i);
        sample4 u = sampler_get(&s, 0);
        double pdf;
        vec3 d = environment_draw(e, u.u[0], u.u[1], &pdf);
        assert_true(fabs(v3_length(d) - 1.0) < 1e-12 && pdf > 0.0);
        assert_true(fabs(environment_pdf(e, d) - pdf) <= 1e-6 * pdf);
        double estimate = environment_radiance(e, d).y / pdf;
        important += estimate / M;
        most = fmax(most, estimate);
    }
    assert_true(fabs(total - 1.0) < 0.01);
    assert_true(fabs(important / uniform - 1.0) < 0.01);
    /* No direction is so much brighter than its density says that it would be seen as a speck. */
    assert_true(most < 6.0 * uniform);
    environment_release(e);
}

static void test_environment_orientation(void **state)
{
    (void)state;
    /* Four columns of different light: centre at -z, right half towards +x, first row up. */
    const float samples[4 * 2] = {1, 2, 3, 4, 5, 6, 7, 8};
    knurl_image *image;
    environment *e, *turned;
    assert_int_equal(knurl_image_create(context, 4, 2, 1, KNURL_PIXEL_F32, samples, &image, NULL), KNURL_OK);
    assert_int_equal(environment_create(context, image, 1.0, 0.0, &e, NULL), KNURL_OK);
    assert_int_equal(environment_create(context, image, 1.0, WARP_PI / 2.0, &turned, NULL), KNURL_OK);
    /* Column 2, centre at u = 5/8: an eighth of a turn from -z to +x. */
    vec3 d = v3_normalize(v3(1.0, 2.0, -1.0));
    assert_true(fabs(environment_radiance(e, d).x - 3.0) < 0.75);
    vec3 exact = v3_scale(v3(sin(WARP_PI / 4.0), 0.0, -cos(WARP_PI / 4.0)), sin(WARP_PI / 4.0));
    exact.y = cos(WARP_PI / 4.0);
    assert_true(fabs(environment_radiance(e, exact).x - 3.0) < 1e-9);
    exact.y = -exact.y;
    assert_true(fabs(environment_radiance(e, exact).x - 7.0) < 1e-9);
    /* Counter-clockwise seen from above takes +x to -z: what was at (+x, -z) is at (-x, -z). */
    exact.x = -exact.x;
    assert_true(fabs(environment_radiance(turned, exact).x - 7.0) < 1e-9);
    environment_release(e);
    environment_release(turned);
    knurl_image_release(image);
}

/* A light that is black, infinite or not a number nowhere breaks anything. */
static void test_environment_damaged(void **state)
{
    (void)state;
    const float samples[8 * 3] = {0, 0, 0, INFINITY, 1, NAN, -5, 2, 0};
    for (int black = 0; black < 2; black++) {
        knurl_image *image;
        environment *e;
        assert_int_equal(
            knurl_image_create(context, 4, 2, 3, KNURL_PIXEL_F32, black ? NULL : samples, &image, NULL),
            KNURL_OK);
        assert_int_equal(environment_create(context, image, 1.0, 0.0, &e, NULL), KNURL_OK);
        for (uint32_t i = 0; i < 64; i++) {
            sampler s = sampler_make(1, 0, 0, i);
            sample4 u = sampler_get(&s, 0);
            double pdf;
            vec3 d = environment_draw(e, u.u[0], u.u[1], &pdf), c = environment_radiance(e, d);
            assert_true(v3_finite(d) && isfinite(pdf) && pdf >= 0.0);
            assert_true(v3_finite(c) && c.x >= 0.0 && c.y >= 0.0 && c.z >= 0.0);
        }
        environment_release(e);
        knurl_image_release(image);
    }
}

static void test_studio_sky(void **state)
{
    (void)state;
    environment *e;
    assert_int_equal(environment_create_studio(context, 1.0, 0.0, &e, NULL), KNURL_OK);
    vec3 key = environment_radiance(e, v3_normalize(v3(-0.85, 0.80, 0.60)));
    vec3 up = environment_radiance(e, v3(0, 1, 0)), down = environment_radiance(e, v3(0, -1, 0));
    assert_true(key.x > key.z && key.x > 5.0);
    assert_true(up.z > up.x && warp_luminance(down) < warp_luminance(up));
    environment_release(e);
}

/* Textures straight from memory: a set with two images. */
static void test_texture_lookup(void **state)
{
    (void)state;
    const uint8_t bytes[2 * 2 * 4] = {255, 0, 0, 255, 0, 255, 0, 0, 0, 0, 255, 51, 188, 188, 188, 255};
    knurl_image *image;
    assert_int_equal(knurl_image_create(context, 2, 2, 4, KNURL_PIXEL_U8, bytes, &image, NULL), KNURL_OK);
    static texture_set set;
    set = (texture_set){.context = context, .images = &image, .count = 1};
    for (int i = 0; i < 256; i++) set.srgb[i] = (float)texture_srgb_to_linear(i / 255.0);
    knurl_texture_ref ref = {.uv_scale = {1, 1}};
    texel t = texture_lookup(&set, &ref, (const double[2]){0.25, 0.25}, true);
    assert_true(t.color.x == 1.0 && t.color.y == 0.0 && t.alpha == 1.0);
    t = texture_lookup(&set, &ref, (const double[2]){0.25, 0.75}, true);
    assert_true(t.color.z == 1.0 && fabs(t.alpha - 0.2) < 1e-12);
    /* 188 / 255 is half the light, but 0.737 as data. */
    t = texture_lookup(&set, &ref, (const double[2]){0.75, 0.75}, true);
    assert_true(fabs(t.color.x - 0.5) < 0.005);
    t = texture_lookup(&set, &ref, (const double[2]){0.75, 0.75}, false);
    assert_true(fabs(t.color.x - 188.0 / 255.0) < 1e-12);
    /* Halfway between red and green; across the border of the tile; clamped there. */
    t = texture_lookup(&set, &ref, (const double[2]){0.5, 0.25}, true);
    assert_true(fabs(t.color.x - 0.5) < 1e-12 && fabs(t.color.y - 0.5) < 1e-12);
    t = texture_lookup(&set, &ref, (const double[2]){-3.0, 0.25}, true);
    assert_true(fabs(t.color.x - 0.5) < 1e-12);
    ref.wrap_u = KNURL_WRAP_CLAMP;
    t = texture_lookup(&set, &ref, (const double[2]){-3.0, 0.25}, true);
    assert_true(t.color.x == 1.0);
    ref.nearest = true;
    t = texture_lookup(&set, &ref, (const double[2]){0.49, 0.25}, true);
    assert_true(t.color.x == 1.0);
    /* A quarter turn counter-clockwise on the image: +s reads towards -v. */
    ref = (knurl_texture_ref){.uv_scale = {1, 1}, .uv_rotation = WARP_PI / 2.0, .nearest = true};
    t = texture_lookup(&set, &ref, (const double[2]){0.3, 0.3}, true);
    assert_true(t.color.z == 1.0);
    t = texture_lookup(&set, &ref, (const double[2]){NAN, INFINITY}, true);
    assert_true(v3_finite(t.color));
    knurl_image_release(image);
}

static void test_camera_frames_everything(void **state)
{
    (void)state;
    static const double boxes[][6] = {
        {-1, -1, -1, 1, 1, 1}, {100, 0, 0, 100.5, 3, 0.1}, {-50, 0, -2, 50, 0, 2}};
    static const int32_t sizes[][2] = {{640, 360}, {200, 800}};
    for (int b = 0; b < 3; b++)
        for (int k = 0; k < 2; k++) {
            camera c;
            camera_frame(boxes[b], boxes[b] + 3, sizes[k][0], sizes[k][1], &c);
            double reach = 0.0;
            for (int corner = 0; corner < 8; corner++) {
                vec3 p = v3(boxes[b][corner & 1 ? 3 : 0], boxes[b][corner & 2 ? 4 : 1],
                            boxes[b][corner & 4 ? 5 : 2]);
                p = v3_sub(p, c.origin);
                double z = v3_dot(p, c.forward);
                assert_true(z > 0.0);
                double x = fabs(v3_dot(p, c.right)) / (z * c.half_width);
                double y = fabs(v3_dot(p, c.up)) / (z * c.half_height);
                assert_true(x < 0.93 && y < 0.93);
                reach = fmax(reach, fmax(x, y));
            }
            assert_true(reach > 0.85);
        }
}

/* All rays through a pixel meet where the lens is focused; the cone is a pixel wide. */
static void test_camera_focus(void **state)
{
    (void)state;
    knurl_description_camera source = {.transform = {1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3},
                                       .yfov = 0.8,
                                       .lens_radius = 0.1,
                                       .focus_distance = 5.0};
    camera c;
    assert_int_equal(camera_from_description(&source, 100, 50, &c, NULL), KNURL_OK);
    vec3 first = v3(0, 0, 0);
    for (int i = 0; i < 16; i++) {
        knurl_ray ray = camera_make_ray(&c, 70.0, 10.0, (i % 4 + 0.5) / 4.0, (i / 4 + 0.5) / 4.0);
        vec3 o = v3_load(ray.origin), d = v3_load(ray.direction);
        vec3 p = v3_mad(o, (-2.0 - o.z) / d.z, d); /* the plane z = 3 - 5 */
        if (i == 0) first = p;
        assert_true(v3_length(v3_sub(p, first)) < 1e-12);
        assert_true(v3_length(v3_sub(o, v3(1, 2, 3))) <= 0.1 + 1e-12);
        assert_true(fabs((double)ray.cone_spread - 2.0 * tan(0.4) / 50.0) < 0.2 * (double)ray.cone_spread);
    }
    source.orthographic = true;
    source.ymag = 2.0;
    source.lens_radius = 0.0;
    assert_int_equal(camera_from_description(&source, 100, 50, &c, NULL), KNURL_OK);
    knurl_ray ray = camera_make_ray(&c, 100.0, 0.0, 0.5, 0.5);
    assert_true(fabs(ray.origin[0] - 5.0) < 1e-12 && fabs(ray.origin[1] - 4.0) < 1e-12 &&
                ray.direction[2] == -1.0);
    assert_true(fabs((double)ray.cone_width - 4.0 / 50.0) < 1e-7 && ray.cone_spread == 0.0f);
    source.ymag = 0.0;
    knurl_error error;
    assert_int_equal(camera_from_description(&source, 100, 50, &c, &error), KNURL_ERROR_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_environment_density), cmocka_unit_test(test_environment_orientation),
        cmocka_unit_test(test_environment_damaged), cmocka_unit_test(test_studio_sky),
        cmocka_unit_test(test_texture_lookup),      cmocka_unit_test(test_camera_frames_everything),
        cmocka_unit_test(test_camera_focus),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
