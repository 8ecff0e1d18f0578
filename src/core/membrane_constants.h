/* Constants of the membrane and of the diffusion, made from the parameters. */
#ifndef SPHM_CORE_MEMBRANE_CONSTANTS_H
#define SPHM_CORE_MEMBRANE_CONSTANTS_H

#include "kernels/membrane.h"
#include "sph_muscle/parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Never fails: the parameters have passed sphm_parameters_check(). spacing_m is the particle spacing; it
 * matters only with conduction_velocity > 0, where the front has to span at least four of them. */
sphm_membrane_constants sphm_membrane_constants_from(const sphm_parameters *parameters, double spacing_m);

/* Speed of a plane wave without recovery, sqrt(D c1/2)(1 - 2a) with c1 = C1/(Cm (Vp - Vr)), mm/ms. */
double sphm_membrane_wave_speed_mm_per_ms(const sphm_membrane_constants *constants);
/* Distance over which that wave rises from 10 to 90 %, 2 ln 9 sqrt(2 D/c1), mm. */
double sphm_membrane_front_width_mm(const sphm_membrane_constants *constants);

#ifdef __cplusplus
}
#endif
#endif
