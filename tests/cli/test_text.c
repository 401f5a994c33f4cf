/* The program's own number formatting and parsing against the C library's, on many values. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../apps/knurl/text.c"

static uint64_t next_random(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

static void check_value(double value)
{
    char found[TEXT_NUMBER_SIZE + 1], expected[64], exact[64];
    *text_format_g9(found, value) = 0;
    snprintf(expected, sizeof expected, "%.9g", value);
    if (strcmp(found, expected) != 0) fail_msg("%a: found %s, expected %s", value, found, expected);
    int length = snprintf(exact, sizeof exact, "%.17g", value);
    double parsed = 0;
    if (!text_parse_number(exact, exact + length, &parsed)) fail_msg("%s is refused", exact);
    if (parsed != value && !isnan(value)) fail_msg("%s: found %a, expected %a", exact, parsed, value);
    if (!text_parse_number(expected, expected + strlen(expected), &parsed))
        fail_msg("%s is refused", expected);
    double library = strtod(expected, NULL);
    if (memcmp(&parsed, &library, sizeof parsed) != 0 && !isnan(value))
        fail_msg("%s: found %a, expected %a", expected, parsed, library);
}

static void test_random_values(void **state)
{
    (void)state;
    uint64_t random = 88172645463325252u;
    for (int i = 0; i < 60000; i++) {
        double unit = (double)(next_random(&random) >> 11) * 0x1p-53;
        double scaled = (2 * unit - 1) * pow(10, (int)(next_random(&random) % 40) - 22);
        check_value(scaled);
        check_value((double)(float)scaled);
        double any;
        uint64_t bits = next_random(&random);
        memcpy(&any, &bits, sizeof any);
        check_value(any);
        check_value((double)(int64_t)(next_random(&random) >> (next_random(&random) % 64)));
        /* Ties at the ninth digit, and products of few binary digits. */
        check_value((double)(next_random(&random) % 2000000000) + 0.5);
        check_value(ldexp((double)(next_random(&random) % 4000000001u), -(int)(next_random(&random) % 40)));
        check_value((double)(next_random(&random) % 1000000000) *
                    pow(10, (int)(next_random(&random) % 20) - 15));
    }
}

static void test_edges(void **state)
{
    (void)state;
    for (int power = -25; power < 20; power++) {
        double value = pow(10, power);
        check_value(value);
        check_value(-value);
        check_value(nextafter(value, 0));
        check_value(nextafter(value, INFINITY));
        check_value(value * (1 - 5e-10));
        check_value(value * 9.999999995);
        check_value(value * 9.9999999949999);
    }
    const double special[] = {0.0, -0.0, INFINITY, -INFINITY, NAN, 5e-324, 1.7976931348623157e308};
    for (size_t i = 0; i < sizeof special / sizeof special[0]; i++) check_value(special[i]);
}

static void test_refused(void **state)
{
    (void)state;
    const char *const refused[] = {"",      " ",    "abc", "1e",  "1e+", "--1", "+-1",
                                   "1.2.3", "0x10", "1 2", ".",   "+",   "-",   "nan(1)",
                                   "1e5x",  ",",    "1,",  "1\n", "1_0", "e5",  "1e1.5"};
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        double value;
        if (text_parse_number(refused[i], refused[i] + strlen(refused[i]), &value))
            fail_msg("'%s' is accepted", refused[i]);
    }
    const char *const accepted[] = {
        "1",   ".5",   "5.",  " 1 ", "\t7",    "+3",    "-0",
        "inf", "-INF", "nan", "1E3", "1e-400", "1e400", "123456789012345678901234567890"};
    for (size_t i = 0; i < sizeof accepted / sizeof accepted[0]; i++) {
        double value, expected = strtod(accepted[i], NULL);
        if (!text_parse_number(accepted[i], accepted[i] + strlen(accepted[i]), &value))
            fail_msg("'%s' is refused", accepted[i]);
        if (value != expected && !isnan(expected)) fail_msg("'%s': found %g", accepted[i], value);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_random_values), cmocka_unit_test(test_edges),
                                       cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
