/* Base triangles covered by parts: nodes of the map's blocks, where they lie in the triangle. */
#include "methods/fast/fast.h"

#include <stdatomic.h>
#include <string.h>

/* Padding of boxes, in the trees' space: see accel/bvh.c, whose rays have the same errors. */
static const double BOX_PAD = 0x1p-19;
/* Bytes per part, the tree's share included: a node of 224 bytes has some five children. */
static const double PART_BYTES = (double)sizeof(fast_part) + 45.0;
/* Texels of a part that is reached through the wrap mode; and the most of them that a triangle may have. */
enum { WRAPPED_SIDE = 16, MOST_WRAPPED = 4096 };
/* Part of the budget that parts of nodes may take in any case, however many wrapped ones there are. */
static const double NODES_SHARE = 0.5;

/* A part along one axis. `from` and `to` are texels that count from the map's first one, unwrapped. */
typedef struct span {
    int64_t from, to;
    int64_t corner; /* where its node begins; <= from */
    int32_t cell;   /* the same in the map */
    bool wrapped;
} span;

static int64_t floor_divide(int64_t a, int64_t b)
{
    int64_t q = a / b;
    return q * b > a ? q - 1 : q;
}

/* The span that holds texel v. */
static span span_at(int64_t v, int32_t size, int64_t side, knurl_wrap wrap)
{
    int64_t period = floor_divide(v, size), start = period * size;
    bool reflected = wrap == KNURL_WRAP_MIRROR && (period & 1) != 0;
    bool outside = wrap == KNURL_WRAP_CLAMP && period != 0;
    if (reflected || outside) {
        int64_t corner = start + (v - start) / WRAPPED_SIDE * WRAPPED_SIDE, to = corner + WRAPPED_SIDE;
        return (span){corner, to < start + size ? to : start + size, corner, 0, true};
    }
    int64_t cell = (v - start) / side * side, end = cell + side < size ? cell + side : size;
    return (span){start + cell, start + end, start + cell, (int32_t)cell, false};
}

/* A convex polygon in the frame's texels: a triangle cut by a rectangle has at most 7 corners. */
typedef struct polygon {
    double x[8], y[8];
    int count;
} polygon;

/* Keeps where sign * (coordinate - limit) <= 0. */
static void cut(polygon *p, bool along_y, double limit, double sign)
{
    polygon out = {.count = 0};
    for (int i = 0; i < p->count; i++) {
        int j = i + 1 < p->count ? i + 1 : 0;
        double a = sign * ((along_y ? p->y[i] : p->x[i]) - limit);
        double b = sign * ((along_y ? p->y[j] : p->x[j]) - limit);
        if (a <= 0.0 && out.count < 8) {
            out.x[out.count] = p->x[i];
            out.y[out.count++] = p->y[i];
        }
        if ((a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0)) {
            if (out.count == 8) continue;
            double w = a / (a - b);
            out.x[out.count] = p->x[i] + w * (p->x[j] - p->x[i]);
            out.y[out.count++] = p->y[i] + w * (p->y[j] - p->y[i]);
        }
    }
    *p = out;
}

/* Texels by which parts overlap. */
static double frame_pad(const triangle_frame *f)
{
    return 4.0 * f->texel_rounding + 1e-6;
}

/* One triangle, being covered. */
typedef struct cover {
    const shell_space *space;
    fast_data *data;
    uint32_t triangle;
    int32_t level;
    height_lod lod;
    triangle_frame frame;
    /* Where parts go; NULL to count only. */
    fast_part *parts;
    fast_box *boxes;
    uint32_t count, wrapped; /* all; those that are FAST_WRAPPED */
    /* Beyond these, of FAST_WRAPPED parts and of others, counts need not be right. */
    uint32_t most_wrapped, most;
} cover;

static bool is_full(const cover *c)
{
    return c->wrapped > c->most_wrapped || c->count - c->wrapped > c->most;
}

static void add_part(cover *c, const fast_part *part, const fast_box *box)
{
    c->parts[c->count] = *part;
    c->boxes[c->count] = *box;
    c->count++;
}

static fast_box padded(const fast_data *data, vec3 lower, vec3 upper)
{
    fast_box box;
    double lo[3], hi[3];
    v3_store(lo, v3_scale(v3_sub(lower, v3_load(data->centre)), data->scale));
    v3_store(hi, v3_scale(v3_sub(upper, v3_load(data->centre)), data->scale));
    for (int k = 0; k < 3; k++) {
        box.lower[k] = float_down(lo[k] - BOX_PAD);
        box.upper[k] = float_up(hi[k] + BOX_PAD);
    }
    return box;
}

/* The whole triangle as one part that is searched. */
static void cover_searched(cover *c)
{
    double lower[3], upper[3];
    if (!shell_box(c->space, c->triangle, lower, upper)) return;
    if (!c->parts) {
        c->count++;
        return;
    }
    fast_part part = {.patch = c->triangle,
                      .flags = FAST_SEARCHED | FAST_WHOLE,
                      .s_min = to_float(c->frame.s0 * c->data->scale),
                      .s_max = to_float(c->frame.s1 * c->data->scale)};
    fast_box box = padded(c->data, v3_load(lower), v3_load(upper));
    add_part(c, &part, &box);
}

/* Range of heights over a part; its node's children that the polygon's box does not touch do not count. */
static knurl_range part_heights(const cover *c, const fast_part *part, const polygon *p)
{
    double x0 = p->x[0], x1 = x0, y0 = p->y[0], y1 = y0;
    for (int i = 1; i < p->count; i++) {
        x0 = min_d(x0, p->x[i]);
        x1 = max_d(x1, p->x[i]);
        y0 = min_d(y0, p->y[i]);
        y1 = max_d(y1, p->y[i]);
    }
    if (part->flags & FAST_WRAPPED)
        return shell_height_range(c->space, &c->lod, KNURL_BOUNDS_MINMAX, &c->frame, x0, y0, x1, y1);
    const height_blocks *blocks = c->data->blocks;
    int level = part->level, shift = 4 + 2 * level;
    const block_node *node =
        &blocks->nodes[level][(size_t)(part->cell_y >> shift) * (size_t)blocks->columns[level] +
                              (size_t)(part->cell_x >> shift)];
    double side = (double)(1 << (shift - 2));
    unsigned low = 65535, high = 0;
    for (int k = 0; k < 16; k++) {
        double left = (double)part->corner_x + side * (double)(k & 3);
        double top = (double)part->corner_y + side * (double)(k >> 2);
        if (left > x1 || left + side < x0 || top > y1 || top + side < y0) continue;
        if (node->min[k] < low) low = node->min[k];
        if (node->max[k] > high) high = node->max[k];
    }
    double a = c->space->offset + c->space->factor * (blocks->origin + blocks->step * (double)low);
    double b = c->space->offset + c->space->factor * (blocks->origin + blocks->step * (double)high);
    double pad = fabs(c->space->factor) * blocks->code_error + 1e-14 * (fabs(a) + fabs(b));
    return (knurl_range){min_d(a, b) - pad, max_d(a, b) + pad};
}

static vec3 normal_at(const triangle_frame *f, double b1, double b2)
{
    return v3_mad(v3_mad(f->n[0], b1, f->ne), b2, f->nf);
}

/* Range of |N| over a polygon: convex, so at most that of its corners, and at least that of the plane that
 * touches it at the middle. */
static void normal_range(const triangle_frame *f, const vec3 *normals, int count, double range[2])
{
    range[0] = range[1] = 1.0;
    if (f->unnormalised) return;
    vec3 middle = v3(0.0, 0.0, 0.0);
    for (int i = 0; i < count; i++) middle = v3_mad(middle, 1.0 / (double)count, normals[i]);
    middle = v3_normalize(middle);
    range[0] = INFINITY;
    range[1] = 0.0;
    for (int i = 0; i < count; i++) {
        range[0] = min_d(range[0], v3_dot(middle, normals[i]));
        range[1] = max_d(range[1], v3_length(normals[i]));
    }
    range[0] = max_d(range[0] * (1.0 - 1e-12), 1e-3);
    range[1] *= 1.0 + 1e-12;
}

/* Where the polygon is on the part, rounded outwards. */
static void set_extent(fast_part *part, const polygon *p)
{
    double x0 = p->x[0], x1 = x0, y0 = p->y[0], y1 = y0, unit = 255.0 / (double)(16 << (2 * part->level));
    for (int i = 1; i < p->count; i++) {
        x0 = min_d(x0, p->x[i]);
        x1 = max_d(x1, p->x[i]);
        y0 = min_d(y0, p->y[i]);
        y1 = max_d(y1, p->y[i]);
    }
    const double ends[4] = {x0 - (double)part->corner_x, y0 - (double)part->corner_y,
                            x1 - (double)part->corner_x, y1 - (double)part->corner_y};
    uint8_t *const to[4] = {&part->from_x, &part->from_y, &part->to_x, &part->to_y};
    for (int i = 0; i < 4; i++) {
        double place = i < 2 ? floor_d(ends[i] * unit) : ceil_d(ends[i] * unit);
        *to[i] = place < 0.0 ? 0 : place > 255.0 ? 255 : (uint8_t)place;
    }
}

/* Height range, frame and box of a part, whose place is known. */
static fast_box measure_part(const cover *c, fast_part *part, const polygon *p)
{
    const triangle_frame *f = &c->frame;
    vec3 normals[8], points[8];
    for (int i = 0; i < p->count; i++) {
        double dx = p->x[i] - f->x[0], dy = p->y[i] - f->y[0];
        double b1 = f->inverse_uv[0] * dx + f->inverse_uv[1] * dy;
        double b2 = f->inverse_uv[2] * dx + f->inverse_uv[3] * dy;
        normals[i] = normal_at(f, b1, b2);
        points[i] = v3_add(f->base, v3_mad(v3_scale(f->pe, b1), b2, f->pf));
    }
    double n[2];
    normal_range(f, normals, p->count, n);
    knurl_range h = part_heights(c, part, p);
    double s0 = h.min < 0.0 ? h.min / n[0] : h.min / n[1], s1 = h.max > 0.0 ? h.max / n[0] : h.max / n[1];
    double pad = 1e-9 * max_d(fabs(s0), fabs(s1)) + 1e-12 * f->size;
    s0 -= pad;
    s1 += pad;
    vec3 lower = v3(INFINITY, INFINITY, INFINITY), upper = v3_neg(lower);
    for (int i = 0; i < p->count; i++) {
        vec3 a = v3_mad(points[i], s0, normals[i]), b = v3_mad(points[i], s1, normals[i]);
        lower = v3_min(lower, v3_min(a, b));
        upper = v3_max(upper, v3_max(a, b));
    }
    part->s_min = float_down(s0 * c->data->scale);
    part->s_max = float_up(s1 * c->data->scale);
    set_extent(part, p);
    /* Bounds on the curve's error (walk.h) count on this. */
    if (n[0] >= 0.5)
        fast_part_frame(c->data, f, part);
    else
        part->flags |= FAST_SEARCHED;
    return padded(c->data, lower, upper);
}

/* The triangle's part on two spans. */
static polygon cut_out(const triangle_frame *f, const span *across, const span *down)
{
    double pad = frame_pad(f);
    polygon p = {.count = 3};
    memcpy(p.x, f->x, sizeof f->x);
    memcpy(p.y, f->y, sizeof f->y);
    cut(&p, false, (double)(across->from - f->origin_x) - pad, -1.0);
    cut(&p, false, (double)(across->to - f->origin_x) + pad, 1.0);
    cut(&p, true, (double)(down->from - f->origin_y) - pad, -1.0);
    cut(&p, true, (double)(down->to - f->origin_y) + pad, 1.0);
    return p;
}

/* Only clamped maps have texels that far away, and there one is like the other. */
static int32_t unwrapped_cell(int64_t cell)
{
    const int64_t far = 1000000000;
    return (int32_t)(cell < -far ? -far : cell > far ? far : cell);
}

/* The part on two spans, if the triangle reaches it. */
static void cover_cell(cover *c, const span *across, const span *down)
{
    const triangle_frame *f = &c->frame;
    polygon p = cut_out(f, across, down);
    if (p.count == 0) return;
    bool wrapped = across->wrapped || down->wrapped;
    c->wrapped += wrapped;
    if (!c->parts) {
        c->count++;
        return;
    }
    fast_part part = {.patch = c->triangle,
                      .corner_x = (int32_t)(across->corner - f->origin_x),
                      .corner_y = (int32_t)(down->corner - f->origin_y)};
    if (wrapped) {
        part.flags = FAST_WRAPPED;
        part.cell_x = unwrapped_cell(across->corner - f->origin_x + f->wrapped_x);
        part.cell_y = unwrapped_cell(down->corner - f->origin_y + f->wrapped_y);
    } else {
        part.level = (uint8_t)c->level;
        part.cell_x = across->cell;
        part.cell_y = down->cell;
    }
    fast_box box = measure_part(c, &part, &p);
    add_part(c, &part, &box);
}

/* A wrapped axis makes parts of WRAPPED_SIDE, so the other axis must too. */
static span next_span(int64_t v, int32_t size, int64_t side, knurl_wrap wrap, bool small)
{
    span s = span_at(v, size, side, wrap);
    if (!small || s.wrapped || s.to - s.corner <= WRAPPED_SIDE) return s;
    int64_t corner = s.corner + (v - s.corner) / WRAPPED_SIDE * WRAPPED_SIDE;
    int64_t to = corner + WRAPPED_SIDE < s.to ? corner + WRAPPED_SIDE : s.to;
    return (span){corner, to, corner, 0, true};
}

/* Texels, counted from the map's first one, that a polygon is on along one axis, or nearly. */
typedef struct texel_range {
    int64_t from, to; /* both included */
} texel_range;

static texel_range texels_of(const double *at, int count, double pad, int64_t origin)
{
    double low = at[0], high = at[0];
    for (int i = 1; i < count; i++) {
        low = min_d(low, at[i]);
        high = max_d(high, at[i]);
    }
    return (texel_range){(int64_t)floor_d(low - 2.0 * pad) + origin,
                         (int64_t)floor_d(high + 2.0 * pad) + origin};
}

/* Where `across` is reached through the wrap mode and `down` is not. */
static void cover_column(cover *c, const span *across, const span *down)
{
    const triangle_frame *f = &c->frame;
    polygon p = cut_out(f, across, down);
    if (p.count == 0) return;
    texel_range y = texels_of(p.y, p.count, frame_pad(f), f->origin_y);
    int64_t side = (int64_t)16 << (2 * c->level), end = y.to < down->to ? y.to + 1 : down->to;
    for (int64_t w = y.from > down->from ? y.from : down->from; w < end && !is_full(c);) {
        span part = next_span(w, c->data->blocks->height, side, c->space->wrap_v, true);
        cover_cell(c, across, &part);
        w = part.to;
    }
}

static void cover_row(cover *c, const span *down)
{
    static const span all = {INT64_MIN / 2, INT64_MAX / 2, 0, 0, false};
    const triangle_frame *f = &c->frame;
    polygon p = cut_out(f, &all, down);
    if (p.count == 0) return;
    texel_range x = texels_of(p.x, p.count, frame_pad(f), f->origin_x);
    int64_t side = (int64_t)16 << (2 * c->level);
    for (int64_t v = x.from; v <= x.to && !is_full(c);) {
        span across = next_span(v, c->data->blocks->width, side, c->space->wrap_u, down->wrapped);
        if (across.wrapped && !down->wrapped)
            cover_column(c, &across, down);
        else
            cover_cell(c, &across, down);
        v = across.to;
    }
}

static void cover_triangle(cover *c)
{
    const triangle_frame *f = &c->frame;
    const fast_data *data = c->data;
    c->count = 0;
    c->wrapped = 0;
    if (f->flags & SHELL_EMPTY) return;
    if (data->patches[c->triangle].flags & FAST_SEARCHED || c->level < 0) {
        cover_searched(c);
        return;
    }
    texel_range y = texels_of(f->y, 3, frame_pad(f), f->origin_y);
    int64_t side = (int64_t)16 << (2 * c->level);
    for (int64_t v = y.from; v <= y.to && !is_full(c);) {
        span down = next_span(v, data->blocks->height, side, c->space->wrap_v, false);
        cover_row(c, &down);
        v = down.to;
    }
}

/* A triangle that is no longer than two parts would meet several with little of it on each: the next level
 * holds it in fewer. */
static int32_t triangle_level(const cover *c, int32_t level)
{
    const triangle_frame *f = &c->frame;
    if (level < 0) return level;
    double across = max_d(f->x[0], max_d(f->x[1], f->x[2])) - min_d(f->x[0], min_d(f->x[1], f->x[2]));
    double down = max_d(f->y[0], max_d(f->y[1], f->y[2])) - min_d(f->y[0], min_d(f->y[1], f->y[2]));
    bool small = max_d(across, down) <= (double)((int64_t)32 << (2 * level));
    return small && level + 1 < c->data->blocks->level_count ? level + 1 : level;
}

typedef struct cover_job {
    const shell_space *space;
    fast_data *data;
    int32_t level;
    uint32_t *first;             /* per triangle: counts, then where its parts begin */
    uint32_t *wrapped;           /* per triangle: how many of those are FAST_WRAPPED */
    fast_box *boxes;             /* NULL: counting */
    uint32_t most_wrapped, most; /* beyond these, per triangle and in all, counting need not go on */
    _Atomic uint64_t others;     /* parts that are not FAST_WRAPPED */
} cover_job;

static void cover_chunk(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    cover_job *job = user;
    cover c = {.space = job->space, .data = job->data, .most_wrapped = job->most_wrapped, .most = job->most};
    height_lod_make(job->space, 0.0, &c.lod);
    for (size_t t = begin; t < end && (job->boxes || job->others <= job->most); t++) {
        c.triangle = (uint32_t)t;
        triangle_frame_load(job->space, c.triangle, &c.lod, &c.frame);
        if (job->boxes) {
            c.parts = job->data->parts + job->first[t];
            c.boxes = job->boxes + job->first[t];
        }
        c.level = triangle_level(&c, job->level);
        cover_triangle(&c);
        if (job->boxes) continue;
        job->first[t] = c.count;
        job->wrapped[t] = c.wrapped;
        job->others += c.wrapped > c.most_wrapped ? 1 : c.count - c.wrapped;
    }
}

/* Whether at most so many parts of a level are not FAST_WRAPPED. All is counted then. */
static bool count_parts(cover_job *job, int32_t level, double most)
{
    job->level = level;
    job->most = most < 0x1p30 ? (uint32_t)max_d(most, 0.0) : 1u << 30;
    job->others = 0;
    knurl_parallel_for(job->space->context, job->space->mesh.triangle_count, 16, cover_chunk, job);
    return job->others <= job->most;
}

/* Counts FAST_WRAPPED parts, which are the same at every level, up to some per triangle; returns how many
 * those are: as many as there can be without taking time for what will not fit. */
static uint32_t count_wrapped(cover_job *job, double most)
{
    uint32_t triangles = job->space->mesh.triangle_count;
    for (uint32_t limit = 16;; limit *= 4) {
        double total = 0.0;
        bool all = true;
        memset(job->wrapped, 0, triangles * sizeof *job->wrapped);
        job->most_wrapped = limit;
        /* If this stops early, no level fits either. */
        count_parts(job, job->data->blocks->level_count - 1, 4.0 * most + 1024.0);
        job->most_wrapped = UINT32_MAX;
        for (uint32_t t = 0; t < triangles; t++) {
            all = all && job->wrapped[t] <= limit;
            total += min_d(job->wrapped[t], limit + 1);
        }
        if (all || total > most || limit == MOST_WRAPPED) return limit;
    }
}

/* Triangles with more FAST_WRAPPED parts than fit are searched; those with few come first. How many parts of
 * that kind are left. */
static double drop_wrapped(cover_job *job, double most)
{
    if (job->space->wrap_u == KNURL_WRAP_REPEAT && job->space->wrap_v == KNURL_WRAP_REPEAT) return 0.0;
    uint32_t triangles = job->space->mesh.triangle_count, counted = count_wrapped(job, most), limit = 0;
    double of_count[MOST_WRAPPED + 1] = {0.0}, left = 0.0, kept = 0.0;
    for (uint32_t t = 0; t < triangles; t++)
        if (job->wrapped[t] <= counted) of_count[job->wrapped[t]] += job->wrapped[t];
    while (limit < counted && left + of_count[limit + 1] <= most) left += of_count[++limit];
    /* Of those with one more, the first ones. */
    for (uint32_t t = 0; t < triangles; t++) {
        uint32_t count = job->wrapped[t];
        if (count <= limit) continue;
        if (count == limit + 1 && count <= counted && left + kept + count <= most)
            kept += count;
        else
            job->data->patches[t].flags |= FAST_SEARCHED | FAST_CROWDED;
    }
    return left + kept;
}

/* Counts parts, of the finest level at which they fit the budget, or of none: base triangles, searched. */
static void choose_parts(cover_job *job, double budget)
{
    double most = budget / PART_BYTES, wrapped = drop_wrapped(job, most);
    double others = max_d(most - wrapped, NODES_SHARE * most);
    for (int32_t level = 0; level < job->data->blocks->level_count; level++)
        if (count_parts(job, level, others)) return;
    count_parts(job, -1, 0x1p32);
}

static knurl_status fill_parts(cover_job *job, knurl_error *error)
{
    fast_data *data = job->data;
    knurl_context *context = job->space->context;
    size_t triangles = job->space->mesh.triangle_count;
    uint64_t total = 0;
    for (size_t t = 0; t < triangles; t++) {
        uint32_t count = job->first[t];
        job->first[t] = (uint32_t)total;
        total += count;
    }
    if (total >= FAST_LEAF)
        return knurl_fail(error, KNURL_ERROR_LIMIT, "method fast: %llu parts, expected under 2^31",
                          (unsigned long long)total);
    data->parts = knurl_alloc_array(context, total, sizeof *data->parts);
    job->boxes = knurl_alloc_array(context, total, sizeof *job->boxes);
    if (!data->parts || !job->boxes)
        return knurl_fail_memory(error, total * (sizeof *job->boxes + sizeof *data->parts), "parts");
    data->part_count = (uint32_t)total;
    knurl_parallel_for(context, triangles, 16, cover_chunk, job);
    return KNURL_OK;
}

knurl_status fast_cover_build(const shell_space *space, fast_data *data, double budget, fast_box **boxes,
                              knurl_error *error)
{
    knurl_context *context = space->context;
    size_t triangles = space->mesh.triangle_count;
    cover_job job = {.space = space, .data = data, .most_wrapped = UINT32_MAX, .most = UINT32_MAX};
    job.first = knurl_alloc_array(context, triangles, sizeof *job.first);
    job.wrapped = knurl_alloc_array(context, triangles, sizeof *job.wrapped);
    knurl_status status;
    if (job.first && job.wrapped) {
        choose_parts(&job, budget);
        status = fill_parts(&job, error);
    } else {
        status = knurl_fail_memory(error, 2 * triangles * sizeof *job.first, "covering triangles");
    }
    knurl_free(context, job.first);
    knurl_free(context, job.wrapped);
    *boxes = job.boxes;
    return status;
}

/* A point of the part's old box: at (x, y), in the middle of its old range of s. */
static void find_place(const cover *c, const fast_part *part, double x, double y, float place[3])
{
    const triangle_frame *f = &c->frame;
    double dx = x - f->x[0], dy = y - f->y[0], at[3];
    double b1 = f->inverse_uv[0] * dx + f->inverse_uv[1] * dy;
    double b2 = f->inverse_uv[2] * dx + f->inverse_uv[3] * dy;
    double s = 0.5 * ((double)part->s_min + (double)part->s_max) / c->data->scale;
    vec3 base = v3_sub(v3_add(f->base, v3_mad(v3_scale(f->pe, b1), b2, f->pf)), v3_load(c->data->centre));
    v3_store(at, v3_scale(v3_mad(base, s, normal_at(f, b1, b2)), c->data->scale));
    for (int k = 0; k < 3; k++) place[k] = to_float(at[k]);
}

fast_leaf fast_part_update(const shell_space *space, fast_data *data, const height_lod *lod,
                           const triangle_frame *frame, uint32_t number)
{
    fast_part *part = &data->parts[number];
    cover c = {.space = space, .data = data, .triangle = part->patch, .level = part->level, .lod = *lod};
    c.frame = *frame;
    fast_leaf leaf = {.number = number};
    if (part->flags & FAST_WHOLE) {
        find_place(&c, part, frame->x[0], frame->y[0], leaf.place);
        c.parts = part;
        c.boxes = &leaf.box;
        cover_searched(&c);
        return leaf;
    }
    bool small = (part->flags & FAST_WRAPPED) != 0;
    int64_t side = (int64_t)16 << (2 * part->level);
    span across =
        next_span(part->corner_x + frame->origin_x, data->blocks->width, side, space->wrap_u, small);
    span down = next_span(part->corner_y + frame->origin_y, data->blocks->height, side, space->wrap_v, small);
    polygon p = cut_out(frame, &across, &down);
    find_place(&c, part, p.x[0], p.y[0], leaf.place);
    leaf.box = measure_part(&c, part, &p);
    return leaf;
}
