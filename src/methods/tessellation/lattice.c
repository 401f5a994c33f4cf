/* Counting and stitching one base triangle's lattice. */
#include "methods/tessellation/lattice.h"

#include <math.h>

/* Sum of floor((a k + b) / m) over k in [0, n): Euclid's algorithm on the line's lattice points. All sums
 * here stay below 2^33. */
static uint64_t floor_sum(uint64_t n, uint64_t m, uint64_t a, uint64_t b)
{
    uint64_t sum = 0;
    while (n > 0) {
        sum += n * (n - 1) / 2 * (a / m) + n * (b / m);
        a %= m;
        b %= m;
        uint64_t top = a * n + b;
        if (top < m) break;
        n = top / m;
        b = top % m;
        uint64_t swap = m;
        m = a;
        a = swap;
    }
    return sum;
}

/* Sum of lattice_last() over the first `rows` rows. */
static uint64_t sum_last(const lattice *l, uint32_t rows)
{
    if (rows == 0) return 0;
    /* Taken from the last row upwards, the numerators grow: begin with that of row rows - 1. */
    uint32_t margin = (l->n1 < l->n2 ? l->n1 : l->n2) / 2u;
    if (margin == 0) margin = 1;
    uint64_t begin = (uint64_t)l->n1 * l->n2 - margin - (uint64_t)(rows - 1) * l->n1;
    return floor_sum(rows, l->n2, l->n1, begin);
}

uint64_t lattice_row(const lattice *l, uint32_t j)
{
    return sum_last(l, j) + j;
}

uint32_t lattice_row_of(const lattice *l, uint64_t vertex)
{
    uint32_t low = 0, high = l->n2; /* row(low) <= vertex < row(high) */
    while (high - low > 1) {
        uint32_t middle = (low + high) / 2;
        if (lattice_row(l, middle) <= vertex)
            low = middle;
        else
            high = middle;
    }
    return low;
}

uint64_t lattice_cells_before(const lattice *l, uint32_t j)
{
    /* Row r has as many cells as row r + 1 has steps; the last row has none. */
    uint32_t rows = j + 1 < l->n2 ? j + 1 : l->n2;
    return sum_last(l, rows) - lattice_last(l, 0);
}

uint32_t lattice_row_of_cell(const lattice *l, uint64_t cell)
{
    uint32_t low = 0, high = l->n2;
    while (high - low > 1) {
        uint32_t middle = (low + high) / 2;
        if (lattice_cells_before(l, middle) <= cell)
            low = middle;
        else
            high = middle;
    }
    return low;
}

void lattice_barycentrics(const lattice *l, lattice_code code, double b[2])
{
    double weight[3];
    if (code.j == LATTICE_BORDER) {
        weight[2] = (double)code.i / (double)l->n3;
        weight[1] = 1.0 - weight[2];
        weight[0] = 0.0;
    } else {
        weight[1] = (double)code.i / (double)l->n1;
        weight[2] = (double)code.j / (double)l->n2;
        weight[0] = 1.0 - weight[1] - weight[2];
    }
    /* Vertex v of the base is the (v - corner)th of A, B, C. */
    b[0] = weight[(4u - l->corner) % 3u];
    b[1] = weight[(5u - l->corner) % 3u];
}

/* The stair goes from B's side to C's, left along rows and up along columns; in step with it goes the
 * border. A step and a border vertex make a triangle of the right winding if the vertex lies beyond the
 * step's line: past height j for a step left in row j, before the height where column i meets BC for a step
 * up in it. Both can always be had because BC has the most vertices. */
typedef struct zipper {
    const lattice *l;
    lattice_stitch_fn *emit;
    void *user;
    lattice_corner stair, border;
} zipper;

static void advance_border(zipper *z, uint32_t to)
{
    while (z->border.code.i < to) {
        lattice_corner next = z->border;
        next.code.i++;
        next.place++;
        const lattice_corner corners[3] = {z->stair, z->border, next};
        z->emit(z->user, corners);
        z->border = next;
    }
}

static void advance_stair(zipper *z, uint32_t i, uint32_t j)
{
    lattice_corner next = {{(uint16_t)i, (uint16_t)j}, z->stair.place + 1};
    const lattice_corner corners[3] = {next, z->stair, z->border};
    z->emit(z->user, corners);
    z->stair = next;
}

/* Border vertex nearest to the middle of a step, seen along the median from A. */
static uint32_t nearest_border(const lattice *l, double i, double j)
{
    double way = 0.5 * (1.0 + j / (double)l->n2 - i / (double)l->n1);
    return (uint32_t)(way * (double)l->n3 + 0.5);
}

static void step_left(zipper *z)
{
    const lattice *l = z->l;
    uint32_t i = z->stair.code.i, j = z->stair.code.j;
    uint32_t target = nearest_border(l, (double)i - 0.5, (double)j), least = j * l->n3 / l->n2 + 1;
    advance_border(z, target > least ? target : least);
    advance_stair(z, i - 1, j);
}

static void step_up(zipper *z)
{
    const lattice *l = z->l;
    uint32_t i = z->stair.code.i, j = z->stair.code.j;
    uint32_t target = nearest_border(l, (double)i, (double)j + 0.5);
    uint32_t most = ((l->n1 - i) * l->n3 + l->n1 - 1u) / l->n1 - 1u;
    advance_border(z, target < most ? target : most);
    advance_stair(z, i, j + 1);
}

void lattice_stitch(const lattice *l, lattice_stitch_fn *emit, void *user)
{
    zipper z = {.l = l, .emit = emit, .user = user};
    z.stair.code.i = (uint16_t)lattice_last(l, 0);
    z.border.code.j = LATTICE_BORDER;
    z.border.place = lattice_stair(l);
    for (uint32_t j = 0; j < l->n2; j++) {
        uint32_t last = lattice_last(l, j + 1); /* 0 behind the last row */
        while (z.stair.code.i > last) step_left(&z);
        if (j + 1u < l->n2) step_up(&z);
    }
    advance_border(&z, l->n3);
}
