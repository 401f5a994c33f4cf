/* The method "tessellation" and knurl/tessellation.h: closed meshes, vertices on the surface, hits that agree
 * with the exact ones within the facets' error, refusals. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "support/random.h"
#include "support/scenes.h"
#include "support/traced.h"

#include <knurl/embree.h>
#include <knurl/tessellation.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const PRIMITIVES[] = {"triangles", "quads", "grids"};

/* ---- Scenes ----------------------------------------------------------------------------------- */

/* A torus about the y axis, radii 1 and 0.4, whose chart wraps both ways. */
static truth_scene rough_torus(void)
{
    truth_scene scene;
    assert_true(truth_torus_make(&scene, "torus", 12, 8, 0.12, -0.03, 0.0));
    return scene;
}

/* The same with long waves in place of noise. */
static truth_scene smooth_torus(void)
{
    enum { WIDTH = 256, HEIGHT = 128 };
    const double turn = 2.0 * 3.14159265358979323846;
    truth_scene scene = rough_torus();
    float *map = malloc(WIDTH * HEIGHT * sizeof *map);
    assert_non_null(map);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            map[y * WIDTH + x] =
                (float)(0.5 + 0.25 * sin(turn * 3.0 * x / WIDTH) + 0.25 * cos(turn * 2.0 * y / HEIGHT));
    free((void *)(uintptr_t)scene.def.samples);
    scene.def.samples = map;
    scene.def.width = WIDTH;
    scene.def.height = HEIGHT;
    scene.def.format = ORACLE_F32;
    return scene;
}

static traced make_traced(const truth_scene *scene, const char *method, int threads)
{
    traced t;
    assert_true(traced_make(&scene->def, method, threads, &t));
    return t;
}

static traced make_facets(const truth_scene *scene, const char *primitive, double rate, int threads)
{
    char method[96];
    (void)snprintf(method, sizeof method, "tessellation:primitive=%s:rate=%g", primitive, rate);
    return make_traced(scene, method, threads);
}

/* A mesh of knurl/tessellation.h. */
typedef struct mesh {
    uint64_t vertices, triangles;
    double *positions;
    float *normals, *texcoords;
    uint32_t *indices;
} mesh;

static mesh make_mesh(knurl_surface *surface, double rate, uint64_t most)
{
    knurl_tessellation_def def = knurl_tessellation_def_default();
    knurl_tessellation *t = NULL;
    knurl_error error = {0};
    def.rate = rate;
    def.max_triangles = most;
    assert_int_equal(knurl_tessellation_create(surface, &def, &t, &error), KNURL_OK);
    mesh m = {.vertices = knurl_tessellation_vertices(t), .triangles = knurl_tessellation_triangles(t)};
    m.positions = malloc(m.vertices * 3 * sizeof *m.positions);
    m.normals = malloc(m.vertices * 3 * sizeof *m.normals);
    m.texcoords = malloc(m.vertices * 2 * sizeof *m.texcoords);
    m.indices = malloc(m.triangles * 3 * sizeof *m.indices);
    assert_true(m.positions && m.normals && m.texcoords && m.indices);
    knurl_tessellation_get_vertices(t, 0, m.vertices, m.positions, m.normals, m.texcoords);
    /* In pieces of odd lengths. */
    for (uint64_t at = 0, step = 1; at < m.triangles; at += step, step = step * 3 % 1009)
        knurl_tessellation_get_triangles(t, at, step, m.indices + 3 * at);
    for (uint32_t b = 0; b < knurl_surface_shell_count(surface); b++) {
        uint64_t first = knurl_tessellation_first_vertex(t, b),
                 end = knurl_tessellation_first_vertex(t, b + 1);
        for (uint64_t i = 3 * knurl_tessellation_first_triangle(t, b);
             i < 3 * knurl_tessellation_first_triangle(t, b + 1); i++)
            assert_true(m.indices[i] >= first && m.indices[i] < end);
    }
    double piece[3 * 7];
    for (uint64_t at = 0; at < m.vertices; at += 1 + at / 2) {
        uint64_t count = m.vertices - at < 7 ? m.vertices - at : 7;
        knurl_tessellation_get_vertices(t, at, 7, piece, NULL, NULL);
        assert_memory_equal(piece, m.positions + 3 * at, count * 3 * sizeof *piece);
    }
    knurl_tessellation_release(t);
    return m;
}

static void free_mesh(mesh *m)
{
    free(m->positions);
    free(m->normals);
    free(m->texcoords);
    free(m->indices);
}

/* ---- The mesh is closed ----------------------------------------------------------------------- */

typedef struct place {
    double p[3];
    uint32_t vertex;
} place;

static int compare_places(const void *a, const void *b)
{
    const place *pa = a, *pb = b;
    for (int k = 0; k < 3; k++)
        if (pa->p[k] != pb->p[k]) return pa->p[k] < pb->p[k] ? -1 : 1;
    return pa->vertex < pb->vertex ? -1 : 1;
}

/* welded[v] is the same for vertices at the same place, bit for bit; returns how many there are. */
static uint32_t weld_vertices(const mesh *m, uint32_t *welded)
{
    place *places = malloc(m->vertices * sizeof *places);
    assert_non_null(places);
    for (uint32_t v = 0; v < m->vertices; v++) {
        memcpy(places[v].p, m->positions + 3 * (size_t)v, sizeof places[v].p);
        places[v].vertex = v;
    }
    qsort(places, m->vertices, sizeof *places, compare_places);
    uint32_t count = 0;
    for (uint64_t i = 0; i < m->vertices; i++) {
        if (i > 0 && memcmp(places[i].p, places[i - 1].p, sizeof places[i].p) != 0) count++;
        welded[places[i].vertex] = count;
    }
    free(places);
    return count + 1;
}

static int compare_edges(const void *a, const void *b)
{
    const uint64_t *ea = a, *eb = b;
    return (*ea > *eb) - (*ea < *eb);
}

/* Every edge is used once in each direction. Returns V - E + F. */
static int64_t check_closed(const mesh *m)
{
    uint32_t *welded = malloc(m->vertices * sizeof *welded);
    uint64_t edges = 3 * m->triangles, *forth = malloc(edges * sizeof *forth),
             *back = malloc(edges * sizeof *back);
    assert_true(welded && forth && back);
    uint32_t count = weld_vertices(m, welded);
    for (uint64_t i = 0; i < m->triangles; i++)
        for (uint64_t k = 0; k < 3; k++) {
            uint64_t a = welded[m->indices[3 * i + k]], b = welded[m->indices[3 * i + (k + 1) % 3]];
            assert_true(a != b);
            forth[3 * i + k] = a << 32 | b;
            back[3 * i + k] = b << 32 | a;
        }
    qsort(forth, edges, sizeof *forth, compare_edges);
    qsort(back, edges, sizeof *back, compare_edges);
    assert_memory_equal(forth, back, edges * sizeof *forth);
    for (uint64_t i = 1; i < edges; i++) assert_true(forth[i] != forth[i - 1]);
    free(welded);
    free(forth);
    free(back);
    return (int64_t)count - (int64_t)(edges / 2) + (int64_t)m->triangles;
}

static void test_torus_is_closed(void **state)
{
    (void)state;
    static const double rates[] = {1.0, 0.61, 0.25, 0.02, 2.5};
    truth_scene scene = rough_torus();
    /* Unequal tiling makes base triangles of many shapes. */
    scene.def.uv_scale[0] = 2.0;
    traced t = make_traced(&scene, "rmip", 2);
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        mesh m = make_mesh(t.surface, rates[i], 0);
        assert_int_equal(check_closed(&m), 0);
        free_mesh(&m);
    }
    traced_free(&t);
    truth_scene_free(&scene);
}

/* Skewed and stretched charts: every shape of lattice. The mesh is a triangle, whose outline must have its
 * edges' points and whose area in texture space must be covered once. */
static void check_one_triangle(const float texcoords[6])
{
    static const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const uint32_t triangle[] = {0, 1, 2};
    truth_scene scene = rough_torus();
    oracle_def def = scene.def;
    def.positions = positions;
    def.normals = normals;
    def.texcoords = texcoords;
    def.triangles = triangle;
    def.vertex_count = 3;
    def.triangle_count = 1;
    traced t;
    assert_true(traced_make(&def, "rmip", 1, &t));
    mesh m = make_mesh(t.surface, 1.0, 0);
    double sum = 0.0;
    for (uint64_t i = 0; i < m.triangles; i++) {
        const double *p[3];
        for (uint64_t k = 0; k < 3; k++) p[k] = m.positions + 3 * (size_t)m.indices[3 * i + k];
        double area = (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[1][1] - p[0][1]) * (p[2][0] - p[0][0]);
        assert_true(area > -1e-12);
        sum += area;
    }
    assert_true(fabs(sum - 1.0) < 1e-9);
    free_mesh(&m);
    traced_free(&t);
    truth_scene_free(&scene);
}

static void test_lattices_cover_their_triangle_once(void **state)
{
    (void)state;
    random_state r = {11};
    for (int i = 0; i < 150; i++) {
        float st[6];
        double sx = pow(10.0, random_range(&r, -3.0, 0.3)), sy = pow(10.0, random_range(&r, -3.0, 0.3));
        for (int k = 0; k < 6; k++) st[k] = (float)(random_unit(&r) * (k % 2 ? sy : sx));
        check_one_triangle(st);
    }
    static const float flat[6] = {0.0f, 0.0f, 0.3f, 0.3f, 0.9f, 0.9f}, right[6] = {0, 0, 1, 0, 0, 1},
                       point[6] = {0};
    check_one_triangle(flat);
    check_one_triangle(right);
    check_one_triangle(point);
}

/* ---- Rays ------------------------------------------------------------------------------------- */

static void core_point(random_state *r, double p[3])
{
    double angle = random_range(r, 0.0, 6.283185307179586);
    p[0] = cos(angle);
    p[1] = 0.0;
    p[2] = sin(angle);
}

static void any_direction(random_state *r, double d[3])
{
    double z = random_range(r, -1.0, 1.0), angle = random_range(r, 0.0, 6.283185307179586),
           s = sqrt(1.0 - z * z);
    d[0] = s * cos(angle);
    d[1] = s * sin(angle);
    d[2] = z;
}

/* From inside the tube: anywhere, and at vertices and edges of the facets. */
static knurl_ray inside_ray(const mesh *m, random_state *r, int i)
{
    double from[3], d[3];
    core_point(r, from);
    if (i % 3 == 0) {
        any_direction(r, d);
    } else {
        uint32_t triangle = random_index(r, (uint32_t)m->triangles), k = random_index(r, 3);
        const double *a = m->positions + 3 * (size_t)m->indices[3 * triangle + k],
                     *b = m->positions + 3 * (size_t)m->indices[3 * triangle + (k + 1) % 3];
        double way = i % 3 == 1 ? 0.0 : random_unit(r);
        for (int c = 0; c < 3; c++) d[c] = a[c] + way * (b[c] - a[c]) - from[c];
    }
    return knurl_ray_make(from, d);
}

static void test_no_ray_leaks(void **state)
{
    (void)state;
    enum { RAYS = 60000 };
    truth_scene scene = rough_torus();
    for (int p = 0; p < 3; p++) {
        traced t = make_facets(&scene, PRIMITIVES[p], 0.7, 2);
        mesh m = make_mesh(t.surface, 0.7, 0);
        random_state r = {(uint64_t)p + 5};
        int leaks[3] = {0};
        for (int i = 0; i < RAYS; i++) {
            knurl_ray ray = inside_ray(&m, &r, i);
            knurl_hit hit;
            leaks[i % 3] += !knurl_scene_intersect(t.scene, &ray, &hit);
            leaks[i % 3] += !knurl_scene_occluded(t.scene, &ray);
        }
        print_message("%-9s leaks: %d at random, %d at vertices, %d at edges\n", PRIMITIVES[p], leaks[0],
                      leaks[1], leaks[2]);
        assert_int_equal(leaks[0] + leaks[2], 0);
        /* Embree's tests agree along edges. Around a vertex their rounding may leave a gap. */
        assert_true(leaks[1] < 2 * RAYS / 3 / 100);
        free_mesh(&m);
        traced_free(&t);
    }
    truth_scene_free(&scene);
}

/* Chords through the whole torus. */
static knurl_ray chord(random_state *r)
{
    double a[3], b[3], d[3];
    any_direction(r, a);
    any_direction(r, b);
    for (int k = 0; k < 3; k++) {
        a[k] *= 2.5;
        d[k] = 0.8 * b[k] - a[k];
    }
    return knurl_ray_make(a, d);
}

static void test_vertices_are_on_the_surface(void **state)
{
    (void)state;
    truth_scene scene = rough_torus();
    traced t = make_traced(&scene, "rmip", 2);
    mesh m = make_mesh(t.surface, 0.37, 0);
    for (size_t i = 0; i < m.vertices; i += 3) {
        const double *p = m.positions + 3 * i;
        double from[3], d[3];
        /* Towards the tube's middle, which the surface faces away from. */
        double radius = sqrt(p[0] * p[0] + p[2] * p[2]);
        const double core[3] = {p[0] / radius, 0.0, p[2] / radius};
        for (int k = 0; k < 3; k++) {
            d[k] = core[k] - p[k];
            from[k] = p[k] - 1e-3 * d[k];
        }
        knurl_ray ray = knurl_ray_make(from, d);
        ray.tmin = 1e-3 - 1e-8;
        ray.tmax = 1e-3 + 1e-8;
        assert_true(knurl_scene_occluded(t.scene, &ray));
        const float *n = m.normals + 3 * i, *st = m.texcoords + 2 * i;
        assert_true(fabsf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1.0f) < 1e-5f);
        assert_true(st[0] >= 0.0f && st[0] <= 1.0f && st[1] >= 0.0f && st[1] <= 1.0f);
    }
    free_mesh(&m);
    traced_free(&t);
    truth_scene_free(&scene);
}

/* Mean and largest distance of the hits' positions from the exact ones, over rays that both hit steeply. */
static void compare_hits(const traced *exact, const traced *facets, double *mean, double *most)
{
    enum { RAYS = 20000 };
    random_state r = {77};
    int both = 0, one = 0;
    *mean = *most = 0.0;
    for (int i = 0; i < RAYS; i++) {
        knurl_ray ray = chord(&r);
        knurl_hit a, b;
        bool hit_a = knurl_scene_intersect(exact->scene, &ray, &a),
             hit_b = knurl_scene_intersect(facets->scene, &ray, &b);
        one += hit_a != hit_b;
        if (!hit_a || !hit_b) continue;
        double length = 0.0, cosine = 0.0, distance = 0.0;
        for (int k = 0; k < 3; k++) {
            length += ray.direction[k] * ray.direction[k];
            cosine += ray.direction[k] * a.ng[k];
            distance += (a.position[k] - b.position[k]) * (a.position[k] - b.position[k]);
        }
        if (fabs(cosine) < 0.5 * sqrt(length)) continue;
        if (distance > 0.01) {
            one++; /* past a silhouette */
            continue;
        }
        both++;
        *mean += sqrt(distance);
        *most = fmax(*most, sqrt(distance));
        /* The record is that of its own place. */
        assert_true(b.a >= 0.0 && b.b >= 0.0 && b.a + b.b <= 1.0);
        assert_true(b.error >= 0.0 && b.error < 0.05);
    }
    assert_true(both > RAYS / 4 && one < RAYS / 200);
    *mean /= both;
}

static void test_hits_converge(void **state)
{
    (void)state;
    truth_scene scene = smooth_torus();
    traced exact = make_traced(&scene, "rmip", 2);
    for (int p = 0; p < 3; p++) {
        double before = 0.0;
        for (double rate = 0.125; rate <= 1.0; rate *= 2.0) {
            traced facets = make_facets(&scene, PRIMITIVES[p], rate, 2);
            double mean, most;
            compare_hits(&exact, &facets, &mean, &most);
            print_message("%-9s rate %5.3f: mean distance %.3g, most %.3g\n", PRIMITIVES[p], rate, mean,
                          most);
            /* Facets of half the size are four times as close. */
            if (rate > 0.125) assert_true(mean < 0.4 * before);
            if (rate == 1.0) assert_true(mean < 5e-5 && most < 1e-3);
            before = mean;
            traced_free(&facets);
        }
    }
    traced_free(&exact);
    truth_scene_free(&scene);
}

static void test_occluded_is_intersect(void **state)
{
    (void)state;
    truth_scene scene = rough_torus();
    for (int p = 0; p < 3; p++) {
        traced t = make_facets(&scene, PRIMITIVES[p], 1.0, 2);
        random_state r = {99};
        for (int i = 0; i < 20000; i++) {
            knurl_ray ray = chord(&r);
            ray.tmin = random_range(&r, 0.0, 0.9);
            ray.tmax = ray.tmin + random_range(&r, 0.0, 0.6);
            knurl_hit hit;
            bool found = knurl_scene_intersect(t.scene, &ray, &hit);
            assert_int_equal(found, knurl_scene_occluded(t.scene, &ray));
            if (found) assert_true(hit.t >= ray.tmin && hit.t <= ray.tmax);
        }
        traced_free(&t);
    }
    truth_scene_free(&scene);
}

static void test_any_number_of_threads(void **state)
{
    (void)state;
    truth_scene scene = rough_torus();
    for (int p = 0; p < 3; p++) {
        traced one = make_facets(&scene, PRIMITIVES[p], 1.0, 1),
               more = make_facets(&scene, PRIMITIVES[p], 1.0, 4);
        mesh m = make_mesh(one.surface, 1.0, 0), other = make_mesh(more.surface, 1.0, 0);
        assert_int_equal(m.vertices, other.vertices);
        assert_memory_equal(m.positions, other.positions, m.vertices * 3 * sizeof *m.positions);
        assert_memory_equal(m.normals, other.normals, m.vertices * 3 * sizeof *m.normals);
        random_state r = {123};
        for (int i = 0; i < 30000; i++) {
            knurl_ray ray = i % 2 ? chord(&r) : inside_ray(&m, &r, i / 2);
            knurl_hit a, b;
            memset(&a, 0, sizeof a);
            memset(&b, 0, sizeof b);
            (void)knurl_scene_intersect(one.scene, &ray, &a);
            (void)knurl_scene_intersect(more.scene, &ray, &b);
            assert_memory_equal(&a, &b, sizeof a);
        }
        free_mesh(&m);
        free_mesh(&other);
        traced_free(&one);
        traced_free(&more);
    }
    truth_scene_free(&scene);
}

/* A flat square of 2 x 256^2 facets, all of whose vertices are rays' exact places: each ray meets up to six
 * facets at one t. */
static void test_any_number_of_threads_at_ties(void **state)
{
    (void)state;
    static const float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0},
                       normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1},
                       texcoords[] = {0, 0, 1, 0, 1, 1, 0, 1};
    static const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
    oracle_def def = {.positions = positions, .normals = normals, .texcoords = texcoords, .vertex_count = 4};
    def.triangles = triangles;
    def.triangle_count = 2;
    static uint8_t zeros[256 * 256];
    def.samples = zeros;
    def.width = def.height = 256;
    def.format = ORACLE_U8;
    def.uv_scale[0] = def.uv_scale[1] = 1.0;
    for (int p = 0; p < 3; p++) {
        truth_scene scene = {.def = def};
        traced one = make_facets(&scene, PRIMITIVES[p], 1.0, 1),
               more = make_facets(&scene, PRIMITIVES[p], 1.0, 5);
        for (int i = 1; i < 256; i++)
            for (int j = 1; j < 256; j++) {
                const double from[3] = {i / 256.0, j / 256.0, 1.0}, down[3] = {0.0, 0.0, -1.0};
                knurl_ray ray = knurl_ray_make(from, down);
                knurl_hit a, b;
                memset(&a, 0, sizeof a);
                memset(&b, 0, sizeof b);
                assert_true(knurl_scene_intersect(one.scene, &ray, &a));
                assert_true(knurl_scene_intersect(more.scene, &ray, &b));
                assert_memory_equal(&a, &b, sizeof a);
            }
        traced_free(&one);
        traced_free(&more);
    }
}

/* ---- In a scene ------------------------------------------------------------------------------- */

static void test_instances_masks_and_memory(void **state)
{
    (void)state;
    truth_scene truth = smooth_torus();
    traced t = make_facets(&truth, "triangles", 1.0, 2);
    knurl_scene *scene = NULL;
    uint32_t object;
    /* Turned, three times as large, mirrored, and far away. */
    static const double there[12] = {0, 3, 0, 1e6, 3, 0, 0, -2e6, 0, 0, 3, 5e5};
    assert_int_equal(knurl_scene_create(t.context, &scene, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(scene, t.surface, &object, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_instance(scene, object, NULL, 1, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_instance(scene, object, there, 2, NULL, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_commit(scene, NULL), KNURL_OK);
    random_state r = {31};
    int hits = 0;
    for (int i = 0; i < 2000; i++) {
        knurl_ray ray = chord(&r), moved = ray;
        for (int k = 0; k < 3; k++) {
            const double *row = there + 4 * k;
            moved.origin[k] =
                row[0] * ray.origin[0] + row[1] * ray.origin[1] + row[2] * ray.origin[2] + row[3];
            moved.direction[k] =
                row[0] * ray.direction[0] + row[1] * ray.direction[1] + row[2] * ray.direction[2];
        }
        ray.mask = 1;
        moved.mask = 2;
        ray.cone_width = 0.5f; /* ignored */
        knurl_hit a, b;
        bool found = knurl_scene_intersect(scene, &ray, &a);
        bool also = knurl_scene_intersect(scene, &moved, &b);
        if (!found || !also) continue;
        hits++;
        assert_int_equal(a.instance, 0);
        assert_int_equal(b.instance, 1);
        assert_true(fabs(a.t - b.t) < 1e-4);
        moved.mask = 1;
        assert_false(knurl_scene_intersect(scene, &moved, &b));
    }
    assert_true(hits > 500);
    mesh m = make_mesh(t.surface, 1.0, 0);
    knurl_scene_memory memory = knurl_scene_get_memory(scene);
    assert_true(memory.shells >= 12 * m.vertices + 12 * m.triangles);
    assert_true(memory.bvh > 20 * m.triangles);
    free_mesh(&m);
    knurl_scene_release(scene);
    traced_free(&t);
    truth_scene_free(&truth);
}

static void test_one_shell_is_the_exact_surface(void **state)
{
    (void)state;
    truth_scene truth = smooth_torus();
    traced facets = make_facets(&truth, "triangles", 0.1, 1), exact = make_traced(&truth, "rmip", 1);
    assert_true(knurl_surface_flags(facets.surface) & KNURL_METHOD_NATIVE);
    assert_false(knurl_surface_flags(exact.surface) & KNURL_METHOD_NATIVE);
    random_state r = {8};
    int hits = 0;
    for (int i = 0; i < 400; i++) {
        knurl_ray ray = chord(&r);
        knurl_hit a, b = {.steps = 0};
        if (!knurl_scene_intersect(exact.scene, &ray, &a)) continue;
        hits++;
        ray.tmin = a.t - 1e-6;
        ray.tmax = a.t + 1e-6;
        assert_true(knurl_surface_intersect(facets.surface, a.triangle, &ray, &b));
        assert_true(knurl_surface_occluded(facets.surface, a.triangle, &ray));
        assert_true(fabs(a.t - b.t) < 1e-9);
    }
    assert_true(hits > 100);
    RTCDevice device = rtcNewDevice(NULL);
    RTCScene scene = rtcNewScene(device);
    assert_true(knurl_embree_attach(device, scene, facets.surface) == RTC_INVALID_GEOMETRY_ID);
    assert_true(rtcGetDeviceError(device) == RTC_ERROR_NONE);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
    traced_free(&facets);
    traced_free(&exact);
    truth_scene_free(&truth);
}

/* ---- Limits ----------------------------------------------------------------------------------- */

static void test_budget(void **state)
{
    (void)state;
    truth_scene scene = rough_torus();
    traced t = make_traced(&scene, "tessellation:budget=0.002", 2);
    mesh m = make_mesh(t.surface, 1.0, 2000);
    assert_true(m.triangles <= 2000 && m.triangles > 1000);
    assert_int_equal(check_closed(&m), 0);
    knurl_surface_info info;
    knurl_surface_get_info(t.surface, &info);
    assert_true(info.shell_bytes < 2000 * 40 + 192 * 64);
    free_mesh(&m);
    /* One per base triangle remains. */
    m = make_mesh(t.surface, 1.0, 1);
    assert_int_equal(m.triangles, scene.def.triangle_count);
    assert_int_equal(check_closed(&m), 0);
    free_mesh(&m);
    traced_free(&t);
    truth_scene_free(&scene);
}

static knurl_status try_method(const char *method, uint64_t limit, double tiles, knurl_error *error)
{
    static const float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0},
                       texcoords[] = {0, 0, 1, 0, 1, 1, 0, 1};
    static const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
    static const uint8_t samples[64 * 64] = {1, 2, 3};
    knurl_context_def def = knurl_context_def_default();
    def.memory_limit = limit;
    knurl_context *context = NULL;
    knurl_image *image = NULL;
    knurl_heightmap *map = NULL;
    knurl_surface *surface = NULL;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    assert_int_equal(knurl_image_create(context, 64, 64, 1, KNURL_PIXEL_U8, samples, &image, NULL), KNURL_OK);
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    assert_int_equal(knurl_heightmap_create(context, &map_def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    knurl_surface_def surface_def = knurl_surface_def_default();
    surface_def.mesh = (knurl_mesh_view){positions, NULL, texcoords, 4, triangles, 2, NULL};
    surface_def.displacement.map = map;
    surface_def.displacement.uv_scale[0] = surface_def.displacement.uv_scale[1] = tiles;
    surface_def.method = method;
    knurl_status status = knurl_surface_create(context, &surface_def, &surface, error);
    assert_true((status == KNURL_OK) == (surface != NULL));
    knurl_surface_release(surface);
    knurl_heightmap_release(map);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
    return status;
}

static void test_refusals(void **state)
{
    (void)state;
    knurl_error error = {0};
    const uint64_t mib = 1024 * 1024;
    /* 64 tiles of 64 texels: 33.5 million triangles. */
    assert_int_equal(try_method("tessellation", 100 * mib, 64.0, &error), KNURL_ERROR_MEMORY);
    assert_non_null(strstr(error.message, "bytes"));
    assert_non_null(strstr(error.message, "104857600"));
    assert_non_null(strstr(error.message, "rate"));
    assert_int_equal(try_method("tessellation:rate=0.1", 100 * mib, 64.0, &error), KNURL_OK);
    assert_int_equal(try_method("tessellation:budget=0.3", 100 * mib, 64.0, &error), KNURL_OK);
    assert_int_equal(try_method("tessellation:primitive=grids:rate=0.1", 100 * mib, 64.0, &error), KNURL_OK);
    /* More than any machine here has: 2 * 48,000^2 triangles. */
    assert_int_equal(try_method("tessellation", 0, 700.0, &error), KNURL_ERROR_MEMORY);
    assert_non_null(strstr(error.message, "the machine"));
    /* Edges of 128,000 texels. */
    assert_int_equal(try_method("tessellation", 0, 2000.0, &error), KNURL_ERROR_LIMIT);
    assert_non_null(strstr(error.message, "edge of triangle"));
    assert_int_equal(try_method("tessellation:rate=0", 0, 1.0, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(try_method("tessellation:primitive=cubes", 0, 1.0, &error), KNURL_ERROR_ARGUMENT);
}

static void test_definitions_are_checked(void **state)
{
    (void)state;
    truth_scene scene = rough_torus();
    traced t = make_traced(&scene, "rmip", 1);
    knurl_tessellation_def def = {0};
    knurl_tessellation *out = NULL;
    knurl_error error = {0};
    assert_int_equal(knurl_tessellation_create(t.surface, &def, &out, &error), KNURL_ERROR_ARGUMENT);
    def = knurl_tessellation_def_default();
    assert_int_equal(knurl_tessellation_create(NULL, &def, &out, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_tessellation_create(t.surface, &def, NULL, &error), KNURL_ERROR_ARGUMENT);
    def.rate = NAN;
    assert_int_equal(knurl_tessellation_create(t.surface, &def, &out, &error), KNURL_ERROR_ARGUMENT);
    assert_null(out);
    traced_free(&t);
    truth_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_torus_is_closed),
        cmocka_unit_test(test_lattices_cover_their_triangle_once),
        cmocka_unit_test(test_no_ray_leaks),
        cmocka_unit_test(test_vertices_are_on_the_surface),
        cmocka_unit_test(test_hits_converge),
        cmocka_unit_test(test_occluded_is_intersect),
        cmocka_unit_test(test_any_number_of_threads),
        cmocka_unit_test(test_any_number_of_threads_at_ties),
        cmocka_unit_test(test_instances_masks_and_memory),
        cmocka_unit_test(test_one_shell_is_the_exact_surface),
        cmocka_unit_test(test_budget),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_definitions_are_checked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
