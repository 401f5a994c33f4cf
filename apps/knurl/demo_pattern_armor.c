/* Patterns of wrought things: a diving helmet, riveted plates, filigree, cut glass. */
#include "demo_pattern.h"

#include "demo_noise.h"

/* Radius at v and the length of the profile, which the scene has put into the table: row i holds the
 * radius at v = i / 64, row 0 the length as well. */
static double profile_radius(const demo_pattern *p, double v)
{
    double x = demo_clamp(v, 0, 1) * 64;
    int i = (int)demo_min(x, 63);
    return demo_mix(p->table[i][0], p->table[i + 1][0], x - i);
}

typedef struct porthole {
    double u, v, radius; /* radius in metres */
    int bars;            /* of the guard, 0: none */
} porthole;

static const porthole portholes[] = {
    {0.50, 0.60, 0.25, 0}, {0.255, 0.60, 0.20, 3}, {0.745, 0.60, 0.20, 3}, {0.50, 0.845, 0.13, 2}};

/* What a place of the helmet belongs to. */
typedef struct fitting {
    double height; /* over the dome, in parts of the map's range; negative: nothing */
    bool glass, brass;
} fitting;

static fitting window_at(const porthole *w, double x, double y)
{
    double radius = hypot(x, y), angle = atan2(y, x), q = radius / w->radius;
    if (q > 1.42) return (fitting){.height = -1};
    if (q < 0.80) {
        double bar = 1;
        for (int i = 0; i < w->bars; i++) {
            double at = (i - 0.5 * (w->bars - 1)) * 0.5;
            bar = demo_min(bar, demo_min(fabs(x / w->radius - at), fabs(y / w->radius - at)));
        }
        double guard = demo_dome(bar / 0.075);
        if (guard > 0) return (fitting){.height = 0.30 + 0.16 * guard, .brass = true};
        return (fitting){.height = 0.04 + 0.10 * (1 - q * q), .glass = true};
    }
    /* Rim, flange, and bolts on the flange. */
    double rim = 0.62 * demo_dome((q - 0.93) / 0.16), flange = 0.20 * demo_step(1.42, 1.36, q);
    double count = w->radius > 0.15 ? 12 : 8, turn = demo_fract(angle / (2 * DEMO_PI) * count) - 0.5;
    double bolt = hypot(turn * 2 * DEMO_PI / count * q, q - 1.24) / 0.085;
    double head = bolt < 1 ? 0.20 + 0.24 * sqrt(1 - 0.6 * bolt * bolt) : 0;
    return (fitting){.height = demo_max(demo_max(rim, flange), head), .brass = true};
}

static fitting collar_at(double u, double v)
{
    /* The neck's two rings, clamped together by lugs. */
    double band = demo_dome((v - 0.275) / 0.024), upper = demo_dome((v - 0.330) / 0.020);
    double lug = fabs(demo_fract(8 * u) - 0.5), bolt = fabs(demo_fract(24 * u) - 0.5);
    double ring = 0.52 * demo_max(band, upper);
    if (lug < 0.10 && fabs(v - 0.30) < 0.055) ring = demo_max(ring, 0.62 - 0.9 * pow(lug / 0.10, 8) * 0.3);
    /* The breastplate's edge, with wing bolts. */
    double edge = v < 0.085 ? 0.26 * demo_step(0.0, 0.012, v) * demo_step(0.085, 0.078, v) : 0;
    double stud = hypot(bolt * 0.30, (v - 0.042)) / 0.026;
    if (stud < 1) edge = demo_max(edge, 0.30 + 0.32 * sqrt(1 - stud * stud));
    double h = demo_max(ring, edge);
    return h > 0 ? (fitting){.height = h, .brass = true} : (fitting){.height = -1};
}

static fitting diver_at(const demo_pattern *p, double u, double v)
{
    double around = 2 * DEMO_PI * profile_radius(p, v), length = p->table[0][1];
    for (int i = 0; i < 4; i++) {
        const porthole *w = &portholes[i];
        fitting f = window_at(w, (u - w->u) * around, (v - w->v) * length);
        if (f.height >= 0) return f;
    }
    return collar_at(u, v);
}

static double diver_height(const demo_pattern *p, double u, double v)
{
    fitting f = diver_at(p, u, v);
    double cast = 0.010 * demo_fbm2(30 * u, 24 * v, 30, 24, 4, 0.55, p->seed);
    if (f.glass) return 0.16 + f.height;
    /* Dents of the hammer, which fade towards the crown. */
    demo_cells cells = {
        .columns = 34, .rows = 22, .jitter = 0.4, .stretch = 1.3, .corner = 0.05, .seed = p->seed};
    demo_cell cell = demo_cells_at(&cells, u, v);
    double dent = 0.045 * demo_min(cell.x * cell.x + cell.y * cell.y, 0.5) * demo_step(0.99, 0.9, v);
    double dome = 0.22 + dent + cast * demo_step(0.995, 0.97, v);
    return f.height < 0 ? dome : 0.22 + demo_max(f.height, 0) + cast;
}

static void diver_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    fitting f = diver_at(p, u, v);
    double mottle = demo_fbm2(9 * u, 6 * v, 9, 6, 6, 0.6, p->seed + 2);
    if (f.glass) {
        demo_set_color(t->color, 0.015, 0.035, 0.04);
        t->metallic = 0;
        t->roughness = 0.04;
        return;
    }
    demo_set_color(t->color, 0.80, 0.36, 0.20);
    if (f.height >= 0) demo_set_color(t->color, 0.86, 0.60, 0.24);
    double tarnish = demo_clamp(0.30 + 0.9 * mottle - 5 * r->cavity, 0, 0.85);
    demo_mix3(t->color, (double[]){0.26, 0.10, 0.05}, tarnish);
    double verdigris =
        demo_clamp(demo_step(0.15, 0.5, mottle) - 6 * r->cavity, 0, 1) * demo_step(0.45, 0.25, v);
    demo_mix3(t->color, (double[]){0.13, 0.36, 0.29}, 0.75 * verdigris);
    t->metallic = 1 - 0.8 * verdigris;
    t->roughness = demo_clamp(0.24 + 0.22 * tarnish + 0.3 * verdigris, 0.15, 0.8);
}

demo_pattern demo_diver(uint32_t seed)
{
    return (demo_pattern){
        .height = diver_height, .shade = diver_shade, .columns = 4096, .rows = 4096, .seed = seed};
}

/* Distance to the border of the tile, 0 to 0.5. */
static double rim_distance(double u, double v)
{
    return demo_min(demo_min(u, 1 - u), demo_min(v, 1 - v));
}

static double rivet_distance(double u, double v)
{
    double x = fabs(demo_fract(u) - 0.5), y = fabs(demo_fract(v) - 0.5);
    return demo_min(demo_min(hypot(x - 0.41, y - 0.41), hypot(x, y - 0.41)), hypot(x - 0.41, y));
}

static double plates_height(const demo_pattern *p, double u, double v)
{
    demo_cells cells = {
        .columns = 13, .rows = 13, .jitter = 0.42, .stretch = 1, .corner = 0.05, .seed = p->seed};
    demo_cell cell = demo_cells_at(&cells, u, v);
    double rim = rim_distance(u, v), h = 0.50 + 0.20 * demo_min(cell.x * cell.x + cell.y * cell.y, 0.6);
    h += 0.03 * demo_fbm2(20 * u, 20 * v, 20, 20, 5, 0.55, p->seed + 1);
    h -= 0.16 * demo_step(0.155, 0.135, rim) * demo_step(0.10, 0.13, rim) * (1 - demo_step(0.12, 0.10, rim));
    double rivet = rivet_distance(u, v) / 0.042;
    if (rivet < 1) h = demo_max(h, 0.62 + 0.30 * sqrt(1 - rivet * rivet));
    return demo_mix(0.20, h, demo_step(0.004, 0.030, rim));
}

static void plates_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double mottle = demo_fbm2(5 * u, 5 * v, 5, 5, 6, 0.6, p->seed + 2);
    double rust =
        demo_clamp(0.20 + 0.9 * mottle - 4 * r->cavity + demo_step(0.06, 0.0, rim_distance(u, v)), 0, 1);
    demo_set_color(t->color, 0.58, 0.57, 0.56);
    if (rivet_distance(u, v) < 0.044) demo_set_color(t->color, 0.78, 0.58, 0.27);
    demo_mix3(t->color, (double[]){0.17, 0.10, 0.06}, 0.75 * rust);
    t->metallic = 1 - 0.5 * rust;
    t->roughness = demo_clamp(0.27 + 0.35 * rust, 0.16, 0.9);
}

demo_pattern demo_plates(uint32_t seed)
{
    return (demo_pattern){
        .height = plates_height, .shade = plates_shade, .columns = 2048, .rows = 2048, .seed = seed};
}

/* A tendril that winds up: a logarithmic spiral with leaves on its outer side. */
typedef struct tendril {
    double x, y, radius, start, hand; /* hand: 1 or -1, the way it winds */
} tendril;

static const tendril tendrils[] = {
    {0.66, 0.26, 0.30, 0.10, 1},  {0.26, 0.36, 0.27, 0.55, -1}, {0.70, 0.75, 0.26, 0.30, -1},
    {0.30, 0.80, 0.23, 0.85, 1},  {0.93, 0.52, 0.13, 0.20, 1},  {0.06, 0.08, 0.16, 0.60, 1},
    {0.05, 0.62, 0.13, 0.00, -1}, {0.44, 0.07, 0.13, 0.40, -1}, {0.95, 0.96, 0.14, 0.10, 1}};

static double tendril_height(const tendril *s, double u, double v)
{
    double x = u - s->x, y = v - s->y, q = hypot(x, y) / s->radius;
    if (q > 1 || q < 0.02) return q < 0.02 ? 0.55 : 0;
    double angle = s->hand * atan2(y, x) / (2 * DEMO_PI) + s->start;
    /* Each turn is 0.44 times as wide as the one around it. */
    double turn = log(q) / log(0.44), phase = demo_fract(turn + angle) - 0.5, along = turn - phase;
    double across = phase / 0.20, stem = demo_dome(across), h = 0.36 * stem + (stem > 0 ? 0.14 : 0);
    /* Leaves point along the stem; veins in herringbone. */
    double leaf = demo_fract(5.5 * along), side = phase - 0.17;
    if (side > 0 && side < 0.30) {
        double shape = sin(DEMO_PI * demo_clamp(leaf - 1.1 * side, 0, 1)), edge = 0.30 * shape - side;
        if (edge > 0)
            h = demo_max(h,
                         (0.10 + 0.24 * demo_step(0, 0.10, edge)) *
                             (1 - 0.25 * demo_step(0.3, 0.0, fabs(demo_fract(30 * side + 3 * leaf) - 0.5))));
    }
    return h * demo_step(1.0, 0.93, q);
}

static double filigree_height(const demo_pattern *p, double u, double v)
{
    double h = 0, hammer = 0.012 * demo_fbm2(40 * u, 40 * v, 40, 40, 3, 0.6, p->seed);
    for (int i = 0; i < (int)(sizeof tendrils / sizeof tendrils[0]); i++)
        h = demo_max(h, tendril_height(&tendrils[i], u, v));
    double bud = 0;
    for (int i = 0; i < (int)(sizeof tendrils / sizeof tendrils[0]); i++)
        bud = demo_max(bud,
                       demo_dome(hypot(u - tendrils[i].x, v - tendrils[i].y) / (0.11 * tendrils[i].radius)));
    h = demo_max(h, 0.62 * bud);
    /* The ridge down the front, with a cord on either side; bands where the tiles turn over. */
    double front = 1 - u, ridge = 0.60 * demo_dome(front / 0.028), cord = fabs(front - 0.045) / 0.013;
    h = demo_max(
        h, demo_max(ridge, 0.42 * demo_dome(cord) * (0.7 + 0.3 * sin(2 * DEMO_PI * (30 * v + 0.3 * cord)))));
    double band = demo_min(v, 1 - v), bead = hypot(demo_fract(28 * u) - 0.5, (band - 0.0) * 28) / 0.46;
    if (band < 0.03) h = demo_max(0.10 * demo_step(0.03, 0.026, band), 0.46 * demo_dome(bead));
    return 0.14 + 1.15 * h + hammer;
}

static void filigree_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double mottle = demo_fbm2(6 * u, 6 * v, 6, 6, 5, 0.6, p->seed + 2),
           gold = demo_step(0.19, 0.26, r->height);
    demo_set_color(t->color, 0.12, 0.26, 0.25);
    demo_mix3(t->color, (double[]){0.05, 0.12, 0.15}, demo_clamp(0.5 + mottle - 5 * r->cavity, 0, 1));
    demo_mix3(t->color, (double[]){0.95, 0.72, 0.36}, gold);
    demo_mix3(t->color, (double[]){0.28, 0.14, 0.05},
              gold * demo_clamp(0.1 - 7 * r->cavity + 0.5 * mottle, 0, 0.8));
    t->metallic = 1;
    t->roughness = demo_clamp(demo_mix(0.34, 0.22, gold) + 0.15 * mottle, 0.14, 0.7);
}

demo_pattern demo_filigree(uint32_t seed)
{
    return (demo_pattern){
        .height = filigree_height, .shade = filigree_shade, .columns = 4096, .rows = 4096, .seed = seed};
}

/* Diamonds between two bands, flutes below, ripples of old glass above; the inside stays smooth. */
static double cutglass_height(const demo_pattern *p, double u, double v)
{
    double y = (v - 0.22) / 0.26, swell = 0.05 * demo_fbm2(8 * u, 8 * v, 8, 8, 3, 0.4, p->seed);
    double x = 14 * u, cut = 0;
    if (y > 0.04 && y < 0.72) {
        double w = 4 * y, a = 2 * demo_whole_distance(x + 0.5 * w), b = 2 * demo_whole_distance(x - 0.5 * w);
        cut = demo_min(demo_min(a, b), 0.62) - 0.55;
        cut *= demo_step(0.04, 0.08, y) * demo_step(0.72, 0.68, y);
    } else if (y > -0.20 && y <= 0.04) {
        cut = -0.40 * pow(demo_dome(2 * demo_whole_distance(x)), 2) * demo_step(-0.20, -0.10, y) *
              demo_step(0.03, -0.03, y);
    } else if (y > 0.72 && y < 0.84) {
        cut = 0.10 * demo_dome((y - 0.78) / 0.05);
    }
    return 0.5 + 0.8 * cut + swell * demo_step(0.06, 0.12, v) * demo_step(0.43, 0.40, v);
}

demo_pattern demo_cutglass(uint32_t seed)
{
    return (demo_pattern){.height = cutglass_height, .columns = 2048, .rows = 2048, .seed = seed};
}
