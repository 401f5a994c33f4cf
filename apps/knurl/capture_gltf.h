/* capture_gltf.h: a glTF document under construction, for capture_gltf.c and capture_stage.c. */
#ifndef APP_CAPTURE_GLTF_H
#define APP_CAPTURE_GLTF_H

#include "capture.h"

#include <jansson.h>

typedef struct capture_gltf {
    json_t *root, *nodes; /* nodes: of the scene */
    json_t *lights;       /* NULL until there is one */
    capture_document *document;
    bool failed; /* out of memory: jansson passes NULL on, so this is looked at once, at the end */
} capture_gltf;

/* These take over `value`. */
void capture_put(capture_gltf *g, json_t *object, const char *key, json_t *value);
void capture_push(capture_gltf *g, json_t *array, json_t *value);
/* Appends to an array of the document's root and returns the index. */
int capture_append(capture_gltf *g, const char *key, json_t *value);
json_t *capture_numbers(capture_gltf *g, const double *values, int count);
/* A node of the scene, its axes and origin in the world; borrowed. */
json_t *capture_add_node(capture_gltf *g, const char *name, const double axes[3][3], const double origin[3]);

/* ---- capture_stage.c: cameras and lights of the model's scene ---- */

/* Without cameras, the one that frames the model: the capture is then seen just as the model is. */
void capture_add_cameras(capture_gltf *g, const loaded_scene *loaded);
void capture_add_lights(capture_gltf *g, const knurl_description *description);

#endif
