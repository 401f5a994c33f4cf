/* support/oracle_solve.c: all roots of one bilinear piece, by Krawczyk's test and bisection.
 *
 * Parameters (x, y) in [-1, 1]^2 span the piece: its texel rectangle where (u, v) determine (a, b), else
 * its bounding rectangle in (a, b). All enclosures are midpoint and radius; the few rounding errors of
 * the midpoints are covered by `noise`. */
#include "oracle_internal.h"

#include <math.h>
#include <string.h>

enum { PATIENCE = 1000, STACK = 256 };

/* Radius of a box that is given up as undecided. It grows fourfold with every PATIENCE boxes: a ray in the
 * surface leaves a line of them. */
static const double MIN_RADIUS = 5e-10;
static const double GROW = 1e-7;    /* by which the first box exceeds the piece */
static const double BORDER = 1e-9;  /* margin under which a root may be the neighbour's too */
static const double SHARP = 1e-9;   /* radius under which a proven root is known well enough */
static const double OUTSIDE = 1e-8; /* how far outside of the piece a root is still taken: more than
                                      BORDER, so that both pieces report what is that near */

/* c + x X + y Y */
typedef struct affine1 {
    double c, x, y;
} affine1;

typedef struct piece_forms {
    affine1 a, b;            /* barycentrics */
    affine1 texel[2][2];     /* texel coordinates per level, axis, relative to the cell */
    double texel_unit[2][2]; /* 1 / extent over the piece, per level, axis */
    affine1 n[3], base[3];   /* N, P - V0 */
    affine1 p[2], q[2];      /* e_i . (P - O), e_i . N */
    affine1 depth, depth_n;  /* along the axis: P - O, N */
    double noise[2];
    double h[6];          /* 1, x, y, xx, xy, yy */
    double nxx, nxy, nyy; /* Nx . Nx, Nx . Ny, Ny . Ny */
    bool unnormalised;
} piece_forms;

typedef struct box2 {
    double c[2], r[2];
} box2;

static double at(affine1 f, double x, double y)
{
    return f.c + f.x * x + f.y * y;
}

/* ---- set-up ---- */

static void bounds_of(const oracle_polygon *polygon, int level, int axis, double *low, double *high)
{
    *low = INFINITY;
    *high = -INFINITY;
    for (int i = 0; i < polygon->count; i++) {
        const oracle_corner *c = &polygon->corner[i];
        double value = level >= 0 ? c->x[level][axis] : axis == 0 ? c->a : c->b;
        *low = fmin(*low, value);
        *high = fmax(*high, value);
    }
}

static affine1 combine(double c, double sa, double sb, const affine1 *a, const affine1 *b)
{
    return (affine1){c + sa * a->c + sb * b->c, sa * a->x + sb * b->x, sa * a->y + sb * b->y};
}

static bool set_parameters(const oracle_piece *piece, piece_forms *f)
{
    const oracle_triangle *t = piece->triangle;
    double low[2], high[2];
    for (int k = 0; k < 2; k++) bounds_of(piece->polygon, t->singular ? -1 : 0, k, &low[k], &high[k]);
    double c[2], r[2];
    for (int k = 0; k < 2; k++) {
        c[k] = 0.5 * (low[k] + high[k]);
        r[k] = 0.5 * (high[k] - low[k]);
        if (!(r[k] > 0.0)) return false;
    }
    if (t->singular) {
        f->a = (affine1){c[0], r[0], 0.0};
        f->b = (affine1){c[1], 0.0, r[1]};
    } else {
        double dx = c[0] - t->x0[0][0], dy = c[1] - t->x0[0][1];
        f->a = (affine1){t->inverse[0][0] * dx + t->inverse[0][1] * dy, t->inverse[0][0] * r[0],
                         t->inverse[0][1] * r[1]};
        f->b = (affine1){t->inverse[1][0] * dx + t->inverse[1][1] * dy, t->inverse[1][0] * r[0],
                         t->inverse[1][1] * r[1]};
    }
    for (int l = 0; l < 2; l++) {
        for (int k = 0; k < 2; k++) {
            double cell = (double)piece->cell[l][k], from, to;
            f->texel[l][k] = combine(t->x0[l][k] - cell, t->x[l][k][0], t->x[l][k][1], &f->a, &f->b);
            bounds_of(piece->polygon, l, k, &from, &to);
            f->texel_unit[l][k] = to > from ? 1.0 / (to - from) : 1.0;
        }
    }
    if (!t->singular) { /* exact by construction */
        f->texel[0][0] = (affine1){c[0] - (double)piece->cell[0][0], r[0], 0.0};
        f->texel[0][1] = (affine1){c[1] - (double)piece->cell[0][1], 0.0, r[1]};
    }
    return true;
}

static void set_height(const oracle *o, const oracle_piece *piece, piece_forms *f)
{
    memset(f->h, 0, sizeof f->h);
    f->h[0] = o->map.offset;
    for (int l = 0; l < o->map.levels; l++) {
        oracle_bilinear g = oracle_cell(o, piece->triangle, l, piece->cell[l]);
        affine1 x = f->texel[l][0], y = f->texel[l][1];
        f->h[0] += g.c + g.x * x.c + g.y * y.c + g.xy * x.c * y.c;
        f->h[1] += g.x * x.x + g.y * y.x + g.xy * (x.c * y.x + x.x * y.c);
        f->h[2] += g.x * x.y + g.y * y.y + g.xy * (x.c * y.y + x.y * y.c);
        f->h[3] += g.xy * x.x * y.x;
        f->h[4] += g.xy * (x.x * y.y + x.y * y.x);
        f->h[5] += g.xy * x.y * y.y;
    }
}

/* e_0 = (D_axis on u, -D_u on axis), e_1 likewise with v: exactly across D, no rounding. */
static affine1 across(const affine1 w[3], const oracle_query *q, int i)
{
    int other = i == 0 ? q->u : q->v;
    double da = q->ray.direction[q->axis], db = q->ray.direction[other];
    return (affine1){da * w[other].c - db * w[q->axis].c, da * w[other].x - db * w[q->axis].x,
                     da * w[other].y - db * w[q->axis].y};
}

static void set_ray(const oracle *o, const oracle_piece *piece, const oracle_query *q, piece_forms *f)
{
    const oracle_triangle *t = piece->triangle;
    affine1 p[3];
    long double from[3];
    double size = 0.0;
    for (int k = 0; k < 3; k++) {
        from[k] = (long double)t->v0[k] - (long double)q->ray.origin[k];
        p[k] = f->base[k] = combine(0.0, t->e[0][k], t->e[1][k], &f->a, &f->b);
        f->n[k] = combine(t->n0[k], t->n[0][k], t->n[1][k], &f->a, &f->b);
        size = fmax(size, fabs(p[k].c) + fabs(p[k].x) + fabs(p[k].y));
    }
    for (int i = 0; i < 2; i++) {
        int other = i == 0 ? q->u : q->v;
        long double da = (long double)q->ray.direction[q->axis], db = (long double)q->ray.direction[other];
        double start = (double)(da * from[other] - db * from[q->axis]);
        f->p[i] = across(p, q, i);
        f->q[i] = across(f->n, q, i);
        double reach = fabs(f->h[0]) + fabs(f->h[1]) + fabs(f->h[2]);
        f->noise[i] = 4e-16 * (fabs(start) + 2.0 * fabs((double)da) * (size + reach));
        f->p[i].c += start;
    }
    f->depth = p[q->axis];
    f->depth.c += (double)from[q->axis];
    f->depth_n = f->n[q->axis];
    f->nxx = f->nxy = f->nyy = 0.0;
    for (int k = 0; k < 3; k++) {
        f->nxx += f->n[k].x * f->n[k].x;
        f->nxy += f->n[k].x * f->n[k].y;
        f->nyy += f->n[k].y * f->n[k].y;
    }
    f->unnormalised = o->unnormalised;
}

/* ---- enclosures ---- */

typedef struct ball {
    double m, r;
} ball;

static ball product(ball a, ball b)
{
    return (ball){a.m * b.m, fabs(a.m) * b.r + a.r * fabs(b.m) + a.r * b.r};
}
static ball sum(ball a, ball b)
{
    return (ball){a.m + b.m, a.r + b.r};
}

static ball range(affine1 f, const box2 *box)
{
    return (ball){at(f, box->c[0], box->c[1]), fabs(f.x) * box->r[0] + fabs(f.y) * box->r[1]};
}

typedef struct enclosure {
    double f[2];      /* value at the centre */
    ball j[2][2];     /* Jacobian over the box */
    double k, kx, ky; /* h / |N| (or h) and its slopes at the centre */
} enclosure;

/* 1 / |N| over the box; false if N may vanish in it. */
static bool inverse_length(const piece_forms *f, const box2 *box, ball *w, ball *mx, ball *my)
{
    double n[3], q = 0.0, sx = 0.0, sy = 0.0;
    for (int k = 0; k < 3; k++) {
        n[k] = at(f->n[k], box->c[0], box->c[1]);
        q += n[k] * n[k];
        sx += n[k] * f->n[k].x;
        sy += n[k] * f->n[k].y;
    }
    double rx = box->r[0], ry = box->r[1];
    double slope = 2.0 * (fabs(sx) * rx + fabs(sy) * ry);
    double bend = f->nxx * rx * rx + 2.0 * fabs(f->nxy) * rx * ry + f->nyy * ry * ry;
    *mx = (ball){sx, f->nxx * rx + fabs(f->nxy) * ry};
    *my = (ball){sy, fabs(f->nxy) * rx + f->nyy * ry};
    if (!(q - slope > 1e-24)) return false;
    double middle = 1.0 / sqrt(q), high = 1.0 / sqrt(q - slope), low = 1.0 / sqrt(q + slope + bend);
    *w = (ball){middle, fmax(high - middle, middle - low)};
    return true;
}

static bool enclose(const piece_forms *f, const box2 *box, enclosure *e)
{
    double x = box->c[0], y = box->c[1], rx = box->r[0], ry = box->r[1];
    const double *h = f->h;
    double hx = h[1] + 2.0 * h[3] * x + h[4] * y, hy = h[2] + h[4] * x + 2.0 * h[5] * y;
    ball height = {h[0] + x * (h[1] + h[3] * x + h[4] * y) + y * (h[2] + h[5] * y),
                   fabs(hx) * rx + fabs(hy) * ry + fabs(h[3]) * rx * rx + fabs(h[4]) * rx * ry +
                       fabs(h[5]) * ry * ry};
    ball k = height, kx = {hx, 2.0 * fabs(h[3]) * rx + fabs(h[4]) * ry};
    ball ky = {hy, fabs(h[4]) * rx + 2.0 * fabs(h[5]) * ry};
    if (!f->unnormalised) {
        ball w, mx, my;
        if (!inverse_length(f, box, &w, &mx, &my)) return false;
        ball minus = {-1.0, 0.0}, cube = product(minus, product(w, product(w, w)));
        k = product(height, w);
        kx = sum(product(kx, w), product(height, product(mx, cube)));
        ky = sum(product(ky, w), product(height, product(my, cube)));
    }
    e->k = k.m;
    e->kx = kx.m;
    e->ky = ky.m;
    for (int i = 0; i < 2; i++) {
        ball n = range(f->q[i], box);
        e->f[i] = at(f->p[i], x, y) + k.m * n.m;
        e->j[i][0] = sum((ball){f->p[i].x, 0.0}, sum(product(kx, n), product(k, (ball){f->q[i].x, 0.0})));
        e->j[i][1] = sum((ball){f->p[i].y, 0.0}, sum(product(ky, n), product(k, (ball){f->q[i].y, 0.0})));
    }
    return true;
}

/* ---- roots ---- */

/* Distance inside the piece of its nearest border, in fractions of its size; negative outside. */
static double margin_of(const oracle *o, const oracle_piece *piece, const piece_forms *f,
                        const double at_xy[2], bool *on_triangle_edge)
{
    double a = at(f->a, at_xy[0], at_xy[1]), b = at(f->b, at_xy[0], at_xy[1]);
    double from, to, unit = 0.0;
    for (int k = 0; k < 2; k++) {
        bounds_of(piece->polygon, -1, k, &from, &to);
        unit = fmax(unit, to - from);
    }
    double edges = fmin(a, fmin(b, 1.0 - a - b)) / unit;
    double texels = INFINITY;
    for (int l = 0; l < o->map.levels; l++) {
        for (int k = 0; k < 2; k++) {
            double x = at(f->texel[l][k], at_xy[0], at_xy[1]);
            texels = fmin(texels, fmin(x, 1.0 - x) * f->texel_unit[l][k]);
        }
    }
    *on_triangle_edge = edges < BORDER;
    return fmin(edges, texels);
}

/* Cosine of the ray and S_a x S_b of this very piece: at a border its neighbours have others. */
static double signed_cosine(const piece_forms *f, const enclosure *e, const double x[2], const double d[3])
{
    double sx[3], sy[3], dot = 0.0, length = 0.0, normal = 0.0;
    for (int k = 0; k < 3; k++) {
        double n = at(f->n[k], x[0], x[1]);
        sx[k] = f->base[k].x + e->kx * n + e->k * f->n[k].x;
        sy[k] = f->base[k].y + e->ky * n + e->k * f->n[k].y;
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        double c = sx[i] * sy[j] - sx[j] * sy[i];
        dot += c * d[k];
        normal += c * c;
        length += d[k] * d[k];
    }
    double turn = f->a.x * f->b.y - f->a.y * f->b.x;
    return (turn > 0.0 ? dot : -dot) / sqrt(length * normal);
}

static void take_root(const oracle *o, const oracle_piece *piece, const piece_forms *f, oracle_query *q,
                      const box2 *box, bool simple, bool degenerate)
{
    bool on_edge;
    oracle_root root = {.triangle = piece->index, .degenerate = degenerate};
    root.margin = margin_of(o, piece, f, box->c, &on_edge);
    double reach = fmax(box->r[0], box->r[1]);
    if (root.margin < -OUTSIDE - reach) return;
    root.margin -= reach; /* what is certain to be left */
    root.a = at(f->a, box->c[0], box->c[1]);
    root.b = at(f->b, box->c[0], box->c[1]);
    box2 point = {{box->c[0], box->c[1]}, {0.0, 0.0}};
    enclosure e;
    if (!enclose(f, &point, &e)) return;
    double depth = at(f->depth, box->c[0], box->c[1]) + e.k * at(f->depth_n, box->c[0], box->c[1]);
    root.t = depth / q->ray.direction[q->axis];
    double over = fmax(q->ray.tmin - root.t, root.t - q->ray.tmax);
    if (over > q->slack) return;
    double cosine = signed_cosine(f, &e, box->c, q->ray.direction);
    oracle_surface(o, piece->index, root.a, root.b, root.position, NULL, NULL);
    root.cosine = fabs(cosine);
    root.side = cosine > 0.0 ? 1 : -1;
    root.simple = simple;
    root.on_edge = on_edge;
    root.pieces = 1;
    root.in_window = over < -q->slack;
    oracle_query_add(o, q, &root);
}

/* Krawczyk's operator on the box: -1 no root, 1 the box holds at most one and was tightened, 0 nothing
 * known; `shrunk` tells whether the box got much smaller. */
static int krawczyk(const piece_forms *f, box2 *box, bool *shrunk)
{
    enclosure e;
    *shrunk = false;
    if (!enclose(f, box, &e)) return 0;
    for (int i = 0; i < 2; i++) {
        double reach = f->noise[i];
        for (int j = 0; j < 2; j++) reach += (fabs(e.j[i][j].m) + e.j[i][j].r) * box->r[j];
        if (fabs(e.f[i]) > reach) return -1;
    }
    double det = e.j[0][0].m * e.j[1][1].m - e.j[0][1].m * e.j[1][0].m;
    double size = (fabs(e.j[0][0].m) + fabs(e.j[0][1].m)) * (fabs(e.j[1][0].m) + fabs(e.j[1][1].m));
    if (!(fabs(det) > 1e-13 * size)) return 0;
    double inverse[2][2] = {{e.j[1][1].m / det, -e.j[0][1].m / det}, {-e.j[1][0].m / det, e.j[0][0].m / det}};
    box2 next;
    bool unique = true;
    for (int i = 0; i < 2; i++) {
        double g = inverse[i][0] * e.f[0] + inverse[i][1] * e.f[1];
        double noise = fabs(inverse[i][0]) * f->noise[0] + fabs(inverse[i][1]) * f->noise[1];
        double radius = noise, contraction = 0.0;
        for (int j = 0; j < 2; j++) {
            double spread = fabs(inverse[i][0]) * e.j[0][j].r + fabs(inverse[i][1]) * e.j[1][j].r + 1e-12;
            radius += spread * box->r[j];
            contraction += spread * box->r[j];
        }
        if (!(contraction < 0.5 * box->r[i])) unique = false;
        double low = fmax(box->c[i] - box->r[i], box->c[i] - g - radius);
        double high = fmin(box->c[i] + box->r[i], box->c[i] - g + radius);
        if (low > high) return -1;
        next.c[i] = 0.5 * (low + high);
        next.r[i] = 0.5 * (high - low);
    }
    *shrunk = next.r[0] < 0.7 * box->r[0] || next.r[1] < 0.7 * box->r[1];
    *box = next;
    return unique ? 1 : 0;
}

/* The at most one root of a box: tightened until rounding stops it. */
static void close_in(const oracle *o, const oracle_piece *piece, const piece_forms *f, oracle_query *q,
                     box2 box)
{
    for (int i = 0; i < 60; i++) {
        bool shrunk;
        if (fmax(box.r[0], box.r[1]) < 1e-14) break;
        int answer = krawczyk(f, &box, &shrunk);
        if (answer < 0) return;
        if (!shrunk) break;
    }
    /* A wide rest is a root known only up to rounding. */
    bool simple = fmax(box.r[0], box.r[1]) < SHARP;
    take_root(o, piece, f, q, &box, simple, false);
}

void oracle_solve_piece(const oracle *o, const oracle_piece *piece, oracle_query *q)
{
    piece_forms f;
    if (!set_parameters(piece, &f)) return;
    set_height(o, piece, &f);
    set_ray(o, piece, q, &f);
    box2 stack[STACK];
    int top = 0, boxes = 0;
    stack[top++] = (box2){{0.0, 0.0}, {1.0 + GROW, 1.0 + GROW}};
    while (top > 0) {
        box2 box = stack[--top];
        bool shrunk;
        int answer = krawczyk(&f, &box, &shrunk);
        if (answer < 0) continue;
        if (answer > 0) {
            close_in(o, piece, &f, q, box);
            continue;
        }
        double least = ldexp(MIN_RADIUS, 2 * (++boxes / PATIENCE));
        if (fmax(box.r[0], box.r[1]) < least || top + 2 > STACK) {
            take_root(o, piece, &f, q, &box, false, boxes >= PATIENCE);
            continue;
        }
        if (shrunk) {
            stack[top++] = box;
            continue;
        }
        int axis = box.r[0] >= box.r[1] ? 0 : 1;
        box.r[axis] *= 0.5;
        box2 half = box;
        half.c[axis] -= box.r[axis];
        box.c[axis] += box.r[axis];
        stack[top++] = box;
        stack[top++] = half;
    }
}
