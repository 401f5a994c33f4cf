/* Radiance HDR (RGBE), own reader and writer. Ward, "Real Pixels", Graphics Gems II, 1991, and the
 * run-length scheme of Radiance's color.c. value = mantissa * 2^(exponent - 136), as most readers
 * have it. EXPOSURE lines are not applied: samples are as the file holds them. */
#include "io/image_io.h"

#include <math.h>
#include <string.h>

typedef struct hdr_reader {
    const image_source *source;
    size_t at;
    int64_t width, height;
    bool bottom_up, right_to_left;
} hdr_reader;

static knurl_status truncated(const hdr_reader *r, const char *where, knurl_error *error)
{
    return knurl_fail(error, KNURL_ERROR_INPUT, "%s: HDR: file ends after %zu bytes, in %s", r->source->name,
                      r->source->size, where);
}

/* A line without its end, cut to `size` - 1 characters. False at the end of the file. */
static bool read_line(hdr_reader *r, char *line, size_t size)
{
    const image_source *s = r->source;
    const unsigned char *end = memchr(s->bytes + r->at, '\n', s->size - r->at);
    if (!end) return false;
    size_t length = (size_t)(end - (s->bytes + r->at)), kept = length < size - 1 ? length : size - 1;
    memcpy(line, s->bytes + r->at, kept);
    line[kept] = 0;
    if (kept > 0 && line[kept - 1] == '\r') line[kept - 1] = 0;
    r->at += length + 1;
    return true;
}

static knurl_status read_header(hdr_reader *r, knurl_error *error)
{
    char line[128], first[3], second[3];
    long long a, b;
    while (true) {
        if (!read_line(r, line, sizeof line)) return truncated(r, "the header", error);
        if (line[0] == 0) break;
        if (strncmp(line, "FORMAT=", 7) == 0 && strcmp(line + 7, "32-bit_rle_rgbe") != 0)
            return knurl_fail(error, KNURL_ERROR_UNSUPPORTED,
                              "%s: HDR: format '%s', expected 32-bit_rle_rgbe", r->source->name, line + 7);
    }
    if (!read_line(r, line, sizeof line)) return truncated(r, "the header", error);
    /* At most 9 digits: scanf may not overflow. */
    int end = 0;
    if (sscanf(line, "%2s %9lld %2s %9lld%n", first, &a, second, &b, &end) != 4 || line[end] != 0)
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s: HDR: size line '%.40s', expected '-Y height +X width'", r->source->name, line);
    bool rows = strcmp(first, "-Y") == 0 || strcmp(first, "+Y") == 0;
    bool columns = strcmp(second, "-X") == 0 || strcmp(second, "+X") == 0;
    if (!rows || !columns)
        return knurl_fail(error, KNURL_ERROR_UNSUPPORTED, "%s: HDR: axes '%s' and '%s', expected -Y and +X",
                          r->source->name, first, second);
    r->height = a;
    r->width = b;
    r->bottom_up = first[0] == '+';
    r->right_to_left = second[0] == '-';
    return KNURL_OK;
}

/* Plain pixels, or the older runs: (1, 1, 1, n) repeats the last pixel, n growing by bytes. */
static knurl_status read_flat_row(hdr_reader *r, unsigned char *row, size_t width, knurl_error *error)
{
    unsigned shift = 0;
    for (size_t x = 0; x < width;) {
        if (r->source->size - r->at < 4) return truncated(r, "the pixels", error);
        const unsigned char *p = r->source->bytes + r->at;
        r->at += 4;
        if (p[0] != 1 || p[1] != 1 || p[2] != 1) {
            memcpy(row + 4 * x++, p, 4);
            shift = 0;
            continue;
        }
        size_t run = shift <= 16 ? (size_t)p[3] << shift : SIZE_MAX;
        shift += 8;
        if (x == 0 || run > width - x)
            return knurl_fail(error, KNURL_ERROR_INPUT, "%s: HDR: run past the end of a row, at byte %zu",
                              r->source->name, r->at - 4);
        for (; run > 0; run--, x++) memcpy(row + 4 * x, row + 4 * (x - 1), 4);
    }
    return KNURL_OK;
}

/* One of the four components of a row, stored apart. */
static knurl_status read_runs(hdr_reader *r, unsigned char *component, size_t width, knurl_error *error)
{
    const image_source *s = r->source;
    for (size_t x = 0; x < width;) {
        if (s->size - r->at < 2) return truncated(r, "the pixels", error);
        size_t code = s->bytes[r->at++];
        size_t run = code > 128 ? code - 128 : code;
        if (run == 0 || run > width - x)
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "%s: HDR: run of %zu with %zu left in the row, at byte %zu", s->name, run,
                              width - x, r->at - 1);
        if (code <= 128 && s->size - r->at < run) return truncated(r, "the pixels", error);
        for (size_t i = 0; i < run; i++, x++) component[4 * x] = s->bytes[code > 128 ? r->at : r->at + i];
        r->at += code > 128 ? 1 : run;
    }
    return KNURL_OK;
}

static knurl_status read_row(hdr_reader *r, unsigned char *row, size_t width, knurl_error *error)
{
    const unsigned char *p = r->source->bytes + r->at;
    if (r->source->size - r->at < 4) return truncated(r, "the pixels", error);
    if (width < 8 || width > 32767 || p[0] != 2 || p[1] != 2 || p[2] > 127)
        return read_flat_row(r, row, width, error);
    size_t length = (size_t)p[2] << 8 | p[3];
    if (length != width)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: HDR: row of %zu pixels at byte %zu, expected %zu",
                          r->source->name, length, r->at, width);
    r->at += 4;
    knurl_status status = KNURL_OK;
    for (size_t c = 0; c < 4 && status == KNURL_OK; c++) status = read_runs(r, row + c, width, error);
    return status;
}

static void expand_row(const unsigned char *row, size_t width, bool reverse, float *to)
{
    for (size_t x = 0; x < width; x++) {
        const unsigned char *p = row + 4 * x;
        float scale = p[3] ? ldexpf(1.0f, (int)p[3] - 136) : 0.0f;
        float *rgb = to + 3 * (reverse ? width - 1 - x : x);
        for (int c = 0; c < 3; c++) rgb[c] = (float)p[c] * scale;
    }
}

knurl_status image_hdr_decode(const image_source *source, knurl_image **image, knurl_error *error)
{
    hdr_reader r = {.source = source};
    knurl_status status = read_header(&r, error);
    if (status != KNURL_OK) return status;
    /* Even the tightest rows have a pixel and a run. */
    int64_t least = r.width < 2 ? 4 : 8;
    if (r.height > 0 && (source->size - r.at) / (size_t)least < (size_t)r.height)
        return truncated(&r, "the pixels", error);
    knurl_image *made;
    status = image_make(source->context, source->name, r.width, r.height, 3, KNURL_PIXEL_F32, &made, error);
    if (status != KNURL_OK) return status;
    size_t width = (size_t)r.width;
    unsigned char *row = knurl_alloc_array(source->context, width, 4);
    if (!row) status = knurl_fail_memory(error, 4 * width, "HDR decoder");
    for (int32_t y = 0; y < made->height && status == KNURL_OK; y++) {
        status = read_row(&r, row, width, error);
        if (status == KNURL_OK)
            expand_row(row, width, r.right_to_left, image_row(made, r.bottom_up ? made->height - 1 - y : y));
    }
    knurl_free(source->context, row);
    if (status != KNURL_OK) {
        knurl_image_release(made);
        return status;
    }
    *image = made;
    return KNURL_OK;
}

/* Negative values and NaN become 0; what is too large, the largest that RGBE holds. Rounds to nearest,
 * so that values that came from RGBE give the same bytes again. */
static void to_rgbe(const float *rgb, unsigned char *rgbe)
{
    float clean[3], largest = 0;
    const float most = 255.0f * 0x1p119f;
    for (int c = 0; c < 3; c++) {
        clean[c] = rgb[c] > 0 ? (rgb[c] < most ? rgb[c] : most) : 0;
        if (clean[c] > largest) largest = clean[c];
    }
    int exponent;
    (void)frexpf(largest, &exponent);
    /* Rounding up to 256 needs the next exponent. */
    if (lrintf(ldexpf(largest, 8 - exponent)) > 255) exponent++;
    if (largest == 0 || exponent + 128 < 1) {
        memset(rgbe, 0, 4);
        return;
    }
    for (int c = 0; c < 3; c++) rgbe[c] = (unsigned char)lrintf(ldexpf(clean[c], 8 - exponent));
    rgbe[3] = (unsigned char)(exponent + 128);
}

/* Plain pixels: the largest mantissa is at least 128, so none can be taken for a run. */
knurl_status image_hdr_encode(const knurl_image *image, const char *path, const char *name,
                              knurl_error *error)
{
    FILE *file;
    knurl_status status = image_file_open(path, name, &file, error);
    if (status != KNURL_OK) return status;
    fprintf(file, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n", image->height, image->width);
    for (int32_t y = 0; y < image->height && !ferror(file); y++) {
        const float *row = image_row_const(image, y);
        for (size_t x = 0; x < (size_t)image->width; x++) {
            unsigned char rgbe[4];
            to_rgbe(row + 3 * x, rgbe);
            fwrite(rgbe, 1, 4, file);
        }
    }
    return image_file_close(file, name, error);
}
