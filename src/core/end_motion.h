/* How an end of the muscle moves: a rigid motion whose pose and velocity are continuous in time, whatever
 * poses arrive when. Between two poses a cubic in time (Hermite) joins position and velocity; rotations do
 * the same with the rotation vector from the pose at the start. When no further pose arrives, an end that was
 * still to move at its last pose brakes and comes back to it, and then holds it. */
#ifndef SPHM_CORE_END_MOTION_H
#define SPHM_CORE_END_MOTION_H

#include "sph_muscle/muscle.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_end_motion {
    double start_s, duration_s; /* duration 0: held at `to` for ever */
    double from_m[3], from_m_per_s[3], to_m[3], to_m_per_s[3];
    double from_rotation[9];         /* orientation at the start, row by row */
    double turn_rad[3];              /* rotation vector from there to the target, muscle frame */
    double from_rate[3], to_rate[3]; /* its time derivative at the two ends, rad/s */
} sphm_end_motion;

/* Where an end is at a moment. A point of the end that is at X at rest is at
 *     position + rotation (X - rest position),
 * the rest position being that of the end of the line of action. Muscle frame. */
typedef struct sphm_end_state {
    double rotation[9], position_m[3], velocity_m_per_s[3], angular_velocity_rad_per_s[3];
} sphm_end_state;

/* Held at rest. */
void sphm_end_motion_rest(sphm_end_motion *motion, const double rest_m[3]);
/* Held elsewhere. */
void sphm_end_motion_hold(sphm_end_motion *motion, const sphm_end_state *at);
void sphm_end_motion_at(const sphm_end_motion *motion, double time_s, sphm_end_state *state);
/* Rotation vector of to from^T. */
void sphm_turn_between(const double from[9], const double to[9], double turn_rad[3]);
/* From where the end is at now_s to `pose`, in duration_s. Refuses what is not finite or not a rotation,
 * durations <= 0, and poses farther than jump_m or half a turn from the present one; `motion` is unchanged
 * then. */
sphm_status sphm_end_motion_set(sphm_end_motion *motion, double now_s, const sphm_end_pose *pose,
                                double duration_s, double jump_m, sphm_context *context);
/* The same from any present state, which the end had instead of that of `motion`. */
sphm_status sphm_end_motion_set_from(sphm_end_motion *motion, double now_s, const sphm_end_state *now,
                                     const sphm_end_pose *pose, double duration_s, double jump_m,
                                     sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
