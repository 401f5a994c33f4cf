/* PNG through libpng's row interface: rows go straight into the image. Gamma and colour chunks are
 * not looked at: samples are data. */
#include "io/image_io.h"

#include <png.h>
#include <string.h>

typedef struct png_job {
    knurl_context *context;
    const image_source *source; /* reading */
    size_t at;
    const knurl_image *written; /* writing */
    FILE *file;
    const char *name;
    knurl_image *image;
    png_structp png;
    png_infop info;
    bool out_of_memory;
    knurl_status failure; /* what kind of failure a libpng error is */
    knurl_status status;
    knurl_error *error;
} png_job;

static void on_error(png_structp png, png_const_charp message)
{
    png_job *job = png_get_error_ptr(png);
    if (job->status == KNURL_OK)
        job->status = knurl_fail(job->error, job->out_of_memory ? KNURL_ERROR_MEMORY : job->failure,
                                 "%s: PNG: %s", job->name, message);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
    const png_job *job = png_get_error_ptr(png);
    knurl_log(job->context, KNURL_LOG_DEBUG, "%s: PNG: %s", job->name, message);
}

static png_voidp on_alloc(png_structp png, png_alloc_size_t size)
{
    png_job *job = png_get_mem_ptr(png);
    void *p = knurl_alloc(job->context, size);
    if (!p) job->out_of_memory = true;
    return p;
}

static void on_free(png_structp png, png_voidp p)
{
    const png_job *job = png_get_mem_ptr(png);
    knurl_free(job->context, p);
}

static void on_read(png_structp png, png_bytep to, size_t size)
{
    png_job *job = png_get_io_ptr(png);
    if (size > job->source->size - job->at) {
        job->status =
            knurl_fail(job->error, KNURL_ERROR_INPUT, "%s: PNG: file ends after %zu bytes, more expected",
                       job->name, job->source->size);
        png_error(png, "end of file");
    }
    memcpy(to, job->source->bytes + job->at, size);
    job->at += size;
}

static void prepare_transforms(png_job *job)
{
    png_byte type = png_get_color_type(job->png, job->info);
    png_byte depth = png_get_bit_depth(job->png, job->info);
    if (type == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(job->png);
    if (type == PNG_COLOR_TYPE_GRAY && depth < 8) png_set_expand_gray_1_2_4_to_8(job->png);
    if (png_get_valid(job->png, job->info, PNG_INFO_tRNS)) png_set_tRNS_to_alpha(job->png);
    if (depth == 16 && image_little_endian()) png_set_swap(job->png);
}

/* Everything that may jump. Nothing local is used after a jump. */
static knurl_status read_guarded(png_job *job)
{
    if (setjmp(png_jmpbuf(job->png))) return job->status;
    png_set_read_fn(job->png, job, on_read);
    png_set_user_limits(job->png, IMAGE_MAX_SIDE, IMAGE_MAX_SIDE);
    png_set_chunk_cache_max(job->png, 128);
    png_set_chunk_malloc_max(job->png, 8u << 20);
    /* Negative count: drop all that is not needed for pixels, profiles and texts included. */
    png_set_keep_unknown_chunks(job->png, PNG_HANDLE_CHUNK_NEVER, NULL, -1);
    png_read_info(job->png, job->info);
    png_uint_32 width = png_get_image_width(job->png, job->info);
    png_uint_32 height = png_get_image_height(job->png, job->info);
    /* Deflate shrinks by 1032 at the most, so a short file can be refused before memory is taken. */
    if ((uint64_t)png_get_rowbytes(job->png, job->info) * height / 1040 > job->source->size) {
        job->status = knurl_fail(job->error, KNURL_ERROR_INPUT,
                                 "%s: PNG: %zu bytes cannot hold the %u x %u pixels that it declares",
                                 job->name, job->source->size, width, height);
        return job->status;
    }
    prepare_transforms(job);
    int passes = png_set_interlace_handling(job->png);
    png_read_update_info(job->png, job->info);
    knurl_pixel_format format =
        png_get_bit_depth(job->png, job->info) == 16 ? KNURL_PIXEL_U16 : KNURL_PIXEL_U8;
    job->status = image_make(job->context, job->name, width, height, png_get_channels(job->png, job->info),
                             format, &job->image, job->error);
    if (job->status != KNURL_OK) return job->status;
    if (png_get_rowbytes(job->png, job->info) != image_row_bytes(job->image))
        png_error(job->png, "unexpected row size");
    for (int pass = 0; pass < passes; pass++)
        for (int32_t y = 0; y < job->image->height; y++)
            png_read_row(job->png, image_row(job->image, y), NULL);
    png_read_end(job->png, NULL);
    return KNURL_OK;
}

knurl_status image_png_decode(const image_source *source, knurl_image **image, knurl_error *error)
{
    png_job job = {.context = source->context,
                   .source = source,
                   .name = source->name,
                   .failure = KNURL_ERROR_INPUT,
                   .error = error};
    job.png =
        png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &job, on_error, on_warning, &job, on_alloc, on_free);
    if (job.png) job.info = png_create_info_struct(job.png);
    knurl_status status =
        job.info ? read_guarded(&job) : knurl_fail_memory(error, sizeof(job), "PNG decoder");
    png_destroy_read_struct(&job.png, &job.info, NULL);
    if (status != KNURL_OK) {
        knurl_image_release(job.image);
        return status;
    }
    *image = job.image;
    return KNURL_OK;
}

static knurl_status write_guarded(png_job *job)
{
    static const int types[] = {0, PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                PNG_COLOR_TYPE_RGB_ALPHA};
    if (setjmp(png_jmpbuf(job->png))) return job->status;
    const knurl_image *image = job->written;
    png_init_io(job->png, job->file);
    png_set_user_limits(job->png, IMAGE_MAX_SIDE, IMAGE_MAX_SIDE);
    png_set_IHDR(job->png, job->info, (png_uint_32)image->width, (png_uint_32)image->height,
                 image->format == KNURL_PIXEL_U16 ? 16 : 8, types[image->channels], PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_compression_level(job->png, 3); /* files grow by a few per cent, and take half the time */
    png_write_info(job->png, job->info);
    if (image->format == KNURL_PIXEL_U16 && image_little_endian()) png_set_swap(job->png);
    for (int32_t y = 0; y < image->height; y++) png_write_row(job->png, image_row_const(image, y));
    png_write_end(job->png, NULL);
    return KNURL_OK;
}

knurl_status image_png_encode(const knurl_image *image, const char *path, const char *name,
                              knurl_error *error)
{
    png_job job = {.context = image->context,
                   .written = image,
                   .name = name,
                   .failure = KNURL_ERROR_OUTPUT,
                   .error = error};
    knurl_status status = image_file_open(path, name, &job.file, error);
    if (status != KNURL_OK) return status;
    job.png =
        png_create_write_struct_2(PNG_LIBPNG_VER_STRING, &job, on_error, on_warning, &job, on_alloc, on_free);
    if (job.png) job.info = png_create_info_struct(job.png);
    status = job.info ? write_guarded(&job) : knurl_fail_memory(error, sizeof(job), "PNG encoder");
    png_destroy_write_struct(&job.png, &job.info);
    knurl_status closed = image_file_close(job.file, name, status == KNURL_OK ? error : NULL);
    return status != KNURL_OK ? status : closed;
}
