/* Height maps: levels of detail, values, creation errors, thread counts. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "bounds/blocks.h"
#include "bounds/heightmap.h"
#include "bounds/minmax.h"
#include "bounds/rmip.h"
#include "data/levels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const int32_t SIZES[][2] = {{1, 1}, {1, 7}, {5, 3}, {16, 16}, {33, 65}, {127, 64}, {200, 130}};
enum { SIZE_COUNT = sizeof SIZES / sizeof SIZES[0] };
static const knurl_pixel_format FORMATS[] = {KNURL_PIXEL_U8, KNURL_PIXEL_U16, KNURL_PIXEL_F32};

static uint32_t next_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(*state >> 32);
}

static knurl_context *make_context(int32_t threads, uint32_t cpu_mask, uint64_t memory_limit)
{
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    def.cpu_mask = cpu_mask;
    def.memory_limit = memory_limit;
    knurl_context *context = NULL;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

static knurl_image *make_image(knurl_context *context, int32_t width, int32_t height, int32_t channels,
                               knurl_pixel_format format, uint64_t seed)
{
    size_t count = (size_t)width * (size_t)height * (size_t)channels;
    unsigned char *samples = malloc(count * (size_t)format);
    assert_non_null(samples);
    for (size_t i = 0; i < count; i++) {
        uint32_t r = next_random(&seed);
        if (format == KNURL_PIXEL_U8)
            samples[i] = (unsigned char)(r >> 24);
        else if (format == KNURL_PIXEL_U16)
            ((uint16_t *)(void *)samples)[i] = (uint16_t)(r >> 16);
        else
            ((float *)(void *)samples)[i] = 3e-3f * ((float)(r >> 8) - 5e6f);
    }
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(context, width, height, channels, format, samples, &image, NULL),
                     KNURL_OK);
    free(samples);
    return image;
}

static knurl_heightmap *make_map(knurl_context *context, const knurl_image *image, int32_t rmip_cell,
                                 int32_t minmax_cell)
{
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    def.rmip_cell = rmip_cell;
    def.minmax_cell = minmax_cell;
    knurl_heightmap *map = NULL;
    knurl_error error = {0};
    knurl_status status = knurl_heightmap_create(context, &def, &map, &error);
    if (status == KNURL_OK) status = heightmap_need(map, HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS, &error);
    if (status != KNURL_OK) fail_msg("%s", error.message);
    return map;
}

/* Length of the overlap of [i, i + 1] with [a, b]. */
static double overlap(int32_t i, double a, double b)
{
    double low = fmax(a, i), high = fmin(b, i + 1.0);
    return high > low ? high - low : 0.0;
}

/* The definition, by areas, in the most direct way. */
static double box_mean(const knurl_heightmap *map, int32_t level, int32_t x, int32_t y)
{
    int32_t n = knurl_heightmap_width(map, level), m = knurl_heightmap_height(map, level);
    double ratio_x = (double)n / knurl_heightmap_width(map, level + 1);
    double ratio_y = (double)m / knurl_heightmap_height(map, level + 1);
    double sum = 0.0, area = 0.0;
    for (int32_t j = 0; j < m; j++) {
        double h = overlap(j, y * ratio_y, (y + 1) * ratio_y);
        if (!(h > 0.0)) continue;
        for (int32_t i = 0; i < n; i++) {
            double weight = h * overlap(i, x * ratio_x, (x + 1) * ratio_x);
            if (!(weight > 0.0)) continue;
            sum += weight * knurl_heightmap_sample(map, level, i, j);
            area += weight;
        }
    }
    assert_true(fabs(area - ratio_x * ratio_y) < 1e-9 * area);
    return sum / area;
}

static void check_level(const knurl_heightmap *map, knurl_pixel_format format, int32_t level)
{
    knurl_range range = knurl_heightmap_range(map);
    for (int32_t y = 0; y < knurl_heightmap_height(map, level + 1); y++) {
        for (int32_t x = 0; x < knurl_heightmap_width(map, level + 1); x++) {
            double expected = box_mean(map, level, x, y),
                   found = knurl_heightmap_sample(map, level + 1, x, y);
            double tolerance =
                format == KNURL_PIXEL_F32 ? 6.1e-8 * fabs(expected) + 1e-8 : 0.5000001 / 65535.0;
            if (!(fabs(found - expected) <= tolerance))
                fail_msg("level %d (%d, %d): %.12g, expected %.12g", level + 1, x, y, found, expected);
            assert_true(found >= range.min && found <= range.max);
        }
    }
}

static void test_levels(void **state)
{
    (void)state;
    knurl_context *context = make_context(2, UINT32_MAX, 0);
    for (size_t s = 0; s < SIZE_COUNT; s++) {
        for (size_t f = 0; f < 3; f++) {
            knurl_image *image = make_image(context, SIZES[s][0], SIZES[s][1], 1, FORMATS[f], s + 10);
            knurl_heightmap *map = make_map(context, image, 8, 8);
            int32_t levels = knurl_heightmap_levels(map), w = SIZES[s][0], h = SIZES[s][1];
            for (int32_t k = 0; k < levels; k++) {
                assert_int_equal(knurl_heightmap_width(map, k), w);
                assert_int_equal(knurl_heightmap_height(map, k), h);
                if (k + 1 < levels) check_level(map, FORMATS[f], k);
                w = w > 1 ? w / 2 : 1;
                h = h > 1 ? h / 2 : 1;
            }
            assert_int_equal(knurl_heightmap_width(map, levels - 1), 1);
            assert_int_equal(knurl_heightmap_height(map, levels - 1), 1);
            assert_int_equal(knurl_heightmap_width(map, levels), 0);
            assert_int_equal(knurl_heightmap_height(map, -1), 0);
            knurl_heightmap_release(map);
            knurl_image_release(image);
        }
    }
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void test_rounding_of_levels(void **state)
{
    (void)state;
    knurl_context *context = make_context(1, UINT32_MAX, 0);
    /* 1, 2 over 2, 5: mean 2.5, half up. 257 times larger from 8 bits: 642.5. */
    const uint16_t wide[] = {1, 2, 2, 5};
    const uint8_t narrow[] = {1, 2, 2, 5};
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(context, 2, 2, 1, KNURL_PIXEL_U16, wide, &image, NULL), KNURL_OK);
    knurl_heightmap *map = make_map(context, image, 8, 8);
    assert_true(knurl_heightmap_sample(map, 1, 0, 0) == 3.0 / 65535.0);
    knurl_heightmap_release(map);
    knurl_image_release(image);
    assert_int_equal(knurl_image_create(context, 2, 2, 1, KNURL_PIXEL_U8, narrow, &image, NULL), KNURL_OK);
    map = make_map(context, image, 8, 8);
    assert_true(knurl_heightmap_sample(map, 1, 0, 0) == 643.0 / 65535.0);
    knurl_heightmap_release(map);
    knurl_image_release(image);
    knurl_context_release(context);
}

static void test_max_level_and_channel(void **state)
{
    (void)state;
    knurl_context *context = make_context(1, UINT32_MAX, 0);
    for (size_t f = 0; f < 3; f++) {
        knurl_image *image = make_image(context, 13, 6, 3, FORMATS[f], 3);
        knurl_heightmap_def def = knurl_heightmap_def_default();
        def.image = image;
        def.channel = 2;
        for (int32_t max_level = 0; max_level < 6; max_level++) {
            def.max_level = max_level;
            knurl_heightmap *map = NULL;
            assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
            assert_int_equal(knurl_heightmap_levels(map), max_level < 3 ? max_level + 1 : 4);
            for (int32_t y = 0; y < 6; y++)
                for (int32_t x = 0; x < 13; x++)
                    assert_true((float)knurl_heightmap_sample(map, 0, x, y) ==
                                knurl_image_value(image, x, y, 2));
            knurl_heightmap_release(map);
        }
        knurl_image_release(image);
    }
    knurl_context_release(context);
}

/* Written with real modulo on the coordinate of the sample, unlike height_wrap. */
static double sample_at(const knurl_heightmap *map, int32_t level, double x, double y, knurl_wrap wrap_u,
                        knurl_wrap wrap_v)
{
    double size[2] = {knurl_heightmap_width(map, level), knurl_heightmap_height(map, level)};
    double at[2] = {x, y};
    knurl_wrap wrap[2] = {wrap_u, wrap_v};
    for (int32_t i = 0; i < 2; i++) {
        if (wrap[i] == KNURL_WRAP_CLAMP) {
            at[i] = fmin(fmax(at[i], 0.0), size[i] - 1.0);
        } else if (wrap[i] == KNURL_WRAP_REPEAT) {
            at[i] -= floor(at[i] / size[i]) * size[i];
        } else {
            at[i] -= floor(at[i] / (2.0 * size[i])) * 2.0 * size[i];
            if (at[i] >= size[i]) at[i] = 2.0 * size[i] - 1.0 - at[i];
        }
    }
    return knurl_heightmap_sample(map, level, (int32_t)at[0], (int32_t)at[1]);
}

static double value_at(const knurl_heightmap *map, int32_t level, double u, double v, knurl_wrap wrap_u,
                       knurl_wrap wrap_v)
{
    double x = u * knurl_heightmap_width(map, level) - 0.5, y = v * knurl_heightmap_height(map, level) - 0.5;
    double i = floor(x), j = floor(y), s = x - i, t = y - j;
    return (1 - s) * (1 - t) * sample_at(map, level, i, j, wrap_u, wrap_v) +
           s * (1 - t) * sample_at(map, level, i + 1, j, wrap_u, wrap_v) +
           (1 - s) * t * sample_at(map, level, i, j + 1, wrap_u, wrap_v) +
           s * t * sample_at(map, level, i + 1, j + 1, wrap_u, wrap_v);
}

static void test_value(void **state)
{
    (void)state;
    knurl_context *context = make_context(1, UINT32_MAX, 0);
    uint64_t seed = 99;
    for (size_t s = 0; s < SIZE_COUNT; s++) {
        knurl_image *image = make_image(context, SIZES[s][0], SIZES[s][1], 1, FORMATS[s % 3], s);
        knurl_heightmap *map = make_map(context, image, 8, 8);
        knurl_range range = knurl_heightmap_range(map);
        double scale = fmax(fabs(range.min), fabs(range.max)), last = knurl_heightmap_levels(map) - 1;
        for (int32_t i = 0; i < 3000; i++) {
            knurl_wrap wrap_u = next_random(&seed) % 3, wrap_v = next_random(&seed) % 3;
            double u = next_random(&seed) * 0x1p-30 - 2.0, v = next_random(&seed) * 0x1p-30 - 2.0;
            double lod = next_random(&seed) * 0x1p-32 * (last + 1.0) - 0.5;
            double clamped = fmin(fmax(lod, 0.0), last), k = floor(clamped);
            double expected = value_at(map, (int32_t)k, u, v, wrap_u, wrap_v);
            if (clamped > k) {
                double coarse = value_at(map, (int32_t)k + 1, u, v, wrap_u, wrap_v);
                expected += (clamped - k) * (coarse - expected);
            }
            double found = knurl_heightmap_value(map, u, v, wrap_u, wrap_v, lod);
            assert_true(fabs(found - expected) <= 1e-11 * scale);
        }
        assert_true(isfinite(knurl_heightmap_value(map, NAN, INFINITY, 0, 0, NAN)));
        knurl_heightmap_release(map);
        knurl_image_release(image);
    }
    knurl_context_release(context);
}

static void expect_error(knurl_context *context, const knurl_heightmap_def *def, knurl_status expected,
                         const char *part)
{
    uint64_t before = knurl_context_bytes(context);
    knurl_error error = {0};
    knurl_heightmap *map = (knurl_heightmap *)(uintptr_t)1;
    knurl_status status = knurl_heightmap_create(context, def, &map, &error);
    if (status != expected || !strstr(error.message, part))
        fail_msg("status %d, message \"%s\", expected %d and \"%s\"", (int)status, error.message,
                 (int)expected, part);
    assert_null(map);
    assert_int_equal(knurl_context_bytes(context), before);
}

static void test_definition_errors(void **state)
{
    (void)state;
    knurl_context *context = make_context(2, UINT32_MAX, 0);
    knurl_image *image = make_image(context, 9, 4, 2, KNURL_PIXEL_U8, 1);
    const knurl_heightmap_def zero = {0};
    expect_error(context, &zero, KNURL_ERROR_ARGUMENT, "knurl_heightmap_def_default");
    expect_error(context, NULL, KNURL_ERROR_ARGUMENT, "knurl_heightmap_def_default");
    knurl_heightmap_def def = knurl_heightmap_def_default();
    expect_error(context, &def, KNURL_ERROR_ARGUMENT, "image is NULL");
    def.image = image;
    def.channel = 2;
    expect_error(context, &def, KNURL_ERROR_ARGUMENT, "channel is 2");
    def.channel = -1;
    expect_error(context, &def, KNURL_ERROR_ARGUMENT, "channel is -1");
    def.channel = 0;
    def.max_level = -2;
    expect_error(context, &def, KNURL_ERROR_ARGUMENT, "max_level is -2");
    def.max_level = -1;
    const int32_t bad_cells[] = {0, -8, 3, 12, 64};
    for (size_t i = 0; i < 5; i++) {
        def.rmip_cell = bad_cells[i];
        expect_error(context, &def, KNURL_ERROR_ARGUMENT, "rmip_cell is");
    }
    def.rmip_cell = 8;
    def.minmax_cell = 32;
    expect_error(context, &def, KNURL_ERROR_ARGUMENT, "minmax_cell is 32");
    def.minmax_cell = 8;
    assert_int_equal(knurl_heightmap_create(context, &def, NULL, NULL), KNURL_ERROR_ARGUMENT);
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_heightmap_create(NULL, &def, &map, NULL), KNURL_ERROR_ARGUMENT);
    knurl_heightmap_release(NULL);
    knurl_image_release(image);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void test_texels_must_be_finite(void **state)
{
    (void)state;
    knurl_context *context = make_context(2, UINT32_MAX, 0);
    enum { WIDTH = 300, HEIGHT = 700 };
    float *samples = calloc((size_t)WIDTH * HEIGHT * 2, sizeof *samples);
    assert_non_null(samples);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.channel = 1;
    /* The first in reading order is named, whichever thread meets which first. */
    samples[2 * (650 * WIDTH + 3) + 1] = -INFINITY;
    samples[2 * (600 * WIDTH + 299) + 1] = NAN;
    samples[0] = NAN; /* of the other channel */
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(context, WIDTH, HEIGHT, 2, KNURL_PIXEL_F32, samples, &image, NULL),
                     KNURL_OK);
    def.image = image;
    expect_error(context, &def, KNURL_ERROR_INPUT, "(299, 600)");
    knurl_image_release(image);
    samples[2 * (600 * WIDTH + 299) + 1] = 0.0f;
    assert_int_equal(knurl_image_create(context, WIDTH, HEIGHT, 2, KNURL_PIXEL_F32, samples, &image, NULL),
                     KNURL_OK);
    def.image = image;
    expect_error(context, &def, KNURL_ERROR_INPUT, "(3, 650)");
    knurl_image_release(image);
    free(samples);
    knurl_context_release(context);
}

/* Every allocation fails once: nothing leaks, and the error says so. */
static void test_out_of_memory(void **state)
{
    (void)state;
    knurl_context *plain = make_context(2, UINT32_MAX, 0);
    for (size_t f = 0; f < 3; f++) {
        knurl_image *image = make_image(plain, 70, 41, 1, FORMATS[f], 5);
        knurl_heightmap_def def = knurl_heightmap_def_default();
        def.image = image;
        def.rmip_cell = f == 1 ? 2 : 16;
        uint64_t failures = 0;
        for (uint64_t limit = 1;; limit += 251) {
            knurl_context *context = make_context(2, UINT32_MAX, limit);
            knurl_heightmap *map = NULL;
            knurl_error error = {0};
            knurl_status status = knurl_heightmap_create(context, &def, &map, &error);
            if (status == KNURL_OK) status = heightmap_need(map, HEIGHT_NEED_RMIP, &error);
            if (status == KNURL_OK) status = heightmap_need(map, HEIGHT_NEED_BLOCKS, &error);
            knurl_heightmap_release(map);
            assert_int_equal(knurl_context_bytes(context), 0);
            knurl_context_release(context);
            if (status == KNURL_OK) break;
            assert_true(status == KNURL_ERROR_MEMORY || status == KNURL_ERROR_LIMIT);
            assert_true(error.message[0] != '\0');
            failures++;
        }
        assert_true(failures > 20);
        knurl_image_release(image);
    }
    knurl_context_release(plain);
}

static void assert_same_map(const knurl_heightmap *a, const knurl_heightmap *b)
{
    assert_int_equal(a->level_count, b->level_count);
    for (int32_t k = 0; k < a->level_count; k++)
        assert_memory_equal(a->levels[k].samples, b->levels[k].samples, height_level_bytes(&a->levels[k]));
    assert_true(a->range_min == b->range_min && a->range_max == b->range_max && a->code_step == b->code_step);
    const minmax_pyramid *p = a->minmax, *q = b->minmax;
    int32_t top = p->level_count - 1;
    assert_int_equal(p->level_count, q->level_count);
    assert_memory_equal(p->codes, q->codes, (p->offset[top] + 1) * sizeof *p->codes);
    const rmip_table *r = heightmap_rmip(a), *t = heightmap_rmip(b);
    assert_int_equal(r->bytes, t->bytes);
    for (size_t row = 0; row < r->y.base[r->y.layers]; row++)
        assert_memory_equal(r->codes + row * r->stride, t->codes + row * t->stride,
                            r->x.base[r->x.layers] * sizeof *r->codes);
    const height_blocks *d = heightmap_blocks(a), *e = heightmap_blocks(b);
    assert_int_equal(d->bytes, e->bytes);
    assert_memory_equal(d->tiles, e->tiles, (size_t)d->tile_columns * (size_t)d->tile_rows * 64);
    for (int32_t k = 0; k < d->level_count; k++)
        assert_memory_equal(d->nodes[k], e->nodes[k],
                            (size_t)d->columns[k] * (size_t)d->rows[k] * sizeof *d->nodes[k]);
}

/* Threads and instruction sets change nothing; sizes and cells reach all tails of the kernels. */
static void test_same_on_any_machine(void **state)
{
    (void)state;
    static const int32_t sizes[][2] = {{1, 1}, {7, 9}, {31, 2}, {64, 64}, {131, 77}, {320, 300}, {1029, 515}};
    static const int32_t cells[][2] = {{1, 1}, {2, 4}, {8, 8}, {16, 1}, {32, 16}, {4, 16}};
    knurl_context *reference = make_context(1, 0, 0);
    knurl_context *others[] = {make_context(1, UINT32_MAX, 0), make_context(5, UINT32_MAX, 0),
                               make_context(3, 0, 0)};
    for (size_t s = 0; s < 7; s++) {
        for (size_t c = 0; c < 6; c++) {
            if (s == 6 && c != 2 && c != 5) continue;
            knurl_image *image =
                make_image(reference, sizes[s][0], sizes[s][1], 1, FORMATS[(s + c) % 3], 7 * s + c);
            knurl_heightmap *expected = make_map(reference, image, cells[c][0], cells[c][1]);
            for (size_t i = 0; i < 3; i++) {
                knurl_heightmap *found = make_map(others[i], image, cells[c][0], cells[c][1]);
                assert_same_map(expected, found);
                knurl_heightmap_release(found);
            }
            knurl_heightmap_release(expected);
            knurl_image_release(image);
        }
    }
    for (size_t i = 0; i < 3; i++) knurl_context_release(others[i]);
    knurl_context_release(reference);
}

typedef struct demand {
    knurl_heightmap *map;
    pthread_t thread;
    uint32_t what;
    const void *found[2];
} demand;

static void *ask(void *user)
{
    demand *d = user;
    if (heightmap_need(d->map, d->what, NULL) != KNURL_OK) return NULL;
    d->found[0] = heightmap_rmip(d->map);
    d->found[1] = heightmap_blocks(d->map);
    return d;
}

/* Several threads ask at once while others read: one structure of each kind is made, and is counted. */
static void test_made_on_demand(void **state)
{
    (void)state;
    knurl_context *context = make_context(2, UINT32_MAX, 0);
    knurl_image *image = make_image(context, 300, 201, 1, KNURL_PIXEL_U8, 4);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    assert_null(heightmap_blocks(map));
    assert_int_equal(knurl_heightmap_memory(map).blocks, 0);
    double build_ms = knurl_heightmap_build_ms(map);
    enum { ASKING = 6 };
    demand demands[ASKING];
    for (size_t i = 0; i < ASKING; i++) {
        demands[i] = (demand){.map = map, .what = i % 2 ? HEIGHT_NEED_BLOCKS : HEIGHT_NEED_RMIP};
        assert_int_equal(pthread_create(&demands[i].thread, NULL, ask, &demands[i]), 0);
    }
    for (int32_t i = 0; i < 1000; i++) {
        knurl_range range = heightmap_bounds_texels(map, KNURL_BOUNDS_RMIP, i % 7, 3, 90 + i % 5, 80,
                                                    KNURL_WRAP_REPEAT, KNURL_WRAP_CLAMP);
        assert_true(range.min < range.max);
        assert_true(knurl_heightmap_memory(map).minmax > 0);
    }
    for (size_t i = 0; i < ASKING; i++) {
        void *result = NULL;
        assert_int_equal(pthread_join(demands[i].thread, &result), 0);
        assert_non_null(result);
        assert_ptr_equal(demands[i].found[i % 2],
                         i % 2 ? (const void *)heightmap_blocks(map) : (const void *)heightmap_rmip(map));
    }
    knurl_heightmap_bytes bytes = knurl_heightmap_memory(map);
    assert_int_equal(bytes.rmip, heightmap_rmip(map)->bytes);
    assert_int_equal(bytes.blocks, heightmap_blocks(map)->bytes);
    assert_true(knurl_heightmap_build_ms(map) > build_ms);
    assert_int_equal(knurl_heightmap_format(map), KNURL_PIXEL_U8);
    knurl_heightmap_release(map);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void test_memory_and_owners(void **state)
{
    (void)state;
    knurl_context *context = make_context(2, UINT32_MAX, 0);
    knurl_image *image = make_image(context, 1024, 1024, 1, KNURL_PIXEL_U16, 4);
    knurl_heightmap *map = make_map(context, image, 8, 8);
    knurl_image_release(image); /* the map has its own samples */
    knurl_context *other = knurl_context_retain(context);
    knurl_context_release(context);
    knurl_heightmap_bytes bytes = knurl_heightmap_memory(map);
    uint64_t total = bytes.samples + bytes.levels + bytes.minmax + bytes.rmip;
    assert_int_equal(bytes.samples, 2u << 20);
    assert_true(bytes.rmip > 0 && total <= 2 * bytes.samples);
    /* Tiles repeat the samples, nodes add 1/8 of that and a little. */
    assert_true(bytes.blocks > bytes.samples && bytes.blocks < bytes.samples * 5 / 4);
    total += bytes.blocks;
    assert_true(knurl_context_bytes(other) >= total && knurl_context_bytes(other) <= total + 4096);
    assert_true(knurl_heightmap_build_ms(map) >= 0.0);
    assert_ptr_equal(knurl_heightmap_retain(map), map);
    knurl_heightmap_release(map);
    assert_int_equal(knurl_heightmap_width(map, 0), 1024);
    knurl_heightmap_release(map);
    assert_int_equal(knurl_context_bytes(other), 0);
    knurl_context_release(other);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_levels),
        cmocka_unit_test(test_rounding_of_levels),
        cmocka_unit_test(test_max_level_and_channel),
        cmocka_unit_test(test_value),
        cmocka_unit_test(test_definition_errors),
        cmocka_unit_test(test_texels_must_be_finite),
        cmocka_unit_test(test_out_of_memory),
        cmocka_unit_test(test_same_on_any_machine),
        cmocka_unit_test(test_made_on_demand),
        cmocka_unit_test(test_memory_and_owners),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
