/* accel/mesh.h: plain triangle meshes and a watertight ray-triangle test in double precision. */
#ifndef KNURL_SRC_ACCEL_MESH_H
#define KNURL_SRC_ACCEL_MESH_H

#include "accel/bvh.h"

#include <knurl/surface.h>

/* Copies of the caller's arrays. */
typedef struct accel_mesh {
    knurl_context *context;
    float *positions; /* 3 per vertex */
    float *normals;   /* 3 per vertex, unit or zero; or NULL */
    float *texcoords; /* 2 per vertex, or NULL */
    uint32_t *triangles;
    uint32_t vertex_count, triangle_count;
    uint64_t bytes;
} accel_mesh;

knurl_status accel_mesh_create(knurl_context *context, const knurl_mesh_view *view, accel_mesh **mesh,
                               knurl_error *error);
void accel_mesh_release(accel_mesh *mesh);

/* accel_bounds_fn with the mesh as `user`; leaves out triangles without area. */
bool accel_mesh_bounds(const void *mesh, uint32_t triangle, accel_box *box);

/* A ray made ready for many triangles of one mesh. */
typedef struct accel_shear {
    double origin[3], direction[3]; /* the segment's, relative to `centre` */
    double centre[3];
    double t0;         /* t of the origin */
    int kx, ky, kz;    /* kz: the largest component of the direction */
    double sx, sy, sz; /* Woop et al. 2013, section 3.1 */
} accel_shear;
void accel_shear_make(const accel_segment *segment, vec3 centre, accel_shear *shear);

/* Hit of one triangle in [tmin, tmax]: t and the barycentrics of vertices 1 and 2. */
bool accel_mesh_intersect(const accel_mesh *mesh, uint32_t triangle, const accel_shear *shear, double tmin,
                          double tmax, double *t, double ab[2]);
/* Everything else of a hit but t, object, instance and steps. */
void accel_mesh_fill_hit(const accel_mesh *mesh, uint32_t triangle, const double ab[2], knurl_hit *hit);

#endif
