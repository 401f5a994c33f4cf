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

static bool is_displaced(const knurl_description *description, uint32_t mesh)
{
    const int32_t number = description->meshes[mesh].material;
    if (number < 0 || (uint32_t)number >= description->material_count) return false;
    const knurl_description_material *material = &description->materials[number];
    return material->displacement.image >= 0 || material->displacement_offset != 0.0;
}

/* Undisplaced meshes keep their numbers, but have neither triangles nor instances. Instances are moved behind
 * those that remain, for subject_close. */
static void leave_displaced(knurl_description *description)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < description->instance_count; i++) {
        const knurl_description_instance instance = description->instances[i];
        if (instance.mesh < 0 || (uint32_t)instance.mesh >= description->mesh_count ||
            !is_displaced(description, (uint32_t)instance.mesh))
            continue;
        description->instances[i] = description->instances[kept];
        description->instances[kept++] = instance;
    }
    description->instance_count = kept;
    for (uint32_t i = 0; i < description->mesh_count; i++)
        if (!is_displaced(description, i)) description->meshes[i].triangle_count = 0;
}

static knurl_status load_description(const bench_options *options, const char *path, bool unnormalised,
                                     subject *made, knurl_error *error)
{
    knurl_status status = knurl_description_load(made->context, path, &made->description, error);
    if (status == KNURL_OK) status = displacement_override(made->description, &options->displacement, error);
    if (status != KNURL_OK) return status;
    scale_displacement(options, made->description);
    made->instance_count = made->description->instance_count;
    if (options->displaced_only) leave_displaced(made->description);
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
    if (made->instance_count) made->description->instance_count = made->instance_count;
    knurl_description_release(made->description);
    knurl_context_release(made->context);
    memset(made, 0, sizeof *made);
}
