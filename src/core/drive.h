/* What acts on the muscle during a run of equal steps: constant over that run (but for the motion of the
 * ends, which is given as a function of time), so that a back end can take many steps from one submission.
 * The muscle cuts its steps where the drive changes. */
#ifndef SPHM_CORE_DRIVE_H
#define SPHM_CORE_DRIVE_H

#include "core/end_motion.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPHM_MAX_FORCES 16

typedef struct sphm_point_force {
    double point_m[3], force_N[3], radius_m;
} sphm_point_force;

/* What moves an end. Nothing but doubles: a snapshot stores them in a row. */
typedef struct sphm_end_drive {
    double condition;       /* SPHM_END_HELD, ... */
    double load_N[3];       /* of a loaded or sliding end */
    sphm_end_motion motion; /* of a held one: of its frame, which is the bone's where there is a tendon */
} sphm_end_drive;

typedef struct sphm_drive {
    uint8_t driven[SPHM_ELECTRODE_COUNT]; /* 1 while the electrode carries a current that is not 0 */
    double current_uA_per_mm2[SPHM_ELECTRODE_COUNT];
    size_t force_count;
    sphm_point_force forces[SPHM_MAX_FORCES];

    /* Solid tissue only. */
    int activation_commanded;
    double activation;                   /* target, where commanded */
    sphm_end_drive ends[SPHM_END_COUNT]; /* their motions go on within a run of steps: by time */
} sphm_drive;

#ifdef __cplusplus
}
#endif
#endif
