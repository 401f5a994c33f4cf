/* One object: its hierarchy, and what to do with each primitive the hierarchy offers. */
#include "accel/object.h"

#include <stdio.h>

static bool surface_bounds(const void *user, uint32_t shell, accel_box *box)
{
    float lower[3], upper[3];
    if (!knurl_surface_shell_bounds(user, shell, lower, upper)) return false;
    *box = (accel_box){v3_loadf(lower), v3_loadf(upper)};
    return true;
}

knurl_status accel_object_build(accel_object *object, accel_device *device, uint32_t number,
                                knurl_error *error)
{
    char what[48];
    (void)snprintf(what, sizeof what, "the hierarchy of object %u", number);
    const native_mesh *facets = object->surface ? knurl_surface_native(object->surface) : NULL;
    object->native = facets != NULL;
    if (facets) return accel_native_create(device, facets, what, &object->bvh, error);
    const uint32_t shells = object->surface ? knurl_surface_shell_count(object->surface) : 0;
    object->whole = shells == 1;
    if (object->whole) {
        accel_box box;
        if (!surface_bounds(object->surface, 0, &box)) box = accel_box_empty();
        return accel_bvh_create_box(device, &box, what, &object->bvh, error);
    }
    if (object->surface)
        return accel_bvh_create(device, shells, surface_bounds, object->surface, what, &object->bvh, error);
    return accel_bvh_create(device, object->mesh->triangle_count, accel_mesh_bounds, object->mesh, what,
                            &object->bvh, error);
}

void accel_object_clear(accel_object *object)
{
    accel_bvh_release(object->bvh);
    if (object->surface) knurl_surface_release(object->surface);
    accel_mesh_release(object->mesh);
    *object = (accel_object){0};
}

accel_box accel_object_bounds(const accel_object *object)
{
    return accel_bvh_bounds(object->bvh);
}

static bool clip(const accel_object *object, const knurl_ray *ray, accel_segment *segment)
{
    if (object->whole)
        return accel_bvh_clip_range(object->bvh, ray->origin, ray->direction, ray->tmin, ray->tmax, segment);
    return accel_bvh_clip(object->bvh, v3_load(ray->origin), v3_load(ray->direction), ray->tmin, ray->tmax,
                          segment);
}

bool accel_object_prepare_any(const accel_object *object, knurl_ray *ray, accel_segment *segment)
{
    if (!clip(object, ray, segment)) return false;
    if (ray->cone_width > 0.0f || ray->cone_spread > 0.0f) {
        float lod =
            object->surface ? (float)knurl_surface_cone_lod(object->surface, ray, segment->t0) : ray->lod;
        if (lod > ray->lod) ray->lod = lod;
    }
    ray->cone_width = ray->cone_spread = 0.0f;
    return true;
}

/* ---- A hierarchy of shells or triangles ------------------------------------------------------- */

typedef struct trace {
    const accel_object *object;
    knurl_ray *ray;    /* displaced surfaces: tmax shrinks */
    accel_shear shear; /* plain meshes */
    knurl_hit *hit;
    double t;
    double ab[2];
    uint32_t triangle; /* of the nearest hit so far */
    uint32_t steps;
} trace;

static void start_trace(trace *s, const accel_object *object, knurl_ray *ray, const accel_segment *segment)
{
    s->object = object;
    s->ray = ray;
    s->triangle = KNURL_NO_HIT;
    s->steps = 0;
    s->t = INFINITY;
    if (object->mesh) accel_shear_make(segment, accel_bvh_centre(object->bvh), &s->shear);
}

/* Which of two hits counts must not depend on the order in which Embree offers primitives. */
static bool is_nearer(const trace *s, double t, uint32_t triangle)
{
    return t < s->t || (t == s->t && triangle < s->triangle);
}

static double visit_shell(void *user, uint32_t shell, double tmax)
{
    trace *s = user;
    knurl_hit hit;
    hit.steps = 0;
    s->ray->tmax = tmax;
    bool found = knurl_surface_intersect(s->object->surface, shell, s->ray, &hit);
    s->steps += hit.steps;
    if (!found) return tmax;
    if (is_nearer(s, hit.t, shell)) {
        s->t = hit.t;
        s->triangle = shell;
        *s->hit = hit;
    }
    return s->t;
}

static double visit_triangle(void *user, uint32_t triangle, double tmax)
{
    trace *s = user;
    double t, ab[2];
    s->steps++;
    if (!accel_mesh_intersect(s->object->mesh, triangle, &s->shear, s->ray->tmin, tmax, &t, ab)) return tmax;
    if (is_nearer(s, t, triangle)) {
        s->t = t;
        s->triangle = triangle;
        s->ab[0] = ab[0];
        s->ab[1] = ab[1];
    }
    return s->t;
}

static bool intersect_hierarchy(const accel_object *object, knurl_ray *ray, const accel_segment *segment,
                                knurl_hit *hit, uint32_t *steps)
{
    trace s;
    start_trace(&s, object, ray, segment);
    s.hit = hit;
    accel_bvh_traverse(object->bvh, segment, ray->tmax, false, object->surface ? visit_shell : visit_triangle,
                       &s);
    *steps += s.steps;
    if (s.triangle == KNURL_NO_HIT) return false;
    if (object->mesh) {
        hit->t = s.t;
        accel_mesh_fill_hit(object->mesh, s.triangle, s.ab, hit);
    }
    return true;
}

static double any_shell(void *user, uint32_t shell, double tmax)
{
    trace *s = user;
    if (!knurl_surface_occluded(s->object->surface, shell, s->ray)) return tmax;
    s->triangle = shell;
    return -INFINITY;
}

static double any_triangle(void *user, uint32_t triangle, double tmax)
{
    trace *s = user;
    double t, ab[2];
    if (!accel_mesh_intersect(s->object->mesh, triangle, &s->shear, s->ray->tmin, s->ray->tmax, &t, ab))
        return tmax;
    s->triangle = triangle;
    return -INFINITY;
}

static bool hierarchy_occluded(const accel_object *object, knurl_ray *ray, const accel_segment *segment)
{
    trace s;
    start_trace(&s, object, ray, segment);
    accel_bvh_traverse(object->bvh, segment, ray->tmax, true, object->surface ? any_shell : any_triangle, &s);
    return s.triangle != KNURL_NO_HIT;
}

/* ---- Facets ----------------------------------------------------------------------------------- */

static bool intersect_facets(const accel_object *object, const knurl_ray *ray, const accel_segment *segment,
                             knurl_hit *hit)
{
    native_hit found;
    if (!accel_native_intersect(object->bvh, segment, ray->tmax, &found)) return false;
    knurl_surface_native_hit(object->surface, ray, &found, hit);
    return true;
}

static void intersect_facets_many(const accel_object *object, const knurl_ray *rays,
                                  const accel_segment *segments, size_t count, knurl_hit *hits, bool *found)
{
    native_hit places[ACCEL_GROUP];
    accel_native_intersect_many(object->bvh, rays, segments, count, places, found);
    for (size_t i = 0; i < count; i++) {
        hits[i].steps = 0;
        if (found[i]) knurl_surface_native_hit(object->surface, &rays[i], &places[i], &hits[i]);
    }
}

/* ---- All kinds -------------------------------------------------------------------------------- */

bool accel_object_intersect_parts(const accel_object *object, knurl_ray *ray, const accel_segment *segment,
                                  knurl_hit *hit, uint32_t *steps)
{
    if (object->native) return intersect_facets(object, ray, segment, hit);
    return intersect_hierarchy(object, ray, segment, hit, steps);
}

bool accel_object_parts_occluded(const accel_object *object, knurl_ray *ray, const accel_segment *segment)
{
    if (object->native) return accel_native_occluded(object->bvh, segment, ray->tmax);
    return hierarchy_occluded(object, ray, segment);
}

static void clip_many(knurl_ray *rays, const accel_segment *segments, size_t count)
{
    for (size_t i = 0; i < count; i++) rays[i].tmax = min_d(rays[i].tmax, segments[i].t1);
}

void accel_object_intersect_many(const accel_object *object, knurl_ray *rays, const accel_segment *segments,
                                 size_t count, knurl_hit *hits, bool *found)
{
    if (object->whole) {
        for (size_t i = 0; i < count; i++) hits[i].steps = 0;
        clip_many(rays, segments, count);
        knurl_surface_intersect_many(object->surface, 0, rays, count, hits, found);
        return;
    }
    if (object->native) {
        intersect_facets_many(object, rays, segments, count, hits, found);
        return;
    }
    for (size_t i = 0; i < count; i++) {
        uint32_t steps = 0;
        found[i] = intersect_hierarchy(object, &rays[i], &segments[i], &hits[i], &steps);
        hits[i].steps = steps;
    }
}

void accel_object_occluded_many(const accel_object *object, knurl_ray *rays, const accel_segment *segments,
                                size_t count, bool *found)
{
    if (object->whole) {
        clip_many(rays, segments, count);
        knurl_surface_occluded_many(object->surface, 0, rays, count, found);
    } else if (object->native) {
        accel_native_occluded_many(object->bvh, rays, segments, count, found);
    } else {
        for (size_t i = 0; i < count; i++) found[i] = hierarchy_occluded(object, &rays[i], &segments[i]);
    }
}
