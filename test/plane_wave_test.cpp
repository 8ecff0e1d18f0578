// Speed of a plane wave along a bar with free sides, against sqrt(D c1/2)(1 - 2a) = 0.2071 mm/ms.
#include "bar.h"

#include <cstdio>

namespace {

using bar::Bar;
using bar::Shape;

// Table 1 without recovery: then the speed has a closed form.
sphm_membrane_constants without_recovery(double ratio = 1) {
    sphm_parameters p = sphm_parameters_default();
    p.excitation_decay = 0;
    p.anisotropy_ratio = ratio;
    return sphm_membrane_constants_from(&p, 1e-3);
}

// The wave's error in per cent with the default reaction step, and one line of the table in
// doc/electrophysiology.md.
double error_percent(const Shape &shape, int laplacian, const char *label, double longest_step_ms = 1) {
    sphm_membrane_constants c = without_recovery();
    c.reaction_step_ms = std::min(c.reaction_step_ms, sphm_real(longest_step_ms));
    Bar b(shape);
    b.weigh(laplacian, double(c.diffusion_mm2_per_ms));
    const double speed = bar::wave_speed(b, c, double(c.reaction_step_ms), 35, 60, 20);
    const double error = 100 * (speed / sphm_membrane_wave_speed_mm_per_ms(&c) - 1);
    std::printf("%-10s spacing %.1f mm, support %.1f, jitter %.1f: %.5f mm/ms, %+.2f %%\n", label,
                shape.spacing, shape.smoothing_ratio, shape.jitter, speed, error);
    return error;
}

Shape bar_of(double spacing_mm, double smoothing_ratio = 2.6, double jitter = 0) {
    Shape shape;
    shape.spacing = spacing_mm;
    shape.smoothing_ratio = smoothing_ratio;
    shape.jitter = jitter;
    return shape;
}

TEST(PlaneWave, ClosedFormOfTable1) {
    const sphm_membrane_constants c = without_recovery();
    // Written out from Table 1: sigma 0.893 * 0.67/(0.893 + 0.67) mS/mm, chi 50 /mm, Cm 0.01 uF/mm2.
    const double d = 0.893 * 0.67 / (0.893 + 0.67) / (50 * 0.01), k = 0.175 / (0.01 * 100);
    EXPECT_NEAR(double(c.diffusion_mm2_per_ms), d, 1e-6);
    EXPECT_NEAR(sphm_membrane_wave_speed_mm_per_ms(&c), std::sqrt(d * k / 2) * (1 - 2 * 0.1), 1e-6);
    EXPECT_NEAR(sphm_membrane_wave_speed_mm_per_ms(&c), 0.2071, 5e-5);
}

TEST(PlaneWave, CorrectedLaplacianAtEverySupport) {
    for (const double support : {2.0, 2.2, 2.6, 3.0}) {
        EXPECT_LT(std::fabs(error_percent(bar_of(1, support), SPHM_LAPLACIAN_CORRECTED, "corrected")), 0.5);
        EXPECT_LT(std::fabs(error_percent(bar_of(2, support), SPHM_LAPLACIAN_CORRECTED, "corrected")), 1.5);
    }
}

// Halving the spacing twice, at a time step whose own error (0.03 %) is below the finest bar's. The thinner
// bar of the finest run has more surface for its volume, so that it is the harder case.
TEST(PlaneWave, ConvergesWithTheSpacing) {
    const double coarse = std::fabs(error_percent(bar_of(2), SPHM_LAPLACIAN_CORRECTED, "corrected", 0.05));
    const double middle = std::fabs(error_percent(bar_of(1), SPHM_LAPLACIAN_CORRECTED, "corrected", 0.05));
    Shape thin = bar_of(0.5);
    thin.width = thin.thickness = 3;
    const double fine = std::fabs(error_percent(thin, SPHM_LAPLACIAN_CORRECTED, "corrected", 0.05));
    EXPECT_LT(middle, coarse / 3);
    EXPECT_LT(fine, middle / 3);
}

// Jitter in each direction, of a tenth and a fifth of a spacing. The first moments of the weights no longer
// vanish then, which the six equations do not see: the speed falls by up to 0.4 and 0.6 %.
TEST(PlaneWave, JitteredLattice) {
    EXPECT_LT(std::fabs(error_percent(bar_of(1, 2.6, 0.1), SPHM_LAPLACIAN_CORRECTED, "corrected")), 0.5);
    EXPECT_LT(std::fabs(error_percent(bar_of(1, 2.6, 0.2), SPHM_LAPLACIAN_CORRECTED, "corrected")), 0.7);
    EXPECT_LT(std::fabs(error_percent(bar_of(2, 2.6, 0.1), SPHM_LAPLACIAN_CORRECTED, "corrected")), 1.5);
    EXPECT_LT(std::fabs(error_percent(bar_of(2, 2.6, 0.2), SPHM_LAPLACIAN_CORRECTED, "corrected")), 2.0);
}

// For comparison. The paper's bare second derivative is twice the Laplacian in the bulk (speed +41 %), less
// what the free surface cuts off; Brookshaw's form is right in the bulk and too slow by the cut.
TEST(PlaneWave, PapersAndBrookshawsFormsAreOff) {
    for (const double support : {2.0, 2.6}) {
        for (const double spacing : {1.0, 2.0}) {
            const double paper = error_percent(bar_of(spacing, support), SPHM_LAPLACIAN_PAPER, "paper");
            EXPECT_GT(paper, 10);
            EXPECT_LT(paper, 41);
            const double pair =
                error_percent(bar_of(spacing, support), SPHM_LAPLACIAN_BROOKSHAW, "brookshaw");
            EXPECT_LT(pair, -3);
            EXPECT_GT(pair, -20);
        }
    }
}

// Steps of a quarter of the longest sub-step: the diffusion is taken every fourth time, and the wave stays.
TEST(PlaneWave, DiffusionMayWaitForShortSteps) {
    const sphm_membrane_constants c = without_recovery();
    Bar b(bar_of(1));
    b.weigh(SPHM_LAPLACIAN_CORRECTED, double(c.diffusion_mm2_per_ms));
    const double longest = std::min(double(c.reaction_step_ms), 0.9 * double(b.diffusion.stable_step_ms));
    const double waiting = bar::wave_speed(b, c, longest / 4, 35, 60, 20);
    const double exact = sphm_membrane_wave_speed_mm_per_ms(&c);
    std::printf("diffusion every fourth step: %+.2f %%\n", 100 * (waiting / exact - 1));
    EXPECT_NEAR(waiting / exact, 1, 0.005);

    // Off the front nothing but the diffusion moves a potential at rest.
    const sphm_drive none{};
    b.rest(c);
    b.state.diffusion_due_s = 0;
    b.state.membrane_potential[0] += 1;
    const size_t next = size_t(b.rows.slot[b.rows.row_start[0]]);
    const sphm_real rest = b.state.membrane_potential[next];
    for (int k = 0; k < 4; k++) {
        EXPECT_EQ(b.state.membrane_potential[next], rest) << k;
        b.step(c, none, longest / 4);
    }
    EXPECT_GT(b.state.membrane_potential[next], rest);
    EXPECT_EQ(b.state.diffusion_due_s, 0);
}

// Speed along over speed across is the root of the ratio; each within 1.5 % of its own closed form.
TEST(PlaneWave, AnisotropyTurnsTheSpeed) {
    for (const double ratio : {2.0, 4.0, 6.0}) {
        const sphm_membrane_constants c = without_recovery(ratio);
        const double step = double(c.reaction_step_ms), exact = sphm_membrane_wave_speed_mm_per_ms(&c);
        Bar b(bar_of(1));
        b.weigh(SPHM_LAPLACIAN_CORRECTED, double(c.diffusion_mm2_per_ms), ratio);
        const double along = bar::wave_speed(b, c, step, 35, 60, 20);
        b.set_fibre(0, 1, 0);
        b.weigh(SPHM_LAPLACIAN_CORRECTED, double(c.diffusion_mm2_per_ms), ratio);
        const double across = bar::wave_speed(b, c, step, 35, 60, 20);
        std::printf("ratio %g: along %.5f, across %.5f mm/ms, quotient %.4f\n", ratio, along, across,
                    along / across);
        EXPECT_NEAR(along / exact, 1, 0.005);
        EXPECT_NEAR(across * std::sqrt(ratio) / exact, 1, 0.015);
        EXPECT_NEAR(along / across, std::sqrt(ratio), 0.015 * std::sqrt(ratio));
    }
}

// conduction_velocity asks for a speed with recovery, whatever the spacing; the front spans four spacings.
TEST(PlaneWave, ConductionVelocityIsMet) {
    for (const double spacing : {1.0, 2.0, 3.0}) {
        sphm_parameters p = sphm_parameters_default();
        p.conduction_velocity = 4;
        const sphm_membrane_constants c = sphm_membrane_constants_from(&p, spacing * 1e-3);
        EXPECT_GE(sphm_membrane_front_width_mm(&c), 4 * spacing * (1 - 1e-5));
        Bar b(bar_of(spacing));
        b.weigh(SPHM_LAPLACIAN_CORRECTED, double(c.diffusion_mm2_per_ms));
        const double speed = bar::wave_speed(b, c, 0.1, 30, 65, 10);
        std::printf("conduction_velocity 4 m/s, spacing %g mm: %.3f m/s, front %.2f mm\n", spacing, speed,
                    sphm_membrane_front_width_mm(&c));
        EXPECT_NEAR(speed, 4, 0.16);
    }
}

} // namespace
