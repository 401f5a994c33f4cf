/* shell/segment.h: a ray inside the shell of one base triangle, as straight segments in texture space.
 *
 * Methods that march through a box of texels (relief mapping, safety zones, secants) want the ray as a
 * line from entry to exit in (x, y, h). This gives that line for each stretch of the curve of
 * shell/curve.h, front to back. Its two ends lie on the curve; between them
 *
 *     h and t are affine in the fraction f, and
 *     (x, y, b1, b2) = ((1 - f) w0 q0 + f w1 q1) / ((1 - f) w0 + f w1)                            (1)
 *
 * with the ends' weights w. So the path in (x, y) is always a straight line, run through at an uneven speed
 * if the weights differ.
 *
 * When this is the ray itself and not a chord of its curve (`exact`):
 * - one constant normal (planes, boxes): shell space is affine, w = 1 and all of it is straight;
 * - S = P + h N with N = c - k P, k one number for the triangle: directions N = k (A - P) that meet in a
 *   point A (the reverse perspective of Baboud and Decoret 2006, section 4: frusta), or smooth normals
 *   N = (P - A) / r of a sphere, k = -1 / r. A point of the ray is Q = (1 - k h) P + h c, so that
 *   Q - A = (1 - k h) (P - A): with w = 1 - k h, the products w b are affine in Q, hence in t, and so is
 *   w. That is (1). In (x, y, 1 / w) such a ray is straight; in (x, y, h) it bends to one side: h is a
 *   concave function of the distance run in (x, y) for k > 0 (shells that narrow upwards), a convex one for
 *   k < 0. See segment_bend().
 * The normalised surface over N = c - k P (spheres) has the same weights, which makes x and y exact; only h
 * is a chord then. All other bases have weights 1, and all of it is a chord: its error is that of the method,
 * and falls with the square of the triangle's size. */
#ifndef KNURL_SRC_SHELL_SEGMENT_H
#define KNURL_SRC_SHELL_SEGMENT_H

#include "shell/curve.h"

typedef struct segment_point {
    double t;      /* ray parameter */
    double b1, b2; /* barycentrics */
    double x, y;   /* texel coordinates in the frame */
    double h;      /* object-space height */
    double weight; /* w of (1), positive; 1 unless N = c - k P */
} segment_point;

typedef struct shell_segment {
    segment_point in, out; /* in.t <= out.t */
} shell_segment;

typedef struct shell_segments {
    shell_segment list[CURVE_MAX_INTERVALS]; /* front to back */
    int count;
    bool exact;             /* the ray's own path, to rounding; else a chord */
    double texel_rounding;  /* if exact, a bound on the error of x and y along the segments */
    double height_rounding; /* the same for h */
} shell_segments;

/* The stretches of the ray inside the shell's prism. Clipped to the ray's [tmin, tmax] with a little room
 * for rounding: a root's own t must still be compared. An end at a side of the prism lies past the side by
 * the rounding of the side's place, so that neighbours overlap.
 *
 * Returns false, with no segments, if the ray cannot be followed: in folded shells, where a point has
 * several inverses and t does not grow along a stretch, and for the rays that ray_curve_make() gives up. The
 * marching methods of this library then call shell_subdivide(), which is slow and exact. */
bool shell_segments_make(const triangle_frame *frame, const knurl_ray *ray, shell_segments *segments);

/* The point at fraction f. */
static inline segment_point segment_at(const shell_segment *s, double f)
{
    double w0 = (1.0 - f) * s->in.weight, w1 = f * s->out.weight, w = w0 + w1;
    double k0 = w0 / w, k1 = w1 / w;
    return (segment_point){.t = (1.0 - f) * s->in.t + f * s->out.t,
                           .b1 = k0 * s->in.b1 + k1 * s->out.b1,
                           .b2 = k0 * s->in.b2 + k1 * s->out.b2,
                           .x = k0 * s->in.x + k1 * s->out.x,
                           .y = k0 * s->in.y + k1 * s->out.y,
                           .h = (1.0 - f) * s->in.h + f * s->out.h,
                           .weight = w};
}

/* Share of the distance run in (x, y) at fraction f, and back. Both grow from 0 to 1. */
static inline double segment_share(const shell_segment *s, double f)
{
    return f * s->out.weight / ((1.0 - f) * s->in.weight + f * s->out.weight);
}
static inline double segment_fraction(const shell_segment *s, double share)
{
    return share * s->in.weight / ((1.0 - share) * s->out.weight + share * s->in.weight);
}

/* Fraction at which x (or y), from `in` to `out` at the two ends, is `line`. NaN or infinite if it
 * never is. */
static inline double segment_cross(const shell_segment *s, double in, double out, double line)
{
    double a = s->in.weight * (in - line), b = s->out.weight * (out - line);
    return a / (a - b);
}

/* Second derivative of h by the distance run in (x, y), its sign only: negative where h is concave, 0 where
 * the segment is straight in (x, y, h). */
static inline double segment_bend(const shell_segment *s)
{
    return (s->out.weight - s->in.weight) * (s->out.h - s->in.h);
}

#endif
