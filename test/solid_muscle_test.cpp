// The solid tissue as a muscle: isometric bars and bellies, end forces, moving ends, commands.
#include "solid_muscles.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace {

constexpr bool kDouble = sizeof(sphm_real) == 8;

using solid::bar, solid::bar_area, solid::make, solid::Muscle, solid::wrench;

// What the state says, without an observer.
struct Look {
    double activation = 0, displacement_max_m = 0, pressure_max_Pa = 0, volume_ratio = 0;
    uint64_t hash = 1469598103934665603u; // of the positions, FNV-1a
};
Look look(const Muscle &muscle) {
    Look l;
    const sphm_state *s = sphm_muscle_state(muscle.get());
    for (size_t i = 0; i < s->count; ++i) {
        const double u[3] = {double(s->shift_x[i]), double(s->shift_y[i]), double(s->shift_z[i])};
        l.activation += double(s->activation[i]) / double(s->count);
        l.volume_ratio += 1112 / double(s->density[i]) / double(s->count);
        l.pressure_max_Pa = std::fmax(l.pressure_max_Pa, std::fabs(double(s->pressure[i])));
        l.displacement_max_m = std::fmax(l.displacement_max_m, std::hypot(u[0], u[1], u[2]));
        const sphm_real x[3] = {s->x[i], s->y[i], s->z[i]};
        const auto *bytes = reinterpret_cast<const unsigned char *>(x);
        for (size_t b = 0; b < sizeof x; ++b)
            l.hash = (l.hash ^ bytes[b]) * 1099511628211u;
    }
    return l;
}

double active_curve(double r) {
    const double d = std::fabs(r - 1);
    return d < 0.4 ? 1 - 4 * d * d : d < 0.6 ? 9 * (0.6 - d) * (0.6 - d) : 0;
}

TEST(SolidMuscle, RestsWithoutStimulus) {
    const Muscle muscle = make(bar());
    solid::proceed(muscle, 0.05);
    Look o = look(muscle);
    EXPECT_LT(o.displacement_max_m, 1e-9);
    EXPECT_NEAR(o.volume_ratio, 1, 1e-6);
    EXPECT_LT(o.pressure_max_Pa, 0.1);
    for (int end = 0; end < 2; ++end)
        for (double f : wrench(muscle, end).force_N)
            EXPECT_NEAR(f, 0, 1e-4);
}

// A bar held at its rest length stays as it is, and pulls with sigma_max f(1/lambda_ofl) alpha/lambda_ofl
// times its area.
TEST(SolidMuscle, HeldBarPullsWithTheFibreLaw) {
    const Muscle muscle = make(bar());
    const sphm_parameters *p = sphm_muscle_parameters(muscle.get());
    for (double alpha : {0.1, 1.0}) {
        sphm_context context{};
        ASSERT_EQ(sphm_muscle_activate(muscle.get(), alpha, 0, &context), SPHM_OK) << context.message;
        solid::proceed(muscle, 0.1);
        const double r = 1 / p->optimal_fibre_stretch;
        const double expected = p->max_isometric_stress * active_curve(r) * alpha * r * bar_area;
        const sphm_wrench origin = wrench(muscle, SPHM_END_ORIGIN),
                          insertion = wrench(muscle, SPHM_END_INSERTION);
        EXPECT_NEAR(-insertion.force_N[0], expected, 0.02 * expected) << alpha;
        EXPECT_NEAR(origin.force_N[0], expected, 0.02 * expected) << alpha;
        EXPECT_NEAR(origin.force_N[0] + insertion.force_N[0], 0, 0.001 * expected);
        EXPECT_NEAR(insertion.active_N[0], insertion.force_N[0], 0.01 * expected);
        for (int d = 0; d < 3; ++d) {
            EXPECT_NEAR(insertion.active_N[d] + insertion.passive_N[d] + insertion.damping_N[d],
                        insertion.force_N[d], 1e-6 * expected);
            EXPECT_NEAR(insertion.moment_Nm[d], 0, 1e-3 * expected * 0.015);
        }
    }
}

// Stretched by a tenth: the passive curve, and nothing active.
TEST(SolidMuscle, StretchedBarPullsWithThePassiveLaw) {
    sphm_parameters p = bar();
    p.fibre_coupling = SPHM_FIBRE_TRUE_STRETCH;
    const Muscle muscle = make(p);
    const sphm_body *body = sphm_muscle_body(muscle.get());
    sphm_end_pose pose{};
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_end_pose(muscle.get(), SPHM_END_INSERTION, &pose, &context), SPHM_OK);
    EXPECT_NEAR(pose.orientation[3], 1, 1e-12);
    EXPECT_NEAR(pose.position_m[0], body->insertion_m[0], 1e-12);
    pose.position_m[0] += 0.005;
    ASSERT_EQ(sphm_muscle_set_end_pose(muscle.get(), SPHM_END_INSERTION, &pose, 0.05, &context), SPHM_OK)
        << context.message;
    solid::proceed(muscle, 0.3);
    const sphm_wrench w = wrench(muscle, SPHM_END_INSERTION);
    EXPECT_NEAR(look(muscle).displacement_max_m, 0.005, 1e-6);
    EXPECT_NEAR(w.active_N[0], 0, 1e-6);

    // The stretch amid the bar, from the layers on both sides of it.
    const sphm_state *s = sphm_muscle_state(muscle.get());
    double shift[2] = {0, 0}, place[2] = {0, 0}, layer[2] = {0, 0};
    for (size_t i = 0; i < s->count; ++i)
        if (std::fabs(double(s->rest_x[i])) < 0.005) {
            const int side = s->rest_x[i] > 0;
            shift[side] += double(s->shift_x[i]);
            place[side] += double(s->rest_x[i]);
            layer[side] += 1;
        }
    const double stretch =
        1 + (shift[1] / layer[1] - shift[0] / layer[0]) / (place[1] / layer[1] - place[0] / layer[0]);
    EXPECT_GT(stretch, 1.13);
    const double r = stretch / p.optimal_fibre_stretch;
    const double fibre =
        p.max_isometric_stress * 0.05 * (std::exp(6.6 * (r - 1)) - 1) / p.optimal_fibre_stretch;
    // The matrix adds a few hundred Pa, and J is a little above 1.
    EXPECT_GT(-w.force_N[0], 0.97 * fibre * bar_area);
    EXPECT_LT(-w.force_N[0], 1.03 * (fibre + 700) * bar_area);
}

// Turning one end about the line of action twists the bar: the two moments about it are opposite.
TEST(SolidMuscle, TwistedBarPushesBackOnBothEnds) {
    const Muscle muscle = make(bar());
    sphm_end_pose pose{};
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_end_pose(muscle.get(), SPHM_END_INSERTION, &pose, &context), SPHM_OK);
    pose.orientation[0] = std::sin(0.4);
    pose.orientation[3] = std::cos(0.4);
    ASSERT_EQ(sphm_muscle_set_end_pose(muscle.get(), SPHM_END_INSERTION, &pose, 0.05, &context), SPHM_OK);
    solid::proceed(muscle, 0.3);
    const sphm_wrench origin = wrench(muscle, SPHM_END_ORIGIN),
                      insertion = wrench(muscle, SPHM_END_INSERTION);
    EXPECT_LT(insertion.moment_Nm[0], -1e-5); // back against the turn
    EXPECT_NEAR(origin.moment_Nm[0], -insertion.moment_Nm[0], 0.01 * std::fabs(insertion.moment_Nm[0]));
    sphm_end_pose now{};
    ASSERT_EQ(sphm_muscle_end_pose(muscle.get(), SPHM_END_INSERTION, &now, &context), SPHM_OK);
    for (int d = 0; d < 4; ++d)
        EXPECT_NEAR(now.orientation[d], pose.orientation[d], 1e-9);
}

// Particles beside the clamps are pressed flat. Were they as viscous as they are thin, they would flip from
// step to step for ever while the others rest.
class StronglyActivatedBelly : public testing::TestWithParam<bool> {};

TEST_P(StronglyActivatedBelly, ComesToRest) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.preset = SPHM_PRESET_BELLY;
    p.particles = 4944;
    p.velocity_damping = 150;
    if (!GetParam()) {
        p.passive_compressive_stiffness = 0;
        p.hourglass_stiffness = 3e4; // with less of both, fibres go on collapsing for longer
    }
    const Muscle muscle = make(p);
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_activate(muscle.get(), 1, 0, &context), SPHM_OK) << context.message;
    solid::proceed(muscle,
                   0.24); // a strip beside a clamp, symmetric up to rounding, buckles as late as 0.14 s
    sphm_particles particles{};
    ASSERT_EQ(sphm_muscle_particles(muscle.get(), &particles, &context), SPHM_OK) << context.message;
    double fastest = 0;
    for (size_t k = 0; k < 3 * particles.count; ++k)
        fastest = std::fmax(fastest, std::fabs(double(particles.velocity_m_per_s[k])));
    EXPECT_LT(fastest, 2e-4); // a thousandth of the length a second
    const double pull = -wrench(muscle, SPHM_END_INSERTION).force_N[0];
    EXPECT_NEAR(wrench(muscle, SPHM_END_ORIGIN).force_N[0], pull, 1e-4 * pull);
}

INSTANTIATE_TEST_SUITE_P(SolidMuscle, StronglyActivatedBelly, testing::Bool(),
                         [](const testing::TestParamInfo<bool> &info) {
                             return info.param ? "AsShipped" : "WithoutCompressiveStiffness";
                         });

TEST(SolidMuscle, StimulusActivatesThroughTheMembrane) {
    sphm_parameters p = bar();
    const Muscle muscle = make(p);
    ASSERT_EQ(sphm_muscle_stimulate(muscle.get(), "belly", 8000, 0, nullptr), SPHM_OK);
    solid::proceed(muscle, 0.03);
    Look o = look(muscle);
    EXPECT_GT(o.activation, 0.9);
    EXPECT_GT(-wrench(muscle, SPHM_END_INSERTION).force_N[0], 0.8 * 3e5 / 1.07 * bar_area);
    ASSERT_EQ(sphm_muscle_activate(muscle.get(), 0, 0.2, nullptr), SPHM_OK);
    solid::proceed(muscle, 0.2);
    o = look(muscle);
    EXPECT_NEAR(o.activation, std::exp(-5.0), 0.003);
    solid::proceed(muscle, 0.05); // the command is over: the stimulus, still on, is heard again
    o = look(muscle);
    EXPECT_GT(o.activation, 0.9);
}

TEST(SolidMuscle, ThreadsDoNotChangeABit) {
    uint64_t hash[2];
    for (int threads = 1; threads <= 2; ++threads) {
        sphm_parameters p = bar();
        p.threads = threads;
        p.jitter = 0.2;
        const Muscle muscle = make(p);
        ASSERT_EQ(sphm_muscle_activate(muscle.get(), 0.3, 0, nullptr), SPHM_OK);
        solid::proceed(muscle, 0.01);
        (void)(threads == 2 ? wrench(muscle, 0) : sphm_wrench{}); // looking changes nothing either
        solid::proceed(muscle, 0.01);
        hash[threads - 1] = look(muscle).hash;
    }
    EXPECT_EQ(hash[0], hash[1]);
}

// A snapshot holds commands and motions too: what is restored goes on bit for bit, in another muscle.
TEST(SolidMuscle, SnapshotContinuesBitForBit) {
    const std::string path = testing::TempDir() + "solid_muscle_test.snapshot";
    const Muscle first = make(bar()), second = make(bar());
    sphm_end_pose pose{};
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_end_pose(first.get(), SPHM_END_INSERTION, &pose, &context), SPHM_OK);
    pose.position_m[0] += 0.002;
    pose.velocity_m_per_s[0] = 0.1;
    ASSERT_EQ(sphm_muscle_set_end_pose(first.get(), SPHM_END_INSERTION, &pose, 0.02, &context), SPHM_OK);
    ASSERT_EQ(sphm_muscle_activate(first.get(), 0.3, 0.015, &context), SPHM_OK);
    solid::proceed(first, 0.01);
    ASSERT_EQ(sphm_muscle_save(first.get(), path.c_str(), &context), SPHM_OK) << context.message;
    ASSERT_EQ(sphm_muscle_load(second.get(), path.c_str(), &context), SPHM_OK) << context.message;
    std::remove(path.c_str());
    EXPECT_EQ(sphm_muscle_hash(first.get()), sphm_muscle_hash(second.get()));
    solid::proceed(first, 0.02);
    solid::proceed(second, 0.02);
    EXPECT_EQ(sphm_muscle_hash(first.get()), sphm_muscle_hash(second.get()));
}

TEST(SolidMuscle, BadCommandsAreRefusedByName) {
    const Muscle muscle = make(bar());
    sphm_context context{};
    EXPECT_EQ(sphm_muscle_activate(muscle.get(), NAN, 0, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_activate(muscle.get(), 1.5, 0, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_NE(std::string(context.message).find("1.5"), std::string::npos);
    EXPECT_EQ(sphm_muscle_activate(muscle.get(), 0.5, -1, &context), SPHM_REFUSED_ARGUMENT);
    sphm_end_pose pose{};
    ASSERT_EQ(sphm_muscle_end_pose(muscle.get(), SPHM_END_ORIGIN, &pose, &context), SPHM_OK);
    EXPECT_EQ(sphm_muscle_set_end_pose(muscle.get(), 2, &pose, 0.1, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_set_end_pose(muscle.get(), 0, &pose, 0, &context), SPHM_REFUSED_ARGUMENT);
    sphm_end_pose bad = pose;
    bad.orientation[0] = 1;
    EXPECT_EQ(sphm_muscle_set_end_pose(muscle.get(), 0, &bad, 0.1, &context), SPHM_REFUSED_ARGUMENT);
    bad = pose;
    bad.position_m[1] = NAN;
    EXPECT_EQ(sphm_muscle_set_end_pose(muscle.get(), 0, &bad, 0.1, &context), SPHM_REFUSED_ARGUMENT);
    bad = pose;
    bad.position_m[1] += 0.02; // a third of the length
    EXPECT_EQ(sphm_muscle_set_end_pose(muscle.get(), 0, &bad, 0.1, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_NE(std::string(context.message).find("0.02"), std::string::npos);

    sphm_parameters fluid = bar();
    fluid.tissue = SPHM_TISSUE_FLUID;
    const Muscle other = make(fluid);
    sphm_wrench w{};
    EXPECT_EQ(sphm_muscle_wrench(other.get(), 0, &w, &context), SPHM_REFUSED_UNSUPPORTED);
    EXPECT_NE(std::string(context.message).find("tissue: solid"), std::string::npos);
    EXPECT_EQ(sphm_muscle_activate(other.get(), 0.5, 0, &context), SPHM_REFUSED_UNSUPPORTED);
}

} // namespace
