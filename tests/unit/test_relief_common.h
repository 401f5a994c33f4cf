/* Small displaced meshes and random rays for the tests of methods that march through texture space. */
#ifndef KNURL_TESTS_RELIEF_COMMON_H
#define KNURL_TESTS_RELIEF_COMMON_H

#include "methods/method.h"
#include "support/random.h"

#include <knurl/knurl.h>

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CASE_VERTICES = 1024, CASE_TRIANGLES = 2048, CASE_TEXELS = 128 * 128 };

/* A mesh, a map and how it displaces; filled by the helpers below, then made into a surface. */
typedef struct relief_case {
    float positions[3 * CASE_VERTICES], normals[3 * CASE_VERTICES], directions[3 * CASE_VERTICES];
    float texcoords[2 * CASE_VERTICES];
    uint32_t triangles[3 * CASE_TRIANGLES];
    uint32_t vertex_count, triangle_count;
    bool with_directions;
    int32_t width, height;
    float samples[CASE_TEXELS];
    knurl_pixel_format format; /* F32, or U8 of the same values */
    double factor, offset, uv_scale, uv_rotation;
    knurl_wrap wrap_u, wrap_v;
} relief_case;

static inline void case_vertex(relief_case *c, vec3 p, vec3 n, double s, double t)
{
    uint32_t v = c->vertex_count++;
    vec3 unit = v3_normalize(n);
    float *at[3] = {c->positions + 3 * v, c->normals + 3 * v, c->directions + 3 * v};
    const vec3 value[3] = {p, unit, n};
    for (int k = 0; k < 3; k++) {
        at[k][0] = (float)value[k].x;
        at[k][1] = (float)value[k].y;
        at[k][2] = (float)value[k].z;
    }
    c->texcoords[2 * v] = (float)s;
    c->texcoords[2 * v + 1] = (float)t;
}

static inline void case_triangle(relief_case *c, uint32_t a, uint32_t b, uint32_t d)
{
    uint32_t *t = c->triangles + 3 * c->triangle_count++;
    t[0] = a;
    t[1] = b;
    t[2] = d;
}

/* A square of cells x cells quads, corner + u e + v f for u, v in [0, 1], texture coordinates (u, v); N
 * constant. */
static inline void case_square(relief_case *c, vec3 corner, vec3 e, vec3 f, int cells)
{
    uint32_t first = c->vertex_count, row = (uint32_t)cells + 1;
    vec3 n = v3_normalize(v3_cross(e, f));
    for (int j = 0; j <= cells; j++)
        for (int i = 0; i <= cells; i++) {
            double u = (double)i / cells, v = (double)j / cells;
            case_vertex(c, v3_mad(v3_mad(corner, u, e), v, f), n, u, v);
        }
    for (uint32_t j = 0; j < (uint32_t)cells; j++)
        for (uint32_t i = 0; i < (uint32_t)cells; i++) {
            uint32_t a = first + j * row + i;
            case_triangle(c, a, a + 1, a + row + 1);
            case_triangle(c, a, a + row + 1, a + row);
        }
}

/* Every N = k (apex - P): shells are frusta. */
static inline void case_converge(relief_case *c, vec3 apex, double k)
{
    c->with_directions = true;
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        vec3 n = v3_scale(v3_sub(apex, v3_loadf(c->positions + 3 * v)), k);
        c->directions[3 * v] = (float)n.x;
        c->directions[3 * v + 1] = (float)n.y;
        c->directions[3 * v + 2] = (float)n.z;
    }
}

/* Part of a unit sphere, latitudes within 60 degrees, with its normals; texture coordinates in [0, 1]. */
static inline void case_sphere(relief_case *c, int around, int across)
{
    const double pi = 3.14159265358979323846;
    for (int j = 0; j <= across; j++)
        for (int i = 0; i <= around; i++) {
            double u = (double)i / around, v = (double)j / across;
            double a = 2.0 * pi * u, b = pi / 3.0 * (1.0 - 2.0 * v);
            vec3 p = v3(cos(b) * cos(a), sin(b), -cos(b) * sin(a));
            case_vertex(c, p, p, u, v);
        }
    uint32_t row = (uint32_t)around + 1;
    for (uint32_t j = 0; j < (uint32_t)across; j++)
        for (uint32_t i = 0; i < (uint32_t)around; i++) {
            uint32_t a = j * row + i;
            case_triangle(c, a, a + row, a + row + 1);
            case_triangle(c, a, a + row + 1, a + 1);
        }
}

typedef enum case_map { MAP_NOISE = 0, MAP_SMOOTH, MAP_BLOCKS, MAP_SPIKES, MAP_KINDS } case_map;

static inline double map_value(case_map kind, random_state *r, double u, double v)
{
    const double tau = 6.28318530717958647692;
    switch (kind) {
    case MAP_SMOOTH:
        return 0.5 + 0.25 * sin(tau * u) * cos(tau * v) + 0.25 * sin(tau * (2.0 * u + v));
    case MAP_BLOCKS: {
        int i = (int)(u * 5.0), j = (int)(v * 4.0);
        return (double)((i * 7 + j * 5) % 4) / 3.0;
    }
    case MAP_SPIKES:
        return random_unit(r) < 0.03 ? 1.0 : 0.0;
    default:
        return random_unit(r);
    }
}

static inline void case_fill(relief_case *c, case_map kind, int32_t width, int32_t height, uint64_t seed)
{
    random_state r = {seed};
    c->width = width;
    c->height = height;
    for (int32_t y = 0; y < height; y++)
        for (int32_t x = 0; x < width; x++)
            c->samples[y * width + x] = (float)map_value(kind, &r, ((double)x + 0.5) / (double)width,
                                                         ((double)y + 0.5) / (double)height);
}

static inline relief_case *case_new(void)
{
    relief_case *c = calloc(1, sizeof *c);
    assert_non_null(c);
    c->format = KNURL_PIXEL_F32;
    c->factor = 0.2;
    c->uv_scale = 1.0;
    return c;
}

static inline knurl_context *case_context(int threads)
{
    knurl_context *context = NULL;
    knurl_context_def def = knurl_context_def_default();
    def.threads = threads;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

static inline knurl_heightmap *case_heightmap(knurl_context *context, const relief_case *c)
{
    knurl_image *image = NULL;
    knurl_heightmap *map = NULL;
    static uint8_t bytes[CASE_TEXELS];
    const void *samples = c->samples;
    if (c->format == KNURL_PIXEL_U8) {
        for (int i = 0; i < c->width * c->height; i++)
            bytes[i] = (uint8_t)((double)c->samples[i] * 255.0 + 0.5);
        samples = bytes;
    }
    assert_int_equal(knurl_image_create(context, c->width, c->height, 1, c->format, samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    return map;
}

static inline knurl_surface *case_surface(knurl_context *context, const relief_case *c,
                                          const char *specification)
{
    knurl_error error = {.message = ""};
    knurl_surface *surface = NULL;
    knurl_surface_def def = knurl_surface_def_default();
    def.mesh = (knurl_mesh_view){.positions = c->positions,
                                 .normals = c->normals,
                                 .texcoords = c->texcoords,
                                 .vertex_count = c->vertex_count,
                                 .triangles = c->triangles,
                                 .triangle_count = c->triangle_count,
                                 .directions = c->with_directions ? c->directions : NULL};
    def.displacement.map = case_heightmap(context, c);
    def.displacement.factor = c->factor;
    def.displacement.offset = c->offset;
    def.displacement.wrap_u = c->wrap_u;
    def.displacement.wrap_v = c->wrap_v;
    def.displacement.uv_scale[0] = def.displacement.uv_scale[1] = c->uv_scale;
    def.displacement.uv_rotation = c->uv_rotation;
    def.displacement.uv_offset[0] = -0.3 * (c->uv_scale - 1.0);
    def.method = specification;
    if (knurl_surface_create(context, &def, &surface, &error) != KNURL_OK) fail_msg("%s", error.message);
    knurl_heightmap_release(def.displacement.map);
    return surface;
}

/* Nearest hit of all shells. */
static inline bool surface_trace(const knurl_surface *surface, const knurl_ray *ray, knurl_hit *hit)
{
    knurl_ray part = *ray;
    bool found = false;
    hit->steps = 0;
    hit->triangle = KNURL_NO_HIT;
    for (uint32_t k = 0; k < knurl_surface_shell_count(surface); k++)
        if (knurl_surface_intersect(surface, k, &part, hit)) {
            found = true;
            part.tmax = hit->t;
        }
    return found;
}

/* Rays around a box: kind 0 from outside to a point inside, 1 from inside, 2 nearly along its x z
 * plane, 3 along an axis. One in four has a window [tmin, tmax]. */
static inline knurl_ray random_ray(random_state *r, vec3 lower, vec3 upper)
{
    vec3 size = v3_sub(upper, lower), center = v3_scale(v3_add(lower, upper), 0.5);
    vec3 inside = v3(random_range(r, lower.x, upper.x), random_range(r, lower.y, upper.y),
                     random_range(r, lower.z, upper.z));
    vec3 d =
        v3_normalize(v3(random_range(r, -1.0, 1.0), random_range(r, -1.0, 1.0), random_range(r, -1.0, 1.0)));
    uint32_t kind = random_index(r, 4);
    if (kind == 2) d.y *= 0.05 * random_unit(r);
    if (kind == 3) {
        uint32_t axis = random_index(r, 3);
        double sign = random_unit(r) < 0.5 ? 1.0 : -1.0;
        d = v3(axis == 0 ? sign : 0.0, axis == 1 ? sign : 0.0, axis == 2 ? sign : 0.0);
    }
    double length = exp(random_range(r, -2.0, 2.0));
    vec3 o = kind == 1 ? inside : v3_mad(inside, -2.0 * v3_length(size), d);
    if (kind == 0 && random_unit(r) < 0.1) o = v3_mad(center, 3.0 * v3_length(size), v3_neg(d));
    d = v3_scale(d, length);
    double origin[3], direction[3];
    v3_store(origin, o);
    v3_store(direction, d);
    knurl_ray ray = knurl_ray_make(origin, direction);
    if (random_unit(r) < 0.25) {
        double far = 4.0 * v3_length(size) / length;
        ray.tmin = random_range(r, 0.0, far);
        ray.tmax = ray.tmin + random_range(r, 0.0, far);
    }
    return ray;
}

/* How one method's hits differ from another's. */
typedef struct disagreement {
    uint64_t rays, hits, missed, added, moved; /* moved: t differs by more than the tolerance */
    uint64_t steps;
    double worst;
} disagreement;

static inline void count_ray(disagreement *d, const knurl_ray *ray, const knurl_surface *truth,
                             const knurl_surface *tested, double tolerance)
{
    knurl_hit a, b;
    bool hit_a = surface_trace(truth, ray, &a), hit_b = surface_trace(tested, ray, &b);
    d->rays++;
    d->hits += hit_a;
    d->missed += hit_a && !hit_b;
    d->added += hit_b && !hit_a;
    d->steps += b.steps;
    if (!hit_a || !hit_b) return;
    double away = fabs(a.t - b.t) * v3_length(v3_load(ray->direction));
    d->moved += away > tolerance;
    if (away <= tolerance && away > d->worst) d->worst = away;
}

static inline uint64_t wrong(const disagreement *d)
{
    return d->missed + d->added + d->moved;
}

static inline void surface_box(const knurl_surface *s, vec3 *lower, vec3 *upper)
{
    knurl_surface_info info;
    knurl_surface_get_info(s, &info);
    *lower = v3_load(info.lower);
    *upper = v3_load(info.upper);
}

static inline disagreement compare_methods(const relief_case *c, const char *exact, const char *other,
                                           float lod, uint64_t rays, double tolerance, uint64_t seed)
{
    knurl_context *context = case_context(1);
    knurl_surface *truth = case_surface(context, c, exact), *tested = case_surface(context, c, other);
    random_state r = {seed};
    disagreement d = {0};
    vec3 lower, upper;
    surface_box(truth, &lower, &upper);
    for (uint64_t k = 0; k < rays; k++) {
        knurl_ray ray = random_ray(&r, lower, upper);
        ray.lod = lod;
        count_ray(&d, &ray, truth, tested, tolerance);
    }
    knurl_surface_release(tested);
    knurl_surface_release(truth);
    knurl_context_release(context);
    return d;
}

static inline void print_disagreement(const char *what, const disagreement *d)
{
    printf("%-44s %7llu rays %7llu hits: %llu missed, %llu added, %llu moved; %.1f steps per ray\n", what,
           (unsigned long long)d->rays, (unsigned long long)d->hits, (unsigned long long)d->missed,
           (unsigned long long)d->added, (unsigned long long)d->moved, (double)d->steps / (double)d->rays);
}

static inline void add(disagreement *sum, const disagreement *d)
{
    sum->rays += d->rays;
    sum->hits += d->hits;
    sum->missed += d->missed;
    sum->added += d->added;
    sum->moved += d->moved;
    sum->steps += d->steps;
}

static inline relief_case *plane_case(int index)
{
    relief_case *c = case_new();
    case_square(c, v3(-1.0, 0.25, 1.0), v3(2.0, 0.1, 0.0), v3(0.0, 0.3, -2.0), 1 + index % 3);
    case_fill(c, (case_map)(index % MAP_KINDS), 9 + 5 * (index % 4), 16 + 3 * (index % 5),
              11u + (unsigned)index);
    c->format = index % 2 ? KNURL_PIXEL_U8 : KNURL_PIXEL_F32;
    c->factor = index % 5 == 4 ? -0.3 : 0.3;
    c->offset = index % 3 == 1 ? 0.1 : 0.0;
    c->wrap_u = (knurl_wrap)(index % 3);
    c->wrap_v = (knurl_wrap)(index / 3 % 3);
    c->uv_scale = index % 4 == 2 ? 2.7 : 1.0;
    c->uv_rotation = index % 4 == 3 ? 0.4 : 0.0;
    return c;
}

static inline relief_case *box_case(case_map kind)
{
    relief_case *c = case_new();
    const vec3 e[3] = {v3(1.0, 0.0, 0.0), v3(0.0, 1.0, 0.0), v3(0.0, 0.0, 1.0)};
    for (int axis = 0; axis < 3; axis++) {
        vec3 u = e[(axis + 1) % 3], v = e[(axis + 2) % 3];
        case_square(c, e[axis], u, v, 1);
        case_square(c, v3(0.0, 0.0, 0.0), v, u, 1);
    }
    case_fill(c, kind, 24, 20, 5);
    c->factor = 0.15;
    return c;
}

/* Directions that meet in a point above (k > 0) or below (k < 0) the base. */
static inline relief_case *frustum_case(int index)
{
    relief_case *c = case_new();
    case_square(c, v3(-1.0, 0.0, 1.0), v3(2.0, 0.0, 0.0), v3(0.0, 0.0, -2.0), 1 + index % 2);
    case_fill(c, (case_map)(index % MAP_KINDS), 21, 18, 40u + (unsigned)index);
    c->factor = index % 3 == 2 ? -0.8 : 0.8;
    if (index % 2)
        case_converge(c, v3(0.1, -2.0, 0.3), -0.47);
    else
        case_converge(c, v3(0.2, 1.7, -0.1), 0.61);
    return c;
}

typedef struct tracer {
    const knurl_surface *surface;
    knurl_hit *hits;
    int count;
} tracer;

static inline void *trace_all(void *user)
{
    tracer *t = user;
    random_state r = {5};
    vec3 lower, upper;
    surface_box(t->surface, &lower, &upper);
    for (int k = 0; k < t->count; k++) {
        knurl_ray ray = random_ray(&r, lower, upper);
        memset(&t->hits[k], 0, sizeof t->hits[k]);
        surface_trace(t->surface, &ray, &t->hits[k]);
    }
    return NULL;
}

/* Surfaces built with 1 and 4 threads, traced by 5 threads: the same hits to the last bit. */
static inline void check_threads(relief_case *c, const char *const *methods, size_t count)
{
    enum { RAYS = 400, THREADS = 4 };
    for (size_t m = 0; m < count; m++) {
        knurl_context *one = case_context(1), *four = case_context(4);
        knurl_surface *a = case_surface(one, c, methods[m]), *b = case_surface(four, c, methods[m]);
        knurl_hit *hits = calloc((THREADS + 1) * RAYS, sizeof *hits);
        tracer tracers[THREADS + 1];
        pthread_t threads[THREADS];
        assert_non_null(hits);
        for (int k = 0; k <= THREADS; k++) tracers[k] = (tracer){k ? b : a, hits + k * RAYS, RAYS};
        for (int k = 0; k < THREADS; k++)
            assert_int_equal(pthread_create(&threads[k], NULL, trace_all, &tracers[k + 1]), 0);
        trace_all(&tracers[0]);
        for (int k = 0; k < THREADS; k++) pthread_join(threads[k], NULL);
        for (int k = 1; k <= THREADS; k++) assert_memory_equal(hits, hits + k * RAYS, RAYS * sizeof *hits);
        free(hits);
        knurl_surface_release(a);
        knurl_surface_release(b);
        knurl_context_release(one);
        knurl_context_release(four);
    }
}

#endif
