/* Dilation and erosion by sliding windows along rows, then along columns (van Herk 1992; Gil and Werman
 * 1993): three comparisons per texel and axis however large the box is. An erosion is the dilation of the map
 * upside down. */
#include "methods/empty_skip/zones.h"

#include <string.h>

enum { LANES = 32 }; /* columns filtered together */

typedef struct zone_job {
    const shell_space *space;
    zone_map *map;
    uint8_t *source, *rows; /* quantised samples; the same after the pass along rows */
    int channel;
    bool erosion;
    atomic_bool failed;
} zone_job;

/* Samples on each side that the bilinear signal reads, over a texel of half a unit each way and delta more;
 * with room for the rounding of positions. */
static int32_t reach(double size, int32_t texels)
{
    return (int32_t)ceil(size * (double)texels + 0.51);
}

static void quantise_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    const zone_job *job = user;
    const knurl_heightmap *map = job->space->map;
    const height_level *level = &map->levels[0];
    double range = map->range_max - map->range_min, scale = range > 0.0 ? 255.0 / range : 0.0;
    (void)thread;
    for (size_t y = begin; y < end; y++)
        for (int32_t x = 0; x < level->width; x++) {
            double q = (height_fetch(level, x, (int32_t)y) - map->range_min) * scale;
            /* Up for the dilation, down for the erosion, which is kept upside down. */
            double rounded = job->erosion ? 255.0 - floor_d(max_d(q, 0.0)) : ceil_d(q);
            job->source[y * (size_t)level->width + (size_t)x] = (uint8_t)min_d(max_d(rounded, 0.0), 255.0);
        }
}

static uint8_t larger(uint8_t a, uint8_t b)
{
    return a > b ? a : b;
}

/* out[i] = max of in[i .. i + window - 1], i in [0, count), each entry of `lanes` bytes; in has count +
 * window - 1 entries, as have the two scratch arrays. */
static void slide(const uint8_t *in, uint8_t *prefix, uint8_t *suffix, uint8_t *out, size_t count,
                  size_t window, size_t lanes)
{
    size_t length = count + window - 1;
    memcpy(prefix, in, length * lanes);
    memcpy(suffix, in, length * lanes);
    for (size_t k = 1; k < length; k++) {
        if (k % window == 0) continue;
        uint8_t *at = prefix + k * lanes;
        for (size_t l = 0; l < lanes; l++) at[l] = larger(at[l], at[l - lanes]);
    }
    for (size_t k = length - 1; k-- > 0;) {
        if (k % window == window - 1) continue;
        uint8_t *at = suffix + k * lanes;
        for (size_t l = 0; l < lanes; l++) at[l] = larger(at[l], at[l + lanes]);
    }
    for (size_t i = 0; i < count; i++)
        for (size_t l = 0; l < lanes; l++)
            out[i * lanes + l] = larger(suffix[i * lanes + l], prefix[(i + window - 1) * lanes + l]);
}

/* Input, prefix, suffix and output of slide(), in one block. */
static uint8_t *scratch_alloc(zone_job *job, size_t length, size_t lanes)
{
    uint8_t *block = knurl_alloc_array(job->space->context, 4 * length, lanes);
    if (!block) atomic_store(&job->failed, true);
    return block;
}

static void filter_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    zone_job *job = user;
    int32_t width = job->map->width, r = reach(ZONE_SIZES[job->channel], width);
    size_t window = 2 * (size_t)r + 1, length = (size_t)width + window - 1;
    uint8_t *in = scratch_alloc(job, length, 1);
    (void)thread;
    if (!in) return;
    for (size_t y = begin; y < end; y++) {
        const uint8_t *from = job->source + y * (size_t)width;
        for (size_t k = 0; k < length; k++)
            in[k] = from[height_wrap((int64_t)k - r, width, job->space->wrap_u)];
        slide(in, in + length, in + 2 * length, job->rows + y * (size_t)width, (size_t)width, window, 1);
    }
    knurl_free(job->space->context, in);
}

static void store_columns(const zone_job *job, const uint8_t *out, size_t x0, size_t lanes)
{
    for (size_t y = 0; y < (size_t)job->map->height; y++)
        for (size_t l = 0; l < lanes; l++) {
            zone_texel *texel = &job->map->texels[y * (size_t)job->map->width + x0 + l];
            uint8_t value = out[y * lanes + l];
            if (job->erosion)
                texel->erosion[job->channel] = (uint8_t)(255 - value);
            else
                texel->dilation[job->channel] = value;
        }
}

/* Columns [begin, end), at most LANES of them. */
static void filter_columns(void *user, size_t begin, size_t end, int32_t thread)
{
    zone_job *job = user;
    int32_t height = job->map->height, r = reach(ZONE_SIZES[job->channel], height);
    size_t window = 2 * (size_t)r + 1, length = (size_t)height + window - 1, lanes = end - begin;
    uint8_t *in = scratch_alloc(job, length, lanes);
    (void)thread;
    if (!in) return;
    for (size_t k = 0; k < length; k++) {
        size_t y = (size_t)height_wrap((int64_t)k - r, height, job->space->wrap_v);
        memcpy(in + k * lanes, job->rows + y * (size_t)job->map->width + begin, lanes);
    }
    uint8_t *out = in + 3 * length * lanes;
    slide(in, in + length * lanes, in + 2 * length * lanes, out, (size_t)height, window, lanes);
    store_columns(job, out, begin, lanes);
    knurl_free(job->space->context, in);
}

static void filter_all(zone_job *job)
{
    knurl_context *context = job->space->context;
    size_t width = (size_t)job->map->width, height = (size_t)job->map->height;
    for (int pass = 0; pass < 2; pass++) {
        job->erosion = pass == 1;
        knurl_parallel_for(context, height, 16, quantise_rows, job);
        for (job->channel = 0; job->channel < ZONE_CHANNELS; job->channel++) {
            knurl_parallel_for(context, height, 16, filter_rows, job);
            knurl_parallel_for(context, width, LANES, filter_columns, job);
        }
    }
}

knurl_status zone_map_make(const shell_space *space, zone_map *map, knurl_error *error)
{
    const height_level *level = &space->map->levels[0];
    size_t count = (size_t)level->width * (size_t)level->height;
    *map = (zone_map){.width = level->width, .height = level->height};
    zone_job job = {.space = space, .map = map};
    atomic_init(&job.failed, false);
    map->texels = knurl_alloc_array(space->context, count, sizeof *map->texels);
    job.source = knurl_alloc(space->context, count);
    job.rows = knurl_alloc(space->context, count);
    if (map->texels && job.source && job.rows)
        filter_all(&job);
    else
        atomic_store(&job.failed, true);
    knurl_free(space->context, job.source);
    knurl_free(space->context, job.rows);
    if (!atomic_load(&job.failed)) return KNURL_OK;
    zone_map_free(space->context, map);
    return knurl_fail_memory(error, count * (sizeof *map->texels + 2), "dilation and erosion maps");
}

void zone_map_free(knurl_context *context, zone_map *map)
{
    knurl_free(context, map->texels);
    map->texels = NULL;
}
