/* capture.c: `knurl capture`, from a model to a scene of textures with depth. */
#include "capture.h"
#include "commands.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Makes a folder and those above it; *made if the last one was missing. */
static int make_folder(command_session *session, const char *folder, bool *made)
{
    char path[4096];
    *made = false;
    if (strlen(folder) >= sizeof path - 128)
        return session_fail_with(session, CODE_FILE, "the output name is too long");
    memcpy(path, folder, strlen(folder) + 1);
    for (char *p = path + 1;; p++) {
        if (*p != '/' && *p != 0) continue;
        char saved = *p;
        *p = 0;
        struct stat info;
        *made = mkdir(path, 0777) == 0;
        int reason = errno == EEXIST ? ENOTDIR : errno;
        if (!*made && !(stat(path, &info) == 0 && S_ISDIR(info.st_mode)))
            return session_fail_with(session, CODE_FILE, "cannot make the folder %s: %s", path,
                                     strerror(reason));
        *p = saved;
        if (saved == 0) break;
    }
    if (access(folder, W_OK | X_OK) != 0)
        return session_fail_with(session, CODE_FILE, "%s: cannot write there: %s", folder, strerror(errno));
    return CODE_DONE;
}

static double count_rays(const capture_options *options, const capture_view *view)
{
    double samples = (double)options->samples * options->samples;
    return (double)view->width * view->height + samples * view->color_width * view->color_height;
}

/* All views share one range, so that views of a cube have equal codes along their edges. */
static int choose_ranges(command_session *session, const capture_options *options, capture_result *result)
{
    double low = INFINITY, high = -INFINITY;
    result->roughness[0] = result->metallic[0] = INFINITY;
    result->roughness[1] = result->metallic[1] = -INFINITY;
    for (int k = 0; k < result->count; k++) {
        const capture_maps *maps = &result->maps[k];
        low = fmin(low, maps->low);
        high = fmax(high, maps->high);
        result->roughness[0] = fmin(result->roughness[0], maps->roughness[0]);
        result->roughness[1] = fmax(result->roughness[1], maps->roughness[1]);
        result->metallic[0] = fmin(result->metallic[0], maps->metallic[0]);
        result->metallic[1] = fmax(result->metallic[1], maps->metallic[1]);
    }
    /* Heights without any colour sample: nothing would be seen of them. */
    if (!(result->roughness[0] <= result->roughness[1])) low = INFINITY;
    if (!(low <= high))
        return session_fail_with(session, CODE_FILE,
                                 "%s: no view meets the model; --center and --from place the views",
                                 options->model);
    result->offset = options->float_depth ? 0 : low;
    result->factor = options->float_depth ? 1 : high - low;
    return CODE_DONE;
}

static int trace_views(command_session *session, const capture_options *options, const loaded_scene *loaded,
                       const double box[6], capture_result *result)
{
    capture_job job = {.session = session,
                       .options = options,
                       .description = loaded->description,
                       .scene = loaded->scene,
                       .box = options->clipped ? box : NULL};
    for (int k = 0; k < result->count; k++) job.rays_all += count_rays(options, &result->views[k]);
    capture_textures *textures = NULL;
    int code = capture_textures_load(session, loaded->description, &textures);
    job.textures = textures;
    for (int k = 0; k < result->count && code == CODE_DONE; k++) {
        code = capture_view_trace(&job, &result->views[k], &result->maps[k]);
        if (code == CODE_DONE && result->maps[k].hits == 0)
            session_note(session, "knurl: %s%s meets nothing and is left out",
                         result->views[k].name[0] ? "view " : "the view", result->views[k].name);
    }
    capture_textures_release(textures);
    return code;
}

static void summarise(command_session *session, const capture_options *options, const capture_result *result)
{
    double texels = 0, hits = 0;
    int written = 0;
    for (int k = 0; k < result->count; k++) {
        written += result->maps[k].hits > 0;
        texels += (double)result->views[k].width * result->views[k].height;
        hits += (double)result->maps[k].hits;
    }
    char step[64] = "floats";
    if (!options->float_depth) (void)snprintf(step, sizeof step, "steps of %.3g m", result->factor / 65535);
    session_note(
        session,
        "knurl: %s/capture.gltf: %d %s, %d texels across, %.1f %% of them hit, depth in %s, %llu base "
        "triangles",
        options->folder, written, written == 1 ? "view" : "views", (int)options->size, 100 * hits / texels,
        step, (unsigned long long)result->triangles);
}

static int capture_loaded(command_session *session, const capture_options *options,
                          const loaded_scene *loaded, capture_result *result)
{
    double box[6];
    if (!capture_box(options, loaded->scene, box))
        return session_fail_with(session, CODE_FILE, "%s: %s", options->model,
                                 options->clipped ? "nothing of it is in the box of --clip"
                                                  : "there is nothing to capture");
    char message[200];
    result->count = capture_views_fit(options, box, result->views, message);
    if (!result->count) return session_fail_with(session, CODE_FILE, "%s: %s", options->model, message);
    int code = trace_views(session, options, loaded, box, result);
    if (code == CODE_DONE) code = choose_ranges(session, options, result);
    if (code == CODE_DONE) code = capture_write(session, options, loaded, result);
    progress_clear(&session->progress);
    if (code == CODE_DONE) summarise(session, options, result);
    for (int k = 0; k < result->count; k++) capture_maps_release(&result->maps[k]);
    return code;
}

int capture_command(int argc, char **argv)
{
    capture_options options;
    capture_options_parse(argc, argv, &options);
    signals_install();
    command_session session;
    int code = session_open(&session, "capture", &options.general);
    loaded_scene loaded = {0};
    if (code == CODE_DONE)
        code = scene_load(&session, options.model, &options.displacement, &options.method, &loaded);
    bool made = false;
    if (code == CODE_DONE) code = make_folder(&session, options.folder, &made);
    capture_result *result = calloc(1, sizeof *result);
    if (code == CODE_DONE)
        code = result ? capture_loaded(&session, &options, &loaded, result)
                      : session_fail_with(&session, CODE_LIMIT, "out of memory");
    if (code != CODE_DONE && made) (void)rmdir(options.folder); /* only if it is empty */
    free(result);
    scene_release(&loaded);
    session_close(&session);
    return code;
}
