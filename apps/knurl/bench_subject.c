/* bench_subject.c: one scene built for one method. */
#include "bench.h"

#include <math.h>
#include <string.h>

/* Displacement of every material times a number, tiling times another. */
static void scale_displacement(const bench_options *options, knurl_description *description)
{
    for (uint32_t i = 0; i < description->material_count; i++) {
        knurl_description_material *material = &description->materials[i];
        material->displacement_factor *= options->disp_scale;
        material->displacement_offset *= options->disp_scale;
        for (int axis = 0; axis < 2; axis++) material->displacement.uv_scale[axis] *= options->tile_scale;
    }
}

static knurl_status load_description(const bench_options *options, const char *path, bool unnormalised,
                                     subject *made, knurl_error *error)
{
    knurl_status status = knurl_description_load(made->context, path, &made->description, error);
    if (status == KNURL_OK) status = displacement_override(made->description, &options->displacement, error);
    if (status != KNURL_OK) return status;
    scale_displacement(options, made->description);
    if (!unnormalised) return KNURL_OK;
    knurl_displacement_override override = knurl_displacement_override_default();
    override.unnormalised = 1;
    return knurl_description_override(made->description, &override, error);
}

static knurl_status build(command_session *session, const bench_options *options, subject *made,
                          knurl_error *error)
{
    knurl_build_def def = knurl_build_def_default();
    double image_seconds = 0, start = seconds_now();
    def.surface.method = made->method;
    if (options->rmip_cell) def.heightmap.rmip_cell = options->rmip_cell;
    def.image_seconds = &image_seconds;
    def.progress = progress_update;
    def.progress_user = &session->progress;
    knurl_status status = knurl_scene_build(made->description, &def, &made->scene, error);
    made->build_ms = 1e3 * (seconds_now() - start - image_seconds);
    return status;
}

int subject_open(command_session *session, const bench_options *options, const char *path, const char *method,
                 bool unnormalised, uint64_t memory_limit, subject *made)
{
    memset(made, 0, sizeof *made);
    made->method = method;
    made->build_ms = NAN;
    int32_t index = -1;
    if (knurl_method_check(method, &index, NULL) == KNURL_OK) made->flags = knurl_method_flags(index);
    knurl_context_def def = knurl_context_def_default();
    def.threads = options->general.threads;
    def.memory_limit = memory_limit;
    knurl_error error = {0};
    if (knurl_context_create(&def, &made->context, &error) != KNURL_OK) return session_fail(session, &error);
    knurl_status status = load_description(options, path, unnormalised, made, &error);
    if (status != KNURL_OK) return session_fail(session, &error);
    status = build(session, options, made, &error);
    progress_clear(&session->progress);
    if (status == KNURL_OK) {
        made->memory = knurl_scene_get_memory(made->scene);
        return CODE_DONE;
    }
    if (status == KNURL_ERROR_INPUT || status == KNURL_INTERRUPTED) return session_fail(session, &error);
    snprintf(made->failure, sizeof made->failure, "%s",
             error.message[0] ? error.message : knurl_status_name(status));
    return CODE_DONE;
}

void subject_close(subject *made)
{
    knurl_scene_release(made->scene);
    knurl_description_release(made->description);
    knurl_context_release(made->context);
    memset(made, 0, sizeof *made);
}
