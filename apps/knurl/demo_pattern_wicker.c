/* Woven willow. */
#include "demo_pattern.h"

#include "demo_noise.h"

enum { STAKES = 8, RODS = 8 }; /* per tile; even, so that over and under meet at the border */

typedef struct wicker {
    double height, shine;
    uint32_t id;
} wicker;

/* Stakes stand at whole numbers of x; each row is one bundle of rods that passes before every other stake. */
static wicker wicker_at(const demo_pattern *p, double u, double v)
{
    double x = u * STAKES, y = v * RODS, across = demo_fract(y) * 2 - 1;
    int32_t row = (int32_t)floor(y), stake = (int32_t)floor(x + 0.5);
    int32_t row_id = ((row % RODS) + RODS) % RODS, stake_id = ((stake % STAKES) + STAKES) % STAKES;
    wicker w = {.height = 0.05, .id = 0};
    double to_stake = x - floor(x + 0.5);
    double standing = 0.34 + 0.20 * demo_dome(to_stake / 0.17);
    if (fabs(to_stake) < 0.17)
        w = (wicker){
            .height = standing, .shine = 1 - fabs(to_stake) / 0.17, .id = demo_hash(stake_id, 0, 1, p->seed)};
    /* Three thin rods side by side; each wobbles on its own. */
    double sway = cos(DEMO_PI * (x + row)), lift = 0.48 + 0.24 * sway;
    for (int32_t k = 0; k < 3; k++) {
        double wobble = 0.05 * demo_noise2(1.0 * x, 0.5 + k + 3 * row_id, STAKES, 3 * RODS, p->seed + 5);
        double q = (across - (k - 1) * 0.61 - wobble) / 0.33;
        double rod = lift + 0.20 * demo_dome(q) - 0.03 * demo_random(row_id, k, 4, p->seed);
        if (fabs(q) < 1 && rod > w.height)
            w = (wicker){.height = rod, .shine = 1 - fabs(q), .id = demo_hash(row_id, k, 2, p->seed)};
    }
    return w;
}

static double wicker_height(const demo_pattern *p, double u, double v)
{
    wicker w = wicker_at(p, u, v);
    if (w.id == 0) return w.height;
    return w.height + 0.015 * demo_fbm2(14 * u, 90 * v, 14, 90, 3, 0.6, p->seed + w.id % 7);
}

static void wicker_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    wicker w = wicker_at(p, u, v);
    double tone = ((w.id >> 8) & 255) / 255.0, fibre = demo_fbm2(10 * u, 80 * v, 10, 80, 4, 0.6, p->seed + 3);
    demo_set_color(t->color, 0.40, 0.215, 0.085);
    demo_mix3(t->color, (double[]){0.56, 0.36, 0.16}, tone);
    if (w.id % 11 < 2) demo_mix3(t->color, (double[]){0.17, 0.070, 0.030}, 0.8);
    for (int k = 0; k < 3; k++)
        t->color[k] *= demo_clamp(0.55 + 0.6 * r->height + 0.4 * fibre + 1.2 * r->cavity, 0.15, 1.5);
    if (w.id == 0) demo_set_color(t->color, 0.02, 0.012, 0.008);
    t->roughness = demo_clamp(0.5 + 0.25 * fibre, 0.3, 0.9);
    t->metallic = 0;
}

demo_pattern demo_wicker(uint32_t seed)
{
    return (demo_pattern){
        .height = wicker_height, .shade = wicker_shade, .columns = 1024, .rows = 1024, .seed = seed};
}
