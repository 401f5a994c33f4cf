/* knurl/embree.h: a displaced surface as one more geometry in your own Embree scene.
 *
 * Header only, for Embree 3.13 and 4.x. The version is that of an rtcore.h included before, else 4
 * if <embree4/rtcore.h> is found, else 3; define KNURL_EMBREE_VERSION as 3 or 4 to choose yourself.
 *
 *     unsigned int id = knurl_embree_attach(device, scene, surface);  // then rtcCommitScene(scene)
 *
 * A surface is a user geometry of knurl_surface_shell_count() primitives: one in all with `fast`, the default
 * method, which has a hierarchy of its own (KNURL_METHOD_WHOLE), else one per base triangle. A hit has the
 * fields of an Embree triangle's either way: tfar, u and v (the barycentrics of vertices 1 and 2), Ng (here
 * of unit length), primID (the base triangle), geomID, instID. Rays may come alone, in packets or streams;
 * masks, filter functions and instancing work as usual. */
#ifndef KNURL_EMBREE_H
#define KNURL_EMBREE_H

#ifndef KNURL_EMBREE_VERSION
#if defined(RTC_VERSION_MAJOR)
#define KNURL_EMBREE_VERSION RTC_VERSION_MAJOR
#elif defined(__has_include)
#if __has_include(<embree4/rtcore.h>)
#define KNURL_EMBREE_VERSION 4
#else
#define KNURL_EMBREE_VERSION 3
#endif
#else
#define KNURL_EMBREE_VERSION 3
#endif
#endif

#if KNURL_EMBREE_VERSION >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <knurl/surface.h>

#include <math.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- The two versions of Embree behind one name each ------------------------------------------ */

#if KNURL_EMBREE_VERSION >= 4
typedef struct RTCRayQueryContext knurl_embree_query_context;
#else
typedef struct RTCIntersectContext knurl_embree_query_context;
#endif

static inline void knurl_embree_init_query(knurl_embree_query_context *context)
{
#if KNURL_EMBREE_VERSION >= 4
    rtcInitRayQueryContext(context);
#else
    rtcInitIntersectContext(context);
#endif
}

/* rtcIntersect1 with a context; NULL for a plain query. */
static inline void knurl_embree_intersect1(RTCScene scene, knurl_embree_query_context *context,
                                           struct RTCRayHit *rayhit)
{
    knurl_embree_query_context plain;
    if (!context) knurl_embree_init_query(context = &plain);
#if KNURL_EMBREE_VERSION >= 4
    struct RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.context = context;
    rtcIntersect1(scene, rayhit, &arguments);
#else
    rtcIntersect1(scene, context, rayhit);
#endif
}

/* rtcOccluded1 with a context; NULL for a plain query. Afterwards ray->tfar is -infinity if
 * something is in the way. */
static inline void knurl_embree_occluded1(RTCScene scene, knurl_embree_query_context *context,
                                          struct RTCRay *ray)
{
    knurl_embree_query_context plain;
    if (!context) knurl_embree_init_query(context = &plain);
#if KNURL_EMBREE_VERSION >= 4
    struct RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
    arguments.context = context;
    rtcOccluded1(scene, ray, &arguments);
#else
    rtcOccluded1(scene, context, ray);
#endif
}

/* ---- Level of detail in, full hits out -------------------------------------------------------- */

/* A query context with room for what Embree's ray and hit cannot hold. Only for scenes in which
 * every knurl surface was attached with knurl_embree_attach_extended: then *every* query must pass
 * &context.base of one of these.
 *
 *     knurl_embree_context context;
 *     knurl_embree_context_init(&context);
 *     knurl_hit hit;
 *     context.hits = &hit;             // ray.id 0 uses hits[0], ray.id 1 uses hits[1], ...
 *     context.hit_count = 1;
 *     knurl_embree_intersect1(scene, &context.base, &rayhit);
 *     // If rayhit.hit.geomID is a knurl geometry, hit holds the full hit. */
typedef struct knurl_embree_context {
    knurl_embree_query_context base; /* must stay first */
    /* NULL, or hit_count hits, indexed by ray.id; written on each accepted hit, in the space of the
     * surface (an instance's own space). Rays with an id from hit_count on get none. */
    knurl_hit *hits;
    uint32_t hit_count;
    /* As in knurl_ray, for all rays of the query; default 0. A callback is not told where the ray enters the
     * object, so the width is taken at the ray parameter cone_distance. */
    float lod;
    float cone_width, cone_spread;
    float cone_distance;
} knurl_embree_context;

static inline void knurl_embree_context_init(knurl_embree_context *context)
{
    memset(context, 0, sizeof *context);
    knurl_embree_init_query(&context->base);
}

/* ---- Callbacks: nothing below this line is needed to use the header, but for the attach calls -- */

/* Smallest float not below x: as tfar it never culls a hit nearer than x, and because tfar was
 * itself a float, never exceeds the tfar from which x was found. */
static inline float knurl_embree_float_above(double x)
{
    float f = (float)x;
    return (double)f < x ? nextafterf(f, INFINITY) : f;
}

/* Ray i of a packet of n. RTCRayN is a structure of arrays; its accessors exist in C++ only. */
static inline struct RTCRay knurl_embree_get_ray(const struct RTCRayN *rays, unsigned int n, unsigned int i)
{
    const float *f = (const float *)(const void *)rays;
    const unsigned int *w = (const unsigned int *)(const void *)rays;
    struct RTCRay ray;
    ray.org_x = f[0 * n + i], ray.org_y = f[1 * n + i], ray.org_z = f[2 * n + i];
    ray.tnear = f[3 * n + i];
    ray.dir_x = f[4 * n + i], ray.dir_y = f[5 * n + i], ray.dir_z = f[6 * n + i];
    ray.time = f[7 * n + i];
    ray.tfar = f[8 * n + i];
    ray.mask = w[9 * n + i], ray.id = w[10 * n + i], ray.flags = w[11 * n + i];
    return ray;
}

static inline void knurl_embree_set_tfar(struct RTCRayN *rays, unsigned int n, unsigned int i, float tfar)
{
    ((float *)(void *)rays)[8 * n + i] = tfar;
}

/* Hits follow the 12 arrays of the rays. */
static inline void knurl_embree_set_hit(struct RTCRayHitN *rayhits, unsigned int n, unsigned int i,
                                        const struct RTCHit *hit)
{
    float *f = (float *)(void *)rayhits + 12 * (size_t)n;
    unsigned int *w = (unsigned int *)(void *)rayhits + 12 * (size_t)n;
    f[0 * n + i] = hit->Ng_x, f[1 * n + i] = hit->Ng_y, f[2 * n + i] = hit->Ng_z;
    f[3 * n + i] = hit->u, f[4 * n + i] = hit->v;
    w[5 * n + i] = hit->primID, w[6 * n + i] = hit->geomID;
    for (unsigned int l = 0; l < RTC_MAX_INSTANCE_LEVEL_COUNT; l++) {
        w[(7 + l) * n + i] = hit->instID[l];
#ifdef RTC_GEOMETRY_INSTANCE_ARRAY
        w[(7 + RTC_MAX_INSTANCE_LEVEL_COUNT + l) * n + i] = hit->instPrimID[l];
#endif
    }
}

static inline struct RTCHit
knurl_embree_make_hit(const knurl_hit *full, const knurl_embree_query_context *context, unsigned int geometry)
{
    struct RTCHit hit;
    memset(&hit, 0, sizeof hit);
    hit.Ng_x = (float)full->ng[0], hit.Ng_y = (float)full->ng[1], hit.Ng_z = (float)full->ng[2];
    hit.u = (float)full->a, hit.v = (float)full->b;
    hit.primID = full->triangle;
    hit.geomID = geometry;
    for (unsigned int l = 0; l < RTC_MAX_INSTANCE_LEVEL_COUNT; l++) {
        hit.instID[l] = context->instID[l];
#ifdef RTC_GEOMETRY_INSTANCE_ARRAY
        hit.instPrimID[l] = context->instPrimID[l];
#endif
    }
    return hit;
}

/* An Embree ray as a knurl ray: floats are doubles already, so nothing is rounded. */
static inline knurl_ray knurl_embree_to_ray(const struct RTCRay *ray, const knurl_surface *surface,
                                            const knurl_embree_context *extended)
{
    const double origin[3] = {(double)ray->org_x, (double)ray->org_y, (double)ray->org_z};
    const double direction[3] = {(double)ray->dir_x, (double)ray->dir_y, (double)ray->dir_z};
    knurl_ray out = knurl_ray_make(origin, direction);
    out.tmin = ray->tnear > 0.0f ? (double)ray->tnear : 0.0;
    out.tmax = (double)ray->tfar;
    if (!extended) return out;
    out.lod = extended->lod;
    if (extended->cone_width > 0.0f || extended->cone_spread > 0.0f) {
        knurl_ray cone = out;
        cone.cone_width = extended->cone_width;
        cone.cone_spread = extended->cone_spread;
        const float lod = (float)knurl_surface_cone_lod(surface, &cone, (double)extended->cone_distance);
        if (lod > out.lod) out.lod = lod;
    }
    return out;
}

/* Where to look for the next surface behind a hit that a filter function has refused. */
static inline double knurl_embree_behind(const knurl_ray *ray, const knurl_hit *hit)
{
    const double *d = ray->direction;
    const double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    const double t = hit->t + 2.0 * hit->error / length;
    return t > hit->t ? t : nextafter(hit->t, INFINITY);
}

static inline void knurl_embree_bounds(const struct RTCBoundsFunctionArguments *args)
{
    const knurl_surface *surface = (const knurl_surface *)args->geometryUserPtr;
    struct RTCBounds *box = args->bounds_o;
    float lower[3], upper[3];
    if (!knurl_surface_shell_bounds(surface, args->primID, lower, upper)) {
        /* Embree leaves out primitives whose box is empty. */
        box->lower_x = box->lower_y = box->lower_z = INFINITY;
        box->upper_x = box->upper_y = box->upper_z = -INFINITY;
        return;
    }
    /* Embree's traversal rounds by some ulps of the box's coordinates. */
    float reach = 0.0f;
    for (int i = 0; i < 3; i++) reach = fmaxf(reach, fmaxf(fabsf(lower[i]), fabsf(upper[i])));
    const float pad = reach * 0x1p-21f;
    box->lower_x = lower[0] - pad, box->lower_y = lower[1] - pad, box->lower_z = lower[2] - pad;
    box->upper_x = upper[0] + pad, box->upper_y = upper[1] + pad, box->upper_z = upper[2] + pad;
}

/* One ray of an intersect packet; returns whether a hit was accepted. */
static inline bool knurl_embree_intersect_ray(const struct RTCIntersectFunctionNArguments *args,
                                              unsigned int i, knurl_embree_context *extended)
{
    const knurl_surface *surface = (const knurl_surface *)args->geometryUserPtr;
    struct RTCRayN *rays = (struct RTCRayN *)(void *)args->rayhit;
    struct RTCRay ray = knurl_embree_get_ray(rays, args->N, i);
    knurl_ray segment = knurl_embree_to_ray(&ray, surface, extended);
    knurl_hit full;
    full.steps = 0;
    while (segment.tmin <= segment.tmax && knurl_surface_intersect(surface, args->primID, &segment, &full)) {
        struct RTCHit hit = knurl_embree_make_hit(&full, args->context, args->geomID);
        int accepted = -1;
        ray.tfar = knurl_embree_float_above(full.t);
        /* Filters may be asked about packets of any size, so each ray goes as a packet of one. */
        struct RTCFilterFunctionNArguments filter;
        filter.valid = &accepted;
        filter.geometryUserPtr = args->geometryUserPtr;
        filter.context = args->context;
        filter.ray = (struct RTCRayN *)(void *)&ray;
        filter.hit = (struct RTCHitN *)(void *)&hit;
        filter.N = 1;
#if KNURL_EMBREE_VERSION >= 4
        rtcInvokeIntersectFilterFromGeometry(args, &filter);
#else
        rtcFilterIntersection(args, &filter);
#endif
        if (accepted) {
            knurl_embree_set_tfar(rays, args->N, i, ray.tfar);
            knurl_embree_set_hit(args->rayhit, args->N, i, &hit);
            if (extended && extended->hits && ray.id < extended->hit_count) extended->hits[ray.id] = full;
            return true;
        }
        segment.tmin = knurl_embree_behind(&segment, &full);
    }
    return false;
}

static inline void knurl_embree_intersect_packet(const struct RTCIntersectFunctionNArguments *args,
                                                 knurl_embree_context *extended)
{
    for (unsigned int i = 0; i < args->N; i++) {
        if (!args->valid[i]) continue;
        const bool found = knurl_embree_intersect_ray(args, i, extended);
#if KNURL_EMBREE_VERSION >= 4
        args->valid[i] = found ? -1 : 0;
#else
        (void)found;
#endif
    }
}

static inline bool knurl_embree_occluded_ray(const struct RTCOccludedFunctionNArguments *args, unsigned int i,
                                             const knurl_embree_context *extended)
{
    const knurl_surface *surface = (const knurl_surface *)args->geometryUserPtr;
    struct RTCRay ray = knurl_embree_get_ray(args->ray, args->N, i);
    knurl_ray segment = knurl_embree_to_ray(&ray, surface, extended);
    /* The common case, nothing in the way, needs no full hit and no filter. */
    if (!knurl_surface_occluded(surface, args->primID, &segment)) return false;
    bool refused = false;
    knurl_hit full;
    full.steps = 0;
    while (segment.tmin <= segment.tmax && knurl_surface_intersect(surface, args->primID, &segment, &full)) {
        struct RTCHit hit = knurl_embree_make_hit(&full, args->context, args->geomID);
        int accepted = -1;
        ray.tfar = knurl_embree_float_above(full.t);
        struct RTCFilterFunctionNArguments filter;
        filter.valid = &accepted;
        filter.geometryUserPtr = args->geometryUserPtr;
        filter.context = args->context;
        filter.ray = (struct RTCRayN *)(void *)&ray;
        filter.hit = (struct RTCHitN *)(void *)&hit;
        filter.N = 1;
#if KNURL_EMBREE_VERSION >= 4
        rtcInvokeOccludedFilterFromGeometry(args, &filter);
#else
        rtcFilterOcclusion(args, &filter);
#endif
        if (accepted) {
            refused = false;
            break;
        }
        refused = true;
        segment.tmin = knurl_embree_behind(&segment, &full);
    }
    if (!refused) knurl_embree_set_tfar(args->ray, args->N, i, -INFINITY);
    return !refused;
}

static inline void knurl_embree_occluded_packet(const struct RTCOccludedFunctionNArguments *args,
                                                const knurl_embree_context *extended)
{
    for (unsigned int i = 0; i < args->N; i++) {
        if (!args->valid[i]) continue;
        const bool found = knurl_embree_occluded_ray(args, i, extended);
#if KNURL_EMBREE_VERSION >= 4
        args->valid[i] = found ? -1 : 0;
#else
        (void)found;
#endif
    }
}

static inline void knurl_embree_intersect(const struct RTCIntersectFunctionNArguments *args)
{
    knurl_embree_intersect_packet(args, NULL);
}
static inline void knurl_embree_intersect_extended(const struct RTCIntersectFunctionNArguments *args)
{
    knurl_embree_intersect_packet(args, (knurl_embree_context *)(void *)args->context);
}
static inline void knurl_embree_occluded(const struct RTCOccludedFunctionNArguments *args)
{
    knurl_embree_occluded_packet(args, NULL);
}
static inline void knurl_embree_occluded_extended(const struct RTCOccludedFunctionNArguments *args)
{
    knurl_embree_occluded_packet(args, (const knurl_embree_context *)(const void *)args->context);
}

static inline unsigned int knurl_embree_attach_with(RTCDevice device, RTCScene scene,
                                                    const knurl_surface *surface,
                                                    RTCIntersectFunctionN intersect,
                                                    RTCOccludedFunctionN occluded)
{
    if (knurl_surface_flags(surface) & KNURL_METHOD_NATIVE) return RTC_INVALID_GEOMETRY_ID;
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    if (!geometry) return RTC_INVALID_GEOMETRY_ID;
    rtcSetGeometryUserPrimitiveCount(geometry, knurl_surface_shell_count(surface));
    /* Embree's pointer is not const, but nothing writes through it. */
    rtcSetGeometryUserData(geometry, (void *)(uintptr_t)surface);
    rtcSetGeometryBoundsFunction(geometry, knurl_embree_bounds, NULL);
    rtcSetGeometryIntersectFunction(geometry, intersect);
    rtcSetGeometryOccludedFunction(geometry, occluded);
    rtcSetGeometryMask(geometry, 0xFFFFFFFFu); /* the default is not the same in 3.x and 4.x */
    rtcCommitGeometry(geometry);
    const unsigned int id = rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry); /* the scene holds it now */
    return id;
}

/* ---- The calls to use ------------------------------------------------------------------------- */

/* Adds the surface to the scene; returns its geometry ID, or RTC_INVALID_GEOMETRY_ID (then see
 * rtcGetDeviceError; without an error there, the surface's method is KNURL_METHOD_NATIVE, whose facets
 * knurl/tessellation.h gives to geometries of your own). The surface is not retained: release it after the
 * scene. Masks and filter functions can be set on rtcGetGeometry(scene, id) before rtcCommitScene. */
static inline unsigned int knurl_embree_attach(RTCDevice device, RTCScene scene, const knurl_surface *surface)
{
    return knurl_embree_attach_with(device, scene, surface, knurl_embree_intersect, knurl_embree_occluded);
}

/* The same for queries that all carry a knurl_embree_context. */
static inline unsigned int knurl_embree_attach_extended(RTCDevice device, RTCScene scene,
                                                        const knurl_surface *surface)
{
    return knurl_embree_attach_with(device, scene, surface, knurl_embree_intersect_extended,
                                    knurl_embree_occluded_extended);
}

/* The full hit behind an Embree hit on `surface`, found again from the ray and primID; for when the
 * query had no extended context. In an instance, put the ray into the instance's space first.
 * `lod` is that of the query, 0 for plain ones. False if the ray is not one that hit. */
static inline bool knurl_embree_hit(const knurl_surface *surface, const struct RTCRayHit *rayhit, float lod,
                                    knurl_hit *hit)
{
    memset(hit, 0, sizeof *hit);
    hit->triangle = KNURL_NO_HIT;
    if (rayhit->hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
    knurl_ray ray = knurl_embree_to_ray(&rayhit->ray, surface, NULL);
    ray.lod = lod;
    /* tfar was rounded up from the hit, so the hit lies less than one float below it; a second one
     * covers the last bits of a root that is found in another interval. */
    const float below = nextafterf(nextafterf(rayhit->ray.tfar, -INFINITY), -INFINITY);
    if ((double)below > ray.tmin) ray.tmin = (double)below;
    ray.tmax = (double)nextafterf(rayhit->ray.tfar, INFINITY);
    const bool whole = (knurl_surface_flags(surface) & KNURL_METHOD_WHOLE) != 0;
    return knurl_surface_intersect(surface, whole ? 0 : rayhit->hit.primID, &ray, hit);
}

#ifdef __cplusplus
}
#endif
#endif
