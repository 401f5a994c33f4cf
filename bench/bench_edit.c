/* What an edit of a height map costs until rays see it: 256 x 256 texels of 16-bit maps of several sizes on a
 * sphere of 900 triangles, tiled once and 8 x 8, by step, on one thread.
 *
 *     bench_edit [method] [edit] [rounds]
 */
#include <knurl/knurl.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { COLUMNS = 30, ROWS = 16, MAX_EDIT = 1024, MAX_ROUNDS = 1001, STEPS = 4 };

static const double PI = 3.14159265358979323846;

static double thread_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

static uint32_t next_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(*state >> 32);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Waves of several octaves, turned by `phase`. */
static double relief(double x, double y, double phase)
{
    double sum = 0.0, weight = 0.5;
    for (int octave = 1; octave < 7; octave++, weight *= 0.55) {
        double f = 2.0 * PI * (double)(2 << octave);
        sum += weight * sin(f * x + 0.3 * sin(f * y) + octave + phase) * cos(f * y + octave * octave);
    }
    return 0.5 + 0.35 * sum;
}

typedef struct sphere {
    float positions[3 * (COLUMNS + 1) * (ROWS + 1)], texcoords[2 * (COLUMNS + 1) * (ROWS + 1)];
    uint32_t triangles[6 * COLUMNS * ROWS], triangle_count;
} sphere;

static void make_sphere(sphere *s)
{
    for (int j = 0; j <= ROWS; j++)
        for (int i = 0; i <= COLUMNS; i++) {
            double theta = PI * j / ROWS, phi = 2.0 * PI * (i % COLUMNS) / COLUMNS;
            float *p = s->positions + 3 * (j * (COLUMNS + 1) + i),
                  *t = s->texcoords + 2 * (j * (COLUMNS + 1) + i);
            p[0] = (float)(sin(theta) * cos(phi));
            p[1] = (float)cos(theta);
            p[2] = (float)(sin(theta) * sin(phi));
            t[0] = (float)i / COLUMNS;
            t[1] = (float)j / ROWS;
        }
    s->triangle_count = 0;
    for (uint32_t j = 0; j < ROWS; j++)
        for (uint32_t i = 0; i < COLUMNS; i++) {
            uint32_t a = j * (COLUMNS + 1) + i, b = a + 1, c = a + COLUMNS + 1, d = c + 1;
            const uint32_t both[6] = {a, b, d, a, d, c};
            for (uint32_t half = j == 0; half < (j < ROWS - 1 ? 2u : 1u); half++)
                memcpy(s->triangles + 3 * s->triangle_count++, both + 3 * half, 3 * sizeof *both);
        }
}

static knurl_image *make_image(knurl_context *context, int32_t size)
{
    uint16_t *samples = malloc((size_t)size * (size_t)size * sizeof *samples);
    if (!samples) return NULL;
    for (int32_t y = 0; y < size; y++)
        for (int32_t x = 0; x < size; x++)
            samples[(size_t)y * (size_t)size + (size_t)x] =
                (uint16_t)(65535.0 * relief((double)x / size, (double)y / size, 0.0));
    knurl_image *image = NULL;
    (void)knurl_image_create(context, size, size, 1, KNURL_PIXEL_U16, samples, &image, NULL);
    free(samples);
    return image;
}

typedef struct subject {
    knurl_heightmap *map;
    knurl_surface *surface;
    knurl_scene *scene;
} subject;

static knurl_status make_subject(knurl_context *context, const sphere *s, const knurl_image *image,
                                 double tiling, const char *method, subject *made, knurl_error *error)
{
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    knurl_status status = knurl_heightmap_create(context, &map_def, &made->map, error);
    knurl_surface_def def = knurl_surface_def_default();
    def.method = method;
    def.mesh.positions = def.mesh.normals = s->positions;
    def.mesh.texcoords = s->texcoords;
    def.mesh.vertex_count = (COLUMNS + 1) * (ROWS + 1);
    def.mesh.triangles = s->triangles;
    def.mesh.triangle_count = s->triangle_count;
    def.displacement.map = made->map;
    def.displacement.factor = 0.03;
    def.displacement.uv_scale[0] = def.displacement.uv_scale[1] = tiling;
    if (status == KNURL_OK) status = knurl_surface_create(context, &def, &made->surface, error);
    if (status == KNURL_OK) status = knurl_scene_create(context, &made->scene, error);
    if (status == KNURL_OK) status = knurl_scene_add_surface(made->scene, made->surface, NULL, error);
    if (status == KNURL_OK) status = knurl_scene_add_instance(made->scene, 0, NULL, UINT32_MAX, NULL, error);
    if (status == KNURL_OK) status = knurl_scene_commit(made->scene, error);
    return status;
}

/* Milliseconds of map, surface, scene, all. */
static knurl_status edit_once(const subject *s, int32_t x, int32_t y, int32_t side, const uint16_t *samples,
                              double ms[STEPS], knurl_error *error)
{
    double t[4] = {thread_ms(), 0.0, 0.0, 0.0};
    knurl_status status =
        knurl_heightmap_update(s->map, x, y, side, side, samples, (size_t)side * sizeof *samples, error);
    t[1] = thread_ms();
    if (status == KNURL_OK) status = knurl_surface_update(s->surface, x, y, side, side, error);
    t[2] = thread_ms();
    if (status == KNURL_OK) status = knurl_scene_update(s->scene, 0, error);
    t[3] = thread_ms();
    for (int i = 0; i < 3; i++) ms[i] = t[i + 1] - t[i];
    ms[3] = t[3] - t[0];
    return status;
}

static knurl_status bench(const subject *s, int32_t size, double tiling, int32_t side, int rounds,
                          knurl_error *error)
{
    static uint16_t samples[MAX_EDIT * MAX_EDIT];
    static double ms[STEPS][MAX_ROUNDS];
    uint64_t seed = 11;
    for (int round = 0; round < rounds; round++) {
        int32_t x = (int32_t)(next_random(&seed) % (uint32_t)(size - side + 1));
        int32_t y = (int32_t)(next_random(&seed) % (uint32_t)(size - side + 1));
        double phase = next_random(&seed) * 0x1p-28;
        for (int32_t j = 0; j < side; j++)
            for (int32_t i = 0; i < side; i++)
                samples[j * side + i] =
                    (uint16_t)(65535.0 * relief((double)(x + i) / size, (double)(y + j) / size, phase));
        double one[STEPS];
        knurl_status status = edit_once(s, x, y, side, samples, one, error);
        if (status != KNURL_OK) return status;
        for (int i = 0; i < STEPS; i++) ms[i][round] = one[i];
    }
    for (int i = 0; i < STEPS; i++) qsort(ms[i], (size_t)rounds, sizeof ms[i][0], compare);
    printf("%5d   %2g x %-2g  %7.3f  %7.3f  %7.3f   %7.3f  (%.3f to %.3f)\n", size, tiling, tiling,
           ms[0][rounds / 2], ms[1][rounds / 2], ms[2][rounds / 2], ms[3][rounds / 2], ms[3][0],
           ms[3][rounds - 1]);
    return KNURL_OK;
}

int main(int argc, char **argv)
{
    const char *method = argc > 1 ? argv[1] : "fast";
    int32_t side = argc > 2 ? (int32_t)strtol(argv[2], NULL, 10) : 256;
    int rounds = argc > 3 ? (int)strtol(argv[3], NULL, 10) : 41;
    if (side < 1 || side > MAX_EDIT || rounds < 1 || rounds > MAX_ROUNDS) {
        fprintf(stderr, "usage: bench_edit [method] [edit 1 to %d] [rounds 1 to %d]\n", MAX_EDIT, MAX_ROUNDS);
        return 2;
    }
    static sphere mesh;
    make_sphere(&mesh);
    knurl_error error = {0};
    knurl_context *context = NULL;
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    knurl_status status = knurl_context_create(&def, &context, &error);
    printf("%s, %u triangles, edits of %d x %d texels; milliseconds, medians of %d\n", method,
           mesh.triangle_count, side, side, rounds);
    printf(" size   tiling       map  surface    scene       all\n");
    static const int32_t sizes[] = {1024, 2048, 4096};
    static const double tilings[] = {1.0, 8.0};
    for (size_t i = 0; i < 3 && status == KNURL_OK; i++) {
        knurl_image *image = make_image(context, sizes[i]);
        for (size_t k = 0; k < 2 && image && status == KNURL_OK; k++) {
            subject s = {0};
            status = make_subject(context, &mesh, image, tilings[k], method, &s, &error);
            if (status == KNURL_OK) status = bench(&s, sizes[i], tilings[k], side, rounds, &error);
            knurl_scene_release(s.scene);
            knurl_surface_release(s.surface);
            knurl_heightmap_release(s.map);
        }
        knurl_image_release(image);
    }
    if (status != KNURL_OK) fprintf(stderr, "bench_edit: %s\n", error.message);
    knurl_context_release(context);
    return status == KNURL_OK ? 0 : 4;
}
