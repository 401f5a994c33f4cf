/* Parallel offset prisms and their intersection; see prism.h.
 *
 * What the paper leaves open:
 * - Eq. 5 and Eq. 6 give different prisms. Eq. 5 goes along the interpolated normal, Eq. 6 and the
 *   barycentric projection along the interpolated N_i / (N_i . Ng), which is another direction unless all
 *   three vertex normals lean equally. Two neighbours lean differently along their common edge, so that
 *   their bilinear sides do not quite coincide (third order in the angle of the normals).
 * - Eq. 8 keeps the first entry and the last exit. A side is not flat, so a ray may leave through one and
 *   come back: entries and exits are paired in order here, which is Eq. 8 for one pair. A ray that starts
 *   inside needs no case of its own, because t < 0 is looked at too. */
#include "methods/pdm/prism.h"

/* A vertex normal whose cosine with Ng is below this has no useful offset. */
static const double LEAST_COSINE = 0.01;
/* Crossings this far outside of a patch or triangle, as a part of it, still count, and stretches are longer
 * by this part of the prism's size at both ends: a ray through an edge of the prism, and a root in the side
 * between two prisms, are not lost to rounding. */
static const double EDGE_SLACK = 1e-9;

static void set_extents(const triangle_frame *f, const double low[3], const double high[3], prism *p)
{
    for (int i = 0; i < 3; i++) {
        p->low[i] = v3_mad(f->p[i], low[i], f->n[i]);
        p->high[i] = v3_mad(f->p[i], high[i], f->n[i]);
    }
    p->size = f->size + v3_length(v3_sub(p->high[0], p->low[0]));
}

/* Whether an offset triangle lies the other way round than the base. */
static bool turns_over(const prism *p, const vec3 corner[3])
{
    vec3 n = v3_cross(v3_sub(corner[1], corner[0]), v3_sub(corner[2], corner[0]));
    return !(p->winding * v3_dot(n, p->ng) > 0.0);
}

bool prism_make(const triangle_frame *f, double offset_limit, prism *p)
{
    p->ng = v3_normalize(v3_cross(f->pe, f->pf));
    p->winding = 1.0;
    double sum = 0.0, least = INFINITY, most = 0.0;
    for (int i = 0; i < 3; i++) sum += v3_dot(f->n[i], p->ng);
    if (sum < 0.0) {
        p->ng = v3_neg(p->ng);
        p->winding = -1.0;
    }
    for (int i = 0; i < 3; i++) {
        p->k[i] = v3_dot(f->n[i], p->ng);
        if (!(p->k[i] > LEAST_COSINE * v3_length(f->n[i]))) return false;
        p->lean[i] = v3_scale(f->n[i], 1.0 / p->k[i]);
        least = min_d(least, p->k[i]);
        most = max_d(most, p->k[i]);
    }
    /* Distances along Ng that enclose heights s0 to s1 along any of the normals. */
    double w0 = f->s0 * (f->s0 < 0.0 ? most : least), w1 = f->s1 * (f->s1 > 0.0 ? most : least);
    double limit = offset_limit * max_d(fabs(f->s0), fabs(f->s1));
    if (offset_limit > 0.0) {
        double low[3], high[3];
        for (int i = 0; i < 3; i++) {
            low[i] = max_d(w0 / p->k[i], -limit);
            high[i] = min_d(w1 / p->k[i], limit);
        }
        set_extents(f, low, high, p);
    }
    if (!(offset_limit > 0.0) || turns_over(p, p->low) || turns_over(p, p->high)) {
        const double low[3] = {f->s0, f->s0, f->s0}, high[3] = {f->s1, f->s1, f->s1};
        set_extents(f, low, high, p);
    }
    return true;
}

typedef struct crossing {
    double t;
    bool entering; /* n_p . r_dir < 0 (Eq. 8) */
} crossing;

typedef struct crossing_list {
    crossing at[2 * PRISM_MAX_STRETCHES];
    int count;
    double slack; /* of t */
} crossing_list;

static void add_crossing(crossing_list *list, double t, double outward)
{
    if (!isfinite(t) || list->count == 2 * PRISM_MAX_STRETCHES) return;
    int i = list->count++;
    t += outward < 0.0 ? -list->slack : list->slack;
    for (; i > 0 && list->at[i - 1].t > t; i--) list->at[i] = list->at[i - 1];
    list->at[i] = (crossing){t, outward < 0.0};
}

static vec3 mix(vec3 a, vec3 b, double u)
{
    return v3_mad(a, u, v3_sub(b, a));
}

/* The patch between the lines a0 a1 and b0 b1 at position u of [0, 1] from one to the other. */
static void cross_patch_line(crossing_list *list, vec3 a0, vec3 a1, vec3 b0, vec3 b1, double u, vec3 o,
                             vec3 d, double winding)
{
    if (!(u >= -EDGE_SLACK && u <= 1.0 + EDGE_SLACK)) return;
    vec3 at = v3_sub(mix(a0, b0, u), o), line = mix(v3_sub(a1, a0), v3_sub(b1, b0), u);
    vec3 n = v3_cross(d, line);
    double area = v3_dot(n, n);
    vec3 m = v3_cross(n, at);
    double t = v3_dot(m, line) / area, v = v3_dot(m, d) / area;
    if (!(v >= -EDGE_SLACK && v <= 1.0 + EDGE_SLACK)) return;
    /* Edge times up points outwards where the vertices go counter-clockwise around Ng. */
    vec3 along = mix(v3_sub(b0, a0), v3_sub(b1, a1), v);
    add_crossing(list, t, winding * v3_dot(v3_cross(along, line), d));
}

/* Ray against a bilinear patch: the lines across it that the ray meets (Reshetov 2019, "Cool patches"). */
static void cross_patch(crossing_list *list, vec3 a0, vec3 a1, vec3 b0, vec3 b1, vec3 o, vec3 d,
                        double winding)
{
    vec3 qa = v3_sub(a0, o), qb = v3_sub(b0, o), ea = v3_sub(a1, a0), eb = v3_sub(b1, b0);
    double a = v3_dot(v3_cross(qa, d), ea);
    /* det[lerp(qa, qb, u), d, lerp(ea, eb, u)] = a + b u + c u^2, whose value at u = 1 is that of line b. */
    double c = v3_dot(v3_cross(v3_sub(qb, qa), d), v3_sub(eb, ea));
    double b = v3_dot(v3_cross(qb, d), eb) - a - c;
    double discriminant = b * b - 4.0 * a * c;
    if (!(discriminant >= 0.0)) return;
    double s = -0.5 * (b + copysign(sqrt(discriminant), b));
    if (c != 0.0) cross_patch_line(list, a0, a1, b0, b1, s / c, o, d, winding);
    if (s != 0.0) cross_patch_line(list, a0, a1, b0, b1, a / s, o, d, winding);
}

/* Top (side 1) and bottom (side -1), for vertices counter-clockwise around Ng. */
static void cross_triangle(crossing_list *list, const vec3 corner[3], double side, vec3 o, vec3 d)
{
    vec3 e = v3_sub(corner[1], corner[0]), g = v3_sub(corner[2], corner[0]), to = v3_sub(o, corner[0]);
    vec3 n = v3_cross(e, g), across = v3_cross(to, d);
    double det = -v3_dot(n, d);
    double b1 = v3_dot(g, across) / det, b2 = -v3_dot(e, across) / det;
    if (!(b1 >= -EDGE_SLACK && b2 >= -EDGE_SLACK && b1 + b2 <= 1.0 + EDGE_SLACK)) return;
    add_crossing(list, v3_dot(n, to) / det, side * v3_dot(n, d));
}

int prism_intersect(const prism *p, vec3 o, vec3 d, prism_stretch stretches[PRISM_MAX_STRETCHES])
{
    crossing_list list = {.count = 0, .slack = EDGE_SLACK * p->size / v3_length(d)};
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3;
        cross_patch(&list, p->low[i], p->high[i], p->low[j], p->high[j], o, d, p->winding);
    }
    cross_triangle(&list, p->high, p->winding, o, d);
    cross_triangle(&list, p->low, -p->winding, o, d);
    int count = 0;
    bool inside = false;
    for (int i = 0; i < list.count; i++) {
        if (list.at[i].entering) {
            if (!inside && count < PRISM_MAX_STRETCHES) stretches[count].in = list.at[i].t;
            inside = true;
        } else if (inside) {
            if (count < PRISM_MAX_STRETCHES) stretches[count++].out = list.at[i].t;
            inside = false;
        }
    }
    return count;
}
