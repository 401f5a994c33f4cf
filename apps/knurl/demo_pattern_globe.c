/* Patterns over whole spheres: coral, moon, planet, urchin. */
#include "demo_pattern.h"

#include "demo_noise.h"

static void scaled(const double d[3], double scale, double shift, double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = scale * d[k] + shift;
}

static void direction_at(const demo_pattern *p, double u, double v, double d[3])
{
    if (p->octahedral)
        demo_octahedral(u, v, d);
    else
        demo_latitude_longitude(u, v, d);
}

enum { WAVES = 18, WAVE_NUMBER = 26 };

/* A narrow-band random field: plane waves of one length in all directions. Its level sets wind and
 * fork as the furrows of brain corals do. */
static double furrows(const demo_pattern *p, const double d[3])
{
    double sum = 0;
    for (int i = 0; i < WAVES; i++) {
        const double *wave = p->table[i];
        sum += cos(wave[0] * d[0] + wave[1] * d[1] + wave[2] * d[2] + wave[3]);
    }
    return sum / sqrt(WAVES / 2.0);
}

static double coral_height(const demo_pattern *p, double u, double v)
{
    double d[3], q[3], fine[3];
    demo_latitude_longitude(u, v, d);
    scaled(d, 2.5, 3, q);
    for (int k = 0; k < 3; k++)
        fine[k] = d[k] + 0.02 * demo_noise3((double[3]){q[k], q[(k + 1) % 3], q[(k + 2) % 3]}, p->seed);
    double field = furrows(p, fine), wall = demo_step(-0.42, 0.55, field);
    double crest = 0.10 * demo_step(0.9, 1.3, field);
    scaled(d, 60, 9, q);
    double teeth = 0.05 * demo_noise3(q, p->seed + 1) * (1 - 0.8 * fabs(2 * wall - 1));
    double h = 0.12 + 0.78 * wall - crest + teeth;
    /* Triangles at the poles all read v near 0 or 1 at different u: the height must not depend on u there. */
    double pole = demo_min(v, 1 - v);
    return demo_mix(0.55, h, demo_step(0.066, 0.095, pole));
}

static void coral_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double d[3], q[3];
    demo_latitude_longitude(u, v, d);
    scaled(d, 4, 1, q);
    double mottle = demo_fbm3(q, 5, 0.55, p->seed + 3);
    demo_set_color(t->color, 0.10, 0.19, 0.13);
    demo_mix3(t->color, (double[]){0.62, 0.33, 0.16}, demo_step(0.18, 0.62, r->height));
    demo_mix3(t->color, (double[]){0.88, 0.66, 0.42}, demo_step(0.66, 0.92, r->height));
    for (int k = 0; k < 3; k++) t->color[k] *= 1 + 0.5 * mottle;
    t->roughness = demo_clamp(0.62 - 0.2 * r->height + 0.2 * mottle, 0.35, 0.9);
    t->metallic = 0;
}

demo_pattern demo_coral(uint32_t seed)
{
    demo_pattern pattern = (demo_pattern){
        .height = coral_height, .shade = coral_shade, .columns = 2048, .rows = 1024, .seed = seed};
    for (int32_t i = 0; i < WAVES; i++) {
        double y = 2 * (i + 0.5) / WAVES - 1, turn = 2 * DEMO_PI * demo_random(i, 0, 0, seed),
               ring = sqrt(1 - y * y);
        pattern.table[i][0] = WAVE_NUMBER * ring * cos(turn);
        pattern.table[i][1] = WAVE_NUMBER * y;
        pattern.table[i][2] = WAVE_NUMBER * ring * sin(turn);
        pattern.table[i][3] = 2 * DEMO_PI * demo_random(i, 1, 0, seed);
    }
    return pattern;
}

/* Profile of a crater over distance / radius: bowl, raised rim, apron of ejecta. */
static double crater_profile(double q, double flat)
{
    if (q > 2.1) return 0;
    double bowl = demo_max(q * q - 1, -flat), rim = 0.42 * exp(-9 * (q - 1) * (q - 1));
    double apron = 0.10 * demo_step(2.1, 1.0, q) * (q > 1 ? 1 : q * q);
    return (q < 1 ? 0.9 * bowl : 0) + rim + apron;
}

/* Craters of about one size: one at most per cell of a lattice around the sphere. */
static double craters(const double d[3], double cells, double density, uint32_t seed)
{
    double q[3], sum = 0, gap[3][3]; /* gap: squared distance to the cells before, here and after */
    int32_t base[3];
    for (int k = 0; k < 3; k++) {
        q[k] = d[k] * cells;
        base[k] = (int32_t)floor(q[k]);
        double inside = q[k] - base[k];
        gap[k][0] = inside * inside;
        gap[k][1] = 0;
        gap[k][2] = (1 - inside) * (1 - inside);
    }
    for (int n = 0; n < 27; n++) {
        int i[3] = {n % 3, n / 3 % 3, n / 9};
        /* Beyond the apron of the largest crater. */
        if (gap[0][i[0]] + gap[1][i[1]] + gap[2][i[2]] > 0.9) continue;
        int32_t c[3] = {base[0] + i[0] - 1, base[1] + i[1] - 1, base[2] + i[2] - 1};
        if (demo_random(c[0], c[1], c[2], seed) > density) continue;
        double centre[3], length = 0, squared = 0;
        for (int k = 0; k < 3; k++) {
            centre[k] = c[k] + demo_random(c[0], c[1], c[2], seed + 1 + (uint32_t)k);
            length += centre[k] * centre[k];
        }
        length = sqrt(length);
        /* Only cells that the sphere passes through hold one, so that their sizes stay alike. */
        if (fabs(length - cells) > 0.5) continue;
        for (int k = 0; k < 3; k++)
            squared += (q[k] - centre[k] * cells / length) * (q[k] - centre[k] * cells / length);
        double size = demo_random(c[0], c[1], c[2], seed + 4), radius = 0.14 + 0.32 * size * size;
        sum += radius * crater_profile(sqrt(squared) / radius, 0.35 + 0.4 * (1 - size));
    }
    return sum / cells;
}

static double moon_relief(const demo_pattern *p, const double d[3])
{
    double q[3], warped[3];
    scaled(d, 3, 7, q);
    for (int k = 0; k < 3; k++) {
        double turned[3] = {4 * q[k], 4 * q[(k + 1) % 3], 4 * q[(k + 2) % 3]};
        warped[k] = d[k] + 0.01 * demo_fbm3(turned, 2, 0.5, p->seed + 2);
    }
    double h = 0.05 * demo_fbm3(q, 8, 0.55, p->seed);
    for (int i = 0; i < 4; i++) {
        double cells = 1.9 * pow(2.35, i);
        h += 0.95 * craters(warped, cells, i < 2 ? 0.75 : 0.5, p->seed + 17 * (uint32_t)i);
    }
    return h;
}

static double moon_height(const demo_pattern *p, double u, double v)
{
    double d[3];
    direction_at(p, u, v, d);
    double h = 0.62 + 1.9 * moon_relief(p, d);
    return p->octahedral ? h : demo_mix(0.62, h, demo_step(0.01, 0.03, demo_min(v, 1 - v)));
}

static void moon_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double d[3], q[3];
    direction_at(p, u, v, d);
    scaled(d, 1.6, 2, q);
    double mare = demo_step(0.0, 0.35, demo_fbm3(q, 7, 0.55, p->seed + 5));
    scaled(d, 30, 0, q);
    double grain = demo_fbm3(q, 4, 0.6, p->seed + 6);
    demo_set_color(t->color, 0.45, 0.43, 0.40);
    demo_mix3(t->color, (double[]){0.17, 0.165, 0.17}, 0.85 * mare);
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 0.3 * grain + 3 * r->cavity, 0.5, 1.6);
    t->roughness = 0.95;
}

demo_pattern demo_moon(uint32_t seed)
{
    return (demo_pattern){.height = moon_height,
                          .shade = moon_shade,
                          .columns = 1024,
                          .rows = 1024,
                          .octahedral = true,
                          .seed = seed};
}

/* The moon's craters with poles, darker. */
static void asteroid_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    moon_shade(p, u, v, r, t);
    double dust = demo_step(0.45, 0.75, r->height);
    for (int k = 0; k < 3; k++) t->color[k] *= 0.55 + 0.35 * dust;
    t->color[2] *= 0.86;
}

demo_pattern demo_asteroid(uint32_t seed)
{
    return (demo_pattern){
        .height = moon_height, .shade = asteroid_shade, .columns = 4096, .rows = 4096, .seed = seed};
}

static double earth_level(const demo_pattern *p, const double d[3])
{
    double q[3], warped[3];
    scaled(d, 1.35, 11, q);
    for (int k = 0; k < 3; k++) {
        double turned[3] = {2 * q[k], 2 * q[(k + 1) % 3], 2 * q[(k + 2) % 3]};
        warped[k] = q[k] + 0.32 * demo_fbm3(turned, 3, 0.55, p->seed + 2);
    }
    double continents = demo_fbm3(warped, 9, 0.53, p->seed), land = demo_step(0.0, 0.30, continents);
    if (land <= 0) return 0.55 * continents;
    double turned[3] = {1.5 * warped[1], 1.5 * warped[2], 1.5 * warped[0]};
    double range = demo_step(-0.05, 0.4, demo_fbm3(turned, 3, 0.5, p->seed + 8));
    scaled(warped, 3.2, 0, q);
    return 0.55 * continents + land * (0.05 + 0.80 * range * pow(demo_ridged3(q, 8, p->seed + 4), 1.6));
}

enum { SEA = 16 }; /* level of the sea, per cent */

static double earth_height(const demo_pattern *p, double u, double v)
{
    double d[3];
    demo_octahedral(u, v, d);
    double ice = 0.03 * demo_step(0.90, 0.95,
                                  fabs(d[1]) + 0.02 * demo_noise3((double[3]){9 * d[0], 9 * d[1], 9 * d[2]},
                                                                  p->seed + 9));
    return demo_max(SEA / 100.0 + 0.9 * earth_level(p, d), SEA / 100.0 + ice);
}

static void earth_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    static const double white[3] = {0.80, 0.82, 0.85};
    double d[3], q[3];
    demo_octahedral(u, v, d);
    scaled(d, 12, 3, q);
    double noise = demo_fbm3(q, 6, 0.6, p->seed + 7), level = r->height - SEA / 100.0,
           cold = fabs(d[1]) + 0.06 * noise;
    scaled(d, 2.2, 5, q);
    for (int k = 0; k < 3; k++) q[k] += 0.5 * noise;
    double cloud =
        0.85 * demo_step(0.10, 0.42, demo_fbm3((double[3]){q[0], 1.7 * q[1], q[2]}, 7, 0.55, p->seed + 13));
    if (level < 0.0005) {
        double depth = demo_step(0, -0.22, earth_level(p, d));
        demo_set_color(t->color, 0.03, 0.16, 0.19);
        demo_mix3(t->color, (double[]){0.006, 0.025, 0.075}, sqrt(depth));
        demo_mix3(t->color, white, cloud);
        t->roughness = demo_mix(0.18, 1, cloud);
        return;
    }
    double dry = demo_step(0.12, 0.0, fabs(cold - 0.32) - 0.10 * noise);
    demo_set_color(t->color, 0.055, 0.10, 0.025);
    demo_mix3(t->color, (double[]){0.46, 0.32, 0.15}, 0.9 * dry);
    demo_mix3(t->color, (double[]){0.10, 0.105, 0.06}, demo_step(0.5, 0.75, cold));
    demo_mix3(t->color, (double[]){0.20, 0.15, 0.11}, demo_step(0.12, 0.30, level + 0.1 * noise));
    double line = demo_mix(0.42, 0.10, demo_step(0.2, 0.85, cold));
    double snow = demo_max(demo_step(line, line + 0.10, level + 0.06 * noise), demo_step(0.88, 0.93, cold));
    demo_mix3(t->color, (double[]){0.86, 0.89, 0.93}, snow);
    demo_mix3(t->color, (double[]){0.50, 0.42, 0.27}, (1 - snow) * demo_step(0.012, 0.003, level));
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 0.35 * noise + 2 * r->cavity, 0.5, 1.2);
    demo_mix3(t->color, white, cloud);
    t->roughness = demo_mix(0.95, 0.65, snow);
}

demo_pattern demo_earth(uint32_t seed)
{
    return (demo_pattern){.height = earth_height,
                          .shade = earth_shade,
                          .columns = 1536,
                          .rows = 1536,
                          .octahedral = true,
                          .seed = seed};
}

enum { SPINES = 220 };

/* Angle to the nearest spine, over the spines' spacing; `spine` is its number. Spines are numbered
 * from the upper pole down, so only a band of them needs a look. */
static double nearest_spine(const demo_pattern *p, const double d[3], int *spine)
{
    double best = -1;
    int middle = (int)((1 - d[1]) * 0.5 * SPINES), reach = 28;
    for (int i = middle - reach; i <= middle + reach; i++) {
        if (i < 0 || i >= SPINES) continue;
        double facing = p->table[i][0] * d[0] + p->table[i][1] * d[1] + p->table[i][2] * d[2];
        if (facing <= best) continue;
        best = facing;
        *spine = i;
    }
    return acos(demo_clamp(best, -1, 1)) / sqrt(4 * DEMO_PI / SPINES);
}

static double urchin_height(const demo_pattern *p, double u, double v)
{
    double d[3], q[3];
    int spine = 0;
    demo_octahedral(u, v, d);
    double away = nearest_spine(p, d, &spine);
    double length = 0.62 + 0.38 * demo_random(spine, 1, 1, p->seed);
    double cone = demo_clamp(1 - away / 0.30, 0, 1);
    /* A cone on a flared foot; fine rings along the cone. */
    double flare = 0.09 * exp(-9 * demo_max(away - 0.26, 0)) * demo_step(0.75, 0.3, away);
    scaled(d, 40, 5, q);
    double skin = 0.008 * demo_fbm3(q, 3, 0.6, p->seed + 2);
    double h = demo_max(0.055 + flare, 0.10 + (length - 0.1) * cone);
    return cone > 0.9 ? h : h + skin;
}

static void urchin_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double d[3];
    int spine = 0;
    demo_octahedral(u, v, d);
    (void)nearest_spine(p, d, &spine);
    double tip = demo_step(0.12, 0.75, r->height), tone = demo_random(spine, 2, 1, p->seed);
    demo_set_color(t->color, 0.030, 0.012, 0.050);
    demo_mix3(t->color, (double[]){0.36, 0.025, 0.10}, demo_step(0.08, 0.32, r->height));
    demo_mix3(t->color, (double[]){0.95, 0.52 + 0.15 * tone, 0.22}, tip * tip);
    t->roughness = 0.38 - 0.12 * tip;
    t->metallic = 0;
}

demo_pattern demo_urchin(uint32_t seed)
{
    demo_pattern pattern = (demo_pattern){.height = urchin_height,
                                          .shade = urchin_shade,
                                          .columns = 1024,
                                          .rows = 1024,
                                          .octahedral = true,
                                          .seed = seed};
    /* A Fibonacci spiral, slightly disturbed. */
    for (int32_t i = 0; i < SPINES; i++) {
        double y = 1 - 2 * (i + 0.5) / SPINES, ring = sqrt(1 - y * y);
        double turn = i * 2.39996322972865332 + 0.25 * (demo_random(i, 0, 1, seed) - 0.5);
        pattern.table[i][0] = ring * cos(turn);
        pattern.table[i][1] = y;
        pattern.table[i][2] = ring * sin(turn);
    }
    return pattern;
}
