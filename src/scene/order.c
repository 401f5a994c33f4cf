/* An order of many rays in which neighbours go alike: caches then hold what the next ray needs. */
#include "scene/scene.h"

#include <string.h>

/* A ray's key in the high half, its number in the low one. */
typedef struct order_job {
    const knurl_scene *scene;
    const knurl_ray *rays;
    uint64_t *entries;
} order_job;

/* Every third bit of the result is one of the low ten of x. */
static uint32_t spread3(uint32_t x)
{
    x &= 0x3ffu;
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

/* Every second bit of the result is one of the low sixteen of x. */
static uint32_t spread2(uint32_t x)
{
    x &= 0xffffu;
    x = (x | x << 8) & 0x00ff00ffu;
    x = (x | x << 4) & 0x0f0f0f0fu;
    x = (x | x << 2) & 0x33333333u;
    return (x | x << 1) & 0x55555555u;
}

/* x in [0, 1] as a whole number of `bits` bits. */
static uint32_t quantise(double x, int bits)
{
    double most = (double)((1 << bits) - 1), scaled = x * (most + 1.0);
    return scaled >= most ? (uint32_t)most : scaled > 0.0 ? (uint32_t)scaled : 0u;
}

/* Octahedral coordinates of a direction in [0, 1]^2 (Meyer et al. 2010). */
static void octahedral(vec3 d, double *u, double *v)
{
    double sum = fabs(d.x) + fabs(d.y) + fabs(d.z), x = d.x / sum, y = d.y / sum;
    if (d.z < 0.0) {
        double turned = (1.0 - fabs(y)) * copysign(1.0, x);
        y = (1.0 - fabs(x)) * copysign(1.0, y);
        x = turned;
    }
    *u = 0.5 * x + 0.5;
    *v = 0.5 * y + 0.5;
}

/* Where the ray enters the scene's bounds, 6 bits per axis along a Morton curve, then its direction, 7 bits
 * per coordinate likewise. */
static uint32_t ray_key(const accel_box *box, const knurl_ray *ray)
{
    vec3 o = v3_load(ray->origin), d = v3_load(ray->direction), inverse = v3_reciprocal(d);
    vec3 a = v3_mul(v3_sub(box->lower, o), inverse), b = v3_mul(v3_sub(box->upper, o), inverse);
    vec3 near = v3_min(a, b), size = v3_sub(box->upper, box->lower);
    double t = max_d(max_d(near.x, near.y), max_d(near.z, ray->tmin)), u, v;
    vec3 p = v3_sub(v3_mad(o, t, d), box->lower);
    uint32_t place = spread3(quantise(p.x / size.x, 6)) | spread3(quantise(p.y / size.y, 6)) << 1 |
                     spread3(quantise(p.z / size.z, 6)) << 2;
    octahedral(d, &u, &v);
    return place << 14 | spread2(quantise(u, 7)) | spread2(quantise(v, 7)) << 1;
}

static void make_keys(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const order_job *job = user;
    for (size_t i = begin; i < end; i++)
        job->entries[i] = (uint64_t)ray_key(&job->scene->box, &job->rays[i]) << 32 | i;
}

/* Whether rays come in an order that is as good: most are next to one that goes alike, or to one that starts
 * alike where rays start in many places. */
static bool is_ordered(const uint64_t *entries, size_t count)
{
    size_t alike = 0, moves = 0;
    for (size_t i = 1; i < count; i++) {
        uint32_t change = (uint32_t)((entries[i - 1] ^ entries[i]) >> 32);
        alike += change >> 6 == 0;
        moves += change >> 14 != 0;
    }
    return alike * 10 >= count * 6 || (moves * 50 >= count && moves * 5 <= count * 2);
}

/* By the high half; stable, so that the order is the same whatever the machine. */
static uint64_t *radix_sort(uint64_t *from, uint64_t *to, size_t count)
{
    enum { BITS = 11, BUCKETS = 1 << BITS };
    uint32_t starts[BUCKETS];
    for (int shift = 32; shift < 64; shift += BITS) {
        memset(starts, 0, sizeof starts);
        for (size_t i = 0; i < count; i++) starts[from[i] >> shift & (BUCKETS - 1)]++;
        uint32_t sum = 0;
        for (int k = 0; k < BUCKETS; k++) {
            uint32_t here = starts[k];
            starts[k] = sum;
            sum += here;
        }
        for (size_t i = 0; i < count; i++) to[starts[from[i] >> shift & (BUCKETS - 1)]++] = from[i];
        uint64_t *swap = from;
        from = to;
        to = swap;
    }
    return from;
}

const uint32_t *scene_order(const knurl_scene *scene, const knurl_ray *rays, size_t count, uint64_t *scratch)
{
    order_job job = {scene, rays, scratch};
    knurl_parallel_for(scene->context, count, KNURL_BATCH_BLOCK, make_keys, &job);
    if (is_ordered(scratch, count)) return NULL;
    uint64_t *sorted = radix_sort(scratch, scratch + count, count);
    /* The numbers alone, in place: each is written at or before where it is read. */
    uint32_t *order = (uint32_t *)(void *)sorted;
    for (size_t i = 0; i < count; i++) {
        uint32_t number = (uint32_t)sorted[i];
        memcpy(&order[i], &number, sizeof number);
    }
    return order;
}
