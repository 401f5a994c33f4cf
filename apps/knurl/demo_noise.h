/* demo_noise.h: hash-based noise. Everything depends on its arguments only, never on call order. */
#ifndef KNURL_APPS_DEMO_NOISE_H
#define KNURL_APPS_DEMO_NOISE_H

#include <math.h>
#include <stdint.h>

#define DEMO_PI 3.14159265358979323846

/* The C library's fmax and fmin are calls, for the sake of NaN. */
static inline double demo_max(double a, double b)
{
    return a > b ? a : b;
}

static inline double demo_min(double a, double b)
{
    return a < b ? a : b;
}

static inline double demo_clamp(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

static inline double demo_mix(double a, double b, double t)
{
    return a + (b - a) * t;
}

/* 0 below `low`, 1 above `high`, a cubic between; low > high gives the falling step. */
static inline double demo_step(double low, double high, double x)
{
    double t = demo_clamp((x - low) / (high - low), 0, 1);
    return t * t * (3 - 2 * t);
}

static inline double demo_fract(double x)
{
    return x - floor(x);
}

/* Distance to the nearest whole number, 0 to 0.5. */
static inline double demo_whole_distance(double x)
{
    return fabs(x - floor(x + 0.5));
}

/* Half a circle of radius 1 over x in [-1, 1], 0 outside. */
static inline double demo_dome(double x)
{
    return fabs(x) >= 1 ? 0 : sqrt(1 - x * x);
}

static inline void demo_mix3(double a[3], const double b[3], double t)
{
    for (int i = 0; i < 3; i++) a[i] = demo_mix(a[i], b[i], t);
}

static inline void demo_set_color(double color[3], double r, double g, double b)
{
    color[0] = r;
    color[1] = g;
    color[2] = b;
}

uint32_t demo_hash(int32_t x, int32_t y, int32_t z, uint32_t seed);
/* Uniform in [0, 1). */
double demo_random(int32_t x, int32_t y, int32_t z, uint32_t seed);

/* Gradient noise, about [-1, 1], repeating after the whole numbers px and py. */
double demo_noise2(double x, double y, int32_t px, int32_t py, uint32_t seed);
double demo_noise3(const double p[3], uint32_t seed);

/* Sum of octaves, each twice as fine (and as often repeated) and `gain` times as strong as the one
 * before; about [-1, 1]. */
double demo_fbm2(double x, double y, int32_t px, int32_t py, int octaves, double gain, uint32_t seed);
double demo_fbm3(const double p[3], int octaves, double gain, uint32_t seed);
/* Ridged multifractal (Musgrave): sharp crests, rough where high, smooth where low; about [0, 1]. */
double demo_ridged2(double x, double y, int32_t px, int32_t py, int octaves, uint32_t seed);
double demo_ridged3(const double p[3], int octaves, uint32_t seed);

/* Cells of a jittered grid. Odd rows are shifted by `shift` cells. */
typedef struct demo_cells {
    int32_t columns, rows; /* per period; rows even if shift is not 0 */
    double jitter;         /* 0 to 0.45, in cells */
    double shift;          /* 0 or 0.5 */
    double stretch;        /* height of a cell over its width: distances are in cell widths */
    double corner;         /* radius that rounds the cells' corners, in cell widths */
    uint32_t seed;
} demo_cells;

typedef struct demo_cell {
    double border; /* distance to the rounded border, in cell widths; 0 on it */
    double x, y;   /* position from the cell's point, in cell widths */
    uint32_t id;   /* hash of the cell */
} demo_cell;

/* The cell at (u, v), which has period 1. */
demo_cell demo_cells_at(const demo_cells *cells, double u, double v);

typedef struct demo_cell3 {
    double nearest, second; /* distances to the two nearest points, in cells */
    uint32_t id;            /* hash of the nearest one's cell */
} demo_cell3;

/* Worley's cells in space: one point in each unit cube. */
demo_cell3 demo_cells3_at(const double p[3], uint32_t seed);

#endif
