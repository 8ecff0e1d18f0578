/* The muscle handle: creation, time, stimulus and forces. What looks at a muscle is in particles.c,
 * observables.c, skin.c and snapshot.c. */
#include "core/muscle.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/choose_backend.h"
#include "core/calibration.h"
#include "core/context.h"
#include "core/electrodes.h"
#include "core/observer.h"

/* A muscle whose steps are to be this share of those at rest (particles at some hundred m/s, or collapsed to
 * a hundredth of their volume) has blown up: steps would shrink until time no longer moves, and advance()
 * would never come back. */
#define RUNAWAY_SHARE 0.01

/* Creation ----------------------------------------------------------------------------------------------- */

void sphm_muscle_destroy(sphm_muscle *muscle) {
    if (!muscle)
        return;
    sphm_observer_destroy(muscle->observer);
    if (muscle->backend)
        muscle->ops->destroy(muscle->backend);
    sphm_stimulus_free(&muscle->stimulus);
    sphm_model_free(&muscle->model);
    free(muscle);
}

/* A step asked for by hand must be stable on the rest shape. */
static sphm_status check_time_step(const sphm_muscle *muscle, sphm_context *context) {
    const double asked = muscle->requested_step_s;
    const sphm_time_step_limits limits = muscle->ops->limits(muscle->backend);
    if (asked <= limits.smallest || muscle->model.parameters.time_step_policy == SPHM_TIME_STEP_REDUCE)
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                     "time_step is %g s, above the limit of %g s (courant %g, acoustic %g, viscous %g, "
                     "shape matching %g); give at most that, 0 for automatic, or time_step_policy: reduce",
                     asked, limits.smallest, limits.courant, limits.acoustic, limits.viscous,
                     limits.shape_matching);
}

static void warn_time_step(sphm_muscle *muscle, double limit_s, sphm_context *context) {
    if (muscle->warned_step || !(muscle->requested_step_s > limit_s))
        return;
    muscle->warned_step = 1;
    sphm_log(context, SPHM_LOG_WARNING, "time_step %g s is above the limit of %g s and was reduced to it",
             muscle->requested_step_s, limit_s);
}

static void take_backend(sphm_muscle *muscle, const sphm_chosen_backend *chosen) {
    if (muscle->backend)
        muscle->ops->destroy(muscle->backend);
    muscle->ops = chosen->ops;
    muscle->backend = chosen->backend;
    memcpy(muscle->device, chosen->device, sizeof muscle->device);
    memset(&muscle->looks, 0, sizeof muscle->looks);
    ++muscle->changes;
    ++muscle->replacements;
}

static sphm_status build(sphm_muscle *muscle, const sphm_parameters *parameters, const sphm_surface *mesh,
                         sphm_context *context) {
    sphm_chosen_backend chosen;
    /* Before the body is filled, which takes a while. */
    sphm_status status = sphm_backend_available(parameters, context);
    sphm_parameters used = *parameters;
    if (status == SPHM_OK && used.max_isometric_force > 0 && used.tissue == SPHM_TISSUE_SOLID) {
        status = sphm_parameters_check(parameters, context);
        if (status == SPHM_OK)
            status = sphm_calibrate_isometric_stress(parameters, mesh, &used.max_isometric_stress, context);
    }
    if (status == SPHM_OK)
        status = sphm_model_create(&muscle->model, &used, mesh, context);
    if (status == SPHM_OK)
        status = sphm_stimulus_create(&muscle->stimulus, parameters, context);
    if (status == SPHM_OK)
        status = sphm_backend_create(&muscle->model, &chosen, context);
    if (status != SPHM_OK)
        return status;
    take_backend(muscle, &chosen);
    sphm_muscle_rest_ends(muscle);
    sphm_muscle_plan_start(muscle);
    muscle->requested_step_s = parameters->time_step;
    muscle->rest_step_s = muscle->ops->limits(muscle->backend).smallest;
    warn_time_step(muscle, muscle->ops->limits(muscle->backend).smallest,
                   parameters->time_step_policy == SPHM_TIME_STEP_REDUCE ? context : NULL);
    return check_time_step(muscle, context);
}

sphm_status sphm_muscle_create(const sphm_parameters *parameters, const sphm_surface *mesh,
                               sphm_muscle **muscle, sphm_context *context) {
    *muscle = NULL;
    sphm_muscle *m = (sphm_muscle *)calloc(1, sizeof *m);
    if (!m)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a muscle");
    const sphm_status status = build(m, parameters, mesh, context);
    if (status != SPHM_OK) {
        sphm_muscle_destroy(m);
        return status;
    }
    *muscle = m;
    return SPHM_OK;
}

/* A new back end holds the rest state; making one is simpler, and surer, than undoing a run. It is chosen
 * anew, too: under `auto` a muscle whose GPU has failed goes on with the CPU. */
sphm_status sphm_muscle_reset(sphm_muscle *muscle, sphm_context *context) {
    sphm_chosen_backend fresh;
    sphm_status status = sphm_backend_create(&muscle->model, &fresh, context);
    if (status != SPHM_OK)
        return status;
    status = sphm_stimulus_reset(&muscle->stimulus, &muscle->model.parameters, context);
    if (status != SPHM_OK) {
        fresh.ops->destroy(fresh.backend);
        return status;
    }
    take_backend(muscle, &fresh);
    sphm_muscle_rest_ends(muscle);
    sphm_muscle_plan_start(muscle);
    muscle->force_count = 0;
    muscle->failed = 0;
    return SPHM_OK;
}

/* The call that failed returns this, and every later one until the muscle is reset or restored. */
static sphm_status fail(sphm_muscle *muscle, sphm_status status, const char *message) {
    muscle->failed = status;
    snprintf(muscle->failure, sizeof muscle->failure, "%s", message);
    return status;
}

sphm_status sphm_muscle_restore(sphm_muscle *muscle, const sphm_state *state, sphm_context *context) {
    sphm_context own; /* the reason is kept even for a caller without a context */
    memset(&own, 0, sizeof own);
    sphm_context *used = context ? context : &own;
    const sphm_status status = muscle->ops->restore(muscle->backend, state, used);
    ++muscle->changes;
    ++muscle->replacements;
    if (status < 0)
        return fail(muscle, status, used->message);
    if (status == SPHM_OK) {
        muscle->failed = 0;
        muscle->start.ready = muscle->start.begun = 1;
    }
    return status;
}

/* Time --------------------------------------------------------------------------------------------------- */

/* The start-up phase goes before time 0, whatever the back end's clock says meanwhile. */
double sphm_muscle_time(const sphm_muscle *muscle) {
    return muscle->start.ready ? muscle->ops->clock(muscle->backend)->time_s : 0;
}
uint64_t sphm_muscle_steps(const sphm_muscle *muscle) {
    return muscle->start.ready ? muscle->ops->clock(muscle->backend)->steps : 0;
}

sphm_time_step_limits sphm_muscle_time_step_limits(const sphm_muscle *muscle) {
    return muscle->ops->limits(muscle->backend);
}

double sphm_muscle_time_step(const sphm_muscle *muscle) {
    const double limit = muscle->ops->limits(muscle->backend).smallest;
    const double asked = muscle->requested_step_s;
    return asked > 0 && asked < limit ? asked : limit;
}

static sphm_status refuse_failed(const sphm_muscle *muscle, sphm_context *context) {
    return sphm_fail(context, (sphm_status)muscle->failed, "%s; reset or load a snapshot to go on",
                     muscle->failure);
}

/* What acts now. Forces that have ended are forgotten. */
static sphm_drive drive_now(sphm_muscle *muscle, double now) {
    sphm_drive drive;
    memset(&drive, 0, sizeof drive);
    sphm_stimulus_drive(&muscle->stimulus, now, &drive);
    size_t kept = 0;
    for (size_t f = 0; f < muscle->force_count; ++f)
        if (muscle->forces[f].end_s > now + SPHM_STIMULUS_TOLERANCE_S)
            muscle->forces[kept++] = muscle->forces[f];
    muscle->force_count = kept;
    for (size_t f = 0; f < kept; ++f)
        drive.forces[f] = muscle->forces[f].force;
    drive.force_count = kept;
    if (muscle->solid.activation_end_s <= now + SPHM_STIMULUS_TOLERANCE_S)
        muscle->solid.activation = NAN;
    drive.activation_commanded = !isnan(muscle->solid.activation);
    drive.activation = muscle->solid.activation;
    memcpy(drive.ends, muscle->solid.ends, sizeof drive.ends);
    return drive;
}

static double next_change(const sphm_muscle *muscle, double now) {
    double next = sphm_stimulus_next_change(&muscle->stimulus, now);
    for (size_t f = 0; f < muscle->force_count; ++f)
        next = fmin(next, muscle->forces[f].end_s);
    if (!isnan(muscle->solid.activation))
        next = fmin(next, muscle->solid.activation_end_s);
    return next;
}

/* A step that has become this short is a state that ran away, and says so instead. */
static sphm_status refuse_runaway(sphm_muscle *muscle, const sphm_time_step_limits *limits,
                                  sphm_context *context) {
    if (limits->smallest >= RUNAWAY_SHARE * muscle->rest_step_s)
        return SPHM_OK;
    sphm_context own;
    memset(&own, 0, sizeof own);
    (void)sphm_fail(&own, SPHM_FAILED_NONFINITE,
                    "the state ran away at %.6g s: particles are so %s that a step may take %.3g s only "
                    "instead of %.3g s",
                    muscle->ops->clock(muscle->backend)->time_s,
                    limits->courant <= limits->smallest ? "fast" : "compressed or stretched",
                    limits->smallest, muscle->rest_step_s);
    (void)sphm_fail(context, SPHM_FAILED_NONFINITE, "%s", own.message);
    return fail(muscle, SPHM_FAILED_NONFINITE, own.message);
}

/* Equal steps, as many as the back end takes at a time, towards `end`, which the drive does not change
 * before. */
static sphm_status submit(sphm_muscle *muscle, double end, const sphm_drive *drive, sphm_context *context) {
    const double left = end - muscle->ops->clock(muscle->backend)->time_s;
    const sphm_time_step_limits limits = muscle->ops->limits(muscle->backend);
    if (refuse_runaway(muscle, &limits, context) != SPHM_OK)
        return SPHM_FAILED_NONFINITE;
    warn_time_step(muscle, limits.smallest, context);
    const double steps = ceil(left / sphm_muscle_time_step(muscle) - 1e-9);
    const double step = left / (steps < 1 ? 1 : steps);
    const size_t most = muscle->ops->steps_at_a_time;
    const size_t count = steps < (double)most ? (steps < 1 ? 1 : (size_t)steps) : most;
    sphm_context own; /* the reason is kept even for a caller without a context */
    memset(&own, 0, sizeof own);
    sphm_context *used = context ? context : &own;
    const sphm_status status = muscle->ops->step(muscle->backend, count, step, drive, used);
    ++muscle->changes;
    return status < 0 ? fail(muscle, status, used->message) : status;
}

sphm_status sphm_muscle_run_to(sphm_muscle *muscle, double end_s, const sphm_drive *drive,
                               sphm_context *context) {
    sphm_status status = muscle->failed ? refuse_failed(muscle, context) : SPHM_OK;
    while (status == SPHM_OK && end_s - muscle->ops->clock(muscle->backend)->time_s > 1e-12 * (1 + end_s))
        status = submit(muscle, end_s, drive, context);
    return status;
}

sphm_status sphm_muscle_advance(sphm_muscle *muscle, double duration_s, sphm_context *context) {
    if (!(duration_s > 0) || !isfinite(duration_s))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "duration is %g s; it must be finite and above 0",
                         duration_s);
    if (muscle->failed)
        return refuse_failed(muscle, context);
    const sphm_status started = sphm_muscle_finish_start(muscle, context);
    if (started != SPHM_OK)
        return started;
    const double end = sphm_muscle_time(muscle) + duration_s;
    for (double now = sphm_muscle_time(muscle); end - now > 1e-12 * (1 + end);
         now = sphm_muscle_time(muscle)) {
        const sphm_drive drive = drive_now(muscle, now);
        const double change = next_change(muscle, now);
        const sphm_status status = submit(muscle, change > now ? fmin(end, change) : end, &drive, context);
        if (status != SPHM_OK)
            return status;
    }
    return SPHM_OK;
}

sphm_status sphm_muscle_step(sphm_muscle *muscle, size_t count, sphm_context *context) {
    const size_t most = muscle->ops->steps_at_a_time;
    sphm_status status = SPHM_OK;
    for (size_t done = 0; done < count && status == SPHM_OK;) {
        const size_t steps = count - done < most ? count - done : most;
        status = sphm_muscle_advance(muscle, (double)steps * sphm_muscle_time_step(muscle), context);
        done += steps;
    }
    return status;
}

/* Stimulus and forces ------------------------------------------------------------------------------------ */

sphm_status sphm_muscle_stimulate(sphm_muscle *muscle, const char *electrode, double current_uA_per_mm2,
                                  double duration_s, sphm_context *context) {
    return sphm_stimulus_command(&muscle->stimulus, sphm_muscle_time(muscle), electrode, current_uA_per_mm2,
                                 duration_s, context);
}

sphm_status sphm_muscle_schedule(sphm_muscle *muscle, const char *schedule, sphm_context *context) {
    return sphm_stimulus_schedule(&muscle->stimulus, sphm_muscle_time(muscle), schedule, context);
}

double sphm_muscle_stimulus(const sphm_muscle *muscle, const char *electrode) {
    const int index = electrode ? sphm_electrode_find(electrode) : muscle->stimulus.default_electrode;
    return index < 0 ? 0 : sphm_stimulus_current(&muscle->stimulus, index, sphm_muscle_time(muscle));
}

static int finite3(const double v[3]) {
    return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

sphm_status sphm_muscle_apply_force(sphm_muscle *muscle, const double point_m[3], const double force_N[3],
                                    double radius_m, double duration_s, sphm_context *context) {
    if (!finite3(point_m) || !finite3(force_N))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "external force (%g, %g, %g) N at (%g, %g, %g) m; all must be finite", force_N[0],
                         force_N[1], force_N[2], point_m[0], point_m[1], point_m[2]);
    if (!(radius_m > 0) || !isfinite(radius_m))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "radius is %g m; it must be finite and above 0",
                         radius_m);
    if (!(duration_s >= 0) || !isfinite(duration_s))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "duration is %g s; it must be finite, and 0 (until reset) or above", duration_s);
    (void)drive_now(muscle, sphm_muscle_time(muscle)); /* forgets forces that have ended */
    if (muscle->force_count == SPHM_MAX_FORCES)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "%d external forces act already; that is the most",
                         SPHM_MAX_FORCES);
    sphm_timed_force *slot = &muscle->forces[muscle->force_count++];
    memcpy(slot->force.point_m, point_m, sizeof slot->force.point_m);
    memcpy(slot->force.force_N, force_N, sizeof slot->force.force_N);
    slot->force.radius_m = radius_m;
    slot->end_s = duration_s > 0 ? sphm_muscle_time(muscle) + duration_s : INFINITY;
    return SPHM_OK;
}

/* Looking ------------------------------------------------------------------------------------------------ */

const sphm_parameters *sphm_muscle_parameters(const sphm_muscle *muscle) {
    return &muscle->model.parameters;
}
const sphm_body *sphm_muscle_body(const sphm_muscle *muscle) {
    return &muscle->model.body;
}
const char *sphm_muscle_device(const sphm_muscle *muscle) {
    return muscle->device;
}
sphm_timing sphm_muscle_timing(const sphm_muscle *muscle) {
    sphm_timing timing = muscle->ops->timing(muscle->backend);
    if (muscle->observer)
        timing.memory_bytes += muscle->observer->memory_bytes;
    return timing;
}
void sphm_muscle_reset_timing(sphm_muscle *muscle) {
    muscle->ops->reset_timing(muscle->backend);
}
