/* Building and updating the minmax pyramid. */
#include "bounds/minmax.h"

knurl_status minmax_build(knurl_context *context, const height_level *level, int32_t shift,
                          const cell_scale *scale, minmax_pyramid **pyramid, knurl_error *error)
{
    minmax_pyramid made = {.shift = shift};
    size_t total = 0;
    int32_t width = cell_count(level->width, shift), height = cell_count(level->height, shift);
    for (;;) {
        int32_t k = made.level_count++;
        made.width[k] = width;
        made.height[k] = height;
        made.offset[k] = total;
        total += (size_t)width * (size_t)height;
        if (width == 1 && height == 1) break;
        width = (width + 1) / 2;
        height = (height + 1) / 2;
    }
    *pyramid = knurl_alloc(context, sizeof made);
    made.codes = knurl_alloc_array(context, total, sizeof *made.codes);
    if (!*pyramid || !made.codes) {
        knurl_free(context, *pyramid);
        knurl_free(context, made.codes);
        *pyramid = NULL;
        return knurl_fail_memory(error, total * sizeof *made.codes, "the minmax pyramid of a height map");
    }
    made.bytes = sizeof made + total * sizeof *made.codes;
    **pyramid = made;
    minmax_update(context, *pyramid, level, scale, (height_rect){0, 0, level->width, level->height});
    return KNURL_OK;
}

void minmax_update(knurl_context *context, minmax_pyramid *pyramid, const height_level *level,
                   const cell_scale *scale, height_rect samples)
{
    height_rect cells[4];
    int32_t count = cell_holders(level, pyramid->shift, samples, cells);
    cell_grid grid = minmax_level(pyramid, 0);
    for (int32_t i = 0; i < count; i++) cell_grid_fold(context, level, scale, &grid, cells[i]);
    for (int32_t k = 1; k < pyramid->level_count; k++) {
        cell_grid coarse = minmax_level(pyramid, k);
        for (int32_t i = 0; i < count; i++) {
            height_rect *c = &cells[i];
            *c = (height_rect){c->x0 / 2, c->y0 / 2, (c->x1 + 1) / 2, (c->y1 + 1) / 2};
            cell_grid_reduce(context, &grid, &coarse, *c);
        }
        grid = coarse;
    }
}

void minmax_destroy(knurl_context *context, minmax_pyramid *pyramid)
{
    if (!pyramid) return;
    knurl_free(context, pyramid->codes);
    knurl_free(context, pyramid);
}
