/* shell/shell.h: the shell of a base triangle: what is stored, and what a ray works with.
 *
 * The shell map is F(b, s) = P(b) + s N(b) with s the unnormalised height: s = h / |N| for the
 * normalised surface (RMIP 2023, Eq. 1), s = h for the unnormalised one (PDM 2025, Eq. 7). */
#ifndef KNURL_SRC_SHELL_SHELL_H
#define KNURL_SRC_SHELL_SHELL_H

#include "bounds/heightmap.h"
#include "math/vec.h"

#include <knurl/surface.h>

/* Vertex data, shared by every method. Triangles index vertices. */
typedef struct base_mesh {
    float *positions, *normals, *texcoords; /* 3, 3 (unit, or given directions), 2 per vertex */
    uint32_t *triangles;
    uint32_t vertex_count, triangle_count;
} base_mesh;

enum {
    SHELL_EMPTY = 1u << 0,          /* no area at any height: nothing to hit */
    SHELL_FOLDED = 1u << 1,         /* inversion is not unique: traced by boxes (subdivide.c) */
    SHELL_FLAT_UV = 1u << 2,        /* no area in texture space: (u, v) cannot be inverted */
    SHELL_CONSTANT_NORMAL = 1u << 3 /* three equal normals: shell space is affine */
};

/* Stored per base triangle. */
typedef struct shell {
    float height_min, height_max; /* range of h, rounded outwards */
    float normal_min;             /* lower bound of |N| over the triangle */
    float s_min, s_max;           /* range of s = h / |N|, padded and rounded outwards */
    float area;                   /* bound on twice the area of the offset triangles at s_min and s_max */
    uint16_t flags;
    uint8_t low_level, high_level; /* levels of detail that height_min and height_max are from */
} shell;

/* What all shells of a surface share. */
typedef struct shell_space {
    knurl_context *context;
    base_mesh mesh;
    shell *shells;
    knurl_heightmap *map;     /* never NULL: a 1 x 1 map stands for "none" */
    knurl_bounds_kind bounds; /* that shells' heights come from, whatever the map has by now */
    double factor, offset;
    knurl_wrap wrap_u, wrap_v;
    double uv[6]; /* u = uv[0] s + uv[1] t + uv[2], v = uv[3] s + uv[4] t + uv[5] */
    bool unnormalised;
    bool directions;   /* N was given as directions, which need not be normals of the base at all */
    double texel_size; /* object-space length of a level 0 texel, area mean */
} shell_space;

/* Level of detail resolved to one or two levels: h = (1 - blend) level[0] + blend level[1]. */
typedef struct height_lod {
    const height_level *level[2];
    double blend;     /* 0: level[1] is not read */
    double ratio[2];  /* texel coordinate of level 1: x1 = (x0 + 0.5) ratio - 0.5 */
    double lod;       /* clamped to the map's levels */
    double to_map[2]; /* texel of the map's level 0 per texel of level[0] */
} height_lod;

void height_lod_make(const shell_space *space, double lod, height_lod *lod_out);

/* One triangle, loaded and put into its local frame. Texel coordinates are those of lod->level[0],
 * relative to the integer texel `origin`, so that far tiles keep their last bits. */
typedef struct triangle_frame {
    vec3 p[3]; /* positions relative to vertex 0's position `base` */
    vec3 base;
    vec3 n[3];
    vec3 pe, pf, ne, nf;   /* edges of P and N: 1 - 0 and 2 - 0 */
    double x[3], y[3];     /* texel coordinates */
    double xe, xf, ye, yf; /* their edges */
    int64_t origin_x, origin_y;
    int64_t wrapped_x, wrapped_y; /* reads the same texels as the origin, from the first tile */
    double texel_rounding;        /* bound on the rounding of x, y */
    double size;                  /* largest |p| component, a length scale */
    double area;                  /* the shell\'s */
    double s0, s1;                /* range of the unnormalised height, padded outwards */
    double inverse_uv[4];         /* (b1, b2) = M (x - x[0], y - y[0]); zeros when SHELL_FLAT_UV */
    uint32_t flags;
    bool unnormalised;
} triangle_frame;

/* In two parts: everything but texel coordinates, then those. Or both at once. */
void triangle_frame_load_shape(const shell_space *space, uint32_t triangle, triangle_frame *frame);
void triangle_frame_load_texels(const shell_space *space, uint32_t triangle, const height_lod *lod,
                                triangle_frame *frame);
void triangle_frame_load(const shell_space *space, uint32_t triangle, const height_lod *lod,
                         triangle_frame *frame);

/* (u, v) of a vertex's (s, t). */
static inline vec2 shell_uv(const shell_space *space, double s, double t)
{
    const double *m = space->uv;
    return (vec2){m[0] * s + m[1] * t + m[2], m[3] * s + m[4] * t + m[5]};
}

/* |N| where it enters the surface; 1 for the unnormalised variant, so that h = s * this. */
static inline double frame_normal_scale(const triangle_frame *f, double b1, double b2)
{
    if (f->unnormalised) return 1.0;
    return v3_length(v3_mad(v3_mad(f->n[0], b1, f->ne), b2, f->nf));
}

/* One bilinear piece of h in texel coordinates: exact inside its cell, extended beyond it. */
typedef struct height_patch {
    double x, y;           /* corner that dx, dy are relative to */
    double c, cx, cy, cxy; /* h = c + cx dx + cy dy + cxy dx dy */
    double min, max;       /* range of h over the cell, including rounding */
    double slope;          /* bound on |h_x| + |h_y| over the cell */
} height_patch;

/* Cell (i, j) of level[0], relative to the frame's origin; (i1, j1), cell of level[1] in absolute
 * indices, matters only when lod->blend > 0. */
void height_patch_load(const shell_space *space, const height_lod *lod, const triangle_frame *frame,
                       int64_t i, int64_t j, int64_t i1, int64_t j1, height_patch *patch);

/* The piece at any position of the frame's texels, of both levels where the level of detail blends two. */
void height_patch_find(const shell_space *space, const height_lod *lod, const triangle_frame *frame, double x,
                       double y, height_patch *patch);

static inline double height_patch_at(const height_patch *patch, double x, double y)
{
    double dx = x - patch->x, dy = y - patch->y;
    return patch->c + patch->cx * dx + dy * (patch->cy + patch->cxy * dx);
}

/* Conservative range of h over a rectangle of the frame's texel coordinates. */
knurl_range shell_height_range(const shell_space *space, const height_lod *lod, knurl_bounds_kind kind,
                               const triangle_frame *frame, double x0, double y0, double x1, double y1);

/* A root found on a shell: everything else of a hit follows from it. */
typedef struct shell_root {
    double t;
    double b1, b2;
    double x, y;        /* texel coordinates in the frame */
    height_patch patch; /* the bilinear piece the root lies on */
} shell_root;

/* Brings the root to full precision with Newton's method on S(b) - O - t D = 0. */
void shell_root_polish(const triangle_frame *frame, const knurl_ray *ray, shell_root *root);
/* Newton's method on S(b) - O - t D = 0 from b1, b2 and t of *root, on its patch, to the end: the last step
 * is within `error`, the bounds on what rounding makes of b1 and b2. False if it does not get there, as near
 * tangencies, or leaves the triangle far behind. */
bool shell_root_solve(const triangle_frame *frame, const knurl_ray *ray, shell_root *root, double error[2]);
/* Fills every field but steps, object and instance. */
void shell_hit_fill(const shell_space *space, const height_lod *lod, const triangle_frame *frame,
                    uint32_t triangle, const knurl_ray *ray, const shell_root *root, knurl_hit *hit);

/* Building: subjects of their own files. All return KNURL_OK or an error with its place. */
knurl_status base_mesh_copy(knurl_context *context, const knurl_mesh_view *view, base_mesh *mesh,
                            uint64_t *replaced_normals, knurl_error *error);
void base_mesh_free(knurl_context *context, base_mesh *mesh);
/* Inner edges whose two sides read different places of the map. */
uint64_t shell_seam_edges(const shell_space *space);
/* Fills space->shells and space->texel_size from everything else. */
knurl_status shell_space_build(shell_space *space, knurl_error *error);
/* Box of a shell, rounded outwards; false for SHELL_EMPTY. */
bool shell_box(const shell_space *space, uint32_t triangle, double lower[3], double upper[3]);

/* Box-based search for the nearest root, for folded shells and for rays the curve cannot follow
 * (subdivide.c). Needs no inversion. Counts visited boxes in *steps. */
bool shell_subdivide(const shell_space *space, const height_lod *lod, knurl_bounds_kind kind,
                     const triangle_frame *frame, const knurl_ray *ray, bool any, shell_root *root,
                     uint32_t *steps);

#endif
