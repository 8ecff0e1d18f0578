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
    std::vector<double> limit, isolated, values[2];
    for (const char *threads : {"1", "3"}) {
        Muscle muscle(Muscle::Settings{
            {"tissue", "solid"}, {"particles", "6000"}, {"smoothing_ratio", "2"}, {"threads", threads}});
        ASSERT_EQ(muscle.status, SPHM_OK) << muscle.context.message;
        muscle.stimulate(8000);
        muscle.advance(2e-4);
        values[limit.size()] = muscle.values();
        limit.push_back(sphm_muscle_time_step_limits(muscle.handle).smallest);
        isolated.push_back(static_cast<double>(sphm_muscle_body(muscle.handle)->isolated));
    }
    EXPECT_EQ(limit[0], limit[1]);
    EXPECT_EQ(isolated[0], isolated[1]);
    EXPECT_EQ(values[0], values[1]);
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
