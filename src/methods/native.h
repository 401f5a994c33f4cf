/* methods/native.h: facets that Embree traces as they are, made by a KNURL_METHOD_NATIVE method. */
#ifndef KNURL_SRC_METHODS_NATIVE_H
#define KNURL_SRC_METHODS_NATIVE_H

#include "math/vec.h"

#include <knurl/surface.h>

typedef enum native_kind { NATIVE_TRIANGLES = 0, NATIVE_QUADS, NATIVE_GRIDS } native_kind;

/* The layout of Embree's RTCGrid: height rows of width vertices, `stride` apart. */
typedef struct native_grid {
    uint32_t first, stride;
    uint16_t width, height;
} native_grid;

typedef struct native_part {
    native_kind kind;
    const float *vertices; /* 3 per vertex; 4 bytes behind the last may be read */
    uint32_t vertex_count;
    const void *primitives; /* 3 or 4 vertex numbers each, or a native_grid */
    uint32_t primitive_count;
} native_part;

enum { NATIVE_MAX_PARTS = 2 };

/* Coordinates are (x - centre) * scale, of magnitude 1 at most: float keeps its last bits wherever the
 * object is. The centre's coordinates are floats, the scale is a power of two. */
typedef struct native_mesh {
    vec3 lower, upper; /* bounds before that; lower > upper if there is nothing */
    vec3 centre;
    double scale;
    native_part parts[NATIVE_MAX_PARTS];
    uint32_t part_count;
} native_mesh;

/* What Embree says of a hit, and where that is on the base mesh. */
typedef struct native_hit {
    double t;
    uint32_t part, primitive;
    float u, v;
} native_hit;
typedef struct native_place {
    uint32_t triangle;
    double b1, b2;
} native_place;

/* The surface's facets; NULL if its method has shells. */
const native_mesh *knurl_surface_native(const knurl_surface *surface);
/* The full hit; fills every field but object and instance. */
void knurl_surface_native_hit(const knurl_surface *surface, const knurl_ray *ray, const native_hit *found,
                              knurl_hit *hit);

#endif
