/* options.c: the option groups that several commands share. */
#include "common.h"
#include "values.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    KEY_THREADS = 0x100,
    KEY_MEMORY_LIMIT,
    KEY_METHOD,
    KEY_ACCEL_BUDGET,
    KEY_RMIP_CELL,
    KEY_DISP,
    KEY_DISP_FACTOR,
    KEY_DISP_OFFSET,
    KEY_TILE,
    KEY_WRAP,
    KEY_COLOR,
    KEY_NO_DISP
};

char *help_filter(int key, const char *text, void *input)
{
    (void)input;
    return key == ARGP_KEY_HELP_DUP_ARGS_NOTE ? NULL : (char *)(uintptr_t)text;
}

/* ---- general ---- */

general_options general_options_default(void)
{
    return (general_options){0};
}

static error_t parse_general(int key, char *argument, struct argp_state *state)
{
    general_options *options = state->input;
    switch (key) {
    case KEY_THREADS:
        options->threads = (int)value_integer(state, "--threads", argument, 0, 1024);
        break;
    case KEY_MEMORY_LIMIT:
        options->memory_limit = value_size(state, "--memory-limit", argument);
        break;
    case 'q':
        options->quiet = true;
        break;
    case 'v':
        options->verbose = true;
        break;
    default:
        return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const struct argp_option general_list[] = {
    {"threads", KEY_THREADS, "N", 0, "Worker threads; 0 (default): one per core. Results do not depend on it",
     0},
    {"memory-limit", KEY_MEMORY_LIMIT, "SIZE", 0, "Give up (status 4) rather than hold more, e.g. 500M or 2G",
     0},
    {"quiet", 'q', NULL, 0, "No progress, no warnings; errors only", 0},
    {"verbose", 'v', NULL, 0, "Say more about what is done", 0},
    {0}};

const struct argp general_argp = {general_list, parse_general, NULL, NULL, NULL, NULL, NULL};

void take_scene(struct argp_state *state, const char *argument, const char **scene)
{
    if (*scene) argp_error(state, "found '%s' after scene '%s', expected one scene", argument, *scene);
    *scene = argument;
}

/* ---- method ---- */

method_options method_options_default(void)
{
    return (method_options){.budget = NAN};
}

static void check_method(struct argp_state *state, const char *specification)
{
    knurl_error error = {0};
    if (knurl_method_check(specification, NULL, &error) == KNURL_OK) return;
    char list[512] = "";
    size_t used = 0;
    for (int32_t i = 0; i < knurl_method_count(); i++) {
        int more = snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "", knurl_method_name(i));
        if (more > 0 && used + (size_t)more < sizeof list) used += (size_t)more;
    }
    argp_error(state, "--method: %s; methods are %s", error.message, list);
}

/* MiB. Zero is a size here. */
static double parse_budget(struct argp_state *state, const char *text)
{
    uint64_t bytes = strcmp(text, "0") == 0 ? 0 : value_size(state, "--accel-budget", text);
    if (bytes > UINT64_C(1) << 40) argp_error(state, "--accel-budget: found '%s', expected 1T at most", text);
    return (double)bytes / 1048576.0;
}

/* Adds --accel-budget to the method's parameters. */
static void take_budget(struct argp_state *state, method_options *options)
{
    if (isnan(options->budget)) return;
    const char *method = options->method ? options->method : knurl_surface_def_default().method;
    size_t name = strcspn(method, ":");
    if (name != 4 || strncmp(method, "fast", name) != 0)
        argp_error(state, "--accel-budget: found with --method %s, expected method fast", method);
    if (strstr(method + name, ":budget="))
        argp_error(state, "--accel-budget: found beside --method %s, expected one budget", method);
    int length =
        snprintf(options->budgeted, sizeof options->budgeted, "%s:budget=%.17g", method, options->budget);
    if (length < 0 || (size_t)length >= sizeof options->budgeted)
        argp_error(state, "--method: found %zu characters, expected under %zu with --accel-budget",
                   strlen(method), sizeof options->budgeted - 32);
    options->method = options->budgeted;
}

static error_t parse_method(int key, char *argument, struct argp_state *state)
{
    method_options *options = state->input;
    switch (key) {
    case KEY_METHOD:
        check_method(state, argument);
        options->method = argument;
        break;
    case KEY_ACCEL_BUDGET:
        options->budget = parse_budget(state, argument);
        break;
    case KEY_RMIP_CELL: {
        options->rmip_cell = (int)value_integer(state, "--rmip-cell", argument, 1, 32);
        if (options->rmip_cell & (options->rmip_cell - 1))
            argp_error(state, "--rmip-cell: found '%s', expected 1, 2, 4, 8, 16 or 32", argument);
        break;
    }
    case ARGP_KEY_END:
        take_budget(state, options);
        break;
    default:
        return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const struct argp_option method_list[] = {
    {"method", KEY_METHOD, "NAME[:PARAMETER=VALUE...]", 0,
     "How rays meet the surface, e.g. rmip:marching-scale=4; default fast; `knurl methods' lists methods and "
     "parameters",
     0},
    {"accel-budget", KEY_ACCEL_BUDGET, "SIZE", 0,
     "Method fast: bytes for its hierarchy over each surface, e.g. 64M; 0: base triangles only, smallest and "
     "slowest. Default: as many as the map's samples",
     0},
    {"rmip-cell", KEY_RMIP_CELL, "N", 0,
     "Method rmip: texels per side of a cell of its table: 1 to 32, a power of two (default 8). Larger is "
     "smaller and slower",
     0},
    {0}};

const struct argp method_argp = {method_list, parse_method, NULL, NULL, NULL, NULL, NULL};

/* ---- displacement ---- */

displacement_options displacement_options_default(void)
{
    return (displacement_options){.factor = NAN, .offset = NAN, .tile_u = NAN, .tile_v = NAN, .wrap = -1};
}

static error_t parse_displacement(int key, char *argument, struct argp_state *state)
{
    static const char *const wrap_names[] = {"repeat", "mirror", "clamp", NULL};
    displacement_options *options = state->input;
    switch (key) {
    case KEY_DISP:
        options->map = argument;
        break;
    case KEY_DISP_FACTOR:
        options->factor = value_real(state, "--disp-factor", argument, -INFINITY, INFINITY);
        break;
    case KEY_DISP_OFFSET:
        options->offset = value_real(state, "--disp-offset", argument, -INFINITY, INFINITY);
        break;
    case KEY_TILE: {
        double tile[2];
        value_reals(state, "--tile", argument, 'x', 2, tile, "two numbers such as 4x4");
        if (!(tile[0] != 0 && tile[1] != 0))
            argp_error(state, "--tile: found '%s', expected numbers other than zero", argument);
        options->tile_u = tile[0];
        options->tile_v = tile[1];
        break;
    }
    case KEY_WRAP:
        options->wrap = value_choice(state, "--wrap", argument, wrap_names);
        break;
    case KEY_COLOR:
        options->color = argument;
        break;
    case KEY_NO_DISP:
        options->remove = true;
        break;
    default:
        return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const struct argp_option displacement_list[] = {
    {"disp", KEY_DISP, "MAP", 0, "Displace every material by this image (its red channel)", 0},
    {"disp-factor", KEY_DISP_FACTOR, "X", 0,
     "Height of map value 1, in the units of the mesh: height = offset + factor * map", 0},
    {"disp-offset", KEY_DISP_OFFSET, "X", 0, "Height of map value 0", 0},
    {"tile", KEY_TILE, "NxM", 0, "Repeat the map N times along u and M times along v; takes no memory", 0},
    {"wrap", KEY_WRAP, "MODE", 0, "Beyond the map's edge: repeat, mirror or clamp", 0},
    {"color", KEY_COLOR, "MAP", 0, "Base colour of every material from this image", 0},
    {"no-disp", KEY_NO_DISP, NULL, 0, "Drop the displacement that the scene asks for", 0},
    {0}};

const struct argp displacement_argp = {displacement_list, parse_displacement, NULL, NULL, NULL, NULL, NULL};
