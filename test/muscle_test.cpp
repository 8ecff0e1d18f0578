// The handle: rest, contraction, time, forces, and what is refused.
#include "muscles.h"

#include <cmath>
#include <limits>

namespace {

const double nan_ = std::numeric_limits<double>::quiet_NaN();

double largest_move(const Muscle &m) {
    const sphm_state &s = m.state();
    double worst = 0;
    for (size_t i = 0; i < s.count; ++i)
        worst = std::max(worst, std::hypot(double(s.x[i] - s.rest_x[i]), double(s.y[i] - s.rest_y[i]),
                                           double(s.z[i] - s.rest_z[i])));
    return worst;
}

TEST(Muscle, AtRestNothingMoves) {
    for (const char *coupling : {"pressure", "fibre_tension"}) {
        Muscle m(Muscle::Settings{{"coupling", coupling}});
        m.advance(0.5);
        EXPECT_LT(largest_move(m), 1e-6 * m.handle->model.body.spacing_m) << coupling;
    }
}

TEST(Muscle, ContractsWhileStimulatedAndComesBack) {
    Muscle m;
    m.stimulate(8000);
    m.advance(0.25);
    const double moved = largest_move(m);
    double volume = 0, rest_volume = 0;
    for (size_t i = 0; i < m.count(); ++i) {
        volume += 1 / double(m.state().density[i]);
        rest_volume += 1 / double(m.state().rest_density[i]);
        if (m.state().attachment[i] != SPHM_FREE) {
            EXPECT_EQ(m.state().x[i], m.state().rest_x[i]);
        }
    }
    EXPECT_GT(moved, 0.2 * m.handle->model.body.spacing_m);
    EXPECT_NEAR(volume / rest_volume, 1, 0.1);
    m.stimulate(0);
    m.advance(0.3);
    EXPECT_LT(largest_move(m), 0.5 * moved);
}

// The demonstration, with fewer particles: what its users are promised to see.
TEST(Muscle, BulgesWhileTheDemoIsStimulatedAndFallsBack) {
    Muscle m(Muscle::Settings{{"preset", "triceps_long_head"}, {"coupling", "fibre_tension"}});
    sphm_observation rest{}, held{}, after{};
    const auto observe = [&](sphm_observation *o) {
        ASSERT_EQ(sphm_muscle_observe(m.handle, o, &m.context), SPHM_OK) << m.context.message;
    };
    observe(&rest);
    m.stimulate(8000);
    m.advance(0.5);
    observe(&held);
    m.stimulate(0);
    m.advance(0.5);
    observe(&after);
    EXPECT_LT(std::fabs(rest.bulge), 1e-6);
    EXPECT_GT(held.bulge, 0.02);
    EXPECT_GT(held.displacement_sections_m, 0.2 * m.handle->model.body.spacing_m);
    EXPECT_GT(held.displacement_surface_m, 0.2 * m.handle->model.body.spacing_m);
    EXPECT_NEAR(held.volume_ratio, 1, 0.1);
    EXPECT_LT(after.displacement_sections_m, 0.5 * held.displacement_sections_m);
    EXPECT_LT(after.displacement_surface_m, 0.5 * held.displacement_surface_m);
    EXPECT_LT(after.bulge, 0.5 * held.bulge);
}

TEST(Muscle, TenSecondsOfRestMoveNothing) {
    Muscle m(Muscle::Settings{{"particles", "120"}});
    m.advance(10);
    EXPECT_LT(largest_move(m), 0.01 * m.handle->model.body.spacing_m);
}

TEST(Muscle, GravityMakesTheFreePartSag) {
    Muscle m(Muscle::Settings{{"gravity", "[0, 0, -9.81]"}});
    m.advance(0.3);
    double fall = 0;
    for (size_t i = 0; i < m.count(); ++i)
        fall += double(m.state().z[i] - m.state().rest_z[i]) / double(m.count());
    EXPECT_LT(fall, -1e-5);
    EXPECT_GT(fall, -m.handle->model.body.mid_radius_m); // held by its ends and its shape
}

TEST(Muscle, AdvancesByExactlyTheDuration) {
    Muscle m;
    ASSERT_EQ(sphm_muscle_schedule(m.handle, "0.00711:0.01333:8000", &m.context), SPHM_OK);
    for (int k = 1; k <= 4; ++k) {
        m.advance(1.0 / 60);
        EXPECT_NEAR(sphm_muscle_time(m.handle), k / 60.0, 1e-9);
    }
    const uint64_t steps = sphm_muscle_steps(m.handle);
    ASSERT_EQ(sphm_muscle_step(m.handle, 5, &m.context), SPHM_OK);
    EXPECT_EQ(sphm_muscle_steps(m.handle), steps + 5);
}

TEST(Muscle, RefusesBadDurations) {
    Muscle m;
    for (double bad : {0.0, -1.0, nan_, std::numeric_limits<double>::infinity()})
        EXPECT_EQ(sphm_muscle_advance(m.handle, bad, &m.context), SPHM_REFUSED_ARGUMENT) << bad;
    EXPECT_EQ(sphm_muscle_time(m.handle), 0);
}

TEST(Muscle, AGivenTimeStepIsReducedOrRefused) {
    Muscle reduced(Muscle::Settings{{"time_step", "0.05"}});
    ASSERT_EQ(reduced.status, SPHM_OK);
    EXPECT_NE(reduced.warnings.find("0.05"), std::string::npos);
    EXPECT_LT(sphm_muscle_time_step(reduced.handle), 0.05);
    EXPECT_EQ(sphm_muscle_time_step(reduced.handle), sphm_muscle_time_step_limits(reduced.handle).smallest);

    Muscle refused(Muscle::Settings{{"time_step", "0.05"}, {"time_step_policy", "refuse"}});
    EXPECT_EQ(refused.status, SPHM_REFUSED_PARAMETER);
    EXPECT_EQ(refused.handle, nullptr);
    EXPECT_NE(std::string(refused.context.message).find("time_step is 0.05"), std::string::npos);

    Muscle small(Muscle::Settings{{"time_step", "1e-5"}, {"time_step_policy", "refuse"}});
    ASSERT_EQ(small.status, SPHM_OK);
    EXPECT_EQ(sphm_muscle_time_step(small.handle), 1e-5);
}

TEST(Muscle, ForcesPullAndForgetThemselves) {
    Muscle m(Muscle::Settings{{"pair_matching", "0"}, {"shape_matching_rate", "1"}});
    const double point[3] = {0, 0, 0}, force[3] = {0, 0, 0.2};
    ASSERT_EQ(sphm_muscle_apply_force(m.handle, point, force, 1, 0.01, &m.context), SPHM_OK);
    m.advance(0.0005);
    double momentum = 0, expected = 0.2 * 0.0005;
    for (size_t i = 0; i < m.count(); ++i)
        momentum += double(m.state().vz[i]) * m.handle->model.particle_mass_kg;
    EXPECT_GT(momentum, 0.4 * expected); // the attached ends take their share
    EXPECT_LE(momentum, expected);
    m.advance(0.02);
    ASSERT_EQ(sphm_muscle_apply_force(m.handle, point, force, 1, 0, &m.context), SPHM_OK);
    EXPECT_EQ(m.handle->force_count, 1u);
}

TEST(Muscle, RefusesBadForces) {
    Muscle m;
    const double point[3] = {0, 0, 0}, bad[3] = {0, nan_, 0};
    EXPECT_EQ(sphm_muscle_apply_force(m.handle, bad, point, 0.1, 0, &m.context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_apply_force(m.handle, point, bad, 0.1, 0, &m.context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_apply_force(m.handle, point, point, 0, 0, &m.context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_apply_force(m.handle, point, point, 0.1, -1, &m.context), SPHM_REFUSED_ARGUMENT);
    for (int k = 0; k < SPHM_MAX_FORCES; ++k)
        EXPECT_EQ(sphm_muscle_apply_force(m.handle, point, point, 0.1, 0, &m.context), SPHM_OK);
    EXPECT_EQ(sphm_muscle_apply_force(m.handle, point, point, 0.1, 0, &m.context), SPHM_REFUSED_ARGUMENT);
}

TEST(Muscle, RefusesBadStimuliAndKeepsRunning) {
    Muscle m;
    m.stimulate(3);
    EXPECT_EQ(sphm_muscle_stimulate(m.handle, nullptr, nan_, 0, &m.context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_stimulate(m.handle, "elbow", 1, 0, &m.context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_stimulus(m.handle, nullptr), 3);
    m.advance(0.001);
}

TEST(Muscle, ANonFiniteStateStopsItUntilReset) {
    Muscle m;
    m.advance(0.001);
    sphm_state &s = const_cast<sphm_state &>(m.state());
    const size_t slot = s.count / 2; // slots follow the length: mid-belly
    ASSERT_EQ(s.attachment[slot], SPHM_FREE);
    s.vy[slot] = std::numeric_limits<sphm_real>::quiet_NaN();
    const int particle = s.id[slot];
    EXPECT_EQ(sphm_muscle_advance(m.handle, 0.001, &m.context), SPHM_FAILED_NONFINITE);
    const std::string message = m.context.message;
    EXPECT_NE(message.find("particle " + std::to_string(particle)), std::string::npos) << message;
    EXPECT_NE(message.find("prediction"), std::string::npos) << message;
    EXPECT_EQ(sphm_muscle_advance(m.handle, 0.001, &m.context), SPHM_FAILED_NONFINITE);
    ASSERT_EQ(sphm_muscle_reset(m.handle, &m.context), SPHM_OK);
    EXPECT_EQ(sphm_muscle_time(m.handle), 0);
    m.advance(0.001);
}

// Any force ends: finite velocities that make steps shrink to nothing are a failure like an overflow.
TEST(Muscle, ARunawayStopsItUntilReset) {
    Muscle m;
    const double point[3] = {0, 0, 0};
    for (double newton : {1e9, 1e15, 1e38}) {
        const double force[3] = {0, newton, 0};
        ASSERT_EQ(sphm_muscle_apply_force(m.handle, point, force, 1, 0, &m.context), SPHM_OK);
        EXPECT_EQ(sphm_muscle_advance(m.handle, 0.05, &m.context), SPHM_FAILED_NONFINITE) << newton;
        if (newton < 1e18) {
            EXPECT_NE(std::string(m.context.message).find("ran away"), std::string::npos)
                << m.context.message;
        }
        EXPECT_EQ(sphm_muscle_advance(m.handle, 0.05, nullptr), SPHM_FAILED_NONFINITE);
        ASSERT_EQ(sphm_muscle_reset(m.handle, &m.context), SPHM_OK);
        m.advance(0.001);
    }
}

TEST(Muscle, TheNameOfTheDeviceOutlivesAReset) {
    Muscle m;
    const char *device = sphm_muscle_device(m.handle);
    ASSERT_EQ(sphm_muscle_reset(m.handle, &m.context), SPHM_OK);
    EXPECT_EQ(sphm_muscle_device(m.handle), device);
    EXPECT_STREQ(device, "cpu, 1 thread");
}

// A particle costs less than 1 KiB to compute, at the paper's number of neighbours; what looks at it adds its
// own.
TEST(Muscle, MemoryIsCountedAndBounded) {
    Muscle m(Muscle::Settings{{"particles", "9888"}, {"paper_units", "true"}});
    const size_t computing = sphm_muscle_timing(m.handle).memory_bytes;
    EXPECT_LT(computing, 1024 * m.count());
    EXPECT_GT(computing, 100 * m.count());
    sphm_particles particles;
    ASSERT_EQ(sphm_muscle_particles(m.handle, &particles, &m.context), SPHM_OK);
    EXPECT_GT(sphm_muscle_timing(m.handle).memory_bytes, computing + 17 * sizeof(float) * m.count());
}

TEST(Muscle, ResetGivesTheFirstRunAgain) {
    Muscle m;
    m.stimulate(8000);
    m.advance(0.01);
    const std::vector<double> first = m.values();
    ASSERT_EQ(sphm_muscle_reset(m.handle, &m.context), SPHM_OK);
    m.stimulate(8000);
    m.advance(0.01);
    EXPECT_EQ(m.values(), first);
}

} // namespace
