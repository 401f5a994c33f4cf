/* Batches equal single rays, whatever the number of threads; stopping; errors of scene calls. */
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

enum { GRID = 24, RAYS = 20000 };

static knurl_context *new_context(int32_t threads)
{
    knurl_context *context;
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

/* A bumpy grid over [-1, 1]^2, with texture coordinates. */
static void make_grid(float *positions, float *texcoords, uint32_t *triangles, knurl_mesh_view *view)
{
    for (uint32_t y = 0; y <= GRID; y++)
        for (uint32_t x = 0; x <= GRID; x++) {
            uint32_t v = y * (GRID + 1) + x;
            float s = (float)x / GRID, t = (float)y / GRID;
            positions[3 * v] = 2 * s - 1;
            positions[3 * v + 1] = 0.1f * sinf(9 * s) * cosf(7 * t);
            positions[3 * v + 2] = 2 * t - 1;
            texcoords[2 * v] = s;
            texcoords[2 * v + 1] = t;
        }
    uint32_t n = 0;
    for (uint32_t y = 0; y < GRID; y++)
        for (uint32_t x = 0; x < GRID; x++) {
            uint32_t v = y * (GRID + 1) + x;
            memcpy(triangles + 3 * n++, (uint32_t[]){v, v + GRID + 1, v + 1}, 12);
            memcpy(triangles + 3 * n++, (uint32_t[]){v + 1, v + GRID + 1, v + GRID + 2}, 12);
        }
    *view = (knurl_mesh_view){.positions = positions,
                              .texcoords = texcoords,
                              .vertex_count = (GRID + 1) * (GRID + 1),
                              .triangles = triangles,
                              .triangle_count = n};
}

/* One mesh, one displaced surface of the same grid, and seven instances of the two. */
static knurl_scene *new_scene(knurl_context *context, const char *method)
{
    static float positions[(GRID + 1) * (GRID + 1) * 3], texcoords[(GRID + 1) * (GRID + 1) * 2];
    static uint32_t triangles[GRID * GRID * 6];
    knurl_scene *scene;
    knurl_surface_def def = knurl_surface_def_default();
    def.method = method;
    make_grid(positions, texcoords, triangles, &def.mesh);
    uint8_t samples[16 * 16];
    random_state random = {5};
    for (int i = 0; i < 256; i++) samples[i] = (uint8_t)random_bits(&random);
    knurl_image *image;
    assert_int_equal(knurl_image_create(context, 16, 16, 1, KNURL_PIXEL_U8, samples, &image, NULL), KNURL_OK);
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    assert_int_equal(knurl_heightmap_create(context, &map_def, &def.displacement.map, NULL), KNURL_OK);
    def.displacement.factor = 0.05;
    def.displacement.uv_scale[0] = 3.0;
    knurl_surface *surface;
    assert_int_equal(knurl_surface_create(context, &def, &surface, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_create(context, &scene, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_mesh(scene, &def.mesh, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(scene, surface, NULL, NULL), KNURL_OK);
    assert_ptr_equal(knurl_scene_surface(scene, 1), surface);
    assert_null(knurl_scene_surface(scene, 0));
    for (uint32_t i = 0; i < 7; i++) {
        double m[12];
        for (int k = 0; k < 12; k++) m[k] = random_range(&random, -0.3, 0.3) + (k % 5 == 0 ? 1.0 : 0.0);
        assert_int_equal(knurl_scene_add_instance(scene, i % 2, m, 1u << (i % 3), NULL, NULL), KNURL_OK);
    }
    assert_int_equal(knurl_scene_commit(scene, NULL), KNURL_OK);
    knurl_surface_release(surface);
    knurl_heightmap_release(def.displacement.map);
    knurl_image_release(image);
    return scene;
}

static knurl_ray *new_rays(void)
{
    knurl_ray *rays = malloc(RAYS * sizeof *rays);
    assert_non_null(rays);
    random_state random = {6};
    for (int i = 0; i < RAYS; i++) {
        double o[3], d[3];
        for (int k = 0; k < 3; k++) {
            o[k] = random_range(&random, -3.0, 3.0);
            d[k] = random_range(&random, -1.0, 1.0) - o[k];
        }
        rays[i] = knurl_ray_make(o, d);
        rays[i].mask = 1 + random_index(&random, 7);
        if (i % 7 == 0) rays[i].cone_spread = 0.02f;
        if (i % 5 == 0) rays[i].tmax = 1.0;
    }
    rays[3].direction[0] = NAN;
    memset(rays[4].direction, 0, sizeof rays[4].direction);
    rays[5].origin[1] = INFINITY;
    rays[6].tmin = 2.0, rays[6].tmax = 1.0;
    return rays;
}

/* Bit by bit, but for the padding. */
static void assert_same_hit(const knurl_hit *a, const knurl_hit *b)
{
    assert_int_equal(a->triangle, b->triangle);
    assert_int_equal(a->steps, b->steps);
    if (a->triangle == KNURL_NO_HIT) return;
    assert_int_equal(a->object, b->object);
    assert_int_equal(a->instance, b->instance);
    assert_memory_equal(&a->t, &b->t, sizeof a->t);
    assert_memory_equal(a->position, b->position, sizeof a->position);
    assert_memory_equal(a->ng, b->ng, sizeof a->ng);
    assert_memory_equal(a->ns, b->ns, sizeof a->ns);
    assert_memory_equal(a->uv, b->uv, sizeof a->uv);
    assert_memory_equal(a->st, b->st, sizeof a->st);
    assert_memory_equal(&a->error, &b->error, sizeof a->error);
}

static void compare_batches(const char *method)
{
    knurl_ray *rays = new_rays();
    knurl_hit *hits = malloc(RAYS * sizeof *hits), *first = malloc(RAYS * sizeof *first);
    uint8_t *occluded = malloc(RAYS);
    assert_true(hits && first && occluded);
    const int32_t threads[] = {1, 2, 7};
    for (int run = 0; run < 3; run++) {
        knurl_context *context = new_context(threads[run]);
        knurl_scene *scene = new_scene(context, method);
        size_t done = 0;
        assert_int_equal(knurl_scene_intersect_batch(scene, rays, RAYS, hits, NULL, NULL, &done, NULL),
                         KNURL_OK);
        assert_int_equal(done, RAYS);
        done = 0;
        assert_int_equal(knurl_scene_occluded_batch(scene, rays, RAYS, occluded, NULL, NULL, &done, NULL),
                         KNURL_OK);
        assert_int_equal(done, RAYS);
        int found = 0, displaced = 0;
        for (int i = 0; i < RAYS; i++) {
            knurl_hit hit;
            bool single = knurl_scene_intersect(scene, &rays[i], &hit);
            assert_same_hit(&hits[i], &hit);
            assert_int_equal(occluded[i], single);
            if (run > 0) assert_same_hit(&hits[i], &first[i]);
            found += single;
            displaced += single && hit.object == 1;
        }
        assert_true(found > RAYS / 4 && found < RAYS && displaced > RAYS / 16);
        for (int i = 3; i <= 6; i++) assert_int_equal(hits[i].triangle, KNURL_NO_HIT);
        if (run == 0) memcpy(first, hits, RAYS * sizeof *first);
        knurl_scene_release(scene);
        assert_true(knurl_context_bytes(context) == 0);
        knurl_context_release(context);
    }
    free(rays);
    free(hits);
    free(first);
    free(occluded);
}

static void test_batch_equals_single_for_any_threads(void **state)
{
    (void)state;
    compare_batches("fast");
    compare_batches("rmip");
}

typedef struct stopper {
    double last;
    double stop_at;
    int calls;
} stopper;

static bool on_progress(void *user, const char *stage, double fraction)
{
    stopper *s = user;
    assert_non_null(stage);
    assert_true(fraction >= s->last && fraction <= 1.0);
    s->last = fraction;
    s->calls++;
    return fraction < s->stop_at;
}

static void test_progress_and_stopping(void **state)
{
    (void)state;
    knurl_ray *rays = new_rays();
    knurl_hit *hits = malloc(RAYS * sizeof *hits);
    assert_non_null(hits);
    knurl_context *context = new_context(3);
    knurl_scene *scene = new_scene(context, "fast");
    stopper s = {.stop_at = 2.0};
    assert_int_equal(knurl_scene_intersect_batch(scene, rays, RAYS, hits, on_progress, &s, NULL, NULL),
                     KNURL_OK);
    assert_true(s.calls > 0 && s.last == 1.0);
    for (int i = 0; i < RAYS; i++) hits[i].triangle = KNURL_NO_HIT - 1;
    s = (stopper){.stop_at = 0.3};
    size_t done;
    knurl_error error;
    assert_int_equal(knurl_scene_intersect_batch(scene, rays, RAYS, hits, on_progress, &s, &done, &error),
                     KNURL_INTERRUPTED);
    assert_true(done > 0 && done <= RAYS);
    for (size_t i = 0; i < done; i++) {
        knurl_hit hit;
        (void)knurl_scene_intersect(scene, &rays[i], &hit);
        assert_same_hit(&hits[i], &hit);
    }
    s = (stopper){.stop_at = 2.0};
    done = 99;
    assert_int_equal(knurl_scene_occluded_batch(scene, NULL, 0, NULL, on_progress, &s, &done, NULL),
                     KNURL_OK);
    assert_int_equal(done, 0);
    knurl_scene_release(scene);
    knurl_context_release(context);
    free(rays);
    free(hits);
}

static void test_memory(void **state)
{
    (void)state;
    knurl_context *context = new_context(1);
    knurl_scene *scene = new_scene(context, "rmip"); /* shells in a hierarchy of Embree's */
    knurl_scene_memory memory = knurl_scene_get_memory(scene);
    knurl_surface_info info;
    knurl_surface_get_info(knurl_scene_surface(scene, 1), &info);
    uint64_t plain = (GRID + 1) * (GRID + 1) * 5 * sizeof(float) + GRID * GRID * 6 * sizeof(uint32_t);
    assert_int_equal(memory.mesh, info.mesh_bytes + plain);
    assert_int_equal(memory.shells, info.shell_bytes);
    assert_int_equal(memory.maps, info.map_bytes);
    /* A hierarchy over 2 x 1,152 boxes: more than the boxes, less than 20 times that. */
    assert_true(memory.bvh > 2304 * 24 && memory.bvh < 2304 * 24 * 20);
    knurl_scene_release(scene);
    knurl_context_release(context);
}

static void test_shared_maps_count_once(void **state)
{
    (void)state;
    knurl_context *context = new_context(1);
    const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    const uint32_t triangles[] = {0, 1, 2};
    knurl_image *image;
    assert_int_equal(knurl_image_create(context, 64, 64, 1, KNURL_PIXEL_U8, NULL, &image, NULL), KNURL_OK);
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    knurl_surface_def def = knurl_surface_def_default();
    assert_int_equal(knurl_heightmap_create(context, &map_def, &def.displacement.map, NULL), KNURL_OK);
    def.mesh = (knurl_mesh_view){.positions = positions,
                                 .normals = normals,
                                 .vertex_count = 3,
                                 .triangles = triangles,
                                 .triangle_count = 1};
    knurl_surface *a, *b;
    assert_int_equal(knurl_surface_create(context, &def, &a, NULL), KNURL_OK);
    assert_int_equal(knurl_surface_create(context, &def, &b, NULL), KNURL_OK);
    knurl_scene *scene;
    assert_int_equal(knurl_scene_create(context, &scene, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(scene, a, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(scene, b, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(scene, b, NULL, NULL), KNURL_OK);
    knurl_surface_info info;
    knurl_surface_get_info(a, &info);
    knurl_scene_memory memory = knurl_scene_get_memory(scene);
    assert_int_equal(memory.maps, info.map_bytes);
    assert_int_equal(memory.mesh, 2 * info.mesh_bytes);
    knurl_surface_release(a);
    knurl_surface_release(b);
    knurl_scene_release(scene);
    knurl_heightmap_release(def.displacement.map);
    knurl_image_release(image);
    assert_true(knurl_context_bytes(context) == 0);
    knurl_context_release(context);
}

static void expect(knurl_status status, knurl_status expected, const knurl_error *error, const char *part)
{
    assert_int_equal(status, expected);
    if (!strstr(error->message, part)) print_message("\"%s\" lacks \"%s\"\n", error->message, part);
    assert_non_null(strstr(error->message, part));
}

static void test_errors(void **state)
{
    (void)state;
    knurl_context *context = new_context(1);
    knurl_error error = {0};
    knurl_scene *scene;
    expect(knurl_scene_create(NULL, &scene, &error), KNURL_ERROR_ARGUMENT, &error, "context");
    assert_int_equal(knurl_scene_create(context, &scene, &error), KNURL_OK);
    float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    uint32_t triangles[] = {0, 1, 2};
    knurl_mesh_view mesh = {
        .positions = positions, .vertex_count = 3, .triangles = triangles, .triangle_count = 1};
    positions[4] = NAN;
    expect(knurl_scene_add_mesh(scene, &mesh, NULL, &error), KNURL_ERROR_INPUT, &error, "vertex 1");
    positions[4] = 0;
    triangles[2] = 3;
    expect(knurl_scene_add_mesh(scene, &mesh, NULL, &error), KNURL_ERROR_INPUT, &error, "is 3");
    triangles[2] = 2;
    mesh.positions = NULL;
    expect(knurl_scene_add_mesh(scene, &mesh, NULL, &error), KNURL_ERROR_ARGUMENT, &error, "positions");
    mesh.positions = positions;
    expect(knurl_scene_add_mesh(scene, NULL, NULL, &error), KNURL_ERROR_ARGUMENT, &error, "mesh");
    expect(knurl_scene_add_surface(scene, NULL, NULL, &error), KNURL_ERROR_ARGUMENT, &error, "surface");
    assert_int_equal(knurl_scene_object_count(scene), 0);
    expect(knurl_scene_add_instance(scene, 0, NULL, 1, NULL, &error), KNURL_ERROR_ARGUMENT, &error,
           "object is 0");
    uint32_t object = 7;
    assert_int_equal(knurl_scene_add_mesh(scene, &mesh, &object, &error), KNURL_OK);
    assert_int_equal(object, 0);
    double m[12] = {1, 0, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0};
    expect(knurl_scene_add_instance(scene, 0, m, 1, NULL, &error), KNURL_ERROR_ARGUMENT, &error, "singular");
    m[10] = NAN;
    expect(knurl_scene_add_instance(scene, 0, m, 1, NULL, &error), KNURL_ERROR_ARGUMENT, &error, "singular");
    assert_int_equal(knurl_scene_instance_count(scene), 0);
    assert_int_equal(knurl_scene_add_instance(scene, 0, NULL, 1, NULL, &error), KNURL_OK);
    knurl_ray ray = knurl_ray_make((const double[3]){0.2, 0.2, 1}, (const double[3]){0, 0, -1});
    knurl_hit hit;
    assert_false(knurl_scene_intersect(scene, &ray, &hit)); /* not committed */
    expect(knurl_scene_intersect_batch(scene, &ray, 1, &hit, NULL, NULL, NULL, &error), KNURL_ERROR_ARGUMENT,
           &error, "committed");
    assert_int_equal(knurl_scene_commit(scene, &error), KNURL_OK);
    assert_true(knurl_scene_intersect(scene, &ray, &hit));
    expect(knurl_scene_intersect_batch(scene, &ray, 1, NULL, NULL, NULL, NULL, &error), KNURL_ERROR_ARGUMENT,
           &error, "output");
    expect(knurl_scene_commit(scene, &error), KNURL_ERROR_ARGUMENT, &error, "committed");
    expect(knurl_scene_add_mesh(scene, &mesh, NULL, &error), KNURL_ERROR_ARGUMENT, &error, "committed");
    expect(knurl_scene_add_instance(scene, 0, NULL, 1, NULL, &error), KNURL_ERROR_ARGUMENT, &error,
           "committed");
    knurl_scene_release(scene);
    knurl_scene_release(NULL);
    knurl_context_release(context);
}

static void test_empty(void **state)
{
    (void)state;
    knurl_context *context = new_context(2);
    for (int kind = 0; kind < 3; kind++) {
        knurl_scene *scene;
        assert_int_equal(knurl_scene_create(context, &scene, NULL), KNURL_OK);
        /* Nothing; a mesh of nothing; triangles without area, often enough for a top level. */
        const float positions[] = {0, 0, 0, 1, 1, 1, 2, 2, 2};
        const uint32_t triangles[] = {0, 1, 2, 0, 0, 1};
        knurl_mesh_view mesh = {.positions = positions,
                                .vertex_count = kind == 2 ? 3 : 0,
                                .triangles = triangles,
                                .triangle_count = kind == 2 ? 2 : 0};
        if (kind > 0) assert_int_equal(knurl_scene_add_mesh(scene, &mesh, NULL, NULL), KNURL_OK);
        for (int i = 0; kind > 0 && i < 6; i++)
            assert_int_equal(knurl_scene_add_instance(scene, 0, NULL, 1, NULL, NULL), KNURL_OK);
        assert_int_equal(knurl_scene_commit(scene, NULL), KNURL_OK);
        double lower[3], upper[3];
        knurl_scene_bounds(scene, lower, upper);
        assert_true(lower[0] > upper[0]);
        knurl_ray ray = knurl_ray_make((const double[3]){0.5, 0.5, 2}, (const double[3]){0, 0, -1});
        knurl_hit hit;
        assert_false(knurl_scene_intersect(scene, &ray, &hit));
        assert_int_equal(hit.triangle, KNURL_NO_HIT);
        assert_false(knurl_scene_occluded(scene, &ray));
        knurl_scene_release(scene);
    }
    assert_true(knurl_context_bytes(context) == 0);
    knurl_context_release(context);
}

/* Every allocation fails once, at each place in turn: an error each time, and nothing leaks. */
typedef struct failing {
    int left;
    long long live;
} failing;

static void *failing_reallocate(void *user, void *p, size_t old_size, size_t new_size, size_t alignment)
{
    failing *f = user;
    if (new_size == 0) {
        f->live -= p != NULL;
        free(p);
        return NULL;
    }
    if (f->left-- == 0) return NULL;
    void *made = NULL;
    if (posix_memalign(&made, alignment, new_size) != 0) return NULL;
    if (p) {
        memcpy(made, p, old_size < new_size ? old_size : new_size);
        free(p);
    } else {
        f->live++;
    }
    return made;
}

static knurl_status build_small(knurl_context *context)
{
    const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint32_t triangles[] = {0, 1, 2};
    knurl_mesh_view mesh = {.positions = positions,
                            .normals = positions,
                            .texcoords = positions,
                            .vertex_count = 3,
                            .triangles = triangles,
                            .triangle_count = 1};
    knurl_scene *scene;
    knurl_status status = knurl_scene_create(context, &scene, NULL);
    if (status == KNURL_OK) status = knurl_scene_add_mesh(scene, &mesh, NULL, NULL);
    for (int i = 0; i < 9 && status == KNURL_OK; i++)
        status = knurl_scene_add_instance(scene, 0, NULL, 1, NULL, NULL);
    if (status == KNURL_OK) status = knurl_scene_commit(scene, NULL);
    knurl_scene_release(scene);
    return status;
}

static void test_out_of_memory(void **state)
{
    (void)state;
    failing f = {.left = -1};
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    def.reallocate = failing_reallocate;
    def.allocator_user = &f;
    int failures = 0;
    for (int n = 0; n < 100; n++) {
        knurl_context *context;
        f.left = -1;
        assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
        f.left = n;
        knurl_status status = build_small(context);
        bool reached = f.left < 0;
        knurl_context_release(context);
        assert_true(f.live == 0);
        if (!reached) break;
        assert_int_equal(status, KNURL_ERROR_MEMORY);
        failures++;
    }
    assert_true(failures > 8 && failures < 100);
}

static void test_memory_limit_counts_embree(void **state)
{
    (void)state;
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    def.memory_limit = 4 << 20; /* the mesh's 3 MB fit; with its hierarchy they do not */
    knurl_context *context;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    enum { COUNT = 60000 };
    float *positions = calloc(COUNT * 9, sizeof *positions);
    uint32_t *triangles = calloc(COUNT * 3, sizeof *triangles);
    assert_true(positions && triangles);
    for (uint32_t i = 0; i < COUNT; i++) {
        positions[9 * i] = positions[9 * i + 3] = (float)(i % 300);
        positions[9 * i + 1] = positions[9 * i + 7] = (float)(i / 300);
        positions[9 * i + 8] = 0.5f;
        for (uint32_t k = 0; k < 3; k++) triangles[3 * i + k] = 3 * i + k;
    }
    knurl_mesh_view mesh = {
        .positions = positions, .vertex_count = 3 * COUNT, .triangles = triangles, .triangle_count = COUNT};
    knurl_scene *scene;
    knurl_error error;
    assert_int_equal(knurl_scene_create(context, &scene, &error), KNURL_OK);
    assert_int_equal(knurl_scene_add_mesh(scene, &mesh, NULL, &error), KNURL_OK);
    assert_int_equal(knurl_scene_add_instance(scene, 0, NULL, 1, NULL, &error), KNURL_OK);
    expect(knurl_scene_commit(scene, &error), KNURL_ERROR_MEMORY, &error, "object 0");
    knurl_scene_release(scene);
    knurl_context_release(context);
    free(positions);
    free(triangles);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_batch_equals_single_for_any_threads),
        cmocka_unit_test(test_progress_and_stopping),
        cmocka_unit_test(test_memory),
        cmocka_unit_test(test_shared_maps_count_once),
        cmocka_unit_test(test_errors),
        cmocka_unit_test(test_empty),
        cmocka_unit_test(test_out_of_memory),
        cmocka_unit_test(test_memory_limit_counts_embree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
