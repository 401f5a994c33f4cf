/* Minimum and maximum of every sample, at the speed of memory. See columns.h. */
#include "bounds/columns.h"

#include "bounds/codes.h"

/* Plain C */

static void fold_u8(const uint8_t *const *rows, int32_t row_count, int32_t begin, int32_t end, uint16_t *min,
                    uint16_t *not_max)
{
    for (int32_t x = begin; x < end; x++) {
        uint8_t low = rows[0][x], high = low;
        for (int32_t r = 1; r < row_count; r++) {
            uint8_t value = rows[r][x];
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
        min[x] = low;
        not_max[x] = (uint16_t) ~(uint32_t)high;
    }
}

static void fold_u16(const uint16_t *const *rows, int32_t row_count, int32_t begin, int32_t end,
                     uint16_t *min, uint16_t *not_max)
{
    for (int32_t x = begin; x < end; x++) {
        uint16_t low = rows[0][x], high = low;
        for (int32_t r = 1; r < row_count; r++) {
            uint16_t value = rows[r][x];
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
        min[x] = low;
        not_max[x] = (uint16_t) ~(uint32_t)high;
    }
}

static void fold_f32(const float *const *rows, int32_t row_count, int32_t begin, int32_t end, float *min,
                     float *max)
{
    for (int32_t x = begin; x < end; x++) {
        float low = rows[0][x], high = low;
        for (int32_t r = 1; r < row_count; r++) {
            float value = rows[r][x];
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
        min[x] = low;
        max[x] = high;
    }
}

static void spans(const uint16_t *min, const uint16_t *not_max, int32_t width, int32_t shift, int32_t begin,
                  uint32_t *codes)
{
    int32_t size = 1 << shift;
    for (int32_t x = begin; x < width; x += size) {
        int32_t last = x + size < width ? x + size : width;
        uint16_t low = min[x], not_high = not_max[x];
        for (int32_t i = x + 1; i <= last; i++) {
            low = min[i] < low ? min[i] : low;
            not_high = not_max[i] < not_high ? not_max[i] : not_high;
        }
        codes[x >> shift] = code_make(low, ~(uint32_t)not_high & 0xffffu);
    }
}

static void plain_u8(const uint8_t *const *rows, int32_t row_count, int32_t width, uint16_t *min,
                     uint16_t *not_max)
{
    fold_u8(rows, row_count, 0, width, min, not_max);
}

static void plain_u16(const uint16_t *const *rows, int32_t row_count, int32_t width, uint16_t *min,
                      uint16_t *not_max)
{
    fold_u16(rows, row_count, 0, width, min, not_max);
}

static void plain_f32(const float *const *rows, int32_t row_count, int32_t width, float *min, float *max)
{
    fold_f32(rows, row_count, 0, width, min, max);
}

static void plain_spans(const uint16_t *min, const uint16_t *not_max, int32_t width, int32_t shift,
                        uint32_t *codes)
{
    spans(min, not_max, width, shift, 0, codes);
}

void code_union_rows(uint32_t *to, const uint32_t *a, const uint32_t *b, size_t count)
{
    for (size_t i = 0; i < count; i++) to[i] = code_union(a[i], b[i]);
}

const columns_kernels columns_plain = {plain_u8, plain_u16, plain_f32, plain_spans};

#if defined(__x86_64__)
#include <immintrin.h>

#define AVX2 __attribute__((target("avx2")))

AVX2 static void avx2_u8(const uint8_t *const *rows, int32_t row_count, int32_t width, uint16_t *min,
                         uint16_t *not_max)
{
    const __m256i ones = _mm256_set1_epi16(-1);
    int32_t x = 0;
    for (; x + 32 <= width; x += 32) {
        __m256i low = _mm256_loadu_si256((const void *)(rows[0] + x)), high = low;
        for (int32_t r = 1; r < row_count; r++) {
            __m256i value = _mm256_loadu_si256((const void *)(rows[r] + x));
            low = _mm256_min_epu8(low, value);
            high = _mm256_max_epu8(high, value);
        }
        for (int32_t half = 0; half < 2; half++) {
            __m128i l = half ? _mm256_extracti128_si256(low, 1) : _mm256_castsi256_si128(low);
            __m128i h = half ? _mm256_extracti128_si256(high, 1) : _mm256_castsi256_si128(high);
            _mm256_storeu_si256((void *)(min + x + 16 * half), _mm256_cvtepu8_epi16(l));
            _mm256_storeu_si256((void *)(not_max + x + 16 * half),
                                _mm256_xor_si256(_mm256_cvtepu8_epi16(h), ones));
        }
    }
    fold_u8(rows, row_count, x, width, min, not_max);
}

AVX2 static void avx2_u16(const uint16_t *const *rows, int32_t row_count, int32_t width, uint16_t *min,
                          uint16_t *not_max)
{
    const __m256i ones = _mm256_set1_epi16(-1);
    int32_t x = 0;
    for (; x + 32 <= width; x += 32) { /* a cache line of each row */
        __m256i low0 = _mm256_loadu_si256((const void *)(rows[0] + x)), high0 = low0;
        __m256i low1 = _mm256_loadu_si256((const void *)(rows[0] + x + 16)), high1 = low1;
        for (int32_t r = 1; r < row_count; r++) {
            __m256i value0 = _mm256_loadu_si256((const void *)(rows[r] + x));
            __m256i value1 = _mm256_loadu_si256((const void *)(rows[r] + x + 16));
            low0 = _mm256_min_epu16(low0, value0);
            high0 = _mm256_max_epu16(high0, value0);
            low1 = _mm256_min_epu16(low1, value1);
            high1 = _mm256_max_epu16(high1, value1);
        }
        _mm256_storeu_si256((void *)(min + x), low0);
        _mm256_storeu_si256((void *)(min + x + 16), low1);
        _mm256_storeu_si256((void *)(not_max + x), _mm256_xor_si256(high0, ones));
        _mm256_storeu_si256((void *)(not_max + x + 16), _mm256_xor_si256(high1, ones));
    }
    fold_u16(rows, row_count, x, width, min, not_max);
}

AVX2 static void avx2_f32(const float *const *rows, int32_t row_count, int32_t width, float *min, float *max)
{
    int32_t x = 0;
    for (; x + 16 <= width; x += 16) {
        __m256 low0 = _mm256_loadu_ps(rows[0] + x), high0 = low0;
        __m256 low1 = _mm256_loadu_ps(rows[0] + x + 8), high1 = low1;
        for (int32_t r = 1; r < row_count; r++) {
            __m256 value0 = _mm256_loadu_ps(rows[r] + x), value1 = _mm256_loadu_ps(rows[r] + x + 8);
            low0 = _mm256_min_ps(low0, value0);
            high0 = _mm256_max_ps(high0, value0);
            low1 = _mm256_min_ps(low1, value1);
            high1 = _mm256_max_ps(high1, value1);
        }
        _mm256_storeu_ps(min + x, low0);
        _mm256_storeu_ps(min + x + 8, low1);
        _mm256_storeu_ps(max + x, high0);
        _mm256_storeu_ps(max + x + 8, high1);
    }
    fold_f32(rows, row_count, x, width, min, max);
}

/* Smallest of 8 values at a time (PHMINPOSUW); cells narrower than that take the plain loop. */
AVX2 static void avx2_spans(const uint16_t *min, const uint16_t *not_max, int32_t width, int32_t shift,
                            uint32_t *codes)
{
    int32_t size = 1 << shift, x = 0;
    for (; size >= 8 && x + size <= width; x += size) {
        __m128i low = _mm_loadu_si128((const void *)(min + x));
        __m128i not_high = _mm_loadu_si128((const void *)(not_max + x));
        for (int32_t i = 8; i < size; i += 8) {
            low = _mm_min_epu16(low, _mm_loadu_si128((const void *)(min + x + i)));
            not_high = _mm_min_epu16(not_high, _mm_loadu_si128((const void *)(not_max + x + i)));
        }
        uint32_t l = (uint32_t)_mm_cvtsi128_si32(_mm_minpos_epu16(low)) & 0xffffu;
        uint32_t h = (uint32_t)_mm_cvtsi128_si32(_mm_minpos_epu16(not_high)) & 0xffffu;
        if (min[x + size] < l) l = min[x + size];
        if (not_max[x + size] < h) h = not_max[x + size];
        codes[x >> shift] = code_make(l, ~h & 0xffffu);
    }
    spans(min, not_max, width, shift, x, codes);
}

AVX2 void code_union_rows_avx2(uint32_t *to, const uint32_t *a, const uint32_t *b, size_t count)
{
    size_t i = 0;
    for (; i + 8 <= count; i += 8) {
        __m256i left = _mm256_loadu_si256((const void *)(a + i));
        __m256i right = _mm256_loadu_si256((const void *)(b + i));
        _mm256_storeu_si256((void *)(to + i), _mm256_max_epu16(left, right));
    }
    code_union_rows(to + i, a + i, b + i, count - i);
}

const columns_kernels columns_avx2 = {avx2_u8, avx2_u16, avx2_f32, avx2_spans};
#else
void code_union_rows_avx2(uint32_t *to, const uint32_t *a, const uint32_t *b, size_t count)
{
    code_union_rows(to, a, b, count);
}

const columns_kernels columns_avx2 = {plain_u8, plain_u16, plain_f32, plain_spans};
#endif
