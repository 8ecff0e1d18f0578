/* The line of action and what follows from it: order along it, attachments, regions, mid-belly section. */
#ifndef SPHM_CORE_LINE_OF_ACTION_H
#define SPHM_CORE_LINE_OF_ACTION_H

#include "core/filling.h"
#include "core/section.h"
#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Each reads body->positions, count, spacing_m, step_m, and what the ones before it wrote. */

/* Whether both ends are given, so that nobody looks for one. */
int sphm_line_of_action_is_given(const sphm_parameters *parameters);
/* The ends of the principal axis of a filling: the line through its middle along which it extends most, cut
 * half a spacing beyond the outermost cubes. */
void sphm_principal_ends(const sphm_filling *filling, double ends[2][3]);
/* Writes origin_m, insertion_m, axis, length_m, layer_m. Given points are taken, and of the others those of
 * `ends`, which is not read where both are given. */
sphm_status sphm_body_find_line_of_action(sphm_body *body, const sphm_parameters *parameters,
                                          const double ends[2][3], sphm_context *context);
/* Writes axial_fraction, attachment, region, and clamp_m of a solid, whose sections are cut from `whole`. */
sphm_status sphm_body_divide(sphm_body *body, const sphm_parameters *parameters, const sphm_cut_body *whole,
                             sphm_context *context);
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
