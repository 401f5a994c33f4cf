/* PDM: Hoetzlein: "Projective Displacement Mapping for Ray Traced Editable Surfaces", 2025. Algorithm 1.
 *
 * The ray is sampled at equal distances in object space between its entry into the prism and its exit. A
 * scanning triangle parallel to the base moves along with the sample; the sample's barycentrics in it are
 * those of its projection to the base, without an inversion. The surface is Eq. 7, S = P + D N'.
 *
 * What the paper leaves open, and what this file does:
 * - Algorithm 1 compares lengths, |s - p| with D, which is right only if |N'| is 1. Eq. 7 is meant: the
 *   height of a sample at distance w above the base is h = w / (N' . Ng).
 * - The projection is along the interpolated N_i / (N_i . Ng), Eq. 7 goes along N'. They agree where the
 *   three vertex normals lean equally against Ng; else the barycentrics are off by a part of the height that
 *   is of third order in the angle of unit normals (first order for directions of other lengths).
 *   `projection=linear` is the paper; `projection=exact`
 *   brings each sample to Eq. 7 with Newton steps from there, and uses the prism whose sides neighbours share
 *   (Eq. 3, as the author's own program does), so that it converges to the surface as the step shrinks.
 * - dt is a length of the scene in the paper. Here `step` counts texels of the base triangle. Section 5.2
 *   wants dt below the displacement; a step in texels does not know heights, so that a stretch is always cut
 *   into at least MIN_STEPS.
 * - The loop of Algorithm 1 stops below the surface, so that a ray which starts there would hit at once.
 *   Here a hit is a change of sign, from either side.
 * - The exit is sampled too, so that a crossing between the last step and the next prism's entry is not lost;
 *   and so is the entry if the first step is jittered.
 * - Sharp creases (section 5.4): extents are limited by `offset-limit`; where a vertex normal is on no side
 *   of Ng the paper inserts base triangles, which would be another surface than that of the other methods.
 *   Those shells, and folded ones, go to shell_subdivide(). A triangle without area in texture space needs
 *   nothing: no texture coordinate is ever inverted.
 *
 * Samples depend on the ray's line, its tmin, and the triangle, but not on tmax, so that the order in which
 * shells are tried does not matter. */
#include "methods/method.h"
#include "methods/pdm/prism.h"
#include "shell/evaluate.h"

#include <string.h>

/* Most steps in a stretch; a longer one has longer steps. */
enum { MIN_STEPS = 4, MAX_STEPS = 1 << 18, NEWTON_STEPS = 4 };
/* A sample whose barycentrics are this far outside of the triangle is none of this shell. */
static const double OUTSIDE = 0.05;
/* The same before a correction. */
static const double FAR_OUTSIDE = 0.5;

static const knurl_method_parameter PARAMETERS[] = {
    {"step", "distance of samples along the ray, in texels of the base triangle (dt)", 1.0, 1e-3, 4096.0,
     NULL, false},
    {"jitter", "shift the first step by a part of it, for thin features over many rays (section 5.3)", 0.0,
     0.0, 1.0, "off|on", false},
    {"offset-limit", "longest extent of a prism at a crease, in largest heights (section 5.4)", 2.0, 1.0, 1e6,
     NULL, false},
    {"projection", "linear: Algorithm 1; exact: samples corrected to Eq. 7", 0.0, 0.0, 1.0, "linear|exact",
     false},
    {0}};

typedef struct pdm_parameters {
    double step;
    bool jitter;
    double offset_limit;
    bool exact;
} pdm_parameters;

static knurl_status pdm_build(const shell_space *space, const double *values, void **data, knurl_error *error)
{
    pdm_parameters *p = knurl_alloc_zero(space->context, sizeof *p);
    *data = p;
    if (!p) return knurl_fail_memory(error, sizeof *p, "method pdm");
    *p = (pdm_parameters){values[0], values[1] != 0.0, values[2], values[3] != 0.0};
    return KNURL_OK;
}

/* The loop's state. */
typedef struct pdm_scan {
    const method_query *query;
    bool exact;
    prism prism;
    vec3 origin, direction; /* relative to vertex 0 */
    vec3 c[3];              /* scanning triangle */
} pdm_scan;

typedef struct sample {
    double t, g; /* g = h_ray - h_surf */
    bool valid;
} sample;

/* triangleBarycentric of Appendix C. */
static void triangle_barycentric(vec3 s, const vec3 c[3], double *b1, double *b2)
{
    vec3 x0 = v3_sub(c[1], c[0]), x1 = v3_sub(c[2], c[0]), x2 = v3_sub(s, c[0]);
    double d00 = v3_dot(x0, x0), d01 = v3_dot(x0, x1), d11 = v3_dot(x1, x1);
    double d20 = v3_dot(x2, x0), d21 = v3_dot(x2, x1);
    double inverse = 1.0 / (d00 * d11 - d01 * d01);
    *b1 = (d11 * d20 - d01 * d21) * inverse;
    *b2 = (d00 * d21 - d01 * d20) * inverse;
}

static bool near_triangle(double b1, double b2, double outside)
{
    return b1 >= -outside && b2 >= -outside && b1 + b2 <= 1.0 + outside;
}

/* P(b) + h N'(b) = s by Newton's method from the linear projection. */
static bool correct_to_surface(const triangle_frame *f, vec3 s, double *b1, double *b2, double *h)
{
    for (int i = 0; i < NEWTON_STEPS; i++) {
        vec3 n = v3_mad(v3_mad(f->n[0], *b1, f->ne), *b2, f->nf);
        vec3 residual = v3_sub(s, v3_mad(v3_mad(v3_scale(f->pe, *b1), *b2, f->pf), *h, n));
        vec3 a = v3_mad(f->pe, *h, f->ne), b = v3_mad(f->pf, *h, f->nf);
        vec3 bn = v3_cross(b, n);
        double inverse = 1.0 / v3_dot(a, bn);
        double db1 = v3_dot(residual, bn) * inverse;
        double db2 = v3_dot(a, v3_cross(residual, n)) * inverse;
        *b1 += db1;
        *b2 += db2;
        *h += v3_dot(a, v3_cross(b, residual)) * inverse;
        if (!near_triangle(*b1, *b2, FAR_OUTSIDE)) return false;
        if (fabs(db1) + fabs(db2) < 1e-9) return near_triangle(*b1, *b2, OUTSIDE);
    }
    return false;
}

/* One turn of Algorithm 1's loop. `root` is where the sample is, if it is valid. */
static sample take_sample(pdm_scan *scan, double t, shell_root *root)
{
    const method_query *q = scan->query;
    const prism *p = &scan->prism;
    vec3 s = v3_mad(scan->origin, t, scan->direction);
    double rise = v3_dot(p->ng, v3_sub(s, scan->c[0])); /* delta h: how far above the scanning triangle */
    for (int i = 0; i < 3; i++) scan->c[i] = v3_mad(scan->c[i], rise, p->lean[i]);
    double b1, b2;
    triangle_barycentric(s, scan->c, &b1, &b2);
    ++*q->steps;
    if (!near_triangle(b1, b2, scan->exact ? FAR_OUTSIDE : OUTSIDE)) return (sample){t, 0.0, false};
    double height = v3_dot(p->ng, s) / (p->k[0] + b1 * (p->k[1] - p->k[0]) + b2 * (p->k[2] - p->k[0]));
    if (scan->exact && !correct_to_surface(q->frame, s, &b1, &b2, &height)) return (sample){t, 0.0, false};
    shell_root_at(q->space, q->lod, q->frame, b1, b2, t, root);
    double g = height - height_patch_at(&root->patch, root->x, root->y);
    return (sample){t, g, isfinite(g)};
}

/* interpolateCrossing of Algorithm 1, and the last projection. */
static bool take_root(pdm_scan *scan, const sample *a, const sample *b)
{
    shell_root root;
    double t = a->t + (b->t - a->t) * (a->g / (a->g - b->g));
    t = min_d(max_d(t, a->t), b->t);
    if (!take_sample(scan, t, &root).valid || t > scan->query->ray->tmax) return false;
    *scan->query->root = root;
    return true;
}

/* Shortest object-space distance on the base over which the texture coordinates move by one texel: one over
 * the largest stretch from P to (x, y), whose square is the larger root of det(X - r G) = 0 with X and G
 * the two metrics of the edges. */
static double texel_length(const triangle_frame *f)
{
    double g11 = v3_dot(f->pe, f->pe), g12 = v3_dot(f->pe, f->pf), g22 = v3_dot(f->pf, f->pf);
    double x11 = f->xe * f->xe + f->ye * f->ye, x12 = f->xe * f->xf + f->ye * f->yf;
    double x22 = f->xf * f->xf + f->yf * f->yf;
    double det_g = g11 * g22 - g12 * g12, det_x = x11 * x22 - x12 * x12;
    double half = 0.5 * (g11 * x22 + g22 * x11 - 2.0 * g12 * x12) / det_g;
    double stretch = half + sqrt(max_d(half * half - det_x / det_g, 0.0));
    return stretch * f->size * f->size > 1.0 ? 1.0 / sqrt(stretch) : f->size;
}

/* One round of SplitMix64. */
static uint64_t mix_bits(uint64_t z)
{
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static uint64_t hash_doubles(uint64_t hash, const double *values, int count)
{
    for (int i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        hash = mix_bits(hash ^ bits);
    }
    return hash;
}

/* R of section 5.3 in (0, 1], from the bits of the ray and of the triangle: repeatable, and the same
 * whatever tmax is. */
static double jitter_of(const method_query *q)
{
    const triangle_frame *f = q->frame;
    uint64_t hash = hash_doubles(hash_doubles(0, q->ray->origin, 3), q->ray->direction, 3);
    const double triangle[9] = {f->base.x, f->base.y, f->base.z, f->pe.x, f->pe.y,
                                f->pe.z,   f->pf.x,   f->pf.y,   f->pf.z};
    hash = hash_doubles(hash_doubles(hash, &q->ray->tmin, 1), triangle, 9);
    return (double)((hash >> 11) + 1) * 0x1p-53;
}

/* The for loop of Algorithm 1, from t = in to out. */
static bool march(pdm_scan *scan, double in, double out, double dt, double shift)
{
    double tmax = scan->query->ray->tmax;
    shell_root unused;
    sample last = take_sample(scan, in, &unused);
    for (int i = 0; last.t < out && last.t <= tmax && i <= MAX_STEPS + MIN_STEPS; i++) {
        double t = in + ((double)i + shift) * dt;
        sample next = take_sample(scan, t < out ? t : out, &unused);
        if (last.valid && next.valid && (last.g <= 0.0) != (next.g <= 0.0) && take_root(scan, &last, &next))
            return true;
        last = next;
    }
    return false;
}

static bool pdm_intersect(const void *data, const method_query *q)
{
    const pdm_parameters *parameters = data;
    pdm_scan scan;
    if (q->frame->flags & SHELL_FOLDED ||
        !prism_make(q->frame, parameters->exact ? 0.0 : parameters->offset_limit, &scan.prism))
        return shell_subdivide(q->space, q->lod, KNURL_BOUNDS_RMIP, q->frame, q->ray, q->any, q->root,
                               q->steps);
    scan.query = q;
    scan.exact = parameters->exact;
    scan.origin = v3_sub(v3_load(q->ray->origin), q->frame->base);
    scan.direction = v3_load(q->ray->direction);
    memcpy(scan.c, q->frame->p, sizeof scan.c);
    prism_stretch stretches[PRISM_MAX_STRETCHES];
    int count = prism_intersect(&scan.prism, scan.origin, scan.direction, stretches);
    if (count == 0) return false;
    double step = parameters->step * texel_length(q->frame) / v3_length(scan.direction);
    double shift = parameters->jitter ? jitter_of(q) : 1.0;
    for (int i = 0; i < count; i++) {
        double in = max_d(stretches[i].in, q->ray->tmin), out = stretches[i].out;
        if (!(in <= out) || in > q->ray->tmax) continue;
        double dt = max_d(min_d(step, (out - in) / MIN_STEPS), (out - in) / MAX_STEPS);
        if (march(&scan, in, out, dt, shift)) return true;
    }
    return false;
}

const method method_pdm = {
    .name = "pdm",
    .summary = "projective displacement mapping in parallel offset prisms (Hoetzlein 2025)",
    .flags = KNURL_METHOD_UNNORMALISED,
    .needs = HEIGHT_NEED_RMIP,
    .parameters = PARAMETERS,
    .build = pdm_build,
    .intersect = pdm_intersect,
};
