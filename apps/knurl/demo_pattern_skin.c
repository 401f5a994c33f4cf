/* Patterns of skins: an alien's, a reptile's, leather, cloth. */
#include "demo_pattern.h"

#include "demo_noise.h"

static void scaled(const double d[3], double scale, double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = scale * d[k];
}

static double part(uint32_t id, int shift)
{
    return ((id >> shift) & 255) / 255.0;
}

enum { PLATES = 3 }; /* per tile, in one band */

typedef struct alien_plate {
    double x, y;   /* from its middle, in band heights */
    double border; /* to its edge, in band heights */
} alien_plate;

/* Plates lean more and more towards the band's lower edge: bands swirl around the ball. */
static alien_plate plate_at(double u, double v)
{
    double w = demo_fract(v), x = demo_fract(PLATES * u + 0.6 * w * w) - 0.5, y = w - 0.5;
    double radius = 0.16, qx = fabs(x) * 0.92 - 0.46 + radius, qy = fabs(y) - 0.455 + radius;
    double outside = hypot(demo_max(qx, 0), demo_max(qy, 0)) + demo_min(demo_max(qx, qy), 0) - radius;
    return (alien_plate){.x = x * 0.92, .y = y, .border = -outside};
}

enum { GROOVE = 12 }; /* height between bands, per cent */

static double alien_height(const demo_pattern *p, double u, double v)
{
    alien_plate at = plate_at(u, v);
    if (at.border <= 0) return GROOVE / 100.0;
    double rise = demo_clamp(at.border / 0.13, 0, 1), h = 0.42 * sqrt(rise * (2 - rise));
    double radius = hypot(at.x, at.y + 0.03), angle = atan2(at.y, at.x);
    /* Folds of skin around the eye, a lid, and the ball in its socket. */
    double folds = sin(7 * angle + 5 * demo_noise2(6 * u, 2 * v, 6, 2, p->seed));
    h += 0.05 * folds * demo_step(0.20, 0.30, radius) * demo_step(0.02, 0.14, at.border);
    h += 0.24 * exp(-pow((radius - 0.235) / 0.055, 2));
    double socket = demo_step(0.215, 0.17, radius);
    h = demo_mix(h, 0.10 + 0.62 * demo_dome(radius / 0.20), socket);
    if (radius < 0.075) h -= 0.10 * demo_step(0.07, 0.05, radius);
    double skin = 0.022 * demo_fbm2(30 * u, 12 * v, 30, 12, 5, 0.5, p->seed + 1);
    return GROOVE / 100.0 + h + skin * demo_step(0.0, 0.05, at.border) * (1 - socket);
}

static void alien_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    alien_plate at = plate_at(u, v);
    double radius = hypot(at.x, at.y + 0.03), mottle = demo_fbm2(12 * u, 5 * v, 12, 5, 5, 0.6, p->seed + 2);
    demo_set_color(t->color, 0.035, 0.15, 0.13);
    demo_mix3(t->color, (double[]){0.16, 0.42, 0.24}, demo_clamp(r->height + 0.8 * mottle, 0, 1));
    demo_mix3(t->color, (double[]){0.30, 0.05, 0.20}, demo_step(0.10, 0.02, at.border + 0.04 * mottle));
    demo_mix3(t->color, (double[]){0.62, 0.52, 0.30}, 0.8 * demo_step(0.045, 0.02, fabs(radius - 0.235)));
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 1.5 * r->cavity, 0.35, 1.5);
    t->roughness = demo_clamp(0.42 + 0.3 * mottle, 0.2, 0.8);
    if (radius > 0.195) return;
    double iris = demo_step(0.125, 0.11, radius), rays = 0.5 + 0.5 * sin(30 * atan2(at.y + 0.03, at.x));
    demo_set_color(t->color, 0.80, 0.74, 0.52);
    demo_mix3(t->color, (double[]){0.90, 0.30 + 0.25 * rays, 0.03}, iris);
    demo_mix3(t->color, (double[]){0.006, 0.004, 0.004}, demo_step(0.068, 0.055, radius));
    t->roughness = 0.08;
}

demo_pattern demo_alien(uint32_t seed)
{
    return (demo_pattern){
        .height = alien_height, .shade = alien_shade, .columns = 2048, .rows = 2048, .seed = seed};
}

/* How much a direction belongs to the back of the head: 1 behind and above, 0 at the throat. */
static double back_of_head(const double d[3])
{
    return demo_step(-0.45, 0.55, d[1] - 0.25 * d[2]);
}

/* 1 on the eyes, which are smooth balls of the base mesh. */
static double eye_of_head(const double d[3], double grow)
{
    double x = fabs(d[0]) - 0.60, y = d[1] - 0.34, z = d[2] - 0.72;
    return demo_step(0.16 + grow, 0.13 + grow, sqrt(x * x + y * y + z * z));
}

static double reptile_height(const demo_pattern *p, double u, double v)
{
    double d[3], q[3];
    demo_octahedral(u, v, d);
    double back = back_of_head(d), eye = eye_of_head(d, 0);
    /* Warped, so that rows of scales bend. */
    scaled(d, 3, q);
    double bend = 0.035 * demo_noise3(q, p->seed + 3), warped[3] = {d[0] + bend, d[1] - bend, d[2] + bend};
    scaled(warped, 30, q);
    demo_cell3 scale = demo_cells3_at(q, p->seed);
    double edge = scale.second - scale.nearest;
    double dome = demo_step(0.02, 0.30, edge) * (0.65 + 0.35 * (1 - scale.nearest));
    scaled(warped, 8.5, q);
    demo_cell3 plate = demo_cells3_at(q, p->seed + 1);
    double large = plate.second - plate.nearest;
    double boss = part(plate.id, 3) < 0.55 * back ? demo_step(0.10, 0.7, large) * (1.1 - plate.nearest) : 0;
    scaled(d, 130, q);
    double grain = 0.015 * demo_noise3(q, p->seed + 4);
    double h = 0.16 + (0.17 + 0.10 * back) * dome + 0.5 * boss + grain;
    h += 0.16 * eye_of_head(d, 0.07) * (1 - eye) * dome;
    return demo_mix(h, 0.20, eye);
}

static void reptile_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double d[3], q[3];
    demo_octahedral(u, v, d);
    double back = back_of_head(d);
    scaled(d, 5, q);
    double mottle = demo_fbm3(q, 5, 0.6, p->seed + 5), stripe = sin(13 * d[1] + 5 * mottle + 4 * fabs(d[0]));
    demo_set_color(t->color, 0.52, 0.42, 0.24);
    demo_mix3(t->color, (double[]){0.12, 0.20, 0.07}, demo_clamp(back + 0.5 * mottle, 0, 1));
    demo_mix3(t->color, (double[]){0.28, 0.07, 0.03}, 0.8 * back * demo_step(0.35, 0.75, stripe));
    demo_mix3(t->color, (double[]){0.62, 0.55, 0.34}, demo_step(0.50, 0.80, r->height));
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(0.95 + 5 * r->cavity, 0.25, 1.7);
    t->roughness = demo_clamp(0.48 - 0.5 * r->cavity + 0.15 * mottle, 0.25, 0.85);
    double x = fabs(d[0]) - 0.60, y = d[1] - 0.34, z = d[2] - 0.72, away = sqrt(x * x + y * y + z * z);
    if (away > 0.15) return;
    demo_set_color(t->color, 0.80, 0.46, 0.03);
    demo_mix3(t->color, (double[]){0.10, 0.03, 0.01}, demo_step(0.075, 0.12, away));
    demo_mix3(t->color, (double[]){0.004, 0.004, 0.004},
              demo_step(0.020, 0.014, fabs(x)) * demo_step(0.095, 0.085, fabs(y)));
    t->roughness = 0.06;
}

demo_pattern demo_reptile(uint32_t seed)
{
    return (demo_pattern){.height = reptile_height,
                          .shade = reptile_shade,
                          .columns = 4096,
                          .rows = 4096,
                          .octahedral = true,
                          .seed = seed};
}

/* Signed distance, about, to the seam of two equal pieces of leather, and the place along it. */
static double seam_distance(const double d[3], double *along)
{
    double turn = atan2(d[2], d[0]);
    *along = turn;
    /* The ball's own curve: twice up and down around it. */
    return (d[1] - 0.52 * sin(2 * turn) * (1 - d[1] * d[1])) * 0.75;
}

static double leather_height(const demo_pattern *p, double u, double v)
{
    double d[3], q[3], along;
    demo_latitude_longitude(u, v, d);
    double seam = seam_distance(d, &along), away = fabs(seam);
    scaled(d, 24, q);
    demo_cell3 grain = demo_cells3_at(q, p->seed);
    double pebble = demo_step(0.0, 0.32, grain.second - grain.nearest);
    scaled(d, 7, q);
    double crease = demo_fbm3(q, 4, 0.5, p->seed + 1);
    double fold = 0.10 * demo_step(0.06, 0.0, fabs(crease));
    double h = 0.42 + 0.20 * pebble * (0.7 + 0.3 * part(grain.id, 4)) - fold + 0.06 * crease;
    /* The edges turn down into the seam; a welt; stitches on both sides. */
    h *= 0.35 + 0.65 * demo_step(0.012, 0.05, away);
    h += 0.10 * exp(-pow((away - 0.055) / 0.02, 2));
    double stitch = demo_fract(along * 40 / (2 * DEMO_PI)) - 0.5;
    double across = (away - 0.085) / 0.016, length = stitch / 0.36;
    double thread = demo_dome(sqrt(across * across + length * length * length * length));
    if (thread > 0) h = demo_max(h, 0.42 + 0.40 * thread + 0.03 * sin(45 * stitch + 2 * across));
    return demo_mix(0.5, h, demo_step(0.012, 0.035, demo_min(v, 1 - v)));
}

static void leather_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    double d[3], q[3], along;
    demo_latitude_longitude(u, v, d);
    double seam = seam_distance(d, &along), away = fabs(seam);
    scaled(d, 3, q);
    double wear = demo_fbm3(q, 6, 0.6, p->seed + 3);
    demo_set_color(t->color, 0.34, 0.12, 0.035);
    if (seam > 0) demo_set_color(t->color, 0.26, 0.065, 0.028);
    demo_mix3(t->color, (double[]){0.56, 0.27, 0.10}, demo_clamp(0.25 + 0.9 * wear + 2 * r->cavity, 0, 0.8));
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 4 * r->cavity, 0.2, 1.5);
    t->roughness = demo_clamp(0.44 - 0.9 * r->cavity + 0.2 * wear, 0.22, 0.8);
    double stitch = demo_fract(along * 40 / (2 * DEMO_PI)) - 0.5, across = (away - 0.085) / 0.016,
           length = stitch / 0.36;
    if (across * across + length * length * length * length > 1) return;
    demo_set_color(t->color, 0.72, 0.60, 0.40);
    t->roughness = 0.75;
}

demo_pattern demo_leather(uint32_t seed)
{
    return (demo_pattern){
        .height = leather_height, .shade = leather_shade, .columns = 4096, .rows = 4096, .seed = seed};
}

enum { THREADS = 12 }; /* per tile and axis; even, so that over and under meet */

typedef struct thread_at {
    double height, across, along;
    bool warp;
} thread_at;

/* Whole numbers are the threads' middles: half a turn of the tile maps threads to threads. */
static thread_at cloth_thread(double u, double v)
{
    double x = u * THREADS, y = v * THREADS, cx = floor(x + 0.5), cy = floor(y + 0.5);
    double over = fmod(fabs(cx + cy), 2) < 0.5 ? 1 : -1, ax = (x - cx) / 0.47, ay = (y - cy) / 0.47;
    double lift = 0.20 * over * cos(DEMO_PI * 0.9 * (y - cy)),
           drop = -0.20 * over * cos(DEMO_PI * 0.9 * (x - cx));
    double warp = fabs(ax) < 1 ? 0.34 + lift + 0.30 * demo_dome(ax) : 0;
    double weft = fabs(ay) < 1 ? 0.34 + drop + 0.30 * demo_dome(ay) : 0;
    return warp > weft ? (thread_at){warp, ax, y, true} : (thread_at){weft, ay, x, false};
}

/* Noise that is the same when turned half round. */
static double turned_noise(double u, double v, int32_t period, uint32_t seed)
{
    return 0.5 * (demo_noise2(u, v, period, period, seed) + demo_noise2(-u, -v, period, period, seed));
}

static double cloth_height(const demo_pattern *p, double u, double v)
{
    thread_at at = cloth_thread(u, v);
    if (!(at.height > 0)) return 0.08;
    /* Twisted fibres: slanting grooves on the thread. */
    double twist = 0.035 * cos(2 * DEMO_PI * (2.5 * at.along)) * demo_dome(at.across);
    double fuzz = 0.05 * turned_noise(40 * u, 40 * v, 40, p->seed + 1) +
                  0.03 * turned_noise(110 * u, 110 * v, 110, p->seed + 2);
    return at.height + 0.05 + twist + fuzz;
}

static void cloth_shade(const demo_pattern *p, double u, double v, const demo_relief *r, demo_texel *t)
{
    thread_at at = cloth_thread(u, v);
    double tone = turned_noise(7 * u, 7 * v, 7, p->seed + 3);
    demo_set_color(t->color, 0.060, 0.065, 0.085);
    if (!at.warp) demo_set_color(t->color, 0.038, 0.042, 0.062);
    for (int k = 0; k < 3; k++) t->color[k] *= demo_clamp(1 + 0.5 * tone + 3 * r->cavity, 0.3, 2.0);
    t->roughness = 0.85;
}

demo_pattern demo_cloth(uint32_t seed)
{
    return (demo_pattern){
        .height = cloth_height, .shade = cloth_shade, .columns = 2048, .rows = 2048, .seed = seed};
}
