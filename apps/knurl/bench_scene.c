/* bench_scene.c: everything that is measured on one scene.
 *
 * Per ray set: each method traces it once with each kind of calls for its hits and steps, then methods and
 * kinds of calls take turns for the clock. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A scene whose hits count as exact. */
typedef struct reference {
    subject subject;
    bool unnormalised;
    double *t; /* of the present ray set; NaN for a miss */
} reference;

typedef struct scene_bench {
    command_session *session;
    const bench_options *options;
    const char *path;
    bench_results *results;
    subject *subjects;     /* one per method of the options */
    reference *references; /* those in use; the first one makes the rays */
    int reference_count;
    int *reference_of; /* per method */
    ray_set sets[RAYS_KINDS];
    size_t largest;  /* rays of the largest set */
    knurl_hit *hits; /* buffers of that size */
    uint8_t *occluded;
    double *t, *scratch;
    uint32_t *steps;
    double diagonal;
    int threads;            /* all of them */
    size_t runs_done, runs; /* timed runs, for progress */
} scene_bench;

/* What one method makes of one ray set, besides its time. */
typedef struct outcome {
    step_statistics steps;
    disagreement difference;
    bool compared;
} outcome;

static int fail_memory(command_session *session)
{
    return session_fail_with(session, CODE_LIMIT, "out of memory for the measurements");
}

/* ---- references ---- */

static const char RMIP_VARIANT[] = "rmip:marching-scale=1:inversion=off:bounds=minmax";

/* rmip is checked against the variant of it that shares least with it: no table, no inversion, and
 * bounds down to single texels. */
static const char *reference_method(const bench_options *options, const char *method)
{
    if (options->reference) return options->reference;
    return strcspn(method, ":") == 4 && strncmp(method, "rmip", 4) == 0 ? RMIP_VARIANT : "rmip";
}

/* Number of the reference for a method and kind of surface, opened at its first use; memory limits are for
 * the methods that are measured. */
static int find_reference(scene_bench *b, const char *method, bool unnormalised, int *found)
{
    for (*found = 0; *found < b->reference_count; (*found)++)
        if (b->references[*found].unnormalised == unnormalised &&
            strcmp(b->references[*found].subject.method, method) == 0)
            return CODE_DONE;
    reference *made = &b->references[b->reference_count];
    made->unnormalised = unnormalised;
    made->t = NULL;
    b->reference_count++;
    return subject_open(b->session, b->options, b->path, method, unnormalised, 0, &made->subject);
}

/* "rmip", or "rmip, unnormalised". */
static void describe_reference(const scene_bench *b, int method, char *text, size_t size)
{
    const reference *exact = &b->references[b->reference_of[method]];
    snprintf(text, size, "%.*s%s", (int)size - 20, exact->subject.method,
             exact->unnormalised ? ", unnormalised" : "");
}

/* ---- opening and closing ---- */

static int open_subjects(scene_bench *b)
{
    const bench_options *options = b->options;
    int found, code = find_reference(b, options->reference ? options->reference : "rmip", false, &found);
    if (code != CODE_DONE) return code;
    if (b->references[0].subject.failure[0])
        return session_fail_with(b->session, CODE_LIMIT, "%s: the reference that makes the rays: %s", b->path,
                                 b->references[0].subject.failure);
    for (int i = 0; i < options->method_count && code == CODE_DONE; i++) {
        const char *method = options->methods[i];
        code = subject_open(b->session, options, b->path, method, false, options->general.memory_limit,
                            &b->subjects[i]);
        if (code != CODE_DONE) break;
        bool unnormalised = (b->subjects[i].flags & KNURL_METHOD_UNNORMALISED) != 0;
        code = find_reference(b, reference_method(options, method), unnormalised, &b->reference_of[i]);
        if (signals_stop_requested()) code = CODE_INTERRUPTED;
    }
    return code;
}

static int make_buffers(scene_bench *b)
{
    for (int i = 0; i < RAYS_KINDS; i++)
        if (b->sets[i].count > b->largest) b->largest = b->sets[i].count;
    b->hits = malloc(b->largest * sizeof *b->hits);
    b->occluded = malloc(b->largest);
    b->t = malloc(b->largest * sizeof *b->t);
    b->scratch = malloc(b->largest * sizeof *b->scratch);
    b->steps = malloc(b->largest * sizeof *b->steps);
    bool good = b->hits && b->occluded && b->t && b->scratch && b->steps;
    for (int i = 0; i < b->reference_count; i++) {
        b->references[i].t = malloc(b->largest * sizeof *b->t);
        good = good && b->references[i].t;
    }
    return good ? CODE_DONE : fail_memory(b->session);
}

static void close_bench(scene_bench *b)
{
    for (int i = 0; b->subjects && i < b->options->method_count; i++) subject_close(&b->subjects[i]);
    for (int i = 0; i < b->reference_count; i++) {
        subject_close(&b->references[i].subject);
        free(b->references[i].t);
    }
    ray_sets_free(b->sets);
    free(b->subjects);
    free(b->references);
    free(b->reference_of);
    free(b->hits);
    free(b->occluded);
    free(b->t);
    free(b->scratch);
    free(b->steps);
}

/* ---- hits and steps ---- */

/* Traces a set on all threads; t and steps are in `t` and b->steps. A blocked ray of an any-hit set has
 * t 0, and steps mean nothing. */
static int trace_set(scene_bench *b, const subject *s, const ray_set *set, call_kind calls, double *t)
{
    int code = bench_trace(b->session, s, set, calls, b->threads, b->hits, b->occluded, NULL);
    if (code != CODE_DONE) return code;
    for (size_t i = 0; i < set->count; i++) {
        if (set->any_hit) {
            t[i] = b->occluded[i] ? 0 : NAN;
        } else {
            t[i] = b->hits[i].triangle != KNURL_NO_HIT ? b->hits[i].t : NAN;
            b->steps[i] = b->hits[i].steps;
        }
    }
    return CODE_DONE;
}

static int trace_references(scene_bench *b, const ray_set *set)
{
    int code = CODE_DONE;
    for (int i = 0; i < b->reference_count && code == CODE_DONE; i++)
        if (!b->references[i].subject.failure[0])
            code = trace_set(b, &b->references[i].subject, set, CALLS_BATCH, b->references[i].t);
    return code;
}

static int find_outcome(scene_bench *b, int method, const ray_set *set, call_kind calls, outcome *result)
{
    const reference *exact = &b->references[b->reference_of[method]];
    int code = trace_set(b, &b->subjects[method], set, calls, b->t);
    if (code != CODE_DONE) return code;
    result->steps = set->any_hit ? (step_statistics){NAN, NAN, NAN}
                                 : step_statistics_of(b->steps, set->count, b->scratch);
    result->compared = !exact->subject.failure[0];
    if (result->compared)
        result->difference = disagreement_of(b->t, exact->t, set->count, b->diagonal, b->scratch);
    if (set->any_hit) result->difference.median = result->difference.p99 = NAN;
    return CODE_DONE;
}

/* ---- time ---- */

static const char *file_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* What was found of one ray set, for [calls][method]. */
enum { CALL_KINDS = 2 };
static const call_kind call_kinds[CALL_KINDS] = {CALLS_SINGLE, CALLS_BATCH};
static const char *const call_names[CALL_KINDS] = {"single", "batch"};

typedef struct measures {
    outcome *outcomes[CALL_KINDS];
    /* Million rays per second, [method * rounds + round] */
    double *wall[CALL_KINDS], *processor[CALL_KINDS];
} measures;

/* Methods and kinds of calls take turns. */
static int time_rounds(scene_bench *b, const ray_set *set, int threads, unsigned calls, const measures *found)
{
    int methods = b->options->method_count, rounds = b->options->rounds;
    for (int turn = 0; turn < rounds * methods * CALL_KINDS; turn++) {
        int kind = turn % CALL_KINDS, m = turn / CALL_KINDS % methods, round = turn / CALL_KINDS / methods;
        const subject *s = &b->subjects[m];
        if (!(calls & call_kinds[kind])) continue;
        double part = (double)b->runs_done++ / (double)b->runs;
        if (!progress_update(&b->session->progress, file_name(b->path), part)) return CODE_INTERRUPTED;
        if (s->failure[0]) continue;
        run_time taken;
        int code = bench_trace(b->session, s, set, call_kinds[kind], threads, b->hits, b->occluded, &taken);
        if (code != CODE_DONE) return code;
        found->wall[kind][m * rounds + round] = 1e-6 * (double)set->count / taken.wall;
        found->processor[kind][m * rounds + round] = 1e-6 * (double)set->count / taken.processor;
    }
    return CODE_DONE;
}

/* ---- rows ---- */

static int add_row(scene_bench *b, int method, ray_kind kind, int threads, int calls, const measures *found)
{
    const subject *s = &b->subjects[method];
    const ray_set *set = &b->sets[kind];
    const outcome *result = &found->outcomes[calls][method];
    bench_row *row = bench_results_add(b->results);
    if (!row) return fail_memory(b->session);
    row->scene = b->path;
    row->method = s->method;
    row->rays = ray_kind_names[kind];
    row->threads = threads;
    row->calls = call_names[calls];
    row->count = set->count;
    describe_reference(b, method, row->reference, sizeof row->reference);
    row->build_ms = s->build_ms;
    row->has_memory = !s->failure[0];
    row->memory = s->memory;
    const char *failure = s->failure[0] ? s->failure : set->failure;
    snprintf(row->failure, sizeof row->failure, "%.*s", (int)sizeof row->failure - 1, failure);
    if (failure[0]) return CODE_DONE;
    size_t rounds = (size_t)b->options->rounds, first = (size_t)method * rounds;
    row->mrays = spread_of(found->wall[calls] + first, rounds);
    row->mrays_cpu = spread_of(found->processor[calls] + first, rounds).median;
    row->steps = result->steps;
    if (!result->compared) return CODE_DONE;
    row->missed = (double)result->difference.missed;
    row->invented = (double)result->difference.invented;
    row->dt_median = result->difference.median;
    row->dt_p99 = result->difference.p99;
    return CODE_DONE;
}

/* Kinds of calls that are measured with one thread, or with all. */
static unsigned calls_for(const bench_options *options, int threads)
{
    return options->calls ? options->calls : threads == 1 ? CALLS_SINGLE : CALLS_BATCH;
}

static int measure_threads(scene_bench *b, ray_kind kind, int threads, const measures *found)
{
    const unsigned calls = calls_for(b->options, threads);
    int code = b->sets[kind].failure[0] ? CODE_DONE : time_rounds(b, &b->sets[kind], threads, calls, found);
    size_t first = b->results->row_count;
    for (int k = 0; k < CALL_KINDS; k++)
        for (int m = 0; m < b->options->method_count && code == CODE_DONE; m++)
            if (calls & call_kinds[k]) code = add_row(b, m, kind, threads, k, found);
    progress_clear(&b->session->progress);
    if (code == CODE_DONE)
        bench_table_rows(bench_table_stream(b->options), b->results->rows + first,
                         b->results->row_count - first, false);
    return code;
}

/* Keeps b->steps of a method for the heat maps. */
static int keep_steps(scene_bench *b, const ray_set *set, uint32_t **kept)
{
    if (!*kept) *kept = malloc(set->count * sizeof **kept);
    if (!*kept) return fail_memory(b->session);
    memcpy(*kept, b->steps, set->count * sizeof **kept);
    return CODE_DONE;
}

/* Traces the set once with every method and kind of calls: disagreement and steps, which also warms up. */
static int find_outcomes(scene_bench *b, ray_kind kind, const measures *found)
{
    const ray_set *set = &b->sets[kind];
    int methods = b->options->method_count;
    const unsigned calls =
        calls_for(b->options, 1) | (b->threads > 1 ? calls_for(b->options, b->threads) : 0);
    bool picture = b->options->heat_map && kind == RAYS_PRIMARY;
    uint32_t **steps = calloc((size_t)methods, sizeof *steps);
    int code = steps ? trace_references(b, set) : fail_memory(b->session);
    for (int turn = 0; turn < methods * CALL_KINDS && code == CODE_DONE; turn++) {
        int m = turn / CALL_KINDS, k = turn % CALL_KINDS;
        if (b->subjects[m].failure[0] || !(calls & call_kinds[k])) continue;
        code = find_outcome(b, m, set, call_kinds[k], &found->outcomes[k][m]);
        if (picture && code == CODE_DONE) code = keep_steps(b, set, &steps[m]);
    }
    if (picture && code == CODE_DONE)
        code = heat_maps_save(b->session, b->options, b->path, set, steps, b->results);
    for (int m = 0; steps && m < methods; m++) free(steps[m]);
    free(steps);
    return code;
}

static bool measures_make(measures *found, size_t methods, size_t rounds)
{
    bool good = true;
    *found = (measures){0};
    for (int k = 0; k < CALL_KINDS; k++) {
        found->outcomes[k] = calloc(methods, sizeof *found->outcomes[k]);
        found->wall[k] = calloc(methods * rounds, sizeof(double));
        found->processor[k] = calloc(methods * rounds, sizeof(double));
        good = good && found->outcomes[k] && found->wall[k] && found->processor[k];
    }
    return good;
}

static void measures_free(measures *found)
{
    for (int k = 0; k < CALL_KINDS; k++) {
        free(found->outcomes[k]);
        free(found->wall[k]);
        free(found->processor[k]);
    }
}

static int measure_set(scene_bench *b, ray_kind kind)
{
    measures found;
    bool good = measures_make(&found, (size_t)b->options->method_count, (size_t)b->options->rounds);
    int code = good ? CODE_DONE : fail_memory(b->session);
    if (code == CODE_DONE && !b->sets[kind].failure[0]) code = find_outcomes(b, kind, &found);
    if (code == CODE_DONE) code = measure_threads(b, kind, 1, &found);
    if (code == CODE_DONE && b->threads > 1) code = measure_threads(b, kind, b->threads, &found);
    measures_free(&found);
    return code;
}

static void print_subjects(const scene_bench *b)
{
    FILE *out = bench_table_stream(b->options);
    bench_table_scene(out, b->path, &b->references[0].subject);
    for (int m = 0; m < b->options->method_count; m++) {
        char text[160];
        describe_reference(b, m, text, sizeof text);
        bench_table_subject(out, &b->subjects[m], text);
    }
    bench_table_rows(out, NULL, 0, true);
}

static int measure_all(scene_bench *b)
{
    const subject *rays_from = &b->references[0].subject;
    b->threads = (int)knurl_context_threads(rays_from->context);
    const bool both = b->options->calls == (CALLS_SINGLE | CALLS_BATCH);
    const size_t ways = (b->threads > 1 ? 2u : 1u) * (both ? 2u : 1u);
    b->runs =
        (size_t)b->options->kind_count * ways * (size_t)b->options->rounds * (size_t)b->options->method_count;
    double lower[3], upper[3], sum = 0;
    knurl_scene_bounds(rays_from->scene, lower, upper);
    for (int i = 0; i < 3; i++) sum += (upper[i] - lower[i]) * (upper[i] - lower[i]);
    b->diagonal = isfinite(sum) && sum > 0 ? sqrt(sum) : 1;
    int code = ray_sets_make(b->session, b->options, rays_from->description, rays_from->scene, b->sets);
    if (code == CODE_DONE) code = make_buffers(b);
    progress_clear(&b->session->progress);
    if (code == CODE_DONE) print_subjects(b);
    for (int i = 0; i < b->options->kind_count && code == CODE_DONE; i++)
        code = measure_set(b, b->options->kinds[i]);
    if (code == CODE_DONE && b->options->frame_width)
        code = bench_frames(b->session, b->options, b->path, b->subjects, b->results);
    return code;
}

int bench_scene(command_session *session, const bench_options *options, const char *path,
                bench_results *results)
{
    size_t methods = (size_t)options->method_count;
    scene_bench b = {.session = session, .options = options, .path = path, .results = results};
    b.subjects = calloc(methods, sizeof *b.subjects);
    b.references = calloc(methods + 1, sizeof *b.references);
    b.reference_of = calloc(methods, sizeof *b.reference_of);
    int code = b.subjects && b.references && b.reference_of ? open_subjects(&b) : fail_memory(session);
    if (code == CODE_DONE) code = measure_all(&b);
    close_bench(&b);
    progress_clear(&session->progress);
    return code;
}
