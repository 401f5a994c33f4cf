/* glTF files that are wrong: the good one of tests/data with one piece of text replaced, and whole
 * documents. Each must fail with its status and name the place. */
#include "unit/test_description_common.h"

#include <stdlib.h>

#include "base/base.h"

#define BROKEN KNURL_TEST_DIR "/broken.gltf"

static char *good; /* text of displaced.gltf */
static size_t good_size;

static int setup(void **state)
{
    if (make_context(state) != 0) return 1;
    unsigned char *bytes;
    if (knurl_file_read(context, KNURL_SOURCE_DIR "/tests/data/displaced.gltf", &bytes, &good_size, NULL) !=
        KNURL_OK)
        return 1;
    good = (char *)bytes;
    return 0;
}

static int teardown(void **state)
{
    knurl_free(context, good);
    return drop_context(state);
}

/* The good file with the first `from` after `anchor` replaced. Blanks in the file are as json.dumps
 * with indent 1 writes them, so pieces are kept within a line. */
static void write_replaced(const char *anchor, const char *from, const char *to)
{
    const char *start = strstr(good, anchor);
    assert_non_null(start);
    const char *at = strstr(start, from);
    assert_non_null(at);
    size_t before = (size_t)(at - good), old = strlen(from), new = strlen(to);
    char *text = malloc(good_size + new);
    assert_non_null(text);
    memcpy(text, good, before);
    memcpy(text + before, to, new);
    memcpy(text + before + new, at + old, good_size - before - old);
    write_bytes(BROKEN, text, good_size - old + new);
    free(text);
}

typedef struct broken_case {
    const char *anchor, *from, *to;
    knurl_status status;
    const char *place, *detail;
} broken_case;

static const broken_case cases[] = {
    {"asset", "\"2.0\"", "\"1.0\"", KNURL_ERROR_UNSUPPORTED, "/asset/version", "found \"1.0\""},
    {"asset", "\"2.0\"", "2.0", KNURL_ERROR_INPUT, "/asset/version", "found a number, expected a string"},
    {"extensionsRequired", "KHR_materials_displacement", "KHR_draco_mesh_compression",
     KNURL_ERROR_UNSUPPORTED, "/extensionsRequired/0", "KHR_draco_mesh_compression"},
    {"displacementGeometryTexture", "\"index\": 0", "\"index\": 7", KNURL_ERROR_INPUT,
     "/materials/0/extensions/KHR_materials_displacement/displacementGeometryTexture/index",
     "found 7, expected 0 to 2"},
    {"displacementGeometryTexture", "\"index\": 0", "\"idx\": 0", KNURL_ERROR_INPUT,
     "/displacementGeometryTexture/index", "not there"},
    {"displacementGeometryFactor", "0.2", "\"0.2\"", KNURL_ERROR_INPUT,
     "/KHR_materials_displacement/displacementGeometryFactor", "found a string, expected a number"},
    {"\"rotation\": 0.125", "0.125", "null", KNURL_ERROR_INPUT, "/extensions/KHR_texture_transform/rotation",
     "found null, expected a number"},
    {"\"baseColorFactor\"", "0.5,", "", KNURL_ERROR_INPUT, "/baseColorFactor",
     "found 3 elements, expected 4"},
    {"\"roughnessFactor\"", "0.75", "-1", KNURL_ERROR_INPUT, "/roughnessFactor", "found -1, expected 0 to 1"},
    {"\"alphaMode\"", "MASK", "MOSK", KNURL_ERROR_INPUT, "/materials/0/alphaMode", "found \"MOSK\""},
    {"\"wrapS\"", "33648", "33649", KNURL_ERROR_INPUT, "/samplers/0/wrapS", "found 33649"},
    {"\"textures\"", "\"source\": 2", "\"source\": 3.5", KNURL_ERROR_INPUT, "/textures/2/source",
     "found 3.5"},
    {"\"buffers\"", "\"byteLength\": 153", "\"byteLength\": 154", KNURL_ERROR_INPUT, "/buffers/0",
     "153 bytes are there, expected byteLength 154"},
    {"\"buffers\"", ";base64,", ";base64,*", KNURL_ERROR_INPUT, "/buffers/0/uri", "character 0"},
    {"\"buffers\"", ";base64,", ",", KNURL_ERROR_UNSUPPORTED, "/buffers/0/uri", "expected data:"},
    {"\"buffers\"", "data:", "http://", KNURL_ERROR_UNSUPPORTED, "/buffers/0/uri", "expected a file"},
    {"\"buffers\"", "data:application/octet-stream;base64,", "nowhere.bin?", KNURL_ERROR_INPUT,
     "/buffers/0/uri", "nowhere.bin"},
    {"\"bufferViews\"", "\"byteLength\": 48", "\"byteLength\": 154", KNURL_ERROR_INPUT,
     "/bufferViews/0/byteLength", "found 154"},
    {"\"byteOffset\": 128", "\"byteLength\": 12", "\"byteLength\": 100", KNURL_ERROR_INPUT, "/bufferViews/3",
     "byteOffset 128 + byteLength 100, expected at most 153"},
    {"\"bufferViews\"", "\"byteLength\": 48", "\"byteLength\": 48, \"byteStride\": 8", KNURL_ERROR_INPUT,
     "/bufferViews/0/byteStride", "found 8, expected at least 12"},
    {"\"accessors\"", "\"count\": 4", "\"count\": 5", KNURL_ERROR_INPUT, "/accessors/0",
     "5 elements take 60 bytes of buffer view 0, which has 48"},
    {"\"accessors\"", "\"count\": 4", "\"count\": 4294967295", KNURL_ERROR_INPUT, "/accessors/0",
     "51539607540 bytes"},
    {"\"accessors\"", "\"count\": 4", "\"count\": 1e300", KNURL_ERROR_INPUT, "/accessors/0/count",
     "expected a whole number"},
    {"\"accessors\"", "\"count\": 4", "\"count\": 0", KNURL_ERROR_INPUT, "/accessors/0", "count is 0"},
    {"\"accessors\"", "\"VEC3\"", "\"VEC5\"", KNURL_ERROR_INPUT, "/accessors/0", "type is \"VEC5\""},
    {"\"accessors\"", "\"VEC3\"", "\"VEC2\"", KNURL_ERROR_INPUT, "/meshes/0/primitives/0/attributes/POSITION",
     "has 2 components, expected 3"},
    {"\"accessors\"", "5126", "5127", KNURL_ERROR_INPUT, "/accessors/0", "componentType is 5127"},
    {"\"indices\"", "3", "99", KNURL_ERROR_INPUT, "/meshes/0/primitives/0/indices",
     "found 99, expected 0 to 4"},
    {"\"indices\"", "3", "2", KNURL_ERROR_INPUT, "/meshes/0/primitives/0/indices", "components"},
    {"\"POSITION\"", "\"material\": 0", "\"material\": 1", KNURL_ERROR_INPUT,
     "/meshes/0/primitives/0/material", "found 1, expected 0 to 0"},
    {"\"name\": \"tile\"", "\"mesh\": 0", "\"mesh\": 0, \"children\": [0]", KNURL_ERROR_INPUT, "/children",
     "node 0 is below itself"},
    {"\"name\": \"tile\"", "\"mesh\": 0", "\"mesh\": 0, \"children\": [1]", KNURL_ERROR_INPUT, "/children",
     "is a child of node"},
    {"\"name\": \"tile\"", "\"mesh\": 0", "\"mesh\": 1", KNURL_ERROR_INPUT, "/nodes/1/mesh",
     "found 1, expected 0 to 0"},
    {"\"name\": \"tile\"", "\"mesh\": 0", "\"mesh\": 0, \"rotation\": [0, 0, 0, 0]", KNURL_ERROR_INPUT,
     "/nodes/1/rotation", "length 0"},
    {"\"yfov\"", "0.7", "0", KNURL_ERROR_INPUT, "/cameras/0/perspective", "yfov"},
    {"\"type\": \"point\"", "point", "area", KNURL_ERROR_INPUT, "/extensions/KHR_lights_punctual/lights/0",
     "area"},
    {"\"environment\"", "\"intensity\": 2", "\"intensity\": -2", KNURL_ERROR_INPUT,
     "/scenes/0/extras/environment/intensity", "found -2"},
};

static void one_change_each(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const broken_case *c = &cases[i];
        write_replaced(c->anchor, c->from, c->to);
        expect_failure(BROKEN, c->status, c->place, c->detail);
    }
}

static void files_that_are_no_gltf(void **state)
{
    (void)state;
    expect_failure(KNURL_TEST_DIR "/missing.gltf", KNURL_ERROR_INPUT, "missing.gltf", "No such file");
    write_bytes(BROKEN, "", 0);
    expect_failure(BROKEN, KNURL_ERROR_INPUT, "broken.gltf", "empty");
    write_bytes(BROKEN, good, good_size / 2);
    expect_failure(BROKEN, KNURL_ERROR_INPUT, "broken.gltf:", "JSON");
    write_bytes(BROKEN, "[]", 2);
    expect_failure(BROKEN, KNURL_ERROR_INPUT, "broken.gltf", "not an object");
    write_bytes(BROKEN, "{}", 2);
    expect_failure(BROKEN, KNURL_ERROR_INPUT, "/asset", "not there");
    static const char nodes[] = "{\"asset\":{\"version\":\"2.0\"},\"nodes\":{}}";
    write_bytes(BROKEN, nodes, sizeof nodes - 1);
    expect_failure(BROKEN, KNURL_ERROR_INPUT, "/nodes", "found an object, expected an array");
}

/* Ten million brackets must not use up the stack, nor a huge count the memory. */
static void absurd_sizes(void **state)
{
    (void)state;
    size_t size = 10u << 20;
    char *deep = malloc(size);
    assert_non_null(deep);
    memset(deep, '[', size);
    write_bytes(BROKEN, deep, size);
    free(deep);
    expect_failure(BROKEN, KNURL_ERROR_INPUT, "broken.gltf:1", "JSON");
    static const char zeros[] =
        "{\"asset\":{\"version\":\"2.0\"},\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"
        "\"accessors\":[{\"componentType\":5126,\"count\":4000000000,\"type\":\"VEC3\"}]}";
    write_bytes(BROKEN, zeros, sizeof zeros - 1);
    expect_failure(BROKEN, KNURL_ERROR_LIMIT, "/accessors/0", "4000000000 without a bufferView");
    /* The same vertices again and again: the budget is by file size. */
    char *text = malloc(1 << 20);
    assert_non_null(text);
    int length =
        sprintf(text, "{\"asset\":{\"version\":\"2.0\"},\"accessors\":[{\"componentType\":5126,\"count\":"
                      "1000000,\"type\":\"VEC3\"}],\"meshes\":[{\"primitives\":[");
    for (int i = 0; i < 1000; i++)
        length += sprintf(text + length, "%s{\"attributes\":{\"POSITION\":0}}", i ? "," : "");
    length += sprintf(text + length, "]}]}");
    write_bytes(BROKEN, text, (size_t)length);
    free(text);
    expect_failure(BROKEN, KNURL_ERROR_LIMIT, "/meshes/0/primitives/", "far larger than its file");
}

/* Positions 0, 1, NaN as in a file whose float is 0x7fc00000. */
static void positions_not_finite(void **state)
{
    (void)state;
    static const char json[] =
        "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"name\":\"bad\","
        "\"primitives\":[{"
        "\"attributes\":{\"POSITION\":0}}]}],\"buffers\":[{\"byteLength\":36,\"uri\":\"data:;base64,"
        "AAAAAAAAAAAAAAAA"
        "AACAPwAAAAAAAAAAAAAAAAAAwH8AAAAA\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}]}";
    write_bytes(BROKEN, json, sizeof json - 1);
    expect_failure(BROKEN, KNURL_ERROR_INPUT, "mesh 0 (\"bad\"), vertex 2", "position is (0, nan, 0)");
}

static void deep_chains_of_nodes(void **state)
{
    (void)state;
    enum { COUNT = 200000 };
    char *text = malloc(COUNT * 24);
    assert_non_null(text);
    int length = sprintf(text, "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[");
    for (int i = 0; i + 1 < COUNT; i++) length += sprintf(text + length, "{\"children\":[%d]},", i + 1);
    length += sprintf(text + length, "{}]}");
    write_bytes(BROKEN, text, (size_t)length);
    free(text);
    knurl_description *d = load_file(BROKEN);
    assert_int_equal(d->instance_count, 0);
    knurl_description_release(d);
}

/* Whatever single allocation fails, the call says so and leaks nothing. */
typedef struct failing {
    int left;
} failing;

static void *failing_reallocate(void *user, void *p, size_t old_size, size_t new_size, size_t alignment)
{
    failing *f = user;
    if (new_size == 0) {
        free(p);
        return NULL;
    }
    if (f->left-- <= 0) return NULL;
    void *made = aligned_alloc(alignment, (new_size + alignment - 1) / alignment * alignment);
    if (made && p) {
        memcpy(made, p, old_size < new_size ? old_size : new_size);
        free(p);
    }
    return made;
}

static void out_of_memory_everywhere(void **state)
{
    (void)state;
    const char *const files[] = {"displaced.gltf", "room.obj", "corner.ply"};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char path[1024];
        (void)snprintf(path, sizeof path, "%s/tests/data/%s", KNURL_SOURCE_DIR, files[i]);
        knurl_status status = KNURL_ERROR_MEMORY;
        int allowed = 1, failures = 0;
        for (; status != KNURL_OK && allowed < 2000; allowed++) {
            failing f = {allowed};
            knurl_context_def def = knurl_context_def_default();
            def.reallocate = failing_reallocate;
            def.allocator_user = &f;
            knurl_context *tight;
            assert_int_equal(knurl_context_create(&def, &tight, NULL), KNURL_OK);
            knurl_description *d;
            status = knurl_description_load(tight, path, &d, NULL);
            /* A warning that finds no memory is only logged, so some failures do no harm. */
            if (status != KNURL_OK) {
                assert_int_equal(status, KNURL_ERROR_MEMORY);
                failures++;
            }
            knurl_description_release(d);
            assert_int_equal(knurl_context_bytes(tight), 0);
            knurl_context_release(tight);
        }
        assert_int_equal(status, KNURL_OK);
        assert_true(failures > 10);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_change_each),      cmocka_unit_test(files_that_are_no_gltf),
        cmocka_unit_test(absurd_sizes),         cmocka_unit_test(positions_not_finite),
        cmocka_unit_test(deep_chains_of_nodes), cmocka_unit_test(out_of_memory_everywhere),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
