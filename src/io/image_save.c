/* Saving images: the format is chosen by the extension, samples are converted to what it holds. */
#include "io/image_io.h"

#include <errno.h>
#include <math.h>
#include <string.h>
#include <strings.h>

typedef struct image_writer {
    const char *extension;
    image_encode_fn *encode;
    unsigned formats;            /* sum of the knurl_pixel_format values it takes */
    knurl_pixel_format fallback; /* what others become */
    int32_t channels_for[5];     /* indexed by the image's channels; 0: refused */
} image_writer;

enum { U8 = KNURL_PIXEL_U8, U16 = KNURL_PIXEL_U16, F32 = KNURL_PIXEL_F32 };

static const image_writer writers[] = {
    {".png", image_png_encode, U8 | U16, KNURL_PIXEL_U16, {0, 1, 2, 3, 4}},
    {".jpg", image_jpeg_encode, U8, KNURL_PIXEL_U8, {0, 1, 1, 3, 3}},
    {".jpeg", image_jpeg_encode, U8, KNURL_PIXEL_U8, {0, 1, 1, 3, 3}},
    {".tif", image_tiff_encode, U8 | U16 | F32, KNURL_PIXEL_F32, {0, 1, 2, 3, 4}},
    {".tiff", image_tiff_encode, U8 | U16 | F32, KNURL_PIXEL_F32, {0, 1, 2, 3, 4}},
    {".exr", image_exr_encode, F32, KNURL_PIXEL_F32, {0, 1, 2, 3, 4}},
    {".hdr", image_hdr_encode, F32, KNURL_PIXEL_F32, {0, 3, 3, 3, 3}},
    {".pgm", image_pnm_encode, U8 | U16, KNURL_PIXEL_U16, {0, 1, 1, 0, 0}},
    {".ppm", image_pnm_encode, U8 | U16, KNURL_PIXEL_U16, {0, 3, 3, 3, 3}},
    {".pfm", image_pfm_encode, F32, KNURL_PIXEL_F32, {0, 1, 1, 3, 3}},
};

static const image_writer *find_writer(const char *path)
{
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash : path, '.');
    for (size_t i = 0; dot && i < sizeof writers / sizeof *writers; i++)
        if (strcasecmp(dot, writers[i].extension) == 0) return &writers[i];
    return NULL;
}

/* Nearest integer of value * most with value clamped to [0, 1]; NaN gives 0. */
static uint16_t quantise(float value, float most)
{
    if (!(value > 0)) return 0;
    return (uint16_t)lrintf((value < 1 ? value : 1) * most);
}

static void convert_sample(const void *from, knurl_pixel_format from_format, size_t i, void *to,
                           knurl_pixel_format to_format, size_t j)
{
    if (to_format == KNURL_PIXEL_F32) {
        ((float *)to)[j] = image_scaled(from_format, from, i);
        return;
    }
    uint16_t value; /* 0 to 65535, or 0 to 255 where the target is U8 */
    if (from_format == KNURL_PIXEL_U8 && to_format == KNURL_PIXEL_U16)
        value = (uint16_t)(((const uint8_t *)from)[i] * 257);
    else if (from_format == KNURL_PIXEL_U8)
        value = ((const uint8_t *)from)[i];
    else if (from_format == KNURL_PIXEL_U16 && to_format == KNURL_PIXEL_U8)
        value = (uint16_t)((((const uint16_t *)from)[i] * 255u + 32767u) / 65535u);
    else if (from_format == KNURL_PIXEL_U16)
        value = ((const uint16_t *)from)[i];
    else
        value = quantise(((const float *)from)[i], to_format == KNURL_PIXEL_U8 ? 255.0f : 65535.0f);
    if (to_format == KNURL_PIXEL_U8)
        ((uint8_t *)to)[j] = (uint8_t)value;
    else
        ((uint16_t *)to)[j] = value;
}

/* Grey spreads over three channels; alpha, always the last of an even count, is left out. */
static knurl_status convert(knurl_context *context, const knurl_image *image, const char *name,
                            int32_t channels, knurl_pixel_format format, knurl_image **converted,
                            knurl_error *error)
{
    knurl_status status =
        image_make(context, name, image->width, image->height, channels, format, converted, error);
    if (status != KNURL_OK) return status;
    bool grey = image->channels <= 2 && channels >= 3;
    for (int32_t y = 0; y < image->height; y++) {
        const void *from = image_row_const(image, y);
        void *to = image_row(*converted, y);
        for (size_t x = 0, j = 0; x < (size_t)image->width; x++)
            for (int32_t c = 0; c < channels; c++, j++)
                convert_sample(from, image->format, x * (size_t)image->channels + (size_t)(grey ? 0 : c), to,
                               format, j);
    }
    return KNURL_OK;
}

static knurl_status encode_and_commit(const image_writer *writer, const knurl_image *image, const char *path,
                                      knurl_error *error)
{
    knurl_output output;
    knurl_status status = knurl_output_open(path, &output, error);
    if (status != KNURL_OK) return status;
    status = writer->encode(image, output.path, path, error);
    if (status != KNURL_OK) {
        knurl_output_discard(&output);
        return status;
    }
    return knurl_output_commit(&output, error);
}

knurl_status knurl_image_save(knurl_context *context, const knurl_image *image, const char *path,
                              knurl_error *error)
{
    if (!context || !image || !path)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "context, image or path is NULL");
    const image_writer *writer = find_writer(path);
    if (!writer)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "%s: extension names no image format, expected .png, .jpg, .tif, .exr, .hdr, .pgm, "
                          ".ppm or .pfm",
                          path);
    int32_t channels = writer->channels_for[image->channels];
    if (channels == 0)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s: cannot hold %d channels", path, image->channels);
    bool alpha = image->channels == 2 || image->channels == 4;
    if (alpha && channels != image->channels)
        knurl_log(context, KNURL_LOG_WARNING, "%s: the format has no alpha; alpha is left out", path);
    knurl_pixel_format format = (writer->formats & image->format) ? image->format : writer->fallback;
    if (channels == image->channels && format == image->format)
        return encode_and_commit(writer, image, path, error);
    knurl_image *converted;
    knurl_status status = convert(context, image, path, channels, format, &converted, error);
    if (status != KNURL_OK) return status;
    status = encode_and_commit(writer, converted, path, error);
    knurl_image_release(converted);
    return status;
}

knurl_status knurl_image_save_layers(knurl_context *context, const knurl_image_layer *layers,
                                     int32_t layer_count, const char *path, knurl_error *error)
{
    if (!context || !layers || !path)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "context, layers or path is NULL");
    if (layer_count < 1)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s: %d layers, expected at least 1", path,
                          layer_count);
    for (int32_t i = 0; i < layer_count; i++) {
        const knurl_image *image = layers[i].image, *first = layers[0].image;
        if (!layers[i].name || !image)
            return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s: layer %d has no name or no image", path, i);
        if (image->format != KNURL_PIXEL_F32 || image->width != first->width ||
            image->height != first->height)
            return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                              "%s: layer '%s' is %d x %d of format %d, expected %d x %d of 32-bit floats",
                              path, layers[i].name, image->width, image->height, (int)image->format,
                              first->width, first->height);
    }
    knurl_output output;
    knurl_status status = knurl_output_open(path, &output, error);
    if (status != KNURL_OK) return status;
    status = image_exr_encode_layers(context, layers, layer_count, output.path, path, error);
    if (status != KNURL_OK) {
        knurl_output_discard(&output);
        return status;
    }
    return knurl_output_commit(&output, error);
}

knurl_status image_file_open(const char *path, const char *name, FILE **file, knurl_error *error)
{
    *file = fopen(path, "wb");
    if (!*file) return knurl_fail(error, KNURL_ERROR_OUTPUT, "%s: %s", name, strerror(errno));
    return KNURL_OK;
}

knurl_status image_file_close(FILE *file, const char *name, knurl_error *error)
{
    bool bad = ferror(file) != 0;
    if (fclose(file) != 0) bad = true;
    if (bad)
        return knurl_fail(error, KNURL_ERROR_OUTPUT, "%s: write failed: %s", name,
                          errno ? strerror(errno) : "disk full?");
    return KNURL_OK;
}
