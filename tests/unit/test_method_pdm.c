/* pdm: its prism against the definition, convergence to Eq. 7, jitter, and rays that start inside. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "methods/pdm/prism.h"
#include "support/random.h"
#include "test_marching_common.h"

/* ---- the prism ---- */

static vec3 random_point(random_state *r, double reach)
{
    double x = random_range(r, -reach, reach), y = random_range(r, -reach, reach);
    return v3(x, y, random_range(r, -reach, reach));
}

/* A triangle with normals that lean at random, in either order of its vertices. */
static triangle_frame random_frame(random_state *r, double lean)
{
    triangle_frame f = {
        .s0 = random_range(r, -0.4, 0.0), .s1 = random_range(r, 0.1, 0.4), .unnormalised = true};
    f.p[1] = f.pe = v3_add(v3(1.0, 0.0, 0.0), random_point(r, 0.3));
    f.p[2] = f.pf = v3_add(v3(0.0, 1.0, 0.0), random_point(r, 0.3));
    vec3 up = v3_scale(v3_normalize(v3_cross(f.pe, f.pf)), random_index(r, 2) ? 1.0 : -1.0);
    for (int i = 0; i < 3; i++) f.n[i] = v3_normalize(v3_add(up, random_point(r, lean)));
    f.ne = v3_sub(f.n[1], f.n[0]);
    f.nf = v3_sub(f.n[2], f.n[0]);
    f.size = 1.0;
    return f;
}

/* How far inside the parallel offset prism a point is, by its definition: its barycentrics in the triangle
 * of the points V_i + w N_i / (N_i . Ng) at its own distance w from the base. Negative outside. */
static double depth_inside(const triangle_frame *f, const prism *p, vec3 at)
{
    double w = v3_dot(p->ng, at), w0 = INFINITY, w1 = -INFINITY;
    vec3 c[3];
    for (int i = 0; i < 3; i++) {
        c[i] = v3_mad(f->p[i], w / v3_dot(f->n[i], p->ng), f->n[i]);
        w0 = fmin(w0, v3_dot(p->ng, p->low[i]));
        w1 = fmax(w1, v3_dot(p->ng, p->high[i]));
    }
    vec3 e = v3_sub(c[1], c[0]), g = v3_sub(c[2], c[0]), to = v3_sub(at, c[0]), n = v3_cross(e, g);
    double b1 = v3_dot(v3_cross(to, g), n) / v3_dot(n, n), b2 = v3_dot(v3_cross(e, to), n) / v3_dot(n, n);
    return fmin(fmin(fmin(b1, b2), 1.0 - b1 - b2), fmin(w - w0, w1 - w));
}

/* Not so where parallel extents would cross, and the standard prism is made. */
static bool is_parallel(const prism *p)
{
    for (int i = 1; i < 3; i++)
        if (fabs(v3_dot(p->ng, v3_sub(p->high[i], p->high[0]))) > 1e-12 ||
            fabs(v3_dot(p->ng, v3_sub(p->low[i], p->low[0]))) > 1e-12)
            return false;
    return true;
}

static void offsets_are_parallel_and_enclose(void **state)
{
    (void)state;
    random_state r = {3};
    for (int k = 0; k < 500; k++) {
        triangle_frame f = random_frame(&r, 0.3);
        prism p;
        assert_true(prism_make(&f, 1e6, &p));
        assert_true(is_parallel(&p));
        /* Eq. 7 between s0 and s1 keeps between both planes. */
        double b1 = random_unit(&r), b2 = random_unit(&r) * (1.0 - b1);
        double h = f.s0 + (f.s1 - f.s0) * random_unit(&r);
        vec3 at = v3_mad(v3_mad(v3_scale(f.pe, b1), b2, f.pf), h, v3_mad(v3_mad(f.n[0], b1, f.ne), b2, f.nf));
        double w = v3_dot(p.ng, at);
        assert_true(w <= v3_dot(p.ng, p.high[0]) + 1e-12 && w >= v3_dot(p.ng, p.low[0]) - 1e-12);
    }
}

static void stretches_are_what_is_inside(void **state)
{
    (void)state;
    random_state r = {4};
    int crossed = 0, twice = 0, started_inside = 0;
    for (int k = 0; k < 20000; k++) {
        triangle_frame f = random_frame(&r, k % 2 ? 0.2 : 0.7);
        prism p;
        prism_stretch s[PRISM_MAX_STRETCHES];
        if (!prism_make(&f, 1e6, &p) || !is_parallel(&p)) continue;
        vec3 o = random_point(&r, 1.5), d = v3_sub(random_point(&r, 0.8), o);
        if (k % 3 == 0) {
            /* Along a side, to cross it twice. */
            double ha = random_unit(&r), hb = random_unit(&r);
            vec3 a = v3_mad(p.low[0], ha, v3_sub(p.high[0], p.low[0]));
            vec3 b = v3_mad(p.low[1], hb, v3_sub(p.high[1], p.low[1]));
            d = v3_add(v3_sub(b, a), random_point(&r, 0.02));
            o = v3_mad(a, -0.5, d);
        }
        int count = prism_intersect(&p, o, d, s);
        crossed += count > 0;
        twice += count > 1;
        for (int i = 0; i < count; i++)
            assert_true(s[i].in <= s[i].out && (i == 0 || s[i].in >= s[i - 1].out));
        for (int j = 0; j < 20; j++) {
            double t = random_range(&r, -1.0, 3.0), depth = depth_inside(&f, &p, v3_mad(o, t, d));
            if (fabs(depth) < 1e-6) continue;
            bool listed = false;
            for (int i = 0; i < count; i++) listed = listed || (t >= s[i].in && t <= s[i].out);
            assert_int_equal(listed, depth > 0.0);
        }
        /* A ray that starts inside has its entry behind it. */
        if (depth_inside(&f, &p, o) > 1e-6) {
            started_inside++;
            assert_true(count > 0 && s[0].in < 0.0);
        }
    }
    printf("prism: %d rays cross, %d more than once, %d start inside\n", crossed, twice, started_inside);
    assert_true(crossed > 3000 && twice > 10 && started_inside > 100);
}

static void creases_limit_the_offset(void **state)
{
    (void)state;
    random_state r = {5};
    triangle_frame f = random_frame(&r, 0.0);
    vec3 up = f.n[0], side = v3_normalize(f.pe);
    f.s0 = 0.0;
    f.s1 = 0.1;
    f.n[1] = v3_mad(v3_scale(up, 0.05), sqrt(1.0 - 0.05 * 0.05), side);
    prism p;
    assert_true(prism_make(&f, 1e6, &p));
    assert_true(fabs(v3_length(v3_sub(p.high[1], f.p[1])) - 2.0) < 1e-9); /* 0.1 / 0.05 */
    assert_true(prism_make(&f, 2.0, &p));
    assert_true(fabs(v3_length(v3_sub(p.high[1], f.p[1])) - 0.2) < 1e-9);
    f.n[1] = v3_mad(v3_scale(up, -0.05), sqrt(1.0 - 0.05 * 0.05), side);
    assert_false(prism_make(&f, 2.0, &p));
}

/* ---- the surface ---- */

static void check_convergence(const char *name, const char *projection)
{
    truth_scene scene;
    assert_true(marching_scene(name, &scene));
    scene.def.unnormalised = true;
    static const double STEPS[3] = {0.5, 0.125, 0.03125};
    marching_error e[3];
    for (int i = 0; i < 3; i++) {
        char method[80];
        snprintf(method, sizeof method, "pdm:step=%g:projection=%s", STEPS[i], projection);
        assert_true(marching_measure(&scene, method, -1, &e[i]));
        assert_int_equal(e[i].contradicted, 0);
        /* Second order: 16 with each step where the map is smooth. */
        if (i > 0) assert_true(e[i].median < e[i - 1].median / 6.0 && e[i].p90 < e[i - 1].p90 / 3.0);
    }
    assert_true(e[2].hits > e[2].rays / 2);
    assert_true(e[2].missed * 200 < e[2].hits && e[2].invented * 200 < e[2].hits);
    assert_true(e[2].median < 2e-6);
    truth_scene_free(&scene);
}

static void linear_projection_converges_where_normals_lean_equally(void **state)
{
    (void)state;
    check_convergence("ico20", "linear");
    check_convergence("plane", "linear");
}

static void exact_projection_converges_everywhere(void **state)
{
    (void)state;
    check_convergence("torus", "exact");
    check_convergence("flat-uv", "exact");
    check_convergence("lod-1.37", "exact");
    check_convergence("sail-512-noise", "exact");
}

/* The paper's projection leaves an error that no step removes; small, and a contrast to the above. */
static void linear_projection_stays_near_where_they_do_not(void **state)
{
    (void)state;
    truth_scene scene;
    marching_error linear, exact;
    assert_true(marching_scene("sail-512-noise", &scene));
    scene.def.unnormalised = true;
    assert_true(marching_measure(&scene, "pdm:step=0.03125", -1, &linear));
    assert_true(marching_measure(&scene, "pdm:step=0.03125:projection=exact", -1, &exact));
    assert_true(linear.median < 1e-3 && linear.missed * 20 < linear.hits);
    assert_true(linear.median > 10.0 * exact.median);
    truth_scene_free(&scene);
}

static void rays_may_start_inside(void **state)
{
    (void)state;
    static const ray_family FAMILIES[2] = {RAYS_SHELL, RAYS_INSIDE};
    truth_scene scene;
    marching_error e;
    assert_true(marching_scene("unnormalised", &scene));
    for (int i = 0; i < 2; i++) {
        assert_true(marching_measure(&scene, "pdm:step=0.03125", (int)FAMILIES[i], &e));
        assert_true(e.hits > MARCHING_RAYS / 3 && e.missed <= 1 && e.invented <= 1 && e.contradicted == 0);
        assert_true(e.median < 1e-5);
    }
    truth_scene_free(&scene);
}

static void winding_does_not_matter(void **state)
{
    (void)state;
    truth_scene scene;
    marching_error e;
    assert_true(marching_scene("ico20", &scene));
    scene.def.unnormalised = true;
    uint32_t *turned = malloc(sizeof *turned * 3 * scene.def.triangle_count);
    const uint32_t *given = scene.def.triangles;
    assert_non_null(turned);
    for (uint32_t i = 0; i < scene.def.triangle_count; i++) {
        turned[3 * i] = given[3 * i];
        turned[3 * i + 1] = given[3 * i + 2];
        turned[3 * i + 2] = given[3 * i + 1];
    }
    scene.def.triangles = turned;
    assert_true(marching_measure(&scene, "pdm:step=0.0625", -1, &e));
    assert_true(e.missed * 100 < e.hits && e.invented * 100 < e.hits && e.median < 5e-6);
    scene.def.triangles = given;
    free(turned);
    truth_scene_free(&scene);
}

/* ---- jitter ---- */

static void jitter_is_repeatable(void **state)
{
    (void)state;
    truth_scene scene;
    traced plain, shifted;
    assert_true(marching_scene("ico80-x4", &scene));
    assert_true(traced_make(&scene.def, "pdm:step=3", 1, &plain));
    assert_true(traced_make(&scene.def, "pdm:step=3:jitter=on", 1, &shifted));
    oracle *o = oracle_create(&scene.def);
    int hits = 0, moved = 0;
    for (uint64_t i = 0; i < 500; i++) {
        oracle_ray made = ray_make(&scene, o, RAYS_TO_SURFACE, i);
        knurl_ray ray = traced_ray(&plain, &made);
        knurl_hit a = {0}, b = {0}, c = {0}, d = {0};
        bool hit = knurl_scene_intersect(shifted.scene, &ray, &b);
        assert_int_equal(knurl_scene_occluded(shifted.scene, &ray), hit);
        if (!hit) continue;
        hits++;
        assert_true(knurl_scene_intersect(shifted.scene, &ray, &c));
        assert_true(c.t == b.t && c.a == b.a && c.b == b.b);
        moved += knurl_scene_intersect(plain.scene, &ray, &a) && a.t != b.t;
        ray.tmax = b.t; /* a shorter ray finds the same samples, and so the same hit */
        assert_true(knurl_scene_intersect(shifted.scene, &ray, &d) && d.t == b.t);
        ray.tmax = b.t * (1.0 - 1e-9);
        assert_false(knurl_scene_intersect(shifted.scene, &ray, &d));
    }
    assert_true(hits > 250 && moved > hits / 2);
    oracle_destroy(o);
    traced_free(&plain);
    traced_free(&shifted);
    truth_scene_free(&scene);
}

/* A ridge one texel wide at half of its height, between two samples of a step of 8 texels for every ray that
 * runs across it at that height (section 5.3). */
static int ridge_hits(const char *method, int rays)
{
    static const float positions[9] = {0, 0, 0, 0, 0, 1, 2, 0, 0.5f},
                       normals[9] = {0, 1, 0, 0, 1, 0, 0, 1, 0};
    static const float texcoords[6] = {0, 0, 0, 1, 2, 0.5f};
    static const uint32_t triangle[3] = {0, 1, 2};
    float samples[64] = {0};
    samples[36] = 1.0f;
    oracle_def def = {.positions = positions,
                      .normals = normals,
                      .texcoords = texcoords,
                      .vertex_count = 3,
                      .triangles = triangle,
                      .triangle_count = 1,
                      .width = 64,
                      .height = 1,
                      .format = ORACLE_F32,
                      .samples = samples,
                      .factor = 0.5,
                      .uv_scale = {1.0, 1.0},
                      .wrap_u = ORACLE_CLAMP,
                      .wrap_v = ORACLE_CLAMP,
                      .unnormalised = true};
    traced t;
    assert_true(traced_make(&def, method, 1, &t));
    int hits = 0;
    for (int i = 0; i < rays; i++) {
        double origin[3] = {-1.0, 0.25, 0.4 + 0.2 * i / rays}, direction[3] = {1.0, 0.0, 0.0};
        knurl_ray ray = knurl_ray_make(origin, direction);
        hits += knurl_scene_occluded(t.scene, &ray);
    }
    traced_free(&t);
    return hits;
}

static void jitter_finds_thin_features(void **state)
{
    (void)state;
    assert_int_equal(ridge_hits("rmip", 400), 400);
    assert_int_equal(ridge_hits("pdm:step=0.5", 400), 400);
    assert_int_equal(ridge_hits("pdm:step=8", 400), 0);
    int hits = ridge_hits("pdm:step=8:jitter=on", 400); /* one in eight: 50, standard deviation 7 */
    printf("jitter: %d of 400\n", hits);
    assert_in_range(hits, 20, 80);
}

/* ---- the rest ---- */

static void parameters_are_checked(void **state)
{
    (void)state;
    static const char *const WRONG[] = {
        "pdm:step=0",           "pdm:step=-1",         "pdm:step=nan",     "pdm:jitter=2",
        "pdm:offset-limit=0.9", "pdm:projection=bent", "pdm:offset-limit", "pdm:samples=3",
    };
    int32_t index = -1;
    assert_int_equal(
        knurl_method_check("pdm:step=0.25:jitter=on:offset-limit=4:projection=exact", &index, NULL),
        KNURL_OK);
    assert_string_equal(knurl_method_name(index), "pdm");
    assert_int_equal(knurl_method_flags(index), KNURL_METHOD_UNNORMALISED);
    for (size_t i = 0; i < sizeof WRONG / sizeof WRONG[0]; i++)
        assert_int_equal(knurl_method_check(WRONG[i], NULL, NULL), KNURL_ERROR_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(offsets_are_parallel_and_enclose),
        cmocka_unit_test(stretches_are_what_is_inside),
        cmocka_unit_test(creases_limit_the_offset),
        cmocka_unit_test(linear_projection_converges_where_normals_lean_equally),
        cmocka_unit_test(exact_projection_converges_everywhere),
        cmocka_unit_test(linear_projection_stays_near_where_they_do_not),
        cmocka_unit_test(rays_may_start_inside),
        cmocka_unit_test(winding_does_not_matter),
        cmocka_unit_test(jitter_is_repeatable),
        cmocka_unit_test(jitter_finds_thin_features),
        cmocka_unit_test(parameters_are_checked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
