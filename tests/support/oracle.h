/* support/oracle.h: a slow double-precision answer to "where does this ray meet the displaced
 * surface", by means that share nothing with the library.
 *
 * Every base triangle is cut along the texel lines of its map into convex pieces on which the height
 * is one bilinear function. On a piece the ray's two transverse equations
 *
 *     e1 . (P + k N - O) = 0,  e2 . (P + k N - O) = 0,  k = h / |N| (or h),  e1, e2 exactly across D
 *
 * are solved by subdivision with a preconditioned Krawczyk test: a box of parameters is dropped when an
 * enclosure proves that it holds no root, and a root is accepted when the enclosure of the Jacobian
 * proves that the box holds at most one and Newton's map contracts onto it. Neither the heights nor the
 * shells need to be invertible. A bounding-box tree only skips pieces that the ray cannot touch. */
#ifndef KNURL_TESTS_ORACLE_H
#define KNURL_TESTS_ORACLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum oracle_wrap { ORACLE_REPEAT = 0, ORACLE_MIRROR, ORACLE_CLAMP } oracle_wrap;

typedef enum oracle_format { ORACLE_U8 = 1, ORACLE_U16 = 2, ORACLE_F32 = 4 } oracle_format;

typedef struct oracle_def {
    const float *positions; /* 3 per vertex */
    const float *normals;   /* 3 per vertex; normalised in double, then rounded to float */
    const float *texcoords; /* 2 per vertex */
    uint32_t vertex_count;
    const uint32_t *triangles;
    uint32_t triangle_count;
    int32_t width, height;
    oracle_format format;
    const void *samples; /* width * height, one channel; NULL: the map is 0 everywhere */
    double factor, offset;
    oracle_wrap wrap_u, wrap_v;
    double uv_offset[2], uv_scale[2], uv_rotation;
    bool unnormalised;
    double lod; /* level of detail of every ray, clamped to [0, levels - 1] */
} oracle_def;

typedef struct oracle oracle;

typedef struct oracle_ray {
    double origin[3], direction[3];
    double tmin, tmax;
} oracle_ray;

typedef struct oracle_root {
    double t;
    double a, b; /* barycentrics of vertices 1 and 2 */
    uint32_t triangle;
    double position[3];
    double cosine; /* |D . n| of unit vectors: 0 is a tangency; the least of all pieces that meet here */
    double margin; /* smallest distance to the piece's border in pieces' half sizes: under about
                      1e-9 the root may belong to the neighbour piece */
    bool certain;  /* one transversal crossing, proven: the ray meets the surface here whatever the
                      rounding. Else it runs within rounding of a tangency, a sharp crease, an open
                      edge of the surface or the border of [tmin, tmax] */
    /* What `certain` is made from. */
    bool simple;     /* the pieces' Jacobians are proven regular around the root */
    bool degenerate; /* the ray runs along the surface within rounding for a while: a box of that, no exact
                        place */
    bool on_edge;    /* within rounding of an edge of the base triangle */
    bool open;       /* ... that no other triangle's surface continues */
    bool in_window;  /* not within rounding of tmin or tmax */
    bool mixed;      /* pieces that meet here are crossed in different senses: a crease seen edge on */
    int side;        /* sign of D . (S_a x S_b) */
    int pieces;      /* how many pieces' roots were merged into this one */
} oracle_root;

/* Copies everything; NULL when out of memory. As knurl/surface.h says of degenerate triangles, those whose
 * offset triangles V_i(d) = P_i + d N_i have no area for any d are not part of the surface, although
 * P + h N may sweep a fin over them. */
oracle *oracle_create(const oracle_def *def);
void oracle_destroy(oracle *o);

/* All roots with t in [tmin, tmax], by t, one for each place: roots of neighbouring pieces at the same
 * place are merged. Returns how many there are; at most `capacity` are stored. */
int oracle_roots(const oracle *o, const oracle_ray *ray, oracle_root *roots, int capacity);
/* Whether the surface is all around the ray at a root: the rays beside it, on a circle of 1e-8 of the
 * scale, meet it there too. Where several pieces meet, `certain` says only that those found are crossed in
 * one sense; a piece seen almost edge on may not be among them. This settles it. */
bool oracle_surrounded(const oracle *o, const oracle_ray *ray, const oracle_root *root);
/* The first root only; false for none. */
bool oracle_first(const oracle *o, const oracle_ray *ray, oracle_root *root);

/* The surface itself: point, unit normal of S_a x S_b, height. Any of the outputs may be NULL. */
void oracle_surface(const oracle *o, uint32_t triangle, double a, double b, double position[3],
                    double normal[3], double *height);
/* Smallest distance between the ray's line and the surface near (triangle, a, b), found by descent that
 * stays inside the triangle. */
double oracle_gap(const oracle *o, const oracle_ray *ray, uint32_t triangle, double a, double b);
/* Map coordinates after the uv transform at a point of a triangle. */
void oracle_uv(const oracle *o, uint32_t triangle, double a, double b, double uv[2]);
/* A corner of the texel grid (where four bilinear cells of level 0 meet) inside a triangle: the fractions
 * pick one from the grid over the triangle's rectangle; false if that is outside of the triangle. */
bool oracle_texel_corner(const oracle *o, uint32_t triangle, double fx, double fy, double *a, double *b);
/* Reconstruction of the map at (u, v). */
double oracle_map_value(const oracle *o, double u, double v);
/* Length of the diagonal of the surface's bounds, and the bounds. */
double oracle_scale(const oracle *o);
void oracle_bounds(const oracle *o, double lower[3], double upper[3]);
uint64_t oracle_bytes(const oracle *o);

#endif
