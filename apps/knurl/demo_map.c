/* From patterns to image files. */
#include "demo_map.h"

#include "demo_noise.h"
#include "parallel.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct grid {
    const demo_pattern *pattern;
    int32_t columns, rows, color_columns, color_rows;
    float *heights, *means;
    uint16_t *samples;
    uint8_t *colors, *surfaces;
} grid;

enum { ROWS_PER_CHUNK = 8 };

/* Rows of a loop, dealt out to threads: each texel depends on its place only. */
typedef struct row_loop {
    void (*work)(void *user, int32_t row);
    void *user;
    int32_t rows;
} row_loop;

static void do_rows(void *user, size_t chunk)
{
    const row_loop *loop = user;
    int32_t first = (int32_t)chunk * ROWS_PER_CHUNK, end = first + ROWS_PER_CHUNK;
    for (int32_t row = first; row < end && row < loop->rows; row++) loop->work(loop->user, row);
}

static void for_rows(demo_scene *scene, void *user, int32_t rows, void (*work)(void *, int32_t))
{
    row_loop loop = {work, user, rows};
    parallel_chunks((int)knurl_context_threads(scene->context),
                    (size_t)((rows + ROWS_PER_CHUNK - 1) / ROWS_PER_CHUNK), do_rows, &loop);
}

static double texel_place(const demo_pattern *pattern, int32_t i, int32_t count)
{
    return pattern->octahedral && count > 1 ? (double)i / (count - 1) : (i + 0.5) / count;
}

/* The mean over a texel's square: patterns that are finer than the map do not alias. */
static double mean_height(const grid *g, int32_t x, int32_t y, int32_t across)
{
    double sum = 0;
    for (int32_t j = 0; j < across; j++)
        for (int32_t i = 0; i < across; i++)
            sum += g->pattern->height(g->pattern, (x + (i + 0.5) / across) / g->columns,
                                      (y + (j + 0.5) / across) / g->rows);
    return sum / (across * across);
}

static void height_row(void *user, int32_t row)
{
    grid *g = user;
    double v = texel_place(g->pattern, row, g->rows);
    for (int32_t x = 0; x < g->columns; x++) {
        double h = g->pattern->oversample > 1
                       ? mean_height(g, x, row, g->pattern->oversample)
                       : g->pattern->height(g->pattern, texel_place(g->pattern, x, g->columns), v);
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

typedef struct blur_job {
    grid *g;
    float *copy;
} blur_job;

static int32_t blur_radius(const grid *g)
{
    int32_t radius = g->columns / 100, limit = (g->columns < g->rows ? g->columns : g->rows) / 2 - 1;
    if (radius > limit) radius = limit;
    return radius < 0 ? 0 : radius;
}

/* Sums over the 2 * radius + 1 columns around each texel of a row. */
static void blur_row(void *user, int32_t row)
{
    grid *g = user;
    int32_t radius = blur_radius(g);
    const float *in = height_at(g, 0, row);
    float *out = g->means + (size_t)row * (size_t)g->columns;
    double sum = 0;
    for (int32_t i = -radius; i <= radius; i++) sum += (double)in[neighbour(g, i, g->columns)];
    for (int32_t i = 0; i < g->columns; i++) {
        out[i] = (float)sum;
        sum += (double)in[neighbour(g, i + radius + 1, g->columns)] -
               (double)in[neighbour(g, i - radius, g->columns)];
    }
}

enum { BAND = 256 };

/* The same down a band of columns, in place, a row at a time: the rows that leave the window are kept. */
static void blur_band(void *user, size_t band)
{
    const blur_job *job = user;
    grid *g = job->g;
    int32_t radius = blur_radius(g), window = 2 * radius + 1;
    int32_t first = (int32_t)band * BAND, count = g->columns - first < BAND ? g->columns - first : BAND;
    float *column = job->copy + (size_t)band * BAND * (size_t)g->rows;
    double sums[BAND] = {0};
    for (int32_t y = 0; y < g->rows; y++)
        memcpy(column + (size_t)y * BAND, g->means + (size_t)y * (size_t)g->columns + first,
               (size_t)count * sizeof *column);
    for (int32_t y = -radius; y <= radius; y++)
        for (int32_t i = 0; i < count; i++)
            sums[i] += (double)column[(size_t)neighbour(g, y, g->rows) * BAND + (size_t)i];
    for (int32_t y = 0; y < g->rows; y++) {
        float *out = g->means + (size_t)y * (size_t)g->columns + first;
        const float *in = column + (size_t)neighbour(g, y + radius + 1, g->rows) * BAND;
        const float *gone = column + (size_t)neighbour(g, y - radius, g->rows) * BAND;
        for (int32_t i = 0; i < count; i++) {
            out[i] = (float)(sums[i] / ((double)window * window));
            sums[i] += (double)in[i] - (double)gone[i];
        }
    }
}

static bool blur(demo_scene *scene, grid *g)
{
    size_t bands = ((size_t)g->columns + BAND - 1) / BAND;
    blur_job job = {g, malloc(bands * BAND * (size_t)g->rows * sizeof(float))};
    if (!job.copy) return false;
    for_rows(scene, g, g->rows, blur_row);
    parallel_chunks((int)knurl_context_threads(scene->context), bands, blur_band, &job);
    free(job.copy);
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

static void color_row(void *user, int32_t row)
{
    grid *g = user;
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

/* One image file, written while other work goes on. */
typedef struct save_job {
    demo_scene *scene;
    char path[4096];
    int32_t columns, rows;
    int channels;
    knurl_pixel_format format;
    const void *samples;
    knurl_status status;
    knurl_error error;
} save_job;

static void save_image(save_job *job)
{
    knurl_context *context = job->scene->context;
    knurl_image *image = NULL;
    job->status = knurl_image_create(context, job->columns, job->rows, job->channels, job->format,
                                     job->samples, &image, &job->error);
    if (job->status == KNURL_OK) job->status = knurl_image_save(context, image, job->path, &job->error);
    knurl_image_release(image);
}

static void *save_thread(void *argument)
{
    save_image(argument);
    return NULL;
}

static void save_done(save_job *job)
{
    if (job->status != KNURL_OK) demo_scene_fail(job->scene, job->status, "%s", job->error.message);
}

static save_job save_begin(demo_scene *scene, const char *file, int32_t columns, int32_t rows, int channels,
                           knurl_pixel_format format, const void *samples)
{
    save_job job = {.scene = scene,
                    .columns = columns,
                    .rows = rows,
                    .channels = channels,
                    .format = format,
                    .samples = samples};
    demo_scene_path(scene, file, job.path, sizeof job.path);
    return job;
}

static void save_each(void *jobs, size_t i)
{
    save_image((save_job *)jobs + i);
}

static void write_colors(demo_scene *scene, grid *g, const demo_maps *maps)
{
    if (!blur(scene, g)) {
        demo_scene_fail(scene, KNURL_ERROR_MEMORY, "out of memory for %s", maps->color);
        return;
    }
    for_rows(scene, g, g->color_rows, color_row);
    save_job jobs[2] = {
        save_begin(scene, maps->color, g->color_columns, g->color_rows, g->pattern->alpha ? 4 : 3,
                   KNURL_PIXEL_U8, g->colors),
        save_begin(scene, maps->surface, g->color_columns, g->color_rows, 3, KNURL_PIXEL_U8, g->surfaces)};
    if (scene->status != KNURL_OK) return;
    parallel_chunks((int)knurl_context_threads(scene->context), 2, save_each, jobs);
    for (int i = 0; i < 2; i++) save_done(&jobs[i]);
}

/* Compressing the heights is one thread's work: colours are made meanwhile. */
static void write_grid(demo_scene *scene, grid *g, const demo_maps *maps)
{
    size_t count = (size_t)g->columns * (size_t)g->rows;
    for_rows(scene, g, g->rows, height_row);
    if (g->pattern->octahedral) fold_border(g);
    for (size_t i = 0; i < count; i++) g->samples[i] = (uint16_t)((double)g->heights[i] * 65535 + 0.5);
    scene->texels += count;
    save_job heights = save_begin(scene, maps->height, g->columns, g->rows, 1, KNURL_PIXEL_U16, g->samples);
    if (scene->status != KNURL_OK) return;
    pthread_t thread;
    bool beside = pthread_create(&thread, NULL, save_thread, &heights) == 0;
    if (!beside) save_image(&heights);
    if (g->pattern->shade) write_colors(scene, g, maps);
    if (beside) pthread_join(thread, NULL);
    save_done(&heights);
}

/* --size sets the longer side, --map-size limits it; the other keeps the pattern's shape. */
static void choose_size(const demo_scene *scene, grid *g)
{
    int32_t longer = g->columns > g->rows ? g->columns : g->rows, wanted = longer;
    if (scene->map_size > 0) wanted = scene->map_size;
    if (scene->map_limit > 0 && scene->map_limit < wanted) wanted = scene->map_limit;
    g->columns = (int32_t)((int64_t)g->columns * wanted / longer);
    g->rows = (int32_t)((int64_t)g->rows * wanted / longer);
    bool full = g->pattern->full_color;
    g->color_columns = full ? g->columns : g->columns / 2;
    g->color_rows = full ? g->rows : g->rows / 2;
}

demo_maps demo_write_maps(demo_scene *scene, const demo_pattern *pattern, const char *stem)
{
    demo_maps maps;
    (void)snprintf(maps.height, sizeof maps.height, "%.60s-height.png", stem);
    (void)snprintf(maps.color, sizeof maps.color, "%.60s-color.png", stem);
    (void)snprintf(maps.surface, sizeof maps.surface, "%.60s-surface.png", stem);
    if (scene->status != KNURL_OK) return maps;
    grid g = {.pattern = pattern, .columns = pattern->columns, .rows = pattern->rows};
    choose_size(scene, &g);
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

typedef struct sky_image {
    const demo_sky *sky;
    int32_t columns, rows;
    double radius;
    float *samples;
} sky_image;

static void sky_row(void *user, int32_t y)
{
    const sky_image *image = user;
    const demo_sky *sky = image->sky;
    double polar = (y + 0.5) / image->rows * DEMO_PI, radius = image->radius;
    for (int32_t x = 0; x < image->columns; x++) {
        /* u = 0.5 looks along -z, u grows to the right. */
        double turn = ((x + 0.5) / image->columns - 0.5) * 2 * DEMO_PI, radiance[3];
        double d[3] = {sin(polar) * sin(turn), cos(polar), -sin(polar) * cos(turn)};
        sky_radiance(sky, d, radiance);
        double facing = d[0] * sky->sun[0] + d[1] * sky->sun[1] + d[2] * sky->sun[2];
        double angle = acos(demo_clamp(facing, -1, 1)), solid = 2 * DEMO_PI * (1 - cos(radius));
        double disc = demo_step(1.1 * radius, 0.9 * radius, angle) / solid;
        float *out = image->samples + 3 * ((size_t)y * (size_t)image->columns + (size_t)x);
        for (int k = 0; k < 3; k++) out[k] = (float)(radiance[k] + disc * sky->sun_irradiance[k]);
    }
}

void demo_write_sky(demo_scene *scene, const demo_sky *sky, const char *file)
{
    if (scene->status != KNURL_OK) return;
    int32_t columns = scene->map_size > 0 && scene->map_size < 1024 ? scene->map_size : 1024;
    if (scene->map_limit > 0 && scene->map_limit < columns) columns = scene->map_limit;
    sky_image image = {.sky = sky, .columns = columns, .rows = columns / 2};
    image.radius = fmax(sky->sun_radius * DEMO_PI / 180, 1.5 * DEMO_PI / image.rows);
    image.samples = malloc((size_t)columns * (size_t)image.rows * 3 * sizeof *image.samples);
    if (!image.samples) {
        demo_scene_fail(scene, KNURL_ERROR_MEMORY, "out of memory for %s", file);
        return;
    }
    for_rows(scene, &image, image.rows, sky_row);
    save_job job = save_begin(scene, file, columns, image.rows, 3, KNURL_PIXEL_F32, image.samples);
    if (scene->status == KNURL_OK) {
        save_image(&job);
        save_done(&job);
    }
    free(image.samples);
}
