/* The quad-tree over the minmax mipmap; see tree.h. */
#include "methods/tfdm/tree.h"

#include <float.h>

static tree_axis make_axis(int32_t size, int64_t origin, knurl_wrap wrap)
{
    int32_t padding = size > 1 ? 32 - __builtin_clz((unsigned)size - 1u) : 0;
    return (tree_axis){size, padding, size == 1 << padding, wrap == KNURL_WRAP_REPEAT, origin, wrap};
}

/* What a range code's halves stand for. */
static void make_decoding(tree *t)
{
    const knurl_heightmap *map = t->space->map;
    double base = 0.0, step = 1.0;
    switch (map->levels[0].format) {
    case KNURL_PIXEL_U8:
        step = 1.0 / 255.0;
        break;
    case KNURL_PIXEL_U16:
        step = 1.0 / 65535.0;
        break;
    default:
        base = map->range_min;
        step = map->code_step;
        break;
    }
    t->base = t->space->offset + t->space->factor * base;
    t->scale = t->space->factor * step;
    t->rounding = 8.0 * DBL_EPSILON *
                  (fabs(t->space->offset) + fabs(t->space->factor * base) + 65536.0 * fabs(t->scale));
}

void tree_make(const shell_space *space, const height_lod *lod, const triangle_frame *frame,
               const minmax_pyramid *pyramid, tree *t)
{
    *t = (tree){.space = space, .lod = lod, .frame = frame};
    t->pyramid = lod->lod > 0.0 ? NULL : pyramid;
    t->x = make_axis(lod->level[0]->width, frame->origin_x, space->wrap_u);
    t->y = make_axis(lod->level[0]->height, frame->origin_y, space->wrap_v);
    make_decoding(t);
}

int64_t tree_number(const tree_axis *a, double position)
{
    int64_t texel = (int64_t)floor_d(position) + a->origin, tile = texel / a->size, i = texel % a->size;
    if (i < 0) {
        i += a->size;
        tile--;
    }
    return tile * ((int64_t)1 << a->padding) + i;
}

double tree_position(const tree_axis *a, int64_t number)
{
    if (a->even) return (double)(number - a->origin);
    int64_t tile = number >> a->padding, i = number & (((int64_t)1 << a->padding) - 1);
    return (double)(tile * a->size + (i < a->size ? i : a->size) - a->origin);
}

static void axis_borders(const tree_axis *a, int64_t number, int level, pair *low, pair *high)
{
    int64_t side = (int64_t)1 << level;
    double from = tree_position(a, number);
    if (a->even) {
        *low = (pair){from, from + (double)side};
        *high = *low + pair_of((double)side);
        return;
    }
    double middle = tree_position(a, number + side);
    *low = (pair){from, middle};
    *high = (pair){middle, tree_position(a, number + 2 * side)};
}

void tree_borders(const tree *t, int64_t x, int64_t y, int level, quad *q)
{
    axis_borders(&t->x, x, level, &q->x0, &q->x1);
    axis_borders(&t->y, y, level, &q->y0, &q->y1);
}

/* Whether the pyramid's nodes are the tree's: not beyond a clamped border, and not in mirrored tiles,
 * whose cells lie between the samples in the other order. */
static inline bool is_aligned(const tree_axis *a, int64_t number, int level)
{
    if (a->aligned || level >= a->padding) return true;
    int64_t tile = number >> a->padding;
    return a->wrap == KNURL_WRAP_CLAMP ? tile == 0 : (tile & 1) == 0;
}

/* Index of the pyramid's node; of the last one for numbers without a texel. */
static inline size_t node_index(const tree_axis *a, int64_t number, int shift)
{
    int64_t i = number & (((int64_t)1 << a->padding) - 1);
    return (size_t)((i < a->size ? i : a->size - 1) >> shift);
}

static void query(const tree *t, quad *q, int i, int j)
{
    knurl_range h = shell_height_range(t->space, t->lod, KNURL_BOUNDS_MINMAX, t->frame, q->x0[i], q->y0[j],
                                       q->x1[i], q->y1[j]);
    q->min[j][i] = h.min;
    q->max[j][i] = h.max;
}

static inline pair unpack(uint32_t a, uint32_t b)
{
    return (pair){(double)(int32_t)a, (double)(int32_t)b};
}

void tree_heights(const tree *t, int64_t x, int64_t y, int level, unsigned wanted, quad *q)
{
    const minmax_pyramid *p = t->pyramid;
    int64_t side = (int64_t)1 << level;
    if (p) {
        int l = level > p->shift ? level - p->shift : 0;
        l = l < p->level_count ? l : p->level_count - 1;
        size_t left = node_index(&t->x, x, l + p->shift), right = node_index(&t->x, x + side, l + p->shift);
        for (int j = 0; j < 2; j++) {
            const uint32_t *row =
                p->codes + p->offset[l] + node_index(&t->y, y + j * side, l + p->shift) * (size_t)p->width[l];
            uint32_t a = row[left], b = row[right];
            pair low = pair_of(t->base) + pair_of(t->scale) * unpack(code_min(a), code_min(b));
            pair high = pair_of(t->base) + pair_of(t->scale) * unpack(code_max(a), code_max(b));
            q->min[j] = pair_min(low, high) - pair_of(t->rounding);
            q->max[j] = pair_max(low, high) + pair_of(t->rounding);
        }
        if (t->x.aligned && t->y.aligned) return;
    }
    for (int k = 0; k < 4; k++)
        if (wanted >> k & 1 && !(p && is_aligned(&t->x, x + (k & 1) * side, level) &&
                                 is_aligned(&t->y, y + (k >> 1) * side, level)))
            query(t, q, k & 1, k >> 1);
}
