/* demo_scenes.h: the sample scenes' table and their parts. */
#ifndef KNURL_APPS_DEMO_SCENES_H
#define KNURL_APPS_DEMO_SCENES_H

#include "demo_map.h"

typedef struct demo_entry {
    const char *name;
    const char *summary; /* one line */
    void (*write)(demo_scene *scene);
} demo_entry;

extern const demo_entry demo_entries[];
extern const int demo_entry_count;

void demo_scene_torus(demo_scene *scene);
void demo_scene_plane(demo_scene *scene);
void demo_scene_sphere(demo_scene *scene);
void demo_scene_box(demo_scene *scene);
void demo_scene_cobblestones(demo_scene *scene);
void demo_scene_basket(demo_scene *scene);
void demo_scene_spikes(demo_scene *scene);
void demo_scene_chainmail(demo_scene *scene);
void demo_scene_planet(demo_scene *scene);
void demo_scene_glass(demo_scene *scene);
void demo_scene_gallery(demo_scene *scene);

/* Skies, written as NAME of the scene's folder. Azimuth in degrees from -z to the right. */
demo_sky demo_sky_evening(uint32_t seed, double azimuth, double elevation);
demo_sky demo_sky_noon(uint32_t seed, double azimuth, double elevation);
demo_sky demo_sky_studio(uint32_t seed);
void demo_add_sky(demo_scene *scene, const demo_sky *sky);

/* A floor of plain material at height y. */
void demo_add_floor(demo_scene *scene, double y, double size, const double color[3], double roughness);

#endif
