/* data/image.h: what an image is made of, for the modules that fill one in place. */
#ifndef KNURL_SRC_DATA_IMAGE_H
#define KNURL_SRC_DATA_IMAGE_H

#include "base/base.h"

#include <knurl/image.h>

enum { IMAGE_MAX_SIDE = 65536, IMAGE_MAX_CHANNELS = 4 };

/* Header and samples are one block, so that a large image is allocated, and counted, once. */
struct knurl_image {
    knurl_context *context;
    atomic_size_t references;
    int32_t width, height, channels;
    knurl_pixel_format format;
    _Alignas(64) unsigned char samples[]; /* width * height * channels * format bytes */
};

/* An image whose samples are not set yet: the caller fills all of them before it gives the image
 * away. Sides come from files and are checked here, together with max_image_pixels and the memory
 * limit, before anything is allocated. `name` is what messages start with. */
knurl_status image_make(knurl_context *context, const char *name, int64_t width, int64_t height,
                        int32_t channels, knurl_pixel_format format, knurl_image **image, knurl_error *error);

static inline size_t image_row_samples(const knurl_image *image)
{
    return (size_t)image->width * (size_t)image->channels;
}

static inline size_t image_row_bytes(const knurl_image *image)
{
    return image_row_samples(image) * (size_t)image->format;
}

static inline void *image_row(knurl_image *image, int32_t y)
{
    return image->samples + (size_t)y * image_row_bytes(image);
}

static inline const void *image_row_const(const knurl_image *image, int32_t y)
{
    return image->samples + (size_t)y * image_row_bytes(image);
}

/* Sample `i` of a row, or of the whole image, scaled as the format says. */
static inline float image_scaled(knurl_pixel_format format, const void *samples, size_t i)
{
    switch (format) {
    case KNURL_PIXEL_U8:
        return (float)((const uint8_t *)samples)[i] / 255.0f;
    case KNURL_PIXEL_U16:
        return (float)((const uint16_t *)samples)[i] / 65535.0f;
    default:
        return ((const float *)samples)[i];
    }
}

#endif
