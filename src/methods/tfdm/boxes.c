/* Four nodes at once; see boxes.h. */
#include "methods/tfdm/boxes.h"

#include <float.h>

static box_axis make_axis(double p, double n, double px, double py, double nx, double ny, double rounding,
                          double inverse)
{
    return (box_axis){
        pair_of(p * inverse),        pair_of(n * inverse),        pair_of(px * inverse),
        pair_of(py * inverse),       pair_of(nx * inverse),       pair_of(ny * inverse),
        pair_of(fabs(nx * inverse)), pair_of(fabs(ny * inverse)), pair_of(rounding * fabs(inverse))};
}

/* Orthonormal axes, the last along the mean normal (Duff et al. 2017). */
static void make_axes(const triangle_frame *f, vec3 e[3])
{
    vec3 n = v3_normalize(v3_add(f->n[0], v3_add(f->n[1], f->n[2])));
    double sign = copysign(1.0, n.z), a = -1.0 / (sign + n.z), b = n.x * n.y * a;
    e[0] = v3(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    e[1] = v3(b, sign + n.y * n.y * a, -n.y);
    e[2] = n;
}

/* Slabs hold whatever the axes are, so that their rounding does not matter; that of the ray's components
 * along them moves the ray by a few roundings of its distance, which cell.rounding covers. */
void quad_boxes_make(const shell_space *space, const triangle_frame *f, const knurl_ray *ray, bool turned,
                     double pad, quad_boxes *q)
{
    cell_boxes *c = &q->cell;
    cell_boxes_make(f, ray, c);
    vec3 e[3] = {v3(1.0, 0.0, 0.0), v3(0.0, 1.0, 0.0), v3(0.0, 0.0, 1.0)};
    if (turned) make_axes(f, e);
    for (int k = 0; k < 3; k++) {
        double along = v3_dot(v3_load(ray->direction), e[k]);
        double inverse = 1.0 / (fabs(along) < 1e-300 ? copysign(1e-300, along) : along);
        q->axis[k] =
            make_axis(-v3_dot(c->origin, e[k]), v3_dot(f->n[0], e[k]), v3_dot(c->px, e[k]),
                      v3_dot(c->py, e[k]), v3_dot(c->nx, e[k]), v3_dot(c->ny, e[k]), c->rounding, inverse);
    }
    q->x0 = min_d(f->x[0], min_d(f->x[1], f->x[2]));
    q->x1 = max_d(f->x[0], max_d(f->x[1], f->x[2]));
    q->y0 = min_d(f->y[0], min_d(f->y[1], f->y[2]));
    q->y1 = max_d(f->y[0], max_d(f->y[1], f->y[2]));
    q->pad = pad;
    /* The signal's slope is at most its range per texel along each axis, at any level of detail. */
    knurl_range map = knurl_heightmap_range(space->map);
    q->height_pad = 2.0 * pad * fabs(space->factor) * (map.max - map.min);
    const double *m = f->inverse_uv;
    for (int k = 0; k < 2; k++) {
        q->slope[0][k] = pair_of(-m[k] - m[k + 2]);
        q->slope[1][k] = pair_of(m[k]);
        q->slope[2][k] = pair_of(m[k + 2]);
    }
    q->side_rounding = pair_of(
        -16.0 * DBL_EPSILON *
        (1.0 + (fabs(m[0]) + fabs(m[2])) * (q->x1 - q->x0) + (fabs(m[1]) + fabs(m[3])) * (q->y1 - q->y0)));
}

/* Cuts [a, b] to [low, high] and grows it by pad; the lanes where something is left. */
static inline pair_bits cut_span(pair a, pair b, double low, double high, double pad, pair *center,
                                 pair *half)
{
    pair from = pair_max(a, pair_of(low)), to = pair_min(b, pair_of(high));
    *center = pair_of(0.5) * (from + to);
    *half = pair_of(0.5) * (to - from) + pair_of(pad);
    return (a < b) & (*half >= pair_of(0.0));
}

unsigned quad_in_triangle(const quad_boxes *q, const quad *nodes, bool parent_inside, quad_cut *cut,
                          unsigned *inside)
{
    const triangle_frame *f = q->cell.frame;
    unsigned columns = pair_mask(cut_span(nodes->x0, nodes->x1, q->x0, q->x1, q->pad, &cut->cx, &cut->rx));
    unsigned rows = pair_mask(cut_span(nodes->y0, nodes->y1, q->y0, q->y1, q->pad, &cut->cy, &cut->ry));
    cut->cx -= pair_of(f->x[0]);
    cut->cy -= pair_of(f->y[0]);
    unsigned wanted = columns * ((rows & 1) | (rows & 2) << 1);
    *inside = wanted;
    if (parent_inside || !wanted) return wanted;
    /* Ranges of the barycentrics over columns and rows, which add up. */
    pair_bits touched[2] = {{-1, -1}, {-1, -1}}, held[2] = {{-1, -1}, {-1, -1}};
    for (int k = 0; k < 3; k++) {
        pair x = q->slope[k][0] * cut->cx, dx = pair_abs(q->slope[k][0] * cut->rx);
        pair y = q->slope[k][1] * cut->cy, dy = pair_abs(q->slope[k][1] * cut->ry);
        if (k == 0) y += pair_of(1.0);
        pair x_low = x - dx, x_high = x + dx, y_low = y - dy, y_high = y + dy;
        for (int j = 0; j < 2; j++) {
            touched[j] &= x_high + pair_of(y_high[j]) >= q->side_rounding;
            held[j] &= x_low + pair_of(y_low[j]) >= pair_of(0.0);
        }
    }
    *inside &= pair_mask(held[0]) | pair_mask(held[1]) << 2;
    return wanted & (pair_mask(touched[0]) | pair_mask(touched[1]) << 2);
}

/* 1 / |N|, bounded over all four nodes. */
static void inverse_normal(const quad_boxes *q, const quad_cut *cut, double *small, double *large)
{
    const cell_boxes *c = &q->cell;
    *small = *large = 1.0;
    if (c->frame->unnormalised) return;
    pair left = cut->cx - cut->rx, right = cut->cx + cut->rx, top = cut->cy - cut->ry,
         bottom = cut->cy + cut->ry;
    double x0 = min_d(left[0], left[1]), x1 = max_d(right[0], right[1]), y0 = min_d(top[0], top[1]),
           y1 = max_d(bottom[0], bottom[1]);
    vec3 n = v3_mad(v3_mad(c->frame->n[0], 0.5 * (x0 + x1), c->nx), 0.5 * (y0 + y1), c->ny);
    double low, high;
    cell_normal_range(c, n, 0.5 * (x1 - x0), 0.5 * (y1 - y0), &low, &high);
    *small = 1.0 / high;
    *large = 1.0 / low;
}

/* What a row of two nodes is tested with. */
typedef struct row_clip {
    pair cy, ry;
    pair sc, sr;  /* centre and half size of s = h / |N| */
    pair in, out; /* the ray's range in the slabs so far */
} row_clip;

static inline void clip_row(const box_axis *a, pair p, pair n, pair move, pair rx, row_clip *r)
{
    p += a->py * r->cy;
    n += a->ny * r->cy;
    pair half = pair_abs(a->px + r->sc * a->nx) * rx + pair_abs(a->py + r->sc * a->ny) * r->ry;
    half += r->sr * (pair_abs(n) + move + a->ny_size * r->ry) + a->rounding;
    pair center = p + r->sc * n;
    /* b where a is NaN, which infinities make of a direction without extent along an axis: such a slab
     * does not bound the ray. */
    r->in = pair_max(center - half, r->in);
    r->out = pair_min(center + half, r->out);
}

unsigned quad_clip(const quad_boxes *q, const quad *nodes, const quad_cut *cut, unsigned wanted, double tmin,
                   double tmax, pair entry[2])
{
    const triangle_frame *f = q->cell.frame;
    double small, large;
    inverse_normal(q, cut, &small, &large);
    row_clip row[2];
    for (int j = 0; j < 2; j++) {
        pair h0 = nodes->min[j] - pair_of(q->height_pad), h1 = nodes->max[j] + pair_of(q->height_pad);
        pair s0 = pair_max(pair_min(h0 * pair_of(small), h0 * pair_of(large)), pair_of(f->s0));
        pair s1 = pair_min(pair_max(h1 * pair_of(small), h1 * pair_of(large)), pair_of(f->s1));
        row[j] = (row_clip){pair_of(cut->cy[j]),      pair_of(cut->ry[j]), pair_of(0.5) * (s0 + s1),
                            pair_of(0.5) * (s1 - s0), pair_of(tmin),       pair_of(tmax)};
    }
    for (int k = 0; k < 3; k++) {
        const box_axis *a = &q->axis[k];
        pair p = a->p + a->px * cut->cx, n = a->n + a->nx * cut->cx, move = a->nx_size * cut->rx;
        clip_row(a, p, n, move, cut->rx, &row[0]);
        clip_row(a, p, n, move, cut->rx, &row[1]);
    }
    unsigned found = 0;
    for (int j = 0; j < 2; j++) {
        entry[j] = row[j].in;
        found |= pair_mask((row[j].sr >= pair_of(0.0)) & (row[j].in <= row[j].out)) << 2 * j;
    }
    return found & wanted;
}
