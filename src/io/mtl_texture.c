/* Texture statements of MTL files: options, then a file name that may hold blanks. */
#include "io/mtl.h"

#include <math.h>

#include "data/description.h"

/* How many numbers or words follow an option, and what is done with it. */
typedef struct option {
    const char *name;
    int most;    /* numbers that may follow */
    bool word;   /* one word follows instead */
    bool effect; /* false: read and ignored */
} option;

static const option options[] = {
    {"-mm", 2, false, true},      {"-bm", 1, false, true},         {"-s", 3, false, true},
    {"-o", 3, false, true},       {"-clamp", 0, true, true},       {"-t", 3, false, false},
    {"-texres", 2, false, false}, {"-boost", 1, false, false},     {"-blendu", 0, true, false},
    {"-blendv", 0, true, false},  {"-imfchan", 0, true, false},    {"-type", 0, true, false},
    {"-cc", 0, true, false},      {"-colorspace", 0, true, false},
};

static const option *find_option(text_span word)
{
    for (size_t i = 0; i < sizeof options / sizeof *options; i++)
        if (text_is(word, options[i].name)) return &options[i];
    return NULL;
}

/* Up to `most` numbers off the front of *rest. The last word stays: it is the file's name, even if it
 * looks like a number. */
static int take_numbers(text_span *rest, int most, double *numbers)
{
    int count = 0;
    while (count < most) {
        text_span after = *rest, word;
        if (!text_next_word(&after, &word) || !text_number(word, &numbers[count])) break;
        if (after.begin == after.end) break;
        *rest = after;
        count++;
    }
    return count;
}

static void apply_numbers(const option *o, int count, const double *n, mtl_texture *texture, double *bump)
{
    if (text_is((text_span){o->name + 1, o->name + 3}, "mm")) {
        texture->base = n[0];
        if (count > 1) texture->gain = n[1];
    } else if (o->name[1] == 'b') {
        *bump = n[0];
    } else {
        double *target = o->name[1] == 's' ? texture->scale : texture->offset;
        for (int i = 0; i < count && i < 2; i++) target[i] = n[i];
    }
}

static knurl_status take_word(const mtl_place *at, const option *o, text_span *rest, mtl_texture *texture,
                              knurl_error *error)
{
    text_span word;
    if (!text_next_word(rest, &word))
        return knurl_fail(error, KNURL_ERROR_INPUT, "%s:%u: %s ends the line, expected a word after it",
                          at->path, at->line, o->name);
    if (text_is((text_span){o->name, o->name + 6}, "-clamp")) {
        bool on = text_is(word, "on");
        if (!on && !text_is(word, "off"))
            return knurl_fail(error, KNURL_ERROR_INPUT, "%s:%u: -clamp is \"%.*s\", expected on or off",
                              at->path, at->line, text_shown(word), word.begin);
        texture->clamp = on;
    } else if (text_is((text_span){o->name, o->name + 4}, "-imf") && !text_is(word, "r") &&
               !text_is(word, "m") && !text_is(word, "l")) {
        description_warn(at->description, "%s:%u: -imfchan %.*s is ignored, knurl reads the red channel",
                         at->path, at->line, text_shown(word), word.begin);
    }
    return KNURL_OK;
}

static knurl_status take_option(const mtl_place *at, text_span word, text_span *rest, mtl_texture *texture,
                                double *bump, knurl_error *error)
{
    const option *o = find_option(word);
    double numbers[3];
    if (!o) {
        (void)take_numbers(rest, 3, numbers);
        description_warn(at->description, "%s:%u: option %.*s is not known and ignored", at->path, at->line,
                         text_shown(word), word.begin);
        return KNURL_OK;
    }
    if (o->word) return take_word(at, o, rest, texture, error);
    int count = take_numbers(rest, o->most, numbers);
    if (count == 0) {
        text_span next = *rest, found;
        (void)text_next_word(&next, &found);
        return knurl_fail(error, KNURL_ERROR_INPUT,
                          "%s:%u: after %s found \"%.*s\", expected a number and, further on, a file name",
                          at->path, at->line, o->name, text_shown(found), found.begin);
    }
    if (o->effect) apply_numbers(o, count, numbers, texture, bump);
    return KNURL_OK;
}

knurl_status mtl_read_texture(const mtl_place *at, text_span rest, mtl_texture *texture, knurl_error *error)
{
    *texture = (mtl_texture){.gain = 1.0, .scale = {1.0, 1.0}};
    double bump = 1.0;
    for (;;) {
        text_span after = rest, word;
        if (!text_next_word(&after, &word))
            return knurl_fail(error, KNURL_ERROR_INPUT, "%s:%u: the line ends, expected the name of an image",
                              at->path, at->line);
        bool is_option = word.begin[0] == '-' && word.end - word.begin > 1 &&
                         (find_option(word) || after.begin != after.end);
        if (!is_option) break;
        rest = after;
        knurl_status status = take_option(at, word, &rest, texture, &bump, error);
        if (status != KNURL_OK) return status;
    }
    if (rest.end - rest.begin >= 2 && *rest.begin == '"' && rest.end[-1] == '"') {
        rest.begin++;
        rest.end--;
    }
    texture->name = rest;
    texture->gain *= bump;
    return KNURL_OK;
}

knurl_texture_ref mtl_texture_ref(const mtl_texture *texture, int32_t image)
{
    /* u = o_u + s_u s; v = 1 - (o_v + s_v (1 - t)) = (1 - o_v - s_v) + s_v t. */
    knurl_texture_ref ref = description_no_texture();
    ref.image = image;
    ref.wrap_u = ref.wrap_v = texture->clamp ? KNURL_WRAP_CLAMP : KNURL_WRAP_REPEAT;
    ref.uv_offset[0] = texture->offset[0];
    ref.uv_offset[1] = 1.0 - texture->offset[1] - texture->scale[1];
    ref.uv_scale[0] = texture->scale[0];
    ref.uv_scale[1] = texture->scale[1];
    return ref;
}
