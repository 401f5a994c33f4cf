/* What is a hit: in double precision, on S itself.
 *
 * Watertight. g = s |N| - h is continuous along the ray. A root in a texel's closed region is found there up
 * to the rounding of (b1, b2), which shell_root_solve() bounds; it is taken if it lies in the texel and in
 * the triangle widened by that bound. A root at a border is thus taken by at least one of the two sides, and
 * by both at most: which does no harm, as they agree on t within rounding. What the solver cannot settle,
 * near tangencies and where roots are close together, goes to shell_search(), which is watertight by itself,
 * with the range of t over the texel. */
#include "methods/fast/fast.h"
#include "shell/search.h"

static const triangle_frame *load_frame(fast_ray *r, uint32_t triangle)
{
    return frame_recall(r->memo, r->space, r->lod, triangle);
}

/* Of two hits at the same t that of the lower triangle counts, whatever order they are found in. */
static bool take(fast_ray *r, uint32_t triangle, const shell_root *root)
{
    if (r->found && (root->t > r->t || (root->t == r->t && triangle >= r->triangle))) return false;
    r->found = true;
    r->t = root->t;
    r->triangle = triangle;
    r->root = *root;
    double tau = (root->t - r->t0) * r->rate;
    /* t has been rounded: what is at the same t must still be looked at. */
    tau += 0x1p-48 * (fabs(tau) + fabs(r->t0 * r->rate));
    if (tau < r->tau_max) r->tau_max = tau;
    return true;
}

/* The shell between two parameters. */
static bool search_between(fast_ray *r, uint32_t triangle, double tau_in, double tau_out)
{
    knurl_ray ray = *r->ray;
    double in = r->t0 + tau_in / r->rate, out = r->t0 + tau_out / r->rate;
    ray.tmin = max_d(ray.tmin, in);
    ray.tmax = min_d(ray.tmax, out);
    if (r->found) ray.tmax = min_d(ray.tmax, r->t);
    if (!(ray.tmin <= ray.tmax)) return false;
    const triangle_frame *f = load_frame(r, triangle);
    shell_root root;
    return shell_search(r->space, r->lod, KNURL_BOUNDS_MINMAX, f, &ray, r->any, &root, &r->steps) &&
           take(r, triangle, &root);
}

bool fast_search(fast_ray *r, uint32_t triangle)
{
    /* A triangle has several parts. */
    if (r->searched == triangle) return false;
    r->searched = triangle;
    return search_between(r, triangle, -INFINITY, INFINITY);
}

static bool search_texel(fast_ray *r, const fast_candidate *c)
{
    return search_between(r, c->triangle, c->tau_in, c->tau_out);
}

bool fast_decide(fast_ray *r, const fast_candidate *c)
{
    if (!c->certain) return search_texel(r, c);
    const triangle_frame *f = load_frame(r, c->triangle);
    shell_root root;
    double dx = (double)c->x - f->x[0], dy = (double)c->y - f->y[0], error[2];
    root.b1 = f->inverse_uv[0] * dx + f->inverse_uv[1] * dy;
    root.b2 = f->inverse_uv[2] * dx + f->inverse_uv[3] * dy;
    root.t = r->t0 + c->tau / r->rate;
    height_patch_load(r->space, r->lod, f, c->i, c->j, 0, 0, &root.patch);
    if (!shell_root_solve(f, r->ray, &root, error)) return search_texel(r, c);
    double ex = f->texel_rounding + error[0] * fabs(f->xe) + error[1] * fabs(f->xf);
    double ey = f->texel_rounding + error[0] * fabs(f->ye) + error[1] * fabs(f->yf);
    double x = root.x - (double)c->i, y = root.y - (double)c->j;
    double away = max_d(max_d(-x - ex, x - 1.0 - ex), max_d(-y - ey, y - 1.0 - ey));
    /* Elsewhere than where one root was seen to be: another one. */
    double tau = (root.t - r->t0) * r->rate;
    if (!(tau >= c->tau_in && tau <= c->tau_out)) return search_texel(r, c);
    if (away > 0.0) return false;
    double b0 = 1.0 - root.b1 - root.b2;
    if (root.b1 < -error[0] || root.b2 < -error[1] || b0 < -(error[0] + error[1])) return false;
    if (!(root.t >= r->ray->tmin && root.t <= r->ray->tmax)) return false;
    return take(r, c->triangle, &root);
}
