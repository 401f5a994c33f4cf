/* render/camera.h: primary rays, and the pixel filter. */
#ifndef KNURL_SRC_RENDER_CAMERA_H
#define KNURL_SRC_RENDER_CAMERA_H

#include "math/vec.h"

#include <knurl/render.h>

typedef struct camera {
    vec3 origin, right, up, forward; /* unit axes */
    bool orthographic;
    double half_width, half_height; /* of the image plane: metres, or at distance 1 */
    double lens_radius, focus_distance;
    int32_t width, height; /* pixels of the whole image */
} camera;

knurl_status camera_from_description(const knurl_description_camera *source, int32_t width, int32_t height,
                                     camera *out, knurl_error *error);
/* A three-quarter view from a little above that shows all of the box; `lower` > `upper`: of a unit box. */
void camera_frame(const double lower[3], const double upper[3], int32_t width, int32_t height, camera *out);
/* What knurl_render_def.camera says: an index that must be valid, or -1. */
knurl_status camera_choose(const knurl_description *description, const knurl_scene *scene, int32_t index,
                           int32_t width, int32_t height, camera *out, knurl_error *error);
/* (x, y) in pixels from the top left corner; (u, v) in [0, 1) choose the point on the lens. The ray
 * carries the cone of a pixel. */
knurl_ray camera_make_ray(const camera *c, double x, double y, double u, double v);

/* Blackman-Harris reconstruction over this radius, drawn by importance, so that every sample belongs to
 * one pixel with weight 1 and image tiles are independent. */
#define FILTER_RADIUS 1.5
enum { FILTER_STEPS = 512 };
typedef struct pixel_filter {
    double inverse[FILTER_STEPS + 1]; /* inverse cumulative distribution, pixels from the centre */
} pixel_filter;
void pixel_filter_build(pixel_filter *f);
double pixel_filter_offset(const pixel_filter *f, double u);

#endif
