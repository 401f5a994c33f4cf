/* knurl/heightmap.h: a displacement map with its level-of-detail pyramid and range bounds. */
#ifndef KNURL_HEIGHTMAP_H
#define KNURL_HEIGHTMAP_H

#include <knurl/image.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What happens outside [0, 1] on one axis. Values match the description's samplers. */
typedef enum knurl_wrap {
    KNURL_WRAP_REPEAT = 0,
    KNURL_WRAP_MIRROR, /* mirrored repeat */
    KNURL_WRAP_CLAMP   /* clamp to edge */
} knurl_wrap;

/* A map is the bilinear reconstruction of its samples, texel centres at (i + 0.5) / size.
 * Wrapping belongs to its use (knurl_displacement), so one map serves many surfaces. */
typedef struct knurl_heightmap knurl_heightmap;

typedef struct knurl_heightmap_def {
    uint32_t cookie;
    const knurl_image *image; /* any size from 1 x 1; samples are copied */
    int32_t channel;          /* default 0 (red) */
    int32_t max_level;        /* coarsest level of detail to build, -1 (default): down to 1 x 1 */
    int32_t rmip_cell;        /* texels per side of a cell of the RMIP table: 1, 2, 4, 8, 16 or
                                 32; default 8. Bytes are about 64 / cell^2 per texel, once
                                 something uses the table. */
    int32_t minmax_cell;      /* texels per side of the finest minmax cell: 1, 2, 4, 8 or 16;
                                 default 8. Bytes are about 5.3 / cell^2 per texel. */
} knurl_heightmap_def;

KNURL_API knurl_heightmap_def knurl_heightmap_def_default(void);

/* Builds in parallel on the context's threads. Texels must be finite: a NaN or an infinity
 * is KNURL_ERROR_INPUT with its place. */
KNURL_API knurl_status knurl_heightmap_create(knurl_context *context, const knurl_heightmap_def *def,
                                              knurl_heightmap **map, knurl_error *error);
KNURL_API void knurl_heightmap_release(knurl_heightmap *map);
KNURL_API knurl_heightmap *knurl_heightmap_retain(knurl_heightmap *map);

KNURL_API int32_t knurl_heightmap_width(const knurl_heightmap *map, int32_t level);
KNURL_API int32_t knurl_heightmap_height(const knurl_heightmap *map, int32_t level);
KNURL_API int32_t knurl_heightmap_levels(const knurl_heightmap *map); /* at least 1 */
/* Format of the samples of level 0: the image's. */
KNURL_API knurl_pixel_format knurl_heightmap_format(const knurl_heightmap *map);

/* Sample (x, y) of a level, x in [0, width), y in [0, height). Level k + 1 is the area-weighted
 * box filter of level k at max(1, size / 2) samples per axis; levels above 0 of integer maps are
 * rounded to 16 bits, of float maps to float. */
KNURL_API double knurl_heightmap_sample(const knurl_heightmap *map, int32_t level, int32_t x, int32_t y);
/* The reconstruction at (u, v), v = 0 at the first row; lod in [0, levels - 1], fractional
 * values blend two levels linearly. Any u, v of magnitude under 2^20. */
KNURL_API double knurl_heightmap_value(const knurl_heightmap *map, double u, double v, knurl_wrap wrap_u,
                                       knurl_wrap wrap_v, double lod);

typedef struct knurl_range {
    double min, max;
} knurl_range;

typedef enum knurl_bounds_kind {
    KNURL_BOUNDS_MINMAX = 0, /* minmax pyramid, up to 2 x 2 nodes */
    KNURL_BOUNDS_RMIP        /* RMIP table, up to 2 x 2 rectangles */
} knurl_bounds_kind;

/* Conservative range of the reconstruction over the closed rectangle [u0, u1] x [v0, v1],
 * u0 <= u1, v0 <= v1, wrapped, at any lod (bounds hold for the blend). */
KNURL_API knurl_range knurl_heightmap_bounds(const knurl_heightmap *map, knurl_bounds_kind kind, double u0,
                                             double v0, double u1, double v1, knurl_wrap wrap_u,
                                             knurl_wrap wrap_v, double lod);
/* Range of all samples; of float maps that were updated it may be wider. */
KNURL_API knurl_range knurl_heightmap_range(const knurl_heightmap *map);

/* Replaces the samples of a rectangle of level 0 and brings levels of detail and bounds up to date,
 * touching only what depends on it. `samples` has width * height values of the map's own format, row by
 * row, rows `row_bytes` apart; they are copied. An empty rectangle changes nothing. Nothing else may use the
 * map, or a surface or scene that has it, during the call; afterwards call knurl_surface_update() for each
 * surface that uses it. Values may not be NaN or infinite (KNURL_ERROR_INPUT, nothing changed). Levels and
 * bounds are those of a new map of the edited image, with one exception: the range of a float map, to which
 * its bounds are quantised, shrinks only when another edit exceeds it. An edit that exceeds it goes through
 * the whole map. Allocates nothing. */
KNURL_API knurl_status knurl_heightmap_update(knurl_heightmap *map, int32_t x, int32_t y, int32_t width,
                                              int32_t height, const void *samples, size_t row_bytes,
                                              knurl_error *error);

typedef struct knurl_heightmap_bytes {
    uint64_t samples; /* level 0 */
    uint64_t levels;  /* levels above 0 */
    uint64_t minmax;
    uint64_t rmip;   /* 0 until something uses the table */
    uint64_t blocks; /* samples and ranges laid out for methods with a hierarchy of their own; 0 until used */
} knurl_heightmap_bytes;

KNURL_API knurl_heightmap_bytes knurl_heightmap_memory(const knurl_heightmap *map);
/* Wall-clock milliseconds that building the bounds took, those that were made later included. */
KNURL_API double knurl_heightmap_build_ms(const knurl_heightmap *map);

#ifdef __cplusplus
}
#endif
#endif
