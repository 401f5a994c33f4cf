/* bench.h: inside of `knurl bench`: its options, the rays, what is measured, what is written. */
#ifndef APP_BENCH_H
#define APP_BENCH_H

#include "bench_statistics.h"
#include "common.h"

#include <jansson.h>
#include <stdio.h>

/* ---- options ---- */

typedef enum ray_kind {
    RAYS_PRIMARY = 0,
    RAYS_GRAZING,
    RAYS_DIFFUSE,
    RAYS_DIFFUSE_SHUFFLED,
    RAYS_OCCLUSION,
    RAYS_INSIDE,
    RAYS_INSIDE_SHUFFLED,
    RAYS_KINDS
} ray_kind;
extern const char *const ray_kind_names[RAYS_KINDS + 1]; /* NULL at the end */

/* How rays are handed to the library; bits. */
typedef enum call_kind { CALLS_SINGLE = 1, CALLS_BATCH = 2 } call_kind;

typedef struct bench_options {
    char **scenes;
    int scene_count;
    char **methods; /* specifications */
    int method_count;
    ray_kind kinds[RAYS_KINDS];
    int kind_count;
    unsigned calls; /* call_kind; 0: single calls on one thread, batches on all */
    const char *json, *csv, *heat_map, *reference, *camera;
    int rounds;
    size_t count; /* rays of a set */
    uint32_t seed;
    double lod;
    double lift;                                  /* of secondary rays' starts, in diagonals of the bounds */
    bool displaced_only;                          /* leave undisplaced meshes out */
    double disp_scale, tile_scale;                /* on top of the displacement options */
    int frame_width, frame_height, frame_samples; /* 0: no frames */
    int rmip_cell;                                /* 0: the library's default */
    general_options general;
    displacement_options displacement;
} bench_options;

/* Ends the program when the command line is wrong. Release with bench_options_free. */
void bench_options_parse(int argc, char **argv, bench_options *options);
void bench_options_free(bench_options *options);

/* ---- scenes, one copy for each method ---- */

/* A scene built for one method, in a context of its own, so that limits and bytes are the method's. */
typedef struct subject {
    const char *method; /* specification */
    uint32_t flags;     /* KNURL_METHOD_* */
    knurl_context *context;
    knurl_description *description;
    uint32_t instance_count; /* of the file; the description may have fewer in use */
    knurl_scene *scene;
    double build_ms; /* maps' structures, shells and hierarchy; not reading files */
    knurl_scene_memory memory;
    char failure[1024]; /* why there is no scene; empty if there is one */
} subject;

/* A failure of the description (a bad file) ends the command and is returned as an exit code; a method
 * that does not build is a CODE_DONE with `failure` set. */
int subject_open(command_session *session, const bench_options *options, const char *path, const char *method,
                 bool unnormalised, uint64_t memory_limit, subject *made);
void subject_close(subject *made);

/* ---- rays ---- */

typedef struct ray_set {
    knurl_ray *rays;
    size_t count;
    bool any_hit; /* whether, not where */
    int32_t width, height;
    uint32_t *pixels;  /* of each ray in an image of that size; primary rays only, else NULL */
    char failure[256]; /* why there are none; empty if there are some */
} ray_set;

/* Fills sets[kind] for every kind that the options ask for, from hits on `scene`. */
int ray_sets_make(command_session *session, const bench_options *options,
                  const knurl_description *description, const knurl_scene *scene, ray_set sets[RAYS_KINDS]);
void ray_sets_free(ray_set sets[RAYS_KINDS]);

/* ---- results ---- */

/* What is not known or does not exist is NaN. */
typedef struct bench_row {
    const char *scene, *method, *rays;
    int threads;
    const char *calls; /* "single", "batch"; NULL for pictures */
    size_t count;
    spread mrays;     /* of wall-clock time */
    double mrays_cpu; /* of the processor time of all threads, median */
    double frame_ms;
    step_statistics steps;
    double build_ms;
    bool has_memory;
    knurl_scene_memory memory;
    double missed, invented, dt_median, dt_p99;
    char reference[160]; /* empty: not compared */
    char failure[256];
} bench_row;

typedef struct heat_map {
    char *file;
    const char *scene, *method;
    uint32_t lowest, highest; /* steps that are black and white */
} heat_map;

typedef struct bench_results {
    bench_row *rows;
    size_t row_count, row_capacity;
    heat_map *maps;
    size_t map_count;
} bench_results;

/* Returns a row to fill, everything unknown; NULL when out of memory. */
bench_row *bench_results_add(bench_results *results);
void bench_results_free(bench_results *results);

/* JSON and CSV as the options say. */
int bench_results_save(command_session *session, const bench_options *options, const bench_results *results,
                       bool interrupted);
/* The table on standard output, or standard error if JSON or CSV goes there. */
FILE *bench_table_stream(const bench_options *options);
void bench_table_scene(FILE *out, const char *scene, const subject *rays_from);
void bench_table_subject(FILE *out, const subject *s, const char *reference);
void bench_table_rows(FILE *out, const bench_row *rows, size_t count, bool heading);

/* ---- measuring ---- */

/* Wall-clock time, and processor time of all threads, which a busy machine disturbs less. */
typedef struct run_time {
    double wall, processor;
} run_time;

/* Traces a set on one thread or on all of the context's: hits[i] or, of any-hit sets, occluded[i] is ray i's.
 * `taken` may be NULL. Returns an exit code. */
int bench_trace(command_session *session, const subject *s, const ray_set *set, call_kind calls, int threads,
                knurl_hit *hits, uint8_t *occluded, run_time *taken);

/* Everything about one scene file, appended to the results row by row. */
int bench_scene(command_session *session, const bench_options *options, const char *path,
                bench_results *results);

/* Pictures of `steps[m][i]`, the steps of method m on ray i, with one scale for all methods; NULL for
 * methods without. */
int heat_maps_save(command_session *session, const bench_options *options, const char *scene,
                   const ray_set *set, uint32_t *const *steps, bench_results *results);

/* Times path-traced frames of all subjects and adds their rows. */
int bench_frames(command_session *session, const bench_options *options, const char *path,
                 const subject *subjects, bench_results *results);

#endif
