/* Range queries: from a rectangle anywhere on the wrapped plane to cells of one period, to codes, to
 * heights. This is the inner loop of every method, so cells are found by shifts, ranges are merged as
 * integers, and only the result becomes floating point. */
#include "bounds/heightmap.h"

#include "bounds/minmax.h"
#include "bounds/rmip.h"

#include <math.h>

/* What an interval covers of one period, as texel cells: cell i is [i, i + 1]. */
typedef struct axis_cells {
    int32_t count; /* 1 or 2 */
    int32_t first[2], last[2];
} axis_cells;

/* [a, b] with 0 <= a <= b <= size. A closed interval that ends on a sample has that sample in the cell
 * before it, unless it is a point. */
static inline void add_cells(axis_cells *cells, double a, double b, int32_t size)
{
    int32_t first = (int32_t)a, last = (int32_t)b;
    last -= last == b;
    first = first < size ? first : size - 1;
    last = last < size ? last : size - 1;
    cells->first[cells->count] = first;
    cells->last[cells->count] = last > first ? last : first;
    cells->count++;
}

static void whole_axis(axis_cells *cells, int32_t size)
{
    *cells = (axis_cells){1, {0}, {size - 1}};
}

/* a - shift, rounded so that it is not above (or not below) the exact difference. The first subtraction
 * is exact unless `a` is small and of the other sign, and z is exact then (Dekker's fast two-sum). */
static inline double subtract_down(double a, double shift)
{
    double r = a - shift, z = r + shift;
    return z > a ? nextafter(r, -INFINITY) : r;
}

static inline double subtract_up(double a, double shift)
{
    double r = a - shift, z = r + shift;
    return z < a ? nextafter(r, INFINITY) : r;
}

/* Multiple of `period` that brings `a`, |a| < 2^50, to [start, start + period). The quotient is cut off
 * towards zero, and rounding cannot take it below a whole number that it reaches: it is right or one too
 * large. */
static inline double period_of(double a, double start, double period)
{
    double shift = (double)(int64_t)((a - start) / period) * period;
    return a < shift + start ? shift - period : shift;
}

/* Moves an interval by whole periods so that it starts in [0, size). */
static inline void into_period(double *a, double *b, int32_t size)
{
    if (!(fabs(*a) < 0x1p50)) return;
    double shift = period_of(*a, 0.0, size), start = subtract_down(*a, shift);
    *a = start > 0.0 ? start : 0.0;
    *b = subtract_up(*b, shift);
}

/* Starts in [0, size], is shorter than a period. */
static void fold_repeat(axis_cells *cells, double a, double b, int32_t size)
{
    double period = size;
    if (b <= period) {
        add_cells(cells, a < period ? a : period, b > a ? b : a, size);
    } else {
        add_cells(cells, a, period, size);
        add_cells(cells, 0.0, b - period, size);
    }
}

/* The signal has period 2 * size and is symmetric about -0.5 and size - 0.5, where it is constant up to
 * the next sample. Values that are reflected are larger than their image, so that is exact. */
static void fold_mirror(axis_cells *cells, double a, double b, int32_t size)
{
    double period = 2.0 * size, last = size - 1, turn = size - 0.5, shift = period_of(a, -0.5, period);
    a = subtract_down(a, shift);
    b = subtract_up(b, shift);
    double low, high;
    if (a <= turn) {
        low = a;
        high = b;
        if (b > turn) {
            low = fmin(a, period - 1.0 - b);
            high = turn;
        }
    } else {
        low = period - 1.0 - b;
        high = period - 1.0 - a;
        if (b > period - 0.5) {
            low = -0.5;
            high = fmax(high, b - period);
        }
    }
    low = low > 0.0 ? (low < last ? low : last) : 0.0;
    high = high < last ? (high > low ? high : low) : last;
    add_cells(cells, low, high, size);
}

static void fold(axis_cells *cells, double a, double b, int32_t size, knurl_wrap wrap)
{
    double last = size - 1, period = wrap == KNURL_WRAP_MIRROR ? 2.0 * size : (double)size;
    if (wrap == KNURL_WRAP_CLAMP) { /* NaN: everything */
        a = a > 0.0 ? (a < last ? a : last) : 0.0;
        b = b < last ? (b > a ? b : a) : last;
        add_cells(cells, a, b, size);
    } else if (!(b - a < period) || !(fabs(a) < 0x1p50)) {
        whole_axis(cells, size);
    } else if (wrap == KNURL_WRAP_MIRROR) {
        fold_mirror(cells, a, b, size);
    } else { /* came through into_period */
        fold_repeat(cells, a, b, size);
    }
}

static inline knurl_range decode(const knurl_heightmap *map, uint32_t high, uint32_t low)
{
    uint32_t code = (high & 0xffff0000u) | low;
    double min = code_min(code), max = code_max(code);
    switch (map->levels[0].format) {
    case KNURL_PIXEL_U8:
        return (knurl_range){min / 255.0, max / 255.0};
    case KNURL_PIXEL_U16:
        return (knurl_range){min / 65535.0, max / 65535.0};
    default:
        break;
    }
    max = map->range_min + max * map->code_step;
    return (knurl_range){map->range_min + min * map->code_step, max < map->range_max ? max : map->range_max};
}

/* NULL: the pyramid. */
static inline const rmip_table *table_of(const knurl_heightmap *map, knurl_bounds_kind kind)
{
    return kind == KNURL_BOUNDS_RMIP ? heightmap_rmip(map) : NULL;
}

/* A rectangle anywhere. */
static knurl_range wrapped_bounds(const knurl_heightmap *map, const rmip_table *table, const double x[2],
                                  const double y[2], knurl_wrap wrap_u, knurl_wrap wrap_v)
{
    axis_cells h = {0}, v = {0};
    fold(&h, x[0], x[1], map->levels[0].width, wrap_u);
    fold(&v, y[0], y[1], map->levels[0].height, wrap_v);
    uint32_t high = 0, low = 0;
    for (int32_t j = 0; j < v.count; j++) {
        for (int32_t i = 0; i < h.count; i++) {
            if (table)
                rmip_query(table, h.first[i], h.last[i], v.first[j], v.last[j], &high, &low);
            else
                minmax_query(map->minmax, h.first[i], h.last[i], v.first[j], v.last[j], &high, &low);
        }
    }
    return decode(map, high, low);
}

static inline bool inside(double a, double b, int32_t size)
{
    return a >= 0.0 && a <= b && b <= size - 1;
}

/* Last texel cell of an interval from cell `first` on; see add_cells. */
static inline int32_t last_cell(double b, int32_t first)
{
    int32_t last = (int32_t)b;
    last -= last == b;
    return last > first ? last : first;
}

knurl_range heightmap_bounds_texels(const knurl_heightmap *map, knurl_bounds_kind kind, double x0, double y0,
                                    double x1, double y1, knurl_wrap wrap_u, knurl_wrap wrap_v)
{
    int32_t width = map->levels[0].width, height = map->levels[0].height;
    const rmip_table *table = table_of(map, kind);
    if (wrap_u == KNURL_WRAP_REPEAT && !inside(x0, x1, width)) into_period(&x0, &x1, width);
    if (wrap_v == KNURL_WRAP_REPEAT && !inside(y0, y1, height)) into_period(&y0, &y1, height);
    if (!inside(x0, x1, width) || !inside(y0, y1, height))
        return wrapped_bounds(map, table, (const double[2]){x0, x1}, (const double[2]){y0, y1}, wrap_u,
                              wrap_v);
    int32_t left = (int32_t)x0, right = last_cell(x1, left), top = (int32_t)y0, bottom = last_cell(y1, top);
    uint32_t high = 0, low = 0;
    if (table)
        rmip_query(table, left, right, top, bottom, &high, &low);
    else
        minmax_query(map->minmax, left, right, top, bottom, &high, &low);
    return decode(map, high, low);
}

void heightmap_lod_margin(const knurl_heightmap *map, double lod, double margin[2])
{
    /* A blend needs what its coarser level needs, which is more than the finer one does. */
    double last = map->level_count - 1;
    int32_t k = lod > 0.0 ? (int32_t)ceil(lod < last ? lod : last) : 0;
    margin[0] = map->margin[k][0];
    margin[1] = map->margin[k][1];
}

static void grow(double *a, double *b, int32_t size, knurl_wrap wrap, double margin)
{
    double last = size - 1;
    if (wrap == KNURL_WRAP_CLAMP) {
        *a = *a > 0.0 ? (*a < last ? *a : last) : 0.0;
        *b = *b < last ? (*b > 0.0 ? *b : 0.0) : last;
    }
    *a -= margin;
    *b += margin;
}

knurl_range heightmap_bounds_texels_lod(const knurl_heightmap *map, knurl_bounds_kind kind, double x0,
                                        double y0, double x1, double y1, knurl_wrap wrap_u, knurl_wrap wrap_v,
                                        double lod)
{
    if (lod > 0.0) {
        double margin[2];
        heightmap_lod_margin(map, lod, margin);
        grow(&x0, &x1, map->levels[0].width, wrap_u, margin[0]);
        grow(&y0, &y1, map->levels[0].height, wrap_v, margin[1]);
    }
    return heightmap_bounds_texels(map, kind, x0, y0, x1, y1, wrap_u, wrap_v);
}

/* u in texels, moved outward by more than both roundings of u * size - 0.5. */
static inline double to_texels(double u, int32_t size, double direction)
{
    double x = u * size;
    return x - 0.5 + direction * (fabs(x) + 1.0) * 0x1p-51;
}

knurl_range knurl_heightmap_bounds(const knurl_heightmap *map, knurl_bounds_kind kind, double u0, double v0,
                                   double u1, double v1, knurl_wrap wrap_u, knurl_wrap wrap_v, double lod)
{
    int32_t width = map->levels[0].width, height = map->levels[0].height;
    /* The map is const in what it answers. Without memory for the table the pyramid answers. */
    if (kind == KNURL_BOUNDS_RMIP && !heightmap_rmip(map))
        heightmap_need((knurl_heightmap *)map, HEIGHT_NEED_RMIP, NULL);
    return heightmap_bounds_texels_lod(map, kind, to_texels(u0, width, -1.0), to_texels(v0, height, -1.0),
                                       to_texels(u1, width, 1.0), to_texels(v1, height, 1.0), wrap_u, wrap_v,
                                       lod);
}
