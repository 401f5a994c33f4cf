/* demo_scenes.h: the sample scenes' table and their parts. */
#ifndef KNURL_APPS_DEMO_SCENES_H
#define KNURL_APPS_DEMO_SCENES_H

#include "demo_map.h"

typedef struct demo_entry {
    const char *name;
    const char *summary; /* one line */
    void (*write)(demo_scene *scene);
    const char *group; /* NULL: a sample */
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

/* Stand-ins for the assets of papers' tables: as many base triangles, texels and tiles.
 * Group rmip: RMIP 2023, table 1. */
void demo_scene_alien_sphere(demo_scene *scene);
void demo_scene_wicker_basket(demo_scene *scene);
void demo_scene_creature(demo_scene *scene);
void demo_scene_diving_helmet(demo_scene *scene);
void demo_scene_medieval_helmet(demo_scene *scene);
void demo_scene_elven_armor(demo_scene *scene);
void demo_scene_ninja_head(demo_scene *scene);
void demo_scene_terracotta_roof(demo_scene *scene);
void demo_scene_desert_tire(demo_scene *scene);
void demo_scene_rough_glass(demo_scene *scene);

/* Group pdm: Projective Displacement Mapping 2025, table 1. */
void demo_scene_asteroid(demo_scene *scene);
void demo_scene_draped_mail(demo_scene *scene);
void demo_scene_leather_sphere(demo_scene *scene);
void demo_scene_orb(demo_scene *scene);
void demo_scene_tree_stump(demo_scene *scene);
void demo_scene_bamboo_dragon(demo_scene *scene);

/* Group baboud: Baboud and Decoret 2006, table 1. The scene's name ends in the map's texels. */
void demo_scene_terrain(demo_scene *scene);
void demo_scene_grid(demo_scene *scene);
/* Group kolb: Kolb and Rezk-Salama 2005, figure 9. */
void demo_scene_relief_simple(demo_scene *scene);
void demo_scene_relief_spikes(demo_scene *scene);

/* Writes a pattern's maps and starts a material that shows them; `maps` must live as long. */
demo_material demo_begin_material(demo_scene *scene, const char *name, const demo_pattern *pattern,
                                  demo_maps *maps);
/* A mesh of its own with a node. Releases the mesh. */
void demo_add_thing(demo_scene *scene, const char *name, demo_mesh *mesh, int material,
                    const demo_place *place);
/* A material without maps. */
int demo_add_paint(demo_scene *scene, const char *name, const double color[3], double metallic,
                   double roughness);

/* Skies, written as NAME of the scene's folder. Azimuth in degrees from -z to the right. */
demo_sky demo_sky_evening(uint32_t seed, double azimuth, double elevation);
demo_sky demo_sky_noon(uint32_t seed, double azimuth, double elevation);
demo_sky demo_sky_studio(uint32_t seed);
void demo_add_sky(demo_scene *scene, const demo_sky *sky);

/* A floor of plain material at height y. */
void demo_add_floor(demo_scene *scene, double y, double size, const double color[3], double roughness);

#endif
