/* bench_statistics.c: medians, percentiles, disagreement. */
#include "bench_statistics.h"

#include <math.h>
#include <stdlib.h>

static int compare_numbers(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

spread spread_of(double *values, size_t count)
{
    if (count == 0) return (spread){NAN, NAN, NAN};
    qsort(values, count, sizeof *values, compare_numbers);
    return (spread){values[0], 0.5 * (values[(count - 1) / 2] + values[count / 2]), values[count - 1]};
}

static double ranked(const double *sorted, size_t count, double part)
{
    /* The slack keeps 0.99 * 100, which is not quite 99, at rank 99. */
    size_t rank = (size_t)ceil(part * (double)count * (1 - 1e-12));
    if (rank < 1) rank = 1;
    return sorted[(rank < count ? rank : count) - 1];
}

double percentile_of(double *values, size_t count, double part)
{
    if (count == 0) return NAN;
    qsort(values, count, sizeof *values, compare_numbers);
    return ranked(values, count, part);
}

step_statistics step_statistics_of(const uint32_t *steps, size_t count, double *scratch)
{
    if (count == 0) return (step_statistics){NAN, NAN, NAN};
    double sum = 0;
    for (size_t i = 0; i < count; i++) {
        scratch[i] = (double)steps[i];
        sum += scratch[i];
    }
    double p99 = percentile_of(scratch, count, 0.99);
    return (step_statistics){sum / (double)count, p99, scratch[count - 1]};
}

disagreement disagreement_of(const double *t, const double *reference, size_t count, double unit,
                             double *scratch)
{
    disagreement found = {0};
    size_t both = 0;
    for (size_t i = 0; i < count; i++) {
        if (isnan(t[i]) && !isnan(reference[i])) found.missed++;
        if (!isnan(t[i]) && isnan(reference[i])) found.invented++;
        if (!isnan(t[i]) && !isnan(reference[i])) scratch[both++] = fabs(t[i] - reference[i]) / unit;
    }
    found.median = spread_of(scratch, both).median;
    found.p99 = both ? ranked(scratch, both, 0.99) : NAN;
    return found;
}
