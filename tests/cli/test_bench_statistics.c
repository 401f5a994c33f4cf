/* Medians, percentiles and disagreement of `knurl bench` against values worked out by hand. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>

#include "../../apps/knurl/bench_statistics.c"

static void check_spread(const double *values, size_t count, double lowest, double median, double highest)
{
    double copy[8];
    for (size_t i = 0; i < count; i++) copy[i] = values[i];
    spread found = spread_of(copy, count);
    if (found.lowest != lowest || found.median != median || found.highest != highest)
        fail_msg("found %g %g %g, expected %g %g %g", found.lowest, found.median, found.highest, lowest,
                 median, highest);
}

static void test_spread(void **state)
{
    (void)state;
    check_spread((const double[]){7}, 1, 7, 7, 7);
    check_spread((const double[]){3, -1}, 2, -1, 1, 3);
    check_spread((const double[]){5, 1, 4}, 3, 1, 4, 5);
    check_spread((const double[]){9, 2, 8, 1}, 4, 1, 5, 9);
    check_spread((const double[]){4, 4, 1, 4, 4}, 5, 1, 4, 4);
    check_spread((const double[]){2, INFINITY, 1}, 3, 1, 2, INFINITY);
    spread none = spread_of(NULL, 0);
    assert_true(isnan(none.lowest) && isnan(none.median) && isnan(none.highest));
}

/* Nearest rank: the k-th smallest of n with the smallest k >= part * n. */
static void test_percentile(void **state)
{
    (void)state;
    double values[1000];
    static const size_t counts[] = {1, 2, 99, 100, 101, 200, 1000};
    for (size_t c = 0; c < sizeof counts / sizeof counts[0]; c++) {
        size_t n = counts[c];
        for (size_t i = 0; i < n; i++) values[i] = (double)(i * 7919 % n) + 1; /* 1..n, out of order */
        size_t rank = (99 * n + 99) / 100;
        double found = percentile_of(values, n, 0.99);
        if (found != (double)rank) fail_msg("of 1..%zu: found %g, expected %zu", n, found, rank);
        assert_true(percentile_of(values, n, 1) == (double)n);
        assert_true(percentile_of(values, n, 1e-9) == 1);
    }
    assert_true(isnan(percentile_of(values, 0, 0.99)));
}

static void test_steps(void **state)
{
    (void)state;
    uint32_t steps[200];
    double scratch[200];
    for (uint32_t i = 0; i < 200; i++) steps[i] = i < 198 ? 10 : 1000 + i;
    step_statistics found = step_statistics_of(steps, 200, scratch);
    assert_true(found.mean == (198 * 10 + 1198 + 1199) / 200.0);
    assert_true(found.p99 == 10 && found.highest == 1199);
    assert_int_equal(steps[199], 1199);
    steps[0] = UINT32_MAX;
    assert_true(step_statistics_of(steps, 200, scratch).highest == 4294967295.0);
    assert_true(isnan(step_statistics_of(steps, 0, scratch).mean));
}

static void test_disagreement(void **state)
{
    (void)state;
    double scratch[6];
    const double exact[6] = {1, 2, NAN, NAN, 5, 8};
    const double other[6] = {1, NAN, NAN, 4, 5.5, 6};
    disagreement found = disagreement_of(other, exact, 6, 2, scratch);
    assert_int_equal(found.missed, 1);
    assert_int_equal(found.invented, 1);
    assert_true(found.median == 0.25 && found.p99 == 1); /* of 0, 0.25 and 1 */
    found = disagreement_of(exact, exact, 6, 2, scratch);
    assert_true(found.missed == 0 && found.invented == 0 && found.median == 0 && found.p99 == 0);
    const double nothing[6] = {NAN, NAN, NAN, NAN, NAN, NAN};
    found = disagreement_of(nothing, exact, 6, 2, scratch);
    assert_int_equal(found.missed, 4);
    assert_true(found.invented == 0 && isnan(found.median) && isnan(found.p99));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_spread),
        cmocka_unit_test(test_percentile),
        cmocka_unit_test(test_steps),
        cmocka_unit_test(test_disagreement),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
