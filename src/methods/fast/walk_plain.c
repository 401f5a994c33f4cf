/* The traversal for any machine. */
#define FAST_WALK      fast_walk_plain
#define FAST_WALK_MANY fast_walk_many_plain
#include "methods/fast/walk.h"
