/* How much of a shape each particle of a filling stands for. */
#ifndef SPHM_CORE_VOLUMES_H
#define SPHM_CORE_VOLUMES_H

#include "core/winding.h"
#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes body->volumes [count], m3: what lies inside and nearer to a particle than to any other, out to one
 * and a half lattice steps, such that they sum to body->volume_m3. Reads positions, outer, step_m and
 * volume_m3. `displaced`: particles do not lie on the lattice any more. */
sphm_status sphm_body_measure_volumes(sphm_body *body, const sphm_winding *winding, int displaced,
                                      int64_t threads, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
