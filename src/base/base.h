/* base/base.h: errors, memory, threads and files for the rest of the library. */
#ifndef KNURL_SRC_BASE_BASE_H
#define KNURL_SRC_BASE_BASE_H

#include <knurl/base.h>

#include <stdatomic.h>
#include <stdarg.h>

/* Definition structs carry this, so that a zeroed one is refused. */
#define KNURL_COOKIE 0x6b6e7572u

/* Fills `error` (if not NULL) and returns `status`, so that callers write `return knurl_fail(...)`. */
knurl_status knurl_fail(knurl_error *error, knurl_status status, const char *format, ...) KNURL_PRINTF(3, 4);
/* Puts "prefix: " before an error that a callee already wrote. */
knurl_status knurl_fail_prefix(knurl_error *error, knurl_status status, const char *format, ...)
    KNURL_PRINTF(3, 4);

/* Logs through the context's callback. */
void knurl_log(const knurl_context *context, knurl_log_level level, const char *format, ...)
    KNURL_PRINTF(3, 4);

/* Contexts are counted: every object retains its own. */
knurl_context *knurl_context_retain(knurl_context *context);
const knurl_context_def *knurl_context_get_def(const knurl_context *context);

/* Memory is counted against the context. Blocks are 64-byte aligned and remember their size.
 * Returns NULL when out of memory or over the context's limit; size 0 gives a unique block. */
void *knurl_alloc(knurl_context *context, size_t size);
void *knurl_alloc_zero(knurl_context *context, size_t size);
/* count * size with an overflow check. */
void *knurl_alloc_array(knurl_context *context, size_t count, size_t size);
void *knurl_realloc(knurl_context *context, void *p, size_t size); /* p may be NULL */
void knurl_free(knurl_context *context, void *p);                  /* NULL is ignored */
char *knurl_strdup(knurl_context *context, const char *text);
char *knurl_format(knurl_context *context, const char *format, ...) KNURL_PRINTF(2, 3);
/* KNURL_ERROR_MEMORY with a message that names what did not fit. */
knurl_status knurl_fail_memory(knurl_error *error, size_t bytes, const char *what);
/* Whether count * size overflows size_t; else the product is in *product. */
bool knurl_mul_overflow(size_t count, size_t size, size_t *product);

/* Calls work(user, begin, end, thread) over [0, count) in chunks of at most `grain`, on the
 * context's threads, each chunk once, chunk borders always at multiples of grain. `thread` is in
 * [0, knurl_context_threads). Returns when all are done. Safe to nest: inner calls run serially. */
typedef void knurl_range_fn(void *user, size_t begin, size_t end, int32_t thread);
void knurl_parallel_for(knurl_context *context, size_t count, size_t grain, knurl_range_fn *work, void *user);

/* Which of KNURL_CPU_* this machine has and the context allows. */
uint32_t knurl_cpu_features(const knurl_context *context);

/* Monotonic clock, seconds. */
double knurl_seconds(void);

/* Reads a whole file. *bytes is from knurl_alloc, has a zero byte after its end. */
knurl_status knurl_file_read(knurl_context *context, const char *path, unsigned char **bytes, size_t *size,
                             knurl_error *error);

/* A file that appears under its name only when it is complete: write to knurl_output.path (a
 * temporary name beside the target), then knurl_output_commit, or knurl_output_discard. Devices and
 * pipes are not replaced: their path is their own name. */
typedef struct knurl_output {
    char path[4096];   /* write here */
    char target[4096]; /* links resolved */
    bool in_place;     /* not a regular file: nothing to rename or to remove */
} knurl_output;
knurl_status knurl_output_open(const char *target, knurl_output *output, knurl_error *error);
knurl_status knurl_output_commit(knurl_output *output, knurl_error *error);
void knurl_output_discard(knurl_output *output);
/* All of the above for bytes in memory. */
knurl_status knurl_file_write(const char *path, const void *bytes, size_t size, knurl_error *error);

#endif
