/* shell/segment_walk.h: a segment of shell/segment.h against the bilinear map, cell by cell.
 *
 * Baboud and Decoret 2006, section 3.3: the heightfield is the bilinear interpolation of texel centres, so
 * that its pieces meet at the centre lines x = i and y = j, and a walk from centre line to centre line misses
 * none. Where the paper takes the heights as linear in between, and may miss a saddle (its Figure 3), this
 * solves the piece's polynomial: quadratic along a straight segment, cubic where h bends (segment_bend()). */
#ifndef KNURL_SRC_SHELL_SEGMENT_WALK_H
#define KNURL_SRC_SHELL_SEGMENT_WALK_H

#include "shell/segment.h"

typedef struct segment_walk {
    const shell_space *space;
    const height_lod *lod;
    const triangle_frame *frame;
    const knurl_ray *ray;
    const shell_segments *segments;
    const shell_segment *segment; /* the one being walked */
    shell_root root;              /* the hit, once found */
    uint32_t steps;               /* grows by one per cell or sample */
    double g;                     /* ray's height over the surface where the next walk starts, if have_g */
    bool have_g;
} segment_walk;

/* First root between two fractions, 0 <= from <= to <= 1, with t in the ray's [tmin, tmax]. The value of g at
 * the end is carried to a walk that goes on from there, so that no sign change falls between two cells or two
 * walks; clear have_g before a walk that starts elsewhere. At fractions 0 and 1, where another triangle may
 * see the other sign, g being zero within rounding is a hit. Roots on exact segments are polished. */
bool segment_walk_cells(segment_walk *walk, double from, double to);

/* Fraction of the first centre line of level[0] after f, at most 1. */
double segment_next_line(const segment_walk *walk, double f);

/* A sample: g at fraction f, with the point and the piece there. */
double segment_sample(segment_walk *walk, double f, segment_point *point, height_patch *patch);

/* Takes the point at fraction f as the hit if its t is in the ray's range. */
bool segment_accept(segment_walk *walk, double f);

#endif
