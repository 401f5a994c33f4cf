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

/* Bench scenes. Balls with poles: heights are constant there. */
demo_pattern demo_asteroid(uint32_t seed);
demo_pattern demo_alien(uint32_t seed);   /* bands of plates with eyes; a tile spans one band */
demo_pattern demo_leather(uint32_t seed); /* grain and stitched seams */
demo_pattern demo_panels(uint32_t seed);  /* a machine's hull */
/* Octahedral. */
demo_pattern demo_reptile(uint32_t seed); /* scales that follow the creature's head */

/* One tile that is the same when turned half round, for tiling the octahedral chart. */
demo_pattern demo_cloth(uint32_t seed);
/* Tiles. */
demo_pattern demo_plates(uint32_t seed);   /* hammered plates, rivets */
demo_pattern demo_filigree(uint32_t seed); /* leaves and tendrils; to be mirrored */
demo_pattern demo_rooftiles(uint32_t seed);
demo_pattern demo_sand(uint32_t seed);
demo_pattern demo_tread(uint32_t seed);    /* v across the tire */
demo_pattern demo_sidewall(uint32_t seed); /* v from the bead to the shoulder */

/* Whole objects; v runs along the profile. */
demo_pattern demo_diver(uint32_t seed);    /* a diving helmet's dome and collar */
demo_pattern demo_cutglass(uint32_t seed); /* a tumbler's outside; its inside is at 0.5 */
demo_pattern demo_stump(uint32_t seed);    /* bark, then the cut */
demo_pattern demo_bamboo(uint32_t seed);   /* a dragon's joints, scales and belly */

/* Height fields. */
demo_pattern demo_lattice(uint32_t seed);
demo_pattern demo_hills(uint32_t seed);
demo_pattern demo_needles(uint32_t seed);

#endif
