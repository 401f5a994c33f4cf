/* The method's data after an edit of the map: parts whose texels changed get another height range and box,
 * patches whose shell changed another frame, and both trees other boxes. What belongs where stays: where it
 * would not, all is built anew. */
#include "methods/fast/fast.h"
#include "shell/heights.h"

#include <string.h>

/* Texels beyond a FAST_WRAPPED part that its range may be from: cells of the minmax pyramid, of up to twice
 * its length, and whole cells of up to 16 texels more. */
enum { WRAPPED_REACH = 128 };

/* Leaves whose boxes changed, by rising numbers. */
typedef struct moved {
    fast_leaf *leaves;
    uint32_t count, capacity;
} moved;

static knurl_status add(knurl_context *context, moved *m, const fast_leaf *leaf, knurl_error *error)
{
    if (m->count == m->capacity) {
        uint32_t capacity = m->capacity ? 2 * m->capacity : 256;
        fast_leaf *leaves = knurl_realloc(context, m->leaves, capacity * sizeof *leaves);
        if (!leaves) return knurl_fail_memory(error, capacity * sizeof *leaves, "updating boxes");
        m->leaves = leaves;
        m->capacity = capacity;
    }
    m->leaves[m->count++] = *leaf;
    return KNURL_OK;
}

typedef struct updater {
    const shell_space *space;
    const method_edit *edit;
    fast_data *data;
    bool all;      /* parts are affected */
    int64_t reach; /* texels */
    height_lod lod;
    triangle_frame frame;
    moved parts, triangles;
} updater;

/* The first part of a triangle or of those after it. */
static uint32_t first_part(const fast_data *data, uint32_t triangle)
{
    uint32_t low = 0, high = data->part_count;
    while (low < high) {
        uint32_t half = low + (high - low) / 2;
        if (data->parts[half].patch < triangle)
            low = half + 1;
        else
            high = half;
    }
    return low;
}

/* Along one axis. A part in the map's own period has a node's range; others look up the range of a rectangle,
 * by cells that reach beyond it. The last of either holds sample 0, whatever the wrap mode. */
static bool axis_reads(const fast_part *part, int32_t cell, int32_t size, knurl_wrap wrap, int32_t from,
                       int32_t to)
{
    int32_t side = 16 << (2 * part->level);
    if (part->flags & FAST_WRAPPED)
        return height_table_reads(cell, (int64_t)cell + side, WRAPPED_REACH, size, wrap, from, to);
    int32_t last = side < size - cell ? cell + side : size;
    return height_axis_reads(cell, last, size, KNURL_WRAP_REPEAT, from, to);
}

static bool part_reads(const updater *u, const fast_part *part)
{
    const height_blocks *blocks = u->data->blocks;
    const height_rect *r = &u->edit->samples;
    return axis_reads(part, part->cell_x, blocks->width, u->data->wrap_u, r->x0, r->x1) &&
           axis_reads(part, part->cell_y, blocks->height, u->data->wrap_v, r->y0, r->y1);
}

/* Whether any part of the triangle may read what changed; u->frame is its. */
static bool triangle_reads(const updater *u)
{
    const triangle_frame *f = &u->frame;
    const height_blocks *blocks = u->data->blocks;
    const height_rect *r = &u->edit->samples;
    double x0 = min_d(f->x[0], min_d(f->x[1], f->x[2])), x1 = max_d(f->x[0], max_d(f->x[1], f->x[2]));
    double y0 = min_d(f->y[0], min_d(f->y[1], f->y[2])), y1 = max_d(f->y[0], max_d(f->y[1], f->y[2]));
    int64_t left = (int64_t)floor_d(x0) + f->origin_x, right = (int64_t)floor_d(x1) + 1 + f->origin_x;
    int64_t top = (int64_t)floor_d(y0) + f->origin_y, bottom = (int64_t)floor_d(y1) + 1 + f->origin_y;
    return height_table_reads(left, right, u->reach, blocks->width, u->data->wrap_u, r->x0, r->x1) &&
           height_table_reads(top, bottom, u->reach, blocks->height, u->data->wrap_v, r->y0, r->y1);
}

/* Texels beyond a triangle that the ranges of its parts may be from: children of nodes count as a whole.
 * Levels of parts differ by one at most, and children of the next level are this one's nodes. */
static int64_t find_reach(const fast_data *data)
{
    for (uint32_t i = 0; i < data->part_count; i++)
        if (!(data->parts[i].flags & (FAST_WHOLE | FAST_WRAPPED))) {
            int64_t node = (int64_t)16 << (2 * data->parts[i].level);
            return node > WRAPPED_REACH ? node : WRAPPED_REACH;
        }
    return WRAPPED_REACH;
}

static knurl_status update_parts(updater *u, uint32_t triangle, knurl_error *error)
{
    fast_data *data = u->data;
    bool changed = u->edit->changed[triangle] != 0;
    if (!u->all && !changed && !triangle_reads(u)) return KNURL_OK;
    for (uint32_t i = first_part(data, triangle); i < data->part_count && data->parts[i].patch == triangle;
         i++) {
        const fast_part *part = &data->parts[i];
        bool reads = part->flags & FAST_WHOLE ? changed : u->all || part_reads(u, part);
        if (!reads) continue;
        fast_leaf leaf = fast_part_update(u->space, data, &u->lod, &u->frame, i);
        knurl_status status = add(u->space->context, &u->parts, &leaf, error);
        if (status != KNURL_OK) return status;
    }
    return KNURL_OK;
}

/* False if the triangle is another kind of patch now. */
static bool update_patch(const updater *u, uint32_t triangle)
{
    fast_patch *patch = &u->data->patches[triangle], made;
    fast_patch_make(&u->frame, &made);
    if (patch->flags & FAST_CROWDED) made.flags |= FAST_SEARCHED | FAST_CROWDED;
    bool same = made.flags == patch->flags;
    if (same) *patch = made;
    return same;
}

static knurl_status update_triangles(updater *u, bool *rebuild, knurl_error *error)
{
    knurl_status status = KNURL_OK;
    for (uint32_t t = 0; t < u->space->mesh.triangle_count && status == KNURL_OK; t++) {
        triangle_frame_load(u->space, t, &u->lod, &u->frame);
        if (u->edit->changed[t]) {
            if (!update_patch(u, t)) {
                *rebuild = true;
                return KNURL_OK;
            }
            fast_leaf leaf = {.number = t, .box = fast_coarse_box(u->space, u->data, t)};
            status = add(u->space->context, &u->triangles, &leaf, error);
        }
        if (status == KNURL_OK) status = update_parts(u, t, error);
    }
    return status;
}

/* Errors of the trees' boxes were bounded for a surface of radius 1 and, with what they are padded by, hold
 * up to
 * 2. One that is much smaller than that deserves a finer scale. */
static bool fits_space(const fast_data *data, const double lower[3], const double upper[3])
{
    double square = 0.0;
    for (int k = 0; k < 3; k++) {
        double reach = max_d(upper[k] - data->centre[k], data->centre[k] - lower[k]) * data->scale;
        square += reach * reach;
    }
    return square <= 1.9 * 1.9 && square >= 0.25 * 0.25;
}

knurl_status fast_update(const shell_space *space, const method_edit *edit, void *method_data, bool *rebuild,
                         knurl_error *error)
{
    fast_data *data = method_data;
    *rebuild = edit->other_flags || !data->coarse.nodes || !fits_space(data, edit->lower, edit->upper);
    if (*rebuild) return KNURL_OK;
    const float base = data->height_base, code = data->height_code, error_before = data->height_error;
    fast_set_heights(space, data);
    updater u = {.space = space, .edit = edit, .data = data};
    u.all = memcmp(&base, &data->height_base, sizeof base) != 0 ||
            memcmp(&code, &data->height_code, sizeof code) != 0 ||
            memcmp(&error_before, &data->height_error, sizeof error_before) != 0;
    u.reach = find_reach(data);
    height_lod_make(space, 0.0, &u.lod);
    knurl_status status = update_triangles(&u, rebuild, error);
    if (status == KNURL_OK && !*rebuild)
        status = fast_tree_refit(space->context, &data->fine, data->part_count, u.parts.leaves, u.parts.count,
                                 true, error);
    if (status == KNURL_OK && !*rebuild)
        status = fast_tree_refit(space->context, &data->coarse, space->mesh.triangle_count,
                                 u.triangles.leaves, u.triangles.count, false, error);
    knurl_free(space->context, u.parts.leaves);
    knurl_free(space->context, u.triangles.leaves);
    if (status == KNURL_OK && !*rebuild) fast_set_bounds(data, edit->lower, edit->upper);
    return status;
}
