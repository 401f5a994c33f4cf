/* ray_npy.c: rays from NumPy arrays (format versions 1, 2 and 3: numpy.lib.format). */
#include "ray_reader.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_HEADER = 1 << 16 };

/* What the header's dictionary says. */
typedef struct npy_header {
    char type[16]; /* "<f8" */
    bool fortran;
    uint64_t shape[2];
    int dimensions; /* 3 stands for more than 2 */
    bool has_type, has_fortran, has_shape;
} npy_header;

typedef struct scanner {
    const char *place, *end;
} scanner;

static void skip_blanks(scanner *text)
{
    while (text->place < text->end && strchr(" \t\r\n", *text->place) && *text->place) text->place++;
}

static bool accept(scanner *text, char symbol)
{
    skip_blanks(text);
    if (text->place >= text->end || *text->place != symbol) return false;
    text->place++;
    return true;
}

static bool accept_word(scanner *text, const char *word)
{
    skip_blanks(text);
    size_t length = strlen(word);
    if ((size_t)(text->end - text->place) < length || memcmp(text->place, word, length) != 0) return false;
    text->place += length;
    return true;
}

/* A quoted string without escapes. */
static bool scan_string(scanner *text, char *out, size_t size)
{
    char quote = accept(text, '\'') ? '\'' : accept(text, '"') ? '"' : 0;
    if (!quote) return false;
    size_t length = 0;
    while (text->place < text->end && *text->place != quote) {
        if (length + 1 >= size) return false;
        out[length++] = *text->place++;
    }
    out[length] = 0;
    return accept(text, quote);
}

static bool scan_count(scanner *text, uint64_t *value)
{
    skip_blanks(text);
    const char *begin = text->place;
    *value = 0;
    for (; text->place < text->end && *text->place >= '0' && *text->place <= '9'; text->place++) {
        if (*value > (UINT64_MAX >> 5)) return false;
        *value = *value * 10 + (uint64_t)(*text->place - '0');
    }
    return text->place > begin;
}

static bool scan_shape(scanner *text, npy_header *header)
{
    if (!accept(text, '(')) return false;
    while (!accept(text, ')')) {
        uint64_t size;
        if (!scan_count(text, &size)) return false;
        if (header->dimensions < 2) header->shape[header->dimensions] = size;
        if (header->dimensions < 3) header->dimensions++;
        if (accept(text, ',')) continue;
        if (!accept(text, ')')) return false;
        break;
    }
    return true;
}

static bool scan_header(scanner text, npy_header *header)
{
    memset(header, 0, sizeof *header);
    if (!accept(&text, '{')) return false;
    while (!accept(&text, '}')) {
        char key[32];
        if (!scan_string(&text, key, sizeof key) || !accept(&text, ':')) return false;
        if (strcmp(key, "descr") == 0) {
            if (!scan_string(&text, header->type, sizeof header->type)) return false;
            header->has_type = true;
        } else if (strcmp(key, "fortran_order") == 0) {
            header->fortran = accept_word(&text, "True");
            if (!header->fortran && !accept_word(&text, "False")) return false;
            header->has_fortran = true;
        } else if (strcmp(key, "shape") == 0) {
            if (!scan_shape(&text, header)) return false;
            header->has_shape = true;
        } else {
            return false;
        }
        if (!accept(&text, ',') && !(text.place < text.end && (skip_blanks(&text), *text.place == '}')))
            return false;
    }
    return header->has_type && header->has_fortran && header->has_shape;
}

static int refuse(ray_reader *reader, const char *found, const char *expected)
{
    return session_fail_with(reader->session, CODE_FILE, "%s: found %s, expected %s", reader->name, found,
                             expected);
}

static int check_header(ray_reader *reader, const npy_header *header)
{
    char text[96];
    bool big_endian = header->type[0] == '>';
    const char *type = header->type + (header->type[0] == '<' || header->type[0] == '>');
    snprintf(text, sizeof text, "%s type '%s'", big_endian ? "big-endian" : "element", header->type);
    if (big_endian || header->type[0] != '<' || (strcmp(type, "f4") != 0 && strcmp(type, "f8") != 0))
        return refuse(reader, text, "little-endian floats, '<f4' or '<f8'");
    if (header->fortran)
        return refuse(reader, "Fortran order (columns first)", "C order; numpy.ascontiguousarray makes it");
    if (header->dimensions != 2) {
        snprintf(text, sizeof text, "%s%d dimension%s", header->dimensions > 2 ? "more than " : "",
                 header->dimensions > 2 ? 2 : header->dimensions, header->dimensions == 1 ? "" : "s");
        return refuse(reader, text, "shape (n, 6) or (n, 8)");
    }
    if (header->shape[1] != 6 && header->shape[1] != 8) {
        snprintf(text, sizeof text, "shape (%llu, %llu)", (unsigned long long)header->shape[0],
                 (unsigned long long)header->shape[1]);
        return refuse(reader, text, "(n, 6) or (n, 8)");
    }
    if (header->shape[0] > (uint64_t)1 << 48) return refuse(reader, "more than 2^48 rays", "fewer");
    reader->total = header->shape[0];
    reader->columns = (int)header->shape[1];
    reader->sample_size = strcmp(type, "f4") == 0 ? 4 : 8;
    return CODE_DONE;
}

int npy_read_header(ray_reader *reader)
{
    const unsigned char *bytes = (const unsigned char *)reader->buffer;
    size_t size = reader->end;
    if (size < 10 || memcmp(bytes, "\x93NUMPY", 6) != 0)
        return refuse(reader, "no NumPy signature", "a .npy file");
    int version = bytes[6];
    if (version < 1 || version > 3)
        return refuse(reader, "an unknown version of the .npy format", "1, 2 or 3");
    size_t start = version == 1 ? 10 : 12;
    size_t length = (size_t)bytes[8] | (size_t)bytes[9] << 8;
    if (version > 1 && size >= 12) length |= (size_t)bytes[10] << 16 | (size_t)bytes[11] << 24;
    if (size < start || length > LONGEST_HEADER || length > size - start)
        return refuse(reader, "a damaged .npy header", "one as numpy.save writes it");
    npy_header header;
    scanner text = {reader->buffer + start, reader->buffer + start + length};
    if (!scan_header(text, &header))
        return refuse(reader, "a damaged .npy header", "descr, fortran_order and shape");
    reader->begin = start + length;
    return check_header(reader, &header);
}

static double sample_at(const unsigned char *bytes, int size)
{
    uint64_t bits = 0;
    for (int i = size; i-- > 0;) bits = bits << 8 | bytes[i];
    if (size == 8) {
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    uint32_t half = (uint32_t)bits;
    float value;
    memcpy(&value, &half, sizeof value);
    return (double)value;
}

static int refuse_ray(ray_reader *reader, ray_fault fault, uint64_t row, const double *values, int column)
{
    static const char *const expected[] = {
        [RAY_NOT_FINITE] = "a finite number", [RAY_NEGATIVE] = "a number not below 0"};
    command_session *session = reader->session;
    unsigned long long number = row;
    if (fault == RAY_NO_DIRECTION)
        return session_fail_with(session, CODE_FILE,
                                 "%s: row %llu: found direction 0,0,0, expected any other", reader->name,
                                 number);
    if (fault == RAY_EMPTY_RANGE)
        return session_fail_with(session, CODE_FILE, "%s: row %llu: found tmin %g above tmax %g",
                                 reader->name, number, values[6], values[7]);
    return session_fail_with(session, CODE_FILE, "%s: row %llu: found %g, expected %s (column %s)",
                             reader->name, number, values[column], expected[fault], ray_column_name(column));
}

int npy_read_rays(ray_reader *reader, knurl_ray *rays, size_t *count)
{
    size_t row = (size_t)reader->columns * (size_t)reader->sample_size;
    if (reader->end - reader->begin < row * RAY_BLOCK && !reader->at_end) {
        reader_fill(reader);
        int code = reader_check_read(reader);
        if (code != CODE_DONE) return code;
    }
    uint64_t left = reader->total - reader->done;
    size_t have = (reader->end - reader->begin) / row;
    size_t wanted = left < RAY_BLOCK ? (size_t)left : RAY_BLOCK;
    if (have < wanted)
        return session_fail_with(reader->session, CODE_FILE, "%s: ends after %llu of %llu rays", reader->name,
                                 (unsigned long long)(reader->done + have),
                                 (unsigned long long)reader->total);
    if (wanted == 0 && reader->end > reader->begin)
        return session_fail_with(reader->session, CODE_FILE, "%s: goes on after its %llu rays", reader->name,
                                 (unsigned long long)reader->total);
    const unsigned char *bytes = (const unsigned char *)reader->buffer + reader->begin;
    for (size_t i = 0; i < wanted; i++) {
        double values[RAY_COLUMNS] = {0, 0, 0, 0, 0, 0, 0, INFINITY};
        for (int k = 0; k < reader->columns; k++, bytes += reader->sample_size)
            values[k] = sample_at(bytes, reader->sample_size);
        int column;
        ray_fault fault = ray_from_values(values, &rays[i], &column);
        if (fault != RAY_GOOD) return refuse_ray(reader, fault, reader->done + i, values, column);
    }
    reader->begin += wanted * row;
    reader->done += wanted;
    *count = wanted;
    return CODE_DONE;
}
