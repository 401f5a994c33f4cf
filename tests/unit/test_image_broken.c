/* Broken images: errors that say what is wrong, no crash, nothing printed, nothing left behind. */
#include "test_image_common.h"

#include <ImfCRgbaFile.h>
#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MEMORY = 64 << 20, PIXELS = 1 << 20 };

/* Libraries must not print: standard error goes to a file meanwhile. */
typedef struct silence {
    int saved;
    char path[1024];
} silence;

static silence silence_begin(void)
{
    silence s;
    (void)snprintf(s.path, sizeof s.path, "%s/image_stderr_%d", KNURL_TEST_DIR, (int)getpid());
    fflush(stderr);
    s.saved = dup(2);
    int file = open(s.path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    assert_true(s.saved >= 0 && file >= 0);
    dup2(file, 2);
    close(file);
    return s;
}

static void silence_end(const silence *s)
{
    struct stat info;
    fflush(stderr);
    dup2(s->saved, 2);
    close(s->saved);
    assert_int_equal(stat(s->path, &info), 0);
    unlink(s->path);
    assert_int_equal(info.st_size, 0);
}

static void write_dwa(const char *path)
{
    ImfRgba pixels[40 * 40];
    for (size_t i = 0; i < 40 * 40; i++) {
        ImfFloatToHalf((float)i, &pixels[i].r);
        pixels[i].g = pixels[i].b = pixels[i].a = pixels[i].r;
    }
    ImfHeader *header = ImfNewHeader();
    ImfHeaderSetDataWindow(header, 0, 0, 39, 39);
    ImfHeaderSetDisplayWindow(header, 0, 0, 39, 39);
    ImfHeaderSetCompression(header, IMF_DWAA_COMPRESSION);
    ImfOutputFile *file = ImfOpenOutputFile(path, header, IMF_WRITE_RGBA);
    assert_non_null(file);
    assert_true(ImfOutputSetFrameBuffer(file, pixels, 1, 40) && ImfOutputWritePixels(file, 40));
    assert_true(ImfCloseOutputFile(file));
    ImfDeleteHeader(header);
}

typedef struct sample_kind {
    const char *name;
    knurl_pixel_format format;
    int32_t channels;
} sample_kind;

static const sample_kind kinds[] = {
    {"k.png", KNURL_PIXEL_U8, 3},    {"l.png", KNURL_PIXEL_U16, 1}, {"k.jpg", KNURL_PIXEL_U8, 3},
    {"l.jpg", KNURL_PIXEL_U8, 1},    {"k.tif", KNURL_PIXEL_U8, 4},  {"l.tif", KNURL_PIXEL_U16, 1},
    {"m.tif", KNURL_PIXEL_F32, 2},   {"k.exr", KNURL_PIXEL_F32, 3}, {"k.hdr", KNURL_PIXEL_F32, 3},
    {"k.pgm", KNURL_PIXEL_U16, 1},   {"k.ppm", KNURL_PIXEL_U8, 3},  {"k.pfm", KNURL_PIXEL_F32, 3},
    {"dwa.exr", KNURL_PIXEL_F32, 0},
};
enum { KINDS = sizeof kinds / sizeof *kinds };

static unsigned char *make_file(knurl_context *context, const sample_kind *kind, size_t *size)
{
    unsigned char *bytes;
    if (kind->channels == 0) {
        write_dwa(test_path(kind->name));
    } else {
        knurl_image *image = test_pattern(context, 29, 23, kind->channels, kind->format, 5);
        test_save(context, image, test_path(kind->name));
        knurl_image_release(image);
    }
    assert_int_equal(knurl_file_read(context, test_path(kind->name), &bytes, size, NULL), KNURL_OK);
    return bytes;
}

static void test_empty_and_unknown(void **state)
{
    (void)state;
    knurl_context *context = test_context(MEMORY, PIXELS);
    test_expect_failure(context, "", 0, KNURL_ERROR_INPUT, "empty");
    test_expect_failure(context, NULL, 0, KNURL_ERROR_INPUT, "empty");
    test_expect_failure(context, "GIF89a..", 8, KNURL_ERROR_INPUT, "starts with 47 49 46 38");
    test_expect_failure(context, "\x89", 1, KNURL_ERROR_INPUT, "starts with 89");
    knurl_image *image;
    knurl_error error;
    assert_int_equal(knurl_image_load(context, "/nonexistent.png", &image, &error), KNURL_ERROR_INPUT);
    assert_non_null(strstr(error.message, "/nonexistent.png"));
    assert_int_equal(knurl_image_load(context, KNURL_TEST_DIR, &image, &error), KNURL_ERROR_INPUT);
    assert_int_equal(knurl_image_load(context, NULL, &image, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_image_decode(NULL, "", 0, "x", &image, &error), KNURL_ERROR_ARGUMENT);
    assert_int_equal(knurl_image_decode(context, NULL, 5, "x", &image, &error), KNURL_ERROR_ARGUMENT);
    knurl_context_release(context);
}

/* Whether the first `length` bytes fail as they should. An image is right only where nothing of it
 * was cut off: TIFF ends with the four bytes of a link to a next image. */
static bool cut_is_handled(knurl_context *context, const unsigned char *bytes, size_t length, size_t size,
                           const knurl_image *whole)
{
    unsigned char *copy = malloc(length); /* of its own, so that sanitizers see the end */
    memcpy(copy, bytes, length);
    uint64_t before = knurl_context_bytes(context);
    knurl_image *image = NULL;
    knurl_error error = {KNURL_OK, ""};
    knurl_status status = knurl_image_decode(context, copy, length, "cut", &image, &error);
    bool good = !image && strncmp(error.message, "cut: ", 5) == 0 && error.status == status;
    if (status == KNURL_OK)
        good = image && size - length <= 4 && (bytes[0] == 'I' || bytes[0] == 'M') &&
               memcmp(image->samples, whole->samples, image_row_bytes(whole) * (size_t)whole->height) == 0;
    knurl_image_release(image);
    free(copy);
    return good && knurl_context_bytes(context) == before;
}

static void test_truncated(void **state)
{
    (void)state;
    knurl_context *context = test_context(MEMORY, PIXELS);
    for (size_t k = 0; k < KINDS; k++) {
        size_t size;
        unsigned char *bytes = make_file(context, &kinds[k], &size);
        knurl_image *whole = test_load(context, test_path(kinds[k].name));
        silence quiet = silence_begin();
        size_t wrong = 0;
        /* All lengths near both ends, a few hundred between. */
        for (size_t length = 1; length < size; length += length < 400 || size - length < 60 ? 1 : 37)
            if (!cut_is_handled(context, bytes, length, size, whole)) wrong = length;
        silence_end(&quiet);
        if (wrong) fail_msg("%s: wrong outcome when cut to %zu of %zu bytes", kinds[k].name, wrong, size);
        knurl_image_release(whole);
        knurl_free(context, bytes);
    }
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

/* Any outcome is fine but a crash, a leak, a print, or an image outside the limits. */
static void decode_anything(knurl_context *context, const unsigned char *bytes, size_t size)
{
    knurl_image *image = NULL;
    uint64_t before = knurl_context_bytes(context), sum = 0;
    if (knurl_image_decode(context, bytes, size, "noise", &image, NULL) == KNURL_OK) {
        size_t length = image_row_bytes(image) * (size_t)image->height;
        for (size_t i = 0; i < length; i++) sum += image->samples[i]; /* reads all of it */
        assert_true((int64_t)image->width * image->height <= PIXELS && sum <= length * 255);
    } else {
        assert_null(image);
    }
    knurl_image_release(image);
    assert_int_equal(knurl_context_bytes(context), before);
}

static void test_flipped(void **state)
{
    (void)state;
    knurl_context *context = test_context(MEMORY, PIXELS);
    uint32_t random = 12345;
    silence quiet = silence_begin();
    for (size_t k = 0; k < KINDS; k++) {
        size_t size;
        unsigned char *bytes = make_file(context, &kinds[k], &size);
        unsigned char *copy = malloc(size);
        for (int round = 0; round < 250; round++) {
            memcpy(copy, bytes, size);
            uint32_t flips = 1 + test_random(&random) % 6;
            /* Half of the rounds hit the header, where the structure is. */
            size_t reach = round % 2 && size > 300 ? 300 : size;
            for (uint32_t i = 0; i < flips; i++)
                copy[test_random(&random) % reach] = (unsigned char)(test_random(&random) >> 8);
            decode_anything(context, copy, size);
        }
        free(copy);
        knurl_free(context, bytes);
    }
    silence_end(&quiet);
    knurl_context_release(context);
}

static void test_huge_sizes(void **state)
{
    (void)state;
    knurl_context *context = test_context(MEMORY, PIXELS);
    silence quiet = silence_begin();
    const char *const texts[] = {"P5 65536 65536 255\n",
                                 "P6 999999999 999999999 65535\n",
                                 "P2 4294967296 1 255 0",
                                 "Pf 65536 65536 -1.0\n",
                                 "PF 99999999999999999999 1 1\n",
                                 "#?RADIANCE\n\n-Y 65536 +X 65536\nxxxx",
                                 "#?RADIANCE\n\n-Y 999999999 +X 999999999\n",
                                 "P5 0 5 255\n",
                                 "#?RADIANCE\n\n-Y -5 +X 5\nxxxxxxxxxxxx"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        knurl_image *image = NULL;
        knurl_error error = {KNURL_OK, ""};
        knurl_status status = knurl_image_decode(context, texts[i], strlen(texts[i]), "huge", &image, &error);
        assert_true((status == KNURL_ERROR_INPUT || status == KNURL_ERROR_LIMIT) && !image);
        assert_int_equal(strncmp(error.message, "huge: ", 6), 0);
    }
    silence_end(&quiet);
    /* Well-formed files that are over the context's limits. */
    knurl_context *tight = test_context(0, 29 * 23 - 1);
    for (size_t k = 0; k < KINDS; k++) {
        size_t size;
        unsigned char *bytes = make_file(context, &kinds[k], &size);
        test_expect_failure(tight, bytes, size, KNURL_ERROR_LIMIT, "the limit is 666");
        assert_true(knurl_context_peak_bytes(tight) < 1 << 20);
        knurl_free(context, bytes);
    }
    knurl_context_release(tight);
    knurl_context_release(context);
}

static void test_messages(void **state)
{
    (void)state;
    knurl_context *context = test_context(MEMORY, PIXELS);
    const char *const bad[][2] = {
        {"P5 2 2 0\n", "largest value is 0"},
        {"P5 2 2 70000\n", "expected the largest value"},
        {"P5 2 x 255\n", "expected the height"},
        {"P5 2 2 100\n\x01\x02\x03\xff", "sample 3 is 255"},
        {"P2 2 2 10 1 2 3 11", "a number up to 10"},
        {"P2 2 2 10 1 2 3 -1", "expected a sample"},
        {"P5 2 2 255\nabc", "3 bytes of samples, expected 4"},
        {"Pf 1 1 0.0\nabcd", "scale is not a number"},
        {"Pf 1 1 nan\nabcd", "scale is not a number"},
        {"Pf 1 1 -1.0\nabc", "3 bytes of samples, expected 4"},
        {"Pfx", "expected white space"},
        {"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "in the header"},
        {"#?RADIANCE\n\n-Y two +X 2\nxxxx", "size line"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        test_expect_failure(context, bad[i][0], strlen(bad[i][0]), KNURL_ERROR_INPUT, bad[i][1]);
    const char xyze[] = "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nxxxx";
    test_expect_failure(context, xyze, sizeof xyze - 1, KNURL_ERROR_UNSUPPORTED, "32-bit_rle_xyze");
    const char run[] = "#?RADIANCE\n\n-Y 1 +X 2\n\x80\x80\x80\x80\x01\x01\x01\x09";
    test_expect_failure(context, run, sizeof run - 1, KNURL_ERROR_INPUT, "run past the end");
    knurl_context_release(context);
}

/* Fails once `left` allocations were made. */
static void *failing_reallocate(void *user, void *p, size_t old_size, size_t new_size, size_t alignment)
{
    int *left = user;
    if (new_size == 0) {
        free(p);
        return NULL;
    }
    if ((*left)-- <= 0) return NULL;
    void *grown = NULL;
    if (posix_memalign(&grown, alignment, new_size) != 0) return NULL;
    if (p) memcpy(grown, p, old_size < new_size ? old_size : new_size);
    free(p);
    return grown;
}

/* Every allocation fails once: the call says so, and gives all memory back. */
static void test_out_of_memory(void **state)
{
    (void)state;
    knurl_context *healthy = test_context(0, 0), *context;
    int left = 1;
    knurl_context_def def = knurl_context_def_default();
    def.reallocate = failing_reallocate;
    def.allocator_user = &left;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    silence quiet = silence_begin();
    for (size_t k = 0; k < KINDS; k++) {
        size_t size;
        unsigned char *bytes = make_file(healthy, &kinds[k], &size);
        knurl_status status = KNURL_ERROR_MEMORY;
        int tries = 0;
        for (; tries < 100 && status != KNURL_OK; tries++) {
            left = tries;
            knurl_image *image = NULL;
            knurl_error error = {KNURL_OK, ""};
            status = knurl_image_decode(context, bytes, size, "starved", &image, &error);
            if (status != KNURL_OK)
                assert_true(status == KNURL_ERROR_MEMORY && error.status == status && !image);
            else if (kinds[k].channels)
                status = knurl_image_save(context, image, test_path(kinds[k].name), &error);
            if (status != KNURL_OK) assert_int_equal(status, KNURL_ERROR_MEMORY);
            knurl_image_release(image);
            assert_int_equal(knurl_context_bytes(context), 0);
        }
        assert_int_equal(status, KNURL_OK);
        assert_true(tries > 1);
        knurl_free(healthy, bytes);
    }
    silence_end(&quiet);
    knurl_context_release(context);
    knurl_context_release(healthy);
}

/* Inputs that once crashed. */
static void test_crashers(void **state)
{
    (void)state;
    DIR *folder = opendir(KNURL_SOURCE_DIR "/tests/crashers/image");
    if (!folder) skip();
    knurl_context *context = test_context(MEMORY, PIXELS);
    for (const struct dirent *entry; (entry = readdir(folder));) {
        char path[1024];
        unsigned char *bytes;
        size_t size;
        (void)snprintf(path, sizeof path, "%s/tests/crashers/image/%s", KNURL_SOURCE_DIR, entry->d_name);
        if (knurl_file_read(context, path, &bytes, &size, NULL) != KNURL_OK) continue;
        decode_anything(context, bytes, size);
        knurl_free(context, bytes);
    }
    closedir(folder);
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_empty_and_unknown), cmocka_unit_test(test_truncated),
        cmocka_unit_test(test_flipped),           cmocka_unit_test(test_huge_sizes),
        cmocka_unit_test(test_messages),          cmocka_unit_test(test_out_of_memory),
        cmocka_unit_test(test_crashers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
