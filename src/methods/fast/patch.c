/* What base triangles and their parts know of themselves in floats; see fast.h. */
#include "methods/fast/fast.h"

#include <string.h>

/* Parts on which the iteration converges worse are searched. */
static const double MOST_ACROSS = 0.6, MOST_FACTOR = 0.3;
enum { MOST_ITERATIONS = 6 };
/* A few roundings of floats. Products here have two to four factors. */
static const double ROUNDING = 0x1p-21;

/* Barycentrics are affine in the frame's texels: value at (0, 0), along x, along y. */
static void barycentric_planes(const triangle_frame *f, double planes[3][3])
{
    const double *m = f->inverse_uv;
    double b1 = -(m[0] * f->x[0] + m[1] * f->y[0]), b2 = -(m[2] * f->x[0] + m[3] * f->y[0]);
    const double all[3][3] = {
        {1.0 - b1 - b2, -m[0] - m[2], -m[1] - m[3]}, {b1, m[0], m[1]}, {b2, m[2], m[3]}};
    memcpy(planes, all, sizeof all);
}

static void set_edges(const triangle_frame *f, fast_patch *patch)
{
    double planes[3][3], reach[2] = {1.0, 1.0};
    barycentric_planes(f, planes);
    for (int i = 0; i < 3; i++) {
        reach[0] = max_d(reach[0], fabs(f->x[i]) + 1.0);
        reach[1] = max_d(reach[1], fabs(f->y[i]) + 1.0);
    }
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) patch->edge[k][i] = (float)planes[i][k];
        patch->edge_error[i] = float_up(
            ROUNDING * (fabs(planes[i][0]) + fabs(planes[i][1]) * reach[0] + fabs(planes[i][2]) * reach[1]));
    }
    patch->edge[0][3] = 1.0f;
}

static void set_vector(float *to, vec3 v)
{
    to[0] = (float)v.x;
    to[1] = (float)v.y;
    to[2] = (float)v.z;
}

/* N at texel (0, 0) of the frame, and per texel. */
static void normal_vectors(const triangle_frame *f, vec3 n[3])
{
    double b[3][3];
    barycentric_planes(f, b);
    n[0] = v3_mad(v3_mad(f->n[0], b[1][0], f->ne), b[2][0], f->nf);
    n[1] = v3_mad(v3_scale(f->ne, b[1][1]), b[2][1], f->nf);
    n[2] = v3_mad(v3_scale(f->ne, b[1][2]), b[2][2], f->nf);
}

/* |N| is taken as 1 in the unnormalised variant: any unit vector will do. */
static void set_normals(const triangle_frame *f, fast_patch *patch)
{
    patch->normal_most = 1.001f;
    if (f->unnormalised) {
        patch->normal[0][2] = 1.0f;
        return;
    }
    vec3 n[3];
    normal_vectors(f, n);
    double most = 1.0;
    for (int i = 0; i < 3; i++) {
        set_vector(patch->normal[i], n[i]);
        most = max_d(most, v3_length(f->n[i]));
    }
    patch->normal_most = float_up(most * 1.001);
    patch->normal_move = float_up(1.001 * max_d(v3_length(n[1]), v3_length(n[2])));
}

void fast_patch_make(const triangle_frame *f, fast_patch *patch)
{
    *patch = (fast_patch){0};
    if (f->flags & (SHELL_EMPTY | SHELL_FOLDED | SHELL_FLAT_UV)) {
        patch->flags = FAST_SEARCHED;
        return;
    }
    set_edges(f, patch);
    set_normals(f, patch);
}

/* Vectors of a part's frame, in the trees' space, per texel. */
typedef struct axes {
    vec3 origin;     /* F at the centre and middle */
    vec3 ex, ey, es; /* columns of J */
    vec3 nx, ny;
    double reach[3]; /* largest |x|, |y|, |s| from there on the part */
} axes;

/* The centre is that of where the triangle is on the part. */
static void find_axes(const fast_data *data, const triangle_frame *f, const fast_part *part, axes *a)
{
    double side = (double)(16 << (2 * part->level)) / 255.0;
    double x0 = side * part->from_x, x1 = side * part->to_x, y0 = side * part->from_y, y1 = side * part->to_y;
    double x = (double)part->corner_x + 0.5 * (x0 + x1), y = (double)part->corner_y + 0.5 * (y0 + y1);
    double s = (double)(0.5f * (part->s_min + part->s_max)) / data->scale, b[3][3];
    barycentric_planes(f, b);
    double b1 = b[1][0] + b[1][1] * x + b[1][2] * y, b2 = b[2][0] + b[2][1] * x + b[2][2] * y;
    vec3 px = v3_mad(v3_scale(f->pe, b[1][1]), b[2][1], f->pf);
    vec3 py = v3_mad(v3_scale(f->pe, b[1][2]), b[2][2], f->pf);
    a->nx = v3_mad(v3_scale(f->ne, b[1][1]), b[2][1], f->nf);
    a->ny = v3_mad(v3_scale(f->ne, b[1][2]), b[2][2], f->nf);
    a->es = v3_mad(v3_mad(f->n[0], b1, f->ne), b2, f->nf);
    vec3 p = v3_mad(v3_mad(v3_scale(f->pe, b1), b2, f->pf), s, a->es);
    a->origin = v3_scale(v3_add(v3_sub(f->base, v3_load(data->centre)), p), data->scale);
    a->ex = v3_scale(v3_mad(px, s, a->nx), data->scale);
    a->ey = v3_scale(v3_mad(py, s, a->ny), data->scale);
    a->reach[0] = 0.5 * (x1 - x0) + 1.0;
    a->reach[1] = 0.5 * (y1 - y0) + 1.0;
    a->reach[2] = 0.5 * (double)(part->s_max - part->s_min) * (1.0 + 1e-6);
}

/* How the iteration of fast.h converges on a part. */
typedef struct convergence {
    double
        across; /* largest |d_s K| of the 2 x 2 system for d_x and d_y; its inverse is under 1 / (1 - this) */
    double factor; /* by which each iteration brings d_s nearer */
    double lever;  /* how much an error of d_s moves d_x and d_y */
} convergence;

static convergence find_convergence(const axes *a, const vec3 k[2])
{
    convergence c;
    /* A tenth more than the part, as the curve is followed a little beyond it. */
    double x = 1.1 * a->reach[0], y = 1.1 * a->reach[1], s = 1.1 * a->reach[2];
    c.across = s * max_d(fabs(k[0].x) + fabs(k[1].x), fabs(k[0].y) + fabs(k[1].y));
    double mx = fabs(k[0].x) * x + fabs(k[1].x) * y, my = fabs(k[0].y) * x + fabs(k[1].y) * y;
    c.lever = max_d(mx, my) / max_d(1.0 - c.across, 1e-3);
    c.factor = fabs(k[0].z) * x + fabs(k[1].z) * y + s * (fabs(k[0].z) + fabs(k[1].z)) * c.lever;
    return c;
}

/* Bounds on what rounding and the last iteration leave, and how many iterations that takes. */
static bool set_errors(const axes *a, const double inverse[3][3], const convergence *c, fast_part *part)
{
    vec3 far = v3_mad(
        v3_mad(v3_scale(v3_abs(a->ex), a->reach[0]), a->reach[1], v3_abs(a->ey)), a->reach[2],
        v3_add(v3_abs(a->es), v3_mad(v3_scale(v3_abs(a->nx), a->reach[0]), a->reach[1], v3_abs(a->ny))));
    /* Any coordinate may hold all of a distance, which cancels in another. */
    double radius = v3_length(far), rounding[3];
    /* Of the d_s that d_x and d_y are from; the last d_s is nearer by another factor. */
    double left = c->factor * a->reach[2];
    part->iterations = c->factor > 0.0 || c->across > 0.0;
    for (; left * c->lever > 1e-3 && part->iterations < MOST_ITERATIONS; part->iterations++)
        left *= c->factor;
    for (int i = 0; i < 3; i++) {
        rounding[i] = a->reach[i] + 0x1p-22;
        for (int j = 0; j < 3; j++) rounding[i] += fabs(inverse[i][j]) * radius;
        rounding[i] *= 2.0 * ROUNDING;
    }
    double s = rounding[2] + c->factor * left, amplified = 1.0 / (1.0 - c->across);
    double most = max_d(rounding[0], rounding[1]);
    part->error[0] =
        float_up((c->across > 0.0 ? most * amplified : rounding[0]) + (rounding[2] + left) * c->lever);
    part->error[1] =
        float_up((c->across > 0.0 ? most * amplified : rounding[1]) + (rounding[2] + left) * c->lever);
    part->error[2] = float_up(s);
    return isfinite(part->error[2]) && part->error[0] < 1.0f && part->error[1] < 1.0f;
}

/* The origin is rounded to floats, and the centre moved to where that is. The remaining error of s, of 2^-24,
 * is in the errors. */
static void set_origin(const axes *a, const double inverse[3][3], double x, double y, fast_part *part)
{
    set_vector(part->origin, a->origin);
    double move[3] = {(double)part->origin[0] - a->origin.x, (double)part->origin[1] - a->origin.y,
                      (double)part->origin[2] - a->origin.z};
    double dx = 0.0, dy = 0.0, ds = 0.0;
    for (int j = 0; j < 3; j++) {
        dx += inverse[0][j] * move[j];
        dy += inverse[1][j] * move[j];
        ds += inverse[2][j] * move[j];
    }
    part->centre[0] = (float)(x + dx);
    part->centre[1] = (float)(y + dy);
    part->error[2] = float_up((double)part->error[2] + fabs(ds));
}

static bool set_frame(const fast_data *data, const triangle_frame *f, fast_part *part)
{
    axes a;
    find_axes(data, f, part, &a);
    vec3 yz = v3_cross(a.ey, a.es), zx = v3_cross(a.es, a.ex), xy = v3_cross(a.ex, a.ey);
    double det = v3_dot(a.ex, yz);
    if (!(fabs(det) > 1e-12 * v3_length(a.ex) * v3_length(yz)) || !isfinite(1.0 / det)) return false;
    vec3 rows[3] = {v3_scale(yz, 1.0 / det), v3_scale(zx, 1.0 / det), v3_scale(xy, 1.0 / det)};
    double inverse[3][3];
    bool fits = true;
    for (int i = 0; i < 3; i++) v3_store(inverse[i], rows[i]);
    for (int j = 0; j < 3; j++) {
        set_vector(part->inverse[j], v3(inverse[0][j], inverse[1][j], inverse[2][j]));
        for (int i = 0; i < 3; i++) fits = fits && isfinite(part->inverse[j][i]);
    }
    vec3 k[2] = {v3(v3_dot(rows[0], a.nx), v3_dot(rows[1], a.nx), v3_dot(rows[2], a.nx)),
                 v3(v3_dot(rows[0], a.ny), v3_dot(rows[1], a.ny), v3_dot(rows[2], a.ny))};
    set_vector(part->bend_x, k[0]);
    set_vector(part->bend_y, k[1]);
    convergence c = find_convergence(&a, k);
    double side = (double)(16 << (2 * part->level)) / 510.0;
    fits = fits && c.across <= MOST_ACROSS && c.factor <= MOST_FACTOR;
    if (!fits || !set_errors(&a, inverse, &c, part)) return false;
    set_origin(&a, inverse, side * (part->from_x + part->to_x), side * (part->from_y + part->to_y), part);
    return true;
}

void fast_part_frame(const fast_data *data, const triangle_frame *f, fast_part *part)
{
    part->flags &= (uint16_t)~FAST_SEARCHED;
    if (!set_frame(data, f, part)) part->flags |= FAST_SEARCHED;
}

typedef struct patch_job {
    const shell_space *space;
    fast_data *data;
} patch_job;

static void build_patches(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const patch_job *job = user;
    height_lod lod;
    height_lod_make(job->space, 0.0, &lod);
    for (size_t t = begin; t < end; t++) {
        triangle_frame f;
        triangle_frame_load(job->space, (uint32_t)t, &lod, &f);
        fast_patch_make(&f, &job->data->patches[t]);
    }
}

knurl_status fast_patches_build(const shell_space *space, fast_data *data, knurl_error *error)
{
    size_t count = space->mesh.triangle_count;
    data->patches = knurl_alloc_array(space->context, count, sizeof *data->patches);
    if (!data->patches) return knurl_fail_memory(error, count * sizeof *data->patches, "frames");
    patch_job job = {space, data};
    knurl_parallel_for(space->context, count, 64, build_patches, &job);
    return KNURL_OK;
}
