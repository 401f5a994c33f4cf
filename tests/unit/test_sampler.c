/* The sampler: its Sobol tables, its stratification, and its independence of everything but its inputs. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "render/camera.h"
#include "render/sampler.h"

#include <string.h>

/* Direction numbers by the recurrence of Bratley and Fox from the primitive polynomials and initial
 * values in Joe and Kuo's file: degree s, coefficients a, m. */
static void test_direction_numbers(void **state)
{
    (void)state;
    static const struct {
        uint32_t s, a, m[3];
    } rows[4] = {{0, 0, {0}}, {1, 0, {1}}, {2, 1, {1, 3}}, {3, 1, {1, 3, 1}}};
    for (uint32_t d = 0; d < 4; d++) {
        uint32_t v[32];
        for (uint32_t i = 0; i < 32; i++) {
            uint32_t s = rows[d].s;
            if (s == 0) {
                v[i] = UINT32_C(1) << (31 - i);
                continue;
            }
            if (i < s) {
                v[i] = rows[d].m[i] << (31 - i);
                continue;
            }
            v[i] = v[i - s] ^ (v[i - s] >> s);
            for (uint32_t k = 1; k < s; k++)
                if (rows[d].a >> (s - 1 - k) & 1u) v[i] ^= v[i - k];
        }
        for (uint32_t i = 0; i < 32; i++) {
            uint32_t x[4];
            sampler_sobol(UINT32_C(1) << i, x);
            assert_int_equal(x[d], v[i]);
        }
    }
}

/* Any prefix of 2^k points has one point per interval of length 2^-k in every dimension. */
static void test_one_point_per_interval(void **state)
{
    (void)state;
    for (uint32_t group = 0; group < 5; group++)
        for (uint32_t d = 0; d < 4; d++) {
            uint8_t seen[256] = {0};
            for (uint32_t i = 0; i < 256; i++) {
                sampler s = sampler_make(7, 11, 13, i);
                double u = sampler_get(&s, group).u[d];
                assert_true(u >= 0.0 && u < 1.0);
                seen[(int)(u * 256.0)]++;
            }
            for (int i = 0; i < 256; i++) assert_int_equal(seen[i], 1);
        }
}

/* The first two dimensions are a (0, 2)-sequence: every elementary box of area 1/64 has its point. */
static void test_elementary_boxes(void **state)
{
    (void)state;
    for (int log_x = 0; log_x <= 6; log_x++) {
        int columns = 1 << log_x, rows = 64 >> log_x;
        uint8_t seen[64] = {0};
        for (uint32_t i = 0; i < 64; i++) {
            sampler s = sampler_make(1, 2, 3, i);
            sample4 p = sampler_get(&s, 2);
            seen[(int)(p.u[0] * columns) * rows + (int)(p.u[1] * rows)]++;
        }
        for (int i = 0; i < 64; i++) assert_int_equal(seen[i], 1);
    }
}

static void test_same_inputs_same_bits(void **state)
{
    (void)state;
    sampler a = sampler_make(5, 100, 200, 9), b = sampler_make(5, 100, 200, 9);
    sample4 pa = sampler_get(&a, 3), pb = sampler_get(&b, 3);
    assert_memory_equal(&pa, &pb, sizeof pa);
    assert_true(sampler_hash(&a, 1, 2) == sampler_hash(&b, 1, 2));
    sampler other[] = {sampler_make(6, 100, 200, 9), sampler_make(5, 101, 200, 9),
                       sampler_make(5, 100, 201, 9), sampler_make(5, 100, 200, 10)};
    for (int i = 0; i < 4; i++) {
        sample4 p = sampler_get(&other[i], 3);
        assert_true(p.u[0] != pa.u[0] && p.u[1] != pa.u[1]);
    }
    sample4 next = sampler_get(&a, 4);
    assert_true(next.u[0] != pa.u[0]);
}

/* Pixels and groups do not correlate: the mean of products of centred numbers is near zero. */
static void test_no_correlation(void **state)
{
    (void)state;
    double pixels = 0.0, groups = 0.0;
    int count = 0;
    for (uint32_t y = 0; y < 64; y++)
        for (uint32_t x = 0; x < 64; x++, count++) {
            sampler a = sampler_make(0, x, y, 0), b = sampler_make(0, x + 1, y, 0);
            sample4 p = sampler_get(&a, 0), q = sampler_get(&b, 0), r = sampler_get(&a, 1);
            pixels += (p.u[0] - 0.5) * (q.u[0] - 0.5);
            groups += (p.u[1] - 0.5) * (r.u[1] - 0.5);
        }
    /* Standard deviation of one product is 1/12; five sigma. */
    double limit = 5.0 / 12.0 / 64.0;
    assert_true(pixels / count < limit && pixels / count > -limit);
    assert_true(groups / count < limit && groups / count > -limit);
}

/* The pixel filter stays in its radius, is even, and has the window's variance. */
static void test_pixel_filter(void **state)
{
    (void)state;
    pixel_filter f;
    pixel_filter_build(&f);
    double mean = 0.0, square = 0.0;
    for (int i = 0; i < 4096; i++) {
        double x = pixel_filter_offset(&f, (i + 0.5) / 4096.0);
        assert_true(x >= -FILTER_RADIUS && x <= FILTER_RADIUS);
        mean += x / 4096.0;
        square += x * x / 4096.0;
    }
    assert_true(mean < 1e-6 && mean > -1e-6);
    /* The variance of the window by numeric integration, times the squared radius. */
    double expected = 0.0, weight = 0.0;
    for (int i = 0; i < 20000; i++) {
        double x = -1.0 + (i + 0.5) / 10000.0, p = 3.14159265358979323846 * (x + 1.0);
        double w = 0.35875 - 0.48829 * cos(p) + 0.14128 * cos(2.0 * p) - 0.01168 * cos(3.0 * p);
        expected += w * x * x;
        weight += w;
    }
    expected *= FILTER_RADIUS * FILTER_RADIUS / weight;
    /* Linear pieces of the inverse spread the rare tails a little. */
    assert_true(square > 0.98 * expected && square < 1.05 * expected);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_direction_numbers), cmocka_unit_test(test_one_point_per_interval),
        cmocka_unit_test(test_elementary_boxes),  cmocka_unit_test(test_same_inputs_same_bits),
        cmocka_unit_test(test_no_correlation),    cmocka_unit_test(test_pixel_filter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
