/* Stand-ins for the scenes of Projective Displacement Mapping 2025, table 1. */
#include "demo_scenes.h"

#include "demo_noise.h"
#include "demo_pattern.h"
#include "demo_shape.h"

#include <string.h>

void demo_scene_asteroid(demo_scene *scene)
{
    demo_pattern pattern = demo_asteroid(scene->seed + 3);
    demo_maps maps;
    demo_material rock = demo_begin_material(scene, "asteroid", &pattern, &maps);
    rock.factor = 0.30;
    rock.offset = -0.6 * 0.30;
    static const demo_bump lumps[] = {{{0.8, 0.3, 0.5}, 0.7, {0.20, 0.05, 0.10}, false},
                                      {{-0.9, 0.2, 0.3}, 0.6, {-0.22, -0.05, 0.05}, false},
                                      {{0.1, 0.2, 1}, 0.45, {0, 0, -0.14}, false},
                                      {{-0.2, -0.8, 0.5}, 0.5, {0, -0.12, 0.08}, false},
                                      {{0.4, 0.9, -0.2}, 0.5, {0.05, 0.12, 0}, false}};
    demo_sculpture shape = {{1.18, 0.86, 0.92}, lumps, sizeof lumps / sizeof lumps[0]};
    demo_mesh mesh = {0};
    demo_mesh_sculpture_globe(&mesh, &shape, 16, 16);
    demo_add_thing(scene, "ball", &mesh, demo_add_material(scene, &rock),
                   &(demo_place){{0, 0, 0}, {0.6, 0, 0.8}, 24, 20});
    demo_sky sky = {.sun = {0, 1, 0},
                    .sun_radius = 1,
                    .stars = 0.5,
                    .seed = scene->seed,
                    .zenith = {0.004, 0.005, 0.008},
                    .horizon = {0.004, 0.005, 0.008},
                    .ground = {0.004, 0.005, 0.008}};
    demo_add_sky(scene, &sky);
    demo_add_sun(scene, (double[]){0.62, -0.42, -0.66}, (double[]){1, 0.95, 0.88}, 4.2);
    demo_add_camera(scene, &(demo_camera){.eye = {0.6, 0.7, 4.6}, .target = {0.05, 0, 0}, .yfov = 30});
}

/* A sheet (width, depth, radius of the ball under it): lies on the ball, then hangs in folds. */
static void drape_at(const void *shape, double s, double t, double position[3])
{
    const double *size = shape;
    double x = (s - 0.5) * size[0], z = (t - 0.5) * size[1], ball = size[2];
    double way = sqrt(x * x + z * z + 1e-9), turn = atan2(x, z), bend = 1.28 * ball;
    double on = demo_min(way, bend), angle = on / ball, hang = way - on;
    double fold = demo_step(0, 0.9, hang), wave = cos(7 * turn + 0.9 * sin(2 * turn));
    double out =
        ball * sin(angle) + hang * (cos(bend / ball) * (1 - fold) + fold * 0.20) + 0.17 * fold * wave;
    position[0] = out * sin(turn);
    position[1] = ball * cos(angle) - hang * demo_mix(sin(bend / ball), 0.965, fold);
    position[2] = out * cos(turn);
}

void demo_scene_draped_mail(demo_scene *scene)
{
    demo_pattern pattern = demo_mail(scene->seed);
    pattern.columns = pattern.rows = 4096;
    demo_maps maps;
    demo_material mail = demo_begin_material(scene, "mail", &pattern, &maps);
    mail.factor = 0.05;
    mail.offset = -0.02;
    mail.tile[0] = 4;
    mail.tile[1] = 5;
    mail.mask = true;
    mail.double_sided = true;
    double size[3] = {2.3, 2.9, 0.62};
    demo_mesh mesh = {0};
    demo_mesh_surface(&mesh, &(demo_surface){drape_at, size, 23, 31, false, true});
    demo_add_thing(scene, "mail", &mesh, demo_add_material(scene, &mail),
                   &(demo_place){{0, 1.12, 0}, {0, 1, 0}, 25, 0});
    demo_mesh_sphere(&mesh, 0.58, 64, 32);
    demo_add_thing(scene, "head", &mesh, demo_add_paint(scene, "wood", (double[]){0.34, 0.15, 0.06}, 0, 0.4),
                   &(demo_place){.position = {0, 1.12, 0}});
    static const double post[][2] = {{0.42, 0.0}, {0.40, 0.06}, {0.16, 0.12}, {0.10, 0.3}, {0.10, 0.7}};
    demo_mesh_lathe(&mesh, &(demo_profile){post, 5, 32, 16});
    demo_add_thing(scene, "post", &mesh, demo_add_paint(scene, "post", (double[]){0.20, 0.09, 0.04}, 0, 0.4),
                   NULL);
    demo_add_floor(scene, -0.02, 40, (double[]){0.26, 0.24, 0.22}, 0.5);
    demo_sky sky = demo_sky_evening(scene->seed, 130, 36);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.7, 1.85, 4.6}, .target = {0.06, 0.88, 0}, .yfov = 23});
}

/* A ball of 64 x 32 quads on a floor, as the paper's leather sphere and orb. */
static void add_ball(demo_scene *scene, demo_material *material, const demo_place *place)
{
    demo_mesh mesh = {0};
    demo_mesh_sphere(&mesh, 1, 64, 32);
    demo_add_thing(scene, "ball", &mesh, demo_add_material(scene, material), place);
    demo_add_camera(scene, &(demo_camera){.eye = {0.8, 1.9, 4.4}, .target = {0, 1.0, 0}, .yfov = 31});
}

void demo_scene_leather_sphere(demo_scene *scene)
{
    demo_pattern pattern = demo_leather(scene->seed);
    demo_maps maps;
    demo_material leather = demo_begin_material(scene, "leather", &pattern, &maps);
    leather.factor = 0.075;
    leather.offset = -0.03;
    add_ball(scene, &leather, &(demo_place){{0, 1.01, 0}, {0.9, 0.2, 0.4}, 38, 0});
    demo_add_floor(scene, 0, 40, (double[]){0.20, 0.16, 0.12}, 0.4);
    demo_sky sky = demo_sky_studio(scene->seed);
    demo_add_sky(scene, &sky);
}

void demo_scene_orb(demo_scene *scene)
{
    demo_pattern pattern = demo_panels(scene->seed);
    demo_maps maps;
    demo_material hull = demo_begin_material(scene, "hull", &pattern, &maps);
    hull.factor = 0.085;
    hull.offset = -0.03;
    add_ball(scene, &hull, &(demo_place){{0, 1.06, 0}, {1, 0, -0.5}, 22, 0});
    demo_add_floor(scene, 0, 40, (double[]){0.13, 0.13, 0.14}, 0.25);
    demo_sky sky = demo_sky_noon(scene->seed, 130, 40);
    demo_add_sky(scene, &sky);
}

/* Roots spread at the foot; the cut is flat. */
static void stump_at(const void *shape, double s, double t, double position[3])
{
    double point[2], tangent[2], turn = 2 * DEMO_PI * s;
    demo_curve_at(shape, demo_curve_parameter(shape, demo_clamp(t, 0, 1)), point, tangent);
    double foot = exp(-point[1] / 0.24),
           roots = cos(5 * turn + 0.6 * sin(2 * turn)) + 0.4 * cos(3 * turn + 2);
    double side = 1 + 0.19 * foot * roots + 0.035 * cos(3 * turn + 1) + 0.03 * cos(7 * turn + 3 * point[1]);
    position[0] = point[0] * side * sin(turn);
    position[1] = point[1] + 0.06 * point[0] * sin(turn + 0.5) * demo_step(0.3, 1.0, point[1]);
    position[2] = point[0] * side * cos(turn);
}

void demo_scene_tree_stump(demo_scene *scene)
{
    static const double side[][2] = {{1.22, -0.06}, {0.98, 0.08}, {0.80, 0.30},  {0.72, 0.60}, {0.69, 0.88},
                                     {0.66, 0.98},  {0.56, 1.02}, {0.28, 1.025}, {0.0, 1.025}};
    demo_pattern pattern = demo_stump(scene->seed);
    demo_maps maps;
    demo_material wood = demo_begin_material(scene, "stump", &pattern, &maps);
    wood.factor = 0.13;
    wood.offset = -0.06;
    demo_curve curve = {
        .points = side[0], .count = sizeof side / sizeof side[0], .width = 2, .axes = 2, .on_axis = true};
    demo_curve_measure(&curve);
    demo_mesh mesh = {0};
    demo_mesh_surface(&mesh, &(demo_surface){stump_at, &curve, 51, 76, true, false});
    demo_add_thing(scene, "stump", &mesh, demo_add_material(scene, &wood), NULL);
    demo_add_floor(scene, 0, 40, (double[]){0.11, 0.12, 0.055}, 0.95);
    demo_sky sky = demo_sky_noon(scene->seed, 120, 38);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {0.6, 2.1, 4.6}, .target = {0, 0.42, 0}, .yfov = 27});
}

static const double dragon[][5] = {
    {-1.62, 1.33, 1.18, 0.13, 1.15}, {-1.62, 1.385, 0.95, 0.19, 1.15}, {-1.62, 1.41, 0.70, 0.25, 1.10},
    {-1.64, 1.36, 0.36, 0.20, 1.0},  {-1.64, 1.13, 0.08, 0.18, 1.0},   {-1.52, 0.74, -0.04, 0.19, 1.0},
    {-1.22, 0.42, 0.10, 0.23, 1.0},  {-0.80, 0.32, 0.30, 0.25, 1.0},   {-0.36, 0.52, 0.42, 0.26, 1.0},
    {-0.02, 0.92, 0.26, 0.26, 1.0},  {0.34, 1.18, -0.06, 0.25, 1.0},   {0.76, 1.03, -0.28, 0.225, 1.0},
    {1.05, 0.63, -0.20, 0.22, 1.0},  {1.28, 0.34, 0.12, 0.21, 1.0},    {1.64, 0.34, 0.42, 0.18, 1.0},
    {1.98, 0.62, 0.40, 0.14, 1.0},   {2.10, 1.00, 0.18, 0.10, 1.0},    {1.98, 1.36, 0.02, 0.06, 1.0},
    {1.72, 1.54, 0.02, 0.03, 1.0}};

static void add_plain_tube(demo_scene *scene, const char *name, const double (*points)[5], int count,
                           int paint)
{
    demo_mesh mesh = {0};
    demo_mesh_tube(&mesh, &(demo_tube){points, count, {0.3, 0.2, 1}, 0.04, 16, 32});
    demo_add_thing(scene, name, &mesh, paint, NULL);
}

/* Horns, whiskers and eyes, mirrored about the head's middle. */
static void add_dragon_head(demo_scene *scene)
{
    int horn = demo_add_paint(scene, "horn", (double[]){0.70, 0.56, 0.32}, 0, 0.4);
    int whisker = demo_add_paint(scene, "whisker", (double[]){0.62, 0.10, 0.03}, 0, 0.5);
    int white = demo_add_paint(scene, "eye", (double[]){0.85, 0.62, 0.08}, 0, 0.08);
    int black = demo_add_paint(scene, "pupil", (double[]){0.004, 0.004, 0.004}, 0, 0.05);
    for (int side = -1; side <= 1; side += 2) {
        double x = -1.62, k = side;
        const double antler[][5] = {{x + 0.13 * k, 1.58, 0.60, 0.050, 1},
                                    {x + 0.22 * k, 1.78, 0.42, 0.045, 1},
                                    {x + 0.30 * k, 1.90, 0.20, 0.036, 1},
                                    {x + 0.28 * k, 2.06, 0.02, 0.012, 1}};
        const double feeler[][5] = {{x + 0.10 * k, 1.32, 1.20, 0.026, 1},
                                    {x + 0.34 * k, 1.18, 1.24, 0.022, 1},
                                    {x + 0.52 * k, 1.22, 1.10, 0.018, 1},
                                    {x + 0.70 * k, 1.08, 0.98, 0.008, 1}};
        add_plain_tube(scene, "horn", antler, 4, horn);
        add_plain_tube(scene, "whisker", feeler, 4, whisker);
        demo_mesh mesh = {0};
        demo_mesh_sphere(&mesh, 0.075, 32, 16);
        demo_add_thing(scene, "eye", &mesh, white, &(demo_place){.position = {x + 0.19 * k, 1.53, 0.86}});
        demo_mesh_sphere(&mesh, 0.045, 32, 16);
        demo_add_thing(scene, "pupil", &mesh, black,
                       &(demo_place){.position = {x + 0.205 * k, 1.545, 0.900}});
    }
}

void demo_scene_bamboo_dragon(demo_scene *scene)
{
    demo_pattern pattern = demo_bamboo(scene->seed);
    demo_maps maps;
    demo_material scales = demo_begin_material(scene, "bamboo", &pattern, &maps);
    scales.factor = 0.10;
    scales.offset = -0.02;
    demo_mesh mesh = {0};
    demo_mesh_tube(&mesh, &(demo_tube){dragon, sizeof dragon / sizeof dragon[0], {0, 1, 0}, 0.035, 26, 430});
    demo_add_thing(scene, "dragon", &mesh, demo_add_material(scene, &scales), NULL);
    add_dragon_head(scene);
    demo_add_floor(scene, 0, 40, (double[]){0.30, 0.27, 0.23}, 0.6);
    demo_sky sky = demo_sky_noon(scene->seed, 130, 42);
    demo_add_sky(scene, &sky);
    demo_add_camera(scene, &(demo_camera){.eye = {-0.3, 1.9, 6.2}, .target = {-0.06, 1.0, 0}, .yfov = 26});
}
