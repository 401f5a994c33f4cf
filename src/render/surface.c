#include "render/surface.h"

/* A shading normal behind the viewer's horizon is bent along the viewing direction until it is just
 * visible: normals of smooth meshes are wrong there, and light must not leak through. */
static vec3 face_viewer(vec3 ns, vec3 ng, vec3 wo)
{
    const double least = 1e-3;
    if (v3_dot(ns, ng) < 0.0) ns = v3_neg(ns);
    double cosine = v3_dot(ns, wo);
    if (cosine < least) ns = v3_normalize(v3_mad(ns, least - cosine, wo));
    return v3_dot(ns, wo) > 0.0 ? ns : ng;
}

static bsdf_parameters look_up(const world *w, const knurl_description_material *m, const double st[2])
{
    bsdf_parameters p = {.base = v3_load(m->base_color), .metallic = m->metallic, .roughness = m->roughness};
    if (m->base_color_texture.image >= 0)
        p.base = v3_mul(p.base, texture_lookup(w->textures, &m->base_color_texture, st, true).color);
    if (m->metallic_roughness_texture.image >= 0) {
        vec3 c = texture_lookup(w->textures, &m->metallic_roughness_texture, st, false).color;
        p.metallic *= c.z;
        p.roughness *= c.y;
    }
    p.base = v3_max(v3_min(p.base, v3(1, 1, 1)), v3(0, 0, 0));
    p.metallic = warp_clamp(p.metallic, 0.0, 1.0);
    p.roughness = warp_clamp(p.roughness, 0.0, 1.0);
    p.transmission = warp_clamp(m->transmission, 0.0, 1.0);
    p.ior = m->ior >= 1.0 && isfinite(m->ior) ? m->ior : m->ior == 0.0 ? 1e3 : 1.5;
    return p;
}

surface_point surface_make(const world *w, const knurl_hit *hit, vec3 direction)
{
    surface_point s = {.material = world_material(w, hit->object), .position = v3_load(hit->position)};
    vec3 ng = v3_load(hit->ng), viewer = v3_neg(direction);
    bool front = v3_dot(ng, viewer) >= 0.0;
    s.outside = front != w->instances[hit->instance].mirrored;
    s.ng = front ? ng : v3_neg(ng);
    s.shading = frame_from_normal(face_viewer(v3_load(hit->ns), s.ng, viewer));
    s.wo = frame_to_local(&s.shading, viewer);
    s.parameters = look_up(w, s.material, hit->st);
    s.emission = light_emission(w->textures, s.material, hit->st);
    return s;
}
