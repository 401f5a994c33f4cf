/* The method `fast` from inside: its tree, its kernels against each other, memory that runs out. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/base.h"
#include "methods/fast/fast.h"
#include "support/random.h"
#include "support/scenes.h"
#include "support/traced.h"

#include <knurl/knurl.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static knurl_context *make_context(uint32_t cpu_mask)
{
    knurl_context *context = NULL;
    knurl_context_def def = knurl_context_def_default();
    def.cpu_mask = cpu_mask;
    assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
    return context;
}

/* ---- the tree ----------------------------------------------------------------------------------------- */

typedef struct visit {
    const fast_tree *tree;
    const fast_box *boxes;
    uint32_t *seen;
    int deepest;
} visit;

/* Every box below a slot lies in the slot's. */
static void visit_node(visit *v, uint32_t number, int depth, const fast_box *inside)
{
    assert_true(number < v->tree->node_count);
    assert_true(depth < 52);
    if (depth > v->deepest) v->deepest = depth;
    const fast_node *n = &v->tree->nodes[number];
    for (int i = 0; i < FAST_WIDTH; i++) {
        if (n->child[i] == FAST_NONE) {
            assert_true(n->bound[0][i] > n->bound[3][i]);
            continue;
        }
        fast_box box;
        for (int k = 0; k < 3; k++) {
            box.lower[k] = n->bound[k][i];
            box.upper[k] = n->bound[k + 3][i];
            if (inside) assert_true(box.lower[k] >= inside->lower[k] && box.upper[k] <= inside->upper[k]);
        }
        if (!(n->child[i] & FAST_LEAF)) {
            assert_true(n->child[i] > number);
            visit_node(v, n->child[i], depth + 1, &box);
            continue;
        }
        uint32_t leaf = n->child[i] & ~FAST_LEAF;
        v->seen[leaf]++;
        for (int k = 0; k < 3; k++)
            assert_true(box.lower[k] <= v->boxes[leaf].lower[k] && box.upper[k] >= v->boxes[leaf].upper[k]);
    }
}

static int check_tree(const fast_box *boxes, uint32_t count)
{
    knurl_context *context = make_context(UINT32_MAX);
    fast_tree tree;
    knurl_error error = {.message = ""};
    assert_int_equal(fast_tree_build(context, boxes, count, &tree, &error), KNURL_OK);
    uint32_t *seen = calloc(count + 1, sizeof *seen);
    assert_non_null(seen);
    visit v = {&tree, boxes, seen, 0};
    if (tree.nodes) visit_node(&v, 0, 0, NULL);
    for (uint32_t i = 0; i < count; i++) assert_int_equal(seen[i], boxes[i].lower[0] <= boxes[i].upper[0]);
    free(seen);
    knurl_free(context, tree.nodes);
    knurl_context_release(context);
    return v.deepest;
}

static void trees_hold_every_box_once(void **state)
{
    (void)state;
    enum { MANY = 100000 };
    fast_box *boxes = calloc(MANY, sizeof *boxes);
    assert_non_null(boxes);
    random_state random = {1};
    check_tree(boxes, 0);
    for (uint32_t i = 0; i < MANY; i++)
        for (int k = 0; k < 3; k++) {
            boxes[i].lower[k] = (float)random_range(&random, -1.0, 1.0);
            boxes[i].upper[k] = boxes[i].lower[k] + (float)(0.01 * random_unit(&random));
        }
    check_tree(boxes, 1);
    check_tree(boxes, 2);
    check_tree(boxes, 9);
    check_tree(boxes, MANY);
    /* Without content, every third. */
    for (uint32_t i = 0; i < MANY; i += 3)
        boxes[i] = (fast_box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    check_tree(boxes, 1);
    check_tree(boxes, 1000);
    /* All equal; then all in one point. */
    for (uint32_t i = 0; i < MANY; i++) boxes[i] = (fast_box){{-0.5f, -0.5f, -0.5f}, {0.5f, 0.25f, 0.125f}};
    assert_true(check_tree(boxes, MANY) < 20);
    for (uint32_t i = 0; i < MANY; i++) boxes[i] = (fast_box){{0.1f, 0.2f, 0.3f}, {0.1f, 0.2f, 0.3f}};
    assert_true(check_tree(boxes, MANY) < 20);
    /* Each a tenth, or a half, of the one before: every split by area takes few off. */
    for (int base = 0; base < 2; base++) {
        for (uint32_t i = 0; i < MANY; i++)
            for (int k = 0; k < 3; k++) {
                boxes[i].lower[k] =
                    (float)pow(base ? 0.5 : 0.1, (double)(i % 140) + 0.001 * (double)(i / 140));
                boxes[i].upper[k] = boxes[i].lower[k] * 1.01f;
            }
        check_tree(boxes, MANY);
        check_tree(boxes, 140);
    }
    free(boxes);
}

/* ---- kernels ------------------------------------------------------------------------------------------ */

static knurl_surface *make_torus(knurl_context *context, const truth_scene *scene, const char *specification,
                                 knurl_status *status)
{
    const oracle_def *def = &scene->def;
    knurl_image *image = NULL;
    knurl_heightmap *map = NULL;
    knurl_surface *surface = NULL;
    *status =
        knurl_image_create(context, def->width, def->height, 1, KNURL_PIXEL_U16, def->samples, &image, NULL);
    knurl_heightmap_def map_def = knurl_heightmap_def_default();
    map_def.image = image;
    if (*status == KNURL_OK) *status = knurl_heightmap_create(context, &map_def, &map, NULL);
    knurl_image_release(image);
    if (*status != KNURL_OK) return NULL;
    knurl_surface_def made = knurl_surface_def_default();
    made.mesh = (knurl_mesh_view){.positions = def->positions,
                                  .normals = def->normals,
                                  .texcoords = def->texcoords,
                                  .vertex_count = def->vertex_count,
                                  .triangles = def->triangles,
                                  .triangle_count = def->triangle_count};
    made.displacement.map = map;
    made.displacement.factor = def->factor;
    made.displacement.offset = def->offset;
    made.method = specification;
    *status = knurl_surface_create(context, &made, &surface, NULL);
    knurl_heightmap_release(map);
    return surface;
}

/* A ray's hit is on S in double precision, whatever kernel led to it: bit for bit nearly always. */
static void kernels_agree(void **state)
{
    (void)state;
    static const struct {
        int around, across;
        double factor, offset;
    } shapes[] = {{12, 8, 0.12, -0.03}, {5, 4, 0.02, 0.0}, {40, 24, 0.1, 0.05}};
    for (size_t n = 0; n < sizeof shapes / sizeof shapes[0]; n++) {
        truth_scene scene;
        assert_true(truth_torus_make(&scene, "torus", shapes[n].around, shapes[n].across, shapes[n].factor,
                                     shapes[n].offset, 0.0));
        knurl_context *contexts[2] = {make_context(0), make_context(UINT32_MAX)};
        knurl_surface *surfaces[2];
        knurl_status status;
        for (int i = 0; i < 2; i++) {
            surfaces[i] = make_torus(contexts[i], &scene, "fast", &status);
            assert_int_equal(status, KNURL_OK);
        }
        random_state random = {n + 3};
        int differ = 0, hits = 0;
        for (int i = 0; i < 33333; i++) {
            double origin[3], direction[3];
            for (int k = 0; k < 3; k++) {
                origin[k] = random_range(&random, -3.0, 3.0);
                direction[k] = random_range(&random, -1.4, 1.4) * (k == 1 ? 0.4 : 1.0) - origin[k];
            }
            knurl_ray ray = knurl_ray_make(origin, direction);
            knurl_hit hit[2] = {{.triangle = KNURL_NO_HIT}, {.triangle = KNURL_NO_HIT}};
            bool found[2], occluded[2];
            for (int k = 0; k < 2; k++) {
                found[k] = knurl_surface_intersect(surfaces[k], 0, &ray, &hit[k]);
                occluded[k] = knurl_surface_occluded(surfaces[k], 0, &ray);
            }
            hits += found[0];
            if (found[0] != found[1] || occluded[0] != found[0] || occluded[1] != found[1] ||
                (found[0] && (hit[0].triangle != hit[1].triangle ||
                              fabs(hit[0].t - hit[1].t) > 1e-12 * (1.0 + hit[0].t))))
                if (differ++ < 4)
                    printf("torus %zu: %a,%a,%a direction %a,%a,%a: found %d %d occluded %d %d triangles %u "
                           "%u t %.17g %.17g\n",
                           n, origin[0], origin[1], origin[2], direction[0], direction[1], direction[2],
                           found[0], found[1], occluded[0], occluded[1], hit[0].triangle, hit[1].triangle,
                           hit[0].t, hit[1].t);
        }
        assert_true(hits > 5000);
        assert_int_equal(differ, 0);
        for (int i = 0; i < 2; i++) {
            knurl_surface_release(surfaces[i]);
            knurl_context_release(contexts[i]);
        }
        truth_scene_free(&scene);
    }
}

/* ---- memory ------------------------------------------------------------------------------------------- */

typedef struct failing {
    int left;
    long long live;
} failing;

static void *failing_reallocate(void *user, void *p, size_t old_size, size_t new_size, size_t alignment)
{
    failing *f = user;
    if (new_size == 0) {
        f->live -= p != NULL;
        free(p);
        return NULL;
    }
    if (f->left-- == 0) return NULL;
    void *made = NULL;
    if (posix_memalign(&made, alignment, new_size) != 0) return NULL;
    if (p) {
        memcpy(made, p, old_size < new_size ? old_size : new_size);
        free(p);
    } else {
        f->live++;
    }
    return made;
}

static void running_out_of_memory_is_clean(void **state)
{
    (void)state;
    truth_scene scene;
    assert_true(truth_torus_make(&scene, "torus", 12, 8, 0.12, 0.0, 0.0));
    failing f = {.left = -1};
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    def.reallocate = failing_reallocate;
    def.allocator_user = &f;
    int failures = 0, n = 0;
    for (; n < 200; n++) {
        knurl_context *context;
        f.left = -1;
        assert_int_equal(knurl_context_create(&def, &context, NULL), KNURL_OK);
        f.left = n;
        knurl_status status;
        knurl_surface *surface = make_torus(context, &scene, "fast", &status);
        bool reached = f.left < 0;
        knurl_surface_release(surface);
        knurl_context_release(context);
        assert_true(f.live == 0);
        if (!reached) break;
        /* Shrinking a block may fail without harm. */
        assert_true(status == KNURL_ERROR_MEMORY || status == KNURL_OK);
        failures += status == KNURL_ERROR_MEMORY;
    }
    if (!(n < 200 && failures > 10 && failures >= n - 6)) fail_msg("%d allocations, %d errors", n, failures);
    truth_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trees_hold_every_box_once),
        cmocka_unit_test(kernels_agree),
        cmocka_unit_test(running_out_of_memory_is_clean),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
