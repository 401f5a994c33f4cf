#include "render/albedo.h"

#include "render/ggx.h"

/* Rows are uniform in roughness (sqrt alpha), columns in sqrt(cosine), where E bends most. */
static double row_alpha(int row)
{
    return ggx_alpha((double)row / (ALBEDO_ROUGHNESSES - 1));
}

static double column_cosine(int column)
{
    double s = (double)column / (ALBEDO_COSINES - 1);
    return fmax(s * s, 1e-4);
}

/* Importance sampled by visible normals: the weight of a sample is F G2 / G1. */
static albedo integrate(double cosine, double alpha)
{
    enum { STRATA = 16 };
    vec3 wo = v3(sqrt(fmax(0.0, 1.0 - cosine * cosine)), 0.0, cosine);
    albedo sum = {0.0, 0.0};
    for (int i = 0; i < STRATA; i++)
        for (int j = 0; j < STRATA; j++) {
            vec3 h = ggx_sample_visible(wo, alpha, (i + 0.5) / STRATA, (j + 0.5) / STRATA);
            vec3 wi = ggx_reflect(wo, h);
            if (!(wi.z > 0.0)) continue;
            double weight = ggx_g2(wo, wi, alpha) / ggx_g1(wo, alpha);
            sum.e += weight;
            sum.b += weight * pow(fmax(0.0, 1.0 - v3_dot(wo, h)), 5.0);
        }
    return (albedo){sum.e / (STRATA * STRATA), sum.b / (STRATA * STRATA)};
}

static void build_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    albedo_table *table = user;
    (void)thread;
    for (size_t row = begin; row < end; row++) {
        double e = 0.0, b = 0.0, last = 0.0;
        for (int column = 0; column < ALBEDO_COSINES; column++) {
            albedo a = integrate(column_cosine(column), row_alpha((int)row));
            table->e[row][column] = (float)a.e;
            table->b[row][column] = (float)a.b;
            /* Mean 2 E cos dcos: trapezoids in cos^2. */
            double s = (double)column / (ALBEDO_COSINES - 1), square = s * s * s * s;
            if (column > 0) {
                e += 0.5 * (square - last) *
                     ((double)table->e[row][column] + (double)table->e[row][column - 1]);
                b += 0.5 * (square - last) *
                     ((double)table->b[row][column] + (double)table->b[row][column - 1]);
            }
            last = square;
        }
        table->e_mean[row] = (float)e;
        table->b_mean[row] = (float)b;
    }
}

void albedo_build(knurl_context *context, albedo_table *table)
{
    knurl_parallel_for(context, ALBEDO_ROUGHNESSES, 1, build_rows, table);
}

typedef struct slot {
    int index;
    double fraction;
} slot;

static slot find_slot(double x, int count)
{
    double scaled = warp_clamp(x, 0.0, 1.0) * (count - 1);
    int index = (int)scaled;
    if (index > count - 2) index = count - 2;
    return (slot){index, scaled - index};
}

static double bilinear(const float table[][ALBEDO_COSINES], slot row, slot column)
{
    const float *a = table[row.index] + column.index, *b = table[row.index + 1] + column.index;
    return warp_lerp(warp_lerp((double)a[0], (double)a[1], column.fraction),
                     warp_lerp((double)b[0], (double)b[1], column.fraction), row.fraction);
}

albedo albedo_lookup(const albedo_table *table, double cosine, double alpha)
{
    slot row = find_slot(sqrt(alpha), ALBEDO_ROUGHNESSES);
    slot column = find_slot(sqrt(fmax(cosine, 0.0)), ALBEDO_COSINES);
    return (albedo){bilinear(table->e, row, column), bilinear(table->b, row, column)};
}

albedo albedo_mean(const albedo_table *table, double alpha)
{
    slot row = find_slot(sqrt(alpha), ALBEDO_ROUGHNESSES);
    return (albedo){
        warp_lerp((double)table->e_mean[row.index], (double)table->e_mean[row.index + 1], row.fraction),
        warp_lerp((double)table->b_mean[row.index], (double)table->b_mean[row.index + 1], row.fraction)};
}
