/* The table of sample scenes, and what several of them share. */
#include "demo_scenes.h"

#include "demo_noise.h"

#include <string.h>

const demo_entry demo_entries[] = {
    {"gallery", "a courtyard of displaced things: start here", demo_scene_gallery},
    {"torus", "knurled steel ring; closed, its map repeats both ways", demo_scene_torus},
    {"plane", "mountains and a lake on two triangles, 6 km wide", demo_scene_plane},
    {"sphere", "brain coral on 900 triangles, latitude-longitude chart", demo_scene_sphere},
    {"box", "creased and smooth boxes: carved, hammered, and one that comes apart", demo_scene_box},
    {"cobblestones", "a street of setts, one map tiled 12 x 12", demo_scene_cobblestones},
    {"basket", "woven willow on a turned bowl", demo_scene_basket},
    {"spikes", "sea urchin: displacement as large as the ball under it", demo_scene_spikes},
    {"chainmail", "draped mail, its holes cut out by alpha", demo_scene_chainmail},
    {"planet", "seas, mountains and a cratered moon, kilometres wide", demo_scene_planet},
    {"glass", "a closed slab of wavy cast glass", demo_scene_glass},
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

void demo_add_floor(demo_scene *scene, double y, double size, const double color[3], double roughness)
{
    demo_material material = demo_material_default("floor");
    memcpy(material.color, color, 3 * sizeof *color);
    material.roughness = roughness;
    demo_mesh mesh = {0};
    demo_mesh_plane(&mesh, size, size, 1, 1);
    demo_add_node(scene, "floor", demo_add_mesh(scene, "floor", &mesh, demo_add_material(scene, &material)),
                  &(demo_place){.position = {0, y, 0}});
}
