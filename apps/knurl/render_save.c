/* render_save.c: what `knurl render` writes: the picture and its AOVs. */
#include "render.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool is_one_of(const char *extension, const char *const *list)
{
    for (; *list; list++)
        if (strcmp(extension, *list) == 0) return true;
    return false;
}

/* The first `channels` channels of a float image. */
static knurl_status keep_channels(knurl_context *context, const knurl_image *image, int32_t channels,
                                  knurl_image **result, knurl_error *error)
{
    int32_t width = knurl_image_width(image), height = knurl_image_height(image);
    int32_t all = knurl_image_channels(image);
    size_t pixels = (size_t)width * (size_t)height;
    const float *from = knurl_image_samples(image);
    float *samples = malloc(pixels * (size_t)channels * sizeof *samples);
    if (!samples) {
        error->status = KNURL_ERROR_MEMORY;
        snprintf(error->message, sizeof error->message, "out of memory for the picture");
        return error->status;
    }
    for (size_t i = 0; i < pixels; i++)
        for (int32_t c = 0; c < channels; c++)
            samples[i * (size_t)channels + (size_t)c] = from[i * (size_t)all + (size_t)c];
    knurl_status status =
        knurl_image_create(context, width, height, channels, KNURL_PIXEL_F32, samples, result, error);
    free(samples);
    return status;
}

static knurl_status save_beauty(knurl_context *context, const render_options *options, const char *extension,
                                const knurl_image *beauty, knurl_error *error)
{
    static const char *const display[] = {".png", ".jpg", ".jpeg", ".ppm", NULL};
    static const char *const without_alpha[] = {".hdr", ".pfm", NULL};
    knurl_image *changed = NULL;
    knurl_status status = KNURL_OK;
    if (is_one_of(extension, display))
        status = knurl_tonemap(context, beauty, options->exposure, &changed, error);
    else if (is_one_of(extension, without_alpha))
        status = keep_channels(context, beauty, 3, &changed, error);
    if (status == KNURL_OK)
        status = knurl_image_save(context, changed ? changed : beauty, options->out, error);
    if (changed) knurl_image_release(changed);
    return status;
}

static knurl_status save_layers(knurl_context *context, const char *path, const knurl_render_result *result,
                                knurl_error *error)
{
    knurl_image_layer layers[KNURL_AOV_COUNT + 1] = {{"", result->beauty}};
    int32_t count = 1;
    for (int32_t i = 0; i < KNURL_AOV_COUNT; i++)
        if (result->aovs[i]) layers[count++] = (knurl_image_layer){knurl_aov_name(i), result->aovs[i]};
    return knurl_image_save_layers(context, layers, count, path, error);
}

/* "out/a.png" and "depth": "out/a.depth.exr". False if that is too long. */
static bool aov_path(const char *out, int32_t index, char path[4096])
{
    const char *dot = strrchr(out, '.');
    int length = snprintf(path, 4096, "%.*s.%s.exr", (int)(dot - out), out, knurl_aov_name(index));
    return length >= 0 && length < 4096;
}

static bool has_layers(const char *path)
{
    char extension[16];
    path_extension(path, extension);
    return strcmp(extension, ".exr") == 0;
}

int render_check_outputs(command_session *session, const render_options *options)
{
    int code = output_check(session, options->out);
    char path[4096];
    for (int32_t i = 0; i < KNURL_AOV_COUNT && code == CODE_DONE && !has_layers(options->out); i++) {
        if (!(options->def.aovs & 1u << i)) continue;
        if (!aov_path(options->out, i, path))
            return session_fail_with(session, CODE_FILE, "%s: the name is too long to add an AOV's to it",
                                     options->out);
        code = output_check(session, path);
    }
    return code;
}

int render_save(command_session *session, const render_options *options, const knurl_render_result *result)
{
    knurl_error error = {0};
    knurl_status status;
    char extension[16], path[4096];
    path_extension(options->out, extension);
    if (has_layers(options->out)) {
        status = save_layers(session->context, options->out, result, &error);
    } else {
        status = save_beauty(session->context, options, extension, result->beauty, &error);
        for (int32_t i = 0; i < KNURL_AOV_COUNT && status == KNURL_OK; i++)
            if (result->aovs[i] && aov_path(options->out, i, path))
                status = knurl_image_save(session->context, result->aovs[i], path, &error);
    }
    return status == KNURL_OK ? CODE_DONE : session_fail(session, &error);
}
