/* bounds/block_kernels.h: inner loops of building blocks, in plain C and with AVX2, with the same result. */
#ifndef KNURL_SRC_BOUNDS_BLOCK_KERNELS_H
#define KNURL_SRC_BOUNDS_BLOCK_KERNELS_H

#include "bounds/blocks.h"

/* A strip is up to 32 nodes wide; its rows hold 16 samples more, and 4 rows of tiles and one beyond. The
 * stride is not a multiple of 4096 bytes, which would put all rows into one cache set. */
enum { BLOCK_STRIP_NODES = 32, BLOCK_STRIP_STRIDE = 16 * BLOCK_STRIP_NODES + 16, BLOCK_STRIP_ROWS = 20 };

typedef struct block_kernels {
    void (*encode_u8)(const uint8_t *from, int32_t count, uint16_t *to);
    /* floor((value - origin) * inverse_step + 1/2), at most 65535 */
    void (*encode_f32)(const float *from, int32_t count, double origin, double inverse_step, uint16_t *to);
    /* Ranges of 16 children of `count` nodes from 17 rows of 16 * count + 16 codes, BLOCK_STRIP_STRIDE apart.
     */
    void (*fold)(const uint16_t *codes, int32_t count, block_node *nodes);
} block_kernels;

extern const block_kernels block_kernels_plain;
extern const block_kernels block_kernels_avx2; /* the plain ones where AVX2 cannot be built */

#endif
