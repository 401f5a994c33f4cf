#include "render/texture.h"

#include "data/height.h"

double texture_srgb_to_linear(double x)
{
    return x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
}

double texture_linear_to_srgb(double x)
{
    return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1.0 / 2.4) - 0.055;
}

static knurl_status load_texture(texture_set *set, const knurl_description *description,
                                 const knurl_texture_ref *ref, const char *material, knurl_error *error)
{
    if (ref->image == -1) return KNURL_OK;
    if (ref->image < 0 || (uint32_t)ref->image >= set->count)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "material %s names image %d of %u",
                          material ? material : "?", ref->image, set->count);
    if (set->images[ref->image]) return KNURL_OK;
    knurl_status status =
        knurl_description_load_image(description, ref->image, &set->images[ref->image], error);
    return status == KNURL_OK ? status
                              : knurl_fail_prefix(error, status, "material %s", material ? material : "?");
}

knurl_status texture_set_create(const knurl_description *description, texture_set **out, knurl_error *error)
{
    *out = NULL;
    texture_set *set = knurl_alloc_zero(description->context, sizeof *set);
    if (!set) return knurl_fail_memory(error, sizeof *set, "textures");
    set->context = description->context;
    set->count = description->image_count;
    size_t bytes = set->count * sizeof *set->images;
    set->images = knurl_alloc_zero(set->context, bytes);
    knurl_status status = set->images ? KNURL_OK : knurl_fail_memory(error, bytes, "textures");
    for (int i = 0; i < 256; i++) set->srgb[i] = (float)texture_srgb_to_linear(i / 255.0);
    for (uint32_t i = 0; status == KNURL_OK && i < description->material_count; i++) {
        const knurl_description_material *m = &description->materials[i];
        status = load_texture(set, description, &m->base_color_texture, m->name, error);
        if (status == KNURL_OK)
            status = load_texture(set, description, &m->metallic_roughness_texture, m->name, error);
        if (status == KNURL_OK) status = load_texture(set, description, &m->emissive_texture, m->name, error);
    }
    if (status != KNURL_OK) {
        texture_set_release(set);
        return status;
    }
    *out = set;
    return KNURL_OK;
}

void texture_set_release(texture_set *set)
{
    if (!set) return;
    for (uint32_t i = 0; set->images && i < set->count; i++) knurl_image_release(set->images[i]);
    knurl_free(set->context, set->images);
    knurl_free(set->context, set);
}

static double decode(const texture_set *set, const knurl_image *image, size_t sample, bool color)
{
    const void *samples = knurl_image_samples(image);
    switch (knurl_image_format(image)) {
    case KNURL_PIXEL_U8: {
        uint8_t value = ((const uint8_t *)samples)[sample];
        return color ? (double)set->srgb[value] : value / 255.0;
    }
    case KNURL_PIXEL_U16: {
        double value = ((const uint16_t *)samples)[sample] / 65535.0;
        return color ? texture_srgb_to_linear(value) : value;
    }
    default:
        return (double)((const float *)samples)[sample];
    }
}

static texel fetch(const texture_set *set, const knurl_image *image, const knurl_texture_ref *ref, int64_t x,
                   int64_t y, bool color)
{
    int32_t width = knurl_image_width(image), channels = knurl_image_channels(image);
    size_t column = (size_t)height_wrap(x, width, ref->wrap_u);
    size_t row = (size_t)height_wrap(y, knurl_image_height(image), ref->wrap_v);
    size_t first = (row * (size_t)width + column) * (size_t)channels;
    texel t = {.alpha = 1.0};
    t.color.x = decode(set, image, first, color);
    t.color.y = channels >= 3 ? decode(set, image, first + 1, color) : t.color.x;
    t.color.z = channels >= 3 ? decode(set, image, first + 2, color) : t.color.x;
    if (channels == 2 || channels == 4) t.alpha = decode(set, image, first + (size_t)channels - 1, false);
    return t;
}

static texel mix(texel a, texel b, double t)
{
    return (texel){v3_add(v3_scale(a.color, 1.0 - t), v3_scale(b.color, t)),
                   a.alpha + (b.alpha - a.alpha) * t};
}

/* (u, v) = offset + rotate(scale * (s, t)), KHR_texture_transform. The angle turns counter-clockwise
 * as seen on the image, whose v points down. */
static vec2 transform_uv(const knurl_texture_ref *ref, const double st[2])
{
    double x = ref->uv_scale[0] * st[0], y = ref->uv_scale[1] * st[1];
    if (ref->uv_rotation == 0.0) return (vec2){ref->uv_offset[0] + x, ref->uv_offset[1] + y};
    double c = cos(ref->uv_rotation), s = sin(ref->uv_rotation);
    return (vec2){ref->uv_offset[0] + c * x + s * y, ref->uv_offset[1] - s * x + c * y};
}

texel texture_lookup(const texture_set *set, const knurl_texture_ref *ref, const double st[2], bool color)
{
    const knurl_image *image = set->images[ref->image];
    vec2 uv = transform_uv(ref, st);
    double x = uv.x * knurl_image_width(image), y = uv.y * knurl_image_height(image);
    /* Coordinates from files may be anything; beyond 2^50 texels no fraction is left. */
    if (!(fabs(x) < 0x1p50) || !(fabs(y) < 0x1p50)) x = y = 0.0;
    if (ref->nearest) return fetch(set, image, ref, (int64_t)floor(x), (int64_t)floor(y), color);
    x -= 0.5;
    y -= 0.5;
    int64_t column = (int64_t)floor(x), row = (int64_t)floor(y);
    double fx = x - (double)column, fy = y - (double)row;
    texel top =
        mix(fetch(set, image, ref, column, row, color), fetch(set, image, ref, column + 1, row, color), fx);
    texel bottom = mix(fetch(set, image, ref, column, row + 1, color),
                       fetch(set, image, ref, column + 1, row + 1, color), fx);
    return mix(top, bottom, fy);
}
