/* The start-up phase; see start_up.h. */
#include "core/start_up.h"

#include <math.h>
#include <string.h>

#include "core/context.h"
#include "core/muscle.h"
#include "kernels/vector.h"

/* How the ends go to their start poses, at most on average; and never faster than this in all. */
#define RAMP_M_PER_S 0.3
#define RAMP_RAD_PER_S 3.0
#define SHORTEST_RAMP_S 0.1
/* How often the speeds are looked at, and for how long they must be small. Both for true inertia: times of
 * vibrations grow with the root of mass_scaling. 50 ms show a mode of 1 Hz and an amplitude of 4e-4 lengths.
 */
#define LOOK_S 2e-3
#define STILL_S 0.05
/* A pose this close to rest, in lengths or rad, is at rest. */
#define NOWHERE 1e-6

/* Planning ----------------------------------------------------------------------------------------------- */

static void rest_pose(const sphm_muscle *muscle, int end, sphm_end_state *rest) {
    const sphm_end_block *block = &muscle->model.ends[end];
    const double stretch = end == SPHM_END_INSERTION
                               ? (muscle->model.parameters.initial_stretch - 1) * muscle->model.body.length_m
                               : 0;
    memset(rest, 0, sizeof *rest);
    for (int d = 0; d < 3; ++d) {
        rest->position_m[d] = block->point_m[d] + block->axis[d] * (block->tendon_slack_m + stretch);
        rest->rotation[4 * d] = 1;
    }
}

static int loaded_from_all_sides(const sphm_parameters *p) {
    return p->surface_pressure != 0 || p->gravity[0] != 0 || p->gravity[1] != 0 || p->gravity[2] != 0;
}

/* The end goes from rest to `start` in the start-up, and is held there when time begins. */
static void plan_end(sphm_muscle *muscle, int end, const sphm_end_state *start) {
    sphm_start_up *s = &muscle->start;
    sphm_end_motion *motion = &s->ends[end].motion;
    double turn[3], step[3];
    const double rest[3] = {motion->from_m[0], motion->from_m[1], motion->from_m[2]};
    sphm_end_motion_rest(motion, rest);
    sphm_turn_between(motion->from_rotation, start->rotation, turn);
    for (int d = 0; d < 3; ++d)
        step[d] = start->position_m[d] - motion->from_m[d];
    const double distance = sqrt(sphm_dot3(step, step)), angle = sqrt(sphm_dot3(turn, turn));
    sphm_end_motion_hold(&muscle->solid.ends[end].motion, start);
    if (distance <= NOWHERE * muscle->model.body.length_m && angle <= NOWHERE)
        return;
    memcpy(motion->to_m, start->position_m, sizeof motion->to_m);
    memcpy(motion->turn_rad, turn, sizeof motion->turn_rad);
    motion->duration_s = fmax(SHORTEST_RAMP_S, fmax(distance / RAMP_M_PER_S, angle / RAMP_RAD_PER_S));
    s->ramp_s = fmax(s->ramp_s, motion->duration_s);
    s->ready = 0;
}

void sphm_muscle_plan_start(sphm_muscle *muscle) {
    const sphm_parameters *p = &muscle->model.parameters;
    sphm_start_up *s = &muscle->start;
    memset(s, 0, sizeof *s);
    s->ready = 1;
    const int held = muscle->model.ends[0].particles > 0 && muscle->model.ends[1].particles > 0;
    if (!muscle->ops->wrench || !(p->settle_time > 0) || !held)
        return; /* what nothing holds does not come to rest */
    s->ready = !loaded_from_all_sides(p);
    memcpy(s->ends, muscle->solid.ends, sizeof s->ends);
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        sphm_end_state start;
        rest_pose(muscle, end, &start);
        plan_end(muscle, end, &start);
    }
}

int sphm_muscle_ready(const sphm_muscle *muscle) {
    return muscle->start.ready;
}

static sphm_status check_start_pose(const sphm_muscle *muscle, int end, sphm_context *context) {
    if (!muscle->ops->wrench)
        return sphm_fail(context, SPHM_REFUSED_UNSUPPORTED, "a start pose needs tissue: solid");
    if (end < 0 || end >= SPHM_END_COUNT)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "end %d does not exist; 0 is the origin, 1 the insertion", end);
    if (!(muscle->model.parameters.settle_time > 0) || !(muscle->model.ends[end].particles > 0))
        return sphm_fail(
            context, SPHM_REFUSED_ARGUMENT,
            "a start pose needs settle_time above 0 (it is %g s) and attachment_fraction above 0 "
            "(%g)",
            muscle->model.parameters.settle_time, muscle->model.parameters.attachment_fraction);
    if (muscle->start.begun || muscle->ops->clock(muscle->backend)->steps > 0)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "a start pose must be given before the first step; reset the muscle");
    return SPHM_OK;
}

sphm_status sphm_muscle_set_start_pose(sphm_muscle *muscle, int end, const sphm_end_pose *pose,
                                       sphm_context *context) {
    sphm_status status = check_start_pose(muscle, end, context);
    if (status != SPHM_OK)
        return status;
    const sphm_parameters *p = &muscle->model.parameters;
    sphm_end_motion *motion = &muscle->start.ends[end].motion, there = *motion;
    sphm_end_state rest, start;
    sphm_end_motion_at(&there, 0, &rest);
    sphm_end_pose still = *pose;
    for (int d = 0; d < 3; ++d)
        still.velocity_m_per_s[d] = still.angular_velocity_rad_per_s[d] = 0;
    status = sphm_end_motion_set_from(&there, 0, &rest, &still, SHORTEST_RAMP_S,
                                      p->max_pose_jump * muscle->model.body.length_m, context);
    if (status != SPHM_OK)
        return status;
    sphm_end_motion_at(&there, SHORTEST_RAMP_S, &start);
    plan_end(muscle, end, &start);
    return SPHM_OK;
}

/* Running ------------------------------------------------------------------------------------------------ */

static double clock_of(const sphm_muscle *muscle) {
    return muscle->ops->clock(muscle->backend)->time_s;
}

/* In slot order, so that the threads do not change a bit. */
static double mean_square_speed(const sphm_state *s) {
    double sum = 0;
    for (size_t i = 0; i < s->count; ++i)
        sum += (double)s->vx[i] * (double)s->vx[i] + (double)s->vy[i] * (double)s->vy[i] +
               (double)s->vz[i] * (double)s->vz[i];
    return sum / (double)s->count;
}

/* Stops all motion; with `begin`, time begins here. */
static sphm_status stop_motion(sphm_muscle *muscle, int begin, sphm_context *context) {
    sphm_state copy;
    const sphm_state *now = sphm_muscle_state(muscle);
    sphm_status status = sphm_state_create(&copy, now->count, context);
    if (status != SPHM_OK)
        return status;
    sphm_state_copy(now, &copy);
    for (size_t i = 0; i < copy.count; ++i)
        copy.vx[i] = copy.vy[i] = copy.vz[i] = copy.fibre_rate[i] = 0;
    for (int end = 0; end < SPHM_END_COUNT; ++end)
        for (int d = 0; d < 3; ++d)
            copy.ends[end].velocity_m_per_s[d] = copy.ends[end].momentum_Nms[d] = 0;
    if (begin) {
        copy.time_s = 0;
        copy.steps = 0;
    }
    status = muscle->ops->restore(muscle->backend, &copy, context);
    ++muscle->changes;
    ++muscle->replacements;
    sphm_state_free(&copy);
    return status;
}

static sphm_status begin_time(sphm_muscle *muscle, int settled, double speed_m_per_s, sphm_context *context) {
    const double took_s = clock_of(muscle);
    const sphm_status status = stop_motion(muscle, 1, context);
    if (status != SPHM_OK)
        return status;
    muscle->start.ready = 1;
    muscle->ops->reset_timing(muscle->backend);
    if (settled)
        sphm_log(context, SPHM_LOG_INFO, "start-up: at rest after %.3g s of its own", took_s);
    else
        sphm_log(
            context, SPHM_LOG_WARNING,
            "start-up: not at rest after settle_time, %.3g s; the particles still move at %.3g m/s (root "
            "mean square), and settle_speed asks for %.3g m/s",
            took_s, speed_m_per_s, muscle->model.parameters.settle_speed * muscle->model.body.length_m);
    return SPHM_OK;
}

/* One look at the speeds. */
static sphm_status watch(sphm_muscle *muscle, sphm_context *context) {
    const sphm_parameters *p = &muscle->model.parameters;
    sphm_start_up *s = &muscle->start;
    const double now = clock_of(muscle), scale = sqrt(p->mass_scaling);
    const double slow = p->settle_speed * muscle->model.body.length_m / scale;
    const double square = mean_square_speed(sphm_muscle_state(muscle));
    const int fast = square > slow * slow, over = now >= s->ramp_s + p->settle_time;
    if (now < s->ramp_s)
        return SPHM_OK;
    s->still_s = fast || !(s->still_s > 0) ? now : s->still_s;
    if (over || now - s->still_s >= STILL_S * scale)
        return begin_time(muscle, !over, sqrt(square), context);
    const int past_peak = fast && square < s->last_square;
    s->last_square = past_peak ? 0 : square;
    return past_peak ? stop_motion(muscle, 0, context) : SPHM_OK;
}

sphm_status sphm_muscle_start_up(sphm_muscle *muscle, double duration_s, sphm_context *context) {
    if (!(duration_s > 0))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "duration is %g s; it must be above 0", duration_s);
    muscle->start.begun = 1;
    sphm_drive drive;
    memset(&drive, 0, sizeof drive);
    drive.activation_commanded = 1; /* to 0: the membrane stands still */
    memcpy(drive.ends, muscle->start.ends, sizeof drive.ends);
    const double look_s = LOOK_S * sqrt(muscle->model.parameters.mass_scaling);
    sphm_status status = SPHM_OK;
    for (double left = duration_s; status == SPHM_OK && !muscle->start.ready && left > 0; left -= look_s) {
        status = sphm_muscle_run_to(muscle, clock_of(muscle) + look_s, &drive, context);
        if (status == SPHM_OK)
            status = watch(muscle, context);
    }
    return status;
}

sphm_status sphm_muscle_finish_start(sphm_muscle *muscle, sphm_context *context) {
    sphm_status status = SPHM_OK;
    while (status == SPHM_OK && !muscle->start.ready)
        status = sphm_muscle_start_up(muscle, 1, context);
    return status;
}
