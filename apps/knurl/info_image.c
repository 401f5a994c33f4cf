/* info_image.c: what `knurl info` says about images and height maps. */
#include "info.h"
#include "parallel.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- samples ---- */

static json_t *describe_channels(const knurl_image *image)
{
    json_t *list = json_array();
    for (int32_t c = 0; c < knurl_image_channels(image); c++) {
        double lowest = INFINITY, highest = -INFINITY, sum = 0;
        uint64_t finite = 0, other = 0;
        for (int32_t y = 0; y < knurl_image_height(image); y++) {
            for (int32_t x = 0; x < knurl_image_width(image); x++) {
                double value = (double)knurl_image_value(image, x, y, c);
                if (!isfinite(value)) {
                    other++;
                    continue;
                }
                finite++;
                sum += value;
                if (value < lowest) lowest = value;
                if (value > highest) highest = value;
            }
        }
        json_array_append_new(list, json_pack("{s:o, s:o, s:o, s:o}", "min", json_number(lowest), "max",
                                              json_number(highest), "mean", json_number(sum / (double)finite),
                                              "not_finite", json_count(other)));
    }
    return list;
}

/* ---- timing ---- */

enum { ROUNDS = 9, COPY_CHUNK = 1 << 18 };

typedef struct copy_job {
    unsigned char *to;
    const unsigned char *from;
    size_t size;
} copy_job;

static void copy_chunk(void *user, size_t chunk)
{
    copy_job *job = user;
    size_t begin = chunk * COPY_CHUNK;
    size_t size = job->size - begin < COPY_CHUNK ? job->size - begin : COPY_CHUNK;
    memcpy(job->to + begin, job->from + begin, size);
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, compare_doubles);
    return values[count / 2];
}

/* Builds the bounds and copies the samples by turns, both on all threads, so that whatever else the
 * machine does falls on both alike. */
static int measure(command_session *session, const knurl_heightmap_def *def, json_t **timing)
{
    double build[ROUNDS], create[ROUNDS], copy[ROUNDS];
    const knurl_image *image = def->image;
    size_t size = (size_t)knurl_image_width(image) * (size_t)knurl_image_height(image) *
                  (size_t)knurl_image_format(image);
    /* One channel's worth of bytes, which is what the map holds. */
    copy_job job = {malloc(size), knurl_image_samples(image), size};
    if (!job.to) return session_fail_with(session, CODE_LIMIT, "out of memory for the timing");
    memset(job.to, 1, size);
    for (int round = 0; round < ROUNDS; round++) {
        if (signals_stop_requested()) {
            free(job.to);
            return session_fail_with(session, CODE_INTERRUPTED, "interrupted");
        }
        double start = seconds_now();
        parallel_chunks(knurl_context_threads(session->context), (size + COPY_CHUNK - 1) / COPY_CHUNK,
                        copy_chunk, &job);
        double middle = seconds_now();
        knurl_heightmap *map = NULL;
        knurl_error error = {0};
        if (knurl_heightmap_create(session->context, def, &map, &error) != KNURL_OK) {
            free(job.to);
            return session_fail(session, &error);
        }
        copy[round] = (middle - start) * 1e3;
        create[round] = (seconds_now() - middle) * 1e3;
        build[round] = knurl_heightmap_build_ms(map);
        knurl_heightmap_release(map);
    }
    free(job.to);
    double build_ms = median(build, ROUNDS), copy_ms = median(copy, ROUNDS);
    *timing = json_pack("{s:i, s:i, s:o, s:o, s:o, s:o, s:o}", "rounds", (int)ROUNDS, "threads",
                        (int)knurl_context_threads(session->context), "copied_bytes", json_count(size),
                        "copy_ms", json_number(copy_ms), "bounds_ms", json_number(build_ms), "create_ms",
                        json_number(median(create, ROUNDS)), "ratio", json_number(build_ms / copy_ms));
    return CODE_DONE;
}

/* ---- the map ---- */

/* Facets of a tiled map are told as an estimate, and not made. */
static bool is_not_facets(const char *method)
{
    int32_t index = 0;
    return method && knurl_method_check(method, &index, NULL) == KNURL_OK &&
           !(knurl_method_flags(index) & KNURL_METHOD_NATIVE);
}

/* The map on a unit square, tiled: what a surface that uses it costs. */
static knurl_status measure_use(command_session *session, knurl_heightmap *map, const info_options *options,
                                knurl_surface_info *info, knurl_error *error)
{
    static const float positions[12] = {0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1};
    static const float normals[12] = {0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};
    static const float texcoords[8] = {0, 0, 1, 0, 1, 1, 0, 1};
    static const uint32_t triangles[6] = {0, 2, 1, 0, 3, 2};
    knurl_surface_def def = knurl_surface_def_default();
    if (is_not_facets(options->method.method)) def.method = options->method.method;
    def.mesh = (knurl_mesh_view){positions, normals, texcoords, 4, triangles, 2, NULL};
    def.displacement = knurl_displacement_default();
    def.displacement.map = map;
    if (!isnan(options->displacement.tile_u)) {
        def.displacement.uv_scale[0] = options->displacement.tile_u;
        def.displacement.uv_scale[1] = options->displacement.tile_v;
    }
    knurl_surface *surface = NULL;
    knurl_status status = knurl_surface_create(session->context, &def, &surface, error);
    if (status != KNURL_OK) return status;
    knurl_surface_get_info(surface, info);
    knurl_surface_release(surface);
    return KNURL_OK;
}

static json_t *describe_map(command_session *session, const info_options *options, knurl_heightmap *map,
                            knurl_error *error)
{
    knurl_surface_info use;
    if (measure_use(session, map, options, &use, error) != KNURL_OK) return NULL;
    knurl_heightmap_bytes bytes = knurl_heightmap_memory(map);
    knurl_range range = knurl_heightmap_range(map);
    double tile_u = isnan(options->displacement.tile_u) ? 1 : options->displacement.tile_u;
    double tile_v = isnan(options->displacement.tile_v) ? 1 : options->displacement.tile_v;
    json_t *sizes = json_pack("{s:o, s:o, s:o, s:o, s:o, s:o}", "samples", json_count(bytes.samples),
                              "levels", json_count(bytes.levels), "minmax", json_count(bytes.minmax), "rmip",
                              json_count(bytes.rmip), "blocks", json_count(bytes.blocks), "total",
                              json_count(use.map_bytes));
    json_t *tiled = json_pack("{s:o, s:o, s:o, s:o, s:o}", "u", json_number(tile_u), "v", json_number(tile_v),
                              "texels", json_number(use.texels), "map_bytes", json_count(use.map_bytes),
                              "tessellated_bytes", json_count(use.tessellated_bytes));
    return json_pack("{s:i, s:o, s:o, s:o, s:o}", "levels", (int)knurl_heightmap_levels(map), "range",
                     json_numbers((const double[]){range.min, range.max}, 2), "bytes", sizes, "build_ms",
                     json_number(knurl_heightmap_build_ms(map)), "tiled", tiled);
}

static int gather_map(command_session *session, const info_options *options, const knurl_image *image,
                      json_t *root)
{
    knurl_error error = {0};
    knurl_heightmap_def def = heightmap_def_from(&options->method);
    def.image = image;
    knurl_heightmap *map = NULL;
    knurl_status status = knurl_heightmap_create(session->context, &def, &map, &error);
    if (status == KNURL_ERROR_INPUT) { /* not finite: an image all the same */
        json_object_set_new(root, "map", json_null());
        json_object_set_new(root, "map_error", json_text(error.message));
        return CODE_DONE;
    }
    if (status != KNURL_OK) return session_fail(session, &error);
    json_t *described = describe_map(session, options, map, &error);
    knurl_heightmap_release(map);
    if (!described) return session_fail(session, &error);
    json_object_set_new(root, "map", described);
    json_t *timing = NULL;
    int code = options->timing ? measure(session, &def, &timing) : CODE_DONE;
    if (timing) json_object_set_new(root, "timing", timing);
    return code;
}

int info_gather_image(command_session *session, const info_options *options, json_t **root)
{
    knurl_error error = {0};
    knurl_image *image = NULL;
    if (knurl_image_load(session->context, options->path, &image, &error) != KNURL_OK)
        return session_fail(session, &error);
    static const char *const formats[] = {
        [KNURL_PIXEL_U8] = "u8", [KNURL_PIXEL_U16] = "u16", [KNURL_PIXEL_F32] = "f32"};
    knurl_pixel_format format = knurl_image_format(image);
    *root =
        json_pack("{s:s, s:s, s:o, s:i, s:i, s:i, s:s, s:i, s:o}", "knurl", KNURL_VERSION_STRING, "kind",
                  "image", "path", json_text(options->path), "width", (int)knurl_image_width(image), "height",
                  (int)knurl_image_height(image), "channels", (int)knurl_image_channels(image), "format",
                  formats[format], "bits", 8 * (int)format, "channel_ranges", describe_channels(image));
    int code = *root ? gather_map(session, options, image, *root)
                     : session_fail_with(session, CODE_LIMIT, "out of memory for the results");
    knurl_image_release(image);
    if (code != CODE_DONE) {
        json_decref(*root);
        *root = NULL;
    }
    return code;
}

/* ---- text ---- */

static void print_map(const json_t *map)
{
    const json_t *bytes = json_object_get(map, "bytes"), *tiled = json_object_get(map, "tiled");
    const json_t *range = json_object_get(map, "range");
    static const char *const keys[] = {"samples", "levels", "minmax", "rmip", "blocks", "total"};
    static const char *const meanings[] = {
        "level 0",    "coarser levels of detail",           "min-max pyramid",
        "RMIP table", "tiles of samples with their bounds", ""};
    char text[32], other[32];
    printf("as a height map (red channel): %d levels, values %g to %g, bounds built in %.2f ms\n",
           (int)info_number(map, "levels"), json_number_value(json_array_get(range, 0)),
           json_number_value(json_array_get(range, 1)), info_number(map, "build_ms"));
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        if (info_number(bytes, keys[i]) > 0) /* not what only other methods use */
            printf("  %-8s %12s  %s\n", keys[i], format_bytes(text, info_number(bytes, keys[i])),
                   meanings[i]);
    printf("tiled %g x %g on a square: %s texels in %s; tessellated at one vertex per texel: %s\n",
           info_number(tiled, "u"), info_number(tiled, "v"),
           info_count_text((char[32]){0}, info_number(tiled, "texels")),
           format_bytes(text, info_number(tiled, "map_bytes")),
           format_bytes(other, info_number(tiled, "tessellated_bytes")));
}

void info_print_image(const json_t *root)
{
    printf("%s: %d x %d, %d channel%s, %s\n", info_text(root, "path"), (int)info_number(root, "width"),
           (int)info_number(root, "height"), (int)info_number(root, "channels"),
           info_number(root, "channels") > 1 ? "s" : "", info_text(root, "format"));
    const json_t *ranges = json_object_get(root, "channel_ranges");
    for (size_t i = 0; i < json_array_size(ranges); i++) {
        const json_t *range = json_array_get(ranges, i);
        printf("channel %zu: %g to %g, mean %g", i, info_number(range, "min"), info_number(range, "max"),
               info_number(range, "mean"));
        if (info_number(range, "not_finite") > 0)
            printf(", %.0f not finite", info_number(range, "not_finite"));
        putchar('\n');
    }
    const json_t *map = json_object_get(root, "map");
    if (json_is_object(map))
        print_map(map);
    else
        printf("not usable as a height map: %s\n", info_text(root, "map_error"));
    const json_t *timing = json_object_get(root, "timing");
    if (!timing) return;
    char bytes[32];
    printf("timing (medians of %d rounds, %d threads): bounds %.3f ms, copying %s %.3f ms, ratio %.2f; whole "
           "map %.3f ms\n",
           (int)info_number(timing, "rounds"), (int)info_number(timing, "threads"),
           info_number(timing, "bounds_ms"), format_bytes(bytes, info_number(timing, "copied_bytes")),
           info_number(timing, "copy_ms"), info_number(timing, "ratio"), info_number(timing, "create_ms"));
}
