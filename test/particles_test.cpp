// Particle fields by id, of prescribed states.
#include <gtest/gtest.h>

#include "prescribed.h"

namespace {

using prescribed::Muscle;
using prescribed::Place;

TEST(Particles, ComeByIdInTheMusclesFrame) {
    Muscle muscle;
    muscle.set_velocity([](const Place &x) { return x; });
    for (size_t s = 0; s < muscle.state.count; ++s) {
        muscle.state.recovery[s] = sphm_real(muscle.state.id[s]);
        muscle.state.activation[s] = sphm_real(0.5 * muscle.state.id[s]);
        muscle.state.pressure[s] = sphm_real(2 * muscle.state.id[s]);
        muscle.state.membrane_potential[s] = sphm_real(-85 + 0.25 * muscle.state.id[s]);
    }
    muscle.model.parameters.coupling = SPHM_COUPLING_PRESSURE;
    muscle.model.parameters.electrical_pressure = 10;
    const sphm_particles p = muscle.particles();
    ASSERT_EQ(p.count, muscle.state.count);
    for (size_t i = 0; i < p.count; ++i) {
        for (size_t a = 0; a < 3; ++a) {
            ASSERT_NEAR(p.position_m[3 * i + a], muscle.positions[3 * i + a], 6e-8);
            ASSERT_NEAR(p.velocity_m_per_s[3 * i + a], muscle.positions[3 * i + a] - muscle.model.frame_m[a],
                        6e-8);
        }
        ASSERT_EQ(p.recovery[i], float(i));
        ASSERT_EQ(p.activation[i], float(0.5 * double(i)));
        ASSERT_EQ(p.pressure_Pa[i], float(2 * i));
        ASSERT_EQ(p.membrane_potential_mV[i], float(-85 + 0.25 * double(i)));
        ASSERT_NEAR(p.electrical_pressure_Pa[i], 2.5 * double(i), 1e-3);
        ASSERT_EQ(p.density_kg_per_m3[i], float(1000 + i % 7));
        ASSERT_LT(p.displacement_m[i], 1e-12F);
        ASSERT_NEAR(p.fibre_stretch[i], 1, 1e-5);
    }
}

TEST(Particles, StretchAlongTheFibreIsExactForAffineMotions) {
    Muscle muscle;
    // F = [0.8 0.3 0; 0 1.2 -0.1; 0.05 0 1] on fibres along x: |F e_x| = |(0.8, 0, 0.05)|.
    muscle.move([](const Place &x) {
        return Place{0.8 * x[0] + 0.3 * x[1], 1.2 * x[1] - 0.1 * x[2], 0.05 * x[0] + x[2]};
    });
    const sphm_particles p = muscle.particles();
    const double expected = std::hypot(0.8, 0.05);
    for (size_t i = 0; i < p.count; ++i)
        ASSERT_NEAR(p.fibre_stretch[i], expected, 200 * prescribed::rounding(1));
}

TEST(Particles, StretchFollowsTheFibreOfEachParticle) {
    const double spacing = 0.001;
    std::vector<double> rest, fibres;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j)
            for (int k = 0; k < 6; ++k) {
                rest.insert(rest.end(), {i * spacing, j * spacing, k * spacing});
                const double angle = 0.1 * double(fibres.size() / 3);
                fibres.insert(fibres.end(), {std::cos(angle), std::sin(angle), 0});
            }
    sphm_fibre_weights weights;
    ASSERT_EQ(sphm_fibre_weights_create(rest.data(), fibres.data(), 216, spacing, &weights, nullptr),
              SPHM_OK);
    std::vector<sphm_real> present;
    for (size_t i = 0; i < 216; ++i)
        for (size_t a = 0; a < 3; ++a)
            present.push_back(sphm_real(rest[3 * i + a] * (a == 0 ? 0.7 : 1.3)));
    std::vector<float> stretch(216);
    sphm_fibre_stretch(&weights, present.data(), 1, stretch.data());
    for (size_t i = 0; i < 216; ++i)
        ASSERT_NEAR(stretch[i], std::hypot(0.7 * fibres[3 * i], 1.3 * fibres[3 * i + 1]), 1e-5);
    sphm_fibre_weights_free(&weights);
}

TEST(Particles, StretchIsOneWhereItCannotBeTold) {
    // A lone particle, and three in a plane: one direction stays open.
    const std::vector<double> rest = {0, 0, 0, 1, 0, 0, 1.001, 0, 0, 1, 0.001, 0};
    const std::vector<double> fibres = {1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0};
    sphm_fibre_weights weights;
    ASSERT_EQ(sphm_fibre_weights_create(rest.data(), fibres.data(), 4, 0.001, &weights, nullptr), SPHM_OK);
    std::vector<sphm_real> present;
    for (const double x : rest)
        present.push_back(sphm_real(3 * x));
    std::vector<float> stretch(4, -1);
    sphm_fibre_stretch(&weights, present.data(), 1, stretch.data());
    for (const float value : stretch)
        EXPECT_EQ(value, 1.0F);
    sphm_fibre_weights_free(&weights);
}

TEST(Particles, DisplacementVectorsAreWhatTheRigidMotionLeaves) {
    Muscle muscle;
    // A symmetric pinch towards the axis: no rigid part, so the displacement is the motion itself.
    const auto turn = prescribed::rigid(1.2, {3, 1, 2}, {0.1, 0.2, -0.1});
    muscle.move([&](const Place &x) { return turn({x[0], 0.9 * x[1], 0.9 * x[2]}); });
    const sphm_particles p = muscle.particles();
    for (size_t s = 0; s < p.count; ++s) {
        const Place x = muscle.rest_of(s);
        const size_t i = size_t(muscle.state.id[s]);
        const Place d = prescribed::rigid(1.2, {3, 1, 2}, {0, 0, 0})({0, -0.1 * x[1], -0.1 * x[2]});
        double length = 0;
        for (size_t a = 0; a < 3; ++a) {
            ASSERT_NEAR(p.displacement_vector_m[3 * i + a], d[a], 5e-8);
            length += d[a] * d[a];
        }
        ASSERT_NEAR(p.displacement_m[i], std::sqrt(length), 5e-8);
    }
}

} // namespace
