/* Images in memory: counted, immutable once made. */
#include "data/image.h"

#include <string.h>

knurl_status image_make(knurl_context *context, const char *name, int64_t width, int64_t height,
                        int32_t channels, knurl_pixel_format format, knurl_image **image, knurl_error *error)
{
    const knurl_context_def *def = knurl_context_get_def(context);
    *image = NULL;
    if (width < 1 || height < 1)
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s: image of %lld x %lld pixels, expected at least 1 x 1", name, (long long)width,
                          (long long)height);
    if (width > IMAGE_MAX_SIDE || height > IMAGE_MAX_SIDE)
        return knurl_fail(error, KNURL_ERROR_LIMIT,
                          "%s: image of %lld x %lld pixels, sides may be at most %d", name, (long long)width,
                          (long long)height, IMAGE_MAX_SIDE);
    /* At most 2^32 pixels of 16 bytes from here on: 64-bit products cannot overflow. */
    uint64_t pixels = (uint64_t)width * (uint64_t)height;
    if (pixels > def->max_image_pixels)
        return knurl_fail(error, KNURL_ERROR_LIMIT, "%s: %lld x %lld is %llu pixels, the limit is %llu", name,
                          (long long)width, (long long)height, (unsigned long long)pixels,
                          (unsigned long long)def->max_image_pixels);
    uint64_t bytes = pixels * (uint64_t)channels * (uint64_t)format;
    if (bytes > SIZE_MAX - sizeof(knurl_image) || (def->memory_limit && bytes > def->memory_limit))
        return knurl_fail(error, KNURL_ERROR_LIMIT, "%s: image needs %llu bytes, the memory limit is %llu",
                          name, (unsigned long long)bytes, (unsigned long long)def->memory_limit);
    knurl_image *made = knurl_alloc(context, sizeof(knurl_image) + (size_t)bytes);
    if (!made) return knurl_fail_memory(error, (size_t)bytes, name);
    made->context = knurl_context_retain(context);
    atomic_init(&made->references, 1);
    made->width = (int32_t)width;
    made->height = (int32_t)height;
    made->channels = channels;
    made->format = format;
    *image = made;
    return KNURL_OK;
}

knurl_status knurl_image_create(knurl_context *context, int32_t width, int32_t height, int32_t channels,
                                knurl_pixel_format format, const void *samples, knurl_image **image,
                                knurl_error *error)
{
    if (!image) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "image is NULL");
    *image = NULL;
    if (!context) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "context is NULL");
    if (width < 1 || width > IMAGE_MAX_SIDE || height < 1 || height > IMAGE_MAX_SIDE)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "image of %d x %d pixels, expected 1 to %d per side",
                          width, height, IMAGE_MAX_SIDE);
    if (channels < 1 || channels > IMAGE_MAX_CHANNELS)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "image of %d channels, expected 1 to %d", channels,
                          IMAGE_MAX_CHANNELS);
    if (format != KNURL_PIXEL_U8 && format != KNURL_PIXEL_U16 && format != KNURL_PIXEL_F32)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "pixel format is %d, expected 1, 2 or 4", (int)format);
    knurl_image *made;
    knurl_status status = image_make(context, "image", width, height, channels, format, &made, error);
    if (status != KNURL_OK) return status;
    size_t bytes = image_row_bytes(made) * (size_t)height;
    if (samples)
        memcpy(made->samples, samples, bytes);
    else
        memset(made->samples, 0, bytes);
    *image = made;
    return KNURL_OK;
}

void knurl_image_release(knurl_image *image)
{
    if (!image || atomic_fetch_sub_explicit(&image->references, 1, memory_order_acq_rel) != 1) return;
    knurl_context *context = image->context;
    knurl_free(context, image);
    knurl_context_release(context);
}

knurl_image *knurl_image_retain(knurl_image *image)
{
    if (image) atomic_fetch_add_explicit(&image->references, 1, memory_order_relaxed);
    return image;
}

int32_t knurl_image_width(const knurl_image *image)
{
    return image->width;
}
int32_t knurl_image_height(const knurl_image *image)
{
    return image->height;
}
int32_t knurl_image_channels(const knurl_image *image)
{
    return image->channels;
}
knurl_pixel_format knurl_image_format(const knurl_image *image)
{
    return image->format;
}
const void *knurl_image_samples(const knurl_image *image)
{
    return image->samples;
}

float knurl_image_value(const knurl_image *image, int32_t x, int32_t y, int32_t channel)
{
    size_t i = ((size_t)y * (size_t)image->width + (size_t)x) * (size_t)image->channels + (size_t)channel;
    return image_scaled(image->format, image->samples, i);
}
