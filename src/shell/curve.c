/* The explicit ray curve; see curve.h. */
#include "shell/curve.h"
#include "shell/invert.h"

/* A ray whose sine against the offset plane it starts in is under this is followed by depth.
 * By height, rounding is amplified by 1 / sine: to 1e-11 here. By depth, the quadratics leave a
 * remainder of order sine^2: 1e-10 here, which Newton steps take away again. */
static const double GRAZING_SINE = 1e-5;
/* Followed by height with W above this fraction of the offset triangle's area, points are exact to a few
 * hundred roundings as they are. */
static const double STEEP_SINE = 1e-2;
/* Followed by height, a stretch must end at a side or at the height range, before W falls to this
 * fraction of the offset triangle's area; where it does not, the shell is nearly folded and the curve
 * is declared unreliable. */
static const double LEAST_SINE = 1e-8;

/* Everything seen along the ray: two coordinates across it and the depth along it. */
typedef struct ray_view {
    vec3 across1, across2, along; /* orthonormal */
    double length;                /* of the direction */
    vec3 p[3];                    /* P_i - O in (across1, across2, along) */
    vec3 n[3];
    double p_rounding;     /* bound on the absolute error of p */
    double p_size, n_size; /* largest across coordinate of P_i, N_i */
} ray_view;

static double cross2(vec3 a, vec3 b)
{
    return a.x * b.y - a.y * b.x;
}

/* Frisvad-like orthonormal basis, branch by sign (Duff et al. 2017). */
static void make_basis(vec3 d, vec3 *e1, vec3 *e2)
{
    double sign = copysign(1.0, d.z), a = -1.0 / (sign + d.z), b = d.x * d.y * a;
    *e1 = v3(1.0 + sign * d.x * d.x * a, sign * b, -sign * d.x);
    *e2 = v3(b, sign + d.y * d.y * a, -d.y);
}

static vec3 to_view(const ray_view *v, vec3 a)
{
    return v3(v3_dot(a, v->across1), v3_dot(a, v->across2), v3_dot(a, v->along));
}

/* P_i - O is formed from the vertex itself, never relative to another vertex: neighbours that
 * share an edge then see the same numbers for it. */
static void view_make(const triangle_frame *f, const knurl_ray *ray, ray_view *v)
{
    vec3 direction = v3_load(ray->direction), origin = v3_load(ray->origin);
    v->length = v3_length(direction);
    v->along = v3_scale(direction, 1.0 / v->length);
    make_basis(v->along, &v->across1, &v->across2);
    double far = 0.0;
    v->p_size = v->n_size = 0.0;
    for (int i = 0; i < 3; i++) {
        vec3 relative = v3_sub(v3_add(f->base, f->p[i]), origin);
        far = max_d(far, v3_max_component(v3_abs(relative)));
        v->p[i] = to_view(v, relative);
        v->n[i] = to_view(v, f->n[i]);
        v->p_size = max_d(v->p_size, max_d(fabs(v->p[i].x), fabs(v->p[i].y)));
        v->n_size = max_d(v->n_size, max_d(fabs(v->n[i].x), fabs(v->n[i].y)));
    }
    v->p_rounding = 8.0 * DBL_EPSILON * far;
}

/* V_j(s) x V_k(s) as a quadratic in s. */
static quadratic side_quadratic(const ray_view *v, int j, int k)
{
    return (quadratic){{cross2(v->p[j], v->p[k]), cross2(v->p[j], v->n[k]) + cross2(v->n[j], v->p[k]),
                        cross2(v->n[j], v->n[k])}};
}

/* a W + b B1 + c B2 */
static quadratic combine(const ray_curve *c, double a, double b, double d)
{
    quadratic q;
    for (int i = 0; i < 3; i++) q.c[i] = a * c->w.c[i] + b * c->b1.c[i] + d * c->b2.c[i];
    return q;
}

/* Whether W comes so close to 0 between s0 and s1 that the ray may graze; then which s the ray's
 * point nearest to the triangle's centre has decides (is_grazing). */
static bool may_graze(const ray_curve *c, const triangle_frame *f, double threshold)
{
    double b[3];
    quadratic_bernstein(&c->w, f->s0, f->s1, b);
    double lowest = min_d(b[0], min_d(b[1], b[2])), highest = max_d(b[0], max_d(b[1], b[2]));
    return lowest <= threshold && highest >= -threshold;
}

/* Curve by depth, around the ray's point at depth `center`, with `start` near its inverse: value, tangent J
 * c' = D and bend J c'' = -2 s' (N_x x' + N_y y'). */
static bool depth_curve(const triangle_frame *f, const ray_view *v, const knurl_ray *ray, double center,
                        vec3 start, ray_curve *c)
{
    vec3 relative = v3_sub(v3_load(ray->origin), f->base);
    vec3 q = start, ja, jb, js, tangent, bend;
    if (!shell_invert(f, v3_mad(relative, center, v->along), &q)) return false;
    shell_columns(f, q, &ja, &jb, &js);
    if (!solve3(ja, jb, js, v->along, &tangent)) return false;
    vec3 turn = v3_scale(v3_mad(v3_scale(f->ne, tangent.x), tangent.y, f->nf), -2.0 * tangent.z);
    if (!solve3(ja, jb, js, turn, &bend)) return false;
    c->by_depth = true;
    c->refine = !(f->flags & SHELL_CONSTANT_NORMAL);
    c->depth_origin = center / v->length;
    c->depth_scale = 1.0 / v->length;
    c->w = (quadratic){{1.0, 0.0, 0.0}};
    c->b1 = (quadratic){{q.x, tangent.x, 0.5 * bend.x}};
    c->b2 = (quadratic){{q.y, tangent.y, 0.5 * bend.y}};
    c->s = (quadratic){{q.z, tangent.z, 0.5 * bend.z}};
    return true;
}

/* Bounds on the errors of b and s by rounding, for points that are inverted at a known t: the rounding
 * of the ray's point and of the shell's, through the inverse of J at `near`. */
static void set_inversion_rounding(const triangle_frame *f, const ray_view *v, vec3 near, ray_curve *c)
{
    vec3 ja, jb, js;
    shell_columns(f, near, &ja, &jb, &js);
    double reach = f->size + max_d(fabs(f->s0), fabs(f->s1));
    double error = (v->p_rounding + 16.0 * DBL_EPSILON * reach) / fabs(v3_det(ja, jb, js));
    double across = v3_length(v3_cross(jb, js)) + v3_length(v3_cross(ja, js));
    c->barycentric_rounding = error * across + 16.0 * DBL_EPSILON;
    c->height_rounding = error * v3_length(v3_cross(ja, jb));
}

/* One condition on the parameter: value(p) >= -allowance. */
typedef struct condition {
    quadratic q;
    double allowance;
} condition;

static bool holds(const condition *conditions, int count, double p)
{
    for (int i = 0; i < count; i++)
        if (!(quadratic_at(&conditions[i].q, p) >= -conditions[i].allowance)) return false;
    return true;
}

static void sort(double *values, int count)
{
    for (int i = 1; i < count; i++) {
        double value = values[i];
        int j = i;
        for (; j > 0 && values[j - 1] > value; j--) values[j] = values[j - 1];
        values[j] = value;
    }
}

static void add_interval(ray_curve *c, double a, double b)
{
    if (c->interval_count == CURVE_MAX_INTERVALS) {
        c->unreliable = true;
        return;
    }
    double ta = curve_depth(c, a), tb = curve_depth(c, b);
    bool forward = ta <= tb;
    c->intervals[c->interval_count++] =
        forward ? (curve_interval){a, b, ta, tb} : (curve_interval){b, a, tb, ta};
}

/* The three side conditions at a point of the curve: barycentrics. */
static double barycentric(const curve_point *at, int side)
{
    return side == 0 ? 1.0 - at->b1 - at->b2 : side == 1 ? at->b1 : at->b2;
}

/* The side of the prism at an end of a stretch, if there is one, and how its barycentric changes along
 * the curve. */
typedef struct side_end {
    int side; /* -1: an end of the height range */
    double value, slope;
} side_end;

/* Of the barycentrics that grow inwards, the one that is last to reach zero ends the stretch. The nearest
 * to zero will not do: by a vertex two are. `inwards` is a step into the stretch. False if rounding hides
 * whether one that is near zero grows. */
static bool find_side_at(const ray_curve *c, double p, double inwards, side_end *end)
{
    curve_point at = curve_at(c, p), inside = curve_at(c, p + inwards);
    double latest = -INFINITY;
    bool clear = true;
    *end = (side_end){-1, 0.0, 0.0};
    for (int i = 0; i < 3; i++) {
        double value = barycentric(&at, i), growth = barycentric(&inside, i) - value;
        if (!(fabs(value) <= 1e-5)) continue;
        if (!(fabs(growth) > c->barycentric_rounding)) clear = false;
        if (!(growth > c->barycentric_rounding) || !(-value / growth > latest)) continue;
        latest = -value / growth;
        *end = (side_end){i, value, growth / inwards};
    }
    return clear;
}

/* `inwards` is the whole stretch. A short step gives the better slope; on a stretch that is itself hardly
 * longer than rounding only a long one gives any. A ray in a side of the prism shows no growth at all: that
 * side does not end the stretch. */
static side_end find_side(const ray_curve *c, double p, double inwards)
{
    side_end end;
    if (!find_side_at(c, p, 1e-3 * inwards, &end)) (void)find_side_at(c, p, 0.25 * inwards, &end);
    return end;
}

double curve_end_zone(const ray_curve *c, const curve_interval *s, bool first)
{
    double inwards = first ? s->out - s->in : s->in - s->out;
    if (inwards == 0.0) return 0.0;
    side_end end = find_side(c, first ? s->in : s->out, inwards);
    return end.side < 0
               ? 0.0
               : copysign(min_d(2.0 * c->barycentric_rounding / fabs(end.slope), fabs(inwards)), inwards);
}

/* Moves an end that lies on a side to where the curve's points (not only the quadratics) pass it by the
 * rounding of b. Only inwards, since the search was wider than that; near a vertex, where a stretch is no
 * longer than the search was wide, over most of it. */
static double settle_end(const ray_curve *c, double start, double inwards)
{
    if (inwards == 0.0) return start;
    double p = start, other = start + inwards;
    side_end end = find_side(c, p, inwards);
    for (int i = 0; end.side >= 0 && i < 3; i++) {
        double moved = p - (end.value + c->barycentric_rounding) / end.slope;
        if (!(moved >= min_d(start, other) && moved <= max_d(start, other))) break;
        p = moved;
        curve_point at = curve_at(c, p);
        end.value = barycentric(&at, end.side);
    }
    return p;
}

/* For refined points: settles both ends of every stretch, and drops stretches that the points do not
 * confirm, since the search on the quadratics was wider than rounding. */
static void settle_intervals(ray_curve *c)
{
    int kept = 0;
    for (int i = 0; i < c->interval_count; i++) {
        curve_interval s = c->intervals[i];
        double inwards = s.out - s.in;
        double in = settle_end(c, s.in, inwards), out = settle_end(c, s.out, -inwards);
        s = (curve_interval){in, out, curve_depth(c, in), curve_depth(c, out)};
        curve_point at = curve_at(c, 0.5 * (s.in + s.out));
        double least = min_d(barycentric(&at, 0), min_d(barycentric(&at, 1), barycentric(&at, 2)));
        if (s.t_in <= s.t_out && least >= -2.0 * c->barycentric_rounding) c->intervals[kept++] = s;
    }
    c->interval_count = kept;
}

/* Stretches of [lo, hi] where all conditions hold. Cuts at the conditions' roots and tests midpoints
 * (closed, and widened by each condition's allowance for rounding). */
static void find_intervals(ray_curve *c, const condition *conditions, int count, double lo, double hi)
{
    double cuts[16];
    int n = 0;
    cuts[n++] = lo;
    for (int i = 0; i < count; i++) {
        quadratic q = conditions[i].q;
        q.c[0] += conditions[i].allowance;
        double roots[2];
        int found = quadratic_roots(&q, roots);
        for (int k = 0; k < found; k++)
            if (roots[k] > lo && roots[k] < hi) cuts[n++] = roots[k];
    }
    cuts[n++] = hi;
    sort(cuts, n);
    double start = 0.0;
    bool open = false;
    for (int i = 0; i + 1 < n; i++) {
        bool inside = holds(conditions, count, 0.5 * (cuts[i] + cuts[i + 1]));
        if (inside && !open) start = cuts[i];
        if (!inside && open) add_interval(c, start, cuts[i]);
        open = inside;
    }
    if (open) add_interval(c, start, hi);
}

/* Allowance for q_i: products of coordinates known to p_rounding, and the polynomial's rounding. */
static double side_allowance(const triangle_frame *f, const ray_view *v)
{
    double reach = v->p_size + max_d(fabs(f->s0), fabs(f->s1)) * v->n_size;
    return 4.0 * reach * v->p_rounding + 32.0 * DBL_EPSILON * reach * reach;
}

/* By height, W > 0 and W < 0 are separate cases: q_i >= 0 or q_i <= 0. Returns the least |W| there. */
static double height_intervals(ray_curve *c, const triangle_frame *f, const ray_view *v, double area)
{
    double allowance = side_allowance(f, v), w_floor = LEAST_SINE * area, bernstein[3];
    quadratic b0 = combine(c, 1.0, -1.0, -1.0);
    quadratic_bernstein(&c->w, f->s0, f->s1, bernstein);
    double lowest = min_d(bernstein[0], min_d(bernstein[1], bernstein[2]));
    double highest = max_d(bernstein[0], max_d(bernstein[1], bernstein[2]));
    for (int sign = -1; sign <= 1; sign += 2) {
        if (sign > 0 ? highest <= w_floor : lowest >= -w_floor) continue;
        condition conditions[4] = {{b0, allowance}, {c->b1, allowance}, {c->b2, allowance}, {c->w, -w_floor}};
        bool culled = false;
        for (int i = 0; i < 4; i++) {
            for (int k = 0; k < 3; k++) conditions[i].q.c[k] *= (double)sign;
            double b[3];
            quadratic_bernstein(&conditions[i].q, f->s0, f->s1, b);
            culled |= max_d(b[0], max_d(b[1], b[2])) < -conditions[i].allowance;
        }
        if (!culled) find_intervals(c, conditions, 4, f->s0, f->s1);
    }
    double w_least = INFINITY;
    for (int i = 0; i < c->interval_count; i++) {
        curve_interval *s = &c->intervals[i];
        double w[3];
        quadratic_bernstein(&c->w, min_d(s->in, s->out), max_d(s->in, s->out), w);
        w_least = min_d(w_least, min_d(fabs(w[0]), fabs(w[2])));
    }
    if (w_least < 1.001 * w_floor) c->unreliable = true;
    c->barycentric_rounding = c->interval_count ? 2.0 * allowance / w_least + 16.0 * DBL_EPSILON : 0.0;
    return w_least;
}

/* Distance in texels that an error e of b can make. */
static double texel_error(const triangle_frame *f, double e)
{
    return e * (fabs(f->xe) + fabs(f->xf) + fabs(f->ye) + fabs(f->yf));
}

/* How far the quadratics are from the exact curve at the ends of its stretches, which is where they
 * are worst, in b and, as height_remainder, in s; allows for four times what is found. Returns the
 * distance in b. */
static double measure_remainder(ray_curve *c)
{
    double worst = 0.0, worst_height = 0.0;
    for (int i = 0; i < c->interval_count; i++)
        for (int end = 0; end < 2; end++) {
            double p = end ? c->intervals[i].out : c->intervals[i].in;
            double inverse = c->by_depth ? 1.0 : 1.0 / quadratic_at(&c->w, p);
            curve_point at = curve_at(c, p);
            worst = max_d(worst, max_d(fabs(at.b1 - quadratic_at(&c->b1, p) * inverse),
                                       fabs(at.b2 - quadratic_at(&c->b2, p) * inverse)));
            worst_height = max_d(worst_height, fabs(at.s - (c->by_depth ? quadratic_at(&c->s, p) : p)));
        }
    c->height_remainder = 4.0 * worst_height + c->height_rounding;
    return 4.0 * worst;
}

/* After height_intervals: where a small W amplified rounding, points are inverted instead. */
static void settle_height(ray_curve *c, const triangle_frame *f, const ray_view *v, bool steep)
{
    if (steep || c->interval_count == 0) return;
    curve_point near = curve_at(c, 0.5 * (c->intervals[0].in + c->intervals[0].out));
    double amplified = c->barycentric_rounding;
    set_inversion_rounding(f, v, v3(near.b1, near.b2, near.s), c);
    c->refine = true;
    c->texel_remainder = texel_error(f, max_d(amplified, measure_remainder(c)));
    settle_intervals(c);
}

static void depth_intervals(ray_curve *c, const triangle_frame *f, double reach)
{
    /* With a remainder the first search is wide, and then the ends are moved to the exact curve. */
    double e = c->refine ? 1e-6 : c->barycentric_rounding;
    quadratic b0 = combine(c, 1.0, -1.0, -1.0), above = c->s, below = c->s;
    above.c[0] -= f->s0;
    for (int k = 0; k < 3; k++) below.c[k] = -below.c[k];
    below.c[0] += f->s1;
    double height_error = e * (f->size + fabs(f->s0) + fabs(f->s1)) + c->height_rounding;
    condition conditions[5] = {{b0, e}, {c->b1, e}, {c->b2, e}, {above, height_error}, {below, height_error}};
    find_intervals(c, conditions, 5, -reach, reach);
    if (!c->refine) return;
    double remainder = measure_remainder(c);
    c->texel_remainder = texel_error(f, remainder);
    /* So far off that a single Newton step is not enough. */
    if (!(remainder < 4e-7)) c->unreliable = true;
    if (!c->unreliable) settle_intervals(c);
}

/* Farthest depth, from the ray's point nearest to the centre, that the shell can reach. */
static double depth_reach(const triangle_frame *f)
{
    return 4.0 * (f->size + max_d(fabs(f->s0), fabs(f->s1)) *
                                max_d(v3_length(f->n[0]), max_d(v3_length(f->n[1]), v3_length(f->n[2]))));
}

static void make_texel_coordinates(const triangle_frame *f, ray_curve *c)
{
    c->x = combine(c, f->x[0], f->xe, f->xf);
    c->y = combine(c, f->y[0], f->ye, f->yf);
    double extent = fabs(f->xe) + fabs(f->xf) + fabs(f->ye) + fabs(f->yf);
    c->texel_rounding = f->texel_rounding + c->barycentric_rounding * extent;
}

static void sort_intervals(ray_curve *c)
{
    for (int i = 1; i < c->interval_count; i++) {
        curve_interval moving = c->intervals[i];
        int j = i;
        for (; j > 0 && c->intervals[j - 1].t_in > moving.t_in; j--) c->intervals[j] = c->intervals[j - 1];
        c->intervals[j] = moving;
    }
}

static double center_depth(const ray_view *v)
{
    return (v->p[0].z + v->p[1].z + v->p[2].z) / 3.0;
}

static void follow_by_depth(const triangle_frame *f, const ray_view *v, ray_curve *c)
{
    c->interval_count = 0;
    set_inversion_rounding(f, v, v3(c->b1.c[0], c->b2.c[0], c->s.c[0]), c);
    depth_intervals(c, f, depth_reach(f));
}

/* The ray's point nearest to the triangle's centre is inverted (a cubic's root, found by Newton in the
 * three unknowns); the sine of the ray against the offset plane through that point says whether the ray
 * grazes there. Returns false if the inverse cannot be trusted. */
static bool grazes_center(const triangle_frame *f, const ray_view *v, const knurl_ray *ray,
                          const ray_curve *c, ray_curve *depth, bool *grazes)
{
    *depth = *c;
    *grazes = false;
    vec3 middle = v3(1.0 / 3.0, 1.0 / 3.0, 0.5 * (f->s0 + f->s1));
    if (!depth_curve(f, v, ray, center_depth(v), middle, depth)) return false;
    double s = depth->s.c[0];
    double sine = fabs(quadratic_at(&c->w, s));
    vec3 ja = v3_mad(f->pe, s, f->ne), jb = v3_mad(f->pf, s, f->nf);
    if (sine > GRAZING_SINE * v3_length(v3_cross(ja, jb))) return true; /* parallel to a plane elsewhere */
    /* Far outside the height range Newton may have found another branch. */
    double margin = f->s1 - f->s0 + 0.1 * f->size;
    if (s < f->s0 - margin || s > f->s1 + margin) return false;
    *grazes = true;
    return true;
}

/* A ray that may graze. The sine changes along it, so that it may graze where it crosses the prism and
 * not near the centre: the stretches by height tell, and then the curve by depth is taken around them. */
static void follow_grazing(const triangle_frame *f, const ray_view *v, const knurl_ray *ray, double area,
                           ray_curve *c)
{
    ray_curve depth;
    bool grazes;
    if (!grazes_center(f, v, ray, c, &depth, &grazes)) {
        c->unreliable = true;
        return;
    }
    if (grazes) {
        *c = depth;
        follow_by_depth(f, v, c);
        return;
    }
    double w_least = height_intervals(c, f, v, area);
    if (w_least > GRAZING_SINE * area || c->interval_count == 0) {
        settle_height(c, f, v, w_least > STEEP_SINE * area);
        return;
    }
    sort_intervals(c);
    const curve_interval *first = &c->intervals[0], *last = &c->intervals[c->interval_count - 1];
    double t = 0.5 * (first->t_in + last->t_out);
    curve_point near = curve_at(c, 0.5 * (first->in + first->out));
    c->unreliable = !depth_curve(f, v, ray, t * v->length, v3(near.b1, near.b2, near.s), c);
    if (!c->unreliable) follow_by_depth(f, v, c);
}

bool ray_misses_prism(const triangle_frame *f, const knurl_ray *ray)
{
    ray_view v;
    view_make(f, ray, &v);
    quadratic q[3] = {side_quadratic(&v, 1, 2), side_quadratic(&v, 2, 0), side_quadratic(&v, 0, 1)}, w;
    for (int k = 0; k < 3; k++) w.c[k] = q[0].c[k] + q[1].c[k] + q[2].c[k];
    double b[3];
    quadratic_bernstein(&w, f->s0, f->s1, b);
    double lowest = min_d(b[0], min_d(b[1], b[2])), highest = max_d(b[0], max_d(b[1], b[2]));
    double graze = GRAZING_SINE * f->area, allowance = side_allowance(f, &v);
    /* Where W may be zero its sign says nothing. */
    if (!(lowest > graze || highest < -graze)) return false;
    double sign = lowest > 0.0 ? 1.0 : -1.0;
    for (int i = 0; i < 3; i++) {
        quadratic_bernstein(&q[i], f->s0, f->s1, b);
        if (max_d(sign * b[0], max_d(sign * b[1], sign * b[2])) < -allowance) return true;
    }
    return false;
}

void ray_curve_make(const triangle_frame *f, const knurl_ray *ray, ray_curve *c)
{
    ray_view v;
    view_make(f, ray, &v);
    c->interval_count = 0;
    c->by_depth = c->refine = c->unreliable = false;
    c->texel_remainder = c->height_remainder = c->height_rounding = 0.0;
    c->frame = f;
    c->origin = v3_sub(v3_load(ray->origin), f->base);
    c->direction = v3_load(ray->direction);
    for (int i = 0; i < 3; i++) {
        c->depth_p[i] = v.p[i].z / v.length;
        c->depth_n[i] = v.n[i].z / v.length;
    }
    if (f->flags & SHELL_CONSTANT_NORMAL) {
        c->unreliable = !depth_curve(f, &v, ray, center_depth(&v), v3(0.0, 0.0, 0.0), c);
        if (c->unreliable) return;
        follow_by_depth(f, &v, c);
    } else {
        quadratic q0 = side_quadratic(&v, 1, 2);
        c->b1 = side_quadratic(&v, 2, 0);
        c->b2 = side_quadratic(&v, 0, 1);
        for (int k = 0; k < 3; k++) c->w.c[k] = q0.c[k] + c->b1.c[k] + c->b2.c[k];
        double area = f->area;
        if (may_graze(c, f, GRAZING_SINE * area))
            follow_grazing(f, &v, ray, area, c);
        else
            settle_height(c, f, &v, height_intervals(c, f, &v, area) > STEEP_SINE * area);
        sort_intervals(c);
    }
    make_texel_coordinates(f, c);
}
