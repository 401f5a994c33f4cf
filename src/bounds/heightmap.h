/* bounds/heightmap.h: the height map object: levels of detail and range bounds. */
#ifndef KNURL_SRC_BOUNDS_HEIGHTMAP_H
#define KNURL_SRC_BOUNDS_HEIGHTMAP_H

#include "base/base.h"
#include "data/height.h"

enum { HEIGHT_MAX_LEVELS = 18 }; /* 65,536 to 1, and one to spare */

struct minmax_pyramid; /* bounds/minmax.h */
struct rmip_table;     /* bounds/rmip.h */

struct knurl_heightmap {
    knurl_context *context;
    atomic_size_t references;
    height_level levels[HEIGHT_MAX_LEVELS];
    int32_t level_count;
    double range_min, range_max;
    double code_step; /* of float maps: code c of the tables stands for range_min + c * code_step */
    double margin[HEIGHT_MAX_LEVELS][2]; /* heightmap_lod_margin at whole levels */
    struct minmax_pyramid *minmax;
    struct rmip_table *rmip;
    knurl_heightmap_bytes bytes;
    double build_ms;
};

/* How far, in texels of level 0, a rectangle must grow on each side so that the range of level 0
 * over it contains the range of the signal at `lod` over the original one. 0 at lod 0.
 * With KNURL_WRAP_CLAMP the rectangle must be clamped to [0, size - 1] before it grows: a point
 * far outside reads the border sample of a coarse level, which depends on texels well inside. */
void heightmap_lod_margin(const knurl_heightmap *map, double lod, double margin[2]);

/* Conservative range of level 0's bilinear signal over [x0, x1] x [y0, y1] in texel coordinates of
 * level 0 (any position, wrapped), x0 <= x1, y0 <= y1. */
knurl_range heightmap_bounds_texels(const knurl_heightmap *map, knurl_bounds_kind kind, double x0, double y0,
                                    double x1, double y1, knurl_wrap wrap_u, knurl_wrap wrap_v);

/* The same for the signal at `lod`: clamps where the wrap says so, grows by the margin, queries. */
knurl_range heightmap_bounds_texels_lod(const knurl_heightmap *map, knurl_bounds_kind kind, double x0,
                                        double y0, double x1, double y1, knurl_wrap wrap_u, knurl_wrap wrap_v,
                                        double lod);

#endif
