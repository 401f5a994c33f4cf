/* Wavefront OBJ. Read here and not by assimp, which unshares the vertices and cannot name the line of
 * a mistake. What each statement means for knurl: docs/scene-format.md. */
#include <math.h>
#include <string.h>

#include "data/description.h"
#include "io/mtl.h"
#include "io/obj_names.h"
#include "io/obj_polygon.h"
#include "io/scene.h"
#include "io/scene_weld.h"

enum { MAX_LIBRARIES = 256, CORNER_WORDS = 3 };
#define OBJ_ABSENT UINT32_MAX

typedef struct float_array {
    float *data;
    size_t count, capacity; /* floats */
} float_array;

typedef struct corner_array {
    uint32_t *data;         /* position, texture coordinate, normal; OBJ_ABSENT for none */
    size_t count, capacity; /* words */
} corner_array;

/* Faces of one object with one material. */
typedef struct obj_mesh {
    corner_array corners; /* three per triangle */
    text_span object;
    uint32_t object_number;
    uint32_t material_name; /* OBJ_ABSENT before the first usemtl */
} obj_mesh;

typedef struct obj_reader {
    knurl_description *description;
    knurl_context *context;
    knurl_error *error;
    const char *path;
    bool files;
    uint32_t line;
    float_array positions, texcoords, normals;
    corner_array face; /* of the line being read */
    float_array face_positions;
    uint32_t *face_triangles;
    size_t face_capacity;
    obj_mesh *meshes;
    uint32_t mesh_count, mesh_capacity;
    uint32_t mesh;       /* that takes the next face, OBJ_ABSENT: to be found */
    uint32_t plain_mesh; /* the current object's mesh without material */
    text_span object;
    uint32_t object_number, material_name;
    obj_names names;
    char *libraries[MAX_LIBRARIES];
    uint32_t library_count;
    bool warned_elements, warned_unknown, warned_short;
} obj_reader;

static knurl_status fail_at(obj_reader *r, const char *what, text_span found, const char *expected)
{
    return knurl_fail(r->error, KNURL_ERROR_INPUT, "%s:%u: %s: found \"%.*s\", expected %s", r->path, r->line,
                      what, text_shown(found), found.begin ? found.begin : "", expected);
}

/* Room for `more` elements of `size` bytes after `count`. */
static bool reserve(obj_reader *r, void **data, size_t count, size_t *capacity, size_t more, size_t size)
{
    if (more <= *capacity - count) return true;
    size_t wanted = *capacity < 16 ? 16 : *capacity, bytes;
    while (wanted - count < more)
        if (knurl_mul_overflow(wanted, 2, &wanted)) return false;
    void *grown = knurl_mul_overflow(wanted, size, &bytes) ? NULL : knurl_realloc(r->context, *data, bytes);
    if (!grown) return false;
    *data = grown;
    *capacity = wanted;
    return true;
}

static knurl_status push_floats(obj_reader *r, float_array *array, const double *values, size_t count)
{
    void *data = array->data;
    if (array->count / 2 >= UINT32_MAX - 1)
        return knurl_fail(r->error, KNURL_ERROR_LIMIT, "%s:%u: more than 2^32 vertices", r->path, r->line);
    if (!reserve(r, &data, array->count, &array->capacity, count, sizeof(float)))
        return knurl_fail_memory(r->error, array->count * sizeof(float), r->path);
    array->data = data;
    for (size_t i = 0; i < count; i++) array->data[array->count++] = (float)values[i];
    return KNURL_OK;
}

/* v, vt or vn: `least` to `most` numbers. */
static knurl_status read_vector(obj_reader *r, const char *key, text_span rest, int least, int most,
                                float_array *array)
{
    double values[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < most; i++) {
        text_span word;
        if (!text_next_word(&rest, &word)) {
            if (i >= least) break;
            return fail_at(r, key, word, "one more number");
        }
        if (!text_number(word, &values[i]) || !isfinite((float)values[i]))
            return fail_at(r, key, word, "a finite number");
    }
    if (most == 2) values[1] = 1.0 - values[1]; /* v = 0 becomes the image's first row */
    return push_floats(r, array, values, (size_t)most);
}

/* One of the numbers in v/vt/vn, up to a slash or the end: 1 is the first, -1 the last so far. */
static knurl_status read_index(obj_reader *r, const char **at, const char *end, size_t have, const char *what,
                               uint32_t *index)
{
    text_span word = {*at, *at};
    while (word.end < end && *word.end != '/') word.end++;
    *at = word.end < end ? word.end + 1 : end;
    int64_t number;
    if (!text_integer(word, &number)) return fail_at(r, "f", word, "an index such as 1, 1/1, 1//1 or 1/1/1");
    int64_t place = number > 0 ? number - 1 : (int64_t)have + number;
    if (number == 0 || place < 0 || place >= (int64_t)have)
        return knurl_fail(r->error, KNURL_ERROR_INPUT,
                          "%s:%u: %s index is %lld, expected 1 to %zu or -%zu to -1", r->path, r->line, what,
                          (long long)number, have, have);
    *index = (uint32_t)place;
    return KNURL_OK;
}

static knurl_status read_corner(obj_reader *r, text_span word, uint32_t corner[CORNER_WORDS])
{
    corner[1] = corner[2] = OBJ_ABSENT;
    const char *at = word.begin;
    knurl_status status = read_index(r, &at, word.end, r->positions.count / 3, "vertex", &corner[0]);
    if (status == KNURL_OK && at < word.end) {
        if (*at == '/')
            at++;
        else
            status = read_index(r, &at, word.end, r->texcoords.count / 2, "texture coordinate", &corner[1]);
    }
    if (status == KNURL_OK && at < word.end)
        status = read_index(r, &at, word.end, r->normals.count / 3, "normal", &corner[2]);
    if (status == KNURL_OK && at < word.end) status = fail_at(r, "f", word, "at most three indices");
    return status;
}

/* The mesh of the current object and material; made when they meet for the first time. */
static knurl_status find_mesh(obj_reader *r)
{
    if (r->mesh != OBJ_ABSENT) return KNURL_OK;
    uint32_t *known =
        r->material_name == OBJ_ABSENT ? &r->plain_mesh : &r->names.names[r->material_name].mesh;
    if (*known != OBJ_ABSENT && r->meshes[*known].object_number == r->object_number) {
        r->mesh = *known;
        return KNURL_OK;
    }
    void *data = r->meshes;
    size_t capacity = r->mesh_capacity;
    if (r->mesh_count >= INT32_MAX / 2)
        return knurl_fail(r->error, KNURL_ERROR_LIMIT, "%s:%u: too many meshes", r->path, r->line);
    if (!reserve(r, &data, r->mesh_count, &capacity, 1, sizeof(obj_mesh)))
        return knurl_fail_memory(r->error, capacity * sizeof(obj_mesh), r->path);
    r->meshes = data;
    r->mesh_capacity = (uint32_t)capacity;
    r->meshes[r->mesh_count] =
        (obj_mesh){.object = r->object, .object_number = r->object_number, .material_name = r->material_name};
    r->mesh = *known = r->mesh_count++;
    return KNURL_OK;
}

/* Cuts the face of this line into triangles: numbers of its corners in r->face_triangles. */
static knurl_status cut_face(obj_reader *r, uint32_t corners)
{
    r->face_positions.count = 0;
    void *floats = r->face_positions.data, *triangles = r->face_triangles;
    if (!reserve(r, &floats, 0, &r->face_positions.capacity, 3 * (size_t)corners, sizeof(float)))
        return knurl_fail_memory(r->error, corners * sizeof(float), r->path);
    r->face_positions.data = floats;
    if (!reserve(r, &triangles, 0, &r->face_capacity, 3 * (size_t)corners, sizeof(uint32_t)))
        return knurl_fail_memory(r->error, corners * sizeof(uint32_t), r->path);
    r->face_triangles = triangles;
    for (uint32_t i = 0; i < corners; i++)
        memcpy(r->face_positions.data + 3 * (size_t)i,
               r->positions.data + 3 * (size_t)r->face.data[CORNER_WORDS * (size_t)i], 3 * sizeof(float));
    if (corners > OBJ_POLYGON_MAX_EARS)
        description_warn(r->description, "%s:%u: a face of %u corners is cut as if it were convex", r->path,
                         r->line, corners);
    obj_polygon_triangulate(r->face_positions.data, corners, r->face_triangles);
    return KNURL_OK;
}

static knurl_status read_face(obj_reader *r, text_span rest)
{
    text_span word;
    r->face.count = 0;
    while (text_next_word(&rest, &word)) {
        void *data = r->face.data;
        if (!reserve(r, &data, r->face.count, &r->face.capacity, CORNER_WORDS, sizeof(uint32_t)))
            return knurl_fail_memory(r->error, r->face.count * sizeof(uint32_t), r->path);
        r->face.data = data;
        knurl_status status = read_corner(r, word, r->face.data + r->face.count);
        if (status != KNURL_OK) return status;
        r->face.count += CORNER_WORDS;
    }
    if (r->face.count / CORNER_WORDS > UINT32_MAX / 4)
        return knurl_fail(r->error, KNURL_ERROR_LIMIT, "%s:%u: a face of too many corners", r->path, r->line);
    uint32_t corners = (uint32_t)(r->face.count / CORNER_WORDS);
    if (corners < 3) {
        if (!r->warned_short)
            description_warn(r->description, "%s:%u: a face of %u corners is left out, expected at least 3",
                             r->path, r->line, corners);
        r->warned_short = true;
        return KNURL_OK;
    }
    knurl_status status = find_mesh(r);
    if (status == KNURL_OK) status = cut_face(r, corners);
    if (status != KNURL_OK) return status;
    corner_array *out = &r->meshes[r->mesh].corners;
    size_t indices = 3 * (size_t)(corners - 2);
    void *data = out->data;
    if (!reserve(r, &data, out->count, &out->capacity, indices * CORNER_WORDS, sizeof(uint32_t)))
        return knurl_fail_memory(r->error, out->count * sizeof(uint32_t), r->path);
    out->data = data;
    for (size_t i = 0; i < indices; i++, out->count += CORNER_WORDS)
        memcpy(out->data + out->count, r->face.data + CORNER_WORDS * (size_t)r->face_triangles[i],
               CORNER_WORDS * sizeof(uint32_t));
    return KNURL_OK;
}

/* Reads one library; *found says whether there is such a file. */
static knurl_status read_library(obj_reader *r, text_span name, bool *found)
{
    *found = false;
    char *path = text_path_beside(r->context, r->path, name.begin, (size_t)(name.end - name.begin));
    if (!path) return knurl_fail_memory(r->error, (size_t)(name.end - name.begin), r->path);
    for (uint32_t i = 0; i < r->library_count && !*found; i++) *found = strcmp(r->libraries[i], path) == 0;
    unsigned char *bytes = NULL;
    size_t size = 0;
    knurl_status status = KNURL_OK;
    if (!*found && r->files) {
        knurl_error missing = {0};
        status = knurl_file_read(r->context, path, &bytes, &size, &missing);
        *found = status == KNURL_OK;
        if (status == KNURL_ERROR_INPUT) status = KNURL_OK;
        if (status != KNURL_OK && r->error) *r->error = missing;
    }
    if (bytes && r->library_count == MAX_LIBRARIES)
        status = knurl_fail(r->error, KNURL_ERROR_LIMIT, "%s:%u: more than %d material libraries", r->path,
                            r->line, MAX_LIBRARIES);
    if (bytes && status == KNURL_OK) {
        r->libraries[r->library_count++] = path;
        status = mtl_read(r->description, bytes, size, path, r->error);
        path = NULL;
    }
    knurl_free(r->context, bytes);
    knurl_free(r->context, path);
    return status;
}

/* The rest of the line may be one name with blanks, or several names. */
static knurl_status read_libraries(obj_reader *r, text_span rest)
{
    bool found;
    knurl_status status = read_library(r, rest, &found);
    text_span word;
    bool all = found;
    for (text_span left = rest; status == KNURL_OK && !found && text_next_word(&left, &word);) {
        bool one = false;
        if (word.end - word.begin != rest.end - rest.begin) status = read_library(r, word, &one);
        all = one;
        if (!one) break;
    }
    if (status == KNURL_OK && !all)
        description_warn(r->description, "%s:%u: material library \"%.*s\" is not there; materials are grey",
                         r->path, r->line, text_shown(rest), rest.begin);
    return status;
}

static knurl_status read_material(obj_reader *r, text_span rest)
{
    r->mesh = OBJ_ABSENT;
    r->material_name = obj_names_find(&r->names, rest);
    if (r->material_name == UINT32_MAX) return knurl_fail_memory(r->error, 64, r->path);
    return KNURL_OK;
}

static void read_other(obj_reader *r, text_span key)
{
    static const char *const harmless[] = {"g",      "s",          "mg",       "lod",
                                           "bevel",  "c_interp",   "d_interp", "usemap",
                                           "maplib", "shadow_obj", "trace_obj"};
    static const char *const elements[] = {"l",   "p",     "vp",    "curv", "curv2", "surf", "cstype",
                                           "deg", "parm",  "trim",  "hole", "scrv",  "sp",   "end",
                                           "con", "ctech", "stech", "bmat", "step"};
    for (size_t i = 0; i < sizeof harmless / sizeof *harmless; i++)
        if (text_is(key, harmless[i])) return;
    for (size_t i = 0; i < sizeof elements / sizeof *elements; i++) {
        if (!text_is(key, elements[i])) continue;
        if (!r->warned_elements)
            description_warn(r->description,
                             "%s:%u: points, lines and free-form geometry (%.*s) are left out", r->path,
                             r->line, text_shown(key), key.begin);
        r->warned_elements = true;
        return;
    }
    if (!r->warned_unknown)
        description_warn(r->description,
                         "%s:%u: statement \"%.*s\" is not known and ignored, as are others after it",
                         r->path, r->line, text_shown(key), key.begin);
    r->warned_unknown = true;
}

static knurl_status read_statement(obj_reader *r, text_span key, text_span rest)
{
    if (text_is(key, "v")) return read_vector(r, "v", rest, 3, 3, &r->positions);
    if (text_is(key, "vt")) return read_vector(r, "vt", rest, 1, 2, &r->texcoords);
    if (text_is(key, "vn")) return read_vector(r, "vn", rest, 3, 3, &r->normals);
    if (text_is(key, "f") || text_is(key, "fo")) return read_face(r, rest);
    if (text_is(key, "usemtl")) return read_material(r, rest);
    if (text_is(key, "mtllib")) return read_libraries(r, rest);
    if (text_is(key, "o")) {
        r->object = rest;
        r->object_number++;
        r->mesh = OBJ_ABSENT;
        return KNURL_OK;
    }
    read_other(r, key);
    return KNURL_OK;
}

static knurl_status resolve_materials(obj_reader *r)
{
    knurl_description *d = r->description;
    for (uint32_t i = 0; i < d->material_count; i++) {
        const char *name = d->materials[i].name;
        uint32_t number = obj_names_find(&r->names, (text_span){name, name + strlen(name)});
        if (number == UINT32_MAX) return knurl_fail_memory(r->error, 64, r->path);
        if (r->names.names[number].material < 0)
            r->names.names[number].material = (int32_t)i;
        else
            description_warn(d, "%s: material \"%s\" is defined twice, the first one counts", r->path, name);
    }
    for (uint32_t i = 0; i < r->names.count; i++) {
        const obj_name *n = &r->names.names[i];
        if (n->material < 0 && n->mesh != UINT32_MAX)
            description_warn(d, "%s: material \"%.*s\" is not defined, the default grey is used", r->path,
                             text_shown(n->text), n->text.begin);
    }
    return KNURL_OK;
}

static char *mesh_name(obj_reader *r, const obj_mesh *m)
{
    const text_span object = m->object;
    if (m->material_name == OBJ_ABSENT && object.begin == object.end) return knurl_strdup(r->context, "mesh");
    if (m->material_name == OBJ_ABSENT) return text_copy(r->context, object);
    const text_span material = r->names.names[m->material_name].text;
    if (object.begin == object.end) return text_copy(r->context, material);
    return knurl_format(r->context, "%.*s/%.*s", text_shown(object), object.begin, text_shown(material),
                        material.begin);
}

/* Copies the vertices that corners `first` name; texture coordinates and normals only where the mesh
 * has them. */
static knurl_status copy_vertices(obj_reader *r, const obj_mesh *m, const uint32_t *first,
                                  knurl_description_mesh *out)
{
    size_t n = out->vertex_count, bare = 0, missing = 0;
    for (size_t i = 0; i < n; i++) {
        const uint32_t *corner = m->corners.data + CORNER_WORDS * (size_t)first[i];
        bare += corner[1] == OBJ_ABSENT;
        missing += corner[2] == OBJ_ABSENT;
    }
    if (bare && bare < n)
        description_warn(r->description,
                         "%s: mesh \"%s\": %zu of %zu vertices have no texture coordinates, (0, 0) is used",
                         r->path, out->name, bare, n);
    if (missing && missing < n)
        description_warn(
            r->description,
            "%s: mesh \"%s\": %zu of %zu vertices have no normals; smooth normals are made for all", r->path,
            out->name, missing, n);
    out->positions = knurl_alloc_array(r->context, n, 3 * sizeof(float));
    if (bare < n) out->texcoords = knurl_alloc_array(r->context, n, 2 * sizeof(float));
    if (!missing) out->normals = knurl_alloc_array(r->context, n, 3 * sizeof(float));
    if (!out->positions || (bare < n && !out->texcoords) || (!missing && !out->normals))
        return knurl_fail_memory(r->error, n * 8 * sizeof(float), r->path);
    for (size_t i = 0; i < n; i++) {
        const uint32_t *corner = m->corners.data + CORNER_WORDS * (size_t)first[i];
        memcpy(out->positions + 3 * i, r->positions.data + 3 * (size_t)corner[0], 3 * sizeof(float));
        if (out->texcoords && corner[1] == OBJ_ABSENT)
            out->texcoords[2 * i] = out->texcoords[2 * i + 1] = 0.0f;
        else if (out->texcoords)
            memcpy(out->texcoords + 2 * i, r->texcoords.data + 2 * (size_t)corner[1], 2 * sizeof(float));
        if (out->normals)
            memcpy(out->normals + 3 * i, r->normals.data + 3 * (size_t)corner[2], 3 * sizeof(float));
    }
    return KNURL_OK;
}

static knurl_status build_mesh(obj_reader *r, obj_mesh *m)
{
    knurl_description_mesh *out = description_append_mesh(r->description);
    if (!out) return knurl_fail_memory(r->error, sizeof *out, r->path);
    size_t corners = m->corners.count / CORNER_WORDS;
    if (m->material_name != OBJ_ABSENT) out->material = r->names.names[m->material_name].material;
    out->name = mesh_name(r, m);
    out->triangles = knurl_alloc_array(r->context, corners, sizeof(uint32_t));
    uint32_t *first = knurl_alloc_array(r->context, corners, sizeof *first);
    knurl_status status = KNURL_OK;
    if (!out->name || !out->triangles || !first)
        status = knurl_fail_memory(r->error, corners * 2 * sizeof(uint32_t), r->path);
    if (status == KNURL_OK)
        status = scene_weld(r->context, m->corners.data, corners, CORNER_WORDS, out->triangles, first,
                            &out->vertex_count, r->error);
    if (status == KNURL_OK) {
        out->triangle_count = (uint32_t)(corners / 3);
        status = copy_vertices(r, m, first, out);
    }
    knurl_free(r->context, first);
    knurl_free(r->context, m->corners.data);
    m->corners = (corner_array){0};
    if (status != KNURL_OK) return status;
    knurl_description_instance *instance = description_append_instance(r->description);
    if (!instance) return knurl_fail_memory(r->error, sizeof *instance, r->path);
    instance->mesh = (int32_t)r->description->mesh_count - 1;
    instance->name = knurl_strdup(r->context, out->name);
    return instance->name ? KNURL_OK : knurl_fail_memory(r->error, 64, r->path);
}

static void free_reader(obj_reader *r)
{
    for (uint32_t i = 0; i < r->mesh_count; i++) knurl_free(r->context, r->meshes[i].corners.data);
    for (uint32_t i = 0; i < r->library_count; i++) knurl_free(r->context, r->libraries[i]);
    knurl_free(r->context, r->meshes);
    knurl_free(r->context, r->positions.data);
    knurl_free(r->context, r->texcoords.data);
    knurl_free(r->context, r->normals.data);
    knurl_free(r->context, r->face.data);
    knurl_free(r->context, r->face_positions.data);
    knurl_free(r->context, r->face_triangles);
    obj_names_free(&r->names);
}

static knurl_status read_lines(obj_reader *r, unsigned char *bytes, size_t size)
{
    text_lines lines = {.at = (char *)bytes, .end = (char *)bytes + size};
    text_span rest, key;
    while (text_next_line(&lines, &rest)) {
        r->line = lines.line;
        if (!text_next_word(&rest, &key)) continue;
        knurl_status status = read_statement(r, key, rest);
        if (status != KNURL_OK) return status;
    }
    if (r->mesh_count == 0)
        return knurl_fail(r->error, KNURL_ERROR_INPUT, "%s: no faces in %u lines, expected at least one",
                          r->path, r->line);
    knurl_status status = resolve_materials(r);
    for (uint32_t i = 0; i < r->mesh_count && status == KNURL_OK; i++) status = build_mesh(r, &r->meshes[i]);
    return status;
}

knurl_status obj_read(knurl_description *d, unsigned char *bytes, size_t size, bool files, knurl_error *error)
{
    obj_reader r = {.description = d,
                    .context = d->context,
                    .error = error,
                    .path = d->path,
                    .files = files,
                    .mesh = OBJ_ABSENT,
                    .plain_mesh = OBJ_ABSENT,
                    .material_name = OBJ_ABSENT,
                    .names = {.context = d->context}};
    knurl_status status = read_lines(&r, bytes, size);
    free_reader(&r);
    return status;
}
