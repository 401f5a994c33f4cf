/* bench_statistics.h: what `knurl bench` makes of its measurements. Pure functions. */
#ifndef APP_BENCH_STATISTICS_H
#define APP_BENCH_STATISTICS_H

#include <stddef.h>
#include <stdint.h>

/* NaN of an empty list everywhere below. All sort `values` in place. */
typedef struct spread {
    double lowest, median, highest; /* the median of an even count is the mean of the middle two */
} spread;
spread spread_of(double *values, size_t count);
/* The smallest value that at least `part` of all values do not exceed (nearest rank), part in (0, 1]. */
double percentile_of(double *values, size_t count, double part);

typedef struct step_statistics {
    double mean, p99, highest;
} step_statistics;
/* `scratch` holds `count` numbers. */
step_statistics step_statistics_of(const uint32_t *steps, size_t count, double *scratch);

/* How distances along rays differ from a reference's; NaN is a ray that hits nothing. */
typedef struct disagreement {
    uint64_t missed;    /* the reference hits something, the method nothing */
    uint64_t invented;  /* the other way round */
    double median, p99; /* of |t - reference| / unit where both hit; NaN if nowhere */
} disagreement;
disagreement disagreement_of(const double *t, const double *reference, size_t count, double unit,
                             double *scratch);

#endif
