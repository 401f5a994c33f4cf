/* bench_time.c: one way to trace one set of rays, and the clock for it. */
#include "bench.h"
#include "parallel.h"

#include <time.h>

static run_time time_now(void)
{
    struct timespec processor;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &processor);
    return (run_time){seconds_now(), (double)processor.tv_sec + 1e-9 * (double)processor.tv_nsec};
}

static run_time time_since(run_time start)
{
    run_time now = time_now();
    return (run_time){now.wall - start.wall, now.processor - start.processor};
}

static bool keep_going(void *user, const char *stage, double fraction)
{
    (void)user;
    (void)stage;
    (void)fraction;
    return !signals_stop_requested();
}

typedef struct trace_run {
    const knurl_scene *scene;
    const ray_set *set;
    knurl_hit *hits;
    uint8_t *occluded;
} trace_run;

/* Ctrl-C is looked at between blocks. */
enum { BLOCK = KNURL_BATCH_BLOCK };

static void single_block(void *user, size_t block)
{
    const trace_run *run = user;
    const ray_set *set = run->set;
    const size_t begin = block * BLOCK, end = set->count - begin < BLOCK ? set->count : begin + BLOCK;
    if (signals_stop_requested()) return;
    if (set->any_hit)
        for (size_t i = begin; i < end; i++)
            run->occluded[i] = knurl_scene_occluded(run->scene, &set->rays[i]);
    else
        for (size_t i = begin; i < end; i++)
            (void)knurl_scene_intersect(run->scene, &set->rays[i], &run->hits[i]);
}

static knurl_status batch_rays(const trace_run *run, size_t begin, size_t count, knurl_error *error)
{
    const knurl_ray *rays = &run->set->rays[begin];
    if (run->set->any_hit)
        return knurl_scene_occluded_batch(run->scene, rays, count, &run->occluded[begin], keep_going, NULL,
                                          NULL, error);
    return knurl_scene_intersect_batch(run->scene, rays, count, &run->hits[begin], keep_going, NULL, NULL,
                                       error);
}

/* On all of the context's threads, or block by block, which stays on this one. */
static knurl_status trace_batch(const trace_run *run, bool all, knurl_error *error)
{
    const size_t total = run->set->count, step = all ? total : BLOCK;
    knurl_status status = KNURL_OK;
    for (size_t begin = 0; begin < total && status == KNURL_OK; begin += step)
        status = batch_rays(run, begin, total - begin < step ? total - begin : step, error);
    return status;
}

int bench_trace(command_session *session, const subject *s, const ray_set *set, call_kind calls, int threads,
                knurl_hit *hits, uint8_t *occluded, run_time *taken)
{
    trace_run run = {s->scene, set, hits, occluded};
    knurl_error error = {0};
    knurl_status status = KNURL_OK;
    const run_time start = time_now();
    if (calls == CALLS_BATCH)
        status = trace_batch(&run, threads > 1, &error);
    else
        parallel_chunks(threads, (set->count + BLOCK - 1) / BLOCK, single_block, &run);
    if (taken) *taken = time_since(start);
    if (signals_stop_requested() || status == KNURL_INTERRUPTED) return CODE_INTERRUPTED;
    return status == KNURL_OK ? CODE_DONE : session_fail(session, &error);
}
