/* Ranges of cells. One pass over the samples folds the rows of a row of cells column by column, then
 * the columns of each cell; larger cells come from smaller ones. */
#include "bounds/cells.h"

#include "bounds/columns.h"

#include <math.h>
#include <string.h>

enum { CELLS_TEXELS = 65536, CELLS_CODES = 65536 }; /* sizes of pieces of parallel work */

static size_t grain_of(size_t unit, size_t per_row)
{
    size_t grain = unit / (per_row ? per_row : 1);
    return grain ? grain : 1;
}

typedef struct cells_job {
    const height_level *level;
    const columns_kernels *kernels;
    cell_grid grid;
    float *ranges; /* float maps: (minimum, maximum) of each cell, before there is a scale */
    unsigned char *scratch;
    size_t scratch_bytes; /* per thread: two rows of columns */
    const cell_scale *scale;
} cells_job;

/* The rows of samples that a row of cells holds. */
static int32_t cell_rows(const cells_job *job, size_t cell, const void **rows)
{
    const height_level *level = job->level;
    size_t row_bytes = (size_t)level->width * (size_t)level->format;
    int64_t first = (int64_t)cell << job->grid.shift, last = first + (1 << job->grid.shift);
    int32_t count = 0;
    for (int64_t y = first; y <= last && y <= level->height; y++)
        rows[count++] =
            (const unsigned char *)level->samples + (size_t)(y < level->height ? y : 0) * row_bytes;
    return count;
}

static void spans_float(const float *min, const float *max, int32_t width, int32_t shift, float *ranges)
{
    for (int32_t x = 0; x < width; x += 1 << shift) {
        int32_t last = x + (1 << shift) < width ? x + (1 << shift) : width;
        float low = min[x], high = max[x];
        for (int32_t i = x + 1; i <= last; i++) {
            low = min[i] < low ? min[i] : low;
            high = max[i] > high ? max[i] : high;
        }
        ranges[2 * (x >> shift)] = low;
        ranges[2 * (x >> shift) + 1] = high;
    }
}

static void fold_float_row(const cells_job *job, size_t cell, unsigned char *scratch)
{
    const void *rows[COLUMNS_MAX_ROWS];
    int32_t count = cell_rows(job, cell, rows), width = job->level->width;
    float *min = (float *)(void *)scratch, *max = (float *)(void *)(scratch + job->scratch_bytes / 2);
    const float *typed[COLUMNS_MAX_ROWS];
    for (int32_t i = 0; i < count; i++) typed[i] = rows[i];
    job->kernels->f32(typed, count, width, min, max);
    min[width] = min[0];
    max[width] = max[0];
    spans_float(min, max, width, job->grid.shift, job->ranges + 2 * cell * (size_t)job->grid.width);
}

static void fold_integer_row(const cells_job *job, size_t cell, unsigned char *scratch)
{
    const void *rows[COLUMNS_MAX_ROWS];
    int32_t count = cell_rows(job, cell, rows), width = job->level->width;
    uint16_t *min = (uint16_t *)(void *)scratch;
    uint16_t *not_max = (uint16_t *)(void *)(scratch + job->scratch_bytes / 2);
    if (job->level->format == KNURL_PIXEL_U8) {
        const uint8_t *typed[COLUMNS_MAX_ROWS];
        for (int32_t i = 0; i < count; i++) typed[i] = rows[i];
        job->kernels->u8(typed, count, width, min, not_max);
    } else {
        const uint16_t *typed[COLUMNS_MAX_ROWS];
        for (int32_t i = 0; i < count; i++) typed[i] = rows[i];
        job->kernels->u16(typed, count, width, min, not_max);
    }
    min[width] = min[0];
    not_max[width] = not_max[0];
    job->kernels->spans(min, not_max, width, job->grid.shift,
                        job->grid.codes + cell * (size_t)job->grid.width);
}

static void fold_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    const cells_job *job = user;
    unsigned char *scratch = job->scratch + (size_t)thread * job->scratch_bytes;
    for (size_t cell = begin; cell < end; cell++) {
        if (job->level->format == KNURL_PIXEL_F32)
            fold_float_row(job, cell, scratch);
        else
            fold_integer_row(job, cell, scratch);
    }
}

/* Float maps */

static double decode(const cell_scale *scale, int32_t code)
{
    return scale->range_min + (double)code * scale->step;
}

static cell_scale float_scale(const float *ranges, size_t count)
{
    float low = ranges[0], high = ranges[1];
    for (size_t i = 1; i < count; i++) {
        low = ranges[2 * i] < low ? ranges[2 * i] : low;
        high = ranges[2 * i + 1] > high ? ranges[2 * i + 1] : high;
    }
    /* + 0.0: a negative zero would make the scale depend on the order of comparisons. */
    cell_scale scale = {(double)low + 0.0, (double)high + 0.0, 0.0};
    scale.step = (scale.range_max - scale.range_min) / 65535.0;
    while (decode(&scale, 65535) < scale.range_max) scale.step = nextafter(scale.step, INFINITY);
    return scale;
}

/* The division is off by an ulp at most, so the loops run once if at all; decode() grows with the
 * code, hence what they leave is outside or on the value. */
static uint32_t encode(const cell_scale *scale, double value, bool up)
{
    if (!(scale->step > 0.0)) return 0;
    double position = (value - scale->range_min) / scale->step;
    int32_t code = (int32_t)(position < 65535.0 ? position : 65535.0);
    if (up) {
        while (code < 65535 && decode(scale, code) < value) code++;
    } else {
        while (code > 0 && decode(scale, code) > value) code--;
    }
    return (uint32_t)code;
}

static void encode_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const cells_job *job = user;
    size_t width = (size_t)job->grid.width;
    for (size_t i = begin * width; i < end * width; i++)
        job->grid.codes[i] = code_make(encode(job->scale, (double)job->ranges[2 * i], false),
                                       encode(job->scale, (double)job->ranges[2 * i + 1], true));
}

static cell_scale integer_scale(const cell_grid *grid, knurl_pixel_format format)
{
    uint32_t all = 0;
    for (size_t i = 0; i < (size_t)grid->width * (size_t)grid->height; i++)
        all = code_union(all, grid->codes[i]);
    double unit = format == KNURL_PIXEL_U8 ? 255.0 : 65535.0;
    return (cell_scale){(double)code_min(all) / unit, (double)code_max(all) / unit, 0.0};
}

knurl_status cell_grid_build(knurl_context *context, const height_level *level, int32_t shift,
                             cell_grid *grid, cell_scale *scale, knurl_error *error)
{
    *grid = (cell_grid){cell_count(level->width, shift), cell_count(level->height, shift), shift, NULL};
    size_t cells = (size_t)grid->width * (size_t)grid->height;
    bool is_float = level->format == KNURL_PIXEL_F32;
    cells_job job = {.level = level,
                     .kernels =
                         knurl_cpu_features(context) & KNURL_CPU_AVX2 ? &columns_avx2 : &columns_plain};
    job.scratch_bytes = 2 * ((((size_t)level->width + 1) * 4 + 63) / 64 * 64); /* whole cache lines */
    grid->codes = knurl_alloc_array(context, cells, sizeof *grid->codes);
    job.scratch = knurl_alloc_array(context, (size_t)knurl_context_threads(context), job.scratch_bytes);
    if (is_float) job.ranges = knurl_alloc_array(context, cells, 2 * sizeof *job.ranges);
    bool fits = grid->codes && job.scratch && (job.ranges || !is_float);
    if (fits) {
        job.grid = *grid;
        job.scale = scale;
        size_t grain = grain_of(CELLS_TEXELS, (size_t)level->width << shift);
        knurl_parallel_for(context, (size_t)grid->height, grain, fold_rows, &job);
        *scale = is_float ? float_scale(job.ranges, cells) : integer_scale(grid, level->format);
        if (is_float)
            knurl_parallel_for(context, (size_t)grid->height, grain_of(CELLS_CODES, (size_t)grid->width),
                               encode_rows, &job);
    } else {
        knurl_free(context, grid->codes);
        grid->codes = NULL;
    }
    knurl_free(context, job.scratch);
    knurl_free(context, job.ranges);
    return fits ? KNURL_OK
                : knurl_fail_memory(error, cells * (is_float ? 12 : 4), "the cells of a height map");
}

/* Larger cells */

typedef struct reduce_job {
    const cell_grid *fine, *coarse;
} reduce_job;

static void reduce_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const reduce_job *job = user;
    const cell_grid *fine = job->fine, *coarse = job->coarse;
    size_t width = (size_t)fine->width;
    for (size_t y = begin; y < end; y++) {
        const uint32_t *a = fine->codes + 2 * y * width;
        const uint32_t *b = 2 * y + 1 < (size_t)fine->height ? a + width : a;
        uint32_t *to = coarse->codes + y * (size_t)coarse->width;
        for (size_t x = 0; x < width / 2; x++)
            to[x] = code_union(code_union(a[2 * x], a[2 * x + 1]), code_union(b[2 * x], b[2 * x + 1]));
        if (width % 2) to[width / 2] = code_union(a[width - 1], b[width - 1]);
    }
}

void cell_grid_reduce(knurl_context *context, const cell_grid *fine, cell_grid *coarse, uint32_t *codes)
{
    *coarse = (cell_grid){(fine->width + 1) / 2, (fine->height + 1) / 2, fine->shift + 1, codes};
    reduce_job job = {fine, coarse};
    knurl_parallel_for(context, (size_t)coarse->height, grain_of(CELLS_CODES, (size_t)fine->width),
                       reduce_rows, &job);
}
