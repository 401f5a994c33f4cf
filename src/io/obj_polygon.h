/* io/obj_polygon.h: triangles of a polygon. */
#ifndef KNURL_SRC_IO_OBJ_POLYGON_H
#define KNURL_SRC_IO_OBJ_POLYGON_H

#include <stdint.h>

/* Polygons of more corners are cut into a fan, which is right for convex ones. */
enum { OBJ_POLYGON_MAX_EARS = 256 };

/* Cuts the polygon of `count` >= 3 corners (positions: 3 floats per corner) into count - 2 triangles
 * of corner numbers, in the polygon's orientation. Simple polygons up to OBJ_POLYGON_MAX_EARS corners
 * are cut correctly, concave ones too; others still give count - 2 triangles. */
void obj_polygon_triangulate(const float *positions, uint32_t count, uint32_t *triangles);

#endif
