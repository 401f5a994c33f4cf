/* support/oracle.c: building the oracle's triangles and tree, and walking it with a ray. */
#include "oracle_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- triangles ---- */

static void unit_normal(const float *in, double out[3])
{
    double n[3], length = 0.0;
    for (int k = 0; k < 3; k++) n[k] = (double)in[k];
    length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; k++) out[k] = oracle_round_float(n[k] / length);
}

/* u and v of a vertex and slopes, in long double: tile numbers must not eat the texel's digits. */
static void set_uv(const oracle *o, oracle_triangle *t, const oracle_def *def, const uint32_t *corner)
{
    long double c = (long double)cos(def->uv_rotation), s = (long double)sin(def->uv_rotation);
    long double uv[3][2];
    for (int i = 0; i < 3; i++) {
        long double x = (long double)def->uv_scale[0] * (long double)def->texcoords[2 * corner[i]];
        long double y = (long double)def->uv_scale[1] * (long double)def->texcoords[2 * corner[i] + 1];
        uv[i][0] = (long double)def->uv_offset[0] + (c * x + s * y);
        uv[i][1] = (long double)def->uv_offset[1] + (c * y - s * x);
    }
    for (int k = 0; k < 2; k++) {
        t->uv0[k] = (double)uv[0][k];
        t->uv[0][k] = (double)(uv[1][k] - uv[0][k]);
        t->uv[1][k] = (double)(uv[2][k] - uv[0][k]);
        for (int l = 0; l < 2; l++) {
            const oracle_level *level = &o->map.level[l < o->map.levels ? l : 0];
            long double size = (long double)(k == 0 ? level->width : level->height);
            long double x = uv[0][k] * size - 0.5L, base = floorl(x);
            t->base[l][k] = (int64_t)base;
            t->x0[l][k] = (double)(x - base);
            for (int i = 0; i < 2; i++) t->x[l][k][i] = (double)((uv[i + 1][k] - uv[0][k]) * size);
        }
    }
}

static void set_cells(oracle_triangle *t)
{
    oracle_polygon polygon;
    oracle_triangle_polygon(t, &polygon);
    for (int k = 0; k < 2; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < 3; i++) {
            low = fmin(low, polygon.corner[i].x[0][k]);
            high = fmax(high, polygon.corner[i].x[0][k]);
        }
        t->cells[k] = (int64_t)floor(low);
        t->cells[2 + k] = (int64_t)ceil(high);
        if (t->cells[2 + k] <= t->cells[k]) t->cells[2 + k] = t->cells[k] + 1;
    }
    double xa = t->x[0][0][0], xb = t->x[0][0][1], ya = t->x[0][1][0], yb = t->x[0][1][1];
    double det = xa * yb - xb * ya;
    double size = (fabs(xa) + fabs(xb)) * (fabs(ya) + fabs(yb));
    /* Slivers in texture space too: their texel parallelograms reach far outside of the triangle. */
    t->singular = !(fabs(det) > 0.02 * size);
    if (t->singular) return;
    t->inverse[0][0] = yb / det;
    t->inverse[0][1] = -xb / det;
    t->inverse[1][0] = -ya / det;
    t->inverse[1][1] = xa / det;
}

/* (P_a + d N_a) x (P_b + d N_b) is quadratic in d: zero everywhere if it is at three places. */
static bool has_no_area(const oracle_triangle *t)
{
    double edge = 0.0, turn = 0.0;
    for (int k = 0; k < 3; k++) {
        edge = fmax(edge, fmax(fabs(t->e[0][k]), fabs(t->e[1][k])));
        turn = fmax(turn, fmax(fabs(t->n[0][k]), fabs(t->n[1][k])));
    }
    double reach = turn > 0.0 && edge > 0.0 ? edge / turn : 1.0;
    for (int i = -1; i <= 1; i++) {
        double d = (double)i * reach, v[2][3], size = edge + fabs(d) * turn;
        for (int k = 0; k < 3; k++) {
            for (int j = 0; j < 2; j++) v[j][k] = t->e[j][k] + d * t->n[j][k];
        }
        for (int k = 0; k < 3; k++) {
            int p = (k + 1) % 3, q = (k + 2) % 3;
            if (fabs(v[0][p] * v[1][q] - v[0][q] * v[1][p]) > 1e-14 * size * size) return false;
        }
    }
    return true;
}

static void set_triangle(oracle *o, uint32_t index, const oracle_def *def)
{
    oracle_triangle *t = &o->triangles[index];
    const uint32_t *corner = &def->triangles[3 * (size_t)index];
    double n[3][3];
    for (int i = 0; i < 3; i++) unit_normal(&def->normals[3 * (size_t)corner[i]], n[i]);
    for (int k = 0; k < 3; k++) {
        t->v0[k] = (double)def->positions[3 * (size_t)corner[0] + (size_t)k];
        t->n0[k] = n[0][k];
        for (int i = 0; i < 2; i++) {
            t->e[i][k] = (double)def->positions[3 * (size_t)corner[i + 1] + (size_t)k] - t->v0[k];
            t->n[i][k] = n[i + 1][k] - n[0][k];
        }
    }
    set_uv(o, t, def, corner);
    set_cells(t);
    t->empty = has_no_area(t);
}

/* ---- tree ---- */

static uint32_t new_node(oracle *o)
{
    if (o->node_count == o->node_capacity) {
        size_t capacity = o->node_capacity ? 2 * o->node_capacity : 1024;
        oracle_node *nodes = realloc(o->nodes, capacity * sizeof *nodes);
        if (!nodes) {
            o->failed = true;
            return 0;
        }
        o->nodes = nodes;
        o->node_capacity = capacity;
    }
    memset(&o->nodes[o->node_count], 0, sizeof *o->nodes);
    return (uint32_t)o->node_count++;
}

static void merge_boxes(oracle *o, uint32_t node)
{
    oracle_node *n = &o->nodes[node];
    const oracle_node *p = &o->nodes[n->child[0]], *q = &o->nodes[n->child[1]];
    for (int k = 0; k < 3; k++) {
        n->lower[k] = fmin(p->lower[k], q->lower[k]);
        n->upper[k] = fmax(p->upper[k], q->upper[k]);
    }
}

static uint32_t join(oracle *o, uint32_t p, uint32_t q)
{
    uint32_t node = new_node(o);
    if (o->failed) return 0;
    o->nodes[node].child[0] = p;
    o->nodes[node].child[1] = q;
    merge_boxes(o, node);
    return node;
}

/* Splits a rectangle of cells along its longer side; -1 when it is one cell. */
static int split_axis(const int64_t cells[4])
{
    int64_t w = cells[2] - cells[0], h = cells[3] - cells[1];
    if (w <= 1 && h <= 1) return -1;
    return w >= h ? 0 : 1;
}

static void split_cells(const int64_t cells[4], int axis, int64_t out[2][4])
{
    int64_t middle = cells[axis] + (cells[axis + 2] - cells[axis]) / 2;
    memcpy(out[0], cells, 4 * sizeof *cells);
    memcpy(out[1], cells, 4 * sizeof *cells);
    out[0][axis + 2] = middle;
    out[1][axis] = middle;
}

/* 0 stands for "nothing here": node 0 is never a child. */
static uint32_t build_cells(oracle *o, uint32_t triangle, const oracle_polygon *polygon,
                            const int64_t cells[4], int64_t leaf_cells)
{
    const oracle_triangle *t = &o->triangles[triangle];
    if (polygon->count == 0 || o->failed) return 0;
    int axis = split_axis(cells);
    if (axis < 0 || (cells[2] - cells[0]) * (cells[3] - cells[1]) <= leaf_cells) {
        uint32_t node = new_node(o);
        if (o->failed) return 0;
        oracle_node *n = &o->nodes[node];
        n->triangle = triangle;
        for (int k = 0; k < 4; k++) n->cells[k] = (int32_t)cells[k];
        oracle_polygon_box(o, t, polygon, cells, n->lower, n->upper);
        return node;
    }
    int64_t half[2][4];
    split_cells(cells, axis, half);
    uint32_t child[2];
    for (int i = 0; i < 2; i++) {
        oracle_polygon part;
        oracle_clip(polygon, &part, 0, axis, (double)half[1][axis], i == 1);
        child[i] = build_cells(o, triangle, &part, half[i], leaf_cells);
    }
    if (!child[0] || !child[1]) return child[0] ? child[0] : child[1];
    return join(o, child[0], child[1]);
}

static uint32_t build_top(oracle *o, uint32_t *items, size_t count)
{
    if (count == 1) return items[0];
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            double c = o->nodes[items[i]].lower[k] + o->nodes[items[i]].upper[k];
            low[k] = fmin(low[k], c);
            high[k] = fmax(high[k], c);
        }
    }
    int axis = 0;
    for (int k = 1; k < 3; k++) axis = high[k] - low[k] > high[axis] - low[axis] ? k : axis;
    double middle = 0.5 * (low[axis] + high[axis]);
    size_t left = 0;
    for (size_t i = 0; i < count; i++) {
        if (o->nodes[items[i]].lower[axis] + o->nodes[items[i]].upper[axis] < middle) {
            uint32_t swap = items[left];
            items[left++] = items[i];
            items[i] = swap;
        }
    }
    if (left == 0 || left == count) left = count / 2;
    uint32_t p = build_top(o, items, left), q = build_top(o, items + left, count - left);
    return o->failed ? 0 : join(o, p, q);
}

static void build_tree(oracle *o)
{
    uint32_t *items = malloc(o->triangle_count * sizeof *items);
    double total = 0.0;
    for (uint32_t i = 0; i < o->triangle_count; i++) {
        const int64_t *c = o->triangles[i].cells;
        total += (double)(c[2] - c[0]) * (double)(c[3] - c[1]);
    }
    int64_t leaf_cells = 1 + (int64_t)(total / 800000.0);
    size_t count = 0;
    o->failed = o->failed || !items;
    new_node(o);
    for (uint32_t i = 0; i < o->triangle_count && !o->failed; i++) {
        oracle_polygon polygon;
        if (o->triangles[i].empty) continue;
        oracle_triangle_polygon(&o->triangles[i], &polygon);
        uint32_t node = build_cells(o, i, &polygon, o->triangles[i].cells, leaf_cells);
        if (node) items[count++] = node;
    }
    if (count && !o->failed) o->root = build_top(o, items, count);
    free(items);
}

oracle *oracle_create(const oracle_def *def)
{
    oracle *o = calloc(1, sizeof *o);
    if (!o) return NULL;
    o->unnormalised = def->unnormalised;
    o->triangle_count = def->triangle_count;
    o->triangles = calloc(def->triangle_count, sizeof *o->triangles);
    if (!o->triangles || !oracle_map_build(&o->map, def)) {
        oracle_destroy(o);
        return NULL;
    }
    for (uint32_t i = 0; i < o->triangle_count; i++) set_triangle(o, i, def);
    memcpy(o->origin, o->triangles[0].v0, sizeof o->origin);
    build_tree(o);
    if (o->failed) {
        oracle_destroy(o);
        return NULL;
    }
    double lower[3], upper[3], sum = 0.0;
    oracle_bounds(o, lower, upper);
    for (int k = 0; k < 3; k++) sum += (upper[k] - lower[k]) * (upper[k] - lower[k]);
    o->scale = sqrt(sum);
    oracle_find_open_edges(o);
    return o;
}

void oracle_destroy(oracle *o)
{
    if (!o) return;
    oracle_map_free(&o->map);
    free(o->triangles);
    free(o->nodes);
    free(o);
}

double oracle_scale(const oracle *o)
{
    return o->scale;
}

void oracle_bounds(const oracle *o, double lower[3], double upper[3])
{
    for (int k = 0; k < 3; k++) {
        lower[k] = o->nodes[o->root].lower[k] + o->origin[k];
        upper[k] = o->nodes[o->root].upper[k] + o->origin[k];
    }
}

uint64_t oracle_bytes(const oracle *o)
{
    return o->node_capacity * sizeof(oracle_node) + o->triangle_count * sizeof(oracle_triangle);
}

/* ---- rays ---- */

/* Entry distance of the ray into a box, or infinity. */
static double enter(const oracle_query *q, const double lower[3], const double upper[3])
{
    double t0 = q->ray.tmin - q->slack, t1 = q->tmax + q->slack;
    for (int k = 0; k < 3; k++) {
        double low = lower[k] - q->pad - q->local[k], high = upper[k] + q->pad - q->local[k];
        if (q->ray.direction[k] == 0.0) {
            if (low > 0.0 || high < 0.0) return INFINITY;
            continue;
        }
        double a = low * q->inverse[k], b = high * q->inverse[k];
        t0 = fmax(t0, fmin(a, b));
        t1 = fmin(t1, fmax(a, b));
    }
    double rounding = 1e-12 * (fabs(t0) + fabs(t1 < INFINITY ? t1 : t0));
    return t0 <= t1 + rounding ? t0 : INFINITY;
}

static void visit_cells(const oracle *o, oracle_query *q, uint32_t triangle, const oracle_polygon *polygon,
                        const int64_t cells[4]);

/* Cuts a piece of one level-0 cell along the lines of the second level and solves the parts. */
static void visit_piece(const oracle *o, oracle_query *q, uint32_t triangle, const oracle_polygon *polygon,
                        const int64_t cells[4], int axis)
{
    if (polygon->count == 0) return;
    oracle_piece piece = {&o->triangles[triangle], triangle, polygon, {{cells[0], cells[1]}, {0, 0}}};
    for (int k = 0; k < 2 && o->map.levels == 2; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < polygon->count; i++) {
            low = fmin(low, polygon->corner[i].x[1][k]);
            high = fmax(high, polygon->corner[i].x[1][k]);
        }
        double line = floor(low) + 1.0;
        piece.cell[1][k] = (int64_t)floor(low);
        if (k < axis || line >= high) continue;
        for (int side = 0; side < 2; side++) {
            oracle_polygon part;
            oracle_clip(polygon, &part, 1, k, line, side == 1);
            /* The lower part's minimum stays under the line; the upper part may hold more lines. */
            visit_piece(o, q, triangle, &part, cells, k);
        }
        return;
    }
    oracle_solve_piece(o, &piece, q);
}

static void visit_cells(const oracle *o, oracle_query *q, uint32_t triangle, const oracle_polygon *polygon,
                        const int64_t cells[4])
{
    if (polygon->count == 0) return;
    int axis = split_axis(cells);
    if (axis < 0) {
        visit_piece(o, q, triangle, polygon, cells, 0);
        return;
    }
    int64_t half[2][4];
    oracle_polygon part[2];
    double entry[2] = {INFINITY, INFINITY};
    split_cells(cells, axis, half);
    for (int i = 0; i < 2; i++) {
        double lower[3], upper[3];
        oracle_clip(polygon, &part[i], 0, axis, (double)half[1][axis], i == 1);
        if (part[i].count == 0) continue;
        oracle_polygon_box(o, &o->triangles[triangle], &part[i], half[i], lower, upper);
        entry[i] = enter(q, lower, upper);
    }
    int first = entry[0] <= entry[1] ? 0 : 1;
    if (entry[first] <= q->tmax + q->slack) visit_cells(o, q, triangle, &part[first], half[first]);
    if (entry[1 - first] <= q->tmax + q->slack)
        visit_cells(o, q, triangle, &part[1 - first], half[1 - first]);
}

static void visit_leaf(const oracle *o, oracle_query *q, const oracle_node *node)
{
    oracle_polygon polygon, other;
    oracle_triangle_polygon(&o->triangles[node->triangle], &polygon);
    for (int k = 0; k < 2; k++) {
        oracle_clip(&polygon, &other, 0, k, (double)node->cells[k], true);
        oracle_clip(&other, &polygon, 0, k, (double)node->cells[k + 2], false);
    }
    int64_t cells[4];
    for (int k = 0; k < 4; k++) cells[k] = node->cells[k];
    visit_cells(o, q, node->triangle, &polygon, cells);
}

static void visit_node(const oracle *o, oracle_query *q, uint32_t index)
{
    const oracle_node *node = &o->nodes[index];
    if (!node->child[0]) {
        visit_leaf(o, q, node);
        return;
    }
    double entry[2];
    for (int i = 0; i < 2; i++) {
        const oracle_node *child = &o->nodes[node->child[i]];
        entry[i] = enter(q, child->lower, child->upper);
    }
    int first = entry[0] <= entry[1] ? 0 : 1;
    if (entry[first] < INFINITY && entry[first] <= q->tmax + q->slack) visit_node(o, q, node->child[first]);
    if (entry[1 - first] < INFINITY && entry[1 - first] <= q->tmax + q->slack)
        visit_node(o, q, node->child[1 - first]);
}

static void run_query(const oracle *o, const oracle_ray *ray, oracle_query *q)
{
    q->ray = *ray;
    q->tmax = ray->tmax;
    double length = 0.0, far = 0.0;
    q->axis = 0;
    for (int k = 0; k < 3; k++) {
        if (fabs(ray->direction[k]) > fabs(ray->direction[q->axis])) q->axis = k;
        q->local[k] = (double)((long double)ray->origin[k] - (long double)o->origin[k]);
        q->inverse[k] = 1.0 / ray->direction[k];
        length += ray->direction[k] * ray->direction[k];
        far = fmax(far, fabs(q->local[k]));
    }
    q->u = (q->axis + 1) % 3;
    q->v = (q->axis + 2) % 3;
    length = sqrt(length);
    /* Rounding of the caller's own origin + t * direction, and of ours. */
    q->slack = 1e-12 * (o->scale + far) / length;
    q->same = 4e-9 * o->scale / length;
    q->pad = 1e-12 * o->scale + 1e-14 * far;
    if (o->root && enter(q, o->nodes[o->root].lower, o->nodes[o->root].upper) < INFINITY)
        visit_node(o, q, o->root);
}

int oracle_roots(const oracle *o, const oracle_ray *ray, oracle_root *roots, int capacity)
{
    oracle_query q = {.roots = roots, .capacity = capacity};
    run_query(o, ray, &q);
    return q.count;
}

bool oracle_first(const oracle *o, const oracle_ray *ray, oracle_root *root)
{
    oracle_query q = {.roots = root, .capacity = 1, .first_only = true};
    run_query(o, ray, &q);
    return q.count > 0;
}
