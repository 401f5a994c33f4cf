/* accel/object.h: what a scene places: a displaced surface, by shells or by facets, or a plain mesh, with its
 * hierarchy. */
#ifndef KNURL_SRC_ACCEL_OBJECT_H
#define KNURL_SRC_ACCEL_OBJECT_H

#include "accel/mesh.h"
#include "accel/native.h"

typedef struct accel_object {
    knurl_surface *surface; /* one of these two; retained */
    accel_mesh *mesh;       /* owned */
    accel_bvh *bvh;         /* NULL until built */
    bool native;            /* of the surface's facets; else of its shells */
} accel_object;

knurl_status accel_object_build(accel_object *object, accel_device *device, uint32_t number,
                                knurl_error *error);
void accel_object_clear(accel_object *object);
accel_box accel_object_bounds(const accel_object *object);

/* A ray in an object's space, clipped to its bounds, its level of detail chosen. */
typedef struct accel_local_ray {
    knurl_ray ray;
    accel_segment segment;
} accel_local_ray;

/* Takes local->ray and fills the rest. False if the ray misses the bounds. The cone is resolved
 * into ray.lod where the ray enters the bounds: one level for the whole object, hence no cracks. */
bool accel_object_prepare(const accel_object *object, accel_local_ray *local);

/* Nearest hit in [ray.tmin, tmax] in the object's space, the lower triangle of two at the same t.
 * On a hit fills all of *hit but object and instance and returns true. *steps grows by the work. */
bool accel_object_intersect(const accel_object *object, const accel_local_ray *local, double tmax,
                            knurl_hit *hit, uint32_t *steps);
bool accel_object_occluded(const accel_object *object, const accel_local_ray *local);

#endif
