/* demo_pattern.h: what the sample scenes' maps are made of. */
#ifndef KNURL_APPS_DEMO_PATTERN_H
#define KNURL_APPS_DEMO_PATTERN_H

#include "demo_map.h"

/* One tile: periodic in u and v. */
demo_pattern demo_knurling(uint32_t seed);  /* diamond grip between smooth collars, steel */
demo_pattern demo_frieze(uint32_t seed);    /* guilloche, rope and gadroons, cast bronze */
demo_pattern demo_mail(uint32_t seed);      /* interlinked rings, holes cut by alpha */
demo_pattern demo_cobbles(uint32_t seed);   /* setts in sand */
demo_pattern demo_masonry(uint32_t seed);   /* squared blocks in lime mortar */
demo_pattern demo_wicker(uint32_t seed);    /* woven willow */
demo_pattern demo_mountains(uint32_t seed); /* ridges, valleys and a lake */

/* One tile with a constant rim, so that faces of a box meet: h is 1, 0.5 and 0.5 on it. */
demo_pattern demo_rosette(uint32_t seed);  /* carved panel */
demo_pattern demo_hammered(uint32_t seed); /* hammered copper */
demo_pattern demo_ripples(uint32_t seed);  /* cast glass, a height map only */

/* Whole spheres. */
demo_pattern demo_coral(uint32_t seed);  /* latitude-longitude: brain coral */
demo_pattern demo_moon(uint32_t seed);   /* octahedral: craters upon craters */
demo_pattern demo_earth(uint32_t seed);  /* octahedral: seas, mountains, ice */
demo_pattern demo_urchin(uint32_t seed); /* octahedral: sharp cones */

#endif
