/* render/texture.h: images as shading inputs. Each image of a description is loaded once and kept in
 * its own sample format; 8-bit colour is decoded through a table. */
#ifndef KNURL_SRC_RENDER_TEXTURE_H
#define KNURL_SRC_RENDER_TEXTURE_H

#include "base/base.h"
#include "math/vec.h"

#include <knurl/description.h>

typedef struct texture_set {
    knurl_context *context;
    knurl_image **images; /* by image index; NULL where shading does not use it */
    uint32_t count;
    float srgb[256]; /* 8-bit sRGB to linear */
} texture_set;

typedef struct texel {
    vec3 color;
    double alpha;
} texel;

/* Loads what the materials' base colour, metallic-roughness and emissive textures name. */
knurl_status texture_set_create(const knurl_description *description, texture_set **set, knurl_error *error);
void texture_set_release(texture_set *set);

/* Bilinear (or nearest) lookup at the mesh's texture coordinates. `ref->image` must not be -1.
 * One channel is grey, two are grey and alpha. `color`: integer samples are sRGB-encoded. */
texel texture_lookup(const texture_set *set, const knurl_texture_ref *ref, const double st[2], bool color);

double texture_srgb_to_linear(double encoded);
double texture_linear_to_srgb(double linear);

#endif
