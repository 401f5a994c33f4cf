/* support/scenes.h: small scenes made in code for the comparison with the oracle. */
#ifndef KNURL_TESTS_SCENES_H
#define KNURL_TESTS_SCENES_H

#include "oracle.h"

typedef struct truth_scene {
    const char *name;
    oracle_def def;   /* points into arrays that the scene owns */
    double center[3]; /* of the base mesh */
    double size;      /* length by which rays are scaled: about the base's radius */
    bool wide;        /* a shell of 10^5 texels: rays that run along it would take the oracle a second
                         each and are left out */
    bool closed;      /* the displaced surface has no open edge */
} truth_scene;

int truth_scene_count(void);
/* false when out of memory. */
bool truth_scene_make(int index, truth_scene *scene);
void truth_scene_free(truth_scene *scene);

/* Low-poly torus with a chart that wraps both ways; height in units of the tube's radius 0.4. */
bool truth_torus_make(truth_scene *scene, const char *name, int around, int across, double factor,
                      double offset, double place);

#endif
