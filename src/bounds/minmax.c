/* Building the minmax pyramid. */
#include "bounds/minmax.h"

#include <string.h>

knurl_status minmax_build(knurl_context *context, const cell_grid *cells, minmax_pyramid **pyramid,
                          knurl_error *error)
{
    minmax_pyramid made = {.shift = cells->shift};
    size_t total = 0;
    int32_t width = cells->width, height = cells->height;
    for (;;) {
        int32_t level = made.level_count++;
        made.width[level] = width;
        made.height[level] = height;
        made.offset[level] = total;
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
    memcpy(made.codes, cells->codes, (size_t)cells->width * (size_t)cells->height * sizeof *made.codes);
    cell_grid fine = *cells;
    for (int32_t level = 1; level < made.level_count; level++) {
        cell_grid coarse;
        cell_grid_reduce(context, &fine, &coarse, made.codes + made.offset[level]);
        fine = coarse;
    }
    **pyramid = made;
    return KNURL_OK;
}

void minmax_destroy(knurl_context *context, minmax_pyramid *pyramid)
{
    if (!pyramid) return;
    knurl_free(context, pyramid->codes);
    knurl_free(context, pyramid);
}
