/* Every format: what is saved is read back. Variants that knurl does not write itself are made here
 * with the format's own library, or byte by byte. */
#include "test_image_common.h"
#include "io/image_io.h"

#include <ImfCRgbaFile.h>
#include <math.h>
#include <png.h>
#include <stb/stb_image.h>
#include <sys/stat.h>

static void round_trip(const char *extension, int32_t channels, knurl_pixel_format format)
{
    knurl_context *context = test_context(0, 0);
    static const int32_t sizes[][2] = {{1, 1}, {7, 5}, {130, 67}, {1, 40}, {40, 1}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        char name[64];
        (void)snprintf(name, sizeof name, "round_%d_%d%s", channels, (int)format, extension);
        knurl_image *image =
            test_pattern(context, sizes[s][0], sizes[s][1], channels, format, (uint32_t)s + 1);
        test_save(context, image, test_path(name));
        knurl_image *back = test_load(context, test_path(name));
        test_expect_same(back, image);
        knurl_image_release(image);
        knurl_image_release(back);
    }
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void test_exact_formats(void **state)
{
    (void)state;
    for (int32_t channels = 1; channels <= 4; channels++) {
        round_trip(".png", channels, KNURL_PIXEL_U8);
        round_trip(".png", channels, KNURL_PIXEL_U16);
        round_trip(".tif", channels, KNURL_PIXEL_U8);
        round_trip(".tiff", channels, KNURL_PIXEL_U16);
        round_trip(".tif", channels, KNURL_PIXEL_F32);
        round_trip(".exr", channels, KNURL_PIXEL_F32);
    }
    round_trip(".pgm", 1, KNURL_PIXEL_U8);
    round_trip(".PGM", 1, KNURL_PIXEL_U16);
    round_trip(".ppm", 3, KNURL_PIXEL_U8);
    round_trip(".ppm", 3, KNURL_PIXEL_U16);
    round_trip(".pfm", 1, KNURL_PIXEL_F32);
    round_trip(".pfm", 3, KNURL_PIXEL_F32);
}

/* Floats that are not numbers, or nearly nothing, come back bit for bit too. */
static void test_special_floats(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    const float special[] = {NAN, INFINITY, -INFINITY, -0.0f, 1e-45f, 3.4028235e38f};
    static const char *const names[] = {"special.tif", "special.exr", "special.pfm"};
    knurl_image *image;
    assert_int_equal(knurl_image_create(context, 2, 1, 3, KNURL_PIXEL_F32, special, &image, NULL), KNURL_OK);
    for (size_t i = 0; i < 3; i++) {
        test_save(context, image, test_path(names[i]));
        knurl_image *back = test_load(context, test_path(names[i]));
        test_expect_same(back, image);
        knurl_image_release(back);
    }
    knurl_image_release(image);
    knurl_context_release(context);
}

static void test_jpeg(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    for (int32_t channels = 1; channels <= 3; channels += 2) {
        knurl_image *image;
        assert_int_equal(knurl_image_create(context, 61, 47, channels, KNURL_PIXEL_U8, NULL, &image, NULL),
                         KNURL_OK);
        for (size_t i = 0; i < image_row_samples(image) * 47; i++)
            image->samples[i] = (uint8_t)(128 + 100 * sin(0.002 * (double)i));
        test_save(context, image, test_path("a.jpg"));
        knurl_image *back = test_load(context, test_path("a.jpg"));
        test_expect_shape(back, 61, 47, channels, KNURL_PIXEL_U8);
        knurl_image_difference d;
        assert_int_equal(knurl_image_compare(context, back, image, &d, NULL, NULL), KNURL_OK);
        assert_true(d.maximum > 0 && d.maximum < 8.0 / 255 && d.rmse < 1.5 / 255);
        knurl_image_release(image);
        knurl_image_release(back);
    }
    knurl_context_release(context);
}

static void test_hdr(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    knurl_image *image = test_pattern(context, 45, 31, 3, KNURL_PIXEL_F32, 3);
    const float hard[] = {1e-30f, 1.0f, 255.9f, -4, NAN, INFINITY, 0, 1e-42f, 127.99f, 65504, 0.5f, 1e38f};
    memcpy(image->samples, hard, sizeof hard);
    test_save(context, image, test_path("a.hdr"));
    knurl_image *back = test_load(context, test_path("a.hdr"));
    test_expect_shape(back, 45, 31, 3, KNURL_PIXEL_F32);
    for (int32_t i = 2; i < 45 * 31; i++) {
        const float *a = (const float *)(const void *)image->samples + 3 * i;
        const float *b = (const float *)(const void *)back->samples + 3 * i;
        float largest = fmaxf(fmaxf(a[0], a[1]), fmaxf(a[2], 0));
        /* Half a step of an 8-bit mantissa whose top bit is set. */
        for (int c = 0; c < 3; c++) assert_true(fabsf(b[c] - fmaxf(a[c], 0)) <= largest / 255.0f);
    }
    const float *first = (const float *)(const void *)back->samples;
    assert_true(first[3] == 0 && first[4] == 0 && first[5] == 255 * 0x1p119f);
    /* What came from RGBE is stable. */
    test_save(context, back, test_path("b.hdr"));
    knurl_image *again = test_load(context, test_path("b.hdr"));
    test_expect_same(again, back);
    /* Another reader agrees. */
    int width, height, channels;
    float *other = stbi_loadf(test_path("a.hdr"), &width, &height, &channels, 3);
    assert_non_null(other);
    assert_memory_equal(other, back->samples, sizeof(float) * 45 * 31 * 3);
    stbi_image_free(other);
    knurl_image_release(image);
    knurl_image_release(back);
    knurl_image_release(again);
    knurl_context_release(context);
}

static knurl_image *decode(knurl_context *context, const void *bytes, size_t size)
{
    knurl_image *image = NULL;
    knurl_error error = {KNURL_OK, ""};
    if (knurl_image_decode(context, bytes, size, "bytes", &image, &error) != KNURL_OK)
        fail_msg("%s", error.message);
    return image;
}

static void test_hdr_runs(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    /* 9 wide: new runs; each component 5 times a value, then 4 of their own. */
    const unsigned char new_runs[] = "#?RGBE\n# made by hand\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n"
                                     "+Y 1 -X 9\n\x02\x02\x00\x09"
                                     "\x85\x80\x04\x01\x02\x03\x04\x89\x40\x89\x20\x89\x88";
    knurl_image *image = decode(context, new_runs, sizeof new_runs - 1);
    test_expect_shape(image, 9, 1, 3, KNURL_PIXEL_F32);
    assert_true(knurl_image_value(image, 8, 0, 0) == 128.0f && knurl_image_value(image, 4, 0, 0) == 128.0f);
    assert_true(knurl_image_value(image, 3, 0, 0) == 1.0f && knurl_image_value(image, 0, 0, 0) == 4.0f);
    assert_true(knurl_image_value(image, 5, 0, 1) == 64.0f && knurl_image_value(image, 5, 0, 2) == 32.0f);
    knurl_image_release(image);
    /* The older kind: a pixel, then twice itself. */
    const unsigned char old_runs[] = "#?RADIANCE\n\n-Y 1 +X 3\n\x80\x40\x20\x88\x01\x01\x01\x02";
    image = decode(context, old_runs, sizeof old_runs - 1);
    test_expect_shape(image, 3, 1, 3, KNURL_PIXEL_F32);
    assert_true(knurl_image_value(image, 2, 0, 0) == 128.0f && knurl_image_value(image, 2, 0, 2) == 32.0f);
    knurl_image_release(image);
    knurl_context_release(context);
}

static void test_pnm_variants(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    const char p2[] = "P2 # comment\n#another\n 3\t2\n 15 0 1 15 #c\n 7 8 9";
    knurl_image *image = decode(context, p2, strlen(p2));
    test_expect_shape(image, 3, 2, 1, KNURL_PIXEL_U8);
    assert_memory_equal(image->samples, "\x00\x11\xff\x77\x88\x99", 6);
    knurl_image_release(image);
    const char p3[] = "P3 1 1 65535 0 256 65535";
    image = decode(context, p3, strlen(p3));
    test_expect_shape(image, 1, 1, 3, KNURL_PIXEL_U16);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[1], 256);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[2], 65535);
    knurl_image_release(image);
    const unsigned char p5[] = "P5 2 1 65535\n\x12\x34\xff\xfe";
    image = decode(context, p5, sizeof p5 - 1);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[0], 0x1234);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[1], 0xfffe);
    knurl_image_release(image);
    /* 10 and 7-bit scales do not divide 255: they become 16 bits. */
    const unsigned char ten[] = "P5 2 1 1023\n\x03\xff\x02\x00";
    image = decode(context, ten, sizeof ten - 1);
    test_expect_shape(image, 2, 1, 1, KNURL_PIXEL_U16);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[0], 65535);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[1], (512 * 65535 + 511) / 1023);
    knurl_image_release(image);
    const unsigned char odd[] = "P6 1 1 100\n\x00\x32\x64";
    image = decode(context, odd, sizeof odd - 1);
    test_expect_shape(image, 1, 1, 3, KNURL_PIXEL_U16);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[1], 32768);
    knurl_image_release(image);
    knurl_context_release(context);
}

static void test_pfm_variants(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    /* Big endian, two rows: the file's first is the image's last. 1.0 and -2.0. */
    const unsigned char big[] = "Pf\n1 2\n0.5e+1\n\x3f\x80\x00\x00\xc0\x00\x00\x00";
    knurl_image *image = decode(context, big, sizeof big - 1);
    test_expect_shape(image, 1, 2, 1, KNURL_PIXEL_F32);
    assert_true(knurl_image_value(image, 0, 0, 0) == -2.0f && knurl_image_value(image, 0, 1, 0) == 1.0f);
    knurl_image_release(image);
    const unsigned char little[] = "PF 1 1 -1\n\x00\x00\x80\x3f\x00\x00\x00\xc0\x00\x00\x00\x00";
    image = decode(context, little, sizeof little - 1);
    test_expect_shape(image, 1, 1, 3, KNURL_PIXEL_F32);
    assert_true(knurl_image_value(image, 0, 0, 0) == 1.0f && knurl_image_value(image, 0, 0, 1) == -2.0f);
    knurl_image_release(image);
    knurl_context_release(context);
}

/* Writes rows of `row_bytes` with libpng; `interlace` runs its seven passes. */
static void write_png(const char *path, uint32_t width, uint32_t height, int depth, int type, bool interlace,
                      unsigned char *rows, size_t row_bytes)
{
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    png_init_io(png, file);
    png_set_IHDR(png, info, width, height, depth, type, interlace ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_color palette[4] = {{1, 2, 3}, {4, 5, 6}, {255, 0, 9}, {7, 7, 7}};
    png_byte alpha[2] = {0, 128};
    if (type == PNG_COLOR_TYPE_PALETTE) {
        png_set_PLTE(png, info, palette, 4);
        if (depth == 2) png_set_tRNS(png, info, alpha, 2, NULL);
    }
    png_set_gAMA(png, info, 0.45455); /* must not change samples */
    png_write_info(png, info);
    int passes = interlace ? png_set_interlace_handling(png) : 1;
    for (int pass = 0; pass < passes; pass++)
        for (uint32_t y = 0; y < height; y++) png_write_row(png, rows + y * row_bytes);
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    fclose(file);
}

static void test_png_variants(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    unsigned char packed[] = {0x1b}; /* 0, 1, 2, 3 in two bits each */
    write_png(test_path("grey2.png"), 4, 1, 2, PNG_COLOR_TYPE_GRAY, false, packed, 1);
    knurl_image *image = test_load(context, test_path("grey2.png"));
    test_expect_shape(image, 4, 1, 1, KNURL_PIXEL_U8);
    assert_memory_equal(image->samples, "\x00\x55\xaa\xff", 4);
    knurl_image_release(image);
    write_png(test_path("palette2.png"), 4, 1, 2, PNG_COLOR_TYPE_PALETTE, false, packed, 1);
    image = test_load(context, test_path("palette2.png"));
    test_expect_shape(image, 4, 1, 4, KNURL_PIXEL_U8);
    assert_memory_equal(image->samples, "\1\2\3\0\4\5\6\x80\xff\0\x09\xff\7\7\7\xff", 16);
    knurl_image_release(image);
    unsigned char index[] = {2, 0, 3};
    write_png(test_path("palette8.png"), 3, 1, 8, PNG_COLOR_TYPE_PALETTE, false, index, 3);
    image = test_load(context, test_path("palette8.png"));
    test_expect_shape(image, 3, 1, 3, KNURL_PIXEL_U8);
    assert_memory_equal(image->samples, "\xff\0\x09\1\2\3\7\7\7", 9);
    knurl_image_release(image);
    knurl_image *source = test_pattern(context, 37, 29, 1, KNURL_PIXEL_U8, 8);
    write_png(test_path("interlaced.png"), 37, 29, 8, PNG_COLOR_TYPE_GRAY, true, source->samples, 37);
    image = test_load(context, test_path("interlaced.png"));
    test_expect_same(image, source);
    knurl_image_release(image);
    knurl_image_release(source);
    /* 16 bits are big endian in the file: a known value. */
    unsigned char wide[] = {0x12, 0x34, 0xff, 0x01};
    write_png(test_path("grey16.png"), 2, 1, 16, PNG_COLOR_TYPE_GRAY, false, wide, 4);
    image = test_load(context, test_path("grey16.png"));
    test_expect_shape(image, 2, 1, 1, KNURL_PIXEL_U16);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[0], 0x1234);
    assert_int_equal(((const uint16_t *)(const void *)image->samples)[1], 0xff01);
    knurl_image_release(image);
    knurl_context_release(context);
}

static void test_conversions(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    const float values[] = {-1, 0.5f, 2, NAN};
    knurl_image *image, *back;
    assert_int_equal(knurl_image_create(context, 4, 1, 1, KNURL_PIXEL_F32, values, &image, NULL), KNURL_OK);
    test_save(context, image, test_path("clamp.png"));
    back = test_load(context, test_path("clamp.png"));
    test_expect_shape(back, 4, 1, 1, KNURL_PIXEL_U16);
    const uint16_t expected[] = {0, 32768, 65535, 0};
    assert_memory_equal(back->samples, expected, sizeof expected);
    knurl_image_release(back);
    /* Grey becomes three equal channels where the format has no grey. */
    test_save(context, image, test_path("grey.ppm"));
    back = test_load(context, test_path("grey.ppm"));
    test_expect_shape(back, 4, 1, 3, KNURL_PIXEL_U16);
    assert_int_equal(((const uint16_t *)(const void *)back->samples)[5], 32768);
    knurl_image_release(back);
    knurl_image_release(image);
    const uint8_t rgba[] = {0, 51, 255, 9};
    assert_int_equal(knurl_image_create(context, 1, 1, 4, KNURL_PIXEL_U8, rgba, &image, NULL), KNURL_OK);
    test_save(context, image, test_path("rgba.pfm"));
    back = test_load(context, test_path("rgba.pfm"));
    test_expect_shape(back, 1, 1, 3, KNURL_PIXEL_F32);
    assert_true(knurl_image_value(back, 0, 0, 1) == 51.0f / 255.0f &&
                knurl_image_value(back, 0, 0, 2) == 1.0f);
    knurl_image_release(back);
    knurl_error error;
    assert_int_equal(knurl_image_save(context, image, test_path("rgba.pgm"), &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_image_save(context, image, test_path("rgba.webp"), &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_image_save(context, image, "/nonexistent/a.png", &error), KNURL_ERROR_OUTPUT);
    assert_non_null(strstr(error.message, "/nonexistent/a.png"));
    knurl_image_release(image);
    knurl_context_release(context);
}

/* OpenEXR's C++ side, which knurl does not write with, reads the same values, as halves. */
static void expect_same_by_imf(const char *path, const knurl_image *image)
{
    ImfInputFile *file = ImfOpenInputFile(path);
    assert_non_null(file);
    ImfRgba *pixels = calloc((size_t)image->width * (size_t)image->height, sizeof *pixels);
    assert_true(ImfInputSetFrameBuffer(file, pixels, 1, (size_t)image->width));
    assert_true(ImfInputReadPixels(file, 0, image->height - 1));
    assert_true(ImfCloseInputFile(file));
    for (int32_t i = 0; i < image->width * image->height; i++) {
        const ImfHalf rgba[4] = {pixels[i].r, pixels[i].g, pixels[i].b, pixels[i].a};
        for (int32_t c = 0; c < 4; c++) {
            ImfHalf expected;
            ImfFloatToHalf(knurl_image_value(image, i % image->width, i / image->width, c), &expected);
            assert_int_equal(rgba[c], expected);
        }
    }
    free(pixels);
}

static void test_layers(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    knurl_image *beauty = test_pattern(context, 33, 40, 4, KNURL_PIXEL_F32, 1);
    knurl_image *normal = test_pattern(context, 33, 40, 3, KNURL_PIXEL_F32, 2);
    knurl_image *depth = test_pattern(context, 33, 40, 1, KNURL_PIXEL_F32, 3);
    knurl_image *uv = test_pattern(context, 33, 40, 2, KNURL_PIXEL_F32, 4);
    const knurl_image_layer layers[] = {
        {"shading_normal", normal}, {"uv", uv}, {"", beauty}, {"depth", depth}, {"albedo", normal}};
    knurl_error error = {KNURL_OK, ""};
    if (knurl_image_save_layers(context, layers, 5, test_path("layers.exr"), &error) != KNURL_OK)
        fail_msg("%s", error.message);
    knurl_image *back = test_load(context, test_path("layers.exr"));
    test_expect_same(back, beauty);
    knurl_image_release(back);
    expect_same_by_imf(test_path("layers.exr"), beauty);
    /* The names are in the file, in the order that the format asks for. */
    unsigned char *bytes;
    size_t size, at = 0;
    assert_int_equal(knurl_file_read(context, test_path("layers.exr"), &bytes, &size, NULL), KNURL_OK);
    static const char *const names[] = {"A",
                                        "B",
                                        "G",
                                        "R",
                                        "albedo.B",
                                        "albedo.G",
                                        "albedo.R",
                                        "depth",
                                        "shading_normal.X",
                                        "shading_normal.Y",
                                        "shading_normal.Z",
                                        "uv.U",
                                        "uv.V"};
    while (at + 7 < size && memcmp(bytes + at, "chlist", 7) != 0) at++;
    at += 7 + 4;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        assert_true(at + 64 < size);
        assert_string_equal((const char *)bytes + at, names[i]);
        at += strlen(names[i]) + 1;
        assert_int_equal(bytes[at], 2); /* float */
        at += 16;
    }
    assert_int_equal(bytes[at], 0);
    knurl_free(context, bytes);
    /* Without a beauty layer, the first known one. */
    if (knurl_image_save_layers(context, layers, 1, test_path("layer.exr"), &error) != KNURL_OK)
        fail_msg("%s", error.message);
    back = test_load(context, test_path("layer.exr"));
    test_expect_same(back, normal);
    knurl_image_release(back);
    const knurl_image_layer twice[] = {{"depth", depth}, {"depth", depth}};
    assert_int_equal(knurl_image_save_layers(context, twice, 2, test_path("twice.exr"), &error),
                     KNURL_ERROR_ARGUMENT);
    struct stat info;
    assert_int_not_equal(stat(test_path("twice.exr"), &info), 0);
    knurl_image_release(beauty);
    knurl_image_release(normal);
    knurl_image_release(depth);
    knurl_image_release(uv);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

enum { EXR_WIDTH = 75, EXR_HEIGHT = 70 };

/* A smooth picture in halves, by OpenEXR's C++ side; `tile` 0 for scan lines. */
static void write_half_exr(const char *path, int compression, int channels, int tile, ImfRgba *pixels)
{
    for (int y = 0; y < EXR_HEIGHT; y++)
        for (int x = 0; x < EXR_WIDTH; x++) {
            ImfRgba *p = &pixels[y * EXR_WIDTH + x];
            ImfFloatToHalf(0.5f + 0.4f * sinf((float)x * 0.1f), &p->r);
            ImfFloatToHalf((float)y / 8.0f, &p->g);
            ImfFloatToHalf(-3.0f, &p->b);
            ImfFloatToHalf(x > y ? 1.0f : 0.0f, &p->a);
        }
    ImfHeader *header = ImfNewHeader();
    ImfHeaderSetDataWindow(header, -5, 10, -5 + EXR_WIDTH - 1, 10 + EXR_HEIGHT - 1);
    ImfHeaderSetDisplayWindow(header, 0, 0, 99, 99);
    ImfHeaderSetCompression(header, compression);
    /* The library adds absolute coordinates: the base lies before the array. */
    const ImfRgba *base =
        (const ImfRgba *)((uintptr_t)pixels - (uintptr_t)(10 * EXR_WIDTH - 5) * sizeof(ImfRgba));
    if (tile) {
        ImfTiledOutputFile *file =
            ImfOpenTiledOutputFile(path, header, channels, tile, tile / 2, IMF_MIPMAP_LEVELS, IMF_ROUND_DOWN);
        assert_non_null(file);
        assert_true(ImfTiledOutputSetFrameBuffer(file, base, 1, EXR_WIDTH));
        int across = (EXR_WIDTH + tile - 1) / tile, down = (EXR_HEIGHT + tile / 2 - 1) / (tile / 2);
        assert_true(ImfTiledOutputWriteTiles(file, 0, across - 1, 0, down - 1, 0, 0));
        assert_true(ImfCloseTiledOutputFile(file));
    } else {
        ImfOutputFile *file = ImfOpenOutputFile(path, header, channels);
        assert_non_null(file);
        assert_true(ImfOutputSetFrameBuffer(file, base, 1, EXR_WIDTH));
        assert_true(ImfOutputWritePixels(file, EXR_HEIGHT));
        assert_true(ImfCloseOutputFile(file));
    }
    ImfDeleteHeader(header);
}

static void expect_half_exr(knurl_context *context, int compression, int channels, int tile, double tolerance)
{
    static ImfRgba pixels[EXR_WIDTH * EXR_HEIGHT];
    write_half_exr(test_path("half.exr"), compression, channels, tile, pixels);
    knurl_image *image = test_load(context, test_path("half.exr"));
    int32_t count = channels == IMF_WRITE_RGBA ? 4 : 3;
    test_expect_shape(image, EXR_WIDTH, EXR_HEIGHT, count, KNURL_PIXEL_F32);
    double worst = 0;
    for (int y = 0; y < EXR_HEIGHT; y++)
        for (int x = 0; x < EXR_WIDTH; x++) {
            const ImfRgba *p = &pixels[y * EXR_WIDTH + x];
            const ImfHalf rgba[4] = {p->r, p->g, p->b, p->a};
            for (int32_t c = 0; c < count; c++)
                worst = fmax(
                    worst, fabs((double)knurl_image_value(image, x, y, c) - (double)ImfHalfToFloat(rgba[c])));
        }
    if (worst > tolerance)
        fail_msg("compression %d: error %g, expected at most %g", compression, worst, tolerance);
    knurl_image_release(image);
}

static void test_exr_halves(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    static const struct {
        int compression;
        double tolerance;
    } kinds[] = {{IMF_NO_COMPRESSION, 0},   {IMF_RLE_COMPRESSION, 0},   {IMF_ZIPS_COMPRESSION, 0},
                 {IMF_ZIP_COMPRESSION, 0},  {IMF_PIZ_COMPRESSION, 0},   {IMF_PXR24_COMPRESSION, 0},
                 {IMF_B44_COMPRESSION, .1}, {IMF_B44A_COMPRESSION, .1}, {IMF_DWAA_COMPRESSION, .1},
                 {IMF_DWAB_COMPRESSION, .1}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        expect_half_exr(context, kinds[i].compression, IMF_WRITE_RGBA, 0, kinds[i].tolerance);
        expect_half_exr(context, kinds[i].compression, IMF_WRITE_RGB, 0, kinds[i].tolerance);
    }
    expect_half_exr(context, IMF_ZIP_COMPRESSION, IMF_WRITE_RGBA, 32, 0);
    expect_half_exr(context, IMF_PIZ_COMPRESSION, IMF_WRITE_RGB, 16, 0);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void test_half_to_float(void **state)
{
    (void)state;
    for (uint32_t half = 0; half < 65536; half++) {
        float expected = ImfHalfToFloat((ImfHalf)half), got = image_half_to_float((uint16_t)half);
        if (isnan(expected))
            assert_true(isnan(got));
        else
            assert_memory_equal(&got, &expected, sizeof got);
    }
}

static void test_real_assets(void **state)
{
    (void)state;
    static const struct {
        const char *path;
        int32_t channels; /* 0: any */
        knurl_pixel_format format;
    } assets[] = {{"rock-surface/surface_rock_disp_gray16.png", 1, KNURL_PIXEL_U16},
                  {"rock-surface/surface_rock_clr.png", 0, KNURL_PIXEL_U8},
                  {"rocks/rock_displacement.jpg", 0, KNURL_PIXEL_U8},
                  {"rocks/rock_albedo.jpg", 3, KNURL_PIXEL_U8},
                  {"bricks/Bricks102_Displacement.jpg", 0, KNURL_PIXEL_U8},
                  {"spot/spot_texture.png", 0, KNURL_PIXEL_U8}};
    knurl_context *context = test_context(0, 0);
    size_t found = 0;
    for (size_t i = 0; i < sizeof assets / sizeof *assets; i++) {
        char path[256];
        (void)snprintf(path, sizeof path, "/work/shared/assets/%s", assets[i].path);
        struct stat info;
        if (stat(path, &info) != 0) continue;
        found++;
        knurl_image *image = test_load(context, path);
        assert_true(image->width >= 64 && image->height >= 64 && image->format == assets[i].format);
        if (assets[i].channels) assert_int_equal(image->channels, assets[i].channels);
        float least = 1, most = 0;
        for (int32_t y = 0; y < image->height; y += 3)
            for (int32_t x = 0; x < image->width; x += 3) {
                float value = knurl_image_value(image, x, y, 0);
                least = fminf(least, value);
                most = fmaxf(most, value);
            }
        assert_true(most - least > 0.1f);
        knurl_image_release(image);
    }
    knurl_context_release(context);
    if (found == 0) skip();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exact_formats), cmocka_unit_test(test_special_floats),
        cmocka_unit_test(test_jpeg),          cmocka_unit_test(test_hdr),
        cmocka_unit_test(test_hdr_runs),      cmocka_unit_test(test_pnm_variants),
        cmocka_unit_test(test_pfm_variants),  cmocka_unit_test(test_png_variants),
        cmocka_unit_test(test_conversions),   cmocka_unit_test(test_layers),
        cmocka_unit_test(test_exr_halves),    cmocka_unit_test(test_half_to_float),
        cmocka_unit_test(test_real_assets),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
