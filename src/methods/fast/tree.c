/* The tree of boxes: eight children per node, binned surface area heuristic (Wald 2007), collapsed from two
 * to eight by splitting the child of largest area first (Wald et al. 2008). */
#include "methods/fast/fast.h"

#include <string.h>

/* Below this depth ranges are halved by count, which bounds the depth of the tree whatever the boxes are. */
enum { BINS = 16, DEPTH_BY_AREA = 20 };

typedef struct entry {
    fast_box box;
    uint32_t index;
} entry;

typedef struct range {
    uint32_t begin, end;
    fast_box box; /* of the entries' boxes */
} range;

typedef struct builder {
    knurl_context *context;
    entry *entries;
    fast_node *nodes;
    uint32_t count, capacity;
} builder;

static fast_box empty_box(void)
{
    return (fast_box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}

static void grow(fast_box *a, const fast_box *b)
{
    for (int k = 0; k < 3; k++) {
        a->lower[k] = b->lower[k] < a->lower[k] ? b->lower[k] : a->lower[k];
        a->upper[k] = b->upper[k] > a->upper[k] ? b->upper[k] : a->upper[k];
    }
}

static float half_area(const fast_box *b)
{
    float x = b->upper[0] - b->lower[0], y = b->upper[1] - b->lower[1], z = b->upper[2] - b->lower[2];
    return x >= 0.0f ? x * y + y * z + z * x : 0.0f;
}

static float middle(const fast_box *b, int axis)
{
    return 0.5f * (b->lower[axis] + b->upper[axis]);
}

static fast_box range_box(const builder *b, uint32_t begin, uint32_t end)
{
    fast_box box = empty_box();
    for (uint32_t i = begin; i < end; i++) grow(&box, &b->entries[i].box);
    return box;
}

typedef struct split {
    int axis, bin; /* bins up to `bin` go left */
    float low, scale, cost;
} split;

static int bin_of(const split *s, const fast_box *box)
{
    int bin = (int)((middle(box, s->axis) - s->low) * s->scale);
    return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
}

static void find_on_axis(const builder *b, const range *r, int axis, float low, float high, split *best)
{
    split s = {axis, 0, low, (float)BINS / (high - low), 0.0f};
    fast_box boxes[BINS], right[BINS];
    uint32_t counts[BINS] = {0};
    for (int i = 0; i < BINS; i++) boxes[i] = empty_box();
    for (uint32_t i = r->begin; i < r->end; i++) {
        int bin = bin_of(&s, &b->entries[i].box);
        grow(&boxes[bin], &b->entries[i].box);
        counts[bin]++;
    }
    fast_box sum = empty_box();
    for (int i = BINS - 1; i > 0; i--) {
        grow(&sum, &boxes[i]);
        right[i] = sum;
    }
    sum = empty_box();
    uint32_t left = 0;
    for (int i = 0; i + 1 < BINS; i++) {
        grow(&sum, &boxes[i]);
        left += counts[i];
        uint32_t rest = r->end - r->begin - left;
        if (left == 0 || rest == 0) continue;
        s.cost = half_area(&sum) * (float)left + half_area(&right[i + 1]) * (float)rest;
        s.bin = i;
        if (s.cost < best->cost) *best = s;
    }
}

/* Divides a range of at least two entries in two. */
static void divide(const builder *b, const range *r, bool by_area, range *left, range *right)
{
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = r->begin; i < r->end; i++)
        for (int k = 0; k < 3; k++) {
            float m = middle(&b->entries[i].box, k);
            low[k] = m < low[k] ? m : low[k];
            high[k] = m > high[k] ? m : high[k];
        }
    split best = {-1, 0, 0.0f, 0.0f, INFINITY};
    for (int k = 0; by_area && k < 3; k++)
        if (high[k] > low[k]) find_on_axis(b, r, k, low[k], high[k], &best);
    uint32_t at = r->begin + (r->end - r->begin) / 2; /* where all centres coincide, or by count */
    if (best.axis >= 0) {
        at = r->begin;
        uint32_t end = r->end;
        while (at < end) {
            if (bin_of(&best, &b->entries[at].box) <= best.bin) {
                at++;
            } else {
                entry moved = b->entries[at];
                b->entries[at] = b->entries[--end];
                b->entries[end] = moved;
            }
        }
    }
    *left = (range){r->begin, at, range_box(b, r->begin, at)};
    *right = (range){at, r->end, range_box(b, at, r->end)};
}

static void set_child(fast_node *node, int i, const fast_box *box, uint32_t child)
{
    for (int k = 0; k < 3; k++) {
        node->bound[k][i] = box->lower[k];
        node->bound[k + 3][i] = box->upper[k];
    }
    node->child[i] = child;
}

static bool add_node(builder *b, uint32_t *number)
{
    if (b->count == b->capacity) {
        uint32_t capacity = b->capacity ? 2 * b->capacity : 64;
        fast_node *moved = knurl_realloc(b->context, b->nodes, capacity * sizeof *moved);
        if (!moved) return false;
        b->nodes = moved;
        b->capacity = capacity;
    }
    *number = b->count++;
    fast_box none = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = 0; i < FAST_WIDTH; i++) set_child(&b->nodes[*number], i, &none, FAST_NONE);
    return true;
}

/* Fills node `number` with the range's entries, and what is below it. */
static bool build(builder *b, uint32_t number, const range *whole, int depth)
{
    range children[FAST_WIDTH] = {*whole};
    int count = 1;
    while (count < FAST_WIDTH) {
        int largest = -1;
        float area = -1.0f;
        for (int i = 0; i < count; i++)
            if (children[i].end - children[i].begin > 1 && half_area(&children[i].box) > area) {
                area = half_area(&children[i].box);
                largest = i;
            }
        if (largest < 0) break;
        range left, right;
        divide(b, &children[largest], depth < DEPTH_BY_AREA, &left, &right);
        children[largest] = left;
        children[count++] = right;
    }
    for (int i = 0; i < count; i++) {
        const range *r = &children[i];
        if (r->end - r->begin == 1) {
            set_child(&b->nodes[number], i, &r->box, FAST_LEAF | b->entries[r->begin].index);
            continue;
        }
        uint32_t below;
        if (!add_node(b, &below)) return false;
        set_child(&b->nodes[number], i, &r->box, below);
        if (!build(b, below, r, depth + 1)) return false;
    }
    return true;
}

knurl_status fast_tree_build(knurl_context *context, const fast_box *boxes, uint32_t count, fast_tree *tree,
                             knurl_error *error)
{
    *tree = (fast_tree){0};
    builder b = {.context = context};
    b.entries = knurl_alloc_array(context, count, sizeof *b.entries);
    if (!b.entries) return knurl_fail_memory(error, count * sizeof *b.entries, "building a tree");
    uint32_t used = 0, root;
    for (uint32_t i = 0; i < count; i++)
        if (boxes[i].lower[0] <= boxes[i].upper[0]) b.entries[used++] = (entry){boxes[i], i};
    bool done = true;
    if (used > 0) {
        range whole = {0, used, range_box(&b, 0, used)};
        done = add_node(&b, &root) && build(&b, root, &whole, 0);
    }
    knurl_free(context, b.entries);
    if (done && b.count > 0) {
        fast_node *fitted = knurl_realloc(context, b.nodes, b.count * sizeof *fitted);
        if (fitted) b.nodes = fitted;
    }
    if (!done) {
        knurl_free(context, b.nodes);
        return knurl_fail_memory(error, b.capacity * sizeof *b.nodes, "a tree");
    }
    tree->nodes = b.nodes;
    tree->node_count = b.count;
    return KNURL_OK;
}
