/* Instances: rays into an object's space, hits back out, all in double. */
#include "scene/scene.h"

#include <string.h>

static double frobenius(const affine *a)
{
    double sum = 0.0;
    for (int i = 0; i < 12; i++)
        if (i % 4 != 3) sum += a->m[i] * a->m[i];
    return sqrt(sum);
}

bool scene_instance_place(scene_instance *instance, const double transform[12])
{
    affine m = affine_identity();
    instance->identity = !transform || memcmp(transform, m.m, sizeof m.m) == 0;
    if (transform) memcpy(m.m, transform, sizeof m.m);
    for (int i = 0; i < 12; i++)
        if (!isfinite(m.m[i])) return false;
    instance->to_world = m;
    instance->translation = v3(m.m[3], m.m[7], m.m[11]);
    m.m[3] = m.m[7] = m.m[11] = 0.0;
    if (!affine_invert(&m, &instance->inverse)) return false;
    double det = affine_det(&m);
    instance->sign = det < 0.0 ? -1.0 : 1.0;
    instance->norm = frobenius(&m);
    instance->inverse_norm = frobenius(&instance->inverse);
    instance->inverse_scale = 1.0 / cbrt(fabs(det));
    /* Beyond this the transform has lost all digits: a flattened axis dressed as a rotation. */
    return instance->norm * instance->inverse_norm < 1e14;
}

accel_box scene_instance_box(const scene_instance *instance, const accel_box *box)
{
    if (accel_box_is_empty(box) || instance->identity) return *box;
    accel_box out = accel_box_empty();
    for (int i = 0; i < 8; i++) {
        vec3 p = affine_point(&instance->to_world,
                              v3(i & 1 ? box->upper.x : box->lower.x, i & 2 ? box->upper.y : box->lower.y,
                                 i & 4 ? box->upper.z : box->lower.z));
        out = accel_box_union(&out, &(accel_box){p, p});
    }
    /* Rounding of the corners. */
    double reach = v3_max_component(v3_max(v3_abs(out.lower), v3_abs(out.upper))), pad = 0x1p-50 * reach;
    out.lower = v3_sub(out.lower, v3(pad, pad, pad));
    out.upper = v3_add(out.upper, v3(pad, pad, pad));
    return out;
}

void scene_instance_move_ray(const scene_instance *instance, knurl_ray *ray)
{
    vec3 origin = v3_sub(v3_load(ray->origin), instance->translation);
    v3_store(ray->origin, affine_vector(&instance->inverse, origin));
    v3_store(ray->direction, affine_vector(&instance->inverse, v3_load(ray->direction)));
    ray->cone_width = (float)((double)ray->cone_width * instance->inverse_scale);
    ray->cone_spread = (float)((double)ray->cone_spread * instance->inverse_scale);
}

void scene_instance_move_hit(const scene_instance *instance, knurl_hit *hit)
{
    vec3 p = v3_load(hit->position);
    vec3 turned = affine_vector(&instance->to_world, p), world = v3_add(turned, instance->translation);
    v3_store(hit->position, world);
    /* S_a x S_b under M is det(M) M^-T (S_a x S_b). */
    v3_store(hit->ng,
             v3_scale(v3_normalize(affine_normal(&instance->inverse, v3_load(hit->ng))), instance->sign));
    v3_store(hit->ns,
             v3_scale(v3_normalize(affine_normal(&instance->inverse, v3_load(hit->ns))), instance->sign));
    /* What was uncertain before is stretched; then the rounding of M p + translation; then that of
     * taking a ray which starts here back into the object's space, seen from the world. */
    hit->error = hit->error * instance->norm + 0x1p-51 * (instance->norm * v3_length(p) + v3_length(world)) +
                 0x1p-51 * instance->norm * instance->inverse_norm * v3_length(turned);
}
