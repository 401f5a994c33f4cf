/* The glTF attribute _DIRECTION: where it arrives, what it does to the surface, and what is wrong with it. */
#include "unit/test_description_common.h"

#define FILE_NAME KNURL_TEST_DIR "/direction.gltf"

/* Vertex 1 is used by no triangle. The others stand on y = 0; their directions meet in (0, 2, 0). */
static const float positions[4][3] = {{-1, 0, 1}, {9, 9, 9}, {1, 0, 1}, {0, 0, -1}};
static const float apex_directions[4][3] = {{1, 2, -1}, {5, 5, 5}, {-1, 2, -1}, {0, 2, 1}};

/* `height` is a displacement's constant height, NaN for none. */
static void write_scene(const float directions[4][3], const char *accessor, double height)
{
    struct {
        float positions[4][3], directions[4][3];
    } data;
    uint16_t indices[3] = {0, 2, 3};
    unsigned char bytes[sizeof data + sizeof indices];
    memcpy(data.positions, positions, sizeof positions);
    memcpy(data.directions, directions, sizeof data.directions);
    memcpy(bytes, &data, sizeof data);
    memcpy(bytes + sizeof data, indices, sizeof indices);
    write_bytes(KNURL_TEST_DIR "/direction.bin", bytes, sizeof bytes);
    char material[256] = "{}", text[2048];
    if (!isnan(height))
        (void)snprintf(
            material, sizeof material,
            "{\"extensions\":{\"KHR_materials_displacement\":{\"displacementGeometryOffset\":%g}}}", height);
    int length = snprintf(
        text, sizeof text,
        "{\"asset\":{\"version\":\"2.0\"},\"extensionsUsed\":[\"KHR_materials_displacement\"],"
        "\"nodes\":[{\"mesh\":0,\"scale\":[1,3,1],\"translation\":[10,0,0]}],"
        "\"meshes\":[{\"name\":\"cone\",\"primitives\":[{\"attributes\":{\"POSITION\":0,\"_DIRECTION\":1},"
        "\"indices\":2,\"material\":0}]}],\"materials\":[%s],"
        "\"buffers\":[{\"uri\":\"direction.bin\",\"byteLength\":102}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":48},{\"buffer\":0,\"byteOffset\":48,\"byteLength\":48}"
        ","
        "{\"buffer\":0,\"byteOffset\":96,\"byteLength\":6}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},"
        "{\"bufferView\":1,%s},{\"bufferView\":2,\"componentType\":5123,\"count\":3,\"type\":\"SCALAR\"}]}",
        material, accessor);
    assert_true(length > 0 && (size_t)length < sizeof text);
    write_bytes(FILE_NAME, text, (size_t)length);
}

static const char good[] = "\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"";

/* Height of the first hit of a ray straight down at (x, z) in the world; NaN for none. */
static double traced_height(const knurl_description *d, double x, double z)
{
    knurl_build_def def = knurl_build_def_default();
    knurl_scene *scene = NULL;
    knurl_error error = {0};
    assert_int_equal(knurl_scene_build(d, &def, &scene, &error), KNURL_OK);
    knurl_ray ray = knurl_ray_make((const double[]){x, 100, z}, (const double[]){0, -1, 0});
    knurl_hit hit;
    double height = knurl_scene_intersect(scene, &ray, &hit) ? hit.position[1] : NAN;
    knurl_scene_release(scene);
    return height;
}

static void directions_arrive(void **state)
{
    (void)state;
    write_scene(apex_directions, good, 0.5);
    knurl_description *d = load_file(FILE_NAME);
    assert_int_equal(d->mesh_count, 1);
    assert_int_equal(d->meshes[0].vertex_count, 3);
    const float used[] = {1, 2, -1, -1, 2, -1, 0, 2, 1};
    assert_memory_equal(d->meshes[0].directions, used, sizeof used);
    /* Half way to the apex: y = 1, three times that in the world; the triangle half as wide. */
    assert_float_equal(traced_height(d, 10.0, 0.1), 3.0, 1e-6);
    assert_float_equal(traced_height(d, 10.4, 0.4), 3.0, 1e-6);
    assert_true(isnan(traced_height(d, 10.6, 0.9)));
    knurl_description_release(d);
}

static void plain_meshes_ignore_them(void **state)
{
    (void)state;
    write_scene(apex_directions, good, NAN);
    knurl_description *d = load_file(FILE_NAME);
    assert_non_null(d->meshes[0].directions);
    assert_float_equal(traced_height(d, 10.6, 0.9), 0.0, 1e-6);
    knurl_description_release(d);
}

static void scenes_without_them(void **state)
{
    (void)state;
    knurl_description *d = load_file(KNURL_SOURCE_DIR "/tests/data/displaced.gltf");
    for (uint32_t i = 0; i < d->mesh_count; i++) assert_null(d->meshes[i].directions);
    knurl_description_release(d);
}

static void wrong_accessors(void **state)
{
    (void)state;
    static const char place[] = "/meshes/0/primitives/0/attributes/_DIRECTION";
    write_scene(apex_directions, "\"componentType\":5122,\"normalized\":true,\"count\":4,\"type\":\"VEC3\"",
                0.5);
    expect_failure(FILE_NAME, KNURL_ERROR_INPUT, place,
                   "componentType of the accessor is 5122, expected 5126");
    write_scene(apex_directions, "\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"", 0.5);
    expect_failure(FILE_NAME, KNURL_ERROR_INPUT, place, "has 2 components, expected 3");
    write_scene(apex_directions, "\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"", 0.5);
    expect_failure(FILE_NAME, KNURL_ERROR_INPUT, place, "has 3 elements, expected 4 as POSITION");
    write_scene(apex_directions, "\"componentType\":5126,\"count\":5,\"type\":\"VEC3\"", 0.5);
    expect_failure(FILE_NAME, KNURL_ERROR_INPUT, "/accessors/1", "5 elements take 60 bytes");
}

static void wrong_values(void **state)
{
    (void)state;
    float directions[4][3];
    memcpy(directions, apex_directions, sizeof directions);
    directions[1][0] = NAN; /* of the vertex that is left out */
    write_scene(directions, good, 0.5);
    knurl_description_release(load_file(FILE_NAME));
    memset(directions[2], 0, sizeof directions[2]);
    write_scene(directions, good, 0.5);
    expect_failure(FILE_NAME, KNURL_ERROR_INPUT, "mesh 0 (\"cone\"), vertex 1",
                   "direction is (0, 0, 0), expected finite numbers, not all 0");
    directions[2][1] = INFINITY;
    write_scene(directions, good, 0.5);
    expect_failure(FILE_NAME, KNURL_ERROR_INPUT, "mesh 0 (\"cone\"), vertex 1", "direction is (0, inf, 0)");
    directions[2][1] = NAN;
    write_scene(directions, good, 0.5);
    expect_failure(FILE_NAME, KNURL_ERROR_INPUT, "mesh 0 (\"cone\"), vertex 1", "expected finite numbers");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(directions_arrive),   cmocka_unit_test(plain_meshes_ignore_them),
        cmocka_unit_test(scenes_without_them), cmocka_unit_test(wrong_accessors),
        cmocka_unit_test(wrong_values),
    };
    return cmocka_run_group_tests_name("gltf directions", tests, make_context, drop_context);
}
