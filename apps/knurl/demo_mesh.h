/* demo_mesh.h: low-poly base meshes. Vertices on two sides of a texture seam are duplicated with
 * the same floats, so closed shapes are closed bit for bit. */
#ifndef KNURL_APPS_DEMO_MESH_H
#define KNURL_APPS_DEMO_MESH_H

#include <stdbool.h>
#include <stdint.h>

/* Starts as zeros. Out of memory is remembered and makes every later call do nothing. */
typedef struct demo_mesh {
    float *positions, *normals; /* 3 per vertex */
    float *texcoords;           /* 2 per vertex */
    uint32_t vertex_count, vertex_capacity;
    uint32_t *triangles; /* 3 per triangle, counter-clockwise around the normals */
    uint32_t triangle_count, triangle_capacity;
    bool out_of_memory;
} demo_mesh;

void demo_mesh_release(demo_mesh *mesh);

/* Point and unit normal of a shape at (s, t) in [0, 1]. */
typedef void demo_patch_fn(const void *shape, double s, double t, double position[3], double normal[3]);

/* A grid of columns x rows quads over [0, 1]^2, texture coordinates (s, t). Closed axes evaluate
 * their last line of vertices where the first one is. Triangles without area are left out. */
typedef struct demo_patch {
    demo_patch_fn *evaluate;
    const void *shape;
    int columns, rows;
    bool closed_s, closed_t;
} demo_patch;
void demo_mesh_patch(demo_mesh *mesh, const demo_patch *patch);

/* In the plane y = 0, centred, facing +y; u along +x, v along +z. */
void demo_mesh_plane(demo_mesh *mesh, double width, double depth, int columns, int rows);
/* Latitude-longitude, v = 0 at the upper pole; 2 * segments * (rings - 1) triangles. */
void demo_mesh_sphere(demo_mesh *mesh, double radius, int segments, int rings);
/* An octahedron divided into 8 n^2 triangles; its chart is the square folded over the octahedron:
 * no poles, and seams only on the square's border, where (0, v) meets (0, 1 - v) and so on. */
void demo_mesh_octasphere(demo_mesh *mesh, double radius, int n);
/* Point and unit normal of a shape seen from its middle along a unit direction. */
typedef void demo_ball_fn(const void *shape, const double direction[3], double position[3], double normal[3]);
/* The octasphere's lattice and chart on any such shape. */
void demo_mesh_ball(demo_mesh *mesh, demo_ball_fn *evaluate, const void *shape, int n);
/* Around the y axis; u around the axis, v around the tube, v = 0 outside and 0.25 on top. */
void demo_mesh_torus(demo_mesh *mesh, double radius, double tube, int segments, int sides);

typedef struct demo_box {
    double size[3];
    int divisions;      /* quads per side of a face */
    bool smooth;        /* normals away from the centre, shared by the faces; else one per face */
    double side_extent; /* v range of the four upright faces, 1 for the whole map */
} demo_box;
/* Centred; each face has its own chart, the top and the bottom the whole map. */
void demo_mesh_box(demo_mesh *mesh, const demo_box *box);

/* A smooth curve through `count` points (radius, y), turned around the y axis. Outside is to the
 * right of the way the curve runs: up for an outer wall, down for an inner one. v is the arc length
 * along the curve, u runs around the axis. An end with radius 0 is closed and smooth. */
typedef struct demo_profile {
    const double (*points)[2];
    int count; /* 3 or more */
    int segments, rings;
} demo_profile;
void demo_mesh_lathe(demo_mesh *mesh, const demo_profile *profile);

/* Multiplies all texture coordinates: tiles of a mesh's own. */
void demo_mesh_scale_texcoords(demo_mesh *mesh, double u, double v);

/* Direction of a point of the octahedral chart. */
void demo_octahedral(double u, double v, double direction[3]);
/* The same of demo_mesh_sphere's chart. */
void demo_latitude_longitude(double u, double v, double direction[3]);

#endif
