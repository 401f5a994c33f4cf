/* bench_options.c: the command line of `knurl bench`. */
#include "bench.h"
#include "values.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    KEY_METHODS = 0x200,
    KEY_RAYS,
    KEY_CALLS,
    KEY_JSON,
    KEY_CSV,
    KEY_ROUNDS,
    KEY_COUNT,
    KEY_SEED,
    KEY_LOD,
    KEY_REFERENCE,
    KEY_FRAME,
    KEY_HEAT_MAP,
    KEY_CAMERA,
    KEY_RMIP_CELL,
    KEY_LIFT,
    KEY_DISPLACED_ONLY,
    KEY_DISP_SCALE,
    KEY_TILE_SCALE
};

const char *const ray_kind_names[RAYS_KINDS + 1] = {
    "primary", "grazing", "diffuse", "diffuse-shuffled", "occlusion", "inside", "inside-shuffled", NULL};

static const struct argp_option option_list[] = {
    {"methods", KEY_METHODS, "A,B,...", 0,
     "Methods with their parameters, e.g. rmip,rmip:bounds=minmax; default every method", 1},
    {"rays", KEY_RAYS, "A,B,...", 0,
     "primary, grazing, diffuse, diffuse-shuffled, occlusion, inside, inside-shuffled, or none; default "
     "primary,grazing,diffuse,occlusion",
     1},
    {"calls", KEY_CALLS, "A,B", 0,
     "single: a call for each ray; batch: calls for blocks of rays; or both; on one thread and on all. "
     "Default: "
     "single on one thread, batch on all",
     1},
    {"frame", KEY_FRAME, "WxHxSPP", 0, "Also time a path-traced picture, e.g. 320x180x4", 1},
    {"json", KEY_JSON, "FILE", 0, "Write the results as JSON; - is standard output", 1},
    {"csv", KEY_CSV, "FILE", 0, "Write the results as CSV; - is standard output", 1},
    {"heat-map", KEY_HEAT_MAP, "FILE.png", 0,
     "Pictures of the steps of primary rays, log scale: FILE.SCENE.N.png for method N from 0", 1},
    {"rounds", KEY_ROUNDS, "N", 0, "Times that methods take turns (default 5); medians are reported", 1},
    {"count", KEY_COUNT, "N", 0, "Rays of each set, 64 to 67108864 (default 100000)", 1},
    {"seed", KEY_SEED, "N", 0, "Other random rays (default 0)", 1},
    {"lift", KEY_LIFT, "X", 0,
     "Start secondary rays this far off the surface, in diagonals of the scene's bounds (default 0), so that "
     "methods with slightly different surfaces do not meet their own at once",
     1},
    {"reference", KEY_REFERENCE, "METHOD", 0,
     "Count disagreement with this method; default rmip, and for rmip itself a variant of it", 1},
    {"camera", KEY_CAMERA, "N|NAME", 0,
     "Camera that primary rays come from; default the first, or one that frames the scene", 1},
    {"lod", KEY_LOD, "X", 0, "Level of detail of all rays (default 0, the finest)", 1},
    {"rmip-cell", KEY_RMIP_CELL, "N", 0, "Texels per side of a cell of the RMIP table: 1 to 32 (default 8)",
     1},
    {"displaced-only", KEY_DISPLACED_ONLY, NULL, 0, "Leave undisplaced meshes out of the scene", 2},
    {"disp-scale", KEY_DISP_SCALE, "X", 0, "Multiply every displacement, offset included", 2},
    {"tile-scale", KEY_TILE_SCALE, "X", 0, "Multiply every map's tiling", 2},
    {0}};

/* Cuts a copy of `text` at its commas; the list is ended by NULL, its strings are one block. */
static char **split_list(struct argp_state *state, const char *option, const char *text, int *count)
{
    size_t length = strlen(text) + 1, most = 2;
    for (const char *place = text; *place; place++) most += *place == ',';
    char **list = malloc(most * sizeof *list + length);
    if (!list) argp_failure(state, CODE_LIMIT, 0, "out of memory");
    char *copy = (char *)(list + most);
    memcpy(copy, text, length);
    *count = 0;
    for (char *place = copy;; place++) {
        list[(*count)++] = place;
        place += strcspn(place, ",");
        bool last = !*place;
        *place = 0;
        if (!*list[*count - 1])
            argp_error(state, "%s: found '%s', expected names with commas between them", option, text);
        if (last) break;
    }
    list[*count] = NULL;
    return list;
}

static void check_method(struct argp_state *state, const char *option, const char *specification)
{
    knurl_error error = {0};
    if (knurl_method_check(specification, NULL, &error) == KNURL_OK) return;
    char list[512] = "";
    size_t used = 0;
    for (int32_t i = 0; i < knurl_method_count(); i++) {
        int more = snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "", knurl_method_name(i));
        if (more > 0 && used + (size_t)more < sizeof list) used += (size_t)more;
    }
    argp_error(state, "%s: %s; methods are %s", option, error.message, list);
}

static void parse_methods(struct argp_state *state, const char *text, bench_options *options)
{
    free(options->methods);
    options->methods = split_list(state, "--methods", text, &options->method_count);
    for (int i = 0; i < options->method_count; i++) check_method(state, "--methods", options->methods[i]);
}

static void parse_rays(struct argp_state *state, const char *text, bench_options *options)
{
    options->kind_count = 0;
    if (strcmp(text, "none") == 0) return;
    int count;
    char **names = split_list(state, "--rays", text, &count);
    for (int i = 0; i < count; i++) {
        ray_kind kind = (ray_kind)value_choice(state, "--rays", names[i], ray_kind_names);
        bool listed = false;
        for (int k = 0; k < options->kind_count; k++) listed = listed || options->kinds[k] == kind;
        if (!listed) options->kinds[options->kind_count++] = kind;
    }
    free(names);
}

static unsigned parse_calls(struct argp_state *state, const char *text)
{
    static const char *const names[] = {"single", "batch", "both", NULL};
    static const unsigned kinds[] = {CALLS_SINGLE, CALLS_BATCH, CALLS_SINGLE | CALLS_BATCH};
    unsigned calls = 0;
    int count;
    char **list = split_list(state, "--calls", text, &count);
    for (int i = 0; i < count; i++) calls |= kinds[value_choice(state, "--calls", list[i], names)];
    free(list);
    return calls;
}

static void parse_frame(struct argp_state *state, const char *text, bench_options *options)
{
    static const char expected[] = "WIDTHxHEIGHTxSAMPLES such as 320x180x4";
    double values[3];
    value_reals(state, "--frame", text, 'x', 3, values, expected);
    for (int i = 0; i < 3; i++)
        if (values[i] != floor(values[i]) || values[i] < 1 || values[i] > 65536)
            argp_error(state, "--frame: found '%s', expected %s", text, expected);
    options->frame_width = (int)values[0];
    options->frame_height = (int)values[1];
    options->frame_samples = (int)values[2];
}

static double parse_scale(struct argp_state *state, const char *option, const char *text)
{
    return value_real(state, option, text, 1e-6, 1e6);
}

static void check_complete(struct argp_state *state, const bench_options *options)
{
    char extension[16] = "";
    if (options->scene_count == 0) argp_error(state, "the scene file is missing");
    if (options->kind_count == 0 && !options->frame_width)
        argp_error(state, "--rays: found 'none' without --frame, so there is nothing to measure");
    if (options->heat_map) path_extension(options->heat_map, extension);
    if (options->heat_map && strcmp(extension, ".png") != 0)
        argp_error(state, "--heat-map: found '%s', expected a name ending in .png", options->heat_map);
    bool primary = false;
    for (int i = 0; i < options->kind_count; i++) primary = primary || options->kinds[i] == RAYS_PRIMARY;
    if (options->heat_map && !primary) argp_error(state, "--heat-map: needs primary among the --rays");
    if (options->json && options->csv && strcmp(options->json, "-") == 0 && strcmp(options->csv, "-") == 0)
        argp_error(state, "--json and --csv: found '-' for both, expected one of them in a file");
}

/* Where results go and what is measured; true if `key` was one of them. */
static bool parse_output(int key, char *argument, struct argp_state *state, bench_options *options)
{
    switch (key) {
    case KEY_METHODS:
        parse_methods(state, argument, options);
        break;
    case KEY_RAYS:
        parse_rays(state, argument, options);
        break;
    case KEY_CALLS:
        options->calls = parse_calls(state, argument);
        break;
    case KEY_JSON:
        options->json = argument;
        break;
    case KEY_CSV:
        options->csv = argument;
        break;
    case KEY_HEAT_MAP:
        options->heat_map = argument;
        break;
    case KEY_FRAME:
        parse_frame(state, argument, options);
        break;
    case KEY_REFERENCE:
        check_method(state, "--reference", argument);
        options->reference = argument;
        break;
    default:
        return false;
    }
    return true;
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    bench_options *options = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->displacement;
        state->child_inputs[1] = &options->general;
        break;
    case KEY_ROUNDS:
        options->rounds = (int)value_integer(state, "--rounds", argument, 1, 1000);
        break;
    case KEY_COUNT:
        options->count = (size_t)value_integer(state, "--count", argument, 64, 1 << 26);
        break;
    case KEY_SEED:
        options->seed = (uint32_t)value_integer(state, "--seed", argument, 0, UINT32_MAX);
        break;
    case KEY_LOD:
        options->lod = value_real(state, "--lod", argument, 0, 32);
        break;
    case KEY_CAMERA:
        options->camera = argument;
        break;
    case KEY_RMIP_CELL:
        options->rmip_cell = (int)value_integer(state, "--rmip-cell", argument, 1, 32);
        if (options->rmip_cell & (options->rmip_cell - 1))
            argp_error(state, "--rmip-cell: found '%s', expected 1, 2, 4, 8, 16 or 32", argument);
        break;
    case KEY_LIFT:
        options->lift = value_real(state, "--lift", argument, 0, 1);
        break;
    case KEY_DISPLACED_ONLY:
        options->displaced_only = true;
        break;
    case KEY_DISP_SCALE:
        options->disp_scale = parse_scale(state, "--disp-scale", argument);
        break;
    case KEY_TILE_SCALE:
        options->tile_scale = parse_scale(state, "--tile-scale", argument);
        break;
    case ARGP_KEY_ARG:
        options->scenes[options->scene_count++] = argument;
        break;
    case ARGP_KEY_END:
        check_complete(state, options);
        break;
    default:
        return parse_output(key, argument, state, options) ? 0 : ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const char documentation[] =
    "Measure intersection methods side by side on the same rays.\v"
    "Every set is traced with one thread and with all (--calls tells how); methods take turns, so that a "
    "busy machine "
    "disturbs all of them alike. Results are also compared with an exact method: hits that are missed "
    "or false, and |dt| relative to the diagonal of the scene's bounds. A method that cannot be built, "
    "say for lack of memory (--memory-limit is for each), gives rows that say why. Ctrl-C keeps the "
    "rows that are finished (status 130).\n\n"
    "Examples:\n"
    "  knurl bench scene.gltf --json results.json\n"
    "  knurl bench a.gltf b.gltf --methods rmip,tfdm --rays primary,diffuse\n"
    "  knurl bench scene.gltf --methods rmip,tfdm --rays none --frame 320x180x4\n";

/* Methods that were not named: all of them, with their default parameters. */
static void all_methods(bench_options *options)
{
    int count = knurl_method_count();
    options->methods = malloc(((size_t)count + 1) * sizeof *options->methods);
    for (int i = 0; options->methods && i < count; i++)
        options->methods[i] = (char *)(uintptr_t)knurl_method_name(i);
    options->method_count = count;
}

void bench_options_parse(int argc, char **argv, bench_options *options)
{
    *options = (bench_options){.rounds = 5,
                               .count = 100000,
                               .kinds = {RAYS_PRIMARY, RAYS_GRAZING, RAYS_DIFFUSE, RAYS_OCCLUSION},
                               .kind_count = 4,
                               .disp_scale = 1,
                               .tile_scale = 1,
                               .general = general_options_default(),
                               .displacement = displacement_options_default()};
    options->scenes = malloc(((size_t)argc + 1) * sizeof *options->scenes);
    static const struct argp_child children[] = {
        {&displacement_argp, 0, "Displacement, instead of the scene's own:", 2},
        {&general_argp, 0, "General:", 3},
        {0}};
    static const struct argp argp = {option_list, parse_option, "SCENE...", documentation,
                                     children,    help_filter,  NULL};
    if (options->scenes) argp_parse(&argp, argc, argv, 0, NULL, options);
    if (options->scenes && !options->methods) all_methods(options);
    if (!options->scenes || !options->methods) {
        fputs("knurl bench: out of memory\n", stderr);
        exit(CODE_LIMIT);
    }
}

void bench_options_free(bench_options *options)
{
    free(options->scenes);
    free(options->methods);
}
