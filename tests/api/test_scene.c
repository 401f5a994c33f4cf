/* Plain-mesh scenes against brute force: every ray against every triangle, in long double. */
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

enum { MAX_INSTANCES = 16 };

typedef struct placed {
    double transform[12];
    uint32_t mask;
} placed;

typedef struct world {
    knurl_context *context;
    knurl_scene *scene;
    knurl_mesh_view mesh;
    float *positions;
    uint32_t *triangles;
    placed instances[MAX_INSTANCES];
    uint32_t instance_count;
    double centre[3], size; /* to aim rays at */
} world;

/* ---- Making --------------------------------------------------------------------------------- */

static void make_soup(world *w, random_state *random, uint32_t triangles, double centre, double size)
{
    w->positions = malloc(triangles * 9 * sizeof(float));
    w->triangles = malloc(triangles * 3 * sizeof(uint32_t));
    assert_true(w->positions && w->triangles);
    for (uint32_t i = 0; i < triangles; i++) {
        double p[3];
        for (int k = 0; k < 3; k++) p[k] = centre + size * random_range(random, -1.0, 1.0);
        for (int v = 0; v < 3; v++) {
            for (int k = 0; k < 3; k++)
                w->positions[9 * i + 3 * (uint32_t)v + (uint32_t)k] =
                    (float)(p[k] + 0.4 * size * random_range(random, -1.0, 1.0));
            w->triangles[3 * i + (uint32_t)v] = 3 * i + (uint32_t)v;
        }
    }
    w->mesh = (knurl_mesh_view){.positions = w->positions,
                                .vertex_count = 3 * triangles,
                                .triangles = w->triangles,
                                .triangle_count = triangles};
    for (int k = 0; k < 3; k++) w->centre[k] = centre;
    w->size = size;
}

/* A closed sphere of `rows` x `columns`, vertices shared. */
static void make_sphere(world *w, uint32_t rows, uint32_t columns, double radius)
{
    uint32_t vertices = (rows - 1) * columns + 2, n = 0;
    w->positions = malloc(vertices * 3 * sizeof(float));
    w->triangles = malloc((size_t)rows * columns * 6 * sizeof(uint32_t));
    assert_true(w->positions && w->triangles);
    const double pi = acos(-1.0);
    for (uint32_t v = 0; v < vertices; v++) {
        uint32_t r = v < vertices - 2 ? v / columns + 1 : v == vertices - 2 ? 0 : rows;
        double theta = pi * r / rows, phi = 2.0 * pi * (v % columns) / columns;
        w->positions[3 * v] = (float)(radius * sin(theta) * cos(phi));
        w->positions[3 * v + 1] = (float)(radius * cos(theta));
        w->positions[3 * v + 2] = (float)(radius * sin(theta) * sin(phi));
    }
    for (uint32_t r = 0; r < rows; r++)
        for (uint32_t c = 0; c < columns; c++) {
            uint32_t next = (c + 1) % columns;
            uint32_t a = r == 0 ? vertices - 2 : (r - 1) * columns + c, b = (r - 1) * columns + next;
            uint32_t d = r == rows - 1 ? vertices - 1 : r * columns + c, e = r * columns + next;
            if (r > 0) memcpy(w->triangles + 3 * n++, (uint32_t[]){a, b, d}, 12);
            if (r == 0)
                memcpy(w->triangles + 3 * n++, (uint32_t[]){a, e, d}, 12);
            else if (r < rows - 1)
                memcpy(w->triangles + 3 * n++, (uint32_t[]){b, e, d}, 12);
        }
    w->mesh = (knurl_mesh_view){
        .positions = w->positions, .vertex_count = vertices, .triangles = w->triangles, .triangle_count = n};
    w->size = radius;
}

static void place(world *w, const double transform[12], uint32_t mask)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    placed *p = &w->instances[w->instance_count++];
    memcpy(p->transform, transform ? transform : identity, sizeof identity);
    p->mask = mask;
}

/* A random invertible transform: rotation-like, stretched, mirrored every other time. */
static void random_transform(random_state *random, double spread, double m[12])
{
    double det;
    do {
        for (int i = 0; i < 12; i++)
            m[i] = i % 4 == 3 ? random_range(random, -spread, spread) : random_range(random, -2, 2);
        det = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
              m[2] * (m[4] * m[9] - m[5] * m[8]);
    } while (fabs(det) < 0.3);
}

static void finish(world *w, int32_t threads)
{
    knurl_error error;
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    assert_int_equal(knurl_context_create(&def, &w->context, &error), KNURL_OK);
    assert_int_equal(knurl_scene_create(w->context, &w->scene, &error), KNURL_OK);
    uint32_t object, instance;
    assert_int_equal(knurl_scene_add_mesh(w->scene, &w->mesh, &object, &error), KNURL_OK);
    for (uint32_t i = 0; i < w->instance_count; i++) {
        assert_int_equal(knurl_scene_add_instance(w->scene, object, w->instances[i].transform,
                                                  w->instances[i].mask, &instance, &error),
                         KNURL_OK);
        assert_int_equal(instance, i);
    }
    assert_int_equal(knurl_scene_commit(w->scene, &error), KNURL_OK);
}

static void release(world *w)
{
    knurl_scene_release(w->scene);
    assert_true(knurl_context_bytes(w->context) == 0);
    knurl_context_release(w->context);
    free(w->positions);
    free(w->triangles);
}

/* ---- Brute force ------------------------------------------------------------------------------ */

typedef long double real;

typedef struct brute_hit {
    real t;
    real edge; /* least barycentric, or how far outside the nearest miss was: near 0 is undecided */
    uint32_t triangle, instance;
    real normal[3];
} brute_hit;

static void cross(const real a[3], const real b[3], real c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}
static real dot(const real a[3], const real b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Moeller and Trumbore 1997. */
static void brute_triangle(const knurl_ray *ray, real v[3][3], uint32_t triangle, uint32_t instance,
                           brute_hit *best)
{
    real e1[3], e2[3], o[3], d[3], p[3], q[3], n[3];
    for (int k = 0; k < 3; k++) {
        e1[k] = v[1][k] - v[0][k];
        e2[k] = v[2][k] - v[0][k];
        o[k] = (real)ray->origin[k] - v[0][k];
        d[k] = (real)ray->direction[k];
    }
    cross(d, e2, p);
    real det = dot(e1, p);
    if (det == 0) return;
    cross(o, e1, q);
    real a = dot(o, p) / det, b = dot(d, q) / det, t = dot(e2, q) / det;
    real inside = fminl(fminl(a, b), 1 - a - b);
    bool ahead = t >= (real)ray->tmin && t <= (real)ray->tmax;
    if (ahead && fabsl(inside) < best->edge) best->edge = fabsl(inside);
    if (!ahead || inside < 0 || t >= best->t) return;
    best->t = t;
    best->triangle = triangle;
    best->instance = instance;
    cross(e1, e2, n);
    real length = sqrtl(dot(n, n));
    for (int k = 0; k < 3; k++) best->normal[k] = n[k] / length;
}

static brute_hit brute_force(const world *w, const knurl_ray *ray)
{
    brute_hit best = {.t = INFINITY, .edge = 1, .triangle = KNURL_NO_HIT};
    for (uint32_t i = 0; i < w->instance_count; i++) {
        const double *m = w->instances[i].transform;
        if (!(w->instances[i].mask & ray->mask)) continue;
        for (uint32_t t = 0; t < w->mesh.triangle_count; t++) {
            real v[3][3];
            for (int c = 0; c < 3; c++) {
                const float *p = w->positions + 3 * (size_t)w->triangles[3 * t + (uint32_t)c];
                for (int k = 0; k < 3; k++)
                    v[c][k] = (real)m[4 * k] * (real)p[0] + (real)m[4 * k + 1] * (real)p[1] +
                              (real)m[4 * k + 2] * (real)p[2] + (real)m[4 * k + 3];
            }
            brute_triangle(ray, v, t, i, &best);
        }
    }
    return best;
}

/* From `distance` sizes away through a point near the world's middle, direction of any length. */
static knurl_ray random_ray(const world *w, random_state *random, double distance)
{
    double from[3], to[3], length = pow(10.0, random_range(random, -3.0, 3.0)), norm = 0.0;
    for (int k = 0; k < 3; k++) {
        from[k] = random_range(random, -1.0, 1.0);
        norm += from[k] * from[k];
    }
    for (int k = 0; k < 3; k++) {
        from[k] = w->centre[k] + from[k] / sqrt(norm) * distance * w->size;
        to[k] = w->centre[k] + 0.9 * w->size * random_range(random, -1.0, 1.0);
        to[k] = (to[k] - from[k]) / (distance * w->size) * length;
    }
    knurl_ray ray = knurl_ray_make(from, to);
    if (random_index(random, 4) == 0) ray.tmin = random_range(random, 0.0, 1.0) / length * distance * w->size;
    if (random_index(random, 4) == 0)
        ray.tmax = ray.tmin + random_range(random, 0.0, 1.0) / length * distance * w->size;
    return ray;
}

/* Traces `count` rays. Allowed errors in sizes: `slack` of t, as a length, which cannot be better than
 * the last bit of t; `place_slack` of the position, which far origins must not hurt. */
static void compare(const world *w, uint64_t seed, int count, double distance, double slack,
                    double place_slack)
{
    random_state random = {seed};
    int hits = 0, undecided = 0;
    for (int i = 0; i < count; i++) {
        knurl_ray ray = random_ray(w, &random, distance);
        brute_hit truth = brute_force(w, &ray);
        knurl_hit hit;
        bool found = knurl_scene_intersect(w->scene, &ray, &hit);
        assert_int_equal(found, knurl_scene_occluded(w->scene, &ray));
        assert_int_equal(found, hit.triangle != KNURL_NO_HIT);
        if ((double)truth.edge < 1e-9) {
            undecided++;
            continue;
        }
        assert_int_equal(found, truth.triangle != KNURL_NO_HIT);
        if (!found) continue;
        hits++;
        const double *d = ray.direction;
        double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        double along = fabs((double)((real)hit.t - truth.t)) * length;
        if (along > slack * w->size) print_message("ray %d: t %.17g, expected %.17Lg\n", i, hit.t, truth.t);
        assert_true(along <= slack * w->size);
        if (hit.triangle != truth.triangle || hit.instance != truth.instance)
            continue; /* as near as makes no odds */
        double agree = 0.0, off = 0.0;
        for (int k = 0; k < 3; k++) {
            agree += hit.ng[k] * (double)truth.normal[k];
            real p = (real)ray.origin[k] + truth.t * (real)d[k];
            off = fmax(off, fabs((double)(p - (real)hit.position[k])));
        }
        assert_true(agree > 1.0 - 1e-9);
        if (off > place_slack * w->size) print_message("ray %d: position off by %g\n", i, off);
        assert_true(off <= place_slack * w->size);
    }
    assert_true(hits > count / 10);
    assert_true(undecided < count / 100 + 2);
}

static void assert_near(double value, double expected, double slack)
{
    if (!(fabs(value - expected) <= slack)) print_message("%.17g, expected %.17g\n", value, expected);
    assert_true(fabs(value - expected) <= slack);
}

/* ---- Tests ------------------------------------------------------------------------------------ */

static void test_single_mesh(void **state)
{
    (void)state;
    world w = {0};
    random_state random = {1};
    make_soup(&w, &random, 200, 0.0, 1.0);
    place(&w, NULL, UINT32_MAX);
    finish(&w, 1);
    compare(&w, 10, 4000, 3.0, 1e-12, 1e-12);
    compare(&w, 11, 1000, 0.5, 1e-12, 1e-12);
    release(&w);
}

static void test_far_origins(void **state)
{
    (void)state;
    world w = {0};
    random_state random = {2};
    make_soup(&w, &random, 100, 0.0, 1.0);
    place(&w, NULL, UINT32_MAX);
    finish(&w, 1);
    /* t has 53 bits for 1e5 sizes; the ray itself is exact. */
    compare(&w, 20, 2000, 1e5, 1e-10, 1e-11);
    compare(&w, 21, 1000, 1e6, 1e-9, 1e-11);
    /* Here the brute force itself is good to 1e-10 only, times the slant of the triangle. */
    compare(&w, 22, 1000, 1e9, 1e-6, 1e-7);
    release(&w);
}

static void test_far_objects(void **state)
{
    (void)state;
    world w = {0};
    random_state random = {3};
    make_soup(&w, &random, 100, 1e5, 1.0);
    place(&w, NULL, UINT32_MAX);
    finish(&w, 1);
    compare(&w, 30, 2000, 3.0, 1e-9, 1e-10);
    compare(&w, 31, 1000, 1e5, 1e-8, 1e-10);
    release(&w);
}

static void test_sizes(void **state)
{
    (void)state;
    const double sizes[] = {1e-18, 1e-6, 1e6, 1e17, 1e30};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        world w = {0};
        random_state random = {40 + i};
        make_soup(&w, &random, 60, 0.0, sizes[i]);
        place(&w, NULL, UINT32_MAX);
        finish(&w, 1);
        compare(&w, 50 + i, 600, 3.0, 1e-12, 1e-12);
        release(&w);
    }
}

static void check_instances(uint32_t count, uint64_t seed, double spread)
{
    world w = {0};
    random_state random = {seed};
    make_soup(&w, &random, 30, 0.0, 0.5);
    for (uint32_t i = 0; i < count; i++) {
        double m[12];
        random_transform(&random, spread, m);
        place(&w, m, UINT32_MAX);
    }
    w.size = spread + 0.5;
    finish(&w, 2);
    compare(&w, seed + 100, 1500, 3.0, 1e-11, 1e-11);
    compare(&w, seed + 101, 500, 1e4, 1e-9, 1e-9);
    release(&w);
}

static void test_instances(void **state)
{
    (void)state;
    check_instances(1, 61, 0.5);
    check_instances(3, 62, 1.0);
    check_instances(4, 63, 1.0);
    check_instances(5, 64, 1.0);
    check_instances(16, 65, 2.0);
}

static void test_instances_far_away(void **state)
{
    (void)state;
    world w = {0};
    random_state random = {70};
    make_soup(&w, &random, 50, 0.0, 1.0);
    for (int i = 0; i < 6; i++) {
        double m[12];
        random_transform(&random, 2.0, m);
        m[3] += 1e5, m[7] += 1e5, m[11] += 1e5;
        place(&w, m, UINT32_MAX);
    }
    for (int k = 0; k < 3; k++) w.centre[k] = 1e5;
    w.size = 3.0;
    finish(&w, 1);
    compare(&w, 71, 1500, 3.0, 1e-9, 1e-9);
    release(&w);
}

static void test_mirror_and_stretch(void **state)
{
    (void)state;
    const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const float normals[] = {0, 0, 1, 0, 0, 1, 0.6f, 0, 0.8f};
    const float texcoords[] = {0, 0, 1, 0, 0, 1};
    const uint32_t triangles[] = {0, 1, 2};
    knurl_error error;
    knurl_context *context;
    knurl_scene *scene;
    knurl_context_def def = knurl_context_def_default();
    assert_int_equal(knurl_context_create(&def, &context, &error), KNURL_OK);
    assert_int_equal(knurl_scene_create(context, &scene, &error), KNURL_OK);
    knurl_mesh_view mesh = {.positions = positions,
                            .normals = normals,
                            .texcoords = texcoords,
                            .vertex_count = 3,
                            .triangles = triangles,
                            .triangle_count = 1};
    assert_int_equal(knurl_scene_add_mesh(scene, &mesh, NULL, &error), KNURL_OK);
    const double mirror[12] = {-2, 0, 0, 10, 0, 1, 0, 0, 0, 0, 4, 5};
    assert_int_equal(knurl_scene_add_instance(scene, 0, mirror, 1, NULL, &error), KNURL_OK);
    assert_int_equal(knurl_scene_commit(scene, &error), KNURL_OK);
    const double origin[3] = {9.5, 0.25, 9.0}, direction[3] = {0, 0, -2};
    knurl_ray ray = knurl_ray_make(origin, direction);
    knurl_hit hit;
    assert_true(knurl_scene_intersect(scene, &ray, &hit));
    assert_near(hit.t, 2.0, 1e-14);
    assert_near(hit.a, 0.25, 1e-14);
    assert_near(hit.b, 0.25, 1e-14);
    assert_near(hit.st[0], 0.25, 1e-14);
    assert_near(hit.uv[1], 0.25, 1e-14);
    assert_near(hit.position[0], 9.5, 1e-13);
    assert_near(hit.position[2], 5.0, 1e-13);
    /* S_a x S_b of the mirrored triangle: (-2, 0, 0) x (0, 1, 0). */
    assert_near(hit.ng[2], -1.0, 1e-14);
    /* The shading normal stays on ng's side; x shrinks by 2, z by 4, x is mirrored. */
    double n[3] = {-(0.25 * 0.6 / -2.0), 0.0, -(0.75 + 0.25 * 0.8) / 4.0};
    double length = sqrt(n[0] * n[0] + n[2] * n[2]);
    assert_near(hit.ns[0], n[0] / length, 1e-7);
    assert_near(hit.ns[2], n[2] / length, 1e-7);
    assert_true(hit.error > 0.0 && hit.error < 1e-12);
    assert_int_equal(hit.object, 0);
    assert_true(hit.steps > 0);
    double lower[3], upper[3];
    knurl_scene_bounds(scene, lower, upper);
    assert_near(lower[0], 8.0, 1e-12);
    assert_near(upper[0], 10.0, 1e-12);
    assert_near(upper[1], 1.0, 1e-12);
    assert_near(lower[2], 5.0, 1e-12);
    knurl_scene_release(scene);
    knurl_context_release(context);
}

static void test_masks(void **state)
{
    (void)state;
    for (uint32_t count = 3; count <= 9; count += 6) {
        world w = {0};
        make_sphere(&w, 6, 8, 1.0);
        for (uint32_t i = 0; i < count; i++) {
            double m[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -3.0 * i};
            place(&w, m, i == 1 ? 0 : 1u << i);
        }
        finish(&w, 1);
        const double origin[3] = {0.1, 0.2, 5}, direction[3] = {0, 0, -1};
        for (uint32_t i = 0; i < count; i++) {
            knurl_ray ray = knurl_ray_make(origin, direction);
            knurl_hit hit;
            ray.mask = 1u << i;
            assert_int_equal(knurl_scene_intersect(w.scene, &ray, &hit), i != 1);
            assert_int_equal(knurl_scene_occluded(w.scene, &ray), i != 1);
            if (i != 1) assert_int_equal(hit.instance, i);
        }
        knurl_ray ray = knurl_ray_make(origin, direction);
        ray.mask = 0;
        assert_false(knurl_scene_occluded(w.scene, &ray));
        release(&w);
    }
}

/* Rays from inside a closed mesh, aimed at its vertices and edges, must all hit. */
static void test_watertight(void **state)
{
    (void)state;
    for (int far = 0; far < 2; far++) {
        world w = {0};
        make_sphere(&w, 9, 13, 1.0);
        double m[12] = {0.9, 0.3, 0.1, 0, -0.2, 1.1, 0.4, 0, 0.3, -0.1, 0.8, 0};
        if (far) m[3] = 4e4, m[7] = -7e4, m[11] = 1e5;
        place(&w, m, 1);
        finish(&w, 1);
        random_state random = {80};
        for (int i = 0; i < 100000; i++) {
            uint32_t t = random_index(&random, w.mesh.triangle_count), c = random_index(&random, 3);
            const float *p = w.positions + 3 * (size_t)w.triangles[3 * t + c];
            const float *q = w.positions + 3 * (size_t)w.triangles[3 * t + (c + 1) % 3];
            double s = random_index(&random, 2) ? random_unit(&random) : 0.0, x[3], origin[3], direction[3];
            for (int k = 0; k < 3; k++) x[k] = (1.0 - s) * (double)p[k] + s * (double)q[k];
            for (int k = 0; k < 3; k++) {
                origin[k] = m[4 * k + 3] + 0.3 * random_range(&random, -1.0, 1.0);
                direction[k] =
                    m[4 * k] * x[0] + m[4 * k + 1] * x[1] + m[4 * k + 2] * x[2] + m[4 * k + 3] - origin[k];
            }
            knurl_ray ray = knurl_ray_make(origin, direction);
            knurl_hit hit;
            assert_true(knurl_scene_intersect(w.scene, &ray, &hit));
            assert_true(fabs(hit.t - 1.0) < 1e-2);
            assert_true(knurl_scene_occluded(w.scene, &ray));
        }
        release(&w);
    }
}

/* Shadow rays that start 2 * error off the surface never see the surface they start on. */
static void test_secondary_rays(void **state)
{
    (void)state;
    for (int far = 0; far < 2; far++) {
        world w = {0};
        make_sphere(&w, 12, 16, 1.0);
        double m[12] = {2, 0.5, 0, 0, 0, 0.1, 0.3, 0, 0.2, 0, 1, 0};
        if (far) m[3] = 1e6, m[7] = -7e4;
        place(&w, m, 1);
        finish(&w, 1);
        random_state random = {90};
        int tried = 0;
        for (int i = 0; i < 20000; i++) {
            double origin[3], direction[3], out[3];
            for (int k = 0; k < 3; k++) {
                direction[k] = random_range(&random, -1.0, 1.0);
                origin[k] = m[4 * k + 3];
            }
            knurl_ray ray = knurl_ray_make(origin, direction);
            knurl_hit hit;
            assert_true(knurl_scene_intersect(w.scene, &ray, &hit));
            double side = 0.0, cosine = 0.0;
            for (int k = 0; k < 3; k++) side += hit.ng[k] * direction[k];
            for (int k = 0; k < 3; k++) {
                double n = side > 0.0 ? hit.ng[k] : -hit.ng[k]; /* outwards: the ray left from within */
                hit.position[k] += 2.0 * hit.error * n;
                out[k] = random_range(&random, -1.0, 1.0);
                cosine += out[k] * n;
            }
            if (cosine <= 0.0) continue;
            tried++;
            ray = knurl_ray_make(hit.position, out);
            assert_false(knurl_scene_occluded(w.scene, &ray)); /* the sphere is convex */
        }
        assert_true(tried > 5000);
        release(&w);
    }
}

static void test_shading_normals_default_to_flat(void **state)
{
    (void)state;
    world w = {0};
    make_sphere(&w, 6, 8, 1.0);
    place(&w, NULL, 1);
    finish(&w, 1);
    const double origin[3] = {0, 0, 0}, direction[3] = {0.3, 0.2, 0.5};
    knurl_ray ray = knurl_ray_make(origin, direction);
    knurl_hit hit;
    assert_true(knurl_scene_intersect(w.scene, &ray, &hit));
    for (int k = 0; k < 3; k++) assert_true(hit.ns[k] == hit.ng[k]);
    release(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_single_mesh),
        cmocka_unit_test(test_far_origins),
        cmocka_unit_test(test_far_objects),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_instances),
        cmocka_unit_test(test_instances_far_away),
        cmocka_unit_test(test_mirror_and_stretch),
        cmocka_unit_test(test_masks),
        cmocka_unit_test(test_watertight),
        cmocka_unit_test(test_secondary_rays),
        cmocka_unit_test(test_shading_normals_default_to_flat),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
