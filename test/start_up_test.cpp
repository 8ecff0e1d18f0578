// The start-up phase: pre-stretch and weight settle before time 0.
#include "solid_muscles.h"

#include <cstdio>
#include <string>
#include <vector>

namespace {

using namespace solid;

// Nothing slows it down but the tissue's own viscosity.
sphm_parameters stretched(double by = 1.05) {
    sphm_parameters p = bar();
    p.velocity_damping = 0;
    p.initial_stretch = by;
    return p;
}

double root_mean_square_speed(const Muscle &muscle) {
    const sphm_state *s = sphm_muscle_state(muscle.get());
    double sum = 0;
    for (size_t i = 0; i < s->count; ++i)
        sum += std::pow(double(s->vx[i]), 2) + std::pow(double(s->vy[i]), 2) + std::pow(double(s->vz[i]), 2);
    return std::sqrt(sum / double(s->count));
}

void settle(const Muscle &muscle) {
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_start_up(muscle.get(), 10, &context), SPHM_OK) << context.message;
    ASSERT_TRUE(sphm_muscle_ready(muscle.get()));
}

// What the log said, warnings only.
struct Warnings {
    std::vector<std::string> texts;
    sphm_context context{};
    Warnings() {
        context.user = this;
        context.log = [](sphm_log_level level, const char *text, void *user) {
            if (level == SPHM_LOG_WARNING)
                static_cast<Warnings *>(user)->texts.push_back(text);
        };
    }
};

// At rest there is nothing to do: such a muscle is ready, as is any fluid.
TEST(StartUp, NothingToSettle) {
    EXPECT_TRUE(sphm_muscle_ready(make(bar()).get()));
    sphm_parameters p = bar();
    p.tissue = SPHM_TISSUE_FLUID;
    p.gravity[2] = -9.81;
    EXPECT_TRUE(sphm_muscle_ready(make(p).get()));
    p = bar();
    p.gravity[2] = -9.81;
    EXPECT_FALSE(sphm_muscle_ready(make(p).get()));
    p.settle_time = 0;
    EXPECT_TRUE(sphm_muscle_ready(make(p).get()));
}

// A stretched bar begins at its length, at rest, pulling as the material law says, and stays so.
TEST(StartUp, APreStretchedBarIsAtRestAtTimeZero) {
    const Muscle muscle = make(stretched());
    const double rest_m = observe(muscle).length_m;
    EXPECT_FALSE(sphm_muscle_ready(muscle.get()));
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_start_up(muscle.get(), 0.01, &context), SPHM_OK);
    EXPECT_FALSE(sphm_muscle_ready(muscle.get())); // on its way
    EXPECT_EQ(sphm_muscle_time(muscle.get()), 0);
    EXPECT_EQ(observe(muscle).time_s, 0);
    settle(muscle);
    EXPECT_EQ(sphm_muscle_time(muscle.get()), 0);
    EXPECT_EQ(sphm_muscle_steps(muscle.get()), 0u);
    EXPECT_EQ(root_mean_square_speed(muscle), 0);

    const sphm_observation o = observe(muscle);
    const double length_m = sphm_muscle_body(muscle.get())->length_m;
    EXPECT_NEAR(o.length_m, rest_m + 0.05 * length_m, 1e-6);
    EXPECT_EQ(o.activation, 0);
    const sphm_wrench origin = wrench(muscle, SPHM_END_ORIGIN),
                      insertion = wrench(muscle, SPHM_END_INSERTION);
    EXPECT_GT(-insertion.force_N[0], 0.1);
    EXPECT_NEAR(origin.force_N[0], -insertion.force_N[0], 0.01 * origin.force_N[0]);
    for (int k = 0; k < 4; ++k) {
        proceed(muscle, 0.05);
        EXPECT_NEAR(wrench(muscle, SPHM_END_INSERTION).force_N[0], insertion.force_N[0],
                    -0.01 * insertion.force_N[0]);
        EXPECT_LT(root_mean_square_speed(muscle), 2e-3 * length_m);
    }
}

// The weight of a bar held at both ends: it hangs through at time 0 and does not swing.
TEST(StartUp, WeightSettlesToo) {
    sphm_parameters p = stretched(1);
    p.gravity[2] = -9.81;
    const Muscle muscle = make(p);
    const auto middle = [&] {
        const sphm_state *s = sphm_muscle_state(muscle.get());
        double sum = 0, count = 0;
        for (size_t i = 0; i < s->count; ++i)
            if (std::fabs(double(s->rest_x[i])) < 0.005) {
                sum += double(s->shift_z[i]);
                ++count;
            }
        return sum / count;
    };
    settle(muscle);
    const double sag_m = middle();
    EXPECT_LT(sag_m, -1e-4);
    double low = sag_m, high = sag_m;
    for (int k = 0; k < 30; ++k) {
        proceed(muscle, 0.01);
        low = std::fmin(low, middle());
        high = std::fmax(high, middle());
    }
    EXPECT_LT(high - low, 0.05 * std::fabs(sag_m));
}

TEST(StartUp, ThreadsAndResetsDoNotChangeABit) {
    sphm_parameters p = stretched();
    p.jitter = 0.2;
    const Muscle one = make(p);
    p.threads = 2;
    const Muscle two = make(p);
    settle(one);
    settle(two);
    const uint64_t settled = sphm_muscle_hash(one.get());
    EXPECT_EQ(sphm_muscle_hash(two.get()), settled);
    proceed(one, 0.01);
    EXPECT_NE(sphm_muscle_hash(one.get()), settled);
    ASSERT_EQ(sphm_muscle_reset(one.get(), nullptr), SPHM_OK);
    EXPECT_FALSE(sphm_muscle_ready(one.get()));
    settle(one);
    EXPECT_EQ(sphm_muscle_hash(one.get()), settled);
}

// In slices, at once, or by the first advance: the same state. What is commanded meanwhile acts from time 0.
TEST(StartUp, RunsAloneBeforeTheFirstAdvance) {
    const Muscle slices = make(stretched()), alone = make(stretched());
    for (int k = 0; k < 5000 && !sphm_muscle_ready(slices.get()); ++k) {
        ASSERT_EQ(sphm_muscle_start_up(slices.get(), 1e-3, nullptr), SPHM_OK);
        if (k == 3) {
            ASSERT_EQ(sphm_muscle_activate(slices.get(), 0.5, 0, nullptr), SPHM_OK);
        }
    }
    EXPECT_EQ(observe(slices).activation, 0);
    ASSERT_EQ(sphm_muscle_activate(alone.get(), 0.5, 0, nullptr), SPHM_OK);
    proceed(slices, 0.01);
    proceed(alone, 0.01);
    EXPECT_EQ(sphm_muscle_hash(slices.get()), sphm_muscle_hash(alone.get()));
    EXPECT_GT(observe(alone).activation, 0.2);
    EXPECT_NEAR(sphm_muscle_time(alone.get()), 0.01, 1e-12);
}

// A settled muscle goes into a file and comes back, into one that has not started up, bit for bit.
TEST(StartUp, ASnapshotHoldsTheSettledState) {
    const std::string path = testing::TempDir() + "start_up_test.snapshot";
    const Muscle first = make(stretched()), second = make(stretched());
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_save(first.get(), path.c_str(), &context), SPHM_OK) << context.message;
    EXPECT_TRUE(sphm_muscle_ready(first.get()));
    ASSERT_EQ(sphm_muscle_load(second.get(), path.c_str(), &context), SPHM_OK) << context.message;
    std::remove(path.c_str());
    EXPECT_TRUE(sphm_muscle_ready(second.get()));
    EXPECT_EQ(sphm_muscle_hash(first.get()), sphm_muscle_hash(second.get()));
    proceed(first, 0.02);
    proceed(second, 0.02);
    EXPECT_EQ(sphm_muscle_hash(first.get()), sphm_muscle_hash(second.get()));
}

// An end starts where it is told to, turned too; later, or too far away, it is refused.
TEST(StartUp, EndsStartWhereTheyAreTold) {
    const Muscle muscle = make(stretched(1));
    sphm_context context{};
    sphm_end_pose pose = end_pose(muscle, SPHM_END_INSERTION);
    pose.position_m[0] += 0.002;
    pose.position_m[1] += 0.003;
    pose.orientation[0] = std::sin(0.2);
    pose.orientation[3] = std::cos(0.2);
    pose.velocity_m_per_s[0] = 0.1; // ignored
    ASSERT_EQ(sphm_muscle_set_start_pose(muscle.get(), SPHM_END_INSERTION, &pose, &context), SPHM_OK)
        << context.message;
    EXPECT_FALSE(sphm_muscle_ready(muscle.get()));
    sphm_end_pose far = pose;
    far.position_m[2] += 0.03;
    EXPECT_EQ(sphm_muscle_set_start_pose(muscle.get(), SPHM_END_INSERTION, &far, &context),
              SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_set_start_pose(muscle.get(), 2, &pose, &context), SPHM_REFUSED_ARGUMENT);
    settle(muscle);
    const sphm_end_pose now = end_pose(muscle, SPHM_END_INSERTION);
    for (int d = 0; d < 3; ++d) {
        EXPECT_NEAR(now.position_m[d], pose.position_m[d], 1e-12);
        EXPECT_EQ(now.velocity_m_per_s[d], 0);
    }
    for (int d = 0; d < 4; ++d)
        EXPECT_NEAR(now.orientation[d], pose.orientation[d], 1e-12);
    proceed(muscle, 0.1);
    EXPECT_NEAR(end_pose(muscle, SPHM_END_INSERTION).position_m[1], pose.position_m[1], 1e-12);
    EXPECT_LT(wrench(muscle, SPHM_END_INSERTION).moment_Nm[0], -1e-6); // the bar is twisted
    EXPECT_EQ(sphm_muscle_set_start_pose(muscle.get(), SPHM_END_INSERTION, &pose, &context),
              SPHM_REFUSED_ARGUMENT);
    EXPECT_NE(std::string(context.message).find("reset"), std::string::npos);
}

// Through a tendon the bone is drawn out, and the belly takes its share of it.
TEST(StartUp, ATendonSharesThePreStretch) {
    sphm_parameters p = stretched();
    p.tendon_stiffness = 2000;
    p.tendon_slack_length = 0.02;
    const Muscle muscle = make(p);
    const double rest_m = observe(muscle).length_m, drawn_m = 0.05 * sphm_muscle_body(muscle.get())->length_m;
    settle(muscle);
    const double share_m = observe(muscle).length_m - rest_m;
    EXPECT_GT(share_m, 0.1 * drawn_m);
    EXPECT_LT(share_m, 0.99 * drawn_m);
    EXPECT_NEAR(-wrench(muscle, SPHM_END_INSERTION).force_N[0], 2000 * (drawn_m - share_m), 1e-3);
}

// What does not come to rest in time is ready all the same, and says so.
TEST(StartUp, TimeIsBounded) {
    sphm_parameters p = stretched();
    p.settle_time = 0.01;
    p.settle_speed = 1e-6;
    const Muscle muscle = make(p);
    Warnings log;
    ASSERT_EQ(sphm_muscle_start_up(muscle.get(), 10, &log.context), SPHM_OK);
    EXPECT_TRUE(sphm_muscle_ready(muscle.get()));
    ASSERT_EQ(log.texts.size(), 1u);
    EXPECT_NE(log.texts[0].find("settle_time"), std::string::npos);
    EXPECT_EQ(sphm_muscle_time(muscle.get()), 0);

    sphm_context context{};
    sphm_muscle *none = nullptr;
    p.settle_time = 0;
    EXPECT_EQ(sphm_muscle_create(&p, nullptr, &none, &context), SPHM_REFUSED_PARAMETER);
    EXPECT_NE(std::string(context.message).find("initial_stretch"), std::string::npos);
}

} // namespace
