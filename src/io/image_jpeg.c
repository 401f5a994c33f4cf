/* JPEG through libjpeg-turbo: grey and RGB, 8 bits. */
#include "io/image_io.h"

#include <setjmp.h>

#include <jpeglib.h>
#include <jerror.h>

/* A progressive file may repeat scans without end: real ones have about ten. */
enum { JPEG_MAX_SCANS = 500, JPEG_QUALITY = 95 };

typedef struct jpeg_job {
    struct jpeg_error_mgr manager; /* first: libjpeg hands it back to us */
    struct jpeg_progress_mgr progress;
    jmp_buf jump;
    knurl_context *context;
    const image_source *source;
    const knurl_image *written;
    FILE *file;
    const char *name;
    knurl_image *image;
    knurl_status failure, status;
    knurl_error *error;
    union {
        struct jpeg_decompress_struct read;
        struct jpeg_compress_struct write;
    } jpeg;
} jpeg_job;

static void fail_and_jump(j_common_ptr jpeg)
{
    jpeg_job *job = (jpeg_job *)(void *)jpeg->err;
    char text[JMSG_LENGTH_MAX];
    job->manager.format_message(jpeg, text);
    knurl_status status =
        job->manager.msg_code == JERR_OUT_OF_MEMORY || job->manager.msg_code == JERR_NO_BACKING_STORE
            ? KNURL_ERROR_MEMORY
            : job->failure;
    job->status = knurl_fail(job->error, status, "%s: JPEG: %s", job->name, text);
    longjmp(job->jump, 1);
}

/* libjpeg goes on after damage and makes pixels up; for data that is an error. Odd headers are not. */
static void on_message(j_common_ptr jpeg, int level)
{
    jpeg_job *job = (jpeg_job *)(void *)jpeg->err;
    if (level >= 0) return; /* trace */
    switch (job->manager.msg_code) {
    case JWRN_HIT_MARKER:
    case JWRN_JPEG_EOF:
    case JWRN_HUFF_BAD_CODE:
    case JWRN_ARITH_BAD_CODE:
    case JWRN_MUST_RESYNC:
    case JWRN_NOT_SEQUENTIAL:
    case JWRN_BOGUS_PROGRESSION:
        fail_and_jump(jpeg);
        break;
    default:
        break;
    }
    char text[JMSG_LENGTH_MAX];
    job->manager.format_message(jpeg, text);
    knurl_log(job->context, KNURL_LOG_DEBUG, "%s: JPEG: %s", job->name, text);
}

static void on_output(j_common_ptr jpeg)
{
    (void)jpeg;
}

static void on_progress(j_common_ptr jpeg)
{
    jpeg_job *job = (jpeg_job *)(void *)jpeg->err;
    if (job->jpeg.read.input_scan_number <= JPEG_MAX_SCANS) return;
    job->status =
        knurl_fail(job->error, KNURL_ERROR_INPUT, "%s: JPEG: more than %d scans", job->name, JPEG_MAX_SCANS);
    longjmp(job->jump, 1);
}

static struct jpeg_error_mgr *start_errors(jpeg_job *job)
{
    jpeg_std_error(&job->manager);
    job->manager.error_exit = fail_and_jump;
    job->manager.emit_message = on_message;
    job->manager.output_message = on_output;
    return &job->manager;
}

static knurl_status read_guarded(jpeg_job *job)
{
    struct jpeg_decompress_struct *jpeg = &job->jpeg.read;
    if (setjmp(job->jump)) return job->status;
    jpeg_create_decompress(jpeg);
    jpeg->progress = &job->progress;
    job->progress.progress_monitor = on_progress;
    jpeg->mem->max_memory_to_use = (long)image_library_memory(job->context);
    jpeg_mem_src(jpeg, job->source->bytes, job->source->size);
    jpeg_read_header(jpeg, TRUE);
    switch (jpeg->jpeg_color_space) {
    case JCS_GRAYSCALE:
        jpeg->out_color_space = JCS_GRAYSCALE;
        break;
    case JCS_RGB:
    case JCS_YCbCr:
        jpeg->out_color_space = JCS_RGB;
        break;
    default:
        return job->status =
                   knurl_fail(job->error, KNURL_ERROR_UNSUPPORTED,
                              "%s: JPEG: %d components in an unknown or CMYK colour space, expected "
                              "grey or RGB",
                              job->name, jpeg->num_components);
    }
    int32_t channels = jpeg->out_color_space == JCS_RGB ? 3 : 1;
    job->status = image_make(job->context, job->name, jpeg->image_width, jpeg->image_height, channels,
                             KNURL_PIXEL_U8, &job->image, job->error);
    if (job->status != KNURL_OK) return job->status;
    jpeg_start_decompress(jpeg);
    while (jpeg->output_scanline < jpeg->output_height) {
        JSAMPROW row = image_row(job->image, (int32_t)jpeg->output_scanline);
        jpeg_read_scanlines(jpeg, &row, 1);
    }
    jpeg_finish_decompress(jpeg);
    return KNURL_OK;
}

knurl_status image_jpeg_decode(const image_source *source, knurl_image **image, knurl_error *error)
{
    jpeg_job job = {.context = source->context,
                    .source = source,
                    .name = source->name,
                    .failure = KNURL_ERROR_INPUT,
                    .error = error};
    job.jpeg.read.err = start_errors(&job);
    knurl_status status = read_guarded(&job);
    jpeg_destroy_decompress(&job.jpeg.read);
    if (status != KNURL_OK) {
        knurl_image_release(job.image);
        return status;
    }
    *image = job.image;
    return KNURL_OK;
}

static knurl_status write_guarded(jpeg_job *job)
{
    struct jpeg_compress_struct *jpeg = &job->jpeg.write;
    if (setjmp(job->jump)) return job->status;
    const knurl_image *image = job->written;
    jpeg_create_compress(jpeg);
    jpeg_stdio_dest(jpeg, job->file);
    jpeg->image_width = (JDIMENSION)image->width;
    jpeg->image_height = (JDIMENSION)image->height;
    jpeg->input_components = image->channels;
    jpeg->in_color_space = image->channels == 3 ? JCS_RGB : JCS_GRAYSCALE;
    jpeg_set_defaults(jpeg);
    jpeg_set_quality(jpeg, JPEG_QUALITY, TRUE);
    /* Colour at full resolution: renders have hard edges. */
    jpeg->comp_info[0].h_samp_factor = jpeg->comp_info[0].v_samp_factor = 1;
    jpeg_start_compress(jpeg, TRUE);
    while (jpeg->next_scanline < jpeg->image_height) {
        /* libjpeg's rows are not const, but it only reads them. */
        JSAMPROW row = (JSAMPROW)(uintptr_t)image_row_const(image, (int32_t)jpeg->next_scanline);
        jpeg_write_scanlines(jpeg, &row, 1);
    }
    jpeg_finish_compress(jpeg);
    return KNURL_OK;
}

knurl_status image_jpeg_encode(const knurl_image *image, const char *path, const char *name,
                               knurl_error *error)
{
    if (image->width > JPEG_MAX_DIMENSION || image->height > JPEG_MAX_DIMENSION)
        return knurl_fail(error, KNURL_ERROR_UNSUPPORTED,
                          "%s: %d x %d pixels, JPEG holds at most %ld per side", name, image->width,
                          image->height, JPEG_MAX_DIMENSION);
    jpeg_job job = {.context = image->context,
                    .written = image,
                    .name = name,
                    .failure = KNURL_ERROR_OUTPUT,
                    .error = error};
    knurl_status status = image_file_open(path, name, &job.file, error);
    if (status != KNURL_OK) return status;
    job.jpeg.write.err = start_errors(&job);
    status = write_guarded(&job);
    jpeg_destroy_compress(&job.jpeg.write);
    knurl_status closed = image_file_close(job.file, name, status == KNURL_OK ? error : NULL);
    return status != KNURL_OK ? status : closed;
}
