/* The built-in shapes. */
#ifndef SPHM_CORE_BELLY_H
#define SPHM_CORE_BELLY_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A spindle along x: elliptical sections perpendicular to x whose half axes grow from end_radius to width/2
 * (in y) and thickness/2 (in z) with sin(pi s)^exponent, s = 0 ... 1 along the length; the middle of the
 * sections moves by bow sin(pi s) towards +z. */
typedef struct sphm_belly {
    double length_m, width_m, thickness_m, end_radius_m, bow_m, exponent;
} sphm_belly;

/* The belly of a preset; not for `bar`. */
sphm_belly sphm_belly_preset(const sphm_parameters *parameters);
sphm_status sphm_belly_surface(const sphm_belly *belly, sphm_surface *surface, sphm_context *context);
sphm_status sphm_bar_surface(double length_m, double width_m, double thickness_m, sphm_surface *surface,
                             sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
