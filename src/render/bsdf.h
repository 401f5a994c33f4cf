/* render/bsdf.h: how a surface scatters light, in a local frame whose z is the shading normal on the
 * viewer's side (wo.z > 0). wi.z > 0 is reflection, wi.z < 0 transmission.
 *
 * Opaque part: glTF 2.0 metallic-roughness with GGX, single scattering plus Kulla and Conty's (2017)
 * term for light that bounces between facets; the diffuse lobe receives exactly what the specular
 * one leaves, in both directions, so that a white material reflects all light and stays reciprocal.
 * Transmissive part: render/dielectric.h. The two are mixed by transmission * (1 - metallic). */
#ifndef KNURL_SRC_RENDER_BSDF_H
#define KNURL_SRC_RENDER_BSDF_H

#include "render/albedo.h"
#include "render/warp.h"

typedef struct bsdf_parameters {
    vec3 base;                                /* linear, [0, 1] */
    double metallic, roughness, transmission; /* [0, 1] */
    double ior;                               /* >= 1 */
} bsdf_parameters;

/* Everything that does not depend on wi. */
typedef struct bsdf {
    const albedo_table *table;
    vec3 wo;
    double alpha;
    vec3 f0, multiple; /* specular; the factor of the multiple-scattering term */
    vec3 diffuse;      /* base (1 - metallic) */
    double dielectric_f0, dielectric_multiple;
    double lack_o, lack_mean;    /* 1 - E(wo) and its mean: lost by single scattering */
    double rest_o, rest_mean;    /* 1 - specular albedo of the dielectric part */
    double specular_probability; /* against cosine sampling */
    double glass;                /* share and probability of the transmissive part */
    double glass_alpha;          /* 0: smooth */
    double eta;                  /* index behind the surface over that on wo's side */
    vec3 glass_tint;             /* of transmitted light */
} bsdf;

typedef struct bsdf_sample {
    vec3 wi;
    vec3 weight; /* f |cos| / pdf */
    double pdf;  /* solid angle; 0 for delta */
    bool delta;
} bsdf_sample;

/* `outside`: wo is on the side the geometric normal points to. */
bsdf bsdf_make(const albedo_table *table, const bsdf_parameters *parameters, vec3 wo, bool outside);
/* f |cos wi| and the density with which bsdf_draw chooses wi; delta parts are left out. */
vec3 bsdf_evaluate(const bsdf *s, vec3 wi, double *pdf);
/* false: absorbed. u in [0, 1). */
bool bsdf_draw(const bsdf *s, double u_lobe, double u, double v, bsdf_sample *sample);

#endif
