/* Many rays at once, on the context's threads. */
#include "scene/scene.h"

enum { RAYS_PER_CHUNK = 1024 };

typedef struct batch {
    const knurl_scene *scene;
    const knurl_ray *rays;
    knurl_hit *hits; /* one of these two */
    uint8_t *occluded;
    size_t count;
    knurl_progress_fn *progress;
    void *user;
    atomic_flag reporting; /* held by the thread that is inside the callback */
    size_t reported;       /* guarded by it */
    atomic_size_t finished;
    atomic_bool stop;
    atomic_size_t first_skipped; /* begin of the foremost chunk that was left out */
} batch;

static void skip_chunk(batch *b, size_t begin)
{
    size_t first = atomic_load(&b->first_skipped);
    while (begin < first && !atomic_compare_exchange_weak(&b->first_skipped, &first, begin)) {
    }
}

/* Tells the callback how far things are; only with `reporting` held, so fractions never go back. */
static void call_progress(batch *b)
{
    size_t finished = atomic_load(&b->finished);
    if (atomic_load(&b->stop) || finished == b->reported) return;
    b->reported = finished;
    if (!b->progress(b->user, "rays", (double)finished / (double)b->count)) atomic_store(&b->stop, true);
}

static void report(batch *b, size_t done)
{
    (void)atomic_fetch_add(&b->finished, done);
    if (!b->progress || atomic_flag_test_and_set(&b->reporting)) return;
    call_progress(b);
    atomic_flag_clear(&b->reporting);
}

static void trace_chunk(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    batch *b = user;
    if (atomic_load(&b->stop)) {
        skip_chunk(b, begin);
        return;
    }
    if (b->hits)
        for (size_t i = begin; i < end; i++) (void)knurl_scene_intersect(b->scene, &b->rays[i], &b->hits[i]);
    else
        for (size_t i = begin; i < end; i++) b->occluded[i] = knurl_scene_occluded(b->scene, &b->rays[i]);
    report(b, end - begin);
}

static knurl_status run_batch(batch *b, size_t *done, knurl_error *error)
{
    if (done) *done = 0;
    if (!b->scene) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "scene is NULL");
    if (!b->scene->committed) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "scene is not committed yet");
    if (b->count > 0 && (!b->rays || (!b->hits && !b->occluded)))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s array is NULL, expected %zu elements",
                          b->rays ? "output" : "ray", b->count);
    atomic_flag_clear(&b->reporting);
    atomic_init(&b->finished, 0);
    atomic_init(&b->stop, false);
    atomic_init(&b->first_skipped, b->count);
    knurl_parallel_for(b->scene->context, b->count, RAYS_PER_CHUNK, trace_chunk, b);
    if (b->progress) call_progress(b); /* for a last chunk whose report found the callback busy */
    size_t valid = atomic_load(&b->first_skipped);
    if (done) *done = valid;
    if (atomic_load(&b->stop))
        return knurl_fail(error, KNURL_INTERRUPTED, "stopped after %zu of %zu rays", valid, b->count);
    return KNURL_OK;
}

knurl_status knurl_scene_intersect_batch(const knurl_scene *scene, const knurl_ray *rays, size_t count,
                                         knurl_hit *hits, knurl_progress_fn *progress, void *user,
                                         size_t *done, knurl_error *error)
{
    batch b = {
        .scene = scene, .rays = rays, .hits = hits, .count = count, .progress = progress, .user = user};
    return run_batch(&b, done, error);
}

knurl_status knurl_scene_occluded_batch(const knurl_scene *scene, const knurl_ray *rays, size_t count,
                                        uint8_t *occluded, knurl_progress_fn *progress, void *user,
                                        size_t *done, knurl_error *error)
{
    batch b = {.scene = scene,
               .rays = rays,
               .occluded = occluded,
               .count = count,
               .progress = progress,
               .user = user};
    return run_batch(&b, done, error);
}
