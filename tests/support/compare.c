/* support/compare.c: agreement between knurl and the oracle. */
#include "compare.h"

#include <math.h>
#include <stdio.h>

static double length_of(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Allowed |dt|: rounding across the surface, seen at the root's angle. The square root: a curved surface's
 * tangency is known to no more than that. */
static double allowed_dt(const oracle *o, const oracle_ray *ray, const oracle_root *root)
{
    double rounding = COMPARE_ROUNDING * oracle_scale(o) / length_of(ray->direction);
    return rounding / fmax(root->cosine, sqrt(COMPARE_ROUNDING));
}

/* How far the ray dips under the surface between two neighbouring roots: little for a near tangency. */
static double dip(const oracle *o, const oracle_ray *ray, const oracle_root *p, const oracle_root *q)
{
    if (p->triangle != q->triangle) return INFINITY;
    double s[3], n[3], t = 0.5 * (p->t + q->t), sum = 0.0;
    oracle_surface(o, p->triangle, 0.5 * (p->a + q->a), 0.5 * (p->b + q->b), s, n, NULL);
    for (int k = 0; k < 3; k++) sum += (ray->origin[k] + t * ray->direction[k] - s[k]) * n[k];
    return fabs(sum);
}

/* Whether root i cannot be argued away. */
static bool is_proven(const oracle *o, const oracle_ray *ray, compare_result *r, int i)
{
    const oracle_root *root = &r->roots[i];
    /* On a border between pieces the signs of D . n have to agree, and the neighbourhood to confirm it. */
    if (!root->certain || root->pieces > 1) return oracle_surrounded(o, ray, root);
    double gap = INFINITY;
    if (i > 0) gap = fmin(gap, dip(o, ray, root, &r->roots[i - 1]));
    if (i + 1 < r->count) gap = fmin(gap, dip(o, ray, root, &r->roots[i + 1]));
    r->gap = gap;
    return gap > COMPARE_ROUNDING * oracle_scale(o);
}

double compare_off_surface(const oracle *o, const oracle_ray *ray, const knurl_hit *hit)
{
    double s[3], d[3];
    oracle_surface(o, hit->triangle, hit->a, hit->b, s, NULL, NULL);
    for (int k = 0; k < 3; k++) d[k] = ray->origin[k] + hit->t * ray->direction[k] - s[k];
    double outside = fmax(0.0, fmax(-fmin(hit->a, hit->b), hit->a + hit->b - 1.0));
    return fmax(length_of(d), outside > 1e-9 ? INFINITY : 0.0);
}

static void judge(const oracle *o, const oracle_ray *ray, bool hit, compare_result *r)
{
    double end = hit ? r->answer.t : INFINITY;
    bool matched = false, doubtful = false;
    for (int i = 0; i < r->count; i++) {
        oracle_root *root = &r->roots[i];
        double allowed = allowed_dt(o, ray, root);
        if (hit && fabs(root->t - r->answer.t) <= allowed) {
            if (!matched && root->certain) {
                r->hit = true;
                r->t = root->t;
                r->dt = r->answer.t - root->t;
                r->across = fabs(r->dt) * length_of(ray->direction) * root->cosine;
            }
            matched = true;
        } else if (root->t < end) {
            if (is_proven(o, ray, r, i)) {
                r->verdict = COMPARE_MISSED;
                return;
            }
            if (!doubtful) r->gap = oracle_gap(o, ray, root->triangle, root->a, root->b);
            doubtful = true;
        }
    }
    if (hit && !matched) {
        r->gap = oracle_gap(o, ray, r->answer.triangle, r->answer.a, r->answer.b);
        bool beside = compare_off_surface(o, ray, &r->answer) <= COMPARE_ROUNDING * oracle_scale(o);
        r->verdict = beside ? COMPARE_UNSURE : COMPARE_FALSE;
        return;
    }
    r->verdict = doubtful ? COMPARE_UNSURE : COMPARE_AGREE;
}

compare_result compare_ray(const oracle *o, const traced *t, const oracle_ray *ray)
{
    compare_result r = {.gap = INFINITY};
    knurl_ray public_ray = traced_ray(t, ray);
    bool hit = knurl_scene_intersect(t->scene, &public_ray, &r.answer);
    bool occluded = knurl_scene_occluded(t->scene, &public_ray);
    r.count = oracle_first(o, ray, r.roots) ? 1 : 0;
    bool plain = r.count == 1 ? r.roots[0].certain && hit : !hit;
    if (plain && r.count == 1) plain = fabs(r.answer.t - r.roots[0].t) <= allowed_dt(o, ray, r.roots);
    /* Only answers that need a second look are worth the search for all roots. */
    if (!plain) {
        r.count = oracle_roots(o, ray, r.roots, COMPARE_ROOTS);
    }
    judge(o, ray, hit, &r);
    if (r.verdict == COMPARE_AGREE && occluded != hit) r.verdict = COMPARE_OCCLUDED;
    return r;
}

const char *compare_name(compare_verdict verdict)
{
    static const char *const names[] = {"agree", "unsure", "missed", "false", "occluded"};
    return names[verdict];
}

static const char *doubt(const compare_result *r)
{
    if (r->count == 0) return "knurl touches the surface";
    const oracle_root *q = &r->roots[0];
    if (!q->in_window) return "border of [tmin, tmax]";
    if (q->open) return "open edge";
    if (!q->simple) return "tangency";
    return q->mixed ? "crease seen edge on" : "two roots close together";
}

static void print_ray(const char *scene, const oracle_ray *ray)
{
    printf("%s,%a,%a,%a,%a,%a,%a,%a,%a", scene, ray->origin[0], ray->origin[1], ray->origin[2],
           ray->direction[0], ray->direction[1], ray->direction[2], ray->tmin, ray->tmax);
}

void compare_print_unsure(const char *scene, const oracle *o, const oracle_ray *ray, const compare_result *r)
{
    print_ray(scene, ray);
    printf(" # %s, gap %.1e of the diagonal, cosine %.1e\n", doubt(r), r->gap / oracle_scale(o),
           r->count ? r->roots[0].cosine : 0.0);
}

void compare_print(const char *scene, const oracle *o, const oracle_ray *ray, const compare_result *r)
{
    print_ray(scene, ray);
    printf("\n  %s, gap %.3g of scale %.3g; knurl: ", compare_name(r->verdict), r->gap, oracle_scale(o));
    if (r->answer.triangle == KNURL_NO_HIT)
        printf("no hit\n");
    else
        printf("t %.17g triangle %u a %.17g b %.17g, off the oracle's surface %.3g\n", r->answer.t,
               r->answer.triangle, r->answer.a, r->answer.b, compare_off_surface(o, ray, &r->answer));
    for (int i = 0; i < r->count && i < 6; i++) {
        const oracle_root *q = &r->roots[i];
        printf("  root t %.17g triangle %u a %.17g b %.17g cosine %.3g margin %.2g pieces %d%s%s%s%s%s%s\n",
               q->t, q->triangle, q->a, q->b, q->cosine, q->margin, q->pieces, q->certain ? " certain" : "",
               q->simple ? "" : " not-simple", q->mixed ? " mixed" : "", q->open ? " open-edge" : "",
               q->in_window ? "" : " window-border", q->degenerate ? " degenerate" : "");
    }
}
