/* fast: shell-space traversal with precomputed float frames.
 *
 * Base triangles are covered by parts, nodes of the map's blocks (bounds/blocks.h) of 16 x 16 texels or
 * more, as many as the memory budget allows; a tree of eight children per node is over them. A ray is
 * taken into a part's shell space by a few operations (fast.h), tested against the height ranges of sixteen
 * children at once, down to blocks of 4 x 4 texels, whose texels are tested together. All that is in
 * floats, with bounds on its errors, and only says which texels to look at; root.c decides in double
 * precision. Shells without a float frame, and levels of detail above 0, are searched (shell/search.h). */
#include "methods/fast/fast.h"

static const knurl_method_parameter PARAMETERS[] = {
    {"budget",
     "MiB for parts and their tree; -1: as many bytes as the map's samples; 0: whole base triangles", -1.0,
     -1.0, 1048576.0, NULL, false},
    {0}};

/* Padding of the box that rays are clipped to: more than that of the boxes in the tree. */
static const double BOUNDS_PAD = 0x1p-18;

static void fast_destroy(const shell_space *space, void *data)
{
    fast_data *fast = data;
    knurl_free(space->context, fast->patches);
    knurl_free(space->context, fast->parts);
    knurl_free(space->context, fast->fine.nodes);
    knurl_free(space->context, fast->coarse.nodes);
    knurl_free(space->context, fast);
}

void fast_set_bounds(fast_data *data, const double lower[3], const double upper[3])
{
    for (int k = 0; k < 3; k++) {
        data->lower[k] = (lower[k] - data->centre[k]) * data->scale - BOUNDS_PAD;
        data->upper[k] = (upper[k] - data->centre[k]) * data->scale + BOUNDS_PAD;
    }
}

/* Centre and scale from the shells' boxes: radius at most 1, by a power of two. */
static bool find_space(const shell_space *space, fast_data *data)
{
    vec3 lower = v3(INFINITY, INFINITY, INFINITY), upper = v3_neg(lower);
    for (uint32_t t = 0; t < space->mesh.triangle_count; t++) {
        double lo[3], hi[3];
        if (!shell_box(space, t, lo, hi)) continue;
        lower = v3_min(lower, v3_load(lo));
        upper = v3_max(upper, v3_load(hi));
    }
    data->scale = 1.0;
    if (!(lower.x <= upper.x)) return false;
    vec3 centre = v3_mad(v3_scale(lower, 0.5), 0.5, upper), half = v3_sub(upper, centre);
    double radius = v3_length(v3_max(half, v3_sub(centre, lower)));
    int exponent = 0;
    (void)frexp(radius, &exponent); /* radius < 2^exponent */
    if (radius > 0.0) data->scale = ldexp(1.0, exponent < -500 ? 500 : -exponent);
    v3_store(data->centre, centre);
    double lo[3], hi[3];
    v3_store(lo, lower);
    v3_store(hi, upper);
    fast_set_bounds(data, lo, hi);
    return true;
}

void fast_set_heights(const shell_space *space, fast_data *data)
{
    const height_blocks *blocks = data->blocks;
    double base = (space->offset + space->factor * blocks->origin) * data->scale;
    double code = space->factor * blocks->step * data->scale;
    double rounding = 0x1p-20 * (fabs(base) + 65535.0 * fabs(code));
    data->height_base = (float)base;
    data->height_code = (float)code;
    data->height_error = float_up(fabs(space->factor) * blocks->code_error * data->scale * 1.001 + rounding);
}

fast_box fast_coarse_box(const shell_space *space, const fast_data *data, uint32_t triangle)
{
    fast_box box;
    double lo[3], hi[3];
    bool some = shell_box(space, triangle, lo, hi);
    for (int k = 0; k < 3; k++) {
        double a = (lo[k] - data->centre[k]) * data->scale, b = (hi[k] - data->centre[k]) * data->scale;
        box.lower[k] = some ? float_down(a - 0.5 * BOUNDS_PAD) : INFINITY;
        box.upper[k] = some ? float_up(b + 0.5 * BOUNDS_PAD) : -INFINITY;
    }
    return box;
}

static knurl_status build_coarse(const shell_space *space, fast_data *data, knurl_error *error)
{
    uint32_t count = space->mesh.triangle_count;
    fast_box *boxes = knurl_alloc_array(space->context, count, sizeof *boxes);
    if (!boxes) return knurl_fail_memory(error, count * sizeof *boxes, "boxes");
    for (uint32_t t = 0; t < count; t++) boxes[t] = fast_coarse_box(space, data, t);
    knurl_status status = fast_tree_build(space->context, boxes, count, &data->coarse, error);
    knurl_free(space->context, boxes);
    return status;
}

static knurl_status build_structures(const shell_space *space, double budget, fast_data *data,
                                     knurl_error *error)
{
    knurl_status status = KNURL_OK;
    if (!find_space(space, data)) return status;
    data->blocks = heightmap_blocks(space->map);
    fast_set_heights(space, data);
    double bytes = budget < 0.0 ? (double)knurl_heightmap_memory(space->map).samples : budget * 1048576.0;
    /* Small maps on many triangles: a few parts each in any case. */
    if (budget < 0.0) bytes = max_d(bytes, 1024.0 * (double)space->mesh.triangle_count);
    fast_box *boxes = NULL;
    status = fast_patches_build(space, data, error);
    if (status == KNURL_OK) status = fast_cover_build(space, data, bytes, &boxes, error);
    if (status == KNURL_OK)
        status = fast_tree_build(space->context, boxes, data->part_count, &data->fine, error);
    knurl_free(space->context, boxes);
    if (status == KNURL_OK) status = build_coarse(space, data, error);
    return status;
}

static void choose_kernels(uint32_t features, fast_data *data)
{
    data->walk = fast_walk_plain;
    data->walk_many = fast_walk_many_plain;
    if (features & KNURL_CPU_AVX2) {
        data->walk = fast_walk_avx2;
        data->walk_many = fast_walk_many_avx2;
    }
    if (features & KNURL_CPU_AVX512) {
        data->walk = fast_walk_avx512;
        data->walk_many = fast_walk_many_avx512;
    }
}

static knurl_status fast_build(const shell_space *space, const double *values, void **out, knurl_error *error)
{
    fast_data *data = knurl_alloc_zero(space->context, sizeof *data);
    if (!data) return knurl_fail_memory(error, sizeof *data, "method fast");
    *out = data;
    data->wrap_u = space->wrap_u;
    data->wrap_v = space->wrap_v;
    choose_kernels(knurl_cpu_features(space->context), data);
    knurl_status status = build_structures(space, values[0], data, error);
    data->bytes = sizeof *data + space->mesh.triangle_count * sizeof(fast_patch) +
                  data->part_count * sizeof(fast_part) +
                  (data->fine.node_count + data->coarse.node_count) * sizeof(fast_node);
    return status;
}

static uint64_t fast_bytes(const void *data)
{
    return ((const fast_data *)data)->bytes;
}

/* Clips the ray to the bounds and takes it to the trees' space. */
static bool start_ray(const fast_data *data, const knurl_ray *ray, fast_ray *r)
{
    vec3 direction = v3_load(ray->direction);
    double longest = v3_max_component(v3_abs(direction));
    double length = 1.0; /* a power of two that makes it about 1 */
    if (!(longest >= 0.25 && longest <= 4.0)) length = ldexp(1.0, -ilogb(longest));
    direction = v3_scale(direction, length);
    r->rate = data->scale / length;
    vec3 origin = v3_scale(v3_sub(v3_load(ray->origin), v3_load(data->centre)), data->scale);
    vec3 inverse = v3_reciprocal(direction);
    vec3 a = v3_mul(v3_sub(v3_load(data->lower), origin), inverse);
    vec3 b = v3_mul(v3_sub(v3_load(data->upper), origin), inverse);
    vec3 near = v3_min(a, b), far = v3_max(a, b);
    double in = max_d(max_d(near.x, near.y), near.z), out = min_d(min_d(far.x, far.y), far.z);
    double slack = 1e-12 * (fabs(in) + fabs(out));
    in = max_d(in - slack, ray->tmin * r->rate);
    out = min_d(out + slack, ray->tmax * r->rate);
    if (!(in <= out)) return false;
    v3_store(r->origin, v3_mad(origin, in, direction));
    v3_store(r->direction, direction);
    r->inverse_square = 1.0 / v3_dot(direction, direction);
    r->t0 = in / r->rate;
    r->tau_min = 0.0;
    r->tau_max = (out - in) * (1.0 + 1e-12);
    return true;
}

/* False if the ray misses the surface's bounds. */
static bool start_query(const fast_data *data, const surface_query *q, fast_ray *r)
{
    r->data = data;
    r->space = q->space;
    r->lod = q->lod;
    r->ray = q->ray;
    r->memo = q->memo;
    r->any = q->any;
    r->found = false;
    r->coarse = q->lod->lod > 0.0;
    r->steps = 0;
    r->searched = UINT32_MAX;
    return data->coarse.nodes && start_ray(data, q->ray, r);
}

static void finish_query(const fast_ray *r, surface_query *q)
{
    q->steps += r->steps;
    q->found = r->found;
    if (!r->found || q->any) return;
    q->triangle = r->triangle;
    q->root = r->root;
}

static void fast_trace(const void *method_data, surface_query *q)
{
    const fast_data *data = method_data;
    fast_ray r;
    q->found = false;
    if (!start_query(data, q, &r)) return;
    data->walk(&r);
    finish_query(&r, q);
}

static void fast_trace_many(const void *method_data, surface_query *queries, size_t count)
{
    const fast_data *data = method_data;
    fast_ray rays[FAST_PACKET];
    size_t of[FAST_PACKET];
    int gathered = 0;
    for (size_t i = 0; i < count; i++) {
        queries[i].found = false;
        if (start_query(data, &queries[i], &rays[gathered])) of[gathered++] = i;
        if (gathered == FAST_PACKET || (i + 1 == count && gathered > 0)) {
            data->walk_many(rays, gathered);
            for (int k = 0; k < gathered; k++) finish_query(&rays[k], &queries[of[k]]);
            gathered = 0;
        }
    }
}

const method method_fast = {
    .name = "fast",
    .summary = "shell-space traversal in floats, roots in double precision; exact",
    .flags = KNURL_METHOD_EXACT | KNURL_METHOD_WHOLE,
    .needs = HEIGHT_NEED_BLOCKS,
    .parameters = PARAMETERS,
    .build = fast_build,
    .update = fast_update,
    .trace = fast_trace,
    .trace_many = fast_trace_many,
    .bytes = fast_bytes,
    .destroy = fast_destroy,
};
