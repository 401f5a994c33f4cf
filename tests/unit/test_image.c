/* Images in memory, and their comparison. */
#include "test_image_common.h"

#include <math.h>

static void test_create_and_value(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    const uint8_t bytes[] = {0, 255, 51, 102, 153, 204};
    const uint16_t words[] = {0, 65535, 13107};
    const float floats[] = {-2.5f, 1e30f};
    knurl_image *a, *b, *c, *zero;
    assert_int_equal(knurl_image_create(context, 1, 2, 3, KNURL_PIXEL_U8, bytes, &a, NULL), KNURL_OK);
    assert_int_equal(knurl_image_create(context, 3, 1, 1, KNURL_PIXEL_U16, words, &b, NULL), KNURL_OK);
    assert_int_equal(knurl_image_create(context, 1, 1, 2, KNURL_PIXEL_F32, floats, &c, NULL), KNURL_OK);
    assert_int_equal(knurl_image_create(context, 5, 4, 4, KNURL_PIXEL_F32, NULL, &zero, NULL), KNURL_OK);
    test_expect_shape(a, 1, 2, 3, KNURL_PIXEL_U8);
    assert_true(knurl_image_value(a, 0, 0, 1) == 1.0f);
    assert_true(knurl_image_value(a, 0, 1, 2) == 204.0f / 255.0f);
    assert_true(knurl_image_value(b, 1, 0, 0) == 1.0f);
    assert_true(knurl_image_value(b, 2, 0, 0) == 13107.0f / 65535.0f);
    assert_true(knurl_image_value(c, 0, 0, 0) == -2.5f && knurl_image_value(c, 0, 0, 1) == 1e30f);
    assert_true(knurl_image_value(zero, 4, 3, 3) == 0.0f);
    assert_memory_equal(knurl_image_samples(a), bytes, sizeof bytes);
    assert_int_equal((uintptr_t)knurl_image_samples(b) % 64, 0);
    assert_true(knurl_image_retain(a) == a);
    knurl_image_release(a);
    assert_true(knurl_image_value(a, 0, 0, 1) == 1.0f);
    /* Images keep their context alive. */
    knurl_context_release(context);
    knurl_image_release(a);
    knurl_image_release(b);
    knurl_image_release(c);
    knurl_image_release(zero);
    knurl_image_release(NULL);
}

static void expect_create(knurl_context *context, int32_t width, int32_t height, int32_t channels, int format,
                          knurl_status expected)
{
    knurl_image *image = (knurl_image *)(uintptr_t)1;
    knurl_error error;
    assert_int_equal(knurl_image_create(context, width, height, channels, (knurl_pixel_format)format, NULL,
                                        &image, &error),
                     expected);
    assert_null(image);
    assert_int_equal(error.status, expected);
}

static void test_create_refuses(void **state)
{
    (void)state;
    knurl_context *context = test_context(1 << 20, 1 << 20);
    expect_create(NULL, 1, 1, 1, 1, KNURL_ERROR_ARGUMENT);
    expect_create(context, 0, 1, 1, 1, KNURL_ERROR_ARGUMENT);
    expect_create(context, 1, -1, 1, 1, KNURL_ERROR_ARGUMENT);
    expect_create(context, 65537, 1, 1, 1, KNURL_ERROR_ARGUMENT);
    expect_create(context, 1, 1, 0, 1, KNURL_ERROR_ARGUMENT);
    expect_create(context, 1, 1, 5, 1, KNURL_ERROR_ARGUMENT);
    expect_create(context, 1, 1, 1, 3, KNURL_ERROR_ARGUMENT);
    expect_create(context, 65536, 65536, 4, 4, KNURL_ERROR_LIMIT); /* pixels */
    expect_create(context, 1024, 1024, 4, 4, KNURL_ERROR_LIMIT);   /* memory, for one image */
    expect_create(context, 1024, 1024, 1, 1, KNURL_ERROR_MEMORY);  /* memory, with its header */
    assert_int_equal(knurl_image_create(context, 1, 1, 1, KNURL_PIXEL_U8, NULL, NULL, NULL),
                     KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void test_compare_known(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    const float va[] = {0.5f, 0.25f, 1.0f, 0.0f}, vb[] = {0.5f, 0.75f, 1.0f, 0.125f};
    knurl_image *a, *b, *map;
    knurl_image_difference d;
    assert_int_equal(knurl_image_create(context, 2, 2, 1, KNURL_PIXEL_F32, va, &a, NULL), KNURL_OK);
    assert_int_equal(knurl_image_create(context, 2, 2, 1, KNURL_PIXEL_F32, vb, &b, NULL), KNURL_OK);
    assert_int_equal(knurl_image_compare(context, a, b, &d, &map, NULL), KNURL_OK);
    double mse = (0.25 + 0.015625) / 4;
    assert_true(fabs(d.rmse - sqrt(mse)) < 1e-15);
    assert_true(fabs(d.psnr + 10 * log10(mse)) < 1e-12);
    assert_true(fabs(d.relative_mse - (0.25 / 0.5725 + 0.015625 / 0.025625) / 4) < 1e-12);
    assert_true(d.maximum == 0.5 && d.worst_x == 1 && d.worst_y == 0 && d.not_finite == 0);
    test_expect_shape(map, 2, 2, 1, KNURL_PIXEL_F32);
    assert_true(knurl_image_value(map, 0, 0, 0) == 0.0f && knurl_image_value(map, 1, 0, 0) == 0.5f &&
                knurl_image_value(map, 1, 1, 0) == 0.125f);
    knurl_image_release(map);
    assert_int_equal(knurl_image_compare(context, a, a, &d, NULL, NULL), KNURL_OK);
    assert_true(d.rmse == 0 && d.maximum == 0 && isinf(d.psnr) && d.psnr > 0);
    knurl_image_release(a);
    knurl_image_release(b);
    knurl_context_release(context);
}

static void test_compare_not_finite(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    const float va[] = {NAN, 1, INFINITY, 2, NAN, 0}, vb[] = {0, 1, INFINITY, -INFINITY, NAN, 0.5f};
    knurl_image *a, *b, *map;
    knurl_image_difference d;
    assert_int_equal(knurl_image_create(context, 3, 1, 2, KNURL_PIXEL_F32, va, &a, NULL), KNURL_OK);
    assert_int_equal(knurl_image_create(context, 3, 1, 2, KNURL_PIXEL_F32, vb, &b, NULL), KNURL_OK);
    assert_int_equal(knurl_image_compare(context, a, b, &d, &map, NULL), KNURL_OK);
    assert_int_equal(d.not_finite, 2);
    assert_true(fabs(d.rmse - sqrt(0.25 / 2)) < 1e-15); /* two samples are left */
    assert_true(d.maximum == 0.5 && d.worst_x == 2);
    assert_true(isinf(knurl_image_value(map, 0, 0, 0)) && knurl_image_value(map, 2, 0, 0) == 0.5f);
    knurl_image_release(map);
    knurl_image_release(a);
    knurl_image_release(b);
    knurl_context_release(context);
}

static void test_compare_shapes_and_threads(void **state)
{
    (void)state;
    knurl_context *one = NULL, *two = test_context(0, 0);
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    assert_int_equal(knurl_context_create(&def, &one, NULL), KNURL_OK);
    knurl_image *a = test_pattern(two, 71, 93, 3, KNURL_PIXEL_F32, 1);
    knurl_image *b = test_pattern(two, 71, 93, 3, KNURL_PIXEL_F32, 2);
    knurl_image *c = test_pattern(two, 71, 93, 4, KNURL_PIXEL_F32, 2);
    knurl_image *bytes = test_pattern(two, 71, 93, 3, KNURL_PIXEL_U8, 2);
    knurl_image_difference d1, d2;
    memset(&d1, 0, sizeof d1);
    memset(&d2, 0, sizeof d2);
    assert_int_equal(knurl_image_compare(one, a, b, &d1, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_image_compare(two, a, b, &d2, NULL, NULL), KNURL_OK);
    assert_true(d1.rmse > 0 && d1.rmse == d2.rmse && d1.relative_mse == d2.relative_mse &&
                d1.maximum == d2.maximum && d1.worst_x == d2.worst_x && d1.worst_y == d2.worst_y);
    assert_int_equal(knurl_image_compare(one, a, c, &d1, NULL, NULL), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_image_compare(one, a, NULL, &d1, NULL, NULL), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_image_compare(one, a, bytes, &d1, NULL, NULL), KNURL_OK);
    knurl_image_release(a);
    knurl_image_release(b);
    knurl_image_release(c);
    knurl_image_release(bytes);
    knurl_context_release(one);
    knurl_context_release(two);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_create_and_value),
        cmocka_unit_test(test_create_refuses),
        cmocka_unit_test(test_compare_known),
        cmocka_unit_test(test_compare_not_finite),
        cmocka_unit_test(test_compare_shapes_and_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
