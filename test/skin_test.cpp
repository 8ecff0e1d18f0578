// The skin: exact for affine motions, smooth, harmless where the particles span no volume.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/point_grid.h"
#include "prescribed.h"

namespace {

using prescribed::Map;
using prescribed::Muscle;
using prescribed::Place;

double worst_distance(Muscle &muscle, const Map &map) {
    muscle.move(map);
    const sphm_skin skin = muscle.skin();
    double worst = 0;
    for (size_t v = 0; v < skin.vertex_count; ++v) {
        Place rest;
        for (size_t a = 0; a < 3; ++a)
            rest[a] = muscle.vertices[3 * v + a] - muscle.model.frame_m[a];
        const Place place = map(rest);
        for (size_t a = 0; a < 3; ++a)
            worst =
                std::fmax(worst, std::fabs(skin.vertices_m[3 * v + a] - muscle.model.frame_m[a] - place[a]));
    }
    return worst;
}

TEST(Skin, IsExactForRigidAndAffineMotions) {
    Muscle muscle;
    // Vertices are handed out in single precision: half a rounding of 0.6 m, and a little from the weights.
    const double bound = 1.5e-7;
    EXPECT_LT(worst_distance(muscle, [](const Place &x) { return x; }), bound);
    EXPECT_LT(worst_distance(muscle, prescribed::rigid(2.1, {1, 2, -1}, {0.2, 0.1, -0.1})), bound);
    EXPECT_LT(
        worst_distance(muscle,
                       [](const Place &x) {
                           return Place{0.7 * x[0] + 0.2 * x[1], 1.3 * x[1] - 0.4 * x[2], x[2] + 0.5 * x[0]};
                       }),
        bound);
    EXPECT_EQ(muscle.observer->skin.degenerate, 0u);
}

TEST(Skin, WeightsSumToOneAndReproduceTheVertex) {
    Muscle muscle;
    muscle.skin();
    const sphm_skin_weights &w = muscle.observer->skin;
    for (size_t v = 0; v < w.vertex_count; ++v) {
        double carry = 0, blend = 0, place[3] = {0, 0, 0};
        for (size_t k = 24 * v; k < 24 * (v + 1); ++k) {
            carry += w.carry[k];
            blend += w.blend[k];
            ASSERT_GE(w.blend[k], 0);
            for (size_t a = 0; a < 3; ++a)
                place[a] += w.carry[k] * muscle.positions[3 * size_t(w.particle[k]) + a];
        }
        ASSERT_NEAR(carry, 1, 1e-6);
        ASSERT_NEAR(blend, 1, 1e-6);
        for (size_t a = 0; a < 3; ++a)
            ASSERT_NEAR(place[a], muscle.vertices[3 * v + a], 2e-7);
    }
}

TEST(Skin, FollowsABendAndABulgeWithinAFewPercent) {
    Muscle muscle;
    // Centre line bent to a radius of 0.15 m, section swollen by 20 % in the middle.
    const Map bend = [](const Place &x) {
        const double radius = 0.15, angle = x[0] / radius, swell = 1 + 0.2 * std::exp(-x[0] * x[0] / 5e-4);
        return Place{(radius + swell * x[2]) * std::sin(angle), swell * x[1],
                     (radius + swell * x[2]) * std::cos(angle) - radius};
    };
    // Second derivatives are about 20 /m; over a spacing of 2 mm that is 0.02 spacings.
    EXPECT_LT(worst_distance(muscle, bend), 0.05 * 0.002);
}

TEST(Skin, DampsTheDisorderOfParticles) {
    Muscle muscle;
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0, 1e-4);
    muscle.move([&](const Place &x) {
        return Place{x[0] + noise(random), x[1] + noise(random), x[2] + noise(random)};
    });
    const sphm_skin skin = muscle.skin();
    double sum = 0;
    for (size_t i = 0; i < 3 * skin.vertex_count; ++i)
        sum += std::pow(skin.vertices_m[i] - muscle.vertices[i], 2);
    EXPECT_LT(std::sqrt(sum / double(3 * skin.vertex_count)), 1e-4) << "of the noise of the particles";
}

TEST(Skin, BlendsFieldsWithoutOvershoot) {
    Muscle muscle;
    for (size_t s = 0; s < muscle.state.count; ++s) {
        muscle.state.pressure[s] = sphm_real(muscle.rest_of(s)[0] > 0);
        muscle.state.activation[s] = sphm_real(muscle.rest_of(s)[0]);
    }
    const sphm_skin step = muscle.skin(SPHM_FIELD_PRESSURE);
    int between = 0;
    for (size_t v = 0; v < step.vertex_count; ++v) {
        ASSERT_GE(step.field[v], 0);
        ASSERT_LE(step.field[v], 1 + 1e-6);
        between += step.field[v] > 0.01 && step.field[v] < 0.99;
    }
    EXPECT_GT(between, 0);
    const sphm_skin ramp = muscle.skin(SPHM_FIELD_ACTIVATION);
    for (size_t v = 0; v < ramp.vertex_count; ++v)
        ASSERT_NEAR(ramp.field[v], muscle.vertices[3 * v] - muscle.model.frame_m[0], 1.25 * 0.002)
            << "about a spacing of the linear field: at the ends particles lie on one side only";
}

TEST(Skin, RefusesUnknownFields) {
    Muscle muscle;
    sphm_skin skin;
    sphm_context context{};
    EXPECT_EQ(sphm_observer_skin(muscle.observer, &muscle.state, SPHM_FIELD_COUNT, &skin, &context),
              SPHM_REFUSED_ARGUMENT);
    EXPECT_NE(std::strstr(context.message, "field 5"), nullptr) << context.message;
    EXPECT_EQ(sphm_observer_skin(muscle.observer, &muscle.state, -1, &skin, &context), SPHM_REFUSED_ARGUMENT);
}

// Particles on a line or a sheet, or fewer than 24: rigid motions stay exact, nothing flies off.
void expect_rigid(const std::vector<double> &particles, const std::vector<double> &vertices) {
    sphm_skin_weights weights;
    ASSERT_EQ(sphm_skin_weights_create(vertices.data(), vertices.size() / 3, particles.data(),
                                       particles.size() / 3, 0.001, 1, &weights, nullptr),
              SPHM_OK);
    const Map motion = prescribed::rigid(1, {1, 1, 0.3}, {0.01, 0, 0}),
              turn = prescribed::rigid(1, {1, 1, 0.3}, {});
    double rotation[9];
    for (size_t j = 0; j < 3; ++j) {
        Place e = {0, 0, 0};
        e[j] = 1;
        const Place column = turn(e);
        for (size_t i = 0; i < 3; ++i)
            rotation[3 * i + j] = column[i];
    }
    std::vector<sphm_real> present;
    for (size_t i = 0; i < particles.size(); i += 3)
        for (const double x : motion({particles[i], particles[i + 1], particles[i + 2]}))
            present.push_back(sphm_real(x));
    std::vector<float> carried(vertices.size());
    const double zero[3] = {0, 0, 0};
    sphm_skin_carry(&weights, present.data(), rotation, zero, 1, carried.data());
    for (size_t v = 0; v < vertices.size(); v += 3) {
        const Place expected = motion({vertices[v], vertices[v + 1], vertices[v + 2]});
        for (size_t a = 0; a < 3; ++a)
            EXPECT_NEAR(carried[v + a], expected[a], 2e-8);
    }
    for (size_t k = 0; k < 24 * weights.vertex_count; ++k)
        EXPECT_LT(std::fabs(weights.carry[k]), 4) << "a large weight magnifies disorder";
    sphm_skin_weights_free(&weights);
}

TEST(Skin, FallsBackWhereParticlesSpanNoVolume) {
    std::vector<double> line, sheet;
    for (int i = 0; i < 30; ++i)
        line.insert(line.end(), {0.001 * i, 0, 0});
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j)
            sheet.insert(sheet.end(), {0.001 * i, 0.001 * j, 1e-8 * ((i + j) % 2)});
    const std::vector<double> vertices = {0.0104, 0.0007, 0.0003, -0.001, 0, 0, 0.002, 0.002, 0.0005};
    expect_rigid(line, vertices);
    expect_rigid(sheet, vertices);
    expect_rigid({0, 0, 0}, vertices);
    expect_rigid({0, 0, 0, 0.001, 0, 0, 0, 0.001, 0, 0, 0, 0.001}, vertices);
}

TEST(PointGrid, FindsTheNearestPoints) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> u(-1, 1);
    std::vector<double> points;
    for (int i = 0; i < 300; ++i)
        points.insert(points.end(), {u(random), 0.2 * u(random), u(random)});
    sphm_point_grid grid;
    ASSERT_EQ(sphm_point_grid_create(points.data(), 300, 0.1, &grid, nullptr), SPHM_OK);
    for (int trial = 0; trial < 100; ++trial) {
        const double place[3] = {2 * u(random), 2 * u(random), 2 * u(random)},
                     radius = trial % 2 ? INFINITY : 0.7;
        std::vector<std::pair<double, int32_t>> all;
        for (int i = 0; i < 300; ++i) {
            double squared = 0;
            for (int a = 0; a < 3; ++a)
                squared += std::pow(points[3 * i + a] - place[a], 2);
            if (squared <= radius * radius)
                all.emplace_back(squared, i);
        }
        std::sort(all.begin(), all.end());
        int32_t found[20];
        double squared[20];
        const size_t have = sphm_point_grid_closest(&grid, place, radius, 20, found, squared);
        ASSERT_EQ(have, std::min<size_t>(20, all.size()));
        for (size_t k = 0; k < have; ++k)
            ASSERT_EQ(found[k], all[k].second);
    }
    sphm_point_grid_free(&grid);
}

} // namespace
