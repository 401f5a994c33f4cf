/* bake.h: scenes as plain meshes, written block by block. */
#ifndef APP_BAKE_H
#define APP_BAKE_H

#include "output.h"

#include <knurl/tessellation.h>

enum {
    BAKE_BLOCK = 16384, /* vertices or triangles at once */
    BAKE_ROW = 512      /* most bytes that one takes in a file */
};

/* An object of the scene as a mesh. */
typedef struct bake_part {
    const knurl_description_mesh *mesh;
    knurl_tessellation *tessellation; /* NULL: the mesh is not displaced */
    uint64_t vertices, triangles;
} bake_part;

/* Vertices of a part, placed. */
typedef struct bake_block {
    size_t count;
    float positions[3 * BAKE_BLOCK], normals[3 * BAKE_BLOCK], texcoords[2 * BAKE_BLOCK];
} bake_block;

typedef struct bake_job {
    command_session *session;
    const knurl_description *description;
    bake_part *parts; /* one per mesh of the description */
    FILE *out;
    bake_block *block;
    double *points;     /* 3 * BAKE_BLOCK */
    uint32_t *indices;  /* 3 * BAKE_BLOCK */
    char *rows;         /* BAKE_ROW * BAKE_BLOCK, for encoding a block */
    uint64_t done, all; /* vertices and triangles, for progress */
} bake_job;

/* An instance whose part is written: its transform is invertible and its part has triangles. */
bool bake_is_seen(const bake_job *job, uint32_t instance);
/* Whether it mirrors, so that its triangles turn round. */
bool bake_mirrors(const double transform[12]);

/* Each calls back for one block after another of a part, in order, until one fails; all report failures and
 * return an exit code, CODE_INTERRUPTED after a signal. A NULL transform leaves things in the object's space.
 */
typedef int bake_vertices_fn(bake_job *job, void *user, const bake_block *block);
int bake_vertices(bake_job *job, const bake_part *part, const double *transform, bake_vertices_fn *write,
                  void *user);
typedef int bake_triangles_fn(bake_job *job, void *user, const uint32_t *indices, size_t count);
int bake_triangles(bake_job *job, const bake_part *part, bake_triangles_fn *write, void *user);

/* fwrite, or a report. */
int bake_write(bake_job *job, const void *bytes, size_t size);

int bake_obj(bake_job *job);
int bake_ply(bake_job *job);
int bake_glb(bake_job *job);

#endif
