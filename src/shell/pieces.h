/* shell/pieces.h: from the stretches of a ray curve to pieces along which x and y are monotone. */
#ifndef KNURL_SRC_SHELL_PIECES_H
#define KNURL_SRC_SHELL_PIECES_H

#include "shell/curve.h"

/* Narrows a stretch to the ray's [tmin, tmax], a little wider than that; false if nothing is left. */
bool curve_clip_to_ray(const ray_curve *curve, const knurl_ray *ray, curve_interval *stretch);

/* Turning points of x and y cut [in, out] into pieces (RMIP 2023, Algorithm 1, lines 4 and 5). Piece k is
 * from cuts[k] to cuts[k + 1]; returns the number of cuts, ends included. */
int curve_split_at_turns(const ray_curve *curve, double in, double out, double cuts[6]);

#endif
