/* demo_map.h: evaluates a pattern over a grid of texels and writes its maps. */
#ifndef KNURL_APPS_DEMO_MAP_H
#define KNURL_APPS_DEMO_MAP_H

#include "demo_gltf.h"

/* What is known about the height map around a texel when it is coloured. */
typedef struct demo_relief {
    double height;
    double du, dv; /* of the height, per unit of u and v */
    double cavity; /* height above the mean of the neighbourhood, about 1/100 of the map wide */
} demo_relief;

typedef struct demo_texel {
    double color[3]; /* linear */
    double alpha, roughness, metallic;
} demo_texel;

typedef struct demo_pattern demo_pattern;
struct demo_pattern {
    /* In [0, 1]; with period 1 in u and v unless octahedral or used on one tile only. */
    double (*height)(const demo_pattern *pattern, double u, double v);
    /* NULL: a height map only. */
    void (*shade)(const demo_pattern *pattern, double u, double v, const demo_relief *relief,
                  demo_texel *texel);
    int32_t columns, rows; /* of the height map; colours have half as many */
    int32_t oversample;    /* each height is the mean of so many squared; 0: 1 */
    bool full_color;       /* colours have as many texels as heights */
    bool octahedral;       /* chart of demo_octahedral: texels on the border lie on the square's edge
                              and are equal where the chart's sides meet */
    bool alpha;
    uint32_t seed;
    double table[220][4]; /* the pattern's own directions, filled when it is made */
};

typedef struct demo_maps {
    char height[80], color[80], surface[80];
} demo_maps;

/* Writes STEM-height.png (16 bit), STEM-color.png (sRGB, 8 bit) and STEM-surface.png (green
 * roughness, blue metallic) and gives their names. */
demo_maps demo_write_maps(demo_scene *scene, const demo_pattern *pattern, const char *stem);
/* Names the maps in a material. */
void demo_use_maps(demo_material *material, const demo_maps *maps);

typedef struct demo_sky {
    double sun[3];                                    /* unit direction towards the sun */
    double sun_radius;                                /* degrees */
    double sun_irradiance[3];                         /* on a surface that faces it */
    double zenith[3], horizon[3], ground[3], glow[3]; /* radiance; glow: around the sun */
    double clouds;                                    /* 0 none, 1 overcast */
    double cloud_color[3];
    double stars; /* radiance of the brightest, 0: none */
    uint32_t seed;
} demo_sky;

/* Writes a latitude-longitude OpenEXR of 1024 x 512 (or twice as wide as high by --size). */
void demo_write_sky(demo_scene *scene, const demo_sky *sky, const char *file);

#endif
