/* ray_reader.c: opens ray files, and reads rays from CSV. NumPy arrays are in ray_npy.c. */
#include "ray_reader.h"
#include "parallel.h"
#include "text.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char *const column_names[RAY_COLUMNS] = {"ox", "oy", "oz", "dx", "dy", "dz", "tmin", "tmax"};

enum {
    BUFFER_SIZE = 8 << 20, /* bytes of text held at once */
    CHUNK = 4096           /* lines parsed by one thread at a time */
};

/* ---- bytes ---- */

size_t reader_fill(ray_reader *reader)
{
    if (reader->begin > 0) {
        memmove(reader->buffer, reader->buffer + reader->begin, reader->end - reader->begin);
        reader->end -= reader->begin;
        reader->begin = 0;
    }
    while (reader->end < BUFFER_SIZE && !reader->at_end) {
        size_t got = fread(reader->buffer + reader->end, 1, BUFFER_SIZE - reader->end, reader->file);
        if (got == 0) reader->at_end = true;
        reader->end += got;
        reader->consumed += got;
    }
    reader->buffer[reader->end] = 0;
    return reader->end;
}

int reader_check_read(ray_reader *reader)
{
    if (!ferror(reader->file)) return CODE_DONE;
    return session_fail_with(reader->session, CODE_FILE, "%s: read failed: %s", reader->name,
                             strerror(errno));
}

/* ---- the header ---- */

static bool same_name(const char *begin, size_t length, const char *name)
{
    return strlen(name) == length && memcmp(begin, name, length) == 0;
}

static void trim(const char **begin, const char **end)
{
    while (*begin < *end && (**begin == ' ' || **begin == '\t')) (*begin)++;
    while (*end > *begin && ((*end)[-1] == ' ' || (*end)[-1] == '\t' || (*end)[-1] == '\r')) (*end)--;
}

/* At most 40 bytes of a field, safe to print. */
static const char *printable(const char *begin, const char *end, char text[48])
{
    size_t length = 0;
    for (; begin < end && length < 40; begin++)
        text[length++] = (unsigned char)*begin < ' ' || *begin == 0x7f ? '?' : *begin;
    if (begin < end) {
        memcpy(text + length, "...", 3);
        length += 3;
    }
    text[length] = 0;
    return text;
}

static int header_name(ray_reader *reader, const char *begin, const char *end, bool seen[RAY_COLUMNS])
{
    char shown[48];
    trim(&begin, &end);
    if (reader->field_count >= RAY_COLUMNS)
        return session_fail_with(reader->session, CODE_FILE, "%s:1: found more than %d columns", reader->name,
                                 RAY_COLUMNS);
    for (int column = 0; column < RAY_COLUMNS; column++) {
        if (!same_name(begin, (size_t)(end - begin), column_names[column])) continue;
        if (seen[column])
            return session_fail_with(reader->session, CODE_FILE, "%s:1: found column %s twice", reader->name,
                                     column_names[column]);
        seen[column] = true;
        reader->field_column[reader->field_count++] = column;
        return CODE_DONE;
    }
    return session_fail_with(reader->session, CODE_FILE,
                             "%s:1: found '%s', expected a column name: ox, oy, oz, dx, dy, dz, tmin or tmax",
                             reader->name, printable(begin, end, shown));
}

static int read_header(ray_reader *reader)
{
    size_t size = reader_fill(reader);
    int code = reader_check_read(reader);
    if (code != CODE_DONE) return code;
    const char *text = reader->buffer;
    if (size >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0) text += 3; /* byte order mark */
    const char *stop = reader->buffer + size;
    const char *line_end = memchr(text, '\n', (size_t)(stop - text));
    if (!line_end) line_end = stop;
    if (text == stop)
        return session_fail_with(reader->session, CODE_FILE,
                                 "%s: is empty, expected a header such as ox,oy,oz,dx,dy,dz", reader->name);
    bool seen[RAY_COLUMNS] = {false};
    for (const char *place = text;;) {
        const char *comma = memchr(place, ',', (size_t)(line_end - place));
        code = header_name(reader, place, comma ? comma : line_end, seen);
        if (code != CODE_DONE) return code;
        if (!comma) break;
        place = comma + 1;
    }
    for (int column = 0; column < 6; column++)
        if (!seen[column])
            return session_fail_with(reader->session, CODE_FILE, "%s:1: column %s is missing", reader->name,
                                     column_names[column]);
    reader->begin = (size_t)(line_end - reader->buffer) + (line_end < stop ? 1 : 0);
    reader->lines_read = 1;
    return CODE_DONE;
}

/* ---- rays ---- */

ray_fault ray_from_values(const double values[RAY_COLUMNS], knurl_ray *ray, int *column)
{
    for (int i = 0; i < RAY_COLUMNS; i++) {
        *column = i;
        if (isnan(values[i]) || (isinf(values[i]) && i != 7)) return RAY_NOT_FINITE;
        if (i >= 6 && values[i] < 0) return RAY_NEGATIVE;
    }
    memset(ray, 0, sizeof *ray);
    for (int i = 0; i < 3; i++) {
        ray->origin[i] = values[i];
        ray->direction[i] = values[3 + i];
    }
    ray->tmin = values[6];
    ray->tmax = values[7];
    ray->mask = UINT32_MAX;
    if (values[3] == 0 && values[4] == 0 && values[5] == 0) return RAY_NO_DIRECTION;
    return ray->tmin > ray->tmax ? RAY_EMPTY_RANGE : RAY_GOOD;
}

const char *ray_column_name(int column)
{
    return column_names[column];
}

typedef struct csv_block {
    ray_reader *reader;
    const size_t *line_begin; /* count + 1 offsets; a line ends before its '\n' */
    size_t count;
    knurl_ray *rays;
    bool *bad; /* one per chunk: has a line that is refused */
} csv_block;

/* Reads one line; on a fault *field and *field_end name the culprit where there is one. */
static ray_fault parse_line(const ray_reader *reader, const char *begin, const char *end, knurl_ray *ray,
                            int *column, const char **field, const char **field_end)
{
    double values[RAY_COLUMNS] = {0, 0, 0, 0, 0, 0, 0, INFINITY};
    const char *fields[RAY_COLUMNS] = {NULL}, *field_ends[RAY_COLUMNS] = {NULL};
    if (end > begin && end[-1] == '\r') end--;
    if (begin == end) return RAY_BLANK;
    const char *place = begin;
    for (int i = 0; i < reader->field_count; i++) {
        const char *stop = place;
        while (stop < end && *stop != ',') stop++;
        bool last = i + 1 == reader->field_count;
        if ((stop == end) != last) return RAY_FIELD_COUNT;
        *column = reader->field_column[i];
        *field = fields[*column] = place;
        *field_end = field_ends[*column] = stop;
        if (!text_parse_number(place, stop, &values[*column])) return RAY_NOT_A_NUMBER;
        place = stop + 1;
    }
    ray_fault fault = ray_from_values(values, ray, column);
    *field = fields[*column];
    *field_end = field_ends[*column];
    return fault;
}

static void parse_chunk(void *user, size_t chunk)
{
    csv_block *block = user;
    size_t end = (chunk + 1) * CHUNK < block->count ? (chunk + 1) * CHUNK : block->count;
    const char *text = block->reader->buffer;
    int column;
    const char *field, *field_end;
    for (size_t i = chunk * CHUNK; i < end; i++) {
        const char *begin = text + block->line_begin[i], *stop = text + block->line_begin[i + 1] - 1;
        if (parse_line(block->reader, begin, stop, &block->rays[i], &column, &field, &field_end) == RAY_GOOD)
            continue;
        block->bad[chunk] = true;
        return;
    }
}

static int count_fields(const char *begin, const char *end)
{
    int count = 1;
    for (; begin < end; begin++) count += *begin == ',';
    return count;
}

/* Says what is wrong with line `number`, which was refused. */
static int refuse_line(ray_reader *reader, const char *begin, const char *end, uint64_t number)
{
    knurl_ray ray;
    int column = 0;
    const char *field = begin, *field_end = begin;
    ray_fault fault = parse_line(reader, begin, end, &ray, &column, &field, &field_end);
    char shown[48], place[32];
    snprintf(place, sizeof place, "%llu", (unsigned long long)number);
    printable(field, field_end, shown);
    command_session *session = reader->session;
    const char *name = reader->name;
    switch (fault) {
    case RAY_BLANK:
        return session_fail_with(session, CODE_FILE, "%s:%s: blank line, expected a ray", name, place);
    case RAY_FIELD_COUNT:
        return session_fail_with(session, CODE_FILE, "%s:%s: found %d fields, expected %d", name, place,
                                 count_fields(begin, end), reader->field_count);
    case RAY_NOT_FINITE:
        return session_fail_with(session, CODE_FILE,
                                 "%s:%s: found '%s', expected a finite number (column %s)", name, place,
                                 shown, column_names[column]);
    case RAY_NEGATIVE:
        return session_fail_with(session, CODE_FILE,
                                 "%s:%s: found '%s', expected a number not below 0 (column %s)", name, place,
                                 shown, column_names[column]);
    case RAY_NO_DIRECTION:
        return session_fail_with(session, CODE_FILE, "%s:%s: found direction 0,0,0, expected any other", name,
                                 place);
    case RAY_EMPTY_RANGE:
        return session_fail_with(session, CODE_FILE, "%s:%s: found tmin %g above tmax %g", name, place,
                                 ray.tmin, ray.tmax);
    case RAY_NOT_A_NUMBER:
    case RAY_GOOD:
        break;
    }
    return session_fail_with(session, CODE_FILE, "%s:%s: found '%s', expected a number (column %s)", name,
                             place, shown, column_names[column]);
}

/* Finds up to RAY_BLOCK whole lines in the buffer. */
static size_t split_lines(ray_reader *reader, size_t *line_begin)
{
    size_t count = 0, place = reader->begin;
    line_begin[0] = place;
    while (count < RAY_BLOCK && place < reader->end) {
        const char *found = memchr(reader->buffer + place, '\n', reader->end - place);
        if (!found && !reader->at_end) break;
        place = found ? (size_t)(found - reader->buffer) + 1 : reader->end + 1;
        line_begin[++count] = place;
    }
    return count;
}

static int read_csv(ray_reader *reader, knurl_ray *rays, size_t *count)
{
    size_t lines = split_lines(reader, reader->line_begin);
    if (lines < RAY_BLOCK && !reader->at_end) {
        reader_fill(reader);
        int code = reader_check_read(reader);
        if (code != CODE_DONE) return code;
        lines = split_lines(reader, reader->line_begin);
    }
    if (lines == 0 && reader->end > reader->begin)
        return session_fail_with(reader->session, CODE_FILE, "%s:%llu: line of more than %d bytes",
                                 reader->name, (unsigned long long)reader->lines_read + 1, BUFFER_SIZE);
    bool bad[RAY_BLOCK / CHUNK] = {false};
    csv_block block = {reader, reader->line_begin, lines, rays, bad};
    size_t chunks = (lines + CHUNK - 1) / CHUNK;
    parallel_chunks(knurl_context_threads(reader->session->context), chunks, parse_chunk, &block);
    for (size_t chunk = 0; chunk < chunks; chunk++) {
        if (!bad[chunk]) continue;
        for (size_t i = chunk * CHUNK; i < lines; i++) {
            const char *begin = reader->buffer + reader->line_begin[i];
            const char *end = reader->buffer + reader->line_begin[i + 1] - 1;
            const char *field, *field_end;
            int column;
            if (parse_line(reader, begin, end, &rays[i], &column, &field, &field_end) != RAY_GOOD)
                return refuse_line(reader, begin, end, reader->lines_read + i + 1);
        }
    }
    size_t next = reader->line_begin[lines];
    reader->begin = next < reader->end ? next : reader->end;
    reader->lines_read += lines;
    *count = lines;
    return CODE_DONE;
}

/* ---- reader ---- */

static int open_file(ray_reader *reader, const char *path)
{
    struct stat info;
    if (strcmp(path, "-") == 0) {
        reader->file = stdin;
        snprintf(reader->name, sizeof reader->name, "standard input");
    } else {
        snprintf(reader->name, sizeof reader->name, "%s", path);
        reader->file = fopen(path, "rb");
        if (!reader->file)
            return session_fail_with(reader->session, CODE_FILE, "%s: %s", path, strerror(errno));
    }
    if (fstat(fileno(reader->file), &info) == 0) {
        if (S_ISDIR(info.st_mode))
            return session_fail_with(reader->session, CODE_FILE, "%s: is a folder, expected a file of rays",
                                     path);
        if (S_ISREG(info.st_mode)) reader->size = (uint64_t)info.st_size;
    }
    return CODE_DONE;
}

int ray_reader_open(command_session *session, const char *path, ray_reader **result)
{
    *result = NULL;
    ray_reader *reader = calloc(1, sizeof *reader);
    if (reader) {
        reader->session = session;
        reader->total = RAY_COUNT_UNKNOWN;
        reader->buffer = malloc(BUFFER_SIZE + 1);
        reader->line_begin = malloc((RAY_BLOCK + 1) * sizeof *reader->line_begin);
    }
    int code = CODE_DONE;
    if (!reader || !reader->buffer || !reader->line_begin)
        code = session_fail_with(session, CODE_LIMIT, "out of memory for the rays");
    if (code == CODE_DONE) code = open_file(reader, path);
    if (code == CODE_DONE) {
        reader_fill(reader);
        code = reader_check_read(reader);
    }
    if (code == CODE_DONE) {
        char extension[16];
        path_extension(path, extension);
        reader->npy = (reader->end >= 6 && memcmp(reader->buffer, "\x93NUMPY", 6) == 0) ||
                      strcmp(extension, ".npy") == 0;
        code = reader->npy ? npy_read_header(reader) : read_header(reader);
    }
    if (code == CODE_DONE)
        *result = reader;
    else
        ray_reader_close(reader);
    return code;
}

void ray_reader_close(ray_reader *reader)
{
    if (!reader) return;
    if (reader->file && reader->file != stdin) fclose(reader->file);
    free(reader->buffer);
    free(reader->line_begin);
    free(reader);
}

int ray_reader_read(ray_reader *reader, knurl_ray *rays, size_t *count)
{
    *count = 0;
    return reader->npy ? npy_read_rays(reader, rays, count) : read_csv(reader, rays, count);
}

bool ray_reader_is_npy(const ray_reader *reader)
{
    return reader->npy;
}

uint64_t ray_reader_total(const ray_reader *reader)
{
    return reader->total;
}

double ray_reader_fraction(const ray_reader *reader)
{
    if (reader->size == 0) return -1;
    return (double)(reader->consumed - (reader->end - reader->begin)) / (double)reader->size;
}
