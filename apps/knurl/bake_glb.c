/* bake_glb.c: binary glTF 2.0. A mesh for each object, a node for each instance, materials with their
 * colours.
 *
 * The JSON comes before the data and says how large they are and where their positions lie, so each object is
 * walked once for its bounds before anything is written. */
#include "bake.h"
#include "bake_glb.h"
#include "json_file.h"

#include <math.h>
#include <string.h>

enum {
    VERTEX_BYTES = 32,
    TRIANGLE_BYTES = 12,
    FLOATS = 5126,
    UNSIGNED = 5125,
    VERTICES = 34962,
    INDICES = 34963,
    COUNTED = -2 /* a mesh without a number yet whose bytes are in the sum */
};

typedef struct glb_bounds {
    float lower[3], upper[3];
} glb_bounds;

static int grow_bounds(bake_job *job, void *user, const bake_block *block)
{
    (void)job;
    glb_bounds *b = user;
    for (size_t i = 0; i < 3 * block->count; i++) {
        b->lower[i % 3] = fminf(b->lower[i % 3], block->positions[i]);
        b->upper[i % 3] = fmaxf(b->upper[i % 3], block->positions[i]);
    }
    return CODE_DONE;
}

static json_t *corner(const float p[3])
{
    const double wide[3] = {(double)p[0], (double)p[1], (double)p[2]};
    return json_numbers(wide, 3);
}

static int append(json_t *array, json_t *value)
{
    int index = (int)json_array_size(array);
    return json_array_append_new(array, value) == 0 ? index : -1;
}

static json_t *array_of(json_t *root, const char *key)
{
    json_t *array = json_object_get(root, key);
    if (array) return array;
    (void)json_object_set_new(root, key, json_array());
    return json_object_get(root, key);
}

int glb_view(glb_document *g, uint64_t bytes, int target, int stride)
{
    json_t *view = json_pack("{s:i, s:o, s:o}", "buffer", 0, "byteOffset", json_count(g->bytes), "byteLength",
                             json_count(bytes));
    if (target) (void)json_object_set_new(view, "target", json_integer(target));
    if (stride) (void)json_object_set_new(view, "byteStride", json_integer(stride));
    g->bytes += (bytes + 3) / 4 * 4;
    return append(array_of(g->root, "bufferViews"), view);
}

static int add_accessor(glb_document *g, int view, int offset, uint64_t count, int component,
                        const char *type)
{
    return append(array_of(g->root, "accessors"),
                  json_pack("{s:i, s:i, s:i, s:o, s:s}", "bufferView", view, "byteOffset", offset,
                            "componentType", component, "count", json_count(count), "type", type));
}

static int add_mesh(glb_document *g, const bake_part *part, const glb_bounds *bounds, int material)
{
    int vertices = glb_view(g, part->vertices * VERTEX_BYTES, VERTICES, VERTEX_BYTES);
    int indices = glb_view(g, part->triangles * TRIANGLE_BYTES, INDICES, 0);
    int position = add_accessor(g, vertices, 0, part->vertices, FLOATS, "VEC3");
    json_t *accessor = json_array_get(json_object_get(g->root, "accessors"), (size_t)position);
    (void)json_object_set_new(accessor, "min", corner(bounds->lower));
    (void)json_object_set_new(accessor, "max", corner(bounds->upper));
    int normal = add_accessor(g, vertices, 12, part->vertices, FLOATS, "VEC3");
    int texcoord = add_accessor(g, vertices, 24, part->vertices, FLOATS, "VEC2");
    int index = add_accessor(g, indices, 0, 3 * part->triangles, UNSIGNED, "SCALAR");
    return append(array_of(g->root, "meshes"),
                  json_pack("{s:o, s:[{s:{s:i, s:i, s:i}, s:i, s:i}]}", "name", json_text(part->mesh->name),
                            "primitives", "attributes", "POSITION", position, "NORMAL", normal, "TEXCOORD_0",
                            texcoord, "indices", index, "material", material));
}

/* glTF's matrices go column by column. */
static void add_node(glb_document *g, const knurl_description_instance *instance, int mesh)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    const double *m = instance->transform;
    json_t *node = json_pack("{s:i}", "mesh", mesh);
    if (instance->name) (void)json_object_set_new(node, "name", json_text(instance->name));
    if (memcmp(m, identity, sizeof identity) != 0) {
        double columns[16];
        for (int c = 0; c < 4; c++)
            for (int r = 0; r < 4; r++) columns[4 * c + r] = r < 3 ? m[4 * r + c] : c == 3 ? 1.0 : 0.0;
        (void)json_object_set_new(node, "matrix", json_numbers(columns, 16));
    }
    int index = append(array_of(g->root, "nodes"), node);
    (void)append(g->scene_nodes, json_integer(index));
}

/* Names may not be null in glTF. */
static void drop_nulls(json_t *value)
{
    const char *key;
    json_t *child;
    void *next;
    size_t i;
    if (json_is_array(value)) json_array_foreach(value, i, child) drop_nulls(child);
    json_object_foreach_safe(value, next, key, child)
    {
        if (json_is_null(child))
            (void)json_object_del(value, key);
        else
            drop_nulls(child);
    }
}

static int describe_meshes(bake_job *job, glb_document *g)
{
    const knurl_description *d = job->description;
    int code = CODE_DONE;
    for (uint32_t i = 0; i < d->instance_count && code == CODE_DONE; i++) {
        int32_t mesh = d->instances[i].mesh;
        if (!bake_is_seen(job, i)) continue;
        if (g->meshes[mesh] < 0) {
            glb_bounds bounds = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
            code = bake_vertices(job, &job->parts[mesh], NULL, grow_bounds, &bounds);
            if (code != CODE_DONE) return code;
            g->meshes[mesh] =
                add_mesh(g, &job->parts[mesh], &bounds, glb_material(g, d->meshes[mesh].material));
            g->order[g->mesh_count++] = mesh;
        }
        add_node(g, &d->instances[i], g->meshes[mesh]);
    }
    return code;
}

static int write_vertices(bake_job *job, void *user, const bake_block *block)
{
    (void)user;
    float *rows = (float *)(void *)job->rows;
    for (size_t i = 0; i < block->count; i++) {
        memcpy(rows + 8 * i, block->positions + 3 * i, 3 * sizeof *rows);
        memcpy(rows + 8 * i + 3, block->normals + 3 * i, 3 * sizeof *rows);
        memcpy(rows + 8 * i + 6, block->texcoords + 2 * i, 2 * sizeof *rows);
    }
    return bake_write(job, rows, block->count * VERTEX_BYTES);
}

static int write_triangles(bake_job *job, void *user, const uint32_t *indices, size_t count)
{
    (void)user;
    return bake_write(job, indices, count * TRIANGLE_BYTES);
}

static int fail_size(bake_job *job, uint64_t bytes)
{
    return session_fail_with(job->session, CODE_LIMIT,
                             "a GLB file holds 4 GiB at most, found %llu bytes; lower --rate, or write PLY",
                             (unsigned long long)bytes);
}

/* Chunks end on multiples of 4: JSON is filled with blanks. */
static int write_chunks(bake_job *job, glb_document *g, const char *text)
{
    size_t length = strlen(text), filled = (length + 3) / 4 * 4;
    uint64_t total = 12 + 8 + filled + 8 + g->bytes;
    if (total > UINT32_MAX) return fail_size(job, total);
    const uint32_t head[5] = {0x46546c67u, 2, (uint32_t)total, (uint32_t)filled, 0x4e4f534au};
    const uint32_t data[2] = {(uint32_t)g->bytes, 0x004e4942u};
    int code = bake_write(job, head, sizeof head);
    if (code == CODE_DONE) code = bake_write(job, text, length);
    if (code == CODE_DONE) code = bake_write(job, "   ", filled - length);
    if (code == CODE_DONE) code = bake_write(job, data, sizeof data);
    for (uint32_t i = 0; i < g->mesh_count && code == CODE_DONE; i++) {
        const bake_part *part = &job->parts[g->order[i]];
        code = bake_vertices(job, part, NULL, write_vertices, NULL);
        if (code == CODE_DONE) code = bake_triangles(job, part, write_triangles, NULL);
    }
    for (uint32_t i = 0; i < g->image_count && code == CODE_DONE; i++) {
        code = bake_write(job, g->images[i].bytes, g->images[i].size);
        if (code == CODE_DONE) code = bake_write(job, "\0\0\0", (4 - g->images[i].size % 4) % 4);
    }
    return code;
}

static int write_document(bake_job *job, glb_document *g)
{
    /* Known before anything is walked. */
    const knurl_description *d = job->description;
    uint64_t least = 0;
    for (uint32_t i = 0; i < d->instance_count; i++) {
        int32_t mesh = d->instances[i].mesh;
        if (!bake_is_seen(job, i) || g->meshes[mesh] == COUNTED) continue;
        g->meshes[mesh] = COUNTED;
        least += job->parts[mesh].vertices * VERTEX_BYTES + job->parts[mesh].triangles * TRIANGLE_BYTES;
    }
    if (least > UINT32_MAX) return fail_size(job, least);
    g->root = json_pack("{s:{s:s, s:s}, s:i, s:[{}]}", "asset", "version", "2.0", "generator",
                        "knurl " KNURL_VERSION_STRING, "scene", 0, "scenes");
    g->scene_nodes = json_array();
    int code = describe_meshes(job, g);
    if (code != CODE_DONE) return code;
    glb_images(g);
    (void)json_object_set(json_array_get(json_object_get(g->root, "scenes"), 0), "nodes", g->scene_nodes);
    (void)json_object_set_new(g->root, "buffers", json_pack("[{s:o}]", "byteLength", json_count(g->bytes)));
    drop_nulls(g->root);
    char *text = json_dumps(g->root, JSON_COMPACT);
    if (!text) return session_fail_with(job->session, CODE_LIMIT, "out of memory for the glTF document");
    code = write_chunks(job, g, text);
    free(text);
    return code;
}

int bake_glb(bake_job *job)
{
    glb_document g;
    if (!glb_begin(&g, job)) {
        glb_end(&g);
        return session_fail_with(job->session, CODE_LIMIT, "out of memory for the glTF document");
    }
    int code = write_document(job, &g);
    glb_end(&g);
    return code;
}
