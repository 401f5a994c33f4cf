/* Blocks: tiles of samples and nodes of ranges, made in one pass. A strip of a row of nodes (16 rows of
 * samples and the next, up to 32 nodes wide) is brought into the first-level cache as 16-bit codes; tiles
 * are cut from it, and ranges folded first down, then across. */
#include "bounds/blocks.h"

#include "bounds/block_kernels.h"
#include "bounds/cells.h"

#include <math.h>
#include <string.h>

enum { NODE_SHIFT = 4, BLOCKS_TEXELS = 1 << 17 /* per piece of parallel work */ };

/* The scale */

/* The code of a value v is floor(p + 1/2), where p = (v - origin) * (1 / step) is at most 65535 but for
 * rounding. With u = 2^-53, three roundings and that of 1 / step make p wrong by less than 5 u * 65536, the
 * sum another u * 65536; so the code is off the exact quotient by at most 1/2 + 6 u 2^16 < 1/2 + 2^-34. The
 * rest is what origin + c * step loses when it is evaluated in double: less than 3 u (|min| + |max|). */
void height_blocks_rescale(height_blocks *blocks, double range_min, double range_max)
{
    double size = fabs(range_min) + fabs(range_max), step = (range_max - range_min) / 65535.0;
    blocks->origin = range_min;
    blocks->code_error = step > 0.0 ? step * (0.5 + 0x1p-33) + size * 0x1p-51 : 0.0;
    /* A constant map has only code 0: any step will do that nobody's division minds, in float too. */
    blocks->step = step > 0.0 ? step : fmax(size * 0x1p-24, 0x1p-60);
}

/* From samples to level 0 */

typedef struct strip_job {
    height_blocks *blocks;
    const height_level *level;
    const block_kernels *kernels;
    double inverse_step; /* float maps */
    height_rect nodes;   /* of level 0 */
} strip_job;

/* Codes of `count` samples of row y from column x on; columns to the right of the map repeat the last. */
static void gather_row(const strip_job *job, int32_t x, int32_t y, int32_t count, uint16_t *to)
{
    const height_level *level = job->level;
    int32_t inside = level->width - x < count ? level->width - x : count;
    size_t at = (size_t)y * (size_t)level->width + (size_t)x;
    switch (level->format) {
    case KNURL_PIXEL_U8:
        job->kernels->encode_u8((const uint8_t *)level->samples + at, inside, to);
        break;
    case KNURL_PIXEL_U16:
        memcpy(to, (const uint16_t *)level->samples + at, (size_t)inside * sizeof *to);
        break;
    default:
        job->kernels->encode_f32((const float *)level->samples + at, inside, job->blocks->origin,
                                 job->inverse_step, to);
        break;
    }
    for (int32_t i = inside; i < count; i++) to[i] = to[inside - 1];
}

/* Nodes [first, end) of row `row`, with the tiles that lie in them or, at the far borders, beyond. */
typedef struct node_strip {
    int32_t row, first, end;
    int32_t columns, rows; /* of samples that are gathered */
    _Alignas(64) uint16_t codes[BLOCK_STRIP_ROWS][BLOCK_STRIP_STRIDE];
} node_strip;

static void gather(const strip_job *job, node_strip *s)
{
    const height_blocks *b = job->blocks;
    bool bottom = s->row + 1 == b->rows[0];
    s->columns = 16 * (s->end - s->first) + 16; /* one more is needed; vectors take sixteen */
    s->rows = bottom ? BLOCK_STRIP_ROWS : 17;
    for (int32_t r = 0; r < s->rows; r++) {
        int32_t y = 16 * s->row + r;
        if (y < b->height)
            gather_row(job, 16 * s->first, y, s->columns, s->codes[r]);
        else
            memcpy(s->codes[r], s->codes[r - 1], (size_t)s->columns * sizeof s->codes[r][0]);
    }
}

static void cut_tiles(const height_blocks *b, const node_strip *s)
{
    int32_t column_end = s->end == b->columns[0] ? b->tile_columns : 2 * s->end;
    int32_t row_end = s->row + 1 == b->rows[0] ? b->tile_rows : 4 * s->row + 4;
    for (int32_t y = 4 * s->row; y < row_end; y++) {
        const uint16_t *from = s->codes[4 * (y - 4 * s->row)];
        uint16_t *to = b->tiles + ((size_t)y * (size_t)b->tile_columns + 2 * (size_t)s->first) * 32;
        for (int32_t x = 2 * s->first; x < column_end; x++, from += 8, to += 32)
            for (int32_t r = 0; r < 4; r++) memcpy(to + 8 * r, from + r * BLOCK_STRIP_STRIDE, 16);
    }
}

/* The last cell of an axis continues with sample 0; its clamped continuation is a sample that it has. No
 * other cell reads the places behind the border. Rows and columns farther out repeat what is there. */
static void continue_period(const strip_job *job, node_strip *s)
{
    const height_blocks *b = job->blocks;
    int32_t x = b->width - 16 * s->first, y = b->height - 16 * s->row;
    if (y <= 16) gather_row(job, 16 * s->first, 0, s->columns, s->codes[y]);
    if (x > 16 * (s->end - s->first)) return;
    for (int32_t r = 0; r <= 16; r++) {
        int32_t from = r < y ? 16 * s->row + r : 0;
        gather_row(job, 0, from, 1, &s->codes[r][x]);
    }
}

static void set_empty(block_node *node, int32_t child)
{
    node->min[child] = UINT16_MAX;
    node->max[child] = 0;
}

static void make_nodes(const strip_job *job, node_strip *s)
{
    const height_blocks *b = job->blocks;
    block_node *nodes = b->nodes[0] + (size_t)s->row * (size_t)b->columns[0] + s->first;
    job->kernels->fold(s->codes[0], s->end - s->first, nodes);
    if (16 * s->end > b->width)
        for (int32_t i = (b->width - 16 * (s->end - 1) + 3) / 4; i < 4; i++)
            for (int32_t j = 0; j < 4; j++) set_empty(&nodes[s->end - 1 - s->first], 4 * j + i);
    for (int32_t j = (b->height - 16 * s->row + 3) / 4; j < 4; j++)
        for (int32_t k = 0; k < s->end - s->first; k++)
            for (int32_t i = 0; i < 4; i++) set_empty(&nodes[k], 4 * j + i);
}

static void strip_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const strip_job *job = user;
    const height_blocks *b = job->blocks;
    node_strip s;
    for (size_t i = begin; i < end; i++) {
        s.row = job->nodes.y0 + (int32_t)i;
        for (s.first = job->nodes.x0; s.first < job->nodes.x1; s.first = s.end) {
            int32_t left = job->nodes.x1 - s.first;
            s.end = s.first + (left < BLOCK_STRIP_NODES ? left : BLOCK_STRIP_NODES);
            gather(job, &s);
            cut_tiles(b, &s);
            if (s.end == b->columns[0] || s.row + 1 == b->rows[0]) continue_period(job, &s);
            make_nodes(job, &s);
        }
    }
}

static size_t grain_of(height_rect nodes, int32_t texels_per_node)
{
    size_t grain = (size_t)BLOCKS_TEXELS / ((size_t)(nodes.x1 - nodes.x0) * (size_t)texels_per_node);
    return grain ? grain : 1;
}

/* From level to level */

typedef struct parent_job {
    const height_blocks *blocks;
    int32_t level;
    height_rect nodes;
} parent_job;

static void make_parent(const height_blocks *b, int32_t level, int32_t x, int32_t y, block_node *node)
{
    int32_t columns = b->columns[level - 1], rows = b->rows[level - 1];
    for (int32_t j = 0; j < 4; j++) {
        for (int32_t i = 0; i < 4; i++) {
            int32_t child_x = 4 * x + i, child_y = 4 * y + j;
            set_empty(node, 4 * j + i);
            if (child_x >= columns || child_y >= rows) continue;
            const block_node *child =
                b->nodes[level - 1] + (size_t)child_y * (size_t)columns + (size_t)child_x;
            uint16_t low = child->min[0], high = child->max[0];
            for (int32_t k = 1; k < 16; k++) {
                low = child->min[k] < low ? child->min[k] : low;
                high = child->max[k] > high ? child->max[k] : high;
            }
            node->min[4 * j + i] = low;
            node->max[4 * j + i] = high;
        }
    }
}

static void parent_rows(void *user, size_t begin, size_t end, int32_t thread)
{
    (void)thread;
    const parent_job *job = user;
    const height_blocks *b = job->blocks;
    for (size_t i = begin; i < end; i++) {
        int32_t y = job->nodes.y0 + (int32_t)i;
        block_node *row = b->nodes[job->level] + (size_t)y * (size_t)b->columns[job->level];
        for (int32_t x = job->nodes.x0; x < job->nodes.x1; x++) make_parent(b, job->level, x, y, &row[x]);
    }
}

void height_blocks_update(knurl_context *context, height_blocks *blocks, const height_level *level,
                          height_rect samples)
{
    bool avx2 = (knurl_cpu_features(context) & KNURL_CPU_AVX2) != 0;
    height_rect nodes[4];
    int32_t count = cell_holders(level, NODE_SHIFT, samples, nodes);
    for (int32_t i = 0; i < count; i++) {
        strip_job job = {blocks, level, avx2 ? &block_kernels_avx2 : &block_kernels_plain, 0.0, nodes[i]};
        if (blocks->code_error > 0.0) job.inverse_step = 1.0 / blocks->step;
        knurl_parallel_for(context, (size_t)(nodes[i].y1 - nodes[i].y0), grain_of(nodes[i], 256), strip_rows,
                           &job);
    }
    for (int32_t k = 1; k < blocks->level_count; k++) {
        for (int32_t i = 0; i < count; i++) {
            height_rect *n = &nodes[i];
            *n = (height_rect){n->x0 / 4, n->y0 / 4, (n->x1 + 3) / 4, (n->y1 + 3) / 4};
            parent_job job = {blocks, k, *n};
            knurl_parallel_for(context, (size_t)(n->y1 - n->y0), grain_of(*n, 256), parent_rows, &job);
        }
    }
}

/* Memory */

/* Sizes of all levels; returns how many nodes they have. */
static size_t lay_out(height_blocks *b)
{
    int32_t columns = cell_count(b->width, NODE_SHIFT), rows = cell_count(b->height, NODE_SHIFT);
    size_t total = 0;
    for (;;) {
        b->columns[b->level_count] = columns;
        b->rows[b->level_count++] = rows;
        total += (size_t)columns * (size_t)rows;
        if (columns == 1 && rows == 1) break;
        columns = (columns + 3) / 4;
        rows = (rows + 3) / 4;
    }
    b->tile_columns = b->width / BLOCK_TILE_WIDTH + 1;
    b->tile_rows = b->height / BLOCK_TILE_HEIGHT + 1;
    return total;
}

knurl_status height_blocks_build(knurl_context *context, const height_level *level, double range_min,
                                 double range_max, height_blocks **blocks, knurl_error *error)
{
    height_blocks made = {.width = level->width, .height = level->height, .step = 1.0 / 65535.0};
    if (level->format == KNURL_PIXEL_F32) height_blocks_rescale(&made, range_min, range_max);
    size_t node_count = lay_out(&made), tile_count = (size_t)made.tile_columns * (size_t)made.tile_rows;
    *blocks = knurl_alloc(context, sizeof made);
    made.tiles = knurl_alloc_array(context, tile_count, 64);
    made.nodes[0] = knurl_alloc_array(context, node_count, sizeof *made.nodes[0]);
    if (!*blocks || !made.tiles || !made.nodes[0]) {
        knurl_free(context, *blocks);
        knurl_free(context, made.tiles);
        knurl_free(context, made.nodes[0]);
        *blocks = NULL;
        return knurl_fail_memory(error, tile_count * 64 + node_count * sizeof *made.nodes[0],
                                 "the blocks of a height map");
    }
    for (int32_t k = 1; k < made.level_count; k++)
        made.nodes[k] = made.nodes[k - 1] + (size_t)made.columns[k - 1] * (size_t)made.rows[k - 1];
    made.bytes = sizeof made + tile_count * 64 + node_count * sizeof *made.nodes[0];
    **blocks = made;
    height_blocks_update(context, *blocks, level, (height_rect){0, 0, level->width, level->height});
    return KNURL_OK;
}

void height_blocks_destroy(knurl_context *context, height_blocks *blocks)
{
    if (!blocks) return;
    knurl_free(context, blocks->tiles);
    knurl_free(context, blocks->nodes[0]);
    knurl_free(context, blocks);
}
