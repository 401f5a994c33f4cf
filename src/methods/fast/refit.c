/* Other boxes for some leaves of a tree, and for what is above them. */
#include "methods/fast/fast.h"

#include <string.h>

/* Leaves looked for together are within so many lengths of one; and the part of all beyond which a pass over
 * the whole tree is as fast. */
enum { GROUP = 4, MANY = 8 };

typedef struct refit {
    fast_tree *tree;
    const fast_leaf *leaves;
    uint32_t count, left;     /* of leaves; of those still to be found */
    uint64_t *wanted;         /* a bit per leaf of the tree: still to be found */
    uint64_t *touched;        /* a bit per node: has a new box in it. The pass over the whole tree only */
    float lower[3], upper[3]; /* where leaves are looked for */
} refit;

static bool has_bit(const uint64_t *bits, uint32_t i)
{
    return (bits[i >> 6] >> (i & 63) & 1u) != 0;
}

static void set_bit(uint64_t *bits, uint32_t i)
{
    bits[i >> 6] |= (uint64_t)1 << (i & 63);
}

static fast_box node_box(const fast_node *node)
{
    fast_box box;
    for (int k = 0; k < 3; k++) {
        box.lower[k] = INFINITY;
        box.upper[k] = -INFINITY;
        for (int i = 0; i < FAST_WIDTH; i++) {
            box.lower[k] = node->bound[k][i] < box.lower[k] ? node->bound[k][i] : box.lower[k];
            box.upper[k] = node->bound[k + 3][i] > box.upper[k] ? node->bound[k + 3][i] : box.upper[k];
        }
    }
    return box;
}

static void set_box(fast_node *node, int i, const fast_box *box)
{
    for (int k = 0; k < 3; k++) {
        node->bound[k][i] = box->lower[k];
        node->bound[k + 3][i] = box->upper[k];
    }
}

/* Gives a leaf its new box if it is one of the wanted ones. */
static bool move_leaf(refit *r, fast_node *node, int i)
{
    uint32_t number = node->child[i] & ~FAST_LEAF, low = 0, high = r->count;
    if (!has_bit(r->wanted, number)) return false;
    while (high - low > 1) {
        uint32_t half = low + (high - low) / 2;
        *(r->leaves[half].number <= number ? &low : &high) = half;
    }
    set_box(node, i, &r->leaves[low].box);
    r->wanted[number >> 6] &= ~((uint64_t)1 << (number & 63));
    r->left--;
    return true;
}

/* Moves the wanted leaves of a node that are where they are looked for. */
static bool descend(refit *r, uint32_t number)
{
    fast_node *node = &r->tree->nodes[number];
    uint32_t here = 0;
    bool touched = false;
    for (int i = 0; i < FAST_WIDTH; i++) {
        bool meets = true;
        for (int k = 0; k < 3; k++)
            meets = meets & (node->bound[k][i] <= r->upper[k]) & (node->bound[k + 3][i] >= r->lower[k]);
        here |= (uint32_t)meets << i;
    }
    for (; here; here &= here - 1) {
        int i = __builtin_ctz(here);
        uint32_t child = node->child[i];
        if (child == FAST_NONE) continue;
        if (child & FAST_LEAF) {
            touched |= move_leaf(r, node, i);
        } else if (descend(r, child)) {
            fast_box box = node_box(&r->tree->nodes[child]);
            set_box(node, i, &box);
            touched = true;
        }
    }
    return touched;
}

static float longest_side(const float lower[3], const float upper[3])
{
    float side = 0.0f;
    for (int k = 0; k < 3; k++) side = upper[k] - lower[k] > side ? upper[k] - lower[k] : side;
    return side;
}

/* Adds a leaf to those that are looked for, unless it is far from them. */
static bool join(refit *r, const fast_leaf *leaf)
{
    float lower[3], upper[3];
    for (int k = 0; k < 3; k++) {
        lower[k] = leaf->place[k] < r->lower[k] ? leaf->place[k] : r->lower[k];
        upper[k] = leaf->place[k] > r->upper[k] ? leaf->place[k] : r->upper[k];
    }
    if (longest_side(lower, upper) > GROUP * longest_side(leaf->box.lower, leaf->box.upper)) return false;
    memcpy(r->lower, lower, sizeof lower);
    memcpy(r->upper, upper, sizeof upper);
    return true;
}

static void find_in_groups(refit *r)
{
    for (uint32_t i = 0; i < r->count && r->left > 0;) {
        if (!has_bit(r->wanted, r->leaves[i].number)) {
            i++;
            continue;
        }
        memcpy(r->lower, r->leaves[i].place, sizeof r->lower);
        memcpy(r->upper, r->leaves[i].place, sizeof r->upper);
        for (i++; i < r->count && join(r, &r->leaves[i]);) i++;
        (void)descend(r, 0);
    }
}

/* All nodes; children come after their parents. */
static void pass(refit *r)
{
    for (uint32_t n = r->tree->node_count; n-- > 0;) {
        fast_node *node = &r->tree->nodes[n];
        for (int i = 0; i < FAST_WIDTH; i++) {
            uint32_t child = node->child[i];
            if (child == FAST_NONE) continue;
            bool touched = (child & FAST_LEAF) != 0 ? move_leaf(r, node, i) : has_bit(r->touched, child);
            if (!touched) continue;
            set_bit(r->touched, n);
            if (child & FAST_LEAF) continue;
            fast_box box = node_box(&r->tree->nodes[child]);
            set_box(node, i, &box);
        }
    }
}

knurl_status fast_tree_refit(knurl_context *context, fast_tree *tree, uint32_t leaf_count,
                             const fast_leaf *leaves, uint32_t count, bool placed, knurl_error *error)
{
    if (count == 0) return KNURL_OK;
    size_t words = (size_t)leaf_count / 64 + 1, all = words + (size_t)tree->node_count / 64 + 1;
    refit r = {.tree = tree, .leaves = leaves, .count = count, .left = count};
    r.wanted = knurl_alloc_zero(context, all * sizeof *r.wanted);
    if (!r.wanted) return knurl_fail_memory(error, all * sizeof *r.wanted, "refitting a tree");
    r.touched = r.wanted + words;
    for (uint32_t i = 0; i < count; i++) set_bit(r.wanted, leaves[i].number);
    if (placed && count < leaf_count / MANY) find_in_groups(&r);
    if (r.left > 0) pass(&r);
    knurl_free(context, r.wanted);
    return KNURL_OK;
}
