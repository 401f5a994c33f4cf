/* The method `fast` from inside: its tree, its kernels against each other, memory that runs out. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/base.h"
#include "methods/fast/fast.h"
#include "methods/surface.h"
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
        /* The plain kernel, AVX2's, and the best that this machine has. */
        enum { KERNELS = 3 };
        knurl_context *contexts[KERNELS] = {make_context(0), make_context(KNURL_CPU_SSE41 | KNURL_CPU_AVX2),
                                            make_context(UINT32_MAX)};
        knurl_surface *surfaces[KERNELS];
        knurl_status status;
        for (int i = 0; i < KERNELS; i++) {
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
            knurl_hit hit[KERNELS];
            bool found[KERNELS], occluded[KERNELS];
            for (int k = 0; k < KERNELS; k++) {
                hit[k] = (knurl_hit){.triangle = KNURL_NO_HIT};
                found[k] = knurl_surface_intersect(surfaces[k], 0, &ray, &hit[k]);
                occluded[k] = knurl_surface_occluded(surfaces[k], 0, &ray);
            }
            hits += found[0];
            for (int k = 1; k < KERNELS; k++)
                if (found[0] != found[k] || occluded[0] != found[0] || occluded[k] != found[k] ||
                    (found[0] && (hit[0].triangle != hit[k].triangle ||
                                  fabs(hit[0].t - hit[k].t) > 1e-12 * (1.0 + hit[0].t))))
                    if (differ++ < 4)
                        printf(
                            "torus %zu, kernel %d: %a,%a,%a direction %a,%a,%a: found %d %d occluded %d %d "
                            "triangles %u %u t %.17g %.17g\n",
                            n, k, origin[0], origin[1], origin[2], direction[0], direction[1], direction[2],
                            found[0], found[k], occluded[0], occluded[k], hit[0].triangle, hit[k].triangle,
                            hit[0].t, hit[k].t);
        }
        assert_true(hits > 5000);
        assert_int_equal(differ, 0);
        for (int i = 0; i < KERNELS; i++) {
            knurl_surface_release(surfaces[i]);
            knurl_context_release(contexts[i]);
        }
        truth_scene_free(&scene);
    }
}

/* ---- parts -------------------------------------------------------------------------------------------- */

enum { MOST_SAMPLES = 200 * 200, TRIANGLES = 2 };

typedef struct random_surface {
    knurl_surface *surface;
    const shell_space *space;
    const fast_data *data;
    fast_box *boxes; /* of parts, as the tree has them */
} random_surface;

static knurl_heightmap *random_map(knurl_context *context, random_state *r, int width, int height)
{
    static float samples[MOST_SAMPLES];
    static const knurl_pixel_format formats[] = {KNURL_PIXEL_U8, KNURL_PIXEL_U16, KNURL_PIXEL_F32};
    knurl_pixel_format format = formats[random_index(r, 3)];
    for (int i = 0; i < width * height; i++) {
        float value = (float)random_range(r, -1.0, 3.0);
        uint32_t bits = (uint32_t)random_bits(r);
        if (format == KNURL_PIXEL_F32) memcpy(&bits, &value, sizeof bits);
        memcpy(&samples[i], &bits, sizeof bits);
    }
    knurl_image *image = NULL;
    knurl_heightmap *map = NULL;
    assert_int_equal(knurl_image_create(context, width, height, 1, format, samples, &image, NULL), KNURL_OK);
    knurl_heightmap_def def = knurl_heightmap_def_default();
    def.image = image;
    assert_int_equal(knurl_heightmap_create(context, &def, &map, NULL), KNURL_OK);
    knurl_image_release(image);
    return map;
}

/* Triangles that share nothing, of any shape and place; `across` is how long they are in texture space. */
static void random_mesh(random_state *r, double across, float *positions, float *normals, float *texcoords)
{
    for (int t = 0; t < TRIANGLES; t++) {
        const double place[2] = {random_range(r, -2.0, 2.0), random_range(r, -2.0, 2.0)};
        const double bend = random_index(r, 3) ? random_range(r, 0.0, 0.7) : 0.0;
        for (int v = 3 * t; v < 3 * t + 3; v++) {
            const float corner[2] = {v % 3 == 1 ? 1.0f : 0.0f, v % 3 == 2 ? 1.0f : 0.0f};
            for (int k = 0; k < 3; k++) {
                positions[3 * v + k] =
                    (float)(3.0 * t + random_range(r, -0.4, 0.4)) + (k < 2 ? corner[k] : 0.0f);
                normals[3 * v + k] = (float)(random_range(r, -bend, bend) + (k == 2 ? 1.0 : 0.0));
            }
            for (int k = 0; k < 2; k++)
                texcoords[2 * v + k] =
                    (float)(place[k] + across * ((double)corner[k] + random_range(r, -0.4, 0.4)));
        }
    }
}

static void gather_boxes(const fast_tree *tree, fast_box *boxes)
{
    for (uint32_t i = 0; i < tree->node_count; i++)
        for (int j = 0; j < FAST_WIDTH; j++) {
            uint32_t child = tree->nodes[i].child[j];
            if (child == FAST_NONE || !(child & FAST_LEAF)) continue;
            for (int k = 0; k < 3; k++) {
                boxes[child & ~FAST_LEAF].lower[k] = tree->nodes[i].bound[k][j];
                boxes[child & ~FAST_LEAF].upper[k] = tree->nodes[i].bound[k + 3][j];
            }
        }
}

static random_surface make_random(knurl_context *context, random_state *r)
{
    static const int sizes[] = {1, 2, 3, 5, 15, 16, 17, 31, 33, 64, 67, 129, 200};
    static const char *const methods[] = {"fast", "fast:budget=0.002", "fast:budget=0.05", "fast:budget=9"};
    static const double offsets[] = {0.0, 0.0, -0.7, 1000.3, -5000.6, 1e5, -1e5};
    float positions[9 * TRIANGLES], normals[9 * TRIANGLES], texcoords[6 * TRIANGLES];
    uint32_t triangles[3 * TRIANGLES];
    int width = sizes[random_index(r, 13)], height = sizes[random_index(r, 13)];
    double longest = 300.0 / (width > height ? width : height);
    random_mesh(r, longest < 3.0 || random_index(r, 2) ? random_range(r, 0.01, 1.0) * longest : 1.0,
                positions, normals, texcoords);
    for (uint32_t i = 0; i < 3 * TRIANGLES; i++) triangles[i] = i;
    knurl_surface_def def = knurl_surface_def_default();
    def.mesh = (knurl_mesh_view){.positions = positions,
                                 .normals = normals,
                                 .texcoords = texcoords,
                                 .vertex_count = 3 * TRIANGLES,
                                 .triangles = triangles,
                                 .triangle_count = TRIANGLES};
    def.method = methods[random_index(r, 4)];
    knurl_displacement *d = &def.displacement;
    d->map = random_map(context, r, width, height);
    d->factor = random_range(r, -0.1, 0.1);
    d->offset = random_range(r, -0.1, 0.1);
    d->wrap_u = (knurl_wrap)random_index(r, 3);
    d->wrap_v = (knurl_wrap)random_index(r, 3);
    d->uv_offset[0] = offsets[random_index(r, 7)];
    d->uv_offset[1] = offsets[random_index(r, 7)];
    d->unnormalised = random_index(r, 5) == 0;
    random_surface s = {0};
    assert_int_equal(knurl_surface_create(context, &def, &s.surface, NULL), KNURL_OK);
    knurl_heightmap_release(d->map);
    s.space = &s.surface->space;
    s.data = s.surface->data;
    s.boxes = calloc(s.data->part_count + 1, sizeof *s.boxes);
    assert_non_null(s.boxes);
    gather_boxes(&s.data->fine, s.boxes);
    return s;
}

static void free_random(random_surface *s)
{
    free(s->boxes);
    knurl_surface_release(s->surface);
}

/* F in the trees' space. */
static vec3 shell_map(const random_surface *s, const triangle_frame *f, double b1, double b2, double height)
{
    vec3 p = v3_mad(v3_scale(f->pe, b1), b2, f->pf), n = v3_mad(v3_mad(f->n[0], b1, f->ne), b2, f->nf);
    vec3 at = v3_add(v3_sub(f->base, v3_load(s->data->centre)), v3_mad(p, height, n));
    return v3_scale(at, s->data->scale);
}

static double part_side(const fast_part *part)
{
    return (double)(16 << (2 * part->level));
}

/* The height that the traversal reads at (x, y), texels from the part's corner, in the trees' units. */
static double part_height(const random_surface *s, const fast_part *part, double x, double y)
{
    const height_blocks *blocks = s->data->blocks;
    int32_t i = part->cell_x + (int32_t)floor(x), j = part->cell_y + (int32_t)floor(y);
    double code = 0.0, fx = x - floor(x), fy = y - floor(y);
    for (int k = 0; k < 4; k++) {
        int32_t column = height_wrap(i + (k & 1), blocks->width, s->data->wrap_u);
        int32_t row = height_wrap(j + (k >> 1), blocks->height, s->data->wrap_v);
        code += (k & 1 ? fx : 1.0 - fx) * (k >> 1 ? fy : 1.0 - fy) *
                (double)height_blocks_code(blocks, column, row);
    }
    return (double)s->data->height_base + (double)s->data->height_code * code;
}

/* Whether the blocks' ranges of the 4 x 4 texels at (x, y), and of what is above them, hold the height. */
static bool nodes_hold(const random_surface *s, const fast_part *part, double x, double y, double height)
{
    const height_blocks *blocks = s->data->blocks;
    int32_t i = part->cell_x + (int32_t)floor(x), j = part->cell_y + (int32_t)floor(y);
    if (part->flags & FAST_WRAPPED) return true; /* goes by its box only */
    if (i < 0 || j < 0 || i >= blocks->width || j >= blocks->height) return false;
    for (int level = 0; level <= part->level; level++) {
        int shift = 4 + 2 * level;
        const block_node *n =
            &blocks->nodes[level][(int64_t)(j >> shift) * blocks->columns[level] + (i >> shift)];
        int child = ((j >> (shift - 2)) & 3) * 4 + ((i >> (shift - 2)) & 3);
        double a = (double)s->data->height_base + (double)s->data->height_code * (double)n->min[child];
        double b = (double)s->data->height_base + (double)s->data->height_code * (double)n->max[child];
        double pad = 1.01 * (double)s->data->height_error;
        if (!(height >= fmin(a, b) - pad && height <= fmax(a, b) + pad)) return false;
    }
    return true;
}

/* Whether a part has the point of S at (x, y), s and `at` in the trees' space, for rays to find. */
static bool part_holds(const random_surface *s, uint32_t number, double x, double y, double height,
                       double normal, vec3 at)
{
    const fast_part *part = &s->data->parts[number];
    const fast_box *box = &s->boxes[number];
    double place[3], unit = part_side(part) / 255.0;
    v3_store(place, at);
    for (int k = 0; k < 3; k++)
        if (!(place[k] >= (double)box->lower[k] && place[k] <= (double)box->upper[k])) return false;
    double scaled = height * s->data->scale;
    if (!(scaled >= (double)part->s_min * normal && scaled <= (double)part->s_max * normal)) return false;
    if (part->flags & FAST_WHOLE) return true;
    double dx = x - (double)part->corner_x, dy = y - (double)part->corner_y;
    if (!(dx >= unit * part->from_x && dx <= unit * part->to_x)) return false;
    if (!(dy >= unit * part->from_y && dy <= unit * part->to_y)) return false;
    double allowed = 1.01 * (double)s->data->height_error + 1e-9 * (fabs(scaled) + 1e-3);
    return fabs(part_height(s, part, dx, dy) - scaled) <= allowed && nodes_hold(s, part, dx, dy, scaled);
}

static void triangles_are_covered(void **state)
{
    (void)state;
    enum { SURFACES = 400, POINTS = 60 };
    knurl_context *context = make_context(UINT32_MAX);
    random_state r = {11};
    int kinds[3] = {0};
    for (int n = 0; n < SURFACES; n++) {
        random_surface s = make_random(context, &r);
        height_lod lod;
        height_lod_make(s.space, 0.0, &lod);
        for (int i = 0; i < POINTS; i++) {
            triangle_frame f;
            uint32_t t = random_index(&r, TRIANGLES);
            triangle_frame_load(s.space, t, &lod, &f);
            double b1 = random_unit(&r), b2 = random_unit(&r);
            if (b1 + b2 > 1.0) b1 = 1.0 - b1, b2 = 1.0 - b2;
            if (i % 8 == 0) b2 = 0.0;
            if (i == 1) b1 = b2 = 0.0;
            double x = f.x[0] + b1 * f.xe + b2 * f.xf, y = f.y[0] + b1 * f.ye + b2 * f.yf;
            height_patch patch;
            height_patch_find(s.space, &lod, &f, x, y, &patch);
            double h = height_patch_at(&patch, x, y), normal = frame_normal_scale(&f, b1, b2);
            vec3 at = shell_map(&s, &f, b1, b2, h / normal);
            uint32_t held = UINT32_MAX;
            for (uint32_t k = 0; k < s.data->part_count && held == UINT32_MAX; k++)
                if (s.data->parts[k].patch == t && part_holds(&s, k, x, y, h, normal, at)) held = k;
            if (held == UINT32_MAX)
                fail_msg("surface %d, triangle %u: nothing at texel (%.17g, %.17g) of the frame, height %g",
                         n, t, x, y, h);
            uint16_t flags = s.data->parts[held].flags;
            kinds[flags & FAST_WHOLE ? 0 : flags & FAST_WRAPPED ? 1 : 2]++;
        }
        free_random(&s);
    }
    for (int k = 0; k < 3; k++) assert_true(kinds[k] > SURFACES * POINTS / 20);
    knurl_context_release(context);
}

/* Parts and their tree take twice the budget at most, or base triangles have one part each; and they take
 * what they may. */
static void budgets_hold(void **state)
{
    (void)state;
    enum { SIDE = 10, VERTICES = (SIDE + 1) * (SIDE + 1), FACES = 2 * SIDE * SIDE };
    static const double tiles[] = {1.0, 2.5, 9.0, 40.0, 1000.0}, budgets[] = {0.04, 0.2, 1.0, 8.0};
    static float positions[3 * VERTICES], texcoords[2 * VERTICES];
    static uint32_t triangles[3 * FACES];
    knurl_context *context = make_context(UINT32_MAX);
    random_state r = {3};
    knurl_heightmap *map = random_map(context, &r, 112, 200);
    knurl_surface_def def = knurl_surface_def_default();
    def.mesh = (knurl_mesh_view){.positions = positions,
                                 .texcoords = texcoords,
                                 .vertex_count = VERTICES,
                                 .triangles = triangles,
                                 .triangle_count = FACES};
    for (uint32_t v = 0; v < VERTICES; v++) {
        texcoords[2 * v] = positions[3 * v] = (float)(v % (SIDE + 1)) / SIDE;
        texcoords[2 * v + 1] = positions[3 * v + 1] = (float)(v / (SIDE + 1)) / SIDE;
    }
    for (uint32_t q = 0; q < SIDE * SIDE; q++) {
        uint32_t a = q / SIDE * (SIDE + 1) + q % SIDE, c = a + SIDE + 1;
        memcpy(&triangles[6 * q], (uint32_t[]){a, a + 1, c + 1, a, c + 1, c}, 6 * sizeof *triangles);
    }
    def.displacement.map = map;
    def.displacement.factor = 0.01;
    for (uint32_t n = 0; n < 9 * 5 * 4; n++) {
        char specification[64];
        double budget = budgets[n % 4], scale = tiles[n / 4 % 5];
        snprintf(specification, sizeof specification, "fast:budget=%g", budget);
        def.method = specification;
        def.displacement.wrap_u = (knurl_wrap)(n / 20 % 3);
        def.displacement.wrap_v = (knurl_wrap)(n / 60);
        for (int k = 0; k < 2; k++) def.displacement.uv_scale[k] = scale;
        knurl_surface *surface = NULL;
        assert_int_equal(knurl_surface_create(context, &def, &surface, NULL), KNURL_OK);
        const fast_data *data = surface->data;
        double bytes =
            (double)(data->part_count * sizeof(fast_part) + data->fine.node_count * sizeof(fast_node));
        bool whole = data->part_count == FACES;
        if (!(bytes <= 2.0 * budget * 1048576.0) && !whole)
            fail_msg("%s, tiles %g, case %u: %u parts, %g MiB", specification, scale, n, data->part_count,
                     bytes / 1048576.0);
        /* 81 tiles of 91 parts of 16 x 16 texels, more with those that triangles share, are 1.3 MiB. */
        if (budget >= 8.0 && scale <= 9.0)
            for (uint32_t i = 0; i < data->part_count; i++)
                assert_false(data->parts[i].flags & FAST_SEARCHED);
        knurl_surface_release(surface);
    }
    knurl_heightmap_release(map);
    knurl_context_release(context);
}

/* As walk.h has it, in floats: (x, y, s) from the part's centre, of a point of a ray. */
static void invert(const fast_part *p, vec3 origin, vec3 direction, double tau_of_point, float out[3])
{
    vec3 to = v3_sub(v3_loadf(p->origin), origin);
    double shift = v3_dot(to, direction) / v3_dot(direction, direction), near[3], along[3];
    v3_store(near, v3_sub(v3_scale(direction, shift), to));
    v3_store(along, direction);
    float tau = (float)(tau_of_point - shift), q[3];
    for (int i = 0; i < 3; i++) {
        float q0 = 0.0f, q1 = 0.0f;
        for (int j = 2; j >= 0; j--) {
            q0 = p->inverse[j][i] * (float)near[j] + q0;
            q1 = p->inverse[j][i] * (float)along[j] + q1;
        }
        q[i] = q1 * tau + q0;
        out[i] = q[i];
    }
    for (int n = 0; n < p->iterations; n++) {
        float s = out[2], a = s * p->bend_x[0] + 1.0f, b = s * p->bend_y[0], c = s * p->bend_x[1];
        float d = s * p->bend_y[1] + 1.0f, inverse = 1.0f / (a * d - b * c);
        out[0] = (d * q[0] - b * q[1]) * inverse;
        out[1] = (a * q[1] - c * q[0]) * inverse;
        out[2] = q[2] - s * (p->bend_x[2] * out[0] + p->bend_y[2] * out[1]);
    }
}

/* How far off a point of a part's shell is found, in parts of the bounds on that. */
static double frame_error(const random_surface *s, const triangle_frame *f, const fast_part *part,
                          random_state *r)
{
    double unit = part_side(part) / 255.0, worst = 0.0;
    double dx = unit * random_range(r, part->from_x, part->to_x);
    double dy = unit * random_range(r, part->from_y, part->to_y);
    double height = random_range(r, (double)part->s_min, (double)part->s_max);
    double x = dx + (double)part->corner_x - f->x[0], y = dy + (double)part->corner_y - f->y[0];
    double b1 = f->inverse_uv[0] * x + f->inverse_uv[1] * y, b2 = f->inverse_uv[2] * x + f->inverse_uv[3] * y;
    vec3 at = shell_map(s, f, b1, b2, height / s->data->scale);
    vec3 direction = v3(random_range(r, -1.0, 1.0), random_range(r, -1.0, 1.0), random_range(r, -1.0, 1.0));
    if (random_index(r, 3) == 0) direction = v3(0.0, random_index(r, 2) ? 1.0 : -1.0, 0.0);
    double tau = random_index(r, 4) ? random_range(r, 0.0, 2.0) : 0.0;
    float found[3];
    invert(part, v3_mad(at, -tau, direction), direction, tau, found);
    const double there[3] = {dx - (double)part->centre[0], dy - (double)part->centre[1],
                             height - (double)(0.5f * (part->s_min + part->s_max))};
    for (int k = 0; k < 3; k++)
        worst = fmax(worst, fabs((double)found[k] - there[k]) / (double)part->error[k]);
    return worst;
}

/* The same for barycentrics. */
static double edges_error(const fast_patch *p, const triangle_frame *f, random_state *r)
{
    double worst = 0.0, b[3] = {0.0, random_range(r, -0.05, 1.05), random_range(r, -0.05, 1.05)};
    float x = (float)(f->x[0] + b[1] * f->xe + b[2] * f->xf),
          y = (float)(f->y[0] + b[1] * f->ye + b[2] * f->yf);
    double dx = (double)x - f->x[0], dy = (double)y - f->y[0];
    b[1] = f->inverse_uv[0] * dx + f->inverse_uv[1] * dy;
    b[2] = f->inverse_uv[2] * dx + f->inverse_uv[3] * dy;
    b[0] = 1.0 - b[1] - b[2];
    for (int i = 0; i < 3; i++) {
        float found = p->edge[1][i] * x + (p->edge[2][i] * y + p->edge[0][i]);
        worst = fmax(worst, fabs((double)found - b[i]) / (double)p->edge_error[i]);
    }
    return worst;
}

static void frames_are_within_their_errors(void **state)
{
    (void)state;
    enum { SURFACES = 400, POINTS = 100 };
    knurl_context *context = make_context(UINT32_MAX);
    random_state r = {5};
    int tried = 0;
    for (int n = 0; n < SURFACES; n++) {
        random_surface s = make_random(context, &r);
        height_lod lod;
        height_lod_make(s.space, 0.0, &lod);
        for (int i = 0; i < POINTS; i++) {
            const fast_part *part = &s.data->parts[random_index(&r, s.data->part_count)];
            const fast_patch *patch = &s.data->patches[part->patch];
            if ((part->flags | patch->flags) & FAST_SEARCHED) continue;
            triangle_frame f;
            triangle_frame_load(s.space, part->patch, &lod, &f);
            double frame = frame_error(&s, &f, part, &r), edges = edges_error(patch, &f, &r);
            if (!(frame <= 1.0 && edges <= 1.0))
                fail_msg("surface %d: part %td off by %g, sides by %g of what is allowed", n,
                         part - s.data->parts, frame, edges);
            tried++;
        }
        free_random(&s);
    }
    assert_true(tried > SURFACES * POINTS / 4);
    knurl_context_release(context);
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
        cmocka_unit_test(trees_hold_every_box_once),      cmocka_unit_test(kernels_agree),
        cmocka_unit_test(triangles_are_covered),          cmocka_unit_test(budgets_hold),
        cmocka_unit_test(frames_are_within_their_errors), cmocka_unit_test(running_out_of_memory_is_clean),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
