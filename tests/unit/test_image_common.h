/* What the image tests share: contexts, patterns and comparing samples. */
#ifndef KNURL_TEST_IMAGE_COMMON_H
#define KNURL_TEST_IMAGE_COMMON_H

#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/image.h>
#include "base/base.h"
#include "data/image.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static inline knurl_context *test_context(uint64_t memory, uint64_t pixels)
{
    knurl_context_def def = knurl_context_def_default();
    def.threads = 2;
    def.memory_limit = memory;
    if (pixels) def.max_image_pixels = pixels;
    knurl_context *context = NULL;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

static inline uint32_t test_random(uint32_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

/* Random samples, the extremes among them; floats are finite and of both signs. */
static inline knurl_image *test_pattern(knurl_context *context, int32_t width, int32_t height,
                                        int32_t channels, knurl_pixel_format format, uint32_t seed)
{
    size_t count = (size_t)width * (size_t)height * (size_t)channels;
    unsigned char *samples = malloc(count * (size_t)format);
    assert_non_null(samples);
    uint32_t state = seed * 2654435761u + 1;
    for (size_t i = 0; i < count; i++) {
        uint32_t r = test_random(&state);
        if (i == 0) r = 0;
        if (i == 1) r = UINT32_MAX;
        float f = ((float)(r >> 8) - 8388608.0f) * 0x1p-20f;
        uint16_t wide = (uint16_t)(r >> 16);
        if (format == KNURL_PIXEL_U8)
            samples[i] = (unsigned char)(r >> 24);
        else if (format == KNURL_PIXEL_U16)
            memcpy(samples + 2 * i, &wide, 2);
        else
            memcpy(samples + 4 * i, &f, 4);
    }
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(context, width, height, channels, format, samples, &image, NULL),
                     KNURL_OK);
    free(samples);
    return image;
}

static inline void test_expect_shape(const knurl_image *image, int32_t width, int32_t height,
                                     int32_t channels, knurl_pixel_format format)
{
    assert_int_equal(knurl_image_width(image), width);
    assert_int_equal(knurl_image_height(image), height);
    assert_int_equal(knurl_image_channels(image), channels);
    assert_int_equal(knurl_image_format(image), format);
}

static inline void test_expect_same(const knurl_image *a, const knurl_image *b)
{
    test_expect_shape(a, b->width, b->height, b->channels, b->format);
    assert_memory_equal(a->samples, b->samples, image_row_bytes(b) * (size_t)b->height);
}

static inline const char *test_path(const char *name)
{
    static char path[1024];
    (void)snprintf(path, sizeof path, "%s/image_%s", KNURL_TEST_DIR, name);
    return path;
}

static inline knurl_image *test_load(knurl_context *context, const char *path)
{
    knurl_image *image = NULL;
    knurl_error error = {KNURL_OK, ""};
    if (knurl_image_load(context, path, &image, &error) != KNURL_OK) fail_msg("%s", error.message);
    return image;
}

static inline void test_save(knurl_context *context, const knurl_image *image, const char *path)
{
    knurl_error error = {KNURL_OK, ""};
    if (knurl_image_save(context, image, path, &error) != KNURL_OK) fail_msg("%s", error.message);
}

/* Decodes bytes and expects failure with `status`, `text` in the message, and nothing left behind. */
static inline void test_expect_failure(knurl_context *context, const void *bytes, size_t size,
                                       knurl_status status, const char *text)
{
    uint64_t before = knurl_context_bytes(context);
    knurl_image *image = (knurl_image *)(uintptr_t)1;
    knurl_error error = {KNURL_OK, ""};
    knurl_status got = knurl_image_decode(context, bytes, size, "the file", &image, &error);
    if (got != status || !strstr(error.message, text) || !strstr(error.message, "the file"))
        fail_msg("got '%s' (%s), expected '%s' in a %s", error.message, knurl_status_name(got), text,
                 knurl_status_name(status));
    assert_int_equal(error.status, status);
    assert_null(image);
    assert_int_equal(knurl_context_bytes(context), before);
}

#endif
