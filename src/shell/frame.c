/* Loading one triangle for one ray: local frames, levels of detail, bilinear patches. */
#include "shell/shell.h"

#include <float.h>

void height_lod_make(const shell_space *space, double lod, height_lod *out)
{
    const knurl_heightmap *map = space->map;
    double last = (double)(map->level_count - 1);
    if (!(lod > 0.0)) lod = 0.0;
    if (lod > last) lod = last;
    int32_t fine = (int32_t)lod;
    int32_t coarse = fine + 1 < map->level_count ? fine + 1 : fine;
    out->level[0] = &map->levels[fine];
    out->level[1] = &map->levels[coarse];
    out->blend = lod - (double)fine;
    out->ratio[0] = (double)out->level[1]->width / (double)out->level[0]->width;
    out->ratio[1] = (double)out->level[1]->height / (double)out->level[0]->height;
    out->to_map[0] = (double)map->levels[0].width / (double)out->level[0]->width;
    out->to_map[1] = (double)map->levels[0].height / (double)out->level[0]->height;
    out->lod = lod;
}

/* An origin that reads the same texels, in the first period: most cells of a small triangle then need no
 * wrapping of their own. */
static int64_t wrap_origin(int64_t origin, int32_t size, knurl_wrap wrap)
{
    int64_t period = wrap == KNURL_WRAP_MIRROR ? 2 * (int64_t)size : size;
    if (wrap == KNURL_WRAP_CLAMP || (origin >= 0 && origin < period)) return origin;
    int64_t rest = origin % period;
    return rest < 0 ? rest + period : rest;
}

/* Texel coordinates of the vertices, relative to the integer texel below their centre. Multiples of
 * the level's size are taken off first, so that the subtraction is of nearby numbers. */
static void load_texels(const shell_space *space, const uint32_t *v, const height_lod *lod, triangle_frame *f)
{
    double w = (double)lod->level[0]->width, h = (double)lod->level[0]->height;
    vec2 uv[3];
    for (int i = 0; i < 3; i++) {
        const float *st = space->mesh.texcoords + 2 * (size_t)v[i];
        uv[i] = shell_uv(space, (double)st[0], (double)st[1]);
    }
    f->origin_x = (int64_t)floor_d((uv[0].x + uv[1].x + uv[2].x) / 3.0 * w - 0.5);
    f->origin_y = (int64_t)floor_d((uv[0].y + uv[1].y + uv[2].y) / 3.0 * h - 0.5);
    f->wrapped_x = wrap_origin(f->origin_x, lod->level[0]->width, space->wrap_u);
    f->wrapped_y = wrap_origin(f->origin_y, lod->level[0]->height, space->wrap_v);
    f->texel_rounding = 0.0;
    for (int i = 0; i < 3; i++) {
        f->x[i] = (uv[i].x * w - 0.5) - (double)f->origin_x;
        f->y[i] = (uv[i].y * h - 0.5) - (double)f->origin_y;
        double largest = max_d(fabs(uv[i].x * w), fabs(uv[i].y * h)) + 1.0;
        f->texel_rounding = max_d(f->texel_rounding, 4.0 * DBL_EPSILON * largest);
    }
    f->xe = f->x[1] - f->x[0];
    f->xf = f->x[2] - f->x[0];
    f->ye = f->y[1] - f->y[0];
    f->yf = f->y[2] - f->y[0];
}

void triangle_frame_load_shape(const shell_space *space, uint32_t triangle, triangle_frame *f)
{
    const uint32_t *v = space->mesh.triangles + 3 * (size_t)triangle;
    const shell *stored = &space->shells[triangle];
    f->flags = stored->flags;
    f->unnormalised = space->unnormalised;
    f->base = v3_loadf(space->mesh.positions + 3 * (size_t)v[0]);
    for (int i = 0; i < 3; i++) {
        f->p[i] = v3_sub(v3_loadf(space->mesh.positions + 3 * (size_t)v[i]), f->base);
        f->n[i] = v3_loadf(space->mesh.normals + 3 * (size_t)v[i]);
    }
    f->pe = f->p[1];
    f->pf = f->p[2];
    f->ne = v3_sub(f->n[1], f->n[0]);
    f->nf = v3_sub(f->n[2], f->n[0]);
    f->size = v3_max_component(v3_max(v3_abs(f->pe), v3_abs(f->pf)));
    f->s0 = (double)stored->s_min;
    f->s1 = (double)stored->s_max;
    f->area = (double)stored->area;
}

void triangle_frame_load_texels(const shell_space *space, uint32_t triangle, const height_lod *lod,
                                triangle_frame *f)
{
    load_texels(space, space->mesh.triangles + 3 * (size_t)triangle, lod, f);
    double det = f->xe * f->yf - f->xf * f->ye;
    bool invertible = !(f->flags & SHELL_FLAT_UV) && det != 0.0;
    double inverse = invertible ? 1.0 / det : 0.0;
    f->inverse_uv[0] = f->yf * inverse;
    f->inverse_uv[1] = -f->xf * inverse;
    f->inverse_uv[2] = -f->ye * inverse;
    f->inverse_uv[3] = f->xe * inverse;
}

void triangle_frame_load(const shell_space *space, uint32_t triangle, const height_lod *lod,
                         triangle_frame *f)
{
    triangle_frame_load_shape(space, triangle, f);
    triangle_frame_load_texels(space, triangle, lod, f);
}

/* The four heights of cell (i, j), each times `weight`: (0,0), (1,0), (0,1), (1,1). */
static void load_corners(const shell_space *space, const height_level *level, int64_t i, int64_t j,
                         double weight, double h[4])
{
    int32_t columns[2] = {height_wrap(i, level->width, space->wrap_u),
                          height_wrap(i + 1, level->width, space->wrap_u)};
    int32_t rows[2] = {height_wrap(j, level->height, space->wrap_v),
                       height_wrap(j + 1, level->height, space->wrap_v)};
    double raw[4];
    double k = space->factor * weight * height_fetch_cell(level, columns, rows, raw),
           o = space->offset * weight;
    for (int c = 0; c < 4; c++) h[c] = o + k * raw[c];
}

/* The patch of one cell, whose corner is the patch's. */
static void set_patch(const double h[4], height_patch *patch)
{
    double ax = h[1] - h[0], ay = h[2] - h[0], axy = (h[3] - h[2]) - ax;
    patch->c = h[0];
    patch->cx = ax;
    patch->cy = ay;
    patch->cxy = axy;
    patch->min = min_d(min_d(h[0], h[1]), min_d(h[2], h[3]));
    patch->max = max_d(max_d(h[0], h[1]), max_d(h[2], h[3]));
    patch->slope = max_d(fabs(ax), fabs(ax + axy)) + max_d(fabs(ay), fabs(ay + axy));
}

/* Adds a cell of another level: (px, py) is the position of the patch's corner in the cell, (rx, ry) the
 * cell's texels per texel of the patch. */
static void add_patch(const double h[4], double px, double py, double rx, double ry, height_patch *patch)
{
    height_patch other;
    set_patch(h, &other);
    patch->c += other.c + other.cx * px + py * (other.cy + other.cxy * px);
    patch->cx += (other.cx + other.cxy * py) * rx;
    patch->cy += (other.cy + other.cxy * px) * ry;
    patch->cxy += other.cxy * rx * ry;
    patch->min += other.min;
    patch->max += other.max;
    patch->slope += max_d(fabs(other.cx), fabs(other.cx + other.cxy)) * rx +
                    max_d(fabs(other.cy), fabs(other.cy + other.cxy)) * ry;
}

void height_patch_load(const shell_space *space, const height_lod *lod, const triangle_frame *frame,
                       int64_t i, int64_t j, int64_t i1, int64_t j1, height_patch *patch)
{
    double h[4];
    load_corners(space, lod->level[0], frame->wrapped_x + i, frame->wrapped_y + j, 1.0 - lod->blend, h);
    patch->x = (double)i;
    patch->y = (double)j;
    set_patch(h, patch);
    if (lod->blend > 0.0) {
        double px = ((double)(frame->origin_x + i) + 0.5) * lod->ratio[0] - 0.5 - (double)i1;
        double py = ((double)(frame->origin_y + j) + 0.5) * lod->ratio[1] - 0.5 - (double)j1;
        load_corners(space, lod->level[1], i1, j1, lod->blend, h);
        add_patch(h, px, py, lod->ratio[0], lod->ratio[1], patch);
    }
    double rounding = 16.0 * DBL_EPSILON * (fabs(patch->min) + fabs(patch->max));
    patch->min -= rounding;
    patch->max += rounding;
}

void height_patch_find(const shell_space *space, const height_lod *lod, const triangle_frame *f, double x,
                       double y, height_patch *patch)
{
    int64_t i1 = 0, j1 = 0;
    if (lod->blend > 0.0) {
        i1 = (int64_t)floor_d((x + (double)f->origin_x + 0.5) * lod->ratio[0] - 0.5);
        j1 = (int64_t)floor_d((y + (double)f->origin_y + 0.5) * lod->ratio[1] - 0.5);
    }
    height_patch_load(space, lod, f, (int64_t)floor_d(x), (int64_t)floor_d(y), i1, j1, patch);
}

knurl_range shell_height_range(const shell_space *space, const height_lod *lod, knurl_bounds_kind kind,
                               const triangle_frame *frame, double x0, double y0, double x1, double y1)
{
    double sx = lod->to_map[0], sy = lod->to_map[1];
    double ox = (double)frame->origin_x + 0.5, oy = (double)frame->origin_y + 0.5;
    knurl_range raw = heightmap_bounds_texels_lod(
        space->map, kind, (x0 + ox) * sx - 0.5, (y0 + oy) * sy - 0.5, (x1 + ox) * sx - 0.5,
        (y1 + oy) * sy - 0.5, space->wrap_u, space->wrap_v, lod->lod);
    double a = space->offset + space->factor * raw.min, b = space->offset + space->factor * raw.max;
    double rounding = 4.0 * DBL_EPSILON * (fabs(a) + fabs(b));
    return (knurl_range){min_d(a, b) - rounding, max_d(a, b) + rounding};
}
