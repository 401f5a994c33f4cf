/* The rectangular minmax image pyramid of Thonat et al., "RMIP: Displacement ray tracing via inversion and
 * oblong bounding", 2023, section 5.
 *
 * The paper stores the range of every window of 2^p x 2^q cells at every position of an r x r grid,
 * r^2 (1 + log2 r)^2 entries, and answers any rectangle with four of them (Eq. 5). Here larger windows
 * are stored at coarser positions, which brings the table to 16 r^2 entries, any size of map (not only
 * square powers of two) and a query of four loads, always conservative. Windows are clipped at the
 * border of the grid; wrapping and the bilinear signal between samples are dealt with outside
 * (query.c, cells.h).
 *
 * Layout. One axis of r cells has layers p = 0, 1, ... up to the first with 2^p >= r. Layer p holds
 * windows [x, x + 2^p) at x = 0, s, 2s, ... < r, with spacing s(p) = max(1, 2^(p-2)): a window moves by
 * a quarter of its length. Entry base[p] + x / s(p) of the axis is that window. Summed over p, an axis
 * has about r + r + r + r/2 + r/4 + ... = 4 r entries. The table is the product of both axes: entry
 * (column, row) is the range over column's window x row's window, row-major, 4 bytes each (codes.h). Hence
 * 64 r^2 bytes, or 64 / cell^2 bytes per texel: 1 byte for cells of 8 x 8, half of what a 16-bit map takes.
 * Rows are padded by a cache line or two, so that they do not all start in the same cache set.
 *
 * Query. For cells [x, x + w) of one axis take the smallest p with
 *
 *     w <= 2^(p+1) - s + 1        (1.75 * 2^p + 1 for p >= 2, 2^(p+1) below)
 *
 * and the windows at x0 = floor(x / s) s and x1 = max(0, ceil((x + w - 2^p) / s) s).
 *
 * 1. They cover [x, x + w). x0 <= x, and x1 + 2^p >= x + w by the definition of x1. Left to show that they
 *    leave no gap, x1 <= x0 + 2^p. For x1 = 0 that is so. Otherwise let x = x0 + d with d <= s - 1; then
 *    x + w - 2^p <= x0 + (s - 1) + (2^(p+1) - s + 1) - 2^p = x0 + 2^p, which is a multiple of s, and
 *    rounding up to a multiple of s cannot go beyond it.
 * 2. Both are stored: x0 <= x < r, and where x1 > 0, x1 <= x + w - 2^p + s - 1 < x + w <= r.
 * 3. The layer exists: with P the last one, w <= r <= 2^P <= 2^(P+1) - s(P) + 1. In terms of w - 1 the
 *    condition reads 4 (w - 1) <= 7 * 2^p for p >= 2, and for p < 2 the same holds of integers; with
 *    2^e <= w - 1 < 2^(e+1) it fails for e - 1 and holds for e + 1, so p is e or e + 1.
 *
 * The windows of a query reach past it by less than s <= 2^p / 4 on either side (or are a single window's
 * length, where w < 2^p, which happens only for w > 7/8 of 2^p), against 0 in the paper. */
#include "bounds/rmip.h"

enum { RMIP_CODES = 16384, RMIP_STRIP = 512 }; /* entries and columns per piece of parallel work */

static rmip_axis axis_layout(int32_t cells)
{
    rmip_axis axis = {.cells = cells};
    do {
        int32_t p = axis.layers++;
        axis.base[p + 1] = axis.base[p] + (uint32_t)cell_count(cells, rmip_spacing(p));
    } while (1 << (axis.layers - 1) < cells);
    return axis;
}

/* Where layer p + 1 of an axis finds the two halves of its window `i`; false: the second is off the grid. */
static inline bool axis_halves(const rmip_axis *axis, int32_t p, uint32_t i, size_t half[2])
{
    uint32_t count = axis->base[p + 1] - axis->base[p];
    uint32_t first = rmip_spacing(p + 1) > rmip_spacing(p) ? 2 * i : i;
    uint32_t second = first + ((uint32_t)1 << (p - rmip_spacing(p)));
    half[0] = axis->base[p] + (size_t)first;
    half[1] = axis->base[p] + (size_t)second;
    return second < count;
}

typedef void union_rows_fn(uint32_t *to, const uint32_t *a, const uint32_t *b, size_t count);

typedef struct rmip_job {
    rmip_table *table;
    union_rows_fn *union_rows;
} rmip_job;

/* Layer 0 of the y axis: all windows of a row of cells, doubling along x. */
static void widen_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const rmip_job *job = user;
    const rmip_axis *x = &job->table->x;
    for (size_t y = begin; y < end; y++) {
        uint32_t *row = job->table->codes + y * job->table->stride;
        for (int32_t p = 0; p + 1 < x->layers; p++) {
            uint32_t *to = row + x->base[p + 1], count = x->base[p + 2] - x->base[p + 1];
            for (uint32_t i = 0; i < count; i++) {
                size_t half[2];
                bool whole = axis_halves(x, p, i, half);
                to[i] = whole ? code_union(row[half[0]], row[half[1]]) : row[half[0]];
            }
        }
    }
}

/* The other layers of the y axis. Columns of the table do not depend on one another, so a strip of them
 * goes through all layers at once. */
static void double_columns(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const rmip_job *job = user;
    const rmip_axis *y = &job->table->y;
    size_t stride = job->table->stride;
    uint32_t *strip = job->table->codes + begin;
    for (int32_t q = 0; q + 1 < y->layers; q++) {
        uint32_t count = y->base[q + 2] - y->base[q + 1];
        for (uint32_t i = 0; i < count; i++) {
            size_t half[2];
            if (!axis_halves(y, q, i, half)) half[1] = half[0];
            job->union_rows(strip + (y->base[q + 1] + i) * stride, strip + half[0] * stride,
                            strip + half[1] * stride, end - begin);
        }
    }
}

knurl_status rmip_create(knurl_context *context, int32_t width, int32_t height, int32_t shift,
                         rmip_table **table, knurl_error *error)
{
    rmip_table made = {.x = axis_layout(width), .y = axis_layout(height), .shift = shift};
    size_t columns = made.x.base[made.x.layers], rows = made.y.base[made.y.layers];
    /* Lines of 16 entries; an odd number of them spreads rows over all cache sets. */
    size_t lines = (columns + 15) / 16;
    made.stride = columns < 16 ? columns : (lines | 1) * 16;
    *table = knurl_alloc(context, sizeof made);
    made.codes = knurl_alloc_array(context, rows, made.stride * sizeof *made.codes);
    if (!*table || !made.codes) {
        knurl_free(context, *table);
        knurl_free(context, made.codes);
        *table = NULL;
        return knurl_fail_memory(error, rows * made.stride * sizeof *made.codes,
                                 "the RMIP table of a height map");
    }
    made.bytes = sizeof made + rows * made.stride * sizeof *made.codes;
    **table = made;
    return KNURL_OK;
}

void rmip_fill(knurl_context *context, rmip_table *table)
{
    size_t columns = table->x.base[table->x.layers];
    bool avx2 = (knurl_cpu_features(context) & KNURL_CPU_AVX2) != 0;
    rmip_job job = {table, avx2 ? code_union_rows_avx2 : code_union_rows};
    size_t grain = RMIP_CODES / columns ? RMIP_CODES / columns : 1;
    knurl_parallel_for(context, (size_t)table->y.cells, grain, widen_rows, &job);
    knurl_parallel_for(context, columns, RMIP_STRIP, double_columns, &job);
}

void rmip_destroy(knurl_context *context, rmip_table *table)
{
    if (!table) return;
    knurl_free(context, table->codes);
    knurl_free(context, table);
}
