/* bake.c: `knurl bake`, a scene's displaced surfaces as plain triangles in a file. */
#include "bake.h"
#include "commands.h"
#include "values.h"

#include <stdlib.h>
#include <string.h>

enum { KEY_RATE = 0x200, KEY_MAX_TRIANGLES, KEY_FORMAT };

typedef struct bake_options {
    const char *scene, *out;
    int format; /* index into `formats`, -1: by the name of the file */
    double rate;
    int64_t max_triangles;
    general_options general;
    displacement_options displacement;
} bake_options;

static const struct {
    const char *extension;
    int (*write)(bake_job *job);
} formats[] = {{"obj", bake_obj}, {"ply", bake_ply}, {"glb", bake_glb}};
static const char *const format_names[] = {"obj", "ply", "glb", NULL};

static const struct argp_option option_list[] = {
    {"output", 'o', "FILE", 0, "The mesh: .obj, .ply (binary) or .glb; - is standard output, with --format",
     1},
    {"rate", KEY_RATE, "X", 0,
     "Vertices per texel along edges, 0.001 to 64 (default 1): 0.25 makes a sixteenth of the triangles", 1},
    {"max-triangles", KEY_MAX_TRIANGLES, "N", 0, "Lower the rate of objects that would have more", 1},
    {"format", KEY_FORMAT, "NAME", 0, "obj, ply or glb, whatever the name of the file", 1},
    {0}};

/* The format that the file's name stands for. */
static void choose_format(struct argp_state *state, bake_options *options)
{
    char extension[16];
    if (options->format >= 0) return;
    path_extension(options->out, extension);
    for (int i = 0; format_names[i]; i++)
        if (extension[0] && strcmp(extension + 1, format_names[i]) == 0) options->format = i;
    if (options->format < 0)
        argp_error(state, "-o: found '%s', expected a name that ends in .obj, .ply or .glb, or --format",
                   options->out);
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    bake_options *options = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->displacement;
        state->child_inputs[1] = &options->general;
        break;
    case 'o':
        options->out = argument;
        break;
    case KEY_RATE:
        options->rate = value_real(state, "--rate", argument, 0.001, 64);
        break;
    case KEY_MAX_TRIANGLES:
        options->max_triangles = value_integer(state, "--max-triangles", argument, 1, INT64_C(1) << 40);
        break;
    case KEY_FORMAT:
        options->format = value_choice(state, "--format", argument, format_names);
        break;
    case ARGP_KEY_ARG:
        take_scene(state, argument, &options->scene);
        break;
    case ARGP_KEY_END:
        if (!options->scene) argp_error(state, "the scene file is missing");
        if (!options->out) argp_error(state, "-o FILE is missing");
        choose_format(state, options);
        break;
    default:
        return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const char documentation[] =
    "Write a scene's displaced surfaces as plain triangles.\v"
    "Vertices lie exactly on the surface and come with shading normals and texture coordinates. Undisplaced "
    "meshes are written as they are. OBJ and PLY hold every instance in world space; GLB holds every object "
    "once, "
    "with nodes, materials, and pictures of colour, metal and roughness. Cameras and lights are left out. "
    "The mesh is "
    "streamed: it may be larger than memory.\n\n"
    "Examples:\n"
    "  knurl bake moon.gltf -o moon.glb\n"
    "  knurl bake ball.obj --disp rock.png --disp-factor 0.1 --rate 0.5 -o ball.ply\n";

/* ---- the work ---- */

static knurl_status make_part(const bake_options *options, const loaded_scene *loaded, uint32_t number,
                              bake_part *part, knurl_error *error)
{
    const knurl_description_mesh *mesh = &loaded->description->meshes[number];
    const knurl_surface *surface = knurl_scene_surface(loaded->scene, number);
    *part = (bake_part){.mesh = mesh, .vertices = mesh->vertex_count, .triangles = mesh->triangle_count};
    if (!surface) {
        if (!mesh->normals) part->vertices = 3 * part->triangles;
        return KNURL_OK;
    }
    knurl_tessellation_def def = knurl_tessellation_def_default();
    def.rate = options->rate;
    def.max_triangles = (uint64_t)options->max_triangles;
    /* The scene's pointer is const because surfaces are immutable; retaining one is no change. */
    knurl_status status =
        knurl_tessellation_create((knurl_surface *)(uintptr_t)surface, &def, &part->tessellation, error);
    if (status != KNURL_OK) return status;
    part->vertices = knurl_tessellation_vertices(part->tessellation);
    part->triangles = knurl_tessellation_triangles(part->tessellation);
    return KNURL_OK;
}

/* Vertices and triangles that will be walked over; GLB walks over vertices twice, but over instances once. */
static uint64_t count_work(const bake_job *job, bool glb)
{
    uint64_t all = 0;
    const knurl_description *d = job->description;
    for (uint32_t i = 0; i < d->instance_count && !glb; i++) {
        const bake_part *part = &job->parts[d->instances[i].mesh];
        if (bake_is_seen(job, i)) all += part->vertices + part->triangles;
    }
    for (uint32_t i = 0; i < d->mesh_count && glb; i++)
        all += 2 * job->parts[i].vertices + job->parts[i].triangles;
    return all;
}

static void summarise(const bake_job *job, const bake_options *options)
{
    const knurl_description *d = job->description;
    uint64_t triangles = 0;
    double rate = options->rate;
    for (uint32_t i = 0; i < d->instance_count; i++)
        if (bake_is_seen(job, i)) triangles += job->parts[d->instances[i].mesh].triangles;
    for (uint32_t i = 0; i < d->mesh_count; i++) {
        double used = job->parts[i].tessellation ? knurl_tessellation_rate(job->parts[i].tessellation) : rate;
        if (used < rate) rate = used;
    }
    session_note(job->session, "knurl: %s: %llu triangles in all instances, rate %g%s", options->out,
                 (unsigned long long)triangles, rate, rate < options->rate ? " at the lowest" : "");
}

static int write_file(bake_job *job, const bake_options *options)
{
    output_file output;
    int code = output_open(job->session, &output, options->out);
    if (code != CODE_DONE) return code;
    job->out = output.file;
    code = formats[options->format].write(job);
    progress_clear(&job->session->progress);
    if (code == CODE_DONE) code = output_commit(job->session, &output);
    if (code != CODE_DONE)
        output_discard(&output);
    else
        summarise(job, options);
    return code;
}

static int bake_loaded(command_session *session, const bake_options *options, const loaded_scene *loaded)
{
    uint32_t count = loaded->description->mesh_count;
    bake_job job = {.session = session, .description = loaded->description};
    job.parts = calloc((size_t)count + 1, sizeof *job.parts);
    job.block = malloc(sizeof *job.block);
    job.points = malloc(3 * BAKE_BLOCK * sizeof *job.points);
    job.indices = malloc(3 * BAKE_BLOCK * sizeof *job.indices);
    job.rows = malloc((size_t)BAKE_ROW * BAKE_BLOCK);
    int code = CODE_DONE;
    if (!job.parts || !job.block || !job.points || !job.indices || !job.rows)
        code = session_fail_with(session, CODE_LIMIT, "out of memory for a block of vertices");
    for (uint32_t i = 0; i < count && code == CODE_DONE; i++) {
        knurl_error error = {0};
        if (make_part(options, loaded, i, &job.parts[i], &error) != KNURL_OK)
            code = session_fail(session, &error);
    }
    if (code == CODE_DONE) {
        job.all = count_work(&job, formats[options->format].write == bake_glb);
        code = write_file(&job, options);
    }
    for (uint32_t i = 0; job.parts && i < count; i++) knurl_tessellation_release(job.parts[i].tessellation);
    free(job.parts);
    free(job.block);
    free(job.points);
    free(job.indices);
    free(job.rows);
    return code;
}

int bake_command(int argc, char **argv)
{
    bake_options options = {.format = -1,
                            .rate = 1.0,
                            .general = general_options_default(),
                            .displacement = displacement_options_default()};
    static const struct argp_child children[] = {
        {&displacement_argp, 0, "Displacement, instead of the scene's own:", 2},
        {&general_argp, 0, "General:", 3},
        {0}};
    static const struct argp argp = {option_list, parse_option, "SCENE -o FILE", documentation, children,
                                     help_filter, NULL};
    argp_parse(&argp, argc, argv, 0, NULL, &options);
    signals_install();
    command_session session;
    int code = session_open(&session, "bake", &options.general);
    if (code == CODE_DONE) code = output_check(&session, options.out);
    loaded_scene loaded = {0};
    method_options method = method_options_default();
    /* No ray is traced: what is made soonest. */
    method.method = "rmip";
    method.rmip_cell = 32;
    if (code == CODE_DONE)
        code = scene_load(&session, options.scene, &options.displacement, &method, &loaded);
    if (code == CODE_DONE) code = bake_loaded(&session, &options, &loaded);
    scene_release(&loaded);
    session_close(&session);
    return code;
}
