/* knurl/surface.h: a triangle mesh displaced by a height map, and rays against it.
 *
 * For a base triangle with barycentrics (a, b), positions P, vertex normals interpolated to N
 * and texture coordinates (u, v), all affine in (a, b), the surface is
 *
 *     S(a, b) = P(a, b) + h(u, v) N(a, b) / |N(a, b)|      [RMIP 2023, Eq. 1]
 *     h(u, v) = offset + factor * map(u, v)                [object-space length]
 *
 * Barycentrics: a point is (1 - a - b) V0 + a V1 + b V2. */
#ifndef KNURL_SURFACE_H
#define KNURL_SURFACE_H

#include <knurl/heightmap.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A triangle mesh by reference: the arrays must outlive the call only (they are copied). */
typedef struct knurl_mesh_view {
    const float *positions; /* 3 per vertex, finite */
    const float *normals;   /* 3 per vertex or NULL: angle-weighted smooth normals are made,
                               vertices at equal positions share theirs. Normalised on entry. */
    const float *texcoords; /* 2 per vertex or NULL: all (0, 0). v = 0 at the image's first row */
    uint32_t vertex_count;
    const uint32_t *triangles; /* 3 per triangle, each under vertex_count */
    uint32_t triangle_count;
    const float *directions; /* NULL, or 3 per vertex: N of any non-zero length below 1e18 in place of
                                the unit normals; the surface is then S = P + h N whatever
                                knurl_displacement.unnormalised says. With N pointing to one point,
                                shells are frusta (reverse perspective, Baboud and Decoret 2006) */
} knurl_mesh_view;

/* How a map displaces a mesh. Fill with knurl_displacement_default(). The uv transform is that of
 * KHR_texture_transform: (u, v) = offset + rotate(scale * (s, t)). */
typedef struct knurl_displacement {
    uint32_t cookie;
    knurl_heightmap *map; /* NULL: a constant height of `offset`; retained */
    double factor;        /* object-space length for map value 1, default 1 */
    double offset;        /* object-space length, default 0 */
    knurl_wrap wrap_u, wrap_v;
    double uv_offset[2];
    double uv_scale[2]; /* default 1, 1; tiling is free of memory */
    double uv_rotation; /* radians, counter-clockwise as in KHR_texture_transform */
    bool unnormalised;  /* true: S = P + h N (PDM 2025, Eq. 7; shell mapping) */
} knurl_displacement;

KNURL_API knurl_displacement knurl_displacement_default(void);

/* Ray. Points are origin + t * direction; direction may have any finite, non-zero length. An origin may be
 * anywhere; the hit is as exact as t, which is rounded relative to the distance. */
typedef struct knurl_ray {
    double origin[3];
    double direction[3];
    double tmin, tmax; /* closed range, 0 <= tmin <= tmax <= infinity */
    float lod;         /* level of detail in [0, levels - 1], fractional allowed; clamped */
    float cone_width;  /* when cone_spread or cone_width > 0, the level of detail is chosen from */
    float cone_spread; /* the width cone_width + t * cone_spread where the ray enters the
                          object's bounds, but never finer than `lod` */
    uint32_t mask;     /* instances with (instance mask & ray mask) != 0 are seen */
} knurl_ray;

/* A ray with tmin 0, tmax infinite, lod 0, no cone, every mask bit. */
KNURL_API knurl_ray knurl_ray_make(const double origin[3], const double direction[3]);

#define KNURL_NO_HIT UINT32_MAX

typedef struct knurl_hit {
    double t;           /* smallest in [tmin, tmax]; meaningful only if triangle != KNURL_NO_HIT */
    double position[3]; /* on the surface, from (a, b), not from the ray */
    double ng[3];       /* unit S_a x S_b; not turned towards the ray */
    double ns[3];       /* unit shading normal: PDM 2025 Eq. 10 on displaced meshes (with directions,
                           S_a x S_b with the same smooth gradient of h), the interpolated vertex
                           normal on plain ones */
    double a, b;        /* barycentrics of vertices 1 and 2 */
    double uv[2];       /* map coordinates after the uv transform, before wrapping */
    double st[2];       /* the mesh's own texture coordinates */
    double height;      /* h at the hit, object-space length */
    double error;       /* bound on the distance between `position` and the exact surface point;
                           start secondary rays at least 2 * error off the surface */
    uint32_t triangle;  /* base triangle, or KNURL_NO_HIT */
    uint32_t object;    /* object number in its scene; 0 outside scenes */
    uint32_t instance;  /* instance number in its scene; 0 outside scenes */
    uint32_t steps;     /* traversal steps: bounds visited plus texels visited, whole ray */
} knurl_hit;

/* A displaced mesh made ready for one method. Immutable but for knurl_surface_update(); any number of threads
 * may trace it. */
typedef struct knurl_surface knurl_surface;

typedef struct knurl_surface_def {
    uint32_t cookie;
    knurl_mesh_view mesh;
    knurl_displacement displacement;
    const char *method; /* an intersection method, with parameters if wanted, each after a colon:
                           "fast" (default, and for NULL), "fast:budget=64",
                           "rmip:marching-scale=4:bounds=minmax" */
} knurl_surface_def;

KNURL_API knurl_surface_def knurl_surface_def_default(void);
KNURL_API knurl_status knurl_surface_create(knurl_context *context, const knurl_surface_def *def,
                                            knurl_surface **surface, knurl_error *error);
KNURL_API void knurl_surface_release(knurl_surface *surface);
KNURL_API knurl_surface *knurl_surface_retain(knurl_surface *surface);

/* Brings the surface up to date after knurl_heightmap_update() replaced this rectangle of its map, or several
 * edits inside it: shells, the method's data, the info; of methods with a hierarchy of their own, only what
 * depends on the rectangle. Any wrap mode and tiling. Nothing else may use the surface, or a scene that has
 * it, during the call; afterwards call knurl_scene_update() for each such scene. Hits are those of a new
 * surface on the edited map. If it fails, rays may still be shot but can miss what changed, the edit counts
 * as not yet taken in, and the next successful call takes in everything. KNURL_ERROR_ARGUMENT: not a
 * rectangle of the map, or displacement beyond 1e18. KNURL_ERROR_MEMORY. */
KNURL_API knurl_status knurl_surface_update(knurl_surface *surface, int32_t x, int32_t y, int32_t width,
                                            int32_t height, knurl_error *error);

/* Number of shells: the primitive count for an outside BVH. One per base triangle; one in all for methods
 * with a hierarchy of their own (KNURL_METHOD_WHOLE). */
KNURL_API uint32_t knurl_surface_shell_count(const knurl_surface *surface);
/* Axis-aligned box of one shell, rounded outwards; false if the triangle is empty (skip it). */
KNURL_API bool knurl_surface_shell_bounds(const knurl_surface *surface, uint32_t shell, float lower[3],
                                          float upper[3]);
/* Nearest hit of one shell in [tmin, tmax]. On a hit fills *hit and returns true; else leaves all
 * but hit->steps, which grows by the work done, as it was: initialise it. */
KNURL_API bool knurl_surface_intersect(const knurl_surface *surface, uint32_t shell, const knurl_ray *ray,
                                       knurl_hit *hit);
/* Whether anything of one shell lies in [tmin, tmax]. */
KNURL_API bool knurl_surface_occluded(const knurl_surface *surface, uint32_t shell, const knurl_ray *ray);
/* The same for many rays at once, which methods with a hierarchy of their own make use of: found[i] says
 * whether ray i hit, hits[i] (not read before, fully written where found) what; hits[i].steps is the work of
 * ray i either way. */
KNURL_API void knurl_surface_intersect_many(const knurl_surface *surface, uint32_t shell,
                                            const knurl_ray *rays, size_t count, knurl_hit *hits,
                                            bool *found);
KNURL_API void knurl_surface_occluded_many(const knurl_surface *surface, uint32_t shell,
                                           const knurl_ray *rays, size_t count, bool *found);
/* Resolves a cone to the level of detail of this surface (see knurl_ray), at distance t. */
KNURL_API double knurl_surface_cone_lod(const knurl_surface *surface, const knurl_ray *ray, double t);

typedef struct knurl_surface_info {
    uint64_t triangles;
    uint64_t folded;               /* triangles whose shell folds over itself, traced by boxes */
    uint64_t flat_uv;              /* triangles with no area in texture space */
    uint64_t degenerate;           /* triangles with no area at any height, which are empty */
    uint64_t replaced_normals;     /* vertices with zero or non-finite normals given smooth ones */
    uint64_t seam_edges;           /* inner edges whose two sides read different uv */
    double height_min, height_max; /* displacement range, object-space length */
    double lower[3], upper[3];     /* bounds of all shells */
    double texels;                 /* texels covered by the mesh, tiling included */
    uint64_t mesh_bytes;           /* vertex and index data */
    uint64_t shell_bytes;          /* shells and the method's own data */
    uint64_t map_bytes;            /* the map with all its structures (shared with other surfaces) */
    uint64_t tessellated_bytes;    /* estimate for Embree triangles, one vertex per texel */
} knurl_surface_info;

/* KNURL_METHOD_* of the surface's method. On a native one, calls for one shell answer for the exact surface,
 * found by boxes over the map, not for the facets that a scene traces. */
KNURL_API uint32_t knurl_surface_flags(const knurl_surface *surface);

KNURL_API void knurl_surface_get_info(const knurl_surface *surface, knurl_surface_info *info);

/* The methods that knurl_surface_def.method may name. */
KNURL_API int32_t knurl_method_count(void);
KNURL_API const char *knurl_method_name(int32_t index);    /* NULL out of range */
KNURL_API const char *knurl_method_summary(int32_t index); /* one line, with its paper */

enum {
    KNURL_METHOD_EXACT = 1u << 0,        /* finds the first hit of the exact surface */
    KNURL_METHOD_UNNORMALISED = 1u << 1, /* defined for S = P + h N, and makes its surface so */
    KNURL_METHOD_NATIVE = 1u << 2,       /* traced by Embree itself; no level of detail, no shells */
    KNURL_METHOD_WHOLE = 1u << 3         /* has a hierarchy of its own: the surface is one shell */
};
KNURL_API uint32_t knurl_method_flags(int32_t index); /* KNURL_METHOD_*; 0 out of range */

/* A number, or one of several names. */
typedef struct knurl_method_parameter {
    const char *name, *summary;
    double preset, least, most; /* default value and closed range */
    const char *choices;        /* NULL for numbers; else names with | between, valued 0, 1, ... */
    bool whole;                 /* a whole number */
} knurl_method_parameter;

/* Parameter number `parameter` of a method; NULL past the last. */
KNURL_API const knurl_method_parameter *knurl_method_get_parameter(int32_t index, int32_t parameter);
/* Whether `specification` names a method and parameters that it has, with values in range. *index
 * (may be NULL) is the method. */
KNURL_API knurl_status knurl_method_check(const char *specification, int32_t *index, knurl_error *error);

#ifdef __cplusplus
}
#endif
#endif
