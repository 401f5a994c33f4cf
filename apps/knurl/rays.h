/* rays.h: ray files in and hit files out, as CSV or NumPy arrays, a block at a time. The formats are
 * described in docs/command-line.md. */
#ifndef APP_RAYS_H
#define APP_RAYS_H

#include "output.h"

enum { RAY_BLOCK = 65536 }; /* rays held at once, whatever the size of the file */
#define RAY_COUNT_UNKNOWN UINT64_MAX

typedef struct ray_reader ray_reader;

/* "-" is standard input. CSV or NumPy is told from the first bytes. Reports failures itself and returns
 * an exit code, as do the others. */
int ray_reader_open(command_session *session, const char *path, ray_reader **reader);
void ray_reader_close(ray_reader *reader); /* NULL is ignored */
/* Fills up to RAY_BLOCK rays with every level-of-detail field 0; *count is 0 at the end. */
int ray_reader_read(ray_reader *reader, knurl_ray *rays, size_t *count);
bool ray_reader_is_npy(const ray_reader *reader);
/* Rays in the whole file, or RAY_COUNT_UNKNOWN. */
uint64_t ray_reader_total(const ray_reader *reader);
/* Part of the file that was read, or negative if unknown (pipes). */
double ray_reader_fraction(const ray_reader *reader);

/* Columns of a hit, in both formats. */
enum { HIT_COLUMNS = 16 };

typedef struct hit_writer hit_writer;

/* `total` may be RAY_COUNT_UNKNOWN unless a NumPy array goes to a pipe. */
int hit_writer_open(command_session *session, const char *path, bool npy, bool any_hit, uint64_t total,
                    hit_writer **writer);
int hit_writer_write(hit_writer *writer, const knurl_hit *hits, size_t count);
/* For any_hit: one byte per ray, 0 or 1. */
int hit_writer_write_any(hit_writer *writer, const uint8_t *occluded, size_t count);
int hit_writer_commit(hit_writer *writer);
void hit_writer_close(hit_writer *writer); /* discards what was not committed; NULL is ignored */

#endif
