/* Rendering: description and scene -> world -> passes of tiles of samples -> film -> images. */
#include "render/film.h"
#include "render/integrator.h"

#include <pthread.h>
#include <string.h>

/* Small tiles and short passes keep threads busy and interrupts quick. */
enum { TILE_SIZE = 16, MAX_PASS_SAMPLES = 16 };

typedef struct render_job {
    const world *world;
    film *film;
    integrator_fn *integrate;
    trace_stats *stats; /* one per thread */
    int32_t tiles_x, tiles_y;
    int32_t first_sample, pass_samples;
    atomic_size_t tiles_done; /* of all passes */
    size_t tiles_total;
    atomic_bool stop;
    pthread_mutex_t progress_lock;
} render_job;

knurl_render_def knurl_render_def_default(void)
{
    return (knurl_render_def){
        .cookie = KNURL_COOKIE,
        .width = 960,
        .height = 540,
        .samples = 64,
        .max_depth = 8,
        .camera = -1,
        .environment_intensity = 1.0,
    };
}

static knurl_status check_sizes(const knurl_render_def *def, knurl_error *error)
{
    if (def->width < 1 || def->width > 65536 || def->height < 1 || def->height > 65536)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "image is %d x %d pixels, expected 1 to 65536 per side", def->width, def->height);
    bool crop = def->crop_width != 0;
    if (crop && (def->crop_x < 0 || def->crop_y < 0 || def->crop_width < 1 || def->crop_height < 1 ||
                 def->crop_x > def->width - def->crop_width || def->crop_y > def->height - def->crop_height))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "crop %d,%d %d x %d is not inside the %d x %d image",
                          def->crop_x, def->crop_y, def->crop_width, def->crop_height, def->width,
                          def->height);
    if (def->samples < 1 || def->samples > 1 << 24)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "samples is %d, expected 1 to %d", def->samples,
                          1 << 24);
    if (def->max_depth < 0 || def->max_depth > 1 << 16)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "max_depth is %d, expected 0 to %d", def->max_depth,
                          1 << 16);
    return KNURL_OK;
}

static knurl_status check_arguments(const knurl_description *d, const knurl_scene *scene,
                                    const knurl_render_def *def, knurl_error *error)
{
    if (!d || !scene) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "description or scene is NULL");
    if (!def || def->cookie != KNURL_COOKIE)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "render definition was not made by knurl_render_def_default()");
    knurl_status status = check_sizes(def, error);
    if (status != KNURL_OK) return status;
    if (def->camera < -1 || (def->camera >= 0 && (uint32_t)def->camera >= d->camera_count))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "camera is %d, the scene has %u", def->camera,
                          d->camera_count);
    if ((int)def->integrator < 0 || def->integrator > KNURL_INTEGRATOR_PRIMARY)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "integrator is %d, expected 0 to %d",
                          (int)def->integrator, KNURL_INTEGRATOR_PRIMARY);
    if ((int)def->lod_mode < 0 || def->lod_mode > KNURL_LOD_FIXED || !(def->lod >= 0.0))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "lod mode %d with lod %g, expected modes 0 to 2, lod >= 0", (int)def->lod_mode,
                          def->lod);
    if (!(def->environment_intensity >= 0.0) || !isfinite(def->environment_intensity) ||
        !isfinite(def->environment_rotation))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "environment intensity %g, rotation %g: not finite or negative",
                          def->environment_intensity, def->environment_rotation);
    if (!(def->clamp >= 0.0) || !(def->ao_distance >= 0.0))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "clamp %g, ao_distance %g: expected >= 0", def->clamp,
                          def->ao_distance);
    if (knurl_scene_object_count(scene) != d->mesh_count ||
        knurl_scene_instance_count(scene) != d->instance_count)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "scene has %u objects and %u instances, its description %u and %u",
                          knurl_scene_object_count(scene), knurl_scene_instance_count(scene), d->mesh_count,
                          d->instance_count);
    return KNURL_OK;
}

static knurl_ray camera_ray(const world *w, double x, double y, double u, double v)
{
    knurl_ray ray = camera_make_ray(&w->camera, x, y, u, v);
    ray.lod = w->fixed_lod;
    if (!w->auto_lod) ray.cone_width = ray.cone_spread = 0.0f;
    return ray;
}

static void add3(double *pixel, int32_t offset, vec3 value)
{
    if (offset < 0) return;
    pixel[offset] += value.x;
    pixel[offset + 1] += value.y;
    pixel[offset + 2] += value.z;
}

enum { DEPTH, POSITION, GEOMETRIC_NORMAL, SHADING_NORMAL, ALBEDO, UV, OBJECT, TRIANGLE, STEPS };

/* AOVs that are means over the pixel's samples. */
static void add_mean_aovs(const film *f, const trace *t, const knurl_ray *ray, bool found,
                          const knurl_hit *hit, double *pixel)
{
    if (f->aov_offset[STEPS] >= 0) pixel[f->aov_offset[STEPS]] += hit->steps;
    if (!found || !(f->aovs & (KNURL_AOV_GEOMETRIC_NORMAL | KNURL_AOV_SHADING_NORMAL | KNURL_AOV_ALBEDO)))
        return;
    surface_point s = surface_make(t->world, hit, v3_load(ray->direction));
    add3(pixel, f->aov_offset[GEOMETRIC_NORMAL], s.ng);
    add3(pixel, f->aov_offset[SHADING_NORMAL], s.shading.z);
    add3(pixel, f->aov_offset[ALBEDO], s.parameters.base);
}

/* AOVs of the ray through the pixel's and the lens's centre. */
static void add_centre_aovs(const film *f, trace *t, double x, double y, double *pixel)
{
    knurl_ray ray = camera_ray(t->world, x + 0.5, y + 0.5, 0.5, 0.5);
    vec3 eye = v3_load(ray.origin);
    knurl_hit hit;
    bool found = trace_nearest(t, RAY_PRIMARY, &ray, &hit);
    const int32_t *at = f->aov_offset;
    vec3 position = found ? v3_load(hit.position) : v3(0, 0, 0);
    if (at[DEPTH] >= 0) pixel[at[DEPTH]] = found ? v3_length(v3_sub(position, eye)) : INFINITY;
    add3(pixel, at[POSITION], position);
    if (at[UV] >= 0 && found) {
        pixel[at[UV]] = hit.uv[0];
        pixel[at[UV] + 1] = hit.uv[1];
    }
    if (at[OBJECT] >= 0) pixel[at[OBJECT]] = found ? (double)hit.object : -1.0;
    if (at[TRIANGLE] >= 0) pixel[at[TRIANGLE]] = found ? (double)hit.triangle : -1.0;
}

static void trace_sample(const render_job *job, trace *t, int32_t x, int32_t y, double *pixel)
{
    const world *w = t->world;
    sample4 u = sampler_get(&t->sampler, 0);
    knurl_ray ray = camera_ray(w, x + 0.5 + pixel_filter_offset(&w->filter, u.u[0]),
                               y + 0.5 + pixel_filter_offset(&w->filter, u.u[1]), u.u[2], u.u[3]);
    knurl_hit hit;
    bool found = trace_nearest(t, RAY_PRIMARY, &ray, &hit);
    add_mean_aovs(job->film, t, &ray, found, &hit, pixel);
    vec3 radiance = job->integrate(t, &ray, found ? &hit : NULL);
    if (v3_finite(radiance)) add3(pixel, 0, radiance);
    pixel[3] += found ? 1.0 : 0.0;
}

static void trace_pixel(const render_job *job, trace_stats *stats, int32_t x, int32_t y)
{
    const film *f = job->film;
    double pixel[FILM_MAX_CHANNELS] = {0};
    trace t = {.world = job->world, .stats = stats};
    int32_t image_x = f->x + x, image_y = f->y + y;
    t.sampler = sampler_make(job->world->def->seed, (uint32_t)image_x, (uint32_t)image_y, 0);
    if (job->first_sample == 0 && (f->aovs & FILM_CENTRE_AOVS))
        add_centre_aovs(f, &t, image_x, image_y, pixel);
    for (int32_t i = 0; i < job->pass_samples; i++) {
        t.sampler.index = (uint32_t)(job->first_sample + i);
        t.segment = 0;
        trace_sample(job, &t, image_x, image_y, pixel);
    }
    float *out = film_pixel(f, x, y);
    for (int32_t c = 0; c < f->channels; c++) out[c] = (float)pixel[c];
}

/* The lock is only tried: while one thread talks to the caller, the others go on tracing. */
static void report_progress(render_job *job, bool wait)
{
    const knurl_render_def *def = job->world->def;
    if (!def->progress) return;
    if (wait)
        pthread_mutex_lock(&job->progress_lock);
    else if (pthread_mutex_trylock(&job->progress_lock) != 0)
        return;
    if (!atomic_load(&job->stop)) {
        double fraction = (double)atomic_load(&job->tiles_done) / (double)job->tiles_total;
        if (!def->progress(def->progress_user, "render", fraction)) atomic_store(&job->stop, true);
    }
    pthread_mutex_unlock(&job->progress_lock);
}

static void trace_tiles(void *user, size_t begin, size_t end, int32_t thread)
{
    render_job *job = user;
    const film *f = job->film;
    for (size_t tile = begin; tile < end; tile++) {
        if (atomic_load_explicit(&job->stop, memory_order_relaxed)) return;
        int32_t x0 = (int32_t)(tile % (size_t)job->tiles_x) * TILE_SIZE;
        int32_t y0 = (int32_t)(tile / (size_t)job->tiles_x) * TILE_SIZE;
        for (int32_t y = y0; y < y0 + TILE_SIZE && y < f->height; y++)
            for (int32_t x = x0; x < x0 + TILE_SIZE && x < f->width; x++)
                trace_pixel(job, &job->stats[thread], x, y);
        atomic_fetch_add(&job->tiles_done, 1);
        report_progress(job, false);
    }
}

/* 1, 1, 2, 4, 8, 16, 16, ...: the film always holds a stratified number of samples. */
static int32_t next_pass(int32_t done, int32_t wanted)
{
    int32_t pass = done == 0 ? 1 : done < MAX_PASS_SAMPLES ? done : MAX_PASS_SAMPLES;
    return pass < wanted - done ? pass : wanted - done;
}

static size_t count_passes(int32_t wanted)
{
    size_t passes = 0;
    for (int32_t done = 0; done < wanted; done += next_pass(done, wanted)) passes++;
    return passes;
}

static knurl_status trace_passes(render_job *job)
{
    size_t tiles = (size_t)job->tiles_x * (size_t)job->tiles_y;
    int32_t wanted = job->world->def->samples;
    job->tiles_total = tiles * count_passes(wanted);
    for (size_t pass = 1; job->film->samples < wanted; pass++) {
        job->first_sample = job->film->samples;
        job->pass_samples = next_pass(job->film->samples, wanted);
        knurl_parallel_for(job->world->context, tiles, 1, trace_tiles, job);
        if (atomic_load(&job->tiles_done) == pass * tiles)
            film_finish_pass(job->film, job->pass_samples);
        else
            break;
        if (atomic_load(&job->stop)) break;
    }
    report_progress(job, true);
    return atomic_load(&job->stop) ? KNURL_INTERRUPTED : KNURL_OK;
}

static double rays_per_second(const trace_stats *total, ray_class kind, int32_t threads)
{
    return total->seconds[kind] > 0.0 ? (double)total->timed[kind] / total->seconds[kind] * threads : 0.0;
}

static void sum_stats(const render_job *job, double seconds, knurl_render_stats *stats)
{
    int32_t threads = knurl_context_threads(job->world->context);
    trace_stats total = {0};
    for (int32_t i = 0; i < threads; i++) {
        for (int k = 0; k < RAY_CLASSES; k++) {
            total.count[k] += job->stats[i].count[k];
            total.timed[k] += job->stats[i].timed[k];
            total.seconds[k] += job->stats[i].seconds[k];
        }
        total.primary_steps += job->stats[i].primary_steps;
    }
    /* No more threads work than there are tiles. */
    size_t tiles = (size_t)job->tiles_x * (size_t)job->tiles_y;
    if ((size_t)threads > tiles) threads = (int32_t)tiles;
    *stats = (knurl_render_stats){
        .seconds = seconds,
        .primary_rays = total.count[RAY_PRIMARY],
        .diffuse_rays = total.count[RAY_SCATTERED],
        .occlusion_rays = total.count[RAY_SHADOW],
        .primary_per_second = rays_per_second(&total, RAY_PRIMARY, threads),
        .diffuse_per_second = rays_per_second(&total, RAY_SCATTERED, threads),
        .occlusion_per_second = rays_per_second(&total, RAY_SHADOW, threads),
        .steps_mean =
            total.count[RAY_PRIMARY] ? (double)total.primary_steps / (double)total.count[RAY_PRIMARY] : 0.0,
        .samples_done = job->film->samples,
    };
}

static integrator_fn *find_integrator(knurl_integrator kind)
{
    return kind == KNURL_INTEGRATOR_AO        ? ambient_occlusion
           : kind == KNURL_INTEGRATOR_PRIMARY ? primary_radiance
                                              : path_radiance;
}

/* Traces everything into job->film and resolves it. */
static knurl_status run(render_job *job, knurl_render_result *result, knurl_error *error)
{
    if (pthread_mutex_init(&job->progress_lock, NULL) != 0)
        return knurl_fail(error, KNURL_ERROR_MEMORY, "no mutex left for the renderer");
    double started = knurl_seconds();
    knurl_status traced = trace_passes(job);
    pthread_mutex_destroy(&job->progress_lock);
    sum_stats(job, knurl_seconds() - started, &result->stats);
    knurl_status resolved = film_resolve(job->film, result, error);
    if (resolved != KNURL_OK) return resolved;
    if (traced != KNURL_OK)
        return knurl_fail(error, traced, "stopped after %d of %d samples per pixel", job->film->samples,
                          job->world->def->samples);
    return KNURL_OK;
}

knurl_status knurl_render(const knurl_description *description, const knurl_scene *scene,
                          const knurl_render_def *def, knurl_render_result *result, knurl_error *error)
{
    if (!result) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "result is NULL");
    memset(result, 0, sizeof *result);
    knurl_status status = check_arguments(description, scene, def, error);
    if (status != KNURL_OK) return status;
    knurl_context *context = description->context;
    world *w = NULL;
    film *f = NULL;
    size_t stats_bytes = (size_t)knurl_context_threads(context) * sizeof(trace_stats);
    trace_stats *stats = knurl_alloc_zero(context, stats_bytes);
    if (!stats) status = knurl_fail_memory(error, stats_bytes, "statistics");
    if (status == KNURL_OK) status = world_create(description, scene, def, &w, error);
    if (status == KNURL_OK) status = film_create(context, def, &f, error);
    if (status == KNURL_OK) {
        render_job job = {
            .world = w, .film = f, .stats = stats, .integrate = find_integrator(def->integrator)};
        job.tiles_x = (f->width + TILE_SIZE - 1) / TILE_SIZE;
        job.tiles_y = (f->height + TILE_SIZE - 1) / TILE_SIZE;
        status = run(&job, result, error);
    }
    if (status != KNURL_OK && status != KNURL_INTERRUPTED) knurl_render_result_release(result);
    film_release(f);
    world_release(w);
    knurl_free(context, stats);
    return status;
}

void knurl_render_result_release(knurl_render_result *result)
{
    if (!result) return;
    knurl_image_release(result->beauty);
    for (int32_t i = 0; i < KNURL_AOV_COUNT; i++) knurl_image_release(result->aovs[i]);
    memset(result, 0, sizeof *result);
}
