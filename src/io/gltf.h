/* io/gltf.h: the parts of the glTF reader. */
#ifndef KNURL_SRC_IO_GLTF_H
#define KNURL_SRC_IO_GLTF_H

#include <knurl/description.h>

#include "io/gltf_json.h"

/* Bytes of one buffer; inside the GLB file or owned. */
typedef struct gltf_buffer {
    const unsigned char *bytes;
    size_t size;
    unsigned char *owned;
} gltf_buffer;

/* Meshes of the description made from one mesh of the file, one per primitive. */
typedef struct gltf_mesh_range {
    uint32_t first, count;
} gltf_mesh_range;

typedef struct gltf_reader {
    gltf_report report;
    knurl_description *description;
    knurl_context *context;
    bool files; /* whether other files may be opened */
    gltf_at root;
    const unsigned char *binary; /* the BIN chunk of a GLB, or NULL */
    size_t binary_size;
    gltf_buffer *buffers;
    size_t buffer_count;
    /* Bytes that meshes and images may still take. Accessors can be used again and again; this keeps a
     * small file from asking for a huge amount of memory that way. */
    uint64_t budget;
    uint32_t *uv_sets; /* TEXCOORD_n that each material reads */
    uint32_t file_material_count;
    gltf_mesh_range *mesh_ranges;
    size_t mesh_range_count;
    bool warned_primitives, warned_morph, warned_skin;
} gltf_reader;

/* One accessor, checked against its buffer: element i is `components` values at bytes + i * stride. */
typedef struct gltf_accessor {
    const unsigned char *bytes; /* NULL: zeros (a sparse accessor without a base) */
    size_t stride, count;
    uint32_t components;
    uint32_t type; /* 5120 byte ... 5126 float */
    bool normalized;
    /* Elements that replace others, count 0 for none. */
    size_t sparse_count;
    const unsigned char *sparse_indices, *sparse_values;
    uint32_t sparse_index_type;
} gltf_accessor;

/* gltf_buffer.c */
void gltf_read_buffers(gltf_reader *g);
void gltf_free_buffers(gltf_reader *g);
/* The bytes of a buffer view, and the stride it asks for (0 if none); false after an error. */
bool gltf_buffer_view(gltf_reader *g, const gltf_at *view, const unsigned char **bytes, size_t *size,
                      size_t *stride);
/* Decodes "data:...;base64,..." or reads the file of a relative uri. The caller frees *bytes. */
void gltf_read_uri(gltf_reader *g, const gltf_at *at, const char *uri, unsigned char **bytes, size_t *size);
bool gltf_is_data_uri(const char *uri);
/* The path of a relative uri, percent codes resolved; NULL after an error. */
char *gltf_uri_path(gltf_reader *g, const gltf_at *at, const char *uri);
/* Takes bytes off the budget; false after an error. */
bool gltf_take(gltf_reader *g, const gltf_at *at, uint64_t bytes);

/* gltf_accessor.c */
bool gltf_open_accessor(gltf_reader *g, const gltf_at *at, gltf_accessor *accessor);
/* All elements as floats, normalised integers scaled; `out` holds count * components. */
void gltf_accessor_floats(const gltf_accessor *accessor, float *out);
/* A scalar integer accessor's elements. */
void gltf_accessor_indices(const gltf_accessor *accessor, uint32_t *out);

/* gltf_material.c: images and materials, in the file's order. */
void gltf_read_images(gltf_reader *g);
void gltf_read_materials(gltf_reader *g);
/* gltf_mesh.c */
void gltf_read_meshes(gltf_reader *g);
/* gltf_scene.c: nodes flattened to instances, cameras and lights; the scene's extras. */
void gltf_read_scene(gltf_reader *g);

/* A copy of the element's "name", or "<kind> <index>". */
char *gltf_name(gltf_reader *g, const gltf_at *at, const char *kind, size_t index);
/* Out of memory at a place. */
void gltf_fail_memory(gltf_reader *g, const gltf_at *at, size_t bytes);

#endif
