/* Stand-ins for RMIP 2023's helmets, armor and masked head. */
#include "demo_scenes.h"

#include "demo_noise.h"
#include "demo_pattern.h"
#include "demo_shape.h"

#include <string.h>

/* Tells a pattern the radius along a profile and its length, in metres. */
static void measure_profile(demo_pattern *pattern, const double (*points)[2], int count)
{
    demo_curve curve = {.points = points[0], .count = count, .width = 2, .axes = 2, .on_axis = true};
    demo_curve_measure(&curve);
    for (int i = 0; i <= 64; i++) {
        double point[2], tangent[2];
        demo_curve_at(&curve, demo_curve_parameter(&curve, i / 64.0), point, tangent);
        pattern->table[i][0] = point[0];
        pattern->table[i][1] = curve.length[DEMO_CURVE_STEPS];
    }
}

void demo_scene_diving_helmet(demo_scene *scene)
{
    static const double dome[][2] = {{0.98, 0.00}, {0.94, 0.08}, {0.84, 0.18},  {0.73, 0.27}, {0.645, 0.37},
                                     {0.61, 0.48}, {0.63, 0.61}, {0.685, 0.78}, {0.71, 0.96}, {0.64, 1.19},
                                     {0.48, 1.37}, {0.25, 1.47}, {0.0, 1.50}};
    demo_pattern pattern = demo_diver(scene->seed);
    int count = sizeof dome / sizeof dome[0];
    measure_profile(&pattern, dome, count);
    demo_maps maps;
    demo_material copper = demo_begin_material(scene, "helmet", &pattern, &maps);
    copper.factor = 0.15;
    copper.offset = -0.22 * 0.15;
    demo_mesh mesh = {0};
    demo_mesh_lathe(&mesh, &(demo_profile){dome, count, 36, 35});
    demo_add_thing(scene, "helmet", &mesh, demo_add_material(scene, &copper),
                   &(demo_place){{0, 0.02, 0}, {0, 1, 0}, 205, 0});
    demo_add_floor(scene, 0, 40, (double[]){0.20, 0.13, 0.08}, 0.45);
    demo_sky sky = demo_sky_studio(scene->seed);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.2, 1.5, 4.4}, .target = {0, 0.76, 0}, .yfov = 27});
}

/* A great helm: round behind, keeled in front, at s = 0.5. `grow` widens it about its axis. */
typedef struct helm {
    demo_curve curve;
    double grow, s[2], t[2];
} helm;

static void helm_at(const void *shape, double s, double t, double position[3])
{
    const helm *h = shape;
    double point[2], tangent[2], at = demo_mix(h->t[0], h->t[1], t);
    demo_curve_at(&h->curve, demo_curve_parameter(&h->curve, demo_clamp(at, 0, 1)), point, tangent);
    double turn = 2 * DEMO_PI * (demo_mix(h->s[0], h->s[1], s) - 0.5);
    double wrapped = turn - 2 * DEMO_PI * floor(turn / (2 * DEMO_PI) + 0.5);
    double keel = 1 + 0.17 * exp(-pow(wrapped / 0.42, 2)), radius = point[0] * h->grow;
    position[0] = 0.90 * radius * sin(turn);
    position[1] = point[1];
    position[2] = 1.08 * radius * cos(turn) * keel;
}

/* A plain strip over part of the helm. */
static void add_strip(demo_scene *scene, const helm *whole, double grow, const double s[2], const double t[2],
                      int paint)
{
    helm part = *whole;
    part.grow = grow;
    memcpy(part.s, s, sizeof part.s);
    memcpy(part.t, t, sizeof part.t);
    demo_mesh mesh = {0};
    demo_mesh_surface(&mesh, &(demo_surface){helm_at, &part, 48, 8, false, false});
    demo_add_thing(scene, "strip", &mesh, paint, NULL);
}

void demo_scene_medieval_helmet(demo_scene *scene)
{
    static const double wall[][2] = {{0.545, 0.0}, {0.55, 0.25}, {0.565, 0.50}, {0.575, 0.75},
                                     {0.56, 0.98}, {0.48, 1.17}, {0.27, 1.29},  {0.0, 1.33}};
    demo_pattern pattern = demo_plates(scene->seed);
    demo_maps maps;
    demo_material steel = demo_begin_material(scene, "plates", &pattern, &maps);
    steel.factor = 0.065;
    steel.offset = -0.02;
    steel.tile[0] = steel.tile[1] = 5;
    steel.double_sided = true;
    helm whole = {.curve = {.points = wall[0], .count = 8, .width = 2, .axes = 2, .on_axis = true},
                  .grow = 1,
                  .s = {0, 1},
                  .t = {0, 1}};
    demo_curve_measure(&whole.curve);
    demo_mesh mesh = {0};
    demo_mesh_surface(&mesh, &(demo_surface){helm_at, &whole, 34, 34, true, false});
    demo_add_thing(scene, "helm", &mesh, demo_add_material(scene, &steel), NULL);
    int brass = demo_add_paint(scene, "brass", (double[]){0.78, 0.52, 0.20}, 1, 0.28);
    int dark = demo_add_paint(scene, "slit", (double[]){0.004, 0.004, 0.004}, 0, 1);
    add_strip(scene, &whole, 1.10, (double[]){0.31, 0.69}, (double[]){0.455, 0.56}, brass);
    add_strip(scene, &whole, 1.105, (double[]){0.487, 0.513}, (double[]){0.06, 0.66}, brass);
    add_strip(scene, &whole, 1.112, (double[]){0.33, 0.485}, (double[]){0.493, 0.522}, dark);
    add_strip(scene, &whole, 1.112, (double[]){0.515, 0.67}, (double[]){0.493, 0.522}, dark);
    for (int i = 0; i < 14; i++) {
        /* Breaths: small holes on both sides, below the slits. */
        double s = 0.545 + 0.028 * (i % 4) + (i / 4 % 2) * 0.014, t = 0.20 + 0.055 * (i / 4);
        for (int side = 0; side < 2; side++) {
            double middle = side ? 1 - s : s;
            add_strip(scene, &whole, 1.115, (double[]){middle - 0.0035, middle + 0.0035},
                      (double[]){t, t + 0.013}, dark);
        }
    }
    demo_add_floor(scene, 0, 40, (double[]){0.19, 0.12, 0.07}, 0.5);
    demo_sky sky = demo_sky_studio(scene->seed);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {1.25, 1.4, 3.6}, .target = {0, 0.66, 0}, .yfov = 26});
}

/* Half width, height and half depth of a trunk, from the hips to the neck. */
static void trunk_at(const void *shape, double s, double t, double position[3])
{
    double point[3], tangent[3], turn = 2 * DEMO_PI * (s - 0.5);
    demo_curve_at(shape, demo_curve_parameter(shape, demo_clamp(t, 0, 1)), point, tangent);
    double x = sin(turn), z = cos(turn), chest = exp(-pow((point[1] - 0.66) / 0.28, 2));
    double squared = pow(x * x * x * x + z * z * z * z, -0.25 * 0.45);
    position[0] = point[0] * x * squared;
    position[1] = point[1];
    position[2] = point[2] * z * squared + (z > 0 ? 0.09 * chest * z * z * z : 0);
}

void demo_scene_elven_armor(demo_scene *scene)
{
    static const double trunk[][3] = {
        {0.60, -0.34, 0.42}, {0.48, -0.10, 0.31}, {0.43, 0.08, 0.27}, {0.50, 0.34, 0.30}, {0.60, 0.60, 0.34},
        {0.66, 0.82, 0.32},  {0.56, 0.98, 0.26},  {0.32, 1.08, 0.21}, {0.22, 1.19, 0.19}, {0.24, 1.30, 0.21}};
    demo_pattern pattern = demo_filigree(scene->seed);
    demo_maps maps;
    demo_material armor = demo_begin_material(scene, "filigree", &pattern, &maps);
    armor.factor = 0.045;
    armor.offset = -0.005;
    armor.tile[0] = armor.tile[1] = 2;
    armor.wrap = DEMO_MIRROR;
    armor.double_sided = true;
    demo_curve curve = {.points = trunk[0], .count = sizeof trunk / sizeof trunk[0], .width = 3, .axes = 2};
    demo_curve_measure(&curve);
    demo_mesh mesh = {0};
    demo_mesh_surface(&mesh, &(demo_surface){trunk_at, &curve, 20, 20, true, false});
    demo_add_thing(scene, "armor", &mesh, demo_add_material(scene, &armor),
                   &(demo_place){{0, 0.72, 0}, {0, 1, 0}, -18, 0});
    static const double stand[][2] = {{0.46, 0.0}, {0.45, 0.05}, {0.20, 0.10}, {0.06, 0.20}, {0.05, 0.5},
                                      {0.05, 1.5}, {0.05, 2.0},  {0.09, 2.06}, {0.07, 2.14}, {0.0, 2.16}};
    demo_mesh_lathe(&mesh, &(demo_profile){stand, sizeof stand / sizeof stand[0], 32, 64});
    demo_add_thing(scene, "stand", &mesh, demo_add_paint(scene, "wood", (double[]){0.16, 0.07, 0.03}, 0, 0.4),
                   NULL);
    demo_add_floor(scene, 0, 40, (double[]){0.10, 0.10, 0.115}, 0.35);
    demo_sky sky = demo_sky_studio(scene->seed);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.3, 1.5, 4.4}, .target = {0, 1.17, 0}, .yfov = 26});
}

static const demo_bump face[] = {
    {{0, -0.04, 1}, 0.17, {0, -0.03, 0.17}, false},       /* nose, under the cloth */
    {{0, -0.32, 1}, 0.30, {0, -0.02, 0.07}, false},       /* mouth */
    {{0, -0.70, 0.72}, 0.30, {0, -0.10, 0.14}, false},    /* chin */
    {{0.62, -0.15, 0.75}, 0.30, {0.03, 0.0, 0.05}, true}, /* cheekbones */
    {{0.36, 0.20, 0.92}, 0.20, {0, 0, -0.09}, true},      /* sockets */
    {{0, 0.42, 0.92}, 0.32, {0, 0.02, 0.05}, false},      /* brow */
    {{0, 0.55, -0.83}, 0.60, {0, 0.05, -0.14}, false},    /* back of the head */
    {{0, -1, -0.12}, 0.66, {0, -0.62, -0.10}, false},     /* neck */
    {{0.75, -0.95, 0.0}, 0.45, {0.03, -0.12, 0}, true},   /* to the shoulders */
};
static const demo_sculpture ninja = {{0.60, 0.80, 0.70}, face, sizeof face / sizeof face[0]};

/* Part of the head between two elevations (radians), as far out as `lift`. */
typedef struct head_band {
    double turn, low, high, lift;
    bool lens; /* narrow towards its ends */
} head_band;

static void band_at(const void *shape, double s, double t, double position[3])
{
    const head_band *band = shape;
    double side = 2 * s - 1, turn = band->turn * side, normal[3];
    double open = band->lens ? sqrt(demo_clamp(1 - pow(fabs(side), 3), 0.002, 1)) : 1;
    double middle = 0.5 * (band->low + band->high),
           rise = middle + open * (t - 0.5) * (band->high - band->low);
    double edge = 1 - pow(fabs(2 * t - 1), 4);
    demo_sculpture_at(&ninja, (double[]){cos(rise) * sin(turn), sin(rise), cos(rise) * cos(turn)}, position,
                      normal);
    for (int k = 0; k < 3; k++) position[k] += normal[k] * band->lift * (band->lens ? 1 : 0.7 + 0.3 * edge);
}

static void add_eye(demo_scene *scene, double side, const int paint[3])
{
    double at[3], normal[3];
    demo_sculpture_at(&ninja, (double[]){0.36 * side, 0.185, 0.92}, at, normal);
    static const double radius[3] = {0.105, 0.058, 0.030}, out[3] = {-0.010, 0.054, 0.086};
    for (int i = 0; i < 3; i++) {
        demo_mesh mesh = {0};
        demo_mesh_sphere(&mesh, radius[i], 32, 16);
        demo_add_thing(scene, "eye", &mesh, paint[i],
                       &(demo_place){.position = {at[0] - 0.01 * side, 0.93 + at[1], at[2] + out[i]}});
    }
}

void demo_scene_ninja_head(demo_scene *scene)
{
    demo_pattern pattern = demo_cloth(scene->seed);
    demo_maps maps;
    demo_material cloth = demo_begin_material(scene, "cloth", &pattern, &maps);
    cloth.factor = 0.045;
    cloth.tile[0] = cloth.tile[1] = 5;
    demo_place place = {.position = {0, 0.93, 0}};
    demo_mesh mesh = {0};
    demo_mesh_sculpture(&mesh, &ninja, 33);
    demo_add_thing(scene, "ball", &mesh, demo_add_material(scene, &cloth), &place);
    int skin = demo_add_paint(scene, "skin", (double[]){0.55, 0.33, 0.22}, 0, 0.5);
    int red = demo_add_paint(scene, "headband", (double[]){0.42, 0.02, 0.02}, 0, 0.8);
    head_band eyes = {0.78, 0.03, 0.34, 0.047, true}, band = {DEMO_PI, 0.46, 0.72, 0.075, false};
    demo_mesh_surface(&mesh, &(demo_surface){band_at, &eyes, 48, 16, false, false});
    demo_add_thing(scene, "skin", &mesh, skin, &place);
    demo_mesh_surface(&mesh, &(demo_surface){band_at, &band, 96, 16, true, false});
    demo_add_thing(scene, "headband", &mesh, red, &place);
    int paint[3] = {demo_add_paint(scene, "white", (double[]){0.80, 0.78, 0.74}, 0, 0.15),
                    demo_add_paint(scene, "iris", (double[]){0.16, 0.06, 0.02}, 0, 0.1),
                    demo_add_paint(scene, "pupil", (double[]){0.003, 0.003, 0.003}, 0, 0.05)};
    add_eye(scene, -1, paint);
    add_eye(scene, 1, paint);
    demo_add_floor(scene, -0.42, 40, (double[]){0.22, 0.20, 0.18}, 0.6);
    demo_sky sky = demo_sky_evening(scene->seed, 130, 36);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.9, 1.15, 4.1}, .target = {0, 0.80, 0}, .yfov = 29});
}
