/* Edits of a height map under surfaces and scenes: afterwards they are as good as new. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/knurl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/random.h"

static const double PI = 3.14159265358979323846;

static knurl_context *make_context(int32_t threads)
{
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    knurl_context *context = NULL;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

/* ---- Maps ---------------------------------------------------------------------------------------------- */

typedef struct canvas {
    int32_t width, height;
    knurl_pixel_format format;
    unsigned char *samples;
} canvas;

static void put(const canvas *c, int32_t x, int32_t y, double value)
{
    size_t i = (size_t)y * (size_t)c->width + (size_t)x;
    value = value < 0.0 ? 0.0 : value;
    if (c->format != KNURL_PIXEL_F32 && value > 1.0) value = 1.0;
    if (c->format == KNURL_PIXEL_U8)
        c->samples[i] = (uint8_t)(255.0 * value);
    else if (c->format == KNURL_PIXEL_U16)
        ((uint16_t *)(void *)c->samples)[i] = (uint16_t)(65535.0 * value);
    else
        ((float *)(void *)c->samples)[i] = (float)value;
}

typedef struct rect {
    int32_t x, y, width, height;
} rect;

/* Noise in [low, high], or one value of it for all. */
static void paint(const canvas *c, const rect *r, double low, double high, bool constant,
                  random_state *random)
{
    double value = random_range(random, low, high);
    for (int32_t y = r->y; y < r->y + r->height; y++)
        for (int32_t x = r->x; x < r->x + r->width; x++) {
            if (!constant) value = random_range(random, low, high);
            put(c, x, y, value);
        }
}

static canvas make_canvas(int32_t width, int32_t height, knurl_pixel_format format, random_state *random)
{
    canvas c = {width, height, format, malloc((size_t)width * (size_t)height * (size_t)format)};
    assert_non_null(c.samples);
    /* Calm and rough places, and one level of zeros. */
    paint(&c, &(rect){0, 0, width, height}, 0.3, 0.5, false, random);
    paint(&c, &(rect){0, 0, width / 3, height}, 0.0, 0.0, true, random);
    paint(&c, &(rect){width / 2, 0, width - width / 2, height / 2}, 0.2, 0.8, false, random);
    return c;
}

static knurl_heightmap *make_map(knurl_context *context, const canvas *c)
{
    knurl_image *image = NULL;
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_image_create(context, c->width, c->height, 1, c->format, c->samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    return map;
}

static rect random_rect(const canvas *c, random_state *random)
{
    if (random_index(random, 8) == 0) return (rect){0, 0, c->width, c->height};
    uint32_t most = random_index(random, 3) == 0 ? UINT32_MAX : 9;
    rect r;
    r.x = (int32_t)random_index(random, (uint32_t)c->width);
    r.y = (int32_t)random_index(random, (uint32_t)c->height);
    if (random_index(random, 4) == 0) r.x = 0;
    if (random_index(random, 4) == 0) r.y = 0;
    uint32_t w = (uint32_t)(c->width - r.x), h = (uint32_t)(c->height - r.y);
    r.width = 1 + (int32_t)random_index(random, w < most ? w : most);
    r.height = 1 + (int32_t)random_index(random, h < most ? h : most);
    return r;
}

/* Paints and tells the map. */
static rect edit(const canvas *c, knurl_heightmap *map, double most, random_state *random)
{
    rect r = random_rect(c, random);
    double high = random_index(random, 3) == 0 ? most : 0.5, low = random_index(random, 2) == 0 ? 0.0 : 0.3;
    paint(c, &r, low, high, random_index(random, 3) == 0, random);
    size_t row = (size_t)c->width * (size_t)c->format;
    assert_int_equal(knurl_heightmap_update(map, r.x, r.y, r.width, r.height,
                                            c->samples + (size_t)r.y * row + (size_t)r.x * (size_t)c->format,
                                            row, NULL),
                     KNURL_OK);
    return r;
}

/* ---- Surfaces ------------------------------------------------------------------------------------------ */

enum { COLUMNS = 9, ROWS = 6, VERTICES = (COLUMNS + 1) * (ROWS + 1) };

typedef struct mesh {
    float positions[3 * VERTICES], texcoords[2 * VERTICES];
    uint32_t triangles[6 * COLUMNS * ROWS];
} mesh;

/* A torus: closed, every normal, no poles. */
static void make_mesh(mesh *m)
{
    for (uint32_t j = 0; j <= ROWS; j++)
        for (uint32_t i = 0; i <= COLUMNS; i++) {
            uint32_t v = j * (COLUMNS + 1) + i;
            double a = 2.0 * PI * (i % COLUMNS) / COLUMNS, b = 2.0 * PI * (j % ROWS) / ROWS;
            m->positions[3 * v] = (float)((1.0 + 0.4 * cos(b)) * cos(a));
            m->positions[3 * v + 1] = (float)(0.4 * sin(b));
            m->positions[3 * v + 2] = (float)((1.0 + 0.4 * cos(b)) * sin(a));
            m->texcoords[2 * v] = (float)i / COLUMNS;
            m->texcoords[2 * v + 1] = (float)j / ROWS;
        }
    uint32_t *t = m->triangles;
    for (uint32_t j = 0; j < ROWS; j++)
        for (uint32_t i = 0; i < COLUMNS; i++) {
            uint32_t a = j * (COLUMNS + 1) + i, c = a + COLUMNS + 1;
            const uint32_t both[6] = {a, a + 1, c + 1, a, c + 1, c};
            memcpy(t, both, sizeof both);
            t += 6;
        }
}

static knurl_surface_def make_def(const mesh *m, const char *method)
{
    knurl_surface_def def = knurl_surface_def_default();
    def.method = method;
    def.mesh = (knurl_mesh_view){.positions = m->positions,
                                 .texcoords = m->texcoords,
                                 .vertex_count = VERTICES,
                                 .triangles = m->triangles,
                                 .triangle_count = 2 * COLUMNS * ROWS};
    def.displacement.factor = 0.1;
    return def;
}

static void random_placement(knurl_displacement *d, random_state *random)
{
    static const double scales[] = {1.0, 1.0, 0.2, 3.7, -2.0, 8.0};
    static const double factors[] = {0.1, 0.1, -0.1, 0.4};
    d->wrap_u = (knurl_wrap)random_index(random, 3);
    d->wrap_v = (knurl_wrap)random_index(random, 3);
    d->uv_scale[0] = scales[random_index(random, 6)];
    d->uv_scale[1] = scales[random_index(random, 6)];
    if (random_index(random, 2)) {
        d->uv_offset[0] = random_range(random, -3.0, 3.0);
        d->uv_offset[1] = random_range(random, -3.0, 3.0);
    }
    if (random_index(random, 3) == 0) d->uv_rotation = random_range(random, -3.0, 3.0);
    d->factor = factors[random_index(random, 4)];
    d->offset = random_index(random, 3) == 0 ? -0.05 : 0.0;
    d->unnormalised = random_index(random, 4) == 0;
}

static knurl_surface *make_surface(knurl_context *context, const knurl_surface_def *def)
{
    knurl_surface *surface = NULL;
    knurl_error error = {0};
    if (knurl_surface_create(context, def, &surface, &error) != KNURL_OK) fail_msg("%s", error.message);
    return surface;
}

static knurl_scene *make_scene(knurl_context *context, knurl_surface *const surfaces[2], int instances)
{
    knurl_scene *scene = NULL;
    assert_int_equal(knurl_scene_create(context, &scene, NULL), KNURL_OK);
    for (int i = 0; i < 2; i++)
        assert_int_equal(knurl_scene_add_surface(scene, surfaces[i], NULL, NULL), KNURL_OK);
    for (int i = 0; i < instances; i++) {
        double c = cos(i), s = sin(i);
        const double place[12] = {c, s, 0, 2.5 * i, -s, c, 0, 0.3 * i, 0, 0, 1, 0.1 * i};
        assert_int_equal(
            knurl_scene_add_instance(scene, (uint32_t)i % 2, i ? place : NULL, UINT32_MAX, NULL, NULL),
            KNURL_OK);
    }
    assert_int_equal(knurl_scene_commit(scene, NULL), KNURL_OK);
    return scene;
}

/* ---- Comparison ---------------------------------------------------------------------------------------- */

/* From around towards points near the surface; some start in the shell. */
static knurl_ray random_ray(double reach, float lod, random_state *random)
{
    double a = random_range(random, 0.0, 2.0 * PI), b = random_range(random, 0.0, 2.0 * PI), r = 0.45;
    double target[3] = {(1.0 + r * cos(b)) * cos(a), r * sin(b), (1.0 + r * cos(b)) * sin(a)}, from[3], to[3];
    double away = random_index(random, 4) == 0 ? 0.3 : reach;
    for (int k = 0; k < 3; k++) {
        from[k] = target[k] + random_range(random, -away, away);
        to[k] = target[k] + random_range(random, -0.1, 0.1) - from[k];
    }
    knurl_ray ray = knurl_ray_make(from, to);
    ray.lod = lod;
    return ray;
}

/* The nearest of all shells. */
static bool trace(const knurl_surface *surface, const knurl_ray *ray, knurl_hit *hit)
{
    knurl_ray r = *ray;
    bool found = false;
    memset(hit, 0, sizeof *hit);
    for (uint32_t i = 0; i < knurl_surface_shell_count(surface); i++) {
        if (!knurl_surface_intersect(surface, i, &r, hit)) continue;
        found = true;
        r.tmax = hit->t;
    }
    return found;
}

/* `exactly`: bit for bit, with the work that it took. Else the same hit, which its hierarchy may have found
 * by other ways. */
static void compare_hits(const knurl_surface *a, const knurl_surface *b, bool exactly, int rays, float lod,
                         random_state *random)
{
    for (int i = 0; i < rays; i++) {
        knurl_ray ray = random_ray(2.0, lod, random);
        knurl_hit hit[2];
        bool found[2] = {trace(a, &ray, &hit[0]), trace(b, &ray, &hit[1])};
        assert_int_equal(found[0], found[1]);
        if (exactly) {
            assert_memory_equal(&hit[0], &hit[1], sizeof hit[0]);
        } else if (found[0]) {
            assert_int_equal(hit[0].triangle, hit[1].triangle);
            assert_true(fabs(hit[0].t - hit[1].t) <= 1e-12 * (1.0 + fabs(hit[1].t)));
        }
        if (knurl_surface_shell_count(a) == knurl_surface_shell_count(b))
            assert_int_equal(knurl_surface_occluded(a, 0, &ray), knurl_surface_occluded(b, 0, &ray));
    }
}

static void compare_surfaces(const knurl_surface *a, const knurl_surface *b, bool exactly,
                             random_state *random)
{
    knurl_surface_info info[2];
    knurl_surface_get_info(a, &info[0]);
    knurl_surface_get_info(b, &info[1]);
    if (!exactly) info[0].shell_bytes = info[1].shell_bytes = 0; /* another tree */
    assert_memory_equal(&info[0], &info[1], sizeof info[0]);
    for (uint32_t i = 0; i < knurl_surface_shell_count(a); i++) {
        float box[2][6];
        bool some = knurl_surface_shell_bounds(a, i, box[0], box[0] + 3);
        assert_int_equal(some, knurl_surface_shell_bounds(b, i, box[1], box[1] + 3));
        if (some) assert_memory_equal(box[0], box[1], sizeof box[0]);
    }
    compare_hits(a, b, exactly, 40, 0.0f, random);
    compare_hits(a, b, exactly, 6, (float)random_range(random, 0.0, 4.0), random);
    compare_hits(a, b, exactly, 4, 20.0f, random);
}

static bool is_fast(const char *method)
{
    return strncmp(method, "fast", 4) == 0;
}

/* ---- Tests --------------------------------------------------------------------------------------------- */

static const char *const METHODS[] = {"rmip",
                                      "fast",
                                      "tfdm",
                                      "fast:budget=0",
                                      "fast:budget=0.01",
                                      "fast",
                                      "rmip:bounds=minmax",
                                      "tfdm:leaf-texels=8",
                                      "secant",
                                      "pdm",
                                      "robust-binary",
                                      "empty-skip",
                                      "tessellation:rate=0.3"};
enum { METHOD_COUNT = sizeof METHODS / sizeof METHODS[0] };

static const int32_t SIZES[][2] = {{64, 64}, {130, 97}, {1, 1}, {7, 5}, {33, 200}};
static const knurl_pixel_format FORMATS[] = {KNURL_PIXEL_U16, KNURL_PIXEL_F32, KNURL_PIXEL_U8};

static void run_case(knurl_context *context, const mesh *m, const char *method, random_state *random)
{
    const int32_t *size = SIZES[random_index(random, 5)];
    canvas c = make_canvas(size[0], size[1], FORMATS[random_index(random, 3)], random);
    knurl_heightmap *map = make_map(context, &c);
    knurl_surface_def def = make_def(m, method);
    random_placement(&def.displacement, random);
    def.displacement.map = map;
    knurl_surface *surface = make_surface(context, &def);
    for (int i = 0; i < 4; i++) {
        rect r = edit(&c, map, i == 2 ? 4.0 : 1.0, random);
        knurl_error error = {0};
        if (knurl_surface_update(surface, r.x, r.y, r.width, r.height, &error) != KNURL_OK)
            fail_msg("%s", error.message);
        knurl_surface *fresh = make_surface(context, &def);
        compare_surfaces(surface, fresh, !is_fast(method), random);
        knurl_surface_release(fresh);
        if (c.format == KNURL_PIXEL_F32) continue; /* a new map has another scale */
        knurl_heightmap *other = make_map(context, &c);
        def.displacement.map = other;
        fresh = make_surface(context, &def);
        compare_hits(surface, fresh, !is_fast(method), 10, 0.0f, random);
        knurl_surface_release(fresh);
        knurl_heightmap_release(other);
        def.displacement.map = map;
    }
    knurl_surface_release(surface);
    knurl_heightmap_release(map);
    free(c.samples);
}

static void test_methods(void **state)
{
    (void)state;
    mesh m;
    make_mesh(&m);
    knurl_context *contexts[2] = {make_context(1), make_context(3)};
    random_state random = {1};
    for (int i = 0; i < 8 * METHOD_COUNT; i++)
        run_case(contexts[i % 2], &m, METHODS[i % METHOD_COUNT], &random);
    for (int i = 0; i < 2; i++) knurl_context_release(contexts[i]);
}

/* Several edits before one update of the rectangle that holds them. */
static void test_together(void **state)
{
    (void)state;
    mesh m;
    make_mesh(&m);
    knurl_context *context = make_context(1);
    random_state random = {2};
    for (int i = 0; i < 12; i++) {
        const char *method = METHODS[i % 3];
        canvas c = make_canvas(97, 64, FORMATS[i % 2], &random);
        knurl_heightmap *map = make_map(context, &c);
        knurl_surface_def def = make_def(&m, method);
        random_placement(&def.displacement, &random);
        def.displacement.map = map;
        knurl_surface *surface = make_surface(context, &def);
        rect all = edit(&c, map, 2.0, &random);
        for (int k = 0; k < 2; k++) {
            rect r = edit(&c, map, 3.0, &random);
            int32_t x1 = r.x + r.width > all.x + all.width ? r.x + r.width : all.x + all.width;
            int32_t y1 = r.y + r.height > all.y + all.height ? r.y + r.height : all.y + all.height;
            all.x = r.x < all.x ? r.x : all.x;
            all.y = r.y < all.y ? r.y : all.y;
            all.width = x1 - all.x;
            all.height = y1 - all.y;
        }
        assert_int_equal(knurl_surface_update(surface, all.x, all.y, all.width, all.height, NULL), KNURL_OK);
        knurl_surface *fresh = make_surface(context, &def);
        compare_surfaces(surface, fresh, !is_fast(method), &random);
        knurl_surface_release(fresh);
        knurl_surface_release(surface);
        knurl_heightmap_release(map);
        free(c.samples);
    }
    knurl_context_release(context);
}

/* Maps of one value have no scale of their own. */
static void test_constant(void **state)
{
    (void)state;
    mesh m;
    make_mesh(&m);
    knurl_context *context = make_context(1);
    random_state random = {6};
    for (int i = 0; i < 6; i++) {
        canvas c = make_canvas(40, 30, FORMATS[i % 3], &random);
        rect all = {0, 0, c.width, c.height};
        paint(&c, &all, 0.7, 0.7, true, &random);
        knurl_heightmap *map = make_map(context, &c);
        knurl_surface_def def = make_def(&m, "rmip");
        def.displacement.map = map;
        knurl_surface *exact = make_surface(context, &def);
        def.method = i < 3 ? "fast" : "fast:budget=0";
        knurl_surface *surface = make_surface(context, &def);
        compare_hits(surface, exact, false, 100, 0.0f, &random);
        for (int k = 0; k < 3; k++) {
            rect r = edit(&c, map, 1.0, &random);
            assert_int_equal(knurl_surface_update(surface, r.x, r.y, r.width, r.height, NULL), KNURL_OK);
            assert_int_equal(knurl_surface_update(exact, r.x, r.y, r.width, r.height, NULL), KNURL_OK);
            compare_hits(surface, exact, false, 100, 0.0f, &random);
        }
        knurl_surface_release(surface);
        knurl_surface_release(exact);
        knurl_heightmap_release(map);
        free(c.samples);
    }
    knurl_context_release(context);
}

typedef struct pair {
    knurl_surface *surfaces[2]; /* of one map, by different methods */
    knurl_scene *scene;
} pair;

static pair make_pair(knurl_context *context, const mesh *m, knurl_heightmap *map, const char *method,
                      int instances)
{
    pair p;
    knurl_surface_def def = make_def(m, method);
    def.displacement.map = map;
    p.surfaces[0] = make_surface(context, &def);
    def.method = "rmip";
    def.displacement.uv_scale[0] = 2.0;
    p.surfaces[1] = make_surface(context, &def);
    p.scene = make_scene(context, p.surfaces, instances);
    return p;
}

static void free_pair(pair *p)
{
    knurl_scene_release(p->scene);
    for (int i = 0; i < 2; i++) knurl_surface_release(p->surfaces[i]);
}

static knurl_status update_pair(pair *p, const rect *r, knurl_error *error)
{
    for (uint32_t i = 0; i < 2; i++) {
        knurl_status status = knurl_surface_update(p->surfaces[i], r->x, r->y, r->width, r->height, error);
        if (status == KNURL_OK) status = knurl_scene_update(p->scene, i, error);
        if (status != KNURL_OK) return status;
    }
    return KNURL_OK;
}

static void compare_scenes(const knurl_scene *a, const knurl_scene *b, bool exactly, random_state *random)
{
    double box[2][6];
    knurl_scene_bounds(a, box[0], box[0] + 3);
    knurl_scene_bounds(b, box[1], box[1] + 3);
    assert_memory_equal(box[0], box[1], sizeof box[0]);
    for (int i = 0; i < 60; i++) {
        knurl_ray ray = random_ray(2.0, 0.0f, random);
        ray.origin[0] += 2.5 * (double)random_index(random, 7);
        knurl_hit hit[2];
        memset(hit, 0, sizeof hit);
        bool found = knurl_scene_intersect(b, &ray, &hit[1]);
        assert_int_equal(knurl_scene_intersect(a, &ray, &hit[0]), found);
        assert_int_equal(knurl_scene_occluded(a, &ray), found);
        if (exactly) {
            assert_memory_equal(&hit[0], &hit[1], sizeof hit[0]);
        } else if (found) {
            assert_int_equal(hit[0].triangle, hit[1].triangle);
            assert_int_equal(hit[0].instance, hit[1].instance);
            assert_true(fabs(hit[0].t - hit[1].t) <= 1e-12 * (1.0 + fabs(hit[1].t)));
        }
    }
}

static void test_scenes(void **state)
{
    (void)state;
    mesh m;
    make_mesh(&m);
    knurl_context *context = make_context(2);
    random_state random = {3};
    static const char *const methods[] = {"fast", "tfdm", "tessellation:rate=0.3"};
    for (int i = 0; i < 12; i++) {
        canvas c = make_canvas(97, 64, FORMATS[i % 3], &random);
        knurl_heightmap *map = make_map(context, &c);
        int instances = i % 2 ? 7 : 3;
        pair p = make_pair(context, &m, map, methods[i % 3], instances);
        for (int k = 0; k < 3; k++) {
            rect r = edit(&c, map, 3.0, &random);
            assert_int_equal(update_pair(&p, &r, NULL), KNURL_OK);
            pair fresh = make_pair(context, &m, map, methods[i % 3], instances);
            compare_scenes(p.scene, fresh.scene, i % 3 == 1, &random);
            free_pair(&fresh);
        }
        free_pair(&p);
        knurl_heightmap_release(map);
        free(c.samples);
    }
    knurl_context_release(context);
}

typedef struct failing {
    long left; /* calls until one fails; negative: never */
} failing;

static void *failing_reallocate(void *user, void *p, size_t old_size, size_t new_size, size_t alignment)
{
    failing *f = user;
    if (new_size == 0) {
        free(p);
        return NULL;
    }
    if (f->left == 0) return NULL;
    if (f->left > 0) f->left--;
    void *made = aligned_alloc(alignment, (new_size + alignment - 1) / alignment * alignment);
    if (made && p) {
        memcpy(made, p, old_size < new_size ? old_size : new_size);
        free(p);
    }
    return made;
}

/* At each allocation in turn: no memory from there on. What is left can be traced and brought up to date. */
static void test_memory(void **state)
{
    (void)state;
    mesh m;
    make_mesh(&m);
    static const char *const methods[] = {"fast", "tfdm", "rmip", "tessellation:rate=0.3"};
    for (size_t method = 0; method < sizeof methods / sizeof methods[0]; method++) {
        failing f = {.left = -1};
        knurl_context_def def = knurl_context_def_default();
        def.threads = 1;
        def.reallocate = failing_reallocate;
        def.allocator_user = &f;
        knurl_context *context = NULL;
        assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
        random_state random = {4 + method};
        canvas c = make_canvas(97, 64, KNURL_PIXEL_F32, &random);
        knurl_heightmap *map = make_map(context, &c);
        pair p = make_pair(context, &m, map, methods[method], 7);
        knurl_status status = KNURL_ERROR_MEMORY;
        for (long n = 0; status != KNURL_OK; n++) {
            rect r = edit(&c, map, 1.0 + (double)n, &random);
            knurl_error error = {0};
            f.left = n;
            status = update_pair(&p, &r, &error);
            f.left = -1;
            if (status != KNURL_OK) {
                assert_int_equal(status, KNURL_ERROR_MEMORY);
                assert_true(error.message[0] != 0);
                for (int i = 0; i < 20; i++) {
                    knurl_ray ray = random_ray(2.0, 0.0f, &random);
                    knurl_hit hit;
                    (void)trace(p.surfaces[0], &ray, &hit);
                }
                knurl_status committed = knurl_scene_commit(p.scene, NULL);
                assert_true(committed == KNURL_OK || committed == KNURL_ERROR_ARGUMENT);
                assert_int_equal(update_pair(&p, &r, NULL), KNURL_OK);
            }
            pair fresh = make_pair(context, &m, map, methods[method], 7);
            compare_scenes(p.scene, fresh.scene, method == 1 || method == 2, &random);
            free_pair(&fresh);
            assert_true(n < 500);
        }
        free_pair(&p);
        knurl_heightmap_release(map);
        free(c.samples);
        knurl_context_release(context);
    }
}

static void test_arguments(void **state)
{
    (void)state;
    mesh m;
    make_mesh(&m);
    knurl_context *context = make_context(1);
    random_state random = {5};
    canvas c = make_canvas(20, 10, KNURL_PIXEL_F32, &random);
    knurl_heightmap *map = make_map(context, &c);
    pair p = make_pair(context, &m, map, "fast", 1);
    knurl_surface *surface = p.surfaces[0];
    static const int32_t wrong[][4] = {{-1, 0, 1, 1},        {0, -1, 1, 1},       {0, 0, 21, 1},
                                       {0, 0, 1, 11},        {20, 0, 1, 1},       {0, 0, -1, 1},
                                       {0, 0, 1, INT32_MIN}, {INT32_MAX, 0, 1, 1}};
    knurl_error error = {0};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const int32_t *w = wrong[i];
        assert_int_equal(knurl_surface_update(surface, w[0], w[1], w[2], w[3], &error), KNURL_ERROR_ARGUMENT);
        assert_non_null(strstr(error.message, "20 x 10"));
    }
    assert_int_equal(knurl_surface_update(NULL, 0, 0, 1, 1, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_surface_update(surface, 20, 10, 0, 0, &error), KNURL_OK);
    assert_int_equal(knurl_scene_update(NULL, 0, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_scene_update(p.scene, 2, &error), KNURL_ERROR_ARGUMENT);
    /* Heights beyond what surfaces take: the next update that they allow sees all that was missed. */
    float high = 1e20f;
    size_t row = sizeof high;
    assert_int_equal(knurl_heightmap_update(map, 3, 3, 1, 1, &high, row, NULL), KNURL_OK);
    assert_int_equal(knurl_surface_update(surface, 3, 3, 1, 1, &error), KNURL_ERROR_ARGUMENT);
    free_pair(&p);
    knurl_heightmap_release(map);
    free(c.samples);
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_methods), cmocka_unit_test(test_together), cmocka_unit_test(test_constant),
        cmocka_unit_test(test_scenes),  cmocka_unit_test(test_memory),   cmocka_unit_test(test_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
