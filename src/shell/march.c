/* Texel marching with an exact leaf; see march.h.
 *
 * Watertightness inside a shell: g is continuous along the curve, and its value where the curve
 * leaves a texel is carried into the next one instead of being evaluated again from the other side,
 * so that a change of sign cannot fall between two texels. A texel is skipped without evaluating g
 * only if g keeps one sign over it by more than the rounding of any evaluation on its border. */
#include "shell/march.h"

typedef struct sample {
    double p, g;
} sample;

/* What g needs in one cell. */
typedef struct cell_function {
    const shell_walk *walk;
    height_patch patch;
    double rounding; /* bound on the error of g */
} cell_function;

static double g_at(const cell_function *f, double p)
{
    curve_point at = curve_at(f->walk->curve, p);
    return at.s * frame_normal_scale(f->walk->frame, at.b1, at.b2) - height_patch_at(&f->patch, at.x, at.y);
}

/* Polishes the root at parameter p and takes it if its t is in the ray's range. */
static bool accept(shell_walk *walk, const cell_function *f, double p)
{
    curve_point at = curve_at(walk->curve, p);
    shell_root root = {curve_depth(walk->curve, p), at.b1, at.b2, at.x, at.y, f->patch};
    shell_root_polish(walk->frame, walk->ray, &root);
    if (!(root.t >= walk->ray->tmin && root.t <= walk->ray->tmax)) return false;
    walk->root = root;
    return true;
}

/* Root of a bracketed, monotone stretch: the Illinois variant of the secant method. */
static double bracketed_root(const cell_function *f, sample a, sample b)
{
    if (a.g == 0.0) return a.p;
    if (b.g == 0.0) return b.p;
    double fa = a.g, fb = b.g;
    int side = 0;
    for (int i = 0; i < 80; i++) {
        double p = (a.p * fb - b.p * fa) / (fb - fa);
        if (!(p > min_d(a.p, b.p) && p < max_d(a.p, b.p))) p = 0.5 * (a.p + b.p);
        double g = g_at(f, p);
        if (g == 0.0 || fabs(b.p - a.p) <= 4.0 * DBL_EPSILON * fabs(p) || p == a.p || p == b.p) return p;
        if ((g < 0.0) == (fb < 0.0)) {
            if (fabs(g) <= 1e-3 * f->rounding) return p;
            b = (sample){p, g};
            fb = g;
            if (side == 1) fa *= 0.5;
            side = 1;
        } else {
            if (fabs(g) <= 1e-3 * f->rounding) return p;
            a = (sample){p, g};
            fa = g;
            if (side == -1) fb *= 0.5;
            side = -1;
        }
    }
    return 0.5 * (a.p + b.p);
}

typedef enum verdict { NO_ROOT, ONE_ROOT, UNDECIDED } verdict;

/* What the cubic through g at 0, 1/3, 2/3, 1 says of [a, b], with the third difference as allowance
 * for what is not cubic (it falls by 8 with each halving, the remainder by 16). */
static verdict judge(sample a, double g1, double g2, sample b)
{
    double c0 = a.g, c3 = b.g;
    double c1 = (-5.0 * c0 + 18.0 * g1 - 9.0 * g2 + 2.0 * c3) / 6.0;
    double c2 = (2.0 * c0 - 9.0 * g1 + 18.0 * g2 - 5.0 * c3) / 6.0;
    double margin = 0.25 * fabs(c3 - 3.0 * g2 + 3.0 * g1 - c0);
    double least = min_d(min_d(c0, c1), min_d(c2, c3)), most = max_d(max_d(c0, c1), max_d(c2, c3));
    if (least > margin || most < -margin) return NO_ROOT;
    double d0 = c1 - c0, d1 = c2 - c1, d2 = c3 - c2;
    bool rising = min_d(d0, min_d(d1, d2)) > margin, falling = max_d(d0, max_d(d1, d2)) < -margin;
    if (rising || falling) return (c0 <= 0.0) != (c3 <= 0.0) || c0 == 0.0 || c3 == 0.0 ? ONE_ROOT : NO_ROOT;
    return UNDECIDED;
}

enum { LEAF_DEPTH = 26 };

/* At the depth limit the stretch is 1e-8 of a texel: a sign change is a root, and equal signs are a
 * touch only if g is zero within rounding. */
static bool last_resort(shell_walk *walk, const cell_function *f, sample a, sample b)
{
    if ((a.g <= 0.0) != (b.g <= 0.0)) return accept(walk, f, bracketed_root(f, a, b));
    double middle = 0.5 * (a.p + b.p);
    if (fabs(g_at(f, middle)) <= f->rounding) return accept(walk, f, middle);
    return false;
}

/* First acceptable root in [a, b]: isolates by halving, front half first. */
static bool leaf(shell_walk *walk, const cell_function *f, sample a, sample b)
{
    struct {
        sample a, b;
        int depth;
    } stack[LEAF_DEPTH + 2];
    int top = 0;
    stack[top].a = a;
    stack[top].b = b;
    stack[top++].depth = 0;
    while (top > 0) {
        top--;
        a = stack[top].a;
        b = stack[top].b;
        int depth = stack[top].depth;
        double third = (b.p - a.p) / 3.0;
        double g1 = g_at(f, a.p + third), g2 = g_at(f, b.p - third);
        verdict found = judge(a, g1, g2, b);
        if (found == NO_ROOT) continue;
        if (found == ONE_ROOT) {
            if (accept(walk, f, bracketed_root(f, a, b))) return true;
            continue;
        }
        /* The ray runs in the surface: halves would look the same, down to the last of 2^26. */
        if (max_d(max_d(fabs(a.g), fabs(b.g)), max_d(fabs(g1), fabs(g2))) <= f->rounding) {
            if (accept(walk, f, a.p) || accept(walk, f, 0.5 * (a.p + b.p)) || accept(walk, f, b.p))
                return true;
            continue;
        }
        if (depth == LEAF_DEPTH || a.p == b.p) {
            if (last_resort(walk, f, a, b)) return true;
            continue;
        }
        sample middle = {0.5 * (a.p + b.p), 0.0};
        middle.g = g_at(f, middle.p);
        stack[top].a = middle;
        stack[top].b = b;
        stack[top++].depth = depth + 1;
        stack[top].a = a;
        stack[top].b = middle;
        stack[top++].depth = depth + 1;
    }
    return false;
}

/* Lines of one level across one axis. Line k stands at (k - offset) / scale in the frame's texels. */
typedef struct line_family {
    const quadratic *coordinate;
    double offset, scale;
    double step;     /* +1, -1, or 0: the curve does not move along this axis */
    double line;     /* next line's number */
    double last;     /* position where the stretch ends */
    double crossing; /* parameter of the next line, or `out` if it lies beyond */
    bool more;
} line_family;

static void next_crossing(line_family *l, const ray_curve *curve, double from, double out)
{
    double position = (l->line - l->offset) / l->scale;
    l->more = l->step != 0.0 && (l->step > 0.0 ? position < l->last : position > l->last);
    l->crossing = l->more ? curve_cross(curve, l->coordinate, position, from, out) : out;
}

/* Returns the cell the stretch starts in: the one it is about to move through. */
static double start_family(line_family *l, const ray_curve *curve, const quadratic *coordinate, double scale,
                           double offset, double first, double last, double in, double out)
{
    *l = (line_family){.coordinate = coordinate, .offset = offset, .scale = scale, .last = last};
    double position = first * scale + offset, cell = floor_d(position);
    l->step = last > first ? 1.0 : last < first ? -1.0 : 0.0;
    l->line = cell + 1.0;
    if (l->step < 0.0) {
        cell = ceil_d(position) - 1.0;
        l->line = cell;
    }
    next_crossing(l, curve, in, out);
    return cell;
}

/* Range of |N| along a stretch: |N| at its start, plus or minus how far N can move. */
static void normal_range(const shell_walk *walk, const curve_point *in, const curve_point *out,
                         double range[2])
{
    const triangle_frame *f = walk->frame;
    range[0] = range[1] = 1.0;
    if (f->unnormalised) return;
    double at = frame_normal_scale(f, in->b1, in->b2);
    /* x and y are monotone along the stretch, so b stays in the box of the two ends when the map from
     * (x, y) to b is linear; without one (flat uv) the whole triangle bounds N. */
    double move = v3_length(f->ne) + v3_length(f->nf);
    if (!(f->flags & SHELL_FLAT_UV)) {
        double pad = 2.0 * (walk->curve->texel_remainder + walk->curve->texel_rounding);
        double dx = fabs(out->x - in->x) + pad, dy = fabs(out->y - in->y) + pad;
        double db1 = fabs(f->inverse_uv[0]) * dx + fabs(f->inverse_uv[1]) * dy;
        double db2 = fabs(f->inverse_uv[2]) * dx + fabs(f->inverse_uv[3]) * dy;
        move = min_d(move, v3_length(f->ne) * db1 + v3_length(f->nf) * db2);
    }
    range[0] = max_d(at - move, 0.0);
    range[1] = at + move;
}

/* Range of s over [a, b] of the curve. */
static void height_span(const ray_curve *c, double a, double b, double span[2])
{
    double sa = a, sb = b, bow = 0.0;
    if (c->by_depth) {
        sa = quadratic_at(&c->s, a);
        sb = quadratic_at(&c->s, b);
        bow = 0.25 * fabs(c->s.c[2]) * (b - a) * (b - a);
    }
    span[0] = min_d(sa, sb) - bow - c->height_remainder;
    span[1] = max_d(sa, sb) + bow + c->height_remainder;
}

typedef struct march_state {
    shell_walk *walk;
    line_family lines[4]; /* x and y of level[0], x and y of level[1] */
    double cell[4];
    int families;
    double normal[2];
    double rounding; /* the part of g's that is the same for all texels */
    double in, out;
    double carried; /* g at the current parameter, if have_carried */
    bool have_carried;
} march_state;

/* Whether s |N| stays outside [min, max] over [a, b] of the curve. */
static bool clears(const ray_curve *c, const double normal[2], double a, double b, double min, double max)
{
    double span[2];
    height_span(c, a, b, span);
    double z0 = span[0] * (span[0] < 0.0 ? normal[1] : normal[0]);
    double z1 = span[1] * (span[1] > 0.0 ? normal[1] : normal[0]);
    return z0 > max || z1 < min;
}

/* Bound on the error of g, without what depends on the texel. */
static double fixed_rounding(const shell_walk *walk)
{
    const triangle_frame *f = walk->frame;
    double s = max_d(fabs(f->s0), fabs(f->s1));
    double normals = f->unnormalised ? 0.0
                                     : walk->curve->barycentric_rounding * s *
                                           (fabs(f->ne.x) + fabs(f->ne.y) + fabs(f->ne.z) + fabs(f->nf.x) +
                                            fabs(f->nf.y) + fabs(f->nf.z));
    return normals + walk->curve->height_rounding + 32.0 * DBL_EPSILON * s;
}

/* What is added where |h| <= `height` and |h_x| + |h_y| <= `slope`. */
static double texel_rounding(const shell_walk *walk, double slope, double height)
{
    return slope * walk->curve->texel_rounding + 32.0 * DBL_EPSILON * height;
}

/* Whether the surface touches the ray at an end of the march within rounding, where what comes next may
 * see the other sign. At a side of the prism this may be anywhere in the zone that the side lies in. If g
 * keeps its sign there it is nearest to zero at one of the zone's ends. */
static bool touches_end(march_state *m, const cell_function *f, sample end, bool first)
{
    if (fabs(end.g) <= f->rounding) return accept(m->walk, f, end.p);
    const curve_interval *s = m->walk->stretch;
    if (end.p != (first ? s->in : s->out)) return false;
    double zone = curve_end_zone(m->walk->curve, s, first);
    return zone != 0.0 && fabs(g_at(f, end.p + zone)) <= f->rounding && accept(m->walk, f, end.p + zone);
}

/* One texel from parameter a to b. */
static bool visit(march_state *m, double a, double b)
{
    cell_function f = {.walk = m->walk};
    height_patch_load(m->walk->space, m->walk->lod, m->walk->frame, (int64_t)m->cell[0], (int64_t)m->cell[1],
                      m->families > 2 ? (int64_t)m->cell[2] : 0, m->families > 2 ? (int64_t)m->cell[3] : 0,
                      &f.patch);
    f.rounding =
        m->rounding + texel_rounding(m->walk, f.patch.slope, max_d(fabs(f.patch.min), fabs(f.patch.max)));
    m->walk->steps++;
    if (clears(m->walk->curve, m->normal, a, b, f.patch.min - 2.0 * f.rounding,
               f.patch.max + 2.0 * f.rounding)) {
        m->have_carried = false;
        return false;
    }
    sample start = {a, m->have_carried ? m->carried : g_at(&f, a)};
    sample end = {b, g_at(&f, b)};
    if (a == m->in && touches_end(m, &f, start, true)) return true;
    if (a != b && leaf(m->walk, &f, start, end)) return true;
    if (a == b && (start.g <= 0.0) != (end.g <= 0.0) && accept(m->walk, &f, a)) return true;
    if (b == m->out && touches_end(m, &f, end, false)) return true;
    m->carried = end.g;
    m->have_carried = true;
    return false;
}

static void start_march(march_state *m, shell_walk *walk, double in, double out)
{
    const height_lod *lod = walk->lod;
    const triangle_frame *f = walk->frame;
    const ray_curve *c = walk->curve;
    curve_point first = curve_at(c, in), last = curve_at(c, out);
    *m = (march_state){.walk = walk, .families = lod->blend > 0.0 ? 4 : 2, .in = in, .out = out};
    m->cell[0] = start_family(&m->lines[0], c, &c->x, 1.0, 0.0, first.x, last.x, in, out);
    m->cell[1] = start_family(&m->lines[1], c, &c->y, 1.0, 0.0, first.y, last.y, in, out);
    if (m->families > 2) {
        double rx = lod->ratio[0], ry = lod->ratio[1];
        double ox = ((double)f->origin_x + 0.5) * rx - 0.5, oy = ((double)f->origin_y + 0.5) * ry - 0.5;
        m->cell[2] = start_family(&m->lines[2], c, &c->x, rx, ox, first.x, last.x, in, out);
        m->cell[3] = start_family(&m->lines[3], c, &c->y, ry, oy, first.y, last.y, in, out);
    }
    normal_range(walk, &first, &last, m->normal);
    m->rounding = fixed_rounding(walk);
}

bool shell_march(shell_walk *walk, double in, double out)
{
    march_state m;
    start_march(&m, walk, in, out);
    double direction = out >= in ? 1.0 : -1.0, at = in;
    for (;;) {
        int next = -1;
        double to = out;
        for (int i = 0; i < m.families; i++)
            if (m.lines[i].more && (next < 0 || (m.lines[i].crossing - to) * direction < 0.0)) {
                to = m.lines[i].crossing;
                next = i;
            }
        /* Crossings found one by one may fall back by rounding: the walk never does. */
        if ((to - at) * direction < 0.0) to = at;
        if (visit(&m, at, to)) return true;
        if (next < 0) return false;
        at = to;
        m.cell[next] += m.lines[next].step;
        m.lines[next].line += m.lines[next].step;
        next_crossing(&m.lines[next], walk->curve, at, out);
    }
}

bool shell_curve_clears(const shell_walk *walk, double in, double out, knurl_range h)
{
    curve_point first = curve_at(walk->curve, in), last = curve_at(walk->curve, out);
    double normal[2];
    normal_range(walk, &first, &last, normal);
    double pad =
        2.0 * (fixed_rounding(walk) + texel_rounding(walk, h.max - h.min, max_d(fabs(h.min), fabs(h.max))));
    return clears(walk->curve, normal, in, out, h.min - pad, h.max + pad);
}
