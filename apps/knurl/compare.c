/* compare.c: `knurl compare`, the difference of two images. */
#include "commands.h"
#include "heat.h"
#include "json_file.h"
#include "values.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { KEY_MAP = 0x200, KEY_MAX_RMSE, KEY_MIN_PSNR, KEY_MAX_ABS, KEY_MAX_RELMSE, KEY_JSON };

typedef struct compare_options {
    const char *a, *b, *map;
    double max_rmse, min_psnr, max_abs, max_relmse; /* NaN: not asked for */
    bool json;
    general_options general;
} compare_options;

static const struct argp_option option_list[] = {
    {"map", KEY_MAP, "FILE", 0,
     "Write the differences as a picture: a .png and the like in heat colours, an .exr, .pfm or .hdr as they "
     "are",
     1},
    {"max-rmse", KEY_MAX_RMSE, "X", 0, "Fail (status 1) if the root mean square difference is larger", 1},
    {"max-abs", KEY_MAX_ABS, "X", 0, "Fail if the difference of any one sample is larger", 1},
    {"max-relmse", KEY_MAX_RELMSE, "X", 0, "Fail if the mean of (a - b)^2 / (b^2 + 0.01) is larger", 1},
    {"min-psnr", KEY_MIN_PSNR, "DB", 0, "Fail if the peak signal-to-noise ratio is smaller", 1},
    {"json", KEY_JSON, NULL, 0, "Print JSON", 1},
    {0}};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    compare_options *options = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->general;
        break;
    case KEY_MAP:
        options->map = argument;
        break;
    case KEY_MAX_RMSE:
        options->max_rmse = value_real(state, "--max-rmse", argument, 0, INFINITY);
        break;
    case KEY_MIN_PSNR:
        options->min_psnr = value_real(state, "--min-psnr", argument, -INFINITY, INFINITY);
        break;
    case KEY_MAX_ABS:
        options->max_abs = value_real(state, "--max-abs", argument, 0, INFINITY);
        break;
    case KEY_MAX_RELMSE:
        options->max_relmse = value_real(state, "--max-relmse", argument, 0, INFINITY);
        break;
    case KEY_JSON:
        options->json = true;
        break;
    case ARGP_KEY_ARG:
        if (!options->a)
            options->a = argument;
        else if (!options->b)
            options->b = argument;
        else
            argp_error(state, "found '%s', expected two images only", argument);
        break;
    case ARGP_KEY_END:
        if (!options->b) argp_error(state, "expected two images, A and B");
        break;
    default:
        return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

static const char documentation[] =
    "Compare image A with reference B, sample by sample.\v"
    "Values are compared as the files hold them: integers scaled to 0..1, floats as they are. If only one "
    "image has an alpha channel, it is left out. Samples that are not finite in one image only are counted, "
    "and fail every threshold. Images of different sizes end with status 1.\n\n"
    "Examples:\n"
    "  knurl compare new.png reference.png --min-psnr 40 --map difference.png\n"
    "  knurl compare new.exr reference.exr --max-relmse 0.01 && echo same\n";

/* ---- preparing ---- */

/* Leaves out the last channel, the alpha. */
static knurl_status drop_alpha(knurl_context *context, knurl_image **image, knurl_error *error)
{
    int32_t channels = knurl_image_channels(*image);
    size_t sample = (size_t)knurl_image_format(*image), pixel = sample * (size_t)channels;
    size_t pixels = (size_t)knurl_image_width(*image) * (size_t)knurl_image_height(*image);
    const unsigned char *from = knurl_image_samples(*image);
    unsigned char *samples = malloc(pixels * (pixel - sample));
    if (!samples) {
        error->status = KNURL_ERROR_MEMORY;
        snprintf(error->message, sizeof error->message, "out of memory for the images");
        return error->status;
    }
    for (size_t i = 0; i < pixels; i++)
        memcpy(samples + i * (pixel - sample), from + i * pixel, pixel - sample);
    knurl_image *smaller = NULL;
    knurl_status status =
        knurl_image_create(context, knurl_image_width(*image), knurl_image_height(*image), channels - 1,
                           knurl_image_format(*image), samples, &smaller, error);
    free(samples);
    if (status != KNURL_OK) return status;
    knurl_image_release(*image);
    *image = smaller;
    return KNURL_OK;
}

static int prepare(command_session *session, const compare_options *options, knurl_image **a, knurl_image **b)
{
    knurl_error error = {0};
    if (knurl_image_load(session->context, options->a, a, &error) != KNURL_OK ||
        knurl_image_load(session->context, options->b, b, &error) != KNURL_OK)
        return session_fail(session, &error);
    if (knurl_image_width(*a) != knurl_image_width(*b) || knurl_image_height(*a) != knurl_image_height(*b))
        return session_fail_with(session, CODE_CHECK, "sizes differ: %s is %d x %d, %s is %d x %d",
                                 options->a, (int)knurl_image_width(*a), (int)knurl_image_height(*a),
                                 options->b, (int)knurl_image_width(*b), (int)knurl_image_height(*b));
    int32_t channels_a = knurl_image_channels(*a), channels_b = knurl_image_channels(*b);
    knurl_image **longer = channels_a > channels_b ? a : b;
    int32_t more = channels_a > channels_b ? channels_a : channels_b;
    if (more % 2 == 0 && abs(channels_a - channels_b) == 1) {
        session_note(session, "knurl: only one image has an alpha channel, which is left out");
        if (drop_alpha(session->context, longer, &error) != KNURL_OK) return session_fail(session, &error);
    } else if (channels_a != channels_b) {
        return session_fail_with(session, CODE_CHECK, "channels differ: %s has %d, %s has %d", options->a,
                                 (int)channels_a, options->b, (int)channels_b);
    }
    if ((knurl_image_format(*a) == KNURL_PIXEL_F32) != (knurl_image_format(*b) == KNURL_PIXEL_F32))
        session_note(session,
                     "knurl: warning: one image holds integers (screen colours, usually) and one floats "
                     "(linear, usually)");
    return CODE_DONE;
}

/* ---- results ---- */

/* White is the largest difference; the square root keeps small ones visible. */
static knurl_status heat_map(knurl_context *context, const knurl_image *map, double largest,
                             knurl_image **heat, knurl_error *error)
{
    int32_t width = knurl_image_width(map), height = knurl_image_height(map);
    size_t pixels = (size_t)width * (size_t)height;
    uint8_t *colors = malloc(pixels * 3);
    if (!colors) {
        error->status = KNURL_ERROR_MEMORY;
        snprintf(error->message, sizeof error->message, "out of memory for the difference map");
        return error->status;
    }
    const float *values = knurl_image_samples(map);
    for (size_t i = 0; i < pixels; i++) {
        double value = (double)values[i];
        heat_color(isfinite(value) ? (largest > 0 ? sqrt(value / largest) : 0) : 1, colors + 3 * i);
    }
    knurl_status status = knurl_image_create(context, width, height, 3, KNURL_PIXEL_U8, colors, heat, error);
    free(colors);
    return status;
}

static int save_map(command_session *session, const compare_options *options, const knurl_image *map,
                    double largest)
{
    knurl_error error = {0};
    char extension[16];
    path_extension(options->map, extension);
    if (strcmp(extension, ".exr") == 0 || strcmp(extension, ".pfm") == 0 || strcmp(extension, ".hdr") == 0) {
        if (knurl_image_save(session->context, map, options->map, &error) != KNURL_OK)
            return session_fail(session, &error);
        return CODE_DONE;
    }
    knurl_image *heat = NULL;
    knurl_status status = heat_map(session->context, map, largest, &heat, &error);
    if (status == KNURL_OK) status = knurl_image_save(session->context, heat, options->map, &error);
    if (heat) knurl_image_release(heat);
    if (status != KNURL_OK) return session_fail(session, &error);
    session_note(session, "knurl: %s: white is a difference of %g", options->map, largest);
    return CODE_DONE;
}

static int print_numbers(command_session *session, const compare_options *options,
                         const knurl_image_difference *difference, bool holds)
{
    if (options->json)
        return json_save(session,
                         json_pack("{s:o, s:o, s:o, s:o, s:[i, i], s:o, s:b}", "rmse",
                                   json_number(difference->rmse), "relmse",
                                   json_number(difference->relative_mse), "psnr",
                                   json_number(difference->psnr), "max_abs", json_number(difference->maximum),
                                   "worst_pixel", (int)difference->worst_x, (int)difference->worst_y,
                                   "not_finite", json_count(difference->not_finite), "holds", (int)holds),
                         "-");
    printf("rmse       %.9g\n", difference->rmse);
    printf("relmse     %.9g\n", difference->relative_mse);
    printf("psnr       %.6g dB\n", difference->psnr);
    printf("max-abs    %.9g at pixel %d,%d\n", difference->maximum, (int)difference->worst_x,
           (int)difference->worst_y);
    if (difference->not_finite)
        printf("not finite in one image only: %llu samples\n", (unsigned long long)difference->not_finite);
    return CODE_DONE;
}

/* Whether one threshold holds; says so if not. NaN never holds. */
static bool check(command_session *session, const char *option, double limit, double found, bool is_minimum)
{
    if (isnan(limit)) return true;
    if (is_minimum ? found >= limit : found <= limit) return true;
    session_fail_with(session, CODE_CHECK, "%s: found %.9g, expected %s %.9g", option, found,
                      is_minimum ? "at least" : "at most", limit);
    return false;
}

static bool check_all(command_session *session, const compare_options *options,
                      const knurl_image_difference *difference)
{
    bool asked = !isnan(options->max_rmse) || !isnan(options->min_psnr) || !isnan(options->max_abs) ||
                 !isnan(options->max_relmse);
    bool holds = check(session, "--max-rmse", options->max_rmse, difference->rmse, false);
    holds &= check(session, "--min-psnr", options->min_psnr, difference->psnr, true);
    holds &= check(session, "--max-abs", options->max_abs, difference->maximum, false);
    holds &= check(session, "--max-relmse", options->max_relmse, difference->relative_mse, false);
    if (asked && difference->not_finite) {
        session_fail_with(session, CODE_CHECK, "%llu samples are not finite in one image only",
                          (unsigned long long)difference->not_finite);
        holds = false;
    }
    return holds;
}

static int compare_images(command_session *session, const compare_options *options, const knurl_image *a,
                          const knurl_image *b)
{
    knurl_error error = {0};
    knurl_image_difference difference;
    knurl_image *map = NULL;
    if (knurl_image_compare(session->context, a, b, &difference, options->map ? &map : NULL, &error) !=
        KNURL_OK)
        return session_fail(session, &error);
    int code = options->map ? save_map(session, options, map, difference.maximum) : CODE_DONE;
    if (map) knurl_image_release(map);
    if (code != CODE_DONE) return code;
    bool holds = check_all(session, options, &difference);
    code = print_numbers(session, options, &difference, holds);
    return code == CODE_DONE && !holds ? CODE_CHECK : code;
}

int compare_command(int argc, char **argv)
{
    compare_options options = {.max_rmse = NAN,
                               .min_psnr = NAN,
                               .max_abs = NAN,
                               .max_relmse = NAN,
                               .general = general_options_default()};
    static const struct argp_child children[] = {{&general_argp, 0, "General:", 2}, {0}};
    static const struct argp argp = {option_list, parse_option, "A B", documentation,
                                     children,    help_filter,  NULL};
    argp_parse(&argp, argc, argv, 0, NULL, &options);
    command_session session;
    int code = session_open(&session, "compare", &options.general);
    if (code == CODE_DONE && options.map) code = output_check(&session, options.map);
    knurl_image *a = NULL, *b = NULL;
    if (code == CODE_DONE) code = prepare(&session, &options, &a, &b);
    if (code == CODE_DONE) code = compare_images(&session, &options, a, b);
    if (a) knurl_image_release(a);
    if (b) knurl_image_release(b);
    session_close(&session);
    return code;
}
