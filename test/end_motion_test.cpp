// Moving ends: velocities are those of the poses, nothing jumps, and an end comes to rest at its last pose.
#include "core/end_motion.h"

#include <cmath>

#include <gtest/gtest.h>

namespace {

sphm_end_pose pose_at(double x, double angle, double speed, double spin) {
    const double axis[3] = {2 / 7.0, 3 / 7.0, 6 / 7.0};
    sphm_end_pose pose{};
    pose.position_m[0] = x;
    pose.position_m[1] = (0.1 - x) / 3;
    pose.velocity_m_per_s[0] = speed;
    pose.velocity_m_per_s[1] = -speed / 3;
    for (int d = 0; d < 3; ++d) {
        pose.orientation[d] = std::sin(angle / 2) * axis[d];
        pose.angular_velocity_rad_per_s[d] = spin * axis[(d + 1) % 3]; // not about the axis of the turn
    }
    pose.orientation[3] = std::cos(angle / 2);
    return pose;
}

sphm_end_state at(const sphm_end_motion &motion, double time) {
    sphm_end_state state{};
    sphm_end_motion_at(&motion, time, &state);
    return state;
}

// Velocities against differences of poses: dR/dt R^T = [w].
void expect_consistent(const sphm_end_motion &motion, double time) {
    const double h = 1e-6;
    const sphm_end_state a = at(motion, time - h), now = at(motion, time), b = at(motion, time + h);
    for (int d = 0; d < 3; ++d)
        EXPECT_NEAR(now.velocity_m_per_s[d], (b.position_m[d] - a.position_m[d]) / (2 * h), 1e-6) << time;
    for (int i = 0; i < 3; ++i) {
        double turning = 0; // entry (k, j) of dR/dt R^T with i, j, k cyclic
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        for (int c = 0; c < 3; ++c)
            turning += (b.rotation[3 * k + c] - a.rotation[3 * k + c]) / (2 * h) * now.rotation[3 * j + c];
        EXPECT_NEAR(now.angular_velocity_rad_per_s[i], turning, 1e-5) << time;
    }
}

void expect_continuous(const sphm_end_motion &before, const sphm_end_motion &after, double time) {
    const sphm_end_state a = at(before, time), b = at(after, time);
    for (int d = 0; d < 3; ++d) {
        EXPECT_NEAR(a.position_m[d], b.position_m[d], 1e-12);
        EXPECT_NEAR(a.velocity_m_per_s[d], b.velocity_m_per_s[d], 1e-10);
        EXPECT_NEAR(a.angular_velocity_rad_per_s[d], b.angular_velocity_rad_per_s[d], 1e-9);
    }
    for (int d = 0; d < 9; ++d)
        EXPECT_NEAR(a.rotation[d], b.rotation[d], 1e-12);
}

TEST(EndMotion, PosesAndVelocitiesAreContinuousAndBelongTogether) {
    const double rest[3] = {0.1, 0, 0};
    sphm_end_motion motion;
    sphm_end_motion_rest(&motion, rest);
    const sphm_end_motion first = motion;
    sphm_end_pose pose = pose_at(0.11, 0.4, 0.3, 2);
    ASSERT_EQ(sphm_end_motion_set(&motion, 1, &pose, 0.1, 0.05, nullptr), SPHM_OK);
    expect_continuous(first, motion, 1);
    for (double t : {1.01, 1.05, 1.09, 1.11, 1.15, 1.19}) // the second half is the braking
        expect_consistent(motion, t);
    const sphm_end_state there = at(motion, 1.1);
    EXPECT_NEAR(there.position_m[0], 0.11, 1e-12);
    EXPECT_NEAR(there.velocity_m_per_s[0], 0.3, 1e-10);
    for (int d = 0; d < 3; ++d)
        EXPECT_NEAR(there.angular_velocity_rad_per_s[d], pose.angular_velocity_rad_per_s[d], 1e-9);

    const sphm_end_motion second = motion; // a further pose, late: while it brakes
    pose = pose_at(0.12, 1.3, 0, 0);
    ASSERT_EQ(sphm_end_motion_set(&motion, 1.13, &pose, 0.1, 0.05, nullptr), SPHM_OK);
    expect_continuous(second, motion, 1.13);
    for (double t : {1.14, 1.2, 1.22})
        expect_consistent(motion, t);
    for (double t : {1.23, 1.3, 5.0}) { // arrived, and holds
        EXPECT_NEAR(at(motion, t).position_m[0], 0.12, 1e-12);
        EXPECT_NEAR(at(motion, t).velocity_m_per_s[0], 0, 1e-10);
        EXPECT_NEAR(at(motion, t).rotation[0] + at(motion, t).rotation[4] + at(motion, t).rotation[8],
                    1 + 2 * std::cos(1.3), 1e-9);
    }
}

TEST(EndMotion, ComesBackToTheLastPoseWhenNoneFollows) {
    const double rest[3] = {0, 0, 0};
    sphm_end_motion motion;
    sphm_end_motion_rest(&motion, rest);
    const sphm_end_pose pose = pose_at(0.01, 0.2, 0.2, 1);
    ASSERT_EQ(sphm_end_motion_set(&motion, 0, &pose, 0.05, 0.05, nullptr), SPHM_OK);
    EXPECT_GT(at(motion, 0.06).position_m[0], 0.011);                 // it cannot stop at once
    EXPECT_LT(at(motion, 0.07).position_m[0], 0.01 + 0.2 * 0.05 / 6); // but goes no farther than 4/27 of that
    for (double t : {0.1, 0.2}) {
        EXPECT_NEAR(at(motion, t).position_m[0], 0.01, 1e-12);
        EXPECT_NEAR(at(motion, t).velocity_m_per_s[0], 0, 1e-12);
        EXPECT_NEAR(at(motion, t).angular_velocity_rad_per_s[1], 0, 1e-12);
    }
}

} // namespace
