/* Time-step limits of the solid tissue, the same of every back end. */
#ifndef SPHM_CORE_SOLID_LIMITS_H
#define SPHM_CORE_SOLID_LIMITS_H

#include "core/gradient.h"
#include "core/model.h"
#include "sph_muscle/muscle.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Share of the largest stable step that is taken: the limits are read every few steps, on a device after
 * every submission, and the fibres stiffen in between. */
#define SPHM_SOLID_STEP_SHARE 0.8

/* stiffest_Pa: the largest sphm_solid_wave_modulus() of the particles as they are. */
sphm_time_step_limits sphm_solid_limits(const sphm_model *model, const sphm_gradient *gradient,
                                        double stiffest_Pa);

#ifdef __cplusplus
}
#endif
#endif
