/* The public calls that look at a muscle: they hand its state to its observer. */
#include <math.h>
#include <string.h>

#include "core/muscle.h"
#include "core/observer.h"
#include "kernels/vector.h"

sphm_observer *sphm_muscle_observer(sphm_muscle *muscle, sphm_context *context) {
    if (!muscle->observer)
        (void)sphm_observer_create(&muscle->model, sphm_muscle_state(muscle), &muscle->observer, context);
    return muscle->observer;
}

/* Looks by the back end ---------------------------------------------------------------------------------- */

static sphm_status moment_of(const sphm_muscle *muscle, sphm_moment *moment) {
    sphm_end_pose ends[SPHM_END_COUNT];
    sphm_status status = SPHM_OK;
    memset(moment, 0, sizeof *moment);
    moment->changes = muscle->changes;
    moment->replacements = muscle->replacements;
    moment->time_s = sphm_muscle_time(muscle);
    moment->stimulus_uA_per_mm2 = sphm_muscle_stimulus(muscle, NULL);
    if (!muscle->ops->wrench)
        return SPHM_OK;
    for (int end = 0; end < SPHM_END_COUNT && status == SPHM_OK; ++end)
        status = sphm_muscle_end_pose(muscle, end, &ends[end], NULL);
    if (status != SPHM_OK)
        return status;
    for (int d = 0; d < 3; ++d)
        moment->line[d] = ends[SPHM_END_ORIGIN].position_m[d] - ends[SPHM_END_INSERTION].position_m[d];
    moment->distance_m = sqrt(sphm_dot3(moment->line, moment->line));
    for (int d = 0; d < 3; ++d)
        moment->line[d] = moment->distance_m > 0 ? moment->line[d] / moment->distance_m : 0;
    return SPHM_OK;
}

static sphm_status begin_look(sphm_muscle *muscle, sphm_observer *observer, int particles) {
    sphm_looks *looks = &muscle->looks;
    sphm_status status = sphm_observer_prepare(observer, NULL);
    if (status == SPHM_OK)
        status = moment_of(muscle, &looks->awaited);
    if (status == SPHM_OK)
        status = muscle->ops->look(muscle->backend, observer, particles,
                                   &sphm_muscle_drives(muscle)[SPHM_END_INSERTION], NULL);
    looks->under_way = status == SPHM_OK;
    return status;
}

/* Takes the look that is under way, when it has finished. */
static sphm_status take_look(sphm_muscle *muscle, sphm_observer *observer, int wait) {
    sphm_looks *looks = &muscle->looks;
    int finished = 0;
    const sphm_status status = muscle->ops->looked(muscle->backend, wait, &finished, &looks->looked, NULL);
    if (status != SPHM_OK || !finished)
        return status;
    looks->under_way = 0;
    looks->there = 1;
    looks->seen = looks->awaited;
    observer->shape = looks->looked.shape;
    return SPHM_OK;
}

/* What has been seen is of use; `late`: whatever its age, if only it led to the present state. */
static int suffices(const sphm_muscle *muscle, int particles, int late) {
    const sphm_looks *looks = &muscle->looks;
    return looks->there && (!particles || looks->looked.fields) &&
           (late ? looks->seen.replacements == muscle->replacements : looks->seen.changes == muscle->changes);
}

static sphm_status look(sphm_muscle *muscle, sphm_observer *observer, int particles, int late) {
    sphm_looks *looks = &muscle->looks;
    sphm_status status = SPHM_OK;
    if (looks->under_way)
        status = take_look(muscle, observer, !suffices(muscle, particles, late));
    if (status == SPHM_OK && !looks->under_way && !suffices(muscle, particles, 0))
        status = begin_look(muscle, observer, particles);
    if (status == SPHM_OK && !suffices(muscle, particles, late))
        status = take_look(muscle, observer, 1);
    return status;
}

/* 1: muscle->looks.looked is what was asked for. 0: the back end does not look, or cannot any more, and its
 * view() is to be looked at, which shows what there is. */
static int look_there(sphm_muscle *muscle, sphm_observer *observer, int particles, int late) {
    if (!muscle->ops->look || muscle->looks.refused)
        return 0;
    if (look(muscle, observer, particles, late) == SPHM_OK)
        return 1;
    muscle->looks.refused = 1;
    return 0;
}

/* Public calls ------------------------------------------------------------------------------------------- */

static sphm_status get_particles(sphm_muscle *muscle, int late, sphm_particles *particles,
                                 sphm_context *context) {
    sphm_observer *observer = sphm_muscle_observer(muscle, context);
    if (!observer)
        return SPHM_REFUSED_MEMORY;
    if (!look_there(muscle, observer, 1, late))
        return sphm_observer_particles(observer, sphm_muscle_state(muscle), particles, context);
    sphm_observer_hand_out(observer, muscle->looks.looked.fields, particles);
    return SPHM_OK;
}

/* Force at the insertion towards the origin. */
static void fill_force(const sphm_moment *moment, const sphm_wrench *w, sphm_observation *o) {
    o->attachment_distance_m = moment->distance_m;
    o->force_N = sphm_dot3(w->force_N, moment->line);
    o->force_active_N = sphm_dot3(w->active_N, moment->line);
    o->force_passive_N = sphm_dot3(w->passive_N, moment->line);
    o->force_damping_N = sphm_dot3(w->damping_N, moment->line);
}

/* From what the back end has seen. */
static void fill_from_look(sphm_muscle *muscle, const sphm_observer *observer, sphm_observation *o) {
    sphm_looks *looks = &muscle->looks;
    if (looks->seen.changes == muscle->changes)
        (void)moment_of(muscle, &looks->seen); /* commands may have come since */
    sphm_observer_fill(observer, &looks->looked.sums, o);
    o->time_s = looks->seen.time_s;
    o->stimulus_uA_per_mm2 = looks->seen.stimulus_uA_per_mm2;
    if (!muscle->ops->wrench)
        return;
    if (observer->free_count > 0)
        o->normalised_fibre_length = looks->looked.sums.stretch / (double)observer->free_count /
                                     muscle->model.parameters.optimal_fibre_stretch;
    fill_force(&looks->seen, &looks->looked.wrench, o);
}

static sphm_status get_observation(sphm_muscle *muscle, int late, int particles, sphm_observation *o,
                                   sphm_context *context) {
    sphm_wrench w;
    sphm_moment now;
    sphm_observer *observer = sphm_muscle_observer(muscle, context);
    if (!observer)
        return SPHM_REFUSED_MEMORY;
    if (look_there(muscle, observer, particles, late)) {
        fill_from_look(muscle, observer, o);
        return SPHM_OK;
    }
    sphm_status status = sphm_observer_observe(observer, sphm_muscle_state(muscle), o, context);
    o->time_s = sphm_muscle_time(muscle);
    o->stimulus_uA_per_mm2 = sphm_muscle_stimulus(muscle, NULL);
    if (status != SPHM_OK || !muscle->ops->wrench)
        return status;
    status = sphm_observer_fibre_length(observer, &o->normalised_fibre_length, context);
    if (status == SPHM_OK)
        status = sphm_muscle_wrench(muscle, SPHM_END_INSERTION, &w, context);
    if (status == SPHM_OK)
        status = moment_of(muscle, &now);
    if (status == SPHM_OK)
        fill_force(&now, &w, o);
    return status;
}

sphm_status sphm_muscle_particles(sphm_muscle *muscle, sphm_particles *particles, sphm_context *context) {
    return get_particles(muscle, 0, particles, context);
}

sphm_status sphm_muscle_observe(sphm_muscle *muscle, sphm_observation *observation, sphm_context *context) {
    return get_observation(muscle, 0, 0, observation, context);
}

sphm_status sphm_muscle_glance(sphm_muscle *muscle, sphm_particles *particles, sphm_observation *observation,
                               sphm_context *context) {
    sphm_status status = SPHM_OK;
    if (observation)
        status = get_observation(muscle, 1, particles != NULL, observation, context);
    /* Of the same moment: the look that has begun meanwhile may have finished already. */
    if (status == SPHM_OK && particles && observation && muscle->looks.there && !muscle->looks.refused)
        sphm_observer_hand_out(muscle->observer, muscle->looks.looked.fields, particles);
    else if (status == SPHM_OK && particles)
        status = get_particles(muscle, 1, particles, context);
    return status;
}

static sphm_status get_skin(sphm_muscle *muscle, int late, int field, sphm_skin *skin,
                            sphm_context *context) {
    sphm_particles particles;
    sphm_observer *observer = sphm_muscle_observer(muscle, context);
    if (!observer)
        return SPHM_REFUSED_MEMORY;
    if (!look_there(muscle, observer, 1, late))
        return sphm_observer_skin(observer, sphm_muscle_state(muscle), field, skin, context);
    sphm_observer_hand_out(observer, muscle->looks.looked.fields, &particles);
    return sphm_observer_drape(observer, &particles, muscle->looks.looked.place_m, field, skin, context);
}

sphm_status sphm_muscle_skin(sphm_muscle *muscle, int field, sphm_skin *skin, sphm_context *context) {
    return get_skin(muscle, 0, field, skin, context);
}

sphm_status sphm_muscle_glance_skin(sphm_muscle *muscle, int field, sphm_skin *skin, sphm_context *context) {
    return get_skin(muscle, 1, field, skin, context);
}

double sphm_muscle_glance_time(const sphm_muscle *muscle) {
    return muscle->looks.there && !muscle->looks.refused ? muscle->looks.seen.time_s
                                                         : sphm_muscle_time(muscle);
}
