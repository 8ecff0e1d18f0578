// Observations of prescribed states, against what they must be.
#include <gtest/gtest.h>

#include "prescribed.h"

namespace {

using prescribed::Map;
using prescribed::Muscle;
using prescribed::Place;

TEST(Observables, AreExactlyZeroAtRest) {
    Muscle muscle;
    const sphm_observation o = muscle.observe();
    EXPECT_LT(o.displacement_max_m, 1e-15);
    EXPECT_LT(o.displacement_sections_m, 1e-15);
    EXPECT_EQ(o.bulge, 0);
    EXPECT_EQ(o.shortening, 0);
    EXPECT_EQ(o.lengthening_speed_m_per_s, 0);
    EXPECT_NEAR(o.volume_ratio, 1, 1e-12);
    EXPECT_EQ(o.kinetic_energy_J, 0);
    EXPECT_EQ(o.nonfinite, 0u);
    EXPECT_NEAR(o.length_m, 60 * 0.002 * 0.9, 1e-8) << "from centroid to centroid of the attached tenths";
}

TEST(Observables, DoNotSeeARigidMotion) {
    Muscle muscle;
    const double bound = 3 * prescribed::rounding(0.5);
    for (const double angle : {0.3, 1.7, 3.1}) {
        const Place spin = {0.4, -1.3, 2.0};
        muscle.move(prescribed::rigid(angle, {1, -2, 0.7}, {0.3, -0.2, 0.1}));
        muscle.set_velocity([&](const Place &x) {
            return Place{spin[1] * x[2] - spin[2] * x[1] + 0.1, spin[2] * x[0] - spin[0] * x[2],
                         spin[0] * x[1] - spin[1] * x[0] - 0.3};
        });
        const sphm_observation o = muscle.observe();
        EXPECT_LT(o.displacement_max_m, bound);
        EXPECT_LT(o.displacement_sections_m, bound);
        EXPECT_NEAR(o.bulge, 0, bound / 0.005);
        EXPECT_NEAR(o.shortening, 0, bound / 0.1);
        EXPECT_NEAR(o.lengthening_speed_m_per_s, 0, 1e-6) << "turning at 2 rad/s is no lengthening";
        EXPECT_GT(o.kinetic_energy_J, 0);
    }
}

TEST(Observables, TellAUniformStretch) {
    Muscle muscle;
    const double along = 0.8, across = 1.1;
    const Map turn = prescribed::rigid(0.6, {0, 1, 1}, {0.01, 0, 0});
    muscle.move([&](const Place &x) { return turn({along * x[0], across * x[1], across * x[2]}); });
    for (size_t s = 0; s < muscle.state.count; ++s)
        muscle.state.density[s] = sphm_real(muscle.state.rest_density[s] / (along * across * across));
    const sphm_observation o = muscle.observe();
    const double bound = 3 * prescribed::rounding(0.2);
    EXPECT_NEAR(o.shortening, 0.2, bound / 0.1);
    EXPECT_NEAR(o.bulge, 0.1, bound / 0.005);
    EXPECT_NEAR(o.volume_ratio, along * across * across, 1e-6);

    // Displacement (along - 1, across - 1, across - 1) x, section by section.
    double mean = 0, greatest = 0, region[3] = {0, 0, 0}, outer = 0;
    size_t count[3] = {0, 0, 0}, outer_count = 0;
    for (size_t s = 0; s < muscle.state.count; ++s) {
        const Place x = muscle.rest_of(s);
        const double d = std::sqrt(std::pow((along - 1) * x[0], 2) + std::pow((across - 1) * x[1], 2) +
                                   std::pow((across - 1) * x[2], 2));
        const int r = muscle.region[size_t(muscle.state.id[s])];
        mean += d / double(muscle.state.count);
        greatest = std::fmax(greatest, d);
        region[r] += d;
        ++count[r];
        if (muscle.outer[size_t(muscle.state.id[s])]) {
            outer += d;
            ++outer_count;
        }
    }
    EXPECT_NEAR(o.displacement_mean_m, mean, bound);
    EXPECT_NEAR(o.displacement_max_m, greatest, bound);
    EXPECT_NEAR(o.displacement_surface_m, outer / double(outer_count), bound);
    EXPECT_NEAR(o.deformation_by_radius, mean / 0.008, bound / 0.008);
    EXPECT_NEAR(o.deformation_by_length, mean / 0.12, bound / 0.12);
    for (int r = 0; r < 3; ++r)
        EXPECT_NEAR(o.displacement_region_m[r], region[r] / double(count[r]), bound);
    // 20 sections of 3 layers: centroids at (k - 9.5) 6 mm, of which a fifth is lost; mean |k - 9.5| is 5.
    EXPECT_NEAR(o.displacement_sections_m, 0.2 * 5 * 0.006, bound);
}

TEST(Observables, SplitDisplacementsByPlane) {
    // A shift of the centre against the ends leaves the rotation alone by symmetry, but moves the centroid.
    Muscle muscle;
    const Place shift = {0.001, 0.002, 0.0005};
    muscle.move([&](const Place &x) {
        const bool centre = std::fabs(x[0]) < 0.3 * 0.12;
        return centre ? Place{x[0] + shift[0], x[1] + shift[1], x[2] + shift[2]} : x;
    });
    const sphm_observation o = muscle.observe();
    const double bound = 3 * prescribed::rounding(0.1);
    const double planes[3] = {std::hypot(shift[0], shift[1]), std::hypot(shift[1], shift[2]),
                              std::hypot(shift[0], shift[2])};
    for (int p = 0; p < 3; ++p) { // the centroid takes 60 % of the shift
        EXPECT_NEAR(o.displacement_plane_m[SPHM_REGION_CENTRE][p], 0.4 * planes[p], bound);
        EXPECT_NEAR(o.displacement_plane_m[SPHM_REGION_ORIGIN][p], 0.6 * planes[p], bound);
        EXPECT_NEAR(o.displacement_plane_m[SPHM_REGION_INSERTION][p], 0.6 * planes[p], bound);
    }
    EXPECT_NEAR(o.shortening, 0, 1e-6);
}

TEST(Observables, TakeMeansOverRegions) {
    Muscle muscle;
    muscle.model.parameters.coupling = SPHM_COUPLING_PRESSURE;
    muscle.model.parameters.electrical_pressure = 10;
    for (size_t s = 0; s < muscle.state.count; ++s) {
        const int r = muscle.region[size_t(muscle.state.id[s])];
        muscle.state.membrane_potential[s] = sphm_real(-85 + 10 * r);
        muscle.state.pressure[s] = sphm_real(100 * (r + 1));
        muscle.state.activation[s] = sphm_real(0.25 * r);
        muscle.state.vx[s] = r == 1 ? 2 : 0;
    }
    const sphm_observation o = muscle.observe();
    for (int r = 0; r < 3; ++r) {
        EXPECT_DOUBLE_EQ(o.membrane_potential_region_mV[r], -85 + 10 * r);
        EXPECT_DOUBLE_EQ(o.pressure_region_Pa[r], 100 * (r + 1));
    }
    EXPECT_NEAR(o.membrane_potential_mV, 0.2 * -85 + 0.6 * -75 + 0.2 * -65, 1e-9);
    EXPECT_NEAR(o.pressure_mean_Pa, 200, 1e-9);
    EXPECT_NEAR(o.electrical_pressure_mean_Pa, 0.6 * 100 + 0.2 * 200, 1e-9);
    EXPECT_NEAR(o.activation, 0.25, 1e-12);
    EXPECT_DOUBLE_EQ(o.speed_max_m_per_s, 2);
    EXPECT_NEAR(o.kinetic_energy_J,
                0.5 * muscle.model.particle_mass_kg * 4 * 0.6 * double(muscle.state.count), 1e-12);
    muscle.model.parameters.coupling = SPHM_COUPLING_FIBRE_TENSION;
    EXPECT_EQ(muscle.observe().electrical_pressure_mean_Pa, 0);
}

TEST(Observables, LengtheningSpeedIsTheDerivativeOfTheLength) {
    Muscle muscle;
    // A bent, twisted, stretched shape in motion: compare with a central difference.
    const auto shape = [](double t) {
        return [t](const Place &x) {
            return Place{x[0] * (1 + 0.5 * t), x[1] + (1 + t) * 2 * x[0] * x[0] + 0.3 * t * x[0],
                         x[2] + (0.2 + t) * x[0] + t * x[1]};
        };
    };
    const double dt = 1e-3;
    muscle.move(shape(-dt));
    const double before = muscle.observe().length_m;
    muscle.move(shape(dt));
    const double after = muscle.observe().length_m;
    for (size_t s = 0; s < muscle.state.count; ++s) {
        const Place a = shape(-dt)(muscle.rest_of(s)), b = shape(dt)(muscle.rest_of(s));
        muscle.state.vx[s] = sphm_real((b[0] - a[0]) / (2 * dt));
        muscle.state.vy[s] = sphm_real((b[1] - a[1]) / (2 * dt));
        muscle.state.vz[s] = sphm_real((b[2] - a[2]) / (2 * dt));
    }
    muscle.move(shape(0));
    EXPECT_NEAR(muscle.observe().lengthening_speed_m_per_s, (after - before) / (2 * dt), 2e-5);
    EXPECT_GT(std::fabs(after - before) / (2 * dt), 0.01) << "else the comparison says nothing";
}

TEST(Observables, MeasureBetweenTheOutermostSlicesWhereNothingIsAttached) {
    Muscle muscle(60, 8, 0.002, {0, 0, 0}, 0);
    EXPECT_NEAR(muscle.observe().length_m, 0.12 - 0.002, 1e-7) << "2 % of 60 layers is one layer";
    muscle.move([](const Place &x) { return Place{0.5 * x[0], x[1], x[2]}; });
    EXPECT_NEAR(muscle.observe().shortening, 0.5, 1e-6);
}

TEST(Observables, SurviveTheSmallestMuscle) {
    Muscle muscle(2, 2, 0.002, {0, 0, 0}, 0);
    ASSERT_EQ(muscle.state.count, 8u);
    const sphm_observation o = muscle.observe();
    EXPECT_LT(o.displacement_max_m, 1e-15);
    EXPECT_NEAR(o.length_m, 0.002, 1e-9);
}

TEST(Observables, CountNonfiniteParticles) {
    Muscle muscle;
    muscle.state.x[3] = NAN;
    muscle.state.membrane_potential[17] = INFINITY;
    muscle.state.density[17] = NAN;
    EXPECT_EQ(muscle.observe().nonfinite, 2u);
    EXPECT_TRUE(std::isnan(muscle.observe().displacement_mean_m));
}

TEST(Observables, AreTheSameBitsForAnyThreadCountAndSlotOrder) {
    Muscle muscle;
    const auto bend = [](const Place &x) {
        return Place{x[0], x[1] + 3 * x[0] * x[0], 1.1 * x[2] + x[1] * x[0]};
    };
    muscle.move(bend);
    const sphm_observation first = muscle.observe();
    muscle.observer->threads = 2;
    const sphm_observation second = muscle.observe();
    EXPECT_EQ(std::memcmp(&first, &second, sizeof first), 0);
    std::vector<int32_t> order(muscle.state.count);
    for (size_t s = 0; s < order.size(); ++s)
        order[s] = int32_t(order.size() - 1 - s);
    std::vector<double> scratch(muscle.state.capacity);
    sphm_state_permute(&muscle.state, order.data(), scratch.data());
    const sphm_observation third = muscle.observe();
    EXPECT_EQ(std::memcmp(&first, &third, sizeof first), 0);
}

} // namespace
