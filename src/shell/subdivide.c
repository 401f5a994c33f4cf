/* Roots of a ray on one displaced triangle by boxes alone: no inversion, no curve.
 *
 * The base triangle is divided in barycentric space. A piece's texture coordinates bound its heights,
 * heights and corners bound its points, and boxes that the ray misses are dropped. A piece that is
 * small and nearly affine holds at most one root per texel, found by Newton's method. This serves
 * folded shells, where a point may have several inverses, and rays the curve cannot follow. */
#include "shell/near.h"
#include "shell/shell.h"

#include <float.h>

/* Halvings: dividing a piece in four counts as two. Each level leaves at most three pieces waiting per
 * two halvings. */
enum { SUBDIVIDE_DEPTH = 88, SUBDIVIDE_STACK = 3 * SUBDIVIDE_DEPTH / 2 + 8 };
/* Where interpolated normals are shorter than this, opposing normals meet and S has no direction: such
 * pieces, thinner than this against the triangle, are not part of the surface. */
static const double NO_NORMAL = 1e-9;

/* Part of the base triangle: three corners in barycentrics. */
typedef struct piece {
    double b1[3], b2[3];
    int depth;
    bool turning; /* its normals turn by so much that they do not bound the surface: divide across that */
} piece;

typedef struct search {
    const shell_space *space;
    const height_lod *lod;
    const triangle_frame *f;
    knurl_bounds_kind kind;
    vec3 origin, direction, inverse; /* the ray, relative to vertex 0 */
    vec3 across1, across2;           /* orthonormal, across the direction */
    double pad;                      /* bound on the rounding of a box */
    double t0;                       /* ray parameter that depths count from */
    double tmin, tmax;               /* range of depth */
    bool found;
    shell_root root;
} search;

static vec3 at_corner(vec3 base, vec3 e, vec3 g, double b1, double b2)
{
    return v3_mad(v3_mad(base, b1, e), b2, g);
}

/* Box of S over a piece whose heights are in `h`. Sets p->turning. False if there is no surface. */
static bool piece_box(const search *s, piece *p, knurl_range h, vec3 *lower, vec3 *upper)
{
    const triangle_frame *f = s->f;
    vec3 position[3], normal[3];
    double longest = 0.0, move = 0.0;
    for (int i = 0; i < 3; i++) {
        position[i] = at_corner(v3(0.0, 0.0, 0.0), f->pe, f->pf, p->b1[i], p->b2[i]);
        normal[i] = at_corner(f->n[0], f->ne, f->nf, p->b1[i], p->b2[i]);
        longest = max_d(longest, v3_length(normal[i]));
        move = max_d(move, v3_length(v3_sub(normal[i], normal[0])));
    }
    double shortest = v3_length(normal[0]) - move, s0 = h.min, s1 = h.max;
    *lower = v3_min(position[0], v3_min(position[1], position[2]));
    *upper = v3_max(position[0], v3_max(position[1], position[2]));
    p->turning = !f->unnormalised && shortest < 0.25 * longest;
    if (!f->unnormalised && longest < NO_NORMAL) return false;
    if (!f->unnormalised && shortest < 1e-3 * longest) {
        double reach = max_d(fabs(h.min), fabs(h.max));
        *lower = v3_sub(*lower, v3(reach, reach, reach));
        *upper = v3_add(*upper, v3(reach, reach, reach));
    } else {
        if (!f->unnormalised) {
            s0 = h.min < 0.0 ? h.min / shortest : h.min / longest;
            s1 = h.max > 0.0 ? h.max / shortest : h.max / longest;
        }
        *lower = v3(INFINITY, INFINITY, INFINITY);
        *upper = v3_neg(*lower);
        for (int i = 0; i < 3; i++) {
            vec3 a = v3_mad(position[i], s0, normal[i]), b = v3_mad(position[i], s1, normal[i]);
            *lower = v3_min(*lower, v3_min(a, b));
            *upper = v3_max(*upper, v3_max(a, b));
        }
    }
    *lower = v3_sub(*lower, v3(s->pad, s->pad, s->pad));
    *upper = v3_add(*upper, v3(s->pad, s->pad, s->pad));
    return true;
}

static bool ray_meets_box(const search *s, vec3 lower, vec3 upper)
{
    vec3 a = v3_mul(v3_sub(lower, s->origin), s->inverse), b = v3_mul(v3_sub(upper, s->origin), s->inverse);
    vec3 near = v3_min(a, b), far = v3_max(a, b);
    double in = max_d(near.x, max_d(near.y, near.z)), out = min_d(far.x, min_d(far.y, far.z));
    double slack = 1e-14 * (fabs(in) + fabs(out));
    return in <= out + slack && in <= s->tmax + slack && out >= s->tmin - slack;
}

/* Surface and derivatives across the ray on the extension of one bilinear patch. */
typedef struct across {
    double r1, r2;         /* S - O across the ray */
    double a1, a2, c1, c2; /* derivatives along b1 (a) and b2 (c) */
    double depth;          /* (S - O) . D / |D|^2 */
    double x, y;
    double size; /* |S_a| + |S_b| */
} across;

static across across_at(const search *s, const height_patch *patch, double b1, double b2)
{
    const triangle_frame *f = s->f;
    across out;
    out.x = f->x[0] + b1 * f->xe + b2 * f->xf;
    out.y = f->y[0] + b1 * f->ye + b2 * f->yf;
    double dx = out.x - patch->x, dy = out.y - patch->y;
    double hx = patch->cx + patch->cxy * dy, hy = patch->cy + patch->cxy * dx;
    double h = height_patch_at(patch, out.x, out.y);
    double ha = hx * f->xe + hy * f->ye, hb = hx * f->xf + hy * f->yf;
    vec3 n = at_corner(f->n[0], f->ne, f->nf, b1, b2), na = f->ne, nb = f->nf;
    if (!f->unnormalised) {
        double inverse = 1.0 / max_d(v3_length(n), DBL_MIN);
        n = v3_scale(n, inverse);
        na = v3_scale(v3_mad(na, -v3_dot(n, na), n), inverse);
        nb = v3_scale(v3_mad(nb, -v3_dot(n, nb), n), inverse);
    }
    vec3 point = v3_mad(at_corner(v3(0.0, 0.0, 0.0), f->pe, f->pf, b1, b2), h, n);
    vec3 sa = v3_mad(v3_mad(f->pe, h, na), ha, n), sb = v3_mad(v3_mad(f->pf, h, nb), hb, n);
    vec3 relative = v3_sub(point, s->origin);
    out.r1 = v3_dot(relative, s->across1);
    out.r2 = v3_dot(relative, s->across2);
    out.a1 = v3_dot(sa, s->across1);
    out.a2 = v3_dot(sa, s->across2);
    out.c1 = v3_dot(sb, s->across1);
    out.c2 = v3_dot(sb, s->across2);
    out.depth = v3_dot(relative, s->direction) / v3_dot(s->direction, s->direction);
    out.size = v3_length(sa) + v3_length(sb);
    return out;
}

/* A piece seen along its longest and its shortest edge, which keep long, thin pieces well conditioned:
 * its points are center + k1 edge 1 + k2 edge 2. */
typedef struct piece_edges {
    double b1, b2;         /* the centre */
    double e1[2], e2[2];   /* (b1, b2) of the edges */
    double a1, a2, c1, c2; /* derivatives across the ray at the centre, along edge 1 (a) and edge 2 (c) */
    double r1, r2;         /* S - O across the ray at the centre */
    double spread1, spread2;
} piece_edges;

static void along_edges(const piece_edges *e, const across *at, double out[4])
{
    out[0] = at->a1 * e->e1[0] + at->c1 * e->e1[1];
    out[1] = at->a2 * e->e1[0] + at->c2 * e->e1[1];
    out[2] = at->a1 * e->e2[0] + at->c1 * e->e2[1];
    out[3] = at->a2 * e->e2[0] + at->c2 * e->e2[1];
}

/* The edges and the derivatives along them, with how far these differ over the piece from those at its
 * centre: the largest difference at the corners, with half as much again for what bends between them
 * (within one bilinear piece h_a and h_b are linear; only the normal's turn is not). */
static piece_edges make_edges(const search *s, const piece *p, const height_patch *patch)
{
    piece_edges e = {.b1 = (p->b1[0] + p->b1[1] + p->b1[2]) / 3.0,
                     .b2 = (p->b2[0] + p->b2[1] + p->b2[2]) / 3.0};
    double length[3], d[4];
    int longest = 0, shortest = 0;
    for (int i = 0; i < 3; i++) { /* edge i is opposite to corner i */
        int j = (i + 1) % 3, k = (i + 2) % 3;
        length[i] = fabs(p->b1[j] - p->b1[k]) + fabs(p->b2[j] - p->b2[k]);
        if (length[i] > length[longest]) longest = i;
        if (length[i] <= length[shortest]) shortest = i;
    }
    if (shortest == longest) shortest = (longest + 1) % 3;
    int common = 3 - longest - shortest; /* edge 1 ends at corner `shortest`, edge 2 at corner `longest` */
    e.e1[0] = p->b1[shortest] - p->b1[common];
    e.e1[1] = p->b2[shortest] - p->b2[common];
    e.e2[0] = p->b1[longest] - p->b1[common];
    e.e2[1] = p->b2[longest] - p->b2[common];
    across center = across_at(s, patch, e.b1, e.b2);
    along_edges(&e, &center, d);
    e.a1 = d[0], e.a2 = d[1], e.c1 = d[2], e.c2 = d[3];
    e.r1 = center.r1, e.r2 = center.r2;
    for (int i = 0; i < 3; i++) {
        across corner = across_at(s, patch, p->b1[i], p->b2[i]);
        along_edges(&e, &corner, d);
        e.spread1 = max_d(e.spread1, max_d(fabs(d[0] - e.a1), fabs(d[1] - e.a2)));
        e.spread2 = max_d(e.spread2, max_d(fabs(d[2] - e.c1), fabs(d[3] - e.c2)));
    }
    e.spread1 *= 1.5;
    e.spread2 *= 1.5;
    return e;
}

/* What a piece can be on one bilinear patch. */
typedef enum verdict { EXCLUDED, AT_MOST_ONE, DIVIDE, TOO_SMALL } verdict;

/* Range of w . (S - O) over the piece, w across the ray: the affine part at the corners plus the
 * spread of the derivatives. Whether it leaves out zero. */
static bool excludes_zero(const piece_edges *e, double w1, double w2, double pad, double *width)
{
    static const double corners[3][2] = {
        {-1.0 / 3.0, -1.0 / 3.0}, {2.0 / 3.0, -1.0 / 3.0}, {-1.0 / 3.0, 2.0 / 3.0}};
    double value = w1 * e->r1 + w2 * e->r2, along1 = w1 * e->a1 + w2 * e->a2,
           along2 = w1 * e->c1 + w2 * e->c2;
    double most = 0.0;
    for (int i = 0; i < 3; i++) {
        double k1 = corners[i][0], k2 = corners[i][1];
        most = max_d(most,
                     fabs(along1 * k1 + along2 * k2) + 2.0 * (e->spread1 * fabs(k1) + e->spread2 * fabs(k2)));
    }
    *width = most;
    return fabs(value) > most + pad;
}

/* Unit vector at half the angle of (c, s): the larger of its components first, which does not cancel. */
static void major_axis(double c, double s, double *w1, double *w2)
{
    double r = sqrt(c * c + s * s);
    *w1 = 1.0;
    *w2 = 0.0;
    if (!(r > 0.0)) return;
    double large = sqrt(0.5 * (r + fabs(c)) / r), small = 0.5 * s / (r * large);
    *w1 = c >= 0.0 ? large : fabs(small);
    *w2 = c >= 0.0 ? small : copysign(large, s);
}

/* Near a tangency the surface seen along the ray is thin in one direction: the left singular vector of
 * the smaller singular value of the derivative. Testing along it keeps the number of pieces bounded,
 * where boxes alone would need ever more of them. */
static verdict judge(const search *s, const piece *p, const piece_edges *e)
{
    double xx = e->a1 * e->a1 + e->c1 * e->c1, yy = e->a2 * e->a2 + e->c2 * e->c2,
           xy = e->a1 * e->a2 + e->c1 * e->c2;
    double w1, w2;
    major_axis(xx - yy, 2.0 * xy, &w1, &w2);
    double thin, wide;
    if (excludes_zero(e, -w2, w1, s->pad, &thin)) return EXCLUDED;
    if (excludes_zero(e, w1, w2, s->pad, &wide)) return EXCLUDED;
    /* Any derivative within the spread keeps the sign of the determinant: injective on the piece. */
    double det = e->a1 * e->c2 - e->a2 * e->c1;
    double change = e->spread1 * (fabs(e->c1) + fabs(e->c2)) + e->spread2 * (fabs(e->a1) + fabs(e->a2)) +
                    2.0 * e->spread1 * e->spread2;
    if (2.0 * change < fabs(det)) return AT_MOST_ONE;
    return !(thin >= s->pad) || p->depth >= SUBDIVIDE_DEPTH ? TOO_SMALL : DIVIDE;
}

static bool newton(const search *s, const height_patch *patch, double *b1, double *b2, across *at)
{
    double best = INFINITY;
    for (int i = 0; i < 30; i++) {
        *at = across_at(s, patch, *b1, *b2);
        double size = hypot(at->r1, at->r2), det = at->a1 * at->c2 - at->a2 * at->c1;
        if (i > 3 && !(size < 0.9 * best)) return size < 1e-10 * at->size || size <= s->pad;
        best = size;
        double d1 = -(at->r1 * at->c2 - at->r2 * at->c1) / det,
               d2 = -(at->a1 * at->r2 - at->a2 * at->r1) / det;
        if (!isfinite(d1) || !isfinite(d2)) return false;
        *b1 += d1;
        *b2 += d2;
    }
    return false;
}

/* Inside the piece and the patch's cell, with an overlap for rounding: finding a root twice is
 * harmless. */
static bool in_piece(const piece *p, double b1, double b2)
{
    double ax = p->b1[1] - p->b1[0], ay = p->b2[1] - p->b2[0], bx = p->b1[2] - p->b1[0],
           by = p->b2[2] - p->b2[0];
    double det = ax * by - ay * bx, x = b1 - p->b1[0], y = b2 - p->b2[0];
    double u = (x * by - y * bx) / det, v = (ax * y - ay * x) / det, e = 1e-7 + 1e-14 / sqrt(fabs(det));
    return u >= -e && v >= -e && u + v <= 1.0 + e;
}

/* Texel extent of a piece, or the part of the plane where one patch holds. */
typedef struct extent {
    double x0, y0, x1, y1;
} extent;

static bool in_extent(const search *s, const extent *cell, const across *at)
{
    double e = 1e-9 + 4.0 * s->f->texel_rounding;
    return at->x >= cell->x0 - e && at->x <= cell->x1 + e && at->y >= cell->y0 - e && at->y <= cell->y1 + e;
}

static bool keep_root(search *s, const height_patch *patch, const across *at, double b1, double b2)
{
    /* Vertices and edges of the base: closed, widened by rounding alone. */
    double e = 1e-12 + s->pad / max_d(at->size, DBL_MIN);
    if (b1 < -e || b2 < -e || b1 + b2 > 1.0 + e) return false;
    if (!(at->depth >= s->tmin && at->depth <= s->tmax)) return false;
    s->root = (shell_root){s->t0 + at->depth, b1, b2, at->x, at->y, *patch};
    s->tmax = at->depth;
    s->found = true;
    return true;
}

/* Tries one patch on a piece. Returns false if the piece must be divided further. */
static bool try_patch(search *s, const piece *p, const height_patch *patch, const extent *cell)
{
    piece_edges edges = make_edges(s, p, patch);
    verdict found = judge(s, p, &edges);
    double b1 = edges.b1, b2 = edges.b2;
    if (found == EXCLUDED) return true;
    if (found == DIVIDE) return false;
    across at;
    if (newton(s, patch, &b1, &b2, &at) && in_piece(p, b1, b2) && in_extent(s, cell, &at))
        keep_root(s, patch, &at, b1, b2);
    return true;
}

static extent piece_extent(const triangle_frame *f, const piece *p)
{
    extent e = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        double x = f->x[0] + p->b1[i] * f->xe + p->b2[i] * f->xf,
               y = f->y[0] + p->b1[i] * f->ye + p->b2[i] * f->yf;
        e.x0 = min_d(e.x0, x - f->texel_rounding);
        e.x1 = max_d(e.x1, x + f->texel_rounding);
        e.y0 = min_d(e.y0, y - f->texel_rounding);
        e.y1 = max_d(e.y1, y + f->texel_rounding);
    }
    return e;
}

/* Part of cell (i, j) of level[0] that lies in cell (u, v) of level[1]. */
static extent common_cell(const search *s, double i, double j, double u, double v)
{
    const height_lod *lod = s->lod;
    double ox = (double)s->f->origin_x + 0.5, oy = (double)s->f->origin_y + 0.5;
    extent e = {i, j, i + 1.0, j + 1.0};
    if (lod->blend > 0.0) {
        e.x0 = max_d(e.x0, (u + 0.5) / lod->ratio[0] - ox);
        e.x1 = min_d(e.x1, (u + 1.5) / lod->ratio[0] - ox);
        e.y0 = max_d(e.y0, (v + 0.5) / lod->ratio[1] - oy);
        e.y1 = min_d(e.y1, (v + 1.5) / lod->ratio[1] - oy);
    }
    return e;
}

/* The cells of level[1] that a piece's part of cell (i, j) touches; none without blending. */
static extent coarse_cells(const search *s, const extent *e, double i, double j)
{
    const height_lod *lod = s->lod;
    double ox = (double)s->f->origin_x + 0.5, oy = (double)s->f->origin_y + 0.5;
    if (!(lod->blend > 0.0)) return (extent){0.0, 0.0, 0.0, 0.0};
    return (extent){floor_d((max_d(e->x0, i) + ox) * lod->ratio[0] - 0.5),
                    floor_d((max_d(e->y0, j) + oy) * lod->ratio[1] - 0.5),
                    floor_d((min_d(e->x1, i + 1.0) + ox) * lod->ratio[0] - 0.5),
                    floor_d((min_d(e->y1, j + 1.0) + oy) * lod->ratio[1] - 0.5)};
}

/* All patches a small piece touches, each extended over the whole piece. Returns false if the piece
 * must be divided further. */
static bool try_piece(search *s, const piece *p, const extent *e)
{
    bool done = true;
    for (double j = floor_d(e->y0); j <= floor_d(e->y1); j++)
        for (double i = floor_d(e->x0); i <= floor_d(e->x1); i++) {
            extent coarse = coarse_cells(s, e, i, j);
            for (double v = coarse.y0; v <= coarse.y1; v++)
                for (double u = coarse.x0; u <= coarse.x1; u++) {
                    height_patch patch;
                    extent cell = common_cell(s, i, j, u, v);
                    height_patch_load(s->space, s->lod, s->f, (int64_t)i, (int64_t)j, (int64_t)u, (int64_t)v,
                                      &patch);
                    done &= try_patch(s, p, &patch, &cell);
                }
        }
    return done;
}

static void push_quarters(piece *stack, int *top, const piece *p)
{
    double m1[3], m2[3]; /* midpoints opposite to corner i */
    for (int i = 0; i < 3; i++) {
        m1[i] = 0.5 * (p->b1[(i + 1) % 3] + p->b1[(i + 2) % 3]);
        m2[i] = 0.5 * (p->b2[(i + 1) % 3] + p->b2[(i + 2) % 3]);
    }
    int depth = p->depth + 2;
    stack[(*top)++] = (piece){{m1[0], m1[1], m1[2]}, {m2[0], m2[1], m2[2]}, depth, false};
    stack[(*top)++] = (piece){{p->b1[0], m1[2], m1[1]}, {p->b2[0], m2[2], m2[1]}, depth, false};
    stack[(*top)++] = (piece){{m1[2], p->b1[1], m1[0]}, {m2[2], p->b2[1], m2[0]}, depth, false};
    stack[(*top)++] = (piece){{m1[1], m1[0], p->b1[2]}, {m2[1], m2[0], p->b2[2]}, depth, false};
}

/* Across the edge along which the normal changes most. Around a line where opposing normals meet this
 * makes pieces thin and long, of which there are few; quarters would grow by two with each level. */
static void push_halves(const triangle_frame *f, piece *stack, int *top, const piece *p)
{
    int apex = 0; /* the corner opposite to the edge */
    double most = -1.0;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double change = v3_length(v3_mad(v3_scale(f->ne, p->b1[j] - p->b1[k]), p->b2[j] - p->b2[k], f->nf));
        if (change > most) {
            most = change;
            apex = i;
        }
    }
    int j = (apex + 1) % 3, k = (apex + 2) % 3, depth = p->depth + 1;
    double m1 = 0.5 * (p->b1[j] + p->b1[k]), m2 = 0.5 * (p->b2[j] + p->b2[k]);
    stack[(*top)++] = (piece){{p->b1[apex], p->b1[j], m1}, {p->b2[apex], p->b2[j], m2}, depth, false};
    stack[(*top)++] = (piece){{p->b1[apex], m1, p->b1[k]}, {p->b2[apex], m2, p->b2[k]}, depth, false};
}

static void search_make(const shell_space *space, const height_lod *lod, knurl_bounds_kind kind,
                        const triangle_frame *f, const knurl_ray *ray, search *s)
{
    *s = (search){.space = space, .lod = lod, .f = f, .kind = kind};
    s->direction = v3_load(ray->direction);
    /* From here on t counts from the ray's point nearest to vertex 0. */
    double t0 =
        v3_dot(v3_sub(f->base, v3_load(ray->origin)), s->direction) / v3_dot(s->direction, s->direction);
    s->t0 = t0;
    s->tmin = ray->tmin - t0;
    s->tmax = ray->tmax - t0;
    s->origin = v3(near_point(ray->origin[0], ray->direction[0], f->base.x, t0),
                   near_point(ray->origin[1], ray->direction[1], f->base.y, t0),
                   near_point(ray->origin[2], ray->direction[2], f->base.z, t0));
    vec3 d = v3_normalize(s->direction), a = v3_abs(d);
    vec3 least = a.x <= a.y && a.x <= a.z ? v3(1, 0, 0) : a.y <= a.z ? v3(0, 1, 0) : v3(0, 0, 1);
    s->across1 = v3_normalize(v3_cross(d, least));
    s->across2 = v3_cross(d, s->across1);
    s->inverse = v3_reciprocal(s->direction);
    s->pad = 16.0 * DBL_EPSILON * (v3_max_component(v3_abs(s->origin)) + f->size + fabs(f->s0) + fabs(f->s1));
}

bool shell_subdivide(const shell_space *space, const height_lod *lod, knurl_bounds_kind kind,
                     const triangle_frame *f, const knurl_ray *ray, bool any, shell_root *root,
                     uint32_t *steps)
{
    search s;
    search_make(space, lod, kind, f, ray, &s);
    piece stack[SUBDIVIDE_STACK];
    int top = 0;
    stack[top++] = (piece){{0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}, 0, false};
    while (top > 0 && !(any && s.found)) {
        piece p = stack[--top];
        extent e = piece_extent(f, &p);
        knurl_range h = shell_height_range(space, lod, kind, f, e.x0, e.y0, e.x1, e.y1);
        vec3 lower, upper;
        (*steps)++;
        if (!piece_box(&s, &p, h, &lower, &upper) || !ray_meets_box(&s, lower, upper)) continue;
        bool small = floor_d(e.x1) - floor_d(e.x0) <= 1.0 && floor_d(e.y1) - floor_d(e.y0) <= 1.0;
        if ((small || p.depth >= SUBDIVIDE_DEPTH) && try_piece(&s, &p, &e)) continue;
        if (p.depth >= SUBDIVIDE_DEPTH) continue;
        if (p.turning)
            push_halves(f, stack, &top, &p);
        else
            push_quarters(stack, &top, &p);
    }
    if (s.found) {
        *root = s.root;
        shell_root_polish(f, ray, root);
        if (root->t < ray->tmin || root->t > ray->tmax) root->t = s.root.t;
    }
    return s.found;
}
