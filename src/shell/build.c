/* Per-triangle data: range of |N|, folds, degenerate triangles; and boxes. */
#include "math/poly.h"
#include "shell/heights.h"

#include <string.h>

/* A shell counts as folded already where its volume element falls to this fraction of its largest
 * value: inversion is badly conditioned there. */
static const double FOLD_MARGIN = 0.01;
/* Frusta narrow towards their apex on purpose, and stay invertible up to it: captured reliefs come close. */
static const double FOLD_MARGIN_DIRECTIONS = 1e-5;
/* Interpolated normals shorter than this are as good as opposing. */
static const double LEAST_NORMAL = 1e-3;

/* Distance from the origin to the segment a b. */
static double segment_distance(vec3 a, vec3 b)
{
    vec3 d = v3_sub(b, a);
    double length = v3_dot(d, d), k = length > 0.0 ? -v3_dot(a, d) / length : 0.0;
    return v3_length(v3_mad(a, min_d(max_d(k, 0.0), 1.0), d));
}

/* Smallest |N| over the triangle: the distance from the origin to the triangle of the normals. */
static double least_normal(const triangle_frame *f)
{
    double least = min_d(segment_distance(f->n[0], f->n[1]),
                         min_d(segment_distance(f->n[1], f->n[2]), segment_distance(f->n[2], f->n[0])));
    vec3 plane = v3_cross(f->ne, f->nf);
    double area = v3_dot(plane, plane);
    if (area > 0.0) {
        /* Foot of the perpendicular from the origin, in barycentrics. */
        vec3 to = v3_neg(f->n[0]);
        double b1 = v3_dot(v3_cross(to, f->nf), plane) / area, b2 = v3_dot(v3_cross(f->ne, to), plane) / area;
        if (b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0)
            least = min_d(least, fabs(v3_dot(f->n[0], plane)) / sqrt(area));
    }
    return least * (1.0 - 1e-12);
}

static bool all_equal_normals(const triangle_frame *f)
{
    return v3_dot(f->ne, f->ne) == 0.0 && v3_dot(f->nf, f->nf) == 0.0;
}

/* n(s) . a for n(s) = (pe + s ne) x (pf + s nf), as a quadratic in s. */
static quadratic volume_quadratic(const triangle_frame *f, vec3 a)
{
    return (quadratic){{v3_dot(v3_cross(f->pe, f->pf), a),
                        v3_dot(v3_add(v3_cross(f->pe, f->nf), v3_cross(f->ne, f->pf)), a),
                        v3_dot(v3_cross(f->ne, f->nf), a)}};
}

/* det[P_a + s N_a, P_b + s N_b, N] is linear in the barycentrics through N: its sign over the shell
 * is that of the Bernstein coefficients of the three vertices' quadratics in s. */
static bool is_folded(const triangle_frame *f, double margin)
{
    double least = INFINITY, most = -INFINITY;
    for (int i = 0; i < 3; i++) {
        quadratic volume = volume_quadratic(f, f->n[i]);
        double b[3];
        quadratic_bernstein(&volume, f->s0, f->s1, b);
        for (int k = 0; k < 3; k++) {
            least = min_d(least, b[k]);
            most = max_d(most, b[k]);
        }
    }
    return !(least > margin * most) && !(most < margin * least);
}

/* No area at any height: the offset triangles at three heights are all degenerate, so the quadratic
 * is zero. Relative to the edges, so that small triangles are not mistaken for empty ones. */
static bool is_empty(const triangle_frame *f)
{
    for (int i = 0; i < 3; i++) {
        double s = i == 0 ? f->s0 : i == 1 ? f->s1 : 0.5 * (f->s0 + f->s1);
        vec3 e = v3_mad(f->pe, s, f->ne), g = v3_mad(f->pf, s, f->nf);
        if (v3_length(v3_cross(e, g)) > 1e-14 * v3_length(e) * v3_length(g)) return false;
    }
    return true;
}

static bool is_flat_uv(const triangle_frame *f)
{
    double area = fabs(f->xe * f->yf - f->xf * f->ye);
    double edge = max_d(f->xe * f->xe + f->ye * f->ye, f->xf * f->xf + f->yf * f->yf);
    return !(area > 1e-9 * edge) || edge < 1e-12;
}

/* Range of s = h / |N| for h in the shell's range, padded by more than the rounding of
 * g(s) = s |N| - h, so that g has a definite sign at both ends even where h is constant. */
static void set_height_range(const triangle_frame *f, shell *stored)
{
    double h0 = (double)stored->height_min, h1 = (double)stored->height_max;
    double n_min = 1.0, n_max = 1.0;
    if (!f->unnormalised) {
        n_min = (double)stored->normal_min;
        n_max =
            sqrt(max_d(v3_dot(f->n[0], f->n[0]), max_d(v3_dot(f->n[1], f->n[1]), v3_dot(f->n[2], f->n[2]))));
    }
    double s0 = h0 < 0.0 ? h0 / n_min : h0 / n_max, s1 = h1 > 0.0 ? h1 / n_min : h1 / n_max;
    double pad = 1e-9 * max_d(fabs(s0), fabs(s1)) + 1e-13 * f->size;
    stored->s_min = float_down(s0 - pad);
    stored->s_max = float_up(s1 + pad);
}

static double offset_area(const triangle_frame *f, double s)
{
    return v3_length(v3_cross(v3_mad(f->pe, s, f->ne), v3_mad(f->pf, s, f->nf)));
}

void shell_shape(const shell_space *space, const height_lod *lod, uint32_t triangle)
{
    shell *stored = &space->shells[triangle];
    stored->flags = 0;
    triangle_frame f;
    triangle_frame_load(space, triangle, lod, &f);
    double least = least_normal(&f);
    stored->normal_min = space->unnormalised ? 1.0f : float_down(max_d(least, LEAST_NORMAL));
    set_height_range(&f, stored);
    f.s0 = (double)stored->s_min;
    f.s1 = (double)stored->s_max;
    stored->area = float_up((1.0 + 1e-9) * max_d(offset_area(&f, f.s0), offset_area(&f, f.s1)));
    unsigned flags = 0;
    if (is_empty(&f))
        flags |= SHELL_EMPTY;
    else if (is_folded(&f, space->directions ? FOLD_MARGIN_DIRECTIONS : FOLD_MARGIN) ||
             (!space->unnormalised && least < LEAST_NORMAL))
        flags |= SHELL_FOLDED;
    if (is_flat_uv(&f)) flags |= SHELL_FLAT_UV;
    if (all_equal_normals(&f)) flags |= SHELL_CONSTANT_NORMAL;
    stored->flags = (uint16_t)flags;
}

static void build_range(void *user, size_t begin, size_t end, int32_t thread)
{
    const shell_space *space = user;
    (void)thread;
    height_lod lod;
    height_lod_make(space, 0.0, &lod);
    for (size_t t = begin; t < end; t++) {
        shell_heights(space, (uint32_t)t, &space->shells[t]);
        shell_shape(space, &lod, (uint32_t)t);
    }
}

/* Length of a texel of level 0 on the base mesh: square root of area over texels. */
static double mean_texel_size(const shell_space *space)
{
    double area = 0.0, texels = 0.0;
    height_lod lod;
    height_lod_make(space, 0.0, &lod);
    for (uint32_t t = 0; t < space->mesh.triangle_count; t++) {
        triangle_frame f;
        triangle_frame_load(space, t, &lod, &f);
        area += v3_length(v3_cross(f.pe, f.pf));
        texels += fabs(f.xe * f.yf - f.xf * f.ye);
    }
    return texels > 0.0 ? sqrt(area / texels) : 0.0;
}

static knurl_status check_uv(const shell_space *space, knurl_error *error)
{
    for (uint32_t v = 0; v < space->mesh.vertex_count; v++) {
        const float *st = space->mesh.texcoords + 2 * (size_t)v;
        vec2 uv = shell_uv(space, (double)st[0], (double)st[1]);
        if (!(fabs(uv.x) < 0x1p20 && fabs(uv.y) < 0x1p20))
            return knurl_fail(error, KNURL_ERROR_INPUT,
                              "vertex %u: map coordinates (%g, %g), expected magnitudes under 2^20", v, uv.x,
                              uv.y);
    }
    return KNURL_OK;
}

knurl_status shell_space_build(shell_space *space, knurl_error *error)
{
    knurl_status status = check_uv(space, error);
    if (status != KNURL_OK) return status;
    space->shells = knurl_alloc_array(space->context, space->mesh.triangle_count, sizeof *space->shells);
    if (!space->shells)
        return knurl_fail_memory(error, space->mesh.triangle_count * sizeof *space->shells, "shells");
    if (space->mesh.triangle_count)
        memset(space->shells, 0, space->mesh.triangle_count * sizeof *space->shells);
    knurl_parallel_for(space->context, space->mesh.triangle_count, 256, build_range, space);
    space->texel_size = mean_texel_size(space);
    return KNURL_OK;
}

bool shell_box(const shell_space *space, uint32_t triangle, double lower[3], double upper[3])
{
    const shell *stored = &space->shells[triangle];
    if (stored->flags & SHELL_EMPTY) return false;
    height_lod lod;
    height_lod_make(space, 0.0, &lod);
    triangle_frame f;
    triangle_frame_load(space, triangle, &lod, &f);
    vec3 lo = f.p[0], hi = f.p[0];
    for (int i = 0; i < 3; i++) {
        /* F is affine in b at fixed s and in s at fixed b: the corners bound it. */
        vec3 low = v3_mad(f.p[i], f.s0, f.n[i]), high = v3_mad(f.p[i], f.s1, f.n[i]);
        lo = v3_min(lo, v3_min(low, high));
        hi = v3_max(hi, v3_max(low, high));
    }
    if (stored->flags & SHELL_FOLDED && !space->unnormalised &&
        (double)stored->normal_min <= 2.0 * LEAST_NORMAL) {
        /* |N| reaches zero: only |S - P| <= |h| is left. */
        double h = max_d(fabs((double)stored->height_min), fabs((double)stored->height_max));
        lo = v3_sub(v3_min(f.p[0], v3_min(f.p[1], f.p[2])), v3(h, h, h));
        hi = v3_add(v3_max(f.p[0], v3_max(f.p[1], f.p[2])), v3(h, h, h));
    }
    double pad = 1e-12 * (f.size + v3_max_component(v3_max(v3_abs(lo), v3_abs(hi)))) +
                 4e-16 * v3_max_component(v3_abs(f.base));
    v3_store(lower, v3_add(f.base, v3_sub(lo, v3(pad, pad, pad))));
    v3_store(upper, v3_add(f.base, v3_add(hi, v3(pad, pad, pad))));
    return true;
}
