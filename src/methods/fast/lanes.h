/* methods/fast/lanes.h: four and eight floats at once.
 *
 * GCC's and Clang's vectors, so that + - * / and comparisons work lane by lane on any machine; what they
 * lack is here, as an instruction where the file is compiled for a machine that has it. */
#ifndef KNURL_SRC_METHODS_FAST_LANES_H
#define KNURL_SRC_METHODS_FAST_LANES_H

#include <stdint.h>
#include <string.h>

#ifdef __SSE2__
#include <immintrin.h>
#endif

/* All functions here are inlined, so how vectors are handed over does not matter. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

typedef float vf4 __attribute__((vector_size(16)));
typedef float vf8 __attribute__((vector_size(32)));
typedef int32_t vi4 __attribute__((vector_size(16))); /* lanes of all ones or all zeros */
typedef int32_t vi8 __attribute__((vector_size(32)));

#define LANES_INLINE static inline __attribute__((always_inline))

LANES_INLINE vf4 set4(float x)
{
    return (vf4){x, x, x, x};
}
LANES_INLINE vf8 set8(float x)
{
    return (vf8){x, x, x, x, x, x, x, x};
}
LANES_INLINE vf4 load4(const float *p)
{
    vf4 v;
    memcpy(&v, p, sizeof v);
    return v;
}
LANES_INLINE vf8 load8(const float *p)
{
    vf8 v;
    memcpy(&v, p, sizeof v);
    return v;
}
LANES_INLINE vf4 select4(vi4 mask, vf4 a, vf4 b)
{
    return (vf4)((mask & (vi4)a) | (~mask & (vi4)b));
}
LANES_INLINE vf8 select8(vi8 mask, vf8 a, vf8 b)
{
    return (vf8)((mask & (vi8)a) | (~mask & (vi8)b));
}
LANES_INLINE vf4 abs4(vf4 a)
{
    return (vf4)((vi4)a & (vi4){0x7fffffff, 0x7fffffff, 0x7fffffff, 0x7fffffff});
}
LANES_INLINE vf8 abs8(vf8 a)
{
    const int32_t m = 0x7fffffff;
    return (vf8)((vi8)a & (vi8){m, m, m, m, m, m, m, m});
}

/* b where an argument is NaN. */
LANES_INLINE vf4 min4(vf4 a, vf4 b)
{
#ifdef __SSE2__
    return _mm_min_ps(a, b);
#else
    return select4(a < b, a, b);
#endif
}
LANES_INLINE vf4 max4(vf4 a, vf4 b)
{
#ifdef __SSE2__
    return _mm_max_ps(a, b);
#else
    return select4(a > b, a, b);
#endif
}
LANES_INLINE vf8 min8(vf8 a, vf8 b)
{
#ifdef __AVX2__
    return _mm256_min_ps(a, b);
#else
    return select8(a < b, a, b);
#endif
}
LANES_INLINE vf8 max8(vf8 a, vf8 b)
{
#ifdef __AVX2__
    return _mm256_max_ps(a, b);
#else
    return select8(a > b, a, b);
#endif
}

/* a * b + c, one rounding where the machine does it so. */
LANES_INLINE vf4 mad4(vf4 a, vf4 b, vf4 c)
{
#ifdef __FMA__
    return _mm_fmadd_ps(a, b, c);
#else
    return a * b + c;
#endif
}
LANES_INLINE vf8 mad8(vf8 a, vf8 b, vf8 c)
{
#ifdef __FMA__
    return _mm256_fmadd_ps(a, b, c);
#else
    return a * b + c;
#endif
}

LANES_INLINE vf4 sqrt4(vf4 a)
{
#ifdef __SSE2__
    return _mm_sqrt_ps(a);
#else
    for (int i = 0; i < 4; i++) a[i] = __builtin_sqrtf(a[i]);
    return a;
#endif
}

/* Bit i: lane i is set. */
LANES_INLINE uint32_t mask4(vi4 a)
{
#ifdef __SSE2__
    return (uint32_t)_mm_movemask_ps((vf4)a);
#else
    uint32_t bits = 0;
    for (int i = 0; i < 4; i++) bits |= (uint32_t)(a[i] != 0) << i;
    return bits;
#endif
}
LANES_INLINE uint32_t mask8(vi8 a)
{
#ifdef __AVX2__
    return (uint32_t)_mm256_movemask_ps((vf8)a);
#else
    uint32_t bits = 0;
    for (int i = 0; i < 8; i++) bits |= (uint32_t)(a[i] != 0) << i;
    return bits;
#endif
}

/* Largest and smallest of lanes 0 to 2. */
LANES_INLINE float most3(vf4 a)
{
    float m = a[0] > a[1] ? a[0] : a[1];
    return m > a[2] ? m : a[2];
}
LANES_INLINE float least3(vf4 a)
{
    float m = a[0] < a[1] ? a[0] : a[1];
    return m < a[2] ? m : a[2];
}

/* Rows of a 4 x 4 matrix to columns. */
LANES_INLINE void transpose4(vf4 *a, vf4 *b, vf4 *c, vf4 *d)
{
#ifdef __SSE2__
    _MM_TRANSPOSE4_PS(*a, *b, *c, *d);
#else
    vf4 r[4] = {*a, *b, *c, *d}, *to[4] = {a, b, c, d};
    for (int i = 0; i < 4; i++) *to[i] = (vf4){r[0][i], r[1][i], r[2][i], r[3][i]};
#endif
}

/* Eight 16-bit numbers as floats. */
LANES_INLINE vf8 codes8(const uint16_t *p)
{
#ifdef __AVX2__
    return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(const void *)p)));
#else
    vf8 v;
    for (int i = 0; i < 8; i++) v[i] = (float)p[i];
    return v;
#endif
}

/* The reciprocal, finite: zero counts as a tiny number of its sign. */
LANES_INLINE vf4 safe_inverse4(vf4 a)
{
    vi4 small = abs4(a) < set4(1e-30f);
    vf4 tiny = (vf4)(((vi4)a & (vi4){INT32_MIN, INT32_MIN, INT32_MIN, INT32_MIN}) | (vi4)set4(1e-30f));
    return set4(1.0f) / select4(small, tiny, a);
}

#endif
