/* One triangle against rays: what is refused, and what must end, whatever the numbers are. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/knurl.h>

#include "support/random.h"

#include <math.h>
#include <string.h>

static const float POSITIONS[9] = {0, 0, 0, 1, 0, 0, 0, 0, 1};
static const float TEXCOORDS[6] = {0, 0, 1, 0, 0, 1};
static const uint32_t TRIANGLE[3] = {0, 1, 2};

static knurl_context *make_context(void)
{
    knurl_context *context = NULL;
    knurl_context_def def = knurl_context_def_default();
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

static knurl_heightmap *make_map(knurl_context *context, int32_t side, const float *samples)
{
    knurl_image *image = NULL;
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_image_create(context, side, side, 1, KNURL_PIXEL_F32, samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    return map;
}

static knurl_heightmap *random_map(knurl_context *context, int32_t side)
{
    float samples[64 * 64];
    random_state random = {3};
    assert_true(side <= 64);
    for (int i = 0; i < side * side; i++) samples[i] = (float)random_unit(&random);
    return make_map(context, side, samples);
}

static knurl_surface_def triangle_def(const float *normals, knurl_heightmap *map, double factor)
{
    knurl_surface_def def = knurl_surface_def_default();
    def.mesh = (knurl_mesh_view){.positions = POSITIONS,
                                 .normals = normals,
                                 .texcoords = TEXCOORDS,
                                 .vertex_count = 3,
                                 .triangles = TRIANGLE,
                                 .triangle_count = 1};
    def.displacement.map = map;
    def.displacement.factor = factor;
    return def;
}

/* Creates the surface and gives the map back. */
static knurl_surface *create(knurl_context *context, knurl_surface_def *def)
{
    knurl_surface *surface = NULL;
    knurl_error error = {.message = ""};
    if (knurl_surface_create(context, def, &surface, &error) != KNURL_OK) fail_msg("%s", error.message);
    knurl_heightmap_release(def->displacement.map);
    return surface;
}

/* Normals that turn by 180 degrees along an edge pass through zero on a whole line. Searching there must
 * not take time that grows with every halving. */
static void opposing_normals_end(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    static const double angles[] = {150, 175, 179, 179.99, 179.99999, 180};
    for (size_t k = 0; k < sizeof angles / sizeof angles[0]; k++) {
        double a = angles[k] * acos(-1.0) / 180.0;
        float normals[9] = {0, 1, 0, (float)sin(a), (float)cos(a), 0, 0, 1, 0};
        if (angles[k] == 180.0) normals[3] = 0.0f;
        knurl_surface_def def = triangle_def(normals, random_map(context, 16), 0.1);
        knurl_surface *surface = create(context, &def);
        knurl_surface_info info;
        knurl_surface_get_info(surface, &info);
        assert_int_equal(info.folded, 1);
        for (int i = 0; i <= 40; i++) {
            double origin[3] = {0.3 + 0.01 * i, 1, 0.2}, direction[3] = {0, -1, 0.01};
            knurl_ray ray = knurl_ray_make(origin, direction);
            knurl_hit hit = {.triangle = KNURL_NO_HIT};
            knurl_surface_intersect(surface, 0, &ray, &hit);
            assert_true(hit.steps < 50000);
        }
        knurl_surface_release(surface);
    }
    knurl_context_release(context);
}

/* t counts in the direction's length, however long or short that is. */
static void any_direction_length(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    static const float bent[9] = {0, 1, 0, 0.1f, 1, 0, 0, 1, 0.1f}, folded[9] = {0, 1, 0, 1, -1, 0, 0, 1, 0};
    static const int exponents[] = {-1000, -600, -300, -80, -10, 0, 10, 80, 300, 600, 1000};
    for (int f = 0; f < 2; f++) {
        knurl_surface_def def = triangle_def(f ? folded : bent, random_map(context, 16), 0.1);
        knurl_surface *surface = create(context, &def);
        double reference = 0.0;
        for (int pass = 0; pass < 2; pass++)
            for (size_t k = 0; k < sizeof exponents / sizeof exponents[0]; k++) {
                double length = ldexp(1.0, exponents[k]);
                double origin[3] = {0.21, 1, 0.2}, direction[3] = {0, -length, 0.01 * length};
                knurl_ray ray = knurl_ray_make(origin, direction);
                knurl_hit hit = {.triangle = KNURL_NO_HIT};
                if (exponents[k] != 0 && pass == 0) continue;
                assert_true(knurl_surface_intersect(surface, 0, &ray, &hit));
                if (pass == 0) reference = hit.t;
                assert_true(fabs(ldexp(hit.t, exponents[k]) - reference) < 1e-12);
                ray.tmax = 0.5 * hit.t;
                assert_false(knurl_surface_intersect(surface, 0, &ray, &hit));
                assert_false(knurl_surface_occluded(surface, 0, &ray));
            }
        knurl_surface_release(surface);
    }
    knurl_context_release(context);
}

static void huge_heights_are_refused(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    static const float samples[4] = {1e38f, -1e38f, 3e38f, 0};
    knurl_heightmap *map = make_map(context, 2, samples);
    static const double factors[] = {1e10, 1.0, -1e-19};
    for (size_t k = 0; k < 3; k++) {
        knurl_surface_def def = triangle_def(NULL, map, factors[k]);
        knurl_surface *surface = NULL;
        knurl_error error = {.message = ""};
        assert_int_equal(knurl_surface_create(context, &def, &surface, &error), KNURL_ERROR_ARGUMENT);
        assert_non_null(strstr(error.message, "expected below 1e18"));
        assert_null(surface);
    }
    knurl_surface_def def = triangle_def(NULL, map, 1e-38);
    knurl_surface_release(create(context, &def));
    knurl_context_release(context);
}

/* Parameters of texel lines closer than the curve's last bits. */
static void fine_texels_end(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    static const float bent[9] = {0, 1, 0, 0.1f, 1, 0, 0, 1, 0.1f};
    for (int k = 0; k < 40; k++) {
        knurl_surface_def def = triangle_def(bent, random_map(context, 4), 1e-4);
        def.displacement.uv_scale[0] = def.displacement.uv_scale[1] = 4096.0;
        def.displacement.offset = k < 20 ? 0.0 : 1e5;
        def.method = k % 2 ? "rmip:marching-scale=1" : "rmip";
        knurl_surface *surface = create(context, &def);
        double sine = pow(10.0, -1.0 - 0.2 * k);
        double origin[3] = {-0.7, def.displacement.offset + sine + 5e-5, 0.3},
               direction[3] = {1, -sine, 0.01};
        knurl_ray ray = knurl_ray_make(origin, direction);
        knurl_hit hit = {.triangle = KNURL_NO_HIT};
        knurl_surface_intersect(surface, 0, &ray, &hit);
        assert_true(hit.steps < 1000000);
        knurl_surface_release(surface);
    }
    knurl_context_release(context);
}

/* A ring of quads whose chart closes at u = 1: no seam if the map repeats, one if it is clamped. */
static void seams_know_wrapping(void **state)
{
    (void)state;
    enum { N = 8 };
    float positions[(N + 1) * 6], texcoords[(N + 1) * 4];
    uint32_t triangles[N * 6];
    for (uint32_t i = 0; i <= N; i++)
        for (uint32_t k = 0; k < 2; k++) {
            uint32_t v = 2 * i + k;
            double a = 2.0 * acos(-1.0) * (double)(i % N) / N;
            positions[3 * v] = (float)cos(a);
            positions[3 * v + 1] = (float)k;
            positions[3 * v + 2] = (float)sin(a);
            texcoords[2 * v] = (float)i / N;
            texcoords[2 * v + 1] = (float)k;
        }
    for (uint32_t i = 0; i < N; i++)
        memcpy(triangles + 6 * i, (uint32_t[]){2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 2, 2 * i + 1, 2 * i + 3},
               24);
    knurl_context *context = make_context();
    const struct {
        knurl_wrap wrap;
        double scale;
        uint64_t seams;
    } cases[] = {{KNURL_WRAP_REPEAT, 1, 0}, {KNURL_WRAP_REPEAT, 3, 0}, {KNURL_WRAP_REPEAT, 1.5, 1},
                 {KNURL_WRAP_MIRROR, 1, 1}, {KNURL_WRAP_MIRROR, 2, 0}, {KNURL_WRAP_CLAMP, 1, 1}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        knurl_surface_def def = triangle_def(NULL, random_map(context, 8), 0.1);
        def.mesh = (knurl_mesh_view){.positions = positions,
                                     .texcoords = texcoords,
                                     .vertex_count = 2 * (N + 1),
                                     .triangles = triangles,
                                     .triangle_count = 2 * N};
        def.displacement.wrap_u = cases[k].wrap;
        def.displacement.uv_scale[0] = cases[k].scale;
        knurl_surface *surface = create(context, &def);
        knurl_surface_info info;
        knurl_surface_get_info(surface, &info);
        assert_int_equal(info.seam_edges, cases[k].seams);
        knurl_surface_release(surface);
    }
    knurl_context_release(context);
}

/* Directions that point to one apex: the surface at a constant height is the base seen smaller. */
static void directions_make_a_frustum(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    static const double apex[3] = {0.2, 2.0, 0.3};
    float directions[9];
    for (int i = 0; i < 9; i++) directions[i] = (float)apex[i % 3] - POSITIONS[i];
    static const float quarter = 0.25f;
    knurl_surface_def def = triangle_def(NULL, make_map(context, 1, &quarter), 1.0);
    def.mesh.directions = directions;
    knurl_surface *surface = create(context, &def);
    random_state random = {5};
    for (int i = 0; i < 200; i++) {
        double b1 = random_unit(&random), b2 = random_unit(&random);
        if (b1 + b2 > 0.98) continue;
        double on[3] = {0.75 * b1 + 0.25 * apex[0], 0.25 * apex[1], 0.75 * b2 + 0.25 * apex[2]};
        double origin[3] = {random_unit(&random), 3.0, random_unit(&random)}, direction[3];
        for (int c = 0; c < 3; c++) direction[c] = on[c] - origin[c];
        knurl_ray ray = knurl_ray_make(origin, direction);
        knurl_hit hit = {.triangle = KNURL_NO_HIT};
        assert_true(knurl_surface_intersect(surface, 0, &ray, &hit));
        assert_true(fabs(hit.t - 1.0) < 1e-6 && fabs(hit.a - b1) < 1e-6 && fabs(hit.b - b2) < 1e-6);
        /* Parallel to the base, however far the directions lean over. */
        assert_true(fabs(fabs(hit.ng[1]) - 1.0) < 1e-6 && fabs(fabs(hit.ns[1]) - 1.0) < 1e-6);
    }
    knurl_surface_release(surface);
    directions[3] = directions[4] = directions[5] = 0.0f;
    def.displacement.map = NULL;
    knurl_error error = {.message = ""};
    assert_int_equal(knurl_surface_create(context, &def, &surface, &error), KNURL_ERROR_INPUT);
    assert_non_null(strstr(error.message, "vertex 1: direction is 0"));
    knurl_context_release(context);
}

/* Where a method looks must not depend on tmax: shells are tried in any order, each with the best hit so far
 * as tmax. A hit within tmax is the same hit, and occlusion is the existence of one. */
static void hits_do_not_depend_on_tmax(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    static const float bent[9] = {0.1f, 1, 0, 0.3f, 1, 0, 0, 1, -0.2f};
    for (int32_t m = 0; m < knurl_method_count(); m++) {
        if (knurl_method_flags(m) & KNURL_METHOD_NATIVE) continue;
        knurl_surface_def def = triangle_def(bent, random_map(context, 16), 0.1);
        def.method = knurl_method_name(m);
        knurl_surface *surface = create(context, &def);
        random_state random = {11};
        int hits = 0;
        for (int i = 0; i < 500; i++) {
            double a = random_unit(&random), b = random_unit(&random) * (1.0 - a);
            double origin[3] = {random_range(&random, -0.5, 1.5), 0.4, random_range(&random, -0.5, 1.5)};
            double direction[3] = {a - origin[0], -0.4, b - origin[2]};
            knurl_ray ray = knurl_ray_make(origin, direction);
            knurl_hit hit = {.triangle = KNURL_NO_HIT}, again = hit;
            if (!knurl_surface_intersect(surface, 0, &ray, &hit)) continue;
            hits++;
            ray.tmax = hit.t * (1.0 + 1e-6);
            if (!knurl_surface_intersect(surface, 0, &ray, &again) || fabs(again.t - hit.t) > 1e-12 ||
                !knurl_surface_occluded(surface, 0, &ray))
                fail_msg("%s: ray %d: t %.17g, then %.17g", def.method, i, hit.t, again.t);
            ray.tmax = hit.t * (1.0 - 1e-6);
            if (knurl_surface_intersect(surface, 0, &ray, &again) && again.t > ray.tmax)
                fail_msg("%s: ray %d: t %.17g over tmax", def.method, i, again.t);
        }
        assert_true(hits > 200);
        knurl_surface_release(surface);
    }
    knurl_context_release(context);
}

/* The line of a ray decides what it hits, not where on it the origin is; and far rays end as soon as near
 * ones. */
static void far_origins_change_nothing(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    static const float bent[9] = {0.1f, 1, 0, 0.3f, 1, 0, 0, 1, -0.2f};
    static const float lean[9] = {0.1f, 1, 0, 0.3f, 2, 0, 0, 1.5f, -0.2f};
    for (int32_t m = 0; m < knurl_method_count(); m++)
        for (int directions = 0; directions < 2; directions++) {
            if (directions && knurl_method_flags(m) & KNURL_METHOD_NATIVE) continue;
            knurl_surface_def def = triangle_def(bent, random_map(context, 16), 0.1);
            def.method = knurl_method_name(m);
            if (directions) def.mesh.directions = lean;
            if (knurl_method_flags(m) & KNURL_METHOD_NATIVE) def.method = "tessellation:rate=0.25";
            knurl_surface *surface = create(context, &def);
            for (int e = 0; e <= 300; e += 3) {
                double far = pow(10.0, e), off[3] = {far, far, far}, beside[3] = {0.3 * far, -far, 0};
                double origin[3] = {0.25, far, 0.25}, down[3] = {0, -1, 0}, across[3] = {0, 0, -1};
                knurl_ray ray = knurl_ray_make(origin, down);
                knurl_hit hit = {.triangle = KNURL_NO_HIT};
                assert_true(knurl_surface_intersect(surface, 0, &ray, &hit));
                assert_true(fabs(hit.position[0] - 0.25) < 0.02 && fabs(hit.position[2] - 0.25) < 0.02);
                assert_true(fabs(hit.t - far) <= 0.2 + 1e-15 * far && hit.steps < 10000);
                assert_true(knurl_surface_occluded(surface, 0, &ray));
                if (e == 0) continue;
                ray = knurl_ray_make(off, across);
                assert_false(knurl_surface_intersect(surface, 0, &ray, &hit));
                ray = knurl_ray_make(beside, down);
                assert_false(knurl_surface_intersect(surface, 0, &ray, &hit));
            }
            knurl_surface_release(surface);
        }
    knurl_context_release(context);
}

static void methods_refuse_bad_parameters(void **state)
{
    (void)state;
    static const char *const bad[] = {"",
                                      "RMIP",
                                      "rmip:",
                                      "rmip:bounds",
                                      "rmip:bounds=",
                                      "rmip:bounds=tree",
                                      "rmip:marching-scale=0.5",
                                      "rmip:marching-scale=nan",
                                      "rmip:marching-scale=2x",
                                      "rmip:speed=1",
                                      "rmip:bounds=rmip:"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        knurl_error error = {.message = ""};
        assert_int_equal(knurl_method_check(bad[i], NULL, &error), KNURL_ERROR_ARGUMENT);
        assert_true(error.message[0] != '\0');
    }
    int32_t index = -1;
    assert_int_equal(knurl_method_check("rmip:bounds=minmax:marching-scale=64:inversion=off", &index, NULL),
                     KNURL_OK);
    assert_string_equal(knurl_method_name(index), "rmip");
    for (int32_t m = 0; m < knurl_method_count(); m++) {
        assert_int_equal(knurl_method_check(knurl_method_name(m), &index, NULL), KNURL_OK);
        assert_int_equal(index, m);
        const knurl_method_parameter *p;
        for (int32_t k = 0; (p = knurl_method_get_parameter(m, k)); k++)
            assert_true(p->name[0] && p->summary[0] && p->least <= p->preset && p->preset <= p->most);
    }
    assert_null(knurl_method_get_parameter(0, -1));
    assert_null(knurl_method_name(-1));
}

/* Who names no method, and who gives NULL, gets `fast`. */
static void fast_is_the_default(void **state)
{
    (void)state;
    static const char *const names[] = {"fast", NULL, "rmip"};
    static const float up[9] = {0, 1, 0, 0, 1, 0, 0, 1, 0};
    assert_string_equal(knurl_surface_def_default().method, "fast");
    knurl_context *context = make_context();
    for (int i = 0; i < 3; i++) {
        knurl_surface_def def = triangle_def(up, random_map(context, 8), 0.1);
        def.method = names[i];
        knurl_surface *surface = create(context, &def);
        assert_int_equal((knurl_surface_flags(surface) & KNURL_METHOD_WHOLE) != 0, i < 2);
        knurl_surface_release(surface);
    }
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opposing_normals_end),          cmocka_unit_test(any_direction_length),
        cmocka_unit_test(huge_heights_are_refused),      cmocka_unit_test(fine_texels_end),
        cmocka_unit_test(seams_know_wrapping),           cmocka_unit_test(directions_make_a_frustum),
        cmocka_unit_test(methods_refuse_bad_parameters), cmocka_unit_test(hits_do_not_depend_on_tmax),
        cmocka_unit_test(far_origins_change_nothing),    cmocka_unit_test(fast_is_the_default),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
