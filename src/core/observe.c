/* The public calls that look at a muscle: they hand its state to its observer. */
#include "core/muscle.h"
#include "core/observer.h"

sphm_observer *sphm_muscle_observer(sphm_muscle *muscle, sphm_context *context) {
    if (!muscle->observer)
        (void)sphm_observer_create(&muscle->model, sphm_muscle_state(muscle), &muscle->observer, context);
    return muscle->observer;
}

sphm_status sphm_muscle_particles(sphm_muscle *muscle, sphm_particles *particles, sphm_context *context) {
    sphm_observer *observer = sphm_muscle_observer(muscle, context);
    if (!observer)
        return SPHM_REFUSED_MEMORY;
    return sphm_observer_particles(observer, sphm_muscle_state(muscle), particles, context);
}

sphm_status sphm_muscle_observe(sphm_muscle *muscle, sphm_observation *observation, sphm_context *context) {
    sphm_observer *observer = sphm_muscle_observer(muscle, context);
    if (!observer)
        return SPHM_REFUSED_MEMORY;
    const sphm_status status =
        sphm_observer_observe(observer, sphm_muscle_state(muscle), observation, context);
    observation->stimulus_uA_per_mm2 = sphm_muscle_stimulus(muscle, NULL);
    return status;
}

sphm_status sphm_muscle_skin(sphm_muscle *muscle, int field, sphm_skin *skin, sphm_context *context) {
    sphm_observer *observer = sphm_muscle_observer(muscle, context);
    if (!observer)
        return SPHM_REFUSED_MEMORY;
    return sphm_observer_skin(observer, sphm_muscle_state(muscle), field, skin, context);
}
