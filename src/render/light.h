/* render/light.h: choosing a point on a light for next-event estimation.
 *
 * Three groups are chosen from with equal probability: the environment, emissive triangles of
 * undisplaced meshes (by area times emission), and punctual lights (by what each would send to the
 * shaded point unshadowed). Displaced emissive meshes are found by scattered rays alone. */
#ifndef KNURL_SRC_RENDER_LIGHT_H
#define KNURL_SRC_RENDER_LIGHT_H

#include "render/environment.h"
#include "render/texture.h"

#include <knurl/description.h>

typedef struct light_triangle {
    uint32_t instance, triangle;
} light_triangle;

typedef struct light_set {
    knurl_context *context;
    const knurl_description *description;
    const texture_set *textures;
    const environment *environment;
    light_triangle *triangles;
    double *cumulative; /* triangle_count + 1, 0 to total_power */
    size_t triangle_count;
    double total_power;       /* sum of area * emission */
    bool *sampled;            /* by instance: its triangles are in the list */
    double group_probability; /* 1 / number of groups; 0 if there are none */
} light_set;

typedef struct light_sample {
    vec3 direction;  /* unit, from the shaded point */
    double distance; /* infinite for distant lights */
    vec3 radiance;   /* for punctual lights: irradiance on a facing surface */
    double pdf;      /* solid angle, choice of light included; for delta lights the probability */
    bool delta;
} light_sample;

knurl_status light_set_create(const knurl_description *description, const texture_set *textures,
                              const environment *sky, const knurl_scene *scene, light_set **out,
                              knurl_error *error);
void light_set_release(light_set *lights);
/* Whether the description itself gives any light (besides environments). */
bool light_description_shines(const knurl_description *description);

/* u: two for the point, the choice of group, the choice within the group. The first two dimensions of a
 * Sobol point are the best stratified pair. */
bool light_draw(const light_set *lights, vec3 point, const double u[4], light_sample *sample);
/* Densities with which light_draw finds what a scattered ray hit. */
double light_environment_pdf(const light_set *lights, vec3 direction);
double light_triangle_pdf(const light_set *lights, uint32_t instance, double distance, double cosine);

/* Emission of a material at texture coordinates. */
vec3 light_emission(const texture_set *textures, const knurl_description_material *m, const double st[2]);
/* Share of light a material's surface stops there: 1 if opaque. */
double light_coverage(const texture_set *textures, const knurl_description_material *m, const double st[2]);

#endif
