/* methods/fast/walk.h: one ray through the tree, its parts, their nodes and blocks of texels, in floats.
 *
 * Included once per kind of machine, by a file that defines FAST_WALK as the name of the function. See
 * fast.h for the maths. Of a part's curve three points are found by iteration; the quadratics through them
 * are x, y (texels from the part's corner) and z (height over that of code 0) as functions of u in [0, 1],
 * with bounds on how far the curve is from them. */
#include "methods/fast/fast.h"
#include "methods/fast/lanes.h"

typedef struct kernel {
    fast_ray *ray;
    const fast_data *data;
    float tau_min, tau_max; /* rounded outwards */
    /* The ray in the part that is looked at: q = q0 + (tau - shift) q1. */
    double shift;
    vf4 q0, q1;
} kernel;

/* A curve over a part. */
typedef struct part_curve {
    const fast_part *part;
    const fast_patch *patch;
    vf4 c0, c1, c2;      /* lanes x, y, s, z */
    vf4 bow;             /* how far it is from its chord, at most */
    vf4 error;           /* and from the quadratics; lane 3 is that of z against heights */
    float start, length; /* tau - shift at u = 0, and from there to u = 1 */
    float u0, u1;        /* where it is over the part, inside the triangle */
} part_curve;

/* Floats at or below and at or above x, without the care for the last bit that fast_round_up() takes. */
LANES_INLINE float float_below(double x)
{
    return (float)(x - 2.5e-7 * fabs(x));
}
LANES_INLINE float float_above(double x)
{
    return (float)(x + 2.5e-7 * fabs(x));
}

/* ---- The curve ---------------------------------------------------------------------------------------- */

LANES_INLINE void enter_part(kernel *k, const fast_part *p)
{
    const fast_ray *r = k->ray;
    vec3 direction = v3_load(r->direction), to = v3_sub(v3_loadf(p->origin), v3_load(r->origin));
    k->shift = v3_dot(to, direction) * r->inverse_square;
    vec3 near = v3_sub(v3_scale(direction, k->shift), to);
    vf4 ix = load4(p->inverse[0]), iy = load4(p->inverse[1]), iz = load4(p->inverse[2]);
    k->q0 = mad4(ix, set4((float)near.x), mad4(iy, set4((float)near.y), iz * set4((float)near.z)));
    k->q1 =
        mad4(ix, set4((float)direction.x), mad4(iy, set4((float)direction.y), iz * set4((float)direction.z)));
}

/* Points of the curve at tau, from the part's centre: q = d + d_s (K_x d_x + K_y d_y) in two steps, d_x and
 * d_y from d_s by a 2 x 2 system, d_s from d_x and d_y by iteration. */
LANES_INLINE void curve_points(const kernel *k, const fast_part *p, vf4 tau, vf4 *x, vf4 *y, vf4 *s)
{
    vf4 qx = mad4(set4(k->q1[0]), tau, set4(k->q0[0]));
    vf4 qy = mad4(set4(k->q1[1]), tau, set4(k->q0[1]));
    vf4 qs = mad4(set4(k->q1[2]), tau, set4(k->q0[2]));
    vf4 dx = qx, dy = qy, ds = qs;
    const vf4 one = set4(1.0f);
    for (uint32_t i = 0; i < p->iterations; i++) {
        vf4 a = mad4(ds, set4(p->bend_x[0]), one), b = ds * set4(p->bend_y[0]);
        vf4 c = ds * set4(p->bend_x[1]), d = mad4(ds, set4(p->bend_y[1]), one);
        vf4 inverse = one / (a * d - b * c);
        dx = (d * qx - b * qy) * inverse;
        dy = (a * qy - c * qx) * inverse;
        ds = qs - ds * mad4(set4(p->bend_x[2]), dx, set4(p->bend_y[2]) * dy);
    }
    *x = dx;
    *y = dy;
    *s = ds;
}

/* |N| at the points. */
LANES_INLINE vf4 normal_lengths(const fast_patch *p, vf4 x, vf4 y)
{
    vf4 square = set4(0.0f);
    for (int i = 0; i < 3; i++) {
        vf4 n = mad4(set4(p->normal[1][i]), x, mad4(set4(p->normal[2][i]), y, set4(p->normal[0][i])));
        square = mad4(n, n, square);
    }
    return sqrt4(square);
}

/* How far the curve is from the quadratics through its points at u = 0, 1/2, 1: at most 0.0642 of the third
 * derivative of a function of 2 u - 1. With S, X, Y the half movements along the axes and w that of |N|,
 *     d'''  <= 6 (m_s b + S (|K_x| b_x + |K_y| b_y)),   b the bow, m_s = |K_x,s| X + |K_y,s| Y,
 *     |N|'' <= 2 w^2 + 2 |N_x| (b_x + b_y),   |N|''' <= 12 w (w^2 + |N_x| (b_x + b_y)),
 * by up to 1 / (1 - 0.6) more for the 2 x 2 system that d_x and d_y are from, and for |N| >= 1/2. */
static void set_error(part_curve *c, const fast_data *data, vf4 ends)
{
    const fast_patch *p = c->patch;
    vf4 bow = c->bow, half = mad4(set4(0.5f), abs4(ends), bow);
    vf4 bx = abs4(load4(c->part->bend_x)), by = abs4(load4(c->part->bend_y));
    float ms = bx[2] * half[0] + by[2] * half[1], across = bow[0] + bow[1];
    vf4 third = set4(ms) * bow + set4(half[2]) * (bx * set4(bow[0]) + by * set4(bow[1]));
    const vf4 texel_rounding = {4e-6f, 4e-6f, 0.0f, 0.0f};
    float side = (float)(16 << (2 * c->part->level));
    vf4 error = load4(c->part->error) + set4(1.7f) * third + texel_rounding * set4(side);
    float lower = c->part->s_min < 0.0f ? -c->part->s_min : c->part->s_min;
    float upper = c->part->s_max < 0.0f ? -c->part->s_max : c->part->s_max;
    float most = lower > upper ? lower : upper, move = p->normal_move;
    float w = move * (half[0] + half[1]), second = w * w + move * across;
    float z = 0.3f * (6.0f * bow[2] * w + 6.0f * half[2] * second + 12.0f * most * w * second);
    z += error[2] * p->normal_most + most * move * (error[0] + error[1]);
    error[3] = z + 0x1p-20f * most * p->normal_most + data->height_error;
    c->error = error;
}

/* Where the triangle is on a part: texels from the corner, and s from its middle. */
LANES_INLINE void part_extent(const fast_part *part, vf4 *lower, vf4 *upper)
{
    float unit = (float)(16 << (2 * part->level)) * (1.0f / 255.0f),
          middle = 0.5f * (part->s_min + part->s_max);
    *lower = (vf4){unit * (float)part->from_x, unit * (float)part->from_y, part->s_min - middle, -1.0f};
    *upper = (vf4){unit * (float)part->to_x, unit * (float)part->to_y, part->s_max - middle, 1.0f};
}

/* Clips u to where the chord, widened by the bow and the errors, is over the part and inside the triangle. */
static bool clip_to_part(part_curve *c, vf4 first, vf4 last)
{
    const fast_part *part = c->part;
    const fast_patch *p = c->patch;
    vf4 pad = c->bow + c->error, inverse = safe_inverse4(last - first), lower, upper;
    part_extent(part, &lower, &upper);
    vf4 a = (lower - pad - first) * inverse, b = (upper + pad - first) * inverse;
    vf4 in = min4(a, b), out = max4(a, b);
    /* Barycentrics at both ends. */
    vf4 e0 = load4(p->edge[0]), ex = load4(p->edge[1]), ey = load4(p->edge[2]);
    vf4 slack = mad4(abs4(ex), set4(pad[0]), mad4(abs4(ey), set4(pad[1]), load4(p->edge_error)));
    float cx = (float)part->corner_x, cy = (float)part->corner_y;
    vf4 f0 = mad4(ex, set4(first[0] + cx), mad4(ey, set4(first[1] + cy), e0 + slack));
    vf4 f1 = mad4(ex, set4(last[0] + cx), mad4(ey, set4(last[1] + cy), e0 + slack));
    const vf4 zero = set4(0.0f), one = set4(1.0f);
    if (mask4((f0 < zero) & (f1 < zero))) return false;
    vf4 cross = f0 / (f0 - f1);
    in = max4(select4(f0 < zero, cross, zero), in);
    out = min4(select4(f1 < zero, cross, one), out);
    float u0 = most3(in), u1 = least3(out);
    u0 = u0 > 0.0f ? u0 - 2e-6f : 0.0f;
    u1 = u1 < 1.0f ? u1 + 2e-6f : 1.0f;
    c->u0 = u0 > 0.0f ? u0 : 0.0f;
    c->u1 = u1;
    return u0 <= u1;
}

LANES_INLINE vf4 curve_value(const part_curve *c, float u)
{
    return mad4(mad4(c->c2, set4(u), c->c1), set4(u), c->c0);
}

/* ---- Texels ------------------------------------------------------------------------------------------- */

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

LANES_INLINE double curve_tau(const kernel *k, const part_curve *c, const block *b, float v)
{
    return k->shift + (double)c->start + (double)c->length * (double)(b->u0 + v * b->length);
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
        found.tau_in = curve_tau(k, c, b, v0) - slack;
        found.tau_out = curve_tau(k, c, b, t->v1[lane]) + slack;
        return fast_decide(r, &found) && r->any;
    }
    found.certain = true;
    for (int i = 0; i < count; i++) {
        /* The root is somewhere between these. */
        float v = v0 + w[i] * length, first = v - reach[i] * length, last = v + reach[i] * length;
        if (passes_outside(c, b, first, last)) continue;
        found.tau = curve_tau(k, c, b, v);
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
        int lane = __builtin_ctz(may);
        for (uint32_t rest = may & (may - 1); rest; rest &= rest - 1)
            if (t.v0[__builtin_ctz(rest)] < t.v0[lane]) lane = __builtin_ctz(rest);
        may &= ~(1u << lane);
        if (look_at_texel(k, c, &b, &t, lane)) return true;
        if (k->ray->found &&
            (double)c->start + (double)c->length * (double)(b.u0 + t.v0[lane] * b.length) + k->shift >
                k->ray->tau_max)
            return false;
    }
    return false;
}

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
        int n = __builtin_ctz(met);
        for (uint32_t rest = met & (met - 1); rest; rest &= rest - 1)
            if (in[__builtin_ctz(rest)] < in[n]) n = __builtin_ctz(rest);
        met &= ~(1u << n);
        if (k->ray->found &&
            k->shift + (double)c->start + (double)c->length * (double)in[n] > k->ray->tau_max)
            return false;
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
