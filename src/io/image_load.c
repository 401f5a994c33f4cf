/* Loading images: the format is found from the first bytes. */
#include "io/image_io.h"

#include <string.h>

typedef struct image_magic {
    const char *bytes;
    size_t size;
    image_decode_fn *decode;
} image_magic;

static const image_magic magics[] = {
    {"\x89PNG\r\n\x1a\n", 8, image_png_decode},
    {"\xff\xd8\xff", 3, image_jpeg_decode},
    {"II*\0", 4, image_tiff_decode},
    {"MM\0*", 4, image_tiff_decode},
    {"II+\0", 4, image_tiff_decode},
    {"MM\0+", 4, image_tiff_decode},
    {"v/1\x01", 4, image_exr_decode},
    {"#?", 2, image_hdr_decode},
    {"P2", 2, image_pnm_decode},
    {"P3", 2, image_pnm_decode},
    {"P5", 2, image_pnm_decode},
    {"P6", 2, image_pnm_decode},
    {"Pf", 2, image_pfm_decode},
    {"PF", 2, image_pfm_decode},
};

size_t image_library_memory(const knurl_context *context)
{
    uint64_t limit = knurl_context_get_def(context)->memory_limit;
    uint64_t most = UINT64_C(1) << 34;
    return (size_t)(limit && limit < most ? limit : most);
}

knurl_status knurl_image_decode(knurl_context *context, const void *bytes, size_t size, const char *name,
                                knurl_image **image, knurl_error *error)
{
    if (!image) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "image is NULL");
    *image = NULL;
    if (!context || (!bytes && size > 0))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s is NULL", context ? "bytes" : "context");
    if (!name) name = "image";
    if (size == 0) return knurl_fail(error, KNURL_ERROR_INPUT, "%s: empty, expected an image", name);
    image_source source = {.context = context, .bytes = bytes, .size = size, .name = name};
    for (size_t i = 0; i < sizeof magics / sizeof *magics; i++)
        if (size >= magics[i].size && memcmp(bytes, magics[i].bytes, magics[i].size) == 0)
            return magics[i].decode(&source, image, error);
    unsigned char first[4] = {0};
    memcpy(first, bytes, size < 4 ? size : 4);
    return knurl_fail(
        error, KNURL_ERROR_INPUT,
        "%s: starts with %02x %02x %02x %02x, expected a PNG, JPEG, TIFF, OpenEXR, Radiance HDR, "
        "PGM, PPM or PFM image",
        name, first[0], first[1], first[2], first[3]);
}

knurl_status knurl_image_load(knurl_context *context, const char *path, knurl_image **image,
                              knurl_error *error)
{
    if (!image) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "image is NULL");
    *image = NULL;
    if (!context || !path)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "%s is NULL", context ? "path" : "context");
    unsigned char *bytes;
    size_t size;
    knurl_status status = knurl_file_read(context, path, &bytes, &size, error);
    if (status != KNURL_OK) return status;
    status = knurl_image_decode(context, bytes, size, path, image, error);
    knurl_free(context, bytes);
    return status;
}
