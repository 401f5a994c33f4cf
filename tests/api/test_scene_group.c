/* Batches in scenes of one to four instances, where rays are traced together: hits are those of single calls,
 * bit for bit, for every method with shells; nearly so for facets. Surfaces of one shell need no hierarchy.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/scene.h>

#include "support/random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { GRID = 8, RAYS = 3000, MAP = 32 };

static knurl_context *new_context(int32_t threads)
{
    knurl_context *context;
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

/* A bumpy grid over [-1, 1]^2. */
typedef struct grid {
    float positions[(GRID + 1) * (GRID + 1) * 3], texcoords[(GRID + 1) * (GRID + 1) * 2];
    uint32_t triangles[GRID * GRID * 6];
    knurl_mesh_view view;
} grid;

static void make_grid(grid *g)
{
    uint32_t n = 0;
    for (uint32_t v = 0; v < (GRID + 1) * (GRID + 1); v++) {
        float s = (float)(v % (GRID + 1)) / GRID, t = (float)(v / (GRID + 1)) / GRID;
        memcpy(g->positions + 3 * v, (float[]){2 * s - 1, 0.1f * sinf(9 * s) * cosf(7 * t), 2 * t - 1}, 12);
        memcpy(g->texcoords + 2 * v, (float[]){s, t}, 8);
    }
    for (uint32_t i = 0; i < GRID * GRID; i++) {
        uint32_t v = i / GRID * (GRID + 1) + i % GRID;
        memcpy(g->triangles + 3 * n++, (uint32_t[]){v, v + GRID + 1, v + 1}, 12);
        memcpy(g->triangles + 3 * n++, (uint32_t[]){v + 1, v + GRID + 1, v + GRID + 2}, 12);
    }
    g->view = (knurl_mesh_view){.positions = g->positions,
                                .texcoords = g->texcoords,
                                .vertex_count = (GRID + 1) * (GRID + 1),
                                .triangles = g->triangles,
                                .triangle_count = n};
}

static knurl_surface *new_surface(knurl_context *context, const knurl_mesh_view *mesh, const char *method)
{
    uint8_t samples[MAP * MAP];
    random_state random = {5};
    for (int i = 0; i < MAP * MAP; i++) samples[i] = (uint8_t)random_bits(&random);
    knurl_image *image;
    assert_int_equal(knurl_image_create(context, MAP, MAP, 1, KNURL_PIXEL_U8, samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    knurl_surface_def def = knurl_surface_def_default();
    assert_int_equal(knurl_heightmap_create(context, &map_def, &def.displacement.map, NULL), KNURL_OK);
    def.mesh = *mesh;
    def.displacement.factor = 0.1;
    def.method = method;
    knurl_surface *surface;
    assert_int_equal(knurl_surface_create(context, &def, &surface, NULL), KNURL_OK);
    knurl_heightmap_release(def.displacement.map);
    knurl_image_release(image);
    return surface;
}

/* Object 0 is the surface, object 1 a plain mesh. The last two of four instances are of the mesh, at the same
 * place. */
static knurl_scene *new_scene(knurl_context *context, knurl_surface *surface, const knurl_mesh_view *mesh,
                              uint32_t instances)
{
    static const uint32_t masks[] = {7, 6, 5, 7};
    const uint32_t objects[] = {0, instances == 3 ? 0 : 1, 1, 1};
    knurl_scene *scene;
    random_state random = {instances};
    double m[12];
    assert_int_equal(knurl_scene_create(context, &scene, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(scene, surface, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_mesh(scene, mesh, NULL, NULL), KNURL_OK);
    for (uint32_t i = 0; i < instances; i++) {
        for (int k = 0; k < 12 && i < 3; k++)
            m[k] = random_range(&random, -0.3, 0.3) + (k % 5 == 0 ? 1.0 : 0.0);
        const double *place = instances == 1 ? NULL : m;
        assert_int_equal(knurl_scene_add_instance(scene, objects[i], place, masks[i], NULL, NULL), KNURL_OK);
    }
    assert_int_equal(knurl_scene_commit(scene, NULL), KNURL_OK);
    return scene;
}

/* Rays of all kinds; every third block of 16 shares an origin and looks one way. */
static void make_rays(knurl_ray *rays)
{
    random_state random = {6};
    double o[3] = {0}, d[3], target[3] = {0};
    for (int i = 0; i < RAYS; i++) {
        const bool alike = i / 16 % 3 == 0;
        for (int k = 0; k < 3; k++) {
            if (!alike || i % 16 == 0) {
                o[k] = random_range(&random, -3.0, 3.0);
                target[k] = random_range(&random, -1.0, 1.0);
            }
            d[k] = target[k] - o[k] + (alike ? random_range(&random, -0.05, 0.05) : 0.0);
        }
        rays[i] = knurl_ray_make(o, d);
        rays[i].mask = 1 + random_index(&random, 7);
        if (i % 7 == 0) rays[i].cone_spread = 0.02f;
        if (i % 11 == 0) rays[i].lod = 1.25f;
        if (i % 5 == 0) rays[i].tmax = 1.0;
        if (i % 13 == 0) rays[i].tmin = 0.9;
    }
    rays[3].direction[0] = NAN;
    memset(rays[4].direction, 0, sizeof rays[4].direction);
    rays[5].origin[1] = -INFINITY;
    rays[6].tmin = 2.0, rays[6].tmax = 1.0;
    rays[7].origin[0] = 1e300;
    rays[8].direction[1] = 1e-310;
    rays[9].tmax = INFINITY;
}

/* Methods with hierarchies of their own take rays together: they share steps, and last bits may differ. */
static void assert_same_hit(const knurl_hit *a, const knurl_hit *b, bool whole)
{
    assert_int_equal(a->triangle, b->triangle);
    if (!whole) assert_int_equal(a->steps, b->steps);
    if (a->triangle == KNURL_NO_HIT) return;
    if (!whole) {
        assert_memory_equal(a, b, sizeof *a); /* there is no padding */
        return;
    }
    assert_int_equal(a->instance, b->instance);
    assert_int_equal(a->object, b->object);
    assert_true(fabs(a->t - b->t) <= 1e-12 * fabs(b->t));
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(a->position[i] - b->position[i]) <= a->error + b->error);
        assert_true(fabs(a->ns[i] - b->ns[i]) <= 1e-6);
    }
}

_Static_assert(sizeof(knurl_hit) == 18 * sizeof(double) + 4 * sizeof(uint32_t), "knurl_hit has padding");

typedef struct buffers {
    knurl_ray rays[RAYS];
    knurl_hit hits[RAYS];
    uint8_t occluded[RAYS];
} buffers;

/* Number of hits. */
static int compare(const knurl_scene *scene, bool whole, buffers *b)
{
    int found = 0;
    assert_int_equal(knurl_scene_intersect_batch(scene, b->rays, RAYS, b->hits, NULL, NULL, NULL, NULL),
                     KNURL_OK);
    assert_int_equal(knurl_scene_occluded_batch(scene, b->rays, RAYS, b->occluded, NULL, NULL, NULL, NULL),
                     KNURL_OK);
    for (int i = 0; i < RAYS; i++) {
        knurl_hit hit;
        bool single = knurl_scene_intersect(scene, &b->rays[i], &hit);
        assert_same_hit(&b->hits[i], &hit, whole);
        assert_int_equal(b->occluded[i], knurl_scene_occluded(scene, &b->rays[i]));
        found += single;
    }
    return found;
}

static void test_equal_single_calls(void **state)
{
    (void)state;
    static grid g;
    make_grid(&g);
    buffers *b = malloc(sizeof *b);
    assert_non_null(b);
    make_rays(b->rays);
    for (int32_t index = 0; index < knurl_method_count(); index++) {
        if (knurl_method_flags(index) & KNURL_METHOD_NATIVE) continue;
        knurl_context *context = new_context(1 + index % 3);
        knurl_surface *surface = new_surface(context, &g.view, knurl_method_name(index));
        for (uint32_t instances = 1; instances <= 4; instances++) {
            knurl_scene *scene = new_scene(context, surface, &g.view, instances);
            int found = compare(scene, (knurl_method_flags(index) & KNURL_METHOD_WHOLE) != 0, b), later = 0;
            assert_true(found > RAYS / 8 && found < RAYS);
            for (int i = 0; i < RAYS; i++)
                later += b->hits[i].triangle != KNURL_NO_HIT && b->hits[i].instance + 1 == instances;
            assert_true(later > 0);
            for (int i = 3; i <= 6; i++) assert_int_equal(b->hits[i].triangle, KNURL_NO_HIT);
            knurl_scene_release(scene);
        }
        knurl_surface_release(surface);
        knurl_context_release(context);
    }
    free(b);
}

/* Two instances at one place: the lower number counts, unless it is masked out. */
static void test_ties(void **state)
{
    (void)state;
    static grid g;
    make_grid(&g);
    buffers *b = malloc(sizeof *b);
    assert_non_null(b);
    make_rays(b->rays);
    knurl_context *context = new_context(2);
    knurl_surface *surface = new_surface(context, &g.view, "rmip");
    knurl_scene *scene = new_scene(context, surface, &g.view, 4);
    assert_true(compare(scene, false, b) > 0);
    int lower = 0, upper = 0;
    for (int i = 0; i < RAYS; i++) {
        if (b->hits[i].triangle == KNURL_NO_HIT || b->hits[i].instance < 2) continue;
        const bool masked = !(b->rays[i].mask & 5); /* instance 2 */
        assert_int_equal(b->hits[i].instance, masked ? 3 : 2);
        lower += !masked;
        upper += masked;
    }
    assert_true(lower > 20 && upper > 20);
    knurl_scene_release(scene);
    knurl_surface_release(surface);
    knurl_context_release(context);
    free(b);
}

/* A surface that is one shell: no hierarchy, and the hits that the shell itself gives. */
static void test_one_shell(void **state)
{
    (void)state;
    static grid g;
    make_grid(&g);
    buffers *b = malloc(sizeof *b);
    assert_non_null(b);
    make_rays(b->rays);
    const uint32_t triangles[] = {0, GRID * (GRID + 1), GRID};
    knurl_mesh_view one = g.view;
    one.triangles = triangles;
    one.triangle_count = 1;
    knurl_context *context = new_context(2);
    for (int32_t index = 0; index < knurl_method_count(); index++) {
        if (knurl_method_flags(index) & KNURL_METHOD_NATIVE) continue;
        knurl_surface *surface = new_surface(context, &one, knurl_method_name(index));
        assert_int_equal(knurl_surface_shell_count(surface), 1);
        knurl_scene *scene;
        assert_int_equal(knurl_scene_create(context, &scene, NULL), KNURL_OK);
        assert_int_equal(knurl_scene_add_surface(scene, surface, NULL, NULL), KNURL_OK);
        assert_int_equal(knurl_scene_add_instance(scene, 0, NULL, 7, NULL, NULL), KNURL_OK);
        assert_int_equal(knurl_scene_commit(scene, NULL), KNURL_OK);
        assert_true(knurl_scene_get_memory(scene).bvh == 0);
        int found = compare(scene, (knurl_method_flags(index) & KNURL_METHOD_WHOLE) != 0, b);
        assert_true(found > RAYS / 20 && found < RAYS);
        for (int i = 10; i < RAYS; i++) {
            const knurl_ray *ray = &b->rays[i];
            if (ray->cone_spread > 0 || isfinite(ray->tmax)) continue; /* else the box would end it */
            knurl_hit hit = {.triangle = KNURL_NO_HIT};
            bool expected = knurl_surface_intersect(surface, 0, ray, &hit);
            assert_int_equal(b->hits[i].triangle != KNURL_NO_HIT, expected);
            if (expected) assert_true(fabs(b->hits[i].t - hit.t) <= 1e-12);
        }
        knurl_scene_release(scene);
        knurl_surface_release(surface);
    }
    assert_true(knurl_context_bytes(context) == 0);
    knurl_context_release(context);
    free(b);
}

/* Facets in packets: what Embree's rounding makes of a ray may differ in the last bits, and at outlines. */
static void test_facets(void **state)
{
    (void)state;
    static grid g;
    make_grid(&g);
    buffers *b = malloc(sizeof *b);
    assert_non_null(b);
    make_rays(b->rays);
    static const char *const methods[] = {"tessellation", "tessellation:primitive=grids"};
    for (int m = 0; m < 2; m++) {
        knurl_context *context = new_context(2);
        knurl_surface *surface = new_surface(context, &g.view, methods[m]);
        for (uint32_t instances = 1; instances <= 4; instances += 3) {
            knurl_scene *scene = new_scene(context, surface, &g.view, instances);
            assert_int_equal(
                knurl_scene_intersect_batch(scene, b->rays, RAYS, b->hits, NULL, NULL, NULL, NULL), KNURL_OK);
            assert_int_equal(
                knurl_scene_occluded_batch(scene, b->rays, RAYS, b->occluded, NULL, NULL, NULL, NULL),
                KNURL_OK);
            int found = 0, different = 0;
            for (int i = 0; i < RAYS; i++) {
                knurl_hit hit;
                bool single = knurl_scene_intersect(scene, &b->rays[i], &hit);
                bool together = b->hits[i].triangle != KNURL_NO_HIT;
                found += single;
                different += single != together || b->occluded[i] != single ||
                             (single && fabs(hit.t - b->hits[i].t) > 1e-5);
            }
            assert_true(found > RAYS / 8 && found < RAYS);
            assert_true(different <= RAYS / 500);
            knurl_scene_release(scene);
        }
        knurl_surface_release(surface);
        knurl_context_release(context);
    }
    free(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equal_single_calls),
        cmocka_unit_test(test_ties),
        cmocka_unit_test(test_one_shell),
        cmocka_unit_test(test_facets),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
