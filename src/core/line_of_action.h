/* The line of action and what follows from it: order along it, attachments, regions, mid-belly section. */
#ifndef SPHM_CORE_LINE_OF_ACTION_H
#define SPHM_CORE_LINE_OF_ACTION_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Each reads body->positions, count, spacing_m, step_m, and what the ones before it wrote. */

/* Writes origin_m, insertion_m, axis, length_m, layer_m. Given points are taken; `fallback` (NULL for a mesh)
 * holds the ends of a preset. */
sphm_status sphm_body_find_line_of_action(sphm_body *body, const sphm_parameters *parameters,
                                          const double fallback[2][3], sphm_context *context);
/* Writes axial_fraction, attachment, region, and clamp_m of a solid; reads the surface. */
sphm_status sphm_body_divide(sphm_body *body, const sphm_parameters *parameters, sphm_context *context);
/* Writes mid_radius_m. */
void sphm_body_measure_section(sphm_body *body);
/* Unit directions across the axis: `wide` where the tissue extends most, `thin` least; right-handed. */
void sphm_body_cross_axes(const sphm_body *body, double wide[3], double thin[3]);
/* Directions of a surface, longest first, in the rows of `frame`. */
void sphm_surface_principal_frame(const sphm_surface *surface, double frame[3][3]);

#ifdef __cplusplus
}
#endif
#endif
