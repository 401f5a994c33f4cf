/* io/scene.h: the readers behind knurl_description_load, one per format. */
#ifndef KNURL_SRC_IO_SCENE_H
#define KNURL_SRC_IO_SCENE_H

#include <knurl/description.h>

#include "base/base.h"

/* Each reads `bytes` (a whole file, knurl_alloc'd with a zero byte after its end; may be edited) into
 * the empty description `d`, whose path names the file and the folder of the files it refers to.
 * `files` false (fuzzing): no other file is opened; a reference to one is an error or a warning. */
knurl_status gltf_read(knurl_description *d, unsigned char *bytes, size_t size, bool files,
                       knurl_error *error);
knurl_status obj_read(knurl_description *d, unsigned char *bytes, size_t size, bool files,
                      knurl_error *error);
/* `extension` without its dot tells assimp which of its readers to use. */
knurl_status assimp_read(knurl_description *d, const unsigned char *bytes, size_t size, const char *extension,
                         knurl_error *error);

#endif
