/* render/sampler.h: Owen-scrambled Sobol points, padded by shuffling [Burley 2020].
 *
 * A sample asks for groups of four dimensions. Within a group the points of a pixel form a
 * nested-uniformly scrambled 4D Sobol sequence; each group and each pixel has its own shuffle and
 * scramble, so that any prefix of 2^k samples is stratified and nothing correlates across groups. */
#ifndef KNURL_SRC_RENDER_SAMPLER_H
#define KNURL_SRC_RENDER_SAMPLER_H

#include <stdint.h>

typedef struct sampler {
    uint32_t seed;  /* of the pixel */
    uint32_t index; /* of the sample */
} sampler;

typedef struct sample4 {
    double u[4]; /* each in [0, 1) */
} sample4;

/* `x`, `y` are coordinates in the whole image, so that crops repeat the same numbers. */
sampler sampler_make(uint32_t seed, uint32_t x, uint32_t y, uint32_t index);
sample4 sampler_get(const sampler *s, uint32_t group);
/* An unstratified number in [0, 1) for rare decisions, a function of the sample and of (a, b). */
double sampler_hash(const sampler *s, uint32_t a, uint32_t b);

/* Point `index` of the 4D Sobol sequence, unscrambled, as 32-bit fractions. */
void sampler_sobol(uint32_t index, uint32_t x[4]);

#endif
