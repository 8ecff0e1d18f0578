/* The membrane on the CPU: diffusion and reaction of the membrane potential, and the activation filter.
 * Reads and writes membrane_potential, recovery and activation of the state; membrane_next is scratch. */
#ifndef SPHM_CPU_MEMBRANE_H
#define SPHM_CPU_MEMBRANE_H

#include "core/diffusion.h"
#include "core/drive.h"
#include "core/model.h"
#include "core/state.h"
#include "cpu/column_diffusion.h"
#include "kernels/membrane.h"
#include "sph_muscle/muscle.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sub-steps that one step of step_ms is divided into: none longer than reaction_step_ms nor than 0.9 of the
 * diffusion's stable step. At least 1. */
size_t sphm_membrane_substeps(const sphm_membrane_constants *constants, const sphm_diffusion *diffusion,
                              double step_ms);

/* Advances the membrane by step_s under `drive` with `threads` threads (at least 1; bitwise the same for any
 * number). `timing` may be NULL; else the wall time is added to its diffusion_s and cell_model_s. */
void sphm_cpu_membrane_step(sphm_state *state, const sphm_neighbours *neighbours,
                            const sphm_diffusion *diffusion, const sphm_membrane_constants *constants,
                            const sphm_drive *drive, double step_s, int threads, sphm_timing *timing);
/* The same with the diffusion over columns. */
void sphm_cpu_membrane_step_columns(sphm_state *state, const sphm_column_diffusion *columns,
                                    double stable_step_ms, const sphm_membrane_constants *constants,
                                    const sphm_drive *drive, double step_s, int threads, sphm_timing *timing);

/* Diffusion weights of the neighbour rows, on the positions the rows were built from (listed_x, y, z). */
sphm_status sphm_cpu_build_diffusion(sphm_diffusion *diffusion, const sphm_neighbours *rows,
                                     const sphm_model *model, const sphm_state *state, int threads,
                                     sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
