/* methods/fast/walk.h: one ray, or several, through the tree, its parts and their nodes, in floats.
 *
 * Included once per kind of machine, by a file that defines FAST_WALK and FAST_WALK_MANY as the names of the
 * functions. */
#include "methods/fast/walk_texels.h"

/* ---- Nodes -------------------------------------------------------------------------------------------- */

/* Sixteen children of a node, whose corner is (x, y) from the part's, each `side` texels: which of them the
 * curve between u0 and u1 meets, and where. */
LANES_INLINE uint32_t test_children(const kernel *k, const part_curve *c, const block_node *node, int32_t x,
                                    int32_t y, int32_t side, float u0, float u1, float in[16], float out[16])
{
    vf4 first = curve_value(c, u0), last = curve_value(c, u1);
    float length = u1 - u0;
    vf4 pad = abs4(c->c2) * set4(0.25f * length * length) + c->error, inverse = safe_inverse4(last - first);
    const vf8 i = {0, 1, 2, 3, 0, 1, 2, 3}, j = {0, 0, 0, 0, 1, 1, 1, 1};
    vf8 cell = set8((float)side), zero = set8(0.0f), one = set8(1.0f);
    vf8 inverse_x = set8(inverse[0]), inverse_y = set8(inverse[1]), inverse_z = set8(inverse[3]);
    vf8 left = mad8(i, cell, set8((float)x - first[0]));
    vf8 ax = (left - set8(pad[0])) * inverse_x, bx = (left + cell + set8(pad[0])) * inverse_x;
    vf8 in_x = max8(min8(ax, bx), zero), out_x = min8(max8(ax, bx), one);
    uint32_t met = 0;
    for (int h = 0; h < 2; h++) {
        vf8 top = mad8(j + set8((float)(2 * h)), cell, set8((float)y - first[1]));
        vf8 ay = (top - set8(pad[1])) * inverse_y, by = (top + cell + set8(pad[1])) * inverse_y;
        vf8 low = codes8(node->min + 8 * h), high = codes8(node->max + 8 * h);
        /* The factor may be negative: either end may be the lower one. */
        vf8 scale = set8(k->data->height_code), offset = set8(first[3]);
        vf8 za = mad8(low, scale, -offset), zb = mad8(high, scale, -offset);
        vf8 az = (min8(za, zb) - set8(pad[3])) * inverse_z, bz = (max8(za, zb) + set8(pad[3])) * inverse_z;
        vf8 near = max8(max8(in_x, min8(ay, by)), min8(az, bz));
        vf8 far = min8(min8(out_x, max8(ay, by)), max8(az, bz));
        near = near - set8(2e-6f);
        far = far + set8(2e-6f);
        met |= mask8((near <= far) & (low <= high)) << (8 * h);
        near = max8(near, zero);
        far = min8(far, one);
        memcpy(in + 8 * h, &near, sizeof near);
        memcpy(out + 8 * h, &far, sizeof far);
    }
    for (uint32_t rest = met; rest; rest &= rest - 1) {
        int n = __builtin_ctz(rest);
        in[n] = u0 + in[n] * length;
        out[n] = u0 + out[n] * length;
    }
    return met;
}

static const block_node *part_node(const kernel *k, const fast_part *part, int level, int32_t x, int32_t y)
{
    /* Heights of wrapped parts are not in the blocks' nodes. */
    static const block_node any = {{0},
                                   {65535, 65535, 65535, 65535, 65535, 65535, 65535, 65535, 65535, 65535,
                                    65535, 65535, 65535, 65535, 65535, 65535}};
    if (part->flags & FAST_WRAPPED) return &any;
    const height_blocks *blocks = k->data->blocks;
    int shift = 4 + 2 * level;
    return &blocks->nodes[level][(size_t)((part->cell_y + y) >> shift) * (size_t)blocks->columns[level] +
                                 (size_t)((part->cell_x + x) >> shift)];
}

/* A node of a part and what is below it. True if the ray needs to go no further. */
static bool visit_node(kernel *k, const part_curve *c, int level, int32_t x, int32_t y, float u0, float u1)
{
    float in[16], out[16];
    int32_t side = 4 << (2 * level);
    k->ray->steps++;
    uint32_t met = test_children(k, c, part_node(k, c->part, level, x, y), x, y, side, u0, u1, in, out);
    while (met) {
        int n = first_lane(met, in);
        met &= ~(1u << n);
        if (k->ray->found && curve_tau(k, c, in[n]) > k->ray->tau_max) return false;
        int32_t cx = x + side * (n & 3), cy = y + side * (n >> 2);
        if (level == 0 ? visit_block(k, c, cx, cy, in[n], out[n])
                       : visit_node(k, c, level - 1, cx, cy, in[n], out[n]))
            return true;
    }
    return false;
}

/* ---- Parts -------------------------------------------------------------------------------------------- */

enum { MOST_HALVINGS = 6 };

/* The curve over a part between two local parameters; halved where it bends too much for one chord. */
static bool visit_stretch(kernel *k, const fast_part *part, float a, float b, int halvings)
{
    part_curve c;
    c.part = part;
    c.patch = &k->data->patches[part->patch];
    vf4 x, y, s, tau = {a, 0.5f * (a + b), b, b};
    curve_points(k, part, tau, &x, &y, &s);
    x = x + set4(part->centre[0]);
    y = y + set4(part->centre[1]);
    vf4 normal = normal_lengths(c.patch, x + set4((float)part->corner_x), y + set4((float)part->corner_y));
    vf4 z = (s + set4(0.5f * (part->s_min + part->s_max))) * normal - set4(k->data->height_base);
    transpose4(&x, &y, &s, &z); /* now points at a, the middle, b, b: lanes x, y, s, z */
    vf4 first = x, middle = y, last = s;
    c.c0 = first;
    c.c2 = set4(2.0f) * (first + last) - set4(4.0f) * middle;
    c.c1 = last - first - c.c2;
    c.bow = abs4(c.c2) * set4(0.25f);
    c.start = a;
    c.length = b - a;
    set_error(&c, k->data, last - first);
    if (!clip_to_part(&c, first, last)) return false;
    float bow = c.bow[0] > c.bow[1] ? c.bow[0] : c.bow[1];
    float rest = c.error[0] > c.error[1] ? c.error[0] : c.error[1];
    if (halvings < MOST_HALVINGS &&
        (bow > 2.0f || rest > 0.05f + 2.0f * part->error[0] + 2.0f * part->error[1])) {
        float from = a + c.u0 * c.length, to = a + c.u1 * c.length, half = 0.5f * (from + to);
        if (half > from && half < to)
            return visit_stretch(k, part, from, half, halvings + 1) ||
                   visit_stretch(k, part, half, to, halvings + 1);
    }
    return visit_node(k, &c, part->level, 0, 0, c.u0, c.u1);
}

static bool visit_part(kernel *k, uint32_t number)
{
    const fast_part *part = &k->data->parts[number];
    fast_ray *r = k->ray;
    r->steps++;
    if (part->flags & FAST_SEARCHED) return fast_search(r, part->patch) && r->any;
    enter_part(k, part);
    const vf4 centre = {part->centre[0], part->centre[1], 0.0f, 0.0f};
    vf4 lower, upper;
    part_extent(part, &lower, &upper);
    lower = lower - centre;
    upper = upper - centre;
    vf4 reach = max4(abs4(lower), abs4(upper));
    /* How far q is from d: d_s (K_x d_x + K_y d_y). */
    vf4 pad =
        mad4(set4(reach[2]),
             mad4(abs4(load4(part->bend_x)), set4(reach[0]), abs4(load4(part->bend_y)) * set4(reach[1])),
             set4(2.0f) * load4(part->error));
    vf4 inverse = safe_inverse4(k->q1);
    vf4 a = (lower - pad - k->q0) * inverse, b = (upper + pad - k->q0) * inverse;
    float in = most3(min4(a, b)), out = least3(max4(a, b));
    float slack = 1e-6f * (fabsf(in) + fabsf(out));
    in -= slack;
    out += slack;
    double least = r->tau_min - k->shift, most = r->tau_max - k->shift;
    float first = (float)(least - 1e-6 * fabs(least)), last = (float)(most + 1e-6 * fabs(most));
    if (in < first) in = first;
    if (out > last) out = last;
    if (!(in <= out)) return false;
    return visit_stretch(k, part, in, out, 0);
}

/* ---- The tree ----------------------------------------------------------------------------------------- */

typedef struct tree_entry {
    uint32_t child;
    float near;
} tree_entry;

/* Children of a node that are met go on the stack, nearest last. */
LANES_INLINE int push_children(const fast_node *n, uint32_t met, vf8 near, tree_entry *stack, int top)
{
    const int first = top;
    float nears[8];
    memcpy(nears, &near, sizeof near);
    for (; met; met &= met - 1) {
        int i = __builtin_ctz(met);
        tree_entry entry = {n->child[i], nears[i]};
        int place = top++;
        for (; place > first && stack[place - 1].near < entry.near; place--) stack[place] = stack[place - 1];
        stack[place] = entry;
    }
    return top;
}

static void start_kernel(kernel *k, fast_ray *r)
{
    k->ray = r;
    k->data = r->data;
    k->tau_min = float_below(r->tau_min);
    k->tau_max = float_above(r->tau_max);
}

void FAST_WALK(fast_ray *r)
{
    kernel k;
    start_kernel(&k, r);
    const fast_node *nodes = r->coarse ? r->data->coarse.nodes : r->data->fine.nodes;
    if (!nodes) return;
    vf4 direction = {(float)r->direction[0], (float)r->direction[1], (float)r->direction[2], 1.0f};
    vf4 small = safe_inverse4(direction);
    vf8 inverse[3], shift[3];
    int enter[3]; /* 0: through the lower bound, 3: through the upper one */
    for (int i = 0; i < 3; i++) {
        enter[i] = small[i] < 0.0f ? 3 : 0;
        inverse[i] = set8(small[i]);
        shift[i] = set8(-(float)r->origin[i] * small[i]);
    }
    tree_entry stack[FAST_STACK];
    int top = 0;
    stack[top++] = (tree_entry){0, k.tau_min};
    while (top > 0) {
        tree_entry at = stack[--top];
        if (at.near > k.tau_max) continue;
        if (at.child & FAST_LEAF) {
            uint32_t leaf = at.child & ~FAST_LEAF;
            if (r->coarse ? fast_search(r, leaf) && r->any : visit_part(&k, leaf)) return;
            k.tau_max = float_above(r->tau_max);
            continue;
        }
        const fast_node *n = &nodes[at.child];
        r->steps++;
        vf8 near = set8(k.tau_min), far = set8(k.tau_max);
        for (int i = 0; i < 3; i++) {
            near = max8(mad8(load8(n->bound[i + enter[i]]), inverse[i], shift[i]), near);
            far = min8(mad8(load8(n->bound[i + 3 - enter[i]]), inverse[i], shift[i]), far);
        }
        top = push_children(n, mask8(near <= far), near, stack, top);
    }
}

/* ---- Several rays ------------------------------------------------------------------------------------- */

/* Rays that go the same way, lanes. `low` and `high` bound origins and inverse directions of all: nodes are
 * tested against those, leaves against each ray. */
typedef struct packet {
    vf8 origin[3], inverse[3];
    vf8 tau_min, tau_max;
    float origin_low[3], origin_high[3], inverse_low[3], inverse_high[3];
    int enter[3];
    uint32_t active;
} packet;

LANES_INLINE float lanes_least(vf8 a)
{
    float m = a[0];
    for (int i = 1; i < 8; i++) m = a[i] < m ? a[i] : m;
    return m;
}
LANES_INLINE float lanes_most(vf8 a)
{
    float m = a[0];
    for (int i = 1; i < 8; i++) m = a[i] > m ? a[i] : m;
    return m;
}

/* False if the rays are too different to be worth it: `together` is the part of a unit by which
 * directions may differ. */
static bool make_packet(const fast_ray *rays, int count, packet *p)
{
    const float together = 0.1f;
    float direction[3][8], origin[3][8], least[8], most[8];
    for (int k = 0; k < 8; k++) {
        const fast_ray *r = &rays[k < count ? k : 0];
        for (int i = 0; i < 3; i++) {
            direction[i][k] = (float)r->direction[i];
            origin[i][k] = (float)r->origin[i];
        }
        least[k] = float_below(r->tau_min);
        most[k] = float_above(r->tau_max);
    }
    for (int i = 0; i < 3; i++) {
        vf8 d = load8(direction[i]);
        float low = lanes_least(d), high = lanes_most(d);
        if (low < 1e-4f && high > -1e-4f) return false; /* of both signs, or nearly */
        if (high - low > together) return false;
        p->enter[i] = low < 0.0f ? 3 : 0;
        p->origin[i] = load8(origin[i]);
        p->inverse[i] = set8(1.0f) / d;
        p->origin_low[i] = lanes_least(p->origin[i]);
        p->origin_high[i] = lanes_most(p->origin[i]);
        p->inverse_low[i] = lanes_least(p->inverse[i]);
        p->inverse_high[i] = lanes_most(p->inverse[i]);
    }
    p->tau_min = load8(least);
    p->tau_max = load8(most);
    p->active = (1u << count) - 1;
    return true;
}

/* Which children some ray of the packet may meet, and from where on. For a plane at p a ray's parameter is
 * (p - origin) * inverse: the extremes are at the extremes of both factors. */
LANES_INLINE uint32_t packet_children(const packet *p, const fast_node *n, float tau_min, float tau_max,
                                      vf8 *near_out)
{
    vf8 near = set8(tau_min), far = set8(tau_max);
    for (int i = 0; i < 3; i++) {
        bool forward = p->enter[i] == 0;
        /* Nearest where the origin is furthest on, farthest where it is furthest back. */
        vf8 a = load8(n->bound[i + p->enter[i]]) - set8(forward ? p->origin_high[i] : p->origin_low[i]);
        vf8 b = load8(n->bound[i + 3 - p->enter[i]]) - set8(forward ? p->origin_low[i] : p->origin_high[i]);
        vf8 low = set8(p->inverse_low[i]), high = set8(p->inverse_high[i]);
        near = max8(min8(a * low, a * high), near);
        far = min8(max8(b * low, b * high), far);
    }
    *near_out = near;
    return mask8(near <= far);
}

/* Which rays meet one box, child `i` of a node. */
LANES_INLINE uint32_t packet_box(const packet *p, const float box[6])
{
    vf8 near = p->tau_min, far = p->tau_max;
    for (int i = 0; i < 3; i++) {
        near = max8((set8(box[i + p->enter[i]]) - p->origin[i]) * p->inverse[i], near);
        far = min8((set8(box[i + 3 - p->enter[i]]) - p->origin[i]) * p->inverse[i], far);
    }
    return mask8(near <= far) & p->active;
}

typedef struct packet_entry {
    uint32_t child, parent; /* the node that holds the child's box */
    float near;
    uint32_t slot;
} packet_entry;

static void walk_packet(packet *p, kernel *kernels, const fast_node *nodes)
{
    packet_entry stack[FAST_STACK];
    int top = 0;
    float tau_min = lanes_least(p->tau_min), tau_max = lanes_most(p->tau_max);
    stack[top++] = (packet_entry){0, 0, tau_min, 0};
    while (top > 0 && p->active) {
        packet_entry at = stack[--top];
        if (at.near > tau_max) continue;
        if (at.child & FAST_LEAF) {
            const fast_node *parent = &nodes[at.parent];
            float box[6];
            for (int i = 0; i < 6; i++) box[i] = parent->bound[i][at.slot];
            for (uint32_t rest = packet_box(p, box); rest; rest &= rest - 1) {
                int lane = __builtin_ctz(rest);
                kernel *k = &kernels[lane];
                if (visit_part(k, at.child & ~FAST_LEAF)) p->active &= ~(1u << lane);
                p->tau_max[lane] = k->tau_max = float_above(k->ray->tau_max);
            }
            tau_max = -INFINITY;
            for (uint32_t rest = p->active; rest; rest &= rest - 1) {
                float most = p->tau_max[__builtin_ctz(rest)];
                tau_max = most > tau_max ? most : tau_max;
            }
            continue;
        }
        const fast_node *n = &nodes[at.child];
        kernels[__builtin_ctz(p->active)].ray->steps++;
        vf8 near;
        uint32_t met = packet_children(p, n, tau_min, tau_max, &near);
        const int first = top;
        float nears[8];
        memcpy(nears, &near, sizeof near);
        for (; met; met &= met - 1) {
            uint32_t i = (uint32_t)__builtin_ctz(met);
            packet_entry entry = {n->child[i], at.child, nears[i], i};
            int place = top++;
            for (; place > first && stack[place - 1].near < entry.near; place--)
                stack[place] = stack[place - 1];
            stack[place] = entry;
        }
    }
}

void FAST_WALK_MANY(fast_ray *rays, int count)
{
    const fast_node *nodes = rays[0].coarse ? NULL : rays[0].data->fine.nodes;
    packet p;
    if (!nodes || count < FAST_PACKET / 2 || !make_packet(rays, count, &p)) {
        for (int i = 0; i < count; i++) FAST_WALK(&rays[i]);
        return;
    }
    kernel kernels[FAST_PACKET];
    for (int i = 0; i < count; i++) start_kernel(&kernels[i], &rays[i]);
    walk_packet(&p, kernels, nodes);
}
