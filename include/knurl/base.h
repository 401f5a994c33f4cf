/* knurl/base.h: status codes, errors, and the context every object is made from. */
#ifndef KNURL_BASE_H
#define KNURL_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define KNURL_VERSION_MAJOR  0
#define KNURL_VERSION_MINOR  1
#define KNURL_VERSION_PATCH  0
#define KNURL_VERSION_STRING "0.1.0"

#if defined(__GNUC__)
#define KNURL_API                         __attribute__((visibility("default")))
#define KNURL_PRINTF(format_index, first) __attribute__((format(printf, format_index, first)))
#else
#define KNURL_API
#define KNURL_PRINTF(format_index, first)
#endif

/* What a call came to. Every fallible function returns one of these. */
typedef enum knurl_status {
    KNURL_OK = 0,
    KNURL_ERROR_ARGUMENT,    /* the caller broke a documented rule (NULL, range, cookie) */
    KNURL_ERROR_INPUT,       /* a file or its contents are missing, damaged or not understood */
    KNURL_ERROR_UNSUPPORTED, /* well formed, but knurl does not do it */
    KNURL_ERROR_OUTPUT,      /* a file could not be written */
    KNURL_ERROR_MEMORY,      /* the allocator returned NULL */
    KNURL_ERROR_LIMIT,       /* a size is over a limit of the context */
    KNURL_INTERRUPTED        /* the progress callback asked to stop; results so far are valid */
} knurl_status;

/* Short English name of a status ("bad input"), never NULL. */
KNURL_API const char *knurl_status_name(knurl_status status);

/* A message for people: place, value found, value expected. Filled only when a
 * call fails; every `error` parameter may be NULL. Owned by the caller. */
typedef struct knurl_error {
    knurl_status status;
    char message[1024];
} knurl_error;

typedef enum knurl_log_level { KNURL_LOG_DEBUG = 0, KNURL_LOG_INFO, KNURL_LOG_WARNING } knurl_log_level;

/* Called for warnings and notes. May be called from several threads at once.
 * `message` has no newline and is valid during the call only. */
typedef void knurl_log_fn(void *user, knurl_log_level level, const char *message);

/* Called now and then during long work, from one thread at a time.
 * `fraction` is in [0, 1]; `stage` names the work. Return false to stop: the
 * running call then ends with KNURL_INTERRUPTED. */
typedef bool knurl_progress_fn(void *user, const char *stage, double fraction);

/* Replaces the C library's allocator. `reallocate(user, p, old_size, new_size, alignment)`:
 * p NULL allocates, new_size 0 frees, else resizes and keeps the contents. Returns NULL when
 * out of memory (the old block then stays). Called from several threads at once.
 * `alignment` is a power of two, at most 64. */
typedef void *knurl_reallocate_fn(void *user, void *p, size_t old_size, size_t new_size, size_t alignment);

/* How a context is made. Fill it with knurl_context_def_default(). */
typedef struct knurl_context_def {
    uint32_t cookie;
    int32_t threads;                 /* worker threads, 0: one per core; at most 1024 */
    knurl_reallocate_fn *reallocate; /* NULL: aligned C library allocation */
    void *allocator_user;
    knurl_log_fn *log; /* NULL: silent */
    void *log_user;
    uint64_t memory_limit;     /* bytes that all objects may hold together, 0: no limit */
    uint64_t max_image_pixels; /* refuse larger images, default 2^32 (65,536 squared) */
    uint64_t max_file_bytes;   /* refuse larger input files, default 16 GiB */
    uint32_t cpu_mask;         /* KNURL_CPU_* features that may be used, default all */
} knurl_context_def;

enum { KNURL_CPU_SSE41 = 1u << 0, KNURL_CPU_AVX2 = 1u << 1, KNURL_CPU_AVX512 = 1u << 2 };

KNURL_API knurl_context_def knurl_context_def_default(void);

/* Everything is made from a context and keeps it alive: a context may be released
 * before the objects made from it. All functions may be called from any thread;
 * objects are immutable after they are made unless their header says otherwise. */
typedef struct knurl_context knurl_context;

KNURL_API knurl_status knurl_context_create(const knurl_context_def *def, knurl_context **context,
                                            knurl_error *error);
KNURL_API void knurl_context_release(knurl_context *context); /* NULL is ignored */

/* Bytes held now, and the most held at once, by all objects of the context. */
KNURL_API uint64_t knurl_context_bytes(const knurl_context *context);
KNURL_API uint64_t knurl_context_peak_bytes(const knurl_context *context);
/* Worker threads that parallel work of this context uses, the caller's own included. */
KNURL_API int32_t knurl_context_threads(const knurl_context *context);

#ifdef __cplusplus
}
#endif
#endif
