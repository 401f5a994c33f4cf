/* RMIP: Thonat, Georgiev, Beaune, Boubekeur: "RMIP: Displacement ray-tracing via inversion and oblong
 * bounding", SIGGRAPH Asia 2023. Algorithm 1 over the curve of shell/curve.h.
 *
 * What differs from the paper: the projected ray is explicit (a rational quadratic) where the paper
 * has it implicit (Eq. 3), so that turning points, crossings of texel lines and inversion at a known t
 * are roots of small polynomials of one parameter; the leaf is exact on S of Eq. 1, without
 * micro-triangles; and folded shells, which the paper leaves out, go to shell_subdivide(). */
#include "methods/method.h"
#include "shell/cell_box.h"
#include "shell/march.h"
#include "shell/pieces.h"

static const knurl_method_parameter PARAMETERS[] = {
    {"marching-scale", "texels; bounds at most this long are marched (section 4.4)", 6.0, 1.0, 4096.0, NULL,
     false},
    {"inversion", "tighten bounds by inverting box entry and exit (Algorithm 1, line 15)", 1.0, 0.0, 1.0,
     "off|on", false},
    {"bounds", "range structure; minmax covers a rectangle by up to 2 x 2 nodes of the mipmap", 1.0, 0.0, 1.0,
     "minmax|rmip", false},
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
    cell_boxes boxes;
    bound stack[STACK_SIZE];
    int top;
} traversal;

static bound make_bound(const ray_curve *c, double in, double out)
{
    curve_point a = curve_at(c, in), b = curve_at(c, out);
    return (bound){in, out, a.x, a.y, b.x, b.y, curve_depth(c, in), curve_depth(c, out)};
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
    box_span box = cell_box_clip(&t->boxes, x0, x1, y0, y1, h);
    *t_in = max_d(b->t_in, box.in);
    *t_out = min_d(b->t_out, box.out);
    return box.in <= box.out && *t_in <= *t_out + box.slack;
}

/* For triangles without area in texture space, whose rectangles have no box: culled by height. */
static bool clears_rectangle(const traversal *t, const bound *b)
{
    const ray_curve *c = t->walk.curve;
    double pad = c->texel_rounding + c->texel_remainder;
    knurl_range h = shell_height_range(t->walk.space, t->walk.lod, t->parameters->bounds, t->walk.frame,
                                       min_d(b->x_in, b->x_out) - pad, min_d(b->y_in, b->y_out) - pad,
                                       max_d(b->x_in, b->x_out) + pad, max_d(b->y_in, b->y_out) + pad);
    return shell_curve_clears(&t->walk, b->in, b->out, h);
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

/* Line 16: halves the longer side of the rectangle, back half pushed first. False if it is as short as
 * the parameter's last bits, so that no half would be shorter. */
static bool split(traversal *t, const bound *b)
{
    const ray_curve *c = t->walk.curve;
    bool along_x = fabs(b->x_out - b->x_in) >= fabs(b->y_out - b->y_in);
    double k = along_x ? 0.5 * (b->x_in + b->x_out) : 0.5 * (b->y_in + b->y_out);
    double middle = curve_cross(c, along_x ? &c->x : &c->y, k, b->in, b->out);
    if (!(middle > min_d(b->in, b->out) && middle < max_d(b->in, b->out))) return false;
    curve_point at = curve_at(c, middle);
    double depth = curve_depth(c, middle);
    bound front = *b, back = *b;
    front.out = back.in = middle;
    front.x_out = back.x_in = at.x;
    front.y_out = back.y_in = at.y;
    front.t_out = back.t_in = depth;
    t->stack[t->top++] = back;
    t->stack[t->top++] = front;
    return true;
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
        if (!invertible) {
            if (clears_rectangle(t, &b)) continue;
        } else {
            double t_in, t_out;
            if (!clip_to_box(t, &b, &t_in, &t_out)) continue;
            if (t_out < ray->tmin - slack || t_in > ray->tmax + slack) continue;
            if (t->parameters->inversion) b = reduce(c, &b, t_in, t_out);
        }
        if (!split(t, &b) && shell_march(&t->walk, b.in, b.out)) return true;
    }
    return false;
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
    t.top = 0;
    cell_boxes_make(q->frame, q->ray, &t.boxes);
    bool found = false;
    for (int i = 0; i < curve.interval_count && !found; i++) {
        curve_interval stretch = curve.intervals[i];
        if (!curve_clip_to_ray(&curve, q->ray, &stretch)) continue;
        t.walk.stretch = &curve.intervals[i];
        double cuts[6];
        int n = curve_split_at_turns(&curve, stretch.in, stretch.out, cuts);
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
    .needs = HEIGHT_NEED_RMIP,
    .parameters = PARAMETERS,
    .build = rmip_build,
    .intersect = rmip_intersect,
};
