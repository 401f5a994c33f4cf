/* Points of a ray curve, and where it crosses what; see curve.h. */
#include "shell/curve.h"
#include "shell/invert.h"

bool shell_invert(const triangle_frame *f, vec3 point, vec3 *q)
{
    for (int i = 0; i < 20; i++) {
        vec3 ja, jb, js, step;
        shell_columns(f, *q, &ja, &jb, &js);
        if (!solve3(ja, jb, js, v3_sub(point, shell_map(f, *q)), &step)) return false;
        *q = v3_add(*q, step);
        if (!v3_finite(*q)) return false;
        double change = fabs(step.x) + fabs(step.y) + fabs(step.z) / (f->size + fabs(q->z));
        if (change < 1e-15 * (1.0 + fabs(q->x) + fabs(q->y))) return true;
        if (i >= 6 && change < 1e-12) return true;
    }
    return false;
}

curve_point curve_at_refined(const ray_curve *c, double p)
{
    const triangle_frame *f = c->frame;
    double inverse = c->by_depth ? 1.0 : 1.0 / quadratic_at(&c->w, p);
    vec3 q = v3(quadratic_at(&c->b1, p) * inverse, quadratic_at(&c->b2, p) * inverse,
                c->by_depth ? quadratic_at(&c->s, p) : p);
    vec3 ja, jb, js, step;
    shell_columns(f, q, &ja, &jb, &js);
    vec3 point = v3_mad(c->origin, curve_depth(c, p), c->direction);
    if (solve3(ja, jb, js, v3_sub(point, shell_map(f, q)), &step)) q = v3_add(q, step);
    return (curve_point){q.x, q.y, q.z, f->x[0] + q.x * f->xe + q.y * f->xf,
                         f->y[0] + q.x * f->ye + q.y * f->yf};
}

double curve_invert(const ray_curve *c, double in, double out, double t)
{
    if (c->by_depth) {
        double p = (t - c->depth_origin) / c->depth_scale;
        return p < in ? in : p > out ? out : p;
    }
    double t_in = curve_depth(c, in), t_out = curve_depth(c, out);
    if (!(t > t_in)) return in;
    if (!(t < t_out)) return out;
    double a = in, b = out, p = in + (out - in) * ((t - t_in) / (t_out - t_in));
    for (int i = 0; i < 60; i++) {
        double value = curve_depth(c, p) - t;
        if (value > 0.0)
            b = p;
        else
            a = p;
        /* Secant through the bracket's fresh end, bisection every third step. */
        double ta = curve_depth(c, a) - t, tb = curve_depth(c, b) - t;
        double next = i % 3 == 2 || !(tb > ta) ? 0.5 * (a + b) : a + (b - a) * (-ta / (tb - ta));
        if (fabs(next - p) <= 1e-12 * fabs(out - in)) return next;
        p = next;
    }
    return p;
}

static double cross_quadratic(const ray_curve *c, const quadratic *coordinate, double k, double a, double b)
{
    quadratic q = {{coordinate->c[0] - k * c->w.c[0], coordinate->c[1] - k * c->w.c[1],
                    coordinate->c[2] - k * c->w.c[2]}};
    double lo = min_d(a, b), hi = max_d(a, b), roots[2];
    int count = quadratic_roots(&q, roots);
    double best = NAN, outside = INFINITY;
    for (int i = 0; i < count; i++) {
        double away = roots[i] < lo ? lo - roots[i] : roots[i] > hi ? roots[i] - hi : 0.0;
        if (away < outside) {
            outside = away;
            best = roots[i];
        }
    }
    if (outside <= 1e-9 * (hi - lo)) return best < lo ? lo : best > hi ? hi : best;
    /* Rounding hid the root: bisect on the sign. Where there is no change of sign, because the line is closer
     * to an end than the quadratics are to the curve, the end is the root. */
    double at_a = quadratic_at(&q, a), at_b = quadratic_at(&q, b);
    bool rising = at_a < 0.0;
    if (rising == (at_b < 0.0)) return fabs(at_a) <= fabs(at_b) ? a : b;
    for (int i = 0; i < 60; i++) {
        double middle = 0.5 * (a + b);
        if ((quadratic_at(&q, middle) < 0.0) == rising)
            a = middle;
        else
            b = middle;
    }
    return 0.5 * (a + b);
}

double curve_cross(const ray_curve *c, const quadratic *coordinate, double k, double a, double b)
{
    double p = cross_quadratic(c, coordinate, k, a, b);
    for (int i = 0; c->refine && i < 2; i++) {
        curve_point at = curve_at(c, p);
        double w = quadratic_at(&c->w, p), value = (coordinate == &c->x ? at.x : at.y) - k;
        double slope = (quadratic_slope(coordinate, p) - k * quadratic_slope(&c->w, p)) / w;
        double moved = p - value / slope;
        if (isnan(moved)) break;
        p = min_d(max_d(moved, min_d(a, b)), max_d(a, b));
    }
    return p;
}

int curve_turning_points(const ray_curve *c, const quadratic *coordinate, double a, double b,
                         double turning[2])
{
    const double *x = coordinate->c, *w = c->w.c;
    quadratic slope = {
        {x[1] * w[0] - x[0] * w[1], 2.0 * (x[2] * w[0] - x[0] * w[2]), x[2] * w[1] - x[1] * w[2]}};
    double roots[2], lo = min_d(a, b), hi = max_d(a, b);
    int found = quadratic_roots(&slope, roots), count = 0;
    for (int i = 0; i < found; i++)
        if (roots[i] > lo && roots[i] < hi) turning[count++] = roots[i];
    if (count == 2 && (turning[0] > turning[1]) != (a > b)) {
        double first = turning[0];
        turning[0] = turning[1];
        turning[1] = first;
    }
    return count;
}
