/* accel/bvh.h: bounding volume hierarchies over boxes of anything, for rays in double precision.
 *
 * Embree does the traversal in float; what is hit is decided by the caller in double. Nothing that
 * the caller would call a hit is ever culled by the float part (see bvh.c for why). */
#ifndef KNURL_SRC_ACCEL_BVH_H
#define KNURL_SRC_ACCEL_BVH_H

#include "base/base.h"
#include "math/vec.h"

/* Embree's device, its memory count and its last error. Reference counted. */
typedef struct accel_device accel_device;
knurl_status accel_device_create(knurl_context *context, accel_device **device, knurl_error *error);
void accel_device_release(accel_device *device);
/* Bytes that Embree holds for all hierarchies of the device. */
uint64_t accel_device_bytes(const accel_device *device);

typedef struct accel_box {
    vec3 lower, upper; /* lower > upper: empty */
} accel_box;

static inline accel_box accel_box_empty(void)
{
    return (accel_box){v3(INFINITY, INFINITY, INFINITY), v3(-INFINITY, -INFINITY, -INFINITY)};
}
static inline bool accel_box_is_empty(const accel_box *box)
{
    return !(box->lower.x <= box->upper.x && box->lower.y <= box->upper.y && box->lower.z <= box->upper.z);
}
static inline accel_box accel_box_union(const accel_box *a, const accel_box *b)
{
    return (accel_box){v3_min(a->lower, b->lower), v3_max(a->upper, b->upper)};
}

static inline bool accel_box_equal(const accel_box *a, const accel_box *b)
{
    return a->lower.x == b->lower.x && a->lower.y == b->lower.y && a->lower.z == b->lower.z &&
           a->upper.x == b->upper.x && a->upper.y == b->upper.y && a->upper.z == b->upper.z;
}

/* Box of a primitive; false to leave it out. Called from several threads at once. */
typedef bool accel_bounds_fn(const void *user, uint32_t primitive, accel_box *box);

typedef struct accel_bvh accel_bvh;
/* Immutable. `user` must live as long as the hierarchy. No primitives at all is fine. */
knurl_status accel_bvh_create(accel_device *device, uint32_t count, accel_bounds_fn *bounds, const void *user,
                              const char *what, accel_bvh **bvh, knurl_error *error);
void accel_bvh_release(accel_bvh *bvh);
/* Union of the primitives' boxes. */
accel_box accel_bvh_bounds(const accel_bvh *bvh);
/* One primitive, for which no hierarchy is needed: rays can be clipped to its box (accel_bvh_clip_range),
 * but accel_bvh_traverse does not work. */
knurl_status accel_bvh_create_box(accel_device *device, const accel_box *box, const char *what,
                                  accel_bvh **bvh, knurl_error *error);
/* The point that accel_segment.origin is relative to; its coordinates are floats. */
vec3 accel_bvh_centre(const accel_bvh *bvh);

/* The part of a ray that can meet a hierarchy's primitives. */
typedef struct accel_segment {
    vec3 direction; /* the ray's */
    vec3 origin;    /* ray point at t0, relative to the hierarchy's centre: correct to the last bits
                       however far away the ray starts */
    double t0, t1;  /* within [tmin, tmax] of the ray */
} accel_segment;

/* False if the ray does not come near the primitives, or is not finite. */
bool accel_bvh_clip(const accel_bvh *bvh, vec3 origin, vec3 direction, double tmin, double tmax,
                    accel_segment *segment);

/* The same, but finds t0 and t1 only. */
bool accel_bvh_clip_range(const accel_bvh *bvh, const double origin[3], const double direction[3],
                          double tmin, double tmax, accel_segment *segment);

/* Called for each primitive whose box the segment meets before `tmax`, more or less front to back.
 * Returns the new tmax, not above the old one: the hit found, or -INFINITY to end the traversal. */
typedef double accel_visit_fn(void *user, uint32_t primitive, double tmax);
/* `any`: the first hit will end it (a hint to traverse without sorting). */
void accel_bvh_traverse(const accel_bvh *bvh, const accel_segment *segment, double tmax, bool any,
                        accel_visit_fn *visit, void *user);

#endif
