/* What a step does to the membrane, planned on the host for either tissue: cell sweeps and diffusions in
 * turn. */
#ifndef SPHM_CUDA_MEMBRANE_PLAN_H
#define SPHM_CUDA_MEMBRANE_PLAN_H

#include "kernels/membrane.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_membrane_plan {
    int substeps;           /* diffusion sweeps; 0: the diffusion waits */
    int buffer;             /* of the potential, at the start of the step */
    sphm_real first_ms;     /* cell sweep before the first diffusion */
    sphm_real between_ms;   /* between two */
    sphm_real last_ms;      /* after the last */
    sphm_real diffusion_ms; /* each diffusion */
    sphm_real rise, fall;   /* of the activation filter */
} sphm_membrane_plan;

/* Only the filter of a step of step_s: the membrane stands still. */
void sphm_membrane_plan_filter(sphm_membrane_plan *plan, const sphm_membrane_constants *constants,
                               double step_s);
/* A whole step, from potential buffer *buffer with the diffusion *due_s behind; both are moved on.
 * stable_step_ms: of the diffusion. */
void sphm_membrane_plan_step(sphm_membrane_plan *plan, const sphm_membrane_constants *constants,
                             double stable_step_ms, double step_s, double *due_s, int *buffer);

#ifdef __cplusplus
}
#endif
#endif
