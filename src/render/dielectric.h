/* render/dielectric.h: smooth and rough interfaces between dielectrics [Walter et al. 2007].
 *
 * Radiance is carried divided by the squared index of refraction of its medium, which refraction
 * leaves unchanged: no (n1 / n2)^2 factor appears, and an interface alone neither adds nor takes light.
 * eta is the index on the far side over that on wo's side; wo.z > 0. */
#ifndef KNURL_SRC_RENDER_DIELECTRIC_H
#define KNURL_SRC_RENDER_DIELECTRIC_H

#include "render/warp.h"

/* Roughness under which an interface is taken as smooth: a delta distribution. */
#define DIELECTRIC_SMOOTH 0.03

/* Exact unpolarised Fresnel reflectance; cosine >= 0 on the near side. 1 in total reflection. */
double dielectric_fresnel(double cosine, double eta);
/* Refracts wo about h (dot(wo, h) > 0); false in total reflection. */
bool dielectric_refract(vec3 wo, vec3 h, double eta, vec3 *wi);
/* A direction drawn by Fresnel reflectance: its weight is 1. */
vec3 dielectric_draw_smooth(vec3 wo, double eta, double u);
/* f |cos wi| and the density of dielectric_draw_rough. */
double dielectric_evaluate(vec3 wo, vec3 wi, double eta, double alpha, double *pdf);
vec3 dielectric_draw_rough(vec3 wo, double eta, double alpha, double u_lobe, double u, double v);

#endif
