/* render/film.h: sums per pixel.
 *
 * A pass of samples is summed on its own and joins the film when every pixel has it. So an interrupted
 * render is exactly a render of fewer samples, and the order of additions never depends on threads. */
#ifndef KNURL_SRC_RENDER_FILM_H
#define KNURL_SRC_RENDER_FILM_H

#include "base/base.h"

#include <knurl/render.h>

enum { FILM_MAX_CHANNELS = 4 + 3 + 3 + 3 + 3 + 2 + 1 + 1 + 1 + 1 };

typedef struct film {
    knurl_context *context;
    int32_t x, y, width, height; /* the crop, in pixels of the whole image */
    uint32_t aovs;
    int32_t channels;                    /* per pixel: beauty RGBA, then the AOVs asked for */
    int32_t aov_offset[KNURL_AOV_COUNT]; /* channel of AOV i, -1: not asked for */
    float *sum;                          /* finished passes */
    float *pass;                         /* the one being traced */
    int32_t samples;                     /* finished, per pixel */
} film;

/* AOVs that are taken at the pixel's centre once, because a mean of them says nothing. */
#define FILM_CENTRE_AOVS                                                                                     \
    (KNURL_AOV_DEPTH | KNURL_AOV_POSITION | KNURL_AOV_UV | KNURL_AOV_OBJECT | KNURL_AOV_TRIANGLE)

knurl_status film_create(knurl_context *context, const knurl_render_def *def, film **out, knurl_error *error);
void film_release(film *f);
static inline float *film_pixel(const film *f, int32_t x, int32_t y)
{
    return f->pass + ((size_t)y * (size_t)f->width + (size_t)x) * (size_t)f->channels;
}
/* Adds the pass of `samples` samples to the finished ones. */
void film_finish_pass(film *f, int32_t samples);
/* Means, as images. */
knurl_status film_resolve(const film *f, knurl_render_result *result, knurl_error *error);

#endif
