/* support/oracle_piece.c: cutting triangles into bilinear pieces, and boxes of pieces. */
#include "oracle_internal.h"

#include <math.h>

static double lerp(double p, double q, double f)
{
    return p + f * (q - p);
}

static oracle_corner cut(const oracle_corner *p, const oracle_corner *q, int level, int axis, double line)
{
    double dp = p->x[level][axis] - line, dq = q->x[level][axis] - line;
    double f = dp / (dp - dq);
    oracle_corner r;
    r.a = lerp(p->a, q->a, f);
    r.b = lerp(p->b, q->b, f);
    for (int l = 0; l < 2; l++) {
        for (int k = 0; k < 2; k++) r.x[l][k] = lerp(p->x[l][k], q->x[l][k], f);
    }
    r.x[level][axis] = line;
    return r;
}

void oracle_clip(const oracle_polygon *in, oracle_polygon *out, int level, int axis, double line,
                 bool keep_upper)
{
    out->count = 0;
    double sign = keep_upper ? 1.0 : -1.0;
    for (int i = 0; i < in->count; i++) {
        const oracle_corner *p = &in->corner[i], *q = &in->corner[(i + 1) % in->count];
        double dp = sign * (p->x[level][axis] - line), dq = sign * (q->x[level][axis] - line);
        if (dp >= 0.0 && out->count < ORACLE_POLYGON) out->corner[out->count++] = *p;
        if (((dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0)) && out->count < ORACLE_POLYGON)
            out->corner[out->count++] = cut(p, q, level, axis, line);
    }
    if (out->count < 3) out->count = 0;
}

void oracle_triangle_polygon(const oracle_triangle *triangle, oracle_polygon *polygon)
{
    polygon->count = 3;
    for (int i = 0; i < 3; i++) {
        oracle_corner *c = &polygon->corner[i];
        c->a = i == 1 ? 1.0 : 0.0;
        c->b = i == 2 ? 1.0 : 0.0;
        for (int l = 0; l < 2; l++) {
            for (int k = 0; k < 2; k++) {
                double slope = i == 0 ? 0.0 : triangle->x[l][k][i - 1];
                c->x[l][k] = triangle->x0[l][k] + slope;
            }
        }
    }
}

oracle_bilinear oracle_cell(const oracle *o, const oracle_triangle *triangle, int level,
                            const int64_t cell[2])
{
    int64_t x = cell[0] + triangle->base[level][0], y = cell[1] + triangle->base[level][1];
    double w = o->map.weight[level];
    double h00 = oracle_map_sample(&o->map, level, x, y), h10 = oracle_map_sample(&o->map, level, x + 1, y);
    double h01 = oracle_map_sample(&o->map, level, x, y + 1);
    double h11 = oracle_map_sample(&o->map, level, x + 1, y + 1);
    return (oracle_bilinear){w * h00, w * (h10 - h00), w * (h01 - h00), w * ((h11 - h10) - (h01 - h00))};
}

/* Range of one level's height over the polygon: of the bilinear function at the corners of its
 * rectangle when that is in one cell, else of all samples of the cells touched. */
static void level_range(const oracle *o, const oracle_triangle *triangle, const oracle_polygon *polygon,
                        int level, double *lowest, double *highest)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < polygon->count; i++) {
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], polygon->corner[i].x[level][k]);
            high[k] = fmax(high[k], polygon->corner[i].x[level][k]);
        }
    }
    int64_t c0[2], c1[2];
    for (int k = 0; k < 2; k++) {
        c0[k] = (int64_t)floor(low[k]);
        c1[k] = (int64_t)ceil(high[k]);
        if (c1[k] <= c0[k]) c1[k] = c0[k] + 1;
    }
    if (c1[0] - c0[0] > 1 || c1[1] - c0[1] > 1) {
        const int64_t *base = triangle->base[level];
        oracle_map_range(&o->map, level, c0[0] + base[0], c0[1] + base[1], c1[0] + base[0], c1[1] + base[1],
                         lowest, highest);
        *lowest *= o->map.weight[level];
        *highest *= o->map.weight[level];
    } else {
        oracle_bilinear h = oracle_cell(o, triangle, level, c0);
        *lowest = INFINITY;
        *highest = -INFINITY;
        for (int i = 0; i < 4; i++) {
            double x = ((i & 1) != 0 ? high[0] : low[0]) - (double)c0[0];
            double y = ((i & 2) != 0 ? high[1] : low[1]) - (double)c0[1];
            double value = h.c + h.x * x + h.y * y + h.xy * x * y;
            *lowest = fmin(*lowest, value);
            *highest = fmax(*highest, value);
        }
    }
    if (*lowest > *highest) {
        double swap = *lowest;
        *lowest = *highest;
        *highest = swap;
    }
}

/* Range of |N|^2 of the affine N over a convex polygon: the maximum is at a corner (convex function);
 * the minimum is bounded by a corner's tangent plane. */
static void normal_range(const double normals[][3], int count, double *lowest, double *highest)
{
    double best = 0.0;
    *highest = 0.0;
    for (int i = 0; i < count; i++) {
        double least = INFINITY;
        double qi = 0.0;
        for (int k = 0; k < 3; k++) qi += normals[i][k] * normals[i][k];
        for (int j = 0; j < count; j++) {
            double slope = 0.0;
            for (int k = 0; k < 3; k++) slope += normals[i][k] * (normals[j][k] - normals[i][k]);
            least = fmin(least, qi + 2.0 * slope);
        }
        best = fmax(best, least);
        *highest = fmax(*highest, qi);
    }
    *lowest = best;
}

void oracle_polygon_box(const oracle *o, const oracle_triangle *triangle, const oracle_polygon *polygon,
                        const int64_t cells[4], double lower[3], double upper[3])
{
    (void)cells;
    double low = o->map.offset, high = o->map.offset, normals[ORACLE_POLYGON][3];
    for (int l = 0; l < o->map.levels; l++) {
        double a, b;
        level_range(o, triangle, polygon, l, &a, &b);
        low += a;
        high += b;
    }
    double reach = fmax(fabs(low), fabs(high));
    for (int i = 0; i < polygon->count; i++) {
        const oracle_corner *c = &polygon->corner[i];
        for (int k = 0; k < 3; k++)
            normals[i][k] = triangle->n0[k] + c->a * triangle->n[0][k] + c->b * triangle->n[1][k];
    }
    double s0 = low, s1 = high;
    bool bounded = true;
    if (!o->unnormalised) {
        double q0, q1;
        normal_range((const double(*)[3])normals, polygon->count, &q0, &q1);
        bounded = q0 > 1e-12;
        s0 = low < 0.0 ? low / sqrt(q0) : low / sqrt(q1);
        s1 = high > 0.0 ? high / sqrt(q0) : high / sqrt(q1);
    }
    for (int k = 0; k < 3; k++) {
        double hull0 = INFINITY, hull1 = -INFINITY, base0 = INFINITY, base1 = -INFINITY;
        for (int i = 0; i < polygon->count; i++) {
            const oracle_corner *c = &polygon->corner[i];
            double p = (triangle->v0[k] - o->origin[k]) + c->a * triangle->e[0][k] + c->b * triangle->e[1][k];
            double p0 = p + s0 * normals[i][k], p1 = p + s1 * normals[i][k];
            base0 = fmin(base0, p);
            base1 = fmax(base1, p);
            hull0 = fmin(hull0, fmin(p0, p1));
            hull1 = fmax(hull1, fmax(p0, p1));
        }
        /* Normalised heights are distances from the base, whatever the normals do. */
        if (!o->unnormalised) {
            hull0 = bounded ? fmax(hull0, base0 - reach) : base0 - reach;
            hull1 = bounded ? fmin(hull1, base1 + reach) : base1 + reach;
        }
        double pad = 1e-11 * (fabs(hull0) + fabs(hull1) + reach);
        lower[k] = hull0 - pad;
        upper[k] = hull1 + pad;
    }
}
