/* render_options.c: the command line of `knurl render`. */
#include "render.h"
#include "values.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    KEY_WIDTH = 0x200,
    KEY_HEIGHT,
    KEY_SPP,
    KEY_SEED,
    KEY_CAMERA,
    KEY_ENV,
    KEY_ENV_ROTATION,
    KEY_ENV_INTENSITY,
    KEY_BACKGROUND,
    KEY_EXPOSURE,
    KEY_INTEGRATOR,
    KEY_MAX_DEPTH,
    KEY_CLAMP,
    KEY_AO_DISTANCE,
    KEY_CROP,
    KEY_AOV,
    KEY_LOD,
    KEY_STATS
};

static const struct argp_option option_list[] = {
    {0, 0, NULL, 0, "Picture:", 1},
    {"out", 'o', "FILE", 0, "Picture to write: .png .jpg .ppm (for screens) or .exr .hdr .pfm .tif (linear)",
     0},
    {"width", KEY_WIDTH, "N", 0, "Pixels across (default 960)", 0},
    {"height", KEY_HEIGHT, "N", 0, "Pixels down (default 540)", 0},
    {"spp", KEY_SPP, "N", 0, "Samples per pixel (default 64); four times as many halve the noise", 0},
    {"crop", KEY_CROP, "X,Y,W,H", 0, "Trace only this part of the picture, in pixels from the top left", 0},
    {"exposure", KEY_EXPOSURE, "STOPS", 0, "Brighten (or darken) by powers of two; screen formats only", 0},
    {"aov", KEY_AOV, "LIST", 0,
     "Also write depth, position, geometric_normal, shading_normal, albedo, uv, object, triangle, steps "
     "(a,b,... or all): as layers of an .exr, else as OUT.NAME.exr",
     0},
    {"stats", KEY_STATS, "FILE", 0, "Write times, rays and bytes as JSON; - is standard output", 0},
    {0, 0, NULL, 0, "Camera and light:", 2},
    {"camera", KEY_CAMERA, "N|NAME", 0,
     "Camera of the scene, by number from 0 or by name; default the first, or one that frames the scene", 0},
    {"env", KEY_ENV, "FILE", 0, "Light from this latitude-longitude image (.exr, .hdr, ...)", 0},
    {"env-rotation", KEY_ENV_ROTATION, "DEG", 0, "Turn it about the vertical axis", 0},
    {"env-intensity", KEY_ENV_INTENSITY, "X", 0, "Multiply its light (default 1)", 0},
    {"background", KEY_BACKGROUND, "R,G,B|env", 0,
     "What the camera sees beyond the scene: a linear colour, or the environment (default)", 0},
    {0, 0, NULL, 0, "Light transport:", 3},
    {"integrator", KEY_INTEGRATOR, "NAME", 0,
     "path: full global illumination (default); ao: ambient occlusion; primary: normals only", 0},
    {"max-depth", KEY_MAX_DEPTH, "N", 0, "Bounces of light (default 8)", 0},
    {"clamp", KEY_CLAMP, "X", 0,
     "Largest radiance of an indirect sample: less noise, a little less light; 0 (default): none", 0},
    {"ao-distance", KEY_AO_DISTANCE, "X", 0,
     "How far ao looks, in metres; default a tenth of the scene's size", 0},
    {"seed", KEY_SEED, "N", 0, "Another noise pattern; the same seed gives the same picture, bit for bit", 0},
    {"lod", KEY_LOD, "auto|X", 0,
     "Level of detail: 0 (default) is the finest, auto chooses by distance, fractions blend", 0},
    {0}};

const char render_formats[] = ".png, .jpg, .ppm, .exr, .hdr, .pfm or .tif";

bool render_format_known(const char *path)
{
    static const char *const known[] = {".png", ".jpg", ".jpeg", ".ppm", ".exr",
                                        ".hdr", ".pfm", ".tif",  ".tiff"};
    char extension[16];
    path_extension(path, extension);
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (strcmp(extension, known[i]) == 0) return true;
    return false;
}

static uint32_t parse_aovs(struct argp_state *state, const char *text)
{
    uint32_t bits = 0;
    for (const char *place = text;;) {
        size_t length = strcspn(place, ",");
        uint32_t found = 0;
        if (length == 3 && memcmp(place, "all", 3) == 0) found = (1u << KNURL_AOV_COUNT) - 1;
        for (int32_t i = 0; i < KNURL_AOV_COUNT; i++) {
            const char *name = knurl_aov_name(i);
            if (strlen(name) == length && memcmp(place, name, length) == 0) found = 1u << i;
        }
        if (!found) {
            char list[256] = "all";
            size_t used = 3;
            for (int32_t i = 0; i < KNURL_AOV_COUNT; i++) {
                int more = snprintf(list + used, sizeof list - used, ", %s", knurl_aov_name(i));
                if (more > 0 && used + (size_t)more < sizeof list) used += (size_t)more;
            }
            argp_error(state, "--aov: found '%.*s', expected some of %s", (int)length, place, list);
        }
        bits |= found;
        if (!place[length]) return bits;
        place += length + 1;
    }
}

static void parse_crop(struct argp_state *state, const char *text, knurl_render_def *def)
{
    double values[4];
    static const char expected[] = "four whole numbers X,Y,W,H with W and H above 0";
    value_reals(state, "--crop", text, ',', 4, values, expected);
    for (int i = 0; i < 4; i++)
        if (values[i] != floor(values[i]) || values[i] < (i < 2 ? 0 : 1) || values[i] > 65536)
            argp_error(state, "--crop: found '%s', expected %s", text, expected);
    def->crop_x = (int32_t)values[0];
    def->crop_y = (int32_t)values[1];
    def->crop_width = (int32_t)values[2];
    def->crop_height = (int32_t)values[3];
}

static void parse_background(struct argp_state *state, const char *text, knurl_render_def *def)
{
    def->environment_hidden = strcmp(text, "env") != 0;
    if (!def->environment_hidden) return;
    static const char expected[] = "three numbers R,G,B not below 0, or env";
    value_reals(state, "--background", text, ',', 3, def->background, expected);
    for (int i = 0; i < 3; i++)
        if (def->background[i] < 0)
            argp_error(state, "--background: found '%s', expected %s", text, expected);
}

static void parse_lod(struct argp_state *state, const char *text, knurl_render_def *def)
{
    if (strcmp(text, "auto") == 0) {
        def->lod_mode = KNURL_LOD_AUTO;
        return;
    }
    def->lod = value_real(state, "--lod", text, 0, 32);
    def->lod_mode = def->lod > 0 ? KNURL_LOD_FIXED : KNURL_LOD_FINEST;
}

static void check_complete(struct argp_state *state, const render_options *options)
{
    const knurl_render_def *def = &options->def;
    if (!options->scene) argp_error(state, "the scene file is missing");
    if (!options->out) argp_error(state, "-o FILE is missing: where does the picture go?");
    if (!render_format_known(options->out))
        argp_error(state, "--out: found '%s', expected a name ending in %s", options->out, render_formats);
    if (def->crop_width &&
        (def->crop_x + def->crop_width > def->width || def->crop_y + def->crop_height > def->height))
        argp_error(state, "--crop: found %d,%d,%d,%d, expected a part of the %d x %d pixels", def->crop_x,
                   def->crop_y, def->crop_width, def->crop_height, def->width, def->height);
}

/* Options of light transport and light; true if `key` was one of them. */
static bool parse_light(int key, const char *argument, struct argp_state *state, render_options *options)
{
    static const char *const integrators[] = {"path", "ao", "primary", NULL};
    static const double degree = 3.14159265358979323846 / 180;
    knurl_render_def *def = &options->def;
    switch (key) {
    case KEY_CAMERA:
        options->camera = argument;
        break;
    case KEY_ENV:
        options->environment = argument;
        break;
    case KEY_ENV_ROTATION:
        def->environment_rotation = degree * value_real(state, "--env-rotation", argument, -36000, 36000);
        break;
    case KEY_ENV_INTENSITY:
        def->environment_intensity = value_real(state, "--env-intensity", argument, 0, 1e9);
        break;
    case KEY_BACKGROUND:
        parse_background(state, argument, def);
        break;
    case KEY_INTEGRATOR:
        def->integrator = (knurl_integrator)value_choice(state, "--integrator", argument, integrators);
        break;
    case KEY_MAX_DEPTH:
        def->max_depth = (int32_t)value_integer(state, "--max-depth", argument, 1, 1024);
        break;
    case KEY_CLAMP:
        def->clamp = value_real(state, "--clamp", argument, 0, 1e30);
        break;
    case KEY_AO_DISTANCE:
        def->ao_distance = value_real(state, "--ao-distance", argument, 0, INFINITY);
        break;
    case KEY_SEED:
        def->seed = (uint32_t)value_integer(state, "--seed", argument, 0, UINT32_MAX);
        break;
    case KEY_LOD:
        parse_lod(state, argument, def);
        break;
    default:
        return false;
    }
    return true;
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    render_options *options = state->input;
    knurl_render_def *def = &options->def;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->displacement;
        state->child_inputs[1] = &options->method;
        state->child_inputs[2] = &options->general;
        break;
    case 'o':
        options->out = argument;
        break;
    case KEY_WIDTH:
        def->width = (int32_t)value_integer(state, "--width", argument, 1, 65536);
        break;
    case KEY_HEIGHT:
        def->height = (int32_t)value_integer(state, "--height", argument, 1, 65536);
        break;
    case KEY_SPP:
        def->samples = (int32_t)value_integer(state, "--spp", argument, 1, 1 << 20);
        break;
    case KEY_CROP:
        parse_crop(state, argument, def);
        break;
    case KEY_EXPOSURE:
        options->exposure = value_real(state, "--exposure", argument, -100, 100);
        break;
    case KEY_AOV:
        def->aovs = parse_aovs(state, argument);
        break;
    case KEY_STATS:
        options->stats = argument;
        break;
    case ARGP_KEY_ARG:
        take_scene(state, argument, &options->scene);
        break;
    case ARGP_KEY_END:
        check_complete(state, options);
        break;
    default:
        return parse_light(key, argument, state, options) ? 0 : ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const char documentation[] =
    "Make a picture of a scene: glTF (.gltf, .glb), OBJ with MTL, PLY, STL and other meshes.\v"
    "Screen formats get a filmic tone curve and sRGB; linear formats hold radiance as it is, and an .exr "
    "can hold the AOVs as layers. Ctrl-C stops and saves the samples done so far (status 130); a second "
    "Ctrl-C stops at once.\n\n"
    "Examples:\n"
    "  knurl render scene.gltf -o picture.png\n"
    "  knurl render scene.glb -o frame.exr --aov depth,albedo --camera 1\n"
    "  knurl render scene.gltf -o fast.png --width 480 --height 270 --spp 8\n"
    "  knurl render ball.obj --disp rock.png --disp-factor 0.1 -o ball.png\n";

void render_options_parse(int argc, char **argv, render_options *options)
{
    memset(options, 0, sizeof *options);
    options->def = knurl_render_def_default();
    options->general = general_options_default();
    options->method = method_options_default();
    options->displacement = displacement_options_default();
    static const struct argp_child children[] = {
        {&displacement_argp, 0, "Displacement, instead of the scene's own:", 4},
        {&method_argp, 0, "Method:", 5},
        {&general_argp, 0, "General:", 6},
        {0}};
    static const struct argp argp = {option_list, parse_option, "SCENE -o FILE", documentation, children,
                                     help_filter, NULL};
    argp_parse(&argp, argc, argv, 0, NULL, options);
}
