// Series tendons, surface pressure, calibration to a target force.
#include "solid_muscles.h"

#include <string>

namespace {

using namespace solid;

constexpr double slack = 0.04, stiffness = 2000;

sphm_parameters tendon_bar() {
    sphm_parameters p = bar();
    p.mass_scaling = 4;
    p.tendon_stiffness = stiffness;
    p.tendon_slack_length = slack;
    return p;
}

// Bone to bone = muscle + slack length + force over stiffness, and the bone feels what the muscle pulls with.
TEST(Tendon, LengthsAddUp) {
    const Muscle muscle = make(tendon_bar());
    EXPECT_NEAR(end_pose(muscle, SPHM_END_INSERTION).position_m[0], 0.03 + slack, 1e-6);
    EXPECT_NEAR(observe(muscle).force_N, 0, 1e-3);
    ASSERT_EQ(sphm_muscle_activate(muscle.get(), 0.5, 0, nullptr), SPHM_OK);
    proceed(muscle, 0.4);
    const sphm_wrench insertion = wrench(muscle, SPHM_END_INSERTION), origin = wrench(muscle, 0);
    const sphm_observation o = observe(muscle);
    EXPECT_GT(o.force_N, 10);
    EXPECT_NEAR(o.force_N, -insertion.force_N[0], 1e-6);
    EXPECT_NEAR(origin.force_N[0], o.force_N, 0.005 * o.force_N);
    EXPECT_NEAR(o.force_active_N + o.force_passive_N + o.force_damping_N, o.force_N, 0.005 * o.force_N);
    for (double moment : insertion.moment_Nm)
        EXPECT_EQ(moment, 0);
    const sphm_state *s = sphm_muscle_state(muscle.get());
    const double block_m = s->ends[SPHM_END_INSERTION].shift_m[0]; // the muscle became shorter by that
    EXPECT_LT(block_m, 0);
    EXPECT_NEAR(-block_m, o.force_N / stiffness, 1e-6);
    EXPECT_NEAR(o.attachment_distance_m, 0.06 + slack, 1e-6);
}

// A bone that comes nearer slackens the tendon: no force, whatever the muscle does.
TEST(Tendon, OnlyPulls) {
    const Muscle muscle = make(tendon_bar());
    hold_at(muscle, SPHM_END_INSERTION, 0.03 + slack - 0.01, 0.05);
    proceed(muscle, 0.1);
    EXPECT_EQ(wrench(muscle, SPHM_END_INSERTION).force_N[0], 0);
    EXPECT_NEAR(sphm_muscle_state(muscle.get())->ends[1].shift_m[0], 0, 1e-4);
}

// A massless tendon passes a load on and is longer by it; held again, the end starts with that tension.
TEST(Tendon, LoadedEndHangsBeyondTheTendon) {
    const Muscle muscle = make(tendon_bar());
    load(muscle, SPHM_END_INSERTION, 3);
    proceed(muscle, 0.3);
    const sphm_observation o = observe(muscle);
    const double block_m = sphm_muscle_state(muscle.get())->ends[1].shift_m[0];
    EXPECT_NEAR(o.force_N, 3, 0.01);
    const double bone = end_pose(muscle, SPHM_END_INSERTION).position_m[0];
    EXPECT_NEAR(bone, 0.03 + block_m + slack + 3 / stiffness, 1e-6);
    hold_at(muscle, SPHM_END_INSERTION, bone, 0.01);
    EXPECT_NEAR(-wrench(muscle, SPHM_END_INSERTION).force_N[0], 3, 1e-3);
    proceed(muscle, 0.1);
    EXPECT_NEAR(-wrench(muscle, SPHM_END_INSERTION).force_N[0], 3, 0.02);
}

TEST(Tendon, StiffOnesShortenTheStep) {
    sphm_parameters p = tendon_bar();
    const double soft = sphm_muscle_time_step(make(p).get());
    p.tendon_stiffness = 1e7;
    const double stiff = sphm_muscle_time_step(make(p).get());
    EXPECT_LT(stiff, 0.5 * soft);
    p.tendon_ends = SPHM_TENDON_BOTH;
    const Muscle muscle = make(p);
    ASSERT_EQ(sphm_muscle_activate(muscle.get(), 0.5, 0, nullptr), SPHM_OK);
    proceed(muscle, 0.02);
    p.attachment_fraction = 0;
    sphm_context context{};
    sphm_muscle *none = nullptr;
    EXPECT_EQ(sphm_muscle_create(&p, nullptr, &none, &context), SPHM_REFUSED_PARAMETER);
    EXPECT_NE(std::string(context.message).find("tendon_stiffness"), std::string::npos);
}

// What is drawn of a tendon: from the belly's end to the bone, as long as it is stretched.
TEST(Tendon, IsBetweenBellyAndBone) {
    sphm_parameters p = bar();
    double belly[3], bone[3];
    EXPECT_EQ(sphm_muscle_tendon(make(p).get(), SPHM_END_INSERTION, belly, bone), 0);
    p.tendon_stiffness = 2000;
    p.tendon_slack_length = 0.02;
    const Muscle muscle = make(p);
    EXPECT_EQ(sphm_muscle_tendon(muscle.get(), SPHM_END_ORIGIN, belly, bone), 0);
    ASSERT_EQ(sphm_muscle_activate(muscle.get(), 0.3, 0, nullptr), SPHM_OK);
    proceed(muscle, 0.1);
    ASSERT_EQ(sphm_muscle_tendon(muscle.get(), SPHM_END_INSERTION, belly, bone), 1);
    EXPECT_NEAR(bone[0], sphm_muscle_body(muscle.get())->insertion_m[0] + 0.02, 1e-12);
    EXPECT_NEAR(2000 * (bone[0] - belly[0] - 0.02), -wrench(muscle, SPHM_END_INSERTION).force_N[0], 1e-6);
    EXPECT_GT(bone[0] - belly[0], 0.021);
}

// A block with nothing held, without fibres: -K ln J/J = p, no force, no drift.
TEST(SurfacePressure, CompressesABlockByTheBulkModulus) {
    sphm_parameters p = bar();
    p.attachment_fraction = 0;
    p.surface_pressure = 2e4;
    p.max_isometric_stress = 0;
    p.along_fibre_shear = p.cross_fibre_shear = 5e3;
    p.velocity_damping = 200;
    const Muscle muscle = make(p);
    proceed(muscle, 0.2);
    double low = 0.5, high = 1;
    for (int i = 0; i < 60; ++i) {
        const double J = (low + high) / 2;
        (-1e5 * std::log(J) / J > 2e4 ? low : high) = J;
    }
    const sphm_observation o = observe(muscle);
    EXPECT_NEAR(o.volume_ratio, low, 2e-4);
    EXPECT_NEAR(o.pressure_mean_Pa, 2e4, 20);
    double momentum = 0, centre = 0;
    const sphm_state *s = sphm_muscle_state(muscle.get());
    for (size_t i = 0; i < s->count; ++i) {
        momentum += double(s->vy[i]) / double(s->count);
        centre += double(s->shift_y[i]) / double(s->count);
    }
    EXPECT_NEAR(momentum, 0, 1e-6);
    EXPECT_NEAR(centre, 0, 1e-7);
}

// A bar of area A: the force is sigma_max f(1/lambda_ofl)/lambda_ofl A.
TEST(Calibration, FindsTheStressOfABar) {
    sphm_parameters p = bar();
    p.max_isometric_force = 80;
    const Muscle muscle = make(p);
    const double r = 1 / 1.07, f = 1 - 4 * (1 - r) * (1 - r);
    EXPECT_NEAR(sphm_muscle_parameters(muscle.get())->max_isometric_stress, 80 / (r * f * bar_area),
                0.02 * 80 / (r * f * bar_area));
    ASSERT_EQ(sphm_muscle_activate(muscle.get(), 1, 0, nullptr), SPHM_OK);
    proceed(muscle, 0.1);
    EXPECT_NEAR(observe(muscle).force_N, 80, 0.8);
    p.max_isometric_force = 1e4;
    sphm_context context{};
    sphm_muscle *none = nullptr;
    EXPECT_EQ(sphm_muscle_create(&p, nullptr, &none, &context), SPHM_REFUSED_PARAMETER);
    EXPECT_NE(std::string(context.message).find("max_isometric_force"), std::string::npos);
}

} // namespace
