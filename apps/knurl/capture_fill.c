/* capture_fill.c: what texels without a hit hold. Bilinear reconstruction reads them next to the model's
 * outline: the nearest hit's height leaves the surface level there, where any other height would draw a wall
 * up to the cut. */
#include "capture.h"

#include <stdlib.h>

typedef struct nearest_map {
    uint32_t *nearest;
    int32_t width, height;
} nearest_map;

static int64_t distance_to(const nearest_map *map, uint32_t seed, int32_t x, int32_t y)
{
    int64_t dx = (int64_t)(seed % (uint32_t)map->width) - x, dy = (int64_t)(seed / (uint32_t)map->width) - y;
    return dx * dx + dy * dy;
}

/* Takes a neighbour's seed if that is nearer; of equal ones the lower, so that the order does not matter. */
static void relax(const nearest_map *map, int32_t x, int32_t y, int32_t dx, int32_t dy)
{
    int32_t nx = x + dx, ny = y + dy;
    if (nx < 0 || ny < 0 || nx >= map->width || ny >= map->height) return;
    uint32_t *mine = &map->nearest[(size_t)y * (size_t)map->width + (size_t)x];
    uint32_t other = map->nearest[(size_t)ny * (size_t)map->width + (size_t)nx];
    if (other == UINT32_MAX || other == *mine) return;
    if (*mine == UINT32_MAX) {
        *mine = other;
        return;
    }
    int64_t d = distance_to(map, *mine, x, y), e = distance_to(map, other, x, y);
    if (e < d || (e == d && other < *mine)) *mine = other;
}

/* Two passes over the rows, each to and fro (Danielsson 1980, eight neighbours). A seed can be off the
 * nearest by a fraction of a texel in rare arrangements, which does not matter here. */
uint32_t *capture_nearest(const uint8_t *seen, int32_t width, int32_t height)
{
    size_t count = (size_t)width * (size_t)height;
    nearest_map map = {.width = width, .height = height};
    map.nearest = malloc(count * sizeof *map.nearest);
    if (!map.nearest) return NULL;
    for (size_t i = 0; i < count; i++) map.nearest[i] = seen[i] ? (uint32_t)i : UINT32_MAX;
    for (int pass = 0; pass < 2; pass++) {
        int32_t from = pass == 0 ? -1 : 1;
        for (int32_t k = 0; k < height; k++) {
            int32_t y = pass == 0 ? k : height - 1 - k;
            for (int32_t x = 0; x < width; x++) {
                for (int32_t dx = -1; dx <= 1; dx++) relax(&map, x, y, dx, from);
                relax(&map, x, y, -1, 0);
            }
            for (int32_t x = width - 1; x >= 0; x--) relax(&map, x, y, 1, 0);
        }
    }
    return map.nearest;
}
