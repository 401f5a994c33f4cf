#include "render/film.h"

#include <string.h>

static const struct {
    const char *name;
    int32_t channels;
} aovs[KNURL_AOV_COUNT] = {
    {"depth", 1}, {"position", 3}, {"geometric_normal", 3}, {"shading_normal", 3}, {"albedo", 3},
    {"uv", 2},    {"object", 1},   {"triangle", 1},         {"steps", 1},
};

const char *knurl_aov_name(int32_t index)
{
    return index >= 0 && index < KNURL_AOV_COUNT ? aovs[index].name : NULL;
}

int32_t knurl_aov_channels(int32_t index)
{
    return index >= 0 && index < KNURL_AOV_COUNT ? aovs[index].channels : 0;
}

static void lay_out(film *f)
{
    f->channels = 4;
    for (int32_t i = 0; i < KNURL_AOV_COUNT; i++) {
        bool wanted = (f->aovs >> i & 1u) != 0;
        f->aov_offset[i] = wanted ? f->channels : -1;
        if (wanted) f->channels += aovs[i].channels;
    }
}

static bool pixel_bytes(const film *f, size_t *bytes)
{
    size_t pixels;
    return !knurl_mul_overflow((size_t)f->width, (size_t)f->height, &pixels) &&
           !knurl_mul_overflow(pixels, (size_t)f->channels * sizeof(float), bytes);
}

knurl_status film_create(knurl_context *context, const knurl_render_def *def, film **out, knurl_error *error)
{
    *out = NULL;
    film *f = knurl_alloc_zero(context, sizeof *f);
    if (!f) return knurl_fail_memory(error, sizeof *f, "the film");
    f->context = context;
    f->width = def->width;
    f->height = def->height;
    if (def->crop_width > 0) {
        f->x = def->crop_x;
        f->y = def->crop_y;
        f->width = def->crop_width;
        f->height = def->crop_height;
    }
    f->aovs = def->aovs;
    lay_out(f);
    size_t bytes = SIZE_MAX;
    if (pixel_bytes(f, &bytes)) {
        f->sum = knurl_alloc_zero(context, bytes);
        f->pass = knurl_alloc_zero(context, bytes);
    }
    if (!f->sum || !f->pass) {
        film_release(f);
        return knurl_fail_memory(error, bytes, "the film");
    }
    *out = f;
    return KNURL_OK;
}

void film_release(film *f)
{
    if (!f) return;
    knurl_free(f->context, f->sum);
    knurl_free(f->context, f->pass);
    knurl_free(f->context, f);
}

void film_finish_pass(film *f, int32_t samples)
{
    size_t count = (size_t)f->width * (size_t)f->height * (size_t)f->channels;
    for (size_t i = 0; i < count; i++) f->sum[i] += f->pass[i];
    memset(f->pass, 0, count * sizeof *f->pass);
    f->samples += samples;
}

static knurl_status resolve_layer(const film *f, int32_t offset, int32_t channels, float scale,
                                  knurl_image **image, knurl_error *error)
{
    size_t pixels = (size_t)f->width * (size_t)f->height;
    float *samples = knurl_alloc_array(f->context, pixels, (size_t)channels * sizeof(float));
    if (!samples) return knurl_fail_memory(error, pixels * (size_t)channels * sizeof(float), "the image");
    for (size_t i = 0; i < pixels; i++)
        for (int32_t c = 0; c < channels; c++)
            samples[i * (size_t)channels + (size_t)c] =
                f->sum[i * (size_t)f->channels + (size_t)(offset + c)] * scale;
    knurl_status status =
        knurl_image_create(f->context, f->width, f->height, channels, KNURL_PIXEL_F32, samples, image, error);
    knurl_free(f->context, samples);
    return status;
}

knurl_status film_resolve(const film *f, knurl_render_result *result, knurl_error *error)
{
    float mean = f->samples > 0 ? 1.0f / (float)f->samples : 0.0f;
    knurl_status status = resolve_layer(f, 0, 4, mean, &result->beauty, error);
    for (int32_t i = 0; status == KNURL_OK && i < KNURL_AOV_COUNT; i++) {
        if (f->aov_offset[i] < 0) continue;
        float scale = FILM_CENTRE_AOVS >> i & 1u ? 1.0f : mean;
        status = resolve_layer(f, f->aov_offset[i], aovs[i].channels, scale, &result->aovs[i], error);
    }
    return status;
}
