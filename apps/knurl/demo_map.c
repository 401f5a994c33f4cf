/* From patterns to image files. */
#include "demo_map.h"

#include "demo_noise.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct grid {
    const demo_pattern *pattern;
    int32_t columns, rows, color_columns, color_rows;
    float *heights, *means;
    uint16_t *samples;
    uint8_t *colors, *surfaces;
} grid;

/* Rows of a loop, dealt out to threads: each texel depends on its place only. */
typedef struct row_loop {
    void (*work)(grid *g, int32_t row);
    grid *g;
    int32_t rows;
    atomic_int next;
} row_loop;

static void *row_worker(void *argument)
{
    row_loop *loop = argument;
    for (int32_t row; (row = atomic_fetch_add(&loop->next, 1)) < loop->rows;) loop->work(loop->g, row);
    return NULL;
}

static void for_rows(demo_scene *scene, grid *g, int32_t rows, void (*work)(grid *, int32_t))
{
    enum { MAX_THREADS = 64 };
    row_loop loop = {.work = work, .g = g, .rows = rows};
    atomic_init(&loop.next, 0);
    pthread_t threads[MAX_THREADS];
    int started = 0, wanted = (int)knurl_context_threads(scene->context) - 1;
    while (started < wanted && started < MAX_THREADS &&
           !pthread_create(&threads[started], NULL, row_worker, &loop))
        started++;
    row_worker(&loop);
    for (int i = 0; i < started; i++) pthread_join(threads[i], NULL);
}

static double texel_place(const demo_pattern *pattern, int32_t i, int32_t count)
{
    return pattern->octahedral && count > 1 ? (double)i / (count - 1) : (i + 0.5) / count;
}

static void height_row(grid *g, int32_t row)
{
    double v = texel_place(g->pattern, row, g->rows);
    for (int32_t x = 0; x < g->columns; x++) {
        double h = g->pattern->height(g->pattern, texel_place(g->pattern, x, g->columns), v);
        g->heights[(size_t)row * (size_t)g->columns + (size_t)x] = (float)demo_clamp(h, 0, 1);
    }
}

static float *height_at(const grid *g, int32_t x, int32_t y)
{
    return &g->heights[(size_t)y * (size_t)g->columns + (size_t)x];
}

/* The chart's border folds: (0, v) is (0, 1 - v). Noise agrees there up to rounding, texels must
 * agree exactly. */
static void fold_border(grid *g)
{
    int32_t last_x = g->columns - 1, last_y = g->rows - 1;
    for (int32_t i = 0; i <= last_y / 2; i++) {
        *height_at(g, 0, last_y - i) = *height_at(g, 0, i);
        *height_at(g, last_x, last_y - i) = *height_at(g, last_x, i);
    }
    for (int32_t i = 0; i <= last_x / 2; i++) {
        *height_at(g, last_x - i, 0) = *height_at(g, i, 0);
        *height_at(g, last_x - i, last_y) = *height_at(g, i, last_y);
    }
    *height_at(g, last_x, last_y) = *height_at(g, last_x, 0) = *height_at(g, 0, last_y) = *height_at(g, 0, 0);
}

static int32_t neighbour(const grid *g, int32_t i, int32_t count)
{
    if (g->pattern->octahedral) return i < 0 ? 0 : i >= count ? count - 1 : i;
    return i < 0 ? i + count : i >= count ? i - count : i;
}

/* Running mean of 2 * radius + 1 values at a stride. */
static void blur_line(const grid *g, const float *in, float *out, int32_t count, size_t stride,
                      int32_t radius)
{
    double sum = 0;
    for (int32_t i = -radius; i <= radius; i++) sum += (double)in[(size_t)neighbour(g, i, count) * stride];
    for (int32_t i = 0; i < count; i++) {
        out[(size_t)i * stride] = (float)(sum / (2 * radius + 1));
        sum += (double)in[(size_t)neighbour(g, i + radius + 1, count) * stride] -
               (double)in[(size_t)neighbour(g, i - radius, count) * stride];
    }
}

static bool blur(grid *g)
{
    int32_t radius = g->columns / 100, limit = (g->columns < g->rows ? g->columns : g->rows) / 2 - 1;
    if (radius > limit) radius = limit;
    if (radius < 0) radius = 0;
    size_t columns = (size_t)g->columns;
    float *half = malloc(columns * (size_t)g->rows * sizeof *half);
    if (!half) return false;
    for (int32_t y = 0; y < g->rows; y++)
        blur_line(g, g->heights + (size_t)y * columns, half + (size_t)y * columns, g->columns, 1, radius);
    for (int32_t x = 0; x < g->columns; x++) blur_line(g, half + x, g->means + x, g->rows, columns, radius);
    free(half);
    return true;
}

static uint8_t byte(double x)
{
    return (uint8_t)(demo_clamp(x, 0, 1) * 255 + 0.5);
}

static uint8_t srgb_byte(double x)
{
    return byte(x <= 0.0031308 ? 12.92 * x : 1.055 * pow(demo_clamp(x, 0, 1), 1 / 2.4) - 0.055);
}

static void color_row(grid *g, int32_t row)
{
    const demo_pattern *pattern = g->pattern;
    int channels = pattern->alpha ? 4 : 3;
    int32_t y = (int32_t)((row + 0.5) * g->rows / g->color_rows);
    for (int32_t i = 0; i < g->color_columns; i++) {
        int32_t x = (int32_t)((i + 0.5) * g->columns / g->color_columns);
        int32_t left = neighbour(g, x - 1, g->columns), right = neighbour(g, x + 1, g->columns);
        int32_t up = neighbour(g, y - 1, g->rows), down = neighbour(g, y + 1, g->rows);
        double h = (double)*height_at(g, x, y);
        demo_relief relief = {
            .height = h,
            .du = ((double)*height_at(g, right, y) - (double)*height_at(g, left, y)) * 0.5 * g->columns,
            .dv = ((double)*height_at(g, x, down) - (double)*height_at(g, x, up)) * 0.5 * g->rows,
            .cavity = h - (double)g->means[(size_t)y * (size_t)g->columns + (size_t)x],
        };
        demo_texel texel = {.color = {0.5, 0.5, 0.5}, .alpha = 1, .roughness = 1};
        double u = texel_place(pattern, i, g->color_columns), v = texel_place(pattern, row, g->color_rows);
        pattern->shade(pattern, u, v, &relief, &texel);
        size_t at = (size_t)row * (size_t)g->color_columns + (size_t)i;
        for (int k = 0; k < 3; k++) g->colors[at * (size_t)channels + (size_t)k] = srgb_byte(texel.color[k]);
        if (pattern->alpha) g->colors[at * 4 + 3] = byte(texel.alpha);
        g->surfaces[at * 3] = 255;
        g->surfaces[at * 3 + 1] = byte(texel.roughness);
        g->surfaces[at * 3 + 2] = byte(texel.metallic);
    }
}

static void save(demo_scene *scene, const char *file, int32_t columns, int32_t rows, int channels,
                 knurl_pixel_format format, const void *samples)
{
    char path[4096];
    demo_scene_path(scene, file, path, sizeof path);
    if (scene->status != KNURL_OK) return;
    knurl_image *image = NULL;
    scene->status =
        knurl_image_create(scene->context, columns, rows, channels, format, samples, &image, scene->error);
    if (scene->status == KNURL_OK)
        scene->status = knurl_image_save(scene->context, image, path, scene->error);
    knurl_image_release(image);
}

static void write_grid(demo_scene *scene, grid *g, const demo_maps *maps)
{
    size_t count = (size_t)g->columns * (size_t)g->rows;
    for_rows(scene, g, g->rows, height_row);
    if (g->pattern->octahedral) fold_border(g);
    for (size_t i = 0; i < count; i++) g->samples[i] = (uint16_t)((double)g->heights[i] * 65535 + 0.5);
    save(scene, maps->height, g->columns, g->rows, 1, KNURL_PIXEL_U16, g->samples);
    scene->texels += count;
    if (!g->pattern->shade || scene->status != KNURL_OK) return;
    if (!blur(g)) {
        demo_scene_fail(scene, KNURL_ERROR_MEMORY, "out of memory for %s", maps->color);
        return;
    }
    for_rows(scene, g, g->color_rows, color_row);
    save(scene, maps->color, g->color_columns, g->color_rows, g->pattern->alpha ? 4 : 3, KNURL_PIXEL_U8,
         g->colors);
    save(scene, maps->surface, g->color_columns, g->color_rows, 3, KNURL_PIXEL_U8, g->surfaces);
}

demo_maps demo_write_maps(demo_scene *scene, const demo_pattern *pattern, const char *stem)
{
    demo_maps maps;
    (void)snprintf(maps.height, sizeof maps.height, "%.60s-height.png", stem);
    (void)snprintf(maps.color, sizeof maps.color, "%.60s-color.png", stem);
    (void)snprintf(maps.surface, sizeof maps.surface, "%.60s-surface.png", stem);
    if (scene->status != KNURL_OK) return maps;
    grid g = {.pattern = pattern, .columns = pattern->columns, .rows = pattern->rows};
    if (scene->map_size > 0) {
        /* --size is the longer side; the other keeps the pattern's shape. */
        int32_t longer = g.columns > g.rows ? g.columns : g.rows;
        g.columns = (int32_t)((int64_t)g.columns * scene->map_size / longer);
        g.rows = (int32_t)((int64_t)g.rows * scene->map_size / longer);
    }
    g.color_columns = g.columns / 2;
    g.color_rows = g.rows / 2;
    size_t count = (size_t)g.columns * (size_t)g.rows,
           color_count = (size_t)g.color_columns * (size_t)g.color_rows;
    g.heights = malloc(count * sizeof *g.heights);
    g.means = malloc(count * sizeof *g.means);
    g.samples = malloc(count * sizeof *g.samples);
    g.colors = malloc(color_count * 4);
    g.surfaces = malloc(color_count * 3);
    if (g.heights && g.means && g.samples && g.colors && g.surfaces)
        write_grid(scene, &g, &maps);
    else
        demo_scene_fail(scene, KNURL_ERROR_MEMORY, "out of memory for %s of %d x %d texels", maps.height,
                        (int)g.columns, (int)g.rows);
    free(g.heights);
    free(g.means);
    free(g.samples);
    free(g.colors);
    free(g.surfaces);
    return maps;
}

void demo_use_maps(demo_material *material, const demo_maps *maps)
{
    material->height_map = maps->height;
    material->color_map = maps->color;
    material->surface_map = maps->surface;
    material->roughness = 1;
    material->metallic = 1; /* the map decides */
}

/* Radiance of the sky without the sun's disc. */
static void sky_radiance(const demo_sky *sky, const double d[3], double out[3])
{
    double up = d[1], facing = d[0] * sky->sun[0] + d[1] * sky->sun[1] + d[2] * sky->sun[2];
    for (int k = 0; k < 3; k++) out[k] = sky->horizon[k];
    if (up < 0) {
        demo_mix3(out, sky->ground, demo_step(0, 0.12, -up));
        return;
    }
    demo_mix3(out, sky->zenith, 1 - pow(1 - up, 5));
    double halo = demo_clamp(facing, 0, 1);
    double glow = 0.35 * pow(halo, 6) + 0.9 * pow(halo, 60) + 3 * pow(halo, 900);
    for (int k = 0; k < 3; k++) out[k] += glow * sky->glow[k];
    if (sky->clouds > 0) {
        /* A flat layer, seen in perspective; it thins out towards the horizon. */
        double plane[3] = {1.7 * d[0] / (up + 0.12), 0.5, 2.6 * d[2] / (up + 0.12)};
        double noise = 0.5 + 0.75 * demo_fbm3(plane, 6, 0.55, sky->seed);
        double cover = demo_step(1 - sky->clouds, 1.35 - sky->clouds, noise) * demo_step(0.01, 0.10, up);
        double light = 0.75 + 0.9 * glow,
               thick = 1 - 0.35 * demo_step(1.1 - sky->clouds, 1.6 - sky->clouds, noise);
        double cloud[3];
        for (int k = 0; k < 3; k++) cloud[k] = sky->cloud_color[k] * light * thick;
        demo_mix3(out, cloud, 0.8 * cover);
    }
    if (sky->stars > 0) {
        double q[3] = {150 * d[0], 150 * d[1], 150 * d[2]};
        int32_t cell[3] = {(int32_t)floor(q[0]), (int32_t)floor(q[1]), (int32_t)floor(q[2])};
        double chance = demo_random(cell[0], cell[1], cell[2], sky->seed);
        double dust =
            demo_clamp(0.5 + demo_fbm3((double[3]){3 * d[0], 3 * d[1], 3 * d[2]}, 5, 0.6, sky->seed), 0, 1);
        if (chance < 0.012 * dust) {
            double power = sky->stars * pow(chance / 0.012, 4),
                   warm = demo_random(cell[0], cell[1], cell[2], 5);
            out[0] += power * (0.7 + 0.3 * warm);
            out[1] += power * 0.85;
            out[2] += power * (1 - 0.3 * warm);
        }
    }
}

void demo_write_sky(demo_scene *scene, const demo_sky *sky, const char *file)
{
    if (scene->status != KNURL_OK) return;
    int32_t columns = scene->map_size > 0 && scene->map_size < 1024 ? scene->map_size : 1024,
            rows = columns / 2;
    float *samples = malloc((size_t)columns * (size_t)rows * 3 * sizeof *samples);
    if (!samples) {
        demo_scene_fail(scene, KNURL_ERROR_MEMORY, "out of memory for %s", file);
        return;
    }
    double radius = fmax(sky->sun_radius * DEMO_PI / 180, 1.5 * DEMO_PI / rows);
    for (int32_t y = 0; y < rows; y++) {
        double polar = (y + 0.5) / rows * DEMO_PI;
        for (int32_t x = 0; x < columns; x++) {
            /* u = 0.5 looks along -z, u grows to the right. */
            double turn = ((x + 0.5) / columns - 0.5) * 2 * DEMO_PI, radiance[3];
            double d[3] = {sin(polar) * sin(turn), cos(polar), -sin(polar) * cos(turn)};
            sky_radiance(sky, d, radiance);
            double facing = d[0] * sky->sun[0] + d[1] * sky->sun[1] + d[2] * sky->sun[2];
            double angle = acos(demo_clamp(facing, -1, 1)), solid = 2 * DEMO_PI * (1 - cos(radius));
            double disc = demo_step(1.1 * radius, 0.9 * radius, angle) / solid;
            float *out = samples + 3 * ((size_t)y * (size_t)columns + (size_t)x);
            for (int k = 0; k < 3; k++) out[k] = (float)(radiance[k] + disc * sky->sun_irradiance[k]);
        }
    }
    save(scene, file, columns, rows, 3, KNURL_PIXEL_F32, samples);
    free(samples);
}
