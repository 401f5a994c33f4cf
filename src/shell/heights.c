/* See heights.h. */
#include "shell/heights.h"

#include "bounds/minmax.h"

#include <float.h>

static int64_t floor_mod(int64_t a, int64_t period)
{
    int64_t rest = a % period;
    return rest < 0 ? rest + period : rest;
}

/* Whether first .. last and [from, to) have a number in common. */
static bool meets(int64_t first, int64_t last, int64_t from, int64_t to)
{
    return first < to && last >= from;
}

bool height_axis_reads(int64_t first, int64_t last, int32_t size, knurl_wrap wrap, int32_t from, int32_t to)
{
    if (wrap == KNURL_WRAP_CLAMP)
        return meets(height_wrap(first, size, wrap), height_wrap(last, size, wrap), from, to);
    int64_t period = wrap == KNURL_WRAP_MIRROR ? 2 * (int64_t)size : size;
    if (last - first + 1 >= period) return true;
    int64_t start = floor_mod(first, period), end = start + (last - first); /* end < 2 period */
    for (int64_t k = 0; k < 2; k++) {
        if (meets(start, end, from + k * period, to + k * period)) return true;
        int64_t turn = (k + 1) * period;
        if (wrap == KNURL_WRAP_MIRROR && meets(start, end, turn - to, turn - from)) return true;
    }
    return false;
}

bool height_table_reads(int64_t first, int64_t last, int64_t reach, int32_t size, knurl_wrap wrap,
                        int32_t from, int32_t to)
{
    if (wrap == KNURL_WRAP_CLAMP) {
        first = height_wrap(first, size, wrap);
        last = height_wrap(last, size, wrap);
    }
    first -= reach;
    last += reach;
    return height_axis_reads(first, last, size, wrap, from, to) ||
           (from == 0 && height_axis_reads(first, last, size, wrap, size - 1, size));
}

/* ---- Ranges ------------------------------------------------------------------------------------------- */

typedef struct span {
    float low, high;
} span;

/* Map values as heights, widened by more than anything that evaluates the surface rounds. How much must not
 * depend on the values, so that ranges of unions are unions of ranges. */
static span span_of(const shell_space *space, double low, double high)
{
    const knurl_heightmap *map = space->map;
    double most = 1.0;
    if (map->levels[0].format == KNURL_PIXEL_F32) most = max_d(fabs(map->range_min), fabs(map->range_max));
    double a = space->offset + space->factor * low, b = space->offset + space->factor * high;
    double pad = 16.0 * DBL_EPSILON * (fabs(space->offset) + fabs(space->factor) * most);
    return (span){float_down(min_d(a, b) - pad), float_up(max_d(a, b) + pad)};
}

/* A triangle's box in (u, v), and in the texels of a level of detail. */
typedef struct uv_box {
    double u0, u1, v0, v1;
} uv_box;

typedef struct texel_box {
    double x0, x1, y0, y1;
    bool few; /* samples are read one by one */
} texel_box;

static uv_box find_uv_box(const shell_space *space, uint32_t triangle)
{
    const uint32_t *v = space->mesh.triangles + 3 * (size_t)triangle;
    uv_box box = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        const float *st = space->mesh.texcoords + 2 * (size_t)v[i];
        vec2 uv = shell_uv(space, (double)st[0], (double)st[1]);
        box.u0 = min_d(box.u0, uv.x);
        box.u1 = max_d(box.u1, uv.x);
        box.v0 = min_d(box.v0, uv.y);
        box.v1 = max_d(box.v1, uv.y);
    }
    return box;
}

/* Few samples of a coarse level are read one by one: a bound through level 0 would have to grow by 1.5 texels
 * of that level, which is loose where the triangle covers only a few of them. */
enum { FEW_SAMPLES = 256 };

static texel_box find_texels(const shell_space *space, const uv_box *uv, int32_t level)
{
    double w = (double)space->map->levels[level].width, h = (double)space->map->levels[level].height;
    double most = max_d(max_d(fabs(uv->u0), fabs(uv->u1)) * w, max_d(fabs(uv->v0), fabs(uv->v1)) * h) + 1.0;
    double pad = 16.0 * DBL_EPSILON * most; /* as of the coordinates that rays are traced in, and more */
    texel_box box = {uv->u0 * w - 0.5 - pad, uv->u1 * w - 0.5 + pad, uv->v0 * h - 0.5 - pad,
                     uv->v1 * h - 0.5 + pad, false};
    box.few = level > 0 && (box.x1 - box.x0 + 2.0) * (box.y1 - box.y0 + 2.0) <= (double)FEW_SAMPLES;
    return box;
}

/* A few samples' columns and rows: 0 .. n of each axis, n the last cell's second sample. */
static span sampled_span(const shell_space *space, const height_level *level, const texel_box *box)
{
    int32_t columns[FEW_SAMPLES];
    int64_t left = (int64_t)floor_d(box->x0), top = (int64_t)floor_d(box->y0);
    int64_t across = (int64_t)floor_d(box->x1) + 1 - left, down = (int64_t)floor_d(box->y1) + 1 - top;
    for (int64_t i = 0; i <= across; i++) columns[i] = height_wrap(left + i, level->width, space->wrap_u);
    double low = INFINITY, high = -INFINITY;
    for (int64_t j = 0; j <= down; j++) {
        int32_t row = height_wrap(top + j, level->height, space->wrap_v);
        for (int64_t i = 0; i <= across; i++) {
            double value = height_fetch(level, columns[i], row);
            low = min_d(low, value);
            high = max_d(high, value);
        }
    }
    return span_of(space, low, high);
}

/* The box in texels of level 0. */
static texel_box to_finest(const shell_space *space, int32_t level, const texel_box *box)
{
    const height_level *levels = space->map->levels;
    double sx = (double)levels[0].width / (double)levels[level].width;
    double sy = (double)levels[0].height / (double)levels[level].height;
    return (texel_box){(box->x0 + 0.5) * sx - 0.5, (box->x1 + 0.5) * sx - 0.5, (box->y0 + 0.5) * sy - 0.5,
                       (box->y1 + 0.5) * sy - 0.5, false};
}

static span level_span(const shell_space *space, int32_t level, const texel_box *box)
{
    if (box->few) return sampled_span(space, &space->map->levels[level], box);
    texel_box b = to_finest(space, level, box);
    knurl_range raw = heightmap_bounds_texels_lod(space->map, space->bounds, b.x0, b.y0, b.x1, b.y1,
                                                  space->wrap_u, space->wrap_v, (double)level);
    return span_of(space, raw.min, raw.max);
}

static void widen(shell *stored, int32_t level, span s)
{
    if (s.low < stored->height_min) {
        stored->height_min = s.low;
        stored->low_level = (uint8_t)level;
    }
    if (s.high > stored->height_max) {
        stored->height_max = s.high;
        stored->high_level = (uint8_t)level;
    }
}

void shell_heights(const shell_space *space, uint32_t triangle, shell *stored)
{
    uv_box uv = find_uv_box(space, triangle);
    stored->height_min = INFINITY;
    stored->height_max = -INFINITY;
    for (int32_t level = 0; level < space->map->level_count; level++) {
        texel_box box = find_texels(space, &uv, level);
        widen(stored, level, level_span(space, level, &box));
    }
}

/* ---- Edits -------------------------------------------------------------------------------------------- */

static void rect_range(const height_level *level, const height_rect *rect, double range[2])
{
    range[0] = INFINITY;
    range[1] = -INFINITY;
    for (int32_t y = rect->y0; y < rect->y1; y++) {
        const size_t row = (size_t)y * (size_t)level->width;
        if (level->format == KNURL_PIXEL_F32) {
            const float *samples = (const float *)level->samples + row;
            for (int32_t x = rect->x0; x < rect->x1; x++) {
                range[0] = min_d(range[0], (double)samples[x]);
                range[1] = max_d(range[1], (double)samples[x]);
            }
            continue;
        }
        unsigned low = 65535, high = 0;
        for (int32_t x = rect->x0; x < rect->x1; x++) {
            unsigned value = level->format == KNURL_PIXEL_U8
                                 ? ((const uint8_t *)level->samples)[row + (size_t)x]
                                 : ((const uint16_t *)level->samples)[row + (size_t)x];
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
        double unit = level->format == KNURL_PIXEL_U8 ? 255.0 : 65535.0;
        range[0] = min_d(range[0], (double)low / unit);
        range[1] = max_d(range[1], (double)high / unit);
    }
}

void shell_edit_make(const shell_space *space, height_rect samples, bool all, shell_edit *edit)
{
    const knurl_heightmap *map = space->map;
    edit->all = all;
    for (int32_t k = 0; !all && k < map->level_count; k++) {
        if (k > 0) samples = height_level_readers(&map->levels[k - 1], &map->levels[k], samples);
        double range[2];
        rect_range(&map->levels[k], &samples, range);
        /* Range tables of float maps are quantised to steps, and evaluated with a rounding. */
        double step = map->levels[0].format == KNURL_PIXEL_F32 ? 1.5 * map->code_step : 0.0;
        span s = span_of(space, range[0] - step, range[1] + step);
        edit->samples[k] = samples;
        edit->low[k] = s.low;
        edit->high[k] = s.high;
    }
}

/* How far range tables look beyond a rectangle at most, in texels: nodes of the pyramid are up to twice as
 * long as it, windows of the RMIP a part of that, and both begin and end with whole cells. */
static int64_t table_reach(const knurl_heightmap *map, double longest)
{
    int32_t shift = map->minmax->shift > map->rmip_shift ? map->minmax->shift : map->rmip_shift;
    return (int64_t)(2.0 * longest) + (6 << shift);
}

/* Whether level_span() may have another result. */
static bool reads_edit(const shell_space *space, const shell_edit *edit, int32_t level, const texel_box *box)
{
    const knurl_heightmap *map = space->map;
    if (box->few) {
        const height_level *l = &map->levels[level];
        const height_rect *r = &edit->samples[level];
        return height_axis_reads((int64_t)floor_d(box->x0), (int64_t)floor_d(box->x1) + 1, l->width,
                                 space->wrap_u, r->x0, r->x1) &&
               height_axis_reads((int64_t)floor_d(box->y0), (int64_t)floor_d(box->y1) + 1, l->height,
                                 space->wrap_v, r->y0, r->y1);
    }
    const height_rect *r = &edit->samples[0];
    texel_box b = to_finest(space, level, box);
    double margin[2];
    heightmap_lod_margin(map, (double)level, margin);
    double longest = max_d(b.x1 - b.x0 + 2.0 * margin[0], b.y1 - b.y0 + 2.0 * margin[1]);
    int64_t reach = table_reach(map, longest) + (int64_t)max_d(margin[0], margin[1]) + 1;
    return height_table_reads((int64_t)floor_d(b.x0), (int64_t)floor_d(b.x1) + 1, reach, map->levels[0].width,
                              space->wrap_u, r->x0, r->x1) &&
           height_table_reads((int64_t)floor_d(b.y0), (int64_t)floor_d(b.y1) + 1, reach,
                              map->levels[0].height, space->wrap_v, r->y0, r->y1);
}

bool shell_heights_update(const shell_space *space, uint32_t triangle, const shell_edit *edit, shell *stored)
{
    if (edit->all) {
        shell_heights(space, triangle, stored);
        return true;
    }
    const shell before = *stored;
    uv_box uv = find_uv_box(space, triangle);
    for (int32_t level = 0; level < space->map->level_count; level++) {
        texel_box box = find_texels(space, &uv, level);
        bool lowest = before.low_level == level, highest = before.high_level == level;
        int32_t source = box.few ? level : 0;
        /* What did not change is in the range already. */
        if (!lowest && !highest && edit->low[source] >= before.height_min &&
            edit->high[source] <= before.height_max)
            continue;
        if (!reads_edit(space, edit, level, &box)) continue;
        span s = level_span(space, level, &box);
        if ((lowest && s.low > before.height_min) || (highest && s.high < before.height_max)) {
            shell_heights(space, triangle, stored);
            break;
        }
        widen(stored, level, s);
    }
    return stored->height_min < before.height_min || stored->height_min > before.height_min ||
           stored->height_max < before.height_max || stored->height_max > before.height_max;
}
