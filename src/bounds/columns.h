/* bounds/columns.h: kernels of the pass over all samples. Each comes twice, and the caller picks one by
 * the context's CPU features: plain C, and AVX2, which gives the same result. */
#ifndef KNURL_SRC_BOUNDS_COLUMNS_H
#define KNURL_SRC_BOUNDS_COLUMNS_H

#include <stdint.h>

/* The most rows that are folded at once: cells of 32 samples, and the first row of the next cell. */
enum { COLUMNS_MAX_ROWS = 33 };

/* Column-wise range of `row_count` rows of `width` samples, as the minimum and the *complement of the
 * maximum*, so that the same reduction serves both. */
typedef void columns_u8_fn(const uint8_t *const *rows, int32_t row_count, int32_t width, uint16_t *min,
                           uint16_t *not_max);
typedef void columns_u16_fn(const uint16_t *const *rows, int32_t row_count, int32_t width, uint16_t *min,
                            uint16_t *not_max);
typedef void columns_f32_fn(const float *const *rows, int32_t row_count, int32_t width, float *min,
                            float *max);

/* Range codes of the cells of 1 << shift columns; both arrays hold width + 1 values, of which the last
 * repeats the first. */
typedef void spans_fn(const uint16_t *min, const uint16_t *not_max, int32_t width, int32_t shift,
                      uint32_t *codes);

typedef struct columns_kernels {
    columns_u8_fn *u8;
    columns_u16_fn *u16;
    columns_f32_fn *f32;
    spans_fn *spans;
} columns_kernels;

extern const columns_kernels columns_plain;
extern const columns_kernels columns_avx2; /* the plain ones where AVX2 cannot be built */

#endif
