/* bench_rays.c: the rays that `knurl bench` traces. They depend on the scene, the camera, the count and the
 * seed, not on the methods. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double TURN = 6.283185307179586;

/* ---- random numbers and vectors ---- */

typedef struct random_state {
    uint64_t state;
} random_state;

/* SplitMix64 */
static uint64_t next_bits(random_state *random)
{
    uint64_t z = random->state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static random_state random_for(const bench_options *options, ray_kind kind)
{
    random_state random = {((uint64_t)options->seed << 8 | (uint64_t)kind) * 0xd1342543de82ef95u};
    (void)next_bits(&random);
    return random;
}

static double next_unit(random_state *random)
{
    return (double)(next_bits(random) >> 11) * 0x1p-53; /* [0, 1) */
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void normalize(double v[3])
{
    double length = sqrt(dot(v, v));
    for (int i = 0; i < 3; i++) v[i] /= length;
}

/* direction = x * (two axes across n, at the angle `phi`) + z * n */
static void around(const double n[3], double x, double z, double phi, double direction[3])
{
    double s = copysign(1.0, n[2]), a = -1.0 / (s + n[2]), b = n[0] * n[1] * a;
    double u[3] = {1 + s * n[0] * n[0] * a, s * b, -s * n[0]}, v[3] = {b, s + n[1] * n[1] * a, -n[1]};
    for (int i = 0; i < 3; i++) direction[i] = x * (cos(phi) * u[i] + sin(phi) * v[i]) + z * n[i];
    normalize(direction);
}

/* ---- memory ---- */

static int fail_memory(command_session *session)
{
    return session_fail_with(session, CODE_LIMIT, "out of memory for the rays");
}

static bool set_allocate(ray_set *set, size_t count)
{
    set->count = count;
    set->rays = malloc(count * sizeof *set->rays);
    return set->rays != NULL;
}

void ray_sets_free(ray_set sets[RAYS_KINDS])
{
    for (int i = 0; i < RAYS_KINDS; i++) {
        free(sets[i].rays);
        free(sets[i].pixels);
    }
    memset(sets, 0, RAYS_KINDS * sizeof *sets);
}

/* ---- camera rays ---- */

enum { TILE_BITS = 3, TILE = 1 << TILE_BITS };

/* A 16:9 picture of about `count` pixels, whole tiles. */
static void choose_size(size_t count, int32_t *width, int32_t *height)
{
    double w = sqrt((double)count * 16 / 9) / TILE;
    *width = TILE * (w < 1 ? 1 : (int32_t)(w + 0.5));
    *height = TILE * (int32_t)((double)count / *width / TILE);
    if (*height < TILE) *height = TILE;
}

/* Pixel of the i-th ray: tiles by rows, in each tile a Morton curve. */
static uint32_t pixel_of(size_t i, int32_t width)
{
    size_t tiles = (size_t)width / TILE, tile = i / (TILE * TILE);
    size_t x = tile % tiles * TILE, y = tile / tiles * TILE;
    for (int bit = 0; bit < TILE_BITS; bit++) {
        x += (i >> (2 * bit) & 1) << bit;
        y += (i >> (2 * bit + 1) & 1) << bit;
    }
    return (uint32_t)(y * (size_t)width + x);
}

static int make_primary(command_session *session, const bench_options *options,
                        const knurl_description *description, const knurl_scene *scene, ray_set *set)
{
    int32_t camera = -1;
    int code = camera_find(session, description, options->camera, &camera);
    if (code != CODE_DONE) return code;
    choose_size(options->count, &set->width, &set->height);
    size_t count = (size_t)set->width * (size_t)set->height;
    knurl_ray *rows = malloc(count * sizeof *rows);
    set->pixels = malloc(count * sizeof *set->pixels);
    knurl_error error = {0};
    if (!rows || !set->pixels || !set_allocate(set, count)) {
        code = fail_memory(session);
    } else if (knurl_camera_rays(description, scene, camera, set->width, set->height, rows, &error) !=
               KNURL_OK) {
        code = session_fail(session, &error);
    } else {
        for (size_t i = 0; i < count; i++) {
            set->pixels[i] = pixel_of(i, set->width);
            set->rays[i] = rows[set->pixels[i]];
            set->rays[i].lod = (float)options->lod;
        }
    }
    free(rows);
    return code;
}

/* ---- rays that leave the surface ---- */

/* Where a camera ray met the surface. */
typedef struct start_point {
    double position[3], normal[3]; /* the geometric normal, towards the camera */
    double offset;                 /* along the normal, of rays that start here */
} start_point;

typedef struct start_points {
    start_point *points;
    size_t count;
} start_points;

/* The diagonal of the scene's bounds. */
static double diagonal_of(const knurl_scene *scene)
{
    double lower[3], upper[3], extent[3];
    knurl_scene_bounds(scene, lower, upper);
    for (int i = 0; i < 3; i++) extent[i] = upper[i] - lower[i];
    return sqrt(dot(extent, extent));
}

/* Twice the bound on the hit's error, as the renderer's rays do, and the lift. */
static int find_starts(command_session *session, const bench_options *options, const knurl_scene *scene,
                       const ray_set *primary, start_points *starts)
{
    const double lift = options->lift > 0 ? options->lift * diagonal_of(scene) : 0;
    knurl_hit *hits = malloc(primary->count * sizeof *hits);
    starts->points = malloc(primary->count * sizeof *starts->points);
    knurl_error error = {0};
    int code = CODE_DONE;
    if (!hits || !starts->points)
        code = fail_memory(session);
    else if (knurl_scene_intersect_batch(scene, primary->rays, primary->count, hits, progress_update,
                                         &session->progress, NULL, &error) != KNURL_OK)
        code = session_fail(session, &error);
    for (size_t i = 0; code == CODE_DONE && i < primary->count; i++) {
        if (hits[i].triangle == KNURL_NO_HIT) continue;
        start_point *point = &starts->points[starts->count++];
        double side = dot(hits[i].ng, primary->rays[i].direction) > 0 ? -1 : 1;
        for (int axis = 0; axis < 3; axis++) {
            point->position[axis] = hits[i].position[axis];
            point->normal[axis] = side * hits[i].ng[axis];
        }
        point->offset = 2 * hits[i].error + lift;
    }
    free(hits);
    return code;
}

static knurl_ray leave(const bench_options *options, const start_point *start, const double direction[3])
{
    double origin[3];
    for (int i = 0; i < 3; i++) origin[i] = start->position[i] + start->offset * start->normal[i];
    knurl_ray ray = knurl_ray_make(origin, direction);
    ray.lod = (float)options->lod;
    return ray;
}

/* Towards the sky, y up: a cosine distribution, turned to the side that the surface can see. */
static knurl_ray towards_sky(const bench_options *options, const start_point *start, random_state *random)
{
    static const double up[3] = {0, 1, 0};
    double direction[3], sine2 = next_unit(random);
    around(up, sqrt(sine2), sqrt(1 - sine2), TURN * next_unit(random), direction);
    double below = dot(direction, start->normal);
    for (int i = 0; i < 3 && below < 0; i++) direction[i] -= 2 * below * start->normal[i];
    return leave(options, start, direction);
}

/* Towards a light of the scene; false if the surface faces away from it. */
static bool towards_light(const bench_options *options, const start_point *start,
                          const knurl_description_light *light, knurl_ray *ray)
{
    const double *m = light->transform;
    double direction[3], distance = INFINITY;
    for (int i = 0; i < 3; i++)
        direction[i] =
            light->kind == KNURL_LIGHT_DIRECTIONAL ? m[4 * i + 2] : m[4 * i + 3] - start->position[i];
    if (light->kind != KNURL_LIGHT_DIRECTIONAL) distance = sqrt(dot(direction, direction));
    normalize(direction);
    *ray = leave(options, start, direction);
    ray->tmax = distance;
    return distance > 0 && dot(direction, start->normal) > 0;
}

static void make_occlusion(const bench_options *options, const knurl_description *description,
                           const start_points *starts, ray_set *set)
{
    random_state random = random_for(options, RAYS_OCCLUSION);
    size_t wanted = set->count;
    set->any_hit = true;
    set->count = 0;
    for (size_t i = 0; i < wanted; i++) {
        const start_point *start = &starts->points[i * starts->count / wanted];
        knurl_ray *ray = &set->rays[set->count];
        if (description->light_count == 0) {
            *ray = towards_sky(options, start, &random);
            set->count++;
        } else {
            set->count +=
                towards_light(options, start, &description->lights[i % description->light_count], ray);
        }
    }
    if (set->count == 0)
        snprintf(set->failure, sizeof set->failure, "nothing that the camera sees faces a light");
}

static void make_bounces(const bench_options *options, const start_points *starts, ray_kind kind,
                         ray_set *set)
{
    /* The same directions for both, so that a shuffled set is the ordered one shuffled. */
    random_state random = random_for(options, kind == RAYS_DIFFUSE_SHUFFLED ? RAYS_DIFFUSE : kind);
    for (size_t i = 0; i < set->count; i++) {
        const start_point *start = &starts->points[i * starts->count / set->count];
        double direction[3], phi = TURN * next_unit(&random), x = next_unit(&random);
        if (kind == RAYS_GRAZING) {
            double elevation = x * TURN / 72; /* 0 to 5 degrees */
            around(start->normal, cos(elevation), sin(elevation), phi, direction);
        } else {
            around(start->normal, sqrt(x), sqrt(1 - x), phi, direction);
        }
        set->rays[i] = leave(options, start, direction);
    }
}

/* ---- rays from inside ---- */

static uint32_t even_bits(uint64_t code)
{
    uint32_t bits = 0;
    for (int i = 0; i < 26; i++) bits |= (uint32_t)(code >> (2 * i) & 1) << i;
    return bits;
}

/* Directions all around the centre, along a Morton curve over the octahedral map. */
static void make_inside(const bench_options *options, const knurl_scene *scene, ray_set *set)
{
    random_state random = random_for(options, RAYS_INSIDE);
    double lower[3], upper[3], origin[3];
    knurl_scene_bounds(scene, lower, upper);
    for (int i = 0; i < 3; i++) origin[i] = 0.5 * (lower[i] + upper[i]);
    for (size_t i = 0; i < set->count; i++) {
        uint64_t code = (uint64_t)((double)i / (double)set->count * 0x1p52);
        double x = (even_bits(code) + next_unit(&random)) * 0x1p-25 - 1;
        double y = (even_bits(code >> 1) + next_unit(&random)) * 0x1p-25 - 1;
        double direction[3] = {x, y, 1 - fabs(x) - fabs(y)};
        if (direction[2] < 0) {
            direction[0] = copysign(1 - fabs(y), x);
            direction[1] = copysign(1 - fabs(x), y);
        }
        normalize(direction);
        set->rays[i] = knurl_ray_make(origin, direction);
        set->rays[i].lod = (float)options->lod;
    }
}

/* Rays that leave a scene cost next to nothing and say nothing; closed ones may have cracks along seams. */
static int check_closed(command_session *session, const knurl_scene *scene, ray_set *set)
{
    knurl_hit *hits = malloc(set->count * sizeof *hits);
    if (!hits) return fail_memory(session);
    knurl_error error = {0};
    size_t left = 0;
    int code = CODE_DONE;
    if (knurl_scene_intersect_batch(scene, set->rays, set->count, hits, progress_update, &session->progress,
                                    NULL, &error) != KNURL_OK)
        code = session_fail(session, &error);
    for (size_t i = 0; code == CODE_DONE && i < set->count; i++) left += hits[i].triangle == KNURL_NO_HIT;
    if (left > set->count / 100)
        snprintf(set->failure, sizeof set->failure,
                 "the scene is not closed: %zu of %zu rays from its centre hit nothing", left, set->count);
    free(hits);
    return code;
}

/* ---- all of them ---- */

static void shuffle(const bench_options *options, ray_kind kind, ray_set *set)
{
    random_state random = random_for(options, kind);
    for (size_t i = set->count; i > 1; i--) {
        size_t other = next_bits(&random) % i;
        knurl_ray kept = set->rays[i - 1];
        set->rays[i - 1] = set->rays[other];
        set->rays[other] = kept;
    }
}

static int make_set(command_session *session, const bench_options *options,
                    const knurl_description *description, const knurl_scene *scene,
                    const start_points *starts, ray_kind kind, ray_set *set)
{
    bool leaves = kind != RAYS_INSIDE && kind != RAYS_INSIDE_SHUFFLED;
    if (leaves && starts->count == 0) {
        set->any_hit = kind == RAYS_OCCLUSION;
        snprintf(set->failure, sizeof set->failure, "no camera ray hits anything to start from");
        return CODE_DONE;
    }
    if (!set_allocate(set, options->count)) return fail_memory(session);
    if (kind == RAYS_OCCLUSION)
        make_occlusion(options, description, starts, set);
    else if (leaves)
        make_bounces(options, starts, kind, set);
    else
        make_inside(options, scene, set);
    if (!leaves) {
        int code = check_closed(session, scene, set);
        if (code != CODE_DONE) return code;
    }
    if (kind == RAYS_DIFFUSE_SHUFFLED || kind == RAYS_INSIDE_SHUFFLED) shuffle(options, kind, set);
    return CODE_DONE;
}

int ray_sets_make(command_session *session, const bench_options *options,
                  const knurl_description *description, const knurl_scene *scene, ray_set sets[RAYS_KINDS])
{
    start_points starts = {0};
    memset(sets, 0, RAYS_KINDS * sizeof *sets);
    int code = make_primary(session, options, description, scene, &sets[RAYS_PRIMARY]);
    if (code == CODE_DONE) code = find_starts(session, options, scene, &sets[RAYS_PRIMARY], &starts);
    for (int i = 0; i < options->kind_count && code == CODE_DONE; i++) {
        ray_kind kind = options->kinds[i];
        if (kind != RAYS_PRIMARY)
            code = make_set(session, options, description, scene, &starts, kind, &sets[kind]);
    }
    free(starts.points);
    return code;
}
