/* Every other mesh format, through assimp's C interface: triangles, base colours and the nodes'
 * transforms. assimp only parses: indices are checked and polygons cut here, since its own steps
 * trust what a damaged file says. */
#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/scene.h>

#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "data/description.h"
#include "io/assimp_ply.h"
#include "io/obj_polygon.h"
#include "io/scene.h"
#include "io/scene_text.h"
#include "io/scene_weld.h"
#include "math/vec.h"

enum { MAX_DEPTH = 256, MAX_INSTANCES = 1 << 24, ROW = 8 /* words of a vertex: position, normal, uv */ };

/* assimp keeps the message of the last failed import in one variable for all threads. */
static pthread_mutex_t import_lock = PTHREAD_MUTEX_INITIALIZER;

typedef struct assimp_reader {
    knurl_description *d;
    knurl_context *context;
    knurl_error *error;
    const struct aiScene *scene;
    bool facet_normals; /* STL: normals belong to facets and would tear a displaced surface */
    int32_t *mesh;      /* the description's mesh for each of the scene's, -1: left out */
    uint32_t *cut;      /* triangles of one polygon */
    float *corners;     /* positions of one polygon */
    size_t cut_room;    /* corners that fit into them */
} assimp_reader;

static void read_material(assimp_reader *r, const struct aiMaterial *from, knurl_description_material *to)
{
    struct aiColor4D color;
    if (aiGetMaterialColor(from, AI_MATKEY_COLOR_DIFFUSE, &color) == aiReturn_SUCCESS &&
        v3_finite(v3((double)color.r, (double)color.g, (double)color.b))) {
        to->base_color[0] = fmin(fmax((double)color.r, 0.0), 1.0);
        to->base_color[1] = fmin(fmax((double)color.g, 0.0), 1.0);
        to->base_color[2] = fmin(fmax((double)color.b, 0.0), 1.0);
    }
    struct aiString name;
    if (aiGetMaterialTexture(from, aiTextureType_DIFFUSE, 0, &name, NULL, NULL, NULL, NULL, NULL, NULL) !=
            aiReturn_SUCCESS ||
        name.length == 0 || name.data[0] == '*')
        return;
    char *path = text_path_beside(r->context, r->d->path, name.data, name.length);
    if (path) to->base_color_texture.image = knurl_description_add_image(r->d, path);
    knurl_free(r->context, path);
}

static knurl_status read_materials(assimp_reader *r)
{
    for (unsigned i = 0; i < r->scene->mNumMaterials; i++) {
        knurl_description_material *made = description_append_material(r->d);
        if (!made) return knurl_fail_memory(r->error, sizeof *made, r->d->path);
        struct aiString name;
        bool named = aiGetMaterialString(r->scene->mMaterials[i], AI_MATKEY_NAME, &name) == aiReturn_SUCCESS;
        made->name = named && name.length ? knurl_strdup(r->context, name.data)
                                          : knurl_format(r->context, "material %u", i);
        if (!made->name) return knurl_fail_memory(r->error, sizeof *made, r->d->path);
        read_material(r, r->scene->mMaterials[i], made);
    }
    return KNURL_OK;
}

static void copy_row(const assimp_reader *r, const struct aiMesh *m, unsigned i, float row[ROW])
{
    memset(row, 0, ROW * sizeof *row);
    memcpy(row, &m->mVertices[i], 3 * sizeof *row);
    if (m->mNormals && !r->facet_normals) memcpy(row + 3, &m->mNormals[i], 3 * sizeof *row);
    if (m->mTextureCoords[0]) {
        row[6] = m->mTextureCoords[0][i].x;
        row[7] = 1.0f - m->mTextureCoords[0][i].y; /* assimp's v points up */
    }
}

/* Joins vertices that are equal bit for bit: assimp gives every corner its own. number[i] becomes the
 * new index of vertex i. */
static knurl_status weld_vertices(assimp_reader *r, const struct aiMesh *m, uint32_t *number,
                                  knurl_description_mesh *out)
{
    size_t n = m->mNumVertices;
    float *rows = knurl_alloc_array(r->context, n, ROW * sizeof *rows);
    uint32_t *first = knurl_alloc_array(r->context, n, sizeof *first);
    knurl_status status = KNURL_OK;
    if (!rows || !first) status = knurl_fail_memory(r->error, n * ROW * sizeof *rows, r->d->path);
    for (unsigned i = 0; i < n && status == KNURL_OK; i++) copy_row(r, m, i, rows + (size_t)i * ROW);
    if (status == KNURL_OK)
        status = scene_weld(r->context, (const uint32_t *)(const void *)rows, n, ROW, number, first,
                            &out->vertex_count, r->error);
    size_t made = out->vertex_count;
    bool normals = m->mNormals && !r->facet_normals;
    if (status == KNURL_OK) {
        out->positions = knurl_alloc_array(r->context, made, 3 * sizeof(float));
        if (normals) out->normals = knurl_alloc_array(r->context, made, 3 * sizeof(float));
        if (m->mTextureCoords[0]) out->texcoords = knurl_alloc_array(r->context, made, 2 * sizeof(float));
        if (!out->positions || (normals && !out->normals) || (m->mTextureCoords[0] && !out->texcoords))
            status = knurl_fail_memory(r->error, made * ROW * sizeof(float), r->d->path);
    }
    for (size_t i = 0; i < made && status == KNURL_OK; i++) {
        const float *row = rows + (size_t)first[i] * ROW;
        memcpy(out->positions + 3 * i, row, 3 * sizeof *row);
        if (out->normals) memcpy(out->normals + 3 * i, row + 3, 3 * sizeof *row);
        if (out->texcoords) memcpy(out->texcoords + 2 * i, row + 6, 2 * sizeof *row);
    }
    knurl_free(r->context, rows);
    knurl_free(r->context, first);
    return status;
}

static knurl_status make_room(assimp_reader *r, size_t corners)
{
    if (corners <= r->cut_room) return KNURL_OK;
    knurl_free(r->context, r->cut);
    knurl_free(r->context, r->corners);
    r->cut = knurl_alloc_array(r->context, corners, 3 * sizeof *r->cut);
    r->corners = knurl_alloc_array(r->context, corners, 3 * sizeof *r->corners);
    r->cut_room = r->cut && r->corners ? corners : 0;
    return r->cut_room ? KNURL_OK : knurl_fail_memory(r->error, corners * 24, r->d->path);
}

static knurl_status cut_faces(assimp_reader *r, const struct aiMesh *m, const uint32_t *number,
                              knurl_description_mesh *out)
{
    for (unsigned f = 0; f < m->mNumFaces; f++) {
        const struct aiFace *face = &m->mFaces[f];
        if (face->mNumIndices < 3) continue;
        for (unsigned i = 0; i < face->mNumIndices; i++)
            if (face->mIndices[i] >= m->mNumVertices)
                return knurl_fail(r->error, KNURL_ERROR_INPUT,
                                  "%s: mesh \"%s\", face %u: vertex index %u, expected less than %u",
                                  r->d->path, out->name, f, face->mIndices[i], m->mNumVertices);
        knurl_status status = make_room(r, face->mNumIndices);
        if (status != KNURL_OK) return status;
        for (unsigned i = 0; i < face->mNumIndices; i++)
            memcpy(r->corners + 3 * (size_t)i, out->positions + 3 * (size_t)number[face->mIndices[i]],
                   3 * sizeof *r->corners);
        obj_polygon_triangulate(r->corners, face->mNumIndices, r->cut);
        uint32_t *to = out->triangles + 3 * (size_t)out->triangle_count;
        for (size_t i = 0; i < 3 * (size_t)(face->mNumIndices - 2); i++)
            to[i] = number[face->mIndices[r->cut[i]]];
        out->triangle_count += face->mNumIndices - 2;
    }
    return KNURL_OK;
}

static knurl_status read_mesh(assimp_reader *r, unsigned index)
{
    const struct aiMesh *m = r->scene->mMeshes[index];
    r->mesh[index] = -1;
    uint64_t triangles = 0;
    for (unsigned f = 0; f < m->mNumFaces; f++)
        if (m->mFaces[f].mNumIndices >= 3) triangles += m->mFaces[f].mNumIndices - 2;
    if (triangles == 0 || m->mNumVertices == 0 || !m->mVertices) return KNURL_OK;
    if (triangles > UINT32_MAX / 3)
        return knurl_fail(r->error, KNURL_ERROR_LIMIT, "%s: mesh %u has %llu triangles", r->d->path, index,
                          (unsigned long long)triangles);
    knurl_description_mesh *out = description_append_mesh(r->d);
    if (!out) return knurl_fail_memory(r->error, sizeof *out, r->d->path);
    out->material = m->mMaterialIndex < r->scene->mNumMaterials ? (int32_t)m->mMaterialIndex : -1;
    out->name = m->mName.length ? knurl_strdup(r->context, m->mName.data)
                                : knurl_format(r->context, "mesh %u", index);
    out->triangles = knurl_alloc_array(r->context, (size_t)triangles, 3 * sizeof(uint32_t));
    uint32_t *number = knurl_alloc_array(r->context, m->mNumVertices, sizeof *number);
    knurl_status status = KNURL_OK;
    if (!out->name || !out->triangles || !number)
        status = knurl_fail_memory(r->error, (size_t)triangles * 12, r->d->path);
    if (status == KNURL_OK) status = weld_vertices(r, m, number, out);
    if (status == KNURL_OK) status = cut_faces(r, m, number, out);
    knurl_free(r->context, number);
    r->mesh[index] = (int32_t)r->d->mesh_count - 1;
    return status;
}

static affine node_transform(const affine *above, const struct aiMatrix4x4 *m)
{
    const double local[12] = {(double)m->a1, (double)m->a2, (double)m->a3, (double)m->a4,
                              (double)m->b1, (double)m->b2, (double)m->b3, (double)m->b4,
                              (double)m->c1, (double)m->c2, (double)m->c3, (double)m->c4};
    affine out;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
            double sum = j == 3 ? above->m[4 * i + 3] : 0.0;
            for (int k = 0; k < 3; k++) sum += above->m[4 * i + k] * local[4 * k + j];
            out.m[4 * i + j] = sum;
        }
    return out;
}

static knurl_status visit(assimp_reader *r, const struct aiNode *node, const affine *above, int depth)
{
    if (depth > MAX_DEPTH)
        return knurl_fail(r->error, KNURL_ERROR_LIMIT, "%s: nodes more than %d deep", r->d->path, MAX_DEPTH);
    affine to_world = node_transform(above, &node->mTransformation), inverse;
    bool regular = affine_invert(&to_world, &inverse);
    if (!regular && node->mNumMeshes)
        description_warn(r->d, "%s: node \"%s\": its transform flattens the mesh, which is left out",
                         r->d->path, node->mName.data);
    for (unsigned i = 0; i < node->mNumMeshes && regular; i++) {
        if (node->mMeshes[i] >= r->scene->mNumMeshes || r->mesh[node->mMeshes[i]] < 0) continue;
        if (r->d->instance_count >= MAX_INSTANCES)
            return knurl_fail(r->error, KNURL_ERROR_LIMIT, "%s: more than %d instances", r->d->path,
                              MAX_INSTANCES);
        knurl_description_instance *made = description_append_instance(r->d);
        if (!made) return knurl_fail_memory(r->error, sizeof *made, r->d->path);
        made->mesh = r->mesh[node->mMeshes[i]];
        memcpy(made->transform, to_world.m, sizeof made->transform);
        made->name = knurl_strdup(r->context, node->mName.data);
        if (!made->name) return knurl_fail_memory(r->error, sizeof *made, r->d->path);
    }
    for (unsigned i = 0; i < node->mNumChildren; i++) {
        knurl_status status = visit(r, node->mChildren[i], &to_world, depth + 1);
        if (status != KNURL_OK) return status;
    }
    return KNURL_OK;
}

static knurl_status convert(assimp_reader *r)
{
    const affine identity = affine_identity();
    r->mesh = knurl_alloc_zero(r->context, r->scene->mNumMeshes * sizeof *r->mesh);
    if (!r->mesh) return knurl_fail_memory(r->error, r->scene->mNumMeshes * sizeof *r->mesh, r->d->path);
    knurl_status status = read_materials(r);
    for (unsigned i = 0; i < r->scene->mNumMeshes && status == KNURL_OK; i++) status = read_mesh(r, i);
    if (status == KNURL_OK && r->d->mesh_count == 0)
        status =
            knurl_fail(r->error, KNURL_ERROR_INPUT, "%s: no triangles, expected at least one", r->d->path);
    if (status == KNURL_OK && r->scene->mRootNode) status = visit(r, r->scene->mRootNode, &identity, 0);
    knurl_free(r->context, r->mesh);
    knurl_free(r->context, r->cut);
    knurl_free(r->context, r->corners);
    return status;
}

static knurl_status import(assimp_reader *r, const unsigned char *bytes, size_t size, const char *extension)
{
    struct aiPropertyStore *properties = aiCreatePropertyStore();
    if (!properties) return knurl_fail_memory(r->error, 64, r->d->path);
    aiSetImportPropertyInteger(properties, AI_CONFIG_IMPORT_NO_SKELETON_MESHES, 1);
    pthread_mutex_lock(&import_lock);
    /* From memory: assimp then opens no other file, and the size limits were checked. */
    r->scene =
        aiImportFileFromMemoryWithProperties((const char *)bytes, (unsigned)size, 0, extension, properties);
    knurl_status status = KNURL_OK;
    if (!r->scene)
        status = knurl_fail(r->error, KNURL_ERROR_INPUT, "%s: assimp cannot read it: %.400s", r->d->path,
                            aiGetErrorString());
    pthread_mutex_unlock(&import_lock);
    aiReleasePropertyStore(properties);
    return status;
}

knurl_status assimp_read(knurl_description *d, const unsigned char *bytes, size_t size, const char *extension,
                         knurl_error *error)
{
    char dotted[32];
    int length = snprintf(dotted, sizeof dotted, ".%s", extension);
    if (length < 2 || (size_t)length >= sizeof dotted || !aiIsExtensionSupported(dotted))
        return knurl_fail(
            error, KNURL_ERROR_UNSUPPORTED,
            "%s: unknown kind of scene \".%.20s\", expected .gltf, .glb, .obj, .ply, .stl or another "
            "that assimp reads",
            d->path, extension);
    if (size > UINT32_MAX)
        return knurl_fail(error, KNURL_ERROR_LIMIT, "%s: %zu bytes, expected at most %u", d->path, size,
                          UINT32_MAX);
    const text_span kind = {extension, extension + strlen(extension)};
    if (text_is(kind, "ply")) {
        knurl_status status = assimp_check_ply(d->path, bytes, size, error);
        if (status != KNURL_OK) return status;
    }
    assimp_reader r = {.d = d, .context = d->context, .error = error, .facet_normals = text_is(kind, "stl")};
    knurl_status status = import(&r, bytes, size, extension);
    if (status == KNURL_OK) status = convert(&r);
    aiReleaseImport(r.scene);
    return status;
}
