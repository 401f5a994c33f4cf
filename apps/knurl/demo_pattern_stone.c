/* Patterns in stone and glass: setts, masonry, a carved panel, mountains, ripples. */
#include "demo_pattern.h"

#include "demo_noise.h"

static double unit(uint32_t id, int shift)
{
    return ((id >> shift) & 255) / 255.0;
}

static demo_cells sett_cells(const demo_pattern *p)
{
    return (demo_cells){.columns = 8,
                        .rows = 10,
                        .jitter = 0.17,
                        .shift = 0.5,
                        .stretch = 0.8,
                        .corner = 0.045,
                        .seed = p->seed};
}

static double cobbles_height(const demo_pattern *p, double u, double v)
{
    demo_cells cells = sett_cells(p);
    /* A little warp: no mason lays straight rows. */
    double wu = u + 0.011 * demo_fbm2(3 * u, 3 * v, 3, 3, 3, 0.5, p->seed + 1);
    double wv = v + 0.011 * demo_fbm2(3 * u, 3 * v, 3, 3, 3, 0.5, p->seed + 2);
    demo_cell cell = demo_cells_at(&cells, wu, wv);
    double edge = cell.border + 0.016 * demo_fbm2(40 * u, 40 * v, 40, 40, 4, 0.6, p->seed + 4);
    double face = demo_step(0.02, 0.055, edge), sand = 0.20, stone = 0;
    if (face < 1 || edge < 0.08) {
        sand += 0.07 * demo_fbm2(6 * u, 6 * v, 6, 6, 4, 0.5, p->seed + 6) +
                0.03 * demo_fbm2(90 * u, 90 * v, 90, 90, 4, 0.7, p->seed + 5);
    }
    if (face > 0) {
        double shoulder = demo_clamp((edge - 0.035) / 0.30, 0, 1);
        stone = 0.52 + 0.13 * unit(cell.id, 0) + 0.30 * (sqrt(shoulder * (2 - shoulder)) - 1) +
                0.11 * ((unit(cell.id, 8) - 0.5) * cell.x + (unit(cell.id, 16) - 0.5) * cell.y) +
                0.035 * demo_fbm2(32 * u, 32 * v, 32, 32, 6, 0.55, p->seed + 3);
    }
    return 1.25 * demo_max(sand, demo_mix(sand - 0.02, stone, face)) + 0.02;
}

static void cobbles_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    static const double tones[5][3] = {{0.28, 0.26, 0.24},
                                       {0.21, 0.21, 0.225},
                                       {0.34, 0.27, 0.21},
                                       {0.16, 0.165, 0.17},
                                       {0.38, 0.335, 0.285}};
    demo_cells cells = sett_cells(p);
    double wu = u + 0.011 * demo_fbm2(3 * u, 3 * v, 3, 3, 3, 0.5, p->seed + 1);
    double wv = v + 0.011 * demo_fbm2(3 * u, 3 * v, 3, 3, 3, 0.5, p->seed + 2);
    demo_cell cell = demo_cells_at(&cells, wu, wv);
    double edge = cell.border + 0.016 * demo_fbm2(40 * u, 40 * v, 40, 40, 4, 0.6, p->seed + 4);
    double grain = demo_fbm2(64 * u, 64 * v, 64, 64, 5, 0.65, p->seed + 7);
    const double *tone = tones[cell.id % 5];
    demo_set_color(t->color, tone[0], tone[1], tone[2]);
    for (int k = 0; k < 3; k++)
        t->color[k] *= 1 + 0.5 * grain + 0.35 * (unit(cell.id, 24) - 0.5) + 2.0 * r->cavity;
    double moss = demo_step(0.10, 0.42, demo_fbm2(5 * u, 5 * v, 5, 5, 5, 0.6, p->seed + 8));
    double soil[3] = {0.17 + 0.08 * grain, 0.135 + 0.07 * grain, 0.095 + 0.05 * grain};
    demo_mix3(soil, (double[]){0.050, 0.075, 0.018}, 0.9 * moss);
    demo_mix3(t->color, soil, demo_step(0.075, 0.02, edge));
    double worn = demo_step(0.55, 0.85, r->height);
    t->roughness = demo_clamp(0.78 - 0.34 * worn + 0.2 * grain, 0.3, 1);
    t->metallic = 0;
}

demo_pattern demo_cobbles(uint32_t seed)
{
    return (demo_pattern){
        .height = cobbles_height, .shade = cobbles_shade, .columns = 1024, .rows = 1024, .seed = seed};
}

enum { COURSES = 6, BLOCKS = 3 }; /* per tile */

typedef struct block {
    double edge; /* distance to the joint's middle, in course heights */
    double x, y; /* from the block's centre, in course heights */
    uint32_t id;
} block;

/* The joint left of block `column` in a course, in blocks. */
static double joint(int32_t column, int32_t course, uint32_t seed)
{
    int32_t c = ((column % BLOCKS) + BLOCKS) % BLOCKS;
    return column + 0.5 * (course & 1) + 0.24 * (demo_random(c, course, 4, seed) * 2 - 1);
}

static block block_at(const demo_pattern *p, double u, double v)
{
    double y = v * COURSES, x = u * BLOCKS;
    int32_t row = (int32_t)floor(y), course = ((row % COURSES) + COURSES) % COURSES;
    int32_t column = (int32_t)floor(x - 0.5 * (course & 1));
    if (joint(column, course, p->seed) > x)
        column--;
    else if (joint(column + 1, course, p->seed) <= x)
        column++;
    const double aspect = (double)COURSES / BLOCKS; /* of a tile as wide as high */
    double left = joint(column, course, p->seed), right = joint(column + 1, course, p->seed);
    double half = 0.5 * (right - left) * aspect, dx = (x - 0.5 * (left + right)) * aspect, dy = y - row - 0.5;
    /* Distance to a rectangle with rounded corners. */
    double radius = 0.13, qx = fabs(dx) - half + radius, qy = fabs(dy) - 0.5 + radius;
    double outside = hypot(demo_max(qx, 0), demo_max(qy, 0)) + demo_min(demo_max(qx, qy), 0) - radius;
    int32_t wrapped = ((column % BLOCKS) + BLOCKS) % BLOCKS;
    return (block){.edge = -outside, .x = dx, .y = dy, .id = demo_hash(wrapped, course, 9, p->seed)};
}

static double masonry_height(const demo_pattern *p, double u, double v)
{
    double wu = u + 0.008 * demo_fbm2(6 * u, 6 * v, 6, 6, 3, 0.5, p->seed + 21);
    double wv = v + 0.008 * demo_fbm2(6 * u, 6 * v, 6, 6, 3, 0.5, p->seed + 22);
    block b = block_at(p, wu, wv);
    double chip = demo_fbm2(20 * u, 20 * v, 20, 20, 5, 0.6, p->seed + 1);
    double edge = b.edge + 0.035 * chip, shoulder = demo_clamp((edge - 0.05) / 0.20, 0, 1);
    double facets = demo_ridged2(7 * u, 7 * v, 7, 7, 4, p->seed + 2) - 0.5;
    double face = 0.66 + 0.15 * (unit(b.id, 0) - 0.5) + 0.14 * facets + 0.05 * chip +
                  0.16 * ((unit(b.id, 8) - 0.5) * b.x + (unit(b.id, 16) - 0.5) * b.y);
    double mortar = 0.22 + 0.05 * demo_fbm2(50 * u, 50 * v, 50, 50, 4, 0.7, p->seed + 3);
    double stone = face + 0.3 * (sqrt(shoulder * (2 - shoulder)) - 1);
    return demo_max(mortar, demo_mix(mortar, stone, demo_step(0.03, 0.07, edge)));
}

static void masonry_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double wu = u + 0.008 * demo_fbm2(6 * u, 6 * v, 6, 6, 3, 0.5, p->seed + 21);
    double wv = v + 0.008 * demo_fbm2(6 * u, 6 * v, 6, 6, 3, 0.5, p->seed + 22);
    block b = block_at(p, wu, wv);
    double grain = demo_fbm2(48 * u, 48 * v, 48, 48, 5, 0.65, p->seed + 7);
    double tone = unit(b.id, 24), strata = demo_fbm2(4 * u, 22 * v, 4, 22, 4, 0.5, p->seed + 8);
    demo_set_color(t->color, 0.40, 0.31, 0.205);
    demo_mix3(t->color, (double[]){0.29, 0.245, 0.195}, tone);
    demo_mix3(t->color, (double[]){0.42, 0.27, 0.145}, demo_clamp(strata + 0.2, 0, 0.6));
    for (int k = 0; k < 3; k++) t->color[k] *= 1 + 0.35 * grain + 1.2 * r->cavity;
    demo_mix3(t->color, (double[]){0.33 + 0.1 * grain, 0.30 + 0.1 * grain, 0.25 + 0.08 * grain},
              demo_step(0.34, 0.26, r->height));
    t->roughness = demo_clamp(0.86 + 0.15 * grain, 0.6, 1);
    t->metallic = 0;
}

demo_pattern demo_masonry(uint32_t seed)
{
    return (demo_pattern){
        .height = masonry_height, .shade = masonry_shade, .columns = 1024, .rows = 1024, .seed = seed};
}

/* One ring of petals: lobes between two radii, each with a vein. */
static double petals(double angle, double radius, int count, double inner, double outer)
{
    double turn = demo_fract(angle / (2 * DEMO_PI) * count) * 2 - 1;
    double along = (radius - inner) / (outer - inner);
    if (along <= 0 || along >= 1) return 0;
    double width = 0.96 * sqrt(sin(DEMO_PI * pow(along, 0.8)));
    if (fabs(turn) >= width) return 0;
    double across = turn / width, vein = 0.22 * demo_step(0.12, 0.02, fabs(across));
    return (0.45 + 0.55 * along) * sqrt(1 - across * across) - vein * (1 - along);
}

static double rosette_height(const demo_pattern *p, double u, double v)
{
    double x = u - 0.5, y = v - 0.5, radius = hypot(x, y), angle = atan2(y, x);
    double rim = 0.5 - demo_max(fabs(x), fabs(y)),
           grain = 0.02 * demo_fbm2(9 * u, 70 * v, 9, 70, 4, 0.6, p->seed);
    /* From the border inwards: flat frame, cove, beads, field. The frame is exactly 1. */
    if (rim < 0.055) return 1;
    double h = 0.30 + 0.70 * (1 - demo_dome(1 - demo_clamp((rim - 0.055) / 0.045, 0, 1)));
    if (rim > 0.1) h = 0.30;
    double along = fabs(x) > fabs(y) ? y : x,
           bead = hypot((demo_fract(along * 22 + 0.5) - 0.5) / 22, rim - 0.128);
    h = demo_max(h, 0.30 + 0.38 * demo_dome(bead / 0.0205));
    double ring = demo_dome((radius - 0.335) / 0.02);
    h = demo_max(h, 0.30 + 0.42 * ring);
    h = demo_max(h, 0.26 + 0.40 * petals(angle + DEMO_PI / 12, radius, 12, 0.10, 0.315));
    h = demo_max(h, 0.30 + 0.62 * petals(angle, radius, 8, 0.045, 0.215));
    if (radius < 0.052) h = demo_max(h, 0.55 + 0.35 * demo_dome(radius / 0.052));
    for (int k = 0; k < 4; k++) {
        /* A leaf in each corner. */
        double cx = (k & 1) ? 0.5 : -0.5, cy = (k & 2) ? 0.5 : -0.5;
        double qx = (cx - x) * (cx > 0 ? 1 : -1), qy = (cy - y) * (cy > 0 ? 1 : -1);
        h = demo_max(
            h, 0.28 + 0.5 *
                          petals(atan2(qy, qx) - DEMO_PI / 4 + DEMO_PI / 10, hypot(qx, qy), 10, 0.20, 0.345) *
                          demo_step(0.15, 0.16, rim));
    }
    return demo_min(h + grain * demo_step(0.055, 0.07, rim), 1);
}

static void rosette_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double warp = demo_fbm2(3 * u, 3 * v, 3, 3, 4, 0.5, p->seed + 1);
    double grain = demo_fbm2(5 * u + warp, 60 * v, 5, 60, 5, 0.6, p->seed + 2);
    double rings = demo_step(0.1, 0.9, 0.5 + 0.5 * sin(40 * v + 9 * warp));
    demo_set_color(t->color, 0.36, 0.175, 0.065);
    demo_mix3(t->color, (double[]){0.22, 0.09, 0.032}, 0.6 * rings + 0.4 * grain);
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 0.3 * grain + 2.5 * r->cavity, 0.3, 1.6);
    t->roughness = demo_clamp(0.42 + 0.15 * grain - 0.8 * r->cavity, 0.25, 0.8);
    t->metallic = 0;
}

demo_pattern demo_rosette(uint32_t seed)
{
    return (demo_pattern){
        .height = rosette_height, .shade = rosette_shade, .columns = 1024, .rows = 1024, .seed = seed};
}

enum { LAKE = 20 }; /* level of the water, per cent */

static double mountains_height(const demo_pattern *p, double u, double v)
{
    double wu = 0.055 * demo_fbm2(4 * u, 4 * v, 4, 4, 4, 0.5, p->seed + 1);
    double wv = 0.055 * demo_fbm2(4 * u, 4 * v, 4, 4, 4, 0.5, p->seed + 2);
    double ridges = demo_ridged2(5 * (u + wu), 5 * (v + wv), 5, 5, 9, p->seed + 3);
    double hills = 0.5 + 0.5 * demo_fbm2(2 * (u + wu), 2 * (v + wv), 2, 2, 8, 0.48, p->seed + 4);
    double land = pow(demo_clamp(hills * 1.35 - 0.22, 0, 1), 1.25);
    double h = 0.10 + 0.35 * land + 0.75 * land * pow(ridges, 1.4);
    return demo_max(h, LAKE / 100.0);
}

static void mountains_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double slope = hypot(r->du, r->dv), noise = demo_fbm2(40 * u, 40 * v, 40, 40, 5, 0.65, p->seed + 7);
    if (r->height < LAKE / 100.0 + 0.0004) {
        demo_set_color(t->color, 0.012, 0.05, 0.065);
        t->roughness = 0.08;
        return;
    }
    demo_set_color(t->color, 0.075 + 0.03 * noise, 0.095 + 0.03 * noise, 0.03);
    demo_mix3(t->color, (double[]){0.03, 0.052, 0.018},
              demo_step(-0.1, 0.3, noise) * demo_step(0.55, 0.35, r->height));
    demo_mix3(t->color, (double[]){0.19, 0.165, 0.09}, demo_step(0.32, 0.5, r->height + 0.1 * noise));
    double rock[3] = {0.17 + 0.06 * noise, 0.15 + 0.055 * noise, 0.135 + 0.05 * noise};
    demo_mix3(t->color, rock, demo_step(3.4, 5.6, slope + 0.9 * noise));
    double snow =
        demo_step(0.44, 0.54, r->height + 0.1 * noise + 0.8 * r->cavity) * demo_step(9.5, 5.0, slope + noise);
    demo_mix3(t->color, (double[]){0.86, 0.88, 0.92}, snow);
    demo_mix3(t->color, (double[]){0.24, 0.20, 0.13}, demo_step(0.209, 0.202, r->height));
    t->roughness = demo_mix(0.95, 0.6, snow);
}

demo_pattern demo_mountains(uint32_t seed)
{
    return (demo_pattern){
        .height = mountains_height, .shade = mountains_shade, .columns = 2048, .rows = 2048, .seed = seed};
}

static double ripples_height(const demo_pattern *p, double u, double v)
{
    double wu = 0.10 * demo_noise2(3 * u, 3 * v, 3, 3, p->seed + 1);
    double wv = 0.10 * demo_noise2(3 * u, 3 * v, 3, 3, p->seed + 2);
    double swell = demo_fbm2(5 * (u + wu), 5 * (v + wv), 5, 5, 2, 0.3, p->seed + 3);
    double vein = demo_noise2(4 * (u + wv), 4 * (v + wu), 4, 4, p->seed + 4),
           crest = 1 - 2 * sqrt(vein * vein + 0.01);
    double h = 0.47 + 0.45 * swell + 0.14 * crest;
    double rim = demo_min(demo_min(u, 1 - u), demo_min(v, 1 - v));
    return demo_mix(0.5, demo_clamp(h, 0.02, 0.98), demo_step(0.03, 0.12, rim));
}

demo_pattern demo_ripples(uint32_t seed)
{
    return (demo_pattern){.height = ripples_height, .columns = 1024, .rows = 1024, .seed = seed};
}
