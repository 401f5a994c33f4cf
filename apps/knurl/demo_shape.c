/* Freely shaped base meshes: surfaces, sculptures, tubes. */
#include "demo_shape.h"

#include "demo_noise.h"

#include <string.h>

static void cross(const double a[3], const double b[3], double out[3])
{
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void normalize(double v[3])
{
    double length = sqrt(dot(v, v));
    for (int k = 0; k < 3; k++) v[k] /= length;
}

/* dP/ds x dP/dt, as long as it comes out. */
static void surface_facing(const demo_surface *surface, double s, double t, double normal[3])
{
    const double e = 2e-4;
    double p[4][3], ds[3], dt[3];
    surface->evaluate(surface->shape, s - e, t, p[0]);
    surface->evaluate(surface->shape, s + e, t, p[1]);
    surface->evaluate(surface->shape, s, t - e, p[2]);
    surface->evaluate(surface->shape, s, t + e, p[3]);
    for (int k = 0; k < 3; k++) {
        ds[k] = (p[1][k] - p[0][k]) / (2 * e);
        dt[k] = (p[3][k] - p[2][k]) / (2 * e);
    }
    if (surface->flip)
        cross(dt, ds, normal);
    else
        cross(ds, dt, normal);
}

static void surface_at(const void *shape, double s, double t, double position[3], double normal[3])
{
    const demo_surface *surface = shape;
    surface->evaluate(surface->shape, s, t, position);
    if (t <= 0 || t >= 1) {
        /* One point? Then the mean around it, which is the same for every s. */
        double other[3], gap = 0;
        surface->evaluate(surface->shape, s + 0.37, t, other);
        for (int k = 0; k < 3; k++) gap += fabs(other[k] - position[k]);
        if (gap < 1e-9) {
            memset(normal, 0, 3 * sizeof *normal);
            for (int i = 0; i < 16; i++) {
                double part[3];
                surface_facing(surface, i / 16.0, t <= 0 ? 4e-3 : 1 - 4e-3, part);
                for (int k = 0; k < 3; k++) normal[k] += part[k];
            }
            normalize(normal);
            surface->evaluate(surface->shape, 0, t, position);
            return;
        }
    }
    surface_facing(surface, s, t, normal);
    normalize(normal);
}

void demo_mesh_surface(demo_mesh *mesh, const demo_surface *surface)
{
    demo_mesh_patch(
        mesh, &(demo_patch){surface_at, surface, surface->columns, surface->rows, surface->closed_s, false});
}

static void add_bump(const demo_bump *bump, double side, const double d[3], double position[3])
{
    double at[3] = {side * bump->at[0], bump->at[1], bump->at[2]}, squared = 0;
    normalize(at);
    for (int k = 0; k < 3; k++) squared += (d[k] - at[k]) * (d[k] - at[k]);
    double weight = exp(-squared / (bump->width * bump->width));
    for (int k = 0; k < 3; k++) position[k] += weight * bump->push[k] * (k == 0 ? side : 1);
}

static void sculpture_point(const demo_sculpture *sculpture, const double d[3], double position[3])
{
    for (int k = 0; k < 3; k++) position[k] = sculpture->size[k] * d[k];
    for (int i = 0; i < sculpture->count; i++) {
        add_bump(&sculpture->bumps[i], 1, d, position);
        if (sculpture->bumps[i].mirrored) add_bump(&sculpture->bumps[i], -1, d, position);
    }
}

void demo_sculpture_at(const void *sculpture, const double direction[3], double position[3], double normal[3])
{
    const double e = 1e-4;
    double d[3] = {direction[0], direction[1], direction[2]}, tangent[2][3], difference[2][3];
    normalize(d);
    double side[3] = {0, 0, 0};
    side[fabs(d[0]) < 0.6 ? 0 : 1] = 1;
    cross(side, d, tangent[0]);
    normalize(tangent[0]);
    cross(d, tangent[0], tangent[1]);
    for (int i = 0; i < 2; i++) {
        double a[3], b[3], pa[3], pb[3];
        for (int k = 0; k < 3; k++) {
            a[k] = d[k] - e * tangent[i][k];
            b[k] = d[k] + e * tangent[i][k];
        }
        sculpture_point(sculpture, a, pa);
        sculpture_point(sculpture, b, pb);
        for (int k = 0; k < 3; k++) difference[i][k] = pb[k] - pa[k];
    }
    cross(difference[0], difference[1], normal);
    normalize(normal);
    sculpture_point(sculpture, d, position);
}

void demo_mesh_sculpture(demo_mesh *mesh, const demo_sculpture *sculpture, int n)
{
    demo_mesh_ball(mesh, demo_sculpture_at, sculpture, n);
}

static void globe_at(const void *sculpture, double s, double t, double position[3], double normal[3])
{
    double direction[3];
    demo_latitude_longitude(s, t, direction);
    /* Poles are one point whatever s is. */
    if (t <= 0 || t >= 1) direction[0] = direction[2] = 0;
    demo_sculpture_at(sculpture, direction, position, normal);
}

void demo_mesh_sculpture_globe(demo_mesh *mesh, const demo_sculpture *sculpture, int segments, int rings)
{
    demo_mesh_patch(mesh, &(demo_patch){globe_at, sculpture, segments, rings, true, false});
}

/* A frame at each step of the length. */
typedef struct tube_shape {
    demo_curve curve;
    double cap;
    double up[DEMO_CURVE_STEPS + 1][3];
} tube_shape;

static void tube_frames(tube_shape *shape, const double up[3])
{
    double carried[3] = {up[0], up[1], up[2]};
    for (int i = 0; i <= DEMO_CURVE_STEPS; i++) {
        double point[DEMO_CURVE_WIDTH], tangent[DEMO_CURVE_WIDTH];
        demo_curve_at(&shape->curve, demo_curve_parameter(&shape->curve, (double)i / DEMO_CURVE_STEPS), point,
                      tangent);
        normalize(tangent);
        double along = dot(carried, tangent);
        double lean = dot(up, tangent);
        /* Without a turn of its own, but righting itself slowly wherever it does not run upright. */
        for (int k = 0; k < 3; k++) carried[k] += 0.04 * (up[k] - lean * tangent[k]) - along * tangent[k];
        normalize(carried);
        memcpy(shape->up[i], carried, sizeof carried);
    }
}

static void tube_at(const void *data, double s, double t, double position[3])
{
    const tube_shape *shape = data;
    double inside = demo_clamp(t, 0, 1), point[DEMO_CURVE_WIDTH], tangent[DEMO_CURVE_WIDTH], up[3], side[3];
    demo_curve_at(&shape->curve, demo_curve_parameter(&shape->curve, inside), point, tangent);
    normalize(tangent);
    int step = (int)demo_min(inside * DEMO_CURVE_STEPS, DEMO_CURVE_STEPS - 1);
    double part = inside * DEMO_CURVE_STEPS - step;
    for (int k = 0; k < 3; k++) up[k] = demo_mix(shape->up[step][k], shape->up[step + 1][k], part);
    double along = dot(up, tangent);
    for (int k = 0; k < 3; k++) up[k] -= along * tangent[k];
    normalize(up);
    cross(tangent, up, side);
    double end = demo_min(inside, 1 - inside), radius = point[3], turn = 2 * DEMO_PI * s;
    if (shape->cap > 0 && end < shape->cap) radius *= sqrt(1 - pow(1 - end / shape->cap, 2));
    for (int k = 0; k < 3; k++)
        position[k] = point[k] + radius * (sin(turn) * point[4] * side[k] - cos(turn) * up[k]) +
                      (t - inside) * shape->curve.length[DEMO_CURVE_STEPS] * tangent[k];
}

void demo_mesh_tube(demo_mesh *mesh, const demo_tube *tube)
{
    tube_shape shape = {.curve = {.points = tube->points[0], .count = tube->count, .width = 5, .axes = 3},
                        .cap = tube->cap};
    demo_curve_measure(&shape.curve);
    tube_frames(&shape, tube->up);
    demo_mesh_surface(mesh, &(demo_surface){tube_at, &shape, tube->segments, tube->rings, true, true});
}
