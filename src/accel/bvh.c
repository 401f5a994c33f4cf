/* Hierarchies over boxes: Embree user geometry, called with float rays, decided in double.
 *
 * Why no hit is lost. Each hierarchy has its own coordinates x' = (x - c) s, where c is the centre
 * of its bounds and s the power of two that makes their half-diagonal R at most 1. Rays start where
 * they enter the bounds and are divided by a power of two so that the largest component of their
 * direction is in [1/2, 1). So everything Embree sees is at most about 1 in size, whatever the
 * scene's units and wherever its origin. With e = 2^-24, errors along one axis are then at most
 *     e    rounding the entry point (which is found in double to 2^-50 or so),
 *     2 e  rounding the direction, times the at most 2 units walked,
 *     3 e  Embree's slab test, fma(plane, 1/d, -origin/d): two roundings,
 *     8 e  its 1/d, good to 2 ulps, times the 2 units between plane and origin,
 *     1 e  rounding the box itself,
 * 15 e in all, and the robust flag (where Embree heeds it for user geometry) only lowers that.
 * Boxes are padded by 32 e per side. As the errors are per axis, a padded box is entered on each
 * axis before the true ray enters the true box, so neither comparison with tnear (always 0) nor
 * with tfar (the best hit so far, rounded up) culls a box with a nearer hit in it. */
#include "accel/device.h"

#include <float.h>

/* Padding of primitives, and of the bounds that rays are clipped to, in units of R. */
static const double PRIMITIVE_PAD = 0x1p-19; /* 32 e */
static const double BOUNDS_PAD = 0x1p-18;

typedef struct query {
    knurl_embree_query_context base; /* first: the callbacks get its address */
    accel_visit_fn *visit;
    void *user;
    double tmax;
    double t0, rate; /* Embree's t is (t - t0) * rate */
} query;

/* ---- Building --------------------------------------------------------------------------------- */

typedef struct bounds_job {
    accel_bounds_fn *bounds;
    const void *user;
    accel_box *boxes; /* one per thread */
} bounds_job;

static void bounds_chunk(void *user, size_t begin, size_t end, int32_t thread)
{
    bounds_job *job = user;
    accel_box all = job->boxes[thread];
    for (size_t i = begin; i < end; i++) {
        accel_box one;
        if (job->bounds(job->user, (uint32_t)i, &one)) all = accel_box_union(&all, &one);
    }
    job->boxes[thread] = all;
}

static knurl_status find_bounds(accel_bvh *bvh, uint32_t count, knurl_error *error)
{
    knurl_context *context = bvh->device->context;
    int32_t threads = knurl_context_threads(context);
    bounds_job job = {.bounds = bvh->bounds, .user = bvh->user};
    job.boxes = knurl_alloc_array(context, (size_t)threads, sizeof *job.boxes);
    if (!job.boxes) return knurl_fail_memory(error, (size_t)threads * sizeof *job.boxes, "bounds");
    for (int32_t i = 0; i < threads; i++) job.boxes[i] = accel_box_empty();
    knurl_parallel_for(context, count, 4096, bounds_chunk, &job);
    for (int32_t i = 0; i < threads; i++) bvh->box = accel_box_union(&bvh->box, &job.boxes[i]);
    knurl_free(context, job.boxes);
    return KNURL_OK;
}

void accel_bvh_set_half(accel_bvh *bvh)
{
    vec3 half = v3_max(v3_sub(bvh->box.upper, bvh->centre), v3_sub(bvh->centre, bvh->box.lower));
    double pad = BOUNDS_PAD / bvh->scale;
    bvh->half = v3_add(half, v3(pad, pad, pad));
}

static void set_frame(accel_bvh *bvh)
{
    vec3 middle = v3_mad(v3_scale(bvh->box.lower, 0.5), 0.5, bvh->box.upper);
    /* Float coordinates, so that subtracting the centre from a float vertex is exact in double. */
    bvh->centre = v3((double)to_float(middle.x), (double)to_float(middle.y), (double)to_float(middle.z));
    vec3 half = v3_max(v3_sub(bvh->box.upper, bvh->centre), v3_sub(bvh->centre, bvh->box.lower));
    double radius = v3_length(half);
    int exponent = 0;
    (void)frexp(radius, &exponent); /* radius < 2^exponent */
    bvh->scale = radius > 0.0 ? ldexp(1.0, exponent < -1000 ? 1000 : -exponent) : 1.0;
    accel_bvh_set_half(bvh);
}

static void embree_bounds(const struct RTCBoundsFunctionArguments *args)
{
    const accel_bvh *bvh = args->geometryUserPtr;
    struct RTCBounds *out = args->bounds_o;
    accel_box box;
    if (!bvh->bounds(bvh->user, args->primID, &box)) {
        /* Embree leaves out primitives whose box is empty. */
        out->lower_x = out->lower_y = out->lower_z = INFINITY;
        out->upper_x = out->upper_y = out->upper_z = -INFINITY;
        return;
    }
    vec3 lower = v3_scale(v3_sub(box.lower, bvh->centre), bvh->scale);
    vec3 upper = v3_scale(v3_sub(box.upper, bvh->centre), bvh->scale);
    out->lower_x = (float)(lower.x - PRIMITIVE_PAD);
    out->lower_y = (float)(lower.y - PRIMITIVE_PAD);
    out->lower_z = (float)(lower.z - PRIMITIVE_PAD);
    out->upper_x = (float)(upper.x + PRIMITIVE_PAD);
    out->upper_y = (float)(upper.y + PRIMITIVE_PAD);
    out->upper_z = (float)(upper.z + PRIMITIVE_PAD);
}

float accel_bvh_tfar(double tmax, double t0, double rate)
{
    /* t itself has been rounded, which far along a ray is more than the float's last place. */
    double slack = 0x1p-50 * (fabs(tmax) + fabs(t0));
    double tau = ((tmax - t0) + slack) * rate;
    return tau >= (double)FLT_MAX ? FLT_MAX : knurl_embree_float_above(tau);
}

static float embree_tfar(const query *q)
{
    return accel_bvh_tfar(q->tmax, q->t0, q->rate);
}

/* Returns the new tfar, or -infinity when the traversal is to end. */
static float visit_one(query *q, uint32_t primitive)
{
    double tmax = q->visit(q->user, primitive, q->tmax);
    if (tmax < q->tmax) q->tmax = tmax;
    return q->tmax >= q->t0 ? embree_tfar(q) : -INFINITY;
}

static void embree_intersect(const struct RTCIntersectFunctionNArguments *args)
{
    if (!args->valid[0]) return;
    struct RTCRay *ray = (struct RTCRay *)(void *)args->rayhit;
    float tfar = visit_one((query *)(void *)args->context, args->primID);
#if KNURL_EMBREE_VERSION >= 4
    args->valid[0] = tfar < ray->tfar ? -1 : 0;
#endif
    if (tfar < ray->tfar) ray->tfar = tfar;
}

static void embree_occluded(const struct RTCOccludedFunctionNArguments *args)
{
    if (!args->valid[0]) return;
    struct RTCRay *ray = (struct RTCRay *)(void *)args->ray;
    float tfar = visit_one((query *)(void *)args->context, args->primID);
#if KNURL_EMBREE_VERSION >= 4
    args->valid[0] = tfar < 0.0f ? -1 : 0;
#endif
    if (tfar < 0.0f) ray->tfar = -INFINITY;
}

static knurl_status build_scene(accel_bvh *bvh, uint32_t count, const char *what, knurl_error *error)
{
    RTCDevice device = bvh->device->device;
    bvh->scene = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    if (bvh->scene && geometry) {
        rtcSetSceneFlags(bvh->scene, RTC_SCENE_FLAG_ROBUST);
        rtcSetSceneBuildQuality(bvh->scene, RTC_BUILD_QUALITY_MEDIUM);
        rtcSetGeometryUserPrimitiveCount(geometry, count);
        rtcSetGeometryUserData(geometry, bvh);
        rtcSetGeometryBoundsFunction(geometry, embree_bounds, NULL);
        rtcSetGeometryIntersectFunction(geometry, embree_intersect);
        rtcSetGeometryOccludedFunction(geometry, embree_occluded);
        rtcSetGeometryMask(geometry, 0xFFFFFFFFu);
        rtcCommitGeometry(geometry);
        (void)rtcAttachGeometry(bvh->scene, geometry);
        rtcCommitScene(bvh->scene);
    }
    if (geometry) rtcReleaseGeometry(geometry);
    knurl_status status = accel_device_check(bvh->device, what, error);
    if (status == KNURL_OK && (!bvh->scene || !geometry))
        status = knurl_fail(error, KNURL_ERROR_MEMORY, "building %s: Embree gave no scene", what);
    return status;
}

knurl_status accel_bvh_create_box(accel_device *device, const accel_box *box, const char *what,
                                  accel_bvh **out, knurl_error *error)
{
    *out = NULL;
    accel_bvh *bvh = knurl_alloc_zero(device->context, sizeof *bvh);
    if (!bvh) return knurl_fail_memory(error, sizeof *bvh, what);
    bvh->device = accel_device_retain(device);
    bvh->box = *box;
    bvh->empty = accel_box_is_empty(box);
    if (!bvh->empty) set_frame(bvh);
    *out = bvh;
    return KNURL_OK;
}

knurl_status accel_bvh_create(accel_device *device, uint32_t count, accel_bounds_fn *bounds, const void *user,
                              const char *what, accel_bvh **out, knurl_error *error)
{
    *out = NULL;
    accel_bvh *bvh = knurl_alloc_zero(device->context, sizeof *bvh);
    if (!bvh) return knurl_fail_memory(error, sizeof *bvh, what);
    bvh->device = accel_device_retain(device);
    bvh->bounds = bounds;
    bvh->user = user;
    bvh->box = accel_box_empty();
    knurl_status status = find_bounds(bvh, count, error);
    bvh->empty = accel_box_is_empty(&bvh->box);
    if (status == KNURL_OK && !bvh->empty) {
        set_frame(bvh);
        status = build_scene(bvh, count, what, error);
    }
    if (status != KNURL_OK) {
        accel_bvh_release(bvh);
        return status;
    }
    *out = bvh;
    return KNURL_OK;
}

void accel_bvh_release(accel_bvh *bvh)
{
    if (!bvh) return;
    if (bvh->scene) rtcReleaseScene(bvh->scene);
    accel_device *device = bvh->device;
    knurl_free(device->context, bvh);
    accel_device_release(device);
}

accel_box accel_bvh_bounds(const accel_bvh *bvh)
{
    return bvh->box;
}
vec3 accel_bvh_centre(const accel_bvh *bvh)
{
    return bvh->centre;
}

/* ---- Tracing ---------------------------------------------------------------------------------- */

/* Narrows [*t0, *t1] to one slab |o + t d| <= half. Nothing here becomes NaN: o and half are finite, and the
 * reciprocal of a finite number is not 0. */
static inline bool clip_axis(double o, double d, double half, double *t0, double *t1)
{
    double inverse = 1.0 / d;
    /* d is 0, or so small that any finite way stays on the spot */
    if (!(fabs(inverse) < INFINITY)) return fabs(o) <= half;
    double a = (-half - o) * inverse, b = (half - o) * inverse;
    *t0 = max_d(min_d(a, b), *t0);
    *t1 = min_d(max_d(a, b), *t1);
    return *t0 <= *t1;
}

/* `from` is the origin relative to the centre. */
static inline bool clip_box(const accel_bvh *bvh, vec3 from, vec3 direction, double *t0, double *t1)
{
    /* Distances to the planes are rounded relative to how far away the ray starts. */
    double slack = 0x1p-50 * v3_max_component(v3_abs(from));
    return clip_axis(from.x, direction.x, bvh->half.x + slack, t0, t1) &&
           clip_axis(from.y, direction.y, bvh->half.y + slack, t0, t1) &&
           clip_axis(from.z, direction.z, bvh->half.z + slack, t0, t1) && *t1 < INFINITY;
}

/* o + t d for o = high + low, with one rounding of the sum that cancels. */
static double advance(double high, double low, double t, double d)
{
    return fma(t, d, high) + low;
}

/* a - b = *high + *low exactly (Knuth's TwoSum). */
static void subtract_exactly(double a, double b, double *high, double *low)
{
    double s = a - b, bb = s - a;
    *high = s;
    *low = (a - (s - bb)) - (b + bb);
}

bool accel_bvh_clip(const accel_bvh *bvh, vec3 origin, vec3 direction, double tmin, double tmax,
                    accel_segment *segment)
{
    if (bvh->empty) return false;
    vec3 high, low;
    subtract_exactly(origin.x, bvh->centre.x, &high.x, &low.x);
    subtract_exactly(origin.y, bvh->centre.y, &high.y, &low.y);
    subtract_exactly(origin.z, bvh->centre.z, &high.z, &low.z);
    double t0 = tmin, t1 = tmax;
    if (!clip_box(bvh, high, direction, &t0, &t1)) return false;
    segment->direction = direction;
    segment->t0 = t0;
    segment->t1 = t1;
    segment->origin = v3(advance(high.x, low.x, t0, direction.x), advance(high.y, low.y, t0, direction.y),
                         advance(high.z, low.z, t0, direction.z));
    return v3_finite(segment->origin);
}

bool accel_bvh_clip_range(const accel_bvh *bvh, const double origin[3], const double direction[3],
                          double tmin, double tmax, accel_segment *segment)
{
    if (bvh->empty) return false;
    double t0 = tmin, t1 = tmax;
    bool meets = clip_box(bvh, v3_sub(v3_load(origin), bvh->centre), v3_load(direction), &t0, &t1);
    segment->t0 = t0;
    segment->t1 = t1;
    return meets;
}

/* The power of two that makes `longest` fall into [1/2, 1), as ldexp(1, -exponent by frexp). */
static double shrink_of(double longest)
{
    uint64_t bits;
    memcpy(&bits, &longest, sizeof bits);
    uint64_t biased = bits >> 52; /* no sign */
    if (biased >= 1 && biased <= 2044) {
        bits = (2045 - biased) << 52;
        double shrink;
        memcpy(&shrink, &bits, sizeof shrink);
        return shrink;
    }
    int exponent = 0;
    (void)frexp(longest, &exponent);
    return ldexp(1.0, -exponent);
}

bool accel_bvh_start_ray(const accel_bvh *bvh, const accel_segment *segment, struct RTCRay *ray, double *rate)
{
    double shrink = shrink_of(v3_max_component(v3_abs(segment->direction)));
    vec3 d = v3_scale(segment->direction, shrink), o = v3_scale(segment->origin, bvh->scale);
    *rate = bvh->scale / shrink;
    /* Embree asks for coordinates under 1.8e18. A ray that starts so far away that its distance to the object
     * is only known to more than that many sizes of it hits nothing. */
    if (!v3_finite(d) || !isfinite(*rate) || !(*rate > 0.0) || !(v3_max_component(v3_abs(o)) < 1e17))
        return false;
    memset(ray, 0, sizeof *ray);
    ray->org_x = (float)o.x, ray->org_y = (float)o.y, ray->org_z = (float)o.z;
    ray->dir_x = (float)d.x, ray->dir_y = (float)d.y, ray->dir_z = (float)d.z;
    ray->mask = 0xFFFFFFFFu;
    return true;
}

void accel_bvh_traverse(const accel_bvh *bvh, const accel_segment *segment, double tmax, bool any,
                        accel_visit_fn *visit, void *user)
{
    query q = {.visit = visit, .user = user, .tmax = min_d(tmax, segment->t1), .t0 = segment->t0};
    struct RTCRayHit ray;
    if (!(q.tmax >= q.t0) || !accel_bvh_start_ray(bvh, segment, &ray.ray, &q.rate)) return;
    memset(&ray.hit, 0, sizeof ray.hit);
    knurl_embree_init_query(&q.base);
    ray.ray.tfar = embree_tfar(&q);
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    if (any)
        knurl_embree_occluded1(bvh->scene, &q.base, &ray.ray);
    else
        knurl_embree_intersect1(bvh->scene, &q.base, &ray);
}
