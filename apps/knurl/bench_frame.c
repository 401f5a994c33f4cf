/* bench_frame.c: pictures: path-traced frames for the clock, and heat maps of steps. */
#include "bench.h"
#include "heat.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- frames ---- */

typedef struct frame_times {
    double *ms, *mrays; /* [method * rounds + round] */
    double *steps;      /* per method: mean of primary rays */
} frame_times;

static int fail_memory(command_session *session)
{
    return session_fail_with(session, CODE_LIMIT, "out of memory for the pictures");
}

static bool keep_going(void *user, const char *stage, double fraction)
{
    (void)user;
    (void)stage;
    (void)fraction;
    return !signals_stop_requested();
}

/* Tracing and shading, on all threads; reading textures and light is left out. */
static int time_frame(command_session *session, const bench_options *options, int32_t camera,
                      const subject *s, double *ms, double *mrays, double *steps)
{
    knurl_render_def def = knurl_render_def_default();
    def.width = options->frame_width;
    def.height = options->frame_height;
    def.samples = options->frame_samples;
    def.seed = options->seed;
    def.camera = camera;
    def.lod = options->lod;
    def.lod_mode = options->lod > 0 ? KNURL_LOD_FIXED : KNURL_LOD_FINEST;
    def.progress = keep_going;
    knurl_render_result result = {0};
    knurl_error error = {0};
    knurl_status status = knurl_render(s->description, s->scene, &def, &result, &error);
    const knurl_render_stats *stats = &result.stats;
    *ms = 1e3 * stats->seconds;
    *mrays =
        1e-6 * (double)(stats->primary_rays + stats->diffuse_rays + stats->occlusion_rays) / stats->seconds;
    *steps = stats->steps_mean;
    knurl_render_result_release(&result);
    if (status == KNURL_INTERRUPTED) return CODE_INTERRUPTED;
    return status == KNURL_OK ? CODE_DONE : session_fail(session, &error);
}

static int time_rounds(command_session *session, const bench_options *options, int32_t camera,
                       const subject *subjects, const frame_times *times)
{
    int rounds = options->rounds, methods = options->method_count, code = CODE_DONE;
    for (int round = 0; round < rounds; round++) {
        for (int m = 0; m < methods && code == CODE_DONE; m++) {
            double part = (double)(round * methods + m) / (rounds * methods);
            if (!progress_update(&session->progress, "frames", part)) return CODE_INTERRUPTED;
            int at = m * rounds + round;
            if (!subjects[m].failure[0])
                code = time_frame(session, options, camera, &subjects[m], &times->ms[at], &times->mrays[at],
                                  &times->steps[m]);
        }
    }
    return code;
}

static int add_rows(command_session *session, const bench_options *options, const char *path,
                    const subject *subjects, const frame_times *times, bench_results *results)
{
    size_t first = results->row_count, rounds = (size_t)options->rounds;
    for (int m = 0; m < options->method_count; m++) {
        const subject *s = &subjects[m];
        bench_row *row = bench_results_add(results);
        if (!row) return fail_memory(session);
        row->scene = path;
        row->method = s->method;
        row->rays = "frame";
        row->threads = (int)knurl_context_threads(s->context);
        row->count =
            (size_t)options->frame_width * (size_t)options->frame_height * (size_t)options->frame_samples;
        row->build_ms = s->build_ms;
        row->has_memory = !s->failure[0];
        row->memory = s->memory;
        snprintf(row->failure, sizeof row->failure, "%.*s", (int)sizeof row->failure - 1, s->failure);
        if (s->failure[0]) continue;
        row->mrays = spread_of(times->mrays + (size_t)m * rounds, rounds);
        row->frame_ms = spread_of(times->ms + (size_t)m * rounds, rounds).median;
        row->steps.mean = times->steps[m];
    }
    progress_clear(&session->progress);
    bench_table_rows(bench_table_stream(options), results->rows + first, results->row_count - first, false);
    return CODE_DONE;
}

int bench_frames(command_session *session, const bench_options *options, const char *path,
                 const subject *subjects, bench_results *results)
{
    size_t methods = (size_t)options->method_count, all = methods * (size_t)options->rounds;
    frame_times times = {calloc(all, sizeof(double)), calloc(all, sizeof(double)),
                         calloc(methods, sizeof(double))};
    int32_t camera = -1;
    int code = times.ms && times.mrays && times.steps ? CODE_DONE : fail_memory(session);
    if (code == CODE_DONE) code = camera_find(session, subjects[0].description, options->camera, &camera);
    if (code == CODE_DONE) code = time_rounds(session, options, camera, subjects, &times);
    if (code == CODE_DONE) code = add_rows(session, options, path, subjects, &times, results);
    free(times.ms);
    free(times.mrays);
    free(times.steps);
    return code;
}

/* ---- heat maps ---- */

/* "out/steps.png" for scene "a/ball.gltf" and method 2: "out/steps.ball.2.png". */
static char *map_name(const char *path, const char *scene, int method)
{
    const char *slash = strrchr(scene, '/'), *name = slash ? slash + 1 : scene;
    const char *dot = strrchr(name, '.');
    int stem = dot ? (int)(dot - name) : (int)strlen(name);
    size_t size = strlen(path) + strlen(name) + 32;
    char *text = malloc(size);
    int kept = (int)strlen(path) - 4; /* .png */
    if (text) snprintf(text, size, "%.*s.%.*s.%d.png", kept, path, stem, name, method);
    return text;
}

static int save_map(command_session *session, const ray_set *set, const uint32_t *steps, uint32_t highest,
                    const char *file)
{
    uint8_t *colors = malloc(set->count * 3);
    if (!colors) return fail_memory(session);
    double scale = highest > 1 ? 1 / log((double)highest) : 1;
    for (size_t i = 0; i < set->count; i++)
        heat_color(steps[i] > 1 ? log((double)steps[i]) * scale : 0, colors + 3 * (size_t)set->pixels[i]);
    knurl_error error = {0};
    knurl_image *image = NULL;
    knurl_status status = knurl_image_create(session->context, set->width, set->height, 3, KNURL_PIXEL_U8,
                                             colors, &image, &error);
    if (status == KNURL_OK) status = knurl_image_save(session->context, image, file, &error);
    knurl_image_release(image);
    free(colors);
    return status == KNURL_OK ? CODE_DONE : session_fail(session, &error);
}

int heat_maps_save(command_session *session, const bench_options *options, const char *scene,
                   const ray_set *set, uint32_t *const *steps, bench_results *results)
{
    uint32_t highest = 1;
    for (int m = 0; m < options->method_count; m++)
        for (size_t i = 0; steps[m] && i < set->count; i++)
            if (steps[m][i] > highest) highest = steps[m][i];
    heat_map *maps =
        realloc(results->maps, (results->map_count + (size_t)options->method_count) * sizeof *maps);
    if (!maps) return fail_memory(session);
    results->maps = maps;
    int code = CODE_DONE;
    for (int m = 0; m < options->method_count && code == CODE_DONE; m++) {
        if (!steps[m]) continue;
        char *file = map_name(options->heat_map, scene, m);
        if (!file) return fail_memory(session);
        maps[results->map_count++] = (heat_map){file, scene, options->methods[m], 1, highest};
        code = save_map(session, set, steps[m], highest, file);
        if (code == CODE_DONE)
            session_note(session, "knurl: %s: steps of %s, black is 1, white is %u, log scale", file,
                         options->methods[m], (unsigned)highest);
    }
    return code;
}
