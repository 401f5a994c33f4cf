/* Blocks against the definition, sample by sample. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "bounds/blocks.h"
#include "bounds/heightmap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Odd ones, single rows and columns, and sizes around those of tiles, nodes, strips of nodes and levels. */
static const int32_t SIZES[][2] = {{1, 1},   {1, 7},    {9, 1},   {5, 3},    {7, 8},    {16, 16},
                                   {17, 15}, {33, 65},  {64, 63}, {127, 64}, {300, 17}, {512, 33},
                                   {513, 4}, {521, 70}, {8, 300}, {1040, 20}};
enum { SIZE_COUNT = sizeof SIZES / sizeof SIZES[0] };
static const knurl_pixel_format FORMATS[] = {KNURL_PIXEL_U8, KNURL_PIXEL_U16, KNURL_PIXEL_F32};

static uint32_t next_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(*state >> 32);
}

static knurl_context *make_context(int32_t threads, uint32_t cpu_mask)
{
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    def.cpu_mask = cpu_mask;
    knurl_context *context = NULL;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

static knurl_heightmap *map_of(knurl_context *context, int32_t width, int32_t height,
                               knurl_pixel_format format, const void *samples)
{
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(context, width, height, 1, format, samples, &image, NULL), KNURL_OK);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    assert_null(heightmap_blocks(map));
    assert_int_equal(heightmap_need(map, HEIGHT_NEED_BLOCKS, NULL), KNURL_OK);
    return map;
}

static knurl_heightmap *random_map(knurl_context *context, int32_t width, int32_t height,
                                   knurl_pixel_format format, double low, double high, uint64_t seed)
{
    size_t count = (size_t)width * (size_t)height;
    unsigned char *samples = malloc(count * (size_t)format);
    assert_non_null(samples);
    for (size_t i = 0; i < count; i++) {
        uint32_t r = next_random(&seed);
        if (format == KNURL_PIXEL_U8)
            samples[i] = (unsigned char)(r >> 24);
        else if (format == KNURL_PIXEL_U16)
            ((uint16_t *)(void *)samples)[i] = (uint16_t)(r >> 16);
        else
            ((float *)(void *)samples)[i] = (float)(low + (high - low) * (r * 0x1p-32));
    }
    knurl_heightmap *map = map_of(context, width, height, format, samples);
    free(samples);
    return map;
}

static int32_t clamped(int32_t i, int32_t size)
{
    return i < size ? i : size - 1;
}

/* Codes are the samples, everywhere and beyond the borders; floats are within the error that is stated. */
static void check_tiles(const knurl_heightmap *map)
{
    const height_blocks *b = heightmap_blocks(map);
    assert_true((uintptr_t)b->tiles % 64 == 0);
    assert_true(b->tile_columns * BLOCK_TILE_WIDTH > b->width);
    assert_true(b->tile_rows * BLOCK_TILE_HEIGHT > b->height);
    assert_true(b->step > 0.0 && isfinite(1.0 / b->step));
    for (int32_t y = 0; y < b->tile_rows * BLOCK_TILE_HEIGHT; y++) {
        for (int32_t x = 0; x < b->tile_columns * BLOCK_TILE_WIDTH; x++) {
            size_t tile = (size_t)(y / 4) * (size_t)b->tile_columns + (size_t)(x / 8);
            uint32_t code = b->tiles[32 * tile + 8 * (size_t)(y % 4) + (size_t)(x % 8)];
            assert_int_equal(code, height_blocks_code(b, x, y));
            double value = height_fetch(&map->levels[0], clamped(x, b->width), clamped(y, b->height));
            switch (map->levels[0].format) {
            case KNURL_PIXEL_U8:
                assert_int_equal(code, 257 * lround(255.0 * value));
                break;
            case KNURL_PIXEL_U16:
                assert_int_equal(code, lround(65535.0 * value));
                break;
            default:
                assert_true(fabs(value - (b->origin + code * b->step)) <= b->code_error);
            }
        }
    }
}

/* Range of the codes that cells [first, end) hold along both axes, straight from the definition. */
static void true_range(const height_blocks *b, const int32_t first[2], const int32_t end[2], uint32_t *low,
                       uint32_t *high)
{
    *low = 65535;
    *high = 0;
    for (int32_t cy = first[1]; cy < end[1] && cy < b->height; cy++) {
        for (int32_t cx = first[0]; cx < end[0] && cx < b->width; cx++) {
            for (int32_t corner = 0; corner < 4; corner++) {
                int32_t x = cx + corner % 2, y = cy + corner / 2;
                /* The continuation of a repeated axis; that of the others is the cell's own sample. */
                uint32_t code = height_blocks_code(b, x < b->width ? x : 0, y < b->height ? y : 0);
                *low = code < *low ? code : *low;
                *high = code > *high ? code : *high;
            }
        }
    }
}

static void check_nodes(const height_blocks *b)
{
    int32_t size = 4, columns = (b->width + 15) / 16, rows = (b->height + 15) / 16;
    for (int32_t k = 0; k < b->level_count; k++, size *= 4) {
        assert_int_equal(b->columns[k], columns);
        assert_int_equal(b->rows[k], rows);
        assert_true((uintptr_t)b->nodes[k] % 64 == 0);
        for (int32_t y = 0; y < 4 * rows; y++) {
            for (int32_t x = 0; x < 4 * columns; x++) {
                const block_node *node = &b->nodes[k][y / 4 * columns + x / 4];
                int32_t child = 4 * (y % 4) + x % 4;
                uint32_t low, high;
                true_range(b, (const int32_t[2]){x * size, y * size},
                           (const int32_t[2]){(x + 1) * size, (y + 1) * size}, &low, &high);
                if (node->min[child] != low || node->max[child] != high)
                    fail_msg("%d x %d, level %d, child (%d, %d): [%d, %d], expected [%u, %u]", b->width,
                             b->height, k, x, y, node->min[child], node->max[child], low, high);
            }
        }
        columns = (columns + 3) / 4;
        rows = (rows + 3) / 4;
    }
    assert_int_equal(b->columns[b->level_count - 1], 1);
    assert_int_equal(b->rows[b->level_count - 1], 1);
}

static void test_definition(void **state)
{
    (void)state;
    knurl_context *contexts[] = {make_context(1, UINT32_MAX), make_context(3, 0)};
    for (size_t s = 0; s < SIZE_COUNT; s++) {
        for (size_t f = 0; f < 3; f++) {
            knurl_context *context = contexts[(s + f) % 2];
            knurl_heightmap *map =
                random_map(context, SIZES[s][0], SIZES[s][1], FORMATS[f], -20.0, 300.0, 3 * s + f);
            const height_blocks *b = heightmap_blocks(map);
            assert_int_equal(b->width, SIZES[s][0]);
            assert_int_equal(b->height, SIZES[s][1]);
            check_tiles(map);
            check_nodes(b);
            if (FORMATS[f] != KNURL_PIXEL_F32)
                assert_true(b->origin == 0.0 && b->step == 1.0 / 65535.0 && b->code_error == 0.0);
            knurl_heightmap_release(map);
        }
    }
    for (size_t i = 0; i < 2; i++) {
        assert_int_equal(knurl_context_bytes(contexts[i]), 0);
        knurl_context_release(contexts[i]);
    }
}

/* Ranges of all magnitudes, of one ulp, and none. */
static void test_float_scales(void **state)
{
    (void)state;
    static const double ranges[][2] = {
        {0.0, 1.0},
        {-3.4e38, 3.4e38},
        {1e-45, 9e-45},
        {1e-38, 1.0000001e-38},
        {1.0, 1.0 + 0x1p-23},
        {1.0, 1.0 + 10.0 * 0x1p-23}, /* some values are half a code from two codes: nothing to spare */
        {-1e6, -1e6 + 0.25},
        {7.5, 7.5},
        {0.0, 0.0},
        {-3e38, -3e38},
        {-1e-3, 1e5}};
    knurl_context *context = make_context(2, UINT32_MAX);
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++) {
        knurl_heightmap *map = random_map(context, 70, 41, KNURL_PIXEL_F32, ranges[i][0], ranges[i][1], i);
        const height_blocks *b = heightmap_blocks(map);
        check_tiles(map);
        check_nodes(b);
        /* Stated no larger than need be: half a step, and what doubles of this size lose. */
        assert_true(b->code_error <=
                    0.5000001 * b->step + 1e-15 * fmax(fabs(ranges[i][0]), fabs(ranges[i][1])));
        if (ranges[i][0] == ranges[i][1]) {
            assert_true(b->code_error == 0.0);
            assert_int_equal(height_blocks_code(b, 3, 3), 0);
            assert_true(b->origin == (double)(float)ranges[i][0]);
        }
        knurl_heightmap_release(map);
    }
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

/* A single spike is in exactly the children that hold its sample: continuations across the border too. */
static void test_spikes(void **state)
{
    (void)state;
    knurl_context *context = make_context(1, UINT32_MAX);
    static const int32_t sizes[][2] = {{33, 20}, {32, 16}, {70, 5}};
    uint64_t seed = 12;
    for (size_t s = 0; s < 3; s++) {
        int32_t width = sizes[s][0], height = sizes[s][1];
        size_t count = (size_t)width * (size_t)height;
        const size_t corners[4] = {0, (size_t)width - 1, count - 1, count - (size_t)width};
        for (int32_t spike = 0; spike < 20; spike++) {
            uint16_t *samples = calloc(count, sizeof *samples);
            assert_non_null(samples);
            samples[spike < 4 ? corners[spike] : next_random(&seed) % count] = 60000;
            knurl_heightmap *map = map_of(context, width, height, KNURL_PIXEL_U16, samples);
            free(samples);
            check_nodes(heightmap_blocks(map));
            knurl_heightmap_release(map);
        }
    }
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_definition),
        cmocka_unit_test(test_float_scales),
        cmocka_unit_test(test_spikes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
