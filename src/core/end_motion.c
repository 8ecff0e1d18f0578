/* Motion of an end; see end_motion.h. Evaluated by the back ends at every step. */
#include "core/end_motion.h"

#include <math.h>
#include <string.h>

#include "core/context.h"
#include "kernels/vector.h"

/* Rotations ------------------------------------------------------------------------------------------------
 */

/* Angular velocity of a rotation vector r that changes at r_rate: J(r) r_rate with the left Jacobian. */
static void angular_velocity(const double r[3], const double r_rate[3], double out[3]) {
    const double angle = sqrt(sphm_dot3(r, r)), half = angle / 2;
    if (angle < 1e-4) {
        sphm_twist3(r, 0.5, 1.0 / 6, r_rate, out);
        return;
    }
    const double sinc = sin(half) / half;
    sphm_twist3(r, sinc * sinc / 2, (angle - sin(angle)) / (angle * angle * angle), r_rate, out);
}

/* The inverse: the rate of r that goes with an angular velocity. */
static void rotation_rate(const double r[3], const double spin[3], double out[3]) {
    const double angle = sqrt(sphm_dot3(r, r));
    if (angle < 1e-4) {
        sphm_twist3(r, -0.5, 1.0 / 12, spin, out);
        return;
    }
    sphm_twist3(r, -0.5, 1 / (angle * angle) - 1 / (2 * angle * tan(angle / 2)), spin, out);
}

/* Rotation vector of a unit quaternion x, y, z, w. */
static void rotation_vector(const double q[4], double out[3]) {
    const double sign = q[3] < 0 ? -1 : 1, sine = sqrt(sphm_dot3(q, q));
    const double angle = 2 * atan2(sine, sign * q[3]);
    for (int d = 0; d < 3; ++d)
        out[d] = sine > 1e-12 ? sign * q[d] * angle / sine : 2 * sign * q[d];
}

static void matrix_of_quaternion(const double q[4], double out[9]) {
    double r[3];
    rotation_vector(q, r);
    sphm_rotation_of(r, out);
}

void sphm_turn_between(const double from[9], const double to[9], double out[3]) {
    double difference[9];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            difference[3 * i + j] = sphm_dot3(to + 3 * i, from + 3 * j);
    const double axis[3] = {difference[7] - difference[5], difference[2] - difference[6],
                            difference[3] - difference[1]};
    const double sine = sqrt(sphm_dot3(axis, axis)) / 2,
                 cosine = (difference[0] + difference[4] + difference[8] - 1) / 2;
    const double angle = atan2(sine, cosine);
    for (int d = 0; d < 3; ++d)
        out[d] = sine > 1e-12 ? axis[d] / (2 * sine) * angle : axis[d] / 2;
}

/* Cubics ---------------------------------------------------------------------------------------------------
 */

/* Value and derivative at s = t/T in 0 ... 1 of the cubic from a (slope a_rate) to b (slope b_rate). */
static void hermite(double s, double duration, double a, double a_rate, double b, double b_rate,
                    double *value, double *rate) {
    const double m = a_rate * duration, n = b_rate * duration, d = b - a;
    const double c2 = 3 * d - 2 * m - n, c3 = m + n - 2 * d;
    *value = a + s * (m + s * (c2 + s * c3));
    *rate = (m + s * (2 * c2 + 3 * s * c3)) / duration;
}

void sphm_end_motion_rest(sphm_end_motion *motion, const double rest_m[3]) {
    memset(motion, 0, sizeof *motion);
    memcpy(motion->from_m, rest_m, sizeof motion->from_m);
    memcpy(motion->to_m, rest_m, sizeof motion->to_m);
    for (int d = 0; d < 9; d += 4)
        motion->from_rotation[d] = 1;
}

void sphm_end_motion_hold(sphm_end_motion *motion, const sphm_end_state *at) {
    sphm_end_motion_rest(motion, at->position_m);
    memcpy(motion->from_rotation, at->rotation, sizeof motion->from_rotation);
}

/* The segment in which the end brakes behind `motion`, to come to rest at its target. */
static sphm_end_motion braking(const sphm_end_motion *motion) {
    sphm_end_motion b = *motion;
    double turned[9];
    sphm_rotation_of(motion->turn_rad, turned);
    sphm_multiply33(turned, motion->from_rotation, b.from_rotation);
    angular_velocity(motion->turn_rad, motion->to_rate, b.from_rate);
    b.start_s = motion->start_s + motion->duration_s;
    for (int d = 0; d < 3; ++d) {
        b.from_m[d] = motion->to_m[d];
        b.from_m_per_s[d] = motion->to_m_per_s[d];
        b.turn_rad[d] = b.to_m_per_s[d] = b.to_rate[d] = 0;
    }
    return b;
}

static void segment_at(const sphm_end_motion *motion, double s, sphm_end_state *state) {
    double r[3], r_rate[3], turned[9];
    for (int d = 0; d < 3; ++d) {
        hermite(s, motion->duration_s, motion->from_m[d], motion->from_m_per_s[d], motion->to_m[d],
                motion->to_m_per_s[d], &state->position_m[d], &state->velocity_m_per_s[d]);
        hermite(s, motion->duration_s, 0, motion->from_rate[d], motion->turn_rad[d], motion->to_rate[d],
                &r[d], &r_rate[d]);
    }
    sphm_rotation_of(r, turned);
    sphm_multiply33(turned, motion->from_rotation, state->rotation);
    angular_velocity(r, r_rate, state->angular_velocity_rad_per_s);
}

void sphm_end_motion_at(const sphm_end_motion *motion, double time_s, sphm_end_state *state) {
    const double s = motion->duration_s > 0 ? (time_s - motion->start_s) / motion->duration_s : 2;
    if (s <= 1) {
        segment_at(motion, s > 0 ? s : 0, state);
        return;
    }
    if (!(motion->duration_s > 0)) {
        memset(state, 0, sizeof *state);
        memcpy(state->rotation, motion->from_rotation, sizeof state->rotation);
        memcpy(state->position_m, motion->to_m, sizeof state->position_m);
        return;
    }
    const sphm_end_motion after = braking(motion);
    segment_at(&after, s < 2 ? s - 1 : 1, state);
}

/* Commands -------------------------------------------------------------------------------------------------
 */

static sphm_status check(const sphm_end_pose *pose, double duration_s, sphm_context *context) {
    double sum = 0, norm = 0;
    for (int d = 0; d < 3; ++d)
        sum += fabs(pose->position_m[d]) + fabs(pose->velocity_m_per_s[d]) +
               fabs(pose->angular_velocity_rad_per_s[d]);
    for (int d = 0; d < 4; ++d)
        norm += pose->orientation[d] * pose->orientation[d];
    if (!isfinite(sum) || !isfinite(norm))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "pose of an end at (%g, %g, %g) m; all of it must be finite", pose->position_m[0],
                         pose->position_m[1], pose->position_m[2]);
    if (fabs(norm - 1) > 1e-2)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "orientation (%g, %g, %g, %g) of an end; it must be a unit quaternion x, y, z, w",
                         pose->orientation[0], pose->orientation[1], pose->orientation[2],
                         pose->orientation[3]);
    if (!(duration_s > 0) || !isfinite(duration_s))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "duration of an end's motion is %g s; it must be finite and above 0", duration_s);
    return SPHM_OK;
}

sphm_status sphm_end_motion_set_from(sphm_end_motion *motion, double now_s, const sphm_end_state *now,
                                     const sphm_end_pose *pose, double duration_s, double jump_m,
                                     sphm_context *context) {
    const sphm_status status = check(pose, duration_s, context);
    if (status != SPHM_OK)
        return status;
    double target[9], turn[3], step[3];
    matrix_of_quaternion(pose->orientation, target);
    sphm_turn_between(now->rotation, target, turn);
    for (int d = 0; d < 3; ++d)
        step[d] = pose->position_m[d] - now->position_m[d];
    const double distance = sqrt(sphm_dot3(step, step)), angle = sqrt(sphm_dot3(turn, turn));
    if (distance > jump_m || angle > 3)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "an end is to jump %g m and turn %g rad; at most %g m and 3 rad at a time", distance,
                         angle, jump_m);
    motion->start_s = now_s;
    motion->duration_s = duration_s;
    memcpy(motion->from_rotation, now->rotation, sizeof now->rotation);
    memcpy(motion->from_m, now->position_m, sizeof now->position_m);
    memcpy(motion->from_m_per_s, now->velocity_m_per_s, sizeof now->velocity_m_per_s);
    memcpy(motion->from_rate, now->angular_velocity_rad_per_s, sizeof now->angular_velocity_rad_per_s);
    memcpy(motion->to_m, pose->position_m, sizeof motion->to_m);
    memcpy(motion->to_m_per_s, pose->velocity_m_per_s, sizeof motion->to_m_per_s);
    memcpy(motion->turn_rad, turn, sizeof turn);
    rotation_rate(turn, pose->angular_velocity_rad_per_s, motion->to_rate);
    return SPHM_OK;
}

sphm_status sphm_end_motion_set(sphm_end_motion *motion, double now_s, const sphm_end_pose *pose,
                                double duration_s, double jump_m, sphm_context *context) {
    sphm_end_state now;
    sphm_end_motion_at(motion, now_s, &now);
    return sphm_end_motion_set_from(motion, now_s, &now, pose, duration_s, jump_m, context);
}
