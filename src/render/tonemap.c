/* Display images: exposure, Hill's fit of the ACES reference and output transforms, sRGB encoding.
 * The fit works in a wider space than sRGB, so that strong colours run to white instead of clipping. */
#include "render/texture.h"
#include "render/warp.h"

#include <knurl/render.h>

/* Stephen Hill's (2016) matrices: sRGB to the rendering space with its saturation, and back. */
static vec3 to_rendering_space(vec3 c)
{
    return v3(0.59719 * c.x + 0.35458 * c.y + 0.04823 * c.z, 0.07600 * c.x + 0.90834 * c.y + 0.01566 * c.z,
              0.02840 * c.x + 0.13383 * c.y + 0.83777 * c.z);
}

static vec3 from_rendering_space(vec3 c)
{
    return v3(1.60475 * c.x - 0.53108 * c.y - 0.07367 * c.z, -0.10208 * c.x + 1.10813 * c.y - 0.00605 * c.z,
              -0.00327 * c.x - 0.07276 * c.y + 1.07602 * c.z);
}

static double curve(double x)
{
    return (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.4329510) + 0.238081);
}

static uint8_t encode(double x)
{
    return (uint8_t)(texture_linear_to_srgb(warp_clamp(x, 0.0, 1.0)) * 255.0 + 0.5);
}

/* Hill's fit is 0.6 stops under the common exposure; this puts middle grey back in its place. */
static const double base_exposure = 1.5;

static void tonemap_pixel(const knurl_image *linear, int32_t x, int32_t y, double gain, uint8_t *out)
{
    double c[3];
    int32_t channels = knurl_image_channels(linear);
    for (int i = 0; i < 3; i++) {
        double value = (double)knurl_image_value(linear, x, y, channels >= 3 ? i : 0) * gain;
        c[i] = value > 0.0 ? fmin(value, 1e6) : 0.0; /* NaN goes to 0 */
    }
    vec3 v = to_rendering_space(v3_load(c));
    v = from_rendering_space(v3(curve(v.x), curve(v.y), curve(v.z)));
    out[0] = encode(v.x);
    out[1] = encode(v.y);
    out[2] = encode(v.z);
}

typedef struct tonemap_job {
    const knurl_image *linear;
    double gain;
    uint8_t *out;
} tonemap_job;

static void tonemap_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    const tonemap_job *job = user;
    int32_t width = knurl_image_width(job->linear);
    (void)thread;
    for (size_t y = begin; y < end; y++)
        for (int32_t x = 0; x < width; x++)
            tonemap_pixel(job->linear, x, (int32_t)y, job->gain,
                          job->out + 3 * (y * (size_t)width + (size_t)x));
}

knurl_status knurl_tonemap(knurl_context *context, const knurl_image *linear, double exposure,
                           knurl_image **display, knurl_error *error)
{
    if (!context || !linear || !display)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "context, linear or display is NULL");
    *display = NULL;
    if (!(fabs(exposure) <= 64.0))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "exposure is %g stops, expected -64 to 64", exposure);
    int32_t width = knurl_image_width(linear), height = knurl_image_height(linear);
    tonemap_job job = {.linear = linear, .gain = base_exposure * exp2(exposure)};
    job.out = knurl_alloc_array(context, (size_t)width * (size_t)height, 3);
    if (!job.out) return knurl_fail_memory(error, (size_t)width * (size_t)height * 3, "the display image");
    knurl_parallel_for(context, (size_t)height, 16, tonemap_rows, &job);
    knurl_status status =
        knurl_image_create(context, width, height, 3, KNURL_PIXEL_U8, job.out, display, error);
    knurl_free(context, job.out);
    return status;
}
