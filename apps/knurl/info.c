/* info.c: `knurl info`. */
#include "info.h"
#include "commands.h"

#include <stdio.h>
#include <string.h>

enum { KEY_JSON = 0x200, KEY_TIMING };

static const struct argp_option option_list[] = {
    {"json", KEY_JSON, NULL, 0, "Print JSON; its keys are stable", 1},
    {"timing", KEY_TIMING, NULL, 0,
     "Measure: for a map, building its bounds against copying its bytes; for a scene, loading and building",
     1},
    {0}};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    info_options *options = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->displacement;
        state->child_inputs[1] = &options->method;
        state->child_inputs[2] = &options->general;
        break;
    case KEY_JSON:
        options->json = true;
        break;
    case KEY_TIMING:
        options->timing = true;
        break;
    case ARGP_KEY_ARG:
        if (options->path)
            argp_error(state, "found '%s' after file '%s', expected one file", argument, options->path);
        options->path = argument;
        break;
    case ARGP_KEY_END:
        if (!options->path) argp_error(state, "the file is missing");
        break;
    default:
        return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const char documentation[] =
    "Describe a scene, an image or a height map.\v"
    "For a scene: its objects, displacement and memory beside what a full tessellation (one vertex per "
    "texel) would need; triangles that need special care (folded, flat in texture space, degenerate); "
    "texture seams; textures, cameras, lights, warnings. For an image: size, range, and the bytes of the "
    "structures built on it when it displaces a surface.\n\n"
    "Examples:\n"
    "  knurl info scene.gltf\n"
    "  knurl info ball.obj --disp rock.png --tile 16x16\n"
    "  knurl info rock.png --timing\n"
    "  knurl info scene.gltf --json | python3 -m json.tool\n";

/* ---- what kind of file ---- */

static bool extension_of_image(const char *path)
{
    static const char *const known[] = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr",
                                        ".hdr", ".pgm", ".ppm",  ".pnm", ".pfm",  ".pic"};
    char extension[16];
    path_extension(path, extension);
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (strcmp(extension, known[i]) == 0) return true;
    return false;
}

/* By the first bytes, for names that do not tell. */
static bool starts_like_image(const char *path)
{
    static const struct {
        const char *bytes;
        size_t count;
    } signatures[] = {{"\x89PNG", 4},
                      {"\xff\xd8\xff", 3},
                      {"II*\0", 4},
                      {"MM\0*", 4},
                      {"\x76\x2f\x31\x01", 4},
                      {"#?", 2},
                      {"P2", 2},
                      {"P3", 2},
                      {"P5", 2},
                      {"P6", 2},
                      {"PF", 2},
                      {"Pf", 2}};
    char first[4] = {0};
    FILE *file = fopen(path, "rb");
    if (!file) return false;
    size_t got = fread(first, 1, sizeof first, file);
    fclose(file);
    for (size_t i = 0; i < sizeof signatures / sizeof signatures[0]; i++)
        if (got >= signatures[i].count && memcmp(first, signatures[i].bytes, signatures[i].count) == 0)
            return true;
    return false;
}

/* ---- helpers for the printers ---- */

const char *info_count_text(char text[32], double count)
{
    char plain[32];
    snprintf(plain, sizeof plain, "%.0f", count);
    size_t length = strlen(plain), out = 0;
    if (count >= 1e18 || count < 0) return strcpy(text, plain);
    for (size_t i = 0; i < length; i++) {
        if (i > 0 && (length - i) % 3 == 0) text[out++] = ',';
        text[out++] = plain[i];
    }
    text[out] = 0;
    return text;
}

double info_number(const json_t *object, const char *key)
{
    return json_number_value(json_object_get(object, key));
}

const char *info_text(const json_t *object, const char *key)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

int info_command(int argc, char **argv)
{
    info_options options = {.general = general_options_default(),
                            .method = method_options_default(),
                            .displacement = displacement_options_default()};
    static const struct argp_child children[] = {
        {&displacement_argp, 0, "Displacement, instead of the scene's own:", 2},
        {&method_argp, 0, "Method:", 3},
        {&general_argp, 0, "General:", 4},
        {0}};
    static const struct argp argp = {option_list, parse_option, "FILE", documentation,
                                     children,    help_filter,  NULL};
    argp_parse(&argp, argc, argv, 0, NULL, &options);
    signals_install();
    command_session session;
    int code = session_open(&session, "info", &options.general);
    bool image = extension_of_image(options.path) || starts_like_image(options.path);
    json_t *root = NULL;
    if (code == CODE_DONE)
        code = image ? info_gather_image(&session, &options, &root)
                     : info_gather_scene(&session, &options, &root);
    if (code == CODE_DONE && options.json) {
        code = json_save(&session, root, "-");
    } else if (code == CODE_DONE) {
        if (image)
            info_print_image(root);
        else
            info_print_scene(root);
        json_decref(root);
    }
    session_close(&session);
    return code;
}
