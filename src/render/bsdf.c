#include "render/bsdf.h"

#include "render/dielectric.h"
#include "render/ggx.h"

static double schlick_weight(double cosine)
{
    double m = warp_clamp(1.0 - cosine, 0.0, 1.0), m2 = m * m;
    return m2 * m2 * m;
}

/* Colour of light after two and more bounces between facets: Kulla and Conty 2017, with the mean of
 * Schlick's Fresnel, f0 + (1 - f0) / 21. */
static double multiple_factor(double f0, double e_mean)
{
    double f = f0 + (1.0 - f0) / 21.0;
    return f * f * e_mean / (1.0 - f * (1.0 - e_mean));
}

static double dielectric_albedo(const bsdf *s, albedo a)
{
    return s->dielectric_f0 * (a.e - a.b) + a.b + (1.0 - a.e) * s->dielectric_multiple;
}

static void prepare_opaque(bsdf *s, const bsdf_parameters *p)
{
    double r = (p->ior - 1.0) / (p->ior + 1.0);
    s->dielectric_f0 = r * r;
    s->f0 = warp_mix(v3(r * r, r * r, r * r), p->base, p->metallic);
    s->diffuse = v3_scale(p->base, 1.0 - p->metallic);
    albedo o = albedo_lookup(s->table, s->wo.z, s->alpha), mean = albedo_mean(s->table, s->alpha);
    s->dielectric_multiple = multiple_factor(s->dielectric_f0, mean.e);
    double dm = s->dielectric_multiple;
    vec3 metal = v3(multiple_factor(p->base.x, mean.e), multiple_factor(p->base.y, mean.e),
                    multiple_factor(p->base.z, mean.e));
    s->multiple = warp_mix(v3(dm, dm, dm), metal, p->metallic);
    s->lack_o = 1.0 - o.e;
    s->lack_mean = fmax(1.0 - mean.e, 1e-9);
    s->rest_o = 1.0 - dielectric_albedo(s, o);
    s->rest_mean = fmax(1.0 - dielectric_albedo(s, mean), 1e-9);
    double specular = warp_luminance(s->f0) * (o.e - o.b) + o.b;
    double even = warp_luminance(s->diffuse) * s->rest_o + warp_luminance(s->multiple) * s->lack_o;
    s->specular_probability = warp_clamp(specular / fmax(specular + even, 1e-12), 0.05, 0.98);
}

bsdf bsdf_make(const albedo_table *table, const bsdf_parameters *p, vec3 wo, bool outside)
{
    bsdf s = {.table = table, .wo = wo, .alpha = ggx_alpha(p->roughness)};
    s.glass = p->transmission * (1.0 - p->metallic);
    s.eta = outside ? p->ior : 1.0 / p->ior;
    /* Equal indices bend nothing, whatever the facets do. */
    bool smooth = p->roughness < DIELECTRIC_SMOOTH || fabs(p->ior - 1.0) < 1e-3;
    s.glass_alpha = smooth ? 0.0 : ggx_alpha(p->roughness);
    s.glass_tint = p->base;
    if (s.glass < 1.0) prepare_opaque(&s, p);
    return s;
}

static vec3 opaque_evaluate(const bsdf *s, vec3 wi, double *pdf)
{
    *pdf = 0.0;
    if (!(wi.z > 0.0)) return v3(0, 0, 0);
    vec3 h = v3_normalize(v3_add(s->wo, wi));
    double d = ggx_d(h, s->alpha), fresnel = schlick_weight(v3_dot(wi, h));
    double facets = d * ggx_g2(s->wo, wi, s->alpha) / (4.0 * s->wo.z); /* times cos wi */
    vec3 f = v3_scale(warp_mix(s->f0, v3(1, 1, 1), fresnel), facets);
    albedo i = albedo_lookup(s->table, wi.z, s->alpha);
    double even = wi.z / WARP_PI;
    f = v3_mad(f, even * s->lack_o * (1.0 - i.e) / s->lack_mean, s->multiple);
    f = v3_mad(f, even * s->rest_o * (1.0 - dielectric_albedo(s, i)) / s->rest_mean, s->diffuse);
    *pdf = warp_lerp(even, d * ggx_g1(s->wo, s->alpha) / (4.0 * s->wo.z), s->specular_probability);
    return f;
}

vec3 bsdf_evaluate(const bsdf *s, vec3 wi, double *pdf)
{
    double part = 0.0;
    vec3 f = v3(0, 0, 0);
    *pdf = 0.0;
    if (s->glass < 1.0) {
        f = v3_scale(opaque_evaluate(s, wi, &part), 1.0 - s->glass);
        *pdf += (1.0 - s->glass) * part;
    }
    if (s->glass > 0.0 && s->glass_alpha > 0.0) {
        double value = dielectric_evaluate(s->wo, wi, s->eta, s->glass_alpha, &part) * s->glass;
        f = v3_mad(f, value, wi.z < 0.0 ? s->glass_tint : v3(1, 1, 1));
        *pdf += s->glass * part;
    }
    return f;
}

static bool draw_smooth_glass(const bsdf *s, double u, bsdf_sample *sample)
{
    sample->wi = dielectric_draw_smooth(s->wo, s->eta, u);
    sample->weight = sample->wi.z < 0.0 ? s->glass_tint : v3(1, 1, 1);
    sample->pdf = 0.0;
    sample->delta = true;
    return true;
}

bool bsdf_draw(const bsdf *s, double u_lobe, double u, double v, bsdf_sample *sample)
{
    sample->delta = false;
    if (u_lobe < s->glass) {
        u_lobe /= s->glass;
        if (s->glass_alpha == 0.0) return draw_smooth_glass(s, u_lobe, sample);
        sample->wi = dielectric_draw_rough(s->wo, s->eta, s->glass_alpha, u_lobe, u, v);
    } else {
        u_lobe = (u_lobe - s->glass) / (1.0 - s->glass);
        if (u_lobe < s->specular_probability)
            sample->wi = ggx_reflect(s->wo, ggx_sample_visible(s->wo, s->alpha, u, v));
        else
            sample->wi = warp_cosine_hemisphere(u, v);
        if (!(sample->wi.z > 0.0)) return false;
    }
    vec3 f = bsdf_evaluate(s, sample->wi, &sample->pdf);
    if (!(sample->pdf > 0.0)) return false;
    sample->weight = v3_scale(f, 1.0 / sample->pdf);
    return true;
}
