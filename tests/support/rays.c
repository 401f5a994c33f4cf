/* support/rays.c: the ray families. */
#include "rays.h"
#include "random.h"

#include <math.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

const char *ray_family_name(ray_family family)
{
    static const char *const names[RAYS_FAMILIES] = {
        "to-surface", "chord",  "graze-base", "graze-surface", "axis",   "axis-plane", "shell",
        "inside",     "vertex", "edge",       "texel",         "window", "length"};
    return names[family];
}

/* Uniform on the unit sphere. */
static void random_direction(random_state *r, double d[3])
{
    double z = random_range(r, -1.0, 1.0), angle = random_range(r, 0.0, 2.0 * PI), s = sqrt(1.0 - z * z);
    d[0] = s * cos(angle);
    d[1] = s * sin(angle);
    d[2] = z;
}

typedef struct place {
    uint32_t triangle;
    double a, b;
    double point[3], normal[3];
} place;

static void set_place(const oracle *o, place *p)
{
    oracle_surface(o, p->triangle, p->a, p->b, p->point, p->normal, NULL);
}

static place random_place(const truth_scene *s, const oracle *o, random_state *r)
{
    place p;
    p.triangle = random_index(r, s->def.triangle_count);
    p.a = random_unit(r);
    p.b = random_unit(r);
    if (p.a + p.b > 1.0) {
        p.a = 1.0 - p.a;
        p.b = 1.0 - p.b;
    }
    set_place(o, &p);
    return p;
}

static place special_place(const truth_scene *s, const oracle *o, random_state *r, ray_family family)
{
    place p = random_place(s, o, r);
    if (family == RAYS_VERTEX) {
        uint32_t corner = random_index(r, 3);
        p.a = corner == 1 ? 1.0 : 0.0;
        p.b = corner == 2 ? 1.0 : 0.0;
    } else if (family == RAYS_EDGE) {
        double f = random_unit(r);
        uint32_t edge = random_index(r, 3);
        p.a = edge == 0 ? f : edge == 1 ? 0.0 : 1.0 - f;
        p.b = edge == 0 ? 0.0 : f;
    } else {
        for (int i = 0; i < 40; i++) {
            double a, b;
            if (!oracle_texel_corner(o, p.triangle, random_unit(r), random_unit(r), &a, &b)) continue;
            p.a = a;
            p.b = b;
            break;
        }
    }
    set_place(o, &p);
    return p;
}

static oracle_ray towards(const double from[3], const double to[3])
{
    oracle_ray ray = {.tmin = 0.0, .tmax = INFINITY};
    for (int k = 0; k < 3; k++) {
        ray.origin[k] = from[k];
        ray.direction[k] = to[k] - from[k];
    }
    return ray;
}

static void outside_point(const truth_scene *s, random_state *r, double p[3])
{
    double d[3];
    random_direction(r, d);
    for (int k = 0; k < 3; k++) p[k] = s->center[k] + 3.0 * s->size * d[k];
}

/* From behind the place, along a direction at a small angle to its tangent plane. */
static oracle_ray grazing(const truth_scene *s, random_state *r, const double point[3],
                          const double normal[3])
{
    double d[3], dot = 0.0, length = 0.0;
    random_direction(r, d);
    for (int k = 0; k < 3; k++) dot += d[k] * normal[k];
    for (int k = 0; k < 3; k++) d[k] -= dot * normal[k];
    for (int k = 0; k < 3; k++) length += d[k] * d[k];
    double angle =
        pow(10.0, random_range(r, s->wide ? -2.0 : -9.0, -1.0)) * (random_unit(r) < 0.5 ? -1.0 : 1.0);
    oracle_ray ray = {.tmin = 0.0, .tmax = INFINITY};
    for (int k = 0; k < 3; k++) {
        ray.direction[k] = d[k] / sqrt(length) + angle * normal[k];
        ray.origin[k] = point[k] - 3.0 * s->size * ray.direction[k];
    }
    return ray;
}

static void base_point(const truth_scene *s, const place *p, double point[3], double normal[3])
{
    const uint32_t *t = &s->def.triangles[3 * (size_t)p->triangle];
    double w[3] = {1.0 - p->a - p->b, p->a, p->b}, e[2][3], length = 0.0;
    for (int k = 0; k < 3; k++) {
        point[k] = 0.0;
        for (int i = 0; i < 3; i++) point[k] += w[i] * (double)s->def.positions[3 * t[i] + (uint32_t)k];
        for (int i = 0; i < 2; i++)
            e[i][k] = (double)s->def.positions[3 * t[i + 1] + (uint32_t)k] -
                      (double)s->def.positions[3 * t[0] + (uint32_t)k];
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        normal[k] = e[0][i] * e[1][j] - e[0][j] * e[1][i];
        length += normal[k] * normal[k];
    }
    for (int k = 0; k < 3; k++) normal[k] /= sqrt(length);
}

static oracle_ray axis_ray(const truth_scene *s, random_state *r, const place *p, bool plane)
{
    oracle_ray ray = {.tmin = 0.0, .tmax = INFINITY};
    uint32_t axis = s->wide ? 1 : random_index(r, 3);
    double sign = random_unit(r) < 0.5 ? -1.0 : 1.0;
    uint32_t vertex = s->def.triangles[3 * (size_t)p->triangle + random_index(r, 3)];
    uint32_t other = plane ? (axis + 1 + random_index(r, 2)) % 3 : 3;
    for (uint32_t k = 0; k < 3; k++) {
        ray.direction[k] = k == axis ? sign : 0.0;
        ray.origin[k] = k == axis ? s->center[k] - sign * 3.0 * s->size : p->point[k];
        if (k == other) ray.origin[k] = (double)s->def.positions[3 * vertex + k];
    }
    return ray;
}

static oracle_ray inner_ray(const truth_scene *s, const oracle *o, random_state *r, ray_family family)
{
    double from[3], to[3];
    if (family == RAYS_INSIDE) {
        for (int k = 0; k < 3; k++) from[k] = s->center[k] + 0.3 * s->size * random_range(r, -1.0, 1.0);
    } else {
        /* Between the base and the far side of the largest height. */
        place p = random_place(s, o, r);
        double base[3], normal[3], f = random_range(r, 0.0, 1.5);
        base_point(s, &p, base, normal);
        for (int k = 0; k < 3; k++) from[k] = base[k] + f * (p.point[k] - base[k]);
    }
    random_direction(r, to);
    for (int k = 0; k < 3; k++) to[k] = from[k] + s->size * to[k];
    return towards(from, to);
}

oracle_ray ray_make(const truth_scene *scene, const oracle *o, ray_family family, uint64_t index)
{
    random_state r = {index * 0x2545f4914f6cdd1du + (uint64_t)family * 0x9e3779b97f4a7c15u};
    double from[3], to[3], normal[3];
    (void)random_bits(&r);
    outside_point(scene, &r, from);
    place p = random_place(scene, o, &r);
    switch (family) {
    case RAYS_CHORD:
        outside_point(scene, &r, to);
        for (int k = 0; k < 3; k++) to[k] = 0.5 * (to[k] + scene->center[k]);
        return towards(from, to);
    case RAYS_GRAZE_BASE:
        base_point(scene, &p, to, normal);
        return grazing(scene, &r, random_unit(&r) < 0.5 ? to : p.point, normal);
    case RAYS_GRAZE_SURFACE:
        return grazing(scene, &r, p.point, p.normal);
    case RAYS_AXIS:
        return axis_ray(scene, &r, &p, false);
    case RAYS_AXIS_PLANE:
        return axis_ray(scene, &r, &p, true);
    case RAYS_SHELL:
    case RAYS_INSIDE:
        return inner_ray(scene, o, &r, family);
    case RAYS_VERTEX:
    case RAYS_EDGE:
    case RAYS_TEXEL:
        p = special_place(scene, o, &r, family);
        return towards(from, p.point);
    default:
        break;
    }
    oracle_ray ray = towards(from, p.point);
    if (family == RAYS_WINDOW) {
        ray.tmin = random_range(&r, 0.3, 1.2);
        ray.tmax = ray.tmin + random_range(&r, 0.0, 0.8);
    } else if (family == RAYS_LENGTH) {
        double length = pow(10.0, random_range(&r, -6.0, 6.0));
        for (int k = 0; k < 3; k++) ray.direction[k] *= length;
    }
    return ray;
}
