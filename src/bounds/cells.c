/* Ranges of cells. One pass over the samples folds the rows of a row of cells column by column, then
 * the columns of each cell; larger cells come from smaller ones. Any rectangle of cells can be made alone,
 * and each cell depends on its own samples only, so an edit leaves what a new map would have. */
#include "bounds/cells.h"

#include "bounds/columns.h"

#include <math.h>

enum {
    CELLS_TEXELS = 1 << 18, /* sizes of pieces of parallel work */
    CELLS_CODES = 1 << 16,
    CELLS_STRIP = 1024 /* columns that are folded at once, a multiple of all cell sizes */
};

static size_t grain_of(size_t unit, size_t per_row)
{
    size_t grain = unit / (per_row ? per_row : 1);
    return grain ? grain : 1;
}

/* Cells of an axis that hold any of samples [first, end), as up to two intervals. */
static int32_t axis_holders(int32_t size, int32_t shift, int32_t first, int32_t end, int32_t begins[2],
                            int32_t ends[2])
{
    int32_t count = cell_count(size, shift);
    begins[0] = (first > 0 ? first - 1 : 0) >> shift;
    ends[0] = ((end - 1) >> shift) + 1;
    if (first > 0 || ends[0] == count) return 1;
    begins[1] = count - 1; /* whose far end is sample 0 */
    ends[1] = count;
    return 2;
}

int32_t cell_holders(const height_level *level, int32_t shift, height_rect samples, height_rect cells[4])
{
    int32_t x0[2], x1[2], y0[2], y1[2], count = 0;
    int32_t columns = axis_holders(level->width, shift, samples.x0, samples.x1, x0, x1);
    int32_t rows = axis_holders(level->height, shift, samples.y0, samples.y1, y0, y1);
    for (int32_t j = 0; j < rows; j++)
        for (int32_t i = 0; i < columns; i++) cells[count++] = (height_rect){x0[i], y0[j], x1[i], y1[j]};
    return count;
}

/* The scale of float maps */

static double decode(const cell_scale *scale, int32_t code)
{
    return scale->range_min + (double)code * scale->step;
}

cell_scale cell_scale_make(double range_min, double range_max)
{
    cell_scale scale = {range_min, range_max, (range_max - range_min) / 65535.0};
    while (decode(&scale, 65535) < range_max) scale.step = nextafter(scale.step, INFINITY);
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

/* From samples to cells */

typedef struct fold_job {
    const height_level *level;
    const cell_scale *scale;
    const cell_grid *grid;
    const columns_kernels *kernels;
    height_rect cells;
} fold_job;

/* Samples [first, end) of the rows of a row of cells. Where `end` is the map's, what follows is sample 0
 * of the next period; elsewhere it is the next sample. */
typedef struct strip {
    const void *rows[COLUMNS_MAX_ROWS];
    int32_t row_count, first, end;
} strip;

static void strip_rows(const fold_job *job, int32_t cell_row, strip *s)
{
    const height_level *level = job->level;
    size_t row_bytes = (size_t)level->width * (size_t)level->format;
    int64_t first = (int64_t)cell_row << job->grid->shift, last = first + (1 << job->grid->shift);
    s->row_count = 0;
    for (int64_t y = first; y <= last && y <= level->height; y++)
        s->rows[s->row_count++] =
            (const unsigned char *)level->samples + (size_t)(y < level->height ? y : 0) * row_bytes;
}

static void fold_columns_integer(const fold_job *job, const strip *s, int32_t x, int32_t count, uint16_t *min,
                                 uint16_t *not_max)
{
    if (job->level->format == KNURL_PIXEL_U8) {
        const uint8_t *rows[COLUMNS_MAX_ROWS];
        for (int32_t i = 0; i < s->row_count; i++) rows[i] = (const uint8_t *)s->rows[i] + x;
        job->kernels->u8(rows, s->row_count, count, min, not_max);
    } else {
        const uint16_t *rows[COLUMNS_MAX_ROWS];
        for (int32_t i = 0; i < s->row_count; i++) rows[i] = (const uint16_t *)s->rows[i] + x;
        job->kernels->u16(rows, s->row_count, count, min, not_max);
    }
}

static void fold_strip_integer(const fold_job *job, const strip *s, uint32_t *codes)
{
    uint16_t min[CELLS_STRIP + 1], not_max[CELLS_STRIP + 1];
    int32_t count = s->end - s->first;
    bool border = s->end == job->level->width;
    fold_columns_integer(job, s, s->first, count + !border, min, not_max);
    if (border) fold_columns_integer(job, s, 0, 1, min + count, not_max + count);
    job->kernels->spans(min, not_max, count, job->grid->shift, codes);
}

static void fold_columns_float(const fold_job *job, const strip *s, int32_t x, int32_t count, float *min,
                               float *max)
{
    const float *rows[COLUMNS_MAX_ROWS];
    for (int32_t i = 0; i < s->row_count; i++) rows[i] = (const float *)s->rows[i] + x;
    job->kernels->f32(rows, s->row_count, count, min, max);
}

static void fold_strip_float(const fold_job *job, const strip *s, uint32_t *codes)
{
    float min[CELLS_STRIP + 1], max[CELLS_STRIP + 1];
    int32_t count = s->end - s->first, size = 1 << job->grid->shift;
    bool border = s->end == job->level->width;
    fold_columns_float(job, s, s->first, count + !border, min, max);
    if (border) fold_columns_float(job, s, 0, 1, min + count, max + count);
    for (int32_t x = 0; x < count; x += size) {
        int32_t last = x + size < count ? x + size : count;
        float low = min[x], high = max[x];
        for (int32_t i = x + 1; i <= last; i++) {
            low = min[i] < low ? min[i] : low;
            high = max[i] > high ? max[i] : high;
        }
        codes[x >> job->grid->shift] =
            code_make(encode(job->scale, (double)low, false), encode(job->scale, (double)high, true));
    }
}

static void fold_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const fold_job *job = user;
    int32_t shift = job->grid->shift, cells = CELLS_STRIP >> shift, width = job->level->width;
    for (size_t i = begin; i < end; i++) {
        int32_t row = job->cells.y0 + (int32_t)i;
        uint32_t *codes = job->grid->codes + (size_t)row * job->grid->stride;
        strip s;
        strip_rows(job, row, &s);
        for (int32_t x = job->cells.x0; x < job->cells.x1; x += cells) {
            int64_t last = (int64_t)(job->cells.x1 - x < cells ? job->cells.x1 : x + cells) << shift;
            s.first = x << shift;
            s.end = last < width ? (int32_t)last : width;
            if (job->level->format == KNURL_PIXEL_F32)
                fold_strip_float(job, &s, codes + x);
            else
                fold_strip_integer(job, &s, codes + x);
        }
    }
}

void cell_grid_fold(knurl_context *context, const height_level *level, const cell_scale *scale,
                    const cell_grid *grid, height_rect cells)
{
    bool avx2 = (knurl_cpu_features(context) & KNURL_CPU_AVX2) != 0;
    fold_job job = {level, scale, grid, avx2 ? &columns_avx2 : &columns_plain, cells};
    size_t per_row = (size_t)(cells.x1 - cells.x0) << (2 * grid->shift);
    knurl_parallel_for(context, (size_t)(cells.y1 - cells.y0), grain_of(CELLS_TEXELS, per_row), fold_rows,
                       &job);
}

/* Larger cells */

typedef struct reduce_job {
    const cell_grid *fine, *coarse;
    height_rect cells;
} reduce_job;

static void reduce_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const reduce_job *job = user;
    const cell_grid *fine = job->fine, *coarse = job->coarse;
    size_t width = (size_t)fine->width, first = (size_t)job->cells.x0, last = (size_t)job->cells.x1;
    size_t whole = last < width / 2 ? last : width / 2; /* the last of an odd width has one column */
    for (size_t i = begin; i < end; i++) {
        size_t y = (size_t)job->cells.y0 + i;
        const uint32_t *a = fine->codes + 2 * y * fine->stride;
        const uint32_t *b = 2 * y + 1 < (size_t)fine->height ? a + fine->stride : a;
        uint32_t *to = coarse->codes + y * coarse->stride;
        for (size_t x = first; x < whole; x++)
            to[x] = code_union(code_union(a[2 * x], a[2 * x + 1]), code_union(b[2 * x], b[2 * x + 1]));
        if (last > whole) to[whole] = code_union(a[width - 1], b[width - 1]);
    }
}

void cell_grid_reduce(knurl_context *context, const cell_grid *fine, const cell_grid *coarse,
                      height_rect cells)
{
    reduce_job job = {fine, coarse, cells};
    size_t per_row = 4 * (size_t)(cells.x1 - cells.x0);
    knurl_parallel_for(context, (size_t)(cells.y1 - cells.y0), grain_of(CELLS_CODES, per_row), reduce_rows,
                       &job);
}
