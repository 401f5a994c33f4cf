/* The oracle itself: against closed forms, against dense tessellation, and its own map by hand. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "support/random.h"
#include "support/rays.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const float FLAT_NORMALS[9] = {0, 1, 0, 0, 1, 0, 0, 1, 0};
static const uint32_t ONE_TRIANGLE[3] = {0, 1, 2};

static oracle_def flat_def(const float *positions, const float *texcoords)
{
    return (oracle_def){.positions = positions,
                        .normals = FLAT_NORMALS,
                        .texcoords = texcoords,
                        .vertex_count = 3,
                        .triangles = ONE_TRIANGLE,
                        .triangle_count = 1,
                        .width = 1,
                        .height = 1,
                        .format = ORACLE_F32,
                        .factor = 1.0,
                        .uv_scale = {1.0, 1.0}};
}

static oracle_ray random_ray(random_state *r, double from, double to)
{
    oracle_ray ray = {.tmin = 0.0, .tmax = INFINITY};
    for (int k = 0; k < 3; k++) {
        ray.origin[k] = random_range(r, -from, from);
        ray.direction[k] = random_range(r, -to, to) - ray.origin[k];
    }
    return ray;
}

/* (0,0,0), (4,0,0), (0,0,-4) with u, v = x / 4, -z / 4. */
static const float PLANE[9] = {0, 0, 0, 4, 0, 0, 0, 0, -4};
static const float PLANE_UV[6] = {0, 0, 1, 0, 0, 1};

static void constant_height_is_a_plane(void **state)
{
    (void)state;
    oracle_def def = flat_def(PLANE, PLANE_UV);
    float value = 0.5f;
    def.samples = &value;
    def.offset = 0.25;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    random_state r = {1};
    int hits = 0;
    for (int i = 0; i < 20000; i++) {
        oracle_ray ray = random_ray(&r, 6.0, 3.0);
        double t = (0.75 - ray.origin[1]) / ray.direction[1];
        double x = ray.origin[0] + t * ray.direction[0], z = ray.origin[2] + t * ray.direction[2];
        double inside = fmin(fmin(x, -z), 4.0 - x + z);
        if (fabs(inside) < 1e-9 || fabs(t) < 1e-9) continue;
        bool expected = inside > 0.0 && t > 0.0;
        oracle_root root;
        assert_int_equal(oracle_first(o, &ray, &root), expected);
        if (!expected) continue;
        hits++;
        assert_true(root.certain);
        assert_true(fabs(root.t - t) < 1e-13 * (1.0 + fabs(t)) / root.cosine);
    }
    assert_true(hits > 500);
    oracle_destroy(o);
}

/* A linear map is reproduced exactly between the first and the last sample. */
static void ramp_is_a_tilted_plane(void **state)
{
    (void)state;
    enum { WIDTH = 33 };
    float ramp[WIDTH];
    for (int i = 0; i < WIDTH; i++) ramp[i] = (float)i;
    oracle_def def = flat_def(PLANE, PLANE_UV);
    def.width = WIDTH;
    def.samples = ramp;
    def.wrap_u = ORACLE_CLAMP;
    def.factor = 0.03;
    def.offset = -0.2;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    random_state r = {2};
    int hits = 0;
    for (int i = 0; i < 20000; i++) {
        oracle_ray ray = random_ray(&r, 6.0, 3.0);
        /* y = -0.2 + 0.03 (x / 4 * 33 - 0.5) */
        double slope = 0.03 * WIDTH / 4.0, base = -0.2 - 0.015;
        double t =
            (base + slope * ray.origin[0] - ray.origin[1]) / (ray.direction[1] - slope * ray.direction[0]);
        double x = ray.origin[0] + t * ray.direction[0], z = ray.origin[2] + t * ray.direction[2];
        if (x < 0.5 / WIDTH * 4.0 || x > 4.0 - 0.5 / WIDTH * 4.0 || -z < 1e-9 || x - z > 4.0 - 1e-9) continue;
        if (t < 1e-9) continue;
        oracle_root roots[8];
        int count = oracle_roots(o, &ray, roots, 8);
        bool found = false;
        for (int k = 0; k < count; k++) found |= fabs(roots[k].t - t) < 1e-12 * (1.0 + t) / roots[k].cosine;
        assert_true(found);
        hits++;
    }
    assert_true(hits > 500);
    oracle_destroy(o);
}

/* All positions in one point: S = h N / |N| is a piece of a sphere. */
static void point_with_normals_is_a_sphere(void **state)
{
    (void)state;
    static const float center[9] = {0.5f, -1, 2, 0.5f, -1, 2, 0.5f, -1, 2};
    static const float normals[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    oracle_def def = flat_def(center, PLANE_UV);
    def.normals = normals;
    def.offset = 1.5;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    random_state r = {3};
    int hits = 0, pairs = 0;
    for (int i = 0; i < 20000; i++) {
        oracle_ray ray = random_ray(&r, 6.0, 2.5);
        double a = 0.0, b = 0.0, c = -1.5 * 1.5;
        for (int k = 0; k < 3; k++) {
            double from = ray.origin[k] - (double)center[k];
            a += ray.direction[k] * ray.direction[k];
            b += ray.direction[k] * from;
            c += from * from;
        }
        double root_of = b * b - a * c;
        int expected = 0;
        double t[2] = {0.0, 0.0};
        bool near = fabs(root_of) < 1e-9 * a;
        for (int s = -1; s <= 1 && root_of > 0.0; s += 2) {
            double at = (-b + s * sqrt(root_of)) / a, least = INFINITY;
            for (int k = 0; k < 3; k++)
                least = fmin(least, ray.origin[k] + at * ray.direction[k] - (double)center[k]);
            near |= fabs(least) < 1e-9 || fabs(at) < 1e-9;
            if (least > 0.0 && at > 0.0) t[expected++] = at;
        }
        if (near) continue;
        oracle_root roots[4];
        int count = oracle_roots(o, &ray, roots, 4);
        assert_int_equal(count, expected);
        for (int k = 0; k < count; k++) {
            assert_true(roots[k].certain);
            assert_true(fabs(roots[k].t - t[k]) < 1e-12 * (1.0 + t[k]) / roots[k].cosine);
        }
        hits += count;
        pairs += count == 2;
    }
    assert_true(hits > 500 && pairs > 10);
    oracle_destroy(o);
}

/* Unnormalised with P = N: S = (1 + h) N stays in a plane. */
static void unnormalised_scales_the_triangle(void **state)
{
    (void)state;
    static const float corners[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    oracle_def def = flat_def(corners, PLANE_UV);
    def.normals = corners;
    def.offset = 0.5;
    def.unnormalised = true;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    random_state r = {4};
    int hits = 0;
    for (int i = 0; i < 5000; i++) {
        oracle_ray ray = random_ray(&r, 4.0, 1.0);
        double from = ray.origin[0] + ray.origin[1] + ray.origin[2];
        double along = ray.direction[0] + ray.direction[1] + ray.direction[2];
        double t = (1.5 - from) / along, least = INFINITY;
        for (int k = 0; k < 3; k++) least = fmin(least, ray.origin[k] + t * ray.direction[k]);
        if (fabs(least) < 1e-9 || fabs(t) < 1e-9) continue;
        oracle_root root;
        bool expected = least > 0.0 && t > 0.0;
        assert_int_equal(oracle_first(o, &ray, &root), expected);
        if (!expected) continue;
        assert_true(fabs(root.t - t) < 1e-12 * (1.0 + t) / root.cosine);
        hits++;
    }
    assert_true(hits > 100);
    oracle_destroy(o);
}

/* One bilinear cell, y = x' z' in its own coordinates: a quadratic in t. */
static void one_texel_is_a_quadric(void **state)
{
    (void)state;
    static const float corners[9] = {0, 0, 0, 2, 0, 0, 0, 0, -2};
    static const float saddle[4] = {0.0f, 1.0f, 1.0f, 0.0f};
    oracle_def def = flat_def(corners, PLANE_UV);
    def.width = def.height = 2;
    def.samples = saddle;
    def.wrap_u = def.wrap_v = ORACLE_CLAMP;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    random_state r = {5};
    int hits = 0, pairs = 0;
    for (int i = 0; i < 40000; i++) {
        oracle_ray ray = random_ray(&r, 2.0, 1.0);
        ray.direction[0] += 1.0;
        ray.direction[2] -= 1.0;
        ray.direction[1] += 0.5;
        /* cell coordinates x = X - 0.5, y = -Z - 0.5, both in [0, 1]; height x + y - 2 x y */
        double x0 = ray.origin[0] - 0.5, y0 = -ray.origin[2] - 0.5, x1 = ray.direction[0],
               y1 = -ray.direction[2];
        double a = -2.0 * x1 * y1, b = x1 + y1 - 2.0 * (x0 * y1 + x1 * y0) - ray.direction[1];
        double c = x0 + y0 - 2.0 * x0 * y0 - ray.origin[1], disc = b * b - 4.0 * a * c;
        if (disc < 1e-9 || fabs(a) < 1e-6) continue;
        double t[2];
        int expected = 0;
        bool near = false;
        for (int s = 0; s < 2; s++) {
            double at = (-b + ((s == 0) == (a > 0.0) ? -1.0 : 1.0) * sqrt(disc)) / (2.0 * a);
            double x = x0 + at * x1, y = y0 + at * y1;
            double inside = fmin(fmin(fmin(x, 1.0 - x), fmin(y, 1.0 - y)), 1.0 - x - y);
            near |= fabs(inside) < 1e-9 || fabs(at) < 1e-9;
            if (inside > 0.0 && at > 0.0) t[expected++] = at;
        }
        if (near || expected == 0) continue;
        oracle_root roots[8];
        int count = oracle_roots(o, &ray, roots, 8), matched = 0;
        for (int k = 0; k < count; k++) {
            for (int e = 0; e < expected; e++)
                matched += fabs(roots[k].t - t[e]) < 1e-11 * (1.0 + t[e]) / roots[k].cosine;
        }
        assert_int_equal(matched, expected);
        hits++;
        pairs += expected == 2;
    }
    assert_true(hits > 1000 && pairs > 50);
    oracle_destroy(o);
}

/* ---- dense tessellation ---- */

static bool hit_triangle(const oracle_ray *ray, double p[3][3], double *t)
{
    double e1[3], e2[3], s[3], c1[3], c2[3], det = 0.0, u = 0.0, v = 0.0, at = 0.0;
    for (int k = 0; k < 3; k++) {
        e1[k] = p[1][k] - p[0][k];
        e2[k] = p[2][k] - p[0][k];
        s[k] = ray->origin[k] - p[0][k];
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        c1[k] = ray->direction[i] * e2[j] - ray->direction[j] * e2[i];
        c2[k] = s[i] * e1[j] - s[j] * e1[i];
    }
    for (int k = 0; k < 3; k++) {
        det += e1[k] * c1[k];
        u += s[k] * c1[k];
        v += ray->direction[k] * c2[k];
        at += e2[k] * c2[k];
    }
    u /= det;
    v /= det;
    *t = at / det;
    return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && *t >= ray->tmin && *t <= ray->tmax;
}

/* First hits of all rays with triangles between S on a grid of barycentrics. */
static void trace_grid(const oracle *o, uint32_t triangles, int rate, const oracle_ray *rays, int count,
                       double *t)
{
    double(*row)[2][3] = malloc(sizeof *row * (size_t)(rate + 1));
    assert_non_null(row);
    for (int i = 0; i < count; i++) t[i] = INFINITY;
    for (uint32_t tri = 0; tri < triangles; tri++) {
        for (int j = 0; j <= rate; j++) {
            for (int i = 0; i + j <= rate; i++) {
                oracle_surface(o, tri, (double)i / rate, (double)j / rate, row[i][j & 1], NULL, NULL);
                if (j == 0) continue;
                for (int up = 0; up < 2; up++) {
                    if (up == 1 && i == 0) continue;
                    double p[3][3];
                    memcpy(p[0], row[i][~j & 1], sizeof p[0]);
                    memcpy(p[1], up ? row[i - 1][j & 1] : row[i + 1][~j & 1], sizeof p[1]);
                    memcpy(p[2], row[i][j & 1], sizeof p[2]);
                    for (int k = 0; k < count; k++) {
                        double at;
                        if (hit_triangle(&rays[k], p, &at)) t[k] = fmin(t[k], at);
                    }
                }
            }
        }
    }
    free(row);
}

static int compare_doubles(const void *p, const void *q)
{
    double a = *(const double *)p, b = *(const double *)q;
    return a < b ? -1 : a > b ? 1 : 0;
}

/* Median and 80th percentile of the distance between the grid's hits and the oracle's. */
static void grid_errors(const truth_scene *scene, const oracle *o, int rate, double *median, double *high)
{
    enum { RAYS = 40 };
    oracle_ray rays[RAYS];
    double t[RAYS], errors[RAYS];
    for (uint64_t i = 0; i < RAYS; i++)
        rays[i] = ray_make(scene, o, i % 4 == 3 ? RAYS_CHORD : i % 4 == 2 ? RAYS_INSIDE : RAYS_TO_SURFACE, i);
    trace_grid(o, scene->def.triangle_count, rate, rays, RAYS, t);
    for (int i = 0; i < RAYS; i++) {
        oracle_root root;
        double length = 0.0;
        for (int k = 0; k < 3; k++) length += rays[i].direction[k] * rays[i].direction[k];
        bool hit = oracle_first(o, &rays[i], &root);
        errors[i] = hit != (t[i] < INFINITY) ? INFINITY : hit ? fabs(t[i] - root.t) * sqrt(length) : 0.0;
    }
    qsort(errors, RAYS, sizeof *errors, compare_doubles);
    *median = errors[RAYS / 2] / oracle_scale(o);
    *high = errors[RAYS * 8 / 10] / oracle_scale(o);
}

static void tessellations_converge_to_it(void **state)
{
    (void)state;
    static const char *const names[] = {"ico20", "torus-3x200", "folded",        "flat-uv",
                                        "plane", "rotated-uv",  "lod-2.5-float", "unnormalised"};
    int done = 0;
    for (int i = 0; i < truth_scene_count(); i++) {
        truth_scene scene;
        assert_true(truth_scene_make(i, &scene));
        bool wanted = false;
        for (size_t k = 0; k < sizeof names / sizeof names[0]; k++)
            wanted |= strcmp(names[k], scene.name) == 0;
        if (wanted) {
            oracle *o = oracle_create(&scene.def);
            assert_non_null(o);
            /* About 60,000 and 16 times as many triangles. */
            int rate = (int)sqrt(60000.0 / (double)scene.def.triangle_count);
            double coarse[2], fine[2];
            grid_errors(&scene, o, rate, &coarse[0], &coarse[1]);
            grid_errors(&scene, o, 4 * rate, &fine[0], &fine[1]);
            printf("%-14s rate %3d: median %.1e, 80%% %.1e; rate %3d: median %.1e, 80%% %.1e\n", scene.name,
                   rate, coarse[0], coarse[1], 4 * rate, fine[0], fine[1]);
            assert_true(fine[0] < 1e-4);
            assert_true(fine[1] < 0.5 * coarse[1] || fine[1] < 1e-12);
            /* Quadratic inside a texel, linear across the creases between texels. */
            assert_true(fine[0] < 0.5 * coarse[0] || fine[0] < 1e-12);
            done++;
            oracle_destroy(o);
        }
        truth_scene_free(&scene);
    }
    assert_int_equal(done, sizeof names / sizeof names[0]);
}

/* ---- map ---- */

static oracle *map_only(int width, int height, oracle_format format, const void *samples, oracle_wrap wrap,
                        double lod)
{
    oracle_def def = flat_def(PLANE, PLANE_UV);
    def.width = width;
    def.height = height;
    def.format = format;
    def.samples = samples;
    def.wrap_u = def.wrap_v = wrap;
    def.lod = lod;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    return o;
}

static void map_is(const oracle *o, double u, double v, double expected)
{
    double value = oracle_map_value(o, u, v);
    if (fabs(value - expected) > 1e-12)
        fail_msg("map(%g, %g) = %.17g, expected %.17g", u, v, value, expected);
}

static void map_wraps(void **state)
{
    (void)state;
    static const float row[4] = {1.0f, 2.0f, 4.0f, 8.0f};
    static const struct {
        oracle_wrap wrap;
        double before, after, far;
    } cases[] = {
        {ORACLE_REPEAT, 8.0, 1.0, 4.0}, {ORACLE_MIRROR, 1.0, 8.0, 2.0}, {ORACLE_CLAMP, 1.0, 8.0, 8.0}};
    for (int i = 0; i < 3; i++) {
        oracle *o = map_only(4, 1, ORACLE_F32, row, cases[i].wrap, 0.0);
        for (int k = 0; k < 4; k++) map_is(o, (k + 0.5) / 4.0, 0.7, (double)row[k]);
        map_is(o, 0.5, -3.0, 3.0);
        map_is(o, -0.125, 0.0, cases[i].before);
        map_is(o, 1.125, 0.0, cases[i].after);
        map_is(o, 0.0, 0.0, 0.5 * (1.0 + cases[i].before));
        map_is(o, 1.625, 0.0, cases[i].far);
        if (i < 2) map_is(o, -399.375, 0.0, oracle_map_value(o, 0.625, 0.0));
        oracle_destroy(o);
    }
}

static void map_levels_are_box_filtered(void **state)
{
    (void)state;
    static const float five[5] = {1.0f, 2.0f, 4.0f, 8.0f, 16.0f};
    double left = (1.0 + 2.0 + 0.5 * 4.0) / 2.5, right = (0.5 * 4.0 + 8.0 + 16.0) / 2.5;
    oracle *o = map_only(5, 1, ORACLE_F32, five, ORACLE_CLAMP, 1.0);
    map_is(o, 0.25, 0.5, left);
    assert_true(fabs(oracle_map_value(o, 0.75, 0.5) - right) < 1e-6);
    oracle_destroy(o);
    o = map_only(5, 1, ORACLE_F32, five, ORACLE_CLAMP, 2.0);
    assert_true(fabs(oracle_map_value(o, 0.1, 0.5) - 0.5 * (left + right)) < 1e-6);
    oracle_destroy(o);
    /* Between levels: the blend of both reconstructions. */
    o = map_only(5, 1, ORACLE_F32, five, ORACLE_CLAMP, 0.25);
    map_is(o, 0.1, 0.5, 0.75 * 1.0 + 0.25 * left);
    oracle_destroy(o);
    /* 8 bit: (1 + 2 + 2 + 2) / 4 codes of 257 = 449.75, rounded to 450. */
    static const uint8_t bytes[4] = {1, 2, 2, 2};
    o = map_only(2, 2, ORACLE_U8, bytes, ORACLE_REPEAT, 1.0);
    map_is(o, 0.3, 0.9, 450.0 / 65535.0);
    oracle_destroy(o);
    o = map_only(2, 2, ORACLE_U8, bytes, ORACLE_REPEAT, 0.0);
    map_is(o, 0.25, 0.25, 1.0 / 255.0);
    oracle_destroy(o);
}

/* The example of KHR_texture_transform: the lower left quadrant of the image. */
static void uv_transform_is_that_of_gltf(void **state)
{
    (void)state;
    oracle_def def = flat_def(PLANE, PLANE_UV);
    double uv[2];
    def.uv_offset[1] = 1.0;
    def.uv_scale[0] = def.uv_scale[1] = 0.5;
    def.uv_rotation = 1.5707963267948966;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    oracle_uv(o, 0, 0.25, 0.5, uv); /* s = 0.25, t = 0.5 */
    assert_true(fabs(uv[0] - 0.25) < 1e-15);
    assert_true(fabs(uv[1] - 0.875) < 1e-15);
    oracle_destroy(o);
}

/* ---- hard cases ---- */

static void tangencies_are_not_certain(void **state)
{
    (void)state;
    static const float center[9] = {0};
    static const float normals[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    oracle_def def = flat_def(center, PLANE_UV);
    def.normals = normals;
    def.offset = 1.0;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    double s = 1.0 / sqrt(3.0), d = 1.0 / sqrt(2.0);
    for (int i = -3; i <= 3; i++) {
        /* Touching the unit sphere at (s, s, s), or 10^-15, 10^-9, 10^-3 off it. */
        double off = i == 0 ? 0.0 : (i < 0 ? -1.0 : 1.0) * pow(10.0, -21.0 + 6.0 * abs(i));
        oracle_ray ray = {{s * (1 + off) - d, s * (1 + off) + d, s * (1 + off)}, {d, -d, 0.0}, 0.0, INFINITY};
        oracle_root roots[64];
        int count = oracle_roots(o, &ray, roots, 64), certain = 0;
        for (int k = 0; k < count; k++) certain += roots[k].certain;
        if (off <= -1e-9) assert_int_equal(certain, 2);
        if (off >= 1e-9) assert_int_equal(count, 0);
        if (fabs(off) < 1e-14) assert_int_equal(certain, 0);
        if (off == 0.0) assert_true(count > 0);
    }
    oracle_destroy(o);
}

/* A ray that lies in the surface ends, and says so. */
static void rays_in_the_surface_are_degenerate(void **state)
{
    (void)state;
    oracle_def def = flat_def(PLANE, PLANE_UV);
    def.offset = 0.5;
    oracle *o = oracle_create(&def);
    assert_non_null(o);
    oracle_ray ray = {{-1.0, 0.5, -1.0}, {1.0, 0.0, 0.0}, 0.0, INFINITY};
    oracle_root root;
    assert_true(oracle_first(o, &ray, &root));
    assert_false(root.certain);
    oracle_destroy(o);
}

static void closed_surfaces_are_crossed_an_even_number_of_times(void **state)
{
    (void)state;
    uint64_t checked = 0, doubtful = 0;
    for (int i = 0; i < truth_scene_count(); i++) {
        truth_scene scene;
        assert_true(truth_scene_make(i, &scene));
        if (scene.closed) {
            oracle *o = oracle_create(&scene.def);
            assert_non_null(o);
            for (uint64_t k = 0; k < 400; k++) {
                static const ray_family families[4] = {RAYS_CHORD, RAYS_TO_SURFACE, RAYS_EDGE, RAYS_TEXEL};
                oracle_ray ray = ray_make(&scene, o, families[k % 4], k);
                oracle_root roots[64];
                int count = oracle_roots(o, &ray, roots, 64), sides = 0;
                bool certain = true;
                for (int n = 0; n < count; n++) {
                    certain &= roots[n].certain;
                    sides += roots[n].side;
                }
                doubtful += !certain;
                if (!certain) continue;
                checked++;
                assert_int_equal(count % 2, 0);
                assert_int_equal(sides, 0);
            }
            oracle_destroy(o);
        }
        truth_scene_free(&scene);
    }
    printf("%llu rays, %llu left out as doubtful\n", (unsigned long long)checked,
           (unsigned long long)doubtful);
    assert_true(checked > 8 * doubtful);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(constant_height_is_a_plane),
        cmocka_unit_test(ramp_is_a_tilted_plane),
        cmocka_unit_test(point_with_normals_is_a_sphere),
        cmocka_unit_test(unnormalised_scales_the_triangle),
        cmocka_unit_test(one_texel_is_a_quadric),
        cmocka_unit_test(tessellations_converge_to_it),
        cmocka_unit_test(map_wraps),
        cmocka_unit_test(map_levels_are_box_filtered),
        cmocka_unit_test(uv_transform_is_that_of_gltf),
        cmocka_unit_test(tangencies_are_not_certain),
        cmocka_unit_test(rays_in_the_surface_are_degenerate),
        cmocka_unit_test(closed_surfaces_are_crossed_an_even_number_of_times),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
