/* Monotone pieces of a ray curve; see pieces.h. */
#include "shell/pieces.h"

bool curve_clip_to_ray(const ray_curve *c, const knurl_ray *ray, curve_interval *i)
{
    double slack = 1e-12 * (fabs(i->t_in) + fabs(i->t_out)) + 1e-9 * (i->t_out - i->t_in);
    if (i->t_out < ray->tmin - slack || i->t_in > ray->tmax + slack) return false;
    double in = i->in, out = i->out;
    if (ray->tmin > i->t_in) i->in = curve_invert(c, in, out, ray->tmin - slack);
    if (ray->tmax < i->t_out) i->out = curve_invert(c, in, out, ray->tmax + slack);
    return true;
}

int curve_split_at_turns(const ray_curve *c, double in, double out, double cuts[6])
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
