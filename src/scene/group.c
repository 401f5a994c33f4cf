/* Groups of rays against a scene of few instances, each instance's rays handed over together. Every ray meets
 * the same instances in the same order and up to the same t as it would by itself. */
#include "scene/scene.h"

/* The rays that one instance is asked about, in its space. */
typedef struct gathered {
    knurl_ray rays[ACCEL_GROUP];
    accel_segment segments[ACCEL_GROUP];
    uint16_t index[ACCEL_GROUP]; /* of the ray in the group */
    bool found[ACCEL_GROUP];
    size_t count;
} gathered;

/* Makes the next place hold ray i as the instance sees it, and keeps it if it meets the bounds before
 * `tmax`. */
static inline void gather(gathered *g, const knurl_scene *scene, uint32_t number, const knurl_ray *ray,
                          size_t i, double tmax)
{
    const size_t at = g->count;
    if (!scene_prepare(scene, number, ray, &g->rays[at], &g->segments[at]) || g->segments[at].t0 > tmax)
        return;
    g->rays[at].tmax = tmax;
    g->index[at] = (uint16_t)i;
    g->count++;
}

/* ---- Nearest hits ----------------------------------------------------------------------------- */

typedef struct group {
    const knurl_scene *scene;
    const knurl_ray *rays;
    const uint32_t *order_in; /* numbers of the rays and hits, or NULL */
    knurl_hit *hits;
    size_t count;
    double t[ACCEL_GROUP];          /* nearest so far */
    uint32_t instance[ACCEL_GROUP]; /* of that, or KNURL_NO_HIT */
    uint32_t steps[ACCEL_GROUP];
    bool traceable[ACCEL_GROUP];
    uint8_t order[SCENE_FEW_INSTANCES][ACCEL_GROUP]; /* [rank][ray]: instances near to far */
    gathered local;
    knurl_hit found[ACCEL_GROUP];
} group;

static inline size_t number_of(const uint32_t *order, size_t i)
{
    return order ? order[i] : i;
}

static inline const knurl_ray *ray_of(const group *g, size_t i)
{
    return &g->rays[number_of(g->order_in, i)];
}

static void start(group *g)
{
    for (size_t i = 0; i < g->count; i++) {
        if (g->order_in && i + 12 < g->count) {
            const char *ahead = (const char *)ray_of(g, i + 12);
            __builtin_prefetch(ahead);
            __builtin_prefetch(ahead + 64);
        }
        g->t[i] = ray_of(g, i)->tmax;
        g->instance[i] = KNURL_NO_HIT;
        g->steps[i] = 0;
        g->traceable[i] = scene_can_trace(g->scene, ray_of(g, i));
    }
}

/* Asks an instance about the rays gathered for it. */
static void intersect_gathered(group *g, uint32_t number)
{
    gathered *local = &g->local;
    const accel_object *object = &g->scene->objects[g->scene->instances[number].object];
    accel_object_intersect_many(object, local->rays, local->segments, local->count, g->found, local->found);
    for (size_t k = 0; k < local->count; k++) {
        const size_t i = local->index[k];
        const knurl_hit *hit = &g->found[k];
        g->steps[i] += hit->steps;
        if (!local->found[k] || (hit->t == g->t[i] && number >= g->instance[i])) continue;
        g->t[i] = hit->t;
        g->instance[i] = number;
        g->hits[number_of(g->order_in, i)] = *hit;
    }
}

/* Near to far by where rays enter the instances' bounds; KNURL_NO_HIT's last byte where they miss them. */
static void find_order(group *g)
{
    const uint32_t instances = g->scene->instance_count;
    knurl_ray ray;
    accel_segment segment;
    for (size_t i = 0; i < g->count; i++) {
        double enters[SCENE_FEW_INSTANCES];
        uint32_t count = 0;
        for (uint32_t number = 0; g->traceable[i] && number < instances; number++) {
            if (!scene_prepare(g->scene, number, ray_of(g, i), &ray, &segment)) continue;
            uint32_t at = count++;
            for (; at > 0 && enters[at - 1] > segment.t0; at--) {
                enters[at] = enters[at - 1];
                g->order[at][i] = g->order[at - 1][i];
            }
            enters[at] = segment.t0;
            g->order[at][i] = (uint8_t)number;
        }
        for (; count < instances; count++) g->order[count][i] = (uint8_t)KNURL_NO_HIT;
    }
}

static void intersect_only(group *g)
{
    g->local.count = 0;
    for (size_t i = 0; i < g->count; i++)
        if (g->traceable[i]) gather(&g->local, g->scene, 0, ray_of(g, i), i, g->t[i]);
    intersect_gathered(g, 0);
}

static void intersect_few(group *g)
{
    find_order(g);
    const uint32_t instances = g->scene->instance_count;
    for (uint32_t rank = 0; rank < instances; rank++)
        for (uint32_t number = 0; number < instances; number++) {
            g->local.count = 0;
            for (size_t i = 0; i < g->count; i++)
                if (g->order[rank][i] == number)
                    gather(&g->local, g->scene, number, ray_of(g, i), i, g->t[i]);
            if (g->local.count > 0) intersect_gathered(g, number);
        }
}

void scene_intersect_group(const knurl_scene *scene, const knurl_ray *rays, const uint32_t *order,
                           size_t count, knurl_hit *hits)
{
    group g;
    g.scene = scene;
    g.rays = rays;
    g.order_in = order;
    g.hits = hits;
    g.count = count;
    start(&g);
    if (scene->instance_count == 1)
        intersect_only(&g);
    else
        intersect_few(&g);
    for (size_t i = 0; i < count; i++) {
        knurl_hit *hit = &hits[number_of(order, i)];
        if (g.instance[i] != KNURL_NO_HIT)
            scene_finish_hit(scene, g.instance[i], hit);
        else
            *hit = scene_no_hit;
        hit->steps = g.steps[i];
    }
}

/* ---- Any hit ---------------------------------------------------------------------------------- */

void scene_occluded_group(const knurl_scene *scene, const knurl_ray *rays, const uint32_t *order,
                          size_t count, uint8_t *occluded)
{
    gathered local;
    for (size_t i = 0; i < count; i++) occluded[number_of(order, i)] = 0;
    for (uint32_t number = 0; number < scene->instance_count; number++) {
        local.count = 0;
        for (size_t i = 0; i < count; i++) {
            const knurl_ray *ray = &rays[number_of(order, i)];
            if (!occluded[number_of(order, i)] && scene_can_trace(scene, ray))
                gather(&local, scene, number, ray, i, ray->tmax);
        }
        const accel_object *object = &scene->objects[scene->instances[number].object];
        accel_object_occluded_many(object, local.rays, local.segments, local.count, local.found);
        for (size_t k = 0; k < local.count; k++) occluded[number_of(order, local.index[k])] = local.found[k];
    }
}
