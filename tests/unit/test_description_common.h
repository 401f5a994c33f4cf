/* Loading scenes from text and bytes in tests, and checking messages. */
#ifndef KNURL_TEST_DESCRIPTION_COMMON_H
#define KNURL_TEST_DESCRIPTION_COMMON_H

#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/description.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

static knurl_context *context;

static inline int make_context(void **state)
{
    (void)state;
    knurl_context_def def = knurl_context_def_default();
    return knurl_context_create(&def, &context, NULL) == KNURL_OK ? 0 : 1;
}

/* Whatever happened in the tests, nothing may be left allocated. */
static inline int drop_context(void **state)
{
    (void)state;
    uint64_t left = knurl_context_bytes(context);
    knurl_context_release(context);
    return left == 0 ? 0 : 1;
}

static inline void write_bytes(const char *path, const void *bytes, size_t size)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static inline knurl_description *load_file(const char *path)
{
    knurl_description *d = NULL;
    knurl_error error = {0};
    knurl_status status = knurl_description_load(context, path, &d, &error);
    if (status != KNURL_OK) print_error("%s\n", error.message);
    assert_int_equal(status, KNURL_OK);
    assert_non_null(d);
    return d;
}

/* Loads the file and expects a failure whose message contains both pieces. */
static inline void expect_failure(const char *path, knurl_status expected, const char *place,
                                  const char *detail)
{
    knurl_description *d = (knurl_description *)&context; /* must become NULL */
    knurl_error error = {0};
    knurl_status status = knurl_description_load(context, path, &d, &error);
    if (status != expected || !strstr(error.message, place) || !strstr(error.message, detail))
        print_error("status %d, \"%s\", expected %d, \"%s\", \"%s\"\n", status, error.message, expected,
                    place, detail);
    assert_int_equal(status, expected);
    assert_int_equal(error.status, expected);
    assert_null(d);
    assert_non_null(strstr(error.message, place));
    assert_non_null(strstr(error.message, detail));
}

static inline bool has_warning(const knurl_description *d, const char *text)
{
    for (uint32_t i = 0; i < d->warning_count; i++)
        if (strstr(d->warnings[i], text)) return true;
    return false;
}

static inline void expect_numbers(const double *found, size_t count, const double *expected)
{
    for (size_t i = 0; i < count; i++) {
        if (!(fabs(found[i] - expected[i]) <= 1e-12))
            print_error("number %zu is %.17g, expected %.17g\n", i, found[i], expected[i]);
        assert_true(fabs(found[i] - expected[i]) <= 1e-12);
    }
}
#define EXPECT_NUMBERS(found, ...)                                                                           \
    expect_numbers(found, sizeof((double[]){__VA_ARGS__}) / sizeof(double), (const double[]){__VA_ARGS__})

#endif
