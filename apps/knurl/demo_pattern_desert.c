/* Patterns for the tire in the sand, and roof tiles. */
#include "demo_pattern.h"

#include "demo_noise.h"

enum { BARRELS = 5, COURSES = 5 }; /* columns and rows of roof tiles per tile of the map */

typedef struct rooftile {
    double across, along; /* -0.5 to 0.5; 0 at its upper end, 1 at its lower end */
    double height;
    bool cover; /* lies over its neighbours */
    uint32_t id;
} rooftile;

static rooftile rooftile_row(const demo_pattern *p, double x, double y, int32_t column, int32_t row,
                             bool cover)
{
    int32_t c = ((column % BARRELS) + BARRELS) % BARRELS, course = ((row % COURSES) + COURSES) % COURSES;
    uint32_t id = demo_hash(c, course, cover ? 1 : 2, p->seed);
    double slip = 0.10 * ((id & 255) / 255.0 - 0.5), tilt = 0.05 * (((id >> 8) & 255) / 255.0 - 0.5);
    double chip = 0.015 * demo_noise2(4 * x, 0.5, 4 * BARRELS, 1, id % 97);
    double along = y - row + slip + chip, across = x - column - 0.5;
    double arch = demo_dome(across / (0.40 - 0.04 * (1 - along))), bent = tilt * across;
    double h = cover ? 0.30 + 0.36 * arch : 0.30 - 0.24 * demo_dome(across / 0.52);
    return (rooftile){across, along, h + 0.14 * along + bent, cover, id};
}

/* The uppermost tile: a course covers the upper end of the one below it. */
static rooftile rooftile_at(const demo_pattern *p, double u, double v)
{
    double x = u * BARRELS, y = v * COURSES;
    int32_t row = (int32_t)floor(y);
    rooftile best = {.height = -1};
    for (int32_t k = -1; k <= 1; k++) {
        for (int cover = 0; cover < 2; cover++) {
            double shifted = x + (cover ? 0 : 0.5);
            rooftile t = rooftile_row(p, shifted, y, (int32_t)floor(shifted), row + k, cover);
            if (cover && fabs(t.across) > 0.40) continue;
            if (t.along < -0.15 || t.along > 1.0) continue;
            if (t.height > best.height) best = t;
        }
    }
    return best;
}

static double rooftiles_height(const demo_pattern *p, double u, double v)
{
    rooftile t = rooftile_at(p, u, v);
    double grain = 0.022 * demo_fbm2(24 * u, 24 * v, 24, 24, 5, 0.6, p->seed + 3);
    double throwing = 0.006 * sin(2 * DEMO_PI * (11 * t.along));
    return demo_max(t.height, 0.04) * 1.1 + grain + throwing;
}

static void rooftiles_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    rooftile tile = rooftile_at(p, u, v);
    double tone = ((tile.id >> 16) & 255) / 255.0,
           grain = demo_fbm2(30 * u, 30 * v, 30, 30, 5, 0.65, p->seed + 4);
    double lichen = demo_fbm2(7 * u, 7 * v, 7, 7, 5, 0.6, p->seed + 5);
    demo_set_color(t->color, 0.46, 0.155, 0.065);
    demo_mix3(t->color, (double[]){0.62, 0.30, 0.15}, tone * tone);
    if (tile.id % 7 == 0) demo_mix3(t->color, (double[]){0.24, 0.09, 0.05}, 0.8);
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 0.45 * grain + 2.2 * r->cavity, 0.3, 1.6);
    demo_mix3(t->color, (double[]){0.42, 0.40, 0.30}, 0.8 * demo_step(0.22, 0.42, lichen));
    demo_mix3(t->color, (double[]){0.06, 0.08, 0.025},
              0.8 * demo_step(0.10, 0.30, lichen - 3 * r->cavity) * (tile.cover ? 0.2 : 1));
    t->roughness = demo_clamp(0.82 + 0.15 * grain, 0.6, 1);
    t->metallic = 0;
}

demo_pattern demo_rooftiles(uint32_t seed)
{
    return (demo_pattern){
        .height = rooftiles_height, .shade = rooftiles_shade, .columns = 2048, .rows = 2048, .seed = seed};
}

static double sand_height(const demo_pattern *p, double u, double v)
{
    double warp = 0.22 * demo_fbm2(3 * u, 3 * v, 3, 3, 3, 0.5, p->seed);
    double w = demo_fract(7 * v + u + 3 * warp);
    /* Ripples: long windward sides, short lee sides. */
    double ripple = w < 0.68 ? demo_step(0, 0.68, w) : demo_step(1, 0.68, w);
    double grains = demo_fbm2(160 * u, 160 * v, 160, 160, 3, 0.7, p->seed + 1);
    double h = 0.22 + 0.30 * ripple + 0.035 * grains;
    demo_cells cells = {
        .columns = 9, .rows = 9, .jitter = 0.3, .stretch = 1, .corner = 0.02, .seed = p->seed + 2};
    demo_cell cell = demo_cells_at(&cells, u, v);
    double size = 0.05 + 0.20 * pow((cell.id & 255) / 255.0, 3);
    if (cell.id % 5 < 2)
        h = demo_max(h, 0.22 + 1.6 * size * demo_dome(hypot(cell.x, 1.3 * cell.y) / size) + 0.02 * grains);
    return h;
}

static void sand_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double grains = demo_fbm2(150 * u, 150 * v, 150, 150, 3, 0.7, p->seed + 5);
    demo_cells cells = {
        .columns = 9, .rows = 9, .jitter = 0.3, .stretch = 1, .corner = 0.02, .seed = p->seed + 2};
    demo_cell cell = demo_cells_at(&cells, u, v);
    double size = 0.05 + 0.20 * pow((cell.id & 255) / 255.0, 3);
    demo_set_color(t->color, 0.60, 0.39, 0.20);
    if (cell.id % 5 < 2 && hypot(cell.x, 1.3 * cell.y) < size)
        demo_set_color(t->color, 0.26 + 0.15 * ((cell.id >> 8) & 255) / 255.0, 0.22, 0.17);
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(0.95 + 0.35 * grains + 1.2 * r->cavity, 0.4, 1.5);
    t->roughness = 0.95;
}

demo_pattern demo_sand(uint32_t seed)
{
    return (demo_pattern){
        .height = sand_height, .shade = sand_shade, .columns = 4096, .rows = 4096, .seed = seed};
}

enum { LUGS = 5, RIM = 20 }; /* lugs per tile; level of the tire's edges, per cent */

/* Blocks in chevrons on both sides of a zigzag rib. */
static double tread_block(double u, double v)
{
    double x = LUGS * u, side = v - 0.5, away = fabs(side);
    double half = side < 0 ? 0.5 : 0, phase = demo_fract(x + half + 1.6 * away) - 0.5;
    double zigzag = 0.045 + 0.02 * (4 * demo_whole_distance(x + half) - 1);
    double edge = 1;
    if (away < zigzag)
        edge = (zigzag - away) * 10;
    else if (away < 0.25)
        edge = demo_min((0.36 - fabs(phase)) * 2.6, demo_min(away - zigzag - 0.035, 0.25 - away) * 10);
    else
        edge = demo_min((0.30 + 0.25 * (away - 0.25) - fabs(demo_fract(phase + 0.85) - 0.5)) * 2.6,
                        demo_min(away - 0.275, 0.475 - away) * 10);
    return edge;
}

static double tread_height(const demo_pattern *p, double u, double v)
{
    double edge = tread_block(u, v), wear = demo_fbm2(12 * u, 4 * v, 12, 4, 5, 0.6, p->seed);
    double block = demo_step(-0.04, 0.16, edge), away = fabs(v - 0.5);
    double sipe = 0.16 * demo_step(0.035, 0.02, fabs(demo_fract(3 * LUGS * u + 0.5 + 2.5 * away) - 0.5)) *
                  demo_step(0.3, 0.5, edge);
    double floor_level = 0.12 + 0.015 * wear;
    double h = demo_mix(floor_level, 0.86 + 0.035 * wear, block) - sipe;
    return demo_mix(RIM / 100.0, h, demo_step(0.5, 0.485, away));
}

/* Sand in what lies deep, grey dust on black rubber. */
static void rubber_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double dust = demo_fbm2(10 * u, 5 * v, 10, 5, 6, 0.65, p->seed + 4);
    demo_set_color(t->color, 0.020, 0.020, 0.021);
    demo_mix3(
        t->color, (double[]){0.42, 0.28, 0.15},
        demo_clamp(0.12 + 0.5 * dust + 0.8 * demo_step(0.35, 0.10, r->height) - 1.5 * r->cavity, 0, 0.85));
    t->roughness = demo_clamp(0.62 + 0.3 * dust, 0.45, 1);
    t->metallic = 0;
}

demo_pattern demo_tread(uint32_t seed)
{
    return (demo_pattern){
        .height = tread_height, .shade = rubber_shade, .columns = 4096, .rows = 4096, .seed = seed};
}

enum { LETTERS = 5, LETTER_ROWS = 7 };

static double letter_dot(int32_t letter, int32_t x, int32_t y)
{
    static const unsigned char font[LETTERS][LETTER_ROWS] = {{0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11},
                                                             {0x11, 0x19, 0x15, 0x13, 0x11, 0x11, 0x11},
                                                             {0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e},
                                                             {0x1e, 0x11, 0x11, 0x1e, 0x14, 0x12, 0x11},
                                                             {0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1f}};
    if (letter < 0 || letter >= LETTERS || x < 0 || x > 4 || y < 0 || y >= LETTER_ROWS) return 0;
    return font[letter][y] >> (4 - x) & 1;
}

/* KNURL, in dots that run together: their bilinear mix, cut at a level. */
static double lettering(double u, double v)
{
    double x = (u - 0.16) / 0.68 * (6 * LETTERS - 1) - 0.5, y = v * LETTER_ROWS - 0.5;
    int32_t x0 = (int32_t)floor(x), y0 = (int32_t)floor(y);
    double fx = x - x0, fy = y - y0, sum = 0;
    for (int32_t k = 0; k < 4; k++) {
        int32_t i = x0 + (k & 1), j = y0 + (k >> 1);
        double weight = ((k & 1) ? fx : 1 - fx) * ((k & 2) ? fy : 1 - fy);
        if (i >= 0) sum += weight * letter_dot(i / 6, i % 6, j);
    }
    return demo_step(0.38, 0.58, sum);
}

/* v: 0 at the bead, 1 at the shoulder. */
static double sidewall_height(const demo_pattern *p, double u, double v)
{
    double grain = 0.012 * demo_fbm2(60 * u, 20 * v, 60, 20, 4, 0.6, p->seed);
    double h = 0.24 + 0.10 * demo_step(0.15, 0.30, v) * demo_step(0.90, 0.70, v);
    h += 0.26 * demo_dome((v - 0.12) / 0.03) + 0.10 * demo_dome((v - 0.20) / 0.012) +
         0.16 * demo_dome((v - 0.72) / 0.018);
    if (v > 0.30 && v < 0.64) h += 0.34 * lettering(u, 1 - (v - 0.32) / 0.30);
    /* Ribs between the words, lugs below the shoulder. */
    double word = demo_min(u, 1 - u);
    if (word < 0.11 && v > 0.32 && v < 0.62)
        h += 0.20 * demo_dome((demo_fract(14 * v) - 0.5) / 0.3) * demo_step(0.11, 0.10, word);
    double lug = fabs(demo_fract(LUGS * u + 0.1) - 0.5);
    if (v > 0.76) h += 0.45 * demo_step(0.28, 0.24, lug) * demo_step(0.77, 0.80, v);
    return demo_mix(RIM / 100.0, h + grain, demo_step(0, 0.03, v) * demo_step(1, 0.985, v));
}

demo_pattern demo_sidewall(uint32_t seed)
{
    return (demo_pattern){
        .height = sidewall_height, .shade = rubber_shade, .columns = 4096, .rows = 4096, .seed = seed};
}
