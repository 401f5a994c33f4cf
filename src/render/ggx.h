/* render/ggx.h: the GGX microfacet distribution in a local frame, z the macro normal [Walter et al.
 * 2007], with height-correlated Smith masking [Heitz 2014]. */
#ifndef KNURL_SRC_RENDER_GGX_H
#define KNURL_SRC_RENDER_GGX_H

#include "render/warp.h"

/* Below this a lobe is a mirror to the eye, and D overflows nothing above it. */
#define GGX_MIN_ALPHA 1e-3

static inline double ggx_alpha(double roughness)
{
    return fmax(GGX_MIN_ALPHA, roughness * roughness);
}

static inline double ggx_d(vec3 h, double alpha)
{
    /* Written as in Walter Eq. 33 with tan^2 expanded, so that it stays exact near the normal. */
    double x = h.x / alpha, y = h.y / alpha;
    double k = x * x + y * y + h.z * h.z;
    return 1.0 / (WARP_PI * alpha * alpha * k * k);
}

static inline double ggx_lambda(vec3 w, double alpha)
{
    double cos2 = w.z * w.z;
    if (!(cos2 > 0.0)) return INFINITY;
    return 0.5 * (sqrt(1.0 + alpha * alpha * (w.x * w.x + w.y * w.y) / cos2) - 1.0);
}

static inline double ggx_g1(vec3 w, double alpha)
{
    return 1.0 / (1.0 + ggx_lambda(w, alpha));
}

static inline double ggx_g2(vec3 wo, vec3 wi, double alpha)
{
    return 1.0 / (1.0 + ggx_lambda(wo, alpha) + ggx_lambda(wi, alpha));
}

/* Density of visible normals, wo.z > 0. */
static inline double ggx_visible_pdf(vec3 wo, vec3 h, double alpha)
{
    return ggx_g1(wo, alpha) * ggx_d(h, alpha) * fmax(0.0, v3_dot(wo, h)) / wo.z;
}

/* Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023. */
static inline vec3 ggx_sample_visible(vec3 wo, double alpha, double u, double v)
{
    vec3 stretched = v3_normalize(v3(wo.x * alpha, wo.y * alpha, wo.z));
    double phi = 2.0 * WARP_PI * u, z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
    double sine = sqrt(warp_clamp(1.0 - z * z, 0.0, 1.0));
    vec3 h = v3_add(v3(sine * cos(phi), sine * sin(phi), z), stretched);
    return v3_normalize(v3(h.x * alpha, h.y * alpha, fmax(h.z, 1e-12)));
}

static inline vec3 ggx_reflect(vec3 wo, vec3 h)
{
    return v3_sub(v3_scale(h, 2.0 * v3_dot(wo, h)), wo);
}

#endif
