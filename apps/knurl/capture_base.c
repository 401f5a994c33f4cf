/* capture_base.c: the rectangle that carries a view's maps, cut into cells. Cells keep each shell's range of
 * heights tight, which is what clipping the frustum by the model's box is for (Baboud and Decoret 2006,
 * section 4.1); cells with an empty picture are left out. */
#include "capture.h"

#include <math.h>
#include <stdlib.h>

void capture_base_release(capture_base *base)
{
    free(base->positions);
    free(base->directions);
    free(base->texcoords);
    free(base->triangles);
    *base = (capture_base){0};
}

/* First and last texel of the colour map that bilinear lookups between two texels of the height map read. */
static void footprint(int32_t begin, int32_t end, int32_t size, int32_t color_size, int32_t range[2])
{
    double scale = (double)color_size / size;
    range[0] = (int32_t)floor((begin + 0.5) * scale - 0.5) - 1;
    range[1] = (int32_t)ceil((end + 0.5) * scale - 0.5) + 1;
    if (range[0] < 0) range[0] = 0;
    if (range[1] > color_size - 1) range[1] = color_size - 1;
}

static bool is_empty(const capture_view *view, const capture_maps *maps, const int32_t x[2],
                     const int32_t y[2])
{
    int32_t columns[2], rows[2];
    footprint(x[0], x[1], view->width, view->color_width, columns);
    footprint(y[0], y[1], view->height, view->color_height, rows);
    for (int32_t row = rows[0]; row <= rows[1]; row++)
        for (int32_t column = columns[0]; column <= columns[1]; column++) {
            size_t texel = (size_t)row * (size_t)view->color_width + (size_t)column;
            if (maps->colors[4 * texel + 3]) return false;
        }
    return true;
}

/* Texel coordinate of grid line i: lines run through texel centres, the last one through the last texel. */
static int32_t line(int32_t i, int32_t cell, int32_t size)
{
    int64_t texel = (int64_t)i * cell;
    return texel < size - 1 ? (int32_t)texel : size - 1;
}

static void add_vertex(const capture_view *view, int32_t x, int32_t y, capture_base *base)
{
    size_t v = base->vertex_count++;
    double picture[2], point[3], direction[3];
    capture_picture(view, x, y, picture);
    capture_point(view, picture, view->base, point);
    capture_direction(view, picture, direction);
    for (size_t i = 0; i < 3; i++) {
        base->positions[3 * v + i] = (float)(point[i] + 0.0);
        base->directions[3 * v + i] = (float)(direction[i] + 0.0);
    }
    base->texcoords[2 * v] = (float)((x + 0.5) / view->width);
    base->texcoords[2 * v + 1] = (float)((y + 0.5) / view->height);
}

static void add_triangle(capture_base *base, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *t = base->triangles + 3 * (size_t)base->triangle_count++;
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

bool capture_base_make(const capture_view *view, const capture_maps *maps, int32_t cell, capture_base *base)
{
    int32_t columns = (view->width - 2) / cell + 1, rows = (view->height - 2) / cell + 1;
    size_t vertices = (size_t)(columns + 1) * (size_t)(rows + 1), cells = (size_t)columns * (size_t)rows;
    *base = (capture_base){.positions = malloc(vertices * 3 * sizeof(float)),
                           .directions = malloc(vertices * 3 * sizeof(float)),
                           .texcoords = malloc(vertices * 2 * sizeof(float)),
                           .triangles = malloc(cells * 6 * sizeof(uint32_t))};
    if (!base->positions || !base->directions || !base->texcoords || !base->triangles) {
        capture_base_release(base);
        return false;
    }
    for (int32_t y = 0; y <= rows; y++)
        for (int32_t x = 0; x <= columns; x++)
            add_vertex(view, line(x, cell, view->width), line(y, cell, view->height), base);
    for (int32_t y = 0; y < rows; y++)
        for (int32_t x = 0; x < columns; x++) {
            const int32_t xs[2] = {line(x, cell, view->width), line(x + 1, cell, view->width)};
            const int32_t ys[2] = {line(y, cell, view->height), line(y + 1, cell, view->height)};
            if (is_empty(view, maps, xs, ys)) continue;
            /* Counter-clockwise as the viewer sees it, y downwards. */
            uint32_t top = (uint32_t)(y * (columns + 1) + x), bottom = top + (uint32_t)columns + 1;
            add_triangle(base, top, bottom, bottom + 1);
            add_triangle(base, top, bottom + 1, top + 1);
        }
    return true;
}
