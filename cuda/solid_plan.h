/* What the host computes of a step before the device takes it. */
#ifndef SPHM_CUDA_SOLID_PLAN_H
#define SPHM_CUDA_SOLID_PLAN_H

#include "core/model.h"
#include "cuda/solid_layout.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a run of steps leads on from one to the next. */
typedef struct sphm_solid_clock {
    double time_s, diffusion_due_s;
    uint64_t steps;
    int buffer;                         /* of the potential */
    sphm_end_body ends[SPHM_END_COUNT]; /* where they are, as far as they follow their poses */
} sphm_solid_clock;

/* What does not change within a submission, with nothing failed and nobody hit yet. */
void sphm_solid_plan_drive(sphm_solid_submission *submission, const sphm_model *model,
                           const sphm_drive *drive, const sphm_solid_clock *clock);
/* One step, from `clock`, which is moved on. stable_step_ms: of the diffusion. */
void sphm_solid_plan_step(sphm_solid_plan *plan, const sphm_model *model, const sphm_drive *drive,
                          double stable_step_ms, double step_s, sphm_solid_clock *clock);
/* A step that takes none: strain and stress of the present motion, nothing else. */
void sphm_solid_plan_nothing(sphm_solid_plan *plan, int buffer);

#ifdef __cplusplus
}
#endif
#endif
