/* texel-walk, binary and robust-binary: against the exact method, the safety radii against brute force. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "methods/relief/relief.h"
#include "test_relief_common.h"

static void walk_is_exact_on_planes(void **state)
{
    (void)state;
    disagreement sum = {0};
    const float lods[3] = {0.0f, 1.0f, 1.4f};
    for (int i = 0; i < 18; i++) {
        relief_case *c = plane_case(i);
        for (int k = 0; k < 3; k++) {
            disagreement d =
                compare_methods(c, "rmip", "texel-walk", lods[k], k ? 300 : 1500, 1e-9, 100u + (unsigned)i);
            add(&sum, &d);
        }
        free(c);
    }
    print_disagreement("texel-walk on planes", &sum);
    assert_true(sum.hits > 5000);
    assert_int_equal(wrong(&sum), 0);
}

static void walk_is_exact_on_boxes(void **state)
{
    (void)state;
    disagreement sum = {0};
    for (int k = 0; k < MAP_KINDS; k++) {
        relief_case *c = box_case((case_map)k);
        disagreement d = compare_methods(c, "rmip", "texel-walk", 0.0f, 2500, 1e-9, 7);
        add(&sum, &d);
        free(c);
    }
    print_disagreement("texel-walk on boxes", &sum);
    assert_true(sum.hits > 2000);
    assert_int_equal(wrong(&sum), 0);
}

static void walk_is_exact_on_frusta(void **state)
{
    (void)state;
    disagreement sum = {0}, robust = {0};
    for (int i = 0; i < 8; i++) {
        relief_case *c = frustum_case(i);
        disagreement d = compare_methods(c, "rmip", "texel-walk", i % 4 == 3 ? 0.7f : 0.0f, 2000, 1e-6, 9);
        add(&sum, &d);
        d = compare_methods(c, "texel-walk", "robust-binary:allowance=0:binary=40", 0.0f, 1000, 1e-6, 9);
        add(&robust, &d);
        free(c);
    }
    print_disagreement("texel-walk on frusta", &sum);
    print_disagreement("robust-binary on frusta", &robust);
    assert_true(sum.hits > 4000);
    assert_int_equal(wrong(&sum), 0);
    assert_int_equal(wrong(&robust), 0);
}

/* On a curved base the segment is a chord: the error is printed, and falls as triangles shrink. */
static void chord_error_falls_with_size(void **state)
{
    (void)state;
    uint64_t off[3];
    for (int k = 0; k < 3; k++) {
        relief_case *c = case_new();
        char name[64];
        case_sphere(c, 8 << k, 3 << k);
        case_fill(c, MAP_SMOOTH, 48, 24, 3);
        disagreement d = compare_methods(c, "rmip", "texel-walk", 0.0f, 1200, 1e-3, 21);
        snprintf(name, sizeof name, "texel-walk on a sphere of %u triangles", c->triangle_count);
        print_disagreement(name, &d);
        assert_true(d.hits > 500);
        off[k] = wrong(&d);
        free(c);
    }
    assert_true(off[0] > 0);
    assert_true(2 * off[2] < off[0]);
}

static void robust_has_no_wrong_hits(void **state)
{
    (void)state;
    disagreement robust = {0}, loose = {0}, clamped = {0}, binary = {0};
    for (int i = 0; i < 18; i++) {
        relief_case *c = plane_case(i);
        uint64_t seed = 300u + (unsigned)i;
        disagreement d =
            compare_methods(c, "texel-walk", "robust-binary:allowance=0:binary=40", 0.0f, 1000, 1e-8, seed);
        add(&robust, &d);
        d = compare_methods(c, "texel-walk", "robust-binary:allowance=0.05:binary=40", 0.0f, 1000, 1e-8,
                            seed);
        add(&loose, &d);
        d = compare_methods(c, "texel-walk", "robust-binary:allowance=0:zero=clamp:binary=40", 0.0f, 1000,
                            1e-8, seed);
        add(&clamped, &d);
        d = compare_methods(c, "texel-walk", "binary:linear=16:binary=40", 0.0f, 1000, 1e-8, seed);
        add(&binary, &d);
        free(c);
    }
    print_disagreement("robust-binary, allowance 0", &robust);
    print_disagreement("robust-binary, allowance 0.05", &loose);
    print_disagreement("robust-binary, allowance 0, zero=clamp", &clamped);
    print_disagreement("binary, 16 steps", &binary);
    assert_int_equal(wrong(&robust), 0);
    assert_true(wrong(&binary) > 20);
    assert_true(wrong(&loose) < wrong(&binary));
    assert_true(wrong(&clamped) < wrong(&binary));
}

/* ---- safety radii ---- */

static double signal(const shell_space *space, double x, double y)
{
    const height_level *level = &space->map->levels[0];
    double i = floor(x), j = floor(y), h[2][2];
    for (int b = 0; b < 2; b++)
        for (int a = 0; a < 2; a++)
            h[b][a] = height_fetch(level, height_wrap((int64_t)i + a, level->width, space->wrap_u),
                                   height_wrap((int64_t)j + b, level->height, space->wrap_v));
    double u = x - i, v = y - j;
    return (1 - v) * ((1 - u) * h[0][0] + u * h[0][1]) + v * ((1 - u) * h[1][0] + u * h[1][1]);
}

/* A random ray through the square of radius r around a texel, from a random point in the square on the asked
 * side: how deep it goes to the other side before it is back on its own. */
static double hidden_depth(const shell_space *space, random_state *r, int i, int j, int radius, double side)
{
    enum { SAMPLES = 96 };
    double x = i + radius * random_range(r, -1.0, 1.0), y = j + radius * random_range(r, -1.0, 1.0);
    if (random_unit(r) < 0.5) {
        x = i + random_range(r, -0.5, 0.5);
        y = j + random_range(r, -0.5, 0.5);
    }
    double a = random_range(r, 0.0, 6.283185307179586), dx = cos(a), dy = sin(a);
    double length = 4.0 * radius;
    if (dx != 0.0) length = fmin(length, (dx > 0.0 ? i + radius - x : i - radius - x) / dx);
    if (dy != 0.0) length = fmin(length, (dy > 0.0 ? j + radius - y : j - radius - y) / dy);
    /* The lowest ray from the surface, towards another point of it, goes deepest. */
    double target = random_unit(r) * length;
    double start = side * signal(space, x, y) + (random_unit(r) < 0.5 ? 0.0 : 0.1 * random_unit(r));
    double slope = (side * signal(space, x + target * dx, y + target * dy) - start) / fmax(target, 1e-3);
    double depth = 0.0, hidden = 0.0;
    for (int k = 1; k <= SAMPLES; k++) {
        double d = length * k / SAMPLES;
        double g = start + slope * d - side * signal(space, x + d * dx, y + d * dy);
        if (g < 0.0) depth = fmax(depth, -g);
        if (g > 0.0) hidden = fmax(hidden, depth);
    }
    return hidden;
}

/* Deepest that rays were found to hide in the squares of the given radii, and the largest radius. */
static double worst_hidden(const shell_space *space, const safety_radii *radii, int tries, int grow,
                           int *largest, double *mean)
{
    random_state r = {77};
    double worst = 0.0;
    *largest = 0;
    *mean = 0.0;
    for (int side = 0; side < 2; side++) {
        const uint8_t *map = side ? radii->below : radii->above;
        for (int j = 0; j < radii->height; j++)
            for (int i = 0; i < radii->width; i++) {
                int n = map[j * radii->width + i];
                *largest = n > *largest ? n : *largest;
                *mean += (double)n / (2.0 * radii->width * radii->height);
                for (int k = 0; n + grow > 0 && k < tries; k++)
                    worst = fmax(worst, hidden_depth(space, &r, i, j, n + grow, side ? -1.0 : 1.0));
            }
    }
    return worst;
}

static void radii_are_safe(void **state)
{
    (void)state;
    const double allowances[4] = {0.0, 0.02, 0.1, 0.4};
    for (int i = 0; i < 10; i++) {
        relief_case *c = plane_case(i);
        if (i == 9) case_fill(c, MAP_SMOOTH, 120, 110, 1); /* large enough for squares of 16 and 32 cells */
        if (i == 8) /* a valley: convex from above, so that even allowance 0 gives large radii */
            for (int k = 0; k < c->width * c->height; k++)
                c->samples[k] = fabsf((float)(k % c->width) - 0.5f * (float)c->width) / (float)c->width;
        knurl_context *context = case_context(2);
        knurl_heightmap *map = case_heightmap(context, c);
        shell_space space = {.context = context, .map = map, .wrap_u = c->wrap_u, .wrap_v = c->wrap_v};
        double before = -1.0, range = map->range_max - map->range_min;
        for (int k = 0; k < 4; k++) {
            safety_radii radii;
            int largest, ignored;
            double mean, nothing;
            assert_int_equal(safety_radii_make(&space, allowances[k], &radii, NULL), KNURL_OK);
            double worst = worst_hidden(&space, &radii, i == 9 ? 8 : 30, 0, &largest, &mean);
            double beyond = worst_hidden(&space, &radii, i == 9 ? 2 : 30, 2, &ignored, &nothing);
            printf("map %d, allowance %.2f: mean radius %5.2f, largest %2d, deepest hidden %.4f of the range "
                   "(%.4f two texels further)\n",
                   i, allowances[k], mean, largest, worst / range, beyond / range);
            assert_true(worst <= allowances[k] * range + 1e-9);
            assert_true(mean >= before);
            if (i == 9 && k == 3) assert_true(largest >= 12);
            before = mean;
            safety_radii_free(context, &radii);
        }
        assert_true(before > 0.0);
        knurl_heightmap_release(map);
        knurl_context_release(context);
        free(c);
    }
}

/* Maps where the answer is known: a plane and a constant are safe everywhere, a single spike is not near it.
 */
static void radii_of_simple_maps(void **state)
{
    (void)state;
    relief_case *c = case_new();
    knurl_context *context = case_context(1);
    c->width = c->height = 100;
    for (int spike = 0; spike < 2; spike++) {
        if (spike) c->samples[50 * 100 + 50] = 1.0f;
        knurl_heightmap *map = case_heightmap(context, c);
        shell_space space = {.context = context, .map = map};
        safety_radii radii;
        assert_int_equal(safety_radii_make(&space, 0.0, &radii, NULL), KNURL_OK);
        for (int j = 0; j < 100; j++)
            for (int i = 0; i < 100; i++) {
                int away = abs(i - 50) > abs(j - 50) ? abs(i - 50) : abs(j - 50);
                int r = radii.above[j * 100 + i];
                assert_true(spike ? r < (away > 1 ? away : 1) : r >= SAFETY_LARGEST / 2);
                if (spike && away < 16) assert_true(4 * (r + 1) >= away);
            }
        safety_radii_free(context, &radii);
        knurl_heightmap_release(map);
    }
    knurl_context_release(context);
    free(c);
}

static void radii_shorten_the_walk(void **state)
{
    (void)state;
    relief_case *c = case_new();
    case_square(c, v3(-1.0, 0.0, 1.0), v3(2.0, 0.0, 0.0), v3(0.0, 0.0, -2.0), 1);
    case_fill(c, MAP_BLOCKS, 128, 128, 1);
    disagreement walk = compare_methods(c, "rmip", "texel-walk", 0.0f, 3000, 1e-8, 5);
    disagreement robust =
        compare_methods(c, "rmip", "robust-binary:allowance=0:binary=3", 0.0f, 3000, INFINITY, 5);
    print_disagreement("texel-walk, blocks of 128 x 128", &walk);
    print_disagreement("robust-binary, blocks of 128 x 128", &robust);
    assert_int_equal(wrong(&walk), 0);
    assert_int_equal(wrong(&robust), 0);
    assert_true(2 * robust.steps < walk.steps);
    free(c);
}

/* ---- threads, memory, parameters ---- */

static const char *const METHODS[] = {"texel-walk", "binary", "robust-binary", "robust-binary:zero=clamp"};

static void threads_do_not_matter(void **state)
{
    (void)state;
    relief_case *c = plane_case(5);
    case_fill(c, MAP_SMOOTH, 64, 50, 2);
    check_threads(c, METHODS, sizeof METHODS / sizeof METHODS[0]);
    free(c);
}

static void occlusion_agrees(void **state)
{
    (void)state;
    relief_case *c = plane_case(2);
    knurl_context *context = case_context(1);
    for (size_t m = 0; m < sizeof METHODS / sizeof METHODS[0]; m++) {
        knurl_surface *s = case_surface(context, c, METHODS[m]);
        random_state r = {6};
        vec3 lower, upper;
        surface_box(s, &lower, &upper);
        for (int k = 0; k < 300; k++) {
            knurl_ray ray = random_ray(&r, lower, upper);
            for (uint32_t n = 0; n < knurl_surface_shell_count(s); n++) {
                knurl_hit hit = {.steps = 0};
                bool found = knurl_surface_intersect(s, n, &ray, &hit);
                assert_int_equal(found, knurl_surface_occluded(s, n, &ray));
                if (found) assert_true(hit.t >= ray.tmin && hit.t <= ray.tmax && hit.steps > 0);
            }
        }
        knurl_surface_release(s);
    }
    knurl_context_release(context);
    free(c);
}

static void bytes_are_reported(void **state)
{
    (void)state;
    relief_case *c = plane_case(0);
    knurl_context *context = case_context(1);
    knurl_surface_info plain, robust;
    knurl_surface *a = case_surface(context, c, "texel-walk"), *b = case_surface(context, c, "robust-binary");
    knurl_surface_get_info(a, &plain);
    knurl_surface_get_info(b, &robust);
    assert_true(robust.shell_bytes >= plain.shell_bytes + 2 * (uint64_t)(c->width * c->height));
    knurl_surface_release(a);
    knurl_surface_release(b);
    knurl_context_release(context);
    free(c);
}

static void bad_parameters_are_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "texel-walk:linear=4",         "binary:linear=0",        "binary:binary=-1",
        "binary:linear=5000",          "binary:linear=nan",      "robust-binary:allowance=-0.1",
        "robust-binary:allowance=1.5", "robust-binary:zero=off", "robust-binary:binary=53",
        "robust-binary:allowance=inf", "robust-binary:radius=1", "binary:linear",
    };
    static const char *const good[] = {"texel-walk", "binary:linear=1:binary=0", "robust-binary:allowance=1",
                                       "robust-binary:zero=clamp"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        knurl_error error = {.message = ""};
        assert_int_equal(knurl_method_check(bad[i], NULL, &error), KNURL_ERROR_ARGUMENT);
        assert_true(error.message[0] != 0);
    }
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++)
        assert_int_equal(knurl_method_check(good[i], NULL, NULL), KNURL_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(walk_is_exact_on_planes),  cmocka_unit_test(walk_is_exact_on_boxes),
        cmocka_unit_test(walk_is_exact_on_frusta),  cmocka_unit_test(chord_error_falls_with_size),
        cmocka_unit_test(robust_has_no_wrong_hits), cmocka_unit_test(radii_are_safe),
        cmocka_unit_test(radii_of_simple_maps),     cmocka_unit_test(radii_shorten_the_walk),
        cmocka_unit_test(threads_do_not_matter),    cmocka_unit_test(occlusion_agrees),
        cmocka_unit_test(bytes_are_reported),       cmocka_unit_test(bad_parameters_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
