/* bounds/heightmap.h: the height map object: levels of detail and range bounds. */
#ifndef KNURL_SRC_BOUNDS_HEIGHTMAP_H
#define KNURL_SRC_BOUNDS_HEIGHTMAP_H

#include "base/base.h"
#include "bounds/cells.h"
#include "data/levels.h"

#include <pthread.h>

enum { HEIGHT_MAX_LEVELS = 18 }; /* 65,536 to 1, and one to spare */

struct minmax_pyramid; /* bounds/minmax.h */
struct rmip_table;     /* bounds/rmip.h */
struct height_blocks;  /* bounds/blocks.h */

struct knurl_heightmap {
    knurl_context *context;
    atomic_size_t references;
    height_level levels[HEIGHT_MAX_LEVELS];
    int32_t level_count;
    double range_min, range_max;
    double code_step; /* of float maps: code c of the tables stands for range_min + c * code_step */
    double margin[HEIGHT_MAX_LEVELS][2]; /* heightmap_lod_margin at whole levels */
    struct minmax_pyramid *minmax;
    int32_t rmip_shift; /* a cell of the RMIP table is 1 << rmip_shift texels */
    /* Made by heightmap_need, NULL before. Once there they stay until the map goes. */
    _Atomic(struct rmip_table *) rmip;
    _Atomic(struct height_blocks *) blocks;
    pthread_mutex_t making;  /* held while one of them is made */
    _Atomic double build_ms; /* written under `making` */
};

/* Structures that only some methods use. */
enum { HEIGHT_NEED_RMIP = 1u << 0, HEIGHT_NEED_BLOCKS = 1u << 1 };

/* Makes what is not there yet. Any thread may call this, also while others read the map. */
knurl_status heightmap_need(knurl_heightmap *map, uint32_t what, knurl_error *error);

/* NULL unless heightmap_need made it. */
static inline const struct rmip_table *heightmap_rmip(const knurl_heightmap *map)
{
    return atomic_load_explicit(&map->rmip, memory_order_acquire);
}
static inline const struct height_blocks *heightmap_blocks(const knurl_heightmap *map)
{
    return atomic_load_explicit(&map->blocks, memory_order_acquire);
}

/* How the codes of the map's bounds become heights. */
static inline cell_scale heightmap_scale(const knurl_heightmap *map)
{
    return (cell_scale){map->range_min, map->range_max, map->code_step};
}

/* Parts of making and updating a map. The range of integer maps comes from the pyramid, that of float maps,
 * with the step, from the samples. */
void heightmap_integer_range(knurl_heightmap *map);
void heightmap_float_range(knurl_heightmap *map);
/* Brings a table up to date after the samples of a rectangle were replaced and the pyramid was updated. */
void heightmap_fill_rmip(const knurl_heightmap *map, struct rmip_table *table, height_rect samples);

/* How far, in texels of level 0, a rectangle must grow on each side so that the range of level 0
 * over it contains the range of the signal at `lod` over the original one. 0 at lod 0.
 * With KNURL_WRAP_CLAMP the rectangle must be clamped to [0, size - 1] before it grows: a point
 * far outside reads the border sample of a coarse level, which depends on texels well inside. */
void heightmap_lod_margin(const knurl_heightmap *map, double lod, double margin[2]);

/* Conservative range of level 0's bilinear signal over [x0, x1] x [y0, y1] in texel coordinates of
 * level 0 (any position, wrapped), x0 <= x1, y0 <= y1. KNURL_BOUNDS_RMIP takes the minmax pyramid as long
 * as there is no RMIP table. */
knurl_range heightmap_bounds_texels(const knurl_heightmap *map, knurl_bounds_kind kind, double x0, double y0,
                                    double x1, double y1, knurl_wrap wrap_u, knurl_wrap wrap_v);

/* The same for the signal at `lod`: clamps where the wrap says so, grows by the margin, queries. */
knurl_range heightmap_bounds_texels_lod(const knurl_heightmap *map, knurl_bounds_kind kind, double x0,
                                        double y0, double x1, double y1, knurl_wrap wrap_u, knurl_wrap wrap_v,
                                        double lod);

#endif
