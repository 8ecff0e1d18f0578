/* See membrane_plan.h. */
#include "cuda/membrane_plan.h"

#include <math.h>
#include <string.h>

#include "core/membrane_schedule.h"

void sphm_membrane_plan_filter(sphm_membrane_plan *plan, const sphm_membrane_constants *c, double step_s) {
    memset(plan, 0, sizeof *plan);
    plan->rise = (sphm_real)-expm1(-step_s * 1e3 / (double)c->activation_ms);
    plan->fall = (sphm_real)-expm1(-step_s * 1e3 / (double)c->deactivation_ms);
}

void sphm_membrane_plan_step(sphm_membrane_plan *plan, const sphm_membrane_constants *c,
                             double stable_step_ms, double step_s, double *due_s, int *buffer) {
    const sphm_membrane_schedule schedule = sphm_membrane_schedule_step(c, stable_step_ms, *due_s, step_s);
    const int several = schedule.substeps > 0;
    sphm_membrane_plan_filter(plan, c, step_s);
    plan->buffer = *buffer;
    plan->substeps = (int)schedule.substeps;
    plan->first_ms = (sphm_real)(several ? schedule.reaction_ms / 2 : schedule.reaction_ms);
    plan->between_ms = (sphm_real)schedule.reaction_ms;
    plan->last_ms = (sphm_real)(schedule.reaction_ms / 2);
    plan->diffusion_ms = (sphm_real)schedule.diffusion_ms;
    *due_s = schedule.due_s;
    *buffer = (*buffer + plan->substeps) & 1;
}
