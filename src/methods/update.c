/* A surface after an edit of its map. */
#include "methods/surface.h"

static knurl_status check(const knurl_surface *surface, const height_rect *r, knurl_error *error)
{
    if (!surface) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "surface update: surface is NULL");
    const height_level *level = &surface->space.map->levels[0];
    if (r->x0 < 0 || r->y0 < 0 || r->x1 < 0 || r->y1 < 0 || r->x1 > level->width - r->x0 ||
        r->y1 > level->height - r->y0)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "surface update: rectangle of %d x %d texels at (%d, %d), expected one inside the "
                          "map's %d x %d",
                          r->x1, r->y1, r->x0, r->y0, level->width, level->height);
    return KNURL_OK;
}

/* The old data go only when the new are there. */
static knurl_status rebuild_data(knurl_surface *surface, knurl_error *error)
{
    void *data = NULL;
    knurl_status status = surface_make_data(surface, &data, error);
    void *unwanted = status == KNURL_OK ? surface->data : data;
    if (status == KNURL_OK) surface->data = data;
    surface_destroy_data(surface, unwanted);
    return status;
}

static knurl_status update_data(knurl_surface *surface, const method_edit *edit, knurl_error *error)
{
    bool rebuild = surface->stale || !surface->method->update;
    if (!rebuild) {
        knurl_status status = surface->method->update(&surface->space, edit, surface->data, &rebuild, error);
        if (status != KNURL_OK) return status;
    }
    return rebuild ? rebuild_data(surface, error) : KNURL_OK;
}

/* The scale of float maps follows the range of their samples. */
static bool has_scale(const knurl_heightmap *map, const cell_scale *scale)
{
    return map->levels[0].format != KNURL_PIXEL_F32 ||
           (scale->step == map->code_step && scale->range_min == map->range_min &&
            scale->range_max == map->range_max);
}

static knurl_status update_all(knurl_surface *surface, height_rect samples, uint8_t *changed,
                               knurl_error *error)
{
    shell_space *space = &surface->space;
    const height_level *level = &space->map->levels[0];
    knurl_status status = surface_check_heights(space, error);
    if (status != KNURL_OK) return status;
    bool all = surface->stale || !has_scale(space->map, &surface->scale);
    if (all) samples = (height_rect){0, 0, level->width, level->height};
    shell_edit shells;
    shell_edit_make(space, samples, all, &shells);
    method_edit edit = {samples, changed, false, surface->totals.lower, surface->totals.upper};
    status = shell_space_update(space, &shells, &surface->totals, changed, &edit.other_flags, error);
    if (status == KNURL_OK) status = update_data(surface, &edit, error);
    surface_set_totals(surface);
    return status;
}

knurl_status knurl_surface_update(knurl_surface *surface, int32_t x, int32_t y, int32_t width, int32_t height,
                                  knurl_error *error)
{
    height_rect samples = {x, y, width, height};
    knurl_status status = check(surface, &samples, error);
    if (status != KNURL_OK || (!surface->stale && (width == 0 || height == 0))) return status;
    samples = (height_rect){x, y, x + width, y + height};
    knurl_context *context = surface->space.context;
    size_t count = surface->space.mesh.triangle_count;
    uint8_t *changed = knurl_alloc_zero(context, count);
    status = changed ? update_all(surface, samples, changed, error)
                     : knurl_fail_memory(error, count, "updating a surface");
    knurl_free(context, changed);
    surface->stale = status != KNURL_OK;
    if (status == KNURL_OK) surface->scale = heightmap_scale(surface->space.map);
    return status;
}
