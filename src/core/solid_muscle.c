/* What only a solid muscle can: commanded activation, moving ends, wrenches. */
#include <math.h>
#include <string.h>

#include "core/context.h"
#include "core/end_blocks.h"
#include "core/muscle.h"

void sphm_muscle_rest_ends(sphm_muscle *muscle) {
    muscle->solid.activation = NAN;
    muscle->solid.activation_end_s = INFINITY;
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        const sphm_end_block *block = &muscle->model.ends[end];
        double bone[3];
        for (int d = 0; d < 3; ++d)
            bone[d] = block->point_m[d] + block->axis[d] * block->tendon_slack_m;
        memset(&muscle->solid.ends[end], 0, sizeof muscle->solid.ends[end]);
        muscle->solid.ends[end].condition = SPHM_END_HELD;
        sphm_end_motion_rest(&muscle->solid.ends[end].motion, bone);
    }
}

static sphm_status refuse_fluid(const sphm_muscle *muscle, const char *what, sphm_context *context) {
    if (muscle->ops->wrench)
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_UNSUPPORTED, "%s needs tissue: solid", what);
}

static sphm_status check_end(int end, sphm_context *context) {
    if (end == SPHM_END_ORIGIN || end == SPHM_END_INSERTION)
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                     "end %d does not exist; 0 is the origin, 1 the insertion", end);
}

sphm_status sphm_muscle_activate(sphm_muscle *muscle, double activation, double duration_s,
                                 sphm_context *context) {
    const sphm_status status = refuse_fluid(muscle, "commanding an activation", context);
    if (status != SPHM_OK)
        return status;
    if (!(duration_s >= 0) || !isfinite(duration_s))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "duration is %g s; it must be finite, and 0 (until replaced) or above", duration_s);
    if (!(activation >= 0 && activation <= 1))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "activation is %g; it must be within 0 ... 1",
                         activation);
    muscle->solid.activation = activation;
    muscle->solid.activation_end_s = duration_s > 0 ? sphm_muscle_time(muscle) + duration_s : INFINITY;
    return SPHM_OK;
}

sphm_status sphm_muscle_release_activation(sphm_muscle *muscle, sphm_context *context) {
    const sphm_status status = refuse_fluid(muscle, "commanding an activation", context);
    if (status == SPHM_OK)
        muscle->solid.activation = NAN;
    return status;
}

static const double none[3] = {0, 0, 0};

static void set_condition(sphm_muscle *muscle, int end, int condition, const double load_N[3]) {
    muscle->solid.ends[end].condition = condition;
    memcpy(muscle->solid.ends[end].load_N, load_N, sizeof muscle->solid.ends[end].load_N);
}

/* What is commanded before a muscle is ready acts from time 0 on, when the end is at its start pose. */
static void frame_now(const sphm_muscle *muscle, int end, sphm_end_state *now) {
    if (!muscle->start.ready) {
        sphm_end_motion_at(&muscle->start.ends[end].motion, INFINITY, now);
        return;
    }
    sphm_end_frame_state(&muscle->model.ends[end], &muscle->solid.ends[end], sphm_muscle_time(muscle),
                         &muscle->ops->clock(muscle->backend)->ends[end], now);
}

sphm_status sphm_muscle_set_end_pose(sphm_muscle *muscle, int end, const sphm_end_pose *pose,
                                     double duration_s, sphm_context *context) {
    sphm_status status = refuse_fluid(muscle, "moving an end", context);
    if (status == SPHM_OK)
        status = check_end(end, context);
    if (status != SPHM_OK)
        return status;
    const double jump_m = muscle->model.parameters.max_pose_jump * muscle->model.body.length_m;
    sphm_end_state now;
    frame_now(muscle, end, &now);
    status = sphm_end_motion_set_from(&muscle->solid.ends[end].motion, sphm_muscle_time(muscle), &now, pose,
                                      duration_s, jump_m, context);
    if (status == SPHM_OK)
        set_condition(muscle, end, SPHM_END_HELD, none);
    return status;
}

/* Refuses fluids, unknown ends and ends that nothing is attached to. */
static sphm_status check_block(const sphm_muscle *muscle, int end, const char *what, sphm_context *context) {
    const sphm_status status = refuse_fluid(muscle, what, context);
    if (status != SPHM_OK)
        return status;
    if (end != SPHM_END_ORIGIN && end != SPHM_END_INSERTION)
        return check_end(end, context);
    if (!(muscle->model.ends[end].particles > 0))
        return sphm_fail(
            context, SPHM_REFUSED_ARGUMENT,
            "%s: no particles are attached at the %s; attachment_fraction is %g, it must be above 0", what,
            end == SPHM_END_ORIGIN ? "origin" : "insertion", muscle->model.parameters.attachment_fraction);
    return status;
}

sphm_status sphm_muscle_set_end_load(sphm_muscle *muscle, int end, const double force_N[3],
                                     sphm_context *context) {
    const sphm_status status = check_block(muscle, end, "loading an end", context);
    if (status != SPHM_OK)
        return status;
    if (!isfinite(force_N[0]) || !isfinite(force_N[1]) || !isfinite(force_N[2]))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "load is (%g, %g, %g) N; it must be finite",
                         force_N[0], force_N[1], force_N[2]);
    set_condition(muscle, end, SPHM_END_LOADED, force_N);
    return SPHM_OK;
}

sphm_status sphm_muscle_slide_end(sphm_muscle *muscle, int end, double force_N, sphm_context *context) {
    const sphm_status status = check_block(muscle, end, "letting an end slide", context);
    if (status != SPHM_OK)
        return status;
    if (!isfinite(force_N))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "load is %g N; it must be finite", force_N);
    const double *axis = muscle->model.ends[end].axis;
    const double load[3] = {force_N * axis[0], force_N * axis[1], force_N * axis[2]};
    set_condition(muscle, end, SPHM_END_SLIDING, load);
    return SPHM_OK;
}

sphm_status sphm_muscle_release_end(sphm_muscle *muscle, int end, sphm_context *context) {
    const sphm_status status = check_block(muscle, end, "releasing an end", context);
    if (status == SPHM_OK)
        set_condition(muscle, end, SPHM_END_FREE, none);
    return status;
}

int sphm_muscle_end_condition(const sphm_muscle *muscle, int end, double load_N[3]) {
    if (!muscle->ops->wrench || end < 0 || end >= SPHM_END_COUNT)
        return -1;
    if (load_N)
        memcpy(load_N, muscle->solid.ends[end].load_N, 3 * sizeof *load_N);
    return (int)muscle->solid.ends[end].condition;
}

/* Unit quaternion x, y, z, w of a rotation, by its largest component (Shepperd, J. Guid. Control 1 (1978)
 * 223). */
static void quaternion_of(const double R[9], double q[4]) {
    const double trace = R[0] + R[4] + R[8];
    const double squares[4] = {1 + 2 * R[0] - trace, 1 + 2 * R[4] - trace, 1 + 2 * R[8] - trace, 1 + trace};
    int largest = 3;
    for (int k = 0; k < 3; ++k)
        largest = squares[k] > squares[largest] ? k : largest;
    const double twice = sqrt(squares[largest]), scale = 0.5 / twice;
    if (largest == 3) {
        q[0] = (R[7] - R[5]) * scale;
        q[1] = (R[2] - R[6]) * scale;
        q[2] = (R[3] - R[1]) * scale;
    } else {
        const int i = largest, j = (i + 1) % 3, k = (i + 2) % 3;
        q[j] = (R[3 * j + i] + R[3 * i + j]) * scale;
        q[k] = (R[3 * k + i] + R[3 * i + k]) * scale;
        q[3] = (R[3 * k + j] - R[3 * j + k]) * scale;
    }
    q[largest] = twice / 2;
}

sphm_status sphm_muscle_end_pose(const sphm_muscle *muscle, int end, sphm_end_pose *pose,
                                 sphm_context *context) {
    sphm_status status = refuse_fluid(muscle, "the pose of an end", context);
    if (status == SPHM_OK)
        status = check_end(end, context);
    if (status != SPHM_OK)
        return status;
    sphm_end_state now;
    frame_now(muscle, end, &now);
    memcpy(pose->position_m, now.position_m, sizeof now.position_m);
    memcpy(pose->velocity_m_per_s, now.velocity_m_per_s, sizeof now.velocity_m_per_s);
    memcpy(pose->angular_velocity_rad_per_s, now.angular_velocity_rad_per_s,
           sizeof now.angular_velocity_rad_per_s);
    quaternion_of(now.rotation, pose->orientation);
    return SPHM_OK;
}

int sphm_muscle_tendon(const sphm_muscle *muscle, int end, double belly_m[3], double bone_m[3]) {
    if (!muscle->ops->wrench || end < 0 || end >= SPHM_END_COUNT ||
        !(muscle->model.ends[end].tendon_N_per_m > 0))
        return 0;
    sphm_end_state belly, bone;
    sphm_end_block_state(&muscle->model.ends[end], &muscle->ops->clock(muscle->backend)->ends[end], &belly);
    frame_now(muscle, end, &bone);
    memcpy(belly_m, belly.position_m, sizeof belly.position_m);
    memcpy(bone_m, bone.position_m, sizeof bone.position_m);
    return 1;
}

sphm_status sphm_muscle_wrench(sphm_muscle *muscle, int end, sphm_wrench *wrench, sphm_context *context) {
    sphm_status status = refuse_fluid(muscle, "the wrench at an end", context);
    if (status == SPHM_OK)
        status = check_end(end, context);
    if (status != SPHM_OK)
        return status;
    muscle->ops->wrench(muscle->backend, &sphm_muscle_drives(muscle)[end], end, wrench);
    return SPHM_OK;
}
