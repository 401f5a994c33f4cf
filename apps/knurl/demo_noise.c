/* Hash-based noise for the sample scenes' maps. */
#include "demo_noise.h"

/* Xor-shift and multiply rounds, after Wellons' lowbias32. */
static inline uint32_t finish(uint32_t h)
{
    h = (h ^ (h >> 16)) * 0x7feb352du;
    h = (h ^ (h >> 15)) * 0x846ca68bu;
    return h ^ (h >> 16);
}

/* One odd factor per axis: lattice corners share their products. */
static const uint32_t axis_factor[3] = {0x9e3779b1u, 0x85ebca77u, 0xc2b2ae3du};

uint32_t demo_hash(int32_t x, int32_t y, int32_t z, uint32_t seed)
{
    uint32_t sum = (uint32_t)x * axis_factor[0] + (uint32_t)y * axis_factor[1] + (uint32_t)z * axis_factor[2];
    return finish(finish(sum) + seed * 0x27d4eb2fu);
}

double demo_random(int32_t x, int32_t y, int32_t z, uint32_t seed)
{
    return (double)demo_hash(x, y, z, seed) / 4294967296.0;
}

static int32_t wrap(int32_t i, int32_t period)
{
    int32_t r = i % period;
    return r < 0 ? r + period : r;
}

/* As floor(), which is a call on processors without SSE 4.1. |x| < 2^31. */
static inline int32_t lower(double x)
{
    int32_t i = (int32_t)x;
    return i - (x < i);
}

static double fade(double t)
{
    return t * t * t * (t * (t * 6 - 15) + 10);
}

static double corner2(uint32_t hash, double x, double y)
{
    static const double directions[16][2] = {
        {1, 0},  {0.9239, 0.3827},   {0.7071, 0.7071},   {0.3827, 0.9239},
        {0, 1},  {-0.3827, 0.9239},  {-0.7071, 0.7071},  {-0.9239, 0.3827},
        {-1, 0}, {-0.9239, -0.3827}, {-0.7071, -0.7071}, {-0.3827, -0.9239},
        {0, -1}, {0.3827, -0.9239},  {0.7071, -0.7071},  {0.9239, -0.3827},
    };
    const double *d = directions[hash & 15];
    return d[0] * x + d[1] * y;
}

double demo_noise2(double x, double y, int32_t px, int32_t py, uint32_t seed)
{
    int32_t fx = lower(x), fy = lower(y), x0 = wrap(fx, px), y0 = wrap(fy, py);
    int32_t x1 = x0 + 1 == px ? 0 : x0 + 1, y1 = y0 + 1 == py ? 0 : y0 + 1;
    double dx = x - fx, dy = y - fy, wx = fade(dx), wy = fade(dy);
    uint32_t hx0 = (uint32_t)x0 * axis_factor[0] + seed * 0x27d4eb2fu,
             hx1 = (uint32_t)x1 * axis_factor[0] + seed * 0x27d4eb2fu;
    uint32_t hy0 = (uint32_t)y0 * axis_factor[1], hy1 = (uint32_t)y1 * axis_factor[1];
    double top = demo_mix(corner2(finish(hx0 + hy0), dx, dy), corner2(finish(hx1 + hy0), dx - 1, dy), wx);
    double bottom =
        demo_mix(corner2(finish(hx0 + hy1), dx, dy - 1), corner2(finish(hx1 + hy1), dx - 1, dy - 1), wx);
    return 1.4142 * demo_mix(top, bottom, wy);
}

/* The twelve edge directions of a cube, as in Perlin's improved noise, four of them twice. */
static double corner3(uint32_t hash, double x, double y, double z)
{
    static const double directions[16][3] = {
        {1, 1, 0}, {-1, 1, 0}, {1, -1, 0}, {-1, -1, 0}, {1, 0, 1}, {-1, 0, 1}, {1, 0, -1}, {-1, 0, -1},
        {0, 1, 1}, {0, -1, 1}, {0, 1, -1}, {0, -1, -1}, {1, 1, 0}, {-1, 1, 0}, {0, -1, 1}, {0, -1, -1},
    };
    const double *d = directions[hash & 15];
    return d[0] * x + d[1] * y + d[2] * z;
}

double demo_noise3(const double p[3], uint32_t seed)
{
    double d[3], w[3], layer[2];
    uint32_t h[3][2];
    for (int k = 0; k < 3; k++) {
        int32_t low = lower(p[k]);
        h[k][0] = (uint32_t)low * axis_factor[k];
        h[k][1] = h[k][0] + axis_factor[k];
        d[k] = p[k] - low;
        w[k] = fade(d[k]);
    }
    for (int k = 0; k < 2; k++) {
        uint32_t h00 = h[2][k] + h[1][0] + seed * 0x27d4eb2fu, h01 = h[2][k] + h[1][1] + seed * 0x27d4eb2fu;
        double dz = d[2] - k;
        double top = demo_mix(corner3(finish(h00 + h[0][0]), d[0], d[1], dz),
                              corner3(finish(h00 + h[0][1]), d[0] - 1, d[1], dz), w[0]);
        double bottom = demo_mix(corner3(finish(h01 + h[0][0]), d[0], d[1] - 1, dz),
                                 corner3(finish(h01 + h[0][1]), d[0] - 1, d[1] - 1, dz), w[0]);
        layer[k] = demo_mix(top, bottom, w[1]);
    }
    return demo_mix(layer[0], layer[1], w[2]);
}

double demo_fbm2(double x, double y, int32_t px, int32_t py, int octaves, double gain, uint32_t seed)
{
    double sum = 0, amplitude = 1, total = 0;
    for (int i = 0; i < octaves; i++) {
        sum += amplitude * demo_noise2(x, y, px, py, seed + (uint32_t)i);
        total += amplitude;
        amplitude *= gain;
        x *= 2;
        y *= 2;
        px *= 2;
        py *= 2;
    }
    return sum / total;
}

double demo_fbm3(const double p[3], int octaves, double gain, uint32_t seed)
{
    double q[3] = {p[0], p[1], p[2]}, sum = 0, amplitude = 1, total = 0;
    for (int i = 0; i < octaves; i++) {
        sum += amplitude * demo_noise3(q, seed + (uint32_t)i);
        total += amplitude;
        amplitude *= gain;
        /* The shift keeps lattice points of different octaves, where the noise is 0, apart. */
        for (int k = 0; k < 3; k++) q[k] = 2 * q[k] + 0.37 * (k + 1);
    }
    return sum / total;
}

/* One octave of a ridged multifractal: each is weighted by the one before. */
static void add_ridge(double noise, double *sum, double *weight, double *amplitude)
{
    double ridge = 1 - fabs(noise);
    ridge *= ridge * *weight;
    *weight = demo_clamp(2 * ridge, 0, 1);
    *sum += ridge * *amplitude;
    *amplitude *= 0.5;
}

double demo_ridged2(double x, double y, int32_t px, int32_t py, int octaves, uint32_t seed)
{
    double sum = 0, weight = 1, amplitude = 0.55;
    for (int i = 0; i < octaves; i++) {
        add_ridge(demo_noise2(x, y, px, py, seed + (uint32_t)i), &sum, &weight, &amplitude);
        x *= 2;
        y *= 2;
        px *= 2;
        py *= 2;
    }
    return sum;
}

double demo_ridged3(const double p[3], int octaves, uint32_t seed)
{
    double q[3] = {p[0], p[1], p[2]}, sum = 0, weight = 1, amplitude = 0.55;
    for (int i = 0; i < octaves; i++) {
        add_ridge(demo_noise3(q, seed + (uint32_t)i), &sum, &weight, &amplitude);
        for (int k = 0; k < 3; k++) q[k] = 2 * q[k] + 0.37 * (k + 1);
    }
    return sum;
}

enum { REACH = 1, AROUND = (2 * REACH + 1) * (2 * REACH + 1) };

demo_cell demo_cells_at(const demo_cells *cells, double u, double v)
{
    double gx = u * cells->columns, gy = v * cells->rows, points[AROUND][2];
    uint32_t ids[AROUND];
    int32_t row0 = (int32_t)floor(gy);
    int nearest = 0;
    double best = INFINITY;
    for (int k = 0; k < AROUND; k++) {
        int32_t row = row0 + k / (2 * REACH + 1) - REACH;
        double shift = (row & 1) ? cells->shift : 0;
        int32_t column = (int32_t)floor(gx - shift) + k % (2 * REACH + 1) - REACH;
        int32_t cx = wrap(column, cells->columns), cy = wrap(row, cells->rows);
        ids[k] = demo_hash(cx, cy, 7, cells->seed);
        double jx = demo_random(cx, cy, 1, cells->seed) * 2 - 1,
               jy = demo_random(cx, cy, 2, cells->seed) * 2 - 1;
        points[k][0] = column + 0.5 + shift + cells->jitter * jx - gx;
        points[k][1] = (row + 0.5 + cells->jitter * jy - gy) * cells->stretch;
        double squared = points[k][0] * points[k][0] + points[k][1] * points[k][1];
        if (squared < best) {
            best = squared;
            nearest = k;
        }
    }
    /* Distance to every bisector; a soft minimum of them rounds the corners. */
    double px = points[nearest][0], py = points[nearest][1], sum = 0;
    for (int k = 0; k < AROUND; k++) {
        double ex = points[k][0] - px, ey = points[k][1] - py, length = sqrt(ex * ex + ey * ey);
        if (k == nearest || length < 1e-9) continue;
        double distance = (0.5 * (points[k][0] + px) * ex + 0.5 * (points[k][1] + py) * ey) / length;
        if (distance < 14 * cells->corner) sum += exp(-distance / cells->corner);
    }
    double border = sum > 0 ? -cells->corner * log(sum) : 14 * cells->corner;
    return (demo_cell){.border = border, .x = -px, .y = -py, .id = ids[nearest]};
}

demo_cell3 demo_cells3_at(const double p[3], uint32_t seed)
{
    int32_t base[3];
    double best = INFINITY, second = INFINITY;
    uint32_t id = 0;
    for (int k = 0; k < 3; k++) base[k] = lower(p[k]);
    for (int n = 0; n < 27; n++) {
        int32_t cell[3] = {base[0] + n % 3 - 1, base[1] + n / 3 % 3 - 1, base[2] + n / 9 - 1};
        uint32_t sum = seed * 0x27d4eb2fu;
        for (int k = 0; k < 3; k++) sum += (uint32_t)cell[k] * axis_factor[k];
        /* Ten bits for each axis. */
        uint32_t hash = finish(sum);
        double squared = 0;
        for (int k = 0; k < 3; k++) {
            double d = cell[k] + ((hash >> (10 * k)) & 1023) / 1023.0 - p[k];
            squared += d * d;
        }
        if (squared < best) {
            second = best;
            best = squared;
            id = hash;
        } else if (squared < second) {
            second = squared;
        }
    }
    return (demo_cell3){sqrt(best), sqrt(second), id};
}
