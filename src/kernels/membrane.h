/* The membrane at a point: FitzHugh-Nagumo in its original form (section 3.6, eqs 24-27, Table 1). */
#ifndef SPHM_KERNELS_MEMBRANE_H
#define SPHM_KERNELS_MEMBRANE_H

#include "kernels/qualifiers.h"

/* mm, ms, mV, uA, uF; made by sphm_membrane_constants_from() in core/membrane_constants.c. */
typedef struct sphm_membrane_constants {
    sphm_real resting_mV, plateau_mV, threshold_mV;
    sphm_real threshold_fraction;    /* a = (Vth - Vr)/(Vp - Vr) */
    sphm_real capacitance_uF_per_mm2; /* Cm */
    sphm_real excitation_uA_per_mm2; /* C1 */
    sphm_real decay_uA_per_mm2;      /* C2 */
    sphm_real recovery_rate_per_ms;  /* b */
    sphm_real recovery_decay;        /* d */
    sphm_real diffusion_mm2_per_ms;  /* D along the fibre */
    sphm_real anisotropy_ratio;      /* D along over across */
    sphm_real reaction_step_ms;      /* longest sub-step */
    sphm_real activation_ms, deactivation_ms;
} sphm_membrane_constants;

#endif
