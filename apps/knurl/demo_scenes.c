/* The table of sample scenes, and what several of them share. */
#include "demo_scenes.h"

#include "demo_noise.h"

#include <string.h>

const demo_entry demo_entries[] = {
    {"gallery", "a courtyard of displaced things: start here", demo_scene_gallery, NULL},
    {"torus", "knurled steel ring; closed, its map repeats both ways", demo_scene_torus, NULL},
    {"plane", "mountains and a lake on two triangles, 6 km wide", demo_scene_plane, NULL},
    {"sphere", "brain coral on 900 triangles, latitude-longitude chart", demo_scene_sphere, NULL},
    {"box", "creased and smooth boxes: carved, hammered, and one that comes apart", demo_scene_box, NULL},
    {"cobblestones", "a street of setts, one map tiled 12 x 12", demo_scene_cobblestones, NULL},
    {"basket", "woven willow on a turned bowl", demo_scene_basket, NULL},
    {"spikes", "sea urchin: displacement as large as the ball under it", demo_scene_spikes, NULL},
    {"chainmail", "draped mail, its holes cut out by alpha", demo_scene_chainmail, NULL},
    {"planet", "seas, mountains and a cratered moon, kilometres wide", demo_scene_planet, NULL},
    {"glass", "a closed slab of wavy cast glass", demo_scene_glass, NULL},

    {"alien-sphere", "eyes and plates around a ball, 6 x 8 tiles", demo_scene_alien_sphere, "rmip"},
    {"wicker-basket", "woven willow, 5 x 5 tiles, with a handle", demo_scene_wicker_basket, "rmip"},
    {"creature", "a horned reptile's head on a fine mesh", demo_scene_creature, "rmip"},
    {"diving-helmet", "a copper helmet whose windows and bolts are in the map", demo_scene_diving_helmet,
     "rmip"},
    {"medieval-helmet", "hammered and riveted plates, 5 x 5 tiles", demo_scene_medieval_helmet, "rmip"},
    {"elven-armor", "filigree on a breastplate, 2 x 2 mirrored tiles", demo_scene_elven_armor, "rmip"},
    {"ninja-head", "a hood of coarse cloth, 5 x 5 tiles", demo_scene_ninja_head, "rmip"},
    {"terracotta-roof", "barrel tiles on 128 triangles, 2 x 2 tiles", demo_scene_terracotta_roof, "rmip"},
    {"desert-tire", "tread, sidewall and sand: three maps, 6 x 1 and 25 x 25 tiles", demo_scene_desert_tire,
     "rmip"},
    {"rough-glass", "a tumbler of cut glass", demo_scene_rough_glass, "rmip"},

    {"asteroid", "craters on 480 triangles", demo_scene_asteroid, "pdm"},
    {"draped-mail", "mail thrown over a ball, its holes cut out by alpha", demo_scene_draped_mail, "pdm"},
    {"leather-sphere", "stitched leather", demo_scene_leather_sphere, "pdm"},
    {"orb", "panels of a machine, an 8k map", demo_scene_orb, "pdm"},
    {"tree-stump", "bark and year rings", demo_scene_tree_stump, "pdm"},
    {"bamboo-dragon", "a long dragon jointed like bamboo", demo_scene_bamboo_dragon, "pdm"},

    {"terrain-32", "mountains on two triangles, 32 x 32 texels", demo_scene_terrain, "baboud"},
    {"terrain-64", "the same, 64 x 64", demo_scene_terrain, "baboud"},
    {"terrain-128", "the same, 128 x 128", demo_scene_terrain, "baboud"},
    {"terrain-256", "the same, 256 x 256", demo_scene_terrain, "baboud"},
    {"grid-32", "a lattice of bars on two triangles, 32 x 32 texels", demo_scene_grid, "baboud"},
    {"grid-64", "the same, 64 x 64", demo_scene_grid, "baboud"},
    {"grid-128", "the same, 128 x 128", demo_scene_grid, "baboud"},
    {"grid-256", "the same, 256 x 256", demo_scene_grid, "baboud"},

    {"relief-simple", "smooth hills on two triangles", demo_scene_relief_simple, "kolb"},
    {"relief-spikes", "a field of needles on two triangles", demo_scene_relief_spikes, "kolb"},
};
const int demo_entry_count = sizeof demo_entries / sizeof demo_entries[0];

static void set3(double out[3], double x, double y, double z)
{
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

static void aim(demo_sky *sky, double azimuth, double elevation)
{
    double a = azimuth * DEMO_PI / 180, e = elevation * DEMO_PI / 180;
    set3(sky->sun, cos(e) * sin(a), sin(e), -cos(e) * cos(a));
}

demo_sky demo_sky_evening(uint32_t seed, double azimuth, double elevation)
{
    demo_sky sky = {.sun_radius = 1.2, .clouds = 0.55, .seed = seed};
    aim(&sky, azimuth, elevation);
    set3(sky.sun_irradiance, 6.0, 4.2, 2.4);
    set3(sky.zenith, 0.13, 0.25, 0.50);
    set3(sky.horizon, 0.62, 0.50, 0.40);
    set3(sky.ground, 0.16, 0.13, 0.10);
    set3(sky.glow, 1.0, 0.62, 0.30);
    set3(sky.cloud_color, 0.95, 0.80, 0.70);
    return sky;
}

demo_sky demo_sky_noon(uint32_t seed, double azimuth, double elevation)
{
    demo_sky sky = {.sun_radius = 1.0, .clouds = 0.48, .seed = seed};
    aim(&sky, azimuth, elevation);
    set3(sky.sun_irradiance, 3.6, 3.3, 2.85);
    set3(sky.zenith, 0.16, 0.32, 0.68);
    set3(sky.horizon, 0.60, 0.70, 0.82);
    set3(sky.ground, 0.20, 0.18, 0.15);
    set3(sky.glow, 0.6, 0.55, 0.45);
    set3(sky.cloud_color, 0.95, 0.95, 0.97);
    return sky;
}

/* A dim room with one large soft lamp. */
demo_sky demo_sky_studio(uint32_t seed)
{
    demo_sky sky = {.sun_radius = 16, .seed = seed};
    aim(&sky, 135, 50);
    set3(sky.sun_irradiance, 2.6, 2.4, 2.15);
    set3(sky.zenith, 0.42, 0.45, 0.50);
    set3(sky.horizon, 0.16, 0.18, 0.22);
    set3(sky.ground, 0.10, 0.09, 0.085);
    set3(sky.glow, 0.35, 0.30, 0.25);
    return sky;
}

void demo_add_sky(demo_scene *scene, const demo_sky *sky)
{
    demo_write_sky(scene, sky, "sky.exr");
    demo_add_environment(scene, "sky.exr", 1, 0);
}

demo_material demo_begin_material(demo_scene *scene, const char *name, const demo_pattern *pattern,
                                  demo_maps *maps)
{
    *maps = demo_write_maps(scene, pattern, name);
    demo_material material = demo_material_default(name);
    if (pattern->shade)
        demo_use_maps(&material, maps);
    else
        material.height_map = maps->height;
    if (pattern->octahedral) material.wrap = DEMO_CLAMP;
    return material;
}

void demo_add_thing(demo_scene *scene, const char *name, demo_mesh *mesh, int material,
                    const demo_place *place)
{
    demo_add_node(scene, name, demo_add_mesh(scene, name, mesh, material), place);
}

int demo_add_paint(demo_scene *scene, const char *name, const double color[3], double metallic,
                   double roughness)
{
    demo_material material = demo_material_default(name);
    memcpy(material.color, color, 3 * sizeof *color);
    material.metallic = metallic;
    material.roughness = roughness;
    return demo_add_material(scene, &material);
}

void demo_add_floor(demo_scene *scene, double y, double size, const double color[3], double roughness)
{
    demo_mesh mesh = {0};
    demo_mesh_plane(&mesh, size, size, 1, 1);
    demo_add_thing(scene, "floor", &mesh, demo_add_paint(scene, "floor", color, 0, roughness),
                   &(demo_place){.position = {0, y, 0}});
}
