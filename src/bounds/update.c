/* Editing a height map. Every sample of a level and every code of a bound is a function of the samples of
 * level 0 that it stands for (and, of float maps, of the scale of codes); those whose samples changed are
 * made again by what made them first. So the result is that of a new map, and nothing is allocated. */
#include "bounds/heightmap.h"

#include "bounds/blocks.h"
#include "bounds/minmax.h"

#include <math.h>
#include <string.h>

typedef struct edit {
    int32_t x, y, width, height;
    const unsigned char *samples;
    size_t row_bytes;
} edit;

static knurl_status check_edit(const knurl_heightmap *map, const edit *e, knurl_error *error)
{
    if (!map) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "height map update: map is NULL");
    const height_level *level = &map->levels[0];
    if (e->width < 0 || e->height < 0 || e->x < 0 || e->y < 0 || e->width > level->width - e->x ||
        e->height > level->height - e->y)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "height map update: rectangle of %d x %d texels at (%d, %d), expected one inside "
                          "the map's %d x %d",
                          e->width, e->height, e->x, e->y, level->width, level->height);
    if (e->width == 0 || e->height == 0) return KNURL_OK;
    if (!e->samples) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "height map update: samples is NULL");
    size_t least = (size_t)e->width * (size_t)level->format;
    if (e->height > 1 && e->row_bytes < least)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "height map update: rows are %zu bytes apart, expected at least %zu", e->row_bytes,
                          least);
    return KNURL_OK;
}

/* Range of new float samples, which the caller may have put at any address. */
static knurl_status scan_floats(const edit *e, double range[2], knurl_error *error)
{
    float low = INFINITY, high = -INFINITY;
    for (int32_t y = 0; y < e->height; y++) {
        for (int32_t x = 0; x < e->width; x++) {
            float value;
            memcpy(&value, e->samples + (size_t)y * e->row_bytes + (size_t)x * sizeof value, sizeof value);
            if (!isfinite(value))
                return knurl_fail(error, KNURL_ERROR_INPUT,
                                  "height map update: texel (%d, %d) is %g, expected a finite number",
                                  e->x + x, e->y + y, (double)value);
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
    }
    range[0] = (double)low;
    range[1] = (double)high;
    return KNURL_OK;
}

static void copy_samples(const height_level *level, const edit *e)
{
    size_t bytes = (size_t)level->format, row = (size_t)e->width * bytes;
    unsigned char *to =
        (unsigned char *)level->samples + ((size_t)e->y * (size_t)level->width + (size_t)e->x) * bytes;
    for (size_t y = 0; y < (size_t)e->height; y++)
        memcpy(to + y * (size_t)level->width * bytes, e->samples + y * e->row_bytes, row);
}

knurl_status knurl_heightmap_update(knurl_heightmap *map, int32_t x, int32_t y, int32_t width, int32_t height,
                                    const void *samples, size_t row_bytes, knurl_error *error)
{
    edit e = {x, y, width, height, samples, row_bytes};
    knurl_status status = check_edit(map, &e, error);
    if (status != KNURL_OK || width == 0 || height == 0) return status;
    height_level *level = &map->levels[0];
    bool is_float = level->format == KNURL_PIXEL_F32, rescale = false;
    if (is_float) {
        double range[2] = {0.0, 0.0};
        status = scan_floats(&e, range, error);
        if (status != KNURL_OK) return status;
        rescale = range[0] < map->range_min || range[1] > map->range_max;
    }
    copy_samples(level, &e);
    height_rect changed = {x, y, x + width, y + height}, part = changed;
    for (int32_t k = 1; k < map->level_count; k++) {
        part = height_level_readers(&level[k - 1], &level[k], part);
        height_level_refilter(map->context, &level[k - 1], &level[k], part);
    }
    if (rescale) { /* codes get another meaning */
        heightmap_float_range(map);
        changed = (height_rect){0, 0, level->width, level->height};
    }
    cell_scale scale = heightmap_scale(map);
    minmax_update(map->context, map->minmax, level, &scale, changed);
    if (!is_float) heightmap_integer_range(map);
    struct rmip_table *table = atomic_load(&map->rmip);
    if (table) heightmap_fill_rmip(map, table, changed);
    height_blocks *blocks = atomic_load(&map->blocks);
    if (blocks && rescale) height_blocks_rescale(blocks, map->range_min, map->range_max);
    if (blocks) height_blocks_update(map->context, blocks, level, changed);
    return KNURL_OK;
}
