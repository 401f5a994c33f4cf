/* trace.c: `knurl trace`, rays from a file against a scene. */
#include "commands.h"
#include "rays.h"
#include "values.h"

#include <stdlib.h>
#include <string.h>

enum { KEY_RAYS = 0x200, KEY_OUT, KEY_ANY_HIT, KEY_LOD };

typedef struct trace_options {
    const char *scene, *rays, *out;
    bool any_hit;
    double lod;
    general_options general;
    method_options method;
    displacement_options displacement;
} trace_options;

static const struct argp_option option_list[] = {
    {"rays", KEY_RAYS, "FILE", 0, "Rays to trace: CSV or .npy; - is standard input", 1},
    {"out", KEY_OUT, "FILE", 0,
     "Where hits go: .npy by its name, else CSV; - is standard output, in the format of the rays", 1},
    {"any-hit", KEY_ANY_HIT, NULL, 0, "Only say whether anything is hit, which is faster", 1},
    {"lod", KEY_LOD, "X", 0,
     "Level of detail of every map: 0 (default) is the finest, fractions blend two levels", 1},
    {0}};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    trace_options *options = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->displacement;
        state->child_inputs[1] = &options->method;
        state->child_inputs[2] = &options->general;
        break;
    case KEY_RAYS:
        options->rays = argument;
        break;
    case KEY_OUT:
        options->out = argument;
        break;
    case KEY_ANY_HIT:
        options->any_hit = true;
        break;
    case KEY_LOD:
        options->lod = value_real(state, "--lod", argument, 0, 32);
        break;
    case ARGP_KEY_ARG:
        take_scene(state, argument, &options->scene);
        break;
    case ARGP_KEY_END:
        if (!options->scene) argp_error(state, "the scene file is missing");
        if (!options->rays) argp_error(state, "--rays FILE is missing");
        if (!options->out) argp_error(state, "--out FILE is missing");
        break;
    default:
        return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const char documentation[] =
    "Trace your own rays against a scene and write the nearest hits.\v"
    "Rays are CSV with a header: columns ox,oy,oz,dx,dy,dz and optionally tmin,tmax, in any order, one ray "
    "per line. The direction may have any length but zero, and t counts in that length. Or a NumPy array, "
    "float32 or float64, of shape (n, 6) or (n, 8).\n\n"
    "Hits are CSV, one line per ray in the same order:\n"
    "  hit,t,px,py,pz,ngx,ngy,ngz,nsx,nsy,nsz,u,v,height,object,triangle\n\n"
    "A miss is 0 and empty fields; in a NumPy array of shape (n, 16) it is 0 and NaN.\n\n"
    "Examples:\n"
    "  knurl trace moon.gltf --rays rays.csv --out hits.csv\n"
    "  knurl trace ball.obj --disp rock.png --rays rays.npy --out hits.npy\n"
    "  make-rays | knurl trace moon.gltf --rays - --out - --any-hit | count\n";

/* ---- the work ---- */

typedef struct trace_job {
    command_session *session;
    const knurl_scene *scene;
    const trace_options *options;
    ray_reader *reader;
    hit_writer *writer;
    knurl_ray *rays;
    knurl_hit *hits;
    uint8_t *occluded;
    uint64_t traced, found;
} trace_job;

static bool keep_going(void *user, const char *stage, double fraction)
{
    (void)user;
    (void)stage;
    (void)fraction;
    return !signals_stop_requested();
}

static int trace_block(trace_job *job, size_t count)
{
    knurl_error error = {0};
    size_t done = count;
    for (size_t i = 0; i < count; i++) job->rays[i].lod = (float)job->options->lod;
    knurl_status status = job->options->any_hit
                              ? knurl_scene_occluded_batch(job->scene, job->rays, count, job->occluded,
                                                           keep_going, NULL, &done, &error)
                              : knurl_scene_intersect_batch(job->scene, job->rays, count, job->hits,
                                                            keep_going, NULL, &done, &error);
    if (status != KNURL_OK && status != KNURL_INTERRUPTED) return session_fail(job->session, &error);
    for (size_t i = 0; i < done; i++)
        job->found += job->options->any_hit ? job->occluded[i] != 0 : job->hits[i].triangle != KNURL_NO_HIT;
    job->traced += done;
    int code = job->options->any_hit ? hit_writer_write_any(job->writer, job->occluded, done)
                                     : hit_writer_write(job->writer, job->hits, done);
    if (code == CODE_DONE && status == KNURL_INTERRUPTED) code = CODE_INTERRUPTED;
    return code;
}

static int trace_all(trace_job *job)
{
    for (;;) {
        if (signals_stop_requested()) return CODE_INTERRUPTED;
        size_t count;
        int code = ray_reader_read(job->reader, job->rays, &count);
        if (code == CODE_DONE && count == 0) return CODE_DONE;
        if (code == CODE_DONE) code = trace_block(job, count);
        if (code != CODE_DONE) return code;
        double fraction = ray_reader_fraction(job->reader);
        if (fraction >= 0) progress_update(&job->session->progress, "trace", fraction);
    }
}

static int run_job(trace_job *job)
{
    const trace_options *options = job->options;
    command_session *session = job->session;
    char extension[16];
    path_extension(options->out, extension);
    int code = ray_reader_open(session, options->rays, &job->reader);
    if (code != CODE_DONE) return code;
    bool to_stdout = strcmp(options->out, "-") == 0;
    bool npy = to_stdout ? ray_reader_is_npy(job->reader) : strcmp(extension, ".npy") == 0;
    code = hit_writer_open(session, options->out, npy, options->any_hit, ray_reader_total(job->reader),
                           &job->writer);
    if (code != CODE_DONE) return code;
    double start = seconds_now();
    code = trace_all(job);
    double seconds = seconds_now() - start;
    if (code != CODE_DONE && code != CODE_INTERRUPTED) return code;
    int saved = hit_writer_commit(job->writer);
    if (saved != CODE_DONE) return saved;
    if (code == CODE_INTERRUPTED)
        session_fail_with(session, CODE_INTERRUPTED, "interrupted; the first %llu rays are saved",
                          (unsigned long long)job->traced);
    else if (session->general.verbose)
        session_note(session, "%llu rays, %llu hit something, %.2f s", (unsigned long long)job->traced,
                     (unsigned long long)job->found, seconds);
    return code;
}

static int allocate_and_run(trace_job *job)
{
    job->rays = malloc(RAY_BLOCK * sizeof *job->rays);
    job->hits = job->options->any_hit ? NULL : malloc(RAY_BLOCK * sizeof *job->hits);
    job->occluded = malloc(RAY_BLOCK);
    int code;
    if (!job->rays || (!job->hits && !job->options->any_hit) || !job->occluded)
        code = session_fail_with(job->session, CODE_LIMIT, "out of memory for a block of rays");
    else
        code = run_job(job);
    hit_writer_close(job->writer);
    ray_reader_close(job->reader);
    free(job->rays);
    free(job->hits);
    free(job->occluded);
    return code;
}

int trace_command(int argc, char **argv)
{
    trace_options options = {.general = general_options_default(),
                             .method = method_options_default(),
                             .displacement = displacement_options_default()};
    static const struct argp_child children[] = {
        {&displacement_argp, 0, "Displacement, instead of the scene's own:", 2},
        {&method_argp, 0, "Method:", 3},
        {&general_argp, 0, "General:", 4},
        {0}};
    static const struct argp argp = {option_list,   parse_option, "SCENE --rays FILE --out FILE",
                                     documentation, children,     help_filter,
                                     NULL};
    argp_parse(&argp, argc, argv, 0, NULL, &options);
    signals_install();
    command_session session;
    int code = session_open(&session, "trace", &options.general);
    if (code == CODE_DONE) code = output_check(&session, options.out);
    loaded_scene loaded = {0};
    if (code == CODE_DONE)
        code = scene_load(&session, options.scene, &options.displacement, &options.method, &loaded);
    if (code == CODE_DONE) {
        trace_job job = {.session = &session, .scene = loaded.scene, .options = &options};
        code = allocate_and_run(&job);
    }
    scene_release(&loaded);
    session_close(&session);
    return code;
}
