/* Patterns in metal: knurling, a cast frieze, chain mail, hammered copper. */
#include "demo_pattern.h"

#include "demo_noise.h"

/* 0 on whole numbers, 1 half way between. */
static double ramp(double x)
{
    return 2 * demo_whole_distance(x);
}

enum { KNURLS = 14 }; /* diamonds per tile and axis */

static double knurling_height(const demo_pattern *p, double u, double v)
{
    double collar = demo_whole_distance(u);
    double scratches = 0.02 * demo_fbm2(u * 6, v * 90, 6, 90, 3, 0.6, p->seed);
    if (collar < 0.075) return 0.62 + 0.33 * demo_dome(collar / 0.082) + 0.25 * scratches;
    /* Two families of V-shaped cuts, tops left a little flat, as a wheel presses them. */
    double pyramid = demo_min(ramp(KNURLS * (u + v)), ramp(KNURLS * (u - v)));
    double worn = 0.78 + 0.05 * demo_noise2(9 * u, 9 * v, 9, 9, p->seed + 9);
    double top = pyramid < worn ? pyramid : worn + 0.15 * (pyramid - worn);
    return demo_mix(0.1, 0.12 + 0.85 * top + scratches, demo_step(0.085, 0.115, collar));
}

static void knurling_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double grime =
        demo_step(0.45, 0.1, r->height) * (0.7 + 0.5 * demo_fbm2(8 * u, 8 * v, 8, 8, 4, 0.5, p->seed + 3));
    demo_set_color(t->color, 0.62, 0.60, 0.57);
    demo_mix3(t->color, (double[]){0.10, 0.075, 0.05}, demo_clamp(grime, 0, 0.9));
    t->metallic = 1 - 0.6 * demo_clamp(grime, 0, 1);
    t->roughness =
        demo_clamp(0.27 + 0.35 * grime + 0.08 * demo_noise2(5 * u, 60 * v, 5, 60, p->seed + 4), 0.15, 0.9);
}

demo_pattern demo_knurling(uint32_t seed)
{
    return (demo_pattern){
        .height = knurling_height, .shade = knurling_shade, .columns = 1024, .rows = 1024, .seed = seed};
}

/* One strand of the guilloche around v = centre; `side` 1 or -1. Runs above the other strand where
 * its sine crosses upwards. */
static double strand(double u, double w, double side)
{
    double turn = 4 * DEMO_PI * u, middle = side * 0.058 * sin(turn),
           slope = side * 0.058 * 4 * DEMO_PI * cos(turn);
    double distance = fabs(w - middle) / sqrt(1 + slope * slope * 0.1) / 0.034;
    if (distance >= 1) return 0;
    double groove = 0.10 * demo_step(0.16, 0.05, fabs(distance - 0.45));
    return 0.50 * sqrt(1 - distance * distance) + 0.16 + 0.13 * side * cos(turn) - groove;
}

/* The frieze runs along u and is mirrored in v about the middles of the two flanks, v = 0.25 and 0.75. */
static double frieze_height(const demo_pattern *p, double u, double v)
{
    double w = demo_fract(2 * v) - 0.5,
           away = fabs(w); /* away: 0 on the flank, 0.5 on the inner and outer line */
    double cast = 0.018 * demo_fbm2(10 * u, 20 * v, 10, 20, 4, 0.55, p->seed);
    double h = 0.12;
    if (away < 0.125) {
        h = demo_max(h, demo_max(strand(u, w, 1), strand(u, w, -1)));
        for (int k = 0; k < 2; k++) {
            /* A boss in each eye between the strands. */
            double x = (demo_fract(2 * u + 0.25 + 0.5 * k) - 0.5) / 2, q = hypot(x * 0.75, w) / 0.021;
            h = demo_max(h, 0.12 + 0.42 * demo_dome(q));
        }
    } else if (away < 0.155) {
        h = 0.12 + 0.5 * demo_dome((away - 0.14) / 0.015);
    } else if (away < 0.245) {
        /* Rope: slanting lays on a round core. */
        double across = (away - 0.2) / 0.043,
               lay = demo_fract(10 * u + 1.1 * across + 0.18 * across * across);
        h = 0.08 + 0.62 * demo_dome(across) * (0.55 + 0.45 * sqrt(demo_clamp(4 * lay * (1 - lay), 0, 1)));
    } else if (away < 0.275) {
        h = 0.12 + 0.5 * demo_dome((away - 0.26) / 0.015);
    } else {
        /* Gadroons: swelling lobes towards the inner and outer line, cut off at the fillet. */
        double along = demo_step(0.283, 0.31, away), lobe = demo_fract(5 * u) * 2 - 1;
        h = 0.1 +
            along * (0.12 + 0.52 * demo_dome(lobe * 0.985)) * (0.75 + 0.25 * demo_step(0.28, 0.5, away));
    }
    return h + cast;
}

static void frieze_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double mottle = demo_fbm2(6 * u, 12 * v, 6, 12, 5, 0.6, p->seed + 11);
    double polish = demo_step(-0.02, 0.16, r->cavity) * demo_step(0.2, 0.6, r->height);
    double patina = demo_clamp(demo_step(0.36, 0.10, r->height + 0.12 * mottle) - 0.6 * polish, 0, 1);
    demo_set_color(t->color, 0.56, 0.30, 0.11);
    demo_mix3(t->color, (double[]){0.90, 0.58, 0.24}, 0.85 * polish);
    demo_mix3(t->color, (double[]){0.30, 0.13, 0.045}, demo_clamp(0.5 * mottle - 2 * r->cavity, 0, 0.7));
    demo_mix3(t->color, (double[]){0.10, 0.30, 0.22}, 0.85 * patina);
    t->metallic = 1 - 0.85 * patina;
    t->roughness = demo_clamp(0.36 - 0.12 * polish + 0.4 * patina + 0.08 * mottle, 0.16, 0.95);
}

demo_pattern demo_frieze(uint32_t seed)
{
    return (demo_pattern){
        .height = frieze_height, .shade = frieze_shade, .columns = 1024, .rows = 2048, .seed = seed};
}

enum { LINKS = 8 }; /* rings per row and tile; twice as many rows */

/* Height above the sheet of the ring whose centre is (cx, cy); -1 where it is not. Rings of odd rows
 * lean the other way, so that each passes through four neighbours. */
static double link_height(double x, double y, double cx, double cy, double lean)
{
    double dx = x - cx, dy = y - cy, radius = hypot(dx, dy);
    double across = (radius - 0.56) / 0.125;
    if (fabs(across) >= 1) return -1;
    return 0.5 + lean * 0.42 * dy + 0.135 * sqrt(1 - across * across);
}

static double mail_top(double u, double v, uint32_t *link)
{
    double x = u * LINKS, y = v * LINKS, best = -1;
    int32_t row0 = (int32_t)floor(2 * y);
    for (int32_t row = row0 - 2; row <= row0 + 3; row++) {
        int32_t odd = row & 1, column0 = (int32_t)floor(x - 0.5 * odd);
        for (int32_t column = column0 - 1; column <= column0 + 2; column++) {
            double h = link_height(x, y, column + 0.5 * odd, 0.5 * row, odd ? 1 : -1);
            if (h <= best) continue;
            best = h;
            *link = demo_hash((column + 4 * LINKS) % LINKS, (row + 4 * LINKS) % (2 * LINKS), 3, 1);
        }
    }
    return best;
}

static double mail_height(const demo_pattern *p, double u, double v)
{
    uint32_t link = 0;
    double top = mail_top(u, v, &link);
    if (top < 0) return 0.25;
    return top + 0.01 * demo_fbm2(40 * u, 40 * v, 40, 40, 2, 0.5, p->seed);
}

static void mail_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    uint32_t link = 0;
    t->alpha = mail_top(u, v, &link) < 0 ? 0 : 1;
    double tone = (link & 1023) / 1023.0, rust = demo_fbm2(5 * u, 5 * v, 5, 5, 5, 0.6, p->seed + 1);
    demo_set_color(t->color, 0.50 + 0.12 * tone, 0.50 + 0.11 * tone, 0.51 + 0.10 * tone);
    double worn = demo_step(0.32, 0.62, r->height);
    demo_mix3(t->color, (double[]){0.16, 0.075, 0.03}, demo_clamp(0.55 + rust - worn, 0, 0.8));
    t->metallic = 1;
    t->roughness = demo_clamp(0.42 - 0.18 * worn + 0.3 * rust, 0.18, 0.9);
}

demo_pattern demo_mail(uint32_t seed)
{
    return (demo_pattern){.height = mail_height,
                          .shade = mail_shade,
                          .columns = 1024,
                          .rows = 1024,
                          .alpha = true,
                          .seed = seed};
}

static demo_cells hammer_cells(const demo_pattern *p)
{
    return (demo_cells){
        .columns = 11, .rows = 11, .jitter = 0.42, .shift = 0, .stretch = 1, .corner = 0.04, .seed = p->seed};
}

/* Distance to the border of the tile, 0 to 0.5. */
static double rim_distance(double u, double v)
{
    return demo_min(demo_min(u, 1 - u), demo_min(v, 1 - v));
}

static double hammered_height(const demo_pattern *p, double u, double v)
{
    demo_cells cells = hammer_cells(p);
    demo_cell cell = demo_cells_at(&cells, u, v);
    /* Where the hammer fell, a shallow bowl; bowls meet in soft ridges. */
    double h =
        0.14 + 1.55 * (cell.x * cell.x + cell.y * cell.y) * demo_mix(1, 0.8, demo_step(0.1, 0, cell.border));
    h = 0.82 - 0.5 * log1p(exp((0.82 - h) * 14)) / 7;
    h += 0.025 * demo_fbm2(24 * u, 24 * v, 24, 24, 4, 0.5, p->seed + 5);
    double rivet = demo_dome(hypot(demo_fract(u * 12) - 0.5, (rim_distance(u, v) * 12) - 0.5) / 0.24);
    double rim = rim_distance(u, v), band = 0.5 + 0.38 * rivet * demo_step(0.008, 0.02, rim);
    return demo_mix(band, h, demo_step(0.082, 0.105, rim));
}

static void hammered_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double mottle = demo_fbm2(4 * u, 4 * v, 4, 4, 6, 0.6, p->seed + 2);
    demo_set_color(t->color, 0.92, 0.48, 0.30);
    demo_mix3(t->color, (double[]){0.40, 0.13, 0.06}, demo_clamp(0.35 + mottle - 4 * r->cavity, 0, 0.85));
    t->metallic = 1;
    t->roughness = demo_clamp(0.27 + 0.22 * mottle, 0.14, 0.7);
}

demo_pattern demo_hammered(uint32_t seed)
{
    return (demo_pattern){
        .height = hammered_height, .shade = hammered_shade, .columns = 1024, .rows = 1024, .seed = seed};
}
