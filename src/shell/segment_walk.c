/* Cell by cell along a segment; see segment_walk.h. */
#include "shell/segment_walk.h"

#include <float.h>

double segment_sample(segment_walk *w, double f, segment_point *point, height_patch *patch)
{
    *point = segment_at(w->segment, f);
    height_patch_find(w->space, w->lod, w->frame, point->x, point->y, patch);
    w->steps++;
    return point->h - height_patch_at(patch, point->x, point->y);
}

static bool accept_on(segment_walk *w, double f, const height_patch *patch)
{
    segment_point p = segment_at(w->segment, f);
    shell_root root = {p.t, p.b1, p.b2, p.x, p.y, *patch};
    if (w->segments->exact) shell_root_polish(w->frame, w->ray, &root);
    if (!(root.t >= w->ray->tmin && root.t <= w->ray->tmax)) return false;
    w->root = root;
    return true;
}

bool segment_accept(segment_walk *w, double f)
{
    segment_point p = segment_at(w->segment, f);
    shell_root root = {.t = p.t, .b1 = p.b1, .b2 = p.b2, .x = p.x, .y = p.y};
    if (!(root.t >= w->ray->tmin && root.t <= w->ray->tmax)) return false;
    height_patch_find(w->space, w->lod, w->frame, p.x, p.y, &root.patch);
    w->root = root;
    return true;
}

/* g times a positive factor over one cell, as a cubic of u, the share of the distance run there: c[0] is g at
 * its start, the value at 1 is `ratio` times g at its end. */
typedef struct cell_cubic {
    double c[4];
    double ratio;
} cell_cubic;

static double cubic_at(const cell_cubic *q, double u)
{
    return q->c[0] + u * (q->c[1] + u * (q->c[2] + u * q->c[3]));
}

/* Between points a and b, h = (ha D + (hb - ha) u r) / D with D = 1 + u (r - 1) and r the ratio of the
 * weights (segment.h); the map is a quadratic of u. */
static cell_cubic make_cubic(const height_patch *p, const segment_point *a, const segment_point *b)
{
    double x = a->x - p->x, y = a->y - p->y, dx = b->x - a->x, dy = b->y - a->y;
    double m0 = p->c + p->cx * x + y * (p->cy + p->cxy * x);
    double m1 = p->cx * dx + p->cy * dy + p->cxy * (x * dy + y * dx), m2 = p->cxy * dx * dy;
    double r = a->weight / b->weight, e = r - 1.0, g0 = a->h - m0;
    return (cell_cubic){{g0, g0 * e + (b->h - a->h) * r - m1, -m2 - m1 * e, -m2 * e}, r};
}

/* Root in [a, b] where the cubic is monotone and fa, fb have different signs: Illinois. */
static double bracketed_root(const cell_cubic *q, double a, double fa, double b, double fb)
{
    int side = 0;
    for (int i = 0; i < 80 && b - a > DBL_EPSILON; i++) {
        double u = (a * fb - b * fa) / (fb - fa);
        if (!(u > a && u < b)) u = 0.5 * (a + b);
        double value = cubic_at(q, u);
        if (value == 0.0 || u == a || u == b) return u;
        if ((value < 0.0) == (fb < 0.0)) {
            b = u;
            fb = value;
            if (side == 1) fa *= 0.5;
            side = 1;
        } else {
            a = u;
            fa = value;
            if (side == -1) fb *= 0.5;
            side = -1;
        }
    }
    return 0.5 * (a + b);
}

/* The same for a quadratic, in closed form. At the start of a cell the sign may be that of its neighbour, so
 * that the root of this one lies a little outside. */
static double quadratic_root(const cell_cubic *q, double a, double fa, double b, double fb)
{
    quadratic p = {{q->c[0], q->c[1], q->c[2]}};
    double roots[2], best = 0.5 * (a + b), away = INFINITY;
    int count = quadratic_roots(&p, roots);
    for (int i = 0; i < count; i++) {
        double d = max_d(max_d(a - roots[i], roots[i] - b), 0.0);
        if (d < away) {
            away = d;
            best = roots[i];
        }
    }
    return away <= 1e-9 ? min_d(max_d(best, a), b) : bracketed_root(q, a, fa, b, fb);
}

/* Where the cubic turns, strictly inside (0, 1), in order. */
static int turning_points(const cell_cubic *q, double turns[2])
{
    quadratic slope = {{q->c[1], 2.0 * q->c[2], 3.0 * q->c[3]}};
    double roots[2];
    int found = quadratic_roots(&slope, roots), count = 0;
    for (int i = 0; i < found; i++)
        if (roots[i] > 0.0 && roots[i] < 1.0) turns[count++] = roots[i];
    if (count == 2 && turns[0] > turns[1]) {
        double first = turns[0];
        turns[0] = turns[1];
        turns[1] = first;
    }
    return count;
}

typedef struct cell {
    double from, to; /* fractions */
    segment_point a, b;
    height_patch patch;
    double rounding; /* bound on the error of g */
} cell;

/* Takes the root at share u of the cell. */
static bool accept_share(segment_walk *w, const cell *k, double u)
{
    double d = k->b.weight + u * (k->a.weight - k->b.weight);
    return accept_on(w, k->from + (k->to - k->from) * (u * k->a.weight / d), &k->patch);
}

/* Roots of the cell in order, with g at both ends as its neighbours see it. A turning point that is zero
 * within rounding is a touch. */
static bool cell_roots(segment_walk *w, const cell *k, const cell_cubic *q, double first, double last)
{
    double u[4] = {0.0}, value[4] = {first};
    int n = 1, turns = turning_points(q, u + 1);
    for (; n <= turns; n++) value[n] = cubic_at(q, u[n]);
    u[n] = 1.0;
    value[n] = last;
    for (int i = 0; i < n; i++) {
        if ((value[i] <= 0.0) != (value[i + 1] <= 0.0)) {
            double root = q->c[3] == 0.0 ? quadratic_root(q, u[i], value[i], u[i + 1], value[i + 1])
                                         : bracketed_root(q, u[i], value[i], u[i + 1], value[i + 1]);
            if (accept_share(w, k, root)) return true;
        } else if (i + 1 < n && fabs(value[i + 1]) <= k->rounding && accept_share(w, k, u[i + 1])) {
            return true;
        }
    }
    return false;
}

static bool visit(segment_walk *w, cell *k)
{
    const shell_segments *s = w->segments;
    double size = max_d(max_d(fabs(k->patch.min), fabs(k->patch.max)), max_d(fabs(k->a.h), fabs(k->b.h)));
    k->rounding = k->patch.slope * s->texel_rounding + s->height_rounding + 32.0 * DBL_EPSILON * size;
    w->steps++;
    if (min_d(k->a.h, k->b.h) > k->patch.max + 2.0 * k->rounding ||
        max_d(k->a.h, k->b.h) < k->patch.min - 2.0 * k->rounding) {
        w->have_g = false;
        return false;
    }
    cell_cubic q = make_cubic(&k->patch, &k->a, &k->b);
    double first = w->have_g ? w->g : q.c[0], last = cubic_at(&q, 1.0);
    if (k->from == 0.0 && fabs(first) <= k->rounding && accept_on(w, k->from, &k->patch)) return true;
    if (cell_roots(w, k, &q, first, last)) return true;
    if (k->to == 1.0 && fabs(last) <= k->rounding && accept_on(w, k->to, &k->patch)) return true;
    w->g = last / q.ratio;
    w->have_g = true;
    return false;
}

/* Centre lines of one level across one axis: line n stands at (n - offset) / scale in the frame's texels. */
typedef struct line_family {
    double in, out; /* the coordinate at the segment's ends */
    double offset, scale;
    double step;     /* +1, -1, or 0: the segment does not move along this axis */
    double line;     /* next line's number */
    double crossing; /* its fraction; infinite if it is not crossed before `to` */
} line_family;

static void next_crossing(line_family *l, const shell_segment *s, double last)
{
    double position = (l->line - l->offset) / l->scale;
    bool more = l->step > 0.0 ? position < last : l->step < 0.0 && position > last;
    l->crossing = more ? segment_cross(s, l->in, l->out, position) : INFINITY;
}

/* Returns the cell that is about to be moved through. */
static double start_family(line_family *l, double in, double out, double scale, double offset, double first)
{
    *l = (line_family){.in = in, .out = out, .offset = offset, .scale = scale};
    double position = first * scale + offset, at = floor_d(position);
    l->step = out > in ? 1.0 : out < in ? -1.0 : 0.0;
    l->line = at + 1.0;
    if (l->step < 0.0) {
        at = ceil_d(position) - 1.0;
        l->line = at;
    }
    return at;
}

typedef struct cells {
    line_family lines[4]; /* x and y of level[0], x and y of level[1] */
    double at[4];
    int families;
} cells;

static void start_cells(const segment_walk *w, const segment_point *first, cells *c)
{
    const shell_segment *s = w->segment;
    const height_lod *lod = w->lod;
    c->families = lod->blend > 0.0 ? 4 : 2;
    c->at[2] = c->at[3] = 0.0;
    c->at[0] = start_family(&c->lines[0], s->in.x, s->out.x, 1.0, 0.0, first->x);
    c->at[1] = start_family(&c->lines[1], s->in.y, s->out.y, 1.0, 0.0, first->y);
    if (c->families == 2) return;
    double rx = lod->ratio[0], ry = lod->ratio[1];
    double ox = ((double)w->frame->origin_x + 0.5) * rx - 0.5;
    double oy = ((double)w->frame->origin_y + 0.5) * ry - 0.5;
    c->at[2] = start_family(&c->lines[2], s->in.x, s->out.x, rx, ox, first->x);
    c->at[3] = start_family(&c->lines[3], s->in.y, s->out.y, ry, oy, first->y);
}

bool segment_walk_cells(segment_walk *w, double from, double to)
{
    cells c;
    cell k = {.from = from, .a = segment_at(w->segment, from)};
    segment_point last = segment_at(w->segment, to);
    start_cells(w, &k.a, &c);
    for (int i = 0; i < c.families; i++) next_crossing(&c.lines[i], w->segment, i & 1 ? last.y : last.x);
    for (;;) {
        int next = -1;
        k.to = to;
        for (int i = 0; i < c.families; i++)
            if (c.lines[i].crossing < k.to) {
                k.to = c.lines[i].crossing;
                next = i;
            }
        /* Crossings found one by one may fall back by rounding: the walk never does. */
        k.to = max_d(k.to, k.from);
        k.b = next < 0 ? last : segment_at(w->segment, k.to);
        height_patch_load(w->space, w->lod, w->frame, (int64_t)c.at[0], (int64_t)c.at[1], (int64_t)c.at[2],
                          (int64_t)c.at[3], &k.patch);
        if (visit(w, &k)) return true;
        if (next < 0) return false;
        k.from = k.to;
        k.a = k.b;
        c.at[next] += c.lines[next].step;
        c.lines[next].line += c.lines[next].step;
        next_crossing(&c.lines[next], w->segment, next & 1 ? last.y : last.x);
    }
}

/* The next line along one axis; the one after it where rounding put the next at or before f. */
static double next_along(const shell_segment *s, double in, double out, double at, double f)
{
    if (in == out) return 1.0;
    double step = out > in ? 1.0 : -1.0, line = step > 0.0 ? floor_d(at) + 1.0 : ceil_d(at) - 1.0;
    for (int i = 0; i < 2; i++, line += step) {
        if (step > 0.0 ? line >= out : line <= out) return 1.0;
        double crossing = segment_cross(s, in, out, line);
        if (crossing > f) return min_d(crossing, 1.0);
    }
    return 1.0;
}

double segment_next_line(const segment_walk *w, double f)
{
    const shell_segment *s = w->segment;
    segment_point p = segment_at(s, f);
    return min_d(next_along(s, s->in.x, s->out.x, p.x, f), next_along(s, s->in.y, s->out.y, p.y, f));
}
