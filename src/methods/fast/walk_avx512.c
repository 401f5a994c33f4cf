/* The traversal for machines with AVX-512 (F, VL, BW), eight lanes at a time with its masks and registers;
 * built for them. */
#ifdef __AVX512VL__
#define FAST_WALK      fast_walk_avx512
#define FAST_WALK_MANY fast_walk_many_avx512
#include "methods/fast/walk.h"
#else
#include "methods/fast/fast.h"
/* Not such a machine: never chosen, but linked. */
void fast_walk_avx512(fast_ray *ray)
{
    fast_walk_plain(ray);
}
void fast_walk_many_avx512(fast_ray *rays, int count)
{
    fast_walk_many_plain(rays, count);
}
#endif
