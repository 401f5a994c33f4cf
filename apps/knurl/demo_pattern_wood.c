/* Patterns of a felled trunk and of a bamboo dragon. */
#include "demo_pattern.h"

#include "demo_noise.h"

enum { CUT = 64 }; /* v where the cut begins, per cent */

static double bark_height(const demo_pattern *p, double u, double v, double *deep)
{
    double wu = u + 0.012 * demo_fbm2(8 * u, 5 * v, 8, 5, 4, 0.5, p->seed + 1);
    double wv = v + 0.030 * demo_fbm2(8 * u, 5 * v, 8, 5, 4, 0.5, p->seed + 2);
    double rough = demo_fbm2(60 * u, 30 * v, 60, 30, 5, 0.6, p->seed + 3);
    /* Long furrows where slow noise changes its sign, short ones between them. */
    double furrow = fabs(demo_noise2(26 * wu, 5 * wv, 26, 5, p->seed));
    double crack = 1.5 * fabs(demo_noise2(34 * wu, 13 * wv, 34, 13, p->seed + 4));
    *deep = demo_min(furrow, crack) + 0.03 * rough;
    double plate = demo_step(-0.01, 0.20, *deep);
    return 0.10 + 0.52 * plate + 0.30 * furrow * plate + 0.07 * rough;
}

/* Distance from the pith in radii, bent as the trunk grew, and how far into a crack. */
static double ring_radius(const demo_pattern *p, double u, double v, double *crack)
{
    double radius = (1 - v) / (1 - CUT / 100.0), x = radius * cos(2 * DEMO_PI * u),
           y = radius * sin(2 * DEMO_PI * u);
    double bend = 0.5 * demo_fbm2(2 * x + 8, 2 * y + 8, 64, 64, 4, 0.5, p->seed + 6);
    *crack = 1;
    for (int32_t i = 0; i < 7; i++) {
        double at =
            demo_random(i, 3, 0, p->seed) + 0.02 * demo_noise2(6 * radius + 9, i + 0.5, 64, 64, p->seed + 7);
        double reach = 0.25 + 0.75 * demo_random(i, 4, 0, p->seed),
               away = demo_whole_distance(u - at) * radius;
        double open = 0.010 * demo_step(1 - reach, 1.0, radius) + 0.001;
        *crack = demo_min(*crack, radius > 1 - reach ? away / open : 1);
    }
    return radius + 0.06 * bend * radius;
}

static double cut_height(const demo_pattern *p, double u, double v)
{
    double crack, radius = ring_radius(p, u, v, &crack), x = radius * cos(2 * DEMO_PI * u),
                  y = radius * sin(2 * DEMO_PI * u);
    double rings = 0.5 + 0.5 * sin(2 * DEMO_PI * 22 * radius);
    double saw = demo_noise2(30 * (x + 0.4 * y) + 64, 3 * y + 64, 128, 128, p->seed + 8);
    double h = 0.50 + 0.05 * rings * demo_step(0.0, 0.1, radius) + 0.03 * saw * demo_step(0.02, 0.1, radius);
    return h - 0.40 * demo_step(1, 0.2, crack);
}

static double stump_height(const demo_pattern *p, double u, double v)
{
    double deep,
        line = CUT / 100.0,
        at = demo_step(line - 0.006, line + 0.006, v + 0.004 * demo_noise2(30 * u, 0.5, 30, 1, p->seed + 9));
    double h = at < 1 ? bark_height(p, u, v, &deep) : 0;
    if (at > 0) h = demo_mix(h, cut_height(p, u, v), at);
    return demo_mix(0.5, h, demo_step(1, 0.992, v));
}

static void stump_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double noise = demo_fbm2(12 * u, 8 * v, 12, 8, 6, 0.6, p->seed + 11), deep;
    t->metallic = 0;
    t->roughness = 0.9;
    if (v > CUT / 100.0) {
        double crack, radius = ring_radius(p, u, v, &crack),
                      rings = 0.5 + 0.5 * sin(2 * DEMO_PI * 22 * radius);
        demo_set_color(t->color, 0.60, 0.40, 0.20);
        demo_mix3(t->color, (double[]){0.34, 0.17, 0.07},
                  0.55 * pow(rings, 3) + 0.55 * demo_step(0.62, 0.2, radius));
        demo_mix3(t->color, (double[]){0.16, 0.09, 0.045}, demo_step(0.93, 0.97, radius));
        for (int k = 0; k < 3; k++)
            t->color[k] *= demo_clamp(1 + 0.3 * noise, 0.6, 1.4) * demo_step(-0.2, 1.0, crack);
        t->roughness = 0.72;
        return;
    }
    (void)bark_height(p, u, v, &deep);
    demo_set_color(t->color, 0.20, 0.135, 0.085);
    demo_mix3(t->color, (double[]){0.34, 0.27, 0.20}, demo_clamp(2 * r->cavity + 0.5 * noise + 0.3, 0, 1));
    demo_mix3(t->color, (double[]){0.05, 0.028, 0.015}, demo_step(0.10, 0.0, deep));
    double moss = demo_step(0.05, 0.40, noise + 0.55 - 1.7 * v + r->cavity);
    demo_mix3(t->color, (double[]){0.085, 0.14, 0.022}, 0.9 * moss);
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 3 * r->cavity, 0.35, 1.6);
}

demo_pattern demo_stump(uint32_t seed)
{
    return (demo_pattern){
        .height = stump_height, .shade = stump_shade, .columns = 4096, .rows = 4096, .seed = seed};
}

enum { JOINTS = 34, SCALES = 22, SCALE_ROWS = 6 }; /* along; around; rows of scales per joint */

/* One overlapping scale; rows are staggered. 0 to 1, 1 at the tip's middle. */
static double scale_at(double u, double v, double *tip)
{
    double best = 0, y = v * JOINTS * SCALE_ROWS;
    int32_t row0 = (int32_t)floor(y);
    *tip = 0;
    for (int32_t row = row0 - 1; row <= row0; row++) {
        double x = demo_fract(u * SCALES + ((row & 1) ? 0.5 : 0)) - 0.5, along = (y - row) / 2;
        double width = 0.56 * sqrt(demo_clamp(1 - pow(along, 4), 0, 1)), q = fabs(x) / demo_max(width, 1e-6);
        if (q >= 1) continue;
        double h = (0.25 + 0.75 * along) * (1 - 0.5 * q * q) + 0.10 * demo_step(0.16, 0.0, fabs(x));
        if (h > best) {
            best = h;
            *tip = along;
        }
    }
    return best;
}

/* 0 on the back and flanks, 1 on the belly, which is at u = 0. */
static double belly_at(double u)
{
    return demo_step(0.19, 0.17, demo_whole_distance(u));
}

static double bamboo_height(const demo_pattern *p, double u, double v)
{
    double joint = demo_whole_distance(v * JOINTS), tip, scale = scale_at(u, v, &tip), belly = belly_at(u);
    double fibre = 0.02 * demo_fbm2(120 * u, 30 * v, 120, 30, 3, 0.6, p->seed);
    double plates = 0.30 * sqrt(demo_clamp(1 - pow(2 * demo_fract(v * 2 * JOINTS) - 1, 6), 0, 1));
    double h = 0.16 + demo_mix(0.30 * scale, plates, belly) + fibre;
    /* A culm's joint: a swollen ring with a cut below it. */
    h = demo_max(h, 0.18 + 0.34 * demo_dome(joint / 0.10));
    h -= 0.16 * demo_step(0.035, 0.0, fabs(joint - 0.125));
    /* Crest: a thorn on the back of each joint. */
    double crest = hypot(demo_whole_distance(u - 0.5) / 0.055, (demo_fract(v * JOINTS + 0.5) - 0.5) / 0.33);
    h += 0.50 * pow(demo_clamp(1 - crest, 0, 1), 1.2);
    return demo_mix(0.16, h, demo_step(0.004, 0.02, v) * demo_step(1, 0.985, v));
}

static void bamboo_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double joint = demo_whole_distance(v * JOINTS), tip,
           noise = demo_fbm2(10 * u, 40 * v, 10, 40, 5, 0.6, p->seed + 2);
    (void)scale_at(u, v, &tip);
    demo_set_color(t->color, 0.045, 0.17, 0.045);
    demo_mix3(t->color, (double[]){0.34, 0.46, 0.10}, demo_clamp(tip * tip + 0.4 * noise, 0, 1));
    demo_mix3(t->color, (double[]){0.72, 0.60, 0.26}, belly_at(u));
    demo_mix3(t->color, (double[]){0.62, 0.45, 0.13}, demo_step(0.12, 0.08, joint));
    double crest = hypot(demo_whole_distance(u - 0.5) / 0.055, (demo_fract(v * JOINTS + 0.5) - 0.5) / 0.33);
    demo_mix3(t->color, (double[]){0.70, 0.10, 0.03}, demo_step(0.95, 0.6, crest));
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 4 * r->cavity + 0.2 * noise, 0.3, 1.6);
    t->roughness = demo_clamp(0.34 + 0.2 * noise, 0.2, 0.8);
    t->metallic = 0;
}

demo_pattern demo_bamboo(uint32_t seed)
{
    return (demo_pattern){
        .height = bamboo_height, .shade = bamboo_shade, .columns = 4096, .rows = 4096, .seed = seed};
}
