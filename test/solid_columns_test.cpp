// Columns of the solid sweeps: they hold the pairs of the rows, and the sweeps over them give what the sweeps
// over rows give.
#include "core/state.h"
#include "cpu/column_diffusion.h"
#include "sph_muscle/parameters.h"
#include "solid_scene.h"

#include <algorithm>
#include <limits>
#include <memory>

#include <gtest/gtest.h>

namespace {

using solid::Scene;
using solid::Vector;

constexpr double kSpacing = 0.003;
constexpr double kRounding = sizeof(sphm_real) == 8 ? 1e-11 : 1e-4;

// A piece of belly: rows of many lengths.
std::vector<Vector> piece() {
    return solid::fill({0.2, 0.05, 0.036}, kSpacing, 0, solid::in_belly);
}

std::vector<Vector> turned(std::vector<Vector> points) {
    const double c = std::cos(0.6), s = std::sin(0.6);
    for (Vector &p : points) {
        p = {c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]};
        p = {p[0], c * p[1] - s * p[2], s * p[1] + c * p[2]};
    }
    return points;
}

std::unique_ptr<Scene> scene_of(const std::vector<Vector> &points, bool columns, int threads = 1,
                                const std::vector<double> &relative = {}) {
    return std::make_unique<Scene>(points, kSpacing, std::pow(kSpacing, 3), 2.2, threads, columns, relative);
}

// The same motion of every particle whatever its slot: large, uneven, active, viscous.
void disturb(Scene &scene) {
    scene.field.hourglass_Pa = 3e4;
    scene.field.viscosity_Pa_s = 20;
    scene.field.hourglass_time_s = sphm_real(20 / 3e4);
    for (size_t slot = 0; slot < scene.count; ++slot) {
        std::mt19937 random(unsigned(scene.particle[slot]));
        std::uniform_real_distribution<double> uniform(-1, 1);
        const Vector X = scene.rest_at(slot);
        for (int d = 0; d < 3; ++d) {
            scene.motion(slot)[d] = sphm_real(0.004 * std::sin(40 * X[(d + 1) % 3]) + 0.01 * X[d] +
                                              0.02 * kSpacing * uniform(random) + 0.01);
            scene.motion(slot)[4 + d] = sphm_real(0.3 * std::cos(30 * X[d]) + 0.01 * uniform(random));
        }
        scene.activation[slot] = sphm_real(0.3 + 0.2 * uniform(random));
    }
    scene.sweep();
}

struct Results {
    std::vector<double> value[5]; // deformation, its rate, force, density, pressure; by particle
    double modulus = 0;
};

Results results(Scene &scene) {
    Results r;
    const size_t sizes[5] = {9, 9, 3, 1, 1};
    for (int k = 0; k < 5; ++k)
        r.value[k].resize(sizes[k] * scene.count);
    for (size_t slot = 0; slot < scene.count; ++slot) {
        const size_t i = size_t(scene.particle[slot]);
        sphm_real H[9], rate[9];
        sphm_solid_deformation(&scene.lines, slot, H, rate);
        std::copy(H, H + 9, r.value[0].begin() + long(9 * i));
        std::copy(rate, rate + 9, r.value[1].begin() + long(9 * i));
        for (size_t d = 0; d < 3; ++d)
            r.value[2][3 * i + d] = scene.force(slot)[d];
        r.value[3][i] = scene.density[slot];
        r.value[4][i] = scene.pressure[slot];
    }
    r.modulus = scene.stiffest();
    return r;
}

void expect_the_same(const Results &a, const Results &b) {
    const char *names[5] = {"deformation", "rate", "force", "density", "pressure"};
    for (int k = 0; k < 5; ++k) {
        double scale = 0, worst = 0;
        for (size_t i = 0; i < a.value[k].size(); ++i) {
            scale = std::fmax(scale, std::fabs(a.value[k][i]));
            worst = std::fmax(worst, std::fabs(a.value[k][i] - b.value[k][i]));
        }
        EXPECT_GT(scale, 0) << names[k];
        EXPECT_LT(worst, kRounding * scale) << names[k];
    }
    EXPECT_NEAR(a.modulus, b.modulus, kRounding * a.modulus);
}

TEST(SolidColumns, SweepsAgreeWithThoseOverRows) {
    for (const auto &points : {piece(), turned(piece()), solid::block({0.03, 0.021, 0.048}, kSpacing)}) {
        const std::vector<double> uneven = solid::uneven_volumes(points.size());
        const auto with = scene_of(points, true, 1, uneven), without = scene_of(points, false, 1, uneven);
        ASSERT_NE(with->lines.columns.slice, nullptr);
        ASSERT_EQ(without->lines.columns.slice, nullptr);
        disturb(*with);
        disturb(*without);
        expect_the_same(results(*with), results(*without));
    }
}

TEST(SolidColumns, EveryPairIsInExactlyOneColumn) {
    const auto scene = scene_of(piece(), true);
    const sphm_solid_columns &c = scene->lines.columns;
    size_t pairs = 0;
    for (size_t s = 0; s < c.slices; ++s) {
        pairs += 2 * size_t(c.slice[s].count) * (c.slice[s + 1].twin - c.slice[s].twin);
        for (size_t k = c.slice[s].single; k < c.slice[s + 1].single; ++k)
            pairs += size_t(__builtin_popcount(c.single[k].lanes));
    }
    size_t expected = 0;
    for (size_t slot = 0; slot < scene->count; ++slot)
        expected += size_t(scene->rows.row_count[slot]);
    EXPECT_EQ(pairs, expected);
    EXPECT_EQ(c.slice[c.slices].twin, c.twins);
    EXPECT_EQ(c.slice[c.slices].single, c.singles);
}

TEST(SolidColumns, AnyNumberOfThreadsGivesTheSameBits) {
    const auto one = scene_of(piece(), true, 1), three = scene_of(piece(), true, 3);
    disturb(*one);
    disturb(*three);
    const Results a = results(*one), b = results(*three);
    for (int k = 0; k < 5; ++k)
        EXPECT_EQ(a.value[k], b.value[k]);
    EXPECT_EQ(a.modulus, b.modulus);
}

// Lanes reach beyond the first and the last particle.
TEST(SolidColumns, WhatLiesBesideTheParticlesDoesNotMatter) {
    const auto clean = scene_of(piece(), true), dirty = scene_of(piece(), true);
    const sphm_solid_columns &c = dirty->lines.columns;
    std::vector<sphm_real *> arrays(c.motion, c.motion + 6);
    arrays.insert(arrays.end(), c.stress, c.stress + 12);
    for (sphm_real *values : arrays)
        for (int beside = 1; beside <= 16; ++beside)
            values[-beside] = values[int(c.count) + beside - 1] = std::numeric_limits<sphm_real>::quiet_NaN();
    disturb(*clean);
    disturb(*dirty);
    const Results a = results(*clean), b = results(*dirty);
    for (int k = 0; k < 5; ++k)
        EXPECT_EQ(a.value[k], b.value[k]);
}

TEST(SolidColumns, NameTheInvertedParticle) {
    const auto scene = scene_of(piece(), true);
    const size_t victim = scene->count / 3;
    scene->motion(victim)[0] = sphm_real(30 * kSpacing);
    scene->sweep();
    int32_t first = -1;
    for (size_t b = 0; b < scene->lines.blocks && first < 0; ++b)
        first = scene->lines.block_inverted[b];
    size_t expected = 0;
    while (expected < scene->count && scene->density[expected] > 0)
        ++expected;
    ASSERT_LT(expected, scene->count);
    EXPECT_EQ(size_t(first), expected);
}

TEST(SolidColumns, AreNotMadeOfWhatIsNoLattice) {
    EXPECT_EQ(scene_of(solid::block({0.03, 0.021, 0.048}, kSpacing, 0.25), true)->lines.columns.slice,
              nullptr);
    EXPECT_EQ(scene_of(solid::block({0.03, 0.021, 0.048}, kSpacing, 0.001), true)->lines.columns.slice,
              nullptr);
    // Two particles side by side: columns of single pairs.
    EXPECT_EQ(scene_of({{0, 0, 0}, {kSpacing, 0, 0}}, true)->lines.columns.slice, nullptr);
}

// Diffusion weights of a scene, by rows and by columns, and a potential.
struct Diffusing {
    std::unique_ptr<Scene> scene = scene_of(piece(), true);
    sphm_diffusion weights{};
    sphm_column_diffusion columns{};
    sphm_state state{};

    explicit Diffusing(double anisotropy) {
        sphm_context context{};
        sphm_diffusion_input input{};
        input.laplacian = SPHM_LAPLACIAN_CORRECTED;
        input.support_radius_m = 2.6 * kSpacing;
        input.particle_volume_m3 = std::pow(kSpacing, 3);
        input.diffusion_mm2_per_ms = 0.766;
        input.anisotropy_ratio = anisotropy;
        input.x = scene->rest[0].data();
        input.y = scene->rest[1].data();
        input.z = scene->rest[2].data();
        input.fibre_x = scene->fibre[0].data();
        input.fibre_y = scene->fibre[1].data();
        input.fibre_z = scene->fibre[2].data();
        Scene::require(sphm_diffusion_build(&weights, &scene->rows, &input, 1, &context), context);
        Scene::require(
            sphm_column_diffusion_create(&columns, &scene->lines.columns, &scene->rows, &weights, &context),
            context);
        Scene::require(sphm_state_create(&state, scene->count, &context), context);
    }
    Diffusing(const Diffusing &) = delete;
    ~Diffusing() {
        sphm_column_diffusion_free(&columns);
        sphm_diffusion_free(&weights);
        sphm_state_free(&state);
    }
};

TEST(ColumnDiffusion, IsThatOverRows) {
    for (const double anisotropy : {1.0, 4.0}) {
        Diffusing d(anisotropy);
        std::mt19937 random(5);
        std::uniform_real_distribution<double> uniform(-85, 15);
        for (size_t i = 0; i < d.state.count; ++i)
            d.state.membrane_potential[i] = sphm_real(uniform(random));
        const double step_ms = 0.2;
        sphm_column_diffusion_sweep(&d.columns, &d.state, step_ms, 2);
        double worst = 0, largest = 0;
        for (size_t i = 0; i < d.state.count; ++i) {
            double flow = 0;
            for (int32_t k = 0; k < d.scene->rows.row_count[i]; ++k) {
                const size_t at = d.scene->rows.row_start[i] + size_t(k);
                flow += double(d.weights.weight[at]) *
                        (double(d.state.membrane_potential[d.scene->rows.slot[at]]) -
                         double(d.state.membrane_potential[i]));
            }
            const double expected = double(d.state.membrane_potential[i]) + step_ms * flow;
            worst = std::fmax(worst, std::fabs(double(d.state.membrane_next[i]) - expected));
            largest = std::fmax(largest, std::fabs(step_ms * flow));
        }
        EXPECT_GT(largest, 1);
        EXPECT_LT(worst, 0.1 * kRounding * 100);
    }
}

TEST(ColumnDiffusion, KeepsAUniformPotentialToTheBit) {
    Diffusing d(1);
    for (size_t i = 0; i < d.state.count; ++i)
        d.state.membrane_potential[i] = sphm_real(-61.7);
    sphm_column_diffusion_sweep(&d.columns, &d.state, 0.2, 1);
    for (size_t i = 0; i < d.state.count; ++i)
        ASSERT_EQ(d.state.membrane_next[i], sphm_real(-61.7));
}

} // namespace
