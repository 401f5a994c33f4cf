/* io/scene_weld.h: numbering equal rows alike, for vertices that a format spells out per corner. */
#ifndef KNURL_SRC_IO_SCENE_WELD_H
#define KNURL_SRC_IO_SCENE_WELD_H

#include "base/base.h"

/* `rows` holds count rows of `words` words. index[i] becomes the number of row i among the distinct
 * rows in order of first appearance, first[k] the row where number k appeared first (both have room
 * for count). Rows are equal when all their bits are: nothing is merged by tolerance. */
knurl_status scene_weld(knurl_context *context, const uint32_t *rows, size_t count, size_t words,
                        uint32_t *index, uint32_t *first, uint32_t *distinct, knurl_error *error);

#endif
