/* io/mtl.h: material libraries of OBJ files. */
#ifndef KNURL_SRC_IO_MTL_H
#define KNURL_SRC_IO_MTL_H

#include "io/scene_text.h"

/* One texture statement: what stands after map_Kd, disp and their like. */
typedef struct mtl_texture {
    text_span name;             /* the file's name, blanks included; empty if there is none */
    double base, gain;          /* -mm base gain, gain times -bm */
    double scale[2], offset[2]; /* -s, -o, in the file's own coordinates (v up) */
    bool clamp;
} mtl_texture;

/* Where a statement stands, for messages. */
typedef struct mtl_place {
    knurl_description *description;
    const char *path;
    uint32_t line;
} mtl_place;

/* Reads the options and the name after a texture keyword. Unknown options are warned of and
 * skipped, a number that does not read is an error. */
knurl_status mtl_read_texture(const mtl_place *at, text_span rest, mtl_texture *texture, knurl_error *error);
/* The same use of an image in knurl's coordinates, v = 0 at the first row:
 * with (u, v)_file = offset + scale (s, t_file), t_file = 1 - t and row coordinate 1 - v_file. */
knurl_texture_ref mtl_texture_ref(const mtl_texture *texture, int32_t image);

/* Appends the materials of an MTL file in memory to the description. `path` names it and the folder
 * of its textures. The bytes are edited. */
knurl_status mtl_read(knurl_description *d, unsigned char *bytes, size_t size, const char *path,
                      knurl_error *error);

#endif
