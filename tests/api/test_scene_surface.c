/* Displaced surfaces in instances, against every shell tried by hand in the surface's own space. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/scene.h>

#include "support/random.h"

#include <math.h>
#include <string.h>

enum { SIDE = 4, RAYS = 3000 };

/* 3 x 3 part stretched, turned and mirrored; far away. */
static const double placement[12] = {-1.5, 0.4, 0.2, 900, 0.3, 2.0, -0.5, -700, 0.1, 0.3, 0.8, 1300};

static knurl_surface *make_surface(knurl_context *context, const char *method)
{
    static float positions[(SIDE + 1) * (SIDE + 1) * 3], texcoords[(SIDE + 1) * (SIDE + 1) * 2];
    static uint32_t triangles[SIDE * SIDE * 6];
    for (uint32_t y = 0; y <= SIDE; y++)
        for (uint32_t x = 0; x <= SIDE; x++) {
            uint32_t v = y * (SIDE + 1) + x;
            texcoords[2 * v] = (float)x / SIDE;
            texcoords[2 * v + 1] = (float)y / SIDE;
            positions[3 * v] = 2.0f * texcoords[2 * v] - 1.0f;
            positions[3 * v + 1] = 0.2f * (float)((x + y) % 2);
            positions[3 * v + 2] = 2.0f * texcoords[2 * v + 1] - 1.0f;
        }
    for (uint32_t y = 0, n = 0; y < SIDE; y++)
        for (uint32_t x = 0; x < SIDE; x++, n += 6) {
            uint32_t v = y * (SIDE + 1) + x, w = v + SIDE + 1;
            memcpy(triangles + n, (uint32_t[]){v, w, v + 1, v + 1, w, w + 1}, 24);
        }
    uint16_t samples[32 * 32];
    random_state random = {8};
    for (int i = 0; i < 32 * 32; i++) samples[i] = (uint16_t)random_bits(&random);
    knurl_image *image;
    assert_int_equal(knurl_image_create(context, 32, 32, 1, KNURL_PIXEL_U16, samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    knurl_surface_def def = knurl_surface_def_default();
    def.method = method;
    assert_int_equal(knurl_heightmap_create(context, &map_def, &def.displacement.map, NULL), KNURL_OK);
    def.displacement.factor = 0.2;
    def.mesh = (knurl_mesh_view){.positions = positions,
                                 .texcoords = texcoords,
                                 .vertex_count = (SIDE + 1) * (SIDE + 1),
                                 .triangles = triangles,
                                 .triangle_count = SIDE * SIDE * 2};
    knurl_surface *surface;
    assert_int_equal(knurl_surface_create(context, &def, &surface, NULL), KNURL_OK);
    knurl_heightmap_release(def.displacement.map);
    knurl_image_release(image);
    return surface;
}

static double det3(const double m[12])
{
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

/* Solves M x = b by Cramer's rule. */
static void solve(const double m[12], const double b[3], double x[3])
{
    for (int c = 0; c < 3; c++) {
        double replaced[12];
        memcpy(replaced, m, sizeof replaced);
        for (int r = 0; r < 3; r++) replaced[4 * r + c] = b[r];
        x[c] = det3(replaced) / det3(m);
    }
}

static knurl_ray random_ray(random_state *random)
{
    double local_o[3], local_d[3], o[3], d[3];
    for (int k = 0; k < 3; k++) {
        local_o[k] = random_range(random, -3.0, 3.0);
        local_d[k] = (k == 1 ? 0.15 : random_range(random, -1.0, 1.0)) - local_o[k];
    }
    for (int r = 0; r < 3; r++) {
        o[r] = placement[4 * r + 3];
        d[r] = 0.0;
        for (int c = 0; c < 3; c++) {
            o[r] += placement[4 * r + c] * local_o[c];
            d[r] += placement[4 * r + c] * local_d[c];
        }
    }
    return knurl_ray_make(o, d);
}

/* Nearest hit over all shells, in the surface's space. */
static knurl_hit by_hand(const knurl_surface *surface, const knurl_ray *world)
{
    knurl_ray ray = *world;
    double o[3];
    for (int r = 0; r < 3; r++) o[r] = world->origin[r] - placement[4 * r + 3];
    solve(placement, o, ray.origin);
    solve(placement, world->direction, ray.direction);
    ray.cone_width = ray.cone_spread = 0.0f;
    knurl_hit best = {.triangle = KNURL_NO_HIT, .t = INFINITY};
    for (uint32_t i = 0; i < knurl_surface_shell_count(surface); i++) {
        knurl_hit hit = {0};
        if (knurl_surface_intersect(surface, i, &ray, &hit) && hit.t < best.t) best = hit;
    }
    return best;
}

static void check_hit(const knurl_hit *hit, const knurl_hit *local)
{
    assert_true(fabs(hit->t - local->t) < 1e-10);
    double normal[3] = {0}, length = 0.0, agree = 0.0;
    for (int r = 0; r < 3; r++) {
        double p = placement[4 * r + 3];
        for (int c = 0; c < 3; c++) p += placement[4 * r + c] * local->position[c];
        assert_true(fabs(hit->position[r] - p) < 1e-9);
    }
    if (hit->triangle != local->triangle) return; /* on a shared edge */
    /* M S_a x M S_b = cofactor(M) (S_a x S_b). */
    const double *m = placement, *n = local->ng;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
            normal[r] += (m[4 * r1 + c1] * m[4 * r2 + c2] - m[4 * r1 + c2] * m[4 * r2 + c1]) * n[c];
        }
    for (int k = 0; k < 3; k++) {
        length += normal[k] * normal[k];
        agree += normal[k] * hit->ng[k];
    }
    if (fabs(hit->uv[0] - local->uv[0]) + fabs(hit->uv[1] - local->uv[1]) < 1e-9)
        assert_true(agree / sqrt(length) > 1.0 - 1e-6);
    assert_true(hit->error >= local->error && hit->error < 1e-9);
    assert_true(fabs(hit->height - local->height) < 1e-9);
}

static void trace_method(const char *method, uint32_t instances, float cone_width)
{
    knurl_context *context;
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    knurl_surface *surface = make_surface(context, method);
    knurl_scene *scene;
    assert_int_equal(knurl_scene_create(context, &scene, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(scene, surface, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_instance(scene, 0, placement, 1, NULL, NULL), KNURL_OK);
    for (uint32_t i = 1; i < instances; i++) { /* out of the way */
        double m[12] = {1, 0, 0, 1e4 * i, 0, 1, 0, 0, 0, 0, 1, 0};
        assert_int_equal(knurl_scene_add_instance(scene, 0, m, 1, NULL, NULL), KNURL_OK);
    }
    assert_int_equal(knurl_scene_commit(scene, NULL), KNURL_OK);
    random_state random = {21};
    int hits = 0;
    for (int i = 0; i < RAYS; i++) {
        knurl_ray ray = random_ray(&random), level = ray;
        ray.cone_width = cone_width; /* the same width anywhere, so that the entry point does not matter */
        level.cone_width = (float)((double)cone_width / cbrt(fabs(det3(placement))));
        level.lod = cone_width > 0.0f ? (float)knurl_surface_cone_lod(surface, &level, 0.0) : 0.0f;
        if (cone_width > 0.0f) assert_true(level.lod > 0.5f);
        knurl_hit hit, local = by_hand(surface, &level);
        bool found = knurl_scene_intersect(scene, &ray, &hit);
        assert_int_equal(found, local.triangle != KNURL_NO_HIT);
        assert_int_equal(found, knurl_scene_occluded(scene, &ray));
        if (!found) continue;
        hits++;
        check_hit(&hit, &local);
    }
    assert_true(hits > RAYS / 4);
    knurl_scene_release(scene);
    knurl_surface_release(surface);
    assert_true(knurl_context_bytes(context) == 0);
    knurl_context_release(context);
}

/* One shell in all, and one for each triangle. */
static void trace_all(uint32_t instances, float cone_width)
{
    trace_method("fast", instances, cone_width);
    trace_method("rmip", instances, cone_width);
}

static void test_one_instance(void **state)
{
    (void)state;
    trace_all(1, 0.0f);
}

static void test_many_instances(void **state)
{
    (void)state;
    trace_all(9, 0.0f);
}

static void test_cones_are_scaled(void **state)
{
    (void)state;
    trace_all(1, 0.4f);
    trace_all(9, 0.4f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one_instance),
        cmocka_unit_test(test_many_instances),
        cmocka_unit_test(test_cones_are_scaled),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
