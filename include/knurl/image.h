/* knurl/image.h: images in memory and in files. */
#ifndef KNURL_IMAGE_H
#define KNURL_IMAGE_H

#include <knurl/base.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum knurl_pixel_format {
    KNURL_PIXEL_U8 = 1,  /* value = sample / 255 */
    KNURL_PIXEL_U16 = 2, /* value = sample / 65535, native byte order */
    KNURL_PIXEL_F32 = 4  /* value = sample */
} knurl_pixel_format;    /* the number is the bytes per sample */

/* Pixels are interleaved, rows from the top, no padding:
 * sample (x, y, c) is element (y * width + x) * channels + c. Values are as the file
 * holds them: no colour transform. Immutable once made, so it may be shared by threads. */
typedef struct knurl_image knurl_image;

/* Copies width * height * channels samples. width and height in [1, 65536],
 * channels in [1, 4]. `samples` may be NULL for an image of zeros. */
KNURL_API knurl_status knurl_image_create(knurl_context *context, int32_t width, int32_t height,
                                          int32_t channels, knurl_pixel_format format, const void *samples,
                                          knurl_image **image, knurl_error *error);
KNURL_API void knurl_image_release(knurl_image *image);
KNURL_API knurl_image *knurl_image_retain(knurl_image *image); /* one more owner; returns image */

KNURL_API int32_t knurl_image_width(const knurl_image *image);
KNURL_API int32_t knurl_image_height(const knurl_image *image);
KNURL_API int32_t knurl_image_channels(const knurl_image *image);
KNURL_API knurl_pixel_format knurl_image_format(const knurl_image *image);
KNURL_API const void *knurl_image_samples(const knurl_image *image);
/* One sample as a float, scaled as its format says. No range check. */
KNURL_API float knurl_image_value(const knurl_image *image, int32_t x, int32_t y, int32_t channel);

/* Reads PNG (1 to 16 bit, palettes expanded), JPEG, TIFF (8/16-bit integer, 32-bit float),
 * OpenEXR (half, float; DWA too), Radiance HDR, PGM/PPM (P2, P3, P5, P6) and PFM. The format is found
 * from the contents, not from the name. Animated and tiled multi-image files give their
 * first image. At most 4 channels are kept: (Y), (Y, A), (R, G, B), (R, G, B, A). */
KNURL_API knurl_status knurl_image_load(knurl_context *context, const char *path, knurl_image **image,
                                        knurl_error *error);
/* The same from `size` bytes in memory; `name` is used in messages. */
KNURL_API knurl_status knurl_image_decode(knurl_context *context, const void *bytes, size_t size,
                                          const char *name, knurl_image **image, knurl_error *error);

/* Writes by the extension of `path`: .png (U8 or U16 samples), .jpg (U8), .tif, .exr (F32; half
 * with knurl_image_save_layers only), .hdr (F32), .pgm/.ppm (U8, U16), .pfm (F32; 1 or 3 channels).
 * Samples are converted to what the format can hold, clamped to [0, 1] for integers.
 * The file appears under its name only when complete; a device or a pipe is written in place. */
KNURL_API knurl_status knurl_image_save(knurl_context *context, const knurl_image *image, const char *path,
                                        knurl_error *error);

/* One named layer of a multi-layer OpenEXR file. The beauty layer has name "" and channels
 * R, G, B(, A); others become "name.R" ... or "name" for one channel; names ending in
 * "position", "normal" use X, Y, Z; "uv" uses U, V. */
typedef struct knurl_image_layer {
    const char *name;
    const knurl_image *image; /* F32; all layers have the same size */
} knurl_image_layer;

/* 32-bit float, ZIP compression, one part. Also readable again by knurl_image_load (beauty only). */
KNURL_API knurl_status knurl_image_save_layers(knurl_context *context, const knurl_image_layer *layers,
                                               int32_t layer_count, const char *path, knurl_error *error);

/* Difference of two images of the same size and channel count. Alpha is compared too. */
typedef struct knurl_image_difference {
    double rmse;         /* root of the mean squared difference over all samples */
    double relative_mse; /* mean of (a - b)^2 / (b^2 + 0.01) */
    double psnr;         /* dB for a peak of 1; infinite for equal images */
    double maximum;      /* largest absolute difference of one sample */
    int32_t worst_x, worst_y;
    uint64_t not_finite; /* samples where exactly one side is not finite; left out of the rest */
} knurl_image_difference;

/* `map` (may be NULL) receives a one-channel F32 image of the largest difference per pixel. */
KNURL_API knurl_status knurl_image_compare(knurl_context *context, const knurl_image *a, const knurl_image *b,
                                           knurl_image_difference *difference, knurl_image **map,
                                           knurl_error *error);

#ifdef __cplusplus
}
#endif
#endif
