/* support/random.h: a small repeatable random generator (SplitMix64). */
#ifndef KNURL_TESTS_RANDOM_H
#define KNURL_TESTS_RANDOM_H

#include <stdint.h>

typedef struct random_state {
    uint64_t s;
} random_state;

static inline uint64_t random_bits(random_state *r)
{
    uint64_t z = (r->s += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

/* In [0, 1). */
static inline double random_unit(random_state *r)
{
    return (double)(random_bits(r) >> 11) * 0x1p-53;
}
static inline double random_range(random_state *r, double low, double high)
{
    return low + (high - low) * random_unit(r);
}
static inline uint32_t random_index(random_state *r, uint32_t count)
{
    return (uint32_t)(((random_bits(r) >> 32) * (uint64_t)count) >> 32);
}

#endif
