/* The viscous fluid at a point and between two points (eqs 9-15, 20-23). */
#ifndef SPHM_KERNELS_FLUID_H
#define SPHM_KERNELS_FLUID_H

#include "kernels/qualifiers.h"

typedef struct sphm_fluid_constants {
    int coupling;                       /* SPHM_COUPLING_... */
    sphm_real support_radius_m;         /* h */
    sphm_real mass_kg;                  /* of a particle */
    sphm_real stiffness_m2_per_s2;      /* k */
    sphm_real electrical_Pa_per_mV;     /* kappa */
    sphm_real fibre_tension_Pa;         /* T at full activation */
    sphm_real viscosity_Pa_s;           /* mu */
    sphm_real xsph_time_s;              /* tau */
    sphm_real fibre_steering;           /* beta */
    sphm_real shape_matching_rad_per_s; /* omega */
    sphm_real shape_matching_floor;     /* l_i */
    sphm_real gravity_m_per_s2[3];
} sphm_fluid_constants;

#endif
