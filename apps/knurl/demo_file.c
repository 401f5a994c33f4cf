/* Writing a glTF document: .gltf with .bin, or .glb. */
#include "demo_gltf.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

knurl_status demo_write_file(const char *path, const void *bytes, size_t size, knurl_error *error)
{
    char temporary[4200];
    int length = snprintf(temporary, sizeof temporary, "%s.part", path);
    FILE *file = length > 0 && (size_t)length < sizeof temporary ? fopen(temporary, "wb") : NULL;
    bool good = file && (size == 0 || fwrite(bytes, 1, size, file) == size);
    int saved = errno;
    if (file && fclose(file) != 0) {
        good = false;
        saved = errno;
    }
    if (good && rename(temporary, path) != 0) {
        good = false;
        saved = errno;
    }
    if (good) return KNURL_OK;
    if (file) remove(temporary);
    if (error) {
        error->status = KNURL_ERROR_OUTPUT;
        (void)snprintf(error->message, sizeof error->message, "%.900s: %s", path, strerror(saved));
    }
    return KNURL_ERROR_OUTPUT;
}

static void write_file(demo_scene *scene, const char *extension, const void *bytes, size_t size)
{
    char name[300], path[4096];
    (void)snprintf(name, sizeof name, "%s%s", scene->name, extension);
    demo_scene_path(scene, name, path, sizeof path);
    if (scene->status == KNURL_OK) scene->status = demo_write_file(path, bytes, size, scene->error);
}

static void put_word(unsigned char *out, size_t value)
{
    for (int k = 0; k < 4; k++) out[k] = (unsigned char)(value >> (8 * k));
}

/* Header, JSON chunk padded with spaces, binary chunk padded with zeros (glTF 2.0, section 4.4). */
static void write_glb(demo_scene *scene, const char *text)
{
    size_t text_size = strlen(text), text_padded = (text_size + 3) & ~(size_t)3;
    size_t data_padded = (scene->byte_count + 3) & ~(size_t)3, total = 12 + 8 + text_padded + 8 + data_padded;
    unsigned char *out = calloc(total, 1);
    if (!out) {
        demo_scene_fail(scene, KNURL_ERROR_MEMORY, "out of memory for %s.glb", scene->name);
        return;
    }
    put_word(out, 0x46546C67);
    put_word(out + 4, 2);
    put_word(out + 8, total);
    put_word(out + 12, text_padded);
    put_word(out + 16, 0x4E4F534A);
    memset(out + 20, ' ', text_padded);
    memcpy(out + 20, text, text_size);
    put_word(out + 20 + text_padded, data_padded);
    put_word(out + 24 + text_padded, 0x004E4942);
    memcpy(out + 28 + text_padded, scene->bytes, scene->byte_count);
    write_file(scene, ".glb", out, total);
    free(out);
}

static void write_document(demo_scene *scene)
{
    char name[300];
    (void)snprintf(name, sizeof name, "%s.bin", scene->name);
    json_t *buffer = json_pack("{s:I}", "byteLength", (json_int_t)scene->byte_count);
    if (!scene->glb) json_object_set_new(buffer, "uri", json_string(name));
    json_object_set_new(scene->root, "buffers", json_pack("[o]", buffer));
    /* Nine digits give every float back. */
    char *text =
        json_dumps(scene->root, (scene->glb ? JSON_COMPACT : JSON_INDENT(2)) | JSON_REAL_PRECISION(9));
    if (!text) {
        demo_scene_fail(scene, KNURL_ERROR_MEMORY, "out of memory for %s.gltf", scene->name);
        return;
    }
    if (scene->glb)
        write_glb(scene, text);
    else {
        /* The scene file last: where it is, the rest is too. */
        write_file(scene, ".bin", scene->bytes, scene->byte_count);
        write_file(scene, ".gltf", text, strlen(text));
    }
    free(text);
}

knurl_status demo_scene_finish(demo_scene *scene)
{
    if (scene->status == KNURL_OK) write_document(scene);
    json_decref(scene->scene_root);
    json_decref(scene->root);
    free(scene->bytes);
    scene->root = scene->scene_root = NULL;
    scene->bytes = NULL;
    return scene->status;
}
