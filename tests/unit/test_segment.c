/* Segments in texture space: exact where they say so, chords elsewhere, whole and in order. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "shell/segment.h"
#include "test_relief_common.h"

/* A triangle of a case, loaded. */
typedef struct loaded {
    knurl_context *context;
    knurl_surface *surface;
    const shell_space *space;
    height_lod lod;
} loaded;

static loaded load(const relief_case *c)
{
    loaded l = {.context = case_context(1)};
    l.surface = case_surface(l.context, c, "rmip");
    l.space = knurl_surface_space(l.surface);
    height_lod_make(l.space, 0.0, &l.lod);
    return l;
}

static void unload(loaded *l)
{
    knurl_surface_release(l->surface);
    knurl_context_release(l->context);
}

/* P + h N (/ |N|) relative to vertex 0. */
static vec3 shell_place(const triangle_frame *f, double b1, double b2, double h)
{
    vec3 n = v3_mad(v3_mad(f->n[0], b1, f->ne), b2, f->nf);
    return v3_mad(v3_mad(v3_scale(f->pe, b1), b2, f->pf), h / frame_normal_scale(f, b1, b2), n);
}

static double off_ray(const triangle_frame *f, const knurl_ray *ray, const segment_point *p)
{
    vec3 at = v3_mad(v3_sub(v3_load(ray->origin), f->base), p->t, v3_load(ray->direction));
    return v3_length(v3_sub(shell_place(f, p->b1, p->b2, p->h), at));
}

static double off_texels(const triangle_frame *f, const segment_point *p)
{
    return fabs(f->x[0] + p->b1 * f->xe + p->b2 * f->xf - p->x) +
           fabs(f->y[0] + p->b1 * f->ye + p->b2 * f->yf - p->y);
}

typedef struct tally {
    uint64_t rays, segments;
    double ends, between; /* farthest from the ray */
} tally;

static void check_order(const shell_segments *s, const knurl_ray *ray)
{
    for (int i = 0; i < s->count; i++) {
        /* The room is in parts of the whole stretch, which the ray's window may cut. */
        double slack = 1e-7 * (1.0 + fabs(s->list[i].in.t) + fabs(s->list[i].out.t));
        assert_true(s->list[i].in.t <= s->list[i].out.t + slack);
        assert_true(s->list[i].in.t >= ray->tmin - slack && s->list[i].out.t <= ray->tmax + slack);
        assert_true(i == 0 || s->list[i - 1].out.t <= s->list[i].in.t + slack);
        assert_true(s->list[i].in.weight > 0.0 && s->list[i].out.weight > 0.0);
    }
}

static void measure(const triangle_frame *f, const knurl_ray *ray, const shell_segments *s, random_state *r,
                    tally *sum)
{
    check_order(s, ray);
    for (int i = 0; i < s->count; i++) {
        sum->segments++;
        for (int k = 0; k < 6; k++) {
            double at = k < 2 ? (double)k : random_unit(r);
            segment_point p = segment_at(&s->list[i], at);
            double off = off_ray(f, ray, &p);
            double *worst = k < 2 ? &sum->ends : &sum->between;
            *worst = max_d(*worst, off);
            assert_true(off_texels(f, &p) < 1e-9);
        }
    }
}

/* All triangles of a case against random rays. *exact counts segments that claim to be exact. */
static tally trace_case(const relief_case *c, uint64_t rays, uint64_t *exact)
{
    loaded l = load(c);
    knurl_surface_info info;
    knurl_surface_get_info(l.surface, &info);
    random_state r = {99};
    tally sum = {0};
    *exact = 0;
    for (uint64_t k = 0; k < rays; k++) {
        knurl_ray ray = random_ray(&r, v3_load(info.lower), v3_load(info.upper));
        for (uint32_t t = 0; t < c->triangle_count; t++) {
            triangle_frame f;
            shell_segments s;
            triangle_frame_load(l.space, t, &l.lod, &f);
            sum.rays++;
            if (!shell_segments_make(&f, &ray, &s)) continue;
            *exact += s.exact ? (uint64_t)s.count : 0;
            measure(&f, &ray, &s, &r, &sum);
        }
    }
    unload(&l);
    return sum;
}

static void print_tally(const char *what, const tally *t)
{
    printf("%-28s %6llu segments; off the ray by %.1e at the ends, %.1e between\n", what,
           (unsigned long long)t->segments, t->ends, t->between);
}

static void exact_on_planes_and_boxes(void **state)
{
    (void)state;
    uint64_t exact;
    relief_case *c = plane_case(2);
    tally plane = trace_case(c, 2000, &exact);
    print_tally("plane", &plane);
    assert_true(exact > 200 && exact == plane.segments);
    assert_true(plane.ends < 1e-12 && plane.between < 1e-12);
    free(c);
    c = box_case(MAP_NOISE);
    tally box = trace_case(c, 1000, &exact);
    print_tally("box", &box);
    assert_true(exact > 200 && exact == box.segments);
    assert_true(box.ends < 1e-12 && box.between < 1e-12);
    free(c);
}

static void exact_on_frusta(void **state)
{
    (void)state;
    for (int i = 0; i < 4; i++) {
        uint64_t exact;
        relief_case *c = frustum_case(i);
        tally t = trace_case(c, 2000, &exact);
        print_tally("frustum", &t);
        assert_true(exact > 200 && exact == t.segments);
        /* Directions are rounded to float. */
        assert_true(t.ends < 1e-11 && t.between < 1e-6);
        free(c);
    }
}

static void frustum_is_bent_to_one_side(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        relief_case *c = frustum_case(i);
        loaded l = load(c);
        knurl_surface_info info;
        knurl_surface_get_info(l.surface, &info);
        random_state r = {17};
        uint64_t bent = 0;
        for (int k = 0; k < 800; k++) {
            knurl_ray ray = random_ray(&r, v3_load(info.lower), v3_load(info.upper));
            triangle_frame f;
            shell_segments s;
            triangle_frame_load(l.space, 0, &l.lod, &f);
            if (!shell_segments_make(&f, &ray, &s) || s.count == 0) continue;
            const shell_segment *g = &s.list[0];
            segment_point middle = segment_at(g, segment_fraction(g, 0.5));
            double sag = middle.h - 0.5 * (g->in.h + g->out.h);
            /* Narrower upwards (i = 0): the height is concave, the middle above the chord. */
            assert_true(i == 0 ? sag > -1e-12 : sag < 1e-12);
            if (fabs(sag) > 1e-9) {
                assert_true((segment_bend(g) < 0.0) == (sag > 0.0));
                bent++;
            }
        }
        assert_true(bent > 50);
        unload(&l);
        free(c);
    }
}

static void chords_on_spheres(void **state)
{
    (void)state;
    double before = INFINITY;
    for (int k = 0; k < 3; k++) {
        uint64_t exact;
        relief_case *c = case_new();
        case_sphere(c, 8 << k, 3 << k);
        case_fill(c, MAP_SMOOTH, 48, 24, 3);
        tally t = trace_case(c, 300u >> k, &exact);
        print_tally("sphere", &t);
        assert_true(t.segments > 100 && exact == 0);
        assert_true(t.ends < 1e-10);
        assert_true(t.between < 0.5 * before);
        before = t.between;
        free(c);
    }
}

/* Smooth normals of the sphere without normalisation: N = (P - A) / r, so that segments are exact. */
static void exact_on_unnormalised_spheres(void **state)
{
    (void)state;
    uint64_t exact;
    relief_case *c = case_new();
    case_sphere(c, 16, 6);
    case_fill(c, MAP_SMOOTH, 48, 24, 3);
    c->with_directions = true;
    tally t = trace_case(c, 100, &exact);
    print_tally("sphere, S = P + h N", &t);
    assert_true(exact > 100 && exact == t.segments);
    assert_true(t.ends < 1e-10 && t.between < 1e-6);
    free(c);
}

/* Every point of a ray that lies in the prism lies in one of the segments. */
static void segments_cover_the_prism(void **state)
{
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        relief_case *c = kind == 1 ? frustum_case(0) : kind == 0 ? plane_case(1) : case_new();
        if (kind == 2) {
            case_sphere(c, 12, 5);
            case_fill(c, MAP_NOISE, 24, 12, 3);
        }
        loaded l = load(c);
        random_state r = {31};
        uint64_t followed = 0, tried = 0;
        for (int k = 0; k < 6000; k++) {
            triangle_frame f;
            shell_segments s;
            triangle_frame_load(l.space, random_index(&r, c->triangle_count), &l.lod, &f);
            double b1 = random_unit(&r), b2 = random_unit(&r) * (1.0 - b1),
                   high = random_range(&r, f.s0, f.s1);
            vec3 place = v3_add(f.base, shell_place(&f, b1, b2, high * frame_normal_scale(&f, b1, b2)));
            vec3 d = v3(random_range(&r, -1, 1), random_range(&r, -1, 1), random_range(&r, -1, 1));
            double t = random_range(&r, 0.1, 3.0), origin[3], direction[3];
            v3_store(origin, v3_mad(place, -t, d));
            v3_store(direction, d);
            knurl_ray ray = knurl_ray_make(origin, direction);
            tried++;
            if (!shell_segments_make(&f, &ray, &s)) continue;
            followed++;
            bool covered = false;
            for (int i = 0; i < s.count; i++)
                covered |= t >= s.list[i].in.t - 1e-9 && t <= s.list[i].out.t + 1e-9;
            assert_true(covered);
        }
        assert_true(100 * followed > 99 * tried);
        unload(&l);
        free(c);
    }
}

static void crossings_and_shares(void **state)
{
    (void)state;
    random_state r = {3};
    for (int k = 0; k < 2000; k++) {
        shell_segment s = {.in = {.x = random_range(&r, -9, 9), .weight = random_range(&r, 0.1, 3.0)},
                           .out = {.x = random_range(&r, -9, 9), .weight = random_range(&r, 0.1, 3.0)}};
        double f = random_unit(&r), share = segment_share(&s, f);
        segment_point p = segment_at(&s, f);
        assert_true(fabs(segment_fraction(&s, share) - f) < 1e-12);
        assert_true(fabs(s.in.x + share * (s.out.x - s.in.x) - p.x) < 1e-12);
        if (fabs(s.out.x - s.in.x) > 1e-3)
            assert_true(fabs(segment_cross(&s, s.in.x, s.out.x, p.x) - f) < 1e-9);
    }
}

/* A cone of directions that cross below the base, reached by negative heights: folded. */
static void folded_shells_are_refused(void **state)
{
    (void)state;
    relief_case *c = frustum_case(0);
    c->factor = 4.0; /* past the apex */
    loaded l = load(c);
    triangle_frame f;
    shell_segments s;
    triangle_frame_load(l.space, 0, &l.lod, &f);
    assert_true(f.flags & SHELL_FOLDED);
    knurl_ray ray = knurl_ray_make((double[3]){0.2, 5.0, 0.1}, (double[3]){0.0, -1.0, 0.1});
    assert_false(shell_segments_make(&f, &ray, &s));
    assert_int_equal(s.count, 0);
    unload(&l);
    free(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exact_on_planes_and_boxes),     cmocka_unit_test(exact_on_frusta),
        cmocka_unit_test(frustum_is_bent_to_one_side),   cmocka_unit_test(chords_on_spheres),
        cmocka_unit_test(exact_on_unnormalised_spheres), cmocka_unit_test(segments_cover_the_prism),
        cmocka_unit_test(crossings_and_shares),          cmocka_unit_test(folded_shells_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
