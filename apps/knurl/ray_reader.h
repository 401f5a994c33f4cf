/* ray_reader.h: inside of the ray reader, shared by its two formats. */
#ifndef APP_RAY_READER_H
#define APP_RAY_READER_H

#include "rays.h"

enum { RAY_COLUMNS = 8 };

struct ray_reader {
    command_session *session;
    FILE *file;
    char name[1024]; /* for messages */
    char *buffer;    /* bytes [begin, end) are not used yet; buffer[end] is 0 */
    size_t begin, end;
    bool at_end;       /* the file has no more than what the buffer holds */
    uint64_t consumed; /* bytes read from the file */
    uint64_t size;     /* of the whole file, 0: unknown */
    bool npy;
    /* CSV */
    int field_count;
    int field_column[RAY_COLUMNS]; /* column (order of column_names) of each field of a line */
    size_t *line_begin;
    uint64_t lines_read;
    /* NumPy */
    uint64_t total; /* rays */
    uint64_t done;
    int columns;     /* 6 or 8 */
    int sample_size; /* 4 or 8 bytes */
};

typedef enum ray_fault {
    RAY_GOOD = 0,
    RAY_BLANK,
    RAY_FIELD_COUNT,
    RAY_NOT_A_NUMBER,
    RAY_NOT_FINITE,
    RAY_NEGATIVE,
    RAY_NO_DIRECTION,
    RAY_EMPTY_RANGE
} ray_fault;

/* Moves unused bytes to the front and reads more; returns the bytes there are. */
size_t reader_fill(ray_reader *reader);
int reader_check_read(ray_reader *reader);
/* Columns as in column_names; *column is the one at fault for RAY_NOT_FINITE and RAY_NEGATIVE. */
ray_fault ray_from_values(const double values[RAY_COLUMNS], knurl_ray *ray, int *column);
const char *ray_column_name(int column);

int npy_read_header(ray_reader *reader);
int npy_read_rays(ray_reader *reader, knurl_ray *rays, size_t *count);

#endif
