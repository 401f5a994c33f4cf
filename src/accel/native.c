/* Embree's own geometry at Embree's own speed.
 *
 * With the robust flag, facets that share two vertices bit for bit (which is what native_mesh promises) see
 * the same sign of the ray against their edge, so that none passes between them. Exactly at a vertex Embree's
 * rounding can still leave a gap: of rays aimed at vertices of facets a hundredth of the object in size, one
 * in some hundred passes, of others none was seen to. Levels of detail are not for facets: rays' are ignored.
 */
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
        rtcSetSceneFlags(bvh->scene, RTC_SCENE_FLAG_ROBUST);
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
    knurl_embree_intersect1(bvh->scene, NULL, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
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
