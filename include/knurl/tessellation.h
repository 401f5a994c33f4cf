/* knurl/tessellation.h: a displaced surface as plain triangles, for files and for programs that want a mesh.
 *
 * The plan comes first: how many vertices and triangles each base triangle becomes. Any part of the arrays is
 * then made when it is asked for, so that meshes larger than memory can be streamed:
 *
 *     knurl_tessellation_def def = knurl_tessellation_def_default();
 *     knurl_tessellation *t;
 *     knurl_tessellation_create(surface, &def, &t, &error);
 *     double *p = malloc(3 * sizeof *p * knurl_tessellation_vertices(t));
 *     knurl_tessellation_get_vertices(t, 0, knurl_tessellation_vertices(t), p, NULL, NULL);
 *     ...
 *     knurl_tessellation_release(t);
 *
 * Every vertex lies on the surface of knurl/surface.h at level of detail 0. Each base triangle has vertices
 * of its own. Those on a shared edge are equal bit for bit in both triangles, so that the mesh is closed
 * wherever the surface is: where both sides of an edge read the same texels (through whichever tile of a
 * repeated map, if the tiles are a whole number apart in float) and have the same normals at both ends.
 * Along other edges, texture seams and hard edges, S itself is open, and so is the mesh. */
#ifndef KNURL_TESSELLATION_H
#define KNURL_TESSELLATION_H

#include <knurl/surface.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct knurl_tessellation knurl_tessellation;

typedef struct knurl_tessellation_def {
    uint32_t cookie;
    double rate;            /* vertices per texel along edges, 0.001 to 64; default 1 */
    uint64_t max_triangles; /* lower the rate until there are no more; 0 (default): no limit. One per base
                               triangle always remains */
} knurl_tessellation_def;

KNURL_API knurl_tessellation_def knurl_tessellation_def_default(void);

/* Holds counts only, 24 bytes per base triangle; retains the surface, whatever its method. Immutable.
 * KNURL_ERROR_LIMIT if an edge would be cut into more than 65,535 pieces, or if there would be 2^32 - 1
 * vertices or more. */
KNURL_API knurl_status knurl_tessellation_create(knurl_surface *surface, const knurl_tessellation_def *def,
                                                 knurl_tessellation **tessellation, knurl_error *error);
KNURL_API void knurl_tessellation_release(knurl_tessellation *tessellation);

/* Vertices per texel after max_triangles. */
KNURL_API double knurl_tessellation_rate(const knurl_tessellation *tessellation);
KNURL_API uint64_t knurl_tessellation_vertices(const knurl_tessellation *tessellation);
KNURL_API uint64_t knurl_tessellation_triangles(const knurl_tessellation *tessellation);
/* Number of the first vertex and triangle of base triangle `base`; for `base` equal to the number of base
 * triangles, and above, the totals. Degenerate base triangles have none. */
KNURL_API uint64_t knurl_tessellation_first_vertex(const knurl_tessellation *tessellation, uint32_t base);
KNURL_API uint64_t knurl_tessellation_first_triangle(const knurl_tessellation *tessellation, uint32_t base);

/* Vertices [begin, begin + count): positions in the object's space (3 each), unit shading normals (3 each)
 * and the mesh's own texture coordinates (2 each); each array may be NULL. Uses the context's threads; the
 * result does not depend on their number nor on how the range is cut. Numbers past the last vertex are left
 * out. */
KNURL_API void knurl_tessellation_get_vertices(const knurl_tessellation *tessellation, uint64_t begin,
                                               uint64_t count, double *positions, float *normals,
                                               float *texcoords);
/* Triangles [begin, begin + count): three vertex numbers each, wound as the base triangle is. Numbers past
 * the last triangle are left out. */
KNURL_API void knurl_tessellation_get_triangles(const knurl_tessellation *tessellation, uint64_t begin,
                                                uint64_t count, uint32_t *indices);

#ifdef __cplusplus
}
#endif
#endif
