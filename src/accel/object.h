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
    bool whole;             /* one shell is all of the surface: `bvh` is its box, without a hierarchy */
} accel_object;

knurl_status accel_object_build(accel_object *object, accel_device *device, uint32_t number,
                                knurl_error *error);
void accel_object_clear(accel_object *object);
accel_box accel_object_bounds(const accel_object *object);

/* accel_object_prepare with a cone, and for all but whole surfaces. */
bool accel_object_prepare_any(const accel_object *object, knurl_ray *ray, accel_segment *segment);
bool accel_object_intersect_parts(const accel_object *object, knurl_ray *ray, const accel_segment *segment,
                                  knurl_hit *hit, uint32_t *steps);
bool accel_object_parts_occluded(const accel_object *object, knurl_ray *ray, const accel_segment *segment);

/* Makes a ray in the object's space ready: finds the part of it in the object's bounds, and resolves its cone
 * into ray->lod where it enters them: one level for the whole object, hence no cracks. False if it misses the
 * bounds. */
static inline bool accel_object_prepare(const accel_object *object, knurl_ray *ray, accel_segment *segment)
{
    if (!object->whole || ray->cone_width > 0.0f || ray->cone_spread > 0.0f)
        return accel_object_prepare_any(object, ray, segment);
    return accel_bvh_clip_range(object->bvh, ray->origin, ray->direction, ray->tmin, ray->tmax, segment);
}

/* What follows takes rays and segments as accel_object_prepare left them; ray->tmax may have been lowered
 * since, and is scratch afterwards. Everything is in the object's space. */

/* Nearest hit in [ray->tmin, ray->tmax], the lower triangle of two at the same t. On a hit fills all of *hit
 * but instance, object and steps and returns true. *steps grows by the work. */
static inline bool accel_object_intersect(const accel_object *object, knurl_ray *ray,
                                          const accel_segment *segment, knurl_hit *hit, uint32_t *steps)
{
    if (!object->whole) return accel_object_intersect_parts(object, ray, segment, hit, steps);
    /* Beyond the box nothing needs to be looked for. */
    ray->tmax = min_d(ray->tmax, segment->t1);
    hit->steps = 0;
    bool found = knurl_surface_intersect(object->surface, 0, ray, hit);
    *steps += hit->steps;
    return found;
}

static inline bool accel_object_occluded(const accel_object *object, knurl_ray *ray,
                                         const accel_segment *segment)
{
    if (!object->whole) return accel_object_parts_occluded(object, ray, segment);
    ray->tmax = min_d(ray->tmax, segment->t1);
    return knurl_surface_occluded(object->surface, 0, ray);
}

/* The same for up to ACCEL_GROUP rays. found[i] says whether ray i hit; hits[i] is filled if so, and
 * hits[i].steps is the work either way. Shells give the same results as ray by ray; of facets, the last bits
 * may differ. */
enum { ACCEL_GROUP = 256 };
void accel_object_intersect_many(const accel_object *object, knurl_ray *rays, const accel_segment *segments,
                                 size_t count, knurl_hit *hits, bool *found);
void accel_object_occluded_many(const accel_object *object, knurl_ray *rays, const accel_segment *segments,
                                size_t count, bool *found);

#endif
