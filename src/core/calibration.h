/* Finding the fibre stress that gives a muscle the force it is known for. */
#ifndef SPHM_CORE_CALIBRATION_H
#define SPHM_CORE_CALIBRATION_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The max_isometric_stress (Pa) at which the muscle pulls with parameters->max_isometric_force, held at rest
 * length at activation 1. A function of parameters and mesh alone (not of max_isometric_stress). Runs a
 * muscle of at most 4000 particles, two to four times: about as long as a second of the same muscle. Notes
 * the result; warns above 0.6 MPa. Refuses a force that no stress up to 10 MPa reaches. */
sphm_status sphm_calibrate_isometric_stress(const sphm_parameters *parameters, const sphm_surface *mesh,
                                            double *stress_Pa, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
