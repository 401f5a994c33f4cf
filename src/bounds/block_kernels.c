/* Simple loops, which the compiler makes vectors of: once for any processor and once for AVX2. */
#include "bounds/block_kernels.h"

#define KERNEL static inline __attribute__((always_inline))

KERNEL void encode_u8(const uint8_t *from, int32_t count, uint16_t *to)
{
    for (int32_t i = 0; i < count; i++) to[i] = (uint16_t)(257u * from[i]);
}

KERNEL void encode_f32(const float *from, int32_t count, double origin, double inverse_step, uint16_t *to)
{
    for (int32_t i = 0; i < count; i++) {
        double position = ((double)from[i] - origin) * inverse_step + 0.5;
        int32_t code = (int32_t)position;
        to[i] = (uint16_t)(code < 65535 ? code : 65535);
    }
}

KERNEL uint16_t smaller(uint16_t a, uint16_t b)
{
    return a < b ? a : b;
}

KERNEL uint16_t larger(uint16_t a, uint16_t b)
{
    return a > b ? a : b;
}

/* A child has 4 x 4 cells, hence 5 x 5 samples. Down first; then across for all columns, of which every
 * fourth is wanted: that is less work than to pick columns first. */
KERNEL void fold(const uint16_t *codes, int32_t count, block_node *nodes)
{
    uint16_t low[BLOCK_STRIP_STRIDE], high[BLOCK_STRIP_STRIDE];
    for (int32_t j = 0; j < 4; j++) {
        const uint16_t *r0 = codes + 4 * j * BLOCK_STRIP_STRIDE, *r1 = r0 + BLOCK_STRIP_STRIDE,
                       *r2 = r1 + BLOCK_STRIP_STRIDE, *r3 = r2 + BLOCK_STRIP_STRIDE,
                       *r4 = r3 + BLOCK_STRIP_STRIDE;
        for (int32_t x = 0; x < 16 * count + 16; x++) {
            low[x] = smaller(smaller(smaller(r0[x], r1[x]), smaller(r2[x], r3[x])), r4[x]);
            high[x] = larger(larger(larger(r0[x], r1[x]), larger(r2[x], r3[x])), r4[x]);
        }
        for (int32_t k = 0; k < count; k++) {
            const uint16_t *l = low + 16 * k, *h = high + 16 * k;
            uint16_t wide_low[16], wide_high[16];
            for (int32_t x = 0; x < 16; x++) {
                wide_low[x] =
                    smaller(smaller(smaller(l[x], l[x + 1]), smaller(l[x + 2], l[x + 3])), l[x + 4]);
                wide_high[x] = larger(larger(larger(h[x], h[x + 1]), larger(h[x + 2], h[x + 3])), h[x + 4]);
            }
            for (int32_t i = 0; i < 4; i++) {
                nodes[k].min[4 * j + i] = wide_low[4 * i];
                nodes[k].max[4 * j + i] = wide_high[4 * i];
            }
        }
    }
}

static void plain_u8(const uint8_t *from, int32_t count, uint16_t *to)
{
    encode_u8(from, count, to);
}

static void plain_f32(const float *from, int32_t count, double origin, double inverse_step, uint16_t *to)
{
    encode_f32(from, count, origin, inverse_step, to);
}

static void plain_fold(const uint16_t *codes, int32_t count, block_node *nodes)
{
    fold(codes, count, nodes);
}

const block_kernels block_kernels_plain = {plain_u8, plain_f32, plain_fold};

#if defined(__x86_64__)
#define AVX2 __attribute__((target("avx2")))

AVX2 static void avx2_u8(const uint8_t *from, int32_t count, uint16_t *to)
{
    encode_u8(from, count, to);
}

AVX2 static void avx2_f32(const float *from, int32_t count, double origin, double inverse_step, uint16_t *to)
{
    encode_f32(from, count, origin, inverse_step, to);
}

AVX2 static void avx2_fold(const uint16_t *codes, int32_t count, block_node *nodes)
{
    fold(codes, count, nodes);
}

const block_kernels block_kernels_avx2 = {avx2_u8, avx2_f32, avx2_fold};
#else
const block_kernels block_kernels_avx2 = {plain_u8, plain_f32, plain_fold};
#endif
