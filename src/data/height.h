/* data/height.h: one level of a height map, and how indices wrap. */
#ifndef KNURL_SRC_DATA_HEIGHT_H
#define KNURL_SRC_DATA_HEIGHT_H

#include <knurl/heightmap.h>

/* Samples of one level, row-major. Texel coordinates: x = u * width - 0.5, so sample i sits at
 * x = i, and cell i of the bilinear signal is [i, i + 1]. */
typedef struct height_level {
    int32_t width, height;
    knurl_pixel_format format;
    const void *samples; /* width * height, one channel */
    /* NULL, or the same samples as 16-bit codes (65535 is 1) in tiles of 8 x 4, which are then read in place
     * of them: what is near in the map is near in memory. */
    const uint16_t *tiles;
    int32_t tile_columns;
} height_level;

/* Where sample (x, y) is in tiles. */
static inline size_t height_tile_index(int32_t tile_columns, int32_t x, int32_t y)
{
    size_t tile = (size_t)(y >> 2) * (size_t)tile_columns + (size_t)(x >> 3);
    return tile * 32 + (size_t)((y & 3) * 8 + (x & 7));
}

/* Sample (x, y), x in [0, width), y in [0, height), scaled as the format says. */
static inline double height_fetch(const height_level *level, int32_t x, int32_t y)
{
    size_t i = (size_t)y * (size_t)level->width + (size_t)x;
    switch (level->format) {
    case KNURL_PIXEL_U8:
        return (double)((const uint8_t *)level->samples)[i] / 255.0;
    case KNURL_PIXEL_U16:
        return (double)((const uint16_t *)level->samples)[i] / 65535.0;
    default:
        return (double)((const float *)level->samples)[i];
    }
}

/* Raw samples at two columns by two rows: (0,0), (1,0), (0,1), (1,1). Returns the scale that makes
 * values of them, so that a caller with a factor of its own multiplies once. */
static inline double height_fetch_cell(const height_level *level, const int32_t columns[2],
                                       const int32_t rows[2], double raw[4])
{
    if (level->tiles) {
        for (int i = 0; i < 4; i++)
            raw[i] =
                (double)level->tiles[height_tile_index(level->tile_columns, columns[i & 1], rows[i >> 1])];
        return 1.0 / 65535.0;
    }
    size_t top = (size_t)rows[0] * (size_t)level->width, bottom = (size_t)rows[1] * (size_t)level->width;
    size_t at[4] = {top + (size_t)columns[0], top + (size_t)columns[1], bottom + (size_t)columns[0],
                    bottom + (size_t)columns[1]};
    switch (level->format) {
    case KNURL_PIXEL_U8:
        for (int i = 0; i < 4; i++) raw[i] = (double)((const uint8_t *)level->samples)[at[i]];
        return 1.0 / 255.0;
    case KNURL_PIXEL_U16:
        for (int i = 0; i < 4; i++) raw[i] = (double)((const uint16_t *)level->samples)[at[i]];
        return 1.0 / 65535.0;
    default:
        for (int i = 0; i < 4; i++) raw[i] = (double)((const float *)level->samples)[at[i]];
        return 1.0;
    }
}

/* Index of the sample that stands at integer position i of the wrapped signal, |i| < 2^62. */
static inline int32_t height_wrap(int64_t i, int32_t size, knurl_wrap wrap)
{
    if (i >= 0 && i < size) return (int32_t)i;
    if (wrap == KNURL_WRAP_CLAMP) return i < 0 ? 0 : size - 1;
    if (wrap == KNURL_WRAP_REPEAT && i >= size && i < 2 * (int64_t)size) return (int32_t)(i - size);
    int64_t period = wrap == KNURL_WRAP_MIRROR ? 2 * (int64_t)size : size;
    int64_t r = i % period;
    if (r < 0) r += period;
    return (int32_t)(r < size ? r : period - 1 - r);
}

/* Raw samples (i .. i + 2) x (j .. j + 2) of the wrapped signal, row by row; returns the scale. */
static inline double height_fetch_nine(const height_level *level, int64_t i, int64_t j, knurl_wrap wrap_u,
                                       knurl_wrap wrap_v, double raw[9])
{
    int32_t x[3], y[3];
    for (int k = 0; k < 3; k++) {
        x[k] = height_wrap(i + k, level->width, wrap_u);
        y[k] = height_wrap(j + k, level->height, wrap_v);
    }
    if (level->tiles) {
        for (int k = 0; k < 9; k++)
            raw[k] = (double)level->tiles[height_tile_index(level->tile_columns, x[k % 3], y[k / 3])];
        return 1.0 / 65535.0;
    }
    size_t columns[3], rows[3];
    for (int k = 0; k < 3; k++) {
        columns[k] = (size_t)x[k];
        rows[k] = (size_t)y[k] * (size_t)level->width;
    }
    switch (level->format) {
    case KNURL_PIXEL_U8:
        for (int k = 0; k < 9; k++)
            raw[k] = (double)((const uint8_t *)level->samples)[rows[k / 3] + columns[k % 3]];
        return 1.0 / 255.0;
    case KNURL_PIXEL_U16:
        for (int k = 0; k < 9; k++)
            raw[k] = (double)((const uint16_t *)level->samples)[rows[k / 3] + columns[k % 3]];
        return 1.0 / 65535.0;
    default:
        for (int k = 0; k < 9; k++)
            raw[k] = (double)((const float *)level->samples)[rows[k / 3] + columns[k % 3]];
        return 1.0;
    }
}

#endif
