#include "render/dielectric.h"

#include "render/ggx.h"

double dielectric_fresnel(double cosine, double eta)
{
    double sine2 = (1.0 - cosine * cosine) / (eta * eta);
    if (sine2 >= 1.0) return 1.0;
    double t = sqrt(1.0 - sine2);
    double parallel = (eta * cosine - t) / (eta * cosine + t);
    double perpendicular = (cosine - eta * t) / (cosine + eta * t);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

bool dielectric_refract(vec3 wo, vec3 h, double eta, vec3 *wi)
{
    double cosine = v3_dot(wo, h), sine2 = (1.0 - cosine * cosine) / (eta * eta);
    if (sine2 >= 1.0) return false;
    double t = sqrt(1.0 - sine2);
    *wi = v3_sub(v3_scale(h, cosine / eta - t), v3_scale(wo, 1.0 / eta));
    return true;
}

vec3 dielectric_draw_smooth(vec3 wo, double eta, double u)
{
    vec3 h = v3(0, 0, 1), wi;
    if (u < dielectric_fresnel(wo.z, eta) || !dielectric_refract(wo, h, eta, &wi)) return ggx_reflect(wo, h);
    return wi;
}

static double evaluate_reflection(vec3 wo, vec3 wi, double eta, double alpha, double *pdf)
{
    vec3 h = v3_normalize(v3_add(wo, wi));
    double cosine = v3_dot(wo, h);
    if (!(cosine > 0.0)) return 0.0;
    double f = dielectric_fresnel(cosine, eta), scale = f * ggx_d(h, alpha) / (4.0 * wo.z);
    *pdf = scale * ggx_g1(wo, alpha);
    return scale * ggx_g2(wo, wi, alpha);
}

double dielectric_evaluate(vec3 wo, vec3 wi, double eta, double alpha, double *pdf)
{
    *pdf = 0.0;
    if (wi.z == 0.0) return 0.0;
    if (wi.z > 0.0) return evaluate_reflection(wo, wi, eta, alpha, pdf);
    /* Walter Eq. 16, turned to the side of the macro normal. */
    vec3 h = v3_normalize(v3_mad(wo, eta, wi));
    if (h.z < 0.0) h = v3_neg(h);
    double oh = v3_dot(wo, h), ih = v3_dot(wi, h);
    if (!(oh > 0.0) || !(ih < 0.0)) return 0.0;
    double root = ih + oh / eta;
    if (root == 0.0) return 0.0;           /* equal indices: no unique half vector */
    double jacobian = -ih / (root * root); /* Eq. 17 */
    double scale = (1.0 - dielectric_fresnel(oh, eta)) * ggx_d(h, alpha) * oh / wo.z * jacobian;
    *pdf = scale * ggx_g1(wo, alpha);
    return scale * ggx_g2(wo, wi, alpha); /* Eq. 21 without the squared index, times cos wi */
}

vec3 dielectric_draw_rough(vec3 wo, double eta, double alpha, double u_lobe, double u, double v)
{
    vec3 h = ggx_sample_visible(wo, alpha, u, v), wi;
    double cosine = v3_dot(wo, h);
    if (u_lobe < dielectric_fresnel(fmin(cosine, 1.0), eta) || !dielectric_refract(wo, h, eta, &wi)) {
        wi = ggx_reflect(wo, h);
        /* A facet's reflection that leaves through the surface is lost, not transmitted. */
        return wi.z > 0.0 ? wi : v3(0, 0, 0);
    }
    return wi.z < 0.0 ? wi : v3(0, 0, 0);
}
