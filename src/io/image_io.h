/* io/image_io.h: what the image formats share. One file per format; image_load.c and image_save.c
 * choose between them. */
#ifndef KNURL_SRC_IO_IMAGE_IO_H
#define KNURL_SRC_IO_IMAGE_IO_H

#include "data/image.h"

#include <stdio.h>

/* A file in memory. `bytes` is hostile: nothing in it is to be believed before it is checked. */
typedef struct image_source {
    knurl_context *context;
    const unsigned char *bytes;
    size_t size;
    const char *name; /* messages start with it */
} image_source;

/* Makes *image, or writes an error that starts with the source's name. */
typedef knurl_status image_decode_fn(const image_source *source, knurl_image **image, knurl_error *error);

image_decode_fn image_png_decode, image_jpeg_decode, image_tiff_decode, image_exr_decode, image_hdr_decode,
    image_pnm_decode, image_pfm_decode;

/* Writes `image`, whose format and channel count suit the file type, to `path`; `name` is the final
 * name, for messages. */
typedef knurl_status image_encode_fn(const knurl_image *image, const char *path, const char *name,
                                     knurl_error *error);

image_encode_fn image_png_encode, image_jpeg_encode, image_tiff_encode, image_exr_encode, image_hdr_encode,
    image_pnm_encode, image_pfm_encode;

/* Layers to one OpenEXR part at `path`; all are F32 images of one size. */
knurl_status image_exr_encode_layers(knurl_context *context, const knurl_image_layer *layers, int32_t count,
                                     const char *path, const char *name, knurl_error *error);

/* Reads a DWA-compressed file, which needs OpenEXR's C++ side. `channels` is 1 (Y), 3 or 4. */
knurl_status image_exr_dwa_decode(const image_source *source, int32_t width, int32_t height, int32_t channels,
                                  knurl_image **image, knurl_error *error);

/* fopen for writing, and an fclose that sees errors of all earlier writes. */
knurl_status image_file_open(const char *path, const char *name, FILE **file, knurl_error *error);
knurl_status image_file_close(FILE *file, const char *name, knurl_error *error);

/* Bytes that a library may use of its own besides the image: its allocations cannot be counted. */
size_t image_library_memory(const knurl_context *context);

static inline bool image_little_endian(void)
{
    const uint16_t one = 1;
    return *(const unsigned char *)&one == 1;
}

/* Exact: every half is a float. */
static inline float image_half_to_float(uint16_t half)
{
    uint32_t sign = (uint32_t)(half & 0x8000u) << 16, exponent = (half >> 10) & 31u, mantissa = half & 1023u;
    union {
        uint32_t bits;
        float value;
    } f;
    if (exponent == 0) { /* zero or subnormal: mantissa * 2^-24 */
        f.value = (float)mantissa * 0x1p-24f;
        f.bits |= sign;
    } else {
        f.bits = sign | ((exponent == 31 ? 255u : exponent + 112u) << 23) | mantissa << 13;
    }
    return f.value;
}

#endif
