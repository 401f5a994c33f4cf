/* io/assimp_ply.h: a look at PLY files before assimp gets them. */
#ifndef KNURL_SRC_IO_ASSIMP_PLY_H
#define KNURL_SRC_IO_ASSIMP_PLY_H

#include "base/base.h"

/* Walks the header and every list of a PLY file and refuses counts that do not fit its size: assimp
 * believes them and would allocate or loop accordingly. */
knurl_status assimp_check_ply(const char *path, const unsigned char *bytes, size_t size, knurl_error *error);

#endif
