/* One subject each: torus, plane, sphere, box, spikes, planet. */
#include "demo_scenes.h"

#include "demo_noise.h"
#include "demo_pattern.h"

#include <string.h>

void demo_scene_torus(demo_scene *scene)
{
    demo_pattern pattern = demo_knurling(scene->seed);
    demo_maps maps = demo_write_maps(scene, &pattern, "knurling");
    demo_material steel = demo_material_default("knurled steel");
    demo_use_maps(&steel, &maps);
    steel.factor = 0.05;
    steel.offset = -0.02;
    steel.tile[0] = 8;
    steel.tile[1] = 3;
    demo_mesh mesh = {0};
    demo_mesh_torus(&mesh, 1, 0.38, 48, 18);
    int ring = demo_add_mesh(scene, "ring", &mesh, demo_add_material(scene, &steel));
    demo_add_node(scene, "ring", ring, &(demo_place){.position = {0, 0.41, 0}});
    demo_add_floor(scene, 0, 40, (double[]){0.16, 0.15, 0.14}, 0.45);
    demo_sky sky = demo_sky_studio(scene->seed);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {1.2, 2.3, 3.4}, .target = {0, 0.3, 0}, .yfov = 32});
}

void demo_scene_plane(demo_scene *scene)
{
    demo_pattern pattern = demo_mountains(scene->seed);
    demo_maps maps = demo_write_maps(scene, &pattern, "mountains");
    demo_material land = demo_material_default("mountains");
    demo_use_maps(&land, &maps);
    land.factor = 1100;
    land.offset = -0.2 * 1100; /* the lake's level is 0 */
    demo_mesh mesh = {0};
    demo_mesh_plane(&mesh, 6000, 6000, 1, 1);
    demo_add_node(scene, "land", demo_add_mesh(scene, "land", &mesh, demo_add_material(scene, &land)), NULL);
    demo_sky sky = demo_sky_noon(scene->seed, -125, 30);
    /* Haze below the horizon, where the land ends. */
    memcpy(sky.ground, sky.horizon, sizeof sky.ground);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {300, 900, 3500}, .target = {0, 170, 0}, .yfov = 36});
}

void demo_scene_sphere(demo_scene *scene)
{
    demo_pattern pattern = demo_coral(scene->seed);
    demo_maps maps = demo_write_maps(scene, &pattern, "coral");
    demo_material coral = demo_material_default("coral");
    demo_use_maps(&coral, &maps);
    coral.factor = 0.11;
    coral.offset = -0.05;
    demo_mesh mesh = {0};
    demo_mesh_sphere(&mesh, 1, 30, 16);
    int ball = demo_add_mesh(scene, "ball", &mesh, demo_add_material(scene, &coral));
    demo_add_node(scene, "ball", ball, &(demo_place){{0, 1.0, 0}, {1, 0, 0.25}, -32, 0});
    demo_add_floor(scene, 0, 40, (double[]){0.24, 0.20, 0.155}, 0.8);
    demo_sky sky = demo_sky_noon(scene->seed, 140, 42);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.9, 1.9, 4.3}, .target = {0, 0.93, 0}, .yfov = 32});
}

static void add_box(demo_scene *scene, const char *name, const demo_box *box, const demo_material *material,
                    const demo_place *place)
{
    demo_mesh mesh = {0};
    demo_mesh_box(&mesh, box);
    demo_add_node(scene, name, demo_add_mesh(scene, name, &mesh, demo_add_material(scene, material)), place);
}

void demo_scene_box(demo_scene *scene)
{
    demo_pattern pattern = demo_rosette(scene->seed);
    demo_maps carved = demo_write_maps(scene, &pattern, "rosette");
    demo_material wood = demo_material_default("carved wood");
    demo_use_maps(&wood, &carved);
    /* Carved inwards from a frame at height 0: creased, and still closed. */
    wood.factor = 0.09;
    wood.offset = -0.09;
    demo_box crate = {.size = {1, 1, 1}, .divisions = 1, .side_extent = 1};
    add_box(scene, "carved", &crate, &wood, &(demo_place){{-1.3, 0.5, 0}, {0, 1, 0}, 28, 0});

    pattern = demo_hammered(scene->seed);
    demo_maps hammered = demo_write_maps(scene, &pattern, "hammered");
    demo_material copper = demo_material_default("hammered copper");
    demo_use_maps(&copper, &hammered);
    copper.factor = 0.055;
    copper.offset = -0.0275;
    demo_box pillow = {.size = {0.9, 0.9, 0.9}, .divisions = 2, .smooth = true, .side_extent = 1};
    add_box(scene, "pillow", &pillow, &copper, &(demo_place){{0.15, 0.46, -0.1}, {0, 1, 0}, -20, 0});

    /* The same carving pushed outwards: faces with normals of their own come apart at the edges. */
    demo_material burst = wood;
    burst.name = "carved wood, outwards";
    burst.offset = 0.04;
    demo_box small = {.size = {0.8, 0.8, 0.8}, .divisions = 1, .side_extent = 1};
    add_box(scene, "burst", &small, &burst, &(demo_place){{1.55, 0.54, 0.1}, {0, 1, 0}, 38, 0});
    demo_add_floor(scene, 0, 40, (double[]){0.34, 0.33, 0.32}, 0.6);
    demo_sky sky = demo_sky_studio(scene->seed);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.3, 1.9, 4.7}, .target = {0.14, 0.42, 0}, .yfov = 31});
}

void demo_scene_spikes(demo_scene *scene)
{
    demo_pattern pattern = demo_urchin(scene->seed);
    demo_maps maps = demo_write_maps(scene, &pattern, "urchin");
    demo_material shell = demo_material_default("urchin");
    demo_use_maps(&shell, &maps);
    shell.wrap = DEMO_CLAMP;
    shell.factor = 0.8;
    demo_mesh mesh = {0};
    demo_mesh_octasphere(&mesh, 0.8, 8);
    int urchin = demo_add_mesh(scene, "urchin", &mesh, demo_add_material(scene, &shell));
    demo_add_node(scene, "urchin", urchin, &(demo_place){{0, 1.4, 0}, {1, 0, 0}, 35, 0});
    demo_add_floor(scene, 0, 40, (double[]){0.30, 0.25, 0.18}, 0.7);
    demo_sky sky = demo_sky_noon(scene->seed, -130, 48);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0, 2.3, 6}, .target = {0, 1.25, 0}, .yfov = 32});
}

void demo_scene_planet(demo_scene *scene)
{
    demo_pattern pattern = demo_earth(scene->seed);
    demo_maps maps = demo_write_maps(scene, &pattern, "planet");
    demo_material land = demo_material_default("planet");
    demo_use_maps(&land, &maps);
    land.wrap = DEMO_CLAMP;
    land.factor = 130;
    land.offset = -0.16 * 130; /* the sea's level is the sphere's */
    demo_mesh mesh = {0};
    demo_mesh_octasphere(&mesh, 1000, 12);
    int planet = demo_add_mesh(scene, "planet", &mesh, demo_add_material(scene, &land));
    demo_add_node(scene, "planet", planet, &(demo_place){{0, 0, 0}, {0.8, 0.6, 0}, 34, 0});

    pattern = demo_moon(scene->seed);
    pattern.columns = pattern.rows = 512;
    demo_maps moon_maps = demo_write_maps(scene, &pattern, "moon");
    demo_material rock = demo_material_default("moon");
    demo_use_maps(&rock, &moon_maps);
    rock.wrap = DEMO_CLAMP;
    rock.factor = 40;
    rock.offset = -0.6 * 40;
    demo_mesh_octasphere(&mesh, 210, 6);
    int moon = demo_add_mesh(scene, "moon", &mesh, demo_add_material(scene, &rock));
    demo_add_node(scene, "moon", moon, &(demo_place){.position = {1560, 520, -500}});

    demo_sky sky = {.sun = {0, 1, 0},
                    .sun_radius = 1,
                    .stars = 0.5,
                    .seed = scene->seed,
                    .zenith = {0.003, 0.004, 0.007},
                    .horizon = {0.003, 0.004, 0.007},
                    .ground = {0.003, 0.004, 0.007}};
    demo_add_sky(scene, &sky);
    demo_add_sun(scene, (double[]){0.52, -0.38, -0.765}, (double[]){1, 0.95, 0.88}, 3.4);
    demo_add_camera(scene, &(demo_camera){.eye = {300, 450, 3900}, .target = {400, 40, 0}, .yfov = 35});
}
