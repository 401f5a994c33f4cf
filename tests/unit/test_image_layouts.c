/* TIFF layouts and OpenEXR channels that knurl reads but does not write, made with their libraries. */
#include "test_image_common.h"

#include <ImfCRgbaFile.h>
#include <math.h>
#include <openexr.h>
#include <tiffio.h>

typedef struct layout {
    uint16_t samples;
    int depth, format, photometric, compression;
    bool planar;
    uint32_t tile; /* 0: strips */
    uint32_t rows; /* per strip */
    const char *mode;
} layout;

enum { WIDTH = 83, HEIGHT = 61 };

static void set_tags(TIFF *tiff, const layout *l)
{
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, WIDTH);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, HEIGHT);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, l->samples);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, l->depth);
    TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, l->format);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, l->photometric);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, l->compression);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, l->planar ? PLANARCONFIG_SEPARATE : PLANARCONFIG_CONTIG);
    if (l->compression == COMPRESSION_JPEG && l->photometric == PHOTOMETRIC_YCBCR)
        TIFFSetField(tiff, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
    if (l->tile) {
        TIFFSetField(tiff, TIFFTAG_TILEWIDTH, l->tile);
        TIFFSetField(tiff, TIFFTAG_TILELENGTH, l->tile);
    } else {
        TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, l->rows);
    }
}

/* Samples of one plane, or of all, of the block at (x, y) that is `columns` wide. */
static void fill_block(const layout *l, const unsigned char *samples, int plane, uint32_t x, uint32_t y,
                       uint32_t columns, uint32_t rows, unsigned char *block)
{
    size_t bytes = (size_t)l->depth / 8, pixel = bytes * l->samples, kept = l->planar ? bytes : pixel;
    for (uint32_t j = 0; j < rows; j++)
        for (uint32_t i = 0; i < columns; i++) {
            if (x + i >= WIDTH || y + j >= HEIGHT) continue;
            const unsigned char *from = samples + ((size_t)(y + j) * WIDTH + x + i) * pixel;
            memcpy(block + ((size_t)j * columns + i) * kept, from + (l->planar ? (size_t)plane * bytes : 0),
                   kept);
        }
}

static void write_layout(const char *path, const layout *l, const unsigned char *samples)
{
    TIFF *tiff = TIFFOpen(path, l->mode);
    assert_non_null(tiff);
    set_tags(tiff, l);
    unsigned char *block = calloc(1, 1 << 20);
    uint32_t columns = l->tile ? l->tile : WIDTH, rows = l->tile ? l->tile : l->rows;
    for (int plane = 0; plane < (l->planar ? l->samples : 1); plane++)
        for (uint32_t y = 0; y < HEIGHT; y += rows)
            for (uint32_t x = 0; x < WIDTH; x += columns) {
                uint32_t have = l->tile || HEIGHT - y >= rows ? rows : HEIGHT - y;
                size_t size = (size_t)columns * have * (size_t)(l->depth / 8) * (l->planar ? 1 : l->samples);
                fill_block(l, samples, plane, x, y, columns, have, block);
                tmsize_t done =
                    l->tile ? TIFFWriteEncodedTile(tiff, TIFFComputeTile(tiff, x, y, 0, (uint16_t)plane),
                                                   block, (tmsize_t)size)
                            : TIFFWriteEncodedStrip(tiff, TIFFComputeStrip(tiff, y, (uint16_t)plane), block,
                                                    (tmsize_t)size);
                assert_true(done == (tmsize_t)size);
            }
    free(block);
    TIFFClose(tiff);
}

/* `samples` per pixel in the file, of which the first four at most come back, within `tolerance`. */
static void check_layout(knurl_context *context, const layout *l, double tolerance)
{
    size_t bytes = (size_t)l->depth / 8, count = (size_t)WIDTH * HEIGHT * l->samples;
    unsigned char *samples = malloc(count * bytes);
    uint32_t state = 77;
    for (size_t i = 0; i < count; i++) {
        float value = (float)(test_random(&state) % 1000) - 500;
        uint16_t word = (uint16_t)test_random(&state);
        if (bytes == 4)
            memcpy(samples + 4 * i, &value, 4);
        else if (bytes == 2)
            memcpy(samples + 2 * i, &word, 2);
        else
            samples[i] = l->compression == COMPRESSION_JPEG ? (unsigned char)(i / 200) : (unsigned char)word;
    }
    write_layout(test_path("layout.tif"), l, samples);
    knurl_image *image = test_load(context, test_path("layout.tif"));
    int32_t kept = l->samples < 4 ? l->samples : 4;
    test_expect_shape(image, WIDTH, HEIGHT, kept, (knurl_pixel_format)bytes);
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT; i++)
        for (int32_t c = 0; c < kept; c++) {
            double expected = (double)image_scaled(image->format, samples, i * l->samples + (size_t)c);
            if (l->photometric == PHOTOMETRIC_MINISWHITE) expected = 1 - expected;
            double got = (double)image_scaled(image->format, image->samples, i * (size_t)kept + (size_t)c);
            if (!(fabs(got - expected) <= tolerance))
                fail_msg("sample %zu, %d of %d x %d bits: got %g, expected %g", i, (int)c, l->samples,
                         l->depth, got, expected);
        }
    knurl_image_release(image);
    free(samples);
}

static void test_layouts(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    enum { UI = SAMPLEFORMAT_UINT, FP = SAMPLEFORMAT_IEEEFP, BLACK = PHOTOMETRIC_MINISBLACK };
    static const layout exact[] = {
        {1, 8, UI, BLACK, COMPRESSION_NONE, false, 0, 61, "w"},
        {1, 16, UI, BLACK, COMPRESSION_LZW, false, 0, 7, "wb"}, /* big endian below */
        {1, 16, UI, BLACK, COMPRESSION_NONE, false, 32, 0, "w"},
        {3, 8, UI, PHOTOMETRIC_RGB, COMPRESSION_PACKBITS, true, 0, 10, "w"},
        {3, 16, UI, PHOTOMETRIC_RGB, COMPRESSION_ADOBE_DEFLATE, true, 16, 0, "w"},
        {4, 32, FP, PHOTOMETRIC_RGB, COMPRESSION_LZW, false, 48, 0, "w8"},
        {2, 32, FP, BLACK, COMPRESSION_DEFLATE, true, 0, 61, "w"},
        {5, 8, UI, PHOTOMETRIC_RGB, COMPRESSION_NONE, false, 0, 9, "w"},
        {6, 16, UI, BLACK, COMPRESSION_LZW, true, 0, 9, "w"},
        {7, 32, FP, BLACK, COMPRESSION_NONE, false, 16, 0, "wb"},
        {1, 8, UI, PHOTOMETRIC_MINISWHITE, COMPRESSION_NONE, false, 0, 9, "w"},
    };
    for (size_t i = 0; i < sizeof exact / sizeof *exact; i++) check_layout(context, &exact[i], 1e-6);
    const layout jpeg[] = {{1, 8, UI, BLACK, COMPRESSION_JPEG, false, 0, 16, "w"},
                           {3, 8, UI, PHOTOMETRIC_YCBCR, COMPRESSION_JPEG, false, 32, 0, "w"}};
    for (size_t i = 0; i < sizeof jpeg / sizeof *jpeg; i++) check_layout(context, &jpeg[i], 0.2);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void test_unsupported_layouts(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    static const layout kinds[] = {
        {1, 32, SAMPLEFORMAT_UINT, PHOTOMETRIC_MINISBLACK, COMPRESSION_NONE, false, 0, 61, "w"},
        {1, 16, SAMPLEFORMAT_INT, PHOTOMETRIC_MINISBLACK, COMPRESSION_NONE, false, 0, 61, "w"},
        {1, 16, SAMPLEFORMAT_IEEEFP, PHOTOMETRIC_MINISBLACK, COMPRESSION_NONE, false, 0, 61, "w"},
        {1, 64, SAMPLEFORMAT_IEEEFP, PHOTOMETRIC_MINISBLACK, COMPRESSION_NONE, false, 0, 61, "w"},
        {4, 8, SAMPLEFORMAT_UINT, PHOTOMETRIC_SEPARATED, COMPRESSION_NONE, false, 0, 61, "w"},
    };
    unsigned char *samples = calloc(WIDTH * HEIGHT, 8);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        write_layout(test_path("layout.tif"), &kinds[i], samples);
        knurl_image *image;
        knurl_error error;
        assert_int_equal(knurl_image_load(context, test_path("layout.tif"), &image, &error),
                         KNURL_ERROR_UNSUPPORTED);
        assert_null(image);
        assert_non_null(strstr(error.message, "layout.tif: TIFF: "));
    }
    free(samples);
    knurl_context_release(context);
}

/* One uncompressed scanline part with the given channels; sample (x, y) of channel c is c * 100 + y * 10 + x.
 */
static void write_exr(const char *path, const char *const *names, int count, exr_pixel_type_t type,
                      int sampling)
{
    enum { W = 4, H = 2 };
    exr_context_t exr;
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    int part;
    assert_int_equal(exr_start_write(&exr, path, EXR_WRITE_FILE_DIRECTLY, &setup), EXR_ERR_SUCCESS);
    assert_int_equal(exr_add_part(exr, "p", EXR_STORAGE_SCANLINE, &part), EXR_ERR_SUCCESS);
    assert_int_equal(exr_initialize_required_attr_simple(exr, part, W, H, EXR_COMPRESSION_NONE),
                     EXR_ERR_SUCCESS);
    for (int c = 0; c < count; c++)
        assert_int_equal(
            exr_add_channel(exr, part, names[c], type, EXR_PERCEPTUALLY_LOGARITHMIC, sampling, sampling),
            EXR_ERR_SUCCESS);
    assert_int_equal(exr_write_header(exr), EXR_ERR_SUCCESS);
    for (int y = 0; y < H; y++) {
        exr_chunk_info_t chunk;
        exr_encode_pipeline_t encode = EXR_ENCODE_PIPELINE_INITIALIZER;
        uint32_t rows[8][W];
        assert_int_equal(exr_write_scanline_chunk_info(exr, part, y, &chunk), EXR_ERR_SUCCESS);
        assert_int_equal(exr_encoding_initialize(exr, part, &chunk, &encode), EXR_ERR_SUCCESS);
        for (int c = 0; c < encode.channel_count; c++) {
            int named = 0;
            while (strcmp(names[named], encode.channels[c].channel_name) != 0) named++;
            for (int x = 0; x < W; x++) {
                float value = (float)(named * 100 + y * 10 + x);
                rows[c][x] = (uint32_t)value;
                if (type == EXR_PIXEL_FLOAT) memcpy(&rows[c][x], &value, 4);
            }
            encode.channels[c].user_bytes_per_element = 4;
            encode.channels[c].user_data_type = (uint16_t)type;
            encode.channels[c].user_pixel_stride = 4;
            encode.channels[c].user_line_stride = 4 * W;
            encode.channels[c].encode_from_ptr = (const uint8_t *)rows[c];
        }
        assert_int_equal(exr_encoding_choose_default_routines(exr, part, &encode), EXR_ERR_SUCCESS);
        assert_int_equal(exr_encoding_run(exr, part, &encode), EXR_ERR_SUCCESS);
        exr_encoding_destroy(exr, &encode);
    }
    assert_int_equal(exr_finish(&exr), EXR_ERR_SUCCESS);
}

/* Expects the image's channels to be those of the file with the given numbers. */
static void expect_channels(knurl_context *context, const char *const *names, int count,
                            exr_pixel_type_t type, const int *expected, int32_t kept)
{
    write_exr(test_path("channels.exr"), names, count, type, 1);
    knurl_image *image = test_load(context, test_path("channels.exr"));
    test_expect_shape(image, 4, 2, kept, KNURL_PIXEL_F32);
    for (int32_t c = 0; c < kept; c++)
        assert_true(knurl_image_value(image, 3, 1, c) == (float)(expected[c] * 100 + 13));
    knurl_image_release(image);
}

static void test_exr_channels(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    const char *const rgba[] = {"R", "G", "B", "A", "Z"};
    const char *const layers[] = {"b.G", "b.B", "b.R", "a.thing", "a.other"};
    const char *const luminance[] = {"A", "Y"};
    const char *const vector[] = {"Z", "Y", "X"};
    const char *const depth[] = {"height"};
    expect_channels(context, rgba, 5, EXR_PIXEL_FLOAT, (const int[]){0, 1, 2, 3}, 4);
    expect_channels(context, rgba, 3, EXR_PIXEL_UINT, (const int[]){0, 1, 2}, 3);
    expect_channels(context, layers, 5, EXR_PIXEL_FLOAT, (const int[]){2, 0, 1}, 3);
    expect_channels(context, luminance, 2, EXR_PIXEL_FLOAT, (const int[]){1, 0}, 2);
    expect_channels(context, vector, 3, EXR_PIXEL_FLOAT, (const int[]){2, 1, 0}, 3);
    expect_channels(context, depth, 1, EXR_PIXEL_UINT, (const int[]){0}, 1);
    knurl_image *image;
    knurl_error error;
    write_exr(test_path("channels.exr"), depth, 1, EXR_PIXEL_FLOAT, 2);
    assert_int_equal(knurl_image_load(context, test_path("channels.exr"), &image, &error),
                     KNURL_ERROR_UNSUPPORTED);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

/* Grey DWA: one channel, near to what was written. */
static void test_exr_grey_dwa(void **state)
{
    (void)state;
    knurl_context *context = test_context(0, 0);
    enum { W = 64, H = 300 };
    static ImfRgba pixels[W * H];
    for (int i = 0; i < W * H; i++) {
        ImfFloatToHalf((float)(i / W) / (float)H, &pixels[i].g);
        pixels[i].r = pixels[i].b = pixels[i].g;
    }
    ImfHeader *header = ImfNewHeader();
    ImfHeaderSetDataWindow(header, 0, 0, W - 1, H - 1);
    ImfHeaderSetDisplayWindow(header, 0, 0, W - 1, H - 1);
    ImfHeaderSetCompression(header, IMF_DWAB_COMPRESSION);
    ImfOutputFile *file = ImfOpenOutputFile(test_path("grey_dwa.exr"), header, IMF_WRITE_Y);
    assert_non_null(file);
    assert_true(ImfOutputSetFrameBuffer(file, pixels, 1, W) && ImfOutputWritePixels(file, H));
    assert_true(ImfCloseOutputFile(file));
    ImfDeleteHeader(header);
    knurl_image *image = test_load(context, test_path("grey_dwa.exr"));
    test_expect_shape(image, W, H, 1, KNURL_PIXEL_F32);
    for (int32_t y = 0; y < H; y++)
        assert_true(fabsf(knurl_image_value(image, 5, y, 0) - (float)y / (float)H) < 0.05f);
    knurl_image_release(image);
    knurl_context_release(context);
}

int main(void)
{
    TIFFSetWarningHandler(NULL); /* of the writing side: the old Deflate code is meant */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_layouts),
        cmocka_unit_test(test_unsupported_layouts),
        cmocka_unit_test(test_exr_channels),
        cmocka_unit_test(test_exr_grey_dwa),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
