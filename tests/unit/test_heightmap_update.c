/* Edits of a height map against a new map of the edited image, bit for bit. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "bounds/blocks.h"
#include "bounds/heightmap.h"
#include "bounds/minmax.h"
#include "bounds/rmip.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const int32_t SIZES[][2] = {{1, 1},   {1, 9},   {13, 1},  {5, 3},     {16, 16},
                                   {33, 65}, {64, 64}, {127, 6}, {200, 131}, {530, 40}};
enum { SIZE_COUNT = sizeof SIZES / sizeof SIZES[0] };
static const int32_t CELLS[][2] = {{8, 8}, {1, 4}, {32, 2}, {2, 16}, {4, 1}}; /* rmip, minmax */
static const knurl_pixel_format FORMATS[] = {KNURL_PIXEL_U8, KNURL_PIXEL_U16};

static uint32_t next_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(*state >> 32);
}

static knurl_context *make_context(int32_t threads)
{
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    knurl_context *context = NULL;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

/* Samples of a map and where edits go. */
typedef struct canvas {
    int32_t width, height;
    knurl_pixel_format format;
    unsigned char *samples;
    const int32_t *cells;
} canvas;

/* `high` samples are over the middle of the range, others below; floats are in (-100, 100) * size. */
static void random_sample(unsigned char *to, knurl_pixel_format format, bool high, float size, uint64_t *seed)
{
    uint32_t r = next_random(seed);
    uint8_t byte = (uint8_t)(high ? 128 + (r >> 25) : r >> 25);
    uint16_t word = (uint16_t)(high ? 32768 + (r >> 17) : r >> 17);
    float value = size * ((high ? 100.0f : -100.0f) * (float)(r >> 8) * 0x1p-24f);
    memcpy(to,
           format == KNURL_PIXEL_U8    ? (void *)&byte
           : format == KNURL_PIXEL_U16 ? (void *)&word
                                       : &value,
           (size_t)format);
}

static canvas make_canvas(const int32_t size[2], knurl_pixel_format format, const int32_t *cells,
                          uint64_t *seed)
{
    canvas c = {size[0], size[1], format, NULL, cells};
    size_t count = (size_t)size[0] * (size_t)size[1];
    c.samples = malloc(count * (size_t)format);
    assert_non_null(c.samples);
    for (size_t i = 0; i < count; i++)
        random_sample(c.samples + i * (size_t)format, format, next_random(seed) % 2, 1.0f, seed);
    return c;
}

static knurl_heightmap *make_map(knurl_context *context, const canvas *c, uint32_t need)
{
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(context, c->width, c->height, 1, c->format, c->samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    def.rmip_cell = c->cells[0];
    def.minmax_cell = c->cells[1];
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    assert_int_equal(heightmap_need(map, need, NULL), KNURL_OK);
    return map;
}

static void assert_same_levels(const knurl_heightmap *a, const knurl_heightmap *b)
{
    assert_int_equal(a->level_count, b->level_count);
    for (int32_t k = 0; k < a->level_count; k++)
        assert_memory_equal(a->levels[k].samples, b->levels[k].samples, height_level_bytes(&a->levels[k]));
}

static void assert_same_bounds(const knurl_heightmap *a, const knurl_heightmap *b)
{
    assert_true(a->range_min == b->range_min && a->range_max == b->range_max && a->code_step == b->code_step);
    const minmax_pyramid *p = a->minmax, *q = b->minmax;
    assert_memory_equal(p->codes, q->codes, (p->offset[p->level_count - 1] + 1) * sizeof *p->codes);
    const rmip_table *r = heightmap_rmip(a), *t = heightmap_rmip(b);
    for (size_t row = 0; r && t && row < r->y.base[r->y.layers]; row++)
        assert_memory_equal(r->codes + row * r->stride, t->codes + row * t->stride,
                            r->x.base[r->x.layers] * sizeof *r->codes);
    const height_blocks *d = heightmap_blocks(a), *e = heightmap_blocks(b);
    assert_true(!d == !e);
    if (!d) return;
    assert_true(d->origin == e->origin && d->step == e->step && d->code_error == e->code_error);
    assert_memory_equal(d->tiles, e->tiles, (size_t)d->tile_columns * (size_t)d->tile_rows * 64);
    for (int32_t k = 0; k < d->level_count; k++)
        assert_memory_equal(d->nodes[k], e->nodes[k],
                            (size_t)d->columns[k] * (size_t)d->rows[k] * sizeof *d->nodes[k]);
}

typedef struct rectangle {
    int32_t x, y, width, height;
} rectangle;

/* Along one axis: at the near border, at the far one, both, a single sample, anywhere. */
static void random_span(int32_t size, uint64_t *seed, int32_t *first, int32_t *count)
{
    int32_t length = 1 + (int32_t)(next_random(seed) % (uint32_t)size);
    if (next_random(seed) % 2) length = 1 + length / 8;
    switch (next_random(seed) % 5) {
    case 0:
        *first = 0;
        *count = length;
        break;
    case 1:
        *first = size - length;
        *count = length;
        break;
    case 2:
        *first = 0;
        *count = size;
        break;
    case 3:
        *first = (int32_t)(next_random(seed) % (uint32_t)size);
        *count = 1;
        break;
    default:
        *first = (int32_t)(next_random(seed) % (uint32_t)(size - length + 1));
        *count = length;
    }
}

static size_t offset_of(const canvas *c, int32_t x, int32_t y)
{
    return ((size_t)y * (size_t)c->width + (size_t)x) * (size_t)c->format;
}

/* Paints the rectangle into the canvas and into the map. Rows come from odd addresses. */
static void edit(knurl_heightmap *map, canvas *c, rectangle r, float size, uint64_t *seed)
{
    size_t row = (size_t)r.width * (size_t)c->format, stride = row + next_random(seed) % 7;
    unsigned char *samples = malloc(1 + stride * (size_t)r.height);
    assert_non_null(samples);
    bool high = next_random(seed) % 2;
    for (int32_t y = 0; y < r.height; y++) {
        unsigned char *from = samples + 1 + (size_t)y * stride;
        for (int32_t x = 0; x < r.width; x++)
            random_sample(from + (size_t)x * (size_t)c->format, c->format, high, size, seed);
        memcpy(c->samples + offset_of(c, r.x, r.y + y), from, row);
    }
    knurl_error error = {0};
    if (knurl_heightmap_update(map, r.x, r.y, r.width, r.height, samples + 1, stride, &error) != KNURL_OK)
        fail_msg("%s", error.message);
    free(samples);
}

static void check_integers(knurl_context *context, const int32_t size[2], knurl_pixel_format format,
                           const int32_t *cells, uint32_t need, uint64_t *seed)
{
    const uint32_t all = HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS;
    canvas c = make_canvas(size, format, cells, seed);
    knurl_heightmap *map = make_map(context, &c, need);
    for (int32_t i = 0; i < 12; i++) {
        rectangle r;
        random_span(c.width, seed, &r.x, &r.width);
        random_span(c.height, seed, &r.y, &r.height);
        uint64_t held = knurl_context_bytes(context);
        edit(map, &c, r, 1.0f, seed);
        assert_int_equal(knurl_context_bytes(context), held);
        knurl_heightmap *fresh = make_map(context, &c, need);
        assert_same_levels(map, fresh);
        assert_same_bounds(map, fresh);
        knurl_heightmap_release(fresh);
    }
    /* What was not there is made from the edited samples. */
    assert_int_equal(heightmap_need(map, all, NULL), KNURL_OK);
    knurl_heightmap *fresh = make_map(context, &c, all);
    assert_same_bounds(map, fresh);
    knurl_heightmap_release(fresh);
    knurl_heightmap_release(map);
    free(c.samples);
}

static void test_integers(void **state)
{
    (void)state;
    knurl_context *contexts[] = {make_context(1), make_context(3)};
    uint64_t seed = 31;
    for (size_t s = 0; s < SIZE_COUNT; s++)
        for (size_t f = 0; f < 2; f++)
            for (size_t c = 0; c < 5; c++)
                check_integers(contexts[c % 2], SIZES[s], FORMATS[f], CELLS[c],
                               c == 3 ? 0 : HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS, &seed);
    for (size_t i = 0; i < 2; i++) {
        assert_int_equal(knurl_context_bytes(contexts[i]), 0);
        knurl_context_release(contexts[i]);
    }
}

/* Two samples that no edit touches hold the ends of the range, so scales stay and all bits must agree;
 * or an edit exceeds it, and all is made anew. */
static void check_floats(knurl_context *context, const int32_t size[2], const int32_t *cells, bool exceed,
                         uint64_t *seed)
{
    canvas c = make_canvas(size, KNURL_PIXEL_F32, cells, seed);
    const float ends[2] = {-100.0f, 100.0f};
    memcpy(c.samples + offset_of(&c, 0, size[1] - 1), ends, sizeof ends);
    knurl_heightmap *map = make_map(context, &c, HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS);
    float scale = 1.0f;
    for (int32_t i = 0; i < 12; i++) {
        rectangle r;
        random_span(size[0], seed, &r.x, &r.width);
        random_span(size[1] - 1, seed, &r.y, &r.height);
        if (exceed) scale *= 300.0f; /* larger than all before: the range that a new map has */
        edit(map, &c, r, scale, seed);
        knurl_heightmap *fresh = make_map(context, &c, HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS);
        assert_same_levels(map, fresh);
        bool same_range = map->range_min == fresh->range_min && map->range_max == fresh->range_max;
        assert_true(same_range || exceed);
        assert_true(map->range_min <= fresh->range_min && map->range_max >= fresh->range_max);
        if (same_range) assert_same_bounds(map, fresh);
        knurl_heightmap_release(fresh);
    }
    knurl_heightmap_release(map);
    free(c.samples);
}

static void test_floats(void **state)
{
    (void)state;
    knurl_context *context = make_context(2);
    uint64_t seed = 77;
    static const int32_t sizes[][2] = {{2, 2}, {33, 65}, {64, 16}, {127, 7}, {200, 131}};
    for (size_t s = 0; s < 5; s++)
        for (size_t c = 0; c < 5; c++)
            for (int32_t exceed = 0; exceed < 2; exceed++)
                check_floats(context, sizes[s], CELLS[c], exceed, &seed);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

/* A range that is left wide bounds what is there, in structures that are made afterwards too. */
static void test_wide_range(void **state)
{
    (void)state;
    knurl_context *context = make_context(2);
    uint64_t seed = 5;
    const int32_t size[2] = {61, 45};
    canvas c = make_canvas(size, KNURL_PIXEL_F32, CELLS[1], &seed);
    knurl_heightmap *map = make_map(context, &c, 0);
    knurl_range before = knurl_heightmap_range(map), made;
    edit(map, &c, (rectangle){0, 0, size[0], size[1]}, 1e-3f, &seed);
    made = knurl_heightmap_range(map);
    assert_true(made.min == before.min && made.max == before.max);
    assert_int_equal(heightmap_need(map, HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS, NULL), KNURL_OK);
    const height_blocks *b = heightmap_blocks(map);
    assert_true(b->origin == before.min);
    double slack = 2.0 * (before.max - before.min) / 65535.0;
    for (int32_t i = 0; i < 2000; i++) {
        int32_t x = (int32_t)(next_random(&seed) % 61), y = (int32_t)(next_random(&seed) % 45);
        double value = knurl_heightmap_sample(map, 0, x, y);
        assert_true(fabs(b->origin + height_blocks_code(b, x, y) * b->step - value) <= b->code_error);
        for (int32_t kind = 0; kind < 2; kind++) {
            knurl_range range = heightmap_bounds_texels(map, (knurl_bounds_kind)kind, x, y, x, y,
                                                        KNURL_WRAP_CLAMP, KNURL_WRAP_CLAMP);
            assert_true(range.min <= value && range.max >= value);
            assert_true(range.max - range.min < 0.2 + slack);
        }
    }
    /* An edit that exceeds it finds the range as it is. */
    const float far[1] = {1e4f};
    assert_int_equal(knurl_heightmap_update(map, 60, 44, 1, 1, far, 0, NULL), KNURL_OK);
    memcpy(c.samples + offset_of(&c, 60, 44), far, sizeof far);
    knurl_heightmap *fresh = make_map(context, &c, HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS);
    assert_true(knurl_heightmap_range(map).max == (double)far[0]);
    assert_true(knurl_heightmap_range(map).min > before.min);
    assert_same_levels(map, fresh);
    assert_same_bounds(map, fresh);
    knurl_heightmap_release(fresh);
    knurl_heightmap_release(map);
    free(c.samples);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void expect_error(knurl_heightmap *map, rectangle r, const void *samples, size_t row_bytes,
                         knurl_status expected, const char *part)
{
    knurl_error error = {0};
    knurl_status status =
        knurl_heightmap_update(map, r.x, r.y, r.width, r.height, samples, row_bytes, &error);
    if (status != expected || !strstr(error.message, part))
        fail_msg("status %d, message \"%s\", expected %d and \"%s\"", (int)status, error.message,
                 (int)expected, part);
}

static void test_errors_change_nothing(void **state)
{
    (void)state;
    knurl_context *context = make_context(1);
    uint64_t seed = 9;
    const int32_t size[2] = {20, 10};
    canvas c = make_canvas(size, KNURL_PIXEL_F32, CELLS[0], &seed);
    knurl_heightmap *map = make_map(context, &c, HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS);
    knurl_heightmap *untouched = make_map(context, &c, HEIGHT_NEED_RMIP | HEIGHT_NEED_BLOCKS);
    float samples[200];
    for (int32_t i = 0; i < 200; i++) samples[i] = 1e6f;
    const size_t row = 20 * sizeof(float);
    expect_error(NULL, (rectangle){0, 0, 1, 1}, samples, row, KNURL_ERROR_ARGUMENT, "map is NULL");
    const rectangle outside[] = {{-1, 0, 1, 1},        {0, -1, 1, 1},        {20, 0, 1, 1},
                                 {0, 10, 1, 1},        {1, 0, 20, 1},        {0, 0, 1, 11},
                                 {0, 0, -1, 1},        {0, 0, 1, -1},        {0, 3, 3, 8},
                                 {INT32_MAX, 0, 1, 1}, {5, 5, INT32_MAX, 1}, {0, INT32_MIN, 1, 1}};
    for (size_t i = 0; i < sizeof outside / sizeof outside[0]; i++)
        expect_error(map, outside[i], samples, row, KNURL_ERROR_ARGUMENT, "inside the map's 20 x 10");
    expect_error(map, (rectangle){0, 0, 1, 1}, NULL, row, KNURL_ERROR_ARGUMENT, "samples is NULL");
    expect_error(map, (rectangle){0, 0, 20, 2}, samples, row - 1, KNURL_ERROR_ARGUMENT,
                 "expected at least 80");
    samples[2 * 20 + 5] = NAN;
    samples[3 * 20 + 1] = INFINITY;
    expect_error(map, (rectangle){0, 4, 20, 6}, samples, row, KNURL_ERROR_INPUT, "(5, 6) is ");
    expect_error(map, (rectangle){3, 4, 2, 6}, samples, row, KNURL_ERROR_INPUT, "(4, 7) is inf");
    assert_same_levels(map, untouched);
    assert_same_bounds(map, untouched);
    /* Nothing to do is not an error. */
    assert_int_equal(knurl_heightmap_update(map, 20, 10, 0, 0, NULL, 0, NULL), KNURL_OK);
    assert_int_equal(knurl_heightmap_update(map, 3, 3, 0, 5, samples, 0, NULL), KNURL_OK);
    assert_same_bounds(map, untouched);
    knurl_heightmap_release(untouched);
    knurl_heightmap_release(map);
    free(c.samples);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_integers),
        cmocka_unit_test(test_floats),
        cmocka_unit_test(test_wide_range),
        cmocka_unit_test(test_errors_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
