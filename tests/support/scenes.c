/* support/scenes.c: bases, maps and the list of scenes. */
#include "scenes.h"
#include "random.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

/* ---- bases: every builder fills positions, normals, texcoords and triangles ---- */

typedef struct mesh_arrays {
    float *positions, *normals, *texcoords;
    uint32_t *triangles;
    uint32_t vertices, faces;
} mesh_arrays;

static bool reserve(mesh_arrays *m, uint32_t vertices, uint32_t faces)
{
    m->positions = calloc((size_t)vertices * 3, sizeof(float));
    m->normals = calloc((size_t)vertices * 3, sizeof(float));
    m->texcoords = calloc((size_t)vertices * 2, sizeof(float));
    m->triangles = calloc((size_t)faces * 3, sizeof(uint32_t));
    m->vertices = m->faces = 0;
    return m->positions && m->normals && m->texcoords && m->triangles;
}

static uint32_t add_vertex(mesh_arrays *m, const double p[3], const double n[3], double u, double v)
{
    for (int k = 0; k < 3; k++) {
        m->positions[3 * m->vertices + (uint32_t)k] = (float)p[k];
        m->normals[3 * m->vertices + (uint32_t)k] = (float)n[k];
    }
    m->texcoords[2 * m->vertices] = (float)u;
    m->texcoords[2 * m->vertices + 1] = (float)v;
    return m->vertices++;
}

static void add_face(mesh_arrays *m, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *t = &m->triangles[3 * m->faces++];
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

/* Octahedron or icosahedron faces cut `times` times; texcoords are linear in the position, so that the
 * chart has no seam. */
static bool make_ico(mesh_arrays *m, int times)
{
    double g = 0.5 * (1.0 + sqrt(5.0));
    const double corner[12][3] = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                                  {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    static const uint32_t face[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                         {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                         {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                         {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    uint32_t parts = 1u << times;
    if (!reserve(m, 20 * (parts + 1) * (parts + 2) / 2, 20 * parts * parts)) return false;
    for (int f = 0; f < 20; f++) {
        uint32_t row[2][65];
        for (uint32_t j = 0; j <= parts; j++) {
            for (uint32_t i = 0; i + j <= parts; i++) {
                double p[3], length = 0.0;
                /* Summed in an order that depends on the corners only: faces share their edges bit for bit.
                 */
                uint32_t order[3] = {face[f][0], face[f][1], face[f][2]};
                double weight[3] = {(double)(parts - i - j), (double)i, (double)j};
                for (int pass = 0; pass < 2; pass++) {
                    for (int k = 0; k < 2; k++) {
                        if (order[k] <= order[k + 1]) continue;
                        uint32_t so = order[k];
                        double sw = weight[k];
                        order[k] = order[k + 1];
                        weight[k] = weight[k + 1];
                        order[k + 1] = so;
                        weight[k + 1] = sw;
                    }
                }
                for (int k = 0; k < 3; k++) {
                    p[k] = 0.0;
                    for (int c = 0; c < 3; c++) p[k] += weight[c] * corner[order[c]][k];
                    length += p[k] * p[k];
                }
                for (int k = 0; k < 3; k++) p[k] /= sqrt(length);
                row[j & 1][i] =
                    add_vertex(m, p, p, 0.5 + 0.43 * p[0] + 0.11 * p[2], 0.5 + 0.37 * p[1] - 0.29 * p[2]);
                if (j > 0 && i > 0) add_face(m, row[~j & 1][i], row[j & 1][i], row[j & 1][i - 1]);
                if (j > 0) add_face(m, row[~j & 1][i], row[~j & 1][i + 1], row[j & 1][i]);
            }
        }
    }
    return true;
}

typedef void surface_point(double s, double t, double p[3], double n[3]);

/* Grid of a parametric surface, s and t in [0, 1]; `wrap` repeats row or column 0 bit for bit. */
static bool make_grid(mesh_arrays *m, int across, int around, const bool wrap[2], surface_point *point)
{
    if (!reserve(m, (uint32_t)((across + 1) * (around + 1)), (uint32_t)(2 * across * around))) return false;
    for (int j = 0; j <= around; j++) {
        for (int i = 0; i <= across; i++) {
            double s = (double)(wrap[0] ? i % across : i) / across,
                   t = (double)(wrap[1] ? j % around : j) / around;
            double p[3], n[3];
            point(s, t, p, n);
            add_vertex(m, p, n, (double)i / across, (double)j / around);
        }
    }
    for (int j = 0; j < around; j++) {
        for (int i = 0; i < across; i++) {
            uint32_t a = (uint32_t)(j * (across + 1) + i), b = a + 1, c = a + (uint32_t)across + 1, d = c + 1;
            const float *p = m->positions;
            bool flat_ab = memcmp(&p[3 * a], &p[3 * b], 3 * sizeof *p) == 0;
            bool flat_cd = memcmp(&p[3 * c], &p[3 * d], 3 * sizeof *p) == 0;
            if (!flat_ab) add_face(m, a, b, d);
            if (!flat_cd) add_face(m, a, d, c);
        }
    }
    return true;
}

static void torus_point(double s, double t, double p[3], double n[3])
{
    double cs = cos(2 * PI * s), ss = sin(2 * PI * s), ct = cos(2 * PI * t), st = sin(2 * PI * t);
    n[0] = ct * cs;
    n[1] = st;
    n[2] = ct * ss;
    p[0] = (1.0 + 0.4 * ct) * cs;
    p[1] = 0.4 * st;
    p[2] = (1.0 + 0.4 * ct) * ss;
}

static void cylinder_point(double s, double t, double p[3], double n[3])
{
    n[0] = cos(2 * PI * s);
    n[1] = 0.0;
    n[2] = sin(2 * PI * s);
    p[0] = n[0];
    p[1] = 2.0 * t - 1.0;
    p[2] = n[2];
}

/* Poles are exact, so that meridians lie in planes with the axis. Their zeros differ in sign, so that
 * make_grid leaves some triangles without area in: they must be harmless. */
static void sphere_point(double s, double t, double p[3], double n[3])
{
    double r = t <= 0.0 || t >= 1.0 ? 0.0 : sin(PI * t);
    p[0] = n[0] = r * cos(2 * PI * s);
    p[1] = n[1] = cos(PI * t);
    p[2] = n[2] = r * sin(2 * PI * s);
}

static void plane_point(double s, double t, double p[3], double n[3])
{
    p[0] = 2.0 * s - 1.0;
    p[1] = 0.0;
    p[2] = 1.0 - 2.0 * t;
    n[0] = n[2] = 0.0;
    n[1] = 1.0;
}

static void sail_point(double s, double t, double p[3], double n[3])
{
    double x = 2.0 * s - 1.0, z = 1.0 - 2.0 * t;
    p[0] = x;
    p[1] = 0.3 * x * x - 0.4 * z * x;
    p[2] = z;
    n[0] = -(0.6 * x - 0.4 * z);
    n[1] = 1.0;
    n[2] = 0.4 * x;
}

static void huge_point(double s, double t, double p[3], double n[3])
{
    p[0] = 1000.0 * s;
    p[1] = 0.0;
    p[2] = -1000.0 * t;
    n[0] = n[2] = 0.0;
    n[1] = 1.0;
}

/* ---- maps ---- */

static double wave_value(random_state *r, double x, double y, double roughness)
{
    double value = 0.5 + 0.2 * sin(2 * PI * (2 * x + y) + 0.3) + 0.15 * cos(2 * PI * (3 * y - x)) +
                   0.1 * sin(2 * PI * (7 * x + 5 * y));
    return fmin(fmax(value + roughness * (random_unit(r) - 0.5), 0.0), 1.0);
}

static double checker_value(int i, int j, int cell)
{
    return ((i / cell + j / cell) & 1) != 0 ? 1.0 : 0.0;
}

typedef enum map_kind { MAP_WAVES, MAP_ROUGH, MAP_NOISE, MAP_CHECKER, MAP_CONSTANT } map_kind;

static bool make_map(oracle_def *d, int width, int height, oracle_format format, map_kind kind)
{
    size_t count = (size_t)width * (size_t)height;
    unsigned char *bytes = malloc(count * (size_t)format);
    random_state r = {(uint64_t)(width * 7919 + height * 104729 + (int)kind)};
    d->width = width;
    d->height = height;
    d->format = format;
    d->samples = bytes;
    if (!bytes) return false;
    for (int j = 0; j < height; j++) {
        for (int i = 0; i < width; i++) {
            double x = (i + 0.5) / width, y = (j + 0.5) / height, value = 0.625;
            if (kind == MAP_WAVES) value = wave_value(&r, x, y, 0.02);
            if (kind == MAP_ROUGH) value = wave_value(&r, x, y, 0.4);
            if (kind == MAP_NOISE) value = random_unit(&r);
            if (kind == MAP_CHECKER) value = checker_value(i, j, 2);
            size_t at = (size_t)j * (size_t)width + (size_t)i;
            float single = (float)value;
            uint16_t word = (uint16_t)(value * 65535.0 + 0.5);
            if (format == ORACLE_U8) bytes[at] = (unsigned char)(value * 255.0 + 0.5);
            if (format == ORACLE_U16) memcpy(bytes + 2 * at, &word, sizeof word);
            if (format == ORACLE_F32) memcpy(bytes + 4 * at, &single, sizeof single);
        }
    }
    return true;
}

/* ---- putting scenes together ---- */

static void adopt(truth_scene *s, const mesh_arrays *m, const char *name)
{
    memset(s, 0, sizeof *s);
    s->name = name;
    s->size = 1.0;
    s->def = (oracle_def){.positions = m->positions,
                          .normals = m->normals,
                          .texcoords = m->texcoords,
                          .vertex_count = m->vertices,
                          .triangles = m->triangles,
                          .triangle_count = m->faces,
                          .factor = 1.0,
                          .uv_scale = {1.0, 1.0}};
}

static void set_heights(truth_scene *s, double factor, double offset)
{
    s->def.factor = factor;
    s->def.offset = offset;
}

static void set_wrap(truth_scene *s, oracle_wrap u, oracle_wrap v)
{
    s->def.wrap_u = u;
    s->def.wrap_v = v;
}

static void set_uv(truth_scene *s, double sx, double sy, double ox, double oy, double rotation)
{
    s->def.uv_scale[0] = sx;
    s->def.uv_scale[1] = sy;
    s->def.uv_offset[0] = ox;
    s->def.uv_offset[1] = oy;
    s->def.uv_rotation = rotation;
}

/* p' = scale * p + move, heights scaled too. */
static void place(truth_scene *s, double scale, double x, double y, double z)
{
    float *p = (float *)(uintptr_t)s->def.positions;
    const double move[3] = {x, y, z};
    for (uint32_t i = 0; i < 3 * s->def.vertex_count; i++) p[i] = (float)(scale * (double)p[i] + move[i % 3]);
    for (int k = 0; k < 3; k++) s->center[k] = scale * s->center[k] + move[k];
    s->size *= scale;
    s->def.factor *= scale;
    s->def.offset *= scale;
}

/* Tilts every normal by about `amount`; vertices at equal positions get equal normals. */
static void tilt_normals(truth_scene *s, double amount)
{
    float *n = (float *)(uintptr_t)s->def.normals;
    for (uint32_t i = 0; i < s->def.vertex_count; i++) {
        const float *p = &s->def.positions[3 * i];
        for (int k = 0; k < 3; k++) {
            double phase = 12.9 * (double)p[0] + 78.2 * (double)p[1] + 37.7 * (double)p[2] + 2.1 * k;
            n[3 * i + (uint32_t)k] += (float)(amount * sin(phase));
        }
    }
}

/* Texcoords without area: constant on some triangles, on a line on the others. */
static bool flatten_uv(truth_scene *s)
{
    float *st = (float *)(uintptr_t)s->def.texcoords;
    for (uint32_t i = 0; i < s->def.vertex_count; i++) {
        const float *p = &s->def.positions[3 * i];
        double along = (double)p[1] > 0.5 ? 0.25 : 0.3 * (double)p[0] + 0.1 * (double)p[1];
        st[2 * i] = (float)along;
        st[2 * i + 1] = (float)(0.5 * along + 0.125);
    }
    return true;
}

bool truth_torus_make(truth_scene *scene, const char *name, int around, int across, double factor,
                      double offset, double at)
{
    static const bool both[2] = {true, true};
    mesh_arrays m;
    memset(scene, 0, sizeof *scene);
    if (!make_grid(&m, around, across, both, torus_point)) return false;
    adopt(scene, &m, name);
    scene->size = 1.4;
    scene->closed = true;
    set_heights(scene, factor, offset);
    if (at != 0.0) place(scene, 1.0, at, -at, 0.5 * at);
    return make_map(&scene->def, 64, 48, ORACLE_U16, MAP_ROUGH);
}

/* ---- the list ---- */

static bool ico20(truth_scene *s)
{
    mesh_arrays m;
    if (!make_ico(&m, 0)) return false;
    adopt(s, &m, "ico20");
    set_heights(s, 0.15, 0.0);
    s->closed = true;
    return make_map(&s->def, 64, 64, ORACLE_U8, MAP_ROUGH);
}

static bool ico80_x4(truth_scene *s)
{
    mesh_arrays m;
    if (!make_ico(&m, 1)) return false;
    adopt(s, &m, "ico80-x4");
    set_heights(s, 0.6, -0.1);
    s->closed = true;
    return make_map(&s->def, 128, 128, ORACLE_F32, MAP_WAVES);
}

static bool torus(truth_scene *s)
{
    if (!truth_torus_make(s, "torus", 12, 8, 0.12, -0.03, 0.0)) return false;
    free((void *)(uintptr_t)s->def.samples);
    return make_map(&s->def, 128, 64, ORACLE_U16, MAP_ROUGH);
}

static bool cylinder_tiled(truth_scene *s)
{
    static const bool wrap[2] = {true, false};
    mesh_arrays m;
    if (!make_grid(&m, 8, 1, wrap, cylinder_point)) return false;
    adopt(s, &m, "cylinder-8x8");
    set_heights(s, 0.05, 0.0);
    set_uv(s, 8.0, 8.0, 0.0, 0.0, 0.0);
    set_wrap(s, ORACLE_MIRROR, ORACLE_REPEAT);
    return make_map(&s->def, 37, 91, ORACLE_U8, MAP_ROUGH);
}

static bool torus_3x200(truth_scene *s)
{
    if (!truth_torus_make(s, "torus-3x200", 9, 6, 0.3, -0.1, 0.0)) return false;
    s->closed = false;
    set_uv(s, 1.7, 2.3, -0.21, 0.4, 0.0);
    set_wrap(s, ORACLE_CLAMP, ORACLE_MIRROR);
    free((void *)(uintptr_t)s->def.samples);
    return make_map(&s->def, 3, 200, ORACLE_F32, MAP_ROUGH);
}

static bool plane(truth_scene *s)
{
    static const bool wrap[2] = {false, false};
    mesh_arrays m;
    if (!make_grid(&m, 1, 1, wrap, plane_point)) return false;
    adopt(s, &m, "plane");
    set_heights(s, 0.2, -0.05);
    return make_map(&s->def, 256, 256, ORACLE_U16, MAP_WAVES);
}

static bool latlong(truth_scene *s)
{
    static const bool wrap[2] = {true, false};
    mesh_arrays m;
    if (!make_grid(&m, 12, 6, wrap, sphere_point)) return false;
    adopt(s, &m, "latlong");
    set_heights(s, 0.1, 0.0);
    return make_map(&s->def, 64, 32, ORACLE_U8, MAP_ROUGH);
}

static bool checker(truth_scene *s)
{
    mesh_arrays m;
    if (!make_ico(&m, 1)) return false;
    adopt(s, &m, "checker-steps");
    set_heights(s, 0.25, -0.1);
    s->closed = true;
    return make_map(&s->def, 32, 32, ORACLE_U16, MAP_CHECKER);
}

static bool far_torus(truth_scene *s)
{
    return truth_torus_make(s, "torus-far-1e5", 12, 8, 0.12, 0.0, 1e5);
}

static bool tiny_torus(truth_scene *s)
{
    if (!truth_torus_make(s, "torus-tiny-1e-4", 12, 8, 0.12, 0.0, 0.0)) return false;
    place(s, 1e-4, 0.0, 0.0, 0.0);
    return true;
}

static bool huge_torus(truth_scene *s)
{
    if (!truth_torus_make(s, "torus-huge-1e5", 12, 8, 0.12, 0.0, 0.0)) return false;
    place(s, 1e5, 0.0, 0.0, 0.0);
    return true;
}

static bool unnormalised(truth_scene *s)
{
    mesh_arrays m;
    if (!make_ico(&m, 0)) return false;
    adopt(s, &m, "unnormalised");
    set_heights(s, 0.5, -0.2);
    s->def.unnormalised = true;
    s->closed = true;
    return make_map(&s->def, 64, 40, ORACLE_U16, MAP_ROUGH);
}

static bool lod_integer(truth_scene *s)
{
    if (!truth_torus_make(s, "lod-1.37", 12, 8, 0.3, -0.1, 0.0)) return false;
    s->def.lod = (double)1.37f;
    free((void *)(uintptr_t)s->def.samples);
    return make_map(&s->def, 96, 50, ORACLE_U8, MAP_NOISE);
}

static bool lod_float(truth_scene *s)
{
    mesh_arrays m;
    if (!make_ico(&m, 1)) return false;
    adopt(s, &m, "lod-2.5-float");
    set_heights(s, 0.7, -0.3);
    set_uv(s, 3.0, 2.0, 0.0, 0.0, 0.3);
    s->def.lod = 2.5;
    s->closed = true;
    return make_map(&s->def, 61, 33, ORACLE_F32, MAP_NOISE);
}

static bool folded(truth_scene *s)
{
    mesh_arrays m;
    if (!make_ico(&m, 0)) return false;
    adopt(s, &m, "folded");
    tilt_normals(s, 0.5);
    set_heights(s, 1.9, -1.5);
    s->closed = true;
    return make_map(&s->def, 32, 24, ORACLE_U8, MAP_WAVES);
}

static bool folded_torus(truth_scene *s)
{
    if (!truth_torus_make(s, "folded-torus", 8, 5, 0.9, -0.6, 0.0)) return false;
    tilt_normals(s, 0.7);
    return true;
}

static bool flat_uv(truth_scene *s)
{
    mesh_arrays m;
    if (!make_ico(&m, 1)) return false;
    adopt(s, &m, "flat-uv");
    set_heights(s, 0.3, 0.0);
    s->closed = true;
    return flatten_uv(s) && make_map(&s->def, 64, 64, ORACLE_U16, MAP_ROUGH);
}

static bool rotated(truth_scene *s)
{
    static const bool wrap[2] = {true, false};
    mesh_arrays m;
    if (!make_grid(&m, 7, 2, wrap, cylinder_point)) return false;
    adopt(s, &m, "rotated-uv");
    set_heights(s, 0.2, -0.1);
    set_uv(s, 2.3, -1.1, 0.37, -5.2, 0.7);
    set_wrap(s, ORACLE_MIRROR, ORACLE_CLAMP);
    return make_map(&s->def, 37, 91, ORACLE_F32, MAP_ROUGH);
}

static bool constant(truth_scene *s)
{
    mesh_arrays m;
    if (!make_ico(&m, 1)) return false;
    adopt(s, &m, "constant-1x1");
    set_heights(s, 0.3, 0.05);
    s->closed = true;
    return make_map(&s->def, 1, 1, ORACLE_U8, MAP_CONSTANT);
}

static bool torus_1x5(truth_scene *s)
{
    if (!truth_torus_make(s, "torus-1x5", 10, 7, 0.15, 0.0, 0.0)) return false;
    set_wrap(s, ORACLE_CLAMP, ORACLE_REPEAT);
    free((void *)(uintptr_t)s->def.samples);
    return make_map(&s->def, 1, 5, ORACLE_U16, MAP_NOISE);
}

static bool huge_triangle(truth_scene *s)
{
    static const bool wrap[2] = {false, false};
    mesh_arrays m;
    if (!make_grid(&m, 1, 1, wrap, huge_point)) return false;
    adopt(s, &m, "triangle-4k-tiles");
    s->center[0] = 500.0;
    s->center[2] = -500.0;
    s->size = 700.0;
    s->wide = true;
    s->def.triangle_count = 1;
    set_heights(s, 0.02, 0.0);
    set_uv(s, 4096.0, 4096.0, 0.0, 0.0, 0.0);
    return make_map(&s->def, 19, 13, ORACLE_U8, MAP_ROUGH);
}

static bool sail(truth_scene *s)
{
    static const bool wrap[2] = {false, false};
    mesh_arrays m;
    if (!make_grid(&m, 2, 3, wrap, sail_point)) return false;
    adopt(s, &m, "sail-512-noise");
    set_heights(s, 0.05, 0.0);
    set_wrap(s, ORACLE_CLAMP, ORACLE_CLAMP);
    return make_map(&s->def, 512, 512, ORACLE_U8, MAP_NOISE);
}

typedef bool scene_maker(truth_scene *s);
static scene_maker *const MAKERS[] = {
    ico20,     ico80_x4,   torus,      cylinder_tiled, torus_3x200,   plane,     latlong, checker,
    far_torus, tiny_torus, huge_torus, unnormalised,   lod_integer,   lod_float, folded,  folded_torus,
    flat_uv,   rotated,    constant,   torus_1x5,      huge_triangle, sail,
};

int truth_scene_count(void)
{
    return (int)(sizeof MAKERS / sizeof MAKERS[0]);
}

bool truth_scene_make(int index, truth_scene *scene)
{
    memset(scene, 0, sizeof *scene);
    return MAKERS[index](scene);
}

void truth_scene_free(truth_scene *scene)
{
    free((void *)(uintptr_t)scene->def.positions);
    free((void *)(uintptr_t)scene->def.normals);
    free((void *)(uintptr_t)scene->def.texcoords);
    free((void *)(uintptr_t)scene->def.triangles);
    free((void *)(uintptr_t)scene->def.samples);
    memset(scene, 0, sizeof *scene);
}
