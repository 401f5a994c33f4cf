/* Smooth curves: lathe profiles and the spines of tubes. */
#include "demo_curve.h"

#include <math.h>
#include <string.h>

/* Number `k` of the point before the first (side -1) or after the last (side 1). */
static double beyond(const demo_curve *curve, int side, int k)
{
    const double *end = curve->points + (side < 0 ? 0 : curve->count - 1) * curve->width;
    const double *next = end - side * curve->width;
    if (curve->on_axis && !(fabs(end[0]) > 0)) return k == 0 ? -next[0] : next[k];
    return 2 * end[k] - next[k];
}

void demo_curve_at(const demo_curve *curve, double w, double *point, double *tangent)
{
    int last = curve->count - 1, width = curve->width, k = (int)w;
    if (k >= last) k = last - 1;
    if (k < 0) k = 0;
    double x = w - k;
    const double *p1 = curve->points + k * width, *p2 = p1 + width;
    for (int axis = 0; axis < width; axis++) {
        double before = k > 0 ? p1[axis - width] : beyond(curve, -1, axis);
        double after = k + 2 <= last ? p2[axis + width] : beyond(curve, 1, axis);
        double m1 = 0.5 * (p2[axis] - before), m2 = 0.5 * (after - p1[axis]), d = p1[axis] - p2[axis];
        double c3 = 2 * d + m1 + m2, c2 = -3 * d - 2 * m1 - m2;
        point[axis] = ((c3 * x + c2) * x + m1) * x + p1[axis];
        tangent[axis] = (3 * c3 * x + 2 * c2) * x + m1;
    }
}

void demo_curve_measure(demo_curve *curve)
{
    double before[DEMO_CURVE_WIDTH], point[DEMO_CURVE_WIDTH], tangent[DEMO_CURVE_WIDTH];
    demo_curve_at(curve, 0, before, tangent);
    curve->length[0] = 0;
    for (int k = 1; k <= DEMO_CURVE_STEPS; k++) {
        demo_curve_at(curve, (double)k * (curve->count - 1) / DEMO_CURVE_STEPS, point, tangent);
        double squared = 0;
        for (int axis = 0; axis < curve->axes; axis++)
            squared += (point[axis] - before[axis]) * (point[axis] - before[axis]);
        curve->length[k] = curve->length[k - 1] + sqrt(squared);
        memcpy(before, point, sizeof before);
    }
}

double demo_curve_parameter(const demo_curve *curve, double t)
{
    double wanted = t * curve->length[DEMO_CURVE_STEPS];
    int low = 0, high = DEMO_CURVE_STEPS;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (curve->length[middle] < wanted)
            low = middle;
        else
            high = middle;
    }
    double part = (wanted - curve->length[low]) / (curve->length[low + 1] - curve->length[low]);
    return (low + part) * (curve->count - 1) / DEMO_CURVE_STEPS;
}
