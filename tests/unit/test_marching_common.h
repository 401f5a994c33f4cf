/* Error of a marching method against an exact one, over the scenes and rays of the comparison with the
 * oracle. */
#ifndef KNURL_TESTS_MARCHING_COMMON_H
#define KNURL_TESTS_MARCHING_COMMON_H

#include "support/rays.h"
#include "support/traced.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct marching_error {
    int rays, hits;       /* hits: both methods have one */
    int missed, invented; /* only the exact one, only the other one has a hit */
    int contradicted;     /* occluded() is not what intersect() finds */
    double median, p90;   /* of |dt| |D|, in scene sizes */
    double steps;         /* mean */
} marching_error;

static inline bool marching_scene(const char *name, truth_scene *scene)
{
    for (int i = 0; i < truth_scene_count(); i++) {
        if (!truth_scene_make(i, scene)) return false;
        if (strcmp(scene->name, name) == 0) return true;
        truth_scene_free(scene);
    }
    return false;
}

static inline int marching_order(const void *p, const void *q)
{
    double a = *(const double *)p, b = *(const double *)q;
    return a < b ? -1 : a > b ? 1 : 0;
}

static inline double marching_length(const double d[3])
{
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

enum { MARCHING_RAYS = 200 }; /* of each family */

/* Rays along the surface are left out: a marching method may well miss it there. */
static inline bool marching_family(int family)
{
    return family != RAYS_GRAZE_BASE && family != RAYS_GRAZE_SURFACE;
}

static inline void marching_ray(const truth_scene *scene, const oracle *o, const traced *exact,
                                const traced *tested, int family, int index, marching_error *e, double *dt)
{
    oracle_ray made = ray_make(scene, o, (ray_family)family, (uint64_t)index);
    knurl_ray ray = traced_ray(exact, &made);
    knurl_hit a = {0}, b = {0};
    bool in_a = knurl_scene_intersect(exact->scene, &ray, &a);
    bool in_b = knurl_scene_intersect(tested->scene, &ray, &b);
    e->rays++;
    e->steps += b.steps;
    e->missed += in_a && !in_b;
    e->invented += in_b && !in_a;
    e->contradicted += knurl_scene_occluded(tested->scene, &ray) != in_b;
    if (in_a && in_b) dt[e->hits++] = fabs(a.t - b.t) * marching_length(ray.direction) / scene->size;
}

/* `family` < 0: all of them. Prints what it finds. */
static inline bool marching_measure(const truth_scene *scene, const char *method, int family,
                                    marching_error *e)
{
    traced exact, tested;
    oracle *o = oracle_create(&scene->def);
    double *dt = malloc(sizeof *dt * MARCHING_RAYS * RAYS_FAMILIES);
    memset(e, 0, sizeof *e);
    if (!o || !dt || !traced_make(&scene->def, "rmip", 1, &exact)) return false;
    if (!traced_make(&scene->def, method, 1, &tested)) return false;
    for (int f = 0; f < RAYS_FAMILIES; f++)
        for (int i = 0; i < MARCHING_RAYS && marching_family(f) && (family < 0 || f == family); i++)
            marching_ray(scene, o, &exact, &tested, f, i, e, dt);
    qsort(dt, (size_t)e->hits, sizeof *dt, marching_order);
    e->steps /= e->rays;
    if (e->hits) {
        e->median = dt[e->hits / 2];
        e->p90 = dt[e->hits * 9 / 10];
    }
    printf("%-14s %-36s rays %d hits %d missed %d false %d median %.2e p90 %.2e steps %.1f\n", scene->name,
           method, e->rays, e->hits, e->missed, e->invented, e->median, e->p90, e->steps);
    free(dt);
    traced_free(&exact);
    traced_free(&tested);
    oracle_destroy(o);
    return true;
}

#endif
