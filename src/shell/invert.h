/* shell/invert.h: the shell map F(b1, b2, s) = P + s N of a triangle, its derivatives and its inverse. */
#ifndef KNURL_SRC_SHELL_INVERT_H
#define KNURL_SRC_SHELL_INVERT_H

#include "shell/shell.h"

/* Solves columns [a b c] x = r by Cramer's rule; false if singular. */
static inline bool solve3(vec3 a, vec3 b, vec3 c, vec3 r, vec3 *x)
{
    vec3 bc = v3_cross(b, c);
    double det = v3_dot(a, bc);
    if (!(fabs(det) > 1e-14 * v3_length(a) * v3_length(bc)) || !isfinite(det)) return false;
    double inverse = 1.0 / det;
    *x =
        v3(v3_dot(r, bc) * inverse, v3_dot(a, v3_cross(r, c)) * inverse, v3_dot(a, v3_cross(b, r)) * inverse);
    return true;
}

/* F at q = (b1, b2, s), relative to vertex 0. */
static inline vec3 shell_map(const triangle_frame *f, vec3 q)
{
    vec3 base = v3_mad(v3_scale(f->pe, q.x), q.y, f->pf);
    return v3_mad(base, q.z, v3_mad(v3_mad(f->n[0], q.x, f->ne), q.y, f->nf));
}

/* Its derivatives along b1, b2 and s. */
static inline void shell_columns(const triangle_frame *f, vec3 q, vec3 *ja, vec3 *jb, vec3 *js)
{
    *ja = v3_mad(f->pe, q.z, f->ne);
    *jb = v3_mad(f->pf, q.z, f->nf);
    *js = v3_mad(v3_mad(f->n[0], q.x, f->ne), q.y, f->nf);
}

/* Inverts F(b1, b2, s) = point by Newton's method from *q. The point is relative to vertex 0. */
bool shell_invert(const triangle_frame *f, vec3 point, vec3 *q);

#endif
