/* PFM: raw 32-bit floats, rows from the bottom. Header: "PF" (colour) or "Pf" (grey), width, height,
 * and a scale whose sign tells the byte order (negative: little endian). The scale's size is a unit
 * that files disagree on; samples are kept as they are. */
#include "io/image_io.h"

#include <string.h>

enum { PFM_TOKEN = 32 };

static bool is_space(unsigned char c)
{
    return c == ' ' || (c >= '\t' && c <= '\r');
}

/* The next word of the header, and the one white space that ends it. */
static knurl_status read_word(const image_source *s, size_t *at, const char *what, char word[PFM_TOKEN],
                              knurl_error *error)
{
    while (*at < s->size && is_space(s->bytes[*at])) ++*at;
    size_t length = 0;
    while (*at < s->size && length < PFM_TOKEN - 1 && !is_space(s->bytes[*at]))
        word[length++] = (char)s->bytes[(*at)++];
    word[length] = 0;
    if (length == 0 || *at >= s->size || !is_space(s->bytes[*at]))
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: PFM: byte %zu: expected %s", s->name, *at, what);
    ++*at;
    return KNURL_OK;
}

static knurl_status read_side(const image_source *s, size_t *at, const char *what, int64_t *side,
                              knurl_error *error)
{
    char word[PFM_TOKEN];
    knurl_status status = read_word(s, at, what, word, error);
    if (status != KNURL_OK) return status;
    *side = 0;
    for (const char *p = word; *p; p++) {
        if (*p < '0' || *p > '9' || *side > INT32_MAX)
            return knurl_fail(error, KNURL_ERROR_INPUT, "%s: PFM: %s is not a number in range", s->name,
                              what);
        *side = *side * 10 + (*p - '0');
    }
    return KNURL_OK;
}

/* Only the sign matters, so that no locale-dependent number parser is needed. */
static knurl_status read_scale(const image_source *s, size_t *at, bool *little, knurl_error *error)
{
    char word[PFM_TOKEN];
    knurl_status status = read_word(s, at, "the scale", word, error);
    if (status != KNURL_OK) return status;
    *little = word[0] == '-';
    size_t digits = strcspn(word, "123456789"); /* of the mantissa, before any exponent */
    if (strspn(word, "+-.0123456789eE") != strlen(word) || digits >= strcspn(word, "eE"))
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: PFM: scale is not a number other than 0", s->name);
    return KNURL_OK;
}

static void copy_row(float *to, const unsigned char *from, size_t count, bool swap)
{
    if (!swap) {
        memcpy(to, from, count * sizeof(float));
        return;
    }
    for (size_t i = 0; i < count; i++) {
        unsigned char bytes[4] = {from[4 * i + 3], from[4 * i + 2], from[4 * i + 1], from[4 * i]};
        memcpy(&to[i], bytes, sizeof bytes);
    }
}

knurl_status image_pfm_decode(const image_source *source, knurl_image **image, knurl_error *error)
{
    size_t at = 2;
    int64_t width, height;
    bool little;
    int32_t channels = source->bytes[1] == 'F' ? 3 : 1;
    if (source->size < 3 || !is_space(source->bytes[2]))
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: PFM: expected white space after P%c", source->name,
                          source->bytes[1]);
    knurl_status status = read_side(source, &at, "the width", &width, error);
    if (status == KNURL_OK) status = read_side(source, &at, "the height", &height, error);
    if (status == KNURL_OK) status = read_scale(source, &at, &little, error);
    if (status != KNURL_OK) return status;
    bool in_range = width <= IMAGE_MAX_SIDE && height <= IMAGE_MAX_SIDE;
    uint64_t bytes = in_range ? (uint64_t)width * (uint64_t)height * (uint64_t)channels * 4 : 0;
    if (source->size - at < bytes)
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s: PFM: %zu bytes of samples, expected %llu for %lld x %lld", source->name,
                          source->size - at, (unsigned long long)bytes, (long long)width, (long long)height);
    status =
        image_make(source->context, source->name, width, height, channels, KNURL_PIXEL_F32, image, error);
    if (status != KNURL_OK) return status;
    size_t samples = image_row_samples(*image);
    for (int32_t y = 0; y < (*image)->height; y++, at += samples * sizeof(float))
        copy_row(image_row(*image, (*image)->height - 1 - y), source->bytes + at, samples,
                 little != image_little_endian());
    return KNURL_OK;
}

knurl_status image_pfm_encode(const knurl_image *image, const char *path, const char *name,
                              knurl_error *error)
{
    FILE *file;
    knurl_status status = image_file_open(path, name, &file, error);
    if (status != KNURL_OK) return status;
    fprintf(file, "P%c\n%d %d\n%s\n", image->channels == 3 ? 'F' : 'f', image->width, image->height,
            image_little_endian() ? "-1.0" : "1.0");
    for (int32_t y = image->height - 1; y >= 0 && !ferror(file); y--)
        fwrite(image_row_const(image, y), sizeof(float), image_row_samples(image), file);
    return image_file_close(file, name, error);
}
