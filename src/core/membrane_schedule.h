/* What a step of the membrane consists of, for every back end: what each combination of electrodes does to a
 * particle, and how the step is cut into sub-steps (src/cpu/membrane.c says why). */
#ifndef SPHM_CORE_MEMBRANE_SCHEDULE_H
#define SPHM_CORE_MEMBRANE_SCHEDULE_H

#include "core/drive.h"
#include "kernels/membrane.h"

#ifdef __cplusplus
extern "C" {
#endif

/* By the particle's electrode bits. */
#define SPHM_ELECTRODE_MASKS (1 << SPHM_ELECTRODE_COUNT)
typedef struct sphm_membrane_table {
    int anything; /* an electrode is driven */
    sphm_real current[SPHM_ELECTRODE_MASKS], lower[SPHM_ELECTRODE_MASKS], upper[SPHM_ELECTRODE_MASKS];
} sphm_membrane_table;

sphm_membrane_table sphm_membrane_tabulate(const sphm_membrane_constants *constants, const sphm_drive *drive);

/* One step: cell model | diffusion | cell model | ... | cell model, the first and the last cell sweep half as
 * long as the others. Without diffusion one whole cell sweep. */
typedef struct sphm_membrane_schedule {
    size_t substeps;     /* diffusion sweeps; 0: the diffusion waits */
    double reaction_ms;  /* of a whole cell sweep */
    double diffusion_ms; /* of a diffusion sweep */
    double due_s;        /* diffusion that is due after the step */
} sphm_membrane_schedule;

/* A step of step_s where the diffusion lags behind by due_s and is stable up to stable_step_ms. */
sphm_membrane_schedule sphm_membrane_schedule_step(const sphm_membrane_constants *constants,
                                                   double stable_step_ms, double due_s, double step_s);
/* Sub-steps that step_ms is divided into: none longer than reaction_step_ms nor than 0.9 of the diffusion's
 * stable step. At least 1. */
size_t sphm_membrane_count_substeps(const sphm_membrane_constants *constants, double stable_step_ms,
                                    double step_ms);

#ifdef __cplusplus
}
#endif
#endif
