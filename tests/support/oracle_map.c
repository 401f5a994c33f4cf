/* support/oracle_map.c: the oracle's own map: samples, wrap, pyramid, reconstruction. */
#include "oracle_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Unscaled codes of integer maps are exact in double; so are their weighted sums below. */
static double code_of(const oracle_def *def, size_t i)
{
    if (!def->samples) return 0.0;
    switch (def->format) {
    case ORACLE_U8:
        return (double)((const uint8_t *)def->samples)[i];
    case ORACLE_U16:
        return (double)((const uint16_t *)def->samples)[i];
    default:
        return (double)((const float *)def->samples)[i];
    }
}

/* Overlap of [i * n, (i + 1) * n) with [x * m, (x + 1) * m): the weight of sample x of n in sample i
 * of m, in units of 1 / n. */
static int64_t overlap(int64_t i, int64_t n, int64_t x, int64_t m)
{
    int64_t low = i * n > x * m ? i * n : x * m;
    int64_t high = (i + 1) * n < (x + 1) * m ? (i + 1) * n : (x + 1) * m;
    return high > low ? high - low : 0;
}

static bool halve(const oracle_level *fine, oracle_level *coarse, bool integer)
{
    int64_t w = fine->width, h = fine->height;
    int64_t cw = w > 1 ? w / 2 : 1, ch = h > 1 ? h / 2 : 1;
    coarse->width = (int32_t)cw;
    coarse->height = (int32_t)ch;
    coarse->values = malloc((size_t)(cw * ch) * sizeof(double));
    if (!coarse->values) return false;
    for (int64_t j = 0; j < ch; j++) {
        for (int64_t i = 0; i < cw; i++) {
            double sum = 0.0;
            for (int64_t y = j * h / ch; y < h && y * ch < (j + 1) * h; y++) {
                for (int64_t x = i * w / cw; x < w && x * cw < (i + 1) * w; x++)
                    sum += (double)(overlap(i, w, x, cw) * overlap(j, h, y, ch)) * fine->values[y * w + x];
            }
            double total = (double)(w * h);
            double *value = &coarse->values[j * cw + i];
            if (integer) /* sum and total are whole numbers: round half up without an error */
                *value = floor((2.0 * sum + total) / (2.0 * total));
            else
                *value = oracle_round_float(sum / total);
        }
    }
    return true;
}

static bool finish_level(oracle_level *out, const oracle_level *in, double scale)
{
    size_t count = (size_t)in->width * (size_t)in->height;
    *out = *in;
    out->values = malloc(count * sizeof(double));
    if (!out->values) return false;
    out->lowest = INFINITY;
    out->highest = -INFINITY;
    for (size_t i = 0; i < count; i++) {
        double value = in->values[i] / scale;
        out->values[i] = value;
        out->lowest = fmin(out->lowest, value);
        out->highest = fmax(out->highest, value);
    }
    return true;
}

static bool build_pyramid(oracle_level *pyramid, int *count, const oracle_def *def)
{
    size_t samples = (size_t)def->width * (size_t)def->height;
    pyramid[0].width = def->width;
    pyramid[0].height = def->height;
    pyramid[0].values = malloc(samples * sizeof(double));
    *count = 1;
    if (!pyramid[0].values) return false;
    /* 8-bit codes times 257 are the same values as 16-bit codes. */
    double to16 = def->format == ORACLE_U8 ? 257.0 : 1.0;
    for (size_t i = 0; i < samples; i++) pyramid[0].values[i] = to16 * code_of(def, i);
    while (pyramid[*count - 1].width > 1 || pyramid[*count - 1].height > 1) {
        if (!halve(&pyramid[*count - 1], &pyramid[*count], def->format != ORACLE_F32)) return false;
        *count += 1;
    }
    return true;
}

bool oracle_map_build(oracle_map *map, const oracle_def *def)
{
    memset(map, 0, sizeof *map);
    oracle_level pyramid[ORACLE_LEVELS];
    memset(pyramid, 0, sizeof pyramid);
    int count = 0;
    bool ok = build_pyramid(pyramid, &count, def);
    if (ok) {
        double lod = fmin(fmax(def->lod, 0.0), (double)(count - 1));
        int first = (int)floor(lod);
        double fraction = lod - floor(lod);
        double scale = def->format == ORACLE_F32 ? 1.0 : 65535.0;
        map->levels = fraction > 0.0 ? 2 : 1;
        map->weight[0] = (1.0 - fraction) * def->factor;
        map->weight[1] = fraction * def->factor;
        map->offset = def->offset;
        map->wrap_u = def->wrap_u;
        map->wrap_v = def->wrap_v;
        for (int i = 0; i < map->levels && ok; i++)
            ok = finish_level(&map->level[i], &pyramid[first + i], scale);
    }
    for (int i = 0; i < ORACLE_LEVELS; i++) free(pyramid[i].values);
    return ok;
}

void oracle_map_free(oracle_map *map)
{
    free(map->level[0].values);
    free(map->level[1].values);
}

static int64_t wrap_index(int64_t i, int64_t n, oracle_wrap wrap)
{
    switch (wrap) {
    case ORACLE_CLAMP:
        return i < 0 ? 0 : i >= n ? n - 1 : i;
    case ORACLE_MIRROR: {
        int64_t turn = i >= 0 ? i / n : -((-i + n - 1) / n);
        int64_t rest = i - turn * n;
        return (turn & 1) != 0 ? n - 1 - rest : rest;
    }
    default: {
        int64_t rest = i % n;
        return rest < 0 ? rest + n : rest;
    }
    }
}

double oracle_map_sample(const oracle_map *map, int level, int64_t x, int64_t y)
{
    const oracle_level *l = &map->level[level];
    return l->values[wrap_index(y, l->height, map->wrap_v) * l->width + wrap_index(x, l->width, map->wrap_u)];
}

double oracle_map_height(const oracle_map *map, double u, double v)
{
    double sum = map->offset;
    for (int i = 0; i < map->levels; i++) {
        double x = u * map->level[i].width - 0.5, y = v * map->level[i].height - 0.5;
        double fx = floor(x), fy = floor(y);
        int64_t ix = (int64_t)fx, iy = (int64_t)fy;
        double sx = x - fx, sy = y - fy;
        double bottom =
            (1.0 - sx) * oracle_map_sample(map, i, ix, iy) + sx * oracle_map_sample(map, i, ix + 1, iy);
        double top = (1.0 - sx) * oracle_map_sample(map, i, ix, iy + 1) +
                     sx * oracle_map_sample(map, i, ix + 1, iy + 1);
        sum += map->weight[i] * ((1.0 - sy) * bottom + sy * top);
    }
    return sum;
}

void oracle_map_range(const oracle_map *map, int level, int64_t x0, int64_t y0, int64_t x1, int64_t y1,
                      double *lowest, double *highest)
{
    const oracle_level *l = &map->level[level];
    *lowest = l->lowest;
    *highest = l->highest;
    /* The whole map's range serves for anything large. */
    if (x1 - x0 >= l->width && y1 - y0 >= l->height) return;
    if ((x1 - x0 + 1) * (y1 - y0 + 1) > 4096) return;
    *lowest = INFINITY;
    *highest = -INFINITY;
    for (int64_t y = y0; y <= y1; y++) {
        for (int64_t x = x0; x <= x1; x++) {
            double value = oracle_map_sample(map, level, x, y);
            *lowest = fmin(*lowest, value);
            *highest = fmax(*highest, value);
        }
    }
}
