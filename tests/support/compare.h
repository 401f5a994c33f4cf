/* support/compare.h: judging knurl's answer for one ray by the oracle's roots. */
#ifndef KNURL_TESTS_COMPARE_H
#define KNURL_TESTS_COMPARE_H

#include "traced.h"

enum { COMPARE_ROOTS = 64 };

typedef enum compare_verdict {
    COMPARE_AGREE = 0,
    COMPARE_UNSURE,  /* the answers differ, and rounding may decide either way: the ray runs within rounding
                        of a tangency, a crease, an open edge or the border of [tmin, tmax] */
    COMPARE_MISSED,  /* a proven root before knurl's answer */
    COMPARE_FALSE,   /* knurl's hit is not on the surface */
    COMPARE_OCCLUDED /* occluded() contradicts intersect() although nothing is in doubt */
} compare_verdict;

typedef struct compare_result {
    compare_verdict verdict;
    bool hit;      /* both have a hit, and the same one */
    double t, dt;  /* oracle's t and knurl's difference from it, if hit */
    double across; /* |dt| |D| cosine: how far apart the hits are across the surface, if hit */
    double gap;    /* unless it agrees: how near the surface comes to the ray there, object-space length */
    oracle_root roots[COMPARE_ROOTS];
    int count;
    knurl_hit answer;
} compare_result;

/* Rounding that is allowed to either side, as a part of the surface's diagonal. */
#define COMPARE_ROUNDING 1e-9

compare_result compare_ray(const oracle *o, const traced *t, const oracle_ray *ray);
/* Distance between the ray's point at the hit's t and the surface at the hit's barycentrics; infinite if
 * those are more than 1e-9 outside of the triangle. */
double compare_off_surface(const oracle *o, const oracle_ray *ray, const knurl_hit *hit);
const char *compare_name(compare_verdict verdict);
/* One line: the ray and why rounding decides it. */
void compare_print_unsure(const char *scene, const oracle *o, const oracle_ray *ray,
                          const compare_result *result);
/* One line that test_truth can replay (scene and ray), then lines with both answers. */
void compare_print(const char *scene, const oracle *o, const oracle_ray *ray, const compare_result *result);

#endif
