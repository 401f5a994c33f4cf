/* RMIP: Thonat, Georgiev, Beaune, Boubekeur: "RMIP: Displacement ray-tracing via inversion and oblong
 * bounding", SIGGRAPH Asia 2023. Algorithm 1 over the curve of shell/curve.h.
 *
 * What differs from the paper: the projected ray is explicit (a rational quadratic) where the paper
 * has it implicit (Eq. 3), so that turning points, crossings of texel lines and inversion at a known t
 * are roots of small polynomials of one parameter; the leaf is exact on S of Eq. 1, without
 * micro-triangles; and folded shells, which the paper leaves out, go to shell_subdivide(). */
#include "methods/method.h"
#include "shell/march.h"

#include <float.h>

static const knurl_method_parameter PARAMETERS[] = {
    {"marching-scale", "texels; bounds at most this long are marched (section 4.4)", 6.0, 1.0, 4096.0, NULL},
    {"inversion", "tighten bounds by inverting box entry and exit (Algorithm 1, line 15)", 1.0, 0.0, 1.0,
     "off|on"},
    {"bounds", "range structure; minmax covers a rectangle by up to 2 x 2 nodes of the mipmap", 1.0, 0.0, 1.0,
     "minmax|rmip"},
    {0}};

typedef struct rmip_parameters {
    double marching_scale;
    bool inversion;
    knurl_bounds_kind bounds;
} rmip_parameters;

static knurl_status rmip_build(const shell_space *space, const double *values, void **data,
                               knurl_error *error)
{
    rmip_parameters *p = knurl_alloc_zero(space->context, sizeof *p);
    *data = p;
    if (!p) return knurl_fail_memory(error, sizeof *p, "method rmip");
    *p = (rmip_parameters){values[0], values[1] != 0.0,
                           values[2] != 0.0 ? KNURL_BOUNDS_RMIP : KNURL_BOUNDS_MINMAX};
    return KNURL_OK;
}

static void rmip_destroy(const shell_space *space, void *data)
{
    knurl_free(space->context, data);
}

static uint64_t rmip_bytes(const void *data)
{
    return data ? sizeof(rmip_parameters) : 0;
}

/* A 2D bound: the rectangle spanned by the curve's points at `in` and `out`, between which x and y
 * are monotone (section 4.2). */
typedef struct bound {
    double in, out;
    double x_in, y_in, x_out, y_out;
    double t_in, t_out;
} bound;

enum { STACK_SIZE = 160 };

typedef struct traversal {
    const rmip_parameters *parameters;
    shell_walk walk;
    vec3 origin, inverse; /* ray relative to vertex 0, reciprocal direction */
    vec3 px, py, nx, ny;  /* derivatives of P and N along texel coordinates x and y */
    double box_rounding;
    bound stack[STACK_SIZE];
    int top;
} traversal;

static bound make_bound(const ray_curve *c, double in, double out)
{
    curve_point a = curve_at(c, in), b = curve_at(c, out);
    return (bound){in, out, a.x, a.y, b.x, b.y, curve_depth(c, in), curve_depth(c, out)};
}

static double reciprocal(double x)
{
    return 1.0 / (fabs(x) < 1e-300 ? copysign(1e-300, x) : x);
}

static void traversal_start(traversal *t)
{
    const triangle_frame *f = t->walk.frame;
    const knurl_ray *ray = t->walk.ray;
    const double *m = f->inverse_uv;
    t->top = 0;
    t->origin = v3_sub(v3_load(ray->origin), f->base);
    t->inverse =
        v3(reciprocal(ray->direction[0]), reciprocal(ray->direction[1]), reciprocal(ray->direction[2]));
    t->px = v3_mad(v3_scale(f->pe, m[0]), m[2], f->pf);
    t->py = v3_mad(v3_scale(f->pe, m[1]), m[3], f->pf);
    t->nx = v3_mad(v3_scale(f->ne, m[0]), m[2], f->nf);
    t->ny = v3_mad(v3_scale(f->ne, m[1]), m[3], f->nf);
    double s = max_d(fabs(f->s0), fabs(f->s1));
    t->box_rounding = 1e-12 * (f->size + s) + 16.0 * DBL_EPSILON * v3_max_component(v3_abs(t->origin));
}

/* Range of s = h / |N| over the rectangle with centre (b1, b2) and N there; |N|^2 is convex, so it is
 * bounded below by its tangent plane and above by adding the square of N's movement. */
static void height_over_normal(const traversal *t, vec3 n, double rx, double ry, knurl_range h, double *s0,
                               double *s1)
{
    *s0 = h.min;
    *s1 = h.max;
    if (t->walk.frame->unnormalised) return;
    double square = v3_dot(n, n);
    double drift = 2.0 * (fabs(v3_dot(n, t->nx)) * rx + fabs(v3_dot(n, t->ny)) * ry);
    double move = v3_length(t->nx) * rx + v3_length(t->ny) * ry;
    double floor_square = max_d(square - drift, 0.0), lowest = sqrt(square) - move;
    double low = sqrt(max_d(floor_square, lowest > 0.0 ? lowest * lowest : 0.0)) * (1.0 - 1e-15);
    double high = sqrt(square + drift + move * move) * (1.0 + 1e-15);
    low = max_d(low, 1e-3);
    *s0 = h.min < 0.0 ? h.min / low : h.min / high;
    *s1 = h.max > 0.0 ? h.max / low : h.max / high;
}

/* Line 12 and 13 of Algorithm 1: the 3D box of the surface over the rectangle, by range arithmetic
 * around its centre, against the ray. Narrows [t_in, t_out]; false if the ray misses the box. */
static bool clip_to_box(const traversal *t, const bound *b, double *t_in, double *t_out)
{
    const triangle_frame *f = t->walk.frame;
    double pad = t->walk.curve->texel_rounding + t->walk.curve->texel_remainder;
    double x0 = min_d(b->x_in, b->x_out) - pad, x1 = max_d(b->x_in, b->x_out) + pad;
    double y0 = min_d(b->y_in, b->y_out) - pad, y1 = max_d(b->y_in, b->y_out) + pad;
    knurl_range h = shell_height_range(t->walk.space, t->walk.lod, t->parameters->bounds, f, x0, y0, x1, y1);
    double cx = 0.5 * (x0 + x1) - f->x[0], cy = 0.5 * (y0 + y1) - f->y[0], rx = 0.5 * (x1 - x0),
           ry = 0.5 * (y1 - y0);
    vec3 n = v3_mad(v3_mad(f->n[0], cx, t->nx), cy, t->ny), p = v3_mad(v3_scale(t->px, cx), cy, t->py);
    double s0, s1;
    height_over_normal(t, n, rx, ry, h, &s0, &s1);
    double sc = 0.5 * (s0 + s1), sr = 0.5 * (s1 - s0);
    vec3 center = v3_mad(p, sc, n);
    vec3 half = v3_scale(v3_abs(v3_mad(t->px, sc, t->nx)), rx);
    half = v3_mad(half, ry, v3_abs(v3_mad(t->py, sc, t->ny)));
    half = v3_mad(half, sr, v3_mad(v3_mad(v3_abs(n), rx, v3_abs(t->nx)), ry, v3_abs(t->ny)));
    half = v3_add(half, v3(t->box_rounding, t->box_rounding, t->box_rounding));
    vec3 to = v3_sub(center, t->origin);
    vec3 a = v3_mul(v3_sub(to, half), t->inverse), c = v3_mul(v3_add(to, half), t->inverse);
    vec3 near = v3_min(a, c), far = v3_max(a, c);
    double in = max_d(near.x, max_d(near.y, near.z)), out = min_d(far.x, min_d(far.y, far.z));
    double slack = 1e-14 * (fabs(in) + fabs(out));
    *t_in = max_d(b->t_in, in - slack);
    *t_out = min_d(b->t_out, out + slack);
    return in - slack <= out + slack && *t_in <= *t_out + slack;
}

/* Line 15: the part of the bound between two inverted points (section 4.3). The inversion is along
 * the curve, which lies inside the prism, so it cannot find a wrong branch. */
static bound reduce(const ray_curve *c, const bound *b, double t_in, double t_out)
{
    double span = b->t_out - b->t_in, slack = 1e-9 * span;
    double in = t_in > b->t_in + 0.05 * span ? curve_invert(c, b->in, b->out, t_in - slack) : b->in;
    double out = t_out < b->t_out - 0.05 * span ? curve_invert(c, b->in, b->out, t_out + slack) : b->out;
    if (in == b->in && out == b->out) return *b;
    return make_bound(c, in, out);
}

/* Line 16: halves the longer side of the rectangle, back half pushed first. */
static void split(traversal *t, const bound *b)
{
    const ray_curve *c = t->walk.curve;
    bool along_x = fabs(b->x_out - b->x_in) >= fabs(b->y_out - b->y_in);
    double k = along_x ? 0.5 * (b->x_in + b->x_out) : 0.5 * (b->y_in + b->y_out);
    double middle = curve_cross(c, along_x ? &c->x : &c->y, k, b->in, b->out);
    curve_point at = curve_at(c, middle);
    double depth = curve_depth(c, middle);
    bound front = *b, back = *b;
    front.out = back.in = middle;
    front.x_out = back.x_in = at.x;
    front.y_out = back.y_in = at.y;
    front.t_out = back.t_in = depth;
    t->stack[t->top++] = back;
    t->stack[t->top++] = front;
}

/* Lines 4 and 5: turning points cut a stretch into pieces where x and y are monotone. */
static int split_at_turns(const ray_curve *c, double in, double out, double cuts[6])
{
    double turns[4];
    int count = curve_turning_points(c, &c->x, in, out, turns);
    count += curve_turning_points(c, &c->y, in, out, turns + count);
    double direction = out >= in ? 1.0 : -1.0;
    for (int i = 1; i < count; i++)
        for (int j = i; j > 0 && (turns[j] - turns[j - 1]) * direction < 0.0; j--) {
            double swap = turns[j];
            turns[j] = turns[j - 1];
            turns[j - 1] = swap;
        }
    int n = 0;
    cuts[n++] = in;
    for (int i = 0; i < count; i++) cuts[n++] = turns[i];
    cuts[n++] = out;
    return n;
}

/* The while loop of Algorithm 1. */
static bool traverse(traversal *t)
{
    const ray_curve *c = t->walk.curve;
    const knurl_ray *ray = t->walk.ray;
    bool invertible = !(t->walk.frame->flags & SHELL_FLAT_UV);
    while (t->top > 0) {
        bound b = t->stack[--t->top];
        double slack = 1e-12 * (fabs(b.t_in) + fabs(b.t_out));
        if (b.t_out < ray->tmin - slack || b.t_in > ray->tmax + slack) continue;
        double longest = max_d(fabs(b.x_out - b.x_in), fabs(b.y_out - b.y_in));
        if (longest <= t->parameters->marching_scale || t->top + 2 > STACK_SIZE) {
            if (shell_march(&t->walk, b.in, b.out)) return true;
            continue;
        }
        t->walk.steps++;
        if (invertible) {
            double t_in, t_out;
            if (!clip_to_box(t, &b, &t_in, &t_out)) continue;
            if (t_out < ray->tmin - slack || t_in > ray->tmax + slack) continue;
            if (t->parameters->inversion) b = reduce(c, &b, t_in, t_out);
        }
        split(t, &b);
    }
    return false;
}

/* Narrows a stretch to the ray's [tmin, tmax], a little wider than that; false if nothing is left. */
static bool clip_to_ray(const ray_curve *c, const knurl_ray *ray, curve_interval *i)
{
    double slack = 1e-12 * (fabs(i->t_in) + fabs(i->t_out)) + 1e-9 * (i->t_out - i->t_in);
    if (i->t_out < ray->tmin - slack || i->t_in > ray->tmax + slack) return false;
    double in = i->in, out = i->out;
    if (ray->tmin > i->t_in) i->in = curve_invert(c, in, out, ray->tmin - slack);
    if (ray->tmax < i->t_out) i->out = curve_invert(c, in, out, ray->tmax + slack);
    return true;
}

static bool rmip_intersect(const void *data, const method_query *q)
{
    const rmip_parameters *parameters = data;
    ray_curve curve;
    if (!(q->frame->flags & SHELL_FOLDED)) ray_curve_make(q->frame, q->ray, &curve);
    if (q->frame->flags & SHELL_FOLDED || curve.unreliable)
        return shell_subdivide(q->space, q->lod, parameters->bounds, q->frame, q->ray, q->any, q->root,
                               q->steps);
    if (curve.interval_count == 0) return false;
    traversal t;
    t.parameters = parameters;
    t.walk =
        (shell_walk){.space = q->space, .lod = q->lod, .frame = q->frame, .curve = &curve, .ray = q->ray};
    traversal_start(&t);
    bool found = false;
    for (int i = 0; i < curve.interval_count && !found; i++) {
        curve_interval stretch = curve.intervals[i];
        if (!clip_to_ray(&curve, q->ray, &stretch)) continue;
        t.walk.stretch = &curve.intervals[i];
        double cuts[6];
        int n = split_at_turns(&curve, stretch.in, stretch.out, cuts);
        for (int k = n - 2; k >= 0; k--) t.stack[t.top++] = make_bound(&curve, cuts[k], cuts[k + 1]);
        found = traverse(&t);
    }
    *q->steps += t.walk.steps;
    if (found) *q->root = t.walk.root;
    return found;
}

const method method_rmip = {
    .name = "rmip",
    .summary = "inversion and oblong bounds (Thonat et al. 2023); exact",
    .flags = KNURL_METHOD_EXACT,
    .parameters = PARAMETERS,
    .build = rmip_build,
    .intersect = rmip_intersect,
    .bytes = rmip_bytes,
    .destroy = rmip_destroy,
};
