// Solid muscles for tests: a bar of 60 x 15 x 15 mm held at both ends, and short names for what
// is done to it.
#ifndef SPHM_TEST_SOLID_MUSCLES_H
#define SPHM_TEST_SOLID_MUSCLES_H

#include "core/muscle.h"

#include <cmath>
#include <memory>

#include <gtest/gtest.h>

namespace solid {

struct Destroy {
    void operator()(sphm_muscle *muscle) const { sphm_muscle_destroy(muscle); }
};
using Muscle = std::unique_ptr<sphm_muscle, Destroy>;

inline Muscle make(const sphm_parameters &parameters) {
    sphm_context context{};
    sphm_muscle *muscle = nullptr;
    EXPECT_EQ(sphm_muscle_create(&parameters, nullptr, &muscle, &context), SPHM_OK) << context.message;
    return Muscle(muscle);
}

// 500 particles of 3 mm, settled by drag; five layers are held at each end, as if clamped 12 mm from it: 36
// mm are free.
inline sphm_parameters bar() {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.preset = SPHM_PRESET_BAR;
    p.belly_length = 0.06;
    p.belly_width = 0.015;
    p.belly_thickness = 0.015;
    p.particles = 500;
    p.threads = 1;
    p.velocity_damping = 100;
    p.attachment_fraction = 0.2;
    return p;
}
constexpr double bar_area = 0.015 * 0.015;

inline void proceed(const Muscle &muscle, double seconds) {
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_advance(muscle.get(), seconds, &context), SPHM_OK) << context.message;
}

inline sphm_wrench wrench(const Muscle &muscle, int end) {
    sphm_context context{};
    sphm_wrench w{};
    EXPECT_EQ(sphm_muscle_wrench(muscle.get(), end, &w, &context), SPHM_OK) << context.message;
    return w;
}

inline sphm_observation observe(const Muscle &muscle) {
    sphm_context context{};
    sphm_observation o{};
    EXPECT_EQ(sphm_muscle_observe(muscle.get(), &o, &context), SPHM_OK) << context.message;
    return o;
}

inline sphm_end_pose end_pose(const Muscle &muscle, int end) {
    sphm_context context{};
    sphm_end_pose pose{};
    EXPECT_EQ(sphm_muscle_end_pose(muscle.get(), end, &pose, &context), SPHM_OK) << context.message;
    return pose;
}

// Holds an end at x (its other coordinates and its orientation stay), reached within `seconds`.
inline void hold_at(const Muscle &muscle, int end, double x, double seconds) {
    sphm_context context{};
    sphm_end_pose pose = end_pose(muscle, end);
    pose.position_m[0] = x;
    for (int d = 0; d < 3; ++d)
        pose.velocity_m_per_s[d] = pose.angular_velocity_rad_per_s[d] = 0;
    ASSERT_EQ(sphm_muscle_set_end_pose(muscle.get(), end, &pose, seconds, &context), SPHM_OK)
        << context.message;
}

inline void load(const Muscle &muscle, int end, double x, double y = 0, double z = 0) {
    const double force[3] = {x, y, z};
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_set_end_load(muscle.get(), end, force, &context), SPHM_OK) << context.message;
}

} // namespace solid

#endif
