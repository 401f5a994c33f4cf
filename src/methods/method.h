/* methods/method.h: the interface that every intersection method implements, and their list.
 *
 * To add a method: write its folder, fill one `method` struct, and name it in methods.c. */
#ifndef KNURL_SRC_METHODS_METHOD_H
#define KNURL_SRC_METHODS_METHOD_H

#include "methods/native.h"
#include "shell/shell.h"

enum { METHOD_MAX_PARAMETERS = 16 };

/* A query against one shell. The level of detail is resolved, the triangle is loaded. */
typedef struct method_query {
    const shell_space *space;
    const height_lod *lod;
    const triangle_frame *frame;
    const knurl_ray *ray;
    bool any;         /* any root in [tmin, tmax] will do */
    shell_root *root; /* written on a hit */
    uint32_t *steps;  /* grows by bounds and texels visited */
} method_query;

typedef struct method {
    const char *name;
    const char *summary; /* one line, with its paper */
    uint32_t flags;      /* KNURL_METHOD_* */
    /* Ends with a parameter without a name. Values arrive checked, in the same order. */
    const knurl_method_parameter *parameters;
    /* Makes the method's own data for a surface (NULL if it has none). Immutable afterwards. */
    knurl_status (*build)(const shell_space *space, const double *values, void **data, knurl_error *error);
    /* First root of the shell along the ray in [tmin, tmax]. Thread-safe, never allocates. */
    bool (*intersect)(const void *data, const method_query *query);
    /* NULL both where the data is one knurl_alloc() block of parameters, not worth counting. */
    uint64_t (*bytes)(const void *data);
    void (*destroy)(const shell_space *space, void *data);
    /* KNURL_METHOD_NATIVE only: the facets, and where a hit on them is (b1, b2, 1 - b1 - b2 in [0, 1]). */
    const native_mesh *(*native)(const void *data);
    void (*locate)(const void *data, const native_hit *hit, native_place *place);
} method;

/* The method of that name; NULL if there is none. */
const method *method_find(const char *name, size_t length);
/* Method and parameter values of a specification such as "rmip:bounds=minmax". */
knurl_status method_parse(const char *specification, const method **found,
                          double values[METHOD_MAX_PARAMETERS], knurl_error *error);

/* Its space, for what is made from surfaces. Not retained. */
const shell_space *knurl_surface_space(const knurl_surface *surface);
/* The surface's map, for telling shared ones apart. Not retained. */
const knurl_heightmap *knurl_surface_map(const knurl_surface *surface);

extern const method method_rmip;
extern const method method_tessellation;
extern const method method_tfdm;
extern const method method_pdm;
extern const method method_secant;
extern const method method_texel_walk;
extern const method method_binary;
extern const method method_robust_binary;
extern const method method_empty_skip;

#endif
