/* render/trace.h: rays into the scene, counted and timed; holes by alpha; where rays start. */
#ifndef KNURL_SRC_RENDER_TRACE_H
#define KNURL_SRC_RENDER_TRACE_H

#include "render/sampler.h"
#include "render/world.h"

typedef enum ray_class { RAY_PRIMARY = 0, RAY_SCATTERED, RAY_SHADOW, RAY_CLASSES } ray_class;

/* One per thread. */
typedef struct trace_stats {
    uint64_t count[RAY_CLASSES];
    uint64_t timed[RAY_CLASSES]; /* calls measured, every 64th */
    double seconds[RAY_CLASSES]; /* of those */
    uint64_t primary_steps;
    char padding[64]; /* threads do not share cache lines */
} trace_stats;

/* What an integrator works with for one sample of one pixel. */
typedef struct trace {
    const world *world;
    trace_stats *stats;
    sampler sampler;
    uint32_t segment; /* rays so far; decorrelates decisions about holes */
} trace;

/* Nearest surface that does not let the ray pass. Behind each hole the ray is replaced by one that
 * starts there, so that *ray and *hit belong together; hit->steps is the sum over all pieces. */
bool trace_nearest(trace *t, ray_class kind, knurl_ray *ray, knurl_hit *hit);
/* Whether light on its way along [0, distance] meets a surface that stops it. */
bool trace_occluded(trace *t, knurl_ray *ray);

/* Width of the ray's cone that decided the level of detail of what it hit. */
double trace_cone_width(const world *w, const knurl_ray *ray, const knurl_hit *hit);

/* A ray that leaves the hit on the side of `side` . ng > 0, and cannot meet that point again. */
knurl_ray trace_leave(const world *w, const knurl_hit *hit, vec3 side, vec3 direction, double cone_width,
                      double cone_spread);

#endif
