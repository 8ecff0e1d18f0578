/* Inside a muscle: the model, a back end that holds the state, what drives it, and its observer.
 * Private to the library; muscle.c owns it, observables, skin and snapshots read it. */
#ifndef SPHM_CORE_MUSCLE_H
#define SPHM_CORE_MUSCLE_H

#include "core/backend.h"
#include "core/drive.h"
#include "core/model.h"
#include "core/start_up.h"
#include "core/state.h"
#include "core/stimulus.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A pull that ends by itself. */
typedef struct sphm_timed_force {
    sphm_point_force force;
    double end_s; /* simulated time; infinite: until reset */
} sphm_timed_force;

/* What was commanded of a solid muscle. Nothing but doubles: a snapshot stores them in a row. */
typedef struct sphm_solid_commands {
    double activation;       /* NaN: none, the membrane commands */
    double activation_end_s; /* infinite: until replaced */
    sphm_end_drive ends[SPHM_END_COUNT];
} sphm_solid_commands;

/* What the host knows at the moment that is looked at. */
typedef struct sphm_moment {
    uint64_t changes, replacements; /* of the muscle */
    double time_s, stimulus_uA_per_mm2;
    double line[3],
        distance_m; /* from the insertion's frame to the origin's, unit vector and length; solid */
} sphm_moment;

/* Looks by a back end that does not hold up its steps for them (observe.c). */
typedef struct sphm_looks {
    int refused;          /* it could not: look at its view() */
    int there, under_way; /* a look has finished; another has begun */
    sphm_moment seen, awaited;
    sphm_looked looked; /* the one that has finished */
} sphm_looks;

struct sphm_muscle {
    sphm_model model;
    const sphm_backend_ops *ops;
    sphm_backend *backend; /* holds the state: ops->view(backend) */

    sphm_stimulus stimulus;
    size_t force_count;
    sphm_timed_force forces[SPHM_MAX_FORCES];

    sphm_solid_commands solid; /* tissue: solid */
    sphm_start_up start;       /* before time 0 */

    double requested_step_s; /* the parameter, 0: automatic */
    double rest_step_s;      /* the limit at rest */
    int warned_step;         /* the warning about a reduced step was given */
    int failed;              /* the status of a failed step: only reset, load and destroy are allowed then */
    char failure[1024];

    char device[192];               /* a copy: a reset makes a new back end */
    struct sphm_observer *observer; /* made when somebody first looks (observe.c) */
    uint64_t changes;               /* of the state: steps, resets, restored states */
    uint64_t replacements;          /* the last two only */
    sphm_looks looks;
};

/* The state on the host, up to date, in slot order, relative to model.frame_m. */
static inline const sphm_state *sphm_muscle_state(const sphm_muscle *muscle) {
    return muscle->ops->view(muscle->backend);
}

/* What drives the ends now: before time 0 the start-up phase does. */
static inline const sphm_end_drive *sphm_muscle_drives(const sphm_muscle *muscle) {
    return muscle->start.ready ? muscle->solid.ends : muscle->start.ends;
}

/* Ends at rest, no activation commanded (solid_muscle.c). */
void sphm_muscle_rest_ends(sphm_muscle *muscle);

/* Takes steps to end_s of the back end's clock under a constant drive (muscle.c). */
sphm_status sphm_muscle_run_to(sphm_muscle *muscle, double end_s, const sphm_drive *drive,
                               sphm_context *context);

/* Replaces the state (in any slot order) and forgets a failure; stimulus and forces are left alone. */
sphm_status sphm_muscle_restore(sphm_muscle *muscle, const sphm_state *state, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
