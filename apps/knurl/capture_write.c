/* capture_write.c: the files of a capture. They are made in a folder of their own inside DIR and moved to
 * their names at the end, the scene file last: a capture that was there is replaced by all of the new one or
 * stays. */
#include "capture.h"
#include "output.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PATH = 4096, MOST_FILES = 3 * CAPTURE_MOST_VIEWS + 2 };

typedef struct stage {
    command_session *session;
    const char *folder;
    char staging[PATH];
    char names[MOST_FILES][64]; /* in the order in which they are moved */
    int count;
} stage;

void capture_file_name(const capture_options *options, const capture_view *view, const char *what,
                       char name[64])
{
    bool exr = options->float_depth && strcmp(what, "height") == 0;
    (void)snprintf(name, 64, "%s%s%s.%s", what, view->name[0] ? "-" : "", view->name, exr ? "exr" : "png");
}

/* The path of a file being made; it is moved by commit(). */
static bool add_file(stage *s, const char *name, char path[PATH])
{
    (void)snprintf(s->names[s->count++], sizeof s->names[0], "%s", name);
    int length = snprintf(path, PATH, "%s/%s", s->staging, name);
    return length > 0 && length < PATH;
}

static int name_too_long(const stage *s)
{
    return session_fail_with(s->session, CODE_FILE, "the output name is too long");
}

/* Saves and releases an image. */
static int save_image(stage *s, knurl_status status, knurl_image *image, const char *name, knurl_error *error)
{
    char path[PATH];
    if (status != KNURL_OK) return session_fail(s->session, error);
    bool fits = add_file(s, name, path);
    if (fits) status = knurl_image_save(s->session->context, image, path, error);
    knurl_image_release(image);
    if (!fits) return name_too_long(s);
    return status == KNURL_OK ? CODE_DONE : session_fail(s->session, error);
}

static int write_heights(stage *s, const capture_options *options, const capture_result *result, int k)
{
    const capture_view *view = &result->views[k];
    const capture_maps *maps = &result->maps[k];
    knurl_context *context = s->session->context;
    char name[64];
    capture_file_name(options, view, "height", name);
    knurl_error error = {0};
    knurl_image *image = NULL;
    knurl_status status;
    if (options->float_depth) {
        status = knurl_image_create(context, view->width, view->height, 1, KNURL_PIXEL_F32, maps->heights,
                                    &image, &error);
        return save_image(s, status, image, name, &error);
    }
    size_t count = (size_t)view->width * (size_t)view->height;
    uint16_t *codes = malloc(count * sizeof *codes);
    if (!codes) return session_fail_with(s->session, CODE_LIMIT, "out of memory for %s", name);
    double scale = result->factor > 0 ? 65535 / result->factor : 0;
    for (size_t i = 0; i < count; i++) {
        double code = ((double)maps->heights[i] - result->offset) * scale;
        codes[i] = (uint16_t)(fmin(fmax(code, 0), 65535) + 0.5);
    }
    status =
        knurl_image_create(context, view->width, view->height, 1, KNURL_PIXEL_U16, codes, &image, &error);
    free(codes);
    return save_image(s, status, image, name, &error);
}

static int write_picture(stage *s, const capture_options *options, const capture_view *view, const char *what,
                         int32_t channels, const uint8_t *samples)
{
    char name[64];
    capture_file_name(options, view, what, name);
    knurl_error error = {0};
    knurl_image *image = NULL;
    knurl_status status = knurl_image_create(s->session->context, view->color_width, view->color_height,
                                             channels, KNURL_PIXEL_U8, samples, &image, &error);
    return save_image(s, status, image, name, &error);
}

static int write_bytes(stage *s, const char *name, const void *bytes, size_t size)
{
    char path[PATH];
    if (!add_file(s, name, path)) return name_too_long(s);
    output_file output;
    int code = output_open(s->session, &output, path);
    if (code != CODE_DONE) return code;
    (void)fwrite(bytes, 1, size, output.file); /* a failure shows in the commit */
    return output_commit(s->session, &output);
}

static int write_all(stage *s, const capture_options *options, const loaded_scene *loaded,
                     capture_result *result)
{
    int code = CODE_DONE;
    for (int k = 0; k < result->count && code == CODE_DONE; k++) {
        if (!progress_update(&s->session->progress, "write", (double)k / result->count))
            return session_fail_with(s->session, CODE_INTERRUPTED, "interrupted; nothing was written");
        if (result->maps[k].hits == 0) continue;
        code = write_heights(s, options, result, k);
        const capture_view *view = &result->views[k];
        if (code == CODE_DONE) code = write_picture(s, options, view, "color", 4, result->maps[k].colors);
        if (code == CODE_DONE && capture_has_surfaces(result))
            code = write_picture(s, options, view, "surface", 3, result->maps[k].surfaces);
    }
    if (code != CODE_DONE) return code;
    capture_document document;
    if (!capture_document_make(options, loaded, result, &document))
        return session_fail_with(s->session, CODE_LIMIT, "out of memory for the glTF document");
    code = write_bytes(s, "capture.bin", document.bytes, document.size);
    if (code == CODE_DONE) code = write_bytes(s, "capture.gltf", document.text, strlen(document.text));
    free(document.text);
    free(document.bytes);
    if (code == CODE_DONE && signals_stop_requested())
        code = session_fail_with(s->session, CODE_INTERRUPTED, "interrupted; nothing was written");
    return code;
}

static int commit(stage *s)
{
    for (int i = 0; i < s->count; i++) {
        char from[PATH], to[PATH];
        int a = snprintf(from, sizeof from, "%s/%s", s->staging, s->names[i]);
        int b = snprintf(to, sizeof to, "%s/%s", s->folder, s->names[i]);
        if (a < 0 || a >= PATH || b < 0 || b >= PATH) return name_too_long(s);
        if (rename(from, to) != 0)
            return session_fail_with(s->session, CODE_FILE, "%s: %s", to, strerror(errno));
    }
    return CODE_DONE;
}

/* Takes the staging folder away, with what is still in it. */
static void clean_up(stage *s)
{
    for (int i = 0; i < s->count; i++) {
        char path[PATH];
        int length = snprintf(path, sizeof path, "%s/%s", s->staging, s->names[i]);
        if (length > 0 && length < PATH) (void)unlink(path);
    }
    (void)rmdir(s->staging);
}

int capture_write(command_session *session, const capture_options *options, const loaded_scene *loaded,
                  capture_result *result)
{
    stage *s = calloc(1, sizeof *s);
    if (!s) return session_fail_with(session, CODE_LIMIT, "out of memory");
    s->session = session;
    s->folder = options->folder;
    int length = snprintf(s->staging, sizeof s->staging, "%s/.capture-XXXXXX", options->folder);
    int code = CODE_DONE;
    if (length < 0 || length >= PATH - 128)
        code = name_too_long(s);
    else if (!mkdtemp(s->staging))
        code = session_fail_with(session, CODE_FILE, "%s: cannot write there: %s", options->folder,
                                 strerror(errno));
    if (code == CODE_DONE) {
        code = write_all(s, options, loaded, result);
        if (code == CODE_DONE) code = commit(s);
        clean_up(s);
    }
    free(s);
    return code;
}
