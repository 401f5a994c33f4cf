/* MTL: every option of disp, the turn of v, and the conversion to metallic-roughness. */
#include "unit/test_description_common.h"

#include <math.h>
#include <stdlib.h>

#include "data/description.h"
#include "io/mtl.h"

static knurl_description *read_text(const char *text, knurl_status expected, knurl_error *error)
{
    char bytes[2048];
    assert_true(strlen(text) < sizeof bytes);
    memcpy(bytes, text, strlen(text));
    knurl_description *d = description_new(context, "folder/scene.obj");
    assert_non_null(d);
    knurl_status status = mtl_read(d, (unsigned char *)bytes, strlen(text), "folder/a.mtl", error);
    if (status != expected) print_error("%s\n", error->message);
    assert_int_equal(status, expected);
    return d;
}

static knurl_description *read_good(const char *text)
{
    knurl_error error = {0};
    knurl_description *d = read_text(text, KNURL_OK, &error);
    assert_true(d->material_count > 0);
    return d;
}

typedef struct disp_case {
    const char *line;
    const char *path;
    double offset, factor;
    double uv_offset[2], uv_scale[2];
    knurl_wrap wrap;
    const char *warning; /* NULL: none */
} disp_case;

static const disp_case disp_cases[] = {
    {"disp h.png", "folder/h.png", 0, 1, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp -mm -0.5 2 h.png", "folder/h.png", -0.5, 2, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp -mm 0.25 h.png", "folder/h.png", 0.25, 1, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp -bm 3 h.png", "folder/h.png", 0, 3, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp -bm 3 -mm 1 2 h.png", "folder/h.png", 1, 6, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"map_disp -s 3 h.png", "folder/h.png", 0, 1, {0, 0}, {3, 1}, KNURL_WRAP_REPEAT, NULL},
    {"map_Disp -s 3 4 h.png", "folder/h.png", 0, 1, {0, -3}, {3, 4}, KNURL_WRAP_REPEAT, NULL},
    {"disp -s 3 4 5 h.png", "folder/h.png", 0, 1, {0, -3}, {3, 4}, KNURL_WRAP_REPEAT, NULL},
    {"disp -o 0.25 h.png", "folder/h.png", 0, 1, {0.25, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp -o 0.25 0.125 0 h.png", "folder/h.png", 0, 1, {0.25, -0.125}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp -o 0.25 0.125 -s 2 4 h.png",
     "folder/h.png",
     0,
     1,
     {0.25, -3.125},
     {2, 4},
     KNURL_WRAP_REPEAT,
     NULL},
    {"disp -clamp on h.png", "folder/h.png", 0, 1, {0, 0}, {1, 1}, KNURL_WRAP_CLAMP, NULL},
    {"disp -clamp off h.png", "folder/h.png", 0, 1, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp -blendu on -blendv off -texres 512 -type sphere -t 0 0 0 -boost 2 -imfchan l h.png",
     "folder/h.png",
     0,
     1,
     {0, 0},
     {1, 1},
     KNURL_WRAP_REPEAT,
     NULL},
    {"disp -imfchan g h.png", "folder/h.png", 0, 1, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, "-imfchan g"},
    {"disp -wobble 2 3 -bm 2 h.png", "folder/h.png", 0, 2, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, "-wobble"},
    {"disp -bm 2 my height map 01.png",
     "folder/my height map 01.png",
     0,
     2,
     {0, 0},
     {1, 1},
     KNURL_WRAP_REPEAT,
     NULL},
    {"disp -s 2 2 2 100", "folder/100", 0, 1, {0, -1}, {2, 2}, KNURL_WRAP_REPEAT, NULL},
    {"disp \"a b.png\"", "folder/a b.png", 0, 1, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp maps\\h.png", "folder/maps/h.png", 0, 1, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp /abs/h.png # comment", "/abs/h.png", 0, 1, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
    {"disp -mm 1 \\\n 2 h.png", "folder/h.png", 1, 2, {0, 0}, {1, 1}, KNURL_WRAP_REPEAT, NULL},
};

static void every_option_of_disp(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof disp_cases / sizeof *disp_cases; i++) {
        const disp_case *c = &disp_cases[i];
        char text[512];
        (void)snprintf(text, sizeof text, "newmtl m\n%s\r\n", c->line);
        knurl_description *d = read_good(text);
        const knurl_description_material *m = &d->materials[0];
        assert_int_equal(m->displacement.image, 0);
        assert_string_equal(d->images[0].path, c->path);
        expect_numbers(&m->displacement_offset, 1, &c->offset);
        expect_numbers(&m->displacement_factor, 1, &c->factor);
        expect_numbers(m->displacement.uv_offset, 2, c->uv_offset);
        expect_numbers(m->displacement.uv_scale, 2, c->uv_scale);
        assert_int_equal(m->displacement.wrap_u, c->wrap);
        assert_int_equal(m->displacement.wrap_v, c->wrap);
        assert_int_equal(d->warning_count, c->warning ? 1 : 0);
        if (c->warning) assert_true(has_warning(d, c->warning));
        knurl_description_release(d);
    }
}

/* A point's image row from the file's own convention and from ours must be the same. */
static void turned_v_reads_the_same_row(void **state)
{
    (void)state;
    const mtl_texture texture = {.gain = 1, .scale = {2.5, 3.5}, .offset = {0.3, 0.7}};
    knurl_texture_ref ref = mtl_texture_ref(&texture, 0);
    for (int i = 0; i <= 10; i++) {
        double s = 0.1 * i, t_file = 0.37 * i - 1.0, t = 1.0 - t_file;
        double u_file = texture.offset[0] + texture.scale[0] * s,
               v_file = texture.offset[1] + texture.scale[1] * t_file;
        EXPECT_NUMBERS(((const double[]){ref.uv_offset[0] + ref.uv_scale[0] * s,
                                         ref.uv_offset[1] + ref.uv_scale[1] * t}),
                       u_file, 1.0 - v_file);
    }
}

static void plain_and_textured_materials(void **state)
{
    (void)state;
    knurl_description *d =
        read_good("\xef\xbb\xbfnewmtl plain\nKd 0.5 0.25 0.125\n\n"
                  "newmtl with blanks\nKd 0.5\nKs 1 1 1\nNs 98\nmap_Kd -s 2 2 c.png\nKe 3 2 1\n"
                  "newmtl pbr\nmap_Kd c.png\nPr 0.25\nPm 0.75\nmap_Pr orm.png\nmap_Pm orm.png\n"
                  "newmtl cut\nmap_Kd c.png\nmap_d c.png\nd 0.5\nmap_Ke e.png\n");
    assert_int_equal(d->material_count, 4);
    const knurl_description_material *m = d->materials;
    assert_string_equal(m[0].name, "plain");
    EXPECT_NUMBERS(m[0].base_color, 0.5, 0.25, 0.125, 1.0);
    EXPECT_NUMBERS(((const double[]){m[0].roughness, m[0].metallic, m[0].ior}), 1.0, 0.0, 1.5);
    assert_int_equal(m[0].base_color_texture.image, -1);
    assert_int_equal(m[0].displacement.image, -1);
    assert_string_equal(m[1].name, "with blanks");
    EXPECT_NUMBERS(m[1].base_color, 0.5, 0.5, 0.5, 1.0);
    EXPECT_NUMBERS(m[1].emissive, 3.0, 2.0, 1.0);
    EXPECT_NUMBERS(&m[1].roughness, sqrt(sqrt(0.02)));
    EXPECT_NUMBERS(m[1].base_color_texture.uv_scale, 2.0, 2.0);
    EXPECT_NUMBERS(m[1].base_color_texture.uv_offset, 0.0, -1.0);
    EXPECT_NUMBERS(((const double[]){m[2].roughness, m[2].metallic}), 0.25, 0.75);
    EXPECT_NUMBERS(m[2].base_color, 1.0, 1.0, 1.0, 1.0);
    assert_int_equal(m[2].metallic_roughness_texture.image, 1);
    assert_int_equal(m[2].base_color_texture.image, 0); /* one image for one file */
    assert_int_equal(m[3].alpha_mode, KNURL_ALPHA_BLEND);
    EXPECT_NUMBERS(&m[3].base_color[3], 0.5);
    EXPECT_NUMBERS(m[3].emissive, 1.0, 1.0, 1.0);
    assert_int_equal(d->warning_count, 0);
    knurl_description_release(d);
}

static void glass_mirror_and_warnings(void **state)
{
    (void)state;
    knurl_description *d =
        read_good("newmtl glass\nillum 7\nTf 0.9 0.8 0.7\nNi 1.33\nNs 1e6\n"
                  "newmtl thin\nillum 6\nTr 0.75\n"
                  "newmtl mirror\nillum 3\nKd 0 0 0\nKs 0.9 0.8 0.7\nNi 1\n"
                  "newmtl odd\nKd spectral a.rfl\nmap_Pm m.png\nmap_d x.png\nbump b.png\nfoo 1\nKa 1 1 1\n"
                  "Kd 2 0 0\nmap_Kd -mm 0 2 c.png\n");
    const knurl_description_material *m = d->materials;
    EXPECT_NUMBERS(((const double[]){m[0].transmission, m[0].ior, m[0].base_color[1], m[0].base_color[3]}),
                   0.9, 1.33, 0.8, 1.0);
    assert_true(m[0].roughness < 0.05);
    assert_int_equal(m[0].alpha_mode, KNURL_ALPHA_OPAQUE);
    EXPECT_NUMBERS(&m[1].transmission, 0.75);
    EXPECT_NUMBERS(((const double[]){m[2].metallic, m[2].base_color[0], m[2].ior}), 1.0, 0.9, 1.5);
    EXPECT_NUMBERS(m[3].base_color, 1.0, 0.0, 0.0, 1.0);
    const char *const expected[] = {"a.mtl:15: Kd spectral", "map_Pm is ignored",       "map_d is ignored",
                                    "a.mtl:18: bump",        "a.mtl:19: statement foo", "a.mtl:21: Kd is 2",
                                    "a.mtl:22: -mm and -bm"};
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) assert_true(has_warning(d, expected[i]));
    assert_int_equal(d->warning_count, 7);
    knurl_description_release(d);
}

static void mistakes_name_their_line(void **state)
{
    (void)state;
    const struct {
        const char *text, *place, *detail;
    } cases[] = {
        {"Kd 1 1 1\n", "folder/a.mtl:1:", "expected newmtl"},
        {"# c\nnewmtl\n", "folder/a.mtl:2:", "without a name"},
        {"newmtl m\nKd red\n", "folder/a.mtl:2:", "found \"red\", expected a number"},
        {"newmtl m\nKd 1 0x1 1\n", "folder/a.mtl:2:", "found \"0x1\""},
        {"newmtl m\nNs nan\n", "folder/a.mtl:2:", "found \"nan\""},
        {"newmtl m\nNs 1e999\n", "folder/a.mtl:2:", "found \"1e999\""},
        {"newmtl m\n\nd\n", "folder/a.mtl:3:", "d: found \"\""},
        {"newmtl m\nillum x\n", "folder/a.mtl:2:", "illum"},
        {"newmtl m\ndisp\n", "folder/a.mtl:2:", "expected the name of an image"},
        {"newmtl m\ndisp -bm h.png\n", "folder/a.mtl:2:", "after -bm found \"h.png\""},
        {"newmtl m\ndisp -bm 2\n", "folder/a.mtl:2:", "after -bm found \"2\""},
        {"newmtl m\ndisp -clamp maybe h.png\n", "folder/a.mtl:2:", "-clamp is \"maybe\""},
        {"newmtl m\ndisp -clamp\n", "folder/a.mtl:2:", "ends the line"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        knurl_error error = {0};
        knurl_description *d = read_text(cases[i].text, KNURL_ERROR_INPUT, &error);
        if (!strstr(error.message, cases[i].place) || !strstr(error.message, cases[i].detail))
            print_error("\"%s\" for \"%s\"\n", error.message, cases[i].text);
        assert_non_null(strstr(error.message, cases[i].place));
        assert_non_null(strstr(error.message, cases[i].detail));
        knurl_description_release(d);
    }
}

static void numbers_are_rounded_correctly(void **state)
{
    (void)state;
    const char *const words[] = {"0.1",
                                 "-0.30000000000000004",
                                 "1e22",
                                 "123456789012345678901234567890",
                                 "1e-310",
                                 "0.000000000000000000000000000000000000001",
                                 "-0",
                                 ".5",
                                 "5.",
                                 "+7e+2",
                                 "3.14159265358979323846264338327950288"};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        double value, expected = strtod(words[i], NULL);
        assert_true(text_number((text_span){words[i], words[i] + strlen(words[i])}, &value));
        assert_memory_equal(&value, &expected, sizeof value);
    }
    const char *const bad[] = {"",   ".",   "-",   "1e",   "1e+", "1.2.3",
                               "1a", "inf", "nan", "0x10", "--1", "1e400"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        double value;
        assert_false(text_number((text_span){bad[i], bad[i] + strlen(bad[i])}, &value));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_option_of_disp),         cmocka_unit_test(turned_v_reads_the_same_row),
        cmocka_unit_test(plain_and_textured_materials), cmocka_unit_test(glass_mirror_and_warnings),
        cmocka_unit_test(mistakes_name_their_line),     cmocka_unit_test(numbers_are_rounded_correctly),
    };
    return cmocka_run_group_tests(tests, make_context, drop_context);
}
