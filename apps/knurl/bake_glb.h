/* bake_glb.h: the parts of a glTF document in the making. */
#ifndef APP_BAKE_GLB_H
#define APP_BAKE_GLB_H

#include "bake.h"

#include <jansson.h>

typedef struct glb_image {
    unsigned char *bytes;
    size_t size;
    bool png; /* else JPEG */
} glb_image;

typedef struct glb_document {
    const bake_job *job;
    json_t *root, *scene_nodes;
    uint64_t bytes;          /* of data so far */
    int *meshes, *materials; /* the document's number of each of the description's; -1: none yet */
    int *textures;     /* the document's number of an image of the description; -1: none yet, -2: none */
    int32_t *order;    /* meshes in the order of their data */
    glb_image *images; /* in the order of their data */
    uint32_t mesh_count, image_count;
} glb_document;

bool glb_begin(glb_document *g, const bake_job *job);
void glb_end(glb_document *g);
/* Adds a buffer view behind the data so far; 0 leaves target or stride out. Returns its number. */
int glb_view(glb_document *g, uint64_t bytes, int target, int stride);
/* The document's number of a material, which is added if need be. */
int glb_material(glb_document *g, int32_t material);
/* Adds the views of the images that materials use, behind everything else. */
void glb_images(glb_document *g);

#endif
