/* data/levels.h: level 0 of a height map from an image, and the box-filtered levels above it. */
#ifndef KNURL_SRC_DATA_LEVELS_H
#define KNURL_SRC_DATA_LEVELS_H

#include "base/base.h"
#include "data/height.h"

/* Samples (or cells, or nodes) [x0, x1) x [y0, y1). */
typedef struct height_rect {
    int32_t x0, y0, x1, y1;
} height_rect;

/* Bytes of a level's samples. */
size_t height_level_bytes(const height_level *level);

/* Copies one channel of the image into a new level of the same format. A sample that is not finite
 * is KNURL_ERROR_INPUT; the message names the first one in reading order. Float
 * levels get their `range`, as from height_level_range. */
knurl_status height_level_copy(knurl_context *context, const knurl_image *image, int32_t channel,
                               height_level *level, double range[2], knurl_error *error);

/* The next coarser level: max(1, n / 2) samples per axis, each the area-weighted mean of what it
 * covers. Integers become U16 rounded to nearest (halves up), floats stay floats. */
knurl_status height_level_filter(knurl_context *context, const height_level *fine, height_level *coarse,
                                 knurl_error *error);

/* Makes the samples of `to` again; each depends on `fine` alone, so the result is that of a new level. */
void height_level_refilter(knurl_context *context, const height_level *fine, const height_level *coarse,
                           height_rect to);
/* Which samples of the coarser level read those of a rectangle of the finer one. */
height_rect height_level_readers(const height_level *fine, const height_level *coarse, height_rect changed);

/* Smallest and largest sample of a float level; a zero is positive. */
void height_level_range(knurl_context *context, const height_level *level, double range[2]);

/* Frees the samples. */
void height_level_destroy(knurl_context *context, height_level *level);

#endif
