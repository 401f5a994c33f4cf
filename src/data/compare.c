/* Difference of two images. Rows are measured in parallel and summed in order, so that the result
 * does not depend on the number of threads. */
#include "data/image.h"

#include <math.h>

typedef struct row_difference {
    double squares, relative;
    double maximum;
    int32_t worst_x;
    uint64_t samples, not_finite;
} row_difference;

typedef struct comparison {
    const knurl_image *a, *b;
    row_difference *rows;
    float *map; /* one value per pixel, or NULL */
} comparison;

static row_difference compare_row(const comparison *c, int32_t y)
{
    row_difference row = {.maximum = -1};
    const void *a = image_row_const(c->a, y), *b = image_row_const(c->b, y);
    int32_t width = c->a->width, channels = c->a->channels;
    size_t i = 0;
    for (int32_t x = 0; x < width; x++) {
        double largest = 0;
        for (int32_t channel = 0; channel < channels; channel++, i++) {
            double va = (double)image_scaled(c->a->format, a, i),
                   vb = (double)image_scaled(c->b->format, b, i);
            if (!isfinite(va) || !isfinite(vb)) {
                if (isfinite(va) || isfinite(vb)) {
                    row.not_finite++;
                    largest = (double)INFINITY;
                }
                continue;
            }
            double d = va - vb;
            row.squares += d * d;
            row.relative += d * d / (vb * vb + 0.01);
            row.samples++;
            if (fabs(d) > row.maximum) {
                row.maximum = fabs(d);
                row.worst_x = x;
            }
            if (fabs(d) > largest) largest = fabs(d);
        }
        if (c->map) c->map[(size_t)y * (size_t)width + (size_t)x] = (float)largest;
    }
    return row;
}

static void compare_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const comparison *c = user;
    for (size_t y = begin; y < end; y++) c->rows[y] = compare_row(c, (int32_t)y);
}

static knurl_image_difference sum_rows(const comparison *c)
{
    knurl_image_difference sum = {.maximum = 0};
    double squares = 0, relative = 0, maximum = -1;
    uint64_t samples = 0;
    for (int32_t y = 0; y < c->a->height; y++) {
        const row_difference *row = &c->rows[y];
        squares += row->squares;
        relative += row->relative;
        samples += row->samples;
        sum.not_finite += row->not_finite;
        if (row->maximum > maximum) {
            maximum = row->maximum;
            sum.worst_x = row->worst_x;
            sum.worst_y = y;
        }
    }
    double mse = samples ? squares / (double)samples : 0;
    sum.rmse = sqrt(mse);
    sum.relative_mse = samples ? relative / (double)samples : 0;
    sum.psnr = mse > 0 ? -10 * log10(mse) : (double)INFINITY;
    sum.maximum = maximum > 0 ? maximum : 0;
    return sum;
}

knurl_status knurl_image_compare(knurl_context *context, const knurl_image *a, const knurl_image *b,
                                 knurl_image_difference *difference, knurl_image **map, knurl_error *error)
{
    if (map) *map = NULL;
    if (!context || !a || !b || !difference)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "context, image or difference is NULL");
    if (a->width != b->width || a->height != b->height || a->channels != b->channels)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "images of %d x %d x %d and %d x %d x %d samples cannot be compared", a->width,
                          a->height, a->channels, b->width, b->height, b->channels);
    knurl_image *made = NULL;
    if (map) {
        knurl_status status =
            image_make(context, "difference map", a->width, a->height, 1, KNURL_PIXEL_F32, &made, error);
        if (status != KNURL_OK) return status;
    }
    comparison c = {.a = a, .b = b, .map = made ? image_row(made, 0) : NULL};
    c.rows = knurl_alloc_array(context, (size_t)a->height, sizeof *c.rows);
    if (!c.rows) {
        knurl_image_release(made);
        return knurl_fail_memory(error, (size_t)a->height * sizeof *c.rows, "image comparison");
    }
    knurl_parallel_for(context, (size_t)a->height, 16, compare_rows, &c);
    *difference = sum_rows(&c);
    knurl_free(context, c.rows);
    if (map) *map = made;
    return KNURL_OK;
}
