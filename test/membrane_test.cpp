// The membrane: threshold, return to rest, held currents, pulse trains, the activation filter.
#include "bar.h"

#include <cstring>

namespace {

using bar::Bar;
using bar::Shape;

sphm_membrane_constants table1() {
    const sphm_parameters p = sphm_parameters_default();
    return sphm_membrane_constants_from(&p, 1e-3);
}

Shape cube() {
    Shape shape;
    shape.length = shape.width = shape.thickness = 4;
    return shape;
}

// A small cube at rest, every particle under the belly electrode.
struct Cell : public Bar {
    explicit Cell(const sphm_membrane_constants &constants, const Shape &s = cube()) : Bar(s), c(constants) {
        weigh(SPHM_LAPLACIAN_CORRECTED, double(c.diffusion_mm2_per_ms));
        rest(c);
        for (size_t i = 0; i < state.count; i++)
            state.electrodes[i] = 1 << SPHM_ELECTRODE_BELLY;
    }
    void set(double potential_mV) {
        for (size_t i = 0; i < state.count; i++)
            state.membrane_potential[i] = sphm_real(potential_mV);
    }
    void run(double current, double duration_ms, double step_ms = 0.5) {
        sphm_drive drive{};
        drive.driven[SPHM_ELECTRODE_BELLY] = current != 0;
        drive.current_uA_per_mm2[SPHM_ELECTRODE_BELLY] = current;
        for (double t = 0; t < duration_ms - 1e-9; t += step_ms)
            step(c, drive, std::min(step_ms, duration_ms - t));
    }
    double potential() const { return double(state.membrane_potential[0]); }
    double activation() const { return double(state.activation[0]); }
    sphm_membrane_constants c;
};

TEST(Membrane, StaysAtRestToTheBit) {
    Cell cell(table1());
    cell.run(0, 500);
    for (size_t i = 0; i < cell.state.count; i++) {
        ASSERT_EQ(cell.state.membrane_potential[i], cell.c.resting_mV);
        ASSERT_EQ(cell.state.recovery[i], 0);
        ASSERT_EQ(cell.state.activation[i], 0);
    }
}

TEST(Membrane, ThresholdSeparates) {
    Cell below(table1()), above(table1());
    below.c.decay_uA_per_mm2 = above.c.decay_uA_per_mm2 = 0;
    below.set(-75.5);
    above.set(-74.5);
    below.run(0, 800);
    above.run(0, 400);
    EXPECT_NEAR(below.potential(), -85, 0.1);
    EXPECT_NEAR(above.potential(), 15, 0.1);
}

// A weak current has its natural threshold: it needs I > -min Iion over 0 < u < a to fire at all.
TEST(Membrane, SubAndSuprathresholdCurrents) {
    const sphm_membrane_constants c = table1();
    const double a = 0.1, u = ((1 + a) - std::sqrt((1 + a) * (1 + a) - 3 * a)) / 3;
    const double rheobase = double(c.excitation_uA_per_mm2) * u * (u - a) * (u - 1); // without recovery
    EXPECT_GT(rheobase, 0);
    Cell weak(c), strong(c);
    weak.c.decay_uA_per_mm2 = strong.c.decay_uA_per_mm2 = 0;
    weak.run(0.95 * rheobase, 3000);
    strong.run(1.05 * rheobase, 3000);
    EXPECT_LT(weak.potential(), -75);
    EXPECT_GT(strong.potential(), 0);
}

// A short current over the threshold on a part of the bar starts a wave that reaches the other end; a short
// current below it does not.
TEST(Membrane, SubAndSuprathresholdStimuliOnABar) {
    for (const double current : {0.02, 0.2}) {
        Shape shape;
        shape.spacing = 2;
        shape.length = 60;
        shape.width = shape.thickness = 4;
        Cell b(table1(), shape);
        for (size_t i = 0; i < b.state.count; i++)
            b.state.electrodes[i] = b.x_mm(i) < 16 ? 1 : 0;
        b.run(current, 3);
        b.run(0, 10);
        double highest = -1000;
        for (double t = 0; t < 400; t += 2) {
            b.run(0, 2);
            highest = std::max(highest, double(b.state.membrane_potential[b.state.count - 1]));
        }
        if (current < 0.1)
            EXPECT_LT(highest, -80);
        else
            EXPECT_GT(highest, 0);
    }
}

TEST(Membrane, SingleStimulusReturnsToRest) {
    Cell cell(table1());
    cell.run(8000, 2);
    EXPECT_NEAR(cell.potential(), 15, 1e-5);
    double below = 0;
    for (double t = 2; t < 900; t += 0.5) {
        cell.run(0, 0.5);
        if (below == 0 && cell.potential() < -75)
            below = t;
        if (below > 0) {
            ASSERT_LT(cell.potential(), -75) << "it must not come back at " << t << " ms";
        }
    }
    EXPECT_NEAR(below, 192, 3);
    EXPECT_NEAR(cell.potential(), -85, 1);
    cell.run(0, 1000);
    EXPECT_NEAR(cell.potential(), -85, 0.01);
}

// Against classical Runge-Kutta of fourth order with short steps, written independently.
TEST(Membrane, ActionPotentialFollowsTheEquations) {
    double u = 1, w = 0;
    const double h = 0.01, c1 = 0.175, c2 = 0.03, b = 0.011, d = 0.55, a = 0.1;
    const auto du = [&](double x, double y) { return -c1 * x * (x - a) * (x - 1) - c2 * y; };
    const auto dw = [&](double x, double y) { return b * (x - d * y); };
    Cell cell(table1());
    cell.set(15);
    double worst = 0;
    for (int ms = 0; ms < 300; ms++) {
        for (int k = 0; k < 100; k++) {
            const double u1 = du(u, w), w1 = dw(u, w);
            const double u2 = du(u + h / 2 * u1, w + h / 2 * w1), w2 = dw(u + h / 2 * u1, w + h / 2 * w1);
            const double u3 = du(u + h / 2 * u2, w + h / 2 * w2), w3 = dw(u + h / 2 * u2, w + h / 2 * w2);
            const double u4 = du(u + h * u3, w + h * w3), w4 = dw(u + h * u3, w + h * w3);
            u += h / 6 * (u1 + 2 * u2 + 2 * u3 + u4), w += h / 6 * (w1 + 2 * w2 + 2 * w3 + w4);
        }
        cell.run(0, 1, 1);
        worst = std::max(worst, std::fabs(cell.potential() - (-85 + 100 * u)));
    }
    EXPECT_LT(worst, 0.1) << "mV, with the default reaction step";
}

TEST(Membrane, HeldCurrentHoldsThePlateau) {
    Cell cell(table1());
    for (int k = 0; k < 200; k++) {
        cell.run(8000, 10);
        ASSERT_EQ(cell.state.membrane_potential[7], cell.c.plateau_mV);
    }
    EXPECT_NEAR(cell.activation(), 1, 1e-5);
    cell.run(-8000, 10);
    EXPECT_EQ(cell.potential(), -95);
    cell.run(0, 1500);
    EXPECT_NEAR(cell.potential(), -85, 0.1);
}

TEST(Membrane, CurrentsOfTwoElectrodesAddUp) {
    Cell cell(table1()), twice(table1());
    sphm_drive drive{};
    drive.driven[SPHM_ELECTRODE_BELLY] = drive.driven[SPHM_ELECTRODE_SPHERE] = 1;
    drive.current_uA_per_mm2[SPHM_ELECTRODE_BELLY] = drive.current_uA_per_mm2[SPHM_ELECTRODE_SPHERE] = 0.01;
    for (size_t i = 0; i < cell.state.count; i++)
        cell.state.electrodes[i] = 1 << SPHM_ELECTRODE_BELLY | 1 << SPHM_ELECTRODE_SPHERE;
    cell.step(cell.c, drive, 1);
    twice.run(0.02, 1, 1);
    EXPECT_EQ(cell.potential(), twice.potential());
    EXPECT_GT(cell.potential(), -84);
}

TEST(Membrane, ParticlesOffTheElectrodeAreNotHeld) {
    Cell cell(table1());
    cell.state.electrodes[3] = 0;
    cell.state.membrane_potential[3] = 40; // above the plateau: nothing may clamp it
    sphm_drive drive{};
    drive.driven[SPHM_ELECTRODE_BELLY] = 1;
    drive.current_uA_per_mm2[SPHM_ELECTRODE_BELLY] = 8000;
    cell.step(cell.c, drive, 0.01);
    EXPECT_GT(double(cell.state.membrane_potential[3]), 20);
    EXPECT_EQ(cell.state.membrane_potential[4], cell.c.plateau_mV);
}

TEST(Membrane, ActivationFollowsItsExponential) {
    Cell cell(table1());
    cell.run(8000, 1); // the potential jumps to the plateau at once
    for (double t = 1; t < 60; t += 7) {
        EXPECT_NEAR(cell.activation(), 1 - std::exp(-t / 10), 2e-3) << "rising, at " << t << " ms";
        cell.run(8000, 7);
    }
    cell.run(8000, 200);
    const double full = cell.activation();
    EXPECT_NEAR(full, 1, 1e-5);
    for (double t = 1; t < 100; t += 9) {
        cell.run(-8000, t == 1 ? 1 : 9);
        EXPECT_NEAR(cell.activation(), std::exp(-t / 40), 2e-3) << "falling, at " << t << " ms";
    }
}

TEST(Membrane, ActivationTargetIsBetweenNoughtAndOne) {
    const sphm_membrane_constants c = table1();
    EXPECT_EQ(double(sphm_activation_target(&c, -85)), 0);
    EXPECT_EQ(double(sphm_activation_target(&c, -75)), 0);
    EXPECT_NEAR(double(sphm_activation_target(&c, -30)), 0.5, 1e-6);
    EXPECT_EQ(double(sphm_activation_target(&c, 15)), 1);
    EXPECT_EQ(double(sphm_activation_target(&c, 40)), 1);
    // What is not finite must not be taken for rest.
    const sphm_real infinite = std::numeric_limits<sphm_real>::infinity();
    for (sphm_real bad : {infinite, -infinite, std::numeric_limits<sphm_real>::quiet_NaN()})
        EXPECT_TRUE(std::isnan(sphm_activation_target(&c, bad)));
}

// With conduction_velocity the potential lasts about 6 ms and answers every pulse of a train.
TEST(Membrane, FastMembraneFollowsPulses) {
    sphm_parameters p = sphm_parameters_default();
    p.conduction_velocity = 4;
    const sphm_membrane_constants c = sphm_membrane_constants_from(&p, 2e-3);
    Shape shape = cube();
    shape.spacing = 2;
    Cell cell(c, shape);
    cell.run(8000, 0.5, 0.1);
    double lasted = 0.5;
    for (; cell.potential() > -75 && lasted < 30; lasted += 0.1)
        cell.run(0, 0.1, 0.1);
    EXPECT_NEAR(lasted, 6.4, 1);

    for (const double rate_Hz : {20.0, 50.0}) {
        Cell train(c, shape);
        const double period = 1e3 / rate_Hz;
        for (int pulse = 0; pulse < 10; pulse++) {
            train.run(8000, 0.5, 0.1);
            ASSERT_NEAR(train.potential(), 15, 1e-4);
            train.run(0, 2, 0.1);
            ASSERT_GT(train.potential(), -40) << "pulse " << pulse << " at " << rate_Hz << " Hz must fire";
            train.run(0, period - 2.5, 0.1);
            ASSERT_LT(train.potential(), -75) << "pulse " << pulse << " at " << rate_Hz << " Hz must end";
        }
    }
}

TEST(Membrane, ScalingKeepsThePhasePlane) {
    sphm_parameters p = sphm_parameters_default();
    const sphm_membrane_constants slow = sphm_membrane_constants_from(&p, 1e-3);
    p.conduction_velocity = 4;
    const sphm_membrane_constants fast = sphm_membrane_constants_from(&p, 1e-3);
    const double factor = double(fast.excitation_uA_per_mm2) / double(slow.excitation_uA_per_mm2);
    EXPECT_NEAR(factor, 30, 0.01);
    EXPECT_NEAR(double(fast.decay_uA_per_mm2) / double(slow.decay_uA_per_mm2), factor, 1e-3);
    EXPECT_NEAR(double(fast.recovery_rate_per_ms) / double(slow.recovery_rate_per_ms), factor, 1e-3);
    EXPECT_EQ(fast.recovery_decay, slow.recovery_decay);
}

TEST(Membrane, SubstepsKeepBothLimits) {
    sphm_membrane_constants c = table1();
    sphm_diffusion d{};
    c.reaction_step_ms = sphm_real(0.25);
    d.stable_step_ms = 10;
    EXPECT_EQ(sphm_membrane_substeps(&c, &d, 0.1), 1u);
    EXPECT_EQ(sphm_membrane_substeps(&c, &d, 0.25), 1u);
    EXPECT_EQ(sphm_membrane_substeps(&c, &d, 0.26), 2u);
    EXPECT_EQ(sphm_membrane_substeps(&c, &d, 1), 4u);
    d.stable_step_ms = 0.1;
    EXPECT_EQ(sphm_membrane_substeps(&c, &d, 0.9), 10u);
}

TEST(Membrane, SameBitsForAnyNumberOfThreads) {
    Shape shape;
    shape.spacing = 0.8;
    shape.length = 24;
    shape.jitter = 0.1;
    Cell one(table1(), shape), three(table1(), shape);
    three.threads = 3;
    const sphm_diffusion_input in =
        three.input(SPHM_LAPLACIAN_CORRECTED, double(three.c.diffusion_mm2_per_ms));
    ASSERT_EQ(sphm_diffusion_build(&three.diffusion, &three.rows, &in, 3, nullptr), SPHM_OK);
    for (Cell *cell : {&one, &three}) {
        for (size_t i = 0; i < cell->state.count; i++)
            cell->state.electrodes[i] = cell->x_mm(i) < 4;
        cell->run(8000, 5);
        cell->run(0, 20);
    }
    const size_t bytes = one.state.count * sizeof(sphm_real);
    EXPECT_EQ(one.diffusion.stable_step_ms, three.diffusion.stable_step_ms);
    EXPECT_EQ(std::memcmp(one.diffusion.weight, three.diffusion.weight,
                          one.rows.row_start[one.rows.count] * sizeof(sphm_real)),
              0);
    EXPECT_EQ(std::memcmp(one.state.membrane_potential, three.state.membrane_potential, bytes), 0);
    EXPECT_EQ(std::memcmp(one.state.recovery, three.state.recovery, bytes), 0);
    EXPECT_EQ(std::memcmp(one.state.activation, three.state.activation, bytes), 0);
}

TEST(Membrane, TimingIsAddedUp) {
    Cell cell(table1());
    sphm_timing timing{};
    const sphm_drive none{};
    sphm_cpu_membrane_step(&cell.state, &cell.rows, &cell.diffusion, &cell.c, &none, 0.1, 1, &timing);
    EXPECT_GT(timing.diffusion_s, 0);
    EXPECT_GT(timing.cell_model_s, 0);
}

} // namespace
