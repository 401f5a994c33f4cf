/* Every method that claims to be exact against the oracle, over all scenes and ray families.
 *
 * KNURL_TRUTH_SCALE (default 0.02) scales the number of rays: 1 is 2 million rays of each method's default
 * parameters and a quarter of that for each variant. Missed and false hits must be zero; answers that only
 * rounding decides are counted and capped. Lines "scene,origin,direction,tmin,tmax" in the output can be
 * added to regressions.csv as they are. KNURL_TRUTH_SCENE and KNURL_TRUTH_METHOD: only that one. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "support/compare.h"
#include "support/rays.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { THREADS = 2, FULL_RAYS = 7000, PRINTED = 12 };

typedef struct variant {
    const char *method;
    double share; /* of the rays */
} variant;

/* Exact methods under test; a method joins by its line here. */
static const variant VARIANTS[] = {
    {"fast", 1.0},
    {"fast:budget=0", 0.25},
    {"fast:budget=0.05", 0.25},
    {"rmip", 1.0},
    {"rmip:inversion=off", 0.25},
    {"rmip:bounds=minmax", 0.25},
    {"rmip:marching-scale=1", 0.25},
    {"rmip:inversion=off:bounds=minmax:marching-scale=1", 0.25},
    {"tfdm", 0.5},
    {"tfdm:leaf-texels=8:boxes=normal", 0.25},
    {"tfdm:leaf-texels=32", 0.25},
};

enum { VARIANT_COUNT = sizeof VARIANTS / sizeof VARIANTS[0] };

static double truth_scale(void)
{
    const char *text = getenv("KNURL_TRUTH_SCALE");
    double scale = text ? strtod(text, NULL) : 0.02;
    return scale > 0.0 ? scale : 0.02;
}

/* ---- one scene and variant ---- */

typedef struct tally {
    uint64_t rays, hits, verdicts[5];
    uint64_t by_family[RAYS_FAMILIES][5];
    double *relative; /* |dt| / t of the hits */
    double worst_across;
    int printed;
} tally;

typedef struct job {
    const truth_scene *scene;
    const oracle *o;
    const traced *t;
    uint64_t rays_per_family;
    atomic_uint_fast64_t next;
    pthread_mutex_t lock;
    tally total;
} job;

static void count_ray(job *j, ray_family family, const oracle_ray *ray, const compare_result *r)
{
    tally *t = &j->total;
    t->rays++;
    t->verdicts[r->verdict]++;
    t->by_family[family][r->verdict]++;
    if (r->hit) {
        t->relative[t->hits++] = fabs(r->dt) / fmax(fabs(r->t), 1e-300);
        t->worst_across = fmax(t->worst_across, r->across);
    }
    if (r->verdict == COMPARE_UNSURE) compare_print_unsure(j->scene->name, j->o, ray, r);
    if (r->verdict > COMPARE_UNSURE && t->printed++ < PRINTED) compare_print(j->scene->name, j->o, ray, r);
}

static void *work(void *user)
{
    enum { BLOCK = 32 };
    job *j = user;
    uint64_t all = j->rays_per_family * RAYS_FAMILIES;
    compare_result results[BLOCK];
    oracle_ray rays[BLOCK];
    for (;;) {
        uint64_t begin = atomic_fetch_add(&j->next, BLOCK);
        if (begin >= all) return NULL;
        uint64_t end = begin + BLOCK < all ? begin + BLOCK : all;
        for (uint64_t i = begin; i < end; i++) {
            rays[i - begin] = ray_make(j->scene, j->o, (ray_family)(i % RAYS_FAMILIES), i / RAYS_FAMILIES);
            results[i - begin] = compare_ray(j->o, j->t, &rays[i - begin]);
        }
        pthread_mutex_lock(&j->lock);
        for (uint64_t i = begin; i < end; i++)
            count_ray(j, (ray_family)(i % RAYS_FAMILIES), &rays[i - begin], &results[i - begin]);
        pthread_mutex_unlock(&j->lock);
    }
}

static int compare_doubles(const void *p, const void *q)
{
    double a = *(const double *)p, b = *(const double *)q;
    return a < b ? -1 : a > b ? 1 : 0;
}

static void print_row(const job *j, const variant *v)
{
    const tally *t = &j->total;
    qsort(t->relative, t->hits, sizeof *t->relative, compare_doubles);
    double median = 0.0, high = 0.0, worst = 0.0;
    if (t->hits) {
        median = t->relative[t->hits / 2];
        high = t->relative[(t->hits - 1) * 99 / 100];
        worst = t->relative[t->hits - 1];
    }
    printf("%-18s %-32.32s %9llu %9llu %6llu %6llu %6llu %6llu  %8.1e %8.1e %8.1e %8.1e\n", j->scene->name,
           v->method, (unsigned long long)t->rays, (unsigned long long)t->hits,
           (unsigned long long)t->verdicts[COMPARE_MISSED], (unsigned long long)t->verdicts[COMPARE_FALSE],
           (unsigned long long)t->verdicts[COMPARE_OCCLUDED], (unsigned long long)t->verdicts[COMPARE_UNSURE],
           median, high, worst, t->worst_across / oracle_scale(j->o));
    for (int f = 0; f < RAYS_FAMILIES; f++) {
        const uint64_t *n = t->by_family[f];
        if (n[COMPARE_MISSED] + n[COMPARE_FALSE] + n[COMPARE_OCCLUDED] == 0) continue;
        printf("    %s: %llu missed, %llu false, %llu occluded\n", ray_family_name((ray_family)f),
               (unsigned long long)n[COMPARE_MISSED], (unsigned long long)n[COMPARE_FALSE],
               (unsigned long long)n[COMPARE_OCCLUDED]);
    }
    fflush(stdout);
}

/* Number of rays that disagree. */
static uint64_t run_variant(const truth_scene *scene, const oracle *o, const variant *v, tally *sum)
{
    traced t;
    assert_true(traced_make(&scene->def, v->method, 1, &t));
    job j = {.scene = scene, .o = o, .t = &t};
    double rays = FULL_RAYS * truth_scale() * v->share * (scene->wide ? 0.2 : 1.0);
    j.rays_per_family = rays < 8.0 ? 8 : (uint64_t)rays;
    j.total.relative = malloc((size_t)j.rays_per_family * RAYS_FAMILIES * sizeof(double));
    assert_non_null(j.total.relative);
    pthread_mutex_init(&j.lock, NULL);
    pthread_t threads[THREADS];
    for (int i = 0; i < THREADS; i++) assert_int_equal(pthread_create(&threads[i], NULL, work, &j), 0);
    for (int i = 0; i < THREADS; i++) pthread_join(threads[i], NULL);
    print_row(&j, v);
    for (int i = 0; i < 5; i++) sum->verdicts[i] += j.total.verdicts[i];
    sum->rays += j.total.rays;
    for (int f = 0; f < RAYS_FAMILIES; f++) {
        for (int i = 0; i < 5; i++) sum->by_family[f][i] += j.total.by_family[f][i];
    }
    pthread_mutex_destroy(&j.lock);
    free(j.total.relative);
    traced_free(&t);
    return j.total.verdicts[COMPARE_MISSED] + j.total.verdicts[COMPARE_FALSE] +
           j.total.verdicts[COMPARE_OCCLUDED];
}

static void print_families(const tally *sum)
{
    printf("\n%-14s %10s %8s %7s %7s %9s\n", "family", "rays", "unsure", "missed", "false", "occluded");
    for (int f = 0; f < RAYS_FAMILIES; f++) {
        uint64_t all = 0;
        for (int i = 0; i < 5; i++) all += sum->by_family[f][i];
        const uint64_t *n = sum->by_family[f];
        printf("%-14s %10llu %8llu %7llu %7llu %9llu\n", ray_family_name((ray_family)f),
               (unsigned long long)all, (unsigned long long)n[COMPARE_UNSURE],
               (unsigned long long)n[COMPARE_MISSED], (unsigned long long)n[COMPARE_FALSE],
               (unsigned long long)n[COMPARE_OCCLUDED]);
    }
}

/* Rounding hardly ever decides a ray that is not aimed at a tangency or a crease; of those that are, the
 * share that it may decide is capped too. */
static void assert_few_unsure(const tally *sum)
{
    for (int f = 0; f < RAYS_FAMILIES; f++) {
        bool aimed = f == RAYS_GRAZE_SURFACE || f == RAYS_AXIS || f == RAYS_AXIS_PLANE || f == RAYS_VERTEX ||
                     f == RAYS_EDGE || f == RAYS_TEXEL;
        uint64_t all = 0;
        for (int i = 0; i < 5; i++) all += sum->by_family[f][i];
        assert_true(sum->by_family[f][COMPARE_UNSURE] <= 1 + (aimed ? all * 6 / 100 : all / 5000));
    }
}

static bool scene_wanted(const char *name)
{
    const char *only = getenv("KNURL_TRUTH_SCENE");
    return !only || strcmp(only, name) == 0;
}

static bool method_wanted(const char *method)
{
    const char *only = getenv("KNURL_TRUTH_METHOD");
    return !only || strcmp(only, method) == 0;
}

static void agrees_with_the_oracle(void **state)
{
    (void)state;
    uint64_t wrong = 0;
    tally sum = {.rays = 0};
    printf("%-18s %-32s %9s %9s %6s %6s %6s %6s  %8s %8s %8s %8s\n", "scene", "method", "rays", "hits",
           "missed", "false", "occl.", "unsure", "dt/t 50%", "99%", "max", "across");
    for (int i = 0; i < truth_scene_count(); i++) {
        truth_scene scene;
        assert_true(truth_scene_make(i, &scene));
        if (scene_wanted(scene.name)) {
            oracle *o = oracle_create(&scene.def);
            assert_non_null(o);
            for (int v = 0; v < (int)VARIANT_COUNT; v++)
                if (method_wanted(VARIANTS[v].method)) wrong += run_variant(&scene, o, &VARIANTS[v], &sum);
            oracle_destroy(o);
        }
        truth_scene_free(&scene);
    }
    print_families(&sum);
    printf("%llu rays, %llu wrong, %llu decided by rounding\n", (unsigned long long)sum.rays,
           (unsigned long long)wrong, (unsigned long long)sum.verdicts[COMPARE_UNSURE]);
    assert_int_equal(wrong, 0);
    assert_few_unsure(&sum);
}

/* ---- rays that were wrong once ---- */

static bool parse_line(const char *line, char name[64], oracle_ray *ray)
{
    const char *comma = strchr(line, ',');
    if (!comma || line[0] == '#' || comma - line >= 64) return false;
    memcpy(name, line, (size_t)(comma - line));
    name[comma - line] = 0;
    double *field[8] = {&ray->origin[0],    &ray->origin[1],    &ray->origin[2], &ray->direction[0],
                        &ray->direction[1], &ray->direction[2], &ray->tmin,      &ray->tmax};
    const char *at = comma;
    for (int i = 0; i < 8; i++) {
        char *end;
        if (*at != ',') return false;
        *field[i] = strtod(at + 1, &end);
        if (end == at + 1) return false;
        at = end;
    }
    return true;
}

static uint64_t replay(const truth_scene *scene, const oracle *o, const variant *v, FILE *file,
                       uint64_t *rays)
{
    traced t;
    char line[512], name[64];
    uint64_t wrong = 0;
    assert_true(traced_make(&scene->def, v->method, 1, &t));
    rewind(file);
    while (fgets(line, sizeof line, file)) {
        oracle_ray ray;
        if (!parse_line(line, name, &ray) || strcmp(name, scene->name) != 0) continue;
        compare_result r = compare_ray(o, &t, &ray);
        *rays += 1;
        if (r.verdict <= COMPARE_UNSURE) continue;
        printf("%s: ", v->method);
        compare_print(scene->name, o, &ray, &r);
        wrong++;
    }
    traced_free(&t);
    return wrong;
}

static void regressions_stay_fixed(void **state)
{
    (void)state;
    FILE *file = fopen(KNURL_SOURCE_DIR "/tests/truth/regressions.csv", "r");
    assert_non_null(file);
    uint64_t wrong = 0, rays = 0;
    for (int i = 0; i < truth_scene_count(); i++) {
        truth_scene scene;
        assert_true(truth_scene_make(i, &scene));
        oracle *o = oracle_create(&scene.def);
        assert_non_null(o);
        for (int v = 0; v < (int)VARIANT_COUNT; v++) wrong += replay(&scene, o, &VARIANTS[v], file, &rays);
        oracle_destroy(o);
        truth_scene_free(&scene);
    }
    fclose(file);
    printf("%llu regressions, %llu wrong\n", (unsigned long long)rays, (unsigned long long)wrong);
    assert_true(rays > 0);
    assert_int_equal(wrong, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(regressions_stay_fixed),
        cmocka_unit_test(agrees_with_the_oracle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
