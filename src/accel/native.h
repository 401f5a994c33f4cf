/* accel/native.h: facets as Embree's own triangles, quads or grids, without callbacks. */
#ifndef KNURL_SRC_ACCEL_NATIVE_H
#define KNURL_SRC_ACCEL_NATIVE_H

#include "accel/bvh.h"
#include "methods/native.h"

/* The hierarchy refers to the mesh's arrays, which must live as long. Bounds and clipping are those of any
 * other. */
knurl_status accel_native_create(accel_device *device, const native_mesh *mesh, const char *what,
                                 accel_bvh **bvh, knurl_error *error);

/* Nearest facet of the segment up to tmax, as precise as floats about the object's centre are. */
bool accel_native_intersect(const accel_bvh *bvh, const accel_segment *segment, double tmax, native_hit *hit);
bool accel_native_occluded(const accel_bvh *bvh, const accel_segment *segment, double tmax);

/* The same for many rays, each up to its tmax, in packets where that pays. */
void accel_native_intersect_many(const accel_bvh *bvh, const knurl_ray *rays, const accel_segment *segments,
                                 size_t count, native_hit *hits, bool *found);
void accel_native_occluded_many(const accel_bvh *bvh, const knurl_ray *rays, const accel_segment *segments,
                                size_t count, bool *found);

#endif
