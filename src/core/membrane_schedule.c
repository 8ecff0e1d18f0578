/* See membrane_schedule.h. */
#include "core/membrane_schedule.h"

#include <math.h>

/* Share of the stable step of the diffusion that is used: at the very limit the shortest wave is undamped. */
static const double diffusion_share = 0.9;

sphm_membrane_table sphm_membrane_tabulate(const sphm_membrane_constants *c, const sphm_drive *drive) {
    sphm_membrane_table table;
    table.anything = 0;
    for (int mask = 0; mask < SPHM_ELECTRODE_MASKS; mask++) {
        double current = 0;
        int driven = 0;
        for (int e = 0; e < SPHM_ELECTRODE_COUNT; e++)
            if ((mask >> e & 1) && drive->driven[e]) {
                current += drive->current_uA_per_mm2[e];
                driven = 1;
            }
        table.anything |= driven;
        table.current[mask] = (sphm_real)current;
        table.lower[mask] = driven ? c->resting_mV - SPHM_ELECTRODE_UNDERSHOOT_MV : -(sphm_real)INFINITY;
        table.upper[mask] = driven ? c->plateau_mV : (sphm_real)INFINITY;
    }
    return table;
}

/* The longest sub-step. */
static double longest_step_ms(const sphm_membrane_constants *c, double stable_step_ms) {
    return fmin((double)c->reaction_step_ms, diffusion_share * stable_step_ms);
}

size_t sphm_membrane_count_substeps(const sphm_membrane_constants *c, double stable_step_ms, double step_ms) {
    /* A step that is the longest one but for rounding is one sub-step, not two. */
    const double substeps = ceil(step_ms / longest_step_ms(c, stable_step_ms) - 1e-6);
    return substeps > 1 ? (size_t)substeps : 1;
}

/* Whether the diffusion over due_ms, to be taken in the next step, will still be one sub-step. */
static int can_wait(const sphm_membrane_constants *c, double stable_step_ms, double due_ms) {
    return due_ms <= longest_step_ms(c, stable_step_ms) * (1 + 1e-6);
}

sphm_membrane_schedule sphm_membrane_schedule_step(const sphm_membrane_constants *c, double stable_step_ms,
                                                   double due_s, double step_s) {
    const double step_ms = step_s * 1e3, due_ms = due_s * 1e3 + step_ms;
    sphm_membrane_schedule s;
    s.substeps = can_wait(c, stable_step_ms, due_ms + step_ms)
                     ? 0
                     : sphm_membrane_count_substeps(c, stable_step_ms, due_ms);
    s.reaction_ms = step_ms / (double)(s.substeps ? s.substeps : 1);
    s.diffusion_ms = s.substeps ? due_ms / (double)s.substeps : 0;
    s.due_s = s.substeps ? 0 : due_s + step_s;
    return s;
}
