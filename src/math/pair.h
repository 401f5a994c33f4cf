/* math/pair.h: two doubles that are worked on together, in one register where the machine has such. */
#ifndef KNURL_SRC_MATH_PAIR_H
#define KNURL_SRC_MATH_PAIR_H

#ifdef __SSE2__
#include <emmintrin.h>
#endif

/* GCC and Clang: + - * / and comparisons work lane by lane. */
typedef double pair __attribute__((vector_size(16)));
typedef long long pair_bits __attribute__((vector_size(16))); /* lanes of all ones or all zeros */

static inline pair pair_of(double both)
{
    return (pair){both, both};
}

/* min_d and max_d of math/vec.h: b where an argument is NaN. */
static inline pair pair_min(pair a, pair b)
{
#ifdef __SSE2__
    return _mm_min_pd(a, b);
#else
    pair_bits less = a < b;
    return (pair)((less & (pair_bits)a) | (~less & (pair_bits)b));
#endif
}
static inline pair pair_max(pair a, pair b)
{
#ifdef __SSE2__
    return _mm_max_pd(a, b);
#else
    pair_bits more = a > b;
    return (pair)((more & (pair_bits)a) | (~more & (pair_bits)b));
#endif
}
static inline pair pair_abs(pair a)
{
    return (pair)((pair_bits)a & (pair_bits){0x7fffffffffffffff, 0x7fffffffffffffff});
}
/* Bit i: lane i is set. */
static inline unsigned pair_mask(pair_bits lanes)
{
#ifdef __SSE2__
    return (unsigned)_mm_movemask_pd((pair)lanes);
#else
    return (unsigned)(lanes[0] != 0) | (unsigned)(lanes[1] != 0) << 1;
#endif
}

#endif
