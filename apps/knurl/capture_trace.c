/* capture_trace.c: the rays of one view, and the maps that come of them. */
#include "capture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    BLOCK = 65536,   /* rays traced at a time: bounds memory, and the wait after Ctrl-C */
    MOST_LAYERS = 64 /* holes that a ray passes */
};

/* Rays of a block and what they hit. `live` numbers the rays that are still under way. */
typedef struct ray_block {
    knurl_ray *rays, *next_rays;
    knurl_hit *hits, *next_hits;
    uint32_t *live;
    size_t count;
} ray_block;

static void block_release(ray_block *block)
{
    free(block->rays);
    free(block->next_rays);
    free(block->hits);
    free(block->next_hits);
    free(block->live);
}

static bool block_create(ray_block *block)
{
    *block = (ray_block){.rays = malloc(BLOCK * sizeof(knurl_ray)),
                         .next_rays = malloc(BLOCK * sizeof(knurl_ray)),
                         .hits = malloc(BLOCK * sizeof(knurl_hit)),
                         .next_hits = malloc(BLOCK * sizeof(knurl_hit)),
                         .live = malloc(BLOCK * sizeof(uint32_t))};
    if (block->rays && block->next_rays && block->hits && block->next_hits && block->live) return true;
    block_release(block);
    return false;
}

/* A ray that ends before it starts hits nothing. */
static void add_ray(const capture_job *job, const capture_view *view, double x, double y, ray_block *block)
{
    knurl_ray *ray = &block->rays[block->count++];
    if (!capture_ray(view, x, y, job->box, ray)) {
        ray->tmin = 1;
        ray->tmax = 0;
    }
}

/* Past a hole: beyond what rounding may have put the hit off the surface. */
static void pass_hole(const knurl_hit *hit, knurl_ray *ray)
{
    double cosine = 0, length = 0;
    for (int i = 0; i < 3; i++) {
        cosine += hit->ng[i] * ray->direction[i];
        length += ray->direction[i] * ray->direction[i];
    }
    double slope = fmax(fabs(cosine), 0.01 * sqrt(length));
    ray->tmin = nextafter(hit->t + 2 * hit->error / slope, INFINITY);
}

/* Traces the block; rays go on through holes. */
static int trace_block(capture_job *job, ray_block *block)
{
    knurl_error error = {0};
    if (knurl_scene_intersect_batch(job->scene, block->rays, block->count, block->hits, NULL, NULL, NULL,
                                    &error) != KNURL_OK)
        return session_fail(job->session, &error);
    for (size_t i = 0; i < block->count; i++) block->live[i] = (uint32_t)i;
    size_t live = block->count;
    for (int layer = 0; live > 0; layer++) {
        size_t going = 0;
        for (size_t k = 0; k < live; k++) {
            uint32_t i = block->live[k];
            knurl_hit *hit = &block->hits[i];
            if (hit->triangle == KNURL_NO_HIT || !capture_is_hole(job->textures, hit)) continue;
            pass_hole(hit, &block->rays[i]);
            hit->triangle = KNURL_NO_HIT;
            block->next_rays[going] = block->rays[i];
            block->live[going++] = i;
        }
        live = layer < MOST_LAYERS ? going : 0;
        if (live && knurl_scene_intersect_batch(job->scene, block->next_rays, live, block->next_hits, NULL,
                                                NULL, NULL, &error) != KNURL_OK)
            return session_fail(job->session, &error);
        for (size_t k = 0; k < live; k++) block->hits[block->live[k]] = block->next_hits[k];
    }
    job->rays_done += (double)block->count;
    if (!progress_update(&job->session->progress, "capture", fmin(job->rays_done / job->rays_all, 1)))
        return session_fail_with(job->session, CODE_INTERRUPTED, "interrupted; nothing was written");
    return CODE_DONE;
}

static void keep_heights(const capture_view *view, const ray_block *block, size_t first, capture_maps *maps)
{
    for (size_t i = 0; i < block->count; i++) {
        const knurl_hit *hit = &block->hits[i];
        maps->seen[first + i] = hit->triangle != KNURL_NO_HIT;
        if (hit->triangle == KNURL_NO_HIT) continue;
        float height = (float)(view->front - view->base - hit->t);
        maps->heights[first + i] = height;
        maps->low = fmin(maps->low, (double)height);
        maps->high = fmax(maps->high, (double)height);
        maps->hits++;
    }
}

static int trace_heights(capture_job *job, const capture_view *view, ray_block *block, capture_maps *maps)
{
    size_t width = (size_t)view->width, count = width * (size_t)view->height;
    for (size_t first = 0; first < count; first += BLOCK) {
        block->count = 0;
        for (size_t i = first; i < count && i - first < BLOCK; i++)
            add_ray(job, view, (double)(i % width), (double)(i / width), block);
        int code = trace_block(job, block);
        if (code != CODE_DONE) return code;
        keep_heights(view, block, first, maps);
    }
    return CODE_DONE;
}

static void widen(double range[2], double value)
{
    range[0] = fmin(range[0], value);
    range[1] = fmax(range[1], value);
}

static uint8_t to_byte(double value)
{
    return (uint8_t)(255 * value + 0.5);
}

/* One texel from its samples: the mean of what they hit, alpha the fraction that did. */
static void average(const capture_job *job, const knurl_hit *hits, int32_t samples, size_t texel,
                    capture_maps *maps)
{
    double sum[5] = {0}, color[4];
    int32_t covered = 0;
    for (int32_t i = 0; i < samples; i++) {
        if (hits[i].triangle == KNURL_NO_HIT) continue;
        double roughness, metallic;
        capture_base_color(job->textures, &hits[i], color);
        capture_surface(job->textures, &hits[i], &roughness, &metallic);
        for (int c = 0; c < 3; c++) sum[c] += fmin(fmax(color[c], 0), 1);
        sum[3] += roughness;
        sum[4] += metallic;
        widen(maps->roughness, roughness);
        widen(maps->metallic, metallic);
        covered++;
    }
    if (!covered) return;
    uint8_t *out = maps->colors + 4 * texel, *surface = maps->surfaces + 3 * texel;
    for (int c = 0; c < 3; c++) out[c] = to_byte(capture_srgb_encode(sum[c] / covered));
    for (int c = 1; c < 3; c++) surface[c] = to_byte(sum[2 + c] / covered);
    /* A rare hit must not count as empty: empty pieces of the base are left out. */
    out[3] = to_byte((double)covered / samples);
    if (!out[3]) out[3] = 1;
}

static void add_samples(const capture_job *job, const capture_view *view, size_t texel, ray_block *block)
{
    int32_t n = job->options->samples;
    size_t width = (size_t)view->color_width;
    double column = (double)(texel % width), row = (double)(texel / width);
    double step_x = (double)view->width / view->color_width;
    double step_y = (double)view->height / view->color_height;
    for (int32_t k = 0; k < n * n; k++)
        add_ray(job, view, (column + (k % n + 0.5) / n) * step_x - 0.5,
                (row + (k / n + 0.5) / n) * step_y - 0.5, block);
}

static int trace_colors(capture_job *job, const capture_view *view, ray_block *block, capture_maps *maps)
{
    int32_t samples = job->options->samples * job->options->samples;
    size_t count = (size_t)view->color_width * (size_t)view->color_height;
    size_t texels = BLOCK / (size_t)samples;
    for (size_t first = 0; first < count; first += texels) {
        size_t end = count - first < texels ? count : first + texels;
        block->count = 0;
        for (size_t i = first; i < end; i++) add_samples(job, view, i, block);
        int code = trace_block(job, block);
        if (code != CODE_DONE) return code;
        for (size_t i = first; i < end; i++)
            average(job, block->hits + (i - first) * (size_t)samples, samples, i, maps);
    }
    return CODE_DONE;
}

/* Gives texels without a hit the height, and empty ones the colour, of the nearest that has one. */
static bool fill(const capture_view *view, capture_maps *maps)
{
    size_t count = (size_t)view->width * (size_t)view->height;
    uint32_t *nearest = capture_nearest(maps->seen, view->width, view->height);
    for (size_t i = 0; nearest && maps->hits && i < count; i++) maps->heights[i] = maps->heights[nearest[i]];
    bool good = nearest != NULL;
    free(nearest);
    count = (size_t)view->color_width * (size_t)view->color_height;
    uint8_t *covered = malloc(count);
    for (size_t i = 0; covered && i < count; i++) covered[i] = maps->colors[4 * i + 3] > 0;
    nearest = covered ? capture_nearest(covered, view->color_width, view->color_height) : NULL;
    for (size_t i = 0; nearest && i < count; i++) {
        if (nearest[i] == UINT32_MAX || nearest[i] == i) continue;
        memcpy(maps->colors + 4 * i, maps->colors + 4 * (size_t)nearest[i], 3);
        memcpy(maps->surfaces + 3 * i, maps->surfaces + 3 * (size_t)nearest[i], 3);
    }
    good = good && nearest;
    free(nearest);
    free(covered);
    return good;
}

int capture_view_trace(capture_job *job, const capture_view *view, capture_maps *maps)
{
    size_t count = (size_t)view->width * (size_t)view->height;
    size_t color_count = (size_t)view->color_width * (size_t)view->color_height;
    *maps = (capture_maps){.heights = calloc(count, sizeof(float)),
                           .seen = calloc(count, 1),
                           .colors = calloc(color_count, 4),
                           .surfaces = calloc(color_count, 3),
                           .low = INFINITY,
                           .high = -INFINITY,
                           .roughness = {INFINITY, -INFINITY},
                           .metallic = {INFINITY, -INFINITY}};
    ray_block block;
    if (!maps->heights || !maps->seen || !maps->colors || !maps->surfaces || !block_create(&block))
        return session_fail_with(job->session, CODE_LIMIT, "out of memory for the maps");
    int code = trace_heights(job, view, &block, maps);
    if (code == CODE_DONE) code = trace_colors(job, view, &block, maps);
    block_release(&block);
    if (code == CODE_DONE && !fill(view, maps))
        code = session_fail_with(job->session, CODE_LIMIT, "out of memory for the maps");
    return code;
}

void capture_maps_release(capture_maps *maps)
{
    free(maps->heights);
    free(maps->seen);
    free(maps->colors);
    free(maps->surfaces);
    *maps = (capture_maps){0};
}
