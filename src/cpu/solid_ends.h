/* The ends of the solid tissue: how the attached particles move, and what the tissue does to them. */
#ifndef SPHM_CPU_SOLID_ENDS_H
#define SPHM_CPU_SOLID_ENDS_H

#include "core/drive.h"
#include "core/model.h"
#include "core/state.h"
#include "kernels/solid_motion.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Moves state->ends[end] by step_s from state->time_s; `force` (x, y, z, [count] each, slot order) are the
 * internal and external forces on the particles now. */
sphm_end_frame sphm_solid_move_end(const sphm_model *model, sphm_state *state, sphm_real *const force[3],
                                   const sphm_end_drive *drive, int end, double step_s);
/* Force on the particles attached at an end, and its moment about `pivot` (state positions). */
void sphm_solid_sum_end(const sphm_state *state, sphm_real *const force[3], int end, const double pivot[3],
                        double force_N[3], double moment_Nm[3]);

#ifdef __cplusplus
}
#endif
#endif
