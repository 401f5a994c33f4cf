/* OBJ and the formats that assimp reads, and what may be changed in a description afterwards. */
#include "unit/test_description_common.h"

#include <math.h>
#include <stdlib.h>

#define ROOM KNURL_SOURCE_DIR "/tests/data/room.obj"
#define OBJ  KNURL_TEST_DIR "/made.obj"
#define PLY  KNURL_TEST_DIR "/made.ply"

static void write_text(const char *path, const char *text)
{
    write_bytes(path, text, strlen(text));
}

static void obj_meshes_and_materials(void **state)
{
    (void)state;
    knurl_description *d = load_file(ROOM);
    assert_int_equal(d->mesh_count, 3);
    assert_int_equal(d->instance_count, 3);
    EXPECT_NUMBERS(d->instances[2].transform, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0);
    const knurl_description_mesh *m = &d->meshes[0];
    assert_string_equal(m->name, "floor/stone");
    const float positions[] = {-1, 0, 1, 1, 0, 1, 1, 0, -1, -1, 0, -1},
                texcoords[] = {0, 1, 1, 1, 1, 0, 0, 0};
    const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
    assert_int_equal(m->vertex_count, 4); /* shared across the two usemtl groups of the same material */
    assert_memory_equal(m->positions, positions, sizeof positions);
    assert_memory_equal(m->texcoords, texcoords, sizeof texcoords); /* v turned */
    assert_memory_equal(m->triangles, triangles, sizeof triangles);
    assert_string_equal(d->materials[m->material].name, "stone");
    const knurl_description_material *stone = &d->materials[m->material];
    EXPECT_NUMBERS(((const double[]){stone->displacement_offset, stone->displacement_factor}), -0.1, 0.4);
    assert_string_equal(d->images[stone->displacement.image].path,
                        KNURL_SOURCE_DIR "/tests/data/maps/height map.png");
    m = &d->meshes[1]; /* negative indices -4 -2 -1 */
    const float second[] = {-1, 0, 1, 1, 0, -1, -1, 0, -1};
    assert_memory_equal(m->positions, second, sizeof second);
    assert_string_equal(d->materials[m->material].name, "glass");
    m = &d->meshes[2];
    assert_null(m->normals);
    assert_null(m->texcoords);
    assert_string_equal(d->materials[m->material].name, "default");
    assert_true(has_warning(d, "material \"unknown\" is not defined"));
    knurl_description_release(d);
}

/* The dart's reflex corner is its first: the only right cut goes through it. */
static void concave_polygons_are_cut_inside(void **state)
{
    (void)state;
    knurl_description *d = load_file(ROOM);
    const knurl_description_mesh *m = &d->meshes[2];
    assert_int_equal(m->triangle_count, 2);
    double area = 0;
    for (uint32_t i = 0; i < 2; i++) {
        const float *a = m->positions + 3 * m->triangles[3 * i],
                    *b = m->positions + 3 * m->triangles[3 * i + 1],
                    *c = m->positions + 3 * m->triangles[3 * i + 2];
        double part = (double)((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2;
        assert_true(part > 0);
        area += part;
    }
    assert_true(fabs(area - 6.0) < 1e-6);
    knurl_description_release(d);
    /* An L of six corners, turned into the plane x = 0 and listed from its reflex corner's neighbour. */
    write_text(OBJ, "v 0 0 0\nv 0 2 0\nv 0 2 1\nv 0 1 1\nv 0 1 2\nv 0 0 2\nf 5 6 1 2 3 4\n");
    d = load_file(OBJ);
    m = &d->meshes[0];
    assert_int_equal(m->triangle_count, 4);
    area = 0;
    for (uint32_t i = 0; i < 4; i++) {
        const float *a = m->positions + 3 * m->triangles[3 * i],
                    *b = m->positions + 3 * m->triangles[3 * i + 1],
                    *c = m->positions + 3 * m->triangles[3 * i + 2];
        double part = (double)((b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])) / 2;
        assert_true(part > 0);
        area += part;
    }
    assert_true(fabs(area - 3.0) < 1e-6);
    knurl_description_release(d);
}

static void obj_vertices_keep_their_bits(void **state)
{
    (void)state;
    write_text(OBJ,
               "v 0.1 1.7328719 -1.2345678e-3\nv 16777217 0.30000001192092896 1e-40\nv 1 2 3 0.5 0.5 0.5\n"
               "vt 0.3\nf 1/1 2/1 3/1\nf 3 2 1\n");
    knurl_description *d = load_file(OBJ);
    const float expected[] = {0.1f, 1.7328719f, -1.2345678e-3f, 16777217.0f, 0.30000001192092896f, 1e-40f, 1,
                              2,    3};
    assert_memory_equal(d->meshes[0].positions, expected, sizeof expected);
    assert_int_equal(d->meshes[0].vertex_count, 6); /* with and without texture coordinates */
    assert_float_equal(d->meshes[0].texcoords[1], 1.0f, 0.0f);
    assert_float_equal(d->meshes[0].texcoords[6], 0.0f, 0.0f);
    assert_true(has_warning(d, "3 of 6 vertices have no texture coordinates"));
    knurl_description_release(d);
}

static void obj_mistakes_name_their_line(void **state)
{
    (void)state;
    const struct {
        const char *text, *place, *detail;
    } cases[] = {
        {"", "made.obj", "empty"},
        {"# nothing\n", "made.obj", "no faces"},
        {"v 1 2\n", "made.obj:1:", "expected one more number"},
        {"v 1 2 x\n", "made.obj:1:", "found \"x\""},
        {"v 1 2 nan\n", "made.obj:1:", "found \"nan\", expected a finite number"},
        {"v 1 2 1e39\n", "made.obj:1:", "expected a finite number"},
        {"v 0 0 0\nf 1 1 2\n", "made.obj:2:", "vertex index is 2, expected 1 to 1 or -1 to -1"},
        {"v 0 0 0\nf 1 1 0\n", "made.obj:2:", "vertex index is 0"},
        {"v 0 0 0\nf 1 1 -2\n", "made.obj:2:", "vertex index is -2"},
        {"v 0 0 0\nf 1 1 99999999999999999999\n", "made.obj:2:", "expected an index"},
        {"v 0 0 0\nf 1/1 1/1 1/1\n", "made.obj:2:", "texture coordinate index is 1"},
        {"v 0 0 0\nf 1//3 1 1\n", "made.obj:2:", "normal index is 3"},
        {"v 0 0 0\n\nf 1/ 1 \\\n a\n", "made.obj:3:", "found \"a\""},
        {"v 0 0 0\nvt 0 0\nvn 0 0 1\nf 1/1/1/1 1 1\n", "made.obj:4:", "at most three"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_text(OBJ, cases[i].text);
        expect_failure(OBJ, KNURL_ERROR_INPUT, cases[i].place, cases[i].detail);
    }
    write_text(KNURL_TEST_DIR "/bad.mtl", "newmtl a\nKd\n");
    write_text(OBJ, "mtllib bad.mtl\n");
    expect_failure(OBJ, KNURL_ERROR_INPUT, "bad.mtl:2:", "Kd");
    expect_failure(KNURL_TEST_DIR "/none.obj", KNURL_ERROR_INPUT, "none.obj", "No such file");
}

static void material_libraries(void **state)
{
    (void)state;
    write_text(KNURL_TEST_DIR "/one two.mtl", "newmtl x\nKd 1 0 0\n");
    write_text(KNURL_TEST_DIR "/three.mtl", "newmtl y\nKd 0 1 0\nnewmtl x\n");
    write_text(OBJ,
               "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib one two.mtl\nmtllib three.mtl three.mtl\nmtllib gone.mtl\n"
               "usemtl x\nf 1 2 3\nusemtl y\nf 1 2 3\nf 1 2\nl 1 2\n");
    knurl_description *d = load_file(OBJ);
    assert_int_equal(d->material_count, 3);
    EXPECT_NUMBERS(d->materials[d->meshes[0].material].base_color, 1, 0, 0, 1);
    EXPECT_NUMBERS(d->materials[d->meshes[1].material].base_color, 0, 1, 0, 1);
    const char *const expected[] = {"made.obj:6: material library \"gone.mtl\"", "\"x\" is defined twice",
                                    "made.obj:11: a face of 2 corners", "made.obj:12: points, lines"};
    for (size_t i = 0; i < 4; i++) assert_true(has_warning(d, expected[i]));
    assert_int_equal(d->warning_count, 4);
    knurl_description_release(d);
}

static void ply_and_stl_through_assimp(void **state)
{
    (void)state;
    knurl_description *d = load_file(KNURL_SOURCE_DIR "/tests/data/corner.ply");
    assert_int_equal(d->mesh_count, 1);
    assert_int_equal(d->meshes[0].vertex_count, 5); /* joined again where equal */
    assert_int_equal(d->meshes[0].triangle_count, 3);
    assert_int_equal(d->instance_count, 1);
    assert_true(d->materials[d->meshes[0].material].double_sided);
    knurl_description_release(d);
    write_text(KNURL_TEST_DIR "/made.stl",
               "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
               "vertex 0 1 0\nendloop\nendfacet\nfacet normal 0 0 1\nouter loop\n"
               "vertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n");
    d = load_file(KNURL_TEST_DIR "/made.stl");
    assert_int_equal(d->meshes[0].vertex_count, 4);
    assert_int_equal(d->meshes[0].triangle_count, 2);
    assert_null(d->meshes[0].normals);
    knurl_description_release(d);
}

#define PLY_HEAD                                                                                             \
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"

static void damaged_ply(void **state)
{
    (void)state;
    const struct {
        const char *text, *place, *detail;
    } cases[] = {
        {"play\n", "made.ply:1:", "ply"},
        {"ply\nformat ascii 1.0\nelement vertex 3\n", "made.ply", "without end_header"},
        {PLY_HEAD "End_header\n", "made.ply:7:", "found \"End_header\""}, /* assimp would never end */
        {"ply\nformat hex 1.0\n", "made.ply:2:", "found \"hex\""},
        {"ply\nformat ascii 1.0\nelement vertex -3\n", "made.ply:3:", "found \"-3\""},
        {"ply\nformat ascii 1.0\nelement vertex 99999999999\n", "made.ply:3:", "a count up to"},
        {"ply\nformat ascii 1.0\nelement vertex 3\nproperty real x\n", "made.ply:4:", "a type such as"},
        {"ply\nformat ascii 1.0\nelement vertex 2000000000\nend_header\n", "element vertex", "no properties"},
        {"ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float "
         "x\nend_header\n12345678",
         "element vertex, item 2 of 2000000000", "the file ends"},
        {PLY_HEAD "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0 0 1 0\n"
                  "200000000 0 1 2\n",
         "element face, item 0 of 1", "the file ends"},
        {PLY_HEAD "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
                  "3 0 1 7\n",
         "made.ply", "7"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_text(PLY, cases[i].text);
        expect_failure(PLY, KNURL_ERROR_INPUT, cases[i].place, cases[i].detail);
    }
    write_text(KNURL_TEST_DIR "/made.xyzzy", "text");
    expect_failure(KNURL_TEST_DIR "/made.xyzzy", KNURL_ERROR_UNSUPPORTED, "made.xyzzy", ".xyzzy");
}

static void overrides(void **state)
{
    (void)state;
    knurl_description *d = load_file(ROOM);
    knurl_displacement_override o = knurl_displacement_override_default();
    assert_int_equal(knurl_description_override(d, &o, NULL), KNURL_OK);
    assert_int_equal(d->image_count, 1); /* nothing asked, nothing changed */
    EXPECT_NUMBERS(&d->materials[0].displacement_factor, 0.4);
    o.map = "other.png";
    o.factor = 2;
    o.tile_u = 5;
    o.wrap_v = KNURL_WRAP_MIRROR;
    o.color_map = "color.png";
    o.unnormalised = 1;
    assert_int_equal(knurl_description_override(d, &o, NULL), KNURL_OK);
    const knurl_description_material *m = &d->materials[0];
    assert_string_equal(d->images[m->displacement.image].path, "other.png");
    EXPECT_NUMBERS(((const double[]){m->displacement_factor, m->displacement_offset}), 2.0, -0.1);
    EXPECT_NUMBERS(m->displacement.uv_scale, 5.0, 8.0);
    assert_int_equal(m->displacement.wrap_u, KNURL_WRAP_CLAMP);
    assert_int_equal(m->displacement.wrap_v, KNURL_WRAP_MIRROR);
    assert_true(m->displacement_unnormalised);
    assert_string_equal(d->images[m->base_color_texture.image].path, "color.png");
    EXPECT_NUMBERS(m->base_color, 1.0, 1.0, 1.0, 1.0);
    assert_true(has_warning(d, "mesh 2 (\"dart/unknown\") has no texture coordinates"));
    o = knurl_displacement_override_default();
    o.remove = true;
    o.offset = 0.5;
    assert_int_equal(knurl_description_override(d, &o, NULL), KNURL_OK);
    assert_int_equal(m->displacement.image, -1);
    EXPECT_NUMBERS(((const double[]){m->displacement_factor, m->displacement_offset}), 1.0, 0.5);
    knurl_error error;
    o.factor = INFINITY;
    assert_int_equal(knurl_description_override(d, &o, &error), KNURL_ERROR_ARGUMENT);
    assert_non_null(strstr(error.message, "factor"));
    o = knurl_displacement_override_default();
    o.wrap_u = 3;
    assert_int_equal(knurl_description_override(d, &o, &error), KNURL_ERROR_ARGUMENT);
    o = (knurl_displacement_override){0};
    assert_int_equal(knurl_description_override(d, &o, &error), KNURL_ERROR_ARGUMENT);
    knurl_description_release(d);
}

static void many_warnings_are_cut_off(void **state)
{
    (void)state;
    FILE *file = fopen(KNURL_TEST_DIR "/many.mtl", "w");
    assert_non_null(file);
    fprintf(file, "newmtl a\n");
    for (int i = 0; i < 1000; i++) fprintf(file, "strange%d\n", i);
    fclose(file);
    write_text(OBJ, "mtllib many.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    knurl_description *d = load_file(OBJ);
    assert_int_equal(d->warning_count, 201);
    assert_true(has_warning(d, "more than 200 warnings"));
    knurl_description_release(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_meshes_and_materials),
        cmocka_unit_test(concave_polygons_are_cut_inside),
        cmocka_unit_test(obj_vertices_keep_their_bits),
        cmocka_unit_test(obj_mistakes_name_their_line),
        cmocka_unit_test(material_libraries),
        cmocka_unit_test(ply_and_stl_through_assimp),
        cmocka_unit_test(damaged_ply),
        cmocka_unit_test(overrides),
        cmocka_unit_test(many_warnings_are_cut_off),
    };
    return cmocka_run_group_tests(tests, make_context, drop_context);
}
