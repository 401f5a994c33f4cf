/* MTL files line by line, and their conversion to metallic-roughness (docs/scene-format.md). */
#include "io/mtl.h"

#include <math.h>
#include <string.h>

#include "data/description.h"

/* What one newmtl says. Values that were not given are NaN. */
typedef struct mtl_material {
    double kd[3], ks[3], ke[3], tf[3];
    double ns, ni, dissolve, roughness, metallic;
    int64_t illum;
    bool open; /* a newmtl was seen */
    knurl_texture_ref map_kd, map_ke, map_pr, map_pm, map_d;
} mtl_material;

typedef struct mtl_reader {
    mtl_place at;
    knurl_context *context;
    mtl_material now;
    uint32_t material; /* index of the material being read */
} mtl_reader;

static void clear_material(mtl_material *m)
{
    *m =
        (mtl_material){.ns = NAN, .ni = NAN, .dissolve = 1.0, .roughness = NAN, .metallic = NAN, .illum = -1};
    m->kd[0] = m->ks[0] = m->ke[0] = m->tf[0] = NAN;
    m->map_kd = m->map_ke = m->map_pr = m->map_pm = m->map_d = description_no_texture();
}

static bool is_refractive(const mtl_material *m)
{
    return m->illum == 6 || m->illum == 7;
}

static void convert_opacity(mtl_reader *r, knurl_description_material *out)
{
    const mtl_material *m = &r->now;
    double dissolve = fmin(fmax(m->dissolve, 0.0), 1.0);
    if (is_refractive(m)) {
        bool filter = !isnan(m->tf[0]);
        double brightest = filter ? fmax(m->tf[0], fmax(m->tf[1], m->tf[2])) : 0.0;
        out->transmission = dissolve < 1.0 ? 1.0 - dissolve : fmin(fmax(brightest, 0.0), 1.0);
        if (filter && out->transmission > 0.0)
            for (int i = 0; i < 3; i++) out->base_color[i] = m->tf[i];
        return;
    }
    out->base_color[3] = dissolve;
    if (dissolve < 1.0) out->alpha_mode = KNURL_ALPHA_BLEND;
    if (m->map_d.image < 0) return;
    /* The description has one image for colour and alpha. */
    if (m->map_d.image == m->map_kd.image)
        out->alpha_mode = KNURL_ALPHA_BLEND;
    else
        description_warn(
            r->at.description,
            "%s: material \"%s\": map_d is ignored, it is read only from the alpha of map_Kd's file",
            r->at.path, out->name);
}

static void convert_specular(mtl_reader *r, knurl_description_material *out)
{
    const mtl_material *m = &r->now;
    bool shiny = !isnan(m->ks[0]) && fmax(m->ks[0], fmax(m->ks[1], m->ks[2])) > 0.0;
    bool mirror = m->illum == 3 || m->illum == 5 || m->illum == 8;
    /* Phong exponent to Beckmann width: alpha^2 = 2 / (Ns + 2); alpha = roughness^2. */
    bool glossy = shiny || is_refractive(m);
    out->roughness = glossy && !isnan(m->ns) ? pow(2.0 / (fmax(m->ns, 0.0) + 2.0), 0.25) : 1.0;
    if (!isnan(m->roughness))
        out->roughness = m->roughness;
    else if (m->map_pr.image >= 0)
        out->roughness = 1.0;
    out->metallic = !isnan(m->metallic) ? m->metallic : 0.0;
    bool black = !isnan(m->kd[0]) && fmax(m->kd[0], fmax(m->kd[1], m->kd[2])) <= 0.0;
    if (isnan(m->metallic) && mirror && shiny && black && m->map_kd.image < 0) {
        out->metallic = 1.0;
        for (int i = 0; i < 3; i++) out->base_color[i] = m->ks[i];
    }
    /* Ni 1 is what programs write that have no such setting; glass of index 1 would be invisible. */
    if (!isnan(m->ni) && m->ni > 1.0) out->ior = m->ni;
    if (m->map_pr.image >= 0) out->metallic_roughness_texture = m->map_pr;
    if (m->map_pm.image < 0) return;
    if (m->map_pm.image == m->map_pr.image)
        out->metallic = !isnan(m->metallic) ? m->metallic : 1.0;
    else
        description_warn(
            r->at.description,
            "%s: material \"%s\": map_Pm is ignored, it is read only from the blue of map_Pr's file",
            r->at.path, out->name);
}

/* Turns what newmtl and the lines after it said into the description's material. */
static void finish_material(mtl_reader *r)
{
    mtl_material *m = &r->now;
    if (!m->open) return;
    knurl_description_material *out = &r->at.description->materials[r->material];
    bool colored = !isnan(m->kd[0]);
    for (int i = 0; i < 3; i++) {
        out->base_color[i] = colored ? m->kd[i] : m->map_kd.image >= 0 ? 1.0 : 0.8;
        out->emissive[i] = !isnan(m->ke[0]) ? m->ke[i] : m->map_ke.image >= 0 ? 1.0 : 0.0;
    }
    out->base_color_texture = m->map_kd;
    out->emissive_texture = m->map_ke;
    convert_specular(r, out);
    convert_opacity(r, out);
    m->open = false;
}

static knurl_status begin_material(mtl_reader *r, text_span rest, knurl_error *error)
{
    finish_material(r);
    if (rest.begin == rest.end)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s:%u: newmtl without a name", r->at.path, r->at.line);
    knurl_description_material *made = description_append_material(r->at.description);
    if (!made) return knurl_fail_memory(error, sizeof *made, r->at.path);
    r->material = r->at.description->material_count - 1;
    made->name = text_copy(r->context, rest);
    if (!made->name) return knurl_fail_memory(error, (size_t)(rest.end - rest.begin), r->at.path);
    clear_material(&r->now);
    r->now.open = true;
    return KNURL_OK;
}

static knurl_status read_number(mtl_reader *r, text_span key, text_span *rest, double low, double high,
                                double *value, knurl_error *error)
{
    text_span word;
    if (!text_next_word(rest, &word) || !text_number(word, value))
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s:%u: %.*s: found \"%.*s\", expected a number",
                          r->at.path, r->at.line, text_shown(key), key.begin, text_shown(word), word.begin);
    if (*value >= low && *value <= high) return KNURL_OK;
    double inside = fmin(fmax(*value, low), high);
    description_warn(r->at.description, "%s:%u: %.*s is %g, expected %g to %g; %g is used", r->at.path,
                     r->at.line, text_shown(key), key.begin, *value, low, high, inside);
    *value = inside;
    return KNURL_OK;
}

static knurl_status read_color(mtl_reader *r, text_span key, text_span rest, double high, double color[3],
                               knurl_error *error)
{
    text_span look = rest, word;
    if (text_next_word(&look, &word) && (text_is(word, "spectral") || text_is(word, "xyz"))) {
        description_warn(r->at.description, "%s:%u: %.*s %.*s is not supported and ignored", r->at.path,
                         r->at.line, text_shown(key), key.begin, text_shown(word), word.begin);
        return KNURL_OK;
    }
    double value[3];
    knurl_status status = read_number(r, key, &rest, 0.0, high, &value[0], error);
    if (status != KNURL_OK) return status;
    value[1] = value[2] = value[0];
    for (int i = 1; i < 3 && rest.begin != rest.end; i++) {
        status = read_number(r, key, &rest, 0.0, high, &value[i], error);
        if (status != KNURL_OK) return status;
    }
    memcpy(color, value, sizeof value);
    return KNURL_OK;
}

static knurl_status add_texture(mtl_reader *r, text_span rest, mtl_texture *texture, knurl_texture_ref *ref,
                                knurl_error *error)
{
    knurl_status status = mtl_read_texture(&r->at, rest, texture, error);
    if (status != KNURL_OK) return status;
    size_t length = (size_t)(texture->name.end - texture->name.begin);
    if (length == 0)
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s:%u: the name of the image is empty", r->at.path,
                          r->at.line);
    char *path = text_path_beside(r->context, r->at.path, texture->name.begin, length);
    int32_t image = path ? knurl_description_add_image(r->at.description, path) : -1;
    knurl_free(r->context, path);
    if (image < 0) return knurl_fail_memory(error, length, "an image's name");
    *ref = mtl_texture_ref(texture, image);
    return KNURL_OK;
}

static knurl_status read_map(mtl_reader *r, text_span key, text_span rest, knurl_texture_ref *ref,
                             knurl_error *error)
{
    mtl_texture texture;
    knurl_status status = add_texture(r, rest, &texture, ref, error);
    if (status == KNURL_OK && (texture.base != 0.0 || texture.gain != 1.0))
        description_warn(r->at.description, "%s:%u: -mm and -bm are ignored on %.*s, they work on disp only",
                         r->at.path, r->at.line, text_shown(key), key.begin);
    return status;
}

static knurl_status read_displacement(mtl_reader *r, text_span rest, knurl_error *error)
{
    mtl_texture texture;
    knurl_texture_ref ref;
    knurl_status status = add_texture(r, rest, &texture, &ref, error);
    if (status != KNURL_OK) return status;
    knurl_description_material *out = &r->at.description->materials[r->material];
    out->displacement = ref;
    out->displacement_offset = texture.base;
    out->displacement_factor = texture.gain;
    return KNURL_OK;
}

static knurl_status read_illum(mtl_reader *r, text_span rest, knurl_error *error)
{
    text_span word;
    if (text_next_word(&rest, &word) && text_integer(word, &r->now.illum) && r->now.illum >= 0)
        return KNURL_OK;
    return knurl_fail(error, KNURL_ERROR_INPUT,
                      "%s:%u: illum: found \"%.*s\", expected a number from 0 to 10", r->at.path, r->at.line,
                      text_shown(word), word.begin);
}

static knurl_status read_dissolve(mtl_reader *r, text_span key, text_span rest, knurl_error *error)
{
    double value;
    text_span look = rest, word;
    if (text_next_word(&look, &word) && text_is(word, "-halo")) {
        description_warn(r->at.description, "%s:%u: -halo is ignored", r->at.path, r->at.line);
        rest = look;
    }
    knurl_status status = read_number(r, key, &rest, 0.0, 1.0, &value, error);
    if (status == KNURL_OK) r->now.dissolve = text_is(key, "Tr") ? 1.0 - value : value;
    return status;
}

/* Statements that say nothing about what knurl renders. */
static bool is_ignored(text_span key)
{
    static const char *const names[] = {"Ka",     "Km",    "map_Ka",      "map_Ks",    "map_Ns",  "map_Tr",
                                        "refl",   "Ps",    "Pc",          "Pcr",       "aniso",   "anisor",
                                        "map_Ps", "decal", "map_opacity", "sharpness", "map_aat", "map_refl"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (text_is(key, names[i])) return true;
    return false;
}

static knurl_status read_statement(mtl_reader *r, text_span key, text_span rest, knurl_error *error)
{
    mtl_material *m = &r->now;
    const struct {
        const char *name;
        double *target, low, high;
    } numbers[] = {{"Ns", &m->ns, 0.0, 1e9},
                   {"Ni", &m->ni, 0.001, 100.0},
                   {"Pr", &m->roughness, 0.0, 1.0},
                   {"Pm", &m->metallic, 0.0, 1.0}},
      colors[] = {{"Kd", m->kd, 0.0, 1.0},
                  {"Ks", m->ks, 0.0, 1.0},
                  {"Ke", m->ke, 0.0, 1e30},
                  {"Tf", m->tf, 0.0, 1.0}};
    const struct {
        const char *name;
        knurl_texture_ref *target;
    } maps[] = {{"map_Kd", &m->map_kd},
                {"map_Ke", &m->map_ke},
                {"map_Pr", &m->map_pr},
                {"map_Pm", &m->map_pm},
                {"map_d", &m->map_d}};
    for (size_t i = 0; i < 4; i++) {
        if (text_is(key, numbers[i].name))
            return read_number(r, key, &rest, numbers[i].low, numbers[i].high, numbers[i].target, error);
        if (text_is(key, colors[i].name))
            return read_color(r, key, rest, colors[i].high, colors[i].target, error);
    }
    for (size_t i = 0; i < sizeof maps / sizeof *maps; i++)
        if (text_is(key, maps[i].name)) return read_map(r, key, rest, maps[i].target, error);
    if (text_is(key, "disp") || text_is(key, "map_disp")) return read_displacement(r, rest, error);
    if (text_is(key, "illum")) return read_illum(r, rest, error);
    if (text_is(key, "d") || text_is(key, "Tr")) return read_dissolve(r, key, rest, error);
    if (text_is(key, "bump") || text_is(key, "map_bump") || text_is(key, "norm"))
        description_warn(r->at.description, "%s:%u: %.*s is ignored, only disp displaces", r->at.path,
                         r->at.line, text_shown(key), key.begin);
    else if (!is_ignored(key))
        description_warn(r->at.description, "%s:%u: statement %.*s is not known and ignored", r->at.path,
                         r->at.line, text_shown(key), key.begin);
    return KNURL_OK;
}

knurl_status mtl_read(knurl_description *d, unsigned char *bytes, size_t size, const char *path,
                      knurl_error *error)
{
    mtl_reader r = {.at = {d, path, 0}, .context = d->context};
    clear_material(&r.now);
    text_lines lines = {.at = (char *)bytes, .end = (char *)bytes + size};
    text_span rest, key;
    while (text_next_line(&lines, &rest)) {
        r.at.line = lines.line;
        if (!text_next_word(&rest, &key)) continue;
        knurl_status status = KNURL_OK;
        if (text_is(key, "newmtl"))
            status = begin_material(&r, rest, error);
        else if (!r.now.open)
            status = knurl_fail(error, KNURL_ERROR_INPUT, "%s:%u: found \"%.*s\", expected newmtl first",
                                path, lines.line, text_shown(key), key.begin);
        else
            status = read_statement(&r, key, rest, error);
        if (status != KNURL_OK) return status;
    }
    finish_material(&r);
    return KNURL_OK;
}
