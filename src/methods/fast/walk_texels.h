/* methods/fast/walk_texels.h: blocks of 4 x 4 texels against a ray's curve, in floats. A part of walk.h.
 *
 * All texels of a block are tested together; those that may have a root are looked at one by one, front to
 * back, and decided by fast_decide(). */
#ifndef KNURL_SRC_METHODS_FAST_WALK_TEXELS_H
#define KNURL_SRC_METHODS_FAST_WALK_TEXELS_H

#include "methods/fast/walk_curve.h"

/* A block's curve: 4 x 4 texels, the curve between two parameters. */
typedef struct block {
    int32_t x, y;     /* texels from the part's corner */
    float u0, length; /* v in [0, 1] is u = u0 + v length */
    vf4 c0, c1, c2;   /* lanes as in part_curve, of v; x and y from the block's corner */
} block;

/* Per texel: g at v0, in the middle, and at v1; the bound on its error; whether it may vanish. */
typedef struct texels {
    float v0[16], v1[16], g0[16], gm[16], g1[16], margin[16];
} texels;

/* Rows of five samples, the last three of eight are not used. */
static void load_rows(const kernel *k, const fast_part *part, int32_t x, int32_t y, uint16_t rows[5][8])
{
    const height_blocks *blocks = k->data->blocks;
    int32_t cx = part->cell_x + x, cy = part->cell_y + y;
    if (!(part->flags & FAST_WRAPPED) && cx + 4 < blocks->width && cy + 4 < blocks->height) {
        const uint16_t *tile =
            blocks->tiles + ((size_t)(cy >> 2) * (size_t)blocks->tile_columns + (size_t)(cx >> 3)) * 32;
        const uint16_t *below = tile + (size_t)blocks->tile_columns * 32;
        if (!(cx & 4)) {
            memcpy(rows[0], tile, 64);
            memcpy(rows[4], below, 16);
            return;
        }
        for (int j = 0; j < 4; j++) {
            memcpy(rows[j], tile + 8 * j + 4, 8);
            memcpy(rows[j] + 4, tile + 32 + 8 * j, 8);
        }
        memcpy(rows[4], below + 4, 8);
        memcpy(rows[4] + 4, below + 32, 8);
        return;
    }
    for (int j = 0; j < 5; j++)
        for (int i = 0; i < 5; i++)
            rows[j][i] =
                (uint16_t)height_blocks_code(blocks, height_wrap(cx + i, blocks->width, k->data->wrap_u),
                                             height_wrap(cy + j, blocks->height, k->data->wrap_v));
}

/* Samples at a texel's corner (dx, dy) of 8 texels: two rows of four. */
LANES_INLINE vf8 corner_codes(const uint16_t rows[5][8], int row, int dx)
{
    uint16_t both[8];
    memcpy(both, rows[row] + dx, 8);
    memcpy(both + 4, rows[row + 1] + dx, 8);
    return codes8(both);
}

/* Quadratic coefficients as lanes. */
typedef struct poly8 {
    vf8 c0, c1, c2;
} poly8;
LANES_INLINE poly8 poly8_of(const block *b, int lane)
{
    return (poly8){set8(b->c0[lane]), set8(b->c1[lane]), set8(b->c2[lane])};
}
LANES_INLINE vf8 poly8_at(const poly8 *p, vf8 v)
{
    return mad8(mad8(p->c2, v, p->c1), v, p->c0);
}

/* g = z - h at v. */
LANES_INLINE vf8 g_at(const poly8 *x, const poly8 *y, const poly8 *z, vf8 v, vf8 i, vf8 j, const vf8 h[4])
{
    vf8 dx = poly8_at(x, v) - i, dy = poly8_at(y, v) - j;
    vf8 height = mad8(dy, mad8(dx, h[3], h[2]), mad8(dx, h[1], h[0]));
    return poly8_at(z, v) - height;
}

/* Eight texels, rows `half` and `half` + 1: which of them may have a root. */
LANES_INLINE uint32_t test_texels(const kernel *k, const part_curve *c, const block *b,
                                  const uint16_t rows[5][8], int half, texels *t)
{
    const vf8 zero = set8(0.0f), one = set8(1.0f);
    const vf8 i = {0, 1, 2, 3, 0, 1, 2, 3}, j = {0, 0, 0, 0, 1, 1, 1, 1};
    vf8 row = j + set8((float)half);
    poly8 x = poly8_of(b, 0), y = poly8_of(b, 1), z = poly8_of(b, 3);
    /* Where the chord is over each texel. */
    float bow_x = 0.25f * fabsf(b->c2[0]) + c->error[0], bow_y = 0.25f * fabsf(b->c2[1]) + c->error[1];
    vf4 chord = safe_inverse4(b->c1 + b->c2);
    vf8 inverse_x = set8(chord[0]), inverse_y = set8(chord[1]);
    vf8 ax = (i - set8(bow_x) - x.c0) * inverse_x, bx = (i + set8(1.0f + bow_x) - x.c0) * inverse_x;
    vf8 ay = (row - set8(bow_y) - y.c0) * inverse_y, by = (row + set8(1.0f + bow_y) - y.c0) * inverse_y;
    vf8 v0 = max8(max8(min8(ax, bx), min8(ay, by)), zero), v1 = min8(min8(max8(ax, bx), max8(ay, by)), one);
    v0 = max8(v0 - set8(2e-6f), zero);
    v1 = min8(v1 + set8(2e-6f), one);
    uint32_t over = mask8(v0 <= v1);
    if (!over) return 0;
    /* The bilinear piece: h = h0 + h1 dx + dy (h2 + h3 dx). */
    vf8 scale = set8(k->data->height_code), h[4];
    vf8 s00 = corner_codes(rows, half, 0) * scale, s10 = corner_codes(rows, half, 1) * scale;
    vf8 s01 = corner_codes(rows, half + 1, 0) * scale, s11 = corner_codes(rows, half + 1, 1) * scale;
    h[0] = s00;
    h[1] = s10 - s00;
    h[2] = s01 - s00;
    h[3] = (s11 - s01) - h[1];
    vf8 slope_x = max8(abs8(h[1]), abs8(h[1] + h[3])), slope_y = max8(abs8(h[2]), abs8(h[2] + h[3]));
    vf8 margin = mad8(slope_x, set8(c->error[0]), mad8(slope_y, set8(c->error[1]), set8(c->error[3])));
    vf8 middle = (v0 + v1) * set8(0.5f);
    vf8 g0 = g_at(&x, &y, &z, v0, i, row, h), gm = g_at(&x, &y, &z, middle, i, row, h);
    vf8 g1 = g_at(&x, &y, &z, v1, i, row, h);
    /* x and y are nearly linear in v, so that g is nearly a quadratic; what h3 x y adds to that, by its third
     * and fourth power, is at most a tenth of it off the quadratic through three points. */
    float x1 = fabsf(b->c1[0]) + 2.0f * fabsf(b->c2[0]), y1 = fabsf(b->c1[1]) + 2.0f * fabsf(b->c2[1]);
    float cubic = 0.1f * (x1 * fabsf(b->c2[1]) + y1 * fabsf(b->c2[0]));
    vf8 part = v1 - v0;
    margin = margin + abs8(h[3]) * set8(cubic) * part * part * part;
    vf8 control = gm + gm - (g0 + g1) * set8(0.5f);
    vf8 least = min8(g0, min8(control, g1)), most = max8(g0, max8(control, g1));
    uint32_t may = over & mask8((least <= margin) & (most >= -margin));
    if (!may) return 0;
    memcpy(t->v0 + 4 * half, &v0, sizeof v0);
    memcpy(t->v1 + 4 * half, &v1, sizeof v1);
    memcpy(t->g0 + 4 * half, &g0, sizeof g0);
    memcpy(t->gm + 4 * half, &gm, sizeof gm);
    memcpy(t->g1 + 4 * half, &g1, sizeof g1);
    memcpy(t->margin + 4 * half, &margin, sizeof margin);
    return may << (4 * half);
}

/* Roots w of the quadratic through g0, gm, g1 at 0, 1/2, 1, first one first, that may be in [0, 1]: `reach`
 * is how far each may be off by the margin on g. At most two; -1 if they are not told apart from a tangency.
 */
static int texel_roots(float g0, float gm, float g1, float margin, float w[2], float reach[2])
{
    float a = 2.0f * (g0 + g1) - 4.0f * gm, b = g1 - g0 - a;
    float square = b * b - 4.0f * a * g0, allowed = 8.0f * fabsf(a) * margin;
    /* The turning point has the value (4 a g0 - b^2) / 4a. */
    if (fabsf(square) <= allowed) return -1;
    if (square < 0.0f) return 0;
    float root = sqrtf(square), q = -0.5f * (b + copysignf(root, b));
    if (!(root > 0.0f)) return -1;
    float found[2] = {g0 / q, a != 0.0f ? q / a : INFINITY}, off = 2.0f * margin / root + 1e-6f;
    if (found[1] < found[0]) {
        float swap = found[0];
        found[0] = found[1];
        found[1] = swap;
    }
    /* So far off that where the quadratic puts the root says little about it. */
    if (off > 0.25f) return -1;
    int count = 0;
    for (int i = 0; i < 2; i++)
        if (found[i] >= -off && found[i] <= 1.0f + off) {
            w[count] = found[i];
            reach[count++] = off;
        }
    return count;
}

/* Barycentrics at (x, y), plus `sign` times the bounds on their errors, for a curve that may be (off_x,
 * off_y) away: bit i, whether b_i is negative. */
static uint32_t negative_sides(const part_curve *c, float x, float y, float off_x, float off_y, float sign)
{
    const fast_patch *p = c->patch;
    vf4 ex = load4(p->edge[1]), ey = load4(p->edge[2]);
    vf4 slack = mad4(abs4(ex), set4(off_x), mad4(abs4(ey), set4(off_y), load4(p->edge_error)));
    vf4 b = mad4(ex, set4(x), mad4(ey, set4(y), load4(p->edge[0]) + set4(sign) * slack));
    return mask4(b < set4(0.0f)) & 7u;
}

LANES_INLINE double block_tau(const kernel *k, const part_curve *c, const block *b, float v)
{
    return curve_tau(k, c, b->u0 + v * b->length);
}

LANES_INLINE vf4 block_value(const block *b, float v)
{
    return mad4(mad4(b->c2, set4(v), b->c1), set4(v), b->c0);
}

/* Whether the curve keeps outside of one side of the triangle from v0 to v1. */
static bool passes_outside(const part_curve *c, const block *b, float v0, float v1)
{
    float cx = (float)(c->part->corner_x + b->x), cy = (float)(c->part->corner_y + b->y);
    vf4 first = block_value(b, v0), last = block_value(b, v1),
        bow = abs4(b->c2) * set4(0.25f * (v1 - v0) * (v1 - v0));
    float off_x = c->error[0] + bow[0], off_y = c->error[1] + bow[1];
    return (negative_sides(c, first[0] + cx, first[1] + cy, off_x, off_y, 1.0f) &
            negative_sides(c, last[0] + cx, last[1] + cy, off_x, off_y, 1.0f)) != 0;
}

/* Whether the curve's point at v is on the texel and in the triangle, and not just near them. */
LANES_INLINE bool is_surely_on(const part_curve *c, const block *b, float v, int lane)
{
    vf4 at = block_value(b, v);
    float x = at[0] - (float)(lane & 3), y = at[1] - (float)(lane >> 2);
    return x > c->error[0] && x < 1.0f - c->error[0] && y > c->error[1] && y < 1.0f - c->error[1] &&
           !negative_sides(c, at[0] + (float)(c->part->corner_x + b->x),
                           at[1] + (float)(c->part->corner_y + b->y), c->error[0], c->error[1], -1.0f);
}

/* One texel that may have a root. True if the ray needs to go no further. */
static bool look_at_texel(kernel *k, const part_curve *c, const block *b, const texels *t, int lane)
{
    fast_ray *r = k->ray;
    const fast_part *part = c->part;
    float v0 = t->v0[lane], length = t->v1[lane] - v0, w[2], reach[2];
    double slack = 4e-6 * (double)c->length;
    fast_candidate found = {.triangle = part->patch,
                            .i = part->corner_x + b->x + (lane & 3),
                            .j = part->corner_y + b->y + (lane >> 2)};
    int count = texel_roots(t->g0[lane], t->gm[lane], t->g1[lane], t->margin[lane], w, reach);
    if (count < 0) {
        if (passes_outside(c, b, v0, t->v1[lane])) return false;
        found.tau_in = block_tau(k, c, b, v0) - slack;
        found.tau_out = block_tau(k, c, b, t->v1[lane]) + slack;
        return fast_decide(r, &found) && r->any;
    }
    found.certain = true;
    for (int i = 0; i < count; i++) {
        /* The root is somewhere between these. */
        float v = v0 + w[i] * length, first = v - reach[i] * length, last = v + reach[i] * length;
        if (passes_outside(c, b, first, last)) continue;
        found.tau = block_tau(k, c, b, v);
        double off = slack + (double)(reach[i] * length * b->length) * (double)c->length;
        if (found.tau + off < r->tau_min || found.tau - off > r->tau_max) continue;
        if (r->any && found.tau - off > r->tau_min && found.tau + off < r->tau_max &&
            is_surely_on(c, b, first, lane) && is_surely_on(c, b, last, lane)) {
            r->found = true;
            return true;
        }
        vf4 at = block_value(b, v);
        found.x = at[0] + (float)(part->corner_x + b->x);
        found.y = at[1] + (float)(part->corner_y + b->y);
        found.tau_in = found.tau - off;
        found.tau_out = found.tau + off;
        if (fast_decide(r, &found)) return r->any;
    }
    return false;
}

/* 4 x 4 texels. True if the ray needs to go no further. */
static bool visit_block(kernel *k, const part_curve *c, int32_t x, int32_t y, float u0, float u1)
{
    block b = {.x = x, .y = y, .u0 = u0, .length = u1 - u0};
    vf4 length = set4(b.length);
    const vf4 corner = {(float)x, (float)y, 0.0f, 0.0f};
    b.c0 = curve_value(c, u0) - corner;
    b.c1 = (c->c1 + set4(2.0f * u0) * c->c2) * length;
    b.c2 = c->c2 * length * length;
    k->ray->steps++;
    uint16_t rows[5][8];
    texels t;
    load_rows(k, c->part, x, y, rows);
    uint32_t may = test_texels(k, c, &b, rows, 0, &t);
    may |= test_texels(k, c, &b, rows, 2, &t);
    while (may) {
        int lane = first_lane(may, t.v0);
        may &= ~(1u << lane);
        if (look_at_texel(k, c, &b, &t, lane)) return true;
        if (k->ray->found && block_tau(k, c, &b, t.v0[lane]) > k->ray->tau_max) return false;
    }
    return false;
}

#endif
