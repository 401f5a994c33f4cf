/* Plain height fields, and the hull of a machine. */
#include "demo_pattern.h"

#include "demo_noise.h"

typedef struct panel {
    double edge;    /* distance to the nearest side, in parts of the equator's length */
    double x, y;    /* from its middle, 1 at the sides */
    double size[2]; /* half its sides, as `edge` */
    int level;
    uint32_t id;
} panel;

enum { COLUMNS = 18, ROWS = 9 };

/* Rectangles that were halved a few times, by chance. */
static panel panel_at(const demo_pattern *p, double u, double v)
{
    double x0 = floor(u * COLUMNS) / COLUMNS, y0 = floor(v * ROWS) / ROWS, w = 1.0 / COLUMNS, h = 1.0 / ROWS;
    uint32_t id = demo_hash((int32_t)(u * COLUMNS), (int32_t)(v * ROWS), 5, p->seed);
    int level = 0;
    for (; level < 6; level++) {
        uint32_t draw = demo_hash((int32_t)id, level, 6, p->seed);
        if (level > 0 && (draw & 7) < 2) break;
        double *side = draw & 8 ? &w : &h, *low = draw & 8 ? &x0 : &y0, at = draw & 8 ? u : v;
        double part = 0.3 + 0.4 * ((draw >> 8) & 255) / 255.0;
        bool upper = at > *low + *side * part;
        if (upper) *low += *side * part;
        *side *= upper ? 1 - part : part;
        id = demo_hash((int32_t)id, upper, 7, p->seed);
    }
    double sx = 0.5 * w * sin(DEMO_PI * v), sy = 0.25 * h, x = 2 * (u - x0) / w - 1, y = 2 * (v - y0) / h - 1;
    double edge = demo_min((1 - fabs(x)) * sx, (1 - fabs(y)) * sy);
    return (panel){edge, x, y, {sx, sy}, level, id};
}

enum { KIND_PLAIN, KIND_VENT, KIND_RIVETS, KIND_DOME, KIND_PIPES, KIND_COUNT };

static int panel_kind(const panel *a)
{
    double ratio = a->size[0] / a->size[1];
    int kind = (int)(a->id >> 8) % 9;
    if (kind == KIND_DOME && (ratio < 0.5 || ratio > 2)) return KIND_VENT;
    return kind < KIND_COUNT ? kind : KIND_PLAIN;
}

/* Rows with a constant height: the trench around the equator, rings on the way to the caps. */
static bool panels_band(double v, double *h)
{
    double away = fabs(v - 0.5), pole = demo_min(v, 1 - v);
    if (away < 0.021) {
        *h = 0.06 + 0.05 * demo_step(0.006, 0.004, away);
        return true;
    }
    if (pole < 0.075) {
        *h = 0.45 + 0.25 * demo_step(0.064, 0.060, pole) - 0.30 * demo_step(0.038, 0.034, pole) +
             0.2 * demo_step(0.018, 0.014, pole);
        return true;
    }
    if (fabs(away - 0.16) < 0.006 || fabs(away - 0.30) < 0.006) {
        *h = 0.20;
        return true;
    }
    return false;
}

static double panels_height(const demo_pattern *p, double u, double v)
{
    double h;
    if (panels_band(v, &h)) {
        if (fabs(v - 0.5) < 0.021 && demo_fract(48 * u) < 0.4 && fabs(v - 0.5) > 0.008) h += 0.12;
        return h;
    }
    panel a = panel_at(p, u, v);
    double base = 0.34 + 0.46 * ((a.id & 255) / 255.0) * (a.level > 3 ? 1 : 0.6);
    h = demo_mix(0.16, base, demo_step(0.0004, 0.0013, a.edge));
    double across = demo_min(a.size[0], a.size[1]);
    switch (panel_kind(&a)) {
    case KIND_VENT: {
        double line = a.size[0] > a.size[1] ? a.x : a.y, length = demo_max(a.size[0], a.size[1]);
        if (a.edge > 0.3 * across) h -= 0.16 * demo_step(0.1, -0.1, sin(line * length * 1500));
        break;
    }
    case KIND_RIVETS: {
        double x = demo_fract(a.x * a.size[0] * 300) - 0.5, y = demo_fract(a.y * a.size[1] * 300) - 0.5;
        if (a.edge > 0.0016 && a.edge < 0.0055) h += 0.10 * demo_dome(hypot(x, y) / 0.3);
        break;
    }
    case KIND_DOME: {
        double q = hypot(a.x * a.size[0], a.y * a.size[1]) / (0.75 * across);
        h += 0.22 * demo_dome(q) - 0.06 * demo_step(0.1, 0.04, fabs(q - 1.1));
        break;
    }
    case KIND_PIPES: {
        double line = a.size[0] > a.size[1] ? a.y * a.size[1] : a.x * a.size[0];
        if (a.edge > 0.0016) h += 0.16 * demo_dome((demo_fract(line * 260) - 0.5) / 0.4) - 0.05;
        break;
    }
    default:
        break;
    }
    return h;
}

static void panels_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double h, grime = demo_fbm2(10 * u, 5 * v, 10, 5, 5, 0.6, p->seed + 2);
    bool band = panels_band(v, &h);
    panel a = panel_at(p, u, v);
    double tone = ((a.id >> 16) & 255) / 255.0;
    demo_set_color(t->color, 0.30 + 0.22 * tone, 0.31 + 0.21 * tone, 0.33 + 0.20 * tone);
    t->metallic = 1;
    t->roughness = 0.26 + 0.25 * tone;
    if (!band && (a.id >> 24) % 23 == 0) {
        demo_set_color(t->color, 0.62, 0.16, 0.03);
        t->metallic = 0;
    } else if (!band && panel_kind(&a) == KIND_PIPES) {
        demo_set_color(t->color, 0.66, 0.40, 0.19);
    } else if (band && fabs(v - 0.5) < 0.006) {
        demo_set_color(t->color, 0.10, 0.55, 0.75);
        t->metallic = 0;
    }
    double dirt = demo_clamp(0.12 + 0.5 * grime - 5 * r->cavity, 0, 0.8);
    demo_mix3(t->color, (double[]){0.05, 0.042, 0.036}, dirt);
    t->roughness = demo_clamp(t->roughness + 0.35 * dirt, 0.15, 0.9);
}

demo_pattern demo_panels(uint32_t seed)
{
    return (demo_pattern){
        .height = panels_height, .shade = panels_shade, .columns = 8192, .rows = 8192, .seed = seed};
}

/* Height fields are seen as plain clay, a little darker in what lies deep. */
static void clay_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    (void)p;
    (void)u;
    (void)v;
    demo_set_color(t->color, 0.20, 0.22, 0.26);
    demo_mix3(t->color, (double[]){0.62, 0.50, 0.36}, demo_step(0.05, 0.75, r->height));
    t->roughness = 0.7;
    t->metallic = 0;
}

static double lattice_height(const demo_pattern *p, double u, double v)
{
    (void)p;
    double x = demo_whole_distance(8 * u) * 2, y = demo_whole_distance(8 * v) * 2;
    /* Bars half way between whole numbers; the border is level. */
    double rim = demo_min(demo_min(u, 1 - u), demo_min(v, 1 - v));
    return demo_max(demo_step(0.62, 0.70, x), demo_step(0.62, 0.70, y)) * demo_step(0.030, 0.038, rim);
}

demo_pattern demo_lattice(uint32_t seed)
{
    return (demo_pattern){
        .height = lattice_height, .shade = clay_shade, .columns = 256, .rows = 256, .seed = seed};
}

static double hills_height(const demo_pattern *p, double u, double v)
{
    double rim = demo_step(0.0, 0.16, demo_min(demo_min(u, 1 - u), demo_min(v, 1 - v)));
    double h = 0.5 + 0.5 * sin(2 * DEMO_PI * (1.5 * u + 0.1)) * sin(2 * DEMO_PI * (1.5 * v + 0.05));
    return 0.05 + rim * (0.72 * h + 0.2 * demo_noise2(5 * u, 5 * v, 5, 5, p->seed));
}

demo_pattern demo_hills(uint32_t seed)
{
    return (demo_pattern){
        .height = hills_height, .shade = clay_shade, .columns = 512, .rows = 512, .seed = seed};
}

static double needles_height(const demo_pattern *p, double u, double v)
{
    demo_cells cells = {
        .columns = 14, .rows = 14, .jitter = 0.28, .stretch = 1, .corner = 0.02, .seed = p->seed};
    demo_cell cell = demo_cells_at(&cells, u, v);
    double top = 0.55 + 0.45 * ((cell.id & 255) / 255.0), q = hypot(cell.x, cell.y) / 0.36;
    double ground = 0.05 + 0.02 * demo_noise2(9 * u, 9 * v, 9, 9, p->seed + 1);
    return demo_max(ground, top * (1 - q));
}

demo_pattern demo_needles(uint32_t seed)
{
    return (demo_pattern){
        .height = needles_height, .shade = clay_shade, .columns = 512, .rows = 512, .seed = seed};
}
