/* From a root to a hit: polishing, position, normals and error bound. */
#include "shell/shell.h"

#include <float.h>

/* The surface and its derivatives along the barycentrics b1 and b2. */
typedef struct surface_point {
    vec3 n;           /* N / |N|, or N for the unnormalised variant */
    double h, ha, hb; /* height and its derivatives */
    vec3 s, sa, sb;   /* S relative to vertex 0, and its derivatives */
    vec3 va, vb;      /* derivatives of the surface at constant height h */
} surface_point;

static surface_point surface_at(const triangle_frame *f, const height_patch *patch, double b1, double b2)
{
    surface_point p;
    double x = f->x[0] + b1 * f->xe + b2 * f->xf, y = f->y[0] + b1 * f->ye + b2 * f->yf;
    double dx = x - patch->x, dy = y - patch->y;
    double hx = patch->cx + patch->cxy * dy, hy = patch->cy + patch->cxy * dx;
    p.h = height_patch_at(patch, x, y);
    p.ha = hx * f->xe + hy * f->ye;
    p.hb = hx * f->xf + hy * f->yf;
    vec3 n = v3_mad(v3_mad(f->n[0], b1, f->ne), b2, f->nf), na = f->ne, nb = f->nf;
    if (!f->unnormalised) {
        double inverse = 1.0 / v3_length(n);
        n = v3_scale(n, inverse);
        na = v3_scale(v3_mad(na, -v3_dot(n, na), n), inverse);
        nb = v3_scale(v3_mad(nb, -v3_dot(n, nb), n), inverse);
    }
    p.n = n;
    p.s = v3_mad(v3_mad(v3_scale(f->pe, b1), b2, f->pf), p.h, n);
    p.va = v3_mad(f->pe, p.h, na);
    p.vb = v3_mad(f->pf, p.h, nb);
    p.sa = v3_mad(p.va, p.ha, n);
    p.sb = v3_mad(p.vb, p.hb, n);
    return p;
}

void shell_root_polish(const triangle_frame *f, const knurl_ray *ray, shell_root *root)
{
    vec3 direction = v3_load(ray->direction), origin = v3_sub(v3_load(ray->origin), f->base);
    double best = INFINITY;
    for (int i = 0; i < 4; i++) {
        surface_point p = surface_at(f, &root->patch, root->b1, root->b2);
        vec3 residual = v3_sub(v3_mad(origin, root->t, direction), p.s);
        double size = v3_length(residual);
        if (!(size < 0.5 * best)) return;
        best = size;
        vec3 cross = v3_cross(p.sb, direction);
        double det = v3_dot(p.sa, cross);
        /* Close to a tangency Newton is no better than the bracketed root. */
        if (fabs(det) < 1e-7 * v3_length(p.sa) * v3_length(p.sb) * v3_length(direction)) return;
        double db1 = v3_dot(residual, cross) / det;
        double db2 = v3_dot(p.sa, v3_cross(residual, direction)) / det;
        double dt = -v3_dot(p.sa, v3_cross(p.sb, residual)) / det;
        /* A polish moves by rounding; anything larger means that this is not the same root. */
        if (!(fabs(db1) + fabs(db2) < 1e-5)) return;
        root->b1 += db1;
        root->b2 += db2;
        root->t += dt;
        root->x += db1 * f->xe + db2 * f->xf;
        root->y += db1 * f->ye + db2 * f->yf;
    }
}

/* S at barycentrics, relative to vertex 0, without derivatives. */
static vec3 surface_position(const triangle_frame *f, const height_patch *patch, double b1, double b2)
{
    double x = f->x[0] + b1 * f->xe + b2 * f->xf, y = f->y[0] + b1 * f->ye + b2 * f->yf;
    vec3 n = v3_mad(v3_mad(f->n[0], b1, f->ne), b2, f->nf);
    double h = height_patch_at(patch, x, y);
    if (!f->unnormalised) h /= v3_length(n);
    return v3_mad(v3_mad(v3_scale(f->pe, b1), b2, f->pf), h, n);
}

/* The derivatives are those of the start: from a start that is off by e steps shrink to the order of e^2,
 * then by a factor of order e each. */
bool shell_root_solve(const triangle_frame *f, const knurl_ray *ray, shell_root *root, double error[2])
{
    vec3 direction = v3_load(ray->direction), origin = v3_load(ray->origin);
    vec3 relative = v3_sub(origin, f->base);
    surface_point p = surface_at(f, &root->patch, root->b1, root->b2);
    vec3 cross = v3_cross(p.sb, direction), other = v3_cross(direction, p.sa), normal = v3_cross(p.sb, p.sa);
    double det = v3_dot(p.sa, cross), cross_square = v3_dot(cross, cross);
    if (!(det * det > 1e-12 * v3_dot(p.sa, p.sa) * cross_square)) return false;
    double inverse = 1.0 / det;
    double size = v3_max_component(v3_abs(origin)) + v3_max_component(v3_abs(f->base)) + f->size + fabs(p.h) +
                  fabs(root->t) * v3_max_component(v3_abs(direction));
    double rounding = 8.0 * DBL_EPSILON * size * fabs(inverse);
    error[0] = rounding * sqrt(cross_square) + 4.0 * DBL_EPSILON;
    error[1] = rounding * v3_length(other) + 4.0 * DBL_EPSILON;
    double before = INFINITY;
    vec3 s = p.s;
    for (int i = 0; i < 12; i++) {
        vec3 residual = v3_sub(v3_mad(relative, root->t, direction), s);
        double db1 = v3_dot(residual, cross) * inverse, db2 = v3_dot(residual, other) * inverse;
        root->b1 += db1;
        root->b2 += db2;
        root->t += v3_dot(residual, normal) * inverse;
        double step = fabs(db1) + fabs(db2);
        /* What is left is this step times how much shorter it was than the last. */
        if (step <= 0.125 * min_d(error[0], error[1]) || (i > 0 && step * step <= before * 1e-17)) {
            root->x = f->x[0] + root->b1 * f->xe + root->b2 * f->xf;
            root->y = f->y[0] + root->b1 * f->ye + root->b2 * f->yf;
            return true;
        }
        if (!(step < 0.5 * before) || !(fabs(root->b1) < 4.0 && fabs(root->b2) < 4.0)) return false;
        before = step;
        s = surface_position(f, &root->patch, root->b1, root->b2);
    }
    return false;
}

/* Height at any position of the frame's texels: the piece there is found anew. */
static double height_anywhere(const shell_space *space, const height_lod *lod, const triangle_frame *f,
                              double x, double y)
{
    height_patch patch;
    height_patch_find(space, lod, f, x, y, &patch);
    return height_patch_at(&patch, x, y);
}

/* Bilinear in a cell of nine samples, (i, j) from 0 to 1. */
static double among_nine(const double h[9], int i, int j, double x, double y)
{
    const double *c = h + 3 * j + i;
    double top = c[0] + x * (c[1] - c[0]), bottom = c[3] + x * (c[4] - c[3]);
    return top + y * (bottom - top);
}

/* Central differences of the height over one texel. Of one level of detail the four places share nine
 * samples. */
static void height_gradient(const shell_space *space, const height_lod *lod, const triangle_frame *f,
                            double x, double y, double *hx, double *hy)
{
    if (lod->blend > 0.0) {
        *hx = height_anywhere(space, lod, f, x + 0.5, y) - height_anywhere(space, lod, f, x - 0.5, y);
        *hy = height_anywhere(space, lod, f, x, y + 0.5) - height_anywhere(space, lod, f, x, y - 0.5);
        return;
    }
    double left = floor_d(x - 0.5), top = floor_d(y - 0.5), h[9];
    double k = height_fetch_nine(lod->level[0], f->wrapped_x + (int64_t)left, f->wrapped_y + (int64_t)top,
                                 space->wrap_u, space->wrap_v, h);
    double dx = x - left, dy = y - top; /* in [0.5, 1.5) */
    int i = dx >= 1.0, j = dy >= 1.0;
    double ax = dx - 0.5, ay = dy - 0.5, ix = dx - (double)i, iy = dy - (double)j;
    *hx = (among_nine(h, 1, j, ax, iy) - among_nine(h, 0, j, ax, iy)) * k * space->factor;
    *hy = (among_nine(h, i, 1, ix, ay) - among_nine(h, i, 0, ix, ay)) * k * space->factor;
}

/* PDM 2025, Eq. 10 with N_s from its Eq. 15, everything divided by the area of the base so that N_g
 * and N' are unit: N'_s = N' + (h_b (V_a x N') + h_a (N' x V_b)) / |V_a x V_b|. V are the tangents at
 * the hit's height, where PDM uses the base's: equal for small heights, right for large ones. The
 * height's gradient is the central difference over one texel, which is continuous. */
static vec3 smooth_normal(const shell_space *space, const height_lod *lod, const triangle_frame *f,
                          const shell_root *root, const surface_point *p, vec3 ng)
{
    double hx, hy;
    height_gradient(space, lod, f, root->x, root->y, &hx, &hy);
    double ha = hx * f->xe + hy * f->ye, hb = hx * f->xf + hy * f->yf;
    vec3 base = v3_cross(p->va, p->vb);
    if (space->directions) {
        /* S_a x S_b with the smooth gradient. Eq. 10 takes N for the normal of a smooth base, but directions
         * only say where heights point: in a frustum they lean over by half its angle. */
        vec3 tilt = v3_add(v3_scale(v3_cross(p->va, p->n), hb), v3_scale(v3_cross(p->n, p->vb), ha));
        vec3 n = v3_normalize(v3_add(base, tilt));
        return v3_dot(n, n) > 0.0 ? n : ng;
    }
    vec3 unit = v3_normalize(p->n);
    double area = v3_dot(base, unit);
    if (!(fabs(area) > 1e-6 * v3_length(p->va) * v3_length(p->vb))) return ng;
    vec3 gradient = v3_add(v3_scale(v3_cross(p->va, unit), hb), v3_scale(v3_cross(unit, p->vb), ha));
    vec3 n = v3_normalize(v3_mad(unit, 1.0 / area, gradient));
    /* The base's winding decides the side, as it does for ng. */
    if (area < 0.0) n = v3_neg(n);
    return v3_dot(n, n) > 0.0 ? n : ng;
}

void shell_hit_fill(const shell_space *space, const height_lod *lod, const triangle_frame *f,
                    uint32_t triangle, const knurl_ray *ray, const shell_root *root, knurl_hit *hit)
{
    surface_point p = surface_at(f, &root->patch, root->b1, root->b2);
    vec3 position = v3_add(f->base, p.s);
    vec3 ng = v3_normalize(v3_cross(p.sa, p.sb));
    if (!(v3_dot(ng, ng) > 0.0)) ng = v3_normalize(p.n);
    const uint32_t *v = space->mesh.triangles + 3 * (size_t)triangle;
    const float *st = space->mesh.texcoords;
    double weights[3] = {1.0 - root->b1 - root->b2, root->b1, root->b2};
    hit->t = root->t;
    hit->a = root->b1;
    hit->b = root->b2;
    hit->st[0] = hit->st[1] = 0.0;
    for (int i = 0; i < 3; i++) {
        hit->st[0] += weights[i] * (double)st[2 * (size_t)v[i]];
        hit->st[1] += weights[i] * (double)st[2 * (size_t)v[i] + 1];
    }
    vec2 uv = shell_uv(space, hit->st[0], hit->st[1]);
    hit->uv[0] = uv.x;
    hit->uv[1] = uv.y;
    hit->height = p.h;
    hit->triangle = triangle;
    v3_store(hit->position, position);
    v3_store(hit->ng, ng);
    v3_store(hit->ns, smooth_normal(space, lod, f, root, &p, ng));
    /* Rounding of the sum that makes the position, plus how far the root is off the ray. */
    vec3 on_ray = v3_mad(v3_load(ray->origin), root->t, v3_load(ray->direction));
    double rounding = 32.0 * DBL_EPSILON *
                      (v3_max_component(v3_abs(f->base)) + f->size + fabs(p.h) +
                       v3_max_component(v3_abs(v3_load(ray->origin))) +
                       fabs(root->t) * v3_max_component(v3_abs(v3_load(ray->direction))));
    hit->error = rounding + v3_length(v3_sub(on_ray, position));
}
