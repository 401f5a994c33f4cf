/* TIFF through libtiff: 8 and 16-bit unsigned integers and 32-bit floats, strips and tiles, samples
 * together or in planes. Messages go to a buffer of the handle, so nothing is printed. */
#include "io/image_io.h"

#include <string.h>
#include <tiffio.h>

typedef struct tiff_job {
    const image_source *source;
    uint64_t at; /* the client's file position */
    char message[256];
    TIFF *tiff;
    uint32_t width, height;
    uint16_t samples, depth; /* per pixel, bits per sample */
    int32_t kept;            /* channels of the image, the first of the samples */
    bool planar, inverted;
    knurl_image *image;
} tiff_job;

static int on_error(TIFF *tiff, void *user, const char *module, const char *format, va_list args)
{
    (void)tiff;
    (void)module;
    tiff_job *job = user;
    if (!job->message[0]) (void)vsnprintf(job->message, sizeof job->message, format, args);
    return 1; /* handled: not passed on to the global handler */
}

static int on_warning(TIFF *tiff, void *user, const char *module, const char *format, va_list args)
{
    (void)tiff;
    (void)user;
    (void)module;
    (void)format;
    (void)args;
    return 1;
}

static tmsize_t on_read(thandle_t user, void *to, tmsize_t size)
{
    tiff_job *job = user;
    if (size <= 0 || job->at >= job->source->size) return 0;
    uint64_t left = job->source->size - job->at;
    if ((uint64_t)size > left) size = (tmsize_t)left;
    memcpy(to, job->source->bytes + job->at, (size_t)size);
    job->at += (uint64_t)size;
    return size;
}

static tmsize_t on_write(thandle_t user, void *from, tmsize_t size)
{
    (void)user;
    (void)from;
    (void)size;
    return 0;
}

static toff_t on_seek(thandle_t user, toff_t offset, int from)
{
    tiff_job *job = user;
    uint64_t base = from == SEEK_CUR ? job->at : from == SEEK_END ? job->source->size : 0;
    job->at = base + offset;
    return job->at;
}

static int on_close(thandle_t user)
{
    (void)user;
    return 0;
}

static toff_t on_size(thandle_t user)
{
    return ((const tiff_job *)user)->source->size;
}

static knurl_status fail(const tiff_job *job, knurl_error *error)
{
    return knurl_fail(error, KNURL_ERROR_INPUT, "%s: TIFF: %s", job->source->name,
                      job->message[0] ? job->message : "cannot be read");
}

static knurl_status unsupported(const tiff_job *job, const char *what, int found, const char *expected,
                                knurl_error *error)
{
    return knurl_fail(error, KNURL_ERROR_UNSUPPORTED, "%s: TIFF: %s is %d, expected %s", job->source->name,
                      what, found, expected);
}

/* Codecs in which a file that knurl can use may come; the rarer ones have a long record of faults. */
static bool known_compression(uint16_t compression)
{
    static const uint16_t known[] = {COMPRESSION_NONE,    COMPRESSION_LZW,      COMPRESSION_ADOBE_DEFLATE,
                                     COMPRESSION_DEFLATE, COMPRESSION_PACKBITS, COMPRESSION_JPEG,
                                     COMPRESSION_LZMA,    COMPRESSION_ZSTD};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i] == compression) return true;
    return false;
}

static knurl_status read_photometric(tiff_job *job, uint16_t compression, bool floats, knurl_error *error)
{
    uint16_t photometric = PHOTOMETRIC_MINISBLACK;
    (void)TIFFGetField(job->tiff, TIFFTAG_PHOTOMETRIC, &photometric);
    job->inverted = photometric == PHOTOMETRIC_MINISWHITE;
    bool converted = photometric == PHOTOMETRIC_YCBCR && compression == COMPRESSION_JPEG && !job->planar;
    if (converted) TIFFSetField(job->tiff, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
    if ((job->inverted && floats) || (photometric > PHOTOMETRIC_RGB && !converted))
        return unsupported(job, "photometric interpretation", photometric, "grey or RGB", error);
    return KNURL_OK;
}

static knurl_status read_header(tiff_job *job, knurl_error *error)
{
    TIFF *tiff = job->tiff;
    uint16_t sample_format, planar, compression, orientation;
    if (!TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &job->width) ||
        !TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &job->height))
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: TIFF: width or height is missing",
                          job->source->name);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &job->samples);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &job->depth);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &sample_format);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &planar);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_COMPRESSION, &compression);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_ORIENTATION, &orientation);
    if (!known_compression(compression))
        return unsupported(job, "compression", compression,
                           "none, LZW, Deflate, PackBits, JPEG, LZMA or Zstandard", error);
    bool floats = sample_format == SAMPLEFORMAT_IEEEFP && job->depth == 32;
    bool integers = (sample_format == SAMPLEFORMAT_UINT || sample_format == SAMPLEFORMAT_VOID) &&
                    (job->depth == 8 || job->depth == 16);
    if (!floats && !integers)
        return knurl_fail(
            error, KNURL_ERROR_UNSUPPORTED,
            "%s: TIFF: %d bits of sample format %d, expected 8 or 16-bit unsigned integers (1) or "
            "32-bit floats (3)",
            job->source->name, job->depth, sample_format);
    if (job->samples < 1 || job->samples > 64)
        return unsupported(job, "samples per pixel", job->samples, "1 to 64", error);
    job->kept = job->samples < IMAGE_MAX_CHANNELS ? job->samples : IMAGE_MAX_CHANNELS;
    job->planar = planar == PLANARCONFIG_SEPARATE && job->samples > 1;
    if (orientation != ORIENTATION_TOPLEFT)
        knurl_log(job->source->context, KNURL_LOG_WARNING, "%s: TIFF: orientation %d is ignored",
                  job->source->name, orientation);
    return read_photometric(job, compression, floats, error);
}

/* Copies `rows` x `columns` pixels of a decoded block whose rows are `stride` pixels of `per_pixel`
 * samples, to the image at (x, y), channels `first` and up. */
static void place(const tiff_job *job, const unsigned char *block, uint32_t stride, int32_t per_pixel,
                  uint32_t x, uint32_t y, uint32_t columns, uint32_t rows, int32_t first)
{
    size_t bytes = (size_t)job->image->format, pixel = (size_t)job->image->channels * bytes;
    size_t copied = (size_t)(per_pixel < job->kept ? per_pixel : job->kept) * bytes;
    for (uint32_t row = 0; row < rows; row++) {
        const unsigned char *from = block + (size_t)row * stride * (size_t)per_pixel * bytes;
        unsigned char *to = image_row(job->image, (int32_t)(y + row));
        to += (size_t)x * pixel + (size_t)first * bytes;
        if (copied == pixel && (size_t)per_pixel * bytes == pixel) {
            memcpy(to, from, columns * pixel);
            continue;
        }
        for (uint32_t i = 0; i < columns; i++)
            memcpy(to + i * pixel, from + i * (size_t)per_pixel * bytes, copied);
    }
}

/* Strips go straight into the image where the layouts agree. */
static knurl_status read_strips(tiff_job *job, knurl_error *error)
{
    uint32_t per_strip = 0;
    TIFFGetFieldDefaulted(job->tiff, TIFFTAG_ROWSPERSTRIP, &per_strip);
    if (per_strip == 0 || per_strip > job->height) per_strip = job->height;
    int32_t per_pixel = job->planar ? 1 : job->samples;
    size_t row = (size_t)job->width * (size_t)per_pixel * (size_t)job->image->format;
    if ((uint64_t)TIFFScanlineSize64(job->tiff) != row)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: TIFF: rows of %llu bytes, expected %zu",
                          job->source->name, (unsigned long long)TIFFScanlineSize64(job->tiff), row);
    bool direct = per_pixel == job->image->channels;
    unsigned char *scratch = direct ? NULL : knurl_alloc_array(job->source->context, row, per_strip);
    if (!direct && !scratch) return knurl_fail_memory(error, row * per_strip, job->source->name);
    knurl_status status = KNURL_OK;
    for (int32_t plane = 0; plane < (job->planar ? job->kept : 1) && status == KNURL_OK; plane++) {
        for (uint32_t y = 0; y < job->height && status == KNURL_OK; y += per_strip) {
            uint32_t rows = job->height - y < per_strip ? job->height - y : per_strip;
            tmsize_t size = (tmsize_t)(rows * row);
            unsigned char *to = direct ? image_row(job->image, (int32_t)y) : scratch;
            uint32_t strip = TIFFComputeStrip(job->tiff, y, (uint16_t)plane);
            if (TIFFReadEncodedStrip(job->tiff, strip, to, size) != size)
                status = fail(job, error);
            else if (!direct)
                place(job, to, job->width, per_pixel, 0, y, job->width, rows, plane);
        }
    }
    knurl_free(job->source->context, scratch);
    return status;
}

static knurl_status read_tile_rows(tiff_job *job, unsigned char *scratch, tmsize_t size, uint32_t tile_width,
                                   uint32_t tile_height, knurl_error *error)
{
    int32_t per_pixel = job->planar ? 1 : job->samples;
    for (int32_t plane = 0; plane < (job->planar ? job->kept : 1); plane++)
        for (uint32_t y = 0; y < job->height; y += tile_height)
            for (uint32_t x = 0; x < job->width; x += tile_width) {
                uint32_t tile = TIFFComputeTile(job->tiff, x, y, 0, (uint16_t)plane);
                if (TIFFReadEncodedTile(job->tiff, tile, scratch, size) != size) return fail(job, error);
                uint32_t columns = job->width - x < tile_width ? job->width - x : tile_width;
                uint32_t rows = job->height - y < tile_height ? job->height - y : tile_height;
                place(job, scratch, tile_width, per_pixel, x, y, columns, rows, plane);
            }
    return KNURL_OK;
}

static knurl_status read_tiles(tiff_job *job, knurl_error *error)
{
    uint32_t tile_width = 0, tile_height = 0;
    TIFFGetField(job->tiff, TIFFTAG_TILEWIDTH, &tile_width);
    TIFFGetField(job->tiff, TIFFTAG_TILELENGTH, &tile_height);
    if (tile_width < 1 || tile_height < 1 || tile_width > IMAGE_MAX_SIDE || tile_height > IMAGE_MAX_SIDE)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: TIFF: tiles of %u x %u pixels, expected 1 to %d",
                          job->source->name, tile_width, tile_height, IMAGE_MAX_SIDE);
    uint64_t pixel = (uint64_t)(job->planar ? 1 : job->samples) * (uint64_t)job->image->format;
    uint64_t bytes = (uint64_t)tile_width * tile_height * pixel;
    uint64_t whole = image_row_bytes(job->image) * (uint64_t)job->height;
    if (bytes != TIFFTileSize64(job->tiff) || bytes > whole * 4 + (64u << 20))
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s: TIFF: tiles of %llu bytes are too large for %u x %u pixels", job->source->name,
                          (unsigned long long)bytes, job->width, job->height);
    unsigned char *scratch = knurl_alloc(job->source->context, (size_t)bytes);
    if (!scratch) return knurl_fail_memory(error, (size_t)bytes, job->source->name);
    knurl_status status = read_tile_rows(job, scratch, (tmsize_t)bytes, tile_width, tile_height, error);
    knurl_free(job->source->context, scratch);
    return status;
}

/* Grey where 0 is white. Alpha, if any, is not turned. */
static void invert(const knurl_image *image, unsigned char *samples)
{
    size_t pixels = (size_t)image->width * (size_t)image->height, step = (size_t)image->channels;
    for (size_t i = 0; i < pixels; i++) {
        if (image->format == KNURL_PIXEL_U8)
            samples[i * step] = (uint8_t)~samples[i * step];
        else {
            uint16_t *wide = (uint16_t *)(void *)samples;
            wide[i * step] = (uint16_t)~wide[i * step];
        }
    }
}

static knurl_status read_all(tiff_job *job, knurl_error *error)
{
    knurl_status status = read_header(job, error);
    if (status != KNURL_OK) return status;
    static const knurl_pixel_format formats[] = {
        [1] = KNURL_PIXEL_U8, [2] = KNURL_PIXEL_U16, [4] = KNURL_PIXEL_F32};
    status = image_make(job->source->context, job->source->name, job->width, job->height, job->kept,
                        formats[job->depth / 8], &job->image, error);
    if (status != KNURL_OK) return status;
    status = TIFFIsTiled(job->tiff) ? read_tiles(job, error) : read_strips(job, error);
    if (status == KNURL_OK && job->inverted) invert(job->image, job->image->samples);
    return status;
}

static TIFFOpenOptions *open_options(tiff_job *job)
{
    TIFFOpenOptions *options = TIFFOpenOptionsAlloc();
    if (!options) return NULL;
    TIFFOpenOptionsSetErrorHandlerExtR(options, on_error, job);
    TIFFOpenOptionsSetWarningHandlerExtR(options, on_warning, job);
    return options;
}

knurl_status image_tiff_decode(const image_source *source, knurl_image **image, knurl_error *error)
{
    tiff_job job = {.source = source};
    TIFFOpenOptions *options = open_options(&job);
    if (!options) return knurl_fail_memory(error, 64, "TIFF decoder");
    TIFFOpenOptionsSetMaxSingleMemAlloc(options, (tmsize_t)image_library_memory(source->context));
    /* "m": no memory mapping: the bytes are in memory already. */
    job.tiff = TIFFClientOpenExt(source->name, "rm", &job, on_read, on_write, on_seek, on_close, on_size,
                                 NULL, NULL, options);
    TIFFOpenOptionsFree(options);
    if (!job.tiff) return fail(&job, error);
    knurl_status status = read_all(&job, error);
    TIFFClose(job.tiff);
    if (status != KNURL_OK) {
        knurl_image_release(job.image);
        return status;
    }
    *image = job.image;
    return KNURL_OK;
}

static bool write_header(TIFF *tiff, const knurl_image *image, uint32_t per_strip)
{
    bool floats = image->format == KNURL_PIXEL_F32;
    bool alpha = image->channels == 2 || image->channels == 4;
    uint16_t extra = EXTRASAMPLE_UNASSALPHA;
    return TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, (uint32_t)image->width) &&
           TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, (uint32_t)image->height) &&
           TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, image->channels) &&
           TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 8 * (int)image->format) &&
           TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, floats ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT) &&
           TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT) &&
           TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) &&
           TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC,
                        image->channels < 3 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB) &&
           (!alpha || TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &extra)) &&
           TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE) &&
           TIFFSetField(tiff, TIFFTAG_PREDICTOR, floats ? PREDICTOR_FLOATINGPOINT : PREDICTOR_HORIZONTAL) &&
           TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, per_strip);
}

/* The predictor works in place, so strips pass through a buffer. */
static bool write_strips(TIFF *tiff, const knurl_image *image, uint32_t per_strip, unsigned char *buffer)
{
    size_t row = image_row_bytes(image);
    for (uint32_t y = 0, strip = 0; y < (uint32_t)image->height; y += per_strip, strip++) {
        uint32_t left = (uint32_t)image->height - y, rows = left < per_strip ? left : per_strip;
        memcpy(buffer, image_row_const(image, (int32_t)y), rows * row);
        if (TIFFWriteEncodedStrip(tiff, strip, buffer, (tmsize_t)(rows * row)) < 0) return false;
    }
    return true;
}

knurl_status image_tiff_encode(const knurl_image *image, const char *path, const char *name,
                               knurl_error *error)
{
    size_t row = image_row_bytes(image);
    uint32_t per_strip = (uint32_t)(row < (1u << 18) ? (1u << 18) / row : 1);
    if (per_strip > (uint32_t)image->height) per_strip = (uint32_t)image->height;
    bool big = (uint64_t)row * (uint64_t)image->height > (UINT64_C(7) << 29); /* 3.5 GiB of a possible 4 */
    tiff_job job = {.width = 0};
    unsigned char *buffer = knurl_alloc(image->context, row * per_strip);
    TIFFOpenOptions *options = open_options(&job);
    knurl_status status = KNURL_OK;
    if (!buffer || !options)
        status = knurl_fail_memory(error, row * per_strip, "TIFF encoder");
    else if (!(job.tiff = TIFFOpenExt(path, big ? "w8" : "w", options)) ||
             !write_header(job.tiff, image, per_strip) || !write_strips(job.tiff, image, per_strip, buffer) ||
             !TIFFFlush(job.tiff))
        status = knurl_fail(error, KNURL_ERROR_OUTPUT, "%s: TIFF: %s", name,
                            job.message[0] ? job.message : "write failed");
    if (job.tiff) TIFFClose(job.tiff);
    if (options) TIFFOpenOptionsFree(options);
    knurl_free(image->context, buffer);
    return status;
}
