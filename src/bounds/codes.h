/* bounds/codes.h: a range of heights in 32 bits.
 *
 * The high half is the code of the maximum, the low half the complement of the code of the minimum.
 * The union of two ranges is then the unsigned maximum of each half, and 0 is the empty range.
 * Codes of integer maps are the samples themselves. Code c of a float map stands for
 * range_min + c * code_step; minima round down and maxima up. */
#ifndef KNURL_SRC_BOUNDS_CODES_H
#define KNURL_SRC_BOUNDS_CODES_H

#include <stddef.h>
#include <stdint.h>

static inline uint32_t code_make(uint32_t min, uint32_t max)
{
    return max << 16 | (~min & 0xffffu);
}
static inline uint32_t code_max(uint32_t code)
{
    return code >> 16;
}
static inline uint32_t code_min(uint32_t code)
{
    return ~code & 0xffffu;
}

static inline uint32_t code_union(uint32_t a, uint32_t b)
{
    uint32_t low_a = a & 0xffffu, low_b = b & 0xffffu;
    return ((a > b ? a : b) & 0xffff0000u) | (low_a > low_b ? low_a : low_b);
}

/* to[i] = union of a[i] and b[i]; `to` may be a. Both give the same result; the second needs AVX2. */
void code_union_rows(uint32_t *to, const uint32_t *a, const uint32_t *b, size_t count);
void code_union_rows_avx2(uint32_t *to, const uint32_t *a, const uint32_t *b, size_t count);

#endif
