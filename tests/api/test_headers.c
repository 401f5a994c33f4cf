/* Each public header stands on its own, in C and in C++; definition structs that no default
 * function has filled are refused. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include <knurl/knurl.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const headers[] = {
    "base.h",        "image.h",  "heightmap.h", "surface.h", "scene.h",
    "description.h", "render.h", "knurl.h",     "embree.h",  "tessellation.h",
};

/* Compiles a file that does nothing but include the header, twice. */
static void check_header(const char *compiler, const char *header)
{
    char command[2048];
    (void)snprintf(
        command, sizeof command,
        "printf '#include <knurl/%s>\\n#include <knurl/%s>\\n' | %s -Wall -Wextra -Werror -fsyntax-only "
        "-I '%s/include' - 2>&1",
        header, header, compiler, KNURL_SOURCE_DIR);
    int status = system(command);
    if (status != 0) print_message("%s does not compile alone with %s\n", header, compiler);
    assert_int_equal(status, 0);
}

static void test_headers_alone(void **state)
{
    (void)state;
    if (system("cc --version >/dev/null 2>&1") != 0 || system("c++ --version >/dev/null 2>&1") != 0) skip();
    for (size_t i = 0; i < sizeof headers / sizeof headers[0]; i++) {
        check_header("cc -x c -std=c17 -pedantic", headers[i]);
        check_header("c++ -x c++ -std=c++17", headers[i]);
    }
}

static void test_every_header_is_listed(void **state)
{
    (void)state;
    FILE *list = popen("cd '" KNURL_SOURCE_DIR "/include/knurl' && ls *.h", "r");
    assert_non_null(list);
    char line[256];
    size_t count = 0;
    while (fgets(line, sizeof line, list)) {
        line[strcspn(line, "\n")] = '\0';
        bool listed = false;
        for (size_t i = 0; i < sizeof headers / sizeof headers[0]; i++)
            listed |= strcmp(line, headers[i]) == 0;
        if (!listed) print_message("%s is not checked\n", line);
        assert_true(listed);
        count++;
    }
    assert_int_equal(pclose(list), 0);
    assert_int_equal(count, sizeof headers / sizeof headers[0]);
}

static void refused(knurl_status status, const knurl_error *error)
{
    assert_int_equal(status, KNURL_ERROR_ARGUMENT);
    assert_int_equal(error->status, KNURL_ERROR_ARGUMENT);
    assert_non_null(strstr(error->message, "_default()"));
}

static void test_zeroed_definitions_are_refused(void **state)
{
    (void)state;
    knurl_error error = {0};
    knurl_context *context = NULL;
    refused(knurl_context_create(&(knurl_context_def){0}, &context, &error), &error);
    assert_null(context);
    knurl_context_def def = knurl_context_def_default();
    assert_int_equal(knurl_context_create(&def, &context, &error), KNURL_OK);

    knurl_heightmap *map = NULL;
    refused(knurl_heightmap_create(context, &(knurl_heightmap_def){0}, &map, &error), &error);
    assert_null(map);

    knurl_surface *surface = NULL;
    refused(knurl_surface_create(context, &(knurl_surface_def){0}, &surface, &error), &error);
    knurl_surface_def surface_def = knurl_surface_def_default();
    surface_def.displacement.cookie = 0;
    refused(knurl_surface_create(context, &surface_def, &surface, &error), &error);
    assert_null(surface);

    knurl_scene *scene = NULL;
    knurl_description description = {.context = context};
    refused(knurl_scene_build(&description, &(knurl_build_def){0}, &scene, &error), &error);
    knurl_build_def build_def = knurl_build_def_default();
    build_def.heightmap.cookie = 0;
    refused(knurl_scene_build(&description, &build_def, &scene, &error), &error);
    assert_null(scene);
    refused(knurl_description_override(&description, &(knurl_displacement_override){0}, &error), &error);

    build_def = knurl_build_def_default();
    assert_int_equal(knurl_scene_build(&description, &build_def, &scene, &error), KNURL_OK);
    knurl_render_result result = {0};
    refused(knurl_render(&description, scene, &(knurl_render_def){0}, &result, &error), &error);
    knurl_scene_release(scene);
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_headers_alone),
        cmocka_unit_test(test_every_header_is_listed),
        cmocka_unit_test(test_zeroed_definitions_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
