/* Low-poly base meshes of the sample scenes. */
#include "demo_mesh.h"

#include "demo_curve.h"
#include "demo_noise.h"

#include <stdlib.h>
#include <string.h>

void demo_mesh_release(demo_mesh *mesh)
{
    free(mesh->positions);
    free(mesh->normals);
    free(mesh->texcoords);
    free(mesh->triangles);
    memset(mesh, 0, sizeof *mesh);
}

static bool grow(demo_mesh *mesh, void **array, uint32_t capacity, size_t size)
{
    void *grown = realloc(*array, capacity * size);
    if (grown)
        *array = grown;
    else
        mesh->out_of_memory = true;
    return grown != NULL;
}

static uint32_t add_vertex(demo_mesh *mesh, const double position[3], const double normal[3], double u,
                           double v)
{
    if (mesh->out_of_memory) return 0;
    if (mesh->vertex_count == mesh->vertex_capacity) {
        uint32_t capacity = mesh->vertex_capacity ? 2 * mesh->vertex_capacity : 256;
        if (!grow(mesh, (void **)&mesh->positions, capacity, 3 * sizeof(float)) ||
            !grow(mesh, (void **)&mesh->normals, capacity, 3 * sizeof(float)) ||
            !grow(mesh, (void **)&mesh->texcoords, capacity, 2 * sizeof(float)))
            return 0;
        mesh->vertex_capacity = capacity;
    }
    uint32_t index = mesh->vertex_count++;
    for (int k = 0; k < 3; k++) {
        /* Adding 0 turns -0 into 0: duplicates are equal bit for bit. */
        mesh->positions[3 * index + (uint32_t)k] = (float)position[k] + 0.0f;
        mesh->normals[3 * index + (uint32_t)k] = (float)normal[k] + 0.0f;
    }
    mesh->texcoords[2 * index] = (float)u;
    mesh->texcoords[2 * index + 1] = (float)v;
    return index;
}

/* Turns the triangle counter-clockwise around its vertex normals; drops it if it has no area. */
static void add_triangle(demo_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    if (mesh->out_of_memory) return;
    const float *p = mesh->positions + 3 * a, *q = mesh->positions + 3 * b, *r = mesh->positions + 3 * c;
    size_t size = 3 * sizeof(float);
    if (!memcmp(p, q, size) || !memcmp(q, r, size) || !memcmp(r, p, size)) return;
    double e[3], f[3], n[3];
    for (int k = 0; k < 3; k++) {
        e[k] = (double)q[k] - (double)p[k];
        f[k] = (double)r[k] - (double)p[k];
        n[k] = (double)mesh->normals[3 * a + (uint32_t)k] + (double)mesh->normals[3 * b + (uint32_t)k] +
               (double)mesh->normals[3 * c + (uint32_t)k];
    }
    double facing = n[0] * (e[1] * f[2] - e[2] * f[1]) + n[1] * (e[2] * f[0] - e[0] * f[2]) +
                    n[2] * (e[0] * f[1] - e[1] * f[0]);
    if (mesh->triangle_count == mesh->triangle_capacity) {
        uint32_t capacity = mesh->triangle_capacity ? 2 * mesh->triangle_capacity : 256;
        if (!grow(mesh, (void **)&mesh->triangles, capacity, 3 * sizeof(uint32_t))) return;
        mesh->triangle_capacity = capacity;
    }
    uint32_t *out = mesh->triangles + 3 * mesh->triangle_count++;
    out[0] = a;
    out[1] = facing < 0 ? c : b;
    out[2] = facing < 0 ? b : c;
}

void demo_mesh_patch(demo_mesh *mesh, const demo_patch *patch)
{
    uint32_t first = mesh->vertex_count, stride = (uint32_t)patch->columns + 1;
    for (int j = 0; j <= patch->rows; j++) {
        for (int i = 0; i <= patch->columns; i++) {
            int wi = patch->closed_s ? i % patch->columns : i, wj = patch->closed_t ? j % patch->rows : j;
            double position[3], normal[3];
            patch->evaluate(patch->shape, (double)wi / patch->columns, (double)wj / patch->rows, position,
                            normal);
            add_vertex(mesh, position, normal, (double)i / patch->columns, (double)j / patch->rows);
        }
    }
    for (uint32_t j = 0; j < (uint32_t)patch->rows; j++) {
        for (uint32_t i = 0; i < (uint32_t)patch->columns; i++) {
            uint32_t a = first + j * stride + i, b = a + 1, c = a + stride, d = c + 1;
            add_triangle(mesh, a, b, d);
            add_triangle(mesh, a, d, c);
        }
    }
}

static void plane_at(const void *shape, double s, double t, double position[3], double normal[3])
{
    const double *size = shape;
    position[0] = (s - 0.5) * size[0];
    position[1] = 0;
    position[2] = (t - 0.5) * size[1];
    normal[0] = normal[2] = 0;
    normal[1] = 1;
}

void demo_mesh_plane(demo_mesh *mesh, double width, double depth, int columns, int rows)
{
    double size[2] = {width, depth};
    demo_mesh_patch(mesh, &(demo_patch){plane_at, size, columns, rows, false, false});
}

static void sphere_at(const void *shape, double s, double t, double position[3], double normal[3])
{
    double radius = *(const double *)shape, turn = 2 * DEMO_PI * s;
    /* The poles must be one point whatever s is. */
    double ring = t <= 0 || t >= 1 ? 0 : sin(DEMO_PI * t);
    normal[0] = ring * sin(turn);
    normal[1] = cos(DEMO_PI * t);
    normal[2] = ring * cos(turn);
    for (int k = 0; k < 3; k++) position[k] = radius * normal[k];
}

void demo_mesh_sphere(demo_mesh *mesh, double radius, int segments, int rings)
{
    demo_mesh_patch(mesh, &(demo_patch){sphere_at, &radius, segments, rings, true, false});
}

void demo_latitude_longitude(double u, double v, double direction[3])
{
    double turn = 2 * DEMO_PI * u, ring = sin(DEMO_PI * v);
    direction[0] = ring * sin(turn);
    direction[1] = cos(DEMO_PI * v);
    direction[2] = ring * cos(turn);
}

void demo_octahedral(double u, double v, double direction[3])
{
    double x = 2 * u - 1, z = 2 * v - 1, y = 1 - fabs(x) - fabs(z);
    if (y < 0) {
        double folded = (1 - fabs(z)) * (x < 0 ? -1 : 1);
        z = (1 - fabs(x)) * (z < 0 ? -1 : 1);
        x = folded;
    }
    double length = sqrt(x * x + y * y + z * z);
    direction[0] = x / length;
    direction[1] = y / length;
    direction[2] = z / length;
}

void demo_mesh_ball(demo_mesh *mesh, demo_ball_fn *evaluate, const void *shape, int n)
{
    uint32_t first = mesh->vertex_count, side = 2 * (uint32_t)n + 1;
    for (int j = 0; j <= 2 * n; j++) {
        for (int i = 0; i <= 2 * n; i++) {
            /* On the lattice, in whole numbers: points that fold together come out equal. */
            int x = i - n, z = j - n, y = n - abs(x) - abs(z);
            if (y < 0) {
                int folded = (n - abs(z)) * (x < 0 ? -1 : 1);
                z = (n - abs(x)) * (z < 0 ? -1 : 1);
                x = folded;
            }
            double length = sqrt((double)(x * x + y * y + z * z));
            double direction[3] = {x / length, y / length, z / length}, position[3], normal[3];
            evaluate(shape, direction, position, normal);
            add_vertex(mesh, position, normal, (double)i / (2 * n), (double)j / (2 * n));
        }
    }
    for (int j = 0; j < 2 * n; j++) {
        for (int i = 0; i < 2 * n; i++) {
            uint32_t a = first + (uint32_t)j * side + (uint32_t)i, b = a + 1, c = a + side, d = c + 1;
            /* Diagonals run along |x| + |z| = constant, so that the octahedron's edges are edges. */
            if ((i < n) == (j < n)) {
                add_triangle(mesh, a, b, c);
                add_triangle(mesh, b, d, c);
            } else {
                add_triangle(mesh, a, b, d);
                add_triangle(mesh, a, d, c);
            }
        }
    }
}

static void ball_at(const void *shape, const double direction[3], double position[3], double normal[3])
{
    for (int k = 0; k < 3; k++) {
        normal[k] = direction[k];
        position[k] = *(const double *)shape * direction[k];
    }
}

void demo_mesh_octasphere(demo_mesh *mesh, double radius, int n)
{
    demo_mesh_ball(mesh, ball_at, &radius, n);
}

static void torus_at(const void *shape, double s, double t, double position[3], double normal[3])
{
    const double *size = shape;
    double turn = 2 * DEMO_PI * s, around = 2 * DEMO_PI * t;
    double radius = size[0] + size[1] * cos(around);
    position[0] = radius * sin(turn);
    position[1] = size[1] * sin(around);
    position[2] = radius * cos(turn);
    normal[0] = cos(around) * sin(turn);
    normal[1] = sin(around);
    normal[2] = cos(around) * cos(turn);
}

void demo_mesh_torus(demo_mesh *mesh, double radius, double tube, int segments, int sides)
{
    double size[2] = {radius, tube};
    demo_mesh_patch(mesh, &(demo_patch){torus_at, size, segments, sides, true, true});
}

/* One face: `axis` is its normal's, `sign` its side; the other two axes carry u and v. */
static void add_face(demo_mesh *mesh, const demo_box *box, int axis, int sign)
{
    int n = box->divisions, au = axis == 0 ? 2 : 0, av = axis == 1 ? 2 : 1;
    uint32_t first = mesh->vertex_count, stride = (uint32_t)n + 1;
    for (int j = 0; j <= n; j++) {
        for (int i = 0; i <= n; i++) {
            /* Whole numbers until the last step: faces agree on their common edges. */
            int corner[3] = {0, 0, 0};
            corner[axis] = sign * n;
            corner[au] = 2 * i - n;
            corner[av] = 2 * j - n;
            double position[3], normal[3] = {0, 0, 0}, length = 0;
            for (int k = 0; k < 3; k++) {
                position[k] = 0.5 * box->size[k] * corner[k] / n;
                length += (double)corner[k] * corner[k];
            }
            if (!box->smooth)
                normal[axis] = sign;
            else
                for (int k = 0; k < 3; k++) normal[k] = corner[k] / sqrt(length);
            double v = (double)(axis == 1 ? j : n - j) / n * (axis == 1 ? 1 : box->side_extent);
            add_vertex(mesh, position, normal, (double)i / n, v);
        }
    }
    for (uint32_t j = 0; j < (uint32_t)n; j++) {
        for (uint32_t i = 0; i < (uint32_t)n; i++) {
            uint32_t a = first + j * stride + i, c = a + stride;
            add_triangle(mesh, a, a + 1, c + 1);
            add_triangle(mesh, a, c + 1, c);
        }
    }
}

void demo_mesh_box(demo_mesh *mesh, const demo_box *box)
{
    for (int axis = 0; axis < 3; axis++) {
        add_face(mesh, box, axis, -1);
        add_face(mesh, box, axis, 1);
    }
}

static void lathe_at(const void *shape, double s, double t, double position[3], double normal[3])
{
    const demo_curve *curve = shape;
    double point[2], tangent[2];
    demo_curve_at(curve, demo_curve_parameter(curve, t), point, tangent);
    /* An end on the axis must be one point, whatever was rounded on the way. */
    if ((t <= 0 || t >= 1) && fabs(point[0]) < 1e-9 * curve->length[DEMO_CURVE_STEPS]) point[0] = 0;
    double turn = 2 * DEMO_PI * s, speed = sqrt(tangent[0] * tangent[0] + tangent[1] * tangent[1]);
    position[0] = point[0] * sin(turn);
    position[1] = point[1];
    position[2] = point[0] * cos(turn);
    normal[0] = tangent[1] / speed * sin(turn);
    normal[1] = -tangent[0] / speed;
    normal[2] = tangent[1] / speed * cos(turn);
}

void demo_mesh_lathe(demo_mesh *mesh, const demo_profile *profile)
{
    demo_curve curve = {
        .points = profile->points[0], .count = profile->count, .width = 2, .axes = 2, .on_axis = true};
    demo_curve_measure(&curve);
    demo_mesh_patch(mesh, &(demo_patch){lathe_at, &curve, profile->segments, profile->rings, true, false});
}

void demo_mesh_scale_texcoords(demo_mesh *mesh, double u, double v)
{
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        mesh->texcoords[2 * i] *= (float)u;
        mesh->texcoords[2 * i + 1] *= (float)v;
    }
}
