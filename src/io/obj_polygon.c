/* Ear clipping in the plane of the polygon's Newell normal. */
#include "io/obj_polygon.h"

#include "math/vec.h"

typedef struct polygon {
    vec2 points[OBJ_POLYGON_MAX_EARS];
    uint32_t ring[OBJ_POLYGON_MAX_EARS]; /* corners that are left */
    uint32_t left;
} polygon;

static void fan(uint32_t count, uint32_t *triangles)
{
    for (uint32_t i = 0; i + 2 < count; i++) {
        triangles[3 * i] = 0;
        triangles[3 * i + 1] = i + 1;
        triangles[3 * i + 2] = i + 2;
    }
}

/* Twice the area of a, b, c; positive when they turn with the polygon. */
static double turn(vec2 a, vec2 b, vec2 c)
{
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

static bool same(vec2 a, vec2 b)
{
    return a.x == b.x && a.y == b.y;
}

/* Projects on the two axes where the normal is smallest, oriented so that the polygon's area is
 * positive; false if it has no area. */
static bool project(const float *positions, uint32_t count, vec2 *points)
{
    vec3 first = v3_loadf(positions), n = v3(0.0, 0.0, 0.0);
    for (uint32_t i = 1; i + 1 < count; i++) {
        vec3 a = v3_sub(v3_loadf(positions + 3 * i), first);
        vec3 b = v3_sub(v3_loadf(positions + 3 * (i + 1)), first);
        n = v3_add(n, v3_cross(a, b));
    }
    double size = v3_max_component(v3_abs(n));
    if (!(size > 0.0) || !v3_finite(n)) return false;
    for (uint32_t i = 0; i < count; i++) {
        vec3 p = v3_sub(v3_loadf(positions + 3 * i), first);
        if (fabs(n.x) == size)
            points[i] = n.x > 0.0 ? (vec2){p.y, p.z} : (vec2){p.z, p.y};
        else if (fabs(n.y) == size)
            points[i] = n.y > 0.0 ? (vec2){p.z, p.x} : (vec2){p.x, p.z};
        else
            points[i] = n.z > 0.0 ? (vec2){p.x, p.y} : (vec2){p.y, p.x};
    }
    return true;
}

static bool is_ear(const polygon *p, uint32_t at)
{
    uint32_t before = (at + p->left - 1) % p->left, after = (at + 1) % p->left;
    vec2 a = p->points[p->ring[before]], b = p->points[p->ring[at]], c = p->points[p->ring[after]];
    if (!(turn(a, b, c) > 0.0)) return false;
    for (uint32_t i = 0; i < p->left; i++) {
        if (i == before || i == at || i == after) continue;
        vec2 q = p->points[p->ring[i]];
        if (same(q, a) || same(q, b) || same(q, c)) continue;
        if (turn(a, b, q) >= 0.0 && turn(b, c, q) >= 0.0 && turn(c, a, q) >= 0.0) return false;
    }
    return true;
}

void obj_polygon_triangulate(const float *positions, uint32_t count, uint32_t *triangles)
{
    polygon p;
    if (count == 3 || count > OBJ_POLYGON_MAX_EARS || !project(positions, count, p.points)) {
        fan(count, triangles);
        return;
    }
    p.left = count;
    for (uint32_t i = 0; i < count; i++) p.ring[i] = i;
    /* Starting behind corner 0 gives a convex polygon the fan that other programs make. */
    for (uint32_t made = 0; made + 3 < count; made++) {
        uint32_t ear = p.left;
        for (uint32_t i = 0; i < p.left && ear == p.left; i++)
            if (is_ear(&p, (i + 1) % p.left)) ear = (i + 1) % p.left;
        if (ear == p.left) ear = 1; /* crosses itself: any cut will do */
        triangles[3 * made] = p.ring[(ear + p.left - 1) % p.left];
        triangles[3 * made + 1] = p.ring[ear];
        triangles[3 * made + 2] = p.ring[(ear + 1) % p.left];
        p.left--;
        for (uint32_t i = ear; i < p.left; i++) p.ring[i] = p.ring[i + 1];
    }
    for (int i = 0; i < 3; i++) triangles[3 * (count - 3) + (uint32_t)i] = p.ring[i];
}
