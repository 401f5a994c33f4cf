/* Level 0 of a height map, and the pyramid of levels of detail above it.
 *
 * Level k + 1 has m = max(1, n / 2) samples where level k has n, and sample i is the mean of level k
 * over [i n / m, (i + 1) n / m], sample j standing for [j, j + 1]. For even n that is two samples with
 * equal weights. For odd n = 2 m + 1 the ratio is 2 + 1 / m, and the overlaps with samples 2i, 2i + 1
 * and 2i + 2 are (m - i) / m, 1 and (i + 1) / m: the polyphase weights (m - i, m, i + 1) / n. They are
 * integers over n, so integer maps are filtered exactly and rounded once. */
#include "data/levels.h"

#include <math.h>
#include <string.h>

enum { ROWS_TEXELS = 1 << 17 }; /* texels per piece of parallel work */

static size_t row_grain(int32_t width)
{
    size_t grain = (size_t)ROWS_TEXELS / (size_t)width;
    return grain ? grain : 1;
}

size_t height_level_bytes(const height_level *level)
{
    return (size_t)level->width * (size_t)level->height * (size_t)level->format;
}

void height_level_destroy(knurl_context *context, height_level *level)
{
    knurl_free(context, (void *)level->samples);
    level->samples = NULL;
}

/* The range of float levels */

typedef struct float_range {
    _Atomic float low, high;
} float_range;

static void range_init(float_range *range)
{
    atomic_init(&range->low, INFINITY);
    atomic_init(&range->high, -INFINITY);
}

static void range_result(float_range *range, double result[2])
{
    /* + 0.0: which of two zeros comes out depends on the order of comparisons. */
    result[0] = (double)atomic_load(&range->low) + 0.0;
    result[1] = (double)atomic_load(&range->high) + 0.0;
}

enum { LANES = 32 }; /* independent, so that they become vectors */

typedef struct range_lanes {
    float low[LANES], high[LANES];
    float zero[LANES]; /* NaN once a value was not finite */
} range_lanes;

static inline void lanes_add(range_lanes *to, const float *values, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        to->low[k] = values[k] < to->low[k] ? values[k] : to->low[k];
        to->high[k] = values[k] > to->high[k] ? values[k] : to->high[k];
        to->zero[k] += 0.0f * values[k];
    }
}

/* Adds values to the range; false if one is not finite. */
static bool range_add(float_range *range, const float *values, size_t count)
{
    range_lanes lanes = {.zero = {0.0f}};
    size_t i = 0;
    for (int32_t k = 0; k < LANES; k++) lanes.low[k] = lanes.high[k] = values[0];
    for (; i + LANES <= count; i += LANES) lanes_add(&lanes, values + i, LANES);
    lanes_add(&lanes, values + i, count - i);
    float low = lanes.low[0], high = lanes.high[0], zero = 0.0f;
    for (int32_t k = 0; k < LANES; k++) {
        low = lanes.low[k] < low ? lanes.low[k] : low;
        high = lanes.high[k] > high ? lanes.high[k] : high;
        zero += lanes.zero[k];
    }
    float found = atomic_load(&range->low);
    while (low < found && !atomic_compare_exchange_weak(&range->low, &found, low)) {
    }
    found = atomic_load(&range->high);
    while (high > found && !atomic_compare_exchange_weak(&range->high, &found, high)) {
    }
    return zero == 0.0f;
}

typedef struct range_job {
    const height_level *level;
    float_range range;
} range_job;

static void range_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    range_job *job = user;
    size_t width = (size_t)job->level->width;
    range_add(&job->range, (const float *)job->level->samples + begin * width, (end - begin) * width);
}

void height_level_range(knurl_context *context, const height_level *level, double range[2])
{
    range_job job = {.level = level};
    range_init(&job.range);
    knurl_parallel_for(context, (size_t)level->height, row_grain(level->width), range_rows, &job);
    range_result(&job.range, range);
}

/* Level 0 */

typedef struct copy_job {
    const unsigned char *from;
    unsigned char *to;
    size_t width, channels, channel;
    size_t sample_bytes;
    float_range range;
    atomic_size_t first_bad; /* index of the first sample that is not finite, SIZE_MAX: none */
} copy_job;

static void note_bad(copy_job *job, size_t index)
{
    size_t first = atomic_load_explicit(&job->first_bad, memory_order_relaxed);
    while (index < first && !atomic_compare_exchange_weak_explicit(
                                &job->first_bad, &first, index, memory_order_relaxed, memory_order_relaxed)) {
    }
}

static void copy_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    copy_job *job = user;
    size_t first = begin * job->width, last = end * job->width, bytes = job->sample_bytes;
    if (job->channels == 1) {
        memcpy(job->to + first * bytes, job->from + first * bytes, (last - first) * bytes);
    } else {
        for (size_t i = first; i < last; i++)
            memcpy(job->to + i * bytes, job->from + (i * job->channels + job->channel) * bytes, bytes);
    }
    if (bytes != sizeof(float)) return;
    const float *values = (const float *)(const void *)job->to;
    if (range_add(&job->range, values + first, last - first)) return;
    while (isfinite(values[first])) first++;
    note_bad(job, first);
}

knurl_status height_level_copy(knurl_context *context, const knurl_image *image, int32_t channel,
                               height_level *level, double range[2], knurl_error *error)
{
    *level = (height_level){.width = knurl_image_width(image),
                            .height = knurl_image_height(image),
                            .format = knurl_image_format(image)};
    size_t bytes = height_level_bytes(level);
    void *samples = knurl_alloc(context, bytes);
    if (!samples) return knurl_fail_memory(error, bytes, "the samples of a height map");
    level->samples = samples;
    copy_job job = {.from = knurl_image_samples(image),
                    .to = samples,
                    .width = (size_t)level->width,
                    .channels = (size_t)knurl_image_channels(image),
                    .channel = (size_t)channel,
                    .sample_bytes = (size_t)level->format};
    atomic_init(&job.first_bad, SIZE_MAX);
    range_init(&job.range);
    knurl_parallel_for(context, (size_t)level->height, row_grain(level->width), copy_rows, &job);
    size_t bad = atomic_load(&job.first_bad);
    if (level->format == KNURL_PIXEL_F32) range_result(&job.range, range);
    if (bad == SIZE_MAX) return KNURL_OK;
    double value = (double)((const float *)samples)[bad];
    height_level_destroy(context, level);
    return knurl_fail(error, KNURL_ERROR_INPUT,
                      "height map: texel (%zu, %zu) is %g, expected a finite number", bad % job.width,
                      bad / job.width, value);
}

/* Levels above */

/* What one output sample reads along an axis. Weights sum to `total`. */
typedef struct taps {
    int32_t first, count;
    uint32_t weight[3], total;
} taps;

static inline taps axis_taps(int32_t fine, int32_t coarse, int32_t i)
{
    if (fine == 1) return (taps){0, 1, {1, 0, 0}, 1};
    if (fine % 2 == 0) return (taps){2 * i, 2, {1, 1, 0}, 2};
    return (taps){2 * i, 3, {(uint32_t)(coarse - i), (uint32_t)coarse, (uint32_t)(i + 1)}, (uint32_t)fine};
}

typedef struct filter_job {
    const height_level *fine, *coarse;
    void *samples; /* of the coarse level */
    height_rect to;
} filter_job;

/* Both sizes even: the common case. */
static void halve_row_u16(const uint16_t *a, const uint16_t *b, uint16_t *to, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        uint32_t sum = (uint32_t)a[2 * i] + a[2 * i + 1] + b[2 * i] + b[2 * i + 1];
        to[i] = (uint16_t)((sum + 2) >> 2);
    }
}

static void halve_row_u8(const uint8_t *a, const uint8_t *b, uint16_t *to, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        uint32_t sum = (uint32_t)a[2 * i] + a[2 * i + 1] + b[2 * i] + b[2 * i + 1];
        to[i] = (uint16_t)((257 * sum + 2) >> 2); /* 65535 = 257 * 255 */
    }
}

/* Any sizes. The sum is below 2^16 * 2^16 * 2^16, so 64 bits are enough. */
static void filter_row_integer(const filter_job *job, int32_t y)
{
    const height_level *fine = job->fine, *coarse = job->coarse;
    uint16_t *to = (uint16_t *)job->samples + (size_t)y * (size_t)coarse->width;
    taps v = axis_taps(fine->height, coarse->height, y);
    for (int32_t x = job->to.x0; x < job->to.x1; x++) {
        taps h = axis_taps(fine->width, coarse->width, x);
        uint64_t sum = 0, total = (uint64_t)v.total * h.total;
        for (int32_t j = 0; j < v.count; j++) {
            size_t row = (size_t)(v.first + j) * (size_t)fine->width + (size_t)h.first;
            uint64_t line = 0;
            for (int32_t i = 0; i < h.count; i++) {
                size_t at = row + (size_t)i;
                uint32_t value = fine->format == KNURL_PIXEL_U8 ? 257u * ((const uint8_t *)fine->samples)[at]
                                                                : ((const uint16_t *)fine->samples)[at];
                line += (uint64_t)h.weight[i] * value;
            }
            sum += v.weight[j] * line;
        }
        to[x] = (uint16_t)((2 * sum + total) / (2 * total));
    }
}

/* In double: the error is far below a float's, so the rounded mean stays between the smallest and
 * the largest sample it was made from, and bounds of level 0 hold for every level. */
static void filter_row_float(const filter_job *job, int32_t y)
{
    const height_level *fine = job->fine, *coarse = job->coarse;
    float *to = (float *)job->samples + (size_t)y * (size_t)coarse->width;
    const float *from = fine->samples;
    taps v = axis_taps(fine->height, coarse->height, y);
    for (int32_t x = job->to.x0; x < job->to.x1; x++) {
        taps h = axis_taps(fine->width, coarse->width, x);
        double sum = 0.0;
        for (int32_t j = 0; j < v.count; j++) {
            const float *line = from + (size_t)(v.first + j) * (size_t)fine->width + h.first;
            double part = 0.0;
            for (int32_t i = 0; i < h.count; i++) part += h.weight[i] * (double)line[i];
            sum += v.weight[j] * part;
        }
        to[x] = (float)(sum / ((double)v.total * h.total));
    }
}

static void filter_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const filter_job *job = user;
    const height_level *fine = job->fine;
    bool halve = fine->width % 2 == 0 && fine->height % 2 == 0;
    size_t width = (size_t)fine->width, first = (size_t)job->to.x0;
    int32_t count = job->to.x1 - job->to.x0;
    for (size_t i = begin; i < end; i++) {
        size_t y = (size_t)job->to.y0 + i, at = 2 * y * width + 2 * first;
        uint16_t *to = (uint16_t *)job->samples + y * (size_t)job->coarse->width + first;
        if (fine->format == KNURL_PIXEL_F32) {
            filter_row_float(job, (int32_t)y);
        } else if (!halve) {
            filter_row_integer(job, (int32_t)y);
        } else if (fine->format == KNURL_PIXEL_U16) {
            const uint16_t *a = (const uint16_t *)fine->samples + at;
            halve_row_u16(a, a + width, to, count);
        } else {
            const uint8_t *a = (const uint8_t *)fine->samples + at;
            halve_row_u8(a, a + width, to, count);
        }
    }
}

void height_level_refilter(knurl_context *context, const height_level *fine, const height_level *coarse,
                           height_rect to)
{
    filter_job job = {fine, coarse, (void *)coarse->samples, to};
    knurl_parallel_for(context, (size_t)(to.y1 - to.y0), row_grain(to.x1 - to.x0), filter_rows, &job);
}

knurl_status height_level_filter(knurl_context *context, const height_level *fine, height_level *coarse,
                                 knurl_error *error)
{
    *coarse = (height_level){.width = fine->width > 1 ? fine->width / 2 : 1,
                             .height = fine->height > 1 ? fine->height / 2 : 1,
                             .format = fine->format == KNURL_PIXEL_F32 ? KNURL_PIXEL_F32 : KNURL_PIXEL_U16};
    size_t bytes = height_level_bytes(coarse);
    coarse->samples = knurl_alloc(context, bytes);
    if (!coarse->samples) return knurl_fail_memory(error, bytes, "a level of a height map");
    height_level_refilter(context, fine, coarse, (height_rect){0, 0, coarse->width, coarse->height});
    return KNURL_OK;
}

/* Coarse samples [*first, *end) whose taps (axis_taps) are among fine samples [*first, *end). */
static void axis_readers(int32_t fine, int32_t coarse, int32_t *first, int32_t *end)
{
    int32_t last = (*end - 1) / 2;
    *first = fine % 2 == 0 || *first == 0 ? *first / 2 : (*first - 1) / 2;
    *end = (last < coarse ? last : coarse - 1) + 1;
}

height_rect height_level_readers(const height_level *fine, const height_level *coarse, height_rect changed)
{
    axis_readers(fine->width, coarse->width, &changed.x0, &changed.x1);
    axis_readers(fine->height, coarse->height, &changed.y0, &changed.y1);
    return changed;
}
