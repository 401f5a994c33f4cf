/* Plain triangle meshes. The test is that of Woop, Benthin and Wald, "Watertight Ray/Triangle
 * Intersection", JCGT 2(1), 2013, in double precision, with these differences:
 *  - No fallback to a wider type. An edge function x1 y2 - y1 x2 without contraction rounds its two
 *    products monotonically, so its computed sign is the true one or zero, never the wrong one; as
 *    zeros count for both neighbours, a ray through a closed fan of triangles always hits one.
 *  - Vertices are taken relative to the point where the ray enters the mesh's bounds, so that a far
 *    origin costs no precision.
 *  - t comes from the triangle's plane, which for grazing rays is better conditioned than the sum
 *    over barycentrics, and is then kept within the depths of the three vertices. */
#include "accel/mesh.h"

#include <string.h>

static knurl_status check_view(const knurl_mesh_view *view, knurl_error *error)
{
    if (!view) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "mesh is NULL");
    if (view->vertex_count > 0 && !view->positions)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "mesh positions are NULL, expected %u vertices",
                          view->vertex_count);
    if (view->triangle_count > 0 && !view->triangles)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "mesh triangles are NULL, expected %u",
                          view->triangle_count);
    if (view->triangle_count == KNURL_NO_HIT)
        return knurl_fail(error, KNURL_ERROR_LIMIT, "mesh has %u triangles, expected at most %u",
                          view->triangle_count, KNURL_NO_HIT - 1);
    for (size_t i = 0; i < 3 * (size_t)view->vertex_count; i++)
        if (!isfinite(view->positions[i]))
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "mesh vertex %zu: position %c is %g, expected a finite number", i / 3,
                              "xyz"[i % 3], (double)view -> positions[i]);
    for (size_t i = 0; i < 3 * (size_t)view->triangle_count; i++)
        if (view->triangles[i] >= view->vertex_count)
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "mesh triangle %zu: vertex index %zu is %u, expected under %u", i / 3, i % 3,
                              view->triangles[i], view->vertex_count);
    return KNURL_OK;
}

static void *copy_array(knurl_context *context, const void *from, size_t count, size_t size, uint64_t *bytes,
                        bool *failed)
{
    if (!from) return NULL;
    void *copy = knurl_alloc_array(context, count, size);
    if (!copy) {
        *failed = true;
        return NULL;
    }
    if (count) memcpy(copy, from, count * size);
    *bytes += (uint64_t)count * size;
    return copy;
}

/* Unit normals, zero where there is none; texture coordinates that later arithmetic can bear. */
static void clean_attributes(accel_mesh *mesh)
{
    for (size_t i = 0; mesh->normals && i < mesh->vertex_count; i++) {
        vec3 n = v3_loadf(mesh->normals + 3 * i);
        n = v3_finite(n) ? v3_normalize(n) : v3(0.0, 0.0, 0.0);
        mesh->normals[3 * i] = (float)n.x;
        mesh->normals[3 * i + 1] = (float)n.y;
        mesh->normals[3 * i + 2] = (float)n.z;
    }
    size_t replaced = 0;
    for (size_t i = 0; mesh->texcoords && i < 2 * (size_t)mesh->vertex_count; i++) {
        if (isfinite(mesh->texcoords[i])) continue;
        mesh->texcoords[i] = 0.0f;
        replaced++;
    }
    if (replaced)
        knurl_log(mesh->context, KNURL_LOG_WARNING,
                  "plain mesh: %zu texture coordinates are not finite, taken as 0", replaced);
}

knurl_status accel_mesh_create(knurl_context *context, const knurl_mesh_view *view, accel_mesh **out,
                               knurl_error *error)
{
    *out = NULL;
    knurl_status status = check_view(view, error);
    if (status != KNURL_OK) return status;
    accel_mesh *mesh = knurl_alloc_zero(context, sizeof *mesh);
    if (!mesh) return knurl_fail_memory(error, sizeof *mesh, "a mesh");
    mesh->context = knurl_context_retain(context);
    mesh->vertex_count = view->vertex_count;
    mesh->triangle_count = view->triangle_count;
    bool failed = false;
    size_t n = view->vertex_count;
    mesh->positions = copy_array(context, view->positions, n, 3 * sizeof(float), &mesh->bytes, &failed);
    mesh->normals = copy_array(context, view->normals, n, 3 * sizeof(float), &mesh->bytes, &failed);
    mesh->texcoords = copy_array(context, view->texcoords, n, 2 * sizeof(float), &mesh->bytes, &failed);
    mesh->triangles = copy_array(context, view->triangles, view->triangle_count, 3 * sizeof(uint32_t),
                                 &mesh->bytes, &failed);
    if (failed) {
        accel_mesh_release(mesh);
        return knurl_fail_memory(error, n * 8 * sizeof(float) + (size_t)view->triangle_count * 12, "a mesh");
    }
    clean_attributes(mesh);
    *out = mesh;
    return KNURL_OK;
}

void accel_mesh_release(accel_mesh *mesh)
{
    if (!mesh) return;
    knurl_context *context = mesh->context;
    knurl_free(context, mesh->positions);
    knurl_free(context, mesh->normals);
    knurl_free(context, mesh->texcoords);
    knurl_free(context, mesh->triangles);
    knurl_free(context, mesh);
    knurl_context_release(context);
}

static void load_vertices(const accel_mesh *mesh, uint32_t triangle, vec3 v[3])
{
    const uint32_t *index = mesh->triangles + 3 * (size_t)triangle;
    for (int i = 0; i < 3; i++) v[i] = v3_loadf(mesh->positions + 3 * (size_t)index[i]);
}

bool accel_mesh_bounds(const void *user, uint32_t triangle, accel_box *box)
{
    vec3 v[3];
    load_vertices(user, triangle, v);
    vec3 n = v3_cross(v3_sub(v[1], v[0]), v3_sub(v[2], v[0]));
    if (n.x == 0.0 && n.y == 0.0 && n.z == 0.0) return false;
    *box = (accel_box){v3_min(v[0], v3_min(v[1], v[2])), v3_max(v[0], v3_max(v[1], v[2]))};
    return true;
}

void accel_shear_make(const accel_segment *segment, vec3 centre, accel_shear *shear)
{
    v3_store(shear->origin, segment->origin);
    v3_store(shear->direction, segment->direction);
    v3_store(shear->centre, centre);
    shear->t0 = segment->t0;
    const double *d = shear->direction;
    int kz = fabs(d[0]) > fabs(d[1]) ? 0 : 1;
    if (fabs(d[2]) > fabs(d[kz])) kz = 2;
    shear->kz = kz;
    shear->kx = (kz + 1) % 3;
    shear->ky = (kz + 2) % 3;
    shear->sx = d[shear->kx] / d[kz];
    shear->sy = d[shear->ky] / d[kz];
    shear->sz = 1.0 / d[kz];
}

/* t, relative to the shear's origin, where the ray meets the plane of the triangle r[0..2]. */
static double plane_t(const accel_shear *shear, const vec3 r[3], const double depth[3])
{
    vec3 n = v3_cross(v3_sub(r[1], r[0]), v3_sub(r[2], r[0]));
    double t = v3_dot(n, r[0]) / v3_dot(n, v3_load(shear->direction));
    double nearest = fmin(depth[0], fmin(depth[1], depth[2])),
           farthest = fmax(depth[0], fmax(depth[1], depth[2]));
    /* Edge on, t may be anything, NaN included; between the vertices it is the best there is. */
    return fmin(fmax(t, nearest), farthest);
}

bool accel_mesh_intersect(const accel_mesh *mesh, uint32_t triangle, const accel_shear *shear, double tmin,
                          double tmax, double *t_out, double ab[2])
{
    const uint32_t *index = mesh->triangles + 3 * (size_t)triangle;
    vec3 r[3];
    double x[3], y[3], depth[3];
    for (int i = 0; i < 3; i++) {
        const float *p = mesh->positions + 3 * (size_t)index[i];
        /* Same arithmetic for a vertex in whichever triangle: neighbours see the same numbers. */
        double q[3];
        for (int k = 0; k < 3; k++) q[k] = ((double)p[k] - shear->centre[k]) - shear->origin[k];
        x[i] = q[shear->kx] - shear->sx * q[shear->kz];
        y[i] = q[shear->ky] - shear->sy * q[shear->kz];
        depth[i] = shear->sz * q[shear->kz];
        r[i] = v3_load(q);
    }
    double w0 = x[2] * y[1] - y[2] * x[1];
    double w1 = x[0] * y[2] - y[0] * x[2];
    double w2 = x[1] * y[0] - y[1] * x[0];
    if ((w0 < 0.0 || w1 < 0.0 || w2 < 0.0) && (w0 > 0.0 || w1 > 0.0 || w2 > 0.0)) return false;
    double sum = w0 + w1 + w2;
    if (sum == 0.0) return false;
    double t = shear->t0 + plane_t(shear, r, depth);
    if (!(t >= tmin && t <= tmax)) return false;
    *t_out = t;
    ab[0] = w1 / sum;
    ab[1] = w2 / sum;
    return true;
}

static void fill_attributes(const accel_mesh *mesh, const uint32_t *index, const double weight[3],
                            knurl_hit *hit)
{
    vec3 n = v3(0.0, 0.0, 0.0);
    double s = 0.0, t = 0.0;
    for (int i = 0; i < 3; i++) {
        if (mesh->normals) n = v3_mad(n, weight[i], v3_loadf(mesh->normals + 3 * (size_t)index[i]));
        if (mesh->texcoords) {
            s += weight[i] * (double)mesh->texcoords[2 * (size_t)index[i]];
            t += weight[i] * (double)mesh->texcoords[2 * (size_t)index[i] + 1];
        }
    }
    n = v3_normalize(n);
    if (v3_dot(n, n) > 0.0)
        v3_store(hit->ns, n);
    else
        memcpy(hit->ns, hit->ng, sizeof hit->ns);
    hit->uv[0] = hit->st[0] = s;
    hit->uv[1] = hit->st[1] = t;
}

void accel_mesh_fill_hit(const accel_mesh *mesh, uint32_t triangle, const double ab[2], knurl_hit *hit)
{
    vec3 v[3];
    load_vertices(mesh, triangle, v);
    vec3 e1 = v3_sub(v[1], v[0]), e2 = v3_sub(v[2], v[0]), n = v3_cross(e1, e2);
    const double weight[3] = {1.0 - ab[0] - ab[1], ab[0], ab[1]};
    v3_store(hit->position, v3_mad(v3_mad(v[0], ab[0], e1), ab[1], e2));
    v3_store(hit->ng, v3_normalize(n));
    /* Rounding of the sum above, and that of the plane (n is good to about 2^-52 |e1| |e2| / |n|)
     * which the test of a ray that starts here will meet. The ratio is capped: slivers that thin
     * are edges for every purpose. */
    double reach = fmax(v3_max_component(v3_abs(v[0])),
                        fmax(v3_max_component(v3_abs(v[1])), v3_max_component(v3_abs(v[2]))));
    double e = fmax(v3_length(e1), v3_length(e2)), ratio = fmin(e * e / v3_length(n), 0x1p20);
    hit->error = 0x1p-50 * (reach + e * (1.0 + ratio));
    hit->a = ab[0];
    hit->b = ab[1];
    hit->height = 0.0;
    hit->triangle = triangle;
    fill_attributes(mesh, triangle * (size_t)3 + mesh->triangles, weight, hit);
}
