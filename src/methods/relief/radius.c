/* Safety radii (Baboud and Decoret 2006, sections 3.4 and 3.5).
 *
 * The paper searches, for many sampled directions, the extremal ray of each slice through the map, and leaves
 * out rays that are blocked before they reach the texel. Here a radius is proved for all directions and
 * all starts at once, and no ray is left out, because rays of this library may start anywhere (at the side of
 * a prism, on the surface). The proof: let C be a convex function with C <= H <= C + e over a square. A
 * straight ray's height over C is concave along it. If the ray is above H at two points it is above C there,
 * hence above C between them: it is nowhere more than e under H between them. So with e = 0 a ray that
 * starts above meets H at most once, and with e = `allowance` all that it can pass through unseen is a part
 * of the surface that reaches less than e over it, the silhouette error of the paper's Figures 7 and 12. The
 * property survives every affine change of heights and of texture space, so that one map of radii serves all
 * triangles; for rays from below the same is asked of -H.
 *
 * For e = 0 that is convexity itself, a property of the 2 x 2 cells around each texel: the radius is the
 * distance to the nearest texel where it fails. For e > 0 squares of 64, 32, ... 2 cells are tested too, at
 * every half of their size, and a texel's radius is at least the distance to the border of a safe square
 * around it (half of what testing every square would give). Squares inside a safe one need no test. A square
 * of m x m cells is
 * - safe if the range of its samples is within e;
 * - not safe if a second difference along rows, columns or diagonals is too large;
 * - else safe if a convex C is found that is the largest of a few hundred planes under the samples: the
 *   discrete Legendre transform over a grid of slopes, and the plane that is best at each cell's centre,
 *   whose distance from the bilinear piece is largest at one of the cell's corners.
 * All of them are conservative: a radius may be too small, never too large. Time grows with the number of
 * texels and not with what is in them: one or two microseconds of one core per texel at most, because no
 * radius is over 32; maps of more than a million texels leave out the smallest squares (least_step()). Memory
 * is two bytes per texel, and three more, for a moment, while building. */
#include "methods/relief/relief.h"

#include <float.h>
#include <string.h>

enum {
    SQUARE_LARGEST = 2 * SAFETY_LARGEST, /* cells per side */
    SLOPES = 16,
    LANES = 4
};

/* Sample of the map in its own units: integers stay exact. */
static double raw_sample(const height_level *level, int32_t x, int32_t y)
{
    size_t i = (size_t)y * (size_t)level->width + (size_t)x;
    switch (level->format) {
    case KNURL_PIXEL_U8:
        return (double)((const uint8_t *)level->samples)[i];
    case KNURL_PIXEL_U16:
        return (double)((const uint16_t *)level->samples)[i];
    default:
        return (double)((const float *)level->samples)[i];
    }
}

static double raw_unit(const height_level *level)
{
    return level->format == KNURL_PIXEL_U8 ? 255.0 : level->format == KNURL_PIXEL_U16 ? 65535.0 : 1.0;
}

/* One square of samples, turned upside down for rays from below. */
typedef struct square {
    int cells, slopes; /* per axis */
    double h[SQUARE_LARGEST + 1][SQUARE_LARGEST + 1];
    /* For the planes: */
    float flat[SQUARE_LARGEST + 1][SQUARE_LARGEST + 1]; /* less the mean slope */
    float px[SLOPES], py[SLOPES];
    float conjugate[SLOPES][SLOPES];      /* largest px x + py y - H, [y][x] */
    float column[SLOPES][SQUARE_LARGEST]; /* height of the best plane with py at a column's centres */
    int32_t choice[SLOPES][SQUARE_LARGEST];
} square;

static void load_square(const shell_space *space, int64_t x, int64_t y, int cells, double sign, square *s)
{
    const height_level *level = &space->map->levels[0];
    int32_t columns[SQUARE_LARGEST + 1];
    s->cells = cells;
    s->slopes = 2 * cells < SLOPES ? 2 * cells : SLOPES;
    for (int i = 0; i <= cells; i++) columns[i] = height_wrap(x + i, level->width, space->wrap_u);
    for (int j = 0; j <= cells; j++) {
        int32_t line = height_wrap(y + j, level->height, space->wrap_v);
        for (int i = 0; i <= cells; i++) s->h[j][i] = sign * raw_sample(level, columns[i], line);
    }
}

static bool is_convex(const square *s)
{
    int n = s->cells;
    for (int j = 0; j <= n; j++)
        for (int i = 0; i <= n; i++) {
            double h = s->h[j][i];
            if (i > 0 && i < n && s->h[j][i - 1] + s->h[j][i + 1] < 2.0 * h) return false;
            if (j > 0 && j < n && s->h[j - 1][i] + s->h[j + 1][i] < 2.0 * h) return false;
            if (i < n && j < n && h + s->h[j + 1][i + 1] != s->h[j][i + 1] + s->h[j + 1][i]) return false;
        }
    return true;
}

static double sample_range(const square *s)
{
    double least = INFINITY, most = -INFINITY;
    for (int j = 0; j <= s->cells; j++)
        for (int i = 0; i <= s->cells; i++) {
            least = min_d(least, s->h[j][i]);
            most = max_d(most, s->h[j][i]);
        }
    return most - least;
}

/* Takes the mean slope off, which changes neither convexity nor distances, and stores floats. Coordinates
 * count from the centre. Returns the largest magnitude. */
static double flatten(square *s)
{
    int n = s->cells;
    double sx = 0.0, sy = 0.0, most = 0.0, middle = 0.5 * (double)n, base = s->h[n / 2][n / 2];
    for (int k = 0; k <= n; k++) {
        sx += s->h[k][n] - s->h[k][0];
        sy += s->h[n][k] - s->h[0][k];
    }
    sx /= (double)(n * (n + 1));
    sy /= (double)(n * (n + 1));
    for (int j = 0; j <= n; j++)
        for (int i = 0; i <= n; i++) {
            double h = s->h[j][i] - base - sx * ((double)i - middle) - sy * ((double)j - middle);
            most = max_d(most, fabs(h));
            s->flat[j][i] = (float)h;
        }
    return most;
}

/* Slopes from the steepest step down to the steepest step up, closer together around the mean, where
 * those of a rough but level map are. */
static void make_slopes(float *slopes, int count, double least, double most)
{
    for (int k = 0; k < count; k++) {
        double at = (double)(2 * k - count + 1) / (double)(count - 1);
        slopes[k] = (float)(at < 0.0 ? least * at * at : most * at * at);
    }
}

static void choose_slopes(square *s)
{
    double x0 = 0.0, x1 = 0.0, y0 = 0.0, y1 = 0.0;
    for (int j = 0; j <= s->cells; j++)
        for (int i = 0; i <= s->cells; i++) {
            double h = (double)s->flat[j][i];
            double dx = i < s->cells ? (double)s->flat[j][i + 1] - h : 0.0;
            double dy = j < s->cells ? (double)s->flat[j + 1][i] - h : 0.0;
            x0 = min_d(x0, dx);
            x1 = max_d(x1, dx);
            y0 = min_d(y0, dy);
            y1 = max_d(y1, dy);
        }
    make_slopes(s->px, s->slopes, x0, x1);
    make_slopes(s->py, s->slopes, y0, y1);
}

static float max_f(float a, float b)
{
    return a > b ? a : b;
}

/* out[i] = max(out[i], slope[i] * x - down[i]) and the like, in whole groups of LANES, which compilers
 * make one instruction each of; arrays have room for them. */
static void raise_by_slopes(float *out, const float *slopes, float x, float less, int count)
{
    for (int i = 0; i < count; i += LANES)
        for (int l = i; l < i + LANES; l++) out[l] = max_f(out[l], slopes[l] * x - less);
}

static void raise_by_row(float *out, const float *row, float more, int count)
{
    for (int i = 0; i < count; i += LANES)
        for (int l = i; l < i + LANES; l++) out[l] = max_f(out[l], row[l] + more);
}

static void raise_and_choose(float *best, int32_t *choice, const float *value, float slope, float more,
                             int32_t number, int count)
{
    for (int i = 0; i < count; i += LANES)
        for (int l = i; l < i + LANES; l++) {
            float at = slope * value[l] + more;
            choice[l] = at > best[l] ? number : choice[l];
            best[l] = max_f(best[l], at);
        }
}

static void fill(float *out, int count)
{
    for (int i = 0; i < count; i += LANES)
        for (int l = i; l < i + LANES; l++) out[l] = -FLT_MAX;
}

/* conjugate(p) = max over samples of p . x - H: the plane p . x - conjugate(p) touches H from below. */
static void make_conjugate(square *s)
{
    float middle = 0.5f * (float)s->cells, row[SLOPES];
    for (int q = 0; q < s->slopes; q++) fill(s->conjugate[q], s->slopes);
    for (int j = 0; j <= s->cells; j++) {
        float y = (float)j - middle;
        fill(row, s->slopes);
        for (int i = 0; i <= s->cells; i++)
            raise_by_slopes(row, s->px, (float)i - middle, s->flat[j][i], s->slopes);
        for (int q = 0; q < s->slopes; q++) raise_by_row(s->conjugate[q], row, s->py[q] * y, s->slopes);
    }
}

/* For each slope along y the slope along x whose plane is highest at a column's centre. */
static void choose_columns(square *s)
{
    float centers[SQUARE_LARGEST];
    for (int i = 0; i < (s->cells > LANES ? s->cells : LANES); i++)
        centers[i] = (float)i - 0.5f * (float)s->cells + 0.5f;
    for (int q = 0; q < s->slopes; q++) {
        fill(s->column[q], s->cells);
        for (int p = 0; p < s->slopes; p++)
            raise_and_choose(s->column[q], s->choice[q], centers, s->px[p], -s->conjugate[q][p], p, s->cells);
    }
}

/* Largest distance of the cell's corners over the plane (p, q). */
static float cell_gap(const square *s, int i, int j, int p, int q)
{
    float middle = 0.5f * (float)s->cells, x = (float)i - middle, y = (float)j - middle;
    float plane = s->px[p] * x + s->py[q] * y - s->conjugate[q][p];
    float g00 = s->flat[j][i] - plane, g10 = s->flat[j][i + 1] - plane - s->px[p];
    float g01 = s->flat[j + 1][i] - plane - s->py[q],
          g11 = s->flat[j + 1][i + 1] - plane - s->px[p] - s->py[q];
    return max_f(max_f(g00, g10), max_f(g01, g11));
}

static bool planes_within(square *s, double allowance)
{
    double size = flatten(s);
    choose_slopes(s);
    int last = s->slopes - 1;
    double steepest = (double)max_f(max_f(s->px[last], -s->px[0]), max_f(s->py[last], -s->py[0]));
    /* Every sum above is of at most four terms of these magnitudes. */
    double rounding = 16.0 * (double)FLT_EPSILON * (size + steepest * (double)s->cells);
    if (!(allowance > rounding) || !(size + steepest * (double)s->cells < 1e37)) return false;
    make_conjugate(s);
    choose_columns(s);
    float middle = 0.5f * (float)s->cells - 0.5f, limit = (float)(allowance - rounding);
    for (int j = 0; j < s->cells; j++) {
        float best[SQUARE_LARGEST], y = (float)j - middle;
        int32_t choice[SQUARE_LARGEST] = {0};
        fill(best, s->cells);
        for (int q = 0; q < s->slopes; q++)
            raise_and_choose(best, choice, s->column[q], 1.0f, s->py[q] * y, q, s->cells);
        for (int i = 0; i < s->cells; i++)
            if (!(cell_gap(s, i, j, s->choice[choice[i]][i], choice[i]) <= limit)) return false;
    }
    return true;
}

/* Whether H at (i, j) is so far over the middle between two samples that no convex C comes near enough. */
static bool stands_out(const square *s, int i, int j, int di, int dj, double allowance)
{
    return 2.0 * s->h[j][i] - s->h[j - dj][i - di] - s->h[j + dj][i + di] > 2.0 * allowance;
}

/* Looks at a few dozen samples, with neighbours at a half and a quarter of the square. */
static bool cannot_be_safe(const square *s, double allowance)
{
    int n = s->cells, every = n > 8 ? n / 8 : 1;
    for (int d = n / 2; d > 0 && 4 * d >= n; d /= 2)
        for (int j = 0; j <= n; j += every)
            for (int i = 0; i <= n; i += every) {
                bool x = i >= d && i + d <= n, y = j >= d && j + d <= n;
                if (x && stands_out(s, i, j, d, 0, allowance)) return true;
                if (y && stands_out(s, i, j, 0, d, allowance)) return true;
                if (x && y && (stands_out(s, i, j, d, d, allowance) || stands_out(s, i, j, -d, d, allowance)))
                    return true;
            }
    return false;
}

static bool is_safe(square *s, double allowance)
{
    if (sample_range(s) <= allowance) return true;
    return !cannot_be_safe(s, allowance) && planes_within(s, allowance);
}

/* All squares of one size: number (a, b) covers texels a * step to (a + 2) * step, and so in y. They start at
 * -1, so that every texel is inside some. */
typedef struct square_grid {
    int32_t step, columns, rows;
    uint8_t *bits; /* 1: safe, or convex, for rays above; 2: for rays below */
} square_grid;

typedef struct radius_job {
    const shell_space *space;
    double allowance; /* in the samples' units */
    safety_radii *radii;
    square_grid grid, coarser; /* coarser.bits is NULL at the first size */
    uint8_t *distances[2];     /* width * height each, for both sides; see local_radii() */
} radius_job;

static uint8_t grid_at(const square_grid *g, int32_t a, int32_t b)
{
    return g->bits[(size_t)(b + 1) * (size_t)g->columns + (size_t)(a + 1)];
}

/* Bits of the squares of twice the size that contain square (a, b): one along an axis where its number is
 * odd, two where it is even. Outside of their grid nothing is known. */
static int inherited(const square_grid *coarser, int32_t a, int32_t b)
{
    int bits = 0;
    if (!coarser->bits) return bits;
    for (int32_t y = (b + 1) / 2 - 1; 2 * y <= b; y++)
        for (int32_t x = (a + 1) / 2 - 1; 2 * x <= a; x++)
            if (x >= -1 && y >= -1 && x + 1 < coarser->columns && y + 1 < coarser->rows)
                bits |= grid_at(coarser, x, y);
    return bits;
}

static void test_squares(void *user, size_t begin, size_t end, int32_t thread)
{
    const radius_job *job = user;
    const square_grid *g = &job->grid;
    square s;
    (void)thread;
    for (size_t k = begin; k < end; k++) {
        int32_t a = (int32_t)(k % (size_t)g->columns) - 1, b = (int32_t)(k / (size_t)g->columns) - 1;
        int bits = inherited(&job->coarser, a, b);
        for (int side = 0; side < 2; side++) {
            if (bits & 1 << side) continue;
            load_square(job->space, (int64_t)a * g->step, (int64_t)b * g->step, 2 * g->step,
                        side == 0 ? 1.0 : -1.0, &s);
            if (is_safe(&s, job->allowance)) bits |= 1 << side;
        }
        g->bits[k] = (uint8_t)bits;
    }
}

/* Convexity of the 2 x 2 cells around every texel, in the grid of that size. */
static void test_convexity(void *user, size_t begin, size_t end, int32_t thread)
{
    const radius_job *job = user;
    const square_grid *g = &job->grid;
    square s;
    (void)thread;
    for (size_t k = begin; k < end; k++) {
        int64_t a = (int64_t)(k % (size_t)g->columns) - 1, b = (int64_t)(k / (size_t)g->columns) - 1;
        load_square(job->space, a, b, 2, 1.0, &s);
        int bits = is_convex(&s) ? 1 : 0;
        load_square(job->space, a, b, 2, -1.0, &s);
        g->bits[k] = (uint8_t)(bits | (is_convex(&s) ? 2 : 0));
    }
}

/* Distance of texel i to the border of square a along one axis. */
static int32_t inside(const square_grid *g, int32_t i, int32_t a)
{
    int32_t before = i - a * g->step, after = (a + 2) * g->step - i;
    return before < after ? before : after;
}

static void spread_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    const radius_job *job = user;
    const square_grid *g = &job->grid;
    (void)thread;
    for (size_t k = begin; k < end; k++) {
        int32_t j = (int32_t)k;
        for (int32_t i = 0; i < job->radii->width; i++) {
            size_t at = k * (size_t)job->radii->width + (size_t)i;
            for (int32_t corner = 0; corner < 4; corner++) {
                int32_t a = i / g->step - (corner & 1), b = j / g->step - (corner >> 1);
                int32_t x = inside(g, i, a), y = inside(g, j, b), n = x < y ? x : y;
                uint8_t bits = grid_at(g, a, b);
                if (bits & 1 && n > job->radii->above[at]) job->radii->above[at] = (uint8_t)n;
                if (bits & 2 && n > job->radii->below[at]) job->radii->below[at] = (uint8_t)n;
            }
        }
    }
}

/* Texels between texel i of a row and the nearest one whose square of 2 x 2 cells is not convex, in both
 * directions, for both sides. The wrapped signal is swept from 32 texels before the row to 32 after it. */
static void row_distances(const radius_job *job, int32_t j, uint8_t *row, int side)
{
    const square_grid *g = &job->grid;
    int32_t width = job->radii->width;
    int forward = SAFETY_LARGEST, backward = SAFETY_LARGEST;
    for (int32_t k = -SAFETY_LARGEST; k < width; k++) {
        int32_t i = height_wrap(k, width, job->space->wrap_u);
        bool convex = grid_at(g, i - 1, j - 1) & 1 << side;
        forward = !convex ? 0 : forward < SAFETY_LARGEST ? forward + 1 : forward;
        if (k >= 0) row[k] = (uint8_t)forward;
    }
    for (int32_t k = width - 1 + SAFETY_LARGEST; k >= 0; k--) {
        int32_t i = height_wrap(k, width, job->space->wrap_u);
        bool convex = grid_at(g, i - 1, j - 1) & 1 << side;
        backward = !convex ? 0 : backward < SAFETY_LARGEST ? backward + 1 : backward;
        if (k < width && backward < row[k]) row[k] = (uint8_t)backward;
    }
}

static void fill_distances(void *user, size_t begin, size_t end, int32_t thread)
{
    const radius_job *job = user;
    size_t width = (size_t)job->radii->width;
    (void)thread;
    for (size_t j = begin; j < end; j++)
        for (int side = 0; side < 2; side++)
            row_distances(job, (int32_t)j, job->distances[side] + j * width, side);
}

/* The distance in both axes: a square is convex if all the squares of 2 x 2 cells in it are. */
static void local_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    const radius_job *job = user;
    const safety_radii *radii = job->radii;
    size_t width = (size_t)radii->width;
    (void)thread;
    for (size_t j = begin; j < end; j++)
        for (int side = 0; side < 2; side++) {
            const uint8_t *distances = job->distances[side];
            uint8_t *out = (side ? radii->below : radii->above) + j * width;
            memcpy(out, distances + j * width, width);
            for (int32_t k = 1; k < SAFETY_LARGEST; k++) {
                size_t up = (size_t)height_wrap((int64_t)j - k, radii->height, job->space->wrap_v);
                size_t down = (size_t)height_wrap((int64_t)j + k, radii->height, job->space->wrap_v);
                for (size_t i = 0; i < width; i++) {
                    uint8_t a = distances[up * width + i], b = distances[down * width + i];
                    uint8_t n = a < b ? a : b, least = n > k ? n : (uint8_t)k;
                    out[i] = out[i] < least ? out[i] : least;
                }
            }
        }
}

static knurl_status grid_make(radius_job *job, int32_t step, knurl_error *error)
{
    square_grid *g = &job->grid;
    g->step = step;
    g->columns = (job->radii->width + step - 1) / step + 1;
    g->rows = (job->radii->height + step - 1) / step + 1;
    size_t count = (size_t)g->columns * (size_t)g->rows;
    g->bits = knurl_alloc(job->space->context, count);
    return g->bits ? KNURL_OK : knurl_fail_memory(error, count, "safety radii");
}

/* Radii by convexity alone. */
static knurl_status local_radii(radius_job *job, knurl_error *error)
{
    knurl_context *context = job->space->context;
    size_t rows = (size_t)job->radii->height, count = (size_t)job->radii->width * rows;
    knurl_status status = grid_make(job, 1, error);
    if (status != KNURL_OK) return status;
    uint8_t *both = knurl_alloc_array(context, count, 2);
    if (both) {
        job->distances[0] = both;
        job->distances[1] = both + count;
        knurl_parallel_for(context, (size_t)job->grid.columns * (size_t)job->grid.rows, 1024, test_convexity,
                           job);
        knurl_parallel_for(context, rows, 16, fill_distances, job);
        knurl_parallel_for(context, rows, 16, local_rows, job);
    } else {
        status = knurl_fail_memory(error, 2 * count, "safety radii");
    }
    knurl_free(context, both);
    knurl_free(context, job->grid.bits);
    return status;
}

/* Smallest squares' step: more than a million texels are tested more coarsely, so that the work stays
 * bounded. Between them only convexity gives radii. */
static int32_t least_step(const safety_radii *radii)
{
    double texels = (double)radii->width * (double)radii->height;
    return texels <= 0x1p20 ? 1 : texels <= 0x1p22 ? 2 : texels <= 0x1p24 ? 4 : 8;
}

/* Radii by squares, from large to small. */
static knurl_status square_radii(radius_job *job, knurl_error *error)
{
    knurl_context *context = job->space->context;
    knurl_status status = KNURL_OK;
    for (int32_t step = SAFETY_LARGEST; step >= least_step(job->radii) && status == KNURL_OK; step /= 2) {
        status = grid_make(job, step, error);
        if (status != KNURL_OK) break;
        knurl_parallel_for(context, (size_t)job->grid.columns * (size_t)job->grid.rows, 64, test_squares,
                           job);
        knurl_parallel_for(context, (size_t)job->radii->height, 16, spread_rows, job);
        knurl_free(context, job->coarser.bits);
        job->coarser = job->grid;
    }
    knurl_free(context, job->coarser.bits);
    return status;
}

knurl_status safety_radii_make(const shell_space *space, double allowance, safety_radii *radii,
                               knurl_error *error)
{
    const height_level *level = &space->map->levels[0];
    size_t count = (size_t)level->width * (size_t)level->height;
    *radii = (safety_radii){.width = level->width, .height = level->height};
    radii->above = knurl_alloc_zero(space->context, count);
    radii->below = knurl_alloc_zero(space->context, count);
    if (!radii->above || !radii->below) {
        safety_radii_free(space->context, radii);
        return knurl_fail_memory(error, 2 * count, "safety radii");
    }
    radius_job job = {.space = space, .radii = radii};
    job.allowance = allowance * (space->map->range_max - space->map->range_min) * raw_unit(level);
    knurl_status status = local_radii(&job, error);
    if (status == KNURL_OK && job.allowance > 0.0) status = square_radii(&job, error);
    if (status != KNURL_OK) safety_radii_free(space->context, radii);
    return status;
}

void safety_radii_free(knurl_context *context, safety_radii *radii)
{
    knurl_free(context, radii->above);
    knurl_free(context, radii->below);
    radii->above = radii->below = NULL;
}
