/* The public surface: mesh, map and method together. */
#include "methods/method.h"
#include "shell/curve.h"
#include "shell/near.h"
#include "shell/evaluate.h"

#include <string.h>

struct knurl_surface {
    shell_space space;
    atomic_size_t references;
    const method *method;
    void *data;  /* the method's own */
    vec3 centre; /* a ball that holds all shells */
    double radius;
    knurl_surface_info info;
};

knurl_displacement knurl_displacement_default(void)
{
    return (knurl_displacement){.cookie = KNURL_COOKIE, .factor = 1.0, .uv_scale = {1.0, 1.0}};
}

knurl_surface_def knurl_surface_def_default(void)
{
    return (knurl_surface_def){
        .cookie = KNURL_COOKIE, .displacement = knurl_displacement_default(), .method = "rmip"};
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
    return b.samples + b.levels + b.minmax + b.rmip;
}

static void fill_info(knurl_surface *surface, uint64_t replaced)
{
    const shell_space *space = &surface->space;
    knurl_surface_info *info = &surface->info;
    *info = (knurl_surface_info){.triangles = space->mesh.triangle_count, .replaced_normals = replaced};
    vec3 lower = v3(INFINITY, INFINITY, INFINITY), upper = v3_neg(lower);
    double texels = 0.0, h0 = INFINITY, h1 = -INFINITY;
    height_lod lod;
    height_lod_make(space, 0.0, &lod);
    for (uint32_t t = 0; t < space->mesh.triangle_count; t++) {
        const shell *stored = &space->shells[t];
        info->folded += (stored->flags & SHELL_FOLDED) != 0;
        info->flat_uv += (stored->flags & SHELL_FLAT_UV) != 0;
        info->degenerate += (stored->flags & SHELL_EMPTY) != 0;
        double lo[3], hi[3];
        if (!shell_box(space, t, lo, hi)) continue;
        triangle_frame f;
        triangle_frame_load(space, t, &lod, &f);
        texels += 0.5 * fabs(f.xe * f.yf - f.xf * f.ye);
        lower = v3_min(lower, v3_load(lo));
        upper = v3_max(upper, v3_load(hi));
        h0 = min_d(h0, (double)stored->height_min);
        h1 = max_d(h1, (double)stored->height_max);
    }
    bool some = lower.x <= upper.x;
    surface->centre = some ? v3_scale(v3_add(lower, upper), 0.5) : v3(0.0, 0.0, 0.0);
    surface->radius = some ? 0.5 * v3_length(v3_sub(upper, lower)) * (1.0 + 1e-12) : 0.0;
    v3_store(info->lower, lower);
    v3_store(info->upper, upper);
    info->height_min = h0 <= h1 ? h0 : 0.0;
    info->height_max = h0 <= h1 ? h1 : 0.0;
    info->texels = texels;
    info->seam_edges = shell_seam_edges(space);
    info->mesh_bytes = (uint64_t)space->mesh.vertex_count * 32 + (uint64_t)space->mesh.triangle_count * 12;
    info->shell_bytes = (uint64_t)space->mesh.triangle_count * sizeof(shell) +
                        (surface->method->bytes ? surface->method->bytes(surface->data) : 0);
    info->map_bytes = map_bytes(space->map);
    /* Two triangles per texel at the 85 bytes per triangle that Embree 3.13 was measured to need. */
    info->tessellated_bytes = (uint64_t)(170.0 * texels);
}

/* Heights are stored as floats and enter products with positions, which have the same limit. */
static knurl_status check_heights(const shell_space *space, knurl_error *error)
{
    knurl_range r = knurl_heightmap_range(space->map);
    double most = fabs(space->offset) + fabs(space->factor) * max_d(fabs(r.min), fabs(r.max));
    if (most < 1e18) return KNURL_OK;
    return knurl_fail(
        error, KNURL_ERROR_ARGUMENT,
        "displacement reaches %g (offset %g, factor %g, map from %g to %g), expected below 1e18", most,
        space->offset, space->factor, r.min, r.max);
}

static knurl_status make_data(knurl_surface *surface, const double *values, knurl_error *error)
{
    if (!surface->method->build) return KNURL_OK;
    return surface->method->build(&surface->space, values, &surface->data, error);
}

static void destroy_data(knurl_surface *surface)
{
    if (surface->data && surface->method->destroy)
        surface->method->destroy(&surface->space, surface->data);
    else
        knurl_free(surface->space.context, surface->data);
}

static knurl_status make_space(knurl_surface *surface, const knurl_surface_def *def, const double *values,
                               uint64_t *replaced, knurl_error *error)
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
    if (status == KNURL_OK) status = check_heights(space, error);
    if (status == KNURL_OK) status = shell_space_build(space, error);
    if (status == KNURL_OK) status = make_data(surface, values, error);
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
    knurl_status status = method_parse(def->method ? def->method : "rmip", &found, values, error);
    if (status == KNURL_OK) status = check_displacement(&def->displacement, error);
    if (status != KNURL_OK) return status;
    knurl_surface *made = knurl_alloc_zero(context, sizeof *made);
    if (!made) return knurl_fail_memory(error, sizeof *made, "a surface");
    made->space.context = knurl_context_retain(context);
    made->method = found;
    atomic_init(&made->references, 1);
    uint64_t replaced = 0;
    status = make_space(made, def, values, &replaced, error);
    if (status != KNURL_OK) {
        knurl_surface_release(made);
        return status;
    }
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
    destroy_data(surface);
    knurl_free(context, surface->space.shells);
    base_mesh_free(context, &surface->space.mesh);
    knurl_heightmap_release(surface->space.map);
    knurl_free(context, surface);
    knurl_context_release(context);
}

uint32_t knurl_surface_shell_count(const knurl_surface *surface)
{
    return surface->space.mesh.triangle_count;
}

bool knurl_surface_shell_bounds(const knurl_surface *surface, uint32_t shell_index, float lower[3],
                                float upper[3])
{
    double lo[3], hi[3];
    if (!shell_box(&surface->space, shell_index, lo, hi)) return false;
    for (int i = 0; i < 3; i++) {
        lower[i] = nextafterf((float)lo[i], -INFINITY);
        upper[i] = nextafterf((float)hi[i], INFINITY);
    }
    return true;
}

static bool query(const knurl_surface *surface, uint32_t triangle, const knurl_ray *ray, bool any,
                  knurl_hit *hit)
{
    const shell_space *space = &surface->space;
    if (space->shells[triangle].flags & SHELL_EMPTY) return false;
    near_ray near;
    if (!near_ray_make(ray, surface->centre, surface->radius, &near)) return false;
    height_lod lod;
    triangle_frame frame;
    shell_root root;
    uint32_t steps = 0;
    triangle_frame_load_shape(space, triangle, &frame);
    if ((surface->method->flags & KNURL_METHOD_EXACT) && ray_misses_prism(&frame, near.ray)) return false;
    height_lod_make(space, (double)ray->lod, &lod);
    triangle_frame_load_texels(space, triangle, &lod, &frame);
    method_query q = {space, &lod, &frame, near.ray, any, &root, &steps};
    bool found = surface->method->intersect(surface->data, &q);
    found = found && isfinite(near_ray_caller_t(&near, root.t));
    if (!hit) return found;
    hit->steps += steps;
    if (found) {
        shell_hit_fill(space, &lod, &frame, triangle, near.ray, &root, hit);
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
    height_lod lod;
    triangle_frame frame;
    shell_root root;
    surface->method->locate(surface->data, found, &place);
    height_lod_make(space, 0.0, &lod);
    triangle_frame_load(space, place.triangle, &lod, &frame);
    shell_root_at(space, &lod, &frame, place.b1, place.b2, found->t, &root);
    shell_hit_fill(space, &lod, &frame, place.triangle, ray, &root, hit);
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
