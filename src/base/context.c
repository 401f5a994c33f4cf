/* The context: counted owner of limits, callbacks and the allocator. */
#include "base/base.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct knurl_context {
    knurl_context_def def;
    atomic_size_t references;
    atomic_ullong bytes, peak;
};

/* Every block starts with its size, so that frees can be counted; 64 bytes keep the alignment. */
enum { BLOCK_ALIGNMENT = 64, BLOCK_HEADER = 64 };

knurl_context_def knurl_context_def_default(void)
{
    return (knurl_context_def){
        .cookie = KNURL_COOKIE,
        .max_image_pixels = UINT64_C(1) << 32,
        .max_file_bytes = UINT64_C(16) << 30,
        .cpu_mask = UINT32_MAX,
    };
}

static void *default_reallocate(void *user, void *p, size_t old_size, size_t new_size, size_t alignment)
{
    (void)user;
    if (new_size == 0) {
        free(p);
        return NULL;
    }
    void *grown = NULL;
    if (posix_memalign(&grown, alignment, new_size) != 0) return NULL;
    if (p) {
        memcpy(grown, p, old_size < new_size ? old_size : new_size);
        free(p);
    }
    return grown;
}

knurl_status knurl_context_create(const knurl_context_def *def, knurl_context **context, knurl_error *error)
{
    if (!context) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "context is NULL");
    *context = NULL;
    if (!def || def->cookie != KNURL_COOKIE)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "context definition was not made by knurl_context_def_default()");
    if (def->threads < 0 || def->threads > 1024)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "threads is %d, expected 0 to 1024", def->threads);
    knurl_reallocate_fn *reallocate = def->reallocate ? def->reallocate : default_reallocate;
    knurl_context *made = reallocate(def->allocator_user, NULL, 0, sizeof(knurl_context), BLOCK_ALIGNMENT);
    if (!made) return knurl_fail_memory(error, sizeof *made, "the context");
    memset(made, 0, sizeof *made);
    made->def = *def;
    made->def.reallocate = reallocate;
    if (made->def.threads == 0) {
        long cores = sysconf(_SC_NPROCESSORS_ONLN);
        made->def.threads = cores < 1 ? 1 : cores > 1024 ? 1024 : (int32_t)cores;
    }
    atomic_init(&made->references, 1);
    *context = made;
    return KNURL_OK;
}

knurl_context *knurl_context_retain(knurl_context *context)
{
    if (context) atomic_fetch_add_explicit(&context->references, 1, memory_order_relaxed);
    return context;
}

void knurl_context_release(knurl_context *context)
{
    if (!context || atomic_fetch_sub_explicit(&context->references, 1, memory_order_acq_rel) != 1) return;
    context->def.reallocate(context->def.allocator_user, context, sizeof *context, 0, BLOCK_ALIGNMENT);
}

const knurl_context_def *knurl_context_get_def(const knurl_context *context)
{
    return &context->def;
}

uint64_t knurl_context_bytes(const knurl_context *context)
{
    return atomic_load_explicit(&((knurl_context *)context)->bytes, memory_order_relaxed);
}

uint64_t knurl_context_peak_bytes(const knurl_context *context)
{
    return atomic_load_explicit(&((knurl_context *)context)->peak, memory_order_relaxed);
}

int32_t knurl_context_threads(const knurl_context *context)
{
    return context->def.threads;
}

static bool count_bytes(knurl_context *context, size_t more)
{
    unsigned long long now = atomic_fetch_add_explicit(&context->bytes, more, memory_order_relaxed) + more;
    if (context->def.memory_limit && now > context->def.memory_limit) {
        atomic_fetch_sub_explicit(&context->bytes, more, memory_order_relaxed);
        return false;
    }
    unsigned long long peak = atomic_load_explicit(&context->peak, memory_order_relaxed);
    while (now > peak && !atomic_compare_exchange_weak_explicit(&context->peak, &peak, now,
                                                                memory_order_relaxed, memory_order_relaxed)) {
    }
    return true;
}

void *knurl_realloc(knurl_context *context, void *p, size_t size)
{
    size_t *old = p ? (size_t *)((char *)p - BLOCK_HEADER) : NULL;
    size_t old_size = old ? *old : 0;
    if (size > SIZE_MAX - BLOCK_HEADER || !count_bytes(context, size)) return NULL;
    size_t *block =
        context->def.reallocate(context->def.allocator_user, old, old ? old_size + BLOCK_HEADER : 0,
                                size + BLOCK_HEADER, BLOCK_ALIGNMENT);
    /* On failure only the growth is taken back; the old block is still counted and still there. */
    atomic_fetch_sub_explicit(&context->bytes, block ? old_size : size, memory_order_relaxed);
    if (!block) return NULL;
    *block = size;
    return (char *)block + BLOCK_HEADER;
}

void *knurl_alloc(knurl_context *context, size_t size)
{
    return knurl_realloc(context, NULL, size);
}

void *knurl_alloc_zero(knurl_context *context, size_t size)
{
    void *p = knurl_alloc(context, size);
    if (p) memset(p, 0, size);
    return p;
}

bool knurl_mul_overflow(size_t count, size_t size, size_t *product)
{
    return __builtin_mul_overflow(count, size, product);
}

void *knurl_alloc_array(knurl_context *context, size_t count, size_t size)
{
    size_t bytes;
    return knurl_mul_overflow(count, size, &bytes) ? NULL : knurl_alloc(context, bytes);
}

void knurl_free(knurl_context *context, void *p)
{
    if (!p) return;
    size_t *block = (size_t *)((char *)p - BLOCK_HEADER);
    size_t size = *block;
    context->def.reallocate(context->def.allocator_user, block, size + BLOCK_HEADER, 0, BLOCK_ALIGNMENT);
    atomic_fetch_sub_explicit(&context->bytes, size, memory_order_relaxed);
}

char *knurl_strdup(knurl_context *context, const char *text)
{
    size_t size = strlen(text) + 1;
    char *copy = knurl_alloc(context, size);
    if (copy) memcpy(copy, text, size);
    return copy;
}

char *knurl_format(knurl_context *context, const char *format, ...)
{
    va_list args, again;
    va_start(args, format);
    va_copy(again, args);
    int length = vsnprintf(NULL, 0, format, args);
    va_end(args);
    char *text = length < 0 ? NULL : knurl_alloc(context, (size_t)length + 1);
    if (text) (void)vsnprintf(text, (size_t)length + 1, format, again);
    va_end(again);
    return text;
}

uint32_t knurl_cpu_features(const knurl_context *context)
{
    uint32_t found = 0;
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("sse4.1")) found |= KNURL_CPU_SSE41;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
        __builtin_cpu_supports("bmi2"))
        found |= KNURL_CPU_AVX2;
    if (found & KNURL_CPU_AVX2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512vl"))
        found |= KNURL_CPU_AVX512;
#endif
    return found & context->def.cpu_mask;
}

double knurl_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
