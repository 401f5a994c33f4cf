/* Whole renders of small scenes made in memory. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/base.h"

#include <knurl/render.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_VERTICES = 1200, MAX_TRIANGLES = 2200 };

/* A description on the stack: meshes 0 (a sphere) and 1 (a square lamp or floor), one of each placed. */
typedef struct fixture {
    knurl_context *context;
    knurl_description description;
    knurl_description_mesh meshes[2];
    knurl_description_material materials[2];
    knurl_description_instance instances[2];
    knurl_description_camera camera;
    knurl_description_light light;
    float positions[MAX_VERTICES * 3], normals[MAX_VERTICES * 3];
    uint32_t triangles[MAX_TRIANGLES * 3];
    float square[12];
    uint32_t square_triangles[6];
    knurl_scene *scene;
} fixture;

static void place(double m[12], double scale, double x, double y, double z)
{
    const double t[12] = {scale, 0, 0, x, 0, scale, 0, y, 0, 0, scale, z};
    memcpy(m, t, sizeof t);
}

static knurl_description_material gray_material(double gray)
{
    knurl_description_material m = {.base_color = {gray, gray, gray, 1.0}, .roughness = 1.0, .ior = 1.5};
    m.base_color_texture.image = m.metallic_roughness_texture.image = m.emissive_texture.image = -1;
    m.displacement.image = -1;
    for (int i = 0; i < 3; i++) m.attenuation_color[i] = 1.0;
    m.attenuation_distance = INFINITY;
    m.alpha_cutoff = 0.5;
    return m;
}

static void make_sphere(fixture *f, uint32_t rings, uint32_t sectors)
{
    uint32_t n = 0, t = 0;
    for (uint32_t i = 0; i <= rings; i++)
        for (uint32_t j = 0; j <= sectors; j++, n++) {
            double theta = 3.14159265358979323846 * i / rings,
                   phi = 6.283185307179586 * (j % sectors) / sectors;
            double p[3] = {sin(theta) * cos(phi), cos(theta), -sin(theta) * sin(phi)};
            if (i == 0 || i == rings) p[0] = p[2] = 0.0;
            for (uint32_t k = 0; k < 3; k++) f->positions[3 * n + k] = f->normals[3 * n + k] = (float)p[k];
        }
    for (uint32_t i = 0; i < rings; i++)
        for (uint32_t j = 0; j < sectors; j++) {
            uint32_t a = i * (sectors + 1) + j, b = a + sectors + 1;
            const uint32_t quad[6] = {a, b, a + 1, a + 1, b, b + 1};
            memcpy(f->triangles + 3 * t, quad, sizeof quad);
            t += 2;
        }
    f->meshes[0] = (knurl_description_mesh){.positions = f->positions,
                                            .normals = f->normals,
                                            .vertex_count = n,
                                            .triangles = f->triangles,
                                            .triangle_count = t,
                                            .material = 0};
}

/* A square of half size 1 in the plane y = 0, looking down (-y). */
static void make_square(fixture *f)
{
    const float corners[12] = {-1, 0, -1, 1, 0, -1, 1, 0, 1, -1, 0, 1};
    const uint32_t index[6] = {0, 1, 2, 0, 2, 3};
    memcpy(f->square, corners, sizeof corners);
    memcpy(f->square_triangles, index, sizeof index);
    f->meshes[1] = (knurl_description_mesh){.positions = f->square,
                                            .vertex_count = 4,
                                            .triangles = f->square_triangles,
                                            .triangle_count = 2,
                                            .material = 1};
}

static void fixture_make_with(fixture *f, int32_t threads, knurl_reallocate_fn *reallocate)
{
    memset(f, 0, sizeof *f);
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    def.reallocate = reallocate;
    assert_int_equal(knurl_context_create(&def, &f->context, NULL), KNURL_OK);
    make_sphere(f, 24, 40);
    make_square(f);
    f->materials[0] = gray_material(0.5);
    f->materials[1] = gray_material(0.5);
    f->instances[0].mesh = 0;
    place(f->instances[0].transform, 1.0, 0, 0, 0);
    f->instances[1].mesh = 1;
    place(f->instances[1].transform, 4.0, 0, -1.5, 0);
    place(f->camera.transform, 1.0, 0, 0, 4);
    f->camera.yfov = 0.7;
    f->description = (knurl_description){.context = f->context,
                                         .meshes = f->meshes,
                                         .mesh_count = 1,
                                         .materials = f->materials,
                                         .material_count = 2,
                                         .instances = f->instances,
                                         .instance_count = 1,
                                         .cameras = &f->camera,
                                         .camera_count = 1,
                                         .lights = &f->light,
                                         .environment_intensity = 1.0};
    f->description.environment.image = -1;
}

static void fixture_make(fixture *f, int32_t threads)
{
    fixture_make_with(f, threads, NULL);
}

static void fixture_build(fixture *f)
{
    knurl_error error;
    knurl_status status = knurl_scene_create(f->context, &f->scene, &error);
    for (uint32_t i = 0; status == KNURL_OK && i < f->description.mesh_count; i++) {
        const knurl_description_mesh *m = &f->meshes[i];
        knurl_mesh_view view = {m->positions, m->normals,        NULL, m->vertex_count,
                                m->triangles, m->triangle_count, NULL};
        uint32_t object;
        status = knurl_scene_add_mesh(f->scene, &view, &object, &error);
    }
    for (uint32_t i = 0; status == KNURL_OK && i < f->description.instance_count; i++)
        status = knurl_scene_add_instance(f->scene, (uint32_t)f->instances[i].mesh, f->instances[i].transform,
                                          UINT32_MAX, NULL, &error);
    if (status == KNURL_OK) status = knurl_scene_commit(f->scene, &error);
    if (status != KNURL_OK) print_error("%s\n", error.message);
    assert_int_equal(status, KNURL_OK);
}

static void fixture_release(fixture *f)
{
    knurl_scene_release(f->scene);
    assert_int_equal(knurl_context_bytes(f->context), 0);
    knurl_context_release(f->context);
}

static knurl_image *constant_image(fixture *f, float value)
{
    float samples[8 * 4 * 3];
    for (int i = 0; i < 8 * 4 * 3; i++) samples[i] = value;
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(f->context, 8, 4, 3, KNURL_PIXEL_F32, samples, &image, NULL),
                     KNURL_OK);
    return image;
}

static knurl_render_def small_def(int32_t size, int32_t samples)
{
    knurl_render_def def = knurl_render_def_default();
    def.width = def.height = size;
    def.samples = samples;
    return def;
}

static knurl_render_result render_ok(const fixture *f, const knurl_render_def *def)
{
    knurl_render_result result;
    knurl_error error;
    knurl_status status = knurl_render(&f->description, f->scene, def, &result, &error);
    if (status != KNURL_OK) print_error("%s\n", error.message);
    assert_int_equal(status, KNURL_OK);
    return result;
}

static double mean_channel(const knurl_image *image, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                           int32_t c)
{
    double sum = 0.0;
    for (int32_t y = y0; y < y1; y++)
        for (int32_t x = x0; x < x1; x++) sum += (double)knurl_image_value(image, x, y, c);
    return sum / ((x1 - x0) * (y1 - y0));
}

static size_t image_bytes(const knurl_image *image)
{
    return (size_t)knurl_image_width(image) * (size_t)knurl_image_height(image) *
           (size_t)knurl_image_channels(image) * (size_t)knurl_image_format(image);
}

/* A convex white object in constant light is as bright as the light; so is any lossless one. */
static void furnace(double gray, double metallic, double roughness, double transmission, int32_t depth,
                    double expected, double tolerance)
{
    static fixture f;
    fixture_make(&f, 2);
    f.materials[0] = gray_material(gray);
    f.materials[0].metallic = metallic;
    f.materials[0].roughness = roughness;
    f.materials[0].transmission = transmission;
    fixture_build(&f);
    knurl_image *sky = constant_image(&f, 2.0f);
    knurl_render_def def = small_def(32, 128);
    def.environment = sky;
    def.max_depth = depth;
    knurl_render_result r = render_ok(&f, &def);
    double mean = mean_channel(r.beauty, 12, 12, 20, 20, 1) / 2.0;
    if (!(fabs(mean - expected) < tolerance))
        print_error("gray %g metal %g rough %g glass %g: %g\n", gray, metallic, roughness, transmission,
                    mean);
    assert_true(fabs(mean - expected) < tolerance);
    assert_true(fabs(mean_channel(r.beauty, 0, 0, 2, 2, 0) - 2.0) < 1e-5);
    assert_true(mean_channel(r.beauty, 0, 0, 2, 2, 3) == 0.0 &&
                mean_channel(r.beauty, 14, 14, 18, 18, 3) == 1.0);
    knurl_render_result_release(&r);
    knurl_image_release(sky);
    fixture_release(&f);
}

static void test_furnace(void **state)
{
    (void)state;
    furnace(1.0, 0.0, 1.0, 0.0, 8, 1.0, 0.01);
    furnace(1.0, 1.0, 0.4, 0.0, 8, 1.0, 0.01);
    furnace(1.0, 0.0, 0.0, 1.0, 64, 1.0, 0.01);
    /* Diffuse under a thin dielectric lobe: half of the rest, plus the lobe's 4 to 6 %. */
    furnace(0.5, 0.0, 1.0, 0.0, 8, 0.525, 0.02);
}

/* A small square lamp over a diffuse floor: irradiance by the form factor; and the same for the point
 * light of equal intensity. Checks area sampling with MIS, the shadow ray's end and I / d^2. */
static void test_lamp_over_floor(void **state)
{
    (void)state;
    static fixture f;
    for (int punctual = 0; punctual < 2; punctual++) {
        fixture_make(&f, 2);
        make_square(&f);
        f.meshes[0] = f.meshes[1]; /* the floor */
        f.meshes[0].material = 0;
        f.materials[0].metallic = 0.0;
        f.materials[0].ior = 1.0; /* no specular lobe but Schlick's grazing rise */
        place(f.instances[0].transform, 2.0, 0, 0, 0);
        double half = 0.05, height = 2.0, radiance = 400.0;
        place(f.instances[1].transform, half, 0, height, 0);
        for (int i = 0; i < 3; i++) f.materials[1].emissive[i] = radiance;
        f.description.mesh_count = punctual ? 1 : 2;
        f.description.instance_count = punctual ? 1 : 2;
        if (punctual) {
            f.light =
                (knurl_description_light){.kind = KNURL_LIGHT_POINT, .color = {1, 1, 1}, .range = INFINITY};
            f.light.intensity = radiance * 4.0 * half * half;
            place(f.light.transform, 1.0, 0, height, 0);
            f.description.light_count = 1;
        }
        /* Look down from beside the lamp. */
        const double look[12] = {1, 0, 0, 0.5, 0, 0, 1, 3, 0, -1, 0, 0};
        memcpy(f.camera.transform, look, sizeof look);
        f.camera.yfov = 0.02;
        fixture_build(&f);
        knurl_render_def def = small_def(8, 256);
        def.max_depth = 1;
        knurl_render_result r = render_ok(&f, &def);
        double distance2 = height * height + 0.25, cosine = height / sqrt(distance2);
        double intensity = radiance * 4.0 * half * half * (punctual ? 1.0 : cosine);
        double expected = intensity * cosine / distance2 * 0.5 / 3.14159265358979323846;
        double mean = mean_channel(r.beauty, 0, 0, 8, 8, 0);
        if (!(fabs(mean / expected - 1.0) < 0.03))
            print_error("punctual %d: %g, expected %g\n", punctual, mean, expected);
        assert_true(fabs(mean / expected - 1.0) < 0.03);
        knurl_render_result_release(&r);
        fixture_release(&f);
    }
}

/* The same bits from 1, 2 and 3 threads, for every integrator and with all AOVs. */
static void test_threads_do_not_matter(void **state)
{
    (void)state;
    for (int integrator = 0; integrator < 3; integrator++) {
        knurl_render_result results[3];
        static fixture fixtures[3];
        for (int32_t i = 0; i < 3; i++) {
            fixture_make(&fixtures[i], i + 1);
            fixtures[i].description.mesh_count = fixtures[i].description.instance_count = 2;
            fixtures[i].materials[0].transmission = 0.5;
            fixtures[i].materials[1].alpha_mode = KNURL_ALPHA_BLEND;
            fixtures[i].materials[1].base_color[3] = 0.7;
            fixture_build(&fixtures[i]);
            knurl_render_def def = small_def(40, 5);
            def.integrator = (knurl_integrator)integrator;
            def.aovs = (1u << KNURL_AOV_COUNT) - 1;
            results[i] = render_ok(&fixtures[i], &def);
            assert_int_equal(results[i].stats.samples_done, 5);
        }
        for (int i = 1; i < 3; i++) {
            assert_memory_equal(knurl_image_samples(results[i].beauty),
                                knurl_image_samples(results[0].beauty), image_bytes(results[0].beauty));
            for (int a = 0; a < KNURL_AOV_COUNT; a++)
                assert_memory_equal(knurl_image_samples(results[i].aovs[a]),
                                    knurl_image_samples(results[0].aovs[a]), image_bytes(results[0].aovs[a]));
            assert_int_equal(results[i].stats.primary_rays, results[0].stats.primary_rays);
            assert_int_equal(results[i].stats.occlusion_rays, results[0].stats.occlusion_rays);
        }
        for (int i = 0; i < 3; i++) {
            knurl_render_result_release(&results[i]);
            fixture_release(&fixtures[i]);
        }
    }
}

typedef struct stopper {
    double at;
    double last;
    int calls;
} stopper;

static bool stop_at(void *user, const char *stage, double fraction)
{
    stopper *s = user;
    assert_true(strlen(stage) > 0 && fraction >= s->last && fraction <= 1.0);
    s->last = fraction;
    s->calls++;
    return fraction < s->at;
}

/* An interrupted render is exactly the render of the samples it finished. */
static void test_interrupt(void **state)
{
    (void)state;
    static fixture f;
    fixture_make(&f, 2);
    fixture_build(&f);
    stopper s = {.at = 0.5};
    knurl_render_def def = small_def(48, 64);
    def.progress = stop_at;
    def.progress_user = &s;
    knurl_render_result stopped, whole;
    knurl_error error;
    assert_int_equal(knurl_render(&f.description, f.scene, &def, &stopped, &error), KNURL_INTERRUPTED);
    assert_true(stopped.stats.samples_done > 0 && stopped.stats.samples_done < 64);
    def = small_def(48, stopped.stats.samples_done);
    whole = render_ok(&f, &def);
    assert_memory_equal(knurl_image_samples(stopped.beauty), knurl_image_samples(whole.beauty),
                        image_bytes(whole.beauty));
    knurl_render_result_release(&stopped);
    knurl_render_result_release(&whole);
    /* Not stopped: the last call says 1. */
    s = (stopper){.at = 2.0};
    def.progress = stop_at;
    def.progress_user = &s;
    whole = render_ok(&f, &def);
    assert_true(s.calls > 0 && s.last == 1.0);
    knurl_render_result_release(&whole);
    fixture_release(&f);
}

/* A crop is a cut-out of the whole image, bit for bit. */
static void test_crop(void **state)
{
    (void)state;
    static fixture f;
    fixture_make(&f, 2);
    fixture_build(&f);
    knurl_render_def def = small_def(40, 3);
    def.height = 30;
    knurl_render_result whole = render_ok(&f, &def);
    def.crop_x = 11;
    def.crop_y = 7;
    def.crop_width = 19;
    def.crop_height = 18;
    knurl_render_result crop = render_ok(&f, &def);
    assert_int_equal(knurl_image_width(crop.beauty), 19);
    assert_int_equal(knurl_image_height(crop.beauty), 18);
    for (int32_t y = 0; y < 18; y++)
        for (int32_t x = 0; x < 19; x++)
            for (int32_t c = 0; c < 4; c++)
                assert_true(knurl_image_value(crop.beauty, x, y, c) ==
                            knurl_image_value(whole.beauty, x + 11, y + 7, c));
    knurl_render_result_release(&whole);
    knurl_render_result_release(&crop);
    fixture_release(&f);
}

static void test_aovs(void **state)
{
    (void)state;
    static fixture f;
    fixture_make(&f, 1);
    f.materials[0].base_color[1] = 0.25;
    fixture_build(&f);
    knurl_render_def def = small_def(33, 4);
    def.aovs = (1u << KNURL_AOV_COUNT) - 1;
    knurl_render_result r = render_ok(&f, &def);
    for (int32_t i = 0; i < KNURL_AOV_COUNT; i++) {
        assert_non_null(r.aovs[i]);
        assert_int_equal(knurl_image_channels(r.aovs[i]), knurl_aov_channels(i));
    }
    assert_string_equal(knurl_aov_name(2), "geometric_normal");
    assert_null(knurl_aov_name(KNURL_AOV_COUNT));
    /* The sphere of radius 1 is 4 - 1 away in the middle (a little more: it is faceted). */
    double depth = (double)knurl_image_value(r.aovs[0], 16, 16, 0);
    assert_true(depth >= 3.0 - 1e-6 && depth < 3.02);
    assert_true(isinf(knurl_image_value(r.aovs[0], 0, 0, 0)));
    assert_true(fabs((double)knurl_image_value(r.aovs[1], 16, 16, 2) - (4.0 - depth)) < 1e-5);
    assert_true((double)knurl_image_value(r.aovs[2], 16, 16, 2) > 0.98);
    assert_true((double)knurl_image_value(r.aovs[3], 16, 16, 2) > 0.99);
    assert_true(knurl_image_value(r.aovs[4], 16, 16, 1) == 0.25f);
    assert_true(knurl_image_value(r.aovs[6], 16, 16, 0) == 0.0f &&
                knurl_image_value(r.aovs[6], 0, 0, 0) == -1.0f);
    assert_true(knurl_image_value(r.aovs[7], 16, 16, 0) >= 0.0f &&
                knurl_image_value(r.aovs[7], 0, 0, 0) == -1.0f);
    assert_true(knurl_image_value(r.aovs[8], 16, 16, 0) > 0.0f);
    assert_true(r.stats.primary_rays == 33 * 33 * 5 && r.stats.steps_mean > 0.0 &&
                r.stats.primary_per_second > 0.0);
    knurl_render_result_release(&r);
    fixture_release(&f);
}

/* Blended alpha lets light through in proportion; masked alpha wholly; shadow rays alike. */
static void test_alpha(void **state)
{
    (void)state;
    static fixture f;
    fixture_make(&f, 2);
    f.materials[0].alpha_mode = KNURL_ALPHA_BLEND;
    f.materials[0].base_color[3] = 0.25;
    for (int i = 0; i < 3; i++) f.materials[0].base_color[i] = 0.0;
    f.materials[0].ior = 1.0;
    fixture_build(&f);
    knurl_image *sky = constant_image(&f, 1.0f);
    knurl_render_def def = small_def(16, 256);
    def.environment = sky;
    knurl_render_result r = render_ok(&f, &def);
    /* Two layers of 75 %. The black surface still reflects a little at grazing angles. */
    assert_true(fabs(mean_channel(r.beauty, 7, 7, 9, 9, 0) - 0.5625) < 0.03);
    assert_true(fabs(1.0 - mean_channel(r.beauty, 7, 7, 9, 9, 3) - 0.5625) < 0.03);
    knurl_render_result_release(&r);
    f.materials[0].alpha_mode = KNURL_ALPHA_MASK;
    r = render_ok(&f, &def);
    assert_true(fabs(mean_channel(r.beauty, 7, 7, 9, 9, 0) - 1.0) < 1e-5);
    knurl_render_result_release(&r);
    knurl_image_release(sky);
    fixture_release(&f);
}

/* Light through 2 m of a medium that halves it every metre. */
static void test_attenuation(void **state)
{
    (void)state;
    static fixture f;
    fixture_make(&f, 2);
    f.materials[0] = gray_material(1.0);
    f.materials[0].transmission = 1.0;
    f.materials[0].roughness = 0.0;
    f.materials[0].ior = 1.0;
    for (int i = 0; i < 3; i++) f.materials[0].attenuation_color[i] = 0.5;
    f.materials[0].attenuation_distance = 1.0;
    fixture_build(&f);
    knurl_image *sky = constant_image(&f, 1.0f);
    knurl_render_def def = small_def(33, 16);
    def.environment = sky;
    knurl_render_result r = render_ok(&f, &def);
    assert_true(fabs((double)knurl_image_value(r.beauty, 16, 16, 0) - 0.25) < 0.01);
    knurl_render_result_release(&r);
    knurl_image_release(sky);
    fixture_release(&f);
}

/* No light: the studio sky shines; an own camera is found; everything of the object is in view. */
static void test_defaults(void **state)
{
    (void)state;
    static fixture f;
    fixture_make(&f, 2);
    f.description.camera_count = 0;
    fixture_build(&f);
    knurl_render_def def = small_def(32, 4);
    def.width = 48;
    knurl_render_result r = render_ok(&f, &def);
    double middle = mean_channel(r.beauty, 22, 14, 26, 18, 1);
    assert_true(middle > 0.05 && middle < 5.0);
    for (int32_t y = 0; y < 32; y++)
        assert_true(knurl_image_value(r.beauty, 0, y, 3) == 0.0f &&
                    knurl_image_value(r.beauty, 47, y, 3) == 0.0f);
    double coverage = mean_channel(r.beauty, 0, 0, 48, 32, 3);
    assert_true(coverage > 0.15 && coverage < 0.7);
    knurl_render_result_release(&r);
    /* A hidden environment shows the background, and still lights. */
    def.environment_hidden = true;
    def.background[1] = 0.125;
    r = render_ok(&f, &def);
    assert_true(knurl_image_value(r.beauty, 0, 0, 1) == 0.125f &&
                knurl_image_value(r.beauty, 0, 0, 0) == 0.0f);
    assert_true(mean_channel(r.beauty, 22, 14, 26, 18, 0) > 0.05);
    knurl_render_result_release(&r);
    fixture_release(&f);
}

static void test_refuses_bad_arguments(void **state)
{
    (void)state;
    static fixture f;
    fixture_make(&f, 1);
    fixture_build(&f);
    knurl_render_result r;
    knurl_error error;
    knurl_render_def def = {0};
    assert_int_equal(knurl_render(&f.description, f.scene, &def, &r, &error), KNURL_ERROR_ARGUMENT);
    assert_non_null(strstr(error.message, "default"));
    def = small_def(0, 1);
    assert_int_equal(knurl_render(&f.description, f.scene, &def, &r, &error), KNURL_ERROR_ARGUMENT);
    def = small_def(16, 0);
    assert_int_equal(knurl_render(&f.description, f.scene, &def, &r, &error), KNURL_ERROR_ARGUMENT);
    def = small_def(16, 1);
    def.camera = 1;
    assert_int_equal(knurl_render(&f.description, f.scene, &def, &r, &error), KNURL_ERROR_ARGUMENT);
    def = small_def(16, 1);
    def.crop_x = 8;
    def.crop_width = 9;
    def.crop_height = 1;
    assert_int_equal(knurl_render(&f.description, f.scene, &def, &r, &error), KNURL_ERROR_ARGUMENT);
    def = small_def(16, 1);
    f.description.mesh_count = 2;
    assert_int_equal(knurl_render(&f.description, f.scene, &def, &r, &error), KNURL_ERROR_ARGUMENT);
    assert_null(r.beauty);
    fixture_release(&f);
}

/* Every allocation of a render may fail: an error then, no crash, and nothing left behind. */
static long allocations_left;

static void *failing_reallocate(void *user, void *p, size_t old_size, size_t new_size, size_t alignment)
{
    (void)user;
    if (new_size == 0) {
        free(p);
        return NULL;
    }
    if (allocations_left == 0) return NULL;
    allocations_left--;
    void *grown = NULL;
    if (posix_memalign(&grown, alignment, new_size) != 0) return NULL;
    if (p) memcpy(grown, p, old_size < new_size ? old_size : new_size);
    free(p);
    return grown;
}

static void test_out_of_memory(void **state)
{
    (void)state;
    static fixture f;
    allocations_left = 1000000;
    fixture_make_with(&f, 1, failing_reallocate);
    f.description.mesh_count = f.description.instance_count = 2;
    f.materials[1].emissive[0] = 1.0;
    fixture_build(&f);
    knurl_image *sky = constant_image(&f, 1.0f);
    knurl_render_def def = small_def(4, 1);
    def.environment = sky;
    def.aovs = KNURL_AOV_DEPTH;
    uint64_t before = knurl_context_bytes(f.context);
    knurl_status status = KNURL_ERROR_MEMORY;
    long allowed = 0;
    for (; status != KNURL_OK && allowed < 100; allowed++) {
        knurl_render_result result;
        knurl_error error;
        allocations_left = allowed;
        status = knurl_render(&f.description, f.scene, &def, &result, &error);
        assert_true(status == KNURL_OK || status == KNURL_ERROR_MEMORY);
        assert_true((result.beauty != NULL) == (status == KNURL_OK));
        knurl_render_result_release(&result);
        assert_int_equal(knurl_context_bytes(f.context), before);
    }
    assert_true(status == KNURL_OK && allowed > 10);
    allocations_left = 1000;
    knurl_image_release(sky);
    fixture_release(&f);
}

static void test_tonemap(void **state)
{
    (void)state;
    knurl_context_def def = knurl_context_def_default();
    knurl_context *context;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    const float samples[6 * 4] = {0,    0,    0,    1, 0.18f, 0.18f, 0.18f,    0, 1, 1,    1,    1,
                                  1e9f, 1e9f, 1e9f, 1, NAN,   -1,    INFINITY, 1, 4, 0.1f, 0.1f, 1};
    knurl_image *linear, *display;
    assert_int_equal(knurl_image_create(context, 6, 1, 4, KNURL_PIXEL_F32, samples, &linear, NULL), KNURL_OK);
    assert_int_equal(knurl_tonemap(context, linear, 0.0, &display, NULL), KNURL_OK);
    assert_int_equal(knurl_image_channels(display), 3);
    const uint8_t *p = knurl_image_samples(display);
    assert_true(p[0] <= 1 && p[1] <= 1 && p[2] <= 1);
    /* Grey stays grey, alpha is ignored, and brighter is brighter. */
    assert_true(p[3] == p[4] && p[4] == p[5] && p[3] > 80 && p[3] < 140);
    assert_true(p[6] > p[3] && p[9] >= p[6] && p[9] > 250);
    assert_true(p[15] > p[16]);
    knurl_image *brighter;
    assert_int_equal(knurl_tonemap(context, linear, 1.0, &brighter, NULL), KNURL_OK);
    assert_true(((const uint8_t *)knurl_image_samples(brighter))[3] > p[3]);
    knurl_image_release(brighter);
    knurl_error error;
    assert_int_equal(knurl_tonemap(context, linear, NAN, &brighter, &error), KNURL_ERROR_ARGUMENT);
    knurl_image_release(linear);
    knurl_image_release(display);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_furnace),
        cmocka_unit_test(test_lamp_over_floor),
        cmocka_unit_test(test_threads_do_not_matter),
        cmocka_unit_test(test_interrupt),
        cmocka_unit_test(test_crop),
        cmocka_unit_test(test_aovs),
        cmocka_unit_test(test_alpha),
        cmocka_unit_test(test_attenuation),
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_refuses_bad_arguments),
        cmocka_unit_test(test_out_of_memory),
        cmocka_unit_test(test_tonemap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
