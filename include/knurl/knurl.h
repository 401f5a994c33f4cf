/* knurl/knurl.h: everything but the Embree adapter (knurl/embree.h). */
#ifndef KNURL_KNURL_H
#define KNURL_KNURL_H

#include <knurl/base.h>
#include <knurl/description.h>
#include <knurl/heightmap.h>
#include <knurl/image.h>
#include <knurl/render.h>
#include <knurl/scene.h>
#include <knurl/surface.h>
#include <knurl/tessellation.h>

#endif
