/* What range bounds cost and how tight they are: building them for a 4096 x 4096 16-bit map beside a plain
 * copy of as many bytes, memory by structure, tightness by shape of rectangle, time per query.
 *
 *     bench_bounds [size] [rounds]
 */
#include <knurl/heightmap.h>

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double read_clock(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double seconds(void)
{
    return read_clock(CLOCK_MONOTONIC);
}
/* Queries run on one thread; what other programs take of it is left out. */
static double thread_seconds(void)
{
    return read_clock(CLOCK_THREAD_CPUTIME_ID);
}

static uint32_t next_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(*state >> 32);
}

static double uniform(uint64_t *state)
{
    return next_random(state) * 0x1p-32;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, compare);
    return count % 2 ? values[count / 2] : 0.5 * (values[count / 2 - 1] + values[count / 2]);
}

/* Value noise of several octaves: relief-like, with detail down to the texel. */
static double lattice(int32_t x, int32_t y, uint32_t octave)
{
    uint32_t h = (uint32_t)x * 0x9e3779b1u ^ (uint32_t)y * 0x85ebca77u ^ octave * 0xc2b2ae3du;
    h = (h ^ h >> 15) * 0x2c1b3c6du;
    h = (h ^ h >> 12) * 0x297a2d39u;
    return (h ^ h >> 15) * 0x1p-32;
}

static double relief(int32_t x, int32_t y, int32_t size)
{
    double sum = 0.0, weight = 0.5;
    uint32_t octave = 0;
    for (int32_t period = size / 4; period >= 2; period /= 4, weight *= 0.35, octave++) {
        int32_t i = x / period, j = y / period;
        double s = (double)(x % period) / period, t = (double)(y % period) / period;
        double top = lattice(i, j, octave) * (1 - s) + lattice(i + 1, j, octave) * s;
        double bottom = lattice(i, j + 1, octave) * (1 - s) + lattice(i + 1, j + 1, octave) * s;
        sum += weight * (top * (1 - t) + bottom * t);
    }
    return sum;
}

static knurl_image *make_image(knurl_context *context, int32_t size)
{
    uint16_t *samples = malloc((size_t)size * (size_t)size * sizeof *samples);
    if (!samples) return NULL;
    for (int32_t y = 0; y < size; y++)
        for (int32_t x = 0; x < size; x++)
            samples[(size_t)y * (size_t)size + (size_t)x] = (uint16_t)(65535.0 * relief(x, y, size));
    knurl_image *image = NULL;
    knurl_image_create(context, size, size, 1, KNURL_PIXEL_U16, samples, &image, NULL);
    free(samples);
    return image;
}

/* The yardstick: a loop that copies words, its memory touched before, on as many threads as the build. */
typedef struct copy_part {
    const uint64_t *from;
    uint64_t *to;
    size_t words;
} copy_part;

static void *copy_words(void *argument)
{
    const copy_part *part = argument;
    for (size_t i = 0; i < part->words; i++) part->to[i] = part->from[i];
    return NULL;
}

enum { MAX_THREADS = 64 };

static double copy_ms(const uint64_t *from, uint64_t *to, size_t words, int threads)
{
    copy_part parts[MAX_THREADS];
    pthread_t ids[MAX_THREADS];
    double start = seconds();
    size_t done = 0;
    for (int i = 0; i < threads; i++) {
        size_t end = words * (size_t)(i + 1) / (size_t)threads;
        parts[i] = (copy_part){from + done, to + done, end - done};
        done = end;
        if (i > 0 && pthread_create(&ids[i], NULL, copy_words, &parts[i]) != 0) exit(4);
    }
    copy_words(&parts[0]);
    for (int i = 1; i < threads; i++) pthread_join(ids[i], NULL);
    return 1e3 * (seconds() - start);
}

static int bench_build(int32_t size, int threads, int rounds)
{
    enum { MAX_ROUNDS = 101 };
    static double build[MAX_ROUNDS], copy[MAX_ROUNDS];
    if (rounds > MAX_ROUNDS) rounds = MAX_ROUNDS;
    knurl_context_def context_def = knurl_context_def_default();
    context_def.threads = threads;
    knurl_context *context = NULL;
    if (knurl_context_create(&context_def, &context, NULL) != KNURL_OK) return 4;
    knurl_heightmap_def def = knurl_heightmap_def_default();
    knurl_image *image = make_image(context, size);
    def.image = image;
    uint64_t *from = NULL, *to = NULL;
    size_t bytes = 0;
    for (int i = -1; i < rounds; i++) { /* round -1 warms up and tells the sizes */
        knurl_heightmap *map = NULL;
        knurl_error error;
        if (!image || knurl_heightmap_create(context, &def, &map, &error) != KNURL_OK) return 4;
        /* The RMIP table is made when it is asked for. */
        (void)knurl_heightmap_bounds(map, KNURL_BOUNDS_RMIP, 0.0, 0.0, 1.0, 1.0, KNURL_WRAP_REPEAT,
                                     KNURL_WRAP_REPEAT, 0.0);
        if (i < 0) {
            knurl_heightmap_bytes memory = knurl_heightmap_memory(map);
            bytes = memory.samples + memory.minmax + memory.rmip;
            uint64_t total = bytes + memory.levels;
            from = malloc(bytes);
            to = malloc(bytes);
            if (!from || !to) return 4;
            for (size_t k = 0; k < bytes / 8; k++) from[k] = to[k] = k;
            printf("%d thread(s): samples %.1f MB, levels %.1f, minmax %.1f, rmip %.1f; all %.2f x the "
                   "samples\n",
                   threads, 1e-6 * (double)memory.samples, 1e-6 * (double)memory.levels,
                   1e-6 * (double)memory.minmax, 1e-6 * (double)memory.rmip,
                   (double)total / (double)memory.samples);
        } else {
            build[i] = knurl_heightmap_build_ms(map);
            copy[i] = copy_ms(from, to, bytes / 8, threads);
        }
        knurl_heightmap_release(map);
    }
    double build_ms = median(build, rounds), copied_ms = median(copy, rounds);
    printf("  build %.2f ms (%.2f to %.2f), copy of %.1f MB %.2f ms (%.2f to %.2f): ratio %.2f\n", build_ms,
           build[0], build[rounds - 1], 1e-6 * (double)bytes, copied_ms, copy[0], copy[rounds - 1],
           build_ms / copied_ms);
    free(from);
    free(to);
    knurl_image_release(image);
    knurl_context_release(context);
    return 0;
}

typedef struct shape {
    double width, height; /* texels */
} shape;

static const shape SHAPES[] = {{3, 3},    {12, 12},  {64, 64},   {500, 500},
                               {200, 10}, {10, 200}, {1000, 30}, {30, 1000}};
enum { SHAPE_COUNT = sizeof SHAPES / sizeof SHAPES[0], QUERIES = 200000 };

static double true_width(const knurl_heightmap *map, double x, double y, const shape *s)
{
    double low = INFINITY, high = -INFINITY;
    for (int32_t j = (int32_t)y; j <= (int32_t)ceil(y + s->height); j++) {
        for (int32_t i = (int32_t)x; i <= (int32_t)ceil(x + s->width); i++) {
            double value = knurl_heightmap_sample(map, 0, i, j);
            low = fmin(low, value);
            high = fmax(high, value);
        }
    }
    return high - low;
}

/* Against the range of the samples at and around the rectangle: the best a table of texels can do. */
static void bench_tightness(const knurl_heightmap *map, const shape *s, double mean[2])
{
    enum { TRIES = 200 };
    int32_t size = knurl_heightmap_width(map, 0);
    uint64_t seed = 3;
    mean[0] = mean[1] = 0.0;
    for (int i = 0; i < TRIES; i++) {
        double x = uniform(&seed) * (size - 2 - s->width), y = uniform(&seed) * (size - 2 - s->height);
        double truth = true_width(map, x, y, s);
        for (int kind = 0; kind < 2; kind++) {
            knurl_range found = knurl_heightmap_bounds(
                map, (knurl_bounds_kind)kind, (x + 0.5) / size, (y + 0.5) / size, (x + 0.5 + s->width) / size,
                (y + 0.5 + s->height) / size, KNURL_WRAP_REPEAT, KNURL_WRAP_REPEAT, 0.0);
            mean[kind] += (found.max - found.min) / truth / TRIES;
        }
    }
}

/* Rectangles all over the map (`spread` 1) or in a window of it, as rays of one tile of pixels ask for. */
static double query_ns(const knurl_heightmap *map, knurl_bounds_kind kind, const shape *s, double spread,
                       double origin, double *sum)
{
    static float start[QUERIES][2];
    double size = knurl_heightmap_width(map, 0), width = s->width / size, height = s->height / size;
    uint64_t seed = 9;
    for (int i = 0; i < QUERIES; i++)
        for (int k = 0; k < 2; k++) start[i][k] = (float)(origin + uniform(&seed) * spread * 0.7);
    double begin = thread_seconds();
    for (int i = 0; i < QUERIES; i++) {
        double u = (double)start[i][0], v = (double)start[i][1];
        knurl_range found = knurl_heightmap_bounds(map, kind, u, v, u + width, v + height, KNURL_WRAP_REPEAT,
                                                   KNURL_WRAP_REPEAT, 0.0);
        *sum += found.max - found.min;
    }
    return 1e9 * (thread_seconds() - begin) / QUERIES;
}

static int bench_queries(int32_t size)
{
    knurl_context *context = NULL;
    knurl_context_def context_def = knurl_context_def_default();
    if (knurl_context_create(&context_def, &context, NULL) != KNURL_OK) return 4;
    knurl_heightmap_def def = knurl_heightmap_def_default();
    knurl_image *image = make_image(context, size);
    def.image = image;
    knurl_heightmap *map = NULL;
    if (!image || knurl_heightmap_create(context, &def, &map, NULL) != KNURL_OK) return 4;
    printf("texels        tightness (1: exact)   ns per query, anywhere    in a 128 x 128 window   across a "
           "border\n");
    printf("               minmax      rmip        minmax      rmip         minmax      rmip        minmax   "
           "rmip\n");
    double sum = 0.0;
    for (size_t i = 0; i < SHAPE_COUNT; i++) {
        enum { ROUNDS = 5 };
        double mean[2], ns[6][ROUNDS];
        if (SHAPES[i].width * 4 > size || SHAPES[i].height * 4 > size) continue;
        bench_tightness(map, &SHAPES[i], mean);
        for (int round = 0; round < ROUNDS; round++) {
            for (int kind = 0; kind < 2; kind++) {
                const knurl_bounds_kind k = (knurl_bounds_kind)kind;
                ns[kind][round] = query_ns(map, k, &SHAPES[i], 1.0, 0.001, &sum);
                ns[2 + kind][round] = query_ns(map, k, &SHAPES[i], 128.0 / size, 0.3, &sum);
                ns[4 + kind][round] = query_ns(map, k, &SHAPES[i], 2.0 / size, 3.0 - 1.5 / size, &sum);
            }
        }
        printf(
            "%4g x %-5g    %6.2f    %6.2f        %6.1f    %6.1f         %6.1f    %6.1f        %6.1f %6.1f\n",
            SHAPES[i].width, SHAPES[i].height, mean[0], mean[1], median(ns[0], ROUNDS), median(ns[1], ROUNDS),
            median(ns[2], ROUNDS), median(ns[3], ROUNDS), median(ns[4], ROUNDS), median(ns[5], ROUNDS));
    }
    printf("(checksum %.6g)\n", sum);
    knurl_heightmap_release(map);
    knurl_image_release(image);
    knurl_context_release(context);
    return 0;
}

int main(int argc, char **argv)
{
    int32_t size = argc > 1 ? (int32_t)strtol(argv[1], NULL, 10) : 4096;
    int rounds = argc > 2 ? (int)strtol(argv[2], NULL, 10) : 11;
    if (size < 16 || size > 32768 || rounds < 1) {
        fprintf(stderr, "usage: bench_bounds [size 16 to 32768] [rounds]\n");
        return 2;
    }
    printf("%d x %d, 16 bits, default cells; medians of %d interleaved rounds\n", size, size, rounds);
    int failed = bench_build(size, 1, rounds);
    if (!failed) failed = bench_build(size, 2, rounds);
    if (!failed) failed = bench_queries(size);
    return failed;
}
