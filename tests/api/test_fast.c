/* The method `fast` against `rmip` on the same surfaces and rays, feature by feature. Where the two differ
 * the oracle decides (or `tfdm`, on what the oracle does not know): only rays that run within rounding of a
 * tangency, a crease, an open edge or the border of [tmin, tmax] may, and hardly any do.
 *
 * KNURL_FAST_SCALE (default 1) scales the number of rays, KNURL_FAST_SEED changes them, KNURL_FAST_CASE runs
 * one case only. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "support/compare.h"
#include "support/random.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

enum { MOST_VERTICES = 700, MOST_TRIANGLES = 1200 };

/* ---- bases -------------------------------------------------------------------------------------------- */

typedef struct base {
    float positions[3 * MOST_VERTICES], normals[3 * MOST_VERTICES], texcoords[2 * MOST_VERTICES];
    float directions[3 * MOST_VERTICES];
    uint32_t triangles[3 * MOST_TRIANGLES];
    uint32_t vertices, faces;
    bool has_directions;
} base;

static void add_vertex(base *m, const double p[3], const double n[3], double u, double v)
{
    assert_true(m->vertices < MOST_VERTICES);
    for (int k = 0; k < 3; k++) {
        m->positions[3 * m->vertices + (uint32_t)k] = (float)p[k];
        m->normals[3 * m->vertices + (uint32_t)k] = (float)n[k];
    }
    m->texcoords[2 * m->vertices] = (float)u;
    m->texcoords[2 * m->vertices + 1] = (float)v;
    m->vertices++;
}

static void add_face(base *m, uint32_t a, uint32_t b, uint32_t c)
{
    assert_true(m->faces < MOST_TRIANGLES);
    uint32_t *t = &m->triangles[3 * m->faces++];
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

typedef void surface_point(double s, double t, double p[3], double n[3]);

/* Column and row 0 repeat bit for bit where the surface closes. */
static void make_grid(base *m, int across, int down, bool close_s, bool close_t, surface_point *point)
{
    memset(m, 0, sizeof *m);
    for (int j = 0; j <= down; j++)
        for (int i = 0; i <= across; i++) {
            double p[3], n[3];
            point((double)(close_s ? i % across : i) / across, (double)(close_t ? j % down : j) / down, p, n);
            add_vertex(m, p, n, (double)i / across, (double)j / down);
        }
    for (int j = 0; j < down; j++)
        for (int i = 0; i < across; i++) {
            uint32_t a = (uint32_t)(j * (across + 1) + i), b = a + 1, c = a + (uint32_t)across + 1, d = c + 1;
            add_face(m, a, b, d);
            add_face(m, a, d, c);
        }
}

static void plane_point(double s, double t, double p[3], double n[3])
{
    const double up[3] = {0.0, 1.0, 0.0}, at[3] = {2.0 * s - 1.0, 0.0, 1.0 - 2.0 * t};
    memcpy(p, at, sizeof at);
    memcpy(n, up, sizeof up);
}

/* No axis is special. */
static void tilted_point(double s, double t, double p[3], double n[3])
{
    const double e[3] = {0.8, 0.36, -0.48}, f[3] = {-0.6, 0.48, -0.64}, up[3] = {0.0, 0.8, 0.6};
    for (int k = 0; k < 3; k++) {
        p[k] = (2.0 * s - 1.0) * e[k] + (2.0 * t - 1.0) * f[k];
        n[k] = up[k];
    }
}

static void sail_point(double s, double t, double p[3], double n[3])
{
    double x = 2.0 * s - 1.0, z = 1.0 - 2.0 * t;
    const double at[3] = {x, 0.3 * x * x - 0.4 * z * x, z}, up[3] = {-(0.6 * x - 0.4 * z), 1.0, 0.4 * x};
    memcpy(p, at, sizeof at);
    memcpy(n, up, sizeof up);
}

static void torus_point(double s, double t, double p[3], double n[3])
{
    double cs = cos(2 * PI * s), ss = sin(2 * PI * s), ct = cos(2 * PI * t), st = sin(2 * PI * t);
    const double out[3] = {ct * cs, st, ct * ss};
    memcpy(n, out, sizeof out);
    p[0] = (1.0 + 0.4 * ct) * cs;
    p[1] = 0.4 * st;
    p[2] = (1.0 + 0.4 * ct) * ss;
}

/* With triangles without area at the poles. */
static void sphere_point(double s, double t, double p[3], double n[3])
{
    double r = t <= 0.0 || t >= 1.0 ? 0.0 : sin(PI * t);
    const double out[3] = {r * cos(2 * PI * s), cos(PI * t), r * sin(2 * PI * s)};
    memcpy(p, out, sizeof out);
    memcpy(n, out, sizeof out);
}

static void make_plane(base *m)
{
    make_grid(m, 1, 1, false, false, plane_point);
}
static void make_tilted(base *m)
{
    make_grid(m, 1, 1, false, false, tilted_point);
}
static void make_sail(base *m)
{
    make_grid(m, 3, 2, false, false, sail_point);
}
static void make_torus(base *m)
{
    make_grid(m, 9, 6, true, true, torus_point);
}
static void make_fine_torus(base *m)
{
    make_grid(m, 30, 18, true, true, torus_point);
}
static void make_sphere(base *m)
{
    make_grid(m, 10, 6, true, false, sphere_point);
}

/* Normals at the middle of a face have a third of their length. */
static void make_tetrahedron(base *m)
{
    static const double corners[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
    memset(m, 0, sizeof *m);
    for (int i = 0; i < 4; i++)
        add_vertex(m, corners[i], corners[i], 0.5 + 0.3 * corners[i][0] + 0.07 * corners[i][2],
                   0.5 + 0.3 * corners[i][1] - 0.11 * corners[i][2]);
    add_face(m, 0, 1, 2);
    add_face(m, 0, 3, 1);
    add_face(m, 0, 2, 3);
    add_face(m, 1, 3, 2);
}

/* One edge along which normals turn by 160 degrees: |N| falls to 0.17. */
static void make_fan(base *m)
{
    static const double p[4][3] = {{-1, 0, -1}, {1, 0, -1}, {-1, 0, 1}, {1, 0, 1}};
    const double s = sin(80.0 * PI / 180.0), c = cos(80.0 * PI / 180.0);
    memset(m, 0, sizeof *m);
    for (int i = 0; i < 4; i++) {
        const double n[3] = {p[i][0] * s, c, 0.2 * p[i][2]};
        add_vertex(m, p[i], n, 0.5 + 0.5 * p[i][0], 0.5 + 0.5 * p[i][2]);
    }
    add_face(m, 0, 2, 1);
    add_face(m, 1, 2, 3);
}

static void make_folded(base *m)
{
    make_torus(m);
    for (uint32_t i = 0; i < m->vertices; i++)
        for (uint32_t k = 0; k < 3; k++) {
            const float *p = &m->positions[3 * i];
            double phase = 12.9 * (double)p[0] + 78.2 * (double)p[1] + 37.7 * (double)p[2] + 2.1 * (double)k;
            m->normals[3 * i + k] += (float)(0.7 * sin(phase));
        }
}

static void make_flat_uv(base *m)
{
    make_sail(m);
    for (uint32_t i = 0; i < m->vertices; i++) {
        const float *p = &m->positions[3 * i];
        double along = (double)p[0] > 0.0 ? 0.25 : 0.3 * (double)p[2];
        m->texcoords[2 * i] = (float)along;
        m->texcoords[2 * i + 1] = (float)(0.5 * along + 0.125);
    }
}

static void make_no_uv(base *m)
{
    make_torus(m);
    memset(m->texcoords, 0, sizeof m->texcoords);
}

/* Triangles whose corners coincide, or lie on a line, among others. */
static void make_degenerate(base *m)
{
    make_sail(m);
    add_face(m, 0, 0, 1);
    add_face(m, 2, 2, 2);
    double p[3][3] = {{0, 0.5, 0}, {0.5, 0.5, 0}, {1, 0.5, 0}}, n[3] = {0, 1, 0};
    for (int i = 0; i < 3; i++) add_vertex(m, p[i], n, 0.5 * i, 0.1 * i * i);
    add_face(m, m->vertices - 3, m->vertices - 2, m->vertices - 1);
}

/* All N point to one apex. */
static void make_frusta(base *m)
{
    static const double apex[3] = {0.1, 1.5, -0.2};
    make_grid(m, 3, 2, false, false, plane_point);
    m->has_directions = true;
    for (uint32_t i = 0; i < 3 * m->vertices; i++)
        m->directions[i] = (float)(apex[i % 3] - (double)m->positions[i]);
}

/* Directions that are long, short and lean over. */
static void make_leaning(base *m)
{
    make_sail(m);
    m->has_directions = true;
    for (uint32_t i = 0; i < m->vertices; i++) {
        double length = 1.0 + 0.6 * sin(5.0 * (double)i);
        for (uint32_t k = 0; k < 3; k++)
            m->directions[3 * i + k] =
                (float)(length * ((double)m->normals[3 * i + k] + (k == 0 ? 0.4 : 0.0)));
    }
}

/* ---- maps --------------------------------------------------------------------------------------------- */

typedef enum map_kind { WAVES, ROUGH, NOISE, STEPS, FLAT, BIPOLAR, HUGE_RANGE, TINY_RANGE, RAMP } map_kind;

static double map_value(map_kind kind, random_state *r, int i, int j, double x, double y)
{
    double waves = 0.5 + 0.2 * sin(2 * PI * (2 * x + y) + 0.3) + 0.15 * cos(2 * PI * (3 * y - x)) +
                   0.1 * sin(2 * PI * (7 * x + 5 * y));
    switch (kind) {
    case WAVES:
        return waves;
    case ROUGH:
        return fmin(fmax(waves + 0.4 * (random_unit(r) - 0.5), 0.0), 1.0);
    case NOISE:
        return random_unit(r);
    case STEPS:
        return (i / 2 + j / 2) % 2 ? 1.0 : 0.0;
    case FLAT:
        return 0.625;
    case BIPOLAR:
        return 2.0 * waves - 1.4 + 0.1 * random_unit(r);
    case HUGE_RANGE:
        return 1e15 * (waves - 0.5);
    case TINY_RANGE:
        return 1e-20 * (waves - 0.5);
    default:
        return x;
    }
}

static void *make_samples(int width, int height, oracle_format format, map_kind kind)
{
    unsigned char *bytes = malloc((size_t)width * (size_t)height * (size_t)format);
    random_state r = {(uint64_t)(width * 7919 + height * 104729 + (int)kind)};
    assert_non_null(bytes);
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            double value = map_value(kind, &r, i, j, (i + 0.5) / width, (j + 0.5) / height);
            size_t at = (size_t)j * (size_t)width + (size_t)i;
            float single = (float)value;
            uint16_t word = (uint16_t)(value * 65535.0 + 0.5);
            if (format == ORACLE_U8) bytes[at] = (unsigned char)(value * 255.0 + 0.5);
            if (format == ORACLE_U16) memcpy(bytes + 2 * at, &word, sizeof word);
            if (format == ORACLE_F32) memcpy(bytes + 4 * at, &single, sizeof single);
        }
    return bytes;
}

/* ---- a case ------------------------------------------------------------------------------------------- */

typedef struct fast_case {
    const char *name;
    void (*make)(base *m);
    int width, height;
    oracle_format format;
    map_kind kind;
    double factor, offset;
    oracle_wrap wrap_u, wrap_v;
    double scale_u, scale_v, offset_u, offset_v, rotation;
    double lod;
    double scale, move; /* of the object; 0: 1 */
    bool unnormalised;
    const char *method; /* NULL: fast */
    int rays;           /* 0: 1000 */
    bool extreme;       /* directions of any length, origins at any distance */
} fast_case;

typedef struct setup {
    const fast_case *c;
    base mesh;
    oracle_def def;
    void *samples;
    knurl_context *context;
    knurl_heightmap *map;
    knurl_surface *fast, *rmip, *tfdm;
    knurl_surface_info info;
    double size;
    /* The third opinion, made when first asked for. */
    oracle *o;
    knurl_scene *scene;
} setup;

static void set_def(setup *s)
{
    const fast_case *c = s->c;
    base *m = &s->mesh;
    double scale = c->scale != 0.0 ? c->scale : 1.0;
    const double moves[3] = {c->move, -c->move, 0.5 * c->move};
    for (uint32_t i = 0; i < 3 * m->vertices; i++)
        m->positions[i] = (float)(scale * (double)m->positions[i] + moves[i % 3]);
    s->def =
        (oracle_def){.positions = m->positions,
                     .normals = m->normals,
                     .texcoords = m->texcoords,
                     .vertex_count = m->vertices,
                     .triangles = m->triangles,
                     .triangle_count = m->faces,
                     .width = c->width,
                     .height = c->height,
                     .format = c->format,
                     .samples = s->samples,
                     .factor = c->factor * scale,
                     .offset = c->offset * scale,
                     .wrap_u = c->wrap_u,
                     .wrap_v = c->wrap_v,
                     .uv_offset = {c->offset_u, c->offset_v},
                     .uv_scale = {c->scale_u != 0.0 ? c->scale_u : 1.0, c->scale_v != 0.0 ? c->scale_v : 1.0},
                     .uv_rotation = c->rotation,
                     .unnormalised = c->unnormalised,
                     .lod = c->lod};
    s->size = scale;
}

static knurl_surface *make_surface(setup *s, const char *method)
{
    const oracle_def *def = &s->def;
    knurl_surface_def out = knurl_surface_def_default();
    out.mesh = (knurl_mesh_view){.positions = def->positions,
                                 .normals = def->normals,
                                 .texcoords = def->texcoords,
                                 .vertex_count = def->vertex_count,
                                 .triangles = def->triangles,
                                 .triangle_count = def->triangle_count,
                                 .directions = s->mesh.has_directions ? s->mesh.directions : NULL};
    knurl_displacement *d = &out.displacement;
    d->map = s->map;
    d->factor = def->factor;
    d->offset = def->offset;
    d->wrap_u = (knurl_wrap)def->wrap_u; /* in the same order */
    d->wrap_v = (knurl_wrap)def->wrap_v;
    memcpy(d->uv_offset, def->uv_offset, sizeof d->uv_offset);
    memcpy(d->uv_scale, def->uv_scale, sizeof d->uv_scale);
    d->uv_rotation = def->uv_rotation;
    d->unnormalised = def->unnormalised;
    out.method = method;
    knurl_surface *surface = NULL;
    knurl_error error = {.message = ""};
    if (knurl_surface_create(s->context, &out, &surface, &error) != KNURL_OK)
        fail_msg("%s: %s", s->c->name, error.message);
    return surface;
}

static void setup_make(setup *s, const fast_case *c)
{
    memset(s, 0, sizeof *s);
    s->c = c;
    c->make(&s->mesh);
    s->samples = make_samples(c->width, c->height, c->format, c->kind);
    set_def(s);
    knurl_context_def context = knurl_context_def_default();
    assert_int_equal(knurl_context_create(&context, &s->context, NULL), KNURL_OK);
    knurl_pixel_format format = c->format == ORACLE_U8    ? KNURL_PIXEL_U8
                                : c->format == ORACLE_U16 ? KNURL_PIXEL_U16
                                                          : KNURL_PIXEL_F32;
    knurl_image *image = NULL;
    assert_int_equal(knurl_image_create(s->context, c->width, c->height, 1, format, s->samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def map = knurl_heightmap_def_default();
    map.image = image;
    assert_int_equal(knurl_heightmap_create(s->context, &map, &s->map, NULL), KNURL_OK);
    knurl_image_release(image);
    s->fast = make_surface(s, c->method ? c->method : "fast");
    s->rmip = make_surface(s, "rmip");
    knurl_surface_get_info(s->rmip, &s->info);
}

static void setup_free(setup *s)
{
    if (s->o) oracle_destroy(s->o);
    knurl_scene_release(s->scene);
    knurl_surface_release(s->fast);
    knurl_surface_release(s->rmip);
    knurl_surface_release(s->tfdm);
    knurl_heightmap_release(s->map);
    knurl_context_release(s->context);
    free(s->samples);
}

/* ---- rays --------------------------------------------------------------------------------------------- */

static void unit_vector(random_state *r, double d[3])
{
    double z = random_range(r, -1.0, 1.0), a = random_range(r, 0.0, 2.0 * PI), q = sqrt(1.0 - z * z);
    d[0] = q * cos(a);
    d[1] = q * sin(a);
    d[2] = z;
}

/* A point of a random triangle's shell, and N there. */
static void shell_point(const setup *s, random_state *r, double p[3], double n[3])
{
    const base *m = &s->mesh;
    const uint32_t *v = &m->triangles[3 * random_index(r, m->faces)];
    const float *from = m->has_directions ? m->directions : m->normals;
    double a = random_unit(r), b = random_unit(r);
    if (a + b > 1.0) a = 1.0 - a, b = 1.0 - b;
    if (random_index(r, 16) == 0) a = 0.0;
    const double w[3] = {1.0 - a - b, a, b};
    for (int k = 0; k < 3; k++) {
        p[k] = n[k] = 0.0;
        for (int i = 0; i < 3; i++) {
            p[k] += w[i] * (double)m->positions[3 * v[i] + (uint32_t)k];
            n[k] += w[i] * (double)from[3 * v[i] + (uint32_t)k];
        }
    }
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    double h = random_range(r, s->info.height_min, s->info.height_max);
    if (random_index(r, 8) == 0) h = random_index(r, 2) ? s->info.height_min : s->info.height_max;
    for (int k = 0; k < 3; k++) {
        if (!m->has_directions && !s->def.unnormalised) n[k] /= length;
        p[k] += h * n[k];
        if (m->has_directions || s->def.unnormalised) n[k] /= length;
    }
}

static void choose_direction(random_state *r, const double n[3], double d[3])
{
    unit_vector(r, d);
    double along = d[0] * n[0] + d[1] * n[1] + d[2] * n[2], lean = pow(10.0, random_range(r, -7.0, 0.0));
    switch (random_index(r, 8)) {
    case 0: /* along the normal */
        for (int k = 0; k < 3; k++) d[k] = -n[k];
        break;
    case 1: /* nearly so */
        for (int k = 0; k < 3; k++) d[k] = -n[k] + lean * d[k];
        break;
    case 2:
    case 3: /* grazing */
        for (int k = 0; k < 3; k++) d[k] += (lean - along) * n[k];
        break;
    case 4: { /* along an axis */
        uint32_t axis = random_index(r, 3);
        double sign = random_index(r, 2) ? 1.0 : -1.0;
        for (uint32_t k = 0; k < 3; k++) d[k] = k == axis ? sign : 0.0;
        break;
    }
    default:
        break;
    }
}

static knurl_ray make_ray(const setup *s, random_state *r)
{
    static const double far[] = {0.0, 0.0, 0.01, 0.3, 3.0, 3.0, 3.0, 100.0};
    double p[3], n[3], d[3], origin[3];
    shell_point(s, r, p, n);
    choose_direction(r, n, d);
    double distance = far[random_index(r, 8)] * s->size, length = pow(2.0, random_range(r, -3.0, 3.0));
    if (s->c->extreme) {
        length = pow(10.0, random_range(r, -150.0, 150.0));
        if (random_index(r, 2)) distance = s->size * pow(10.0, random_range(r, 0.0, 12.0));
    }
    for (int k = 0; k < 3; k++) {
        origin[k] = p[k] - distance * d[k];
        d[k] *= length;
    }
    knurl_ray ray = knurl_ray_make(origin, d);
    ray.lod = (float)s->c->lod;
    uint32_t window = random_index(r, 8);
    if (window == 0) ray.tmin = (distance + s->size * random_range(r, -0.2, 0.2)) / length;
    if (window == 1) ray.tmax = (distance + s->size * random_range(r, -0.2, 0.2)) / length;
    if (window == 2) {
        ray.tmin = (distance + s->size * random_range(r, -0.2, 0.0)) / length;
        ray.tmax = (distance + s->size * random_range(r, 0.0, 0.2)) / length;
    }
    ray.tmin = fmax(ray.tmin, 0.0);
    ray.tmax = fmax(ray.tmax, ray.tmin);
    return ray;
}

/* ---- comparing ---------------------------------------------------------------------------------------- */

static bool first_hit(const knurl_surface *surface, knurl_ray ray, knurl_hit *hit)
{
    uint32_t count = knurl_surface_shell_count(surface);
    bool found = false;
    memset(hit, 0, sizeof *hit);
    hit->triangle = KNURL_NO_HIT;
    for (uint32_t i = 0; i < count; i++)
        if (knurl_surface_intersect(surface, i, &ray, hit)) {
            found = true;
            ray.tmax = hit->t;
        }
    return found;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* How far apart two answers for the same root may be along the ray. */
static double allowed_dt(const setup *s, const knurl_ray *ray, const knurl_hit *hit)
{
    double length = sqrt(dot(ray->direction, ray->direction)), size = s->size + fabs(s->c->move) + 1e-300,
           d[3];
    for (int k = 0; k < 3; k++) {
        size = fmax(size, fabs(ray->origin[k]));
        d[k] = ray->direction[k] / length;
    }
    size = fmax(size, fmax(fabs(s->info.height_min), fabs(s->info.height_max)));
    double cosine = fmax(fabs(dot(hit->ng, d)), 1e-7);
    return 1e-10 * hit->t + 1e-14 * size / length / cosine;
}

typedef enum sameness { SAME, OTHER_ROOT, OTHER_FIELDS } sameness;

/* Geometric normals of two pieces differ where they meet; all else is continuous. */
static bool near_border(const setup *s, const knurl_hit *hit)
{
    double x = hit->uv[0] * s->c->width - 0.5, y = hit->uv[1] * s->c->height - 0.5;
    double ulps = 1e-7 + 1e-13 * (fabs(x) + fabs(y));
    return s->c->lod > 0.0 || fabs(x - round(x)) < ulps || fabs(y - round(y)) < ulps || hit->a < 1e-9 ||
           hit->b < 1e-9 || hit->a + hit->b > 1.0 - 1e-9;
}

static sameness compare_hits(const setup *s, const knurl_ray *ray, const knurl_hit *p, const knurl_hit *q)
{
    double dt = allowed_dt(s, ray, q);
    if (!(fabs(p->t - q->t) <= dt)) return OTHER_ROOT;
    bool edge = q->a < 1e-8 || q->b < 1e-8 || q->a + q->b > 1.0 - 1e-8;
    if (p->triangle != q->triangle) return edge ? SAME : OTHER_ROOT;
    double off = dt * sqrt(dot(ray->direction, ray->direction)) + 1e-10 * s->size, worst = 0.0, bent = 0.0;
    for (int k = 0; k < 3; k++) {
        worst = fmax(worst, fabs(p->position[k] - q->position[k]));
        bent = fmax(bent, fabs(p->ns[k] - q->ns[k]));
        if (!near_border(s, q)) bent = fmax(bent, fabs(p->ng[k] - q->ng[k]));
    }
    if (!(worst <= 4.0 * off) || !(bent <= 1e-5)) return OTHER_FIELDS;
    double texels = fmax(fabs(s->def.uv_scale[0]), fabs(s->def.uv_scale[1]));
    for (int k = 0; k < 2; k++) {
        if (!(fabs(p->uv[k] - q->uv[k]) <= 1e-6 * texels + 1e-12 * fabs(q->uv[k]))) return OTHER_FIELDS;
        if (!(fabs(p->st[k] - q->st[k]) <= 1e-6)) return OTHER_FIELDS;
    }
    return fabs(p->height - q->height) <= 1e-6 * s->size ? SAME : OTHER_FIELDS;
}

static void print_difference(const setup *s, const knurl_ray *ray, bool fast, const knurl_hit *f, bool rmip,
                             const knurl_hit *r, bool occluded, const char *what)
{
    printf("%s: %s\n  origin %a,%a,%a direction %a,%a,%a t in [%a, %a]\n", s->c->name, what, ray->origin[0],
           ray->origin[1], ray->origin[2], ray->direction[0], ray->direction[1], ray->direction[2], ray->tmin,
           ray->tmax);
    if (fast) printf("  fast t %.17g triangle %u (%.9g, %.9g)\n", f->t, f->triangle, f->a, f->b);
    if (rmip) printf("  rmip t %.17g triangle %u (%.9g, %.9g)\n", r->t, r->triangle, r->a, r->b);
    printf("  fast %d rmip %d fast occluded %d\n", fast, rmip, occluded);
}

static void make_third(setup *s)
{
    if (s->mesh.has_directions) {
        if (!s->tfdm) s->tfdm = make_surface(s, "tfdm");
        return;
    }
    if (s->o) return;
    uint32_t object = 0, instance = 0;
    s->o = oracle_create(&s->def);
    assert_non_null(s->o);
    assert_int_equal(knurl_scene_create(s->context, &s->scene, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_surface(s->scene, s->fast, &object, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_add_instance(s->scene, object, NULL, UINT32_MAX, &instance, NULL), KNURL_OK);
    assert_int_equal(knurl_scene_commit(s->scene, NULL), KNURL_OK);
}

/* Whether rounding may decide this ray, on which fast differs from rmip. Prints what it finds wrong. */
static bool excused(setup *s, const knurl_ray *ray, const knurl_hit *f, bool fast)
{
    make_third(s);
    if (s->mesh.has_directions) {
        knurl_hit t;
        bool tfdm = first_hit(s->tfdm, *ray, &t);
        return tfdm == fast && (!fast || compare_hits(s, ray, f, &t) == SAME);
    }
    oracle_ray asked = {.tmin = ray->tmin, .tmax = ray->tmax};
    memcpy(asked.origin, ray->origin, sizeof asked.origin);
    memcpy(asked.direction, ray->direction, sizeof asked.direction);
    traced t = {s->context, s->fast, s->scene, (float)s->c->lod};
    compare_result result = compare_ray(s->o, &t, &asked);
    if (result.verdict <= COMPARE_UNSURE) {
        if (getenv("KNURL_FAST_VERBOSE")) compare_print_unsure(s->c->name, s->o, &asked, &result);
        return true;
    }
    compare_print(s->c->name, s->o, &asked, &result);
    return false;
}

/* Whether all is well. */
static bool run_case(const fast_case *c)
{
    static setup s;
    const char *scale = getenv("KNURL_FAST_SCALE"), *seed = getenv("KNURL_FAST_SEED");
    const char *only = getenv("KNURL_FAST_CASE");
    if (only && strcmp(only, c->name) != 0) return true;
    setup_make(&s, c);
    int rays = (int)((c->rays ? c->rays : 1000) * (scale ? strtod(scale, NULL) : 1.0));
    random_state r = {seed ? strtoull(seed, NULL, 10) : 7};
    int hits = 0, doubtful = 0, wrong = 0, fields = 0, occlusions = 0;
    for (int i = 0; i < rays; i++) {
        knurl_ray ray = make_ray(&s, &r);
        knurl_hit f, q;
        bool fast = first_hit(s.fast, ray, &f), rmip = first_hit(s.rmip, ray, &q);
        bool occluded = knurl_surface_occluded(s.fast, 0, &ray);
        hits += fast;
        sameness same = fast != rmip ? OTHER_ROOT : fast ? compare_hits(&s, &ray, &f, &q) : SAME;
        if (same == OTHER_FIELDS && fields++ < 4)
            print_difference(&s, &ray, fast, &f, rmip, &q, occluded, "same t, other fields");
        if (same == OTHER_ROOT) {
            if (excused(&s, &ray, &f, fast))
                doubtful++;
            else if (wrong++ < 4)
                print_difference(&s, &ray, fast, &f, rmip, &q, occluded, "another answer");
        }
        if (occluded != fast && occlusions++ < 4)
            print_difference(&s, &ray, fast, &f, rmip, &q, occluded, "occluded contradicts intersect");
    }
    setup_free(&s);
    /* Some rays run in the plane of a flat top, on purpose. */
    bool good = wrong + fields + occlusions == 0 && doubtful <= 1 + rays / 200 && hits > rays / 20;
    if (getenv("KNURL_FAST_VERBOSE") || !good)
        printf("%-24s %6d rays %6d hits %4d doubtful %4d wrong %4d fields %4d occlusions\n", c->name, rays,
               hits, doubtful, wrong, fields, occlusions);
    fflush(stdout);
    return good;
}

static void run_cases(const fast_case *cases, size_t count)
{
    bool good = true;
    for (size_t i = 0; i < count; i++) good = run_case(&cases[i]) && good;
    assert_true(good);
}
#define RUN(cases) run_cases(cases, sizeof(cases) / sizeof *(cases))

/* ---- the cases ---------------------------------------------------------------------------------------- */

#define SURFACE(n, m, w, h, f, k, a, o)                                                                      \
    .name = n, .make = m, .width = w, .height = h, .format = f, .kind = k, .factor = a, .offset = o
#define UV(wu, wv, su, sv, ou, ov, r)                                                                        \
    .wrap_u = ORACLE_##wu, .wrap_v = ORACLE_##wv, .scale_u = su, .scale_v = sv, .offset_u = ou,              \
    .offset_v = ov, .rotation = r

static void map_sizes(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("map-1x1", make_torus, 1, 1, ORACLE_U8, ROUGH, 0.1, 0.0)},
        {SURFACE("map-1x9", make_torus, 1, 9, ORACLE_U8, NOISE, 0.2, 0.0)},
        {SURFACE("map-1x200", make_plane, 1, 200, ORACLE_U16, ROUGH, 0.3, -0.1)},
        {SURFACE("map-3x5", make_torus, 3, 5, ORACLE_U16, NOISE, 0.2, 0.0)},
        {SURFACE("map-17x33", make_torus, 17, 33, ORACLE_F32, ROUGH, 0.15, 0.0)},
        {SURFACE("map-64x64", make_sphere, 64, 64, ORACLE_U8, ROUGH, 0.15, 0.0)},
        {SURFACE("map-100x70", make_plane, 100, 70, ORACLE_U16, ROUGH, 0.3, 0.0)},
        {SURFACE("map-256x256", make_tilted, 256, 256, ORACLE_U16, WAVES, 0.4, 0.0)},
        {SURFACE("map-256x256-noise", make_plane, 256, 256, ORACLE_U8, NOISE, 0.05, 0.0)},
        {SURFACE("map-256x256-torus", make_torus, 256, 256, ORACLE_U16, WAVES, 0.15, 0.0)},
    };
    RUN(cases);
}

static void heights(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("steps", make_plane, 64, 64, ORACLE_U8, STEPS, 0.1, 0.0)},
        {SURFACE("steps-torus", make_torus, 64, 32, ORACLE_U8, STEPS, 0.1, 0.0)},
        {SURFACE("flat", make_plane, 64, 64, ORACLE_U8, FLAT, 0.3, 0.0)},
        {SURFACE("flat-float-torus", make_torus, 64, 64, ORACLE_F32, FLAT, 0.1, 0.0)},
        {SURFACE("bipolar", make_torus, 64, 64, ORACLE_F32, BIPOLAR, 0.1, 0.0)},
        {SURFACE("huge-range", make_torus, 64, 64, ORACLE_F32, HUGE_RANGE, 2e-16, 0.0)},
        {SURFACE("tiny-range", make_torus, 64, 64, ORACLE_F32, TINY_RANGE, 2e17, 0.0)},
        {SURFACE("negative-factor", make_torus, 64, 64, ORACLE_U16, ROUGH, -0.1, 0.05)},
        {SURFACE("zero-factor", make_torus, 64, 64, ORACLE_U16, ROUGH, 0.0, 0.05)},
        {SURFACE("zero-height", make_torus, 64, 64, ORACLE_U16, ROUGH, 0.0, 0.0)},
    };
    RUN(cases);
}

static void large_offsets(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("offset-1", make_plane, 64, 64, ORACLE_U16, STEPS, 1e-2, 1.0)},
        {SURFACE("offset-0.7-small", make_plane, 64, 64, ORACLE_U16, STEPS, 1e-4, 0.7)},
        {SURFACE("offset-0.9-tiny", make_plane, 64, 64, ORACLE_U16, STEPS, 1e-6, 0.9)},
        {SURFACE("offset-1.3-tilted", make_tilted, 64, 64, ORACLE_U8, STEPS, 3e-5, 1.3)},
        {SURFACE("offset-30", make_tilted, 64, 64, ORACLE_U8, ROUGH, 0.1, 30.0)},
        {SURFACE("offset-1000", make_plane, 64, 64, ORACLE_U16, ROUGH, 0.1, -1000.0)},
        {SURFACE("offset-torus", make_torus, 64, 64, ORACLE_U16, STEPS, 1e-4, 0.1)},
        {SURFACE("offset-torus-negative", make_torus, 64, 64, ORACLE_U16, ROUGH, 1e-3, -0.13)},
        {SURFACE("offset-sphere", make_sphere, 64, 64, ORACLE_U16, STEPS, 1e-2, 20.0)},
    };
    RUN(cases);
}

static void wrapping(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("mirror-repeat", make_plane, 37, 41, ORACLE_U16, ROUGH, 0.1, 0),
         UV(MIRROR, REPEAT, 3, 5, -1.3, 0.4, 0)},
        {SURFACE("clamp-mirror", make_torus, 33, 40, ORACLE_U8, ROUGH, 0.1, 0),
         UV(CLAMP, MIRROR, 3, 2, -0.7, 0.4, 0)},
        {SURFACE("repeat-clamp", make_sail, 64, 48, ORACLE_U16, ROUGH, 0.1, 0),
         UV(REPEAT, CLAMP, 2, 2.5, -9.7, -0.4, 0)},
        {SURFACE("clamp-clamp", make_plane, 64, 48, ORACLE_U16, ROUGH, 0.1, 0),
         UV(CLAMP, CLAMP, 4, 4, -1.5, -1.2, 0.5)},
        {SURFACE("mirror-mirror", make_torus, 20, 48, ORACLE_U16, ROUGH, 0.1, 0),
         UV(MIRROR, MIRROR, 4, 4, -7.5, -3.2, 0.8)},
        {SURFACE("repeat-far", make_plane, 64, 48, ORACLE_U16, ROUGH, 0.1, 0),
         UV(REPEAT, REPEAT, 1, 1, 1000.3, -5000.6, 0)},
        {SURFACE("mirror-far", make_plane, 64, 48, ORACLE_U16, ROUGH, 0.1, 0),
         UV(MIRROR, MIRROR, 1, 1, 1000.3, -5000.6, 0)},
        {SURFACE("clamp-far", make_plane, 64, 48, ORACLE_U16, ROUGH, 0.1, 0),
         UV(CLAMP, REPEAT, 1, 1, 1000.3, -5000.6, 0)},
        {SURFACE("clamp-very-far", make_plane, 4096, 2, ORACLE_U16, RAMP, 0.3, 0),
         UV(CLAMP, REPEAT, 1, 1, 9e5, 0, 0)},
        {SURFACE("clamp-very-far-down", make_plane, 4096, 2, ORACLE_U16, RAMP, 0.3, 0),
         UV(CLAMP, REPEAT, 1, 1, -9e5, 0, 0)},
        {SURFACE("mirror-very-far", make_plane, 4096, 2, ORACLE_U16, RAMP, 0.3, 0),
         UV(MIRROR, CLAMP, 1, 1, 9e5, 0, 0)},
    };
    RUN(cases);
}

static void transforms(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("rotated", make_torus, 64, 48, ORACLE_U16, ROUGH, 0.1, 0), .scale_u = 2, .scale_v = 3,
         .rotation = 1.1},
        {SURFACE("negative-scale", make_torus, 64, 48, ORACLE_U16, ROUGH, 0.1, 0), .scale_u = -1,
         .scale_v = -2},
        {SURFACE("one-negative", make_plane, 64, 48, ORACLE_U16, ROUGH, 0.1, 0), .scale_u = -1.5,
         .scale_v = 2},
        {SURFACE("many-per-texel", make_fine_torus, 8, 8, ORACLE_U16, NOISE, 0.1, 0), .scale_u = 0.3,
         .scale_v = 0.2},
        {SURFACE("within-a-texel", make_fine_torus, 8, 8, ORACLE_U16, NOISE, 0.1, 0), .scale_u = 1e-3,
         .scale_v = 1e-3},
        {SURFACE("tiles-300", make_plane, 16, 16, ORACLE_U8, ROUGH, 0.005, 0), .scale_u = 300,
         .scale_v = 300},
        {SURFACE("tiles-100-torus", make_torus, 32, 32, ORACLE_U8, ROUGH, 0.01, 0), .scale_u = 100,
         .scale_v = 60},
        {SURFACE("mirror-tiles", make_plane, 16, 16, ORACLE_U8, ROUGH, 0.05, 0),
         UV(MIRROR, MIRROR, 40, 40, 0, 0, 0)},
        {SURFACE("stretched", make_plane, 256, 16, ORACLE_U8, ROUGH, 0.1, 0), .scale_u = 20, .scale_v = 0.01},
        {SURFACE("sheared", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0), .scale_u = 30, .scale_v = 0.2,
         .rotation = 0.7},
    };
    RUN(cases);
}

static void shapes(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("tetrahedron", make_tetrahedron, 64, 64, ORACLE_U16, WAVES, 0.1, 0.0)},
        {SURFACE("tetrahedron-low", make_tetrahedron, 64, 64, ORACLE_U16, ROUGH, 0.01, 0.0)},
        {SURFACE("tetrahedron-raised", make_tetrahedron, 64, 64, ORACLE_U16, ROUGH, 0.02, 0.4)},
        {SURFACE("fan", make_fan, 64, 64, ORACLE_U16, WAVES, 0.05, 0.0)},
        {SURFACE("fan-low", make_fan, 64, 64, ORACLE_U16, WAVES, 0.005, 0.0)},
        {SURFACE("fan-rough", make_fan, 128, 128, ORACLE_U16, ROUGH, 0.01, 0.0)},
        {SURFACE("folded", make_folded, 32, 24, ORACLE_U8, WAVES, 0.9, -0.6), .rays = 300},
        {SURFACE("fold-margin", make_folded, 32, 24, ORACLE_U8, ROUGH, 0.1, 0.0)},
        {SURFACE("flat-uv", make_flat_uv, 32, 24, ORACLE_U8, ROUGH, 0.1, 0.0)},
        {SURFACE("no-uv", make_no_uv, 32, 24, ORACLE_U8, ROUGH, 0.1, 0.0)},
        {SURFACE("degenerate", make_degenerate, 32, 24, ORACLE_U8, ROUGH, 0.1, 0.0)},
        {SURFACE("unnormalised", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .unnormalised = true},
        {SURFACE("unnormalised-tetrahedron", make_tetrahedron, 64, 64, ORACLE_U8, ROUGH, 0.2, 0.0),
         .unnormalised = true},
        {SURFACE("frusta", make_frusta, 64, 64, ORACLE_U8, ROUGH, 0.4, 0.1)},
        {SURFACE("frusta-waves", make_frusta, 64, 64, ORACLE_F32, BIPOLAR, 0.2, 0.0)},
        {SURFACE("leaning", make_leaning, 64, 64, ORACLE_U8, ROUGH, 0.3, 0.0)},
    };
    RUN(cases);
}

static void places(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("scale-1e-6", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .scale = 1e-6},
        {SURFACE("scale-1e6", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .scale = 1e6},
        {SURFACE("scale-1e-15", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .scale = 1e-15},
        {SURFACE("far-1e5", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .move = 1e5},
        {SURFACE("far-1e7", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .scale = 1000.0, .move = 1e7},
        {SURFACE("extreme-rays", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .extreme = true},
        {SURFACE("extreme-rays-plane", make_plane, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .extreme = true},
        {SURFACE("extreme-rays-1e6", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .scale = 1e6,
         .extreme = true},
    };
    RUN(cases);
}

static void levels_of_detail(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("lod-0.3", make_torus, 64, 48, ORACLE_U8, NOISE, 0.1, 0.0), .lod = 0.3},
        {SURFACE("lod-1", make_torus, 64, 48, ORACLE_U8, NOISE, 0.1, 0.0), .lod = 1.0},
        {SURFACE("lod-2.7", make_sail, 64, 48, ORACLE_U16, NOISE, 0.3, 0.0), .lod = 2.7},
        {SURFACE("lod-coarsest", make_torus, 64, 48, ORACLE_U8, NOISE, 0.1, 0.0), .lod = 6.0},
        {SURFACE("lod-over", make_torus, 64, 48, ORACLE_F32, NOISE, 0.1, 0.0), .lod = 60.0},
    };
    RUN(cases);
}

static void budgets(void **state)
{
    (void)state;
    static const fast_case cases[] = {
        {SURFACE("budget-0", make_torus, 64, 64, ORACLE_U8, ROUGH, 0.1, 0.0), .method = "fast:budget=0"},
        {SURFACE("budget-tiny", make_torus, 256, 256, ORACLE_U8, ROUGH, 0.1, 0.0),
         .method = "fast:budget=0.0001"},
        {SURFACE("budget-coarse", make_torus, 256, 256, ORACLE_U16, WAVES, 0.1, 0.0),
         .method = "fast:budget=0.03"},
        {SURFACE("budget-coarse-plane", make_plane, 256, 256, ORACLE_U16, ROUGH, 0.1, 0.0),
         .method = "fast:budget=0.001"},
        /* Parts much larger than triangles. */
        {SURFACE("budget-large-parts", make_fine_torus, 512, 512, ORACLE_U16, WAVES, 0.15, 0.0),
         .method = "fast:budget=0.125"},
        {SURFACE("budget-larger-parts", make_fine_torus, 1024, 1024, ORACLE_U16, WAVES, 0.15, 0.0),
         .method = "fast:budget=0.115"},
        {SURFACE("budget-huge", make_torus, 256, 256, ORACLE_U8, ROUGH, 0.1, 0.0),
         .method = "fast:budget=1048576"},
        {SURFACE("budget-huge-tiles", make_plane, 64, 64, ORACLE_U8, ROUGH, 0.05, 0.0), .scale_u = 20,
         .scale_v = 20, .method = "fast:budget=100"},
    };
    RUN(cases);
}

/* Outside of one side of a triangle at both ends of a texel, and inside between them. */
static void a_curve_bows_into_a_triangle(void **state)
{
    (void)state;
    static const fast_case c = {SURFACE("bow", make_torus, 3, 5, ORACLE_U16, NOISE, 0.2, 0.0)};
    static setup s;
    const double origin[3] = {-0x1.02a844e479d48p-4, 0x1.b2a77aacfead4p-1, -0x1.9761a75ce6bacp-1};
    const double direction[3] = {-0x1.699c13b10198fp-4, -0x1.0c3bbb2985d4ep-5, 0x1.db043476179d6p-6};
    setup_make(&s, &c);
    knurl_ray ray = knurl_ray_make(origin, direction);
    knurl_hit f, q;
    assert_true(first_hit(s.fast, ray, &f) && first_hit(s.rmip, ray, &q));
    assert_int_equal(q.triangle, 29);
    assert_int_equal(compare_hits(&s, &ray, &f, &q), SAME);
    setup_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(map_sizes),     cmocka_unit_test(heights),
        cmocka_unit_test(large_offsets), cmocka_unit_test(wrapping),
        cmocka_unit_test(transforms),    cmocka_unit_test(shapes),
        cmocka_unit_test(places),        cmocka_unit_test(levels_of_detail),
        cmocka_unit_test(budgets),       cmocka_unit_test(a_curve_bows_into_a_triangle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
