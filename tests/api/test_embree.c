/* The Embree adapter: a displaced sphere attached to a foreign Embree scene, beside Embree's own
 * triangles, must give what knurl_scene gives. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/embree.h>
#include <knurl/scene.h>

#include "support/random.h"

#include <stdlib.h>

enum { ROWS = 8, COLUMNS = 12, RAYS = 4000 };

typedef struct fixture {
    const char *method;
    knurl_context *context;
    knurl_surface *surface;
    knurl_scene *scene; /* object 0: the sphere, object 1: the floor */
    RTCDevice device;
    RTCScene plain, extended;
    unsigned int sphere, floor; /* geometry IDs, the same in both scenes */
} fixture;

static const float floor_positions[12] = {-3, -1.2f, -3, 3, -1.2f, -3, 3, -1.2f, 3, -3, -1.2f, 3};
static const uint32_t floor_triangles[6] = {0, 2, 1, 0, 3, 2};

static knurl_surface *make_sphere(knurl_context *context, const char *method)
{
    static float positions[(ROWS + 1) * (COLUMNS + 1) * 3], texcoords[(ROWS + 1) * (COLUMNS + 1) * 2];
    static uint32_t triangles[ROWS * COLUMNS * 6];
    const double pi = acos(-1.0);
    for (uint32_t r = 0; r <= ROWS; r++)
        for (uint32_t c = 0; c <= COLUMNS; c++) {
            uint32_t v = r * (COLUMNS + 1) + c;
            double theta = pi * r / ROWS, phi = 2.0 * pi * (c % COLUMNS) / COLUMNS;
            positions[3 * v] = (float)(sin(theta) * cos(phi));
            positions[3 * v + 1] = (float)cos(theta);
            positions[3 * v + 2] = (float)(sin(theta) * sin(phi));
            texcoords[2 * v] = (float)c / COLUMNS;
            texcoords[2 * v + 1] = (float)r / ROWS;
        }
    for (uint32_t r = 0, n = 0; r < ROWS; r++)
        for (uint32_t c = 0; c < COLUMNS; c++, n += 6) {
            uint32_t v = r * (COLUMNS + 1) + c, w = v + COLUMNS + 1;
            memcpy(triangles + n, (uint32_t[]){v, v + 1, w, v + 1, w + 1, w}, 24);
        }
    uint8_t samples[32 * 16];
    random_state random = {3};
    for (size_t i = 0; i < sizeof samples; i++) samples[i] = (uint8_t)random_bits(&random);
    knurl_image *image;
    assert_int_equal(knurl_image_create(context, 32, 16, 1, KNURL_PIXEL_U8, samples, &image, NULL), KNURL_OK);
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    knurl_surface_def def = knurl_surface_def_default();
    def.method = method;
    assert_int_equal(knurl_heightmap_create(context, &map_def, &def.displacement.map, NULL), KNURL_OK);
    def.displacement.factor = 0.15;
    def.mesh = (knurl_mesh_view){.positions = positions,
                                 .normals = positions,
                                 .texcoords = texcoords,
                                 .vertex_count = (ROWS + 1) * (COLUMNS + 1),
                                 .triangles = triangles,
                                 .triangle_count = ROWS * COLUMNS * 2};
    knurl_surface *surface;
    assert_int_equal(knurl_surface_create(context, &def, &surface, NULL), KNURL_OK);
    knurl_heightmap_release(def.displacement.map);
    knurl_image_release(image);
    return surface;
}

static unsigned int attach_floor(RTCDevice device, RTCScene scene)
{
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void *p = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 4);
    memcpy(p, floor_positions, sizeof floor_positions);
    p = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 2);
    memcpy(p, floor_triangles, sizeof floor_triangles);
    rtcSetGeometryMask(geometry, 0xFFFFFFFFu);
    rtcCommitGeometry(geometry);
    unsigned int id = rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    return id;
}

static int setup_method(void **state, const char *method)
{
    fixture *f = calloc(1, sizeof *f);
    if (!f) return -1;
    f->method = method;
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    assert_int_equal(knurl_context_create(&def, &f->context, NULL), KNURL_OK);
    f->surface = make_sphere(f->context, method);
    knurl_mesh_view floor = {
        .positions = floor_positions, .vertex_count = 4, .triangles = floor_triangles, .triangle_count = 2};
    assert_int_equal(knurl_scene_create(f->context, &f->scene, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(f->scene, f->surface, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_mesh(f->scene, &floor, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_instance(f->scene, 0, NULL, 1, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_instance(f->scene, 1, NULL, 2, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_commit(f->scene, NULL), KNURL_OK);
    f->device = rtcNewDevice("threads=1");
    assert_non_null(f->device);
    f->plain = rtcNewScene(f->device);
    f->sphere = knurl_embree_attach(f->device, f->plain, f->surface);
    f->floor = attach_floor(f->device, f->plain);
    rtcCommitScene(f->plain);
    f->extended = rtcNewScene(f->device);
    assert_int_equal(knurl_embree_attach_extended(f->device, f->extended, f->surface), f->sphere);
    assert_int_equal(attach_floor(f->device, f->extended), f->floor);
    rtcCommitScene(f->extended);
    assert_int_equal(rtcGetDeviceError(f->device), RTC_ERROR_NONE);
    *state = f;
    return 0;
}

/* A surface with a hierarchy of its own, one primitive; and one of a primitive per triangle. */
static int setup_fast(void **state)
{
    return setup_method(state, "fast");
}

static int setup_rmip(void **state)
{
    return setup_method(state, "rmip");
}

static int teardown(void **state)
{
    fixture *f = *state;
    rtcReleaseScene(f->plain);
    rtcReleaseScene(f->extended);
    rtcReleaseDevice(f->device);
    knurl_scene_release(f->scene);
    knurl_surface_release(f->surface);
    knurl_context_release(f->context);
    free(f);
    return 0;
}

static struct RTCRay random_ray(random_state *random)
{
    float o[3], d[3];
    for (int k = 0; k < 3; k++) {
        o[k] = (float)random_range(random, -3.0, 3.0);
        d[k] = (float)random_range(random, -1.1, 1.1) - o[k];
    }
    struct RTCRay ray = {.org_x = o[0],
                         .org_y = o[1] + 2.0f,
                         .org_z = o[2],
                         .dir_x = d[0],
                         .dir_y = d[1] - 2.0f,
                         .dir_z = d[2],
                         .tfar = INFINITY,
                         .mask = 0xFFFFFFFFu};
    if (random_index(random, 5) == 0) ray.tnear = (float)random_unit(random);
    if (random_index(random, 5) == 0) ray.tfar = ray.tnear + (float)random_unit(random);
    return ray;
}

static struct RTCRayHit start(const struct RTCRay *ray)
{
    struct RTCRayHit rayhit;
    memset(&rayhit, 0, sizeof rayhit);
    rayhit.ray = *ray;
    rayhit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rayhit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    return rayhit;
}

static knurl_ray as_knurl_ray(const struct RTCRay *ray)
{
    knurl_ray out =
        knurl_ray_make((const double[3]){(double)ray->org_x, (double)ray->org_y, (double)ray->org_z},
                       (const double[3]){(double)ray->dir_x, (double)ray->dir_y, (double)ray->dir_z});
    out.tmin = (double)ray->tnear;
    out.tmax = (double)ray->tfar;
    return out;
}

static void assert_near(double value, double expected, double slack)
{
    if (!(fabs(value - expected) <= slack)) print_message("%.17g, expected %.17g\n", value, expected);
    assert_true(fabs(value - expected) <= slack);
}

/* An Embree hit against a knurl one. */
static void assert_agrees(const fixture *f, const struct RTCRayHit *rayhit, const knurl_hit *hit)
{
    if (hit->triangle == KNURL_NO_HIT) {
        assert_int_equal(rayhit->hit.geomID, RTC_INVALID_GEOMETRY_ID);
        return;
    }
    assert_int_equal(rayhit->hit.geomID, hit->object == 0 ? f->sphere : f->floor);
    assert_near((double)rayhit->ray.tfar, hit->t, 1e-6 * hit->t);
    if (hit->object != 0) return;
    /* The smallest float not below t; roots found in other intervals may differ in the last bits. */
    assert_true((double)rayhit->ray.tfar >= hit->t * (1.0 - 1e-12));
    assert_true((double)nextafterf(rayhit->ray.tfar, 0.0f) <= hit->t * (1.0 + 1e-12));
    if (rayhit->hit.primID != hit->triangle) return; /* on a shared edge */
    assert_near((double)rayhit->hit.u, hit->a, 1e-6);
    assert_near((double)rayhit->hit.v, hit->b, 1e-6);
    assert_near((double)rayhit->hit.Ng_x, hit->ng[0], 1e-6);
    assert_near((double)rayhit->hit.Ng_y, hit->ng[1], 1e-6);
    assert_near((double)rayhit->hit.Ng_z, hit->ng[2], 1e-6);
    assert_int_equal(rayhit->hit.instID[0], RTC_INVALID_GEOMETRY_ID);
}

/* ---- Tests ---------------------------------------------------------------------------------- */

/* primID is the base triangle also where Embree knows of one primitive only. */
static void test_primitives(void **state)
{
    const fixture *f = *state;
    const bool whole = (knurl_surface_flags(f->surface) & KNURL_METHOD_WHOLE) != 0;
    assert_int_equal(whole, strcmp(f->method, "fast") == 0);
    assert_int_equal(knurl_surface_shell_count(f->surface), whole ? 1 : 2 * ROWS * COLUMNS);
    bool seen[2 * ROWS * COLUMNS] = {false};
    random_state random = {15};
    int count = 0;
    for (int i = 0; i < RAYS; i++) {
        struct RTCRay ray = random_ray(&random);
        struct RTCRayHit rayhit = start(&ray);
        knurl_embree_intersect1(f->plain, NULL, &rayhit);
        if (rayhit.hit.geomID != f->sphere) continue;
        assert_true(rayhit.hit.primID < 2 * ROWS * COLUMNS);
        count += !seen[rayhit.hit.primID];
        seen[rayhit.hit.primID] = true;
    }
    assert_true(count > ROWS * COLUMNS);
}

static void test_same_hits_as_scene(void **state)
{
    const fixture *f = *state;
    random_state random = {11};
    int sphere = 0, floor = 0;
    for (int i = 0; i < RAYS; i++) {
        struct RTCRay ray = random_ray(&random);
        struct RTCRayHit rayhit = start(&ray);
        knurl_ray same = as_knurl_ray(&ray);
        knurl_hit hit;
        knurl_embree_intersect1(f->plain, NULL, &rayhit);
        bool found = knurl_scene_intersect(f->scene, &same, &hit);
        assert_agrees(f, &rayhit, &hit);
        sphere += found && hit.object == 0;
        floor += found && hit.object == 1;
        knurl_embree_occluded1(f->plain, NULL, &ray);
        assert_int_equal(ray.tfar < 0.0f, found);
        knurl_hit full;
        bool again = rayhit.hit.geomID == f->sphere && knurl_embree_hit(f->surface, &rayhit, 0.0f, &full);
        assert_int_equal(again, found && hit.object == 0);
        if (!again) continue;
        assert_near(full.t, hit.t, 1e-12 * hit.t);
        for (int k = 0; k < 3; k++) assert_near(full.position[k], hit.position[k], 1e-11);
        assert_near(full.height, hit.height, 1e-11);
    }
    assert_true(sphere > RAYS / 4 && floor > RAYS / 20);
}

static void test_extended_context(void **state)
{
    const fixture *f = *state;
    random_state random = {12};
    int sphere = 0, coarser = 0;
    for (int i = 0; i < RAYS; i++) {
        struct RTCRay ray = random_ray(&random);
        ray.id = i % 2 ? 1 : 0;
        struct RTCRayHit rayhit = start(&ray);
        knurl_ray same = as_knurl_ray(&ray);
        knurl_hit hit, full[2];
        knurl_embree_context context;
        knurl_embree_context_init(&context);
        context.hits = full;
        context.hit_count = i % 4 == 3 ? 1 : 2; /* ray 1 then has no place for its hit */
        context.lod = same.lod = (float)(i % 3) * 0.7f;
        full[0].triangle = full[1].triangle = KNURL_NO_HIT;
        knurl_embree_intersect1(f->extended, &context.base, &rayhit);
        bool found = knurl_scene_intersect(f->scene, &same, &hit);
        assert_agrees(f, &rayhit, &hit);
        knurl_ray fine = as_knurl_ray(&ray);
        knurl_hit fine_hit;
        if (found && hit.object == 0 && knurl_scene_intersect(f->scene, &fine, &fine_hit))
            coarser += fabs(fine_hit.t - hit.t) > 1e-6;
        if (rayhit.hit.geomID == f->sphere && ray.id < context.hit_count) {
            sphere++;
            assert_int_equal(full[ray.id].triangle, rayhit.hit.primID);
            assert_near(full[ray.id].t, hit.t, 1e-12 * hit.t);
            for (int k = 0; k < 3; k++) assert_near(full[ray.id].ns[k], hit.ns[k], 1e-6);
        }
        assert_int_equal(full[1 - ray.id].triangle, KNURL_NO_HIT);
        if (ray.id >= context.hit_count) assert_int_equal(full[ray.id].triangle, KNURL_NO_HIT);
        knurl_embree_occluded1(f->extended, &context.base, &ray);
        assert_int_equal(ray.tfar < 0.0f, found);
    }
    assert_true(sphere > RAYS / 5 && coarser > RAYS / 20);
}

/* A cone in the context is the level of detail that its width at the given distance asks for. */
static void test_cone(void **state)
{
    const fixture *f = *state;
    struct RTCRay ray = {
        .org_x = 0.1f, .org_y = 3.0f, .org_z = 0.2f, .dir_y = -1.0f, .tfar = INFINITY, .mask = 0xFFFFFFFFu};
    struct RTCRayHit rayhit = start(&ray);
    knurl_embree_context context;
    knurl_embree_context_init(&context);
    context.cone_spread = 0.3f;
    context.cone_distance = 2.0f;
    knurl_embree_intersect1(f->extended, &context.base, &rayhit);
    knurl_ray same = as_knurl_ray(&ray);
    same.cone_spread = 0.3f;
    same.lod = (float)knurl_surface_cone_lod(f->surface, &same, 2.0);
    same.cone_spread = 0.0f;
    assert_true(same.lod > 0.5f);
    knurl_hit hit;
    assert_true(knurl_scene_intersect(f->scene, &same, &hit));
    assert_agrees(f, &rayhit, &hit);
}

#if KNURL_EMBREE_VERSION < 4
/* Packets, with some of their rays switched off, and streams equal single rays. */
static void test_packets(void **state)
{
    const fixture *f = *state;
    random_state random = {13};
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (int round = 0; round < 300; round++) {
        struct RTCRayHit8 packet;
        memset(&packet, 0, sizeof packet);
        struct RTCRayHit single[8], stream[8];
        int valid[8] __attribute__((aligned(32)));
        for (int i = 0; i < 8; i++) {
            struct RTCRay ray = random_ray(&random);
            single[i] = stream[i] = start(&ray);
            valid[i] = random_index(&random, 4) ? -1 : 0;
            packet.ray.org_x[i] = ray.org_x, packet.ray.org_y[i] = ray.org_y, packet.ray.org_z[i] = ray.org_z;
            packet.ray.dir_x[i] = ray.dir_x, packet.ray.dir_y[i] = ray.dir_y, packet.ray.dir_z[i] = ray.dir_z;
            packet.ray.tnear[i] = ray.tnear, packet.ray.tfar[i] = ray.tfar, packet.ray.mask[i] = ray.mask;
            packet.hit.geomID[i] = packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
            rtcIntersect1(f->plain, &context, &single[i]);
        }
        struct RTCRay8 shadow = packet.ray;
        rtcIntersect8(valid, f->plain, &context, &packet);
        rtcOccluded8(valid, f->plain, &context, &shadow);
        rtcIntersect1M(f->plain, &context, stream, 8, sizeof stream[0]);
        for (int i = 0; i < 8; i++) {
            assert_int_equal(stream[i].hit.geomID, single[i].hit.geomID);
            assert_true(fabsf(stream[i].ray.tfar - single[i].ray.tfar) <= 1e-6f * single[i].ray.tfar ||
                        stream[i].ray.tfar == single[i].ray.tfar);
            if (!valid[i]) {
                assert_int_equal(packet.hit.geomID[i], RTC_INVALID_GEOMETRY_ID);
                continue;
            }
            assert_int_equal(packet.hit.geomID[i], single[i].hit.geomID);
            assert_int_equal(shadow.tfar[i] < 0.0f, single[i].hit.geomID != RTC_INVALID_GEOMETRY_ID);
            if (single[i].hit.geomID != f->sphere || packet.hit.primID[i] != single[i].hit.primID) continue;
            assert_near((double)packet.ray.tfar[i], (double)single[i].ray.tfar, 1e-6);
            assert_near((double)packet.hit.u[i], (double)single[i].hit.u, 1e-6);
            assert_near((double)packet.hit.v[i], (double)single[i].hit.v, 1e-6);
            assert_near((double)packet.hit.Ng_y[i], (double)single[i].hit.Ng_y, 1e-6);
            assert_int_equal(packet.hit.instID[0][i], RTC_INVALID_GEOMETRY_ID);
        }
    }
}
#endif

/* Refuses hits whose normal faces the ray: what is left is seen from behind. */
static void refuse_front(const struct RTCFilterFunctionNArguments *args)
{
    const unsigned int n = args->N;
    const float *ray = (const float *)(const void *)args->ray, *hit = (const float *)(const void *)args->hit;
    for (unsigned int i = 0; i < n; i++) {
        float cosine =
            ray[4 * n + i] * hit[i] + ray[5 * n + i] * hit[n + i] + ray[6 * n + i] * hit[2 * n + i];
        if (cosine < 0.0f) args->valid[i] = 0;
    }
}

static void test_filters(void **state)
{
    fixture *f = *state;
    RTCScene scene = rtcNewScene(f->device);
    unsigned int id = knurl_embree_attach(f->device, scene, f->surface);
    RTCGeometry geometry = rtcGetGeometry(scene, id);
    rtcSetGeometryIntersectFilterFunction(geometry, refuse_front);
    rtcSetGeometryOccludedFilterFunction(geometry, refuse_front);
    rtcCommitGeometry(geometry);
    rtcCommitScene(scene);
    random_state random = {14};
    int behind = 0;
    for (int i = 0; i < RAYS; i++) {
        struct RTCRay ray = random_ray(&random);
        struct RTCRayHit rayhit = start(&ray);
        knurl_embree_intersect1(scene, NULL, &rayhit);
        /* The same by hand: walk through the hits until one is seen from behind. */
        knurl_ray same = as_knurl_ray(&ray);
        same.mask = 1;
        knurl_hit hit;
        bool found;
        double cosine = 0.0;
        while ((found = knurl_scene_intersect(f->scene, &same, &hit))) {
            cosine = 0.0;
            for (int k = 0; k < 3; k++) cosine += hit.ng[k] * same.direction[k];
            if (cosine >= 0.0) break;
            same.tmin = hit.t + 1e-9;
            if (!(same.tmin <= same.tmax)) {
                found = false;
                break;
            }
        }
        if (found && cosine < 1e-4) continue; /* a silhouette: front and back are a matter of rounding */
        assert_int_equal(found, rayhit.hit.geomID == id);
        struct RTCRay shadow = ray;
        knurl_embree_occluded1(scene, NULL, &shadow);
        assert_int_equal(found, shadow.tfar < 0.0f);
        if (!found) {
            assert_true(rayhit.ray.tfar == ray.tfar);
            continue;
        }
        assert_near((double)rayhit.ray.tfar, hit.t, 1e-6 * hit.t);
        behind++;
    }
    assert_true(behind > RAYS / 4);
    rtcReleaseScene(scene);
}

static void test_masks(void **state)
{
    fixture *f = *state;
    if (!rtcGetDeviceProperty(f->device, RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED)) skip();
    struct RTCRay ray = {.org_y = 3.0f, .dir_y = -1.0f, .tfar = INFINITY, .mask = 0x80000000u};
    struct RTCRayHit rayhit = start(&ray);
    knurl_embree_intersect1(f->plain, NULL, &rayhit);
    assert_int_equal(rayhit.hit.geomID, f->sphere); /* seen by every mask bit */
    RTCScene scene = rtcNewScene(f->device);
    unsigned int id = knurl_embree_attach(f->device, scene, f->surface);
    rtcSetGeometryMask(rtcGetGeometry(scene, id), 2);
    rtcCommitGeometry(rtcGetGeometry(scene, id));
    rtcCommitScene(scene);
    for (unsigned int mask = 1; mask <= 2; mask++) {
        ray.mask = mask;
        rayhit = start(&ray);
        knurl_embree_intersect1(scene, NULL, &rayhit);
        assert_int_equal(rayhit.hit.geomID, mask == 2 ? id : RTC_INVALID_GEOMETRY_ID);
    }
    rtcReleaseScene(scene);
}

/* Instanced in the foreign scene: instID comes from the query's context. */
static void test_instancing(void **state)
{
    fixture *f = *state;
    RTCScene scene = rtcNewScene(f->device);
    for (unsigned int i = 0; i < 3; i++) {
        RTCGeometry instance = rtcNewGeometry(f->device, RTC_GEOMETRY_TYPE_INSTANCE);
        const float m[12] = {1, 0, 0, 4.0f * (float)i, 0, 1, 0, 0, 0, 0, 1, 0};
        rtcSetGeometryInstancedScene(instance, f->plain);
        rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, m);
        rtcSetGeometryMask(instance, 0xFFFFFFFFu);
        rtcCommitGeometry(instance);
        rtcAttachGeometryByID(scene, instance, 10 + i);
        rtcReleaseGeometry(instance);
    }
    rtcCommitScene(scene);
    for (unsigned int i = 0; i < 3; i++) {
        struct RTCRay ray = {.org_x = 4.0f * (float)i + 0.1f,
                             .org_y = 3.0f,
                             .dir_y = -1.0f,
                             .tfar = INFINITY,
                             .mask = 0xFFFFFFFFu};
        struct RTCRayHit rayhit = start(&ray), local;
        knurl_embree_intersect1(scene, NULL, &rayhit);
        assert_int_equal(rayhit.hit.geomID, f->sphere);
        assert_int_equal(rayhit.hit.instID[0], 10 + i);
        ray.org_x = 0.1f;
        local = start(&ray);
        knurl_embree_intersect1(f->plain, NULL, &local);
        assert_near((double)rayhit.ray.tfar, (double)local.ray.tfar, 1e-5);
    }
    rtcReleaseScene(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_primitives),
        cmocka_unit_test(test_same_hits_as_scene),
        cmocka_unit_test(test_extended_context),
        cmocka_unit_test(test_cone),
#if KNURL_EMBREE_VERSION < 4
        cmocka_unit_test(test_packets),
#endif
        cmocka_unit_test(test_filters),
        cmocka_unit_test(test_masks),
        cmocka_unit_test(test_instancing),
    };
    int failed = cmocka_run_group_tests_name("fast", tests, setup_fast, teardown);
    return failed + cmocka_run_group_tests_name("rmip", tests, setup_rmip, teardown);
}
