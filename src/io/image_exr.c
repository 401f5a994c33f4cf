/* Reading OpenEXR through OpenEXRCore, from memory: the first flat part, level 0, half, float and
 * unsigned channels, as 32-bit floats. The image is the data window. The core library decompresses;
 * channels are taken out of its chunks here, because only some of its own unpackers convert types. */
#include "io/image_io.h"

#include <openexr.h>
#include <stdlib.h>
#include <string.h>

enum { EXR_MAX_PICKS = IMAGE_MAX_CHANNELS };

typedef struct exr_job {
    const image_source *source;
    exr_context_t exr;
    int part;
    exr_storage_t storage;
    exr_compression_t compression;
    exr_attr_box2i_t window;
    int64_t width, height;
    int32_t picks[EXR_MAX_PICKS]; /* channel of the file for each of the image, -1: zeros */
    int32_t pick_count;
    bool plain_names; /* the picks are R, G, B(, A) or Y, without a layer's name */
    knurl_image *image;
    char message[256];
} exr_job;

static int64_t on_read(exr_const_context_t exr, void *user, void *to, uint64_t size, uint64_t offset,
                       exr_stream_error_func_ptr_t error_cb)
{
    (void)exr;
    (void)error_cb;
    const image_source *source = ((const exr_job *)user)->source;
    if (offset >= source->size) return 0;
    if (size > source->size - offset) size = source->size - offset;
    memcpy(to, source->bytes + offset, (size_t)size);
    return (int64_t)size;
}

static int64_t on_size(exr_const_context_t exr, void *user)
{
    (void)exr;
    return (int64_t)((const exr_job *)user)->source->size;
}

static void on_error(exr_const_context_t exr, exr_result_t code, const char *message)
{
    (void)code;
    void *user = NULL;
    if (!exr || exr_get_user_data(exr, &user) != EXR_ERR_SUCCESS || !user) return;
    exr_job *job = user;
    if (!job->message[0]) (void)snprintf(job->message, sizeof job->message, "%s", message);
}

/* Zeroed, so that a decompressor that stops early leaves no stray memory in an image. */
static void *on_alloc(size_t size)
{
    return calloc(1, size);
}

static knurl_status fail(const exr_job *job, exr_result_t result, knurl_error *error)
{
    knurl_status status = result == EXR_ERR_OUT_OF_MEMORY             ? KNURL_ERROR_MEMORY
                          : result == EXR_ERR_FEATURE_NOT_IMPLEMENTED ? KNURL_ERROR_UNSUPPORTED
                                                                      : KNURL_ERROR_INPUT;
    return knurl_fail(error, status, "%s: OpenEXR: %s", job->source->name,
                      job->message[0] ? job->message : exr_get_default_error_message(result));
}

static int32_t find_channel(const exr_attr_chlist_t *list, const char *prefix, size_t prefix_length,
                            const char *name)
{
    for (int32_t i = 0; i < list->num_channels; i++) {
        const char *full = list->entries[i].name.str;
        if (strncmp(full, prefix, prefix_length) == 0 && strcmp(full + prefix_length, name) == 0) return i;
    }
    return -1;
}

/* Channel sets in order of preference. The first `needed` must be there. */
typedef struct channel_set {
    const char *names[EXR_MAX_PICKS];
    int32_t needed;
} channel_set;

static const channel_set channel_sets[] = {
    {{"R", "G", "B", "A"}, 3},   {{"X", "Y", "Z", NULL}, 3},  {{"Y", "A", NULL, NULL}, 1},
    {{"U", "V", NULL, NULL}, 2}, {{"R", "G", NULL, NULL}, 1},
};

static bool pick_set(exr_job *job, const exr_attr_chlist_t *list, const char *prefix, size_t prefix_length)
{
    for (size_t s = 0; s < sizeof channel_sets / sizeof *channel_sets; s++) {
        const channel_set *set = &channel_sets[s];
        int32_t count = 0;
        for (; count < EXR_MAX_PICKS && set->names[count]; count++) {
            job->picks[count] = find_channel(list, prefix, prefix_length, set->names[count]);
            if (job->picks[count] < 0) break;
        }
        if (count < set->needed) continue;
        job->pick_count = count;
        job->plain_names = prefix_length == 0 && (s == 0 || (s == 2 && count == 1));
        return true;
    }
    return false;
}

/* The unnamed layer first, then the first layer with a known set, then the first channel. */
static knurl_status pick_channels(exr_job *job, knurl_error *error)
{
    const exr_attr_chlist_t *list = NULL;
    exr_result_t result = exr_get_channels(job->exr, job->part, &list);
    if (result != EXR_ERR_SUCCESS) return fail(job, result, error);
    if (list->num_channels < 1)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: OpenEXR: no channels", job->source->name);
    bool found = pick_set(job, list, "", 0);
    for (int32_t i = 0; i < list->num_channels && !found; i++) {
        const char *name = list->entries[i].name.str, *dot = strrchr(name, '.');
        if (dot) found = pick_set(job, list, name, (size_t)(dot - name) + 1);
    }
    if (!found) {
        job->picks[0] = 0;
        job->pick_count = 1;
        if (list->num_channels > 1)
            knurl_log(job->source->context, KNURL_LOG_WARNING, "%s: only channel '%s' of %d is read",
                      job->source->name, list->entries[0].name.str, list->num_channels);
    }
    for (int32_t c = 0; c < job->pick_count; c++) {
        const exr_attr_chlist_entry_t *entry = &list->entries[job->picks[c]];
        if (entry->x_sampling != 1 || entry->y_sampling != 1)
            return knurl_fail(error, KNURL_ERROR_UNSUPPORTED,
                              "%s: OpenEXR: channel '%s' is subsampled %d x %d, expected 1 x 1",
                              job->source->name, entry->name.str, entry->x_sampling, entry->y_sampling);
    }
    return KNURL_OK;
}

static knurl_status read_header(exr_job *job, knurl_error *error)
{
    int parts = 0;
    exr_result_t result = exr_get_count(job->exr, &parts);
    for (job->part = 0; result == EXR_ERR_SUCCESS && job->part < parts; job->part++) {
        result = exr_get_storage(job->exr, job->part, &job->storage);
        if (job->storage == EXR_STORAGE_SCANLINE || job->storage == EXR_STORAGE_TILED) break;
    }
    if (result != EXR_ERR_SUCCESS) return fail(job, result, error);
    if (job->part >= parts)
        return knurl_fail(error, KNURL_ERROR_UNSUPPORTED, "%s: OpenEXR: %d deep parts, expected a flat one",
                          job->source->name, parts);
    result = exr_get_data_window(job->exr, job->part, &job->window);
    if (result == EXR_ERR_SUCCESS) result = exr_get_compression(job->exr, job->part, &job->compression);
    if (result != EXR_ERR_SUCCESS) return fail(job, result, error);
    job->width = (int64_t)job->window.max.x - job->window.min.x + 1;
    job->height = (int64_t)job->window.max.y - job->window.min.y + 1;
    return pick_channels(job, error);
}

static uint32_t load_u32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* `count` little-endian samples to every `step`-th float. */
static void convert_samples(const unsigned char *from, uint16_t type, size_t count, float *to, size_t step)
{
    for (size_t i = 0; i < count; i++, to += step) {
        if (type == EXR_PIXEL_HALF)
            *to = image_half_to_float((uint16_t)(from[2 * i] | from[2 * i + 1] << 8));
        else if (type == EXR_PIXEL_UINT)
            *to = (float)load_u32(from + 4 * i);
        else {
            uint32_t bits = load_u32(from + 4 * i);
            memcpy(to, &bits, sizeof bits);
        }
    }
}

/* A chunk holds, row by row, each channel's samples of the row. (x, y): its place in the image. */
static bool unpack_chunk(const exr_job *job, const exr_decode_pipeline_t *decode, int64_t x, int64_t y)
{
    const unsigned char *p = decode->unpacked_buffer, *end = p + decode->chunk.unpacked_size;
    size_t channels = (size_t)job->pick_count;
    if (!p || x < 0 || y < 0 || x + decode->chunk.width > job->width ||
        y + decode->chunk.height > job->height)
        return false;
    for (int32_t row = 0; row < decode->chunk.height; row++) {
        float *to = image_row(job->image, (int32_t)(y + row));
        to += (size_t)x * channels;
        for (int32_t c = 0; c < decode->channel_count; c++) {
            const exr_coding_channel_info_t *channel = &decode->channels[c];
            if (channel->y_samples > 1 && (job->window.min.y + y + row) % channel->y_samples != 0) continue;
            size_t width = (size_t)channel->width, bytes = width * (size_t)channel->bytes_per_element;
            if ((size_t)(end - p) < bytes) return false;
            for (size_t k = 0; k < channels; k++)
                if (job->picks[k] == c && width == (size_t)decode->chunk.width)
                    convert_samples(p, channel->data_type, width, to + k, channels);
            p += bytes;
        }
    }
    return true;
}

/* `started` tells whether `decode` was initialised; its buffers are used again for each chunk. */
static knurl_status decode_chunk(exr_job *job, exr_decode_pipeline_t *decode, bool *started,
                                 const exr_chunk_info_t *chunk, int64_t x, int64_t y, knurl_error *error)
{
    if (chunk->packed_size == 0 || chunk->packed_size > job->source->size)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: OpenEXR: chunk %d of %llu bytes in a file of %zu",
                          job->source->name, chunk->idx, (unsigned long long)chunk->packed_size,
                          job->source->size);
    if (chunk->unpacked_size > image_library_memory(job->source->context))
        return knurl_fail(error, KNURL_ERROR_LIMIT, "%s: OpenEXR: chunk of %llu bytes, the limit is %zu",
                          job->source->name, (unsigned long long)chunk->unpacked_size,
                          image_library_memory(job->source->context));
    exr_result_t result;
    if (*started)
        result = exr_decoding_update(job->exr, job->part, chunk, decode);
    else {
        result = exr_decoding_initialize(job->exr, job->part, chunk, decode);
        *started = true;
        if (result == EXR_ERR_SUCCESS)
            result = exr_decoding_choose_default_routines(job->exr, job->part, decode);
        decode->unpack_and_convert_fn = NULL; /* unpack_chunk does it */
    }
    if (result == EXR_ERR_SUCCESS) result = exr_decoding_run(job->exr, job->part, decode);
    if (result != EXR_ERR_SUCCESS) return fail(job, result, error);
    if (!unpack_chunk(job, decode, x, y))
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: OpenEXR: chunk %d does not fit the image",
                          job->source->name, chunk->idx);
    return KNURL_OK;
}

static knurl_status read_scanlines(exr_job *job, exr_decode_pipeline_t *decode, bool *started,
                                   knurl_error *error)
{
    int32_t per_chunk = 0;
    exr_result_t result = exr_get_scanlines_per_chunk(job->exr, job->part, &per_chunk);
    if (result != EXR_ERR_SUCCESS || per_chunk < 1) return fail(job, result, error);
    for (int64_t y = 0; y < job->height; y += per_chunk) {
        exr_chunk_info_t chunk;
        result = exr_read_scanline_chunk_info(job->exr, job->part, (int)(job->window.min.y + y), &chunk);
        if (result != EXR_ERR_SUCCESS) return fail(job, result, error);
        if (chunk.height != (job->height - y < per_chunk ? job->height - y : per_chunk) ||
            chunk.width != job->width)
            return knurl_fail(error, KNURL_ERROR_INPUT, "%s: OpenEXR: chunk %d has a wrong size",
                              job->source->name, chunk.idx);
        knurl_status status = decode_chunk(job, decode, started, &chunk, 0, y, error);
        if (status != KNURL_OK) return status;
    }
    return KNURL_OK;
}

static knurl_status read_tiles(exr_job *job, exr_decode_pipeline_t *decode, bool *started, knurl_error *error)
{
    int32_t width = 0, height = 0;
    exr_result_t result = exr_get_tile_sizes(job->exr, job->part, 0, 0, &width, &height);
    if (result != EXR_ERR_SUCCESS || width < 1 || height < 1) return fail(job, result, error);
    for (int64_t y = 0; y < job->height; y += height)
        for (int64_t x = 0; x < job->width; x += width) {
            exr_chunk_info_t chunk;
            result = exr_read_tile_chunk_info(job->exr, job->part, (int)(x / width), (int)(y / height), 0, 0,
                                              &chunk);
            if (result != EXR_ERR_SUCCESS) return fail(job, result, error);
            if (chunk.width != (job->width - x < width ? job->width - x : width) ||
                chunk.height != (job->height - y < height ? job->height - y : height))
                return knurl_fail(error, KNURL_ERROR_INPUT, "%s: OpenEXR: chunk %d has a wrong size",
                                  job->source->name, chunk.idx);
            knurl_status status = decode_chunk(job, decode, started, &chunk, x, y, error);
            if (status != KNURL_OK) return status;
        }
    return KNURL_OK;
}

static knurl_status read_pixels(exr_job *job, knurl_error *error)
{
    if (job->compression == EXR_COMPRESSION_DWAA || job->compression == EXR_COMPRESSION_DWAB) {
        if (!job->plain_names || job->part != 0)
            return knurl_fail(error, KNURL_ERROR_UNSUPPORTED,
                              "%s: OpenEXR: DWA compression of other channels than R, G, B(, A) or Y",
                              job->source->name);
        return image_exr_dwa_decode(job->source, (int32_t)job->width, (int32_t)job->height, job->pick_count,
                                    &job->image, error);
    }
    knurl_status status = image_make(job->source->context, job->source->name, job->width, job->height,
                                     job->pick_count, KNURL_PIXEL_F32, &job->image, error);
    if (status != KNURL_OK) return status;
    exr_decode_pipeline_t decode = EXR_DECODE_PIPELINE_INITIALIZER;
    bool started = false;
    if (job->storage == EXR_STORAGE_TILED)
        status = read_tiles(job, &decode, &started, error);
    else
        status = read_scanlines(job, &decode, &started, error);
    if (started) exr_decoding_destroy(job->exr, &decode);
    return status;
}

knurl_status image_exr_decode(const image_source *source, knurl_image **image, knurl_error *error)
{
    exr_job job = {.source = source};
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = on_error;
    setup.alloc_fn = on_alloc;
    setup.free_fn = free;
    setup.user_data = &job;
    setup.read_fn = on_read;
    setup.size_fn = on_size;
    setup.max_image_width = setup.max_image_height = IMAGE_MAX_SIDE;
    setup.max_tile_width = setup.max_tile_height = IMAGE_MAX_SIDE;
    setup.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    exr_result_t result = exr_start_read(&job.exr, source->name, &setup);
    if (result != EXR_ERR_SUCCESS) return fail(&job, result, error);
    knurl_status status = read_header(&job, error);
    if (status == KNURL_OK) status = read_pixels(&job, error);
    exr_finish(&job.exr);
    if (status != KNURL_OK) {
        knurl_image_release(job.image);
        return status;
    }
    *image = job.image;
    return KNURL_OK;
}
