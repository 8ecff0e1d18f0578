// The same bits for any number of threads, after a restore, and for two muscles side by side.
#include "muscles.h"

namespace {

const Muscle::Settings lively = {{"particles", "800"}};

std::vector<double> run(const char *threads, const char *coupling, const char *fibres) {
    Muscle muscle(Muscle::Settings{{"particles", "800"},
                                   {"threads", threads},
                                   {"coupling", coupling},
                                   {"fibres", fibres},
                                   {"pennation_angle", "12"},
                                   {"fibre_steering", "0.3"}});
    EXPECT_EQ(muscle.status, SPHM_OK) << muscle.context.message;
    muscle.stimulate(8000);
    const double point[3] = {0, 0, 0}, force[3] = {0, 0.5, 0.2};
    EXPECT_EQ(sphm_muscle_apply_force(muscle.handle, point, force, 0.02, 0, &muscle.context), SPHM_OK);
    muscle.advance(0.02);
    EXPECT_GT(sphm_muscle_steps(muscle.handle), 50u);
    EXPECT_GT(sphm_muscle_timing(muscle.handle).neighbour_rebuilds, 1u);
    return muscle.values();
}

TEST(Determinism, AnyNumberOfThreadsGivesTheSameBits) {
    for (const char *fibres : {"parallel", "pennate"})
        EXPECT_EQ(run("1", "fibre_tension", fibres), run("2", "fibre_tension", fibres)) << fibres;
    EXPECT_EQ(run("1", "fibre_tension", "parallel"), run("3", "fibre_tension", "parallel"));
}

// A solid's rest shape is made by several threads from some thousands of particles on.
TEST(Determinism, TheRestShapeIsTheSameForAnyNumberOfThreads) {
    std::vector<double> limit, values[2];
    for (const char *threads : {"1", "3"}) {
        Muscle muscle(Muscle::Settings{
            {"tissue", "solid"}, {"particles", "6000"}, {"smoothing_ratio", "2"}, {"threads", threads}});
        ASSERT_EQ(muscle.status, SPHM_OK) << muscle.context.message;
        muscle.stimulate(8000);
        muscle.advance(2e-4);
        values[limit.size()] = muscle.values();
        limit.push_back(sphm_muscle_time_step_limits(muscle.handle).smallest);
    }
    EXPECT_EQ(limit[0], limit[1]);
    EXPECT_EQ(values[0], values[1]);
}

TEST(Determinism, IsolatedParticlesAreAsManyForAnyNumberOfThreads) {
    size_t isolated[2];
    for (int64_t threads : {1, 3}) {
        sphm_parameters p = sphm_parameters_default();
        p.particles = 6000;
        p.jitter = 0.3;
        p.paper_units = 1;
        p.paper_h = 0.025; // about the spacing: jitter moves neighbours within it and out of it
        p.threads = threads;
        sphm_body body;
        sphm_context context{};
        ASSERT_EQ(sphm_body_create(&p, nullptr, &body, &context), SPHM_OK) << context.message;
        isolated[threads > 1] = body.isolated;
        EXPECT_GT(body.isolated, 0u);
        EXPECT_LT(body.isolated, body.count);
        sphm_body_free(&body);
    }
    EXPECT_EQ(isolated[0], isolated[1]);
}

TEST(Determinism, ARestoredStateContinuesBitForBit) {
    Muscle one(lively), two(lively);
    one.stimulate(8000);
    one.advance(0.013);
    two.stimulate(8000);
    ASSERT_EQ(sphm_muscle_restore(two.handle, &one.state(), &two.context), SPHM_OK) << two.context.message;
    EXPECT_EQ(one.values(), two.values());
    one.advance(0.013);
    two.advance(0.013);
    EXPECT_EQ(one.values(), two.values());
    EXPECT_GT(sphm_muscle_timing(one.handle).neighbour_rebuilds, 1u);
}

TEST(Determinism, CellSizeChangesRoundingOnly) {
    Muscle one, two(Muscle::Settings{{"cell_size", "0.03"}});
    for (Muscle *m : {&one, &two}) {
        m->stimulate(8000);
        m->advance(0.02);
    }
    const std::vector<double> a = one.values(), b = two.values();
    const size_t n = one.count();
    double worst = 0;
    for (size_t i = n; i < 4 * n; ++i) // x, y, z
        worst = std::max(worst, std::abs(a[i] - b[i]));
    EXPECT_GT(worst, 0);
    EXPECT_LT(worst, 1e-5);
}

} // namespace
