/* The height map object: an image's channel, its levels of detail, and range bounds over level 0. */
#include "bounds/heightmap.h"

#include "bounds/blocks.h"
#include "bounds/minmax.h"
#include "bounds/rmip.h"
#include "data/levels.h"

#include <math.h>
#include <string.h>

knurl_heightmap_def knurl_heightmap_def_default(void)
{
    return (knurl_heightmap_def){.cookie = KNURL_COOKIE, .max_level = -1, .rmip_cell = 8, .minmax_cell = 8};
}

/* log2 of a power of two in [1, largest], else -1. */
static int32_t cell_shift(int32_t cell, int32_t largest)
{
    if (cell < 1 || cell > largest || (cell & (cell - 1)) != 0) return -1;
    return __builtin_ctz((unsigned)cell);
}

static knurl_status check_def(const knurl_heightmap_def *def, knurl_error *error)
{
    if (!def || def->cookie != KNURL_COOKIE)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "height map definition was not made by knurl_heightmap_def_default()");
    if (!def->image) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "height map: image is NULL");
    int32_t channels = knurl_image_channels(def->image);
    if (def->channel < 0 || def->channel >= channels)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "height map: channel is %d, expected 0 to %d",
                          def->channel, channels - 1);
    if (def->max_level < -1)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "height map: max_level is %d, expected -1 or more",
                          def->max_level);
    if (cell_shift(def->rmip_cell, 32) < 0)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "height map: rmip_cell is %d, expected 1, 2, 4, 8, 16 or 32", def->rmip_cell);
    if (cell_shift(def->minmax_cell, 16) < 0)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "height map: minmax_cell is %d, expected 1, 2, 4, 8 or 16", def->minmax_cell);
    return KNURL_OK;
}

/* How far a sample of level k reaches, in texels of level 0, along an axis of sizes n_0, n_1, ...
 *
 * At u, level k blends two samples whose centres are within 1 / n_k of u and which stand for intervals of
 * 1 / n_k: within 1.5 / n_k of u. A sample's interval overlaps intervals of level k - 1 that may stick out,
 * by less than 1 / n_(k-1) and only where n_(k-1) is odd and not 1 (even sizes have common borders), and so
 * on down to level 0. A sample of level 0 that stands for part of a range of u has its centre at least half a
 * texel inside that range's end, grown as described. Sizes wrap alike at every level (the borders 0 and 1
 * are borders of samples), so this holds across a repeat or a reflection too. */
static double axis_margin(const knurl_heightmap *map, int32_t level, bool vertical)
{
    double reach = 0.0, size0 = 0.0;
    for (int32_t k = 0; k <= level; k++) {
        int32_t n = vertical ? map->levels[k].height : map->levels[k].width;
        if (k == 0) size0 = n;
        if (k == level)
            reach += 1.5 / n;
        else if (n % 2 == 1 && n > 1)
            reach += 1.0 / n;
    }
    return level == 0 ? 0.0 : (reach * size0 - 0.5) * (1.0 + 0x1p-40);
}

static void set_float_range(knurl_heightmap *map, const double range[2])
{
    cell_scale scale = cell_scale_make(range[0], range[1]);
    map->range_min = scale.range_min;
    map->range_max = scale.range_max;
    map->code_step = scale.step;
}

static knurl_status build_levels(knurl_heightmap *map, const knurl_heightmap_def *def, knurl_error *error)
{
    double range[2] = {0.0, 0.0};
    knurl_status status =
        height_level_copy(map->context, def->image, def->channel, &map->levels[0], range, error);
    if (status != KNURL_OK) return status;
    if (map->levels[0].format == KNURL_PIXEL_F32) set_float_range(map, range);
    map->level_count = 1;
    for (int32_t k = 0; k + 1 < HEIGHT_MAX_LEVELS; k++) {
        const height_level *fine = &map->levels[k];
        if ((fine->width == 1 && fine->height == 1) || k == def->max_level) break;
        status = height_level_filter(map->context, fine, &map->levels[k + 1], error);
        if (status != KNURL_OK) return status;
        map->level_count++;
        map->margin[k + 1][0] = axis_margin(map, k + 1, false);
        map->margin[k + 1][1] = axis_margin(map, k + 1, true);
    }
    return KNURL_OK;
}

void heightmap_integer_range(knurl_heightmap *map)
{
    uint32_t all = map->minmax->codes[map->minmax->offset[map->minmax->level_count - 1]];
    double unit = map->levels[0].format == KNURL_PIXEL_U8 ? 255.0 : 65535.0;
    map->range_min = (double)code_min(all) / unit;
    map->range_max = (double)code_max(all) / unit;
}

void heightmap_float_range(knurl_heightmap *map)
{
    double range[2];
    height_level_range(map->context, &map->levels[0], range);
    set_float_range(map, range);
}

static knurl_status build_bounds(knurl_heightmap *map, const knurl_heightmap_def *def, knurl_error *error)
{
    double start = knurl_seconds();
    cell_scale scale = heightmap_scale(map);
    knurl_status status = minmax_build(map->context, &map->levels[0], cell_shift(def->minmax_cell, 16),
                                       &scale, &map->minmax, error);
    if (status != KNURL_OK) return status;
    if (map->levels[0].format != KNURL_PIXEL_F32) heightmap_integer_range(map);
    map->rmip_shift = cell_shift(def->rmip_cell, 32);
    atomic_store(&map->build_ms, 1e3 * (knurl_seconds() - start));
    return KNURL_OK;
}

/* Structures on demand */

/* Cells that the pyramid has are its cells; smaller ones need the samples. A pyramid that ends early ends
 * with a single cell, which is what any larger cells come to. */
void heightmap_fill_rmip(const knurl_heightmap *map, struct rmip_table *table, height_rect samples)
{
    const minmax_pyramid *pyramid = map->minmax;
    cell_grid to = rmip_cells(table);
    if (map->rmip_shift >= pyramid->shift) {
        int32_t level = map->rmip_shift - pyramid->shift, last = pyramid->level_count - 1;
        cell_grid from = minmax_level(pyramid, level < last ? level : last);
        for (size_t y = 0; y < (size_t)to.height; y++)
            memcpy(to.codes + y * to.stride, from.codes + y * from.stride,
                   (size_t)to.width * sizeof *to.codes);
    } else {
        height_rect cells[4];
        cell_scale scale = heightmap_scale(map);
        int32_t count = cell_holders(&map->levels[0], to.shift, samples, cells);
        for (int32_t i = 0; i < count; i++)
            cell_grid_fold(map->context, &map->levels[0], &scale, &to, cells[i]);
    }
    rmip_fill(map->context, table);
}

static knurl_status make_rmip(knurl_heightmap *map, knurl_error *error)
{
    const height_level *level = &map->levels[0];
    struct rmip_table *table = NULL;
    knurl_status status =
        rmip_create(map->context, cell_count(level->width, map->rmip_shift),
                    cell_count(level->height, map->rmip_shift), map->rmip_shift, &table, error);
    if (status != KNURL_OK) return status;
    heightmap_fill_rmip(map, table, (height_rect){0, 0, level->width, level->height});
    atomic_store_explicit(&map->rmip, table, memory_order_release);
    return KNURL_OK;
}

static knurl_status make_blocks(knurl_heightmap *map, knurl_error *error)
{
    height_blocks *blocks = NULL;
    knurl_status status =
        height_blocks_build(map->context, &map->levels[0], map->range_min, map->range_max, &blocks, error);
    if (status == KNURL_OK) atomic_store_explicit(&map->blocks, blocks, memory_order_release);
    return status;
}

knurl_status heightmap_need(knurl_heightmap *map, uint32_t what, knurl_error *error)
{
    knurl_status status = KNURL_OK;
    pthread_mutex_lock(&map->making);
    double start = knurl_seconds();
    bool rmip = (what & HEIGHT_NEED_RMIP) && !heightmap_rmip(map);
    bool blocks = (what & HEIGHT_NEED_BLOCKS) && !heightmap_blocks(map);
    if (rmip) status = make_rmip(map, error);
    if (blocks && status == KNURL_OK) status = make_blocks(map, error);
    if (rmip || blocks)
        atomic_store(&map->build_ms, atomic_load(&map->build_ms) + 1e3 * (knurl_seconds() - start));
    pthread_mutex_unlock(&map->making);
    return status;
}

knurl_status knurl_heightmap_create(knurl_context *context, const knurl_heightmap_def *def,
                                    knurl_heightmap **map, knurl_error *error)
{
    if (!map) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "height map: map is NULL");
    *map = NULL;
    if (!context) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "height map: context is NULL");
    knurl_status status = check_def(def, error);
    if (status != KNURL_OK) return status;
    knurl_heightmap *made = knurl_alloc_zero(context, sizeof *made);
    if (!made) return knurl_fail_memory(error, sizeof *made, "a height map");
    made->context = knurl_context_retain(context);
    atomic_init(&made->references, 1);
    pthread_mutex_init(&made->making, NULL);
    status = build_levels(made, def, error);
    if (status == KNURL_OK) status = build_bounds(made, def, error);
    if (status != KNURL_OK) {
        knurl_heightmap_release(made);
        return status;
    }
    *map = made;
    return KNURL_OK;
}

knurl_heightmap *knurl_heightmap_retain(knurl_heightmap *map)
{
    if (map) atomic_fetch_add_explicit(&map->references, 1, memory_order_relaxed);
    return map;
}

void knurl_heightmap_release(knurl_heightmap *map)
{
    if (!map || atomic_fetch_sub_explicit(&map->references, 1, memory_order_acq_rel) != 1) return;
    knurl_context *context = map->context;
    height_blocks_destroy(context, map->blocks);
    rmip_destroy(context, map->rmip);
    minmax_destroy(context, map->minmax);
    for (int32_t k = 0; k < HEIGHT_MAX_LEVELS; k++) height_level_destroy(context, &map->levels[k]);
    pthread_mutex_destroy(&map->making);
    knurl_free(context, map);
    knurl_context_release(context);
}

int32_t knurl_heightmap_width(const knurl_heightmap *map, int32_t level)
{
    return level >= 0 && level < map->level_count ? map->levels[level].width : 0;
}

int32_t knurl_heightmap_height(const knurl_heightmap *map, int32_t level)
{
    return level >= 0 && level < map->level_count ? map->levels[level].height : 0;
}

int32_t knurl_heightmap_levels(const knurl_heightmap *map)
{
    return map->level_count;
}

knurl_pixel_format knurl_heightmap_format(const knurl_heightmap *map)
{
    return map->levels[0].format;
}

double knurl_heightmap_sample(const knurl_heightmap *map, int32_t level, int32_t x, int32_t y)
{
    return height_fetch(&map->levels[level], x, y);
}

knurl_range knurl_heightmap_range(const knurl_heightmap *map)
{
    return (knurl_range){map->range_min, map->range_max};
}

knurl_heightmap_bytes knurl_heightmap_memory(const knurl_heightmap *map)
{
    const struct rmip_table *rmip = heightmap_rmip(map);
    const height_blocks *blocks = heightmap_blocks(map);
    knurl_heightmap_bytes bytes = {.minmax = map->minmax->bytes};
    for (int32_t k = 0; k < map->level_count; k++)
        *(k == 0 ? &bytes.samples : &bytes.levels) += height_level_bytes(&map->levels[k]);
    if (rmip) bytes.rmip = rmip->bytes;
    if (blocks) bytes.blocks = blocks->bytes;
    return bytes;
}

double knurl_heightmap_build_ms(const knurl_heightmap *map)
{
    return atomic_load(&map->build_ms);
}

/* The value */

static double mix(double a, double b, double t)
{
    /* Never outside [a, b], so that bounds hold to the last bit. */
    double value = a + t * (b - a);
    double low = a < b ? a : b, high = a < b ? b : a;
    return value < low ? low : value > high ? high : value;
}

static double bilinear(const height_level *level, double u, double v, knurl_wrap wrap_u, knurl_wrap wrap_v)
{
    double x = u * level->width - 0.5, y = v * level->height - 0.5;
    double column = floor(x), row = floor(y);
    int64_t i = (int64_t)column, j = (int64_t)row;
    int32_t x0 = height_wrap(i, level->width, wrap_u), x1 = height_wrap(i + 1, level->width, wrap_u);
    int32_t y0 = height_wrap(j, level->height, wrap_v), y1 = height_wrap(j + 1, level->height, wrap_v);
    double top = mix(height_fetch(level, x0, y0), height_fetch(level, x1, y0), x - column);
    double bottom = mix(height_fetch(level, x0, y1), height_fetch(level, x1, y1), x - column);
    return mix(top, bottom, y - row);
}

double knurl_heightmap_value(const knurl_heightmap *map, double u, double v, knurl_wrap wrap_u,
                             knurl_wrap wrap_v, double lod)
{
    /* Beyond any use, but not beyond a caller's mistake: converting them to integers is undefined. */
    if (!(fabs(u) < 0x1p40)) u = 0.0;
    if (!(fabs(v) < 0x1p40)) v = 0.0;
    double last = map->level_count - 1;
    lod = lod > 0.0 ? (lod < last ? lod : last) : 0.0;
    int32_t k = (int32_t)lod;
    double value = bilinear(&map->levels[k], u, v, wrap_u, wrap_v);
    if (lod == k) return value;
    return mix(value, bilinear(&map->levels[k + 1], u, v, wrap_u, wrap_v), lod - k);
}
