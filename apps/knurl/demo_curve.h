/* demo_curve.h: smooth curves through points, measured by length. */
#ifndef KNURL_APPS_DEMO_CURVE_H
#define KNURL_APPS_DEMO_CURVE_H

#include <stdbool.h>

enum { DEMO_CURVE_STEPS = 512, DEMO_CURVE_WIDTH = 5 };

/* Catmull-Rom through `count` points of `width` numbers each, of which the first `axes` are a
 * position and the others are carried along. */
typedef struct demo_curve {
    const double *points;
    int count, width, axes; /* count 3 or more, width at most DEMO_CURVE_WIDTH */
    bool on_axis;           /* an end whose first number is 0 lies on an axis, which the curve meets at
                               a right angle: the neighbour is mirrored there */
    double length[DEMO_CURVE_STEPS + 1]; /* arc length up to step i, by demo_curve_measure */
} demo_curve;

void demo_curve_measure(demo_curve *curve);
/* The curve and its derivative at w in [0, count - 1]. */
void demo_curve_at(const demo_curve *curve, double w, double *point, double *tangent);
/* The w at the part t in [0, 1] of the curve's length. */
double demo_curve_parameter(const demo_curve *curve, double t);

#endif
