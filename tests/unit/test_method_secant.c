/* secant: convergence where the ray is straight in texture space, passes, and order independence. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "test_marching_common.h"

static void check_convergence(const char *name, double missed_share)
{
    truth_scene scene;
    assert_true(marching_scene(name, &scene));
    static const int SAMPLES[3] = {15, 60, 240};
    marching_error e[3];
    for (int i = 0; i < 3; i++) {
        char method[80];
        snprintf(method, sizeof method, "secant:samples=%d:passes=2", SAMPLES[i]);
        assert_true(marching_measure(&scene, method, -1, &e[i]));
        assert_int_equal(e[i].contradicted, 0);
        if (i > 0) assert_true(e[i].median < e[i - 1].median / 5.0 && e[i].p90 < e[i - 1].p90 / 3.0);
        if (i > 0) assert_true(e[i].missed <= e[i - 1].missed);
    }
    assert_true(e[2].hits > e[2].rays / 2);
    assert_true(e[2].missed < missed_share * e[2].hits && e[2].invented < missed_share * e[2].hits);
    truth_scene_free(&scene);
}

static void converges_on_a_plane(void **state)
{
    (void)state;
    check_convergence("plane", 0.01);
}

/* An icosahedron whose normals meet in its centre, S = P + h N: segments are the ray itself. */
static void converges_where_normals_meet_in_a_point(void **state)
{
    (void)state;
    check_convergence("unnormalised", 0.01);
}

/* On other bases samples help until the chord's own error is left. */
static void stays_near_on_curved_bases(void **state)
{
    (void)state;
    static const char *const NAMES[] = {"torus", "latlong", "flat-uv"};
    for (size_t i = 0; i < sizeof NAMES / sizeof NAMES[0]; i++) {
        truth_scene scene;
        marching_error e;
        assert_true(marching_scene(NAMES[i], &scene));
        assert_true(marching_measure(&scene, "secant:samples=100", -1, &e));
        assert_true(e.hits > e.rays / 2 && e.missed * 50 < e.hits && e.invented * 200 < e.hits);
        assert_true(e.median < 2e-3 && e.contradicted == 0);
        truth_scene_free(&scene);
    }
}

static void passes_split_the_ray(void **state)
{
    (void)state;
    truth_scene scene;
    traced one, many;
    assert_true(marching_scene("plane", &scene));
    assert_true(traced_make(&scene.def, "secant:samples=57", 1, &one));
    assert_true(traced_make(&scene.def, "secant:samples=15:passes=4", 1, &many));
    oracle *o = oracle_create(&scene.def);
    int hits = 0;
    for (uint64_t i = 0; i < 500; i++) {
        oracle_ray made = ray_make(&scene, o, RAYS_CHORD, i);
        knurl_ray ray = traced_ray(&one, &made);
        knurl_hit a = {0}, b = {0};
        bool hit = knurl_scene_intersect(one.scene, &ray, &a);
        assert_int_equal(knurl_scene_intersect(many.scene, &ray, &b), hit);
        assert_true(a.t == b.t && a.steps == b.steps);
        hits += hit;
    }
    assert_true(hits > 50);
    oracle_destroy(o);
    traced_free(&one);
    traced_free(&many);
    truth_scene_free(&scene);
}

static void samples_do_not_depend_on_tmax(void **state)
{
    (void)state;
    truth_scene scene;
    traced t;
    assert_true(marching_scene("torus", &scene));
    assert_true(traced_make(&scene.def, "secant", 1, &t));
    oracle *o = oracle_create(&scene.def);
    int hits = 0;
    for (uint64_t i = 0; i < 500; i++) {
        oracle_ray made = ray_make(&scene, o, RAYS_TO_SURFACE, i);
        knurl_ray ray = traced_ray(&t, &made);
        knurl_hit a = {0}, b = {0};
        if (!knurl_scene_intersect(t.scene, &ray, &a)) continue;
        hits++;
        ray.tmax = a.t;
        assert_true(knurl_scene_intersect(t.scene, &ray, &b) && b.t == a.t);
        ray.tmax = a.t * (1.0 - 1e-9);
        assert_false(knurl_scene_intersect(t.scene, &ray, &b));
    }
    assert_true(hits > 250);
    oracle_destroy(o);
    traced_free(&t);
    truth_scene_free(&scene);
}

static void parameters_are_checked(void **state)
{
    (void)state;
    static const char *const WRONG[] = {"secant:samples=1", "secant:samples=5000", "secant:passes=0",
                                        "secant:passes=x", "secant:step=1"};
    int32_t index = -1;
    assert_int_equal(knurl_method_check("secant:samples=30:passes=3", &index, NULL), KNURL_OK);
    assert_string_equal(knurl_method_name(index), "secant");
    assert_int_equal(knurl_method_flags(index), 0);
    for (size_t i = 0; i < sizeof WRONG / sizeof WRONG[0]; i++)
        assert_int_equal(knurl_method_check(WRONG[i], NULL, NULL), KNURL_ERROR_ARGUMENT);
    truth_scene scene;
    traced t;
    assert_true(marching_scene("plane", &scene));
    assert_false(traced_make(&scene.def, "secant:samples=2.5", 1, &t));
    truth_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(converges_on_a_plane),
        cmocka_unit_test(converges_where_normals_meet_in_a_point),
        cmocka_unit_test(stays_near_on_curved_bases),
        cmocka_unit_test(passes_split_the_ray),
        cmocka_unit_test(samples_do_not_depend_on_tmax),
        cmocka_unit_test(parameters_are_checked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
