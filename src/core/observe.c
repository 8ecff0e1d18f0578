/* The public calls that look at a muscle: they hand its state to its observer. */
#include "core/muscle.h"
#include "core/observer.h"
#include "kernels/vector.h"

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

/* Force at the insertion towards the origin. */
static sphm_status observe_force(sphm_muscle *muscle, sphm_observation *o, sphm_context *context) {
    sphm_wrench w;
    sphm_end_pose ends[SPHM_END_COUNT];
    sphm_status status = sphm_muscle_wrench(muscle, SPHM_END_INSERTION, &w, context);
    for (int end = 0; end < SPHM_END_COUNT && status == SPHM_OK; ++end)
        status = sphm_muscle_end_pose(muscle, end, &ends[end], context);
    if (status != SPHM_OK)
        return status;
    double line[3];
    for (int d = 0; d < 3; ++d)
        line[d] = ends[SPHM_END_ORIGIN].position_m[d] - ends[SPHM_END_INSERTION].position_m[d];
    o->attachment_distance_m = sqrt(sphm_dot3(line, line));
    for (int d = 0; d < 3; ++d)
        line[d] = o->attachment_distance_m > 0 ? line[d] / o->attachment_distance_m : 0;
    o->force_N = sphm_dot3(w.force_N, line);
    o->force_active_N = sphm_dot3(w.active_N, line);
    o->force_passive_N = sphm_dot3(w.passive_N, line);
    o->force_damping_N = sphm_dot3(w.damping_N, line);
    return SPHM_OK;
}

sphm_status sphm_muscle_observe(sphm_muscle *muscle, sphm_observation *observation, sphm_context *context) {
    sphm_observer *observer = sphm_muscle_observer(muscle, context);
    if (!observer)
        return SPHM_REFUSED_MEMORY;
    sphm_status status = sphm_observer_observe(observer, sphm_muscle_state(muscle), observation, context);
    observation->stimulus_uA_per_mm2 = sphm_muscle_stimulus(muscle, NULL);
    if (status == SPHM_OK && muscle->ops->wrench)
        status = sphm_observer_fibre_length(observer, &observation->normalised_fibre_length, context);
    if (status == SPHM_OK && muscle->ops->wrench)
        status = observe_force(muscle, observation, context);
    return status;
}

sphm_status sphm_muscle_skin(sphm_muscle *muscle, int field, sphm_skin *skin, sphm_context *context) {
    sphm_observer *observer = sphm_muscle_observer(muscle, context);
    if (!observer)
        return SPHM_REFUSED_MEMORY;
    return sphm_observer_skin(observer, sphm_muscle_state(muscle), field, skin, context);
}
