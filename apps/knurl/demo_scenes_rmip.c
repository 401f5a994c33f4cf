/* Stand-ins for the scenes of RMIP 2023, table 1; those worn on the body are in demo_scenes_wear.c. */
#include "demo_scenes.h"

#include "demo_noise.h"
#include "demo_pattern.h"
#include "demo_shape.h"

#include <string.h>

void demo_scene_alien_sphere(demo_scene *scene)
{
    demo_pattern pattern = demo_alien(scene->seed);
    demo_maps maps;
    demo_material skin = demo_begin_material(scene, "alien", &pattern, &maps);
    skin.factor = 0.17;
    skin.offset = -0.02;
    skin.tile[0] = 6;
    skin.tile[1] = 8;
    demo_mesh mesh = {0};
    demo_mesh_sphere(&mesh, 1, 30, 16);
    demo_add_thing(scene, "ball", &mesh, demo_add_material(scene, &skin),
                   &(demo_place){{0, 1.14, 0}, {1, 0, 0.35}, 24, 0});
    demo_add_floor(scene, 0, 40, (double[]){0.10, 0.11, 0.13}, 0.35);
    demo_sky sky = demo_sky_studio(scene->seed);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.9, 2.0, 4.3}, .target = {0, 1.10, 0}, .yfov = 33});
}

void demo_scene_wicker_basket(demo_scene *scene)
{
    demo_pattern pattern = demo_wicker(scene->seed);
    pattern.columns = pattern.rows = 2048;
    demo_maps maps;
    demo_material willow = demo_begin_material(scene, "willow", &pattern, &maps);
    willow.factor = 0.045;
    willow.offset = -0.01;
    willow.tile[0] = willow.tile[1] = 5;
    willow.double_sided = true;
    static const double wall[][2] = {{0.72, 0.0},  {0.86, 0.16}, {0.95, 0.40}, {1.00, 0.66},
                                     {1.05, 0.88}, {1.03, 1.00}, {0.94, 1.00}, {0.91, 0.88},
                                     {0.86, 0.66}, {0.80, 0.40}, {0.70, 0.18}, {0.52, 0.08}};
    demo_mesh mesh = {0};
    demo_mesh_lathe(&mesh, &(demo_profile){wall, sizeof wall / sizeof wall[0], 40, 48});
    int material = demo_add_material(scene, &willow);
    demo_add_thing(scene, "basket", &mesh, material, NULL);
    static const double arch[][5] = {
        {-0.98, 0.72, 0, 0.075, 1}, {-0.98, 1.10, 0, 0.075, 1}, {-0.86, 1.52, 0, 0.075, 1},
        {-0.50, 1.84, 0, 0.075, 1}, {0.00, 1.95, 0, 0.075, 1},  {0.50, 1.84, 0, 0.075, 1},
        {0.86, 1.52, 0, 0.075, 1},  {0.98, 1.10, 0, 0.075, 1},  {0.98, 0.72, 0, 0.075, 1}};
    demo_mesh_tube(&mesh, &(demo_tube){arch, sizeof arch / sizeof arch[0], {0, 0, 1}, 0.02, 8, 61});
    /* As many rods to the metre as on the wall. */
    demo_mesh_scale_texcoords(&mesh, 0.2, 1.2);
    demo_add_thing(scene, "handle", &mesh, material, &(demo_place){{0, 0, 0}, {0, 1, 0}, 28, 0});

    int paint[3] = {demo_add_paint(scene, "red apple", (double[]){0.55, 0.025, 0.02}, 0, 0.25),
                    demo_add_paint(scene, "green apple", (double[]){0.36, 0.48, 0.05}, 0, 0.28),
                    demo_add_paint(scene, "bottom", (double[]){0.16, 0.09, 0.04}, 0, 0.9)};
    static const double fruit[][2] = {{0.0, 0.21}, {0.10, 0.25}, {0.22, 0.24},  {0.28, 0.13},
                                      {0.28, 0.0}, {0.2, -0.17}, {0.10, -0.23}, {0.0, -0.21}};
    double down[8][2];
    for (int i = 0; i < 8; i++) memcpy(down[i], fruit[7 - i], sizeof down[i]);
    for (int i = 0; i < 9; i++) {
        double turn = i < 6 ? i * DEMO_PI / 3 + 0.3 : i * 2 * DEMO_PI / 3, out = i < 6 ? 0.56 : 0.29;
        demo_mesh_lathe(&mesh, &(demo_profile){(const double(*)[2])down, 8, 32, 24});
        demo_add_thing(scene, "apple", &mesh, paint[i % 4 == 1],
                       &(demo_place){{out * cos(turn), i < 6 ? 0.80 : 1.12, out * sin(turn)},
                                     {cos(3.0 * i), 0.2, sin(5.0 * i)},
                                     25.0 + 9 * i,
                                     0});
    }
    static const double disc[][2] = {{0.74, 0.02}, {0.72, 0.10}, {0.30, 0.10}, {0.0, 0.10}};
    demo_mesh_lathe(&mesh, &(demo_profile){disc, 4, 32, 6});
    demo_add_thing(scene, "bottom", &mesh, paint[2], NULL);
    demo_add_floor(scene, -0.02, 40, (double[]){0.36, 0.30, 0.23}, 0.5);
    demo_sky sky = demo_sky_noon(scene->seed, 125, 40);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.5, 2.3, 4.9}, .target = {0, 0.97, 0}, .yfov = 27});
}

enum { MOUTH = 15, HEAD_BUMPS = 17 };

/* A reptile that looks along +z; the eyes are where demo_reptile paints them. */
static void creature_head(demo_bump bumps[HEAD_BUMPS + MOUTH])
{
    static const demo_bump head[HEAD_BUMPS] = {
        {{0, -0.14, 1}, 0.62, {0, -0.10, 0.62}, false},         /* snout */
        {{0.30, -0.02, 0.95}, 0.22, {0.07, 0.05, 0.05}, true},  /* cheeks of the snout */
        {{0.5, -0.42, 0.75}, 0.30, {0.10, -0.05, 0.02}, true},  /* jaws */
        {{0.62, 0.56, 0.60}, 0.15, {0.07, 0.15, 0.07}, true},   /* brows */
        {{0.45, 0.62, 0.66}, 0.14, {0.02, 0.10, 0.05}, true},   /* */
        {{0.60, 0.34, 0.72}, 0.15, {0.08, 0.02, 0.06}, true},   /* eyes */
        {{0.16, 0.06, 1}, 0.085, {0.02, 0.05, 0.02}, true},     /* nostrils: a lip */
        {{0.20, 0.035, 1}, 0.050, {-0.02, -0.03, -0.06}, true}, /* and a hole */
        {{0.52, 0.84, -0.22}, 0.17, {0.22, 0.62, -0.42}, true}, /* horns */
        {{0.80, 0.52, -0.45}, 0.15, {0.36, 0.26, -0.34}, true}, /* */
        {{0.95, 0.10, -0.45}, 0.15, {0.40, 0.00, -0.30}, true}, /* frill */
        {{0.88, -0.32, -0.36}, 0.14, {0.27, -0.13, -0.20}, true},
        {{0, 0.36, 0.93}, 0.09, {0, 0.15, 0.12}, false},     /* crest of the nose */
        {{0, 0.70, 0.72}, 0.10, {0, 0.17, 0.05}, false},     /* */
        {{0, 0.95, 0.30}, 0.11, {0, 0.24, 0.0}, false},      /* */
        {{0, -0.66, 0.72}, 0.11, {0, -0.16, 0.06}, false},   /* chin */
        {{0, -0.62, -0.80}, 0.75, {0, -0.85, -0.75}, false}, /* neck */
    };
    memcpy(bumps, head, sizeof head);
    for (int i = 0; i < MOUTH; i++) {
        double turn = (i - 0.5 * (MOUTH - 1)) * 0.115, smile = -0.30 + 0.14 * fabs(turn);
        bumps[HEAD_BUMPS + i] = (demo_bump){
            {sin(turn), smile, cos(turn)}, 0.074, {-0.055 * sin(turn), 0.03, -0.055 * cos(turn)}, false};
    }
}

void demo_scene_creature(demo_scene *scene)
{
    demo_pattern pattern = demo_reptile(scene->seed);
    demo_maps maps;
    demo_material skin = demo_begin_material(scene, "scales", &pattern, &maps);
    skin.factor = 0.06;
    skin.offset = -0.015;
    demo_bump bumps[HEAD_BUMPS + MOUTH];
    creature_head(bumps);
    demo_sculpture head = {{0.74, 0.70, 0.84}, bumps, HEAD_BUMPS + MOUTH};
    demo_mesh mesh = {0};
    demo_mesh_sculpture(&mesh, &head, 81);
    demo_add_thing(scene, "creature", &mesh, demo_add_material(scene, &skin),
                   &(demo_place){{0, 1.05, 0}, {1, 0, 0}, 4, 34});
    static const double plinth[][2] = {{0.62, -0.80}, {0.60, -0.70}, {0.46, -0.62}, {0.42, -0.30},
                                       {0.42, 0.20},  {0.50, 0.30},  {0.48, 0.37},  {0.0, 0.38}};
    demo_mesh_lathe(&mesh, &(demo_profile){plinth, 8, 64, 64});
    demo_add_thing(scene, "plinth", &mesh,
                   demo_add_paint(scene, "slate", (double[]){0.16, 0.165, 0.17}, 0, 0.35),
                   &(demo_place){.position = {-0.26, 0, -0.40}});
    demo_add_floor(scene, -0.8, 60, (double[]){0.13, 0.14, 0.11}, 0.9);
    demo_sky sky = demo_sky_evening(scene->seed, 140, 34);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.1, 1.3, 5.2}, .target = {0.08, 1.00, 0}, .yfov = 30});
}

static void roof_at(const void *shape, double s, double t, double position[3])
{
    (void)shape;
    /* Steep at the ridge, flatter at the eaves; old rafters sag a little. */
    double sag = 0.05 * sin(2 * DEMO_PI * (1.3 * s + 0.1)) * sin(DEMO_PI * t);
    position[0] = (s - 0.5) * 5.2;
    position[1] = 1.75 * (1 - t) * (1 - 0.30 * t) - sag;
    position[2] = 2.6 * t - 1.3;
}

void demo_scene_terracotta_roof(demo_scene *scene)
{
    demo_pattern pattern = demo_rooftiles(scene->seed);
    demo_maps maps;
    demo_material clay = demo_begin_material(scene, "roof tiles", &pattern, &maps);
    clay.factor = 0.42;
    clay.offset = -0.10;
    clay.tile[0] = clay.tile[1] = 2;
    demo_mesh mesh = {0};
    demo_mesh_surface(&mesh, &(demo_surface){roof_at, NULL, 8, 8, false, true});
    demo_add_thing(scene, "roof", &mesh, demo_add_material(scene, &clay), NULL);
    int plaster = demo_add_paint(scene, "plaster", (double[]){0.70, 0.63, 0.52}, 0, 0.9);
    demo_mesh_plane(&mesh, 4.9, 3, 1, 1);
    demo_add_thing(scene, "wall", &mesh, plaster, &(demo_place){{0, -1.45, 0.95}, {1, 0, 0}, 90, 0});
    int ridge_paint = demo_add_paint(scene, "ridge", (double[]){0.40, 0.15, 0.07}, 0, 0.85);
    for (int i = 0; i < 11; i++) {
        double x = -2.6 + i * 0.49;
        const double ridge[][5] = {
            {x, 1.83, -1.32, 0.19, 1}, {x + 0.27, 1.85, -1.32, 0.20, 1}, {x + 0.54, 1.86, -1.32, 0.215, 1}};
        demo_mesh_tube(&mesh, &(demo_tube){ridge, 3, {0, 1, 0}, 0, 24, 2});
        demo_add_thing(scene, "ridge", &mesh, ridge_paint, NULL);
    }
    demo_sky sky = demo_sky_evening(scene->seed, -115, 34);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {1.5, 2.3, 5.6}, .target = {0.05, 0.72, 0}, .yfov = 29});
}

static void dune_at(const void *shape, double s, double t, double position[3])
{
    const double *size = shape;
    double x = (s - 0.5) * size[0], z = (t - 0.5) * size[0], away = hypot(x, z);
    double dune = 0.30 * sin(0.55 * x + 0.5 * sin(0.4 * z)) + 0.40 * sin(0.42 * z - 0.3 * x + 1);
    double far = demo_step(1.2, 7, away), mound = 0.16 * exp(-pow((away - 1.0) / 0.8, 2));
    position[0] = x;
    position[1] = dune * far + mound;
    position[2] = z;
}

void demo_scene_desert_tire(demo_scene *scene)
{
    demo_pattern patterns[3] = {demo_sand(scene->seed), demo_tread(scene->seed), demo_sidewall(scene->seed)};
    demo_maps maps[3];
    demo_material sand = demo_begin_material(scene, "sand", &patterns[0], &maps[0]);
    sand.factor = 0.085;
    sand.offset = -0.03;
    sand.tile[0] = sand.tile[1] = 25;
    demo_material tread = demo_begin_material(scene, "tread", &patterns[1], &maps[1]);
    tread.factor = 0.10;
    tread.offset = -0.02; /* edges lie at 0, where tread and sidewalls meet */
    tread.tile[0] = 6;
    demo_material side = demo_begin_material(scene, "sidewall", &patterns[2], &maps[2]);
    side.factor = 0.075;
    side.offset = -0.015;
    side.tile[0] = 6;
    double size = 25;
    demo_mesh mesh = {0};
    demo_mesh_surface(&mesh, &(demo_surface){dune_at, &size, 40, 40, false, true});
    demo_add_thing(scene, "ground", &mesh, demo_add_material(scene, &sand), NULL);

    static const double crown[][2] = {{0.93, -0.33}, {0.985, -0.21}, {1.0, 0}, {0.985, 0.21}, {0.93, 0.33}};
    static const double wall[][2] = {
        {0.57, -0.20}, {0.64, -0.29}, {0.75, -0.355}, {0.86, -0.365}, {0.93, -0.33}};
    static const double disc[][2] = {{0.585, 0.24}, {0.555, 0.17}, {0.52, 0.04}, {0.42, 0.03},
                                     {0.34, 0.10},  {0.20, 0.12},  {0.17, 0.19}, {0.0, 0.20}};
    demo_place upright = {{0, 0.86, 0}, {1, 0, 0}, 78, 32}, back = {{0, 0.86, 0}, {1, 0, 0}, 78 - 180, 32};
    int rubber = demo_add_material(scene, &side);
    demo_mesh_lathe(&mesh, &(demo_profile){crown, 5, 96, 14});
    demo_add_thing(scene, "tread", &mesh, demo_add_material(scene, &tread), &upright);
    demo_mesh_lathe(&mesh, &(demo_profile){wall, 5, 96, 8});
    demo_add_thing(scene, "inner sidewall", &mesh, rubber, &upright);
    demo_mesh_lathe(&mesh, &(demo_profile){wall, 5, 96, 8});
    demo_add_thing(scene, "outer sidewall", &mesh, rubber, &back);
    demo_mesh_lathe(&mesh, &(demo_profile){disc, 8, 64, 32});
    demo_add_thing(scene, "wheel", &mesh,
                   demo_add_paint(scene, "wheel", (double[]){0.30, 0.285, 0.27}, 1, 0.42), &upright);
    demo_sky sky = demo_sky_evening(scene->seed, 125, 27);
    memcpy(sky.ground, (double[]){0.40, 0.28, 0.17}, sizeof sky.ground);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.5, 1.35, 4.6}, .target = {-0.05, 0.82, 0}, .yfov = 28});
}

void demo_scene_rough_glass(demo_scene *scene)
{
    demo_pattern pattern = demo_cutglass(scene->seed);
    demo_maps maps;
    demo_material glass = demo_begin_material(scene, "cut glass", &pattern, &maps);
    glass.factor = 0.07;
    glass.offset = -0.035;
    glass.roughness = 0.02;
    glass.transmission = 1;
    glass.thickness = 0.1;
    glass.attenuation_distance = 1.2;
    memcpy(glass.attenuation_color, (double[]){0.78, 0.93, 0.90}, sizeof glass.attenuation_color);
    static const double wall[][2] = {{0.0, 0.0},   {0.16, 0.0},   {0.32, 0.0},  {0.40, 0.06},
                                     {0.43, 0.22}, {0.455, 0.5},  {0.48, 0.80}, {0.49, 0.97},
                                     {0.46, 1.02}, {0.425, 0.97}, {0.415, 0.8}, {0.39, 0.5},
                                     {0.37, 0.30}, {0.30, 0.22},  {0.15, 0.20}, {0.0, 0.20}};
    demo_mesh mesh = {0};
    demo_mesh_lathe(&mesh, &(demo_profile){wall, sizeof wall / sizeof wall[0], 30, 38});
    demo_add_thing(scene, "glass", &mesh, demo_add_material(scene, &glass),
                   &(demo_place){.position = {0, 0.04, 0}});
    static const double colors[3][3] = {{0.80, 0.24, 0.02}, {0.62, 0.03, 0.04}, {0.75, 0.55, 0.05}};
    static const double places[3][3] = {{-0.52, 0.27, -0.85}, {0.14, 0.22, -1.15}, {0.70, 0.19, -0.55}};
    for (int i = 0; i < 3; i++) {
        demo_mesh_sphere(&mesh, places[i][1], 48, 24);
        demo_add_thing(scene, "fruit", &mesh, demo_add_paint(scene, "fruit", colors[i], 0, 0.35),
                       &(demo_place){.position = {places[i][0], places[i][1], places[i][2]}});
    }
    demo_add_floor(scene, 0, 30, (double[]){0.42, 0.27, 0.15}, 0.4);
    demo_sky sky = demo_sky_noon(scene->seed, -145, 38);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.25, 1.25, 2.6}, .target = {0.02, 0.48, 0}, .yfov = 30});
}
