/* Embree's own geometry at Embree's own speed.
 *
 * The robust flag makes its tests of facets and boxes watertight: facets that share two vertices bit for bit
 * (which is what native_mesh promises) let no ray through between them. */
#include "accel/native.h"

#include "accel/device.h"

/* ---- Building --------------------------------------------------------------------------------- */

static RTCGeometry make_geometry(RTCDevice device, const native_part *part)
{
    static const struct {
        enum RTCGeometryType type;
        enum RTCBufferType buffer;
        enum RTCFormat format;
        size_t stride;
    } kinds[] = {
        [NATIVE_TRIANGLES] = {RTC_GEOMETRY_TYPE_TRIANGLE, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, 12},
        [NATIVE_QUADS] = {RTC_GEOMETRY_TYPE_QUAD, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT4, 16},
        [NATIVE_GRIDS] = {RTC_GEOMETRY_TYPE_GRID, RTC_BUFFER_TYPE_GRID, RTC_FORMAT_GRID,
                          sizeof(struct RTCGrid)},
    };
    _Static_assert(sizeof(native_grid) == sizeof(struct RTCGrid), "native_grid has another layout");
    RTCGeometry geometry = rtcNewGeometry(device, kinds[part->kind].type);
    if (!geometry) return NULL;
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, part->vertices, 0, 12,
                               part->vertex_count);
    rtcSetSharedGeometryBuffer(geometry, kinds[part->kind].buffer, 0, kinds[part->kind].format,
                               part->primitives, 0, kinds[part->kind].stride, part->primitive_count);
    rtcSetGeometryMask(geometry, 0xFFFFFFFFu);
    rtcCommitGeometry(geometry);
    return geometry;
}

static knurl_status build_scene(accel_bvh *bvh, const native_mesh *mesh, const char *what, knurl_error *error)
{
    RTCDevice device = bvh->device->device;
    bvh->scene = rtcNewScene(device);
    bool complete = bvh->scene != NULL;
    if (complete) {
#if KNURL_EMBREE_VERSION >= 4
        rtcSetSceneFlags(bvh->scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS);
#else
        rtcSetSceneFlags(bvh->scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
#endif
        rtcSetSceneBuildQuality(bvh->scene, RTC_BUILD_QUALITY_MEDIUM);
    }
    for (uint32_t i = 0; complete && i < mesh->part_count; i++) {
        RTCGeometry geometry = make_geometry(device, &mesh->parts[i]);
        complete = geometry != NULL;
        if (!complete) break;
        rtcAttachGeometryByID(bvh->scene, geometry, i);
        rtcReleaseGeometry(geometry);
    }
    if (complete) rtcCommitScene(bvh->scene);
    knurl_status status = accel_device_check(bvh->device, what, error);
    if (status == KNURL_OK && !complete)
        status = knurl_fail(error, KNURL_ERROR_MEMORY, "building %s: Embree gave no scene", what);
    return status;
}

knurl_status accel_native_create(accel_device *device, const native_mesh *mesh, const char *what,
                                 accel_bvh **out, knurl_error *error)
{
    *out = NULL;
    accel_bvh *bvh = knurl_alloc_zero(device->context, sizeof *bvh);
    if (!bvh) return knurl_fail_memory(error, sizeof *bvh, what);
    bvh->device = accel_device_retain(device);
    bvh->box = (accel_box){mesh->lower, mesh->upper};
    bvh->centre = mesh->centre;
    bvh->scale = mesh->scale;
    bvh->user = mesh;
    knurl_status status = KNURL_OK;
    if (mesh->part_count > 0 && !accel_box_is_empty(&bvh->box)) {
        accel_bvh_set_half(bvh);
        status = build_scene(bvh, mesh, what, error);
    }
    if (status != KNURL_OK) {
        accel_bvh_release(bvh);
        return status;
    }
    *out = bvh;
    return KNURL_OK;
}

/* ---- Tracing ---------------------------------------------------------------------------------- */

/* Which of several facets at one edge Embree names depends on the order in its leaves, which depends on how
 * many threads built them. A second query then lists them all and takes the first by number. */
typedef struct edge_query {
    knurl_embree_query_context base; /* first: the filter gets its address */
    bool found;
    float t, u, v;
    uint32_t part, primitive;
} edge_query;

static bool comes_before(const struct RTCHit *hit, const edge_query *q)
{
    if (hit->geomID != q->part) return hit->geomID < q->part;
    if (hit->primID != q->primitive) return hit->primID < q->primitive;
    return hit->u != q->u ? hit->u < q->u : hit->v < q->v;
}

static void list_hit(const struct RTCFilterFunctionNArguments *args)
{
    edge_query *q = (edge_query *)(void *)args->context;
    const struct RTCRay *ray = (const struct RTCRay *)(const void *)args->ray; /* N is 1 */
    const struct RTCHit *hit = (const struct RTCHit *)(const void *)args->hit;
    if (!args->valid[0]) return;
    args->valid[0] = 0;
    if (q->found && !comes_before(hit, q)) return;
    q->found = true;
    q->t = ray->tfar;
    q->u = hit->u;
    q->v = hit->v;
    q->part = hit->geomID;
    q->primitive = hit->primID;
}

/* Whether u, v, or u + v is within rounding of a whole number: an edge or a diagonal. */
static bool is_near_edge(const native_mesh *mesh, const struct RTCHit *hit)
{
    static const float NEAR = 1e-5f;
    const native_part *part = &mesh->parts[hit->geomID];
    float u = hit->u, v = hit->v;
    if (part->kind == NATIVE_GRIDS) {
        const native_grid *grid = (const native_grid *)part->primitives + hit->primID;
        u *= (float)(grid->width - 1);
        v *= (float)(grid->height - 1);
    }
    u -= (float)(int)u;
    v -= (float)(int)v;
    float near = part->kind == NATIVE_GRIDS ? 64.0f * NEAR : NEAR, w = u + v;
    return u < near || v < near || u > 1.0f - near || v > 1.0f - near || fabsf(w - 1.0f) < near;
}

static void settle_edge(const accel_bvh *bvh, const struct RTCRay *ray, struct RTCRayHit *found)
{
    static const float SLACK = 0x1p-21f;
    edge_query q = {.found = false};
    knurl_embree_init_query(&q.base);
    struct RTCRayHit again = *found;
    again.ray.tnear = fmaxf(ray->tnear, found->ray.tfar - SLACK);
    again.ray.tfar = fminf(ray->tfar, found->ray.tfar + SLACK);
    again.hit.geomID = RTC_INVALID_GEOMETRY_ID;
#if KNURL_EMBREE_VERSION >= 4
    struct RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.context = &q.base;
    arguments.filter = list_hit;
    arguments.flags = RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
    rtcIntersect1(bvh->scene, &again, &arguments);
#else
    q.base.filter = list_hit;
    rtcIntersect1(bvh->scene, &q.base, &again);
#endif
    if (!q.found) return;
    found->ray.tfar = q.t;
    found->hit.u = q.u;
    found->hit.v = q.v;
    found->hit.geomID = q.part;
    found->hit.primID = q.primitive;
}

bool accel_native_intersect(const accel_bvh *bvh, const accel_segment *segment, double tmax, native_hit *hit)
{
    struct RTCRayHit ray;
    double rate;
    tmax = fmin(tmax, segment->t1);
    if (!(tmax >= segment->t0) || !accel_bvh_start_ray(bvh, segment, &ray.ray, &rate)) return false;
    ray.ray.tfar = accel_bvh_tfar(tmax, segment->t0, rate);
    memset(&ray.hit, 0, sizeof ray.hit);
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    struct RTCRay start = ray.ray;
    knurl_embree_intersect1(bvh->scene, NULL, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
    if (is_near_edge(bvh->user, &ray.hit)) settle_edge(bvh, &start, &ray);
    hit->t = fmin(segment->t0 + (double)ray.ray.tfar / rate, tmax);
    hit->part = ray.hit.geomID;
    hit->primitive = ray.hit.primID;
    hit->u = ray.hit.u;
    hit->v = ray.hit.v;
    return true;
}

bool accel_native_occluded(const accel_bvh *bvh, const accel_segment *segment, double tmax)
{
    struct RTCRay ray;
    double rate;
    tmax = fmin(tmax, segment->t1);
    if (!(tmax >= segment->t0) || !accel_bvh_start_ray(bvh, segment, &ray, &rate)) return false;
    ray.tfar = accel_bvh_tfar(tmax, segment->t0, rate);
    knurl_embree_occluded1(bvh->scene, NULL, &ray);
    return ray.tfar < 0.0f;
}
