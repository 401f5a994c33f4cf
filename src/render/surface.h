/* render/surface.h: a hit turned into what shading needs. */
#ifndef KNURL_SRC_RENDER_SURFACE_H
#define KNURL_SRC_RENDER_SURFACE_H

#include "render/bsdf.h"
#include "render/trace.h"

typedef struct surface_point {
    const knurl_description_material *material;
    vec3 position;
    vec3 ng;       /* geometric normal, on the viewer's side */
    frame shading; /* z: shading normal on the viewer's side; always faces the viewer */
    vec3 wo;       /* towards the viewer, shading frame */
    bool outside;  /* the viewer is on the side the mesh's winding calls front */
    bsdf_parameters parameters;
    vec3 emission;
} surface_point;

/* `direction`: of the ray that hit. */
surface_point surface_make(const world *w, const knurl_hit *hit, vec3 direction);

#endif
