/* methods/empty_skip/zones.h: the four-channel dilation and erosion of a map (Kolb and Rezk-Salama 2005,
 * sections 3.2 and 3.4). */
#ifndef KNURL_SRC_METHODS_EMPTY_SKIP_ZONES_H
#define KNURL_SRC_METHODS_EMPTY_SKIP_ZONES_H

#include "shell/shell.h"

enum { ZONE_CHANNELS = 4 };

/* Box sizes delta, as parts of the map's width and height (section 5). */
static const double ZONE_SIZES[ZONE_CHANNELS] = {0.03125, 0.0625, 0.125, 0.25};

/* For each texel of level 0: bounds on the map over all points that lie at most delta * width and delta *
 * height texels from any point of the texel, in 255ths of the map's range, rounded outwards. */
typedef struct zone_texel {
    uint8_t dilation[ZONE_CHANNELS], erosion[ZONE_CHANNELS];
} zone_texel;

typedef struct zone_map {
    int32_t width, height;
    zone_texel *texels;
} zone_map;

knurl_status zone_map_make(const shell_space *space, zone_map *map, knurl_error *error);
void zone_map_free(knurl_context *context, zone_map *map);

#endif
