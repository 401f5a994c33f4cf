/* Range bounds against brute force. A bilinear signal takes its extremes over a rectangle at the corners
 * of the pieces that the texel grid cuts it into, and so does a blend of two levels with both grids'
 * lines; so brute force over those corners is exact. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "bounds/heightmap.h"
#include "bounds/rmip.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const int32_t SIZES[][2] = {{1, 1}, {1, 7}, {5, 3}, {16, 16}, {33, 65}, {127, 64}, {200, 130}};
enum { SIZE_COUNT = sizeof SIZES / sizeof SIZES[0] };
static const int32_t CELLS[][2] = {{8, 8}, {1, 1}, {2, 4}, {16, 2}, {32, 16}, {4, 1}, {8, 2}};
static const knurl_pixel_format FORMATS[] = {KNURL_PIXEL_U8, KNURL_PIXEL_U16, KNURL_PIXEL_F32};

static uint32_t next_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(*state >> 32);
}

static double uniform(uint64_t *state)
{
    return next_random(state) * 0x1p-32;
}

static knurl_context *make_context(void)
{
    knurl_context_def def = knurl_context_def_default();
    def.threads = 2;
    knurl_context *context = NULL;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

/* roughness 1: noise, 0: smooth waves. */
static knurl_heightmap *make_map(knurl_context *context, const int32_t size[2], knurl_pixel_format format,
                                 const int32_t cells[2], double roughness, uint64_t seed)
{
    size_t count = (size_t)size[0] * (size_t)size[1];
    unsigned char *samples = malloc(count * (size_t)format);
    assert_non_null(samples);
    for (size_t i = 0; i < count; i++) {
        double x = (double)(i % (size_t)size[0]), y = (double)(i / (size_t)size[0]);
        double wave = 0.5 + 0.25 * sin(0.013 * x + 0.007 * y) + 0.25 * cos(0.011 * y - 0.006 * x);
        double value = wave + roughness * (uniform(&seed) - wave);
        if (format == KNURL_PIXEL_U8)
            samples[i] = (unsigned char)(255.0 * value);
        else if (format == KNURL_PIXEL_U16)
            ((uint16_t *)(void *)samples)[i] = (uint16_t)(65535.0 * value);
        else
            ((float *)(void *)samples)[i] = (float)(1e3 * value - 300.0);
    }
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(context, size[0], size[1], 1, format, samples, &image, NULL),
                     KNURL_OK);
    free(samples);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    def.rmip_cell = cells[0];
    def.minmax_cell = cells[1];
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    assert_int_equal(heightmap_need(map, HEIGHT_NEED_RMIP, NULL), KNURL_OK);
    knurl_image_release(image);
    return map;
}

typedef struct rectangle {
    double u[2], v[2];
    knurl_wrap wrap[2];
    double lod;
} rectangle;

enum { MAX_LINES = 4096 };

/* Ends of the interval and the lines of the grids of the levels that take part. */
static int32_t lines(const knurl_heightmap *map, const double ends[2], double lod, bool vertical, double *out)
{
    int32_t count = 0, last = knurl_heightmap_levels(map) - 1;
    out[count++] = ends[0];
    out[count++] = ends[1];
    int32_t fine = (int32_t)fmin(floor(lod), last), coarse = (int32_t)fmin(ceil(lod), last);
    for (int32_t k = fine; k <= coarse; k++) {
        double n = vertical ? knurl_heightmap_height(map, k) : knurl_heightmap_width(map, k);
        for (double i = ceil(ends[0] * n - 0.5); i <= ends[1] * n - 0.5; i++) {
            double at = (i + 0.5) / n;
            assert_true(count < MAX_LINES);
            if (at >= ends[0] && at <= ends[1]) out[count++] = at;
        }
    }
    return count;
}

static knurl_range brute_force(const knurl_heightmap *map, const rectangle *r)
{
    static double x[MAX_LINES], y[MAX_LINES];
    int32_t nx = lines(map, r->u, r->lod, false, x), ny = lines(map, r->v, r->lod, true, y);
    knurl_range range = {INFINITY, -INFINITY};
    for (int32_t j = 0; j < ny; j++) {
        for (int32_t i = 0; i < nx; i++) {
            double value = knurl_heightmap_value(map, x[i], y[j], r->wrap[0], r->wrap[1], r->lod);
            range.min = fmin(range.min, value);
            range.max = fmax(range.max, value);
        }
    }
    return range;
}

static knurl_range bounds(const knurl_heightmap *map, knurl_bounds_kind kind, const rectangle *r)
{
    return knurl_heightmap_bounds(map, kind, r->u[0], r->v[0], r->u[1], r->v[1], r->wrap[0], r->wrap[1],
                                  r->lod);
}

/* Not one bit of slack: values are evaluated so that they stay between their samples. */
static void check(const knurl_heightmap *map, const rectangle *r)
{
    knurl_range truth = brute_force(map, r), all = knurl_heightmap_range(map);
    for (int32_t kind = 0; kind < 2; kind++) {
        knurl_range found = bounds(map, (knurl_bounds_kind)kind, r);
        if (!(found.min <= truth.min && found.max >= truth.max))
            fail_msg("%s, %d x %d, u [%.17g, %.17g], v [%.17g, %.17g], wrap %d %d, lod %g: "
                     "[%.12g, %.12g] does not hold [%.12g, %.12g]",
                     kind ? "rmip" : "minmax", map->levels[0].width, map->levels[0].height, r->u[0], r->u[1],
                     r->v[0], r->v[1], r->wrap[0], r->wrap[1], r->lod, found.min, found.max, truth.min,
                     truth.max);
        assert_true(found.min >= all.min && found.max <= all.max);
    }
}

/* An interval of one of the kinds that have gone wrong somewhere: tiny, wide, on borders, far away. */
static void random_interval(double ends[2], int32_t size, uint64_t *seed)
{
    double texel = 1.0 / size, start, width;
    switch (next_random(seed) % 5) {
    case 0:
        start = uniform(seed);
        break;
    case 1:
        start = (double)(next_random(seed) % 5) - 2.0 - 2.0 * texel * uniform(seed);
        break; /* at a border */
    case 2:
        start = 8.0 * uniform(seed) - 4.0;
        break;
    case 3:
        start = ((double)(int32_t)(next_random(seed) % (4 * (uint32_t)size)) - size + 0.5) * texel;
        break;
    default:
        start = -1000.0 * uniform(seed);
        break;
    }
    switch (next_random(seed) % 5) {
    case 0:
        width = 0.0;
        break;
    case 1:
        width = 3.0 * texel * uniform(seed);
        break;
    case 2:
        width = uniform(seed) * uniform(seed);
        break;
    case 3:
        width = (double)(next_random(seed) % 9) * texel;
        break;
    default:
        width = 2.2 * uniform(seed);
        break;
    }
    if (size > 100) width *= 0.4; /* brute force over long intervals of large maps is slow */
    ends[0] = start;
    ends[1] = start + width;
}

static void test_random_rectangles(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    uint64_t seed = 2024;
    for (size_t s = 0; s < SIZE_COUNT; s++) {
        for (size_t f = 0; f < 3; f++) {
            for (size_t c = 0; c < 2; c++) {
                size_t cells = (c * 3 + s + f) % (sizeof CELLS / sizeof CELLS[0]);
                knurl_heightmap *map =
                    make_map(context, SIZES[s], FORMATS[f], CELLS[cells], c ? 0.05 : 1.0, 77 * s + f);
                double last = knurl_heightmap_levels(map) - 1;
                const double lods[] = {0.0, 0.5, 1.0, 2.3, last, uniform(&seed) * last};
                for (int32_t i = 0; i < (s > 4 ? 300 : 1200); i++) {
                    rectangle r = {.wrap = {next_random(&seed) % 3, next_random(&seed) % 3},
                                   .lod = fmin(lods[next_random(&seed) % 6], last)};
                    random_interval(r.u, SIZES[s][0], &seed);
                    random_interval(r.v, SIZES[s][1], &seed);
                    check(map, &r);
                }
                knurl_heightmap_release(map);
            }
        }
    }
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

/* Maps whose only structure is one spike: a bound that forgets a sample shows at once. The spike is the
 * wrap partner of what is queried more often than in noise. */
static void test_single_spikes(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    uint64_t seed = 5;
    static const int32_t sizes[][2] = {{9, 6}, {31, 17}, {24, 40}};
    for (size_t s = 0; s < 3; s++) {
        for (int32_t spike = 0; spike < 24; spike++) {
            size_t count = (size_t)(sizes[s][0] * sizes[s][1]);
            float *samples = calloc(count, sizeof *samples);
            assert_non_null(samples);
            size_t corners[4] = {0, (size_t)sizes[s][0] - 1, count - 1, count - (size_t)sizes[s][0]};
            samples[spike < 4 ? corners[spike] : next_random(&seed) % count] = spike % 2 ? 1.0f : -1.0f;
            knurl_image *image = NULL;
            assert_int_equal(knurl_image_create(context, sizes[s][0], sizes[s][1], 1, KNURL_PIXEL_F32,
                                                samples, &image, NULL),
                             KNURL_OK);
            free(samples);
            knurl_heightmap_def def = knurl_heightmap_def_default();
            def.image = image;
            def.rmip_cell = 1 << (spike % 4);
            def.minmax_cell = 1 << (spike / 4 % 4);
            knurl_heightmap *map = NULL;
            assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
            assert_int_equal(heightmap_need(map, HEIGHT_NEED_RMIP, NULL), KNURL_OK);
            knurl_image_release(image);
            double last = knurl_heightmap_levels(map) - 1;
            for (int32_t i = 0; i < 500; i++) {
                rectangle r = {.wrap = {next_random(&seed) % 3, next_random(&seed) % 3},
                               .lod = i % 2 ? 0.0 : uniform(&seed) * last};
                random_interval(r.u, sizes[s][0], &seed);
                random_interval(r.v, sizes[s][1], &seed);
                check(map, &r);
            }
            knurl_heightmap_release(map);
        }
    }
    knurl_context_release(context);
}

/* Levels of detail far outside a clamped map: the coarse border sample depends on texels well inside. */
static void test_clamped_far_away(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    const int32_t size[2] = {127, 64}, cells[2] = {4, 4};
    knurl_heightmap *map = make_map(context, size, KNURL_PIXEL_U16, cells, 1.0, 8);
    for (double lod = 0.0; lod <= 6.0; lod += 0.75) {
        rectangle r = {{40.0, 41.0}, {-30.0, -30.0}, {KNURL_WRAP_CLAMP, KNURL_WRAP_CLAMP}, lod};
        check(map, &r);
        r = (rectangle){{-9.0, -3.0}, {1e6, 1e6 + 0.5}, {KNURL_WRAP_CLAMP, KNURL_WRAP_CLAMP}, lod};
        double value = knurl_heightmap_value(map, r.u[0], r.v[0], r.wrap[0], r.wrap[1], lod);
        for (int32_t kind = 0; kind < 2; kind++) {
            knurl_range found = bounds(map, (knurl_bounds_kind)kind, &r);
            assert_true(found.min <= value && found.max >= value);
        }
    }
    knurl_heightmap_release(map);
    knurl_context_release(context);
}

static void test_coordinates_without_meaning(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    const int32_t size[2] = {33, 65}, cells[2] = {8, 8};
    knurl_heightmap *map = make_map(context, size, KNURL_PIXEL_F32, cells, 1.0, 8);
    knurl_range all = knurl_heightmap_range(map);
    const double odd[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300, 1e17, -0.0, 0.3};
    for (int32_t i = 0; i < 8 * 8 * 9 * 2; i++) {
        int32_t wrap = i % 9, a = i / 9 % 8, b = i / 72 % 8;
        knurl_range found =
            knurl_heightmap_bounds(map, (knurl_bounds_kind)(i / 576), odd[a], odd[b], odd[b], odd[a],
                                   (knurl_wrap)(wrap % 3), (knurl_wrap)(wrap / 3), 0.7);
        assert_true(found.min >= all.min && found.max <= all.max && found.min <= found.max);
    }
    /* Endless rectangles of repeated maps hold everything. */
    knurl_range found = knurl_heightmap_bounds(map, KNURL_BOUNDS_RMIP, -INFINITY, -1e300, INFINITY, 1e300,
                                               KNURL_WRAP_REPEAT, KNURL_WRAP_MIRROR, 0.0);
    assert_true(found.min == all.min && found.max == all.max);
    knurl_heightmap_release(map);
    knurl_context_release(context);
}

/* A map of one row, 0 but for a 1 at `spike`. */
static knurl_heightmap *make_spike(knurl_context *context, int32_t width, int32_t spike)
{
    uint16_t samples[16] = {0};
    assert_true(width <= 16);
    samples[spike] = 65535;
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(context, width, 1, 1, KNURL_PIXEL_U16, samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    def.rmip_cell = def.minmax_cell = 1;
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    assert_int_equal(heightmap_need(map, HEIGHT_NEED_RMIP, NULL), KNURL_OK);
    knurl_image_release(image);
    return map;
}

/* Points a hair before a sample, where the nearest double after folding is the sample itself. In exact
 * arithmetic the sample before it takes part, so its height must be in the bound. */
static void test_rounding_is_outward(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    static const struct {
        double x;
        knurl_wrap wrap;
        int32_t spike;
    } texels[] = {
        {-1e-20, KNURL_WRAP_REPEAT, 7},         {-2.0 - 0x1p-51, KNURL_WRAP_REPEAT, 5},
        {-2.0 + 0x1p-52, KNURL_WRAP_REPEAT, 7}, {-2.0 + 0x1p-52, KNURL_WRAP_MIRROR, 0},
        {-2.0 - 0x1p-51, KNURL_WRAP_MIRROR, 2}, {-13.0 + 0x1p-49, KNURL_WRAP_MIRROR, 4},
    };
    for (size_t i = 0; i < sizeof texels / sizeof texels[0]; i++) {
        knurl_heightmap *map = make_spike(context, 8, texels[i].spike);
        for (int32_t kind = 0; kind < 2; kind++) {
            knurl_range found = heightmap_bounds_texels(map, (knurl_bounds_kind)kind, texels[i].x, 0.0,
                                                        texels[i].x, 0.0, texels[i].wrap, KNURL_WRAP_CLAMP);
            if (found.max != 1.0) fail_msg("texel %.17g: maximum %g", texels[i].x, found.max);
        }
        knurl_heightmap_release(map);
    }
    /* And where u * width - 0.5 rounds up to a sample. */
    int32_t rounded_up = 0;
    for (int32_t width = 3; width < 16; width += 2) {
        for (int32_t i = 1; i < width; i++) {
            double at = nextafter((i + 0.5) / width, 0.0);
            /* The sign of width * at - (i + 0.5), exactly: the product's error by a fused operation. */
            double error = fma(width, at, -(i + 0.5));
            if (!(error < 0.0) || at * width - 0.5 != i) continue;
            rounded_up++;
            knurl_heightmap *map = make_spike(context, width, i - 1);
            knurl_range found = knurl_heightmap_bounds(map, KNURL_BOUNDS_RMIP, at, 0.5, at, 0.5,
                                                       KNURL_WRAP_CLAMP, KNURL_WRAP_CLAMP, 0.0);
            assert_true(found.max == 1.0);
            knurl_heightmap_release(map);
        }
    }
    assert_true(rounded_up > 0);
    knurl_context_release(context);
}

/* Rectangles of whole cells: integer maps are exact wherever a table stores the very window. */
static void test_exact_windows(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    const int32_t size[2] = {64, 64}, cells[2] = {4, 4};
    for (size_t f = 0; f < 2; f++) {
        knurl_heightmap *map = make_map(context, size, FORMATS[f], cells, 1.0, 8 + f);
        for (int32_t kind = 0; kind < 2; kind++) {
            for (int32_t side = 4; side <= 32; side *= 2) {
                for (int32_t y = 0; y + side < 64; y += side) {
                    for (int32_t x = 0; x + side < 64; x += side) {
                        rectangle r = {{(x + 0.5) / 64.0, (x + side + 0.5) / 64.0},
                                       {(y + 0.5) / 64.0, (y + side + 0.5) / 64.0},
                                       {KNURL_WRAP_REPEAT, KNURL_WRAP_REPEAT},
                                       0.0};
                        knurl_range truth = brute_force(map, &r);
                        knurl_range found = heightmap_bounds_texels(map, (knurl_bounds_kind)kind, x, y,
                                                                    x + side, y + side, r.wrap[0], r.wrap[1]);
                        assert_true(found.min == truth.min && found.max == truth.max);
                    }
                }
            }
        }
        knurl_heightmap_release(map);
    }
    knurl_context_release(context);
}

/* The proof in rmip.c, for every query of small grids and many of a large one. */
static void check_windows(const rmip_axis *axis, int32_t first, int32_t last)
{
    size_t entry[2];
    int32_t begin[2], end[2];
    rmip_windows(axis, first, last, entry);
    for (int32_t i = 0; i < 2; i++) {
        assert_true(entry[i] < axis->base[axis->layers]);
        int32_t p = 0;
        while (entry[i] >= axis->base[p + 1]) p++;
        begin[i] = (int32_t)(entry[i] - axis->base[p]) << rmip_spacing(p);
        end[i] = begin[i] + (1 << p);
    }
    assert_true(end[0] - begin[0] == end[1] - begin[1]);
    assert_true(begin[0] <= first && end[1] > last);
    assert_true(begin[1] <= end[0]);
    int32_t width = last - first + 1, window = end[0] - begin[0];
    /* Reaches past by less than a quarter of a window, or one window holds it all. */
    assert_true(first - begin[0] < (window > 4 ? window / 4 : 1));
    assert_true(end[1] - 1 - last < (window > 4 ? window / 4 : 1) || begin[1] == 0);
    assert_true(width > window * 7 / 8 || window == 1);
}

static void test_windows_cover(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    for (int32_t r = 1; r <= 600; r = r < 70 ? r + 1 : r * 2 - 1) {
        const int32_t size[2] = {r, 1}, cells[2] = {1, 1};
        knurl_heightmap *map = make_map(context, size, KNURL_PIXEL_U8, cells, 1.0, 1);
        const rmip_axis *axis = &heightmap_rmip(map)->x;
        assert_int_equal(axis->cells, r);
        for (int32_t first = 0; first < r; first++)
            for (int32_t last = first; last < r; last++) check_windows(axis, first, last);
        knurl_heightmap_release(map);
    }
    knurl_context_release(context);
}

/* Bound width over true width, for shapes that a ray's projection takes. */
static void test_tightness(void **state)
{
    (void)state;
    static const double shapes[][2] = {{10, 10},  {64, 64},  {100, 12}, {12, 100},
                                       {250, 16}, {40, 300}, {9, 450}};
    knurl_context *context = make_context();
    const int32_t size[2] = {512, 512}, cells[2] = {8, 8};
    knurl_heightmap *map = make_map(context, size, KNURL_PIXEL_U16, cells, 0.02, 3);
    uint64_t seed = 17;
    double excess[2] = {0.0, 0.0};
    for (size_t s = 0; s < 7; s++) {
        double mean[2] = {0.0, 0.0};
        enum { TRIES = 60 };
        for (int32_t i = 0; i < TRIES; i++) {
            rectangle r = {.wrap = {KNURL_WRAP_CLAMP, KNURL_WRAP_CLAMP}};
            r.u[0] = uniform(&seed) * (1.0 - shapes[s][0] / 512.0);
            r.v[0] = uniform(&seed) * (1.0 - shapes[s][1] / 512.0);
            r.u[1] = r.u[0] + shapes[s][0] / 512.0;
            r.v[1] = r.v[0] + shapes[s][1] / 512.0;
            knurl_range truth = brute_force(map, &r);
            for (int32_t kind = 0; kind < 2; kind++) {
                knurl_range found = bounds(map, (knurl_bounds_kind)kind, &r);
                mean[kind] += (found.max - found.min) / (truth.max - truth.min) / TRIES;
            }
        }
        print_message("  %4g x %-4g texels: minmax %.2f, rmip %.2f times the true width\n", shapes[s][0],
                      shapes[s][1], mean[0], mean[1]);
        for (int32_t kind = 0; kind < 2; kind++) assert_true(mean[kind] >= 1.0);
        assert_true(mean[1] < 1.02 * mean[0]);
        if (s < 2) continue;
        for (int32_t kind = 0; kind < 2; kind++) excess[kind] += mean[kind] - 1.0;
    }
    assert_true(excess[1] < 0.5 * excess[0]); /* of the elongated shapes */
    knurl_heightmap_release(map);
    knurl_context_release(context);
}

/* Without a table the pyramid answers, and the public function makes it. */
static void test_table_on_demand(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    const int32_t size[2] = {200, 130}, cells[2] = {2, 8};
    knurl_heightmap *map = make_map(context, size, KNURL_PIXEL_U16, cells, 1.0, 4);
    const double at[4] = {30.5, 40.0, 52.0, 49.5};
    knurl_range table = heightmap_bounds_texels(map, KNURL_BOUNDS_RMIP, at[0], at[1], at[2], at[3],
                                                KNURL_WRAP_REPEAT, KNURL_WRAP_REPEAT);
    rmip_destroy(context, map->rmip);
    map->rmip = NULL;
    assert_int_equal(knurl_heightmap_memory(map).rmip, 0);
    knurl_range pyramid = heightmap_bounds_texels(map, KNURL_BOUNDS_MINMAX, at[0], at[1], at[2], at[3],
                                                  KNURL_WRAP_REPEAT, KNURL_WRAP_REPEAT);
    knurl_range found = heightmap_bounds_texels(map, KNURL_BOUNDS_RMIP, at[0], at[1], at[2], at[3],
                                                KNURL_WRAP_REPEAT, KNURL_WRAP_REPEAT);
    assert_true(found.min == pyramid.min && found.max == pyramid.max);
    assert_true(table.min > pyramid.min || table.max < pyramid.max);
    assert_null(heightmap_rmip(map));
    found = knurl_heightmap_bounds(map, KNURL_BOUNDS_RMIP, (at[0] + 0.5) / size[0], (at[1] + 0.5) / size[1],
                                   (at[2] + 0.5) / size[0], (at[3] + 0.5) / size[1], KNURL_WRAP_REPEAT,
                                   KNURL_WRAP_REPEAT, 0.0);
    assert_true(found.min >= pyramid.min && found.max <= pyramid.max);
    assert_true(found.min > pyramid.min || found.max < pyramid.max);
    const rmip_table *made = heightmap_rmip(map);
    assert_non_null(made);
    assert_int_equal(knurl_heightmap_memory(map).rmip, made->bytes);
    assert_int_equal(heightmap_need(map, HEIGHT_NEED_RMIP, NULL), KNURL_OK);
    assert_ptr_equal(heightmap_rmip(map), made);
    knurl_heightmap_release(map);
    assert_int_equal(knurl_context_bytes(context), 0);
    knurl_context_release(context);
}

static void test_margin(void **state)
{
    (void)state;
    knurl_context *context = make_context();
    const int32_t size[2] = {256, 1}, cells[2] = {8, 8};
    knurl_heightmap *map = make_map(context, size, KNURL_PIXEL_U16, cells, 1.0, 3);
    double margin[2], previous = 0.0;
    heightmap_lod_margin(map, 0.0, margin);
    assert_true(margin[0] == 0.0 && margin[1] == 0.0);
    for (int32_t k = 1; k <= 8; k++) {
        heightmap_lod_margin(map, k - 0.75, margin);
        double fractional = margin[0];
        heightmap_lod_margin(map, k, margin);
        /* Even sizes: three half intervals, less the half texel of the outermost sample. */
        assert_true(fabs(margin[0] - (1.5 * (1 << k) - 0.5)) < 1e-6);
        assert_true(fractional == margin[0] && margin[0] > previous);
        previous = margin[0];
    }
    heightmap_lod_margin(map, 1e9, margin);
    assert_true(margin[0] == previous);
    knurl_heightmap_release(map);
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_random_rectangles),   cmocka_unit_test(test_single_spikes),
        cmocka_unit_test(test_clamped_far_away),    cmocka_unit_test(test_coordinates_without_meaning),
        cmocka_unit_test(test_rounding_is_outward), cmocka_unit_test(test_exact_windows),
        cmocka_unit_test(test_windows_cover),       cmocka_unit_test(test_tightness),
        cmocka_unit_test(test_table_on_demand),     cmocka_unit_test(test_margin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
