/* Embree's own geometry at Embree's own speed.
 *
 * With the robust flag, facets that share two vertices bit for bit (which is what native_mesh promises) see
 * the same sign of the ray against their edge, so that none passes between them. Exactly at a vertex Embree's
 * rounding can still leave a gap: of rays aimed at vertices of facets a hundredth of the object in size, one
 * in some hundred passes, of others none was seen to. Levels of detail are not for facets: rays' are ignored.
 */
#include "accel/native.h"

#include "accel/device.h"

#include <stddef.h>

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
    bvh->empty = mesh->part_count == 0 || accel_box_is_empty(&bvh->box);
    if (!bvh->empty) {
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

/* The segment up to tmax as Embree's ray; false if nothing is left of it. */
static bool start_ray(const accel_bvh *bvh, const accel_segment *segment, double tmax, struct RTCRay *ray,
                      double *rate)
{
    tmax = min_d(tmax, segment->t1);
    if (!(tmax >= segment->t0) || !accel_bvh_start_ray(bvh, segment, ray, rate)) return false;
    ray->tfar = accel_bvh_tfar(tmax, segment->t0, *rate);
    return true;
}

bool accel_native_intersect(const accel_bvh *bvh, const accel_segment *segment, double tmax, native_hit *hit)
{
    struct RTCRayHit ray;
    double rate;
    if (!start_ray(bvh, segment, tmax, &ray.ray, &rate)) return false;
    memset(&ray.hit, 0, sizeof ray.hit);
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    knurl_embree_intersect1(bvh->scene, NULL, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
    hit->t = min_d(segment->t0 + (double)ray.ray.tfar / rate, min_d(tmax, segment->t1));
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
    if (!start_ray(bvh, segment, tmax, &ray, &rate)) return false;
    knurl_embree_occluded1(bvh->scene, NULL, &ray);
    return ray.tfar < 0.0f;
}

/* ---- Many rays -------------------------------------------------------------------------------- */

/* What pays, measured with Embree 3.13 on million-triangle meshes, relative to single calls:
 *   nearest hits  coherent packets of 16 where rays are alike 1.15 to 1.2, of 8 1.14 to 1.15, of 4 1.1,
 * elsewhere 0.7 to 0.9; packets without the flag, and streams: 1.0 to 1.05 everywhere any hits streams 1.3
 * to 1.35, packets 0.85 to 1.08 So packets are for rays that are alike, streams for any hits, and single
 * calls for the rest. */

enum { MOST_LANES = 16 };

/* The ray and hit of RTCRayHit4, 8 and 16, lane by lane: field f of lane k is word f * lanes + k. */
enum {
    ORG = 0,
    TNEAR = 3,
    DIR = 4,
    TIME = 7,
    TFAR = 8,
    MASK = 9,
    HIT_U = 15,
    HIT_V = 16,
    PRIM = 17,
    GEOM = 18,
    INST = 19,
    WORDS = 20
};
_Static_assert(sizeof(struct RTCRayHit16) == WORDS * 16 * sizeof(float), "packets have another layout");
_Static_assert(offsetof(struct RTCRayHit16, hit.u) == HIT_U * 16 * sizeof(float), "u is elsewhere");
_Static_assert(offsetof(struct RTCRayHit16, hit.geomID) == GEOM * 16 * sizeof(float), "geomID is elsewhere");

typedef union packet_word {
    float f;
    unsigned int u;
} packet_word;

typedef struct packet {
    _Alignas(64) packet_word words[WORDS * MOST_LANES];
    _Alignas(64) int valid[MOST_LANES];
    double rate[MOST_LANES];
} packet;

/* Whether neighbours in a packet will go the same way: they start within a 16th of the object's size, and
 * their directions differ by under 8 degrees or so. */
static bool are_alike(const accel_bvh *bvh, const accel_segment *segments, size_t count)
{
    const vec3 o = segments[0].origin, d = segments[0].direction;
    const double near = 0.125 / bvh->scale, straight = 0.98 * v3_dot(d, d);
    for (size_t i = 1; i < count; i++) {
        const vec3 e = segments[i].direction;
        const double along = v3_dot(d, e);
        if (!(v3_max_component(v3_abs(v3_sub(segments[i].origin, o))) < near) || !(along > 0.0) ||
            !(along * along > straight * v3_dot(e, e)))
            return false;
    }
    return true;
}

static void fill_lane(packet *p, size_t lanes, size_t k, const struct RTCRay *ray)
{
    packet_word *w = p->words + k;
    w[(ORG + 0) * lanes].f = ray->org_x;
    w[(ORG + 1) * lanes].f = ray->org_y;
    w[(ORG + 2) * lanes].f = ray->org_z;
    w[TNEAR * lanes].f = 0.0f;
    w[(DIR + 0) * lanes].f = ray->dir_x;
    w[(DIR + 1) * lanes].f = ray->dir_y;
    w[(DIR + 2) * lanes].f = ray->dir_z;
    w[TIME * lanes].f = 0.0f;
    w[TFAR * lanes].f = ray->tfar;
    w[MASK * lanes].u = ray->mask;
    w[GEOM * lanes].u = RTC_INVALID_GEOMETRY_ID;
    w[INST * lanes].u = RTC_INVALID_GEOMETRY_ID;
}

static void trace_packet(RTCScene scene, packet *p, size_t lanes)
{
    void *rays = p->words;
#if KNURL_EMBREE_VERSION >= 4
    struct RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    if (lanes == 16)
        rtcIntersect16(p->valid, scene, rays, &arguments);
    else if (lanes == 8)
        rtcIntersect8(p->valid, scene, rays, &arguments);
    else
        rtcIntersect4(p->valid, scene, rays, &arguments);
#else
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    if (lanes == 16)
        rtcIntersect16(p->valid, scene, &context, rays);
    else if (lanes == 8)
        rtcIntersect8(p->valid, scene, &context, rays);
    else
        rtcIntersect4(p->valid, scene, &context, rays);
#endif
}

static void intersect_packet(const accel_bvh *bvh, const knurl_ray *rays, const accel_segment *segments,
                             size_t count, native_hit *hits, bool *found)
{
    const size_t lanes = bvh->device->lanes;
    packet p;
    for (size_t k = 0; k < lanes; k++) {
        struct RTCRay ray = {0};
        p.valid[k] = k < count && start_ray(bvh, &segments[k], rays[k].tmax, &ray, &p.rate[k]) ? -1 : 0;
        fill_lane(&p, lanes, k, &ray);
    }
    trace_packet(bvh->scene, &p, lanes);
    for (size_t k = 0; k < count; k++) {
        const packet_word *w = p.words + k;
        found[k] = p.valid[k] != 0 && w[GEOM * lanes].u != RTC_INVALID_GEOMETRY_ID;
        if (!found[k]) continue;
        const double tmax = min_d(rays[k].tmax, segments[k].t1);
        hits[k] = (native_hit){.t = min_d(segments[k].t0 + (double)w[TFAR * lanes].f / p.rate[k], tmax),
                               .part = w[GEOM * lanes].u,
                               .primitive = w[PRIM * lanes].u,
                               .u = w[HIT_U * lanes].f,
                               .v = w[HIT_V * lanes].f};
    }
}

void accel_native_intersect_many(const accel_bvh *bvh, const knurl_ray *rays, const accel_segment *segments,
                                 size_t count, native_hit *hits, bool *found)
{
    const size_t lanes = bvh->device->lanes;
    for (size_t begin = 0; begin < count;) {
        const size_t n = lanes == 0 ? 1 : count - begin < lanes ? count - begin : lanes;
        if (n > 2 && are_alike(bvh, segments + begin, n))
            intersect_packet(bvh, rays + begin, segments + begin, n, hits + begin, found + begin);
        else
            for (size_t i = begin; i < begin + n; i++)
                found[i] = accel_native_intersect(bvh, &segments[i], rays[i].tmax, &hits[i]);
        begin += n;
    }
}

#if KNURL_EMBREE_VERSION >= 4
void accel_native_occluded_many(const accel_bvh *bvh, const knurl_ray *rays, const accel_segment *segments,
                                size_t count, bool *found)
{
    for (size_t i = 0; i < count; i++) found[i] = accel_native_occluded(bvh, &segments[i], rays[i].tmax);
}
#else
void accel_native_occluded_many(const accel_bvh *bvh, const knurl_ray *rays, const accel_segment *segments,
                                size_t count, bool *found)
{
    enum { STREAM = 64 };
    struct RTCRay stream[STREAM];
    size_t index[STREAM];
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (size_t i = 0; i < count;) {
        unsigned int length = 0;
        double rate;
        for (; i < count && length < STREAM; i++) {
            found[i] = false;
            if (!start_ray(bvh, &segments[i], rays[i].tmax, &stream[length], &rate)) continue;
            index[length++] = i;
        }
        if (length > 0) rtcOccluded1M(bvh->scene, &context, stream, length, sizeof stream[0]);
        for (unsigned int k = 0; k < length; k++) found[index[k]] = stream[k].tfar < 0.0f;
    }
}
#endif
