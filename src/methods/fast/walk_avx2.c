/* The traversal for machines with AVX2 and FMA; built with -mavx2 -mfma. */
#ifdef __AVX2__
#define FAST_WALK      fast_walk_avx2
#define FAST_WALK_MANY fast_walk_many_avx2
#include "methods/fast/walk.h"
#else
#include "methods/fast/fast.h"
/* Not such a machine: never chosen, but linked. */
void fast_walk_avx2(fast_ray *ray)
{
    fast_walk_plain(ray);
}
void fast_walk_many_avx2(fast_ray *rays, int count)
{
    fast_walk_many_plain(rays, count);
}
#endif
