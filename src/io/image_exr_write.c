/* Writing OpenEXR through OpenEXRCore: one scanline part of 32-bit floats, ZIP. */
#include "io/image_io.h"

#include <openexr.h>
#include <string.h>

enum { EXR_MAX_NAME = 255 };

/* One channel of the file and the image channel that it shows. */
typedef struct exr_channel {
    char name[EXR_MAX_NAME + 1];
    const knurl_image *image;
    int32_t channel;
} exr_channel;

typedef struct exr_writer {
    exr_context_t exr;
    int part;
    exr_channel *channels;
    int32_t count;
    const char *name;
    char message[256];
} exr_writer;

static void on_error(exr_const_context_t exr, exr_result_t code, const char *message)
{
    (void)code;
    void *user = NULL;
    if (!exr || exr_get_user_data(exr, &user) != EXR_ERR_SUCCESS || !user) return;
    exr_writer *w = user;
    if (!w->message[0]) (void)snprintf(w->message, sizeof w->message, "%s", message);
}

static knurl_status fail(const exr_writer *w, exr_result_t result, knurl_error *error)
{
    return knurl_fail(error, result == EXR_ERR_OUT_OF_MEMORY ? KNURL_ERROR_MEMORY : KNURL_ERROR_OUTPUT,
                      "%s: OpenEXR: %s", w->name,
                      w->message[0] ? w->message : exr_get_default_error_message(result));
}

static bool ends_with(const char *text, const char *end)
{
    size_t a = strlen(text), b = strlen(end);
    return a >= b && strcmp(text + a - b, end) == 0;
}

/* What channel `c` of `count` of a layer is called. "" for a lone channel of a named layer. */
static const char *channel_suffix(const char *layer, int32_t count, int32_t c)
{
    static const char *const rgba[] = {"R", "G", "B", "A"}, *const xyz[] = {"X", "Y", "Z", "W"},
                             *const uv[] = {"U", "V", "W", "A"}, *const grey[] = {"Y", "A"};
    if (count == 1) return layer[0] ? "" : "Y";
    if (ends_with(layer, "position") || ends_with(layer, "normal")) return xyz[c];
    if (ends_with(layer, "uv")) return uv[c];
    return count == 2 ? grey[c] : rgba[c];
}

static knurl_status name_channels(exr_writer *w, const knurl_image_layer *layers, int32_t count,
                                  knurl_error *error)
{
    for (int32_t i = 0; i < count; i++)
        for (int32_t c = 0; c < layers[i].image->channels; c++) {
            exr_channel *channel = &w->channels[w->count++];
            const char *suffix = channel_suffix(layers[i].name, layers[i].image->channels, c);
            int length = snprintf(channel->name, sizeof channel->name, "%s%s%s", layers[i].name,
                                  layers[i].name[0] && suffix[0] ? "." : "", suffix);
            if (length < 1 || length > EXR_MAX_NAME)
                return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s: layer name of more than %d characters",
                                  w->name, EXR_MAX_NAME);
            channel->image = layers[i].image;
            channel->channel = c;
            for (int32_t k = 0; k < w->count - 1; k++)
                if (strcmp(w->channels[k].name, channel->name) == 0)
                    return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s: two channels are named '%s'", w->name,
                                      channel->name);
        }
    return KNURL_OK;
}

static exr_result_t write_header(exr_writer *w)
{
    const knurl_image *image = w->channels[0].image;
    exr_result_t result = exr_set_longname_support(w->exr, 1);
    if (result == EXR_ERR_SUCCESS) result = exr_add_part(w->exr, "main", EXR_STORAGE_SCANLINE, &w->part);
    if (result == EXR_ERR_SUCCESS)
        result = exr_initialize_required_attr_simple(w->exr, w->part, image->width, image->height,
                                                     EXR_COMPRESSION_ZIP);
    /* The library keeps the list sorted by name, as the format asks. */
    for (int32_t c = 0; c < w->count && result == EXR_ERR_SUCCESS; c++)
        result = exr_add_channel(w->exr, w->part, w->channels[c].name, EXR_PIXEL_FLOAT,
                                 EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    return result == EXR_ERR_SUCCESS ? exr_write_header(w->exr) : result;
}

static exr_result_t point_channels(const exr_writer *w, exr_encode_pipeline_t *encode, int32_t y)
{
    for (int16_t c = 0; c < encode->channel_count; c++) {
        exr_coding_channel_info_t *to = &encode->channels[c];
        const exr_channel *from = NULL;
        for (int32_t k = 0; k < w->count && !from; k++)
            if (strcmp(w->channels[k].name, to->channel_name) == 0) from = &w->channels[k];
        if (!from) return EXR_ERR_INVALID_ARGUMENT;
        to->user_bytes_per_element = sizeof(float);
        to->user_data_type = EXR_PIXEL_FLOAT;
        to->user_pixel_stride = (int32_t)sizeof(float) * from->image->channels;
        to->user_line_stride = (int32_t)image_row_bytes(from->image);
        to->encode_from_ptr =
            (const uint8_t *)image_row_const(from->image, y) + sizeof(float) * (size_t)from->channel;
    }
    return EXR_ERR_SUCCESS;
}

static exr_result_t write_chunk(const exr_writer *w, exr_encode_pipeline_t *encode, int32_t y)
{
    exr_chunk_info_t chunk;
    exr_result_t result = exr_write_scanline_chunk_info(w->exr, w->part, y, &chunk);
    if (result != EXR_ERR_SUCCESS) return result;
    if (y == 0)
        result = exr_encoding_initialize(w->exr, w->part, &chunk, encode);
    else
        result = exr_encoding_update(w->exr, w->part, &chunk, encode);
    if (result == EXR_ERR_SUCCESS) result = point_channels(w, encode, y);
    if (result == EXR_ERR_SUCCESS && y == 0)
        result = exr_encoding_choose_default_routines(w->exr, w->part, encode);
    return result == EXR_ERR_SUCCESS ? exr_encoding_run(w->exr, w->part, encode) : result;
}

static knurl_status write_file(exr_writer *w, const char *path, knurl_error *error)
{
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = on_error;
    setup.user_data = w;
    exr_result_t result = exr_start_write(&w->exr, path, EXR_WRITE_FILE_DIRECTLY, &setup);
    if (result != EXR_ERR_SUCCESS) return fail(w, result, error);
    result = write_header(w);
    int32_t per_chunk = 0;
    if (result == EXR_ERR_SUCCESS) result = exr_get_scanlines_per_chunk(w->exr, w->part, &per_chunk);
    exr_encode_pipeline_t encode = EXR_ENCODE_PIPELINE_INITIALIZER;
    for (int32_t y = 0; result == EXR_ERR_SUCCESS && y < w->channels[0].image->height; y += per_chunk)
        result = write_chunk(w, &encode, y);
    if (encode.context) exr_encoding_destroy(w->exr, &encode);
    exr_result_t finished = exr_finish(&w->exr);
    if (result == EXR_ERR_SUCCESS) result = finished;
    return result == EXR_ERR_SUCCESS ? KNURL_OK : fail(w, result, error);
}

knurl_status image_exr_encode_layers(knurl_context *context, const knurl_image_layer *layers, int32_t count,
                                     const char *path, const char *name, knurl_error *error)
{
    size_t channels = 0;
    for (int32_t i = 0; i < count; i++) channels += (size_t)layers[i].image->channels;
    if (channels > INT16_MAX)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s: %zu channels, expected at most %d", name,
                          channels, INT16_MAX);
    exr_writer w = {.name = name};
    w.channels = knurl_alloc_array(context, channels, sizeof *w.channels);
    if (!w.channels) return knurl_fail_memory(error, channels * sizeof *w.channels, "OpenEXR encoder");
    knurl_status status = name_channels(&w, layers, count, error);
    if (status == KNURL_OK) status = write_file(&w, path, error);
    knurl_free(context, w.channels);
    return status;
}

knurl_status image_exr_encode(const knurl_image *image, const char *path, const char *name,
                              knurl_error *error)
{
    const knurl_image_layer layer = {"", image};
    return image_exr_encode_layers(image->context, &layer, 1, path, name, error);
}
