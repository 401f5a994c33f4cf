/* The structures of the method `fast` after edits: what would be made of the map as it is now. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "methods/fast/fast.h"
#include "methods/surface.h"
#include "support/random.h"

#include <knurl/knurl.h>
#include <string.h>

enum { WIDTH = 150, HEIGHT = 96, COLUMNS = 9, ROWS = 6, VERTICES = (COLUMNS + 1) * (ROWS + 1) };

typedef struct mesh {
    float positions[3 * VERTICES], texcoords[2 * VERTICES];
    uint32_t triangles[6 * COLUMNS * ROWS];
} mesh;

/* A dome. */
static void make_mesh(mesh *m)
{
    uint32_t *t = m->triangles;
    for (uint32_t v = 0; v < VERTICES; v++) {
        double x = (double)(v % (COLUMNS + 1)) / COLUMNS, y = (double)(v / (COLUMNS + 1)) / ROWS;
        m->positions[3 * v] = (float)x;
        m->positions[3 * v + 1] = (float)y;
        m->positions[3 * v + 2] = (float)(-(x - 0.5) * (x - 0.5) - (y - 0.5) * (y - 0.5));
        m->texcoords[2 * v] = (float)x;
        m->texcoords[2 * v + 1] = (float)y;
    }
    for (uint32_t j = 0; j < ROWS; j++)
        for (uint32_t i = 0; i < COLUMNS; i++, t += 6) {
            uint32_t a = j * (COLUMNS + 1) + i, c = a + COLUMNS + 1;
            memcpy(t, (uint32_t[]){a, a + 1, c + 1, a, c + 1, c}, 6 * sizeof *t);
        }
}

static float random_sample(random_state *random)
{
    return (float)random_range(random, 0.2, 0.6);
}

static knurl_heightmap *make_map(knurl_context *context, random_state *random)
{
    static float samples[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++) samples[i] = random_sample(random);
    /* Edits inside these do not change the scale of codes. */
    samples[0] = 0.0f;
    samples[WIDTH * HEIGHT - 1] = 1.0f;
    knurl_image *image = NULL;
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_image_create(context, WIDTH, HEIGHT, 1, KNURL_PIXEL_F32, samples, &image, NULL),
                     KNURL_OK);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    return map;
}

static knurl_surface *make_surface(knurl_context *context, const mesh *m, knurl_heightmap *map, int number,
                                   random_state *random)
{
    static const char *const methods[] = {"fast", "fast:budget=0.05", "fast:budget=0"};
    static const double scales[] = {1.0, 4.0, -0.7, 9.0};
    knurl_surface_def def = knurl_surface_def_default();
    def.method = methods[number % 3];
    def.mesh = (knurl_mesh_view){.positions = m->positions,
                                 .texcoords = m->texcoords,
                                 .vertex_count = VERTICES,
                                 .triangles = m->triangles,
                                 .triangle_count = 2 * COLUMNS * ROWS};
    def.displacement.map = map;
    def.displacement.factor = number % 5 == 4 ? 0.6 : 0.05; /* some shells fold */
    def.displacement.wrap_u = (knurl_wrap)random_index(random, 3);
    def.displacement.wrap_v = (knurl_wrap)random_index(random, 3);
    def.displacement.uv_scale[0] = scales[random_index(random, 4)];
    def.displacement.uv_scale[1] = scales[random_index(random, 4)];
    def.displacement.uv_offset[0] = number % 2 ? random_range(random, -2.0, 2.0) : 0.0;
    knurl_surface *surface = NULL;
    assert_int_equal(knurl_surface_create(context, &def, &surface, NULL), KNURL_OK);
    return surface;
}

static void edit(knurl_heightmap *map, knurl_surface *surface, float most, random_state *random)
{
    static float samples[WIDTH * HEIGHT];
    int32_t x = (int32_t)random_index(random, WIDTH), y = (int32_t)random_index(random, HEIGHT);
    int32_t w = 1 + (int32_t)random_index(random, 12), h = 1 + (int32_t)random_index(random, 12);
    w = w < WIDTH - x ? w : WIDTH - x;
    h = h < HEIGHT - y ? h : HEIGHT - y;
    for (int i = 0; i < w * h; i++) samples[i] = most * random_sample(random);
    assert_int_equal(knurl_heightmap_update(map, x, y, w, h, samples, (size_t)w * sizeof *samples, NULL),
                     KNURL_OK);
    assert_int_equal(knurl_surface_update(surface, x, y, w, h, NULL), KNURL_OK);
}

static void check_shells(const knurl_surface *surface)
{
    const shell_space *space = &surface->space;
    height_lod lod;
    height_lod_make(space, 0.0, &lod);
    shell_space fresh = *space;
    shell shells[2 * COLUMNS * ROWS];
    memcpy(shells, space->shells, sizeof shells);
    fresh.shells = shells;
    for (uint32_t t = 0; t < space->mesh.triangle_count; t++) {
        shell_heights(&fresh, t, &shells[t]);
        shell_shape(&fresh, &lod, t);
        /* Of several levels with the same end of the range, any may be named. */
        shells[t].low_level = space->shells[t].low_level;
        shells[t].high_level = space->shells[t].high_level;
    }
    assert_memory_equal(shells, space->shells, sizeof shells);
    shell_totals totals;
    shell_totals_make(space, &totals);
    assert_memory_equal(&totals, &surface->totals, sizeof totals);
}

static void check_patches(const knurl_surface *surface, const fast_data *data)
{
    const shell_space *space = &surface->space;
    height_lod lod;
    height_lod_make(space, 0.0, &lod);
    for (uint32_t t = 0; t < space->mesh.triangle_count; t++) {
        triangle_frame frame;
        fast_patch patch;
        triangle_frame_load(space, t, &lod, &frame);
        fast_patch_make(&frame, &patch);
        if (data->patches[t].flags & FAST_CROWDED) patch.flags |= FAST_SEARCHED | FAST_CROWDED;
        assert_memory_equal(&patch, &data->patches[t], sizeof patch);
    }
}

static fast_box child_box(const fast_node *node, int i)
{
    fast_box box;
    for (int k = 0; k < 3; k++) {
        box.lower[k] = node->bound[k][i];
        box.upper[k] = node->bound[k + 3][i];
    }
    return box;
}

/* Each child's box is that of its leaf, or of what is below it. Returns the number of leaves. */
static uint32_t check_tree(const fast_tree *tree, const fast_box *leaves)
{
    uint32_t count = 0;
    for (uint32_t n = 0; n < tree->node_count; n++)
        for (int i = 0; i < FAST_WIDTH; i++) {
            const fast_node *node = &tree->nodes[n];
            fast_box found = child_box(node, i), right;
            if (node->child[i] == FAST_NONE) continue;
            if (node->child[i] & FAST_LEAF) {
                right = leaves[node->child[i] & ~FAST_LEAF];
                count++;
            } else {
                right = child_box(&tree->nodes[node->child[i]], 0);
                for (int j = 1; j < FAST_WIDTH; j++) {
                    fast_box one = child_box(&tree->nodes[node->child[i]], j);
                    for (int k = 0; k < 3; k++) {
                        right.lower[k] = one.lower[k] < right.lower[k] ? one.lower[k] : right.lower[k];
                        right.upper[k] = one.upper[k] > right.upper[k] ? one.upper[k] : right.upper[k];
                    }
                }
            }
            assert_memory_equal(&found, &right, sizeof right);
        }
    return count;
}

static void check_trees(const knurl_surface *surface, fast_data *data)
{
    const shell_space *space = &surface->space;
    knurl_context *context = space->context;
    height_lod lod;
    height_lod_make(space, 0.0, &lod);
    fast_box *boxes = knurl_alloc_array(context, data->part_count + 1, sizeof *boxes);
    assert_non_null(boxes);
    for (uint32_t i = 0; i < data->part_count; i++) {
        const fast_part before = data->parts[i];
        triangle_frame frame;
        triangle_frame_load(space, before.patch, &lod, &frame);
        boxes[i] = fast_part_update(space, data, &lod, &frame, i).box;
        assert_memory_equal(&before, &data->parts[i], sizeof before);
    }
    assert_int_equal(check_tree(&data->fine, boxes), data->part_count);
    knurl_free(context, boxes);
    fast_box coarse[2 * COLUMNS * ROWS];
    for (uint32_t t = 0; t < space->mesh.triangle_count; t++) coarse[t] = fast_coarse_box(space, data, t);
    assert_int_equal(check_tree(&data->coarse, coarse), space->mesh.triangle_count);
    fast_data bounds = *data;
    fast_set_bounds(&bounds, surface->totals.lower, surface->totals.upper);
    assert_memory_equal(bounds.lower, data->lower, sizeof bounds.lower);
    assert_memory_equal(bounds.upper, data->upper, sizeof bounds.upper);
    /* Within what the padding of boxes was made for. */
    for (int k = 0; k < 3; k++) assert_true(data->lower[k] > -2.0 && data->upper[k] < 2.0);
}

static void test_structures(void **state)
{
    (void)state;
    static mesh m;
    make_mesh(&m);
    knurl_context_def def = knurl_context_def_default();
    def.threads = 2;
    knurl_context *context = NULL;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    random_state random = {7};
    int kept = 0;
    for (int number = 0; number < 40; number++) {
        knurl_heightmap *map = make_map(context, &random);
        knurl_surface *surface = make_surface(context, &m, map, number, &random);
        for (int i = 0; i < 6; i++) {
            const void *before = surface->data;
            edit(map, surface, i == 3 && number % 8 == 7 ? 300.0f : i == 4 ? 2.5f : 1.6f, &random);
            kept += surface->data == before;
            check_shells(surface);
            check_patches(surface, surface->data);
            check_trees(surface, surface->data);
        }
        knurl_surface_release(surface);
        knurl_heightmap_release(map);
    }
    assert_true(kept > 120); /* as a rule nothing is built anew */
    knurl_context_release(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_structures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
