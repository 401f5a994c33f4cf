/* Many rays at once, on the context's threads. */
#include "scene/scene.h"

/* Groups must not depend on the number of threads. */
_Static_assert(KNURL_BATCH_BLOCK % ACCEL_GROUP == 0, "a block is not a whole number of groups");

typedef struct batch {
    const knurl_scene *scene;
    const knurl_ray *rays;
    knurl_hit *hits; /* one of these two */
    uint8_t *occluded;
    const uint32_t *order; /* of the stretch being traced, or NULL */
    size_t first;          /* where it begins */
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

/* Rays [begin, end) of the stretch, in its order. */
static void trace_rays(const batch *b, size_t begin, size_t end)
{
    const bool few = !b->scene->top;
    const knurl_ray *rays = b->rays + b->first;
    for (size_t i = begin; i < end;) {
        const size_t count = few && end - i > ACCEL_GROUP ? ACCEL_GROUP : few ? end - i : 1;
        const uint32_t *order = b->order ? b->order + i : NULL;
        const size_t from = b->first + (order ? 0 : i);
        if (few && b->hits)
            scene_intersect_group(b->scene, &b->rays[from], order, count, &b->hits[from]);
        else if (few)
            scene_occluded_group(b->scene, &b->rays[from], order, count, &b->occluded[from]);
        else if (b->hits)
            (void)knurl_scene_intersect(b->scene, &rays[i], &b->hits[b->first + i]);
        else
            b->occluded[b->first + i] = knurl_scene_occluded(b->scene, &rays[i]);
        i += count;
    }
}

static void trace_chunk(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    batch *b = user;
    if (atomic_load(&b->stop)) {
        /* In another order than the caller's nothing of the stretch can be said to be whole. */
        skip_chunk(b, b->order ? b->first : b->first + begin);
        return;
    }
    trace_rays(b, begin, end);
    report(b, end - begin);
}

/* Rays are put in order by stretches, so that what is done when a caller stops is a good part. */
enum { ORDERED_LEAST = 2 * KNURL_BATCH_BLOCK, ORDERED_MOST = 256 * KNURL_BATCH_BLOCK };

/* Worth it for surfaces with hierarchies of their own: other objects hand rays to Embree one by one. */
static bool gains_from_order(const knurl_scene *scene)
{
    if (scene->top || accel_box_is_empty(&scene->box)) return false;
    for (uint32_t i = 0; i < scene->instance_count; i++)
        if (scene->objects[scene->instances[i].object].whole) return true;
    return false;
}

static void trace_stretches(batch *b)
{
    knurl_context *context = b->scene->context;
    uint64_t *scratch = NULL;
    size_t most = b->count;
    if (b->count >= ORDERED_LEAST && gains_from_order(b->scene)) {
        most = b->count < ORDERED_MOST ? b->count : ORDERED_MOST;
        /* Without memory for it rays are traced as they come. */
        scratch = knurl_alloc_array(context, 2 * most, sizeof *scratch);
    }
    for (b->first = 0; b->first < b->count; b->first += most) {
        size_t count = b->count - b->first < most ? b->count - b->first : most;
        b->order = scratch ? scene_order(b->scene, b->rays + b->first, count, scratch) : NULL;
        knurl_parallel_for(context, count, KNURL_BATCH_BLOCK, trace_chunk, b);
    }
    knurl_free(context, scratch);
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
    trace_stretches(b);
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
