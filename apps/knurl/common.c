/* common.c: sessions, loading and error reports. */
#include "common.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static void print_log(void *user, knurl_log_level level, const char *message)
{
    command_session *session = user;
    if (session->general.quiet || (level < KNURL_LOG_WARNING && !session->general.verbose)) return;
    bool bar = session->progress.mode == PROGRESS_BAR;
    fprintf(stderr, "%sknurl: %s%s\n", bar ? "\r\033[K" : "", level == KNURL_LOG_WARNING ? "warning: " : "",
            message);
}

int session_open(command_session *session, const char *command, const general_options *general)
{
    memset(session, 0, sizeof *session);
    session->command = command;
    session->general = *general;
    progress_start(&session->progress, general->quiet);
    knurl_context_def def = knurl_context_def_default();
    def.threads = general->threads;
    def.memory_limit = general->memory_limit;
    def.log = print_log;
    def.log_user = session;
    knurl_error error;
    if (knurl_context_create(&def, &session->context, &error) != KNURL_OK)
        return session_fail(session, &error);
    return CODE_DONE;
}

void session_close(command_session *session)
{
    progress_clear(&session->progress);
    knurl_context_release(session->context);
    session->context = NULL;
}

static enum exit_code code_of(knurl_status status)
{
    switch (status) {
    case KNURL_OK:
        return CODE_DONE;
    case KNURL_ERROR_ARGUMENT:
        return CODE_USAGE;
    case KNURL_ERROR_MEMORY:
    case KNURL_ERROR_LIMIT:
        return CODE_LIMIT;
    case KNURL_INTERRUPTED:
        return CODE_INTERRUPTED;
    case KNURL_ERROR_INPUT:
    case KNURL_ERROR_UNSUPPORTED:
    case KNURL_ERROR_OUTPUT:
        break;
    }
    return CODE_FILE;
}

int session_fail(command_session *session, const knurl_error *error)
{
    const char *message = error->message[0] ? error->message : knurl_status_name(error->status);
    return session_fail_with(session, code_of(error->status), "%s", message);
}

int session_fail_with(command_session *session, enum exit_code code, const char *format, ...)
{
    progress_clear(&session->progress);
    fprintf(stderr, "knurl %s: ", session->command);
    va_list arguments;
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
    return (int)code;
}

void session_note(command_session *session, const char *format, ...)
{
    if (session->general.quiet) return;
    progress_clear(&session->progress);
    va_list arguments;
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

knurl_heightmap_def heightmap_def_from(const method_options *method)
{
    knurl_heightmap_def def = knurl_heightmap_def_default();
    if (method->rmip_cell) def.rmip_cell = method->rmip_cell;
    return def;
}

knurl_status displacement_override(knurl_description *description, const displacement_options *options,
                                   knurl_error *error)
{
    knurl_displacement_override override = knurl_displacement_override_default();
    override.map = options->map;
    override.color_map = options->color;
    override.factor = options->factor;
    override.offset = options->offset;
    override.tile_u = options->tile_u;
    override.tile_v = options->tile_v;
    override.wrap_u = override.wrap_v = options->wrap;
    override.remove = options->remove;
    return knurl_description_override(description, &override, error);
}

/* A forgotten --disp should not go unnoticed. */
static void warn_without_map(command_session *session, const knurl_description *description,
                             const displacement_options *options)
{
    if (isnan(options->factor) && isnan(options->tile_u) && options->wrap < 0) return;
    for (uint32_t i = 0; i < description->material_count; i++)
        if (description->materials[i].displacement.image >= 0) return;
    session_note(session,
                 "knurl: warning: no material has a displacement map, so that --disp-factor, --tile and "
                 "--wrap do nothing; --disp names one");
}

static knurl_status build_scene(command_session *session, const method_options *method, loaded_scene *loaded,
                                knurl_error *error)
{
    knurl_build_def def = knurl_build_def_default();
    if (method->method) def.surface.method = method->method;
    def.heightmap = heightmap_def_from(method);
    def.progress = progress_update;
    def.progress_user = &session->progress;
    return knurl_scene_build(loaded->description, &def, &loaded->scene, error);
}

int scene_load(command_session *session, const char *path, const displacement_options *displacement,
               const method_options *method, loaded_scene *loaded)
{
    memset(loaded, 0, sizeof *loaded);
    knurl_error error = {0};
    double start = seconds_now();
    knurl_status status = knurl_description_load(session->context, path, &loaded->description, &error);
    if (status == KNURL_OK) status = displacement_override(loaded->description, displacement, &error);
    if (status == KNURL_OK) warn_without_map(session, loaded->description, displacement);
    double middle = seconds_now();
    loaded->load_seconds = middle - start;
    if (status == KNURL_OK) status = build_scene(session, method, loaded, &error);
    loaded->build_seconds = seconds_now() - middle;
    progress_clear(&session->progress);
    if (status == KNURL_OK) {
        if (session->general.verbose)
            session_note(session, "knurl: %s: read in %.3f s, built in %.3f s", path, loaded->load_seconds,
                         loaded->build_seconds);
        return CODE_DONE;
    }
    scene_release(loaded);
    return session_fail(session, &error);
}

void scene_release(loaded_scene *loaded)
{
    if (loaded->scene) knurl_scene_release(loaded->scene);
    if (loaded->description) knurl_description_release(loaded->description);
    loaded->scene = NULL;
    loaded->description = NULL;
}

int camera_find(command_session *session, const knurl_description *description, const char *text,
                int32_t *camera)
{
    if (!text) return CODE_DONE;
    for (uint32_t i = 0; i < description->camera_count; i++) {
        const char *name = description->cameras[i].name;
        if (name && strcmp(name, text) == 0) {
            *camera = (int32_t)i;
            return CODE_DONE;
        }
    }
    char *end = NULL;
    long number = strtol(text, &end, 10);
    if (end != text && !*end && number >= 0 && (unsigned long)number < description->camera_count) {
        *camera = (int32_t)number;
        return CODE_DONE;
    }
    if (description->camera_count == 0)
        return session_fail_with(session, CODE_USAGE, "--camera: found '%s', but the scene has no cameras",
                                 text);
    char names[512] = "";
    size_t used = 0;
    for (uint32_t i = 0; i < description->camera_count && used < sizeof names; i++) {
        const char *name = description->cameras[i].name;
        int more = snprintf(names + used, sizeof names - used, "%s%u%s%s%s", i ? ", " : "", i,
                            name ? " (" : "", name ? name : "", name ? ")" : "");
        if (more > 0) used += (size_t)more;
    }
    return session_fail_with(session, CODE_USAGE, "--camera: found '%s', expected one of %s", text, names);
}

const char *format_bytes(char text[32], double bytes)
{
    static const char *const units[] = {"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
    int unit = 0;
    while (bytes >= 1024 && unit < 5) {
        bytes /= 1024;
        unit++;
    }
    snprintf(text, 32, unit ? "%.1f %s" : "%.0f %s", bytes, units[unit]);
    return text;
}

void path_extension(const char *path, char extension[16])
{
    extension[0] = 0;
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(path, '.');
    if (!dot || (slash && dot < slash) || strlen(dot) >= 16) return;
    size_t i = 0;
    for (; dot[i]; i++) extension[i] = (char)tolower((unsigned char)dot[i]);
    extension[i] = 0;
}

int output_check(command_session *session, const char *path)
{
    if (strcmp(path, "-") == 0) return CODE_DONE;
    struct stat info;
    if (stat(path, &info) == 0 && S_ISDIR(info.st_mode))
        return session_fail_with(session, CODE_FILE, "%s: is a folder, expected a file name", path);
    char folder[4096];
    const char *slash = strrchr(path, '/');
    size_t length = slash ? (size_t)(slash - path) : 0;
    if (length >= sizeof folder || strlen(path) >= sizeof folder - 16)
        return session_fail_with(session, CODE_FILE, "the output name is too long");
    if (!slash)
        snprintf(folder, sizeof folder, ".");
    else
        snprintf(folder, sizeof folder, "%.*s", length ? (int)length : 1, path);
    if (stat(folder, &info) != 0 || access(folder, W_OK | X_OK) != 0)
        return session_fail_with(session, CODE_FILE, "%s: cannot write there: %s", path, strerror(errno));
    return CODE_DONE;
}
