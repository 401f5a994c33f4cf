/* Exact search by heights; see search.h. */
#include "shell/search.h"

#include "shell/march.h"
#include "shell/pieces.h"

/* Texels; shorter pieces are marched. */
static const double MARCHED = 6.0;

/* A piece of the curve on which x and y are monotone. */
typedef struct piece {
    double in, out;
} piece;

enum { STACK_SIZE = 160 };

typedef struct search {
    shell_walk walk;
    knurl_bounds_kind kind;
    piece stack[STACK_SIZE];
    int top;
} search;

static bool clears(const search *s, const piece *p, const curve_point *a, const curve_point *b)
{
    const ray_curve *c = s->walk.curve;
    double pad = c->texel_rounding + c->texel_remainder;
    knurl_range h =
        shell_height_range(s->walk.space, s->walk.lod, s->kind, s->walk.frame, min_d(a->x, b->x) - pad,
                           min_d(a->y, b->y) - pad, max_d(a->x, b->x) + pad, max_d(a->y, b->y) + pad);
    return shell_curve_clears(&s->walk, p->in, p->out, h);
}

/* Halves the longer side of the rectangle, back half pushed first. False if there is no shorter half. */
static bool split(search *s, const piece *p, const curve_point *a, const curve_point *b)
{
    const ray_curve *c = s->walk.curve;
    bool along_x = fabs(b->x - a->x) >= fabs(b->y - a->y);
    double k = along_x ? 0.5 * (a->x + b->x) : 0.5 * (a->y + b->y);
    double middle = curve_cross(c, along_x ? &c->x : &c->y, k, p->in, p->out);
    if (!(middle > min_d(p->in, p->out) && middle < max_d(p->in, p->out))) return false;
    s->stack[s->top++] = (piece){middle, p->out};
    s->stack[s->top++] = (piece){p->in, middle};
    return true;
}

static bool search_pieces(search *s)
{
    while (s->top > 0) {
        piece p = s->stack[--s->top];
        curve_point a = curve_at(s->walk.curve, p.in), b = curve_at(s->walk.curve, p.out);
        double longest = max_d(fabs(b.x - a.x), fabs(b.y - a.y));
        if (longest > MARCHED && s->top + 2 <= STACK_SIZE) {
            s->walk.steps++;
            if (clears(s, &p, &a, &b) || split(s, &p, &a, &b)) continue;
        }
        if (shell_march(&s->walk, p.in, p.out)) return true;
    }
    return false;
}

bool shell_search(const shell_space *space, const height_lod *lod, knurl_bounds_kind kind,
                  const triangle_frame *frame, const knurl_ray *ray, bool any, shell_root *root,
                  uint32_t *steps)
{
    ray_curve curve;
    if (!(frame->flags & SHELL_FOLDED)) ray_curve_make(frame, ray, &curve);
    if (frame->flags & SHELL_FOLDED || curve.unreliable)
        return shell_subdivide(space, lod, kind, frame, ray, any, root, steps);
    search s;
    s.walk = (shell_walk){.space = space, .lod = lod, .frame = frame, .curve = &curve, .ray = ray};
    s.kind = kind;
    s.top = 0;
    bool found = false;
    for (int i = 0; i < curve.interval_count && !found; i++) {
        curve_interval stretch = curve.intervals[i];
        if (!curve_clip_to_ray(&curve, ray, &stretch)) continue;
        s.walk.stretch = &curve.intervals[i];
        double cuts[6];
        int n = curve_split_at_turns(&curve, stretch.in, stretch.out, cuts);
        for (int k = n - 2; k >= 0; k--) s.stack[s.top++] = (piece){cuts[k], cuts[k + 1]};
        found = search_pieces(&s);
    }
    *steps += s.walk.steps;
    if (found) *root = s.walk.root;
    return found;
}
