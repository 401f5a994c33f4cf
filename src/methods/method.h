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

/* The frame that was loaded last. For one level of detail at a time. */
typedef struct frame_memo {
    uint32_t triangle; /* UINT32_MAX: none */
    triangle_frame frame;
} frame_memo;

static inline const triangle_frame *frame_recall(frame_memo *memo, const shell_space *space,
                                                 const height_lod *lod, uint32_t triangle)
{
    if (memo->triangle != triangle) triangle_frame_load(space, triangle, lod, &memo->frame);
    memo->triangle = triangle;
    return &memo->frame;
}

/* A query against a whole surface, for a method with a hierarchy of its own. The level of detail is
 * resolved. */
typedef struct surface_query {
    const shell_space *space;
    const height_lod *lod;
    const knurl_ray *ray;
    frame_memo *memo;  /* for frames at that level of detail; queries may share one */
    bool any;          /* any root in [tmin, tmax] will do; triangle and root are not asked for then */
    bool found;        /* written */
    uint32_t triangle; /* written on a hit */
    shell_root root;   /* written on a hit */
    uint32_t steps;    /* grows */
} surface_query;

/* An edit of the map. The shells and the map are up to date. */
typedef struct method_edit {
    height_rect samples; /* of level 0 that changed; all of them if codes of float maps mean other heights */
    const uint8_t *changed;      /* per triangle: 1 if its shell is another than before */
    bool other_flags;            /* of any of those */
    const double *lower, *upper; /* bounds of all shells */
} method_edit;

typedef struct method {
    const char *name;
    const char *summary; /* one line, with its paper */
    uint32_t flags;      /* KNURL_METHOD_* */
    uint32_t needs;      /* HEIGHT_NEED_*: structures of the map that queries or shells use */
    /* Ends with a parameter without a name. Values arrive checked, in the same order. */
    const knurl_method_parameter *parameters;
    /* Makes the method's own data for a surface (NULL if it has none). Immutable afterwards. */
    knurl_status (*build)(const shell_space *space, const double *values, void **data, knurl_error *error);
    /* Brings the data up to date after an edit of the map, to what a new build gives or as good as that. Sets
     * *rebuild, and may leave the data as it is, where only a new build will do. NULL: always. */
    knurl_status (*update)(const shell_space *space, const method_edit *edit, void *data, bool *rebuild,
                           knurl_error *error);
    /* First root of the shell along the ray in [tmin, tmax]. Thread-safe, never allocates. */
    bool (*intersect)(const void *data, const method_query *query);
    /* KNURL_METHOD_WHOLE only, in place of intersect: first root of the surface. */
    void (*trace)(const void *data, surface_query *query);
    /* The same for many queries of one level of detail; NULL where that is no faster. */
    void (*trace_many)(const void *data, surface_query *queries, size_t count);
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

extern const method method_fast;
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
