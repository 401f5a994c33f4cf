/* DWA-compressed OpenEXR. OpenEXRCore 3.1 does not decompress it; OpenEXR's C++ side does, and its C
 * interface reads by file name only: the bytes go through a temporary file. That interface holds
 * pixels as halves, which costs 32-bit channels their last bits; DWA is lossy to begin with. */
#include "io/image_io.h"

#include <ImfCRgbaFile.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Rows are read in blocks of this many: a multiple of what DWAA (32) and DWAB (256) pack together,
 * so that nothing is unpacked twice. */
enum { DWA_ROWS = 256 };

static knurl_status write_temporary(const image_source *source, char path[1024], knurl_error *error)
{
    const char *folder = getenv("TMPDIR");
    int length = snprintf(path, 1024, "%s/knurl-XXXXXX.exr", folder && folder[0] ? folder : "/tmp");
    int file = length > 0 && length < 1024 ? mkstemps(path, 4) : -1;
    if (file < 0)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: no temporary file for DWA data: %s", source->name,
                          strerror(errno));
    size_t done = 0;
    while (done < source->size) {
        ssize_t got = write(file, source->bytes + done, source->size - done);
        if (got > 0)
            done += (size_t)got;
        else if (got == 0 || errno != EINTR)
            break;
    }
    bool closed = close(file) == 0;
    if (done == source->size && closed) return KNURL_OK;
    unlink(path);
    return knurl_fail(error, KNURL_ERROR_INPUT, "%s: temporary file for DWA data is incomplete: %s",
                      source->name, strerror(errno));
}

static bool read_rows(ImfInputFile *file, knurl_image *image, ImfRgba *block, int32_t left, int32_t top)
{
    int32_t channels = image->channels;
    for (int32_t y = 0; y < image->height; y += DWA_ROWS) {
        int32_t rows = image->height - y < DWA_ROWS ? image->height - y : DWA_ROWS;
        /* The library indexes with absolute pixel coordinates, so the base lies before the block. */
        ptrdiff_t first = ((ptrdiff_t)top + y) * image->width + left;
        ImfRgba *base = (ImfRgba *)((uintptr_t)block - (uintptr_t)(first * (ptrdiff_t)sizeof *block));
        if (!ImfInputSetFrameBuffer(file, base, 1, (size_t)image->width) ||
            !ImfInputReadPixels(file, top + y, top + y + rows - 1))
            return false;
        for (int32_t row = 0; row < rows; row++) {
            const ImfRgba *from = block + (size_t)row * (size_t)image->width;
            float *to = image_row(image, y + row);
            for (int32_t x = 0; x < image->width; x++, to += channels) {
                const ImfHalf rgba[4] = {from[x].r, from[x].g, from[x].b, from[x].a};
                for (int32_t c = 0; c < channels; c++) to[c] = image_half_to_float(rgba[c]);
            }
        }
    }
    return true;
}

static knurl_status read_file(const image_source *source, const char *path, knurl_image *image,
                              knurl_error *error)
{
    ImfInputFile *file = ImfOpenInputFile(path);
    if (!file)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s: OpenEXR: DWA-compressed file cannot be opened",
                          source->name);
    int left = 0, top = 0, right = 0, bottom = 0;
    ImfHeaderDataWindow(ImfInputHeader(file), &left, &top, &right, &bottom);
    size_t bytes = (size_t)image->width * DWA_ROWS * sizeof(ImfRgba);
    ImfRgba *block = knurl_alloc_zero(source->context, bytes);
    knurl_status status = KNURL_OK;
    if (!block)
        status = knurl_fail_memory(error, bytes, source->name);
    else if ((int64_t)right - left + 1 != image->width || (int64_t)bottom - top + 1 != image->height ||
             !read_rows(file, image, block, left, top))
        status = knurl_fail(error, KNURL_ERROR_INPUT,
                            "%s: OpenEXR: DWA-compressed data are damaged or incomplete", source->name);
    knurl_free(source->context, block);
    ImfCloseInputFile(file);
    return status;
}

knurl_status image_exr_dwa_decode(const image_source *source, int32_t width, int32_t height, int32_t channels,
                                  knurl_image **image, knurl_error *error)
{
    char path[1024];
    knurl_status status =
        image_make(source->context, source->name, width, height, channels, KNURL_PIXEL_F32, image, error);
    if (status == KNURL_OK) status = write_temporary(source, path, error);
    if (status == KNURL_OK) {
        status = read_file(source, path, *image, error);
        unlink(path);
    }
    if (status != KNURL_OK) {
        knurl_image_release(*image);
        *image = NULL;
    }
    return status;
}
