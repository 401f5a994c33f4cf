/* Kolb, Rezk-Salama: "Efficient Empty Space Skipping for Per-Pixel Displacement Mapping", VMV 2005: safety
 * zones above and below the surface shorten the ray's segment from both ends (section 3.3), then it is
 * sampled regularly and the hit is narrowed by the "bisection" of section 3.1, which is false position.
 *
 * Where the paper is silent, or this differs:
 * - entry and exit are those of the prism with bilinear sides (shell/segment.h), not of three tetrahedra; any
 *   base triangle, frusta included: places along the ray are fractions of t, and the box and the height that
 *   end a zone are met in closed form there;
 * - an entry below the surface is not culled (step 1): the ray then looks for the first point above it,
 *   with dilation and erosion changing places, because both sides of a surface can be hit here;
 * - box sizes (section 5) are the delta of the formulas: half the side of the box, by the map's width and
 *   height separately;
 * - zones are stored per texel for all points in it, so that the nearest texel's entry is safe where a
 * filtered texture lookup would not be; values are 8-bit as in an RGBA texture, rounded outwards;
 * - a pair of forward and backward skips is one of `skips`;
 * - `samples` counts per unit of length in prism coordinates, (u, v) and the map's value (the caption of
 *   Figure 10), at most 65,536 per stretch. Samples lie at the same places whatever was skipped, so
 *   that skipping changes the work and never the hit;
 * - the hit is the last point of the search, not moved onto the surface;
 * - level of detail: samples read any, blended ones included; zones of level 0 serve all, with their boxes
 *   narrowed by what a coarser level mixes in (heightmap_lod_margin());
 * - folded shells, and rays that cannot be followed, go to shell_subdivide(). */
#include "methods/empty_skip/zones.h"
#include "methods/method.h"
#include "shell/segment_walk.h"

static const knurl_method_parameter PARAMETERS[] = {
    {"skips", "pairs of a forward and a backward skip (section 3.3)", 2.0, 0.0, 2.0, NULL, true},
    {"samples", "per unit of length in (u, v, map value) (section 5)", 75.0, 1.0, 65536.0, NULL, true},
    {"bisections", "false position steps after the samples (section 3.1)", 2.0, 0.0, 64.0, NULL, true},
    {0}};

enum { MOST_SAMPLES = 65536 };

typedef struct skip_data {
    zone_map zones;
    int skips, bisections;
    double samples;
} skip_data;

static void empty_skip_destroy(const shell_space *space, void *data)
{
    skip_data *d = data;
    zone_map_free(space->context, &d->zones);
    knurl_free(space->context, d);
}

static knurl_status empty_skip_build(const shell_space *space, const double *values, void **data,
                                     knurl_error *error)
{
    skip_data *d = knurl_alloc_zero(space->context, sizeof *d);
    *data = d;
    if (!d) return knurl_fail_memory(error, sizeof *d, "method empty-skip");
    d->skips = (int)values[0];
    d->samples = values[1];
    d->bisections = (int)values[2];
    return d->skips > 0 ? zone_map_make(space, &d->zones, error) : KNURL_OK;
}

static uint64_t empty_skip_bytes(const void *data)
{
    const skip_data *d = data;
    if (!d) return 0;
    return sizeof *d + (uint64_t)d->zones.width * (uint64_t)d->zones.height * sizeof(zone_texel);
}

/* One segment being searched. */
typedef struct search {
    const skip_data *data;
    segment_walk walk;
    double box[ZONE_CHANNELS][2]; /* half sizes in the frame's texels; negative: of no use */
} search;

/* A zone holds at the level of detail of the query only as far inside its box as a coarser level
 * cannot mix in samples from outside. */
static void set_boxes(search *s)
{
    const height_lod *lod = s->walk.lod;
    double margin[2];
    heightmap_lod_margin(s->walk.space->map, lod->lod, margin);
    for (int c = 0; c < ZONE_CHANNELS; c++) {
        s->box[c][0] = (ZONE_SIZES[c] * (double)s->data->zones.width - margin[0]) / lod->to_map[0];
        s->box[c][1] = (ZONE_SIZES[c] * (double)s->data->zones.height - margin[1]) / lod->to_map[1];
    }
}

static const zone_texel *zones_at(const search *s, const segment_point *p)
{
    const shell_space *space = s->walk.space;
    const zone_map *z = &s->data->zones;
    const triangle_frame *f = s->walk.frame;
    double x = (p->x + (double)f->origin_x + 0.5) * s->walk.lod->to_map[0] - 0.5;
    double y = (p->y + (double)f->origin_y + 0.5) * s->walk.lod->to_map[1] - 0.5;
    size_t column = (size_t)height_wrap((int64_t)floor_d(x + 0.5), z->width, space->wrap_u);
    size_t row = (size_t)height_wrap((int64_t)floor_d(y + 0.5), z->height, space->wrap_v);
    return &z->texels[row * (size_t)z->width + column];
}

/* Height that the zone of a channel ends at, for rays above (dilation) or below (erosion) the surface. */
static double zone_height(const search *s, const zone_texel *texel, int c, bool above)
{
    const shell_space *space = s->walk.space;
    const knurl_heightmap *map = space->map;
    bool dilation = (space->factor < 0.0) != above;
    double share = (double)(dilation ? texel->dilation[c] : texel->erosion[c]) / 255.0;
    double range = map->range_max - map->range_min, value = map->range_min + share * range;
    double h = space->offset + space->factor * value;
    double rounding =
        1e-12 * (fabs(space->offset) + fabs(space->factor) * (fabs(map->range_min) + fabs(map->range_max)));
    return above ? h + rounding : h - rounding;
}

/* Fraction where the segment, forward or backward from `at`, is `box` away from there along one axis;
 * `end` (1 or 0) if it never is. */
static double leave_box(const shell_segment *s, double in, double out, double at, double box, double end)
{
    double border = (end > 0.5) == (out > in) ? at + box : at - box;
    double last = end > 0.5 ? out : in;
    if (in == out || fabs(last - at) <= box) return end;
    return segment_cross(s, in, out, border);
}

/* Where the ray leaves the union of the four zones around fraction `at`, forward (end = 1) or backward (end =
 * 0); `at` itself if it is in none (lambda_1 and lambda_2 of section 3.3). */
static double skip(search *s, double at, bool above, double end)
{
    const shell_segment *g = s->walk.segment;
    segment_point p = segment_at(g, at);
    const zone_texel *texel = zones_at(s, &p);
    double rise = g->out.h - g->in.h, best = at, sense = end > 0.5 ? 1.0 : -1.0;
    bool towards = above ? rise * sense < 0.0 : rise * sense > 0.0;
    s->walk.steps++;
    for (int c = 0; c < ZONE_CHANNELS; c++) {
        double h = zone_height(s, texel, c, above);
        if (!(above ? p.h > h : p.h < h) || s->box[c][0] <= 0.0 || s->box[c][1] <= 0.0) continue;
        double x = leave_box(g, g->in.x, g->out.x, p.x, s->box[c][0], end);
        double y = leave_box(g, g->in.y, g->out.y, p.y, s->box[c][1], end);
        double to = sense * min_d(sense * x, sense * y);
        if (towards) to = sense * min_d(sense * to, sense * ((h - g->in.h) / rise));
        if (sense * to > sense * best) best = to;
    }
    return min_d(max_d(best, 0.0), 1.0);
}

/* Number of regular samples: the segment's length in prism coordinates times the rate. */
static double sample_count(const search *s)
{
    const shell_segment *g = s->walk.segment;
    const height_level *level = s->walk.lod->level[0];
    double factor = fabs(s->walk.space->factor);
    double u = (g->out.x - g->in.x) / (double)level->width, v = (g->out.y - g->in.y) / (double)level->height;
    double z = factor > 0.0 ? (g->out.h - g->in.h) / factor : 0.0;
    double count = ceil(s->data->samples * sqrt(u * u + v * v + z * z));
    return min_d(max_d(count, 1.0), (double)MOST_SAMPLES);
}

static double gap_at(search *s, double f)
{
    segment_point p;
    height_patch patch;
    return segment_sample(&s->walk, f, &p, &patch);
}

/* The "bisection" of section 3.1 between a sample of either sign. */
static bool narrow(search *s, double from, double g_from, double to, double g_to)
{
    double at = to;
    for (int i = 0; i < s->data->bisections; i++) {
        at = from + (to - from) * (g_from / (g_from - g_to));
        if (!(at >= from && at <= to)) at = 0.5 * (from + to);
        double g = gap_at(s, at);
        if ((g > 0.0) == (g_from > 0.0)) {
            from = at;
            g_from = g;
        } else {
            to = at;
            g_to = g;
        }
    }
    return segment_accept(&s->walk, at);
}

/* Regular samples k / count from the last one before fraction `first`, whose side is known, to the first one
 * not before fraction `last`. */
static bool sample_between(search *s, double first, double last, bool above)
{
    double count = sample_count(s), k = max_d(floor_d(first * count), 0.0);
    if (k / count > first) k -= 1.0;
    double from = k / count, g_from = NAN;
    for (k += 1.0; k <= count; k += 1.0) {
        double at = k / count, g = gap_at(s, at);
        if ((g > 0.0) != above) {
            if (isnan(g_from)) g_from = gap_at(s, from);
            if (narrow(s, from, g_from, at, g)) return true;
            above = !above; /* behind the ray's start: what comes next may not be */
            last = 1.0;
        }
        if (at >= last || segment_at(s->walk.segment, at).t > s->walk.ray->tmax) return false;
        from = at;
        g_from = g;
    }
    return false;
}

static bool search_segment(search *s)
{
    double first = 0.0, last = 1.0;
    bool above = gap_at(s, 0.0) > 0.0;
    if (s->data->skips > 0) {
        bool above_last = gap_at(s, 1.0) > 0.0;
        for (int i = 0; i < s->data->skips && first < last; i++) {
            first = skip(s, first, above, 1.0);
            last = skip(s, last, above_last, 0.0);
        }
        if (above != above_last)
            last = 1.0; /* there is a hit: no sample may be left out for rounding */
        else if (first > last)
            return false;
    }
    return sample_between(s, first, last, above);
}

static bool empty_skip_intersect(const void *data, const method_query *q)
{
    shell_segments segments;
    knurl_ray line = *q->ray;
    line.tmax = INFINITY; /* places of samples do not depend on what was hit before */
    if (!shell_segments_make(q->frame, &line, &segments))
        return shell_subdivide(q->space, q->lod, KNURL_BOUNDS_RMIP, q->frame, q->ray, q->any, q->root,
                               q->steps);
    search s = {.data = data};
    s.walk = (segment_walk){
        .space = q->space, .lod = q->lod, .frame = q->frame, .ray = q->ray, .segments = &segments};
    if (s.data->skips > 0) set_boxes(&s);
    bool found = false;
    for (int i = 0; i < segments.count && !found; i++) {
        s.walk.segment = &segments.list[i];
        if (s.walk.segment->in.t > q->ray->tmax) break;
        found = search_segment(&s);
    }
    *q->steps += s.walk.steps;
    if (found) *q->root = s.walk.root;
    return found;
}

const method method_empty_skip = {
    .name = "empty-skip",
    .summary = "safety zones from dilation and erosion, then samples (Kolb and Rezk-Salama 2005)",
    .flags = 0,
    .needs = HEIGHT_NEED_RMIP,
    .parameters = PARAMETERS,
    .build = empty_skip_build,
    .intersect = empty_skip_intersect,
    .bytes = empty_skip_bytes,
    .destroy = empty_skip_destroy,
};
