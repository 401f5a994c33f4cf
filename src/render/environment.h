/* render/environment.h: light from infinitely far, as a latitude-longitude image.
 *
 * With no rotation the image's centre is at -z, its right half towards +x, its first row at +y:
 * u = 1/2 + atan2(x, -z) / 2pi, v = acos(y) / pi. A rotation turns the world's light about y,
 * counter-clockwise seen from above. Integer images are taken as sRGB-encoded, floats as linear. */
#ifndef KNURL_SRC_RENDER_ENVIRONMENT_H
#define KNURL_SRC_RENDER_ENVIRONMENT_H

#include "base/base.h"
#include "math/vec.h"

#include <knurl/image.h>

/* Importance cells are half a pixel wide, or wider: at most this many per row. */
enum { ENVIRONMENT_MAX_CELLS = 2048 };

typedef struct environment {
    knurl_context *context;
    knurl_image *image;
    double intensity, cosine, sine; /* of the rotation */
    int32_t columns, rows;          /* importance cells */
    float *conditional;             /* rows x (columns + 1), cumulative, 0 to 1 */
    float *marginal;                /* rows + 1 */
} environment;

/* Retains the image. */
knurl_status environment_create(knurl_context *context, knurl_image *image, double intensity, double rotation,
                                environment **out, knurl_error *error);
void environment_release(environment *e);

vec3 environment_radiance(const environment *e, vec3 direction); /* unit direction */
/* Solid-angle density of environment_draw. */
double environment_pdf(const environment *e, vec3 direction);
vec3 environment_draw(const environment *e, double u, double v, double *pdf);

/* The light when a scene has none: a studio sky with a warm key, upper left in front, over dark ground. */
knurl_status environment_create_studio(knurl_context *context, double intensity, double rotation,
                                       environment **out, knurl_error *error);

#endif
