/* Scattering: energy, reciprocity, and agreement of samples with their densities. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "render/bsdf.h"
#include "render/dielectric.h"
#include "render/ggx.h"
#include "render/sampler.h"

#include <string.h>

static albedo_table table;

static int set_up(void **state)
{
    (void)state;
    knurl_context_def def = knurl_context_def_default();
    knurl_context *context;
    if (knurl_context_create(&def, &context, NULL) != KNURL_OK) return 1;
    albedo_build(context, &table);
    knurl_context_release(context);
    return 0;
}

static vec3 from_angle(double cosine, double phi)
{
    double sine = sqrt(1.0 - cosine * cosine);
    return v3(sine * cos(phi), sine * sin(phi), cosine);
}

static bsdf_parameters make_parameters(double base, double metallic, double roughness, double transmission)
{
    return (bsdf_parameters){v3(base, base, base), metallic, roughness, transmission, 1.5};
}

/* Mean weight of drawn samples: the share of light that is scattered. */
static double scattered(const bsdf *b, uint32_t count)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < count; i++) {
        sampler s = sampler_make(3, 4, 5, i);
        sample4 u = sampler_get(&s, 0);
        bsdf_sample sample;
        if (bsdf_draw(b, u.u[0], u.u[1], u.u[2], &sample)) sum += sample.weight.x;
    }
    return sum / count;
}

/* A white opaque surface returns everything, whatever its roughness, metal or not, at any angle. */
static void test_white_furnace_opaque(void **state)
{
    (void)state;
    static const double roughness[] = {0.05, 0.2, 0.5, 0.8, 1.0}, cosine[] = {0.02, 0.1, 0.4, 0.8, 1.0};
    for (size_t r = 0; r < 5; r++)
        for (size_t c = 0; c < 5; c++)
            for (int metal = 0; metal < 2; metal++) {
                bsdf_parameters p = make_parameters(1.0, metal, roughness[r], 0.0);
                bsdf b = bsdf_make(&table, &p, from_angle(cosine[c], 0.3), true);
                double e = scattered(&b, 4096);
                if (!(e > 0.97 && e < 1.02))
                    print_error("roughness %g cosine %g metal %d: %g\n", roughness[r], cosine[c], metal, e);
                assert_true(e > 0.97 && e < 1.02);
            }
}

static void test_colour_absorbs(void **state)
{
    (void)state;
    bsdf_parameters p = make_parameters(0.5, 0.0, 1.0, 0.0);
    bsdf b = bsdf_make(&table, &p, from_angle(0.9, 0.0), true);
    double e = scattered(&b, 4096);
    /* Half of what the specular lobe leaves, plus that lobe (4 to 6 %). */
    assert_true(e > 0.50 && e < 0.56);
    p = make_parameters(0.0, 1.0, 0.3, 0.0);
    b = bsdf_make(&table, &p, from_angle(0.9, 0.0), true);
    assert_true(scattered(&b, 4096) < 0.01);
}

/* An interface alone neither adds nor takes light; a rough one loses what bounces between facets. */
static void test_furnace_dielectric(void **state)
{
    (void)state;
    static const double cosine[] = {0.1, 0.4, 0.8, 1.0};
    for (size_t c = 0; c < 4; c++)
        for (int outside = 0; outside < 2; outside++) {
            bsdf_parameters p = make_parameters(1.0, 0.0, 0.0, 1.0);
            bsdf b = bsdf_make(&table, &p, from_angle(cosine[c], 1.0), outside);
            assert_true(fabs(scattered(&b, 1024) - 1.0) < 1e-9);
            p.roughness = 0.2;
            b = bsdf_make(&table, &p, from_angle(cosine[c], 1.0), outside);
            double e = scattered(&b, 4096);
            assert_true(e > 0.90 && e < 1.0 + 1e-9);
            p.roughness = 0.8;
            b = bsdf_make(&table, &p, from_angle(cosine[c], 1.0), outside);
            e = scattered(&b, 4096);
            assert_true(e > 0.55 && e < 1.0 + 1e-9);
        }
}

static void test_reciprocity(void **state)
{
    (void)state;
    for (int i = 0; i < 200; i++) {
        sampler s = sampler_make(1, 1, 1, (uint32_t)i);
        sample4 u = sampler_get(&s, 0), m = sampler_get(&s, 1);
        vec3 a = from_angle(0.05 + 0.95 * u.u[0], 6.28 * u.u[1]),
             b = from_angle(0.05 + 0.95 * u.u[2], 6.28 * u.u[3]);
        bsdf_parameters p = make_parameters(m.u[0], m.u[1], m.u[2], 0.0);
        bsdf ab = bsdf_make(&table, &p, a, true), ba = bsdf_make(&table, &p, b, true);
        double pdf, f = bsdf_evaluate(&ab, b, &pdf).x / b.z, g = bsdf_evaluate(&ba, a, &pdf).x / a.z;
        assert_true(fabs(f - g) <= 1e-9 * (fabs(f) + fabs(g)));
    }
}

/* Refraction: f(wo, wi) of one side equals f(wi, wo) of the other, as radiance is carried per squared
 * index (see dielectric.h). */
static void test_refraction_is_symmetric(void **state)
{
    (void)state;
    int compared = 0;
    for (int i = 0; i < 400; i++) {
        sampler s = sampler_make(1, 2, 1, (uint32_t)i);
        sample4 u = sampler_get(&s, 0);
        vec3 wo = from_angle(0.05 + 0.95 * u.u[0], 0.0), wi;
        wi = dielectric_draw_rough(wo, 1.5, 0.25, 1.0, u.u[1], u.u[2]);
        if (!(wi.z < -0.05)) continue;
        double pdf, f = dielectric_evaluate(wo, wi, 1.5, 0.25, &pdf) / -wi.z;
        double g = dielectric_evaluate(v3_neg(wi), v3_neg(wo), 1.0 / 1.5, 0.25, &pdf) / wo.z;
        /* Per squared index: f n^-2 on one side is g on the other. */
        assert_true(fabs(f - g * 2.25) <= 1e-9 * f || fabs(f * 2.25 - g) <= 1e-9 * g);
        compared++;
    }
    assert_true(compared > 200);
}

/* Compares a histogram of drawn directions with the density, over cells equal in cos and phi. */
enum { CELLS_Z = 16, CELLS_PHI = 12, DRAWS = 1 << 17, FINE = 24 };

static int cell_of(vec3 w)
{
    int i = (int)((w.z + 1.0) * 0.5 * CELLS_Z),
        j = (int)((atan2(w.y, w.x) / (2.0 * WARP_PI) + 0.5) * CELLS_PHI);
    if (i > CELLS_Z - 1) i = CELLS_Z - 1;
    if (j > CELLS_PHI - 1) j = CELLS_PHI - 1;
    return i * CELLS_PHI + j;
}

static double integrate_cell(const bsdf *b, int cell)
{
    double sum = 0.0;
    for (int i = 0; i < FINE; i++)
        for (int j = 0; j < FINE; j++) {
            double z = 2.0 * (cell / CELLS_PHI + (i + 0.5) / FINE) / CELLS_Z - 1.0;
            double phi = ((cell % CELLS_PHI + (j + 0.5) / FINE) / CELLS_PHI - 0.5) * 2.0 * WARP_PI, pdf;
            bsdf_evaluate(b, from_angle(z, phi), &pdf);
            sum += pdf;
        }
    return sum * 4.0 * WARP_PI / (CELLS_Z * CELLS_PHI * FINE * FINE);
}

static void check_density(const bsdf_parameters *p, vec3 wo, bool outside)
{
    bsdf b = bsdf_make(&table, p, wo, outside);
    static uint32_t histogram[CELLS_Z * CELLS_PHI];
    memset(histogram, 0, sizeof histogram);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < DRAWS; i++) {
        /* Owen-scrambled points: the histogram is nearer to the density than random ones would be. */
        sampler s = sampler_make(9, 9, 9, i);
        sample4 u = sampler_get(&s, 0);
        bsdf_sample sample;
        if (!bsdf_draw(&b, u.u[0], u.u[1], u.u[2], &sample)) continue;
        double pdf;
        bsdf_evaluate(&b, sample.wi, &pdf);
        assert_true(fabs(pdf - sample.pdf) <= 1e-6 * pdf);
        histogram[cell_of(sample.wi)]++;
        kept++;
    }
    double total = 0.0;
    for (int cell = 0; cell < CELLS_Z * CELLS_PHI; cell++) {
        double expected = integrate_cell(&b, cell), found = (double)histogram[cell] / DRAWS;
        total += expected;
        double tolerance = 6.0 * sqrt(expected / DRAWS) + 0.02 * expected + 2e-4;
        if (fabs(found - expected) > tolerance)
            print_error("cell %d: drawn %g, density %g\n", cell, found, expected);
        assert_true(fabs(found - expected) <= tolerance);
    }
    assert_true(fabs(total - (double)kept / DRAWS) < 0.01);
}

static void test_samples_follow_density(void **state)
{
    (void)state;
    vec3 wo = from_angle(0.6, 0.7), grazing = from_angle(0.15, -2.0);
    bsdf_parameters p = make_parameters(0.8, 0.0, 0.5, 0.0);
    check_density(&p, wo, true);
    check_density(&p, grazing, true);
    p = make_parameters(0.8, 1.0, 0.7, 0.0);
    check_density(&p, wo, true);
    p = make_parameters(0.8, 0.0, 0.6, 1.0);
    check_density(&p, wo, true);
    check_density(&p, wo, false);
    p = make_parameters(0.8, 0.2, 0.6, 0.5);
    check_density(&p, grazing, true);
}

static void test_fresnel(void **state)
{
    (void)state;
    assert_true(fabs(dielectric_fresnel(1.0, 1.5) - 0.04) < 1e-12);
    assert_true(fabs(dielectric_fresnel(1e-9, 1.5) - 1.0) < 1e-6);
    /* Total reflection from inside beyond 41.8 degrees; symmetric through Snell's law below. */
    assert_true(dielectric_fresnel(cos(0.74), 1.0 / 1.5) == 1.0);
    double inside = cos(0.5), outside = sqrt(1.0 - 2.25 * (1.0 - inside * inside));
    assert_true(fabs(dielectric_fresnel(inside, 1.0 / 1.5) - dielectric_fresnel(outside, 1.5)) < 1e-12);
    vec3 wo = from_angle(0.5, 0.2), wi;
    assert_true(dielectric_refract(wo, v3(0, 0, 1), 1.5, &wi));
    assert_true(fabs(v3_length(wi) - 1.0) < 1e-12);
    /* Snell: sines as 1.5 to 1, opposite azimuth. */
    assert_true(fabs(wi.x * 1.5 + wo.x) < 1e-12 && fabs(wi.y * 1.5 + wo.y) < 1e-12);
}

/* The table against a plain uniform integration of the lobe it tabulates. */
static void test_albedo_table(void **state)
{
    (void)state;
    double alpha = 0.36, cosine = 0.55, sum = 0.0;
    vec3 wo = from_angle(cosine, 0.0);
    enum { N = 400 };
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            vec3 wi = from_angle((i + 0.5) / N, 2.0 * WARP_PI * (j + 0.5) / N),
                 h = v3_normalize(v3_add(wo, wi));
            sum += ggx_d(h, alpha) * ggx_g2(wo, wi, alpha) / (4.0 * wo.z);
        }
    double e = sum * 2.0 * WARP_PI / ((double)N * N);
    assert_true(fabs(albedo_lookup(&table, cosine, alpha).e - e) < 0.005);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_white_furnace_opaque),
        cmocka_unit_test(test_colour_absorbs),
        cmocka_unit_test(test_furnace_dielectric),
        cmocka_unit_test(test_reciprocity),
        cmocka_unit_test(test_refraction_is_symmetric),
        cmocka_unit_test(test_samples_follow_density),
        cmocka_unit_test(test_fresnel),
        cmocka_unit_test(test_albedo_table),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
