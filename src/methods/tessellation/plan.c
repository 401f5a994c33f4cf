/* Cutting a surface: edge counts, numbers, and the points of vertices. */
#include "methods/tessellation/plan.h"

typedef struct counting {
    tessellation_plan *plan;
    double rate;
    uint32_t *longest; /* per thread: an edge count over LATTICE_MOST, and its triangle */
    uint32_t *where;
} counting;

/* Pieces of an edge. The small number keeps lengths that are whole but for rounding whole. */
static double edge_count(double texels, double rate)
{
    return max_d(1.0, ceil_d(min_d(texels * rate - 1e-6, 0x1p30)));
}

static lattice make_lattice(const tessellation_plan *plan, double rate, uint32_t triangle, double *most)
{
    const shell_space *space = plan->space;
    *most = 0.0;
    if (space->shells[triangle].flags & SHELL_EMPTY) return (lattice){0};
    const uint32_t *v = space->mesh.triangles + 3 * (size_t)triangle;
    double count[3]; /* of the edge that faces vertex i */
    for (int i = 0; i < 3; i++) {
        shell_edge edge;
        shell_edge_make(space, &plan->lod, v[(i + 1) % 3], v[(i + 2) % 3], &edge);
        count[i] = edge_count(edge.length, rate);
        *most = max_d(*most, count[i]);
    }
    if (*most > (double)LATTICE_MOST) return (lattice){0};
    uint16_t corner = 0;
    for (uint16_t i = 1; i < 3; i++)
        if (count[i] > count[corner]) corner = i;
    return (lattice){(uint16_t)count[(corner + 2) % 3], (uint16_t)count[(corner + 1) % 3],
                     (uint16_t)count[corner], corner};
}

static void count_range(void *user, size_t begin, size_t end, int32_t thread)
{
    counting *c = user;
    tessellation_plan *plan = c->plan;
    for (size_t t = begin; t < end; t++) {
        double most;
        lattice *l = &plan->lattices[t];
        *l = make_lattice(plan, c->rate, (uint32_t)t, &most);
        plan->first_vertex[t + 1] = lattice_vertices(l);
        plan->first_triangle[t + 1] = 2 * lattice_cells(l) + lattice_stitches(l);
        uint32_t longest = (uint32_t)most;
        if (longest > c->longest[thread] ||
            (longest == c->longest[thread] && (uint32_t)t < c->where[thread])) {
            c->longest[thread] = longest;
            c->where[thread] = (uint32_t)t;
        }
    }
}

/* Fills the plan at one rate. *longest is the largest count of any edge; over LATTICE_MOST, triangles like
 * *where are left empty. */
static knurl_status count_all(tessellation_plan *plan, double rate, uint32_t *longest, uint32_t *where,
                              knurl_error *error)
{
    knurl_context *context = plan->space->context;
    size_t threads = (size_t)knurl_context_threads(context);
    counting c = {.plan = plan, .rate = rate};
    c.longest = knurl_alloc_zero(context, 2 * threads * sizeof *c.longest);
    if (!c.longest) return knurl_fail_memory(error, 2 * threads * sizeof *c.longest, "edge counts");
    c.where = c.longest + threads;
    plan->rate = rate;
    size_t count = plan->space->mesh.triangle_count;
    knurl_parallel_for(context, count, 1024, count_range, &c);
    *longest = *where = 0;
    for (size_t i = 0; i < threads; i++) {
        if (c.longest[i] < *longest || (c.longest[i] == *longest && c.where[i] >= *where && i > 0)) continue;
        *longest = c.longest[i];
        *where = c.where[i];
    }
    knurl_free(context, c.longest);
    plan->first_vertex[0] = plan->first_triangle[0] = 0;
    for (size_t t = 0; t < count; t++) {
        plan->first_vertex[t + 1] += plan->first_vertex[t];
        plan->first_triangle[t + 1] += plan->first_triangle[t];
    }
    return KNURL_OK;
}

/* Counts with a budget: halves the rate until it holds, then goes back as far as it still does. */
static knurl_status count_within(tessellation_plan *plan, double rate, double most, uint32_t *longest,
                                 uint32_t *where, knurl_error *error)
{
    enum { STEPS = 12 };
    knurl_status status = count_all(plan, rate, longest, where, error);
    if (most == 0.0) return status;
    double low = rate, high = rate;
    /* At the least rate every edge is one piece. */
    while (status == KNURL_OK && low > 1e-9 &&
           (*longest > LATTICE_MOST || (double)plan_triangles(plan) > most)) {
        high = low;
        low *= 0.5;
        status = count_all(plan, low, longest, where, error);
    }
    for (int i = 0; status == KNURL_OK && high > low && i < STEPS; i++) {
        double middle = 0.5 * (low + high);
        status = count_all(plan, middle, longest, where, error);
        if (*longest > LATTICE_MOST || (double)plan_triangles(plan) > most)
            high = middle;
        else
            low = middle;
    }
    if (status == KNURL_OK && plan->rate != low) status = count_all(plan, low, longest, where, error);
    return status;
}

knurl_status plan_make(const shell_space *space, double rate, double most, tessellation_plan *plan,
                       knurl_error *error)
{
    knurl_context *context = space->context;
    size_t count = space->mesh.triangle_count;
    *plan = (tessellation_plan){.space = space};
    height_lod_make(space, 0.0, &plan->lod);
    plan->lattices = knurl_alloc_array(context, count, sizeof *plan->lattices);
    plan->first_vertex = knurl_alloc_array(context, count + 1, sizeof *plan->first_vertex);
    plan->first_triangle = knurl_alloc_array(context, count + 1, sizeof *plan->first_triangle);
    knurl_status status = KNURL_OK;
    uint32_t longest = 0, where = 0;
    if (!plan->lattices || !plan->first_vertex || !plan->first_triangle)
        status = knurl_fail_memory(error, count * 24, "the plan of a tessellation");
    if (status == KNURL_OK) status = count_within(plan, rate, most, &longest, &where, error);
    if (status == KNURL_OK && longest > LATTICE_MOST)
        status = knurl_fail(error, KNURL_ERROR_LIMIT,
                            "tessellation: an edge of triangle %u has %u pieces at rate %g, expected at most "
                            "%d; lower the rate or cut the mesh",
                            where, longest, plan->rate, LATTICE_MOST);
    if (status != KNURL_OK) plan_free(plan);
    return status;
}

void plan_free(tessellation_plan *plan)
{
    if (!plan->space) return;
    knurl_context *context = plan->space->context;
    knurl_free(context, plan->lattices);
    knurl_free(context, plan->first_vertex);
    knurl_free(context, plan->first_triangle);
    *plan = (tessellation_plan){0};
}

uint64_t plan_bytes(const tessellation_plan *plan)
{
    uint64_t count = plan->space->mesh.triangle_count;
    return count * sizeof(lattice) + 2 * (count + 1) * sizeof(uint64_t);
}

uint32_t plan_base_of(const uint64_t *first, uint32_t count, uint64_t vertex)
{
    uint32_t low = 0, high = count;
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        if (first[middle] <= vertex)
            low = middle;
        else
            high = middle;
    }
    return low;
}

void plan_piece_load(const tessellation_plan *plan, uint32_t triangle, plan_piece *piece)
{
    piece->plan = plan;
    piece->lattice = plan->lattices[triangle];
    piece->triangle = triangle;
    triangle_frame_load(plan->space, triangle, &plan->lod, &piece->frame);
    const uint32_t *v = plan->space->mesh.triangles + 3 * (size_t)triangle;
    uint32_t a = v[piece->lattice.corner], b = v[(piece->lattice.corner + 1) % 3],
             c = v[(piece->lattice.corner + 2) % 3];
    shell_edge_make(plan->space, &plan->lod, a, b, &piece->ab);
    shell_edge_make(plan->space, &plan->lod, a, c, &piece->ac);
    shell_edge_make(plan->space, &plan->lod, b, c, &piece->bc);
}

vec3 plan_piece_point(const plan_piece *piece, lattice_code code)
{
    const tessellation_plan *plan = piece->plan;
    const lattice *l = &piece->lattice;
    if (code.j == LATTICE_BORDER) return shell_edge_point(plan->space, &plan->lod, &piece->bc, code.i, l->n3);
    if (code.j == 0) return shell_edge_point(plan->space, &plan->lod, &piece->ab, code.i, l->n1);
    if (code.i == 0) return shell_edge_point(plan->space, &plan->lod, &piece->ac, code.j, l->n2);
    double b[2];
    lattice_barycentrics(l, code, b);
    return shell_point(plan->space, &plan->lod, &piece->frame, b[0], b[1]);
}

/* Vertices [begin, end) of the loaded piece, numbers in the piece. */
static void walk_piece(plan_piece *piece, uint64_t first, uint64_t begin, uint64_t end, plan_visit_fn *visit,
                       void *user)
{
    const lattice *l = &piece->lattice;
    plan_vertex v = {.piece = piece};
    uint64_t border = lattice_row(l, l->n2), at = begin;
    uint32_t row = begin < border ? lattice_row_of(l, begin) : l->n2;
    for (; row < l->n2 && at < end; row++) {
        uint64_t row_first = lattice_row(l, row), cells = lattice_cells_before(l, row);
        uint32_t last = lattice_last(l, row), last_above = lattice_last(l, row + 1);
        for (; at < end && at <= row_first + last; at++) {
            uint32_t i = (uint32_t)(at - row_first);
            v.code = (lattice_code){(uint16_t)i, (uint16_t)row};
            v.number = first + at;
            v.has_cell = i < last_above;
            v.above = v.number + last + 1;
            v.cell = cells + i;
            visit(user, &v);
        }
    }
    v.has_cell = false;
    for (; at < end; at++) {
        v.code = (lattice_code){(uint16_t)(at - border), LATTICE_BORDER};
        v.number = first + at;
        v.starts_border = at == border;
        visit(user, &v);
    }
}

void plan_walk(const tessellation_plan *plan, uint64_t begin, uint64_t end, plan_visit_fn *visit, void *user)
{
    if (begin >= end) return;
    plan_piece piece;
    uint32_t count = plan->space->mesh.triangle_count;
    for (uint32_t t = plan_base_of(plan->first_vertex, count, begin); begin < end; t++) {
        uint64_t first = plan->first_vertex[t], last = plan->first_vertex[t + 1];
        if (last <= begin) continue;
        plan_piece_load(plan, t, &piece);
        uint64_t stop = last < end ? last : end;
        walk_piece(&piece, first, begin - first, stop - first, visit, user);
        begin = stop;
    }
}
