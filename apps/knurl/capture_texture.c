/* capture_texture.c: base colour, roughness and metalness of a hit, as glTF defines them. */
#include "capture.h"

#include <math.h>
#include <stdlib.h>

struct capture_textures {
    const knurl_description *description;
    knurl_image **images; /* by image index; NULL where nothing here uses it */
    double linear[256];   /* 8-bit sRGB to linear */
};

static double srgb_decode(double x)
{
    return x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
}

double capture_srgb_encode(double x)
{
    return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
}

int capture_textures_load(command_session *session, const knurl_description *description,
                          capture_textures **out)
{
    capture_textures *t = calloc(1, sizeof *t);
    if (t) t->images = calloc((size_t)description->image_count + 1, sizeof(knurl_image *));
    *out = t;
    if (!t || !t->images) return session_fail_with(session, CODE_LIMIT, "out of memory for textures");
    t->description = description;
    for (int i = 0; i < 256; i++) t->linear[i] = srgb_decode(i / 255.0);
    for (uint32_t i = 0; i < 2 * description->material_count; i++) {
        const knurl_description_material *m = &description->materials[i / 2];
        int32_t image = i % 2 ? m->metallic_roughness_texture.image : m->base_color_texture.image;
        if (image < 0 || t->images[image]) continue;
        knurl_error error = {0};
        if (knurl_description_load_image(description, image, &t->images[image], &error) != KNURL_OK)
            return session_fail(session, &error);
    }
    return CODE_DONE;
}

void capture_textures_release(capture_textures *t)
{
    if (!t) return;
    for (uint32_t i = 0; t->images && i < t->description->image_count; i++)
        if (t->images[i]) knurl_image_release(t->images[i]);
    free(t->images);
    free(t);
}

static int32_t wrap(int64_t x, int32_t size, knurl_wrap mode)
{
    if (mode == KNURL_WRAP_CLAMP) return x < 0 ? 0 : x >= size ? size - 1 : (int32_t)x;
    int64_t period = mode == KNURL_WRAP_MIRROR ? 2 * (int64_t)size : size;
    x %= period;
    if (x < 0) x += period;
    return (int32_t)(x < size ? x : period - 1 - x);
}

/* Adds `weight` times a texel. `color`: integers are sRGB-encoded. */
static void add_texel(const capture_textures *t, const knurl_texture_ref *ref, bool color, int64_t x,
                      int64_t y, double weight, double sum[4])
{
    const knurl_image *image = t->images[ref->image];
    int32_t column = wrap(x, knurl_image_width(image), ref->wrap_u);
    int32_t row = wrap(y, knurl_image_height(image), ref->wrap_v);
    int32_t channels = knurl_image_channels(image);
    for (int32_t c = 0; c < 3; c++) {
        double value = (double)knurl_image_value(image, column, row, channels >= 3 ? c : 0);
        if (color && knurl_image_format(image) == KNURL_PIXEL_U8)
            value = t->linear[(int)(value * 255 + 0.5)];
        else if (color && knurl_image_format(image) == KNURL_PIXEL_U16)
            value = srgb_decode(value);
        sum[c] += weight * value;
    }
    bool alpha = channels == 2 || channels == 4;
    sum[3] += weight * (alpha ? (double)knurl_image_value(image, column, row, channels - 1) : 1);
}

static void sample(const capture_textures *t, const knurl_texture_ref *ref, bool color, const double st[2],
                   double out[4])
{
    const knurl_image *image = t->images[ref->image];
    double s = ref->uv_scale[0] * st[0], r = ref->uv_scale[1] * st[1];
    double cosine = cos(ref->uv_rotation), sine = sin(ref->uv_rotation);
    double x = (ref->uv_offset[0] + cosine * s + sine * r) * knurl_image_width(image);
    double y = (ref->uv_offset[1] - sine * s + cosine * r) * knurl_image_height(image);
    /* Coordinates from files may be anything. */
    if (!(fabs(x) < 0x1p50) || !(fabs(y) < 0x1p50)) x = y = 0;
    out[0] = out[1] = out[2] = out[3] = 0;
    if (ref->nearest) {
        add_texel(t, ref, color, (int64_t)floor(x), (int64_t)floor(y), 1, out);
        return;
    }
    int64_t column = (int64_t)floor(x - 0.5), row = (int64_t)floor(y - 0.5);
    double fx = x - 0.5 - (double)column, fy = y - 0.5 - (double)row;
    for (int k = 0; k < 4; k++)
        add_texel(t, ref, color, column + k % 2, row + k / 2, (k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy),
                  out);
}

static const knurl_description_material *material_of(const capture_textures *t, const knurl_hit *hit)
{
    const knurl_description *d = t->description;
    return &d->materials[d->meshes[hit->object].material];
}

void capture_base_color(const capture_textures *t, const knurl_hit *hit, double color[4])
{
    const knurl_description_material *m = material_of(t, hit);
    for (int i = 0; i < 4; i++) color[i] = m->base_color[i];
    if (m->base_color_texture.image < 0) return;
    double texel[4];
    sample(t, &m->base_color_texture, true, hit->st, texel);
    for (int i = 0; i < 4; i++) color[i] *= texel[i];
}

void capture_surface(const capture_textures *t, const knurl_hit *hit, double *roughness, double *metallic)
{
    const knurl_description_material *m = material_of(t, hit);
    double texel[4] = {1, 1, 1, 1};
    if (m->metallic_roughness_texture.image >= 0)
        sample(t, &m->metallic_roughness_texture, false, hit->st, texel);
    *roughness = fmin(fmax(m->roughness * texel[1], 0), 1);
    *metallic = fmin(fmax(m->metallic * texel[2], 0), 1);
}

bool capture_is_hole(const capture_textures *t, const knurl_hit *hit)
{
    const knurl_description_material *m = material_of(t, hit);
    if (m->alpha_mode == KNURL_ALPHA_OPAQUE) return false;
    double color[4];
    capture_base_color(t, hit, color);
    return color[3] < (m->alpha_mode == KNURL_ALPHA_MASK ? m->alpha_cutoff : 0.5);
}
