/* TFDM: Thonat, Beaune, Sun, Carr, Boubekeur: "Tessellation-free displacement mapping for ray tracing",
 * SIGGRAPH Asia 2021, with Thonat et al. 2023 (RMIP, sections 2, 3 and 6) as the second source.
 *
 * A quad-tree over the minmax mipmap is traversed for each base triangle. Nodes are bounded on the fly
 * by 3D boxes from affine arithmetic over node x height range, and the ray visits them in the order in
 * which it enters them. What we decided where the sources leave it open:
 * - the descent starts from the at most 2 x 2 smallest nodes that cover the triangle in texture space;
 * - four siblings are bounded together, nodes outside the triangle's outline are dropped before, and the
 *   part of a node outside the triangle's box in texture space is cut off;
 * - at most one stack entry is kept per node whose box the ray meets, nearest sibling on top; entries
 *   behind the best root are dropped;
 * - boxes are along the world's axes; boxes=normal gives them one axis along the triangle's mean normal,
 *   which costs nothing and is much tighter where nodes are smaller than the displacement;
 * - |N| is bounded once for four siblings, components of P and N are divided by the ray's once for all;
 * - rays are clipped to the prism first (shell/curve.h), and the curve that this needs serves the leaf,
 *   which is exact on S of Eq. 1, without micro-triangles; nodes before and behind the prism are dropped;
 * - a leaf is one texel, for which the method makes a mipmap of its own; leaf-texels=8 marches through 8 x 8
 *   texels, needs no mipmap but the map's, and with boxes=normal was the fastest we found;
 * - maps of any size, mirrored and clamped ones: see tree.h;
 * - at levels of detail above 0 nodes are those of the finer of both levels, bounded by a query of the
 *   mipmap that holds for the blend;
 * - folded shells, those without area in texture space, and rays that the curve cannot follow go to
 *   shell_subdivide(). */
#include "methods/method.h"
#include "methods/tfdm/boxes.h"
#include "methods/tfdm/leaf.h"

static const knurl_method_parameter PARAMETERS[] = {
    {"leaf-texels", "texels per side of a leaf; larger ones than the paper's 1 are marched", 0.0, 0.0, 5.0,
     "1|2|4|8|16|32", false},
    {"boxes", "axes that nodes' boxes are aligned with; the paper's are the world's", 0.0, 0.0, 1.0,
     "world|normal", false},
    {0}};

typedef struct tfdm_data {
    int leaf_level;
    bool turned_boxes;
    minmax_pyramid *own; /* NULL if the map's is as fine as the leaves */
    const minmax_pyramid *pyramid;
} tfdm_data;

static knurl_status build_pyramid(const shell_space *space, tfdm_data *data, knurl_error *error)
{
    cell_scale scale = heightmap_scale(space->map); /* what the bounds are decoded with */
    knurl_status status =
        minmax_build(space->context, &space->map->levels[0], data->leaf_level, &scale, &data->own, error);
    data->pyramid = data->own;
    return status;
}

static knurl_status tfdm_build(const shell_space *space, const double *values, void **data,
                               knurl_error *error)
{
    tfdm_data *made = knurl_alloc_zero(space->context, sizeof *made);
    *data = made;
    if (!made) return knurl_fail_memory(error, sizeof *made, "method tfdm");
    made->leaf_level = (int)values[0];
    made->turned_boxes = values[1] != 0.0;
    made->pyramid = space->map->minmax;
    return made->leaf_level < made->pyramid->shift ? build_pyramid(space, made, error) : KNURL_OK;
}

static void tfdm_destroy(const shell_space *space, void *data)
{
    minmax_destroy(space->context, ((tfdm_data *)data)->own);
    knurl_free(space->context, data);
}

static knurl_status tfdm_update(const shell_space *space, const method_edit *edit, void *data, bool *rebuild,
                                knurl_error *error)
{
    (void)rebuild;
    (void)error;
    const tfdm_data *tfdm = data;
    cell_scale scale = heightmap_scale(space->map);
    if (tfdm->own) minmax_update(space->context, tfdm->own, &space->map->levels[0], &scale, edit->samples);
    return KNURL_OK;
}

static uint64_t tfdm_bytes(const void *data)
{
    const tfdm_data *d = data;
    return d ? sizeof *d + (d->own ? d->own->bytes : 0) : 0;
}

typedef struct node {
    double entry;
    int64_t x, y; /* tree.h's numbers */
    int32_t level;
    bool inside; /* of the triangle's outline */
} node;

/* A node makes room for its four children, level by level. */
enum { STACK_SIZE = 3 * TREE_MAX_LEVEL + 4 };

typedef struct traversal {
    tree tree;
    quad_boxes boxes;
    leaf_pieces pieces;
    shell_walk walk;
    knurl_ray ray; /* tmax is that of the best root */
    int leaf_level;
    node stack[STACK_SIZE];
    int top;
} traversal;

/* Pushes those of the four nodes of `level` from (x, y) on that the ray meets, the nearest last. */
static void push_quad(traversal *t, int64_t x, int64_t y, int level, bool inside)
{
    static const uint8_t BITS[16] = {0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4};
    quad nodes;
    quad_cut cut;
    unsigned held;
    tree_borders(&t->tree, x, y, level, &nodes);
    unsigned found = quad_in_triangle(&t->boxes, &nodes, inside, &cut, &held);
    if (!found) return;
    tree_heights(&t->tree, x, y, level, found, &nodes);
    t->walk.steps += BITS[found];
    pair entry[2];
    found = quad_clip(&t->boxes, &nodes, &cut, found, t->pieces.near, t->pieces.far, entry);
    int64_t side = (int64_t)1 << level;
    int first = t->top;
    for (; found; found &= found - 1) {
        int k = __builtin_ctz(found), at = t->top++;
        double in = entry[k >> 1][k & 1];
        for (; at > first && t->stack[at - 1].entry < in; at--) t->stack[at] = t->stack[at - 1];
        t->stack[at] = (node){in, x + (k & 1) * side, y + (k >> 1) * side, level, held >> k & 1};
    }
}

static void push_root(traversal *t)
{
    const quad_boxes *b = &t->boxes;
    int64_t x0 = tree_number(&t->tree.x, b->x0 - b->pad), x1 = tree_number(&t->tree.x, b->x1 + b->pad);
    int64_t y0 = tree_number(&t->tree.y, b->y0 - b->pad), y1 = tree_number(&t->tree.y, b->y1 + b->pad);
    int level = t->leaf_level;
    while ((x1 >> level) - (x0 >> level) > 1 || (y1 >> level) - (y0 >> level) > 1) level++;
    int64_t side = (int64_t)1 << level;
    push_quad(t, (x0 >> level) * side, (y0 >> level) * side, level, false);
}

static bool traverse(traversal *t, bool any)
{
    bool found = false;
    while (t->top > 0) {
        node n = t->stack[--t->top];
        if (n.entry > t->pieces.far) continue;
        int64_t side = (int64_t)1 << n.level;
        if (n.level > t->leaf_level) {
            push_quad(t, n.x, n.y, n.level - 1, n.inside);
            continue;
        }
        if (!leaf_intersect(&t->walk, &t->pieces, tree_position(&t->tree.x, n.x),
                            tree_position(&t->tree.x, n.x + side), tree_position(&t->tree.y, n.y),
                            tree_position(&t->tree.y, n.y + side)))
            continue;
        t->ray.tmax = t->pieces.far = t->walk.root.t;
        found = true;
        if (any) break;
    }
    return found;
}

static bool tfdm_intersect(const void *data, const method_query *q)
{
    const tfdm_data *d = data;
    ray_curve curve;
    bool boxes_only = q->frame->flags & (SHELL_FOLDED | SHELL_FLAT_UV);
    if (!boxes_only) ray_curve_make(q->frame, q->ray, &curve);
    if (boxes_only || curve.unreliable)
        return shell_subdivide(q->space, q->lod, KNURL_BOUNDS_MINMAX, q->frame, q->ray, q->any, q->root,
                               q->steps);
    traversal t;
    leaf_pieces_make(&curve, q->ray, &t.pieces);
    if (t.pieces.count == 0) return false;
    t.leaf_level = d->leaf_level;
    t.ray = *q->ray;
    t.walk =
        (shell_walk){.space = q->space, .lod = q->lod, .frame = q->frame, .curve = &curve, .ray = &t.ray};
    t.top = 0;
    tree_make(q->space, q->lod, q->frame, d->pyramid, &t.tree);
    quad_boxes_make(q->space, q->frame, q->ray, d->turned_boxes, curve.texel_rounding + curve.texel_remainder,
                    &t.boxes);
    push_root(&t);
    bool found = traverse(&t, q->any);
    *q->steps += t.walk.steps;
    if (found) *q->root = t.walk.root;
    return found;
}

const method method_tfdm = {
    .name = "tfdm",
    .summary = "minmax quad-tree with boxes by affine arithmetic (Thonat et al. 2021); exact",
    .flags = KNURL_METHOD_EXACT,
    .parameters = PARAMETERS,
    .build = tfdm_build,
    .update = tfdm_update,
    .intersect = tfdm_intersect,
    .bytes = tfdm_bytes,
    .destroy = tfdm_destroy,
};
