/* Points of S in triangles and on their edges. */
#include "shell/evaluate.h"

void shell_root_at(const shell_space *space, const height_lod *lod, const triangle_frame *f, double b1,
                   double b2, double t, shell_root *root)
{
    root->t = t;
    root->b1 = b1;
    root->b2 = b2;
    root->x = f->x[0] + b1 * f->xe + b2 * f->xf;
    root->y = f->y[0] + b1 * f->ye + b2 * f->yf;
    height_patch_find(space, lod, f, root->x, root->y, &root->patch);
}

/* P + h N / |N|, or P + h N. Where opposing normals cancel there is no direction to go. */
static vec3 displace(const shell_space *space, vec3 p, vec3 n, double h)
{
    if (space->unnormalised) return v3_mad(p, h, n);
    double length = v3_length(n);
    return length > 0.0 ? v3_mad(p, h / length, n) : p;
}

vec3 shell_point(const shell_space *space, const height_lod *lod, const triangle_frame *f, double b1,
                 double b2)
{
    shell_root root;
    shell_root_at(space, lod, f, b1, b2, 0.0, &root);
    vec3 p = v3_mad(v3_mad(f->base, b1, f->pe), b2, f->pf);
    vec3 n = v3_mad(v3_mad(f->n[0], b1, f->ne), b2, f->nf);
    return displace(space, p, n, height_patch_at(&root.patch, root.x, root.y));
}

/* Whether vertex a comes after b: by position, then normal, then texture coordinates. */
static bool comes_after(const base_mesh *mesh, uint32_t a, uint32_t b)
{
    const float *arrays[3] = {mesh->positions, mesh->normals, mesh->texcoords};
    for (int k = 0; k < 3; k++) {
        size_t width = k < 2 ? 3 : 2;
        const float *va = arrays[k] + width * a, *vb = arrays[k] + width * b;
        for (size_t i = 0; i < width; i++)
            if (va[i] != vb[i]) return va[i] > vb[i];
    }
    return false;
}

/* Whole periods of the map to take off coordinates of which `least` is the smallest. */
static double periods_below(double least, knurl_wrap wrap)
{
    if (wrap == KNURL_WRAP_CLAMP) return 0.0;
    return wrap == KNURL_WRAP_MIRROR ? 2.0 * floor_d(0.5 * least) : floor_d(least);
}

void shell_edge_make(const shell_space *space, const height_lod *lod, uint32_t first, uint32_t second,
                     shell_edge *edge)
{
    const base_mesh *mesh = &space->mesh;
    edge->swapped = comes_after(mesh, first, second);
    uint32_t v[2] = {edge->swapped ? second : first, edge->swapped ? first : second};
    vec2 *uv = edge->uv;
    for (int i = 0; i < 2; i++) {
        edge->p[i] = v3_loadf(mesh->positions + 3 * (size_t)v[i]);
        edge->n[i] = v3_loadf(mesh->normals + 3 * (size_t)v[i]);
        const float *st = mesh->texcoords + 2 * (size_t)v[i];
        uv[i] = shell_uv(space, (double)st[0], (double)st[1]);
    }
    double u = periods_below(min_d(uv[0].x, uv[1].x), space->wrap_u),
           w = periods_below(min_d(uv[0].y, uv[1].y), space->wrap_v);
    for (int i = 0; i < 2; i++) {
        edge->x[i] = (uv[i].x - u) * (double)lod->level[0]->width - 0.5;
        edge->y[i] = (uv[i].y - w) * (double)lod->level[0]->height - 0.5;
    }
    double dx = edge->x[1] - edge->x[0], dy = edge->y[1] - edge->y[0];
    edge->length = sqrt(dx * dx + dy * dy);
}

/* Height at texel coordinates that count from texel 0. */
static double height_at(const shell_space *space, const height_lod *lod, double x, double y)
{
    static const triangle_frame at_zero; /* of which only the origin, (0, 0), is read */
    height_patch patch;
    height_patch_find(space, lod, &at_zero, x, y, &patch);
    return height_patch_at(&patch, x, y);
}

/* An end of an edge, from its own coordinates alone: other edges there may be moved otherwise. */
static vec3 end_point(const shell_space *space, const height_lod *lod, const shell_edge *edge, int end)
{
    vec2 uv = edge->uv[end];
    double x = (uv.x - periods_below(uv.x, space->wrap_u)) * (double)lod->level[0]->width - 0.5;
    double y = (uv.y - periods_below(uv.y, space->wrap_v)) * (double)lod->level[0]->height - 0.5;
    return displace(space, edge->p[end], edge->n[end], height_at(space, lod, x, y));
}

vec3 shell_edge_point(const shell_space *space, const height_lod *lod, const shell_edge *edge, uint32_t k,
                      uint32_t n)
{
    if (k == 0) return end_point(space, lod, edge, edge->swapped);
    if (k == n) return end_point(space, lod, edge, !edge->swapped);
    double way = (double)(edge->swapped ? n - k : k) / (double)n;
    vec3 p = v3_mad(edge->p[0], way, v3_sub(edge->p[1], edge->p[0]));
    vec3 normal = v3_mad(edge->n[0], way, v3_sub(edge->n[1], edge->n[0]));
    return displace(space, p, normal,
                    height_at(space, lod, edge->x[0] + way * (edge->x[1] - edge->x[0]),
                              edge->y[0] + way * (edge->y[1] - edge->y[0])));
}
