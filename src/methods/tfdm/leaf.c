/* The part of the curve inside a node.
 *
 * A piece's parameter at a texel line depends on the piece and the line alone, not on the node: neighbours
 * share it bit for bit, so the parts of a piece that belong to nodes cover it without gaps. shell_march()
 * takes both ends of a part as closed, which makes it watertight across nodes; the march inside of a part
 * carries values from texel to texel. */
#include "methods/tfdm/leaf.h"

#include "shell/pieces.h"

void leaf_pieces_make(const ray_curve *c, const knurl_ray *ray, leaf_pieces *pieces)
{
    pieces->count = 0;
    pieces->near = INFINITY;
    pieces->far = -INFINITY;
    for (int i = 0; i < c->interval_count; i++) {
        curve_interval clipped = c->intervals[i];
        if (!curve_clip_to_ray(c, ray, &clipped)) continue;
        double slack =
            1e-12 * (fabs(clipped.t_in) + fabs(clipped.t_out)) + 1e-9 * (clipped.t_out - clipped.t_in);
        pieces->near = min_d(pieces->near, clipped.t_in - slack);
        pieces->far = max_d(pieces->far, clipped.t_out + slack);
        double cuts[6];
        int n = curve_split_at_turns(c, clipped.in, clipped.out, cuts);
        curve_point from = curve_at(c, cuts[0]);
        for (int k = 0; k + 1 < n; k++) {
            curve_point to = curve_at(c, cuts[k + 1]);
            pieces->piece[pieces->count++] =
                (leaf_piece){cuts[k], cuts[k + 1], from.x, to.x, from.y, to.y, &c->intervals[i]};
            from = to;
        }
    }
    pieces->near = max_d(pieces->near, ray->tmin);
    pieces->far = min_d(pieces->far, ray->tmax);
}

/* A parameter range, from the front to the back. */
typedef struct stretch {
    double in, out;
} stretch;

/* Later of two parameters along the piece. */
static double later(double a, double b, bool rising)
{
    return (a > b) == rising ? a : b;
}

/* Narrows the part to where the coordinate, which goes from `first` to `last`, is in [low, high]. */
static bool narrow(const ray_curve *c, const leaf_piece *p, const quadratic *coordinate, double first,
                   double last, double low, double high, stretch *part)
{
    if (min_d(first, last) > high || max_d(first, last) < low) return false;
    bool rising = p->out >= p->in;
    double enter = last >= first ? low : high, leave = last >= first ? high : low;
    if ((first - enter) * (last - enter) < 0.0)
        part->in = later(part->in, curve_cross(c, coordinate, enter, p->in, p->out), rising);
    if ((first - leave) * (last - leave) < 0.0)
        part->out = later(part->out, curve_cross(c, coordinate, leave, p->in, p->out), !rising);
    return true;
}

bool leaf_intersect(shell_walk *walk, const leaf_pieces *pieces, double x0, double x1, double y0, double y1)
{
    const ray_curve *c = walk->curve;
    for (int i = 0; i < pieces->count; i++) {
        const leaf_piece *p = &pieces->piece[i];
        stretch part = {p->in, p->out};
        if (!narrow(c, p, &c->x, p->x_in, p->x_out, x0, x1, &part)) continue;
        if (!narrow(c, p, &c->y, p->y_in, p->y_out, y0, y1, &part)) continue;
        if (p->out >= p->in ? part.in > part.out : part.in < part.out) continue;
        walk->stretch = p->stretch;
        if (shell_march(walk, part.in, part.out)) return true;
    }
    return false;
}
