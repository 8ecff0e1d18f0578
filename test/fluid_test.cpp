// The neighbour sweeps: conservation, no force from a rigid motion, the pressure of eq 12.
#include "muscles.h"

#include <cmath>
#include <random>

#include "cpu/backend.h"

namespace {

// Particles with random velocities on a slightly disturbed rest shape.
struct Sweeps {
    Muscle muscle;
    sphm_backend *b;
    explicit Sweeps(const Muscle::Settings &settings, bool disturb) : muscle(settings) {
        EXPECT_EQ(muscle.status, SPHM_OK) << muscle.context.message;
        b = muscle.handle->backend;
        std::mt19937 random(2);
        std::uniform_real_distribution<double> unit(-1, 1);
        sphm_state &s = b->state;
        const double size = disturb ? 0.003 * b->model->body.spacing_m : 0;
        for (size_t i = 0; i < s.count; ++i) {
            s.attachment[i] = SPHM_FREE;
            s.x[i] += static_cast<sphm_real>(size * unit(random));
            s.y[i] += static_cast<sphm_real>(size * unit(random));
            s.z[i] += static_cast<sphm_real>(size * unit(random));
            s.vx[i] = static_cast<sphm_real>(unit(random));
            s.vy[i] = static_cast<sphm_real>(unit(random));
            s.vz[i] = static_cast<sphm_real>(unit(random));
            s.activation[i] = static_cast<sphm_real>(0.5 + 0.5 * unit(random));
        }
    }
    void run(double step) {
        sphm_drive none{};
        const size_t n = b->state.count;
        sphm_cpu_predict(b, step, &none);
        sphm_fluid_sweep_velocity(&b->model->fluid, &b->rows, &b->packs, &b->state, step, 0, n);
        sphm_fluid_set_pressure(&b->model->fluid, &b->packs, &b->state, 0, n);
        sphm_fluid_sweep_forces(&b->model->fluid, &b->rows, &b->packs, &b->state, 0, n);
    }
};

TEST(Fluid, XsphConservesMomentumAndSmooths) {
    Sweeps s(Muscle::Settings{{"shape_matching_rate", "0"}, {"xsph_time", "0.001"}}, true);
    s.run(1e-3);
    double before[3] = {0, 0, 0}, after[3] = {0, 0, 0}, energy_before = 0, energy_after = 0;
    for (size_t i = 0; i < s.b->state.count; ++i) {
        const sphm_pack u = s.b->packs.predicted[i].second, w = s.b->packs.smoothed[i].moving.second;
        before[0] += double(u.x), before[1] += double(u.y), before[2] += double(u.z);
        after[0] += double(w.x), after[1] += double(w.y), after[2] += double(w.z);
        energy_before += double(u.x * u.x + u.y * u.y + u.z * u.z);
        energy_after += double(w.x * w.x + w.y * w.y + w.z * w.z);
    }
    for (int d = 0; d < 3; ++d)
        EXPECT_NEAR(after[d], before[d], 2e-5 * double(s.b->state.count));
    EXPECT_LT(energy_after, 0.7 * energy_before);
}

// Pressure, viscosity, pair matching and tension act in pairs: forces add up to zero, and without viscosity
// (whose pair force is not central) so do their moments.
TEST(Fluid, ForcesConserveMomentum) {
    for (const char *fibres : {"parallel", "pennate"}) {
        Sweeps s(Muscle::Settings{{"fibres", fibres}, {"pennation_angle", "20"}}, true);
        s.run(1e-4);
        const sphm_state &state = s.b->state;
        double sum[3] = {0, 0, 0}, size = 0;
        for (size_t i = 0; i < state.count; ++i) {
            sum[0] += double(state.ax[i]), sum[1] += double(state.ay[i]), sum[2] += double(state.az[i]);
            size +=
                std::abs(double(state.ax[i])) + std::abs(double(state.ay[i])) + std::abs(double(state.az[i]));
        }
        EXPECT_GT(size, 1);
        for (double component : sum)
            EXPECT_NEAR(component / size, 0, 1e-6);
    }
}

TEST(Fluid, CentralForcesConserveAngularMomentum) {
    Sweeps s(Muscle::Settings{{"viscosity", "0"}}, true);
    s.run(1e-4);
    const sphm_state &t = s.b->state;
    double moment[3] = {0, 0, 0}, size = 0;
    for (size_t i = 0; i < t.count; ++i) {
        const double x[3] = {double(t.x[i]), double(t.y[i]), double(t.z[i])};
        const double a[3] = {double(t.ax[i]), double(t.ay[i]), double(t.az[i])};
        for (int d = 0; d < 3; ++d) {
            const double m = x[(d + 1) % 3] * a[(d + 2) % 3] - x[(d + 2) % 3] * a[(d + 1) % 3];
            moment[d] += m;
            size += std::abs(m);
        }
    }
    for (double component : moment)
        EXPECT_NEAR(component / size, 0, 2e-6);
}

TEST(Fluid, ARigidMotionCostsNoForce) {
    Sweeps s(Muscle::Settings{}, false);
    sphm_state &t = s.b->state;
    const double angle = 0.7, c = std::cos(angle), q = std::sin(angle);
    double worst_rest = 0;
    for (size_t i = 0; i < t.count; ++i) {
        const double x = double(t.x[i]), y = double(t.y[i]);
        t.x[i] = static_cast<sphm_real>(c * x - q * y + 0.01);
        t.y[i] = static_cast<sphm_real>(q * x + c * y - 0.02);
        t.z[i] += sphm_real(0.015);
        t.vx[i] = t.vy[i] = t.vz[i] = 0;
        t.activation[i] = 0;
        worst_rest = std::max(worst_rest, std::hypot(x, y));
    }
    s.run(1e-4);
    // A strain of the same rounding size as the positions' would give accelerations of this order.
    const double rounding = 1.2e-7 * worst_rest / s.b->model->body.spacing_m;
    const double scale = s.b->model->parameters.stiffness / s.b->model->body.spacing_m;
    for (size_t i = 0; i < t.count; ++i) {
        EXPECT_NEAR(double(t.ax[i]), 0, 20 * rounding * scale);
        EXPECT_NEAR(double(t.ay[i]), 0, 20 * rounding * scale);
        EXPECT_NEAR(double(t.az[i]), 0, 20 * rounding * scale);
        EXPECT_NEAR(double(s.b->packs.predicted[i].second.x), 0, 1e-5);
        EXPECT_NEAR(double(s.b->packs.predicted[i].second.y), 0, 1e-5);
    }
    EXPECT_NEAR(s.b->motion.rotation[0], c, 1e-6);
    EXPECT_NEAR(s.b->motion.rotation[3], q, 1e-6);
}

TEST(Fluid, TheRestShapeFeelsNothingToTheBit) {
    Sweeps s(Muscle::Settings{}, false);
    sphm_state &t = s.b->state;
    for (size_t i = 0; i < t.count; ++i)
        t.vx[i] = t.vy[i] = t.vz[i] = t.activation[i] = 0;
    s.run(1e-4);
    for (size_t i = 0; i < t.count; ++i) {
        ASSERT_EQ(t.pressure[i], 0);
        ASSERT_EQ(t.ax[i], 0);
        ASSERT_EQ(t.ay[i], 0);
        ASSERT_EQ(t.az[i], 0);
    }
}

TEST(Fluid, ElectricalPressureIsAddedWhereTheCouplingSaysSo) {
    for (const char *coupling : {"pressure", "fibre_tension"}) {
        Sweeps s(Muscle::Settings{{"coupling", coupling}, {"electrical_pressure", "7"}}, false);
        s.b->state.membrane_potential[3] = 15;
        s.run(1e-4);
        EXPECT_FLOAT_EQ(float(s.b->state.pressure[3]), std::string(coupling) == "pressure" ? 700.f : 0.f);
        EXPECT_EQ(s.b->state.pressure[4], 0);
    }
}

// What one half of a muscle pulls the other with, shortened by a tenth.
TEST(Fluid, ShortenedTissuePullsLess) {
    for (const char *fibres : {"parallel", "pennate"}) {
        std::vector<double> ends;
        for (const char *slope : {"0", "1"}) {
            Sweeps s(Muscle::Settings{{"fibres", fibres},
                                      {"pennation_angle", "10"},
                                      {"tension_slope", slope},
                                      {"fibre_tension", "1e6"},
                                      {"pair_matching", "0"},
                                      {"viscosity", "0"},
                                      {"stiffness", "0.001"}},
                     false);
            sphm_state &t = s.b->state;
            for (size_t i = 0; i < t.count; ++i) {
                t.x[i] *= sphm_real(0.9);
                t.vx[i] = t.vy[i] = t.vz[i] = 0;
                t.activation[i] = 1;
            }
            s.run(1e-4);
            double pull = 0;
            for (size_t i = 0; i < t.count; ++i)
                pull -= t.x[i] > 0 ? double(t.ax[i]) : 0;
            ends.push_back(pull);
        }
        EXPECT_GT(ends[0], 0);
        EXPECT_NEAR(ends[1] / ends[0], 1 - 0.1 * SPHM_TENSION_MODULUS, 0.02) << fibres;
    }
}

double nearest_over_spacing(const Muscle &m) {
    const sphm_state &s = m.state();
    double least = 1;
    for (size_t i = 0; i < s.count; ++i)
        for (size_t j = 0; j < i; ++j)
            least = std::min(
                least, std::hypot(double(s.x[i] - s.x[j]), double(s.y[i] - s.y[j]), double(s.z[i] - s.z[j])));
    return least / m.handle->model.body.spacing_m;
}

// doc/fluid.md: beyond some three times the stiffness of the pairs a tension that does not fall makes
// particles clump.
TEST(Fluid, ATensionThatFallsWithShorteningKeepsParticlesApart) {
    std::vector<double> nearest;
    for (const char *slope : {"0", "1"}) {
        Muscle m(Muscle::Settings{{"preset", "triceps_long_head"},
                                  {"particles", "1000"},
                                  {"fibre_tension", "25000"},
                                  {"pair_matching", "4000"},
                                  {"tension_slope", slope}});
        ASSERT_EQ(m.status, SPHM_OK) << m.context.message;
        m.stimulate(8000);
        m.advance(0.1);
        nearest.push_back(nearest_over_spacing(m));
    }
    EXPECT_LT(nearest[0], 0.1);
    EXPECT_GT(nearest[1], 0.4);
}

TEST(Fluid, CoincidingParticlesStayFinite) {
    Sweeps s(Muscle::Settings{}, false);
    sphm_state &t = s.b->state;
    t.x[8] = t.x[7], t.y[8] = t.y[7], t.z[8] = t.z[7];
    s.run(1e-4);
    for (size_t i = 0; i < t.count; ++i)
        ASSERT_TRUE(std::isfinite(t.ax[i]) && std::isfinite(t.ay[i]) && std::isfinite(t.az[i]));
}

// A collapsed muscle would need a million diffusion sub-steps in one step.
TEST(Fluid, ParticlesThatNearlyCoincideStopTheDiffusion) {
    Sweeps s(Muscle::Settings{}, false);
    sphm_state &state = s.b->state;
    const double at_rest = s.b->diffusion.stable_step_ms;
    for (double size : {0.8, 1e-3}) {
        for (size_t i = 0; i < state.count; ++i) {
            state.x[i] = static_cast<sphm_real>(size) * state.rest_x[i];
            state.y[i] = static_cast<sphm_real>(size) * state.rest_y[i];
            state.z[i] = static_cast<sphm_real>(size) * state.rest_z[i];
        }
        s.b->rows_stale = 1;
        sphm_drive none{};
        sphm_context context{};
        const sphm_status status = sphm_cpu_backend.step(s.b, 1, 1e-6, &none, &context);
        if (size > 0.5) {
            EXPECT_EQ(status, SPHM_OK) << context.message;
            continue;
        }
        EXPECT_EQ(status, SPHM_FAILED_NONFINITE);
        EXPECT_LT(s.b->diffusion.stable_step_ms, 0.01 * at_rest);
        EXPECT_NE(std::string(context.message).find("ran away"), std::string::npos) << context.message;
        EXPECT_NE(std::string(context.message).find("diffusion"), std::string::npos) << context.message;
    }
}

} // namespace
