/* render.c: `knurl render`, from a scene file to a picture. */
#include "render.h"
#include "commands.h"
#include "json_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static json_t *describe_rays(const knurl_render_stats *stats)
{
    return json_pack("{s:o, s:o, s:o}", "primary", json_count(stats->primary_rays), "diffuse",
                     json_count(stats->diffuse_rays), "occlusion", json_count(stats->occlusion_rays));
}

static json_t *describe_speed(const knurl_render_stats *stats)
{
    return json_pack("{s:o, s:o, s:o}", "primary", json_number(stats->primary_per_second), "diffuse",
                     json_number(stats->diffuse_per_second), "occlusion",
                     json_number(stats->occlusion_per_second));
}

static json_t *describe_memory(const command_session *session, const knurl_scene *scene)
{
    knurl_scene_memory memory = knurl_scene_get_memory(scene);
    uint64_t tessellated = 0;
    for (uint32_t i = 0; i < knurl_scene_object_count(scene); i++) {
        const knurl_surface *surface = knurl_scene_surface(scene, i);
        knurl_surface_info info;
        if (!surface) continue;
        knurl_surface_get_info(surface, &info);
        tessellated += info.tessellated_bytes;
    }
    return json_pack("{s:o, s:o, s:o, s:o, s:o, s:o}", "mesh", json_count(memory.mesh), "shells",
                     json_count(memory.shells), "maps", json_count(memory.maps), "bvh",
                     json_count(memory.bvh), "peak", json_count(knurl_context_peak_bytes(session->context)),
                     "tessellated", json_count(tessellated));
}

static int save_stats(command_session *session, const render_options *options, const loaded_scene *loaded,
                      const knurl_render_result *result, bool interrupted)
{
    const knurl_render_stats *stats = &result->stats;
    const knurl_render_def *def = &options->def;
    const char *method = options->method.method ? options->method.method : knurl_surface_def_default().method;
    json_t *root = json_pack(
        "{s:s, s:o, s:o, s:s, s:i, s:i, s:i, s:i, s:o, s:i, s:b, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "knurl",
        KNURL_VERSION_STRING, "scene", json_text(options->scene), "output", json_text(options->out), "method",
        method, "width", (int)def->width, "height", (int)def->height, "samples", (int)def->samples,
        "samples_done", (int)stats->samples_done, "seed", json_count(def->seed), "threads",
        (int)knurl_context_threads(session->context), "interrupted", (int)interrupted, "load_seconds",
        json_number(loaded->load_seconds), "build_seconds", json_number(loaded->build_seconds),
        "render_seconds", json_number(stats->seconds), "rays", describe_rays(stats), "rays_per_second",
        describe_speed(stats), "steps_mean", json_number(stats->steps_mean), "bytes",
        describe_memory(session, loaded->scene));
    return json_save(session, root, options->stats);
}

static void summarise(command_session *session, const render_options *options,
                      const knurl_render_result *result)
{
    const knurl_render_stats *stats = &result->stats;
    double rays = (double)(stats->primary_rays + stats->diffuse_rays + stats->occlusion_rays);
    char bytes[32];
    session_note(
        session, "knurl: %s: %d x %d, %d samples per pixel, %.1f s, %.2f million rays/s, peak memory %s",
        options->out, (int)knurl_image_width(result->beauty), (int)knurl_image_height(result->beauty),
        (int)stats->samples_done, stats->seconds, stats->seconds > 0 ? 1e-6 * rays / stats->seconds : 0,
        format_bytes(bytes, (double)knurl_context_peak_bytes(session->context)));
}

static int render_loaded(command_session *session, render_options *options, const loaded_scene *loaded)
{
    knurl_error error = {0};
    knurl_image *environment = NULL;
    if (options->environment &&
        knurl_image_load(session->context, options->environment, &environment, &error) != KNURL_OK)
        return session_fail(session, &error);
    options->def.environment = environment;
    options->def.progress = progress_update;
    options->def.progress_user = &session->progress;
    knurl_render_result result = {0};
    knurl_status status = knurl_render(loaded->description, loaded->scene, &options->def, &result, &error);
    progress_clear(&session->progress);
    int code = CODE_DONE;
    if (status == KNURL_INTERRUPTED && result.beauty && result.stats.samples_done == 0) {
        code = session_fail_with(session, CODE_INTERRUPTED,
                                 "interrupted before one sample per pixel was finished; %s was not written",
                                 options->out);
    } else if (status == KNURL_OK || (status == KNURL_INTERRUPTED && result.beauty)) {
        code = render_save(session, options, &result);
        if (code == CODE_DONE && options->stats)
            code = save_stats(session, options, loaded, &result, status == KNURL_INTERRUPTED);
        if (code == CODE_DONE) summarise(session, options, &result);
        if (code == CODE_DONE && status == KNURL_INTERRUPTED)
            code = session_fail_with(session, CODE_INTERRUPTED,
                                     "interrupted; %s holds what was finished: %d of %d samples per pixel",
                                     options->out, (int)result.stats.samples_done, (int)options->def.samples);
    } else {
        code = session_fail(session, &error);
    }
    knurl_render_result_release(&result);
    if (environment) knurl_image_release(environment);
    return code;
}

int render_command(int argc, char **argv)
{
    render_options options;
    render_options_parse(argc, argv, &options);
    signals_install();
    command_session session;
    int code = session_open(&session, "render", &options.general);
    if (code == CODE_DONE) code = render_check_outputs(&session, &options);
    if (code == CODE_DONE && options.stats) code = output_check(&session, options.stats);
    loaded_scene loaded = {0};
    if (code == CODE_DONE)
        code = scene_load(&session, options.scene, &options.displacement, &options.method, &loaded);
    if (code == CODE_DONE)
        code = camera_find(&session, loaded.description, options.camera, &options.def.camera);
    if (code == CODE_DONE) code = render_loaded(&session, &options, &loaded);
    scene_release(&loaded);
    session_close(&session);
    return code;
}
