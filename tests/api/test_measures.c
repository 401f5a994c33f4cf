/* What measuring programs rely on: camera rays are the renderer's, memory adds up, time is told apart. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/knurl.h>
#include <math.h>
#include <stdio.h>

enum { WIDTH = 24, HEIGHT = 16 };

typedef struct fixture {
    knurl_context *context;
    knurl_description *description;
    knurl_scene *scene;
    double image_seconds;
} fixture;

/* The description's displacement, from a map of our own. */
static void displace(fixture *f)
{
    uint8_t samples[8 * 8];
    for (int i = 0; i < 64; i++) samples[i] = (uint8_t)(i * 37 % 101);
    knurl_image *image = NULL;
    knurl_error error = {0};
    static const char map[] = KNURL_TEST_DIR "/measures.pgm";
    assert_int_equal(knurl_image_create(f->context, 8, 8, 1, KNURL_PIXEL_U8, samples, &image, &error),
                     KNURL_OK);
    assert_int_equal(knurl_image_save(f->context, image, map, &error), KNURL_OK);
    knurl_image_release(image);
    knurl_displacement_override override = knurl_displacement_override_default();
    override.map = map;
    override.factor = 0.05;
    assert_int_equal(knurl_description_override(f->description, &override, &error), KNURL_OK);
}

static void build(fixture *f, const char *file)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/tests/data/%s", KNURL_SOURCE_DIR, file);
    knurl_context_def def = knurl_context_def_default();
    knurl_error error = {0};
    assert_int_equal(knurl_context_create(&def, &f->context, &error), KNURL_OK);
    if (knurl_description_load(f->context, path, &f->description, &error) != KNURL_OK)
        fail_msg("%s", error.message);
    displace(f);
    /* The scenes name pictures that are not there. */
    f->description->environment.image = -1;
    for (uint32_t i = 0; i < f->description->material_count; i++) {
        knurl_description_material *m = &f->description->materials[i];
        m->base_color_texture.image = m->metallic_roughness_texture.image = m->emissive_texture.image = -1;
    }
    knurl_build_def build_def = knurl_build_def_default();
    f->image_seconds = -1;
    build_def.image_seconds = &f->image_seconds;
    build_def.surface.method = "rmip";
    if (knurl_scene_build(f->description, &build_def, &f->scene, &error) != KNURL_OK)
        fail_msg("%s", error.message);
}

static void tear_down(fixture *f)
{
    knurl_scene_release(f->scene);
    knurl_description_release(f->description);
    knurl_context_release(f->context);
}

/* The point that each ray meets is the one in the renderer's picture of positions. */
static void check_rays(const fixture *f, int32_t camera)
{
    static knurl_ray rays[WIDTH * HEIGHT];
    knurl_error error = {0};
    assert_int_equal(knurl_camera_rays(f->description, f->scene, camera, WIDTH, HEIGHT, rays, &error),
                     KNURL_OK);
    knurl_render_def def = knurl_render_def_default();
    def.width = WIDTH;
    def.height = HEIGHT;
    def.samples = 1;
    def.camera = camera;
    def.integrator = KNURL_INTEGRATOR_PRIMARY;
    def.aovs = KNURL_AOV_POSITION | KNURL_AOV_DEPTH;
    knurl_render_result result = {0};
    assert_int_equal(knurl_render(f->description, f->scene, &def, &result, &error), KNURL_OK);
    int hits = 0;
    for (int32_t i = 0; i < WIDTH * HEIGHT; i++) {
        knurl_hit hit;
        bool found = knurl_scene_intersect(f->scene, &rays[i], &hit);
        double depth = (double)knurl_image_value(result.aovs[0], i % WIDTH, i / WIDTH, 0);
        assert_true(found == (bool)isfinite(depth));
        const double *d = rays[i].direction;
        assert_true(fabs(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - 1) < 1e-12);
        if (!found) continue;
        hits++;
        for (int axis = 0; axis < 3; axis++) {
            double position = (double)knurl_image_value(result.aovs[1], i % WIDTH, i / WIDTH, axis);
            if (fabs(position - hit.position[axis]) > 1e-6 * (1 + fabs(position)))
                fail_msg("ray %d axis %d: found %g, the picture has %g", (int)i, axis, hit.position[axis],
                         position);
        }
    }
    assert_true(hits > 10);
    knurl_render_result_release(&result);
}

/* Turns a camera towards the scene, from a corner. */
static void aim(const fixture *f, knurl_description_camera *camera)
{
    static const double right[3] = {0.7071067811865476, 0, -0.7071067811865476};
    static const double up[3] = {-0.408248290463863, 0.816496580927726, -0.408248290463863};
    static const double back = 0.5773502691896258;
    double lower[3], upper[3], diagonal = 0;
    knurl_scene_bounds(f->scene, lower, upper);
    for (int i = 0; i < 3; i++) diagonal += (upper[i] - lower[i]) * (upper[i] - lower[i]);
    for (int i = 0; i < 3; i++) {
        camera->transform[4 * i] = right[i];
        camera->transform[4 * i + 1] = up[i];
        camera->transform[4 * i + 2] = back;
        camera->transform[4 * i + 3] = 0.5 * (lower[i] + upper[i]) + back * sqrt(diagonal);
    }
    camera->ymag = 0.5 * sqrt(diagonal);
}

static void test_rays(void **state)
{
    (void)state;
    static const char *const files[] = {"displaced.gltf", "room.obj"};
    for (int i = 0; i < 2; i++) {
        fixture f = {0};
        build(&f, files[i]);
        for (uint32_t camera = 0; camera < f.description->camera_count; camera++)
            aim(&f, &f.description->cameras[camera]);
        check_rays(&f, -1);
        for (uint32_t camera = 0; camera < f.description->camera_count; camera++)
            check_rays(&f, (int32_t)camera);
        tear_down(&f);
    }
}

static void test_wrong_arguments(void **state)
{
    (void)state;
    fixture f = {0};
    build(&f, "displaced.gltf");
    knurl_ray ray;
    knurl_error error = {0};
    const knurl_description *d = f.description;
    assert_int_equal(knurl_camera_rays(NULL, f.scene, -1, 1, 1, &ray, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_camera_rays(d, NULL, -1, 1, 1, &ray, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_camera_rays(d, f.scene, -1, 1, 1, NULL, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_camera_rays(d, f.scene, -1, 0, 1, &ray, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_camera_rays(d, f.scene, -1, 1, 65537, &ray, NULL), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_camera_rays(d, f.scene, -2, 1, 1, &ray, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_camera_rays(d, f.scene, (int32_t)d->camera_count, 1, 1, &ray, &error),
                     KNURL_ERROR_ARGUMENT);
    tear_down(&f);
}

static void test_memory(void **state)
{
    (void)state;
    fixture f = {0};
    build(&f, "displaced.gltf");
    knurl_scene_memory memory = knurl_scene_get_memory(f.scene);
    const knurl_heightmap_bytes *parts = &memory.map_parts;
    assert_true(parts->samples > 0 && parts->minmax > 0 && parts->rmip > 0);
    assert_int_equal(parts->samples + parts->levels + parts->minmax + parts->rmip + parts->blocks,
                     memory.maps);
    assert_true(f.image_seconds > 0 && f.image_seconds < 60);
    tear_down(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rays),
        cmocka_unit_test(test_wrong_arguments),
        cmocka_unit_test(test_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
