/* knurl_scene_build: a description, written out by hand here, becomes a scene. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/description.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MAP_PATH KNURL_TEST_DIR "/test_scene_build.pgm"

static float positions[] = {-1, 0, -1, 1, 0, -1, -1, 0, 1, 1, 0, 1};
static float normals[] = {0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};
static float texcoords[] = {0, 0, 1, 0, 0, 1, 1, 1};
static uint32_t triangles[] = {0, 2, 1, 1, 2, 3};
static char map_path[] = MAP_PATH, map_name[] = "map", lost_path[] = KNURL_TEST_DIR "/no such file.png";

typedef struct fixture {
    knurl_context *context;
    int warnings;
    knurl_description description;
    knurl_description_mesh meshes[4];
    knurl_description_image images[2];
    knurl_description_material materials[3];
    knurl_description_instance instances[4];
} fixture;

static void on_log(void *user, knurl_log_level level, const char *message)
{
    (void)message;
    if (level == KNURL_LOG_WARNING) ((fixture *)user)->warnings++;
}

static knurl_description_material material(int32_t image, double factor, double offset)
{
    knurl_description_material m = {.displacement_factor = factor, .displacement_offset = offset};
    m.displacement = (knurl_texture_ref){.image = image, .uv_scale = {1, 1}};
    return m;
}

/* Mesh 0 is plain, 1 and 2 share a map of constant value 1, 3 is raised without a map. */
static void fill(fixture *f)
{
    knurl_description_mesh mesh = {.positions = positions,
                                   .normals = normals,
                                   .texcoords = texcoords,
                                   .vertex_count = 4,
                                   .triangles = triangles,
                                   .triangle_count = 2};
    f->materials[0] = material(-1, 1.0, 0.0);
    f->materials[1] = material(0, 0.5, 0.25);
    f->materials[2] = material(-1, 1.0, 0.125);
    f->images[0] = (knurl_description_image){.name = map_name, .path = map_path};
    f->images[1] = (knurl_description_image){.name = map_name, .path = lost_path};
    for (int i = 0; i < 4; i++) {
        f->meshes[i] = mesh;
        f->meshes[i].material = (const int32_t[]){0, 1, 1, 2}[i];
        f->instances[i] = (knurl_description_instance){
            .mesh = 3 - i, .transform = {1, 0, 0, 4.0 * i, 0, 1, 0, 0, 0, 0, 1, 0}};
    }
    f->description = (knurl_description){.context = f->context,
                                         .meshes = f->meshes,
                                         .mesh_count = 4,
                                         .images = f->images,
                                         .image_count = 2,
                                         .materials = f->materials,
                                         .material_count = 3,
                                         .instances = f->instances,
                                         .instance_count = 4,
                                         .environment = {.image = -1}};
}

static int setup(void **state)
{
    static fixture f;
    memset(&f, 0, sizeof f);
    knurl_context_def def = knurl_context_def_default();
    def.threads = 2;
    def.log = on_log;
    def.log_user = &f;
    assert_int_equal(knurl_context_create(&def, &f.context, NULL), KNURL_OK);
    uint8_t white[64];
    memset(white, 255, sizeof white);
    knurl_image *image;
    assert_int_equal(knurl_image_create(f.context, 8, 8, 1, KNURL_PIXEL_U8, white, &image, NULL), KNURL_OK);
    assert_int_equal(knurl_image_save(f.context, image, MAP_PATH, NULL), KNURL_OK);
    knurl_image_release(image);
    fill(&f);
    *state = &f;
    return 0;
}

static int teardown(void **state)
{
    fixture *f = *state;
    assert_true(knurl_context_bytes(f->context) == 0);
    knurl_context_release(f->context);
    remove(MAP_PATH);
    return 0;
}

static knurl_hit look_down(const knurl_scene *scene, double x)
{
    knurl_ray ray = knurl_ray_make((const double[3]){x + 0.3, 5, 0.2}, (const double[3]){0, -1, 0});
    knurl_hit hit;
    (void)knurl_scene_intersect(scene, &ray, &hit);
    return hit;
}

static void test_objects_and_instances_keep_their_numbers(void **state)
{
    fixture *f = *state;
    knurl_build_def def = knurl_build_def_default();
    knurl_scene *scene;
    knurl_error error;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, &error), KNURL_OK);
    assert_int_equal(knurl_scene_object_count(scene), 4);
    assert_int_equal(knurl_scene_instance_count(scene), 4);
    assert_null(knurl_scene_surface(scene, 0));
    assert_non_null(knurl_scene_surface(scene, 1));
    assert_non_null(knurl_scene_surface(scene, 3));
    const double heights[4] = {0.125, 0.75, 0.75, 0.0};
    for (uint32_t i = 0; i < 4; i++) {
        knurl_hit hit = look_down(scene, 4.0 * i);
        assert_int_equal(hit.instance, i);
        assert_int_equal(hit.object, 3 - i);
        assert_true(fabs(hit.t - (5.0 - heights[i])) < 1e-12);
        assert_true(fabs(hit.position[1] - heights[i]) < 1e-12);
    }
    /* Two surfaces share one map; the third has the built-in flat one. */
    knurl_surface_info shared, flat;
    knurl_surface_get_info(knurl_scene_surface(scene, 1), &shared);
    knurl_surface_get_info(knurl_scene_surface(scene, 3), &flat);
    assert_int_equal(knurl_scene_get_memory(scene).maps, shared.map_bytes + flat.map_bytes);
    knurl_scene_release(scene);
}

static void test_a_singular_instance_is_left_out(void **state)
{
    fixture *f = *state;
    fill(f);
    memset(f->instances[1].transform, 0, sizeof f->instances[1].transform);
    knurl_build_def def = knurl_build_def_default();
    knurl_scene *scene;
    int before = f->warnings;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, NULL), KNURL_OK);
    assert_int_equal(f->warnings, before + 1);
    assert_int_equal(knurl_scene_instance_count(scene), 4);
    assert_int_equal(look_down(scene, 4.0).triangle, KNURL_NO_HIT);
    assert_int_equal(look_down(scene, 8.0).instance, 2);
    assert_int_equal(look_down(scene, 0.0).instance, 0); /* not hidden behind the left-out one */
    knurl_scene_release(scene);
    fill(f);
}

static void test_errors_name_the_place(void **state)
{
    fixture *f = *state;
    knurl_build_def def = knurl_build_def_default();
    knurl_scene *scene;
    knurl_error error;
    f->materials[1].displacement.image = 1;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, &error), KNURL_ERROR_INPUT);
    assert_null(scene);
    assert_non_null(strstr(error.message, "mesh 1"));
    assert_non_null(strstr(error.message, "no such file"));
    f->materials[1].displacement.image = 2;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, &error), KNURL_ERROR_ARGUMENT);
    assert_non_null(strstr(error.message, "image is 2"));
    fill(f);
    f->meshes[2].material = 9;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, &error), KNURL_ERROR_ARGUMENT);
    assert_non_null(strstr(error.message, "material is 9"));
    fill(f);
    f->instances[3].mesh = 4;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, &error), KNURL_ERROR_ARGUMENT);
    assert_non_null(strstr(error.message, "mesh is 4"));
    fill(f);
    def.cookie = 0;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, &error), KNURL_ERROR_ARGUMENT);
    assert_non_null(strstr(error.message, "knurl_build_def_default"));
}

static void test_meshes_without_triangles(void **state)
{
    fixture *f = *state;
    f->meshes[1].triangle_count = 0;
    f->meshes[0] = (knurl_description_mesh){0};
    knurl_build_def def = knurl_build_def_default();
    knurl_scene *scene;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, NULL), KNURL_OK);
    assert_int_equal(look_down(scene, 4.0).instance, 1);
    assert_int_equal(look_down(scene, 8.0).triangle, KNURL_NO_HIT);
    knurl_scene_release(scene);
    f->description = (knurl_description){.context = f->context, .environment = {.image = -1}};
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_object_count(scene), 0);
    assert_int_equal(look_down(scene, 0.0).triangle, KNURL_NO_HIT);
    knurl_scene_release(scene);
    fill(f);
}

static bool stop_soon(void *user, const char *stage, double fraction)
{
    (void)fraction;
    assert_non_null(stage);
    return ++*(int *)user < 3;
}

static void test_stopping(void **state)
{
    fixture *f = *state;
    int calls = 0;
    knurl_build_def def = knurl_build_def_default();
    def.progress = stop_soon;
    def.progress_user = &calls;
    knurl_scene *scene;
    assert_int_equal(knurl_scene_build(&f->description, &def, &scene, NULL), KNURL_INTERRUPTED);
    assert_null(scene);
    assert_int_equal(calls, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_objects_and_instances_keep_their_numbers),
        cmocka_unit_test(test_a_singular_instance_is_left_out),
        cmocka_unit_test(test_errors_name_the_place),
        cmocka_unit_test(test_meshes_without_triangles),
        cmocka_unit_test(test_stopping),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
