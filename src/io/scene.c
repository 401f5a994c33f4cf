/* Scene files: which reader takes which file, and images of a description. */
#include "io/scene.h"

#include <string.h>

#include "data/description.h"

static bool has_extension(const char *extension, const char *name)
{
    for (; *extension && *name; extension++, name++) {
        char c = *extension >= 'A' && *extension <= 'Z' ? (char)(*extension - 'A' + 'a') : *extension;
        if (c != *name) return false;
    }
    return !*extension && !*name;
}

static knurl_status read_scene(knurl_description *d, knurl_error *error)
{
    const char *slash = strrchr(d->path, '/');
    const char *dot = strrchr(slash ? slash : d->path, '.');
    const char *extension = dot ? dot + 1 : "";
    unsigned char *bytes;
    size_t size;
    knurl_status status = knurl_file_read(d->context, d->path, &bytes, &size, error);
    if (status != KNURL_OK) return status;
    if (size == 0)
        status = knurl_fail(error, KNURL_ERROR_INPUT, "%s: the file is empty, expected a scene", d->path);
    else if (has_extension(extension, "gltf") || has_extension(extension, "glb"))
        status = gltf_read(d, bytes, size, true, error);
    else if (has_extension(extension, "obj"))
        status = obj_read(d, bytes, size, true, error);
    else
        status = assimp_read(d, bytes, size, extension, error);
    knurl_free(d->context, bytes);
    if (status == KNURL_OK) status = description_finish(d, error);
    return status;
}

knurl_status knurl_description_load(knurl_context *context, const char *path, knurl_description **description,
                                    knurl_error *error)
{
    if (!description) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "description is NULL");
    *description = NULL;
    if (!context || !path) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "context or path is NULL");
    knurl_description *d = description_new(context, path);
    if (!d) return knurl_fail_memory(error, sizeof *d, path);
    knurl_status status = read_scene(d, error);
    if (status != KNURL_OK) {
        knurl_description_release(d);
        return status;
    }
    *description = d;
    return KNURL_OK;
}

knurl_status knurl_description_load_image(const knurl_description *d, int32_t index, knurl_image **image,
                                          knurl_error *error)
{
    if (!image) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "image is NULL");
    *image = NULL;
    if (!d) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "description is NULL");
    if (index < 0 || (uint32_t)index >= d->image_count)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "image %d, expected 0 to %d", index,
                          (int)d->image_count - 1);
    const knurl_description_image *source = &d->images[index];
    if (source->path) return knurl_image_load(d->context, source->path, image, error);
    return knurl_image_decode(d->context, source->bytes, source->size, source->name, image, error);
}
