/* support/oracle_surface.c: the surface itself, open edges, lists of roots, and gaps of near misses. */
#include "oracle_internal.h"

#include <math.h>
#include <string.h>

/* ---- the surface ---- */

/* Height and its slopes in a and b. */
static double height_at(const oracle *o, const oracle_triangle *t, double a, double b, double slope[2])
{
    double h = o->map.offset;
    slope[0] = slope[1] = 0.0;
    for (int l = 0; l < o->map.levels; l++) {
        double x[2];
        int64_t cell[2];
        for (int k = 0; k < 2; k++) {
            double value = t->x0[l][k] + a * t->x[l][k][0] + b * t->x[l][k][1];
            cell[k] = (int64_t)floor(value);
            x[k] = value - floor(value);
        }
        oracle_bilinear g = oracle_cell(o, t, l, cell);
        double gx = g.x + g.xy * x[1], gy = g.y + g.xy * x[0];
        h += g.c + g.x * x[0] + g.y * x[1] + g.xy * x[0] * x[1];
        for (int i = 0; i < 2; i++) slope[i] += gx * t->x[l][0][i] + gy * t->x[l][1][i];
    }
    return h;
}

/* S - V0 and its two derivatives. */
static void surface_frame(const oracle *o, const oracle_triangle *t, double a, double b, double s[3],
                          double ds[2][3], double *height)
{
    double slope[2], n[3], q = 0.0, dot[2] = {0.0, 0.0};
    double h = height_at(o, t, a, b, slope);
    for (int k = 0; k < 3; k++) {
        n[k] = t->n0[k] + a * t->n[0][k] + b * t->n[1][k];
        q += n[k] * n[k];
    }
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3; k++) dot[i] += n[k] * t->n[i][k];
    }
    double w = o->unnormalised ? 1.0 : 1.0 / sqrt(q);
    for (int k = 0; k < 3; k++) {
        s[k] = a * t->e[0][k] + b * t->e[1][k] + h * w * n[k];
        for (int i = 0; i < 2; i++) {
            double dk = slope[i] * w - (o->unnormalised ? 0.0 : h * dot[i] * w * w * w);
            ds[i][k] = t->e[i][k] + dk * n[k] + h * w * t->n[i][k];
        }
    }
    if (height) *height = h;
}

void oracle_surface(const oracle *o, uint32_t triangle, double a, double b, double position[3],
                    double normal[3], double *height)
{
    const oracle_triangle *t = &o->triangles[triangle];
    double s[3], ds[2][3];
    surface_frame(o, t, a, b, s, ds, height);
    double length = 0.0, n[3];
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        n[k] = ds[0][i] * ds[1][j] - ds[0][j] * ds[1][i];
        length += n[k] * n[k];
        if (position) position[k] = t->v0[k] + s[k];
    }
    for (int k = 0; k < 3 && normal; k++) normal[k] = n[k] / sqrt(length);
}

void oracle_uv(const oracle *o, uint32_t triangle, double a, double b, double uv[2])
{
    const oracle_triangle *t = &o->triangles[triangle];
    for (int k = 0; k < 2; k++) uv[k] = t->uv0[k] + a * t->uv[0][k] + b * t->uv[1][k];
}

double oracle_map_value(const oracle *o, double u, double v)
{
    double factor = o->map.weight[0] + o->map.weight[1];
    return factor != 0.0 ? (oracle_map_height(&o->map, u, v) - o->map.offset) / factor : 0.0;
}

/* ---- gaps ---- */

/* Vector from the ray's line to the surface, across D (unit). */
static double line_distance(const oracle_triangle *t, const oracle_ray *ray, const double s[3],
                            const double d[3], double off[3])
{
    double along = 0.0, sum = 0.0;
    for (int k = 0; k < 3; k++) {
        off[k] = (double)((long double)t->v0[k] - (long double)ray->origin[k]) + s[k];
        along += off[k] * d[k];
    }
    for (int k = 0; k < 3; k++) {
        off[k] -= along * d[k];
        sum += off[k] * off[k];
    }
    return sqrt(sum);
}

static void into_triangle(double *a, double *b)
{
    *a = fmin(fmax(*a, 0.0), 1.0);
    *b = fmin(fmax(*b, 0.0), 1.0);
    double over = *a + *b - 1.0;
    if (over > 0.0) {
        *a = fmax(0.0, *a - 0.5 * over);
        *b = fmin(1.0 - *a, *b - 0.5 * over);
        if (*b < 0.0) *b = 0.0;
    }
}

/* Damped Gauss-Newton steps, then a pattern search that also walks along creases. */
double oracle_gap(const oracle *o, const oracle_ray *ray, uint32_t triangle, double a, double b)
{
    const oracle_triangle *t = &o->triangles[triangle];
    double d[3], length = 0.0, s[3], ds[2][3], off[3];
    for (int k = 0; k < 3; k++) length += ray->direction[k] * ray->direction[k];
    for (int k = 0; k < 3; k++) d[k] = ray->direction[k] / sqrt(length);
    into_triangle(&a, &b);
    surface_frame(o, t, a, b, s, ds, NULL);
    double best = line_distance(t, ray, s, d, off);
    double texel = fmax(fabs(t->x[0][0][0]) + fabs(t->x[0][0][1]), fabs(t->x[0][1][0]) + fabs(t->x[0][1][1]));
    double step = texel > 1.0 ? 0.5 / texel : 0.5;
    for (int round = 0; round < 400 && step > 1e-15; round++) {
        static const double way[12][2] = {{1, 0},  {-1, 0}, {0, 1},    {0, -1},   {1, 1},    {-1, -1},
                                          {1, -1}, {-1, 1}, {0.5, -1}, {-0.5, 1}, {1, -0.5}, {-1, 0.5}};
        double better = best, na = a, nb = b;
        for (int i = 0; i < 12; i++) {
            double pa = a + step * way[i][0], pb = b + step * way[i][1];
            into_triangle(&pa, &pb);
            surface_frame(o, t, pa, pb, s, ds, NULL);
            double distance = line_distance(t, ray, s, d, off);
            if (distance < better) {
                better = distance;
                na = pa;
                nb = pb;
            }
        }
        if (better < best) {
            best = better;
            a = na;
            b = nb;
        } else {
            step *= 0.5;
        }
    }
    return best;
}

/* ---- open edges ---- */

/* Corners of edge i of a triangle in (a, b): b = 0, a = 0, a + b = 1. */
static void edge_point(int edge, double f, double *a, double *b)
{
    *a = edge == 0 ? f : edge == 1 ? 0.0 : 1.0 - f;
    *b = edge == 0 ? 0.0 : f;
}

static bool same_curve(const oracle *o, uint32_t i, int ei, uint32_t j, int ej, bool turned)
{
    for (int k = 0; k <= 6; k++) {
        double f = (double)k / 6.0, a, b, p[3], q[3], far = 0.0;
        edge_point(ei, f, &a, &b);
        oracle_surface(o, i, a, b, p, NULL, NULL);
        edge_point(ej, turned ? 1.0 - f : f, &a, &b);
        oracle_surface(o, j, a, b, q, NULL, NULL);
        for (int c = 0; c < 3; c++) far = fmax(far, fabs(p[c] - q[c]) - 1e-15 * fabs(p[c]));
        if (!(far <= 1e-9 * o->scale)) return false;
    }
    return true;
}

static bool near(const double p[3], const double q[3], double far)
{
    return fabs(p[0] - q[0]) <= far && fabs(p[1] - q[1]) <= far && fabs(p[2] - q[2]) <= far;
}

static void edge_ends(const oracle_triangle *t, int edge, double ends[2][3])
{
    for (int i = 0; i < 2; i++) {
        double a, b;
        edge_point(edge, (double)i, &a, &b);
        for (int k = 0; k < 3; k++) ends[i][k] = t->v0[k] + a * t->e[0][k] + b * t->e[1][k];
    }
}

void oracle_find_open_edges(oracle *o)
{
    double far = 1e-12 * o->scale;
    for (uint32_t i = 0; i < o->triangle_count; i++) {
        for (int ei = 0; ei < 3; ei++) {
            double p[2][3], q[2][3];
            edge_ends(&o->triangles[i], ei, p);
            bool open = true;
            for (uint32_t j = 0; j < o->triangle_count && open; j++) {
                for (int ej = 0; ej < 3 && open && j != i && !o->triangles[j].empty; ej++) {
                    edge_ends(&o->triangles[j], ej, q);
                    bool straight = near(p[0], q[0], far) && near(p[1], q[1], far);
                    bool turned = near(p[0], q[1], far) && near(p[1], q[0], far);
                    if (straight || turned) open = !same_curve(o, i, ei, j, ej, !straight);
                }
            }
            o->triangles[i].open[ei] = open;
        }
    }
}

/* ---- lists of roots ---- */

static bool same_place(const oracle *o, const oracle_root *p, const oracle_root *q)
{
    return near(p->position, q->position, 1e-9 * o->scale);
}

static void judge(oracle_root *r)
{
    bool inside = r->margin > 1e-9;
    bool shared = r->pieces >= 2 && !r->open;
    r->certain = r->simple && !r->degenerate && !r->mixed && r->in_window && (inside || shared);
}

/* A proven root outweighs an undecided box beside it only if it is clear of the border. */
static void merge(oracle_root *into, const oracle_root *r)
{
    bool mixed = into->mixed || r->mixed || into->side != r->side;
    bool simple = into->simple && r->simple, degenerate = into->degenerate || r->degenerate;
    bool open = into->open || r->open, on_edge = into->on_edge || r->on_edge;
    int pieces = into->pieces + r->pieces;
    double cosine = fmin(into->cosine, r->cosine);
    if (r->margin > into->margin) *into = *r;
    into->mixed = mixed;
    into->simple = simple;
    into->degenerate = degenerate;
    into->open = open;
    into->on_edge = on_edge;
    into->pieces = pieces;
    into->cosine = cosine;
}

static bool at_open_edge(const oracle *o, const oracle_root *r)
{
    const oracle_triangle *t = &o->triangles[r->triangle];
    double away[3] = {r->b, r->a, 1.0 - r->a - r->b};
    for (int i = 0; i < 3; i++) {
        if (t->open[i] && away[i] < 1e-9) return true;
    }
    return false;
}

void oracle_query_add(const oracle *o, oracle_query *q, const oracle_root *found)
{
    oracle_root root = *found;
    root.open = at_open_edge(o, &root);
    for (int i = 0; i < q->count; i++) {
        if (!same_place(o, &q->roots[i], &root)) continue;
        merge(&q->roots[i], &root);
        judge(&q->roots[i]);
        return;
    }
    judge(&root);
    int at = 0;
    while (at < q->count && q->roots[at].t <= root.t) at++;
    if (at >= q->capacity) return;
    int moved = q->count < q->capacity ? q->count - at : q->capacity - 1 - at;
    memmove(&q->roots[at + 1], &q->roots[at], (size_t)moved * sizeof root);
    q->roots[at] = root;
    if (q->count < q->capacity) q->count++;
    /* Neighbours' copies of the first root must still be found. */
    if (q->first_only) q->tmax = fmin(q->ray.tmax, q->roots[0].t + q->same);
}

bool oracle_texel_corner(const oracle *o, uint32_t triangle, double fx, double fy, double *a, double *b)
{
    const oracle_triangle *t = &o->triangles[triangle];
    if (t->singular) return false;
    double x = floor((double)t->cells[0] + fx * (double)(t->cells[2] - t->cells[0])) - t->x0[0][0];
    double y = floor((double)t->cells[1] + fy * (double)(t->cells[3] - t->cells[1])) - t->x0[0][1];
    *a = t->inverse[0][0] * x + t->inverse[0][1] * y;
    *b = t->inverse[1][0] * x + t->inverse[1][1] * y;
    return *a >= 0.0 && *b >= 0.0 && *a + *b <= 1.0;
}

/* ---- neighbourhoods ---- */

static double length_of(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        out[k] = a[i] * b[j] - a[j] * b[i];
    }
}

/* Whether the surface is all around the ray at a doubtful root: every ray beside it meets it there. */
bool oracle_surrounded(const oracle *o, const oracle_ray *ray, const oracle_root *root)
{
    double away = 1e-8 * o->scale, u[3], v[3], axis[3] = {0.0, 0.0, 0.0};
    int least = 0;
    for (int k = 1; k < 3; k++) least = fabs(ray->direction[k]) < fabs(ray->direction[least]) ? k : least;
    axis[least] = 1.0;
    cross(ray->direction, axis, u);
    cross(ray->direction, u, v);
    double lu = length_of(u), lv = length_of(v), reach = 100.0 * away / length_of(ray->direction);
    if (root->t - reach < ray->tmin || root->t + reach > ray->tmax) return false;
    for (int i = 0; i < 12; i++) {
        double angle = 0.1 + 6.283185307179586 * i / 12.0;
        oracle_ray beside = *ray;
        oracle_root found;
        for (int k = 0; k < 3; k++)
            beside.origin[k] += away * (cos(angle) * u[k] / lu + sin(angle) * v[k] / lv);
        beside.tmin = root->t - reach;
        beside.tmax = root->t + reach;
        if (!oracle_first(o, &beside, &found) || found.degenerate) return false;
    }
    return true;
}
