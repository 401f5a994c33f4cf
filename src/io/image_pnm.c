/* PGM and PPM (P2, P3, P5, P6), own reader and writer. */
#include "io/image_io.h"

#include <string.h>

typedef struct pnm_reader {
    const image_source *source;
    size_t at;
} pnm_reader;

static bool is_space(unsigned char c)
{
    return c == ' ' || (c >= '\t' && c <= '\r');
}

/* White space, and comments from # to the end of the line. */
static void skip_space(pnm_reader *r)
{
    const image_source *s = r->source;
    while (r->at < s->size) {
        if (s->bytes[r->at] == '#')
            while (r->at < s->size && s->bytes[r->at] != '\n') r->at++;
        else if (is_space(s->bytes[r->at]))
            r->at++;
        else
            break;
    }
}

static knurl_status read_number(pnm_reader *r, const char *what, uint32_t most, uint32_t *number,
                                knurl_error *error)
{
    skip_space(r);
    const image_source *s = r->source;
    if (r->at >= s->size)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: PNM: file ends after %zu bytes, expected %s",
                          s->name, s->size, what);
    uint64_t value = 0;
    size_t start = r->at;
    while (r->at < s->size && s->bytes[r->at] >= '0' && s->bytes[r->at] <= '9' && value <= most)
        value = value * 10 + (uint64_t)(s->bytes[r->at++] - '0');
    if (r->at == start || value > most)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: PNM: byte %zu: expected %s, a number up to %u",
                          s->name, start, what, most);
    *number = (uint32_t)value;
    return KNURL_OK;
}

/* value / most as the nearest value / full. Exact where `full` is a multiple of `most`. */
static uint32_t rescale(uint32_t value, uint32_t most, uint32_t full)
{
    return most == full ? value : (uint32_t)(((uint64_t)value * full + most / 2) / most);
}

static void store(knurl_image *image, size_t i, uint32_t value)
{
    if (image->format == KNURL_PIXEL_U8)
        image->samples[i] = (uint8_t)value;
    else
        ((uint16_t *)(void *)image->samples)[i] = (uint16_t)value;
}

static knurl_status fill(pnm_reader *r, bool text, uint32_t most, knurl_image *image, knurl_error *error)
{
    size_t count = image_row_samples(image) * (size_t)image->height;
    size_t bytes = most < 256 ? 1 : 2;
    uint32_t full = image->format == KNURL_PIXEL_U8 ? 255 : 65535;
    const unsigned char *p = r->source->bytes + r->at;
    if (!text && bytes == 1 && most == full) {
        memcpy(image->samples, p, count);
        return KNURL_OK;
    }
    for (size_t i = 0; i < count; i++) {
        uint32_t value;
        if (text) {
            knurl_status status = read_number(r, "a sample", most, &value, error);
            if (status != KNURL_OK) return status;
        } else {
            value = bytes == 1 ? p[i] : (uint32_t)p[2 * i] << 8 | p[2 * i + 1];
            if (value > most)
                return knurl_fail(error, KNURL_ERROR_INPUT,
                                  "%s: PNM: sample %zu is %u, the largest allowed is %u", r->source->name, i,
                                  value, most);
        }
        store(image, i, rescale(value, most, full));
    }
    return KNURL_OK;
}

knurl_status image_pnm_decode(const image_source *source, knurl_image **image, knurl_error *error)
{
    pnm_reader r = {source, 2};
    char kind = (char)source->bytes[1];
    bool text = kind == '2' || kind == '3';
    int32_t channels = kind == '3' || kind == '6' ? 3 : 1;
    uint32_t width, height, most;
    knurl_status status = read_number(&r, "the width", 1u << 30, &width, error);
    if (status == KNURL_OK) status = read_number(&r, "the height", 1u << 30, &height, error);
    if (status == KNURL_OK) status = read_number(&r, "the largest value", 65535, &most, error);
    if (status != KNURL_OK) return status;
    if (most == 0)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: PNM: largest value is 0, expected 1 to 65535",
                          source->name);
    if (!text) { /* exactly one white space */
        if (r.at >= source->size || !is_space(source->bytes[r.at]))
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "%s: PNM: byte %zu: expected white space before samples", source->name, r.at);
        r.at++;
    }
    /* A text sample takes a digit and, but for the last, a space. Sides are under 2^31: no overflow. */
    uint64_t samples = (uint64_t)width * height * (uint64_t)channels;
    uint64_t least = text ? samples * 2 - (samples > 0) : samples * (most < 256 ? 1 : 2);
    if (width <= IMAGE_MAX_SIDE && height <= IMAGE_MAX_SIDE && source->size - r.at < least)
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s: PNM: %zu bytes of samples, expected %llu for %u x %u", source->name,
                          source->size - r.at, (unsigned long long)least, width, height);
    /* A scale that 8 bits cannot hold exactly goes to 16, where it can be told apart. */
    knurl_pixel_format format = most < 256 && 255 % most == 0 ? KNURL_PIXEL_U8 : KNURL_PIXEL_U16;
    knurl_image *made;
    status = image_make(source->context, source->name, width, height, channels, format, &made, error);
    if (status != KNURL_OK) return status;
    status = fill(&r, text, most, made, error);
    if (status != KNURL_OK) {
        knurl_image_release(made);
        return status;
    }
    *image = made;
    return KNURL_OK;
}

knurl_status image_pnm_encode(const knurl_image *image, const char *path, const char *name,
                              knurl_error *error)
{
    FILE *file;
    knurl_status status = image_file_open(path, name, &file, error);
    if (status != KNURL_OK) return status;
    bool wide = image->format == KNURL_PIXEL_U16;
    fprintf(file, "P%c\n%d %d\n%d\n", image->channels == 3 ? '6' : '5', image->width, image->height,
            wide ? 65535 : 255);
    size_t samples = image_row_samples(image);
    for (int32_t y = 0; y < image->height && !ferror(file); y++) {
        if (!wide) {
            fwrite(image_row_const(image, y), 1, samples, file);
            continue;
        }
        const uint16_t *row = image_row_const(image, y);
        for (size_t i = 0; i < samples; i++) {
            putc_unlocked(row[i] >> 8, file);
            putc_unlocked(row[i] & 255, file);
        }
    }
    return image_file_close(file, name, error);
}
