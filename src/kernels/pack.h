/* What sweeps over neighbours read of a particle lies side by side, in packs of four values: one load each.
 */
#ifndef SPHM_KERNELS_PACK_H
#define SPHM_KERNELS_PACK_H

#include "kernels/qualifiers.h"

typedef struct sphm_pack {
    sphm_real x, y, z, w;
} sphm_pack;

/* Packs that are read together: one address, one cache line. */
typedef struct sphm_twin {
    sphm_pack first, second;
} sphm_twin;
typedef struct sphm_quad {
    sphm_twin moving;
    sphm_pack third, fourth;
} sphm_quad;

#endif
