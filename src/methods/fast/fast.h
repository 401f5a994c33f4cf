/* methods/fast/fast.h: the structures of the method `fast`.
 *
 * Everything in floats here only says where to look: it is conservative, with bounds on its errors. What is
 * a hit is decided in double precision on S itself (root.c). All lengths and heights in these structures
 * are multiplied by fast_data.scale and relative to fast_data.centre, so that the surface has a radius of
 * at most 1 whatever its units.
 *
 * The maths. In the frame of a base triangle a point is (x, y, s): texels and unnormalised height. With d
 * the distance in (x, y, s) from a fixed point where the shell map F = P + s N has the derivative J,
 *     F - F0 = J d + d_s (N_x d_x + N_y d_y)                                   (exactly)
 * so that for a point Q on the ray, with q = J^-1 (Q - F0), which is linear in the ray's parameter,
 *     d = q - d_s (K_x d_x + K_y d_y),   K = J^-1 N_x, J^-1 N_y.
 * This is solved by iteration (walk.h, patch.c). The ray's curve in shell space is thus
 * known in a few operations, and bends by -2 d_s' (K_x d_x' + K_y d_y') (design of the shell curve:
 * J c'' = -2 s' (N_x x' + N_y y')). */
#ifndef KNURL_SRC_METHODS_FAST_FAST_H
#define KNURL_SRC_METHODS_FAST_FAST_H

#include "bounds/blocks.h"
#include "methods/method.h"

enum {
    FAST_SEARCHED = 1u << 0, /* no float frame: folded, flat, or too far from affine. By shell_search() */
    FAST_WRAPPED = 1u << 1,  /* part only: its texels are reached through the wrap mode, one by one */
    FAST_CROWDED = 1u << 2,  /* patch only: searched because it would have too many of those */
    FAST_WHOLE = 1u << 3     /* part only: all of a base triangle, searched */
};

/* What parts of a base triangle share. Vectors have a fourth lane. */
typedef struct fast_patch {
    float edge[3][4];    /* barycentric i is edge[0][i] + edge[1][i] x + edge[2][i] y; lane 3 is 1 */
    float edge_error[4]; /* bounds on its rounding */
    float normal[3][4];  /* N at texel (0, 0) of the frame, then per texel along x and y */
    float normal_most;   /* upper bound of |N| */
    float normal_move;   /* upper bound of |N_x|, |N_y| */
    uint32_t flags;      /* FAST_SEARCHED, FAST_CROWDED */
} fast_patch;

/* A part of a patch, one node of the map's blocks, with its float frame. Leaf of the tree; two cache lines.
 * Vectors of three are read four at a time: the fourth is what follows. */
typedef struct fast_part {
    float origin[3];            /* F at the centre and s = (s_min + s_max) / 2 */
    float inverse[3][3];        /* J^-1: (x, y, s) per unit of each coordinate */
    float bend_x[3], bend_y[3]; /* K_x, K_y */
    float error[3];             /* bounds on the error of x, y, s by rounding and by the last iteration */
    float centre[2];            /* texels from the corner */
    float s_min, s_max;         /* range of s */
    uint32_t patch;             /* its base triangle's number */
    int32_t corner_x, corner_y; /* the node's first texel in the frame's texels */
    int32_t cell_x, cell_y;     /* the same texel in the map's; if FAST_WRAPPED, before wrapping */
    uint8_t level;              /* of the blocks */
    uint8_t iterations;         /* of d = q - d_s (K_x d_x + K_y d_y) */
    uint16_t flags;             /* FAST_SEARCHED, FAST_WRAPPED, FAST_WHOLE */
    uint8_t from_x, from_y, to_x, to_y; /* where the triangle is on it: 255 is the node's side */
} fast_part;
_Static_assert(sizeof(fast_part) == 128, "a part is not two cache lines");

/* Eight boxes. A child is a node, a part (FAST_LEAF set), or FAST_NONE with a box that nothing meets. */
enum { FAST_WIDTH = 8 };
#define FAST_LEAF 0x80000000u
#define FAST_NONE 0xffffffffu
typedef struct fast_node {
    float bound[6][FAST_WIDTH]; /* lower x, y, z, upper x, y, z */
    uint32_t child[FAST_WIDTH];
} fast_node;

typedef struct fast_tree {
    fast_node *nodes; /* root first; parents before children; NULL if there is nothing */
    uint32_t node_count;
} fast_tree;

enum { FAST_STACK = 384 }; /* entries: at most 7 per level of the tree, plus one; it has at most 52 */

typedef struct fast_box {
    float lower[3], upper[3];
} fast_box;

typedef struct fast_ray fast_ray;

typedef struct fast_data {
    const height_blocks *blocks;
    fast_patch *patches; /* one per base triangle */
    fast_part *parts;
    uint32_t part_count;
    fast_tree fine;   /* over parts: level of detail 0 */
    fast_tree coarse; /* over base triangles with the heights of every level */
    double centre[3], scale;
    double lower[3], upper[3]; /* of both trees, padded */
    knurl_wrap wrap_u, wrap_v;
    float height_base, height_code; /* height of code c is height_base + c * height_code */
    float height_error;             /* bound on the error of that, samples of float maps included */
    /* The kernels for this machine. */
    void (*walk)(fast_ray *ray);
    void (*walk_many)(fast_ray *rays, int count);
    uint64_t bytes;
} fast_data;

/* One ray on its way. */
struct fast_ray {
    const fast_data *data;
    const shell_space *space;
    const height_lod *lod;
    const knurl_ray *ray; /* the caller's units; its tmax is not updated */
    bool coarse;          /* a level of detail above 0: base triangles are searched */
    bool any, found;
    uint32_t steps;
    /* In the trees' space: origin + tau * direction, t = t0 + tau / rate. */
    double origin[3], direction[3];
    double inverse_square; /* 1 / direction^2 */
    double t0, rate;
    double tau_min, tau_max; /* tau_max comes nearer with each hit */
    uint32_t searched;       /* triangle that fast_search() looked at last */
    /* The nearest hit. */
    uint32_t triangle;
    double t;
    shell_root root;
    frame_memo *memo; /* the query's */
};

/* A texel in which the curve may meet the surface: cell (i, j) of the frame, near parameter tau. */
typedef struct fast_candidate {
    uint32_t triangle;
    int32_t i, j;
    float x, y;             /* where the root seems to be, in the frame's texels */
    double tau;             /* and at which parameter */
    double tau_in, tau_out; /* where the curve is over the texel, widened by all errors */
    bool certain;           /* one root in there, well away from any other; else anything */
} fast_candidate;

/* Decides a candidate in double precision; takes the hit if it is one, and nearer than what there is. */
bool fast_decide(fast_ray *ray, const fast_candidate *candidate);
/* A whole shell by shell_search(). */
bool fast_search(fast_ray *ray, uint32_t triangle);

/* The traversal, compiled for any machine and for some. */
void fast_walk_plain(fast_ray *ray);
void fast_walk_avx2(fast_ray *ray);
void fast_walk_avx512(fast_ray *ray);
/* The same for up to FAST_PACKET rays at level of detail 0, those that go the same way together. */
enum { FAST_PACKET = 8 };
void fast_walk_many_plain(fast_ray *rays, int count);
void fast_walk_many_avx2(fast_ray *rays, int count);
void fast_walk_many_avx512(fast_ray *rays, int count);

/* Heights of codes, and the bounds that rays are clipped to, from those of the shells. */
void fast_set_heights(const shell_space *space, fast_data *data);
void fast_set_bounds(fast_data *data, const double lower[3], const double upper[3]);

/* Updating (update.c). */
knurl_status fast_update(const shell_space *space, const method_edit *edit, void *data, bool *rebuild,
                         knurl_error *error);

/* Building: each in its own file. */
void fast_patch_make(const triangle_frame *frame, fast_patch *patch);
/* Sets the frame of a part that has its place, its range of s and where the triangle is on it; FAST_SEARCHED
 * where there is none. */
void fast_part_frame(const fast_data *data, const triangle_frame *frame, fast_part *part);
knurl_status fast_patches_build(const shell_space *space, fast_data *data, knurl_error *error);
knurl_status fast_cover_build(const shell_space *space, fast_data *data, double budget, fast_box **boxes,
                              knurl_error *error);
/* A leaf of a tree that gets another box. */
typedef struct fast_leaf {
    uint32_t number;
    fast_box box;
    float place[3]; /* in its old box as a rule */
} fast_leaf;

/* Makes the height range of part number `part` again, and its box. `frame` is that of its triangle at level
 * of detail 0, which `lod` is. */
fast_leaf fast_part_update(const shell_space *space, fast_data *data, const height_lod *lod,
                           const triangle_frame *frame, uint32_t part);
/* A leaf of the coarse tree. */
fast_box fast_coarse_box(const shell_space *space, const fast_data *data, uint32_t triangle);
knurl_status fast_tree_build(knurl_context *context, const fast_box *boxes, uint32_t count, fast_tree *tree,
                             knurl_error *error);
/* Gives leaves, by rising numbers, other boxes; `leaf_count` is more than any leaf's number. `placed`: the
 * leaves say where to look for them, which makes few of them fast to find. */
knurl_status fast_tree_refit(knurl_context *context, fast_tree *tree, uint32_t leaf_count,
                             const fast_leaf *leaves, uint32_t count, bool placed, knurl_error *error);

#endif
