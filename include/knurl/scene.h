/* knurl/scene.h: displaced surfaces and plain triangle meshes, instanced, behind one BVH. */
#ifndef KNURL_SCENE_H
#define KNURL_SCENE_H

#include <knurl/surface.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Made in two steps: add objects and instances, then commit. After the commit it is immutable but for
 * knurl_scene_update(), and any number of threads may trace it. */
typedef struct knurl_scene knurl_scene;

KNURL_API knurl_status knurl_scene_create(knurl_context *context, knurl_scene **scene, knurl_error *error);
KNURL_API void knurl_scene_release(knurl_scene *scene);

/* Objects are numbered from 0 in the order they are added. The surface is retained. */
KNURL_API knurl_status knurl_scene_add_surface(knurl_scene *scene, knurl_surface *surface, uint32_t *object,
                                               knurl_error *error);
/* A plain, undisplaced mesh; the arrays are copied. Without normals it is flat-shaded (ns = ng).
 * Triangles without area are left out; texture coordinates that are not finite count as 0. */
KNURL_API knurl_status knurl_scene_add_mesh(knurl_scene *scene, const knurl_mesh_view *mesh, uint32_t *object,
                                            knurl_error *error);
/* Places an object. `transform` is 3 rows of 4, row-major, object to world; NULL is the identity.
 * It must be invertible. `mask` is matched against knurl_ray.mask; 0 is seen by no ray and not part
 * of the bounds. */
KNURL_API knurl_status knurl_scene_add_instance(knurl_scene *scene, uint32_t object,
                                                const double transform[12], uint32_t mask, uint32_t *instance,
                                                knurl_error *error);
KNURL_API knurl_status knurl_scene_commit(knurl_scene *scene, knurl_error *error);
/* Brings the scene up to date after knurl_surface_update() of an object's surface: its hierarchy, the bounds
 * of its instances and what is above them. To be called for each object that is of the surface. Nothing else
 * may use the scene during the call. If it fails (KNURL_ERROR_MEMORY) nothing is hit until
 * knurl_scene_commit(), which then may be called again, succeeds. KNURL_ERROR_ARGUMENT: no such object. */
KNURL_API knurl_status knurl_scene_update(knurl_scene *scene, uint32_t object, knurl_error *error);

/* Nearest hit in world space; returns whether there is one and fills *hit (hit->triangle is
 * KNURL_NO_HIT for none; hit->steps is set either way). Never allocates, never locks. Rays that are
 * not finite, have no direction or tmin > tmax hit nothing, and nothing is hit before the commit. */
KNURL_API bool knurl_scene_intersect(const knurl_scene *scene, const knurl_ray *ray, knurl_hit *hit);
KNURL_API bool knurl_scene_occluded(const knurl_scene *scene, const knurl_ray *ray);
#define KNURL_BATCH_BLOCK 1024
/* Many rays on the context's threads; hits[i] belongs to rays[i], and results do not depend on the
 * number of threads. Calls for up to KNURL_BATCH_BLOCK rays stay on the calling thread. Hits are those of
 * single calls, bit for bit; but methods with hierarchies of their own (KNURL_METHOD_WHOLE) and facets
 * (KNURL_METHOD_NATIVE) are given several rays together, in an order that is good for caches, and then steps
 * and last bits may differ. occluded[i] is 0 or 1. KNURL_INTERRUPTED when `progress` (may be NULL) asks to
 * stop: `*done` rays (may be NULL) from the front are then valid. */
KNURL_API knurl_status knurl_scene_intersect_batch(const knurl_scene *scene, const knurl_ray *rays,
                                                   size_t count, knurl_hit *hits, knurl_progress_fn *progress,
                                                   void *user, size_t *done, knurl_error *error);
KNURL_API knurl_status knurl_scene_occluded_batch(const knurl_scene *scene, const knurl_ray *rays,
                                                  size_t count, uint8_t *occluded,
                                                  knurl_progress_fn *progress, void *user, size_t *done,
                                                  knurl_error *error);

/* World-space bounds of everything; lower > upper when the scene is empty. */
KNURL_API void knurl_scene_bounds(const knurl_scene *scene, double lower[3], double upper[3]);
KNURL_API uint32_t knurl_scene_object_count(const knurl_scene *scene);
KNURL_API uint32_t knurl_scene_instance_count(const knurl_scene *scene);
/* The surface of an object, or NULL for plain meshes. Not retained. */
KNURL_API const knurl_surface *knurl_scene_surface(const knurl_scene *scene, uint32_t object);

typedef struct knurl_scene_memory {
    uint64_t mesh;                   /* vertices and indices, displaced and plain */
    uint64_t shells;                 /* per-triangle data of the methods */
    uint64_t maps;                   /* each distinct map once, with its structures */
    uint64_t bvh;                    /* as counted by Embree's memory monitor */
    knurl_heightmap_bytes map_parts; /* what `maps` is the sum of */
} knurl_scene_memory;
KNURL_API knurl_scene_memory knurl_scene_get_memory(const knurl_scene *scene);

#ifdef __cplusplus
}
#endif
#endif
