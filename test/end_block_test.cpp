// Ends as rigid blocks: mass and inertia, motion of a free top, loads, releases, slides.
#include "solid_muscles.h"

#include "core/end_blocks.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <string>

namespace {

using namespace solid;

// Settles in fewer steps.
sphm_parameters heavy_bar() {
    sphm_parameters p = bar();
    p.mass_scaling = 9;
    return p;
}

// Mass and inertia of a box: m/12 (b^2 + c^2).
TEST(EndBlock, HasMassAndInertiaOfItsParticles) {
    sphm_parameters p = bar();
    p.mass_scaling = 4;
    const Muscle muscle = make(p);
    const sphm_end_block &block = muscle->model.ends[SPHM_END_INSERTION];
    const double mass = 1112 * 0.015 * bar_area; // a quarter of the bar: a cube
    EXPECT_EQ(block.particles, 125);
    EXPECT_NEAR(block.weight_kg, mass, 1e-9);
    EXPECT_NEAR(block.inertia_kg, 4 * mass, 1e-9);
    EXPECT_NEAR(block.centre_m[0], 0.0225, 1e-9);
    EXPECT_NEAR(block.point_m[0], 0.03, 1e-6);
    for (int i = 0; i < 9; ++i)
        EXPECT_NEAR(block.inertia_kg_m2[i], i % 4 ? 0 : 4 * mass * 0.015 * 0.015 / 6, 1e-12) << i;
}

// The same from the sums over the particles of a preset, which stand for unequal volumes.
TEST(EndBlock, WeighsTheVolumesOfItsParticles) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.particles = 900;
    p.mass_scaling = 4;
    const Muscle muscle = make(p);
    const sphm_body &body = *sphm_muscle_body(muscle.get());
    const double all_the_same = body.volume_m3 / double(body.count);
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        const sphm_end_block &block = muscle->model.ends[end];
        const auto sum = [&](const std::function<double(const double *, double)> &of) {
            double total = 0;
            for (size_t i = 0; i < body.count; ++i)
                if (body.attachment[i] ==
                    (end == SPHM_END_ORIGIN ? SPHM_ATTACHED_ORIGIN : SPHM_ATTACHED_INSERTION))
                    total += of(body.positions + 3 * i, p.density * body.volumes[i]);
            return total;
        };
        const double mass = sum([](const double *, double m) { return m; });
        EXPECT_NEAR(block.weight_kg, mass, 1e-9 * mass);
        EXPECT_NEAR(block.inertia_kg, 4 * mass, 1e-9 * mass);
        EXPECT_GT(std::fabs(mass / (p.density * all_the_same * block.particles) - 1), 0.01);
        std::array<double, 3> centre;
        for (size_t d = 0; d < 3; ++d) {
            centre[d] = sum([&](const double *x, double m) { return m * x[d]; }) / mass;
            EXPECT_NEAR(block.centre_m[d], centre[d], 1e-9);
        }
        const double of_cubes = mass * body.spacing_m * body.spacing_m / 6, scale = block.inertia_kg_m2[0];
        for (size_t r = 0; r < 3; ++r)
            for (size_t c = 0; c < 3; ++c) {
                const double inertia = sum([&](const double *x, double m) {
                    const double arm[3] = {x[0] - centre[0], x[1] - centre[1], x[2] - centre[2]};
                    return m *
                           (r == c ? arm[(r + 1) % 3] * arm[(r + 1) % 3] + arm[(r + 2) % 3] * arm[(r + 2) % 3]
                                   : -arm[r] * arm[c]);
                });
                EXPECT_NEAR(block.inertia_kg_m2[3 * r + c], 4 * (inertia + (r == c ? of_cubes : 0)),
                            1e-9 * scale);
            }
    }
}

// Euler's top without forces: angular momentum is kept to rounding, the energy to second order in the step,
// and a symmetric top precesses at L/I_across.
TEST(EndBlock, SpinsLikeATop) {
    sphm_end_block block{};
    block.particles = 1;
    block.inertia_kg = block.weight_kg = 0.01;
    const double along = 1e-6, across = 3e-6;
    for (int d = 0; d < 3; ++d) {
        block.inertia_kg_m2[4 * d] = d ? across : along;
        block.inverse_inertia[4 * d] = 1 / block.inertia_kg_m2[4 * d];
    }
    sphm_end_body body{};
    sphm_end_body_rest(&body);
    const double momentum[3] = {2e-5, 3e-5, 0}, none[3] = {0, 0, 0};
    std::copy(momentum, momentum + 3, body.momentum_Nms);
    const double rate = std::hypot(momentum[0], momentum[1]) / across; // rad/s, of the axis about L
    const int steps = 20000;
    for (int i = 0; i < steps; ++i)
        sphm_end_body_step(&block, none, none, none, none, 2 * M_PI / rate / steps, 1, &body);
    for (int d = 0; d < 3; ++d) {
        EXPECT_NEAR(body.momentum_Nms[d], momentum[d], 1e-15);
        EXPECT_NEAR(body.rotation[3 * d], d == 0, 1e-5); // the axis, after one turn
    }
    double spin[3];
    sphm_end_body_spin(&block, body.rotation, body.momentum_Nms, spin);
    EXPECT_NEAR(sphm_dot3(spin, body.momentum_Nms),
                momentum[0] * momentum[0] / along + momentum[1] * momentum[1] / across, 1e-8);
}

// A loaded bar stretches until its wrench carries the load: as far as a pose would have had to move it.
TEST(EndBlock, LoadedBarCarriesItsLoad) {
    const Muscle muscle = make(heavy_bar());
    const double load_N = 3;
    load(muscle, SPHM_END_INSERTION, load_N);
    EXPECT_EQ(sphm_muscle_end_condition(muscle.get(), SPHM_END_INSERTION, nullptr), SPHM_END_LOADED);
    proceed(muscle, 0.4);
    const sphm_observation loaded = observe(muscle);
    EXPECT_NEAR(loaded.force_N, load_N, 0.001 * load_N);
    EXPECT_NEAR(loaded.force_passive_N, load_N, 0.01 * load_N);
    EXPECT_NEAR(wrench(muscle, SPHM_END_ORIGIN).force_N[0], load_N, 0.001 * load_N);
    EXPECT_GT(loaded.length_m - 0.045, 0.003);
    const double x = end_pose(muscle, SPHM_END_INSERTION).position_m[0];
    EXPECT_NEAR(loaded.attachment_distance_m, x + 0.03, 1e-5);

    const Muscle moved = make(heavy_bar());
    hold_at(moved, SPHM_END_INSERTION, x, 0.1);
    proceed(moved, 0.4);
    EXPECT_NEAR(observe(moved).force_N, load_N, 0.003 * load_N);
}

// The stretch amid a long loaded bar is that of the material: P = load over rest area, lateral surfaces free.
TEST(EndBlock, LoadedBarStretchesByTheMaterialsCurve) {
    const Muscle muscle = make(heavy_bar());
    const double load_N = 4;
    load(muscle, SPHM_END_INSERTION, load_N);
    proceed(muscle, 0.5);
    const sphm_particles p = [&] {
        sphm_particles particles{};
        EXPECT_EQ(sphm_muscle_particles(muscle.get(), &particles, nullptr), SPHM_OK);
        return particles;
    }();
    double stretch = 0, count = 0;
    for (size_t i = 0; i < p.count; ++i)
        if (std::fabs(sphm_muscle_body(muscle.get())->positions[3 * i]) < 0.005) {
            stretch += p.fibre_stretch[i];
            ++count;
        }
    stretch /= count;

    // lambda along, mu across, with P_yy = 0: by bisection on mu, then on lambda.
    const sphm_solid_constants c = muscle->model.solid;
    const auto stress = [&](double lambda, double mu, int component) {
        const sphm_real F[9] = {sphm_real(lambda), 0, 0, 0, sphm_real(mu), 0, 0, 0, sphm_real(mu)};
        const sphm_real f0[3] = {1, 0, 0};
        sphm_real P[9];
        sphm_fibre_stress fibre;
        sphm_solid_stress(F, f0, 0, &c, P, &fibre);
        return double(P[component]);
    };
    double low = 1, high = 1.4;
    for (int i = 0; i < 40; ++i) {
        const double lambda = (low + high) / 2;
        double thin = 0.5, thick = 1.2;
        for (int k = 0; k < 40; ++k)
            (stress(lambda, (thin + thick) / 2, 4) < 0 ? thin : thick) = (thin + thick) / 2;
        (stress(lambda, thin, 0) * bar_area < load_N ? low : high) = lambda;
    }
    EXPECT_GT(low, 1.1);
    EXPECT_NEAR(stretch - 1, low - 1, 0.02 * (low - 1));
}

// Load, release, attach: back to rest, with the poses that were there before.
TEST(EndBlock, ReleasedBarReturnsAndMayBeHeldAgain) {
    sphm_parameters p = heavy_bar();
    p.velocity_damping = 15; // the tissue is soft about its rest shape: more drag would take longer
    const Muscle muscle = make(p);
    load(muscle, SPHM_END_INSERTION, 2, 0.05, 0);
    proceed(muscle, 0.3);
    const sphm_end_pose loaded = end_pose(muscle, SPHM_END_INSERTION);
    EXPECT_GT(loaded.position_m[0], 0.032);
    EXPECT_GT(loaded.position_m[1], 1e-3);
    EXPECT_GT(loaded.orientation[2], 0.004); // turns towards the load
    ASSERT_EQ(sphm_muscle_release_end(muscle.get(), SPHM_END_INSERTION, nullptr), SPHM_OK);
    EXPECT_EQ(sphm_muscle_end_condition(muscle.get(), SPHM_END_INSERTION, nullptr), SPHM_END_FREE);
    proceed(muscle, 2); // overdamped: the last of it sinks back slowly
    const sphm_end_pose free = end_pose(muscle, SPHM_END_INSERTION);
    EXPECT_NEAR(free.position_m[0], 0.03, 1e-4);
    EXPECT_NEAR(free.position_m[1], 0, 2e-4);
    EXPECT_NEAR(free.orientation[2], 0, 0.01);
    EXPECT_NEAR(observe(muscle).force_N, 0, 0.02);

    hold_at(muscle, SPHM_END_INSERTION, 0.032, 0.05);
    EXPECT_EQ(sphm_muscle_end_condition(muscle.get(), SPHM_END_INSERTION, nullptr), SPHM_END_HELD);
    const sphm_end_pose attached = end_pose(muscle, SPHM_END_INSERTION);
    for (int d = 0; d < 3; ++d) // without a jump
        EXPECT_NEAR(attached.position_m[d], free.position_m[d], 1e-12);
    proceed(muscle, 0.1);
    EXPECT_NEAR(end_pose(muscle, SPHM_END_INSERTION).position_m[0], 0.032, 1e-12);
    ASSERT_EQ(sphm_muscle_reset(muscle.get(), nullptr), SPHM_OK);
    EXPECT_NEAR(end_pose(muscle, SPHM_END_INSERTION).position_m[0], 0.03, 1e-6);
    EXPECT_EQ(sphm_muscle_end_condition(muscle.get(), SPHM_END_INSERTION, nullptr), SPHM_END_HELD);
}

// Free at both ends: momentum stays what it was, whatever the muscle does meanwhile.
TEST(EndBlock, FreeMuscleKeepsItsMomentum) {
    sphm_parameters p = bar();
    p.velocity_damping = 0;
    const Muscle muscle = make(p);
    load(muscle, SPHM_END_INSERTION, 0.5, 0.5, 0.2);
    ASSERT_EQ(sphm_muscle_release_end(muscle.get(), SPHM_END_ORIGIN, nullptr), SPHM_OK);
    ASSERT_EQ(sphm_muscle_activate(muscle.get(), 0.2, 0, nullptr), SPHM_OK);
    proceed(muscle, 0.02); // 0.02 s of (0.5, 0.5, 0.2) N
    const auto momentum = [&] {
        const sphm_state *s = sphm_muscle_state(muscle.get());
        std::array<double, 3> sum{};
        for (size_t i = 0; i < s->count; ++i) {
            const double v[3] = {double(s->vx[i]), double(s->vy[i]), double(s->vz[i])};
            for (int d = 0; d < 3; ++d)
                sum[size_t(d)] += muscle->model.particle_mass_kg * double(s->relative_volume[i]) * v[d];
        }
        return sum;
    };
    const auto before = momentum();
    const double impulse[3] = {0.01, 0.01, 0.004};
    for (size_t d = 0; d < 3; ++d)
        EXPECT_NEAR(before[d], impulse[d], 2e-5);
    ASSERT_EQ(sphm_muscle_release_end(muscle.get(), SPHM_END_INSERTION, nullptr), SPHM_OK);
    proceed(muscle, 0.05);
    for (size_t d = 0; d < 3; ++d)
        EXPECT_NEAR(momentum()[d], before[d], 2e-7);
}

TEST(EndBlock, SlidingEndStaysOnTheLine) {
    const Muscle muscle = make(bar());
    ASSERT_EQ(sphm_muscle_slide_end(muscle.get(), SPHM_END_INSERTION, 2, nullptr), SPHM_OK);
    double load_N[3];
    EXPECT_EQ(sphm_muscle_end_condition(muscle.get(), SPHM_END_INSERTION, load_N), SPHM_END_SLIDING);
    EXPECT_NEAR(load_N[0], 2, 1e-6);
    proceed(muscle, 0.3);
    const sphm_end_pose pose = end_pose(muscle, SPHM_END_INSERTION);
    EXPECT_NEAR(observe(muscle).force_N, 2, 0.002);
    EXPECT_NEAR(pose.position_m[1], 0, 1e-9);
    EXPECT_NEAR(pose.orientation[3], 1, 1e-12);
}

// A load keeps a muscle from shortening: isotonic contraction.
TEST(EndBlock, LoadReducesIsotonicShortening) {
    double shortening[2];
    for (int loaded = 0; loaded < 2; ++loaded) {
        sphm_parameters p = heavy_bar();
        p.passive_compressive_stiffness = 3e5;
        const Muscle muscle = make(p);
        load(muscle, SPHM_END_INSERTION, loaded ? 8 : 0.5);
        ASSERT_EQ(sphm_muscle_activate(muscle.get(), 0.3, 0, nullptr), SPHM_OK);
        proceed(muscle, 0.5);
        const sphm_observation o = observe(muscle);
        shortening[loaded] = o.shortening;
        EXPECT_NEAR(o.force_N, loaded ? 8 : 0.5, 0.02);
        EXPECT_GT(o.force_active_N, o.force_N);
        EXPECT_LT(o.normalised_fibre_length, 1 / 1.07);
    }
    EXPECT_GT(shortening[0], 0.1);
    EXPECT_GT(shortening[1], 0.02);
    EXPECT_LT(shortening[1], 0.7 * shortening[0]);
}

// Blocks are part of snapshots, and loads too.
TEST(EndBlock, SnapshotContinuesBitForBit) {
    const std::string path = testing::TempDir() + "end_block_test.snapshot";
    const Muscle first = make(bar()), second = make(bar());
    load(first, SPHM_END_INSERTION, 2, 0.1, 0.05);
    ASSERT_EQ(sphm_muscle_slide_end(first.get(), SPHM_END_ORIGIN, 0.5, nullptr), SPHM_OK);
    proceed(first, 0.01);
    sphm_context context{};
    ASSERT_EQ(sphm_muscle_save(first.get(), path.c_str(), &context), SPHM_OK) << context.message;
    ASSERT_EQ(sphm_muscle_load(second.get(), path.c_str(), &context), SPHM_OK) << context.message;
    std::remove(path.c_str());
    EXPECT_EQ(sphm_muscle_end_condition(second.get(), SPHM_END_ORIGIN, nullptr), SPHM_END_SLIDING);
    proceed(first, 0.02);
    proceed(second, 0.02);
    EXPECT_EQ(sphm_muscle_hash(first.get()), sphm_muscle_hash(second.get()));
    EXPECT_EQ(end_pose(first, 1).orientation[2], end_pose(second, 1).orientation[2]);
}

TEST(EndBlock, ThreadsDoNotChangeABit) {
    uint64_t hash[2];
    for (int threads = 1; threads <= 2; ++threads) {
        sphm_parameters p = bar();
        p.threads = threads;
        const Muscle muscle = make(p);
        load(muscle, SPHM_END_INSERTION, 2, 0.1, 0.05);
        proceed(muscle, 0.02);
        hash[threads - 1] = sphm_muscle_hash(muscle.get());
    }
    EXPECT_EQ(hash[0], hash[1]);
}

TEST(EndBlock, BadLoadsAreRefusedByName) {
    const Muscle muscle = make(bar());
    const double bad[3] = {1, NAN, 0}, good[3] = {1, 0, 0};
    sphm_context context{};
    EXPECT_EQ(sphm_muscle_set_end_load(muscle.get(), 1, bad, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_NE(std::string(context.message).find("nan"), std::string::npos);
    EXPECT_EQ(sphm_muscle_set_end_load(muscle.get(), 2, good, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_slide_end(muscle.get(), 0, INFINITY, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_end_condition(muscle.get(), 0, nullptr), SPHM_END_HELD);
    EXPECT_EQ(sphm_muscle_end_condition(muscle.get(), 5, nullptr), -1);
    sphm_parameters p = bar();
    p.attachment_fraction = 0;
    const Muscle floating = make(p);
    EXPECT_EQ(sphm_muscle_set_end_load(floating.get(), 0, good, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_NE(std::string(context.message).find("attachment_fraction"), std::string::npos);
    p = bar();
    p.tissue = SPHM_TISSUE_FLUID;
    const Muscle fluid = make(p);
    EXPECT_EQ(sphm_muscle_release_end(fluid.get(), 0, &context), SPHM_REFUSED_UNSUPPORTED);
}

} // namespace
