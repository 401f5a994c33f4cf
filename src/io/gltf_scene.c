/* Nodes of glTF files flattened to instances, cameras and lights; extras of the scene. */
#include <math.h>
#include <string.h>

#include "data/description.h"
#include "io/gltf.h"
#include "io/scene_text.h"
#include "math/vec.h"

enum { MAX_INSTANCES = 1 << 24 };
#define NO_NODE UINT32_MAX

typedef struct node_walk {
    gltf_reader *g;
    gltf_at nodes, cameras, lights;
    size_t count;
    uint32_t *parent; /* NO_NODE for roots */
    bool *visited;
    uint32_t *stack;  /* nodes still to visit */
    affine *to_world; /* of visited nodes */
} node_walk;

char *gltf_name(gltf_reader *g, const gltf_at *at, const char *kind, size_t index)
{
    const char *name = gltf_string(&g->report, at, "name", NULL);
    return name ? knurl_strdup(g->context, name) : knurl_format(g->context, "%s %zu", kind, index);
}

static affine multiply(const affine *a, const affine *b)
{
    affine c;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
            double sum = j == 3 ? a->m[4 * i + 3] : 0.0;
            for (int k = 0; k < 3; k++) sum += a->m[4 * i + k] * b->m[4 * k + j];
            c.m[4 * i + j] = sum;
        }
    return c;
}

static affine from_matrix(gltf_reader *g, const gltf_at *at, const double *m)
{
    affine a;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) a.m[4 * i + j] = m[4 * j + i]; /* the file's matrices go by columns */
    if (fabs(m[3]) > 1e-6 || fabs(m[7]) > 1e-6 || fabs(m[11]) > 1e-6 || fabs(m[15] - 1.0) > 1e-6) {
        gltf_at place = gltf_member(at, "matrix");
        gltf_fail(&g->report, &place, KNURL_ERROR_INPUT,
                  "last row is (%g, %g, %g, %g), expected (0, 0, 0, 1)", m[3], m[7], m[11], m[15]);
    }
    return a;
}

static affine local_transform(gltf_reader *g, const gltf_at *at)
{
    double matrix[16], t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
    if (gltf_numbers(&g->report, at, "matrix", 16, matrix)) return from_matrix(g, at, matrix);
    gltf_numbers(&g->report, at, "translation", 3, t);
    gltf_numbers(&g->report, at, "rotation", 4, q);
    gltf_numbers(&g->report, at, "scale", 3, s);
    double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (g->report.status == KNURL_OK && !(norm > 1e-3 && norm < 1e3)) {
        gltf_at place = gltf_member(at, "rotation");
        gltf_fail(&g->report, &place, KNURL_ERROR_INPUT, "quaternion of length %g, expected 1", norm);
        return affine_identity();
    }
    double x = q[0] / norm, y = q[1] / norm, z = q[2] / norm, w = q[3] / norm;
    return (affine){{(1 - 2 * (y * y + z * z)) * s[0], 2 * (x * y - w * z) * s[1], 2 * (x * z + w * y) * s[2],
                     t[0], 2 * (x * y + w * z) * s[0], (1 - 2 * (x * x + z * z)) * s[1],
                     2 * (y * z - w * x) * s[2], t[1], 2 * (x * z - w * y) * s[0], 2 * (y * z + w * x) * s[1],
                     (1 - 2 * (x * x + y * y)) * s[2], t[2]}};
}

/* A rigid frame that keeps the axis that cameras and lights look along; scale is none of theirs. */
static bool rigid(const affine *a, double out[12])
{
    const double *m = a->m;
    vec3 z = v3_normalize(v3(m[2], m[6], m[10])), up = v3(m[1], m[5], m[9]);
    vec3 y = v3_normalize(v3_mad(up, -v3_dot(up, z), z)), x = v3_cross(y, z);
    if (!(v3_length(z) > 0.5) || !(v3_length(y) > 0.5)) return false;
    const double frame[12] = {x.x, y.x, z.x, m[3], x.y, y.y, z.y, m[7], x.z, y.z, z.z, m[11]};
    memcpy(out, frame, sizeof frame);
    return true;
}

static void warn_node(gltf_reader *g, const gltf_at *at, const char *what)
{
    char pointer[256];
    description_warn(g->description, "%s: %s: %s", g->report.file, gltf_pointer(at, pointer, sizeof pointer),
                     what);
}

static void add_instances(node_walk *w, const gltf_at *node, size_t index, const affine *to_world)
{
    gltf_reader *g = w->g;
    int64_t mesh = gltf_index(&g->report, node, "mesh", g->mesh_range_count, false);
    if (g->report.status != KNURL_OK || mesh < 0) return;
    affine inverse;
    if (!affine_invert(to_world, &inverse)) {
        warn_node(g, node, "its transform flattens the mesh, which is left out");
        return;
    }
    if (gltf_member(node, "skin").value && !g->warned_skin) {
        warn_node(g, node, "skins are ignored, the mesh keeps its rest shape");
        g->warned_skin = true;
    }
    gltf_mesh_range range = g->mesh_ranges[mesh];
    for (uint32_t i = 0; i < range.count; i++) {
        if (g->description->instance_count >= MAX_INSTANCES) {
            gltf_fail(&g->report, node, KNURL_ERROR_LIMIT, "more than %d instances", MAX_INSTANCES);
            return;
        }
        knurl_description_instance *made = description_append_instance(g->description);
        if (!made || !(made->name = gltf_name(g, node, "node", index))) {
            gltf_fail_memory(g, node, sizeof *made);
            return;
        }
        made->mesh = (int32_t)(range.first + i);
        memcpy(made->transform, to_world->m, sizeof made->transform);
    }
}

/* Our own keys, in extras of the node or else of the camera. */
static void read_lens(gltf_reader *g, const gltf_at *at, knurl_description_camera *camera)
{
    gltf_at extras = gltf_member(at, "extras");
    if (!json_is_object(extras.value)) return;
    camera->lens_radius = gltf_number(&g->report, &extras, "lens_radius", camera->lens_radius, 0.0, 1e30);
    camera->focus_distance =
        gltf_number(&g->report, &extras, "focus_distance", camera->focus_distance, 0.0, 1e30);
}

static void read_projection(gltf_reader *g, const gltf_at *at, knurl_description_camera *camera)
{
    gltf_report *r = &g->report;
    const char *type = gltf_string(r, at, "type", "");
    camera->orthographic = strcmp(type, "orthographic") == 0;
    gltf_at values = gltf_object(r, at, camera->orthographic ? "orthographic" : "perspective");
    if (r->status != KNURL_OK) return;
    if (!camera->orthographic && strcmp(type, "perspective") != 0)
        gltf_fail(r, at, KNURL_ERROR_INPUT, "type is \"%.20s\", expected perspective or orthographic", type);
    else if (!values.value)
        gltf_fail(r, &values, KNURL_ERROR_INPUT, "not there, expected the values that type %s needs", type);
    else if (camera->orthographic)
        camera->ymag = fabs(gltf_number(r, &values, "ymag", 0.0, -1e30, 1e30));
    else
        camera->yfov = gltf_number(r, &values, "yfov", 0.0, 0.0, 3.1415926);
    if (r->status == KNURL_OK && !((camera->orthographic ? camera->ymag : camera->yfov) > 0.0))
        gltf_fail(r, &values, KNURL_ERROR_INPUT, "%s is 0 or missing, expected more than 0",
                  camera->orthographic ? "ymag" : "yfov");
}

static void add_camera(node_walk *w, const gltf_at *node, const affine *to_world)
{
    gltf_reader *g = w->g;
    int64_t index = gltf_index(&g->report, node, "camera", gltf_count(&w->cameras), false);
    if (g->report.status != KNURL_OK || index < 0) return;
    double frame[12];
    if (!rigid(to_world, frame)) {
        warn_node(g, node, "its transform leaves the camera no direction; it is left out");
        return;
    }
    gltf_at at = gltf_element_object(&g->report, &w->cameras, (size_t)index);
    knurl_description_camera *camera = description_append_camera(g->description);
    const gltf_at *named = gltf_member(node, "name").value ? node : &at;
    if (!camera || !(camera->name = gltf_name(g, named, "camera", (size_t)index))) {
        gltf_fail_memory(g, node, sizeof *camera);
        return;
    }
    memcpy(camera->transform, frame, sizeof frame);
    read_projection(g, &at, camera);
    read_lens(g, &at, camera);
    read_lens(g, node, camera);
}

static void read_light(gltf_reader *g, const gltf_at *at, knurl_description_light *light)
{
    gltf_report *r = &g->report;
    const char *type = gltf_string(r, at, "type", "");
    if (strcmp(type, "point") == 0)
        light->kind = KNURL_LIGHT_POINT;
    else if (strcmp(type, "spot") == 0)
        light->kind = KNURL_LIGHT_SPOT;
    else if (strcmp(type, "directional") == 0)
        light->kind = KNURL_LIGHT_DIRECTIONAL;
    else
        gltf_fail(r, at, KNURL_ERROR_INPUT, "type is \"%.20s\", expected point, spot or directional", type);
    gltf_numbers(r, at, "color", 3, light->color);
    light->intensity = gltf_number(r, at, "intensity", 1.0, 0.0, 1e30);
    light->range = gltf_number(r, at, "range", INFINITY, 0.0, INFINITY);
    gltf_at spot = gltf_object(r, at, "spot");
    const double half_pi = 1.5707963267948966;
    light->outer_cone = gltf_number(r, &spot, "outerConeAngle", half_pi / 2, 0.0, half_pi + 1e-6);
    light->inner_cone = gltf_number(r, &spot, "innerConeAngle", 0.0, 0.0, light->outer_cone);
}

static void add_light(node_walk *w, const gltf_at *node, const affine *to_world)
{
    gltf_reader *g = w->g;
    gltf_extension e;
    gltf_extension_open(&g->report, node, "KHR_lights_punctual", &e);
    if (!e.at.value) return;
    int64_t index = gltf_index(&g->report, &e.at, "light", gltf_count(&w->lights), true);
    if (g->report.status != KNURL_OK || index < 0) return;
    double frame[12];
    if (!rigid(to_world, frame)) {
        warn_node(g, node, "its transform leaves the light no direction; it is left out");
        return;
    }
    gltf_at at = gltf_element_object(&g->report, &w->lights, (size_t)index);
    knurl_description_light *light = description_append_light(g->description);
    const gltf_at *named = gltf_member(node, "name").value ? node : &at;
    if (!light || !(light->name = gltf_name(g, named, "light", (size_t)index))) {
        gltf_fail_memory(g, node, sizeof *light);
        return;
    }
    memcpy(light->transform, frame, sizeof frame);
    read_light(g, &at, light);
}

/* Notes every node's parent; a node with two is no tree. */
static void find_parents(node_walk *w)
{
    gltf_report *r = &w->g->report;
    for (size_t i = 0; i < w->count; i++) w->parent[i] = NO_NODE;
    for (size_t i = 0; i < w->count && r->status == KNURL_OK; i++) {
        gltf_at node = gltf_element_object(r, &w->nodes, i), children = gltf_array(r, &node, "children");
        for (size_t c = 0; c < gltf_count(&children) && r->status == KNURL_OK; c++) {
            gltf_at place = gltf_element(&children, c);
            int64_t child = gltf_index_value(r, &place, w->count);
            if (child < 0) return;
            if (w->parent[child] != NO_NODE)
                gltf_fail(r, &place, KNURL_ERROR_INPUT, "node %lld is a child of node %u already",
                          (long long)child, w->parent[child]);
            w->parent[child] = (uint32_t)i;
        }
    }
}

/* Puts a node and, one after another, all below it into the description. */
static void visit_tree(node_walk *w, uint32_t root)
{
    gltf_report *r = &w->g->report;
    size_t depth = 0;
    w->stack[depth++] = root;
    affine above = affine_identity();
    while (depth && r->status == KNURL_OK) {
        uint32_t index = w->stack[--depth];
        gltf_at node = gltf_element_object(r, &w->nodes, index);
        if (w->visited[index]) {
            gltf_fail(r, &node, KNURL_ERROR_INPUT,
                      "the node is met twice: its parents form a loop or the scene lists it again");
            return;
        }
        w->visited[index] = true;
        affine local = local_transform(w->g, &node);
        const affine *parent =
            index == root || w->parent[index] == NO_NODE ? &above : &w->to_world[w->parent[index]];
        w->to_world[index] = multiply(parent, &local);
        const affine *to_world = &w->to_world[index];
        for (int i = 0; i < 12 && r->status == KNURL_OK; i++)
            if (!isfinite(to_world->m[i]))
                gltf_fail(r, &node, KNURL_ERROR_INPUT, "its transform is not finite");
        if (r->status == KNURL_OK) add_instances(w, &node, index, to_world);
        if (r->status == KNURL_OK) add_camera(w, &node, to_world);
        if (r->status == KNURL_OK) add_light(w, &node, to_world);
        gltf_at children = gltf_array(r, &node, "children");
        /* Backwards, so that they come off the stack in the file's order. Each node has one parent, so
         * the stack holds each at most once. */
        for (size_t c = gltf_count(&children); c-- > 0 && r->status == KNURL_OK;) {
            gltf_at place = gltf_element(&children, c);
            int64_t child = gltf_index_value(r, &place, w->count);
            if (child >= 0) w->stack[depth++] = (uint32_t)child;
        }
    }
}

/* A ring of nodes that no root leads to would else be passed over in silence. */
static void check_loops(node_walk *w)
{
    for (size_t i = 0; i < w->count; i++) w->visited[i] = false;
    for (size_t i = 0; i < w->count; i++) {
        size_t length = 0;
        uint32_t at = (uint32_t)i;
        while (at != NO_NODE && !w->visited[at] && length < w->count) {
            w->stack[length++] = at;
            w->visited[at] = true;
            at = w->parent[at];
        }
        /* Met again within this very walk: a loop. */
        for (size_t k = 0; k < length && at != NO_NODE; k++) {
            if (w->stack[k] != at) continue;
            gltf_at node = gltf_element(&w->nodes, at), children = gltf_member(&node, "children");
            gltf_fail(&w->g->report, &children, KNURL_ERROR_INPUT, "node %u is below itself", at);
            return;
        }
    }
    for (size_t i = 0; i < w->count; i++) w->visited[i] = false;
}

/* Scene extras {"environment": {"image": "sky.hdr", "intensity": 1, "rotation": 0}}. */
static void read_environment(gltf_reader *g, const gltf_at *scene)
{
    gltf_report *r = &g->report;
    gltf_at extras = gltf_member(scene, "extras");
    if (!json_is_object(extras.value)) return;
    gltf_at at = gltf_object(r, &extras, "environment");
    const char *name = gltf_string(r, &at, "image", NULL);
    knurl_description *d = g->description;
    d->environment_intensity = gltf_number(r, &at, "intensity", 1.0, 0.0, 1e30);
    d->environment_rotation = gltf_number(r, &at, "rotation", 0.0, -1e9, 1e9);
    if (!name || r->status != KNURL_OK) return;
    gltf_at place = gltf_member(&at, "image");
    char *path = gltf_uri_path(g, &place, name);
    if (!path) return;
    d->environment.image = knurl_description_add_image(d, path);
    d->environment.wrap_v = KNURL_WRAP_CLAMP;
    if (d->environment.image < 0) gltf_fail_memory(g, &place, strlen(path));
    knurl_free(g->context, path);
}

static void visit_scene(node_walk *w)
{
    gltf_report *r = &w->g->report;
    gltf_at scenes = gltf_array(r, &w->g->root, "scenes");
    int64_t chosen = gltf_index(r, &w->g->root, "scene", gltf_count(&scenes), false);
    if (chosen < 0) chosen = 0;
    if (r->status != KNURL_OK) return;
    if (gltf_count(&scenes) == 0) {
        for (uint32_t i = 0; i < w->count && r->status == KNURL_OK; i++)
            if (w->parent[i] == NO_NODE) visit_tree(w, i);
        return;
    }
    gltf_at scene = gltf_element_object(r, &scenes, (size_t)chosen), roots = gltf_array(r, &scene, "nodes");
    for (size_t i = 0; i < gltf_count(&roots) && r->status == KNURL_OK; i++) {
        gltf_at place = gltf_element(&roots, i);
        int64_t root = gltf_index_value(r, &place, w->count);
        if (root < 0) return;
        if (w->parent[root] != NO_NODE)
            gltf_fail(r, &place, KNURL_ERROR_INPUT, "node %lld is a child of node %u, expected a root",
                      (long long)root, w->parent[root]);
        else
            visit_tree(w, (uint32_t)root);
    }
    read_environment(w->g, &scene);
}

void gltf_read_scene(gltf_reader *g)
{
    node_walk w = {.g = g};
    w.nodes = gltf_array(&g->report, &g->root, "nodes");
    w.cameras = gltf_array(&g->report, &g->root, "cameras");
    gltf_extension lights;
    gltf_extension_open(&g->report, &g->root, "KHR_lights_punctual", &lights);
    w.lights = gltf_array(&g->report, &lights.at, "lights");
    w.count = gltf_count(&w.nodes);
    if (w.count >= NO_NODE) gltf_fail(&g->report, &w.nodes, KNURL_ERROR_LIMIT, "%zu nodes", w.count);
    if (g->report.status != KNURL_OK) return;
    w.parent = knurl_alloc_array(g->context, w.count, sizeof *w.parent);
    w.visited = knurl_alloc_zero(g->context, w.count * sizeof *w.visited);
    w.stack = knurl_alloc_array(g->context, w.count, sizeof *w.stack);
    w.to_world = knurl_alloc_array(g->context, w.count, sizeof *w.to_world);
    if (!w.parent || !w.visited || !w.stack || !w.to_world) {
        gltf_fail_memory(g, &w.nodes, w.count * sizeof(affine));
    } else {
        find_parents(&w);
        if (g->report.status == KNURL_OK) check_loops(&w);
        if (g->report.status == KNURL_OK) visit_scene(&w);
    }
    knurl_free(g->context, w.parent);
    knurl_free(g->context, w.visited);
    knurl_free(g->context, w.stack);
    knurl_free(g->context, w.to_world);
}
