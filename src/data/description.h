/* data/description.h: building a description element by element, for the file readers. */
#ifndef KNURL_SRC_DATA_DESCRIPTION_H
#define KNURL_SRC_DATA_DESCRIPTION_H

#include <knurl/description.h>

#include "base/base.h"

/* An empty description of the file `path`; NULL when out of memory. */
knurl_description *description_new(knurl_context *context, const char *path);

/* Each appends one element with its default values and returns it (valid until the next append of
 * its kind), or NULL when out of memory. */
knurl_description_mesh *description_append_mesh(knurl_description *d);
knurl_description_image *description_append_image(knurl_description *d);
knurl_description_material *description_append_material(knurl_description *d);
knurl_description_instance *description_append_instance(knurl_description *d);
knurl_description_camera *description_append_camera(knurl_description *d);
knurl_description_light *description_append_light(knurl_description *d);

/* No image, repeat, identity transform. */
knurl_texture_ref description_no_texture(void);

/* Keeps the warning in the description (the first 200 only) and logs it. */
void description_warn(knurl_description *d, const char *format, ...) KNURL_PRINTF(2, 3);

/* Frees and clears what a mesh owns. */
void description_clear_mesh(knurl_context *context, knurl_description_mesh *mesh);

/* Last step of every reader: refuses positions and texture coordinates that are not finite, directions
 * that are zero or not finite, and indices out of range, drops normals that are not finite, and gives
 * meshes with material -1 a default one, appended to the materials. */
knurl_status description_finish(knurl_description *d, knurl_error *error);

#endif
