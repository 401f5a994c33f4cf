/* demo_shape.h: freely shaped base meshes; their normals come from differences. */
#ifndef KNURL_APPS_DEMO_SHAPE_H
#define KNURL_APPS_DEMO_SHAPE_H

#include "demo_curve.h"
#include "demo_mesh.h"

/* Point of a surface at (s, t) in [0, 1], defined a little beyond; periodic along closed axes. */
typedef void demo_surface_fn(const void *shape, double s, double t, double position[3]);

typedef struct demo_surface {
    demo_surface_fn *evaluate;
    const void *shape;
    int columns, rows;
    bool closed_s;
    bool flip; /* outside is dP/dt x dP/ds in place of dP/ds x dP/dt */
} demo_surface;

/* A row t = 0 or t = 1 that is one point gets one normal. */
void demo_mesh_surface(demo_mesh *mesh, const demo_surface *surface);

/* Pulls a ball's surface about one direction. */
typedef struct demo_bump {
    double at[3];   /* direction, any length */
    double width;   /* of the Gaussian, as a chord of the unit sphere */
    double push[3]; /* metres at its middle */
    bool mirrored;  /* again on the other side of x = 0 */
} demo_bump;

typedef struct demo_sculpture {
    double size[3]; /* radii of the ellipsoid to start from */
    const demo_bump *bumps;
    int count;
} demo_sculpture;

/* 8 n^2 triangles with the octahedral chart. */
void demo_mesh_sculpture(demo_mesh *mesh, const demo_sculpture *sculpture, int n);
/* 2 * segments * (rings - 1) triangles with a latitude-longitude chart. */
void demo_mesh_sculpture_globe(demo_mesh *mesh, const demo_sculpture *sculpture, int segments, int rings);
/* Point and normal of a sculpture, for what is set upon it. */
void demo_sculpture_at(const void *sculpture, const double direction[3], double position[3],
                       double normal[3]);

/* A round tube along a curve of points (x, y, z, radius, width over height). u runs around it, from
 * below by the right side; v along it, by length. The ends are rounded over `cap` parts
 * of the length and closed; cap 0 leaves them open. */
typedef struct demo_tube {
    const double (*points)[5];
    int count;
    double up[3]; /* above; not along the start */
    double cap;
    int segments, rings;
} demo_tube;
void demo_mesh_tube(demo_mesh *mesh, const demo_tube *tube);

#endif
