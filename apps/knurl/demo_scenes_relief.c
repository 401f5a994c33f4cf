/* Stand-ins for the height fields of Baboud and Decoret 2006 and of Kolb and Rezk-Salama 2005: two
 * triangles each. */
#include "demo_scenes.h"

#include "demo_noise.h"
#include "demo_pattern.h"

#include <stdlib.h>
#include <string.h>

/* A square of 2 m, seen from 45 degrees or from `rise` degrees above it. */
static void write_relief(demo_scene *scene, const char *name, demo_pattern pattern, double depth, double rise)
{
    demo_maps maps;
    demo_material material = demo_begin_material(scene, name, &pattern, &maps);
    material.wrap = DEMO_CLAMP;
    material.factor = depth;
    demo_mesh mesh = {0};
    demo_mesh_plane(&mesh, 2, 2, 1, 1);
    demo_add_thing(scene, name, &mesh, demo_add_material(scene, &material),
                   &(demo_place){{0, 0, 0}, {0, 1, 0}, 24, 0});
    demo_add_floor(scene, -0.001, 40, (double[]){0.22, 0.19, 0.16}, 0.7);
    demo_sky sky = demo_sky_noon(scene->seed, 110, 40);
    demo_add_sky(scene, &sky);
    double angle = rise * DEMO_PI / 180, away = 4.4;
    demo_add_camera(scene, &(demo_camera){.eye = {0, away * sin(angle), away * cos(angle)},
                                          .target = {0, 0.3 * depth, 0},
                                          .yfov = 27});
}

/* The texels along a side, which end the scene's name; what is finer is averaged. */
static demo_pattern at_named_size(const demo_scene *scene, demo_pattern pattern)
{
    const char *dash = strrchr(scene->name, '-');
    pattern.columns = pattern.rows = dash ? (int32_t)strtol(dash + 1, NULL, 10) : 256;
    pattern.oversample = 8;
    pattern.full_color = true;
    return pattern;
}

void demo_scene_terrain(demo_scene *scene)
{
    write_relief(scene, "terrain", at_named_size(scene, demo_mountains(scene->seed)), 0.55, 45);
}

void demo_scene_grid(demo_scene *scene)
{
    write_relief(scene, "grid", at_named_size(scene, demo_lattice(scene->seed)), 0.22, 45);
}

void demo_scene_relief_simple(demo_scene *scene)
{
    write_relief(scene, "hills", demo_hills(scene->seed), 0.45, 38);
}

void demo_scene_relief_spikes(demo_scene *scene)
{
    write_relief(scene, "spikes", demo_needles(scene->seed), 0.55, 38);
}
