/* glTF files that are right: every part of the description they fill. */
#include "unit/test_description_common.h"

#define DISPLACED KNURL_SOURCE_DIR "/tests/data/displaced.gltf"

static void meshes_keep_their_bits(void **state)
{
    (void)state;
    knurl_description *d = load_file(DISPLACED);
    assert_int_equal(d->mesh_count, 2);
    const knurl_description_mesh *m = &d->meshes[0];
    assert_string_equal(m->name, "quad/0");
    assert_int_equal(m->vertex_count, 4);
    assert_int_equal(m->triangle_count, 2);
    assert_int_equal(m->material, 0);
    const float positions[] = {-1, 0, 1, 1, 0, 1, 1, 0, -1, -1, 0, -1},
                texcoords[] = {0, 1, 1, 1, 1, 0, 0, 0.1f};
    const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
    assert_memory_equal(m->positions, positions, sizeof positions);
    assert_memory_equal(m->texcoords, texcoords, sizeof texcoords); /* v as in the file */
    assert_memory_equal(m->triangles, triangles, sizeof triangles);
    assert_float_equal(m->normals[1], 1.0f, 0.0f);
    /* The second primitive uses three of the four vertices, has no normals, and no material. */
    m = &d->meshes[1];
    const float second[] = {-1, 0, 1, 1, 0, -1, -1, 0, -1};
    assert_int_equal(m->vertex_count, 3);
    assert_memory_equal(m->positions, second, sizeof second);
    assert_null(m->normals);
    assert_null(m->texcoords);
    assert_int_equal(m->material, 1);
    assert_int_equal(d->material_count, 2);
    assert_string_equal(d->materials[1].name, "default");
    knurl_description_release(d);
}

static void materials_and_displacement(void **state)
{
    (void)state;
    knurl_description *d = load_file(DISPLACED);
    const knurl_description_material *m = &d->materials[0];
    assert_string_equal(m->name, "stone");
    EXPECT_NUMBERS(m->base_color, 0.5, 0.6, 0.7, 0.8);
    EXPECT_NUMBERS(m->emissive, 1.0, 2.0, 3.0);
    EXPECT_NUMBERS(m->attenuation_color, 0.9, 0.8, 0.7);
    EXPECT_NUMBERS(((const double[]){m->metallic, m->roughness, m->transmission, m->ior,
                                     m->attenuation_distance, m->alpha_cutoff}),
                   0.25, 0.75, 0.5, 1.33, 2.0, 0.25);
    assert_int_equal(m->alpha_mode, KNURL_ALPHA_MASK);
    assert_true(m->double_sided);
    const knurl_texture_ref *t = &m->displacement;
    assert_int_equal(t->image, 0);
    assert_int_equal(t->wrap_u, KNURL_WRAP_MIRROR);
    assert_int_equal(t->wrap_v, KNURL_WRAP_CLAMP);
    assert_true(t->nearest);
    EXPECT_NUMBERS(t->uv_offset, 0.25, 0.5);
    EXPECT_NUMBERS(t->uv_scale, 4.0, 8.0);
    EXPECT_NUMBERS(&t->uv_rotation, 0.125);
    EXPECT_NUMBERS(&m->displacement_factor, 0.2);
    EXPECT_NUMBERS(&m->displacement_offset, -0.1);
    assert_false(m->displacement_unnormalised);
    t = &m->base_color_texture;
    assert_int_equal(t->image, 1);
    assert_int_equal(t->wrap_u, KNURL_WRAP_CLAMP);
    assert_int_equal(t->wrap_v, KNURL_WRAP_REPEAT);
    assert_false(t->nearest);
    EXPECT_NUMBERS(t->uv_scale, 1.0, 1.0);
    assert_int_equal(m->metallic_roughness_texture.image, 2);
    assert_true(has_warning(d, "/materials/0/emissiveTexture: texCoord is 1"));
    knurl_description_release(d);
}

static void images_of_three_kinds(void **state)
{
    (void)state;
    knurl_description *d = load_file(DISPLACED);
    assert_int_equal(d->image_count, 4);
    assert_string_equal(d->images[0].path, KNURL_SOURCE_DIR "/tests/data/height map.png");
    assert_null(d->images[1].path);
    assert_int_equal(d->images[1].size, 12);
    knurl_image *image;
    knurl_error error;
    assert_int_equal(knurl_description_load_image(d, 2, &image, &error), KNURL_OK);
    assert_int_equal(knurl_image_width(image), 2);
    assert_float_equal(knurl_image_value(image, 1, 0, 0), 1.0f, 0.0f);
    knurl_image_release(image);
    assert_int_equal(knurl_description_load_image(d, 4, &image, &error), KNURL_ERROR_ARGUMENT);
    assert_null(image);
    assert_int_equal(knurl_description_load_image(d, 0, &image, &error),
                     KNURL_ERROR_INPUT); /* no such file */
    assert_non_null(strstr(error.message, "height map.png"));
    assert_string_equal(d->images[d->environment.image].path, KNURL_SOURCE_DIR "/tests/data/sky.hdr");
    EXPECT_NUMBERS(&d->environment_intensity, 2.0);
    EXPECT_NUMBERS(&d->environment_rotation, 0.5);
    knurl_description_release(d);
}

static void nodes_cameras_and_lights(void **state)
{
    (void)state;
    knurl_description *d = load_file(DISPLACED);
    assert_int_equal(d->instance_count, 4);
    assert_string_equal(d->instances[0].name, "tile");
    /* Scale 2 in x, moved 3 in z, turned 90 degrees about y (x to -z, z to x), moved 10 in x. */
    EXPECT_NUMBERS(d->instances[0].transform, 0, 0, 1, 13, 0, 1, 0, 0, -2, 0, 0, 0);
    EXPECT_NUMBERS(d->instances[2].transform, 3, 0, 0, 0, 0, 3, 0, 0, 0, 0, 3, 0);
    assert_int_equal(d->instances[1].mesh, 1);
    assert_int_equal(d->camera_count, 2);
    const knurl_description_camera *c = &d->cameras[0];
    assert_string_equal(c->name, "eye");
    assert_false(c->orthographic);
    EXPECT_NUMBERS(((const double[]){c->yfov, c->lens_radius, c->focus_distance}), 0.7, 0.01, 4.0);
    EXPECT_NUMBERS(c->transform, 0, 0, 1, 10, 0, 1, 0, 5, -1, 0, 0, 0);
    c = &d->cameras[1];
    assert_true(c->orthographic);
    assert_string_equal(c->name, "plan");
    EXPECT_NUMBERS(&c->ymag, 1.5);
    EXPECT_NUMBERS(c->transform, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0); /* the parent's scale is gone */
    assert_int_equal(d->light_count, 3);
    const knurl_description_light *l = d->lights;
    assert_string_equal(l[0].name, "key");
    assert_int_equal(l[0].kind, KNURL_LIGHT_POINT);
    EXPECT_NUMBERS(l[0].color, 1.0, 0.5, 0.25);
    EXPECT_NUMBERS(((const double[]){l[0].intensity, l[0].range, l[0].transform[7]}), 40.0, 9.0, 3.0);
    assert_int_equal(l[1].kind, KNURL_LIGHT_SPOT);
    EXPECT_NUMBERS(((const double[]){l[1].inner_cone, l[1].outer_cone}), 0.1, 0.3);
    assert_true(isinf(l[1].range));
    assert_int_equal(l[2].kind, KNURL_LIGHT_DIRECTIONAL);
    knurl_description_release(d);
}

static void put_u32(unsigned char *to, uint32_t value)
{
    for (int i = 0; i < 4; i++) to[i] = (unsigned char)(value >> 8 * i);
}

/* A GLB with one triangle strip of interleaved vertices, byte indices and a sparse change. */
static size_t make_glb(unsigned char *out, const char *json)
{
    unsigned char binary[128] = {0};
    const float vertices[4][4] = {{0, 0, 0, 9}, {1, 0, 0, 9}, {0, 1, 0, 9}, {1, 1, 0, 9}},
                changed[3] = {1, 1, 0.5f};
    memcpy(binary, vertices, sizeof vertices); /* 64 bytes, stride 16 */
    for (int i = 0; i < 4; i++) binary[64 + i] = (unsigned char)i;
    binary[68] = 3; /* sparse index */
    memcpy(binary + 72, changed, sizeof changed);
    size_t text = strlen(json), padded = (text + 3) / 4 * 4, size = 12 + 8 + padded + 8 + 84;
    memcpy(out, "glTF", 4);
    put_u32(out + 4, 2);
    put_u32(out + 8, (uint32_t)size);
    put_u32(out + 12, (uint32_t)padded);
    memcpy(out + 16, "JSON", 4);
    memset(out + 20, ' ', padded);
    memcpy(out + 20, json, text);
    put_u32(out + 20 + padded, 84);
    memcpy(out + 24 + padded, "BIN", 4);
    memcpy(out + 28 + padded, binary, 84);
    return size;
}

static const char glb_json[] =
    "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"mesh\":0}],"
    "\"meshes\":[{\"primitives\":[{\"mode\":5,\"attributes\":{\"POSITION\":0},\"indices\":1},"
    "{\"mode\":6,\"attributes\":{\"POSITION\":0}},{\"mode\":1,\"attributes\":{\"POSITION\":0}}]}],"
    "\"buffers\":[{\"byteLength\":84}],"
    "\"bufferViews\":[{\"buffer\":0,\"byteLength\":64,\"byteStride\":16},{\"buffer\":0,\"byteOffset\":64,"
    "\"byteLength\":5},{\"buffer\":0,\"byteOffset\":72,\"byteLength\":12}],"
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"sparse\":{"
    "\"count\":1,"
    "\"indices\":{\"bufferView\":1,\"byteOffset\":4,\"componentType\":5121},\"values\":{\"bufferView\":2}}},"
    "{\"bufferView\":1,\"componentType\":5121,\"count\":4,\"type\":\"SCALAR\"}]}";

static void glb_strips_fans_and_sparse(void **state)
{
    (void)state;
    unsigned char bytes[2048];
    size_t size = make_glb(bytes, glb_json);
    write_bytes(KNURL_TEST_DIR "/strip.glb", bytes, size);
    knurl_description *d = load_file(KNURL_TEST_DIR "/strip.glb");
    assert_int_equal(d->mesh_count, 2);
    assert_int_equal(d->instance_count, 2);
    assert_true(has_warning(d, "/meshes/0/primitives/2: points and lines are left out"));
    const uint32_t strip[] = {0, 1, 2, 1, 3, 2}, fan[] = {1, 2, 0, 2, 3, 0};
    assert_memory_equal(d->meshes[0].triangles, strip, sizeof strip);
    assert_memory_equal(d->meshes[1].triangles, fan, sizeof fan);
    const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0.5f};
    assert_memory_equal(d->meshes[0].positions, positions, sizeof positions);
    knurl_description_release(d);
}

static void broken_glb(void **state)
{
    (void)state;
    const char *path = KNURL_TEST_DIR "/broken.glb";
    unsigned char bytes[2048], copy[2048];
    size_t size = make_glb(bytes, glb_json);
    write_bytes(path, bytes, 15);
    expect_failure(path, KNURL_ERROR_INPUT, "broken.glb", "15 bytes, expected at least 20");
    write_bytes(path, bytes, size - 1);
    expect_failure(path, KNURL_ERROR_INPUT, "GLB header", "the file ends after");
    memcpy(copy, bytes, size);
    put_u32(copy + 12, 0x7fffffff);
    write_bytes(path, copy, size);
    expect_failure(path, KNURL_ERROR_INPUT, "GLB chunk 0", "length is 2147483647, expected at most");
    memcpy(copy, bytes, size);
    put_u32(copy + size - 92, 85);
    write_bytes(path, copy, size);
    expect_failure(path, KNURL_ERROR_INPUT, "GLB chunk 1", "length is 85, expected at most 84");
    memcpy(copy, bytes, size);
    copy[16] = 'X';
    write_bytes(path, copy, size);
    expect_failure(path, KNURL_ERROR_INPUT, "GLB chunk 0", "type is");
    memcpy(copy, bytes, size);
    copy[4] = 1;
    write_bytes(path, copy, size);
    expect_failure(path, KNURL_ERROR_UNSUPPORTED, "GLB header", "version 1, expected 2");
}

static void texcoord_set_of_the_displacement(void **state)
{
    (void)state;
    /* One triangle, 9 + 6 floats of zeros and ones: TEXCOORD_1 is what the displacement asks for. */
    static const char json[] =
        "{\"asset\":{\"version\":\"2.0\"},\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,"
        "\"TEXCOORD_0\":1,\"TEXCOORD_1\":2},\"material\":0}]}],\"nodes\":[{\"mesh\":0}],"
        "\"buffers\":[{\"byteLength\":60,\"uri\":\"data:;base64,"
        "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"
        "AACAPwAAgD8AAIA/AACAPwAAgD8AAIA/\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":60}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},"
        "{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"},"
        "{\"bufferView\":0,\"byteOffset\":36,\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"}],"
        "\"images\":[{\"uri\":\"h.png\"}],\"textures\":[{\"source\":0}],\"materials\":[{\"extensions\":{"
        "\"KHR_materials_displacement\":{\"displacementGeometryTexture\":{\"index\":0,\"texCoord\":1},"
        "\"extras\":{\"unnormalised\":true}}}}]}";
    write_bytes(KNURL_TEST_DIR "/sets.gltf", json, sizeof json - 1);
    knurl_description *d = load_file(KNURL_TEST_DIR "/sets.gltf");
    for (int i = 0; i < 6; i++) assert_float_equal(d->meshes[0].texcoords[i], 1.0f, 0.0f);
    EXPECT_NUMBERS(&d->materials[0].displacement_factor, 1.0);
    EXPECT_NUMBERS(&d->materials[0].displacement_offset, 0.0);
    assert_true(d->materials[0].displacement_unnormalised);
    assert_int_equal(d->warning_count, 0);
    knurl_description_release(d);
}

/* What would look different elsewhere is said; a texture that only helps rasterisers is not. */
static void ignored_textures(void **state)
{
    (void)state;
    static const char json[] =
        "{\"asset\":{\"version\":\"2.0\"},\"images\":[{\"uri\":\"n.png\"}],\"textures\":[{\"source\":0}],"
        "\"materials\":[{},{\"normalTexture\":{\"index\":0},\"occlusionTexture\":{\"index\":0},"
        "\"extensions\":{"
        "\"KHR_materials_transmission\":{\"transmissionTexture\":{\"index\":0}}}}]}";
    write_bytes(KNURL_TEST_DIR "/ignored.gltf", json, sizeof json - 1);
    knurl_description *d = load_file(KNURL_TEST_DIR "/ignored.gltf");
    assert_true(has_warning(d, "/materials/1: normalTexture is ignored"));
    assert_true(has_warning(d, "/materials/1/extensions/KHR_materials_transmission: transmissionTexture is"));
    assert_int_equal(d->warning_count, 2);
    knurl_description_release(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(meshes_keep_their_bits),
        cmocka_unit_test(materials_and_displacement),
        cmocka_unit_test(images_of_three_kinds),
        cmocka_unit_test(nodes_cameras_and_lights),
        cmocka_unit_test(glb_strips_fans_and_sparse),
        cmocka_unit_test(broken_glb),
        cmocka_unit_test(texcoord_set_of_the_displacement),
        cmocka_unit_test(ignored_textures),
    };
    return cmocka_run_group_tests(tests, make_context, drop_context);
}
