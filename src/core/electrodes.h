/* Electrodes: which particles each of them drives, and their names. */
#ifndef SPHM_CORE_ELECTRODES_H
#define SPHM_CORE_ELECTRODES_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* "belly", "origin", ... of SPHM_ELECTRODE_...; NULL beyond them. */
const char *sphm_electrode_name(int electrode);
/* The electrode called `name`, or -1. */
int sphm_electrode_find(const char *name);

/* Fills mask[body->count], by particle id: bit e is set where the particle belongs to electrode e. belly is
 * every particle; origin and insertion the first and the last 10 % of the tissue by volume (whether or not
 * it is attached), both their union; sphere the particles within electrode_radius of electrode_centre, by
 * default the centroid of the middle tenth of the tissue. Refuses an empty sphere where it is the default
 * electrode, and warns elsewhere if a centre was given. */
sphm_status sphm_electrodes_mark(const sphm_parameters *parameters, const sphm_body *body, uint8_t *mask,
                                 sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
