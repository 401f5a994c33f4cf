/* methods/surface.h: the surface object. */
#ifndef KNURL_SRC_METHODS_SURFACE_H
#define KNURL_SRC_METHODS_SURFACE_H

#include "methods/method.h"
#include "shell/heights.h"

struct knurl_surface {
    shell_space space;
    atomic_size_t references;
    const method *method;
    double values[METHOD_MAX_PARAMETERS]; /* of its parameters */
    void *data;                           /* its own */
    height_lod finest;                    /* level of detail 0 */
    height_level tiled; /* its level, where the method's structures have its samples in tiles */
    vec3 centre;        /* a ball that holds all shells */
    double radius;
    shell_totals totals;
    cell_scale scale; /* of the map's codes when its bounds were last looked at */
    bool stale;       /* an update failed half-way: the next one makes everything anew */
    knurl_surface_info info;
};

/* Heights are stored as floats and enter products with positions, which have the same limit. */
knurl_status surface_check_heights(const shell_space *space, knurl_error *error);
/* What of the surface follows from its totals and its method's data. */
void surface_set_totals(knurl_surface *surface);
/* The method's data, anew; what has been made of it when it fails is in *data. */
knurl_status surface_make_data(const knurl_surface *surface, void **data, knurl_error *error);
void surface_destroy_data(const knurl_surface *surface, void *data);

#endif
