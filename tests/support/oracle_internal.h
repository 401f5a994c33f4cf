/* support/oracle_internal.h: what the oracle's files share. */
#ifndef KNURL_TESTS_ORACLE_INTERNAL_H
#define KNURL_TESTS_ORACLE_INTERNAL_H

#include "oracle.h"

enum { ORACLE_LEVELS = 20, ORACLE_POLYGON = 12 };

typedef struct oracle_level {
    int32_t width, height;
    double *values; /* scaled to [0, 1] for integers */
    double lowest, highest;
} oracle_level;

/* The map as the surface sees it: one level, or two that are blended. */
typedef struct oracle_map {
    oracle_level level[2];
    int levels;       /* 1 or 2 */
    double weight[2]; /* of each level, already multiplied by the factor */
    double offset;
    oracle_wrap wrap_u, wrap_v;
} oracle_map;

/* Rounds to float. GCC 12 at -O2 drops the rounding of (double)(float)x from loops that it vectorises. */
static inline double oracle_round_float(double x)
{
    volatile float f = (float)x;
    return (double)f;
}

/* false when out of memory. */
bool oracle_map_build(oracle_map *map, const oracle_def *def);
void oracle_map_free(oracle_map *map);
double oracle_map_sample(const oracle_map *map, int level, int64_t x, int64_t y);
/* Height (offset and factor applied) at texel coordinates of level 0, X = u * width. */
double oracle_map_height(const oracle_map *map, double u, double v);
/* Range of one level's samples over the cells [x0, x1) x [y0, y1): samples x0 .. x1, y0 .. y1. */
void oracle_map_range(const oracle_map *map, int level, int64_t x0, int64_t y0, int64_t x1, int64_t y1,
                      double *lowest, double *highest);

/* A base triangle relative to its vertex 0. Texel coordinates, X = u * width - 0.5, are relative to
 * an integer base so that large tile numbers cost no digits. */
typedef struct oracle_triangle {
    double v0[3];                /* absolute */
    double e[2][3];              /* V1 - V0, V2 - V0 */
    double n0[3], n[2][3];       /* N0, N1 - N0, N2 - N0 */
    double uv0[2], uv[2][2];     /* u, v: value at vertex 0, slopes in a and b */
    int64_t base[2][2];          /* per level, axis */
    double x0[2][2], x[2][2][2]; /* per level, axis: value at vertex 0; [..][a or b] slopes */
    bool singular;               /* (a, b) cannot be had from (X, Y) */
    double inverse[2][2];        /* of level 0: d(a, b) / d(X, Y) */
    int64_t cells[4];            /* x0, y0, x1, y1 of level 0, relative to base */
    bool empty;                  /* no area at any height: not part of the surface */
    bool open[3];                /* edges b = 0, a = 0, a + b = 1: no other triangle continues S there */
} oracle_triangle;

/* Corner of a convex piece. */
typedef struct oracle_corner {
    double a, b;
    double x[2][2]; /* texel coordinates per level, axis, relative to the triangle's base */
} oracle_corner;

typedef struct oracle_polygon {
    oracle_corner corner[ORACLE_POLYGON];
    int count;
} oracle_polygon;

/* One bilinear piece: the part of a triangle in one texel cell of each level. */
typedef struct oracle_piece {
    const oracle_triangle *triangle;
    uint32_t index;
    const oracle_polygon *polygon;
    int64_t cell[2][2]; /* per level, axis, relative to base */
} oracle_piece;

typedef struct oracle_node {
    double lower[3], upper[3]; /* relative to the oracle's origin */
    uint32_t child[2];         /* both 0 for a leaf */
    uint32_t triangle;         /* of a leaf */
    int32_t cells[4];          /* of a leaf, relative to the triangle's base */
} oracle_node;

struct oracle {
    oracle_map map;
    oracle_triangle *triangles;
    uint32_t triangle_count;
    bool unnormalised;
    double origin[3]; /* of the node boxes */
    double scale;
    oracle_node *nodes;
    size_t node_count, node_capacity;
    uint32_t root;
    bool failed;
};

/* A ray made ready: axis is the direction's largest component, u and v the other two. */
typedef struct oracle_query {
    oracle_ray ray;
    int axis, u, v;
    double local[3];   /* origin relative to the oracle's */
    double inverse[3]; /* 1 / direction, infinite for 0 */
    double tmax;       /* shrinks when only the first root is wanted */
    bool first_only;
    double slack; /* in t: roots this near outside of [tmin, tmax] are kept, as uncertain */
    double pad;   /* of boxes, from rounding */
    double same;  /* in t: within this a root may be a copy of another */
    oracle_root *roots;
    int count, capacity;
} oracle_query;

void oracle_solve_piece(const oracle *o, const oracle_piece *piece, oracle_query *query);
/* Finds the open edges of all triangles. */
void oracle_find_open_edges(oracle *o);
/* Joins the root with those at the same place, and keeps the list sorted. */
void oracle_query_add(const oracle *o, oracle_query *query, const oracle_root *root);

/* Bilinear height of a piece in texel offsets from its cell corners. */
typedef struct oracle_bilinear {
    double c, x, y, xy;
} oracle_bilinear;
oracle_bilinear oracle_cell(const oracle *o, const oracle_triangle *triangle, int level,
                            const int64_t cell[2]);

/* Keeps the part of `in` on the side of `axis` of `level` that is >= line (keep_upper) or <= line. */
void oracle_clip(const oracle_polygon *in, oracle_polygon *out, int level, int axis, double line,
                 bool keep_upper);
/* Box of the surface over a polygon inside the cells; relative to the oracle's origin. */
void oracle_polygon_box(const oracle *o, const oracle_triangle *triangle, const oracle_polygon *polygon,
                        const int64_t cells[4], double lower[3], double upper[3]);
void oracle_triangle_polygon(const oracle_triangle *triangle, oracle_polygon *polygon);

#endif
