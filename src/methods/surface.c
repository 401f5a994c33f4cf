/* The public surface: mesh, map and method together. */
#include "methods/surface.h"

#include "bounds/blocks.h"
#include "shell/curve.h"
#include "shell/near.h"
#include "shell/evaluate.h"

#include <string.h>

knurl_displacement knurl_displacement_default(void)
{
    return (knurl_displacement){.cookie = KNURL_COOKIE, .factor = 1.0, .uv_scale = {1.0, 1.0}};
}

knurl_surface_def knurl_surface_def_default(void)
{
    return (knurl_surface_def){
        .cookie = KNURL_COOKIE, .displacement = knurl_displacement_default(), .method = "fast"};
}

knurl_ray knurl_ray_make(const double origin[3], const double direction[3])
{
    knurl_ray ray = {.tmax = INFINITY, .mask = UINT32_MAX};
    memcpy(ray.origin, origin, sizeof ray.origin);
    memcpy(ray.direction, direction, sizeof ray.direction);
    return ray;
}

static knurl_status check_displacement(const knurl_displacement *d, knurl_error *error)
{
    const struct {
        const char *name;
        double value;
    } fields[] = {
        {"factor", d->factor},
        {"offset", d->offset},
        {"uv_offset[0]", d->uv_offset[0]},
        {"uv_offset[1]", d->uv_offset[1]},
        {"uv_scale[0]", d->uv_scale[0]},
        {"uv_scale[1]", d->uv_scale[1]},
        {"uv_rotation", d->uv_rotation},
    };
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++)
        if (!(fabs(fields[i].value) < 1e18))
            return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                              "displacement %s is %g, expected a finite number below 1e18", fields[i].name,
                              fields[i].value);
    if (d->wrap_u > KNURL_WRAP_CLAMP || d->wrap_v > KNURL_WRAP_CLAMP)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "wrap modes are %u and %u, expected at most %d",
                          (unsigned)d->wrap_u, (unsigned)d->wrap_v, KNURL_WRAP_CLAMP);
    return KNURL_OK;
}

/* KHR_texture_transform: uv' = translation * rotation * scale * uv, with the rotation matrix
 * [cos r, sin r; -sin r, cos r] of the extension's text. */
static void set_uv_transform(const knurl_displacement *d, double uv[6])
{
    double c = cos(d->uv_rotation), s = sin(d->uv_rotation);
    uv[0] = c * d->uv_scale[0];
    uv[1] = s * d->uv_scale[1];
    uv[2] = d->uv_offset[0];
    uv[3] = -s * d->uv_scale[0];
    uv[4] = c * d->uv_scale[1];
    uv[5] = d->uv_offset[1];
}

/* A surface without a map has one texel of value 0: h = offset. */
static knurl_status make_flat_map(knurl_context *context, knurl_heightmap **map, knurl_error *error)
{
    knurl_heightmap_def def = knurl_heightmap_def_default();
    knurl_image *image = NULL;
    knurl_status status = knurl_image_create(context, 1, 1, 1, KNURL_PIXEL_U8, NULL, &image, error);
    if (status != KNURL_OK) return status;
    def.image = image;
    status = knurl_heightmap_create(context, &def, map, error);
    knurl_image_release(image);
    return status;
}

static uint64_t map_bytes(const knurl_heightmap *map)
{
    knurl_heightmap_bytes b = knurl_heightmap_memory(map);
    return b.samples + b.levels + b.minmax + b.rmip + b.blocks;
}

void surface_set_totals(knurl_surface *surface)
{
    const shell_space *space = &surface->space;
    const shell_totals *totals = &surface->totals;
    knurl_surface_info *info = &surface->info;
    info->folded = totals->folded;
    info->flat_uv = totals->flat_uv;
    info->degenerate = totals->degenerate;
    vec3 lower = v3_load(totals->lower), upper = v3_load(totals->upper);
    bool some = lower.x <= upper.x, heights = totals->height_min <= totals->height_max;
    surface->centre = some ? v3_scale(v3_add(lower, upper), 0.5) : v3(0.0, 0.0, 0.0);
    surface->radius = some ? 0.5 * v3_length(v3_sub(upper, lower)) * (1.0 + 1e-12) : 0.0;
    memcpy(info->lower, totals->lower, sizeof info->lower);
    memcpy(info->upper, totals->upper, sizeof info->upper);
    info->height_min = heights ? totals->height_min : 0.0;
    info->height_max = heights ? totals->height_max : 0.0;
    info->texels = totals->texels;
    info->shell_bytes = (uint64_t)space->mesh.triangle_count * sizeof(shell) +
                        (surface->method->bytes ? surface->method->bytes(surface->data) : 0);
    /* Two triangles per texel at the 85 bytes per triangle that Embree 3.13 was measured to need. */
    info->tessellated_bytes = (uint64_t)(170.0 * totals->texels);
}

/* Level of detail 0, read from the method's tiles if it made such and they hold the samples as they are. */
static void make_finest(knurl_surface *surface)
{
    height_lod_make(&surface->space, 0.0, &surface->finest);
    const height_blocks *blocks = heightmap_blocks(surface->space.map);
    if (!(surface->method->needs & HEIGHT_NEED_BLOCKS) || !blocks ||
        surface->finest.level[0]->format == KNURL_PIXEL_F32)
        return;
    surface->tiled = *surface->finest.level[0];
    surface->tiled.tiles = blocks->tiles;
    surface->tiled.tile_columns = blocks->tile_columns;
    surface->finest.level[0] = &surface->tiled;
}

static void fill_info(knurl_surface *surface, uint64_t replaced)
{
    const shell_space *space = &surface->space;
    knurl_surface_info *info = &surface->info;
    *info = (knurl_surface_info){.triangles = space->mesh.triangle_count, .replaced_normals = replaced};
    info->seam_edges = shell_seam_edges(space);
    info->mesh_bytes = (uint64_t)space->mesh.vertex_count * 32 + (uint64_t)space->mesh.triangle_count * 12;
    make_finest(surface);
    shell_totals_make(space, &surface->totals);
    surface_set_totals(surface);
}

/* Heights are stored as floats and enter products with positions, which have the same limit. */
knurl_status surface_check_heights(const shell_space *space, knurl_error *error)
{
    knurl_range r = knurl_heightmap_range(space->map);
    double most = fabs(space->offset) + fabs(space->factor) * max_d(fabs(r.min), fabs(r.max));
    if (most < 1e18) return KNURL_OK;
    return knurl_fail(
        error, KNURL_ERROR_ARGUMENT,
        "displacement reaches %g (offset %g, factor %g, map from %g to %g), expected below 1e18", most,
        space->offset, space->factor, r.min, r.max);
}

knurl_status surface_make_data(const knurl_surface *surface, void **data, knurl_error *error)
{
    *data = NULL;
    if (!surface->method->build) return KNURL_OK;
    return surface->method->build(&surface->space, surface->values, data, error);
}

void surface_destroy_data(const knurl_surface *surface, void *data)
{
    if (data && surface->method->destroy)
        surface->method->destroy(&surface->space, data);
    else
        knurl_free(surface->space.context, data);
}

static knurl_status make_space(knurl_surface *surface, const knurl_surface_def *def, uint64_t *replaced,
                               knurl_error *error)
{
    shell_space *space = &surface->space;
    const knurl_displacement *d = &def->displacement;
    knurl_status status = base_mesh_copy(space->context, &def->mesh, &space->mesh, replaced, error);
    if (status != KNURL_OK) return status;
    space->factor = d->factor;
    space->offset = d->offset;
    space->wrap_u = d->wrap_u;
    space->wrap_v = d->wrap_v;
    space->unnormalised =
        d->unnormalised || def->mesh.directions || (surface->method->flags & KNURL_METHOD_UNNORMALISED);
    space->directions = def->mesh.directions != NULL;
    set_uv_transform(d, space->uv);
    if (d->map)
        space->map = knurl_heightmap_retain(d->map);
    else
        status = make_flat_map(space->context, &space->map, error);
    if (status == KNURL_OK) status = surface_check_heights(space, error);
    if (status == KNURL_OK) status = heightmap_need(space->map, surface->method->needs, error);
    space->bounds = surface->method->needs & HEIGHT_NEED_RMIP ? KNURL_BOUNDS_RMIP : KNURL_BOUNDS_MINMAX;
    if (status == KNURL_OK) status = shell_space_build(space, error);
    if (status == KNURL_OK) status = surface_make_data(surface, &surface->data, error);
    return status;
}

knurl_status knurl_surface_create(knurl_context *context, const knurl_surface_def *def,
                                  knurl_surface **surface, knurl_error *error)
{
    if (!surface) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "surface is NULL");
    *surface = NULL;
    if (!context || !def || def->cookie != KNURL_COOKIE || def->displacement.cookie != KNURL_COOKIE)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "surface definition was not made by knurl_surface_def_default()");
    const method *found = NULL;
    double values[METHOD_MAX_PARAMETERS];
    knurl_status status = method_parse(def->method ? def->method : "fast", &found, values, error);
    if (status == KNURL_OK) status = check_displacement(&def->displacement, error);
    if (status != KNURL_OK) return status;
    knurl_surface *made = knurl_alloc_zero(context, sizeof *made);
    if (!made) return knurl_fail_memory(error, sizeof *made, "a surface");
    made->space.context = knurl_context_retain(context);
    made->method = found;
    memcpy(made->values, values, sizeof values);
    atomic_init(&made->references, 1);
    uint64_t replaced = 0;
    status = make_space(made, def, &replaced, error);
    if (status != KNURL_OK) {
        knurl_surface_release(made);
        return status;
    }
    made->scale = heightmap_scale(made->space.map);
    fill_info(made, replaced);
    if (replaced)
        knurl_log(context, KNURL_LOG_WARNING, "%llu vertices had no usable normal and were given smooth ones",
                  (unsigned long long)replaced);
    *surface = made;
    return KNURL_OK;
}

knurl_surface *knurl_surface_retain(knurl_surface *surface)
{
    if (surface) atomic_fetch_add_explicit(&surface->references, 1, memory_order_relaxed);
    return surface;
}

void knurl_surface_release(knurl_surface *surface)
{
    if (!surface || atomic_fetch_sub_explicit(&surface->references, 1, memory_order_acq_rel) != 1) return;
    knurl_context *context = surface->space.context;
    surface_destroy_data(surface, surface->data);
    knurl_free(context, surface->space.shells);
    base_mesh_free(context, &surface->space.mesh);
    knurl_heightmap_release(surface->space.map);
    knurl_free(context, surface);
    knurl_context_release(context);
}

static bool is_whole(const knurl_surface *surface)
{
    return (surface->method->flags & KNURL_METHOD_WHOLE) != 0;
}

uint32_t knurl_surface_shell_count(const knurl_surface *surface)
{
    return is_whole(surface) ? 1 : surface->space.mesh.triangle_count;
}

bool knurl_surface_shell_bounds(const knurl_surface *surface, uint32_t shell_index, float lower[3],
                                float upper[3])
{
    double lo[3], hi[3];
    if (is_whole(surface)) {
        memcpy(lo, surface->info.lower, sizeof lo);
        memcpy(hi, surface->info.upper, sizeof hi);
        if (!(lo[0] <= hi[0])) return false;
    } else if (!shell_box(&surface->space, shell_index, lo, hi)) {
        return false;
    }
    for (int i = 0; i < 3; i++) {
        lower[i] = nextafterf((float)lo[i], -INFINITY);
        upper[i] = nextafterf((float)hi[i], INFINITY);
    }
    return true;
}

/* The ray's level of detail; `made` is room for one. */
static const height_lod *ray_lod(const knurl_surface *surface, const knurl_ray *ray, height_lod *made)
{
    if (!(ray->lod > 0.0f)) return &surface->finest;
    height_lod_make(&surface->space, (double)ray->lod, made);
    return made;
}

/* The hit of a query that found one; false if its t is beyond numbers. */
static bool fill_whole(surface_query *q, const near_ray *near, knurl_hit *hit)
{
    double t = near_ray_caller_t(near, q->root.t);
    if (!isfinite(t)) return false;
    const triangle_frame *frame = frame_recall(q->memo, q->space, q->lod, q->triangle);
    shell_hit_fill(q->space, q->lod, frame, q->triangle, near->ray, &q->root, hit);
    hit->t = t;
    hit->object = hit->instance = 0;
    return true;
}

static bool query_whole(const knurl_surface *surface, const knurl_ray *ray, bool any, knurl_hit *hit)
{
    near_ray near;
    if (!near_ray_make(ray, surface->centre, surface->radius, &near)) return false;
    height_lod made;
    frame_memo memo;
    memo.triangle = UINT32_MAX;
    surface_query q;
    q.space = &surface->space;
    q.lod = ray_lod(surface, ray, &made);
    q.ray = near.ray;
    q.memo = &memo;
    q.any = any;
    q.steps = 0;
    surface->method->trace(surface->data, &q);
    if (!hit) return q.found;
    hit->steps += q.steps;
    return q.found && fill_whole(&q, &near, hit);
}

static bool query(const knurl_surface *surface, uint32_t triangle, const knurl_ray *ray, bool any,
                  knurl_hit *hit)
{
    const shell_space *space = &surface->space;
    if (is_whole(surface)) return query_whole(surface, ray, any, hit);
    if (space->shells[triangle].flags & SHELL_EMPTY) return false;
    near_ray near;
    if (!near_ray_make(ray, surface->centre, surface->radius, &near)) return false;
    height_lod made;
    triangle_frame frame;
    shell_root root;
    uint32_t steps = 0;
    triangle_frame_load_shape(space, triangle, &frame);
    if ((surface->method->flags & KNURL_METHOD_EXACT) && ray_misses_prism(&frame, near.ray)) return false;
    const height_lod *lod = ray_lod(surface, ray, &made);
    triangle_frame_load_texels(space, triangle, lod, &frame);
    method_query q = {space, lod, &frame, near.ray, any, &root, &steps};
    bool found = surface->method->intersect(surface->data, &q);
    found = found && isfinite(near_ray_caller_t(&near, root.t));
    if (!hit) return found;
    hit->steps += steps;
    if (found) {
        shell_hit_fill(space, lod, &frame, triangle, near.ray, &root, hit);
        hit->t = near_ray_caller_t(&near, root.t);
        hit->object = hit->instance = 0;
    }
    return found;
}

bool knurl_surface_intersect(const knurl_surface *surface, uint32_t shell_index, const knurl_ray *ray,
                             knurl_hit *hit)
{
    return query(surface, shell_index, ray, false, hit);
}

bool knurl_surface_occluded(const knurl_surface *surface, uint32_t shell_index, const knurl_ray *ray)
{
    return query(surface, shell_index, ray, true, NULL);
}

enum { QUERY_GROUP = 32 };

/* Rays at level of detail 0 of a whole surface, up to QUERY_GROUP of them; `of` are their numbers. */
static void query_group(const knurl_surface *surface, frame_memo *memo, const near_ray *near,
                        const uint8_t *of, size_t count, bool any, knurl_hit *hits, bool *found)
{
    surface_query queries[QUERY_GROUP];
    for (size_t k = 0; k < count; k++) {
        surface_query *q = &queries[k];
        q->space = &surface->space;
        q->lod = &surface->finest;
        q->ray = near[k].ray;
        q->memo = memo;
        q->any = any;
        q->steps = 0;
    }
    surface->method->trace_many(surface->data, queries, count);
    for (size_t k = 0; k < count; k++) {
        found[of[k]] = queries[k].found;
        if (!hits) continue;
        hits[of[k]].steps = queries[k].steps;
        if (queries[k].found) found[of[k]] = fill_whole(&queries[k], &near[k], &hits[of[k]]);
    }
}

static void query_many(const knurl_surface *surface, uint32_t shell_index, const knurl_ray *rays,
                       size_t count, bool any, knurl_hit *hits, bool *found)
{
    bool together = is_whole(surface) && surface->method->trace_many;
    frame_memo memo;
    memo.triangle = UINT32_MAX;
    for (size_t begin = 0; begin < count; begin += QUERY_GROUP) {
        near_ray near[QUERY_GROUP];
        uint8_t of[QUERY_GROUP];
        size_t some = 0, end = begin + QUERY_GROUP < count ? begin + QUERY_GROUP : count;
        for (size_t i = begin; i < end; i++) {
            if (hits) hits[i].steps = 0;
            if (!together || rays[i].lod > 0.0f) {
                found[i] = query(surface, shell_index, &rays[i], any, hits ? &hits[i] : NULL);
                continue;
            }
            found[i] = false;
            if (near_ray_make(&rays[i], surface->centre, surface->radius, &near[some]))
                of[some++] = (uint8_t)(i - begin);
        }
        if (some > 0)
            query_group(surface, &memo, near, of, some, any, hits ? hits + begin : NULL, found + begin);
    }
}

void knurl_surface_intersect_many(const knurl_surface *surface, uint32_t shell_index, const knurl_ray *rays,
                                  size_t count, knurl_hit *hits, bool *found)
{
    query_many(surface, shell_index, rays, count, false, hits, found);
}

void knurl_surface_occluded_many(const knurl_surface *surface, uint32_t shell_index, const knurl_ray *rays,
                                 size_t count, bool *found)
{
    query_many(surface, shell_index, rays, count, true, NULL, found);
}

double knurl_surface_cone_lod(const knurl_surface *surface, const knurl_ray *ray, double t)
{
    double width = (double)ray->cone_width + t * (double)ray->cone_spread;
    double lod =
        width > 0.0 && surface->space.texel_size > 0.0 ? log2(width / surface->space.texel_size) : 0.0;
    double last = (double)(surface->space.map->level_count - 1);
    lod = max_d(lod, (double)ray->lod);
    return lod < 0.0 ? 0.0 : lod > last ? last : lod;
}

void knurl_surface_get_info(const knurl_surface *surface, knurl_surface_info *info)
{
    *info = surface->info;
    info->map_bytes = map_bytes(surface->space.map); /* other surfaces may have added to it */
}

uint32_t knurl_surface_flags(const knurl_surface *surface)
{
    return surface->method->flags;
}

const native_mesh *knurl_surface_native(const knurl_surface *surface)
{
    return surface->method->native ? surface->method->native(surface->data) : NULL;
}

void knurl_surface_native_hit(const knurl_surface *surface, const knurl_ray *ray, const native_hit *found,
                              knurl_hit *hit)
{
    const shell_space *space = &surface->space;
    native_place place;
    const height_lod *lod = &surface->finest;
    triangle_frame frame;
    shell_root root;
    surface->method->locate(surface->data, found, &place);
    triangle_frame_load(space, place.triangle, lod, &frame);
    shell_root_at(space, lod, &frame, place.b1, place.b2, found->t, &root);
    shell_hit_fill(space, lod, &frame, place.triangle, ray, &root, hit);
    /* The way from the facet to S is in the error already; facets are in float. */
    hit->error += 0x1p-21 / surface->method->native(surface->data)->scale;
    hit->steps = 0;
}

const shell_space *knurl_surface_space(const knurl_surface *surface)
{
    return &surface->space;
}

const knurl_heightmap *knurl_surface_map(const knurl_surface *surface)
{
    return surface->space.map;
}
