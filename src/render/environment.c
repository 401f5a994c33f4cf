#include "render/environment.h"

#include "render/texture.h"
#include "render/warp.h"

static vec2 direction_to_uv(const environment *e, vec3 d)
{
    double x = e->cosine * d.x - e->sine * d.z, z = e->sine * d.x + e->cosine * d.z;
    return (vec2){0.5 + atan2(x, -z) / (2.0 * WARP_PI), acos(warp_clamp(d.y, -1.0, 1.0)) / WARP_PI};
}

static vec3 uv_to_direction(const environment *e, double u, double v)
{
    double phi = (u - 0.5) * 2.0 * WARP_PI, theta = v * WARP_PI, ring = sin(theta);
    double x = ring * sin(phi), z = -ring * cos(phi);
    return v3(e->cosine * x + e->sine * z, cos(theta), -e->sine * x + e->cosine * z);
}

/* Files may hold infinities (suns clipped to half floats), NaN and negative light. */
static double clean(double x, bool encoded)
{
    if (!(x > 0.0)) return 0.0;
    return encoded ? texture_srgb_to_linear(x) : fmin(x, 1e6);
}

static vec3 fetch(const knurl_image *image, int32_t x, int32_t y)
{
    int32_t channels = knurl_image_channels(image), step = channels >= 3 ? 1 : 0;
    if (knurl_image_format(image) == KNURL_PIXEL_F32) {
        const float *p = knurl_image_samples(image);
        p += ((size_t)y * (size_t)knurl_image_width(image) + (size_t)x) * (size_t)channels;
        return v3(clean((double)p[0], false), clean((double)p[step], false),
                  clean((double)p[2 * step], false));
    }
    return v3(clean((double)knurl_image_value(image, x, y, 0), true),
              clean((double)knurl_image_value(image, x, y, step), true),
              clean((double)knurl_image_value(image, x, y, 2 * step), true));
}

static vec3 bilinear(const knurl_image *image, double u, double v)
{
    int32_t width = knurl_image_width(image), height = knurl_image_height(image);
    double x = u * width - 0.5, y = warp_clamp(v * height - 0.5, 0.0, height - 1.0);
    int32_t column = (int32_t)floor(x), row = (int32_t)y;
    double fx = x - column, fy = y - row;
    int32_t left = (column + width) % width, right = (column + 1 + width) % width;
    int32_t below = row + 1 < height ? row + 1 : row;
    vec3 top = warp_mix(fetch(image, left, row), fetch(image, right, row), fx);
    return warp_mix(top, warp_mix(fetch(image, left, below), fetch(image, right, below), fx), fy);
}

vec3 environment_radiance(const environment *e, vec3 direction)
{
    vec2 uv = direction_to_uv(e, direction);
    return v3_scale(bilinear(e->image, uv.x, uv.y), e->intensity);
}

/* Mean over a cell of what the bilinear lookup returns, so that no light is found by luck alone. Cells
 * of half a pixel need one lookup: there the signal is linear along either axis. */
static double weigh_cell(const environment *e, int32_t column, int32_t row)
{
    int32_t width = knurl_image_width(e->image), height = knurl_image_height(e->image);
    int32_t nx = (width + e->columns - 1) / e->columns, ny = (height + e->rows - 1) / e->rows;
    double sum = 0.0;
    for (int32_t j = 0; j < ny; j++)
        for (int32_t i = 0; i < nx; i++)
            sum += warp_luminance(
                bilinear(e->image, (column + (i + 0.5) / nx) / e->columns, (row + (j + 0.5) / ny) / e->rows));
    return sum / ((double)nx * ny) * sin(WARP_PI * (row + 0.5) / e->rows);
}

static void weigh_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    environment *e = user;
    (void)thread;
    for (size_t row = begin; row < end; row++) {
        float *cells = e->conditional + row * (size_t)(e->columns + 1);
        cells[0] = 0.0f;
        for (int32_t i = 0; i < e->columns; i++) cells[i + 1] = (float)weigh_cell(e, i, (int32_t)row);
    }
}

/* Turns weights in values[1..count] into a cumulative distribution; returns their sum. */
static double accumulate(float *values, int32_t count)
{
    double sum = 0.0, running = 0.0;
    for (int32_t i = 1; i <= count; i++) sum += (double)values[i];
    values[0] = 0.0f;
    for (int32_t i = 1; i <= count; i++) {
        running += (double)values[i];
        values[i] = sum > 0.0 ? (float)(running / sum) : (float)i / (float)count;
    }
    values[count] = 1.0f;
    return sum;
}

static knurl_status build_importance(environment *e, knurl_error *error)
{
    int32_t width = knurl_image_width(e->image), height = knurl_image_height(e->image);
    e->columns = width < ENVIRONMENT_MAX_CELLS / 2 ? 2 * width : ENVIRONMENT_MAX_CELLS;
    e->rows = height < ENVIRONMENT_MAX_CELLS / 4 ? 2 * height : ENVIRONMENT_MAX_CELLS / 2;
    size_t cells = (size_t)e->rows * (size_t)(e->columns + 1);
    e->conditional = knurl_alloc_array(e->context, cells, sizeof(float));
    e->marginal = knurl_alloc_array(e->context, (size_t)e->rows + 1, sizeof(float));
    if (!e->conditional || !e->marginal)
        return knurl_fail_memory(error, cells * sizeof(float), "environment sampling");
    knurl_parallel_for(e->context, (size_t)e->rows, 16, weigh_rows, e);
    for (int32_t row = 0; row < e->rows; row++)
        e->marginal[row + 1] =
            (float)accumulate(e->conditional + (size_t)row * (size_t)(e->columns + 1), e->columns);
    accumulate(e->marginal, e->rows);
    return KNURL_OK;
}

knurl_status environment_create(knurl_context *context, knurl_image *image, double intensity, double rotation,
                                environment **out, knurl_error *error)
{
    *out = NULL;
    environment *e = knurl_alloc_zero(context, sizeof *e);
    if (!e) return knurl_fail_memory(error, sizeof *e, "the environment");
    e->context = context;
    e->image = knurl_image_retain(image);
    e->intensity = intensity;
    e->cosine = cos(rotation);
    e->sine = sin(rotation);
    knurl_status status = build_importance(e, error);
    if (status != KNURL_OK) {
        environment_release(e);
        return status;
    }
    *out = e;
    return KNURL_OK;
}

void environment_release(environment *e)
{
    if (!e) return;
    knurl_image_release(e->image);
    knurl_free(e->context, e->conditional);
    knurl_free(e->context, e->marginal);
    knurl_free(e->context, e);
}

/* Largest i with cumulative[i] <= u and a cell of some width. */
static int32_t find_cell(const float *cumulative, int32_t count, double u)
{
    int32_t low = 0, high = count;
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        if ((double)cumulative[middle] <= u)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static double cell_density(const environment *e, int32_t column, int32_t row, double v)
{
    const float *cells = e->conditional + (size_t)row * (size_t)(e->columns + 1);
    double p = ((double)cells[column + 1] - (double)cells[column]) *
               ((double)e->marginal[row + 1] - (double)e->marginal[row]) * e->columns * e->rows;
    double ring = sin(WARP_PI * v);
    return ring > 0.0 ? p / (2.0 * WARP_PI * WARP_PI * ring) : 0.0;
}

double environment_pdf(const environment *e, vec3 direction)
{
    vec2 uv = direction_to_uv(e, direction);
    int32_t column = (int32_t)(uv.x * e->columns), row = (int32_t)(uv.y * e->rows);
    if (column >= e->columns) column = e->columns - 1;
    if (row >= e->rows) row = e->rows - 1;
    return cell_density(e, column, row, uv.y);
}

vec3 environment_draw(const environment *e, double u, double v, double *pdf)
{
    int32_t row = find_cell(e->marginal, e->rows, v);
    const float *cells = e->conditional + (size_t)row * (size_t)(e->columns + 1);
    int32_t column = find_cell(cells, e->columns, u);
    double width = (double)cells[column + 1] - (double)cells[column];
    double height = (double)e->marginal[row + 1] - (double)e->marginal[row];
    double x = width > 0.0 ? (u - (double)cells[column]) / width : 0.5;
    double y = height > 0.0 ? (v - (double)e->marginal[row]) / height : 0.5;
    double s = (column + x) / e->columns, t = (row + y) / e->rows;
    *pdf = cell_density(e, column, row, t);
    return uv_to_direction(e, s, t);
}
