/* The start-up phase of a solid muscle: from the rest shape to a muscle at rest under its pre-stretch, its
 * weight and the pressure around it. It goes before time 0.
 *
 * The ends move smoothly from rest to their start poses while activation is held at 0. From then on the
 * kinetic energy is watched, and all velocities are set to zero whenever it has passed a peak: by then a
 * vibration has turned most of its energy into motion (kinetic damping: Cundall 1976; Barnes, Int. J. Space
 * Structures 14 (1999) 89). It needs no damping rate that would suit every muscle, and nothing of a back end
 * but steps, looks and restores. Settled: the root of the mean square speed stays below settle_speed for as
 * long as a mode of some hertz needs to show. */
#ifndef SPHM_CORE_START_UP_H
#define SPHM_CORE_START_UP_H

#include "core/drive.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_start_up {
    int ready; /* 1: over, or there was nothing to settle */
    int begun; /* 1: too late for start poses */
    sphm_end_drive ends[SPHM_END_COUNT];
    double ramp_s;      /* until when the ends move, on the phase's own clock: the back end's */
    double still_s;     /* since when nothing has been faster than settle_speed */
    double last_square; /* mean square speed at the last look, m2/s2; 0 after a stop */
} sphm_start_up;

/* After creation and reset: is there anything to settle? Puts the ends' commands at their start poses. */
void sphm_muscle_plan_start(sphm_muscle *muscle);
/* Runs the phase to its end. */
sphm_status sphm_muscle_finish_start(struct sphm_muscle *muscle, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
