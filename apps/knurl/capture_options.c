/* capture_options.c: the command line of `knurl capture`. */
#include "capture.h"
#include "values.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    KEY_VIEWS = 0x200,
    KEY_FROM,
    KEY_FRUSTUM,
    KEY_FOV,
    KEY_CENTER,
    KEY_NEAR,
    KEY_FAR,
    KEY_CLIP,
    KEY_SIZE,
    KEY_COLOR_SIZE,
    KEY_SAMPLES,
    KEY_CELL,
    KEY_DEPTH
};

static const struct argp_option option_list[] = {
    {0, 0, NULL, 0, "Views:", 1},
    {"out", 'o', "DIR", 0, "Folder for capture.gltf, capture.bin and the maps; made if missing", 0},
    {"views", KEY_VIEWS, "1|6", 0,
     "6 (default): the six faces of a cube around the model, apex in its centre; 1: one relief", 0},
    {"from", KEY_FROM, "AXIS|X,Y,Z", 0,
     "One view: where it is seen from: +x, -x, +y, -y, +z (default), -z, or a direction", 0},
    {"frustum", KEY_FRUSTUM, "NAME", 0,
     "One view: parallel (a box; default), reverse (rays meet behind the model, so that its sides are seen; "
     "default with --fov), perspective (rays leave an eye in front of it)",
     0},
    {"fov", KEY_FOV, "DEG", 0, "One view: angle of the frustum across its wider side (default 40)", 0},
    {"center", KEY_CENTER, "X,Y,Z", 0,
     "Where the axis passes; of six views the apex. Default: the middle of the model's bounds", 0},
    {0, 0, NULL, 0, "What is captured:", 2},
    {"near", KEY_NEAR, "X", 0, "Leave out what is less than X metres behind the front face of the bounds", 0},
    {"far", KEY_FAR, "X", 0, "Leave out what is more than X metres behind it", 0},
    {"clip", KEY_CLIP, "X0,Y0,Z0,X1,Y1,Z1", 0, "Capture only what is in this box of the world", 0},
    {0, 0, NULL, 0, "Maps:", 3},
    {"size", KEY_SIZE, "N", 0, "Texels along the longer side of a height map, 2 to 16384 (default 512)", 0},
    {"color-size", KEY_COLOR_SIZE, "N", 0, "The same for the colour maps (default: as --size)", 0},
    {"samples", KEY_SAMPLES, "N", 0, "N x N colour rays per texel, 1 to 16 (default 2)", 0},
    {"depth", KEY_DEPTH, "png|exr", 0, "16-bit integers over the range of heights (default), or floats", 0},
    {"cell", KEY_CELL, "N", 0,
     "Texels per side of a piece of the base, 4 to 16384 (default 32); empty pieces are left out", 0},
    {0}};

static void parse_from(struct argp_state *state, const char *text, double from[3])
{
    static const char *const axes[] = {"+x", "-x", "+y", "-y", "+z", "-z"};
    static const char expected[] = "+x, -x, +y, -y, +z, -z or three numbers X,Y,Z that are not all 0";
    for (int i = 0; i < 6; i++) {
        if (strcmp(text, axes[i]) != 0) continue;
        from[0] = from[1] = from[2] = 0;
        from[i / 2] = i % 2 ? -1 : 1;
        return;
    }
    value_reals(state, "--from", text, ',', 3, from, expected);
    double length = fabs(from[0]) + fabs(from[1]) + fabs(from[2]);
    if (!(length > 1e-100 && length < 1e100))
        argp_error(state, "--from: found '%s', expected %s", text, expected);
}

static void parse_clip(struct argp_state *state, const char *text, capture_options *options)
{
    static const char expected[] = "six numbers X0,Y0,Z0,X1,Y1,Z1, the first three below the others";
    value_reals(state, "--clip", text, ',', 6, options->clip, expected);
    for (int i = 0; i < 3; i++)
        if (!(options->clip[i] < options->clip[i + 3]))
            argp_error(state, "--clip: found '%s', expected %s", text, expected);
    options->clipped = true;
}

/* What only one kind of view has must not be given to the other and do nothing. */
static void check_complete(struct argp_state *state, capture_options *options, const char *single_only)
{
    if (!options->model) argp_error(state, "the model's file is missing");
    if (!options->folder || !options->folder[0])
        argp_error(state, "-o DIR is missing: where do the maps go?");
    if (options->views == 6 && single_only)
        argp_error(state, "%s: found with six views, expected --views 1", single_only);
    if (options->fov > 0 && options->frustum == CAPTURE_PARALLEL)
        argp_error(state, "--fov: found with --frustum parallel, expected reverse or perspective");
    if (!(options->near_cut < options->far_cut))
        argp_error(state, "--near: found %g, expected less than --far %g", options->near_cut,
                   options->far_cut);
    if (!(options->fov > 0)) options->fov = 40 * 3.14159265358979323846 / 180;
}

typedef struct parser {
    capture_options *options;
    const char *single_only; /* an option that only one view has, if given */
    bool frustum_given;
} parser;

static void parse_maps(int key, char *argument, struct argp_state *state, capture_options *options)
{
    static const char *const depths[] = {"png", "exr", NULL};
    switch (key) {
    case KEY_SIZE:
        options->size = (int32_t)value_integer(state, "--size", argument, 2, 16384);
        break;
    case KEY_COLOR_SIZE:
        options->color_size = (int32_t)value_integer(state, "--color-size", argument, 2, 16384);
        break;
    case KEY_SAMPLES:
        options->samples = (int32_t)value_integer(state, "--samples", argument, 1, 16);
        break;
    case KEY_CELL:
        options->cell = (int32_t)value_integer(state, "--cell", argument, 4, 16384);
        break;
    case KEY_DEPTH:
        options->float_depth = value_choice(state, "--depth", argument, depths) == 1;
        break;
    default:
        break;
    }
}

/* Options of the views; true if `key` was one of them. */
static bool parse_view(int key, char *argument, struct argp_state *state, parser *p)
{
    static const char *const counts[] = {"1", "6", NULL};
    static const char *const frusta[] = {"parallel", "reverse", "perspective", NULL};
    capture_options *options = p->options;
    switch (key) {
    case KEY_VIEWS:
        options->views = value_choice(state, "--views", argument, counts) ? 6 : 1;
        break;
    case KEY_FROM:
        parse_from(state, argument, options->from);
        p->single_only = "--from";
        break;
    case KEY_FRUSTUM:
        options->frustum = (capture_frustum)value_choice(state, "--frustum", argument, frusta);
        p->single_only = "--frustum";
        p->frustum_given = true;
        break;
    case KEY_FOV:
        options->fov = value_real(state, "--fov", argument, 1, 170) * 3.14159265358979323846 / 180;
        p->single_only = "--fov";
        break;
    case KEY_CENTER:
        value_reals(state, "--center", argument, ',', 3, options->center, "three numbers X,Y,Z");
        break;
    case KEY_NEAR:
        options->near_cut = value_real(state, "--near", argument, 0, INFINITY);
        break;
    case KEY_FAR:
        options->far_cut = value_real(state, "--far", argument, 0, INFINITY);
        break;
    case KEY_CLIP:
        parse_clip(state, argument, options);
        break;
    default:
        return false;
    }
    return true;
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    parser *p = state->input;
    capture_options *options = p->options;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->displacement;
        state->child_inputs[1] = &options->method;
        state->child_inputs[2] = &options->general;
        break;
    case 'o':
        options->folder = argument;
        break;
    case KEY_SIZE:
    case KEY_COLOR_SIZE:
    case KEY_SAMPLES:
    case KEY_CELL:
    case KEY_DEPTH:
        parse_maps(key, argument, state, options);
        break;
    case ARGP_KEY_ARG:
        if (options->model)
            argp_error(state, "found '%s' after model '%s', expected one model", argument, options->model);
        options->model = argument;
        break;
    case ARGP_KEY_END:
        if (options->fov > 0 && !p->frustum_given) options->frustum = CAPTURE_REVERSE;
        check_complete(state, options, p->single_only);
        break;
    default:
        return parse_view(key, argument, state, p) ? 0 : ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const char documentation[] =
    "Turn a model into textures with depth (relief textures, Baboud and Decoret 2006) and write a glTF of "
    "them, which `knurl render' and the other commands take like any displaced scene.\v"
    "Each texel of a view is one ray into the model; its first hit gives the height, its base colour, "
    "without light, the colour. Where a ray hits nothing the picture is cut out. What no view sees is not "
    "captured, and where the depth jumps between two texels the surface is drawn across.\n\n"
    "Examples:\n"
    "  knurl capture statue.obj -o relief              then: knurl render relief/capture.gltf -o a.png\n"
    "  knurl capture statue.obj -o relief --size 256 --color-size 1024\n"
    "  knurl capture facade.gltf -o relief --views 1 --from -x\n"
    "  knurl capture house.gltf -o relief --views 1 --from +y --fov 60\n";

void capture_options_parse(int argc, char **argv, capture_options *options)
{
    *options = (capture_options){.views = 6,
                                 .from = {0, 0, 1},
                                 .center = {NAN, NAN, NAN},
                                 .far_cut = INFINITY,
                                 .size = 512,
                                 .samples = 2,
                                 .cell = 32,
                                 .general = general_options_default(),
                                 .method = method_options_default(),
                                 .displacement = displacement_options_default()};
    static const struct argp_child children[] = {
        {&displacement_argp, 0, "Displacement, instead of the model's own:", 4},
        {&method_argp, 0, "Method:", 5},
        {&general_argp, 0, "General:", 6},
        {0}};
    static const struct argp argp = {option_list, parse_option, "MODEL -o DIR", documentation, children,
                                     help_filter, NULL};
    parser p = {.options = options};
    argp_parse(&argp, argc, argv, 0, NULL, &p);
}
