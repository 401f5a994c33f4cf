/* Cobblestones, basket, chain mail and glass. */
#include "demo_scenes.h"

#include "demo_noise.h"
#include "demo_pattern.h"

#include <string.h>

void demo_scene_cobblestones(demo_scene *scene)
{
    demo_pattern pattern = demo_cobbles(scene->seed);
    pattern.columns = pattern.rows = 2048;
    demo_maps maps = demo_write_maps(scene, &pattern, "cobbles");
    demo_material stones = demo_material_default("cobbles");
    demo_use_maps(&stones, &maps);
    stones.factor = 0.085;
    stones.offset = -0.06;
    stones.tile[0] = stones.tile[1] = 12;
    demo_mesh mesh = {0};
    demo_mesh_plane(&mesh, 18, 18, 1, 1);
    demo_add_node(scene, "street", demo_add_mesh(scene, "street", &mesh, demo_add_material(scene, &stones)),
                  NULL);
    demo_sky sky = demo_sky_evening(scene->seed, -62, 18);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0, 0.80, 2.6},
                                          .target = {0, -0.05, 0.6},
                                          .yfov = 38,
                                          .lens_radius = 0.006,
                                          .focus_distance = 1.9});
}

void demo_scene_basket(demo_scene *scene)
{
    demo_pattern pattern = demo_wicker(scene->seed);
    demo_maps maps = demo_write_maps(scene, &pattern, "wicker");
    demo_material willow = demo_material_default("willow");
    demo_use_maps(&willow, &maps);
    willow.factor = 0.05;
    willow.offset = -0.01;
    willow.tile[0] = 6;
    willow.tile[1] = 4;
    /* Up the outer wall, over the lip, down the inner wall. */
    static const double wall[][2] = {{0.62, 0.02}, {0.82, 0.22},  {0.98, 0.48}, {1.04, 0.74},
                                     {1.02, 0.90}, {0.95, 0.955}, {0.88, 0.89}, {0.89, 0.73},
                                     {0.83, 0.49}, {0.69, 0.26},  {0.55, 0.10}};
    demo_mesh mesh = {0};
    demo_mesh_lathe(&mesh, &(demo_profile){wall, sizeof wall / sizeof wall[0], 32, 20});
    demo_add_node(scene, "bowl", demo_add_mesh(scene, "bowl", &mesh, demo_add_material(scene, &willow)),
                  NULL);

    demo_material base = demo_material_default("bottom");
    memcpy(base.color, (double[]){0.16, 0.09, 0.04, 1}, sizeof base.color);
    static const double disc[][2] = {{0.66, 0.0}, {0.66, 0.05}, {0.60, 0.10}, {0.30, 0.10}, {0.0, 0.10}};
    demo_mesh_lathe(&mesh, &(demo_profile){disc, sizeof disc / sizeof disc[0], 32, 12});
    demo_add_node(scene, "bottom", demo_add_mesh(scene, "bottom", &mesh, demo_add_material(scene, &base)),
                  NULL);

    demo_material fruit = demo_material_default("orange");
    memcpy(fruit.color, (double[]){0.85, 0.27, 0.025, 1}, sizeof fruit.color);
    fruit.roughness = 0.42;
    static const double places[][4] = {{-0.36, 0.62, 0.18, 0.30},
                                       {0.33, 0.60, 0.25, 0.29},
                                       {0.05, 0.62, -0.38, 0.30},
                                       {0.02, 1.02, 0.03, 0.28}};
    int peel = demo_add_material(scene, &fruit);
    for (int i = 0; i < 4; i++) {
        demo_mesh_sphere(&mesh, places[i][3], 48, 24);
        demo_add_node(scene, "orange", demo_add_mesh(scene, "orange", &mesh, peel),
                      &(demo_place){.position = {places[i][0], places[i][1], places[i][2]}});
    }
    demo_add_floor(scene, 0, 40, (double[]){0.30, 0.25, 0.20}, 0.35);
    demo_sky sky = demo_sky_studio(scene->seed);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.9, 2.2, 3.5}, .target = {0, 0.52, 0}, .yfov = 32});
}

/* A sheet that hangs over a round bar: up the back, over the top, down the front, with folds. */
static void drape_at(const void *shape, double s, double t, double position[3], double normal[3])
{
    const double *size = shape; /* width, drop at the back, bar radius, drop at the front */
    double top = DEMO_PI * size[2], along = t * (size[1] + top + size[3]), y, z, ny, nz, hang;
    if (along < size[1]) {
        hang = size[1] - along;
        y = -hang;
        z = -size[2];
        ny = 0;
        nz = -1;
    } else if (along < size[1] + top) {
        double turn = (along - size[1]) / size[2];
        hang = 0;
        y = size[2] * sin(turn);
        z = -size[2] * cos(turn);
        ny = sin(turn);
        nz = -cos(turn);
    } else {
        hang = along - size[1] - top;
        y = -hang;
        z = size[2];
        ny = 0;
        nz = 1;
    }
    /* Folds grow with the way down; the normal follows the fold's slope in x. */
    double x = (s - 0.5) * size[0], wave = 7.5, depth = 0.11 * demo_step(0, 1.1, hang);
    double slope = depth * wave * cos(wave * x + 0.8), side = nz < 0 ? -1 : 1;
    position[0] = x;
    position[1] = y;
    position[2] = z + (hang > 0 ? side * depth * sin(wave * x + 0.8) : 0);
    double nx = hang > 0 ? -slope : 0, length = sqrt(nx * nx + ny * ny + nz * nz);
    normal[0] = nx / length;
    normal[1] = ny / length;
    normal[2] = nz / length;
}

void demo_scene_chainmail(demo_scene *scene)
{
    demo_pattern pattern = demo_mail(scene->seed);
    demo_maps maps = demo_write_maps(scene, &pattern, "mail");
    demo_material mail = demo_material_default("chain mail");
    demo_use_maps(&mail, &maps);
    mail.factor = 0.06;
    mail.offset = -0.03;
    mail.tile[0] = 3;
    mail.tile[1] = 4;
    mail.mask = true;
    mail.double_sided = true;
    double size[4] = {2.2, 1.2, 0.09, 1.75};
    demo_mesh mesh = {0};
    demo_mesh_patch(&mesh, &(demo_patch){drape_at, size, 24, 32, false, false});
    int shirt = demo_add_mesh(scene, "mail", &mesh, demo_add_material(scene, &mail));
    demo_add_node(scene, "mail", shirt, &(demo_place){.position = {0, 1.95, 0}});

    demo_material wood = demo_material_default("bar");
    memcpy(wood.color, (double[]){0.20, 0.09, 0.035, 1}, sizeof wood.color);
    wood.roughness = 0.5;
    static const double bar[][2] = {{0.0001, -1.55}, {0.07, -1.5}, {0.05, -1.4}, {0.055, -1.3},
                                    {0.055, 1.3},    {0.05, 1.4},  {0.07, 1.5},  {0.0001, 1.55}};
    demo_mesh_lathe(&mesh, &(demo_profile){bar, sizeof bar / sizeof bar[0], 24, 64});
    int rod = demo_add_mesh(scene, "bar", &mesh, demo_add_material(scene, &wood));
    demo_add_node(scene, "bar", rod, &(demo_place){{0, 1.95, 0}, {0, 0, 1}, 90, 0});
    demo_add_floor(scene, 0, 40, (double[]){0.24, 0.22, 0.20}, 0.5);
    demo_sky sky = demo_sky_evening(scene->seed, 150, 30);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {-1.3, 1.35, 3.4}, .target = {-0.1, 1.18, 0}, .yfov = 36});
}

void demo_scene_glass(demo_scene *scene)
{
    demo_pattern pattern = demo_ripples(scene->seed);
    demo_maps maps = demo_write_maps(scene, &pattern, "ripples");
    demo_material glass = demo_material_default("cast glass");
    glass.height_map = maps.height;
    glass.factor = 0.045;
    glass.offset = -0.0225; /* the rim's height is 0, so that the six faces meet */
    glass.roughness = 0;
    glass.transmission = 1;
    glass.thickness = 0.1;
    glass.attenuation_distance = 0.35;
    memcpy(glass.attenuation_color, (double[]){0.55, 0.86, 0.80}, sizeof glass.attenuation_color);
    demo_box slab = {.size = {1.7, 0.10, 1.3}, .divisions = 4, .side_extent = 0.025};
    demo_mesh mesh = {0};
    demo_mesh_box(&mesh, &slab);
    int tile = demo_add_mesh(scene, "slab", &mesh, demo_add_material(scene, &glass));
    demo_add_node(scene, "slab", tile, &(demo_place){{0, 0.68, 0}, {1, 0, 0}, 90, 0});

    static const double colors[5][4] = {{0.75, 0.05, 0.03, 1},
                                        {0.90, 0.45, 0.03, 1},
                                        {0.85, 0.80, 0.72, 1},
                                        {0.05, 0.30, 0.14, 1},
                                        {0.03, 0.10, 0.48, 1}};
    for (int i = 0; i < 5; i++) {
        demo_material paint = demo_material_default("paint");
        memcpy(paint.color, colors[i], sizeof paint.color);
        paint.roughness = 0.35;
        static const double post[][2] = {{0.13, 0}, {0.13, 0.35}, {0.13, 0.95}, {0.13, 1.25}};
        demo_mesh_lathe(&mesh, &(demo_profile){post, 4, 32, 4});
        demo_add_node(scene, "post", demo_add_mesh(scene, "post", &mesh, demo_add_material(scene, &paint)),
                      &(demo_place){.position = {-1.0 + 0.5 * i, 0, -0.9}});
        demo_mesh_sphere(&mesh, 0.13, 32, 16);
        demo_add_node(scene, "knob", demo_add_mesh(scene, "knob", &mesh, demo_add_material(scene, &paint)),
                      &(demo_place){.position = {-1.0 + 0.5 * i, 1.25, -0.9}});
    }
    demo_add_floor(scene, 0, 40, (double[]){0.34, 0.32, 0.29}, 0.7);
    demo_sky sky = demo_sky_noon(scene->seed, -150, 36);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.8, 1.15, 3.3}, .target = {0, 0.66, 0}, .yfov = 34});
}
