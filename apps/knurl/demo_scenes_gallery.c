/* The gallery: a courtyard in the evening sun. */
#include "demo_scenes.h"

#include "demo_noise.h"
#include "demo_pattern.h"

#include <string.h>

/* Writes a pattern's maps and adds a material that shows them. */
static int add_material(demo_scene *scene, const char *name, demo_pattern pattern, double factor,
                        double offset, double tile_u, double tile_v)
{
    demo_maps maps;
    demo_material material = demo_begin_material(scene, name, &pattern, &maps);
    material.factor = factor;
    material.offset = offset;
    material.tile[0] = tile_u;
    material.tile[1] = tile_v;
    return demo_add_material(scene, &material);
}

static void add(demo_scene *scene, const char *name, demo_mesh *mesh, int material, demo_place place)
{
    demo_add_thing(scene, name, mesh, material, &place);
}

static void add_courtyard(demo_scene *scene)
{
    demo_mesh mesh = {0};
    int cobbles = add_material(scene, "cobbles", demo_cobbles(scene->seed), 0.075, -0.058, 13, 13);
    demo_mesh_plane(&mesh, 17, 17, 4, 4);
    add(scene, "floor", &mesh, cobbles, (demo_place){.position = {0, 0, 0}});
    int masonry = add_material(scene, "masonry", demo_masonry(scene->seed), 0.17, -0.10, 9, 1);
    demo_mesh_plane(&mesh, 16.2, 1.8, 8, 1);
    add(scene, "wall", &mesh, masonry, (demo_place){{0, 0.88, -2.7}, {1, 0, 0}, 90, 0});
}

static void add_ring_and_moon(demo_scene *scene)
{
    demo_mesh mesh = {0};
    int bronze = add_material(scene, "bronze", demo_frieze(scene->seed), 0.075, -0.03, 11, 1);
    demo_mesh_torus(&mesh, 0.95, 0.21, 48, 18);
    add(scene, "ring", &mesh, bronze, (demo_place){{-0.15, 1.16, -0.75}, {1, 0, 0}, 90, 20});
    int rock = add_material(scene, "moon", demo_moon(scene->seed + 3), 0.115, -0.07, 1, 1);
    demo_mesh_octasphere(&mesh, 0.5, 9);
    add(scene, "moon", &mesh, rock, (demo_place){{-0.12, 0.93, -0.66}, {0.36, 0.8, 0.48}, 70, 0});
}

static void add_vase(demo_scene *scene)
{
    static const double wall[][2] = {{0.24, 0.0},   {0.33, 0.16}, {0.415, 0.42}, {0.40, 0.70},  {0.29, 0.93},
                                     {0.235, 1.08}, {0.27, 1.22}, {0.31, 1.285}, {0.275, 1.28}, {0.215, 1.19},
                                     {0.19, 1.07},  {0.24, 0.90}, {0.33, 0.68}};
    demo_mesh mesh = {0};
    int willow = add_material(scene, "wicker", demo_wicker(scene->seed), 0.034, -0.01, 3, 6);
    demo_mesh_lathe(&mesh, &(demo_profile){wall, sizeof wall / sizeof wall[0], 24, 28});
    add(scene, "vase", &mesh, willow, (demo_place){.position = {-1.82, 0.01, 0.15}});
}

static void add_crate_and_urchin(demo_scene *scene)
{
    demo_mesh mesh = {0};
    int wood = add_material(scene, "rosette", demo_rosette(scene->seed), 0.05, -0.05, 1, 1);
    demo_box crate = {.size = {0.66, 0.66, 0.66}, .divisions = 1, .side_extent = 1};
    demo_mesh_box(&mesh, &crate);
    add(scene, "crate", &mesh, wood, (demo_place){{1.18, 0.35, 0.15}, {0, 1, 0}, -24, 0});
    int spines = add_material(scene, "urchin", demo_urchin(scene->seed), 0.21, 0, 1, 1);
    demo_mesh_octasphere(&mesh, 0.2, 8);
    add(scene, "urchin", &mesh, spines, (demo_place){{1.16, 0.98, 0.14}, {1, 0, 0}, 35, 0});
}

static void add_small_things(demo_scene *scene)
{
    demo_mesh mesh = {0};
    int steel = add_material(scene, "steel", demo_knurling(scene->seed), 0.013, -0.006, 8, 3);
    demo_mesh_torus(&mesh, 0.235, 0.088, 40, 16);
    add(scene, "knurled ring", &mesh, steel, (demo_place){{0.36, 0.14, 1.25}, {1, 0, 0.2}, 4, 0});
    demo_pattern coral = demo_coral(scene->seed);
    coral.columns = 1024;
    coral.rows = 512;
    int polyps = add_material(scene, "coral", coral, 0.026, -0.012, 1, 1);
    demo_mesh_sphere(&mesh, 0.23, 30, 16);
    add(scene, "coral", &mesh, polyps, (demo_place){{-0.92, 0.25, 0.95}, {0.8, 0, 0.6}, 30, 0});
}

static void add_glass(demo_scene *scene)
{
    demo_mesh mesh = {0};
    demo_pattern ripples = demo_ripples(scene->seed);
    demo_maps maps = demo_write_maps(scene, &ripples, "ripples");
    demo_material glass = demo_material_default("glass");
    glass.height_map = maps.height;
    glass.factor = 0.05;
    glass.offset = -0.025;
    glass.roughness = 0;
    glass.transmission = 1;
    glass.thickness = 0.08;
    glass.attenuation_distance = 0.16;
    memcpy(glass.attenuation_color, (double[]){0.42, 0.80, 0.74}, sizeof glass.attenuation_color);
    demo_box slab = {.size = {0.86, 0.08, 1.35}, .divisions = 4, .side_extent = 0.025};
    demo_mesh_box(&mesh, &slab);
    add(scene, "glass", &mesh, demo_add_material(scene, &glass),
        (demo_place){{2.12, 0.71, -0.75}, {1, 0, 0}, 90, -30});
}

void demo_scene_gallery(demo_scene *scene)
{
    add_courtyard(scene);
    add_ring_and_moon(scene);
    add_vase(scene);
    add_crate_and_urchin(scene);
    add_small_things(scene);
    add_glass(scene);
    demo_sky sky = demo_sky_evening(scene->seed, -124, 27);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.25, 1.45, 5.4}, .target = {0.07, 0.88, 0}, .yfov = 32});
}
