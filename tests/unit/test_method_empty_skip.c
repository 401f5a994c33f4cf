/* empty-skip: the dilation and erosion maps against brute force, and skips that never change a hit. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "methods/empty_skip/zones.h"
#include "test_relief_common.h"

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

/* Range of the samples within (rx, ry) texels of a texel. */
static void sample_range(const shell_space *space, int i, int j, double rx, double ry, double range[2])
{
    const height_level *level = &space->map->levels[0];
    int ax = (int)ceil(rx), ay = (int)ceil(ry);
    range[0] = INFINITY;
    range[1] = -INFINITY;
    for (int y = j - ay; y <= j + ay; y++)
        for (int x = i - ax; x <= i + ax; x++) {
            double h = height_fetch(level, height_wrap(x, level->width, space->wrap_u),
                                    height_wrap(y, level->height, space->wrap_v));
            range[0] = fmin(range[0], h);
            range[1] = fmax(range[1], h);
        }
}

static void check_texel(const shell_space *space, const zone_map *z, int i, int j, random_state *r)
{
    const zone_texel *t = &z->texels[j * z->width + i];
    double low = space->map->range_min, range = space->map->range_max - low;
    for (int c = 0; c < ZONE_CHANNELS; c++) {
        double dx = ZONE_SIZES[c] * z->width, dy = ZONE_SIZES[c] * z->height, wide[2];
        double top = low + range * t->dilation[c] / 255.0, bottom = low + range * t->erosion[c] / 255.0;
        for (int k = 0; k < 20; k++) {
            double x = i + random_range(r, -0.5, 0.5) + dx * random_range(r, -1, 1);
            double y = j + random_range(r, -0.5, 0.5) + dy * random_range(r, -1, 1);
            double h = signal(space, x, y);
            assert_true(h <= top + 1e-12 && h >= bottom - 1e-12);
        }
        /* No wider than the samples that the box reaches, and a step of 8 bits. */
        sample_range(space, i, j, dx + 0.52, dy + 0.52, wide);
        assert_true(top <= wide[1] + range * 1.001 / 255.0 && bottom >= wide[0] - range * 1.001 / 255.0);
        if (c > 0) assert_true(t->dilation[c] >= t->dilation[c - 1] && t->erosion[c] <= t->erosion[c - 1]);
    }
}

static void zones_hold_their_boxes(void **state)
{
    (void)state;
    random_state r = {8};
    for (int i = 0; i < 12; i++) {
        relief_case *c = plane_case(i);
        if (i == 10) case_fill(c, MAP_NOISE, 1, 7, 1);
        if (i == 11) case_fill(c, MAP_SPIKES, 97, 70, 1);
        knurl_context *context = case_context(2);
        knurl_heightmap *map = case_heightmap(context, c);
        shell_space space = {.context = context, .map = map, .wrap_u = c->wrap_u, .wrap_v = c->wrap_v};
        zone_map zones;
        assert_int_equal(zone_map_make(&space, &zones, NULL), KNURL_OK);
        for (int y = 0; y < zones.height; y++)
            for (int x = 0; x < zones.width; x++) check_texel(&space, &zones, x, y, &r);
        zone_map_free(context, &zones);
        knurl_heightmap_release(map);
        knurl_context_release(context);
        free(c);
    }
}

static relief_case *any_case(int index)
{
    if (index < 9) return plane_case(index);
    if (index < 12) return frustum_case(index);
    if (index < 14) return box_case((case_map)(index - 11));
    relief_case *c = case_new();
    case_sphere(c, 12, 5);
    case_fill(c, MAP_SMOOTH, 48, 24, 3);
    c->wrap_v = KNURL_WRAP_CLAMP;
    return c;
}

/* Zero tolerance: samples lie at the same places, so that hits are the same to the last bit. */
static void skips_never_change_a_hit(void **state)
{
    (void)state;
    disagreement one = {0}, two = {0}, none = {0};
    const float lods[3] = {0.0f, 0.0f, 1.3f};
    for (int i = 0; i < 15; i++) {
        relief_case *c = any_case(i);
        const char *plain = "empty-skip:skips=0:samples=200";
        disagreement d = compare_methods(c, plain, "empty-skip:skips=1:samples=200", lods[i % 3], 800, 0.0,
                                         50u + (unsigned)i);
        add(&one, &d);
        d = compare_methods(c, plain, "empty-skip:skips=2:samples=200", lods[i % 3], 800, 0.0,
                            50u + (unsigned)i);
        add(&two, &d);
        d = compare_methods(c, plain, plain, lods[i % 3], 800, 0.0, 50u + (unsigned)i);
        add(&none, &d);
        free(c);
    }
    print_disagreement("skips 0 against itself", &none);
    print_disagreement("skips 1 against 0", &one);
    print_disagreement("skips 2 against 0", &two);
    assert_true(none.hits > 3000);
    assert_int_equal(wrong(&one), 0);
    assert_int_equal(wrong(&two), 0);
    assert_true(two.steps < one.steps && one.steps < none.steps);
}

static void samples_close_in_on_the_exact_surface(void **state)
{
    (void)state;
    static const char *const methods[3] = {"empty-skip:samples=20:bisections=8",
                                           "empty-skip:samples=150:bisections=8",
                                           "empty-skip:samples=1200:bisections=8"};
    uint64_t off[3];
    for (int k = 0; k < 3; k++) {
        disagreement sum = {0};
        for (int i = 0; i < 9; i++) {
            relief_case *c = plane_case(i);
            disagreement d = compare_methods(c, "rmip", methods[k], 0.0f, 500, 1e-3, 4);
            add(&sum, &d);
            free(c);
        }
        print_disagreement(methods[k], &sum);
        off[k] = wrong(&sum);
    }
    assert_true(off[0] > 0);
    assert_true(off[1] < off[0] && off[2] < off[1]);
}

static void more_bisections_come_closer(void **state)
{
    (void)state;
    relief_case *c = plane_case(1);
    uint64_t before = UINT64_MAX;
    static const char *const methods[3] = {"empty-skip:bisections=0", "empty-skip:bisections=1",
                                           "empty-skip:bisections=4"};
    for (int k = 0; k < 3; k++) {
        disagreement d = compare_methods(c, "rmip", methods[k], 0.0f, 1500, 1e-4, 4);
        print_disagreement(methods[k], &d);
        assert_true(wrong(&d) < before);
        before = wrong(&d);
    }
    free(c);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    static const char *const methods[] = {"empty-skip", "empty-skip:skips=0"};
    relief_case *c = plane_case(5);
    case_fill(c, MAP_SMOOTH, 100, 50, 2);
    check_threads(c, methods, 2);
    free(c);
}

static void bytes_are_reported(void **state)
{
    (void)state;
    relief_case *c = plane_case(0);
    knurl_context *context = case_context(1);
    knurl_surface_info without, with;
    knurl_surface *a = case_surface(context, c, "empty-skip:skips=0"),
                  *b = case_surface(context, c, "empty-skip:skips=1");
    knurl_surface_get_info(a, &without);
    knurl_surface_get_info(b, &with);
    assert_int_equal(with.shell_bytes - without.shell_bytes, 8 * c->width * c->height);
    knurl_surface_release(a);
    knurl_surface_release(b);
    knurl_context_release(context);
    free(c);
}

static void bad_parameters_are_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {"empty-skip:skips=3",     "empty-skip:skips=-1",
                                      "empty-skip:samples=0",   "empty-skip:samples=1e9",
                                      "empty-skip:samples=nan", "empty-skip:bisections=65",
                                      "empty-skip:boxes=4"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        knurl_error error = {.message = ""};
        assert_int_equal(knurl_method_check(bad[i], NULL, &error), KNURL_ERROR_ARGUMENT);
        assert_true(error.message[0] != 0);
    }
    assert_int_equal(knurl_method_check("empty-skip:skips=0:samples=1:bisections=0", NULL, NULL), KNURL_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(zones_hold_their_boxes),
        cmocka_unit_test(skips_never_change_a_hit),
        cmocka_unit_test(samples_close_in_on_the_exact_surface),
        cmocka_unit_test(more_bisections_come_closer),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(bytes_are_reported),
        cmocka_unit_test(bad_parameters_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
