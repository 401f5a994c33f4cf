/* data/levels.h: level 0 of a height map from an image, and the box-filtered levels above it. */
#ifndef KNURL_SRC_DATA_LEVELS_H
#define KNURL_SRC_DATA_LEVELS_H

#include "base/base.h"
#include "data/height.h"

/* Bytes of a level's samples. */
size_t height_level_bytes(const height_level *level);

/* Copies one channel of the image into a new level of the same format. A sample that is not finite
 * is KNURL_ERROR_INPUT; the message names the first one in reading order. */
knurl_status height_level_copy(knurl_context *context, const knurl_image *image, int32_t channel,
                               height_level *level, knurl_error *error);

/* The next coarser level: max(1, n / 2) samples per axis, each the area-weighted mean of what it
 * covers. Integers become U16 rounded to nearest (halves up), floats stay floats. */
knurl_status height_level_filter(knurl_context *context, const height_level *fine, height_level *coarse,
                                 knurl_error *error);

/* Frees the samples. */
void height_level_destroy(knurl_context *context, height_level *level);

#endif
