// Looks at a muscle on an emulated device: what is reduced and packed there, on a second stream, is what the
// host's observer makes of the same state, of the moment the look began, and the steps do not wait for it.

#include "emulated_muscle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/observer.h"

namespace {

struct Seen {
    sphm_observation observation{};
    std::vector<float> particles;
};

std::vector<float> copied(const sphm_particles &p) {
    // The arrays lie one behind the other, from the positions on.
    return std::vector<float>(p.position_m, p.position_m + SPHM_LOOK_FIELDS * p.count);
}

// By the host, from the state as it is downloaded.
Seen on_the_host(const Muscle &muscle) {
    Seen seen;
    sphm_context context{};
    sphm_observer *observer = nullptr;
    sphm_particles particles{};
    const sphm_state &state = muscle.state();
    EXPECT_EQ(sphm_observer_create(&muscle.handle->model, &state, &observer, &context), SPHM_OK);
    EXPECT_EQ(sphm_observer_particles(observer, &state, &particles, &context), SPHM_OK);
    seen.particles = copied(particles);
    EXPECT_EQ(sphm_observer_observe(observer, &state, &seen.observation, &context), SPHM_OK);
    sphm_observation &o = seen.observation;
    o.stimulus_uA_per_mm2 = sphm_muscle_stimulus(muscle.handle, nullptr);
    if (muscle.handle->ops->wrench) {
        EXPECT_EQ(sphm_observer_fibre_length(observer, &o.normalised_fibre_length, &context), SPHM_OK);
    }
    sphm_observer_destroy(observer);
    return seen;
}

// The fibres' stretch is summed in single precision. Both sides have the same formula, but as two copies, in
// which the compiler may fuse different products and sums: some units in the last place, 3 with sanitizers.
constexpr double kStretchRounding = 8 * std::numeric_limits<float>::epsilon();

// Every number; those of the force, which the host's observer does not make, apart.
void expect_same(const sphm_observation &a, const sphm_observation &b) {
    const double *x = reinterpret_cast<const double *>(&a), *y = reinterpret_cast<const double *>(&b);
    const size_t force = offsetof(sphm_observation, force_N) / sizeof(double),
                 after = offsetof(sphm_observation, normalised_fibre_length) / sizeof(double);
    for (size_t k = 0; k < offsetof(sphm_observation, nonfinite) / sizeof(double); ++k)
        if (k < force || k >= after) {
            EXPECT_NEAR(y[k], x[k], (k == after ? kStretchRounding : 1e-9) * std::fabs(x[k]) + 1e-15)
                << "number " << k;
        }
    EXPECT_EQ(a.nonfinite, b.nonfinite);
}

// Fields of particles; the last number a particle is the stretch.
void expect_same(const std::vector<float> &a, const std::vector<float> &b) {
    ASSERT_EQ(a.size(), b.size());
    for (size_t k = 0; k < a.size(); ++k) {
        const double rounding =
            SPHM_LOOK_FIELDS * k < (SPHM_LOOK_FIELDS - 1) * a.size() ? 2e-7 : kStretchRounding;
        ASSERT_NEAR(b[k], a[k], rounding * std::fabs(a[k]) + 1e-12) << "number " << k;
    }
}

void steps(Muscle &muscle, int count) {
    ASSERT_EQ(sphm_muscle_advance(muscle.handle, 2e-5 * count, &muscle.context), SPHM_OK)
        << muscle.context.message;
}

// Under way, bent, turned and excited unevenly, so that no number is zero by chance.
void set_moving(Muscle &muscle) {
    const sphm_body *body = sphm_muscle_body(muscle.handle);
    ASSERT_EQ(sphm_muscle_stimulate(muscle.handle, "origin", 8000, 0, nullptr), SPHM_OK);
    const double force[3] = {0.3, 1, 2};
    ASSERT_EQ(sphm_muscle_apply_force(muscle.handle, body->insertion_m, force, 0.05, 0, nullptr), SPHM_OK);
    ASSERT_EQ(sphm_muscle_release_end(muscle.handle, SPHM_END_INSERTION, nullptr), SPHM_OK);
    steps(muscle, 150);
}

Muscle::Settings fluid(const char *particles = "500") {
    return {{"tissue", "fluid"}, {"particles", particles}, {"time_step", "1e-4"}};
}

void fluid_steps(Muscle &muscle, int count) {
    ASSERT_EQ(sphm_muscle_advance(muscle.handle, 1e-4 * count, &muscle.context), SPHM_OK)
        << muscle.context.message;
}

// Long enough for particles to have been sorted anew.
void set_fluid_moving(Muscle &muscle) {
    const double force[3] = {0.3, 1, 2}, middle[3] = {0, 0, 0};
    ASSERT_EQ(sphm_muscle_stimulate(muscle.handle, "origin", 8000, 0, nullptr), SPHM_OK);
    ASSERT_EQ(sphm_muscle_apply_force(muscle.handle, middle, force, 0.05, 0, nullptr), SPHM_OK);
    fluid_steps(muscle, 250);
    ASSERT_GT(sphm_muscle_timing(muscle.handle).neighbour_rebuilds, 1u);
}

// The same of a fluid, whose slots are not in the order of ids and change; it has no wrench.
TEST(DeviceLook, SeesOfAFluidWhatTheHostSees) {
    Emulated gpu(fluid());
    set_fluid_moving(gpu);
    const uint64_t hash = sphm_muscle_hash(gpu.handle);
    Seen expected = on_the_host(gpu);
    sphm_observation observation{};
    sphm_particles particles{};
    ASSERT_EQ(sphm_muscle_observe(gpu.handle, &observation, nullptr), SPHM_OK);
    expect_same(expected.observation, observation);
    EXPECT_GT(observation.displacement_mean_m, 1e-5);
    ASSERT_EQ(sphm_muscle_particles(gpu.handle, &particles, nullptr), SPHM_OK);
    expect_same(expected.particles, copied(particles));
    EXPECT_GT(*std::max_element(particles.pressure_Pa, particles.pressure_Pa + particles.count), 1);
    EXPECT_EQ(sphm_muscle_hash(gpu.handle), hash) << "looking changed something";
    EXPECT_GT(sphm_muscle_timing(gpu.handle).memory_bytes, 500u * (153 + 160));
    // While the next one takes its time, particles are sorted anew: it is of the moment it began at.
    fluid_steps(gpu, 20);
    expected = on_the_host(gpu);
    emulated::patience() = 3;
    Seen found;
    const uint64_t rebuilds = sphm_muscle_timing(gpu.handle).neighbour_rebuilds;
    for (int k = 0; k < 5; ++k) { // begins one, asks three times in vain, gets it
        ASSERT_EQ(sphm_muscle_glance(gpu.handle, &particles, &found.observation, nullptr), SPHM_OK);
        found.particles = copied(particles);
        if (k < 4) {
            EXPECT_EQ(found.observation.time_s, observation.time_s) << "waited";
        }
        fluid_steps(gpu, 60);
    }
    EXPECT_GT(sphm_muscle_timing(gpu.handle).neighbour_rebuilds, rebuilds);
    expect_same(expected.observation, found.observation);
    expect_same(expected.particles, found.particles);
}

TEST(DeviceLook, SurvivesADeviceThatFailsWithAFluid) {
    int failed = 0;
    for (int allowed = 0;; ++allowed) {
        Emulated gpu(fluid("60"));
        sphm_observation found{};
        sphm_particles particles{};
        ASSERT_NE(sphm_muscle_observer(gpu.handle, nullptr), nullptr);
        fluid_steps(gpu, 1); // so that the state is not on the host
        emulated::requests_left() = allowed;
        ASSERT_EQ(sphm_muscle_glance(gpu.handle, &particles, &found, nullptr), SPHM_OK);
        emulated::requests_left() = -1;
        if (!std::isnan(found.displacement_mean_m))
            break;
        ++failed;
        EXPECT_TRUE(std::isnan(particles.position_m[0])) << allowed;
        EXPECT_EQ(sphm_muscle_advance(gpu.handle, 1e-4, &gpu.context), SPHM_FAILED_BACKEND);
    }
    EXPECT_EQ(failed, 21); // every launch, every copy, what marks and waits
}

// Too little memory for looks: the host looks.
TEST(DeviceLook, LeavesAFluidToTheHostWithoutMemory) {
    Emulated gpu(fluid());
    set_fluid_moving(gpu);
    sphm_observation found{};
    emulated::memory_limit() = 1000;
    ASSERT_EQ(sphm_muscle_glance(gpu.handle, nullptr, &found, nullptr), SPHM_OK);
    emulated::memory_limit() = SIZE_MAX;
    expect_same(on_the_host(gpu).observation, found);
    fluid_steps(gpu, 1);
}

TEST(DeviceLook, SeesWhatTheHostSees) {
    Emulated gpu(solid());
    set_moving(gpu);
    const uint64_t hash = sphm_muscle_hash(gpu.handle);
    const Seen expected = on_the_host(gpu);
    sphm_observation observation{};
    sphm_particles particles{};
    ASSERT_EQ(sphm_muscle_observe(gpu.handle, &observation, nullptr), SPHM_OK);
    expect_same(expected.observation, observation);
    EXPECT_GT(observation.displacement_mean_m, 1e-6);
    EXPECT_GT(observation.speed_max_m_per_s, 1e-3);
    EXPECT_NE(observation.normalised_fibre_length, 1);
    ASSERT_EQ(sphm_muscle_particles(gpu.handle, &particles, nullptr), SPHM_OK);
    expect_same(expected.particles, copied(particles));
    EXPECT_EQ(sphm_muscle_hash(gpu.handle), hash) << "looking changed something";
    // The force is that of the wrench.
    sphm_wrench wrench{};
    sphm_end_pose ends[2];
    ASSERT_EQ(sphm_muscle_wrench(gpu.handle, SPHM_END_INSERTION, &wrench, nullptr), SPHM_OK);
    for (int end = 0; end < 2; ++end)
        ASSERT_EQ(sphm_muscle_end_pose(gpu.handle, end, &ends[end], nullptr), SPHM_OK);
    double line[3], length = 0, force = 0;
    for (int d = 0; d < 3; ++d) {
        line[d] = ends[0].position_m[d] - ends[1].position_m[d];
        length += line[d] * line[d];
    }
    for (int d = 0; d < 3; ++d)
        force += wrench.force_N[d] * line[d] / std::sqrt(length);
    EXPECT_GT(std::fabs(force), 1e-4);
    EXPECT_DOUBLE_EQ(observation.force_N, force);
    EXPECT_DOUBLE_EQ(observation.attachment_distance_m, std::sqrt(length));
}

// Also the skin, which is draped over the places that came with the particles.
TEST(DeviceLook, DrapesTheSameSkin) {
    Emulated gpu(solid());
    set_moving(gpu);
    sphm_observer *observer = nullptr;
    sphm_skin a{}, b{};
    const sphm_state &state = gpu.state();
    ASSERT_EQ(sphm_observer_create(&gpu.handle->model, &state, &observer, nullptr), SPHM_OK);
    ASSERT_EQ(sphm_observer_skin(observer, &state, SPHM_FIELD_PRESSURE, &a, nullptr), SPHM_OK);
    ASSERT_EQ(sphm_muscle_skin(gpu.handle, SPHM_FIELD_PRESSURE, &b, nullptr), SPHM_OK);
    ASSERT_EQ(a.vertex_count, b.vertex_count);
    for (size_t k = 0; k < 3 * a.vertex_count; ++k)
        ASSERT_NEAR(a.vertices_m[k], b.vertices_m[k], 1e-8) << k;
    for (size_t k = 0; k < a.vertex_count; ++k)
        ASSERT_NEAR(a.field[k], b.field[k], 1e-6 * std::fabs(a.field[k]) + 1e-9) << k;
    sphm_observer_destroy(observer);
    EXPECT_EQ(sphm_muscle_skin(gpu.handle, SPHM_FIELD_COUNT, &b, &gpu.context), SPHM_REFUSED_ARGUMENT);
}

// A glance hands out what has finished, while the muscle goes on, however long the next one takes; and what
// it then shows is the moment at which it began.
TEST(DeviceLook, DoesNotHoldUpTheSteps) {
    Emulated gpu(solid());
    set_moving(gpu);
    const Seen first = on_the_host(gpu);
    Seen found;
    sphm_particles particles{};
    const auto glance = [&] {
        ASSERT_EQ(sphm_muscle_glance(gpu.handle, &particles, &found.observation, nullptr), SPHM_OK);
        found.particles = copied(particles);
    };
    glance(); // there was none before: it is waited for
    expect_same(first.observation, found.observation);
    steps(gpu, 40);
    const Seen second = on_the_host(gpu);
    emulated::patience() = 1000;
    glance(); // begins the second one, and still shows the first
    expect_same(first.observation, found.observation);
    for (int k = 0; k < 5; ++k) {
        steps(gpu, 40);
        glance();
        expect_same(first.observation, found.observation);
        expect_same(first.particles, found.particles);
    }
    EXPECT_EQ(emulated::patience(), 995); // asked five times, never waited
    emulated::patience() = 0;
    const Seen third = on_the_host(gpu);
    ASSERT_GT(std::fabs(third.observation.displacement_max_m - second.observation.displacement_max_m), 1e-6);
    glance();
    expect_same(second.observation, found.observation);
    expect_same(second.particles, found.particles);
    EXPECT_EQ(found.observation.time_s, second.observation.time_s);
    sphm_skin late{}, now{};
    emulated::patience() = 1000; // the third has begun
    ASSERT_EQ(sphm_muscle_glance_skin(gpu.handle, SPHM_FIELD_DISPLACEMENT, &late, nullptr), SPHM_OK);
    EXPECT_EQ(sphm_muscle_glance_time(gpu.handle), second.observation.time_s);
    emulated::patience() = 0;
    const std::vector<float> late_m(late.vertices_m, late.vertices_m + 3 * late.vertex_count);
    glance();
    expect_same(third.observation, found.observation);
    // Whoever does not want to be late gets the present, and waits for it.
    ASSERT_EQ(sphm_muscle_skin(gpu.handle, SPHM_FIELD_DISPLACEMENT, &now, nullptr), SPHM_OK);
    double moved = 0;
    for (size_t k = 0; k < late_m.size(); ++k)
        moved = std::fmax(moved, std::fabs(static_cast<double>(now.vertices_m[k] - late_m[k])));
    EXPECT_GT(moved, 1e-6);
}

// Nothing of before a reset or a restored state is shown after it.
TEST(DeviceLook, ForgetsWhatWasBefore) {
    Emulated gpu(solid()), other(solid());
    set_moving(gpu);
    steps(other, 10);
    sphm_observation found{};
    ASSERT_EQ(sphm_muscle_glance(gpu.handle, nullptr, &found, nullptr), SPHM_OK);
    steps(gpu, 10);
    emulated::patience() = 1000;
    ASSERT_EQ(sphm_muscle_glance(gpu.handle, nullptr, &found, nullptr), SPHM_OK); // one is under way
    ASSERT_EQ(sphm_muscle_restore(gpu.handle, &other.state(), &gpu.context), SPHM_OK);
    ASSERT_EQ(sphm_muscle_glance(gpu.handle, nullptr, &found, nullptr), SPHM_OK);
    emulated::patience() = 0;
    expect_same(on_the_host(gpu).observation, found);
    EXPECT_NEAR(found.time_s, 2e-4, 1e-12);
    // Particles that no look has brought yet are waited for.
    sphm_particles particles{};
    ASSERT_EQ(sphm_muscle_glance(gpu.handle, &particles, nullptr, nullptr), SPHM_OK);
    expect_same(on_the_host(gpu).particles, copied(particles));
}

TEST(DeviceLook, GivesTheSameBitsInAnyOrder) {
    Emulated gpu(solid());
    set_moving(gpu);
    sphm_observation found[2];
    for (int backwards = 0; backwards < 2; ++backwards) {
        ++gpu.handle->changes; // or it would not look again
        emulated::backwards() = backwards != 0;
        ASSERT_EQ(sphm_muscle_observe(gpu.handle, &found[backwards], nullptr), SPHM_OK);
        emulated::backwards() = false;
    }
    EXPECT_EQ(memcmp(&found[0], &found[1], sizeof found[0]), 0);
}

// Whatever request fails: the numbers are NaN or right, and the muscle says so when it is stepped again.
TEST(DeviceLook, SurvivesADeviceThatFails) {
    int failed = 0;
    for (int allowed = 0;; ++allowed) {
        Emulated gpu(solid({{"particles", "60"}}));
        sphm_observation found{};
        sphm_particles particles{};
        steps(gpu, 33);
        ASSERT_NE(sphm_muscle_observer(gpu.handle, nullptr), nullptr);
        steps(gpu, 1); // so that the state is not on the host
        emulated::requests_left() = allowed;
        ASSERT_EQ(sphm_muscle_glance(gpu.handle, &particles, &found, nullptr), SPHM_OK);
        emulated::requests_left() = -1;
        if (!std::isnan(found.displacement_mean_m)) {
            EXPECT_FALSE(std::isnan(particles.position_m[0]));
            break;
        }
        ++failed;
        EXPECT_TRUE(std::isnan(particles.position_m[0])) << allowed;
        EXPECT_EQ(sphm_muscle_advance(gpu.handle, 2e-5, &gpu.context), SPHM_FAILED_BACKEND);
    }
    EXPECT_EQ(failed, 31); // every launch, every copy, what marks and waits
}

// Too little memory for looks: the host looks, as it did before there were any.
TEST(DeviceLook, LeavesItToTheHostWithoutMemory) {
    Emulated gpu(solid());
    set_moving(gpu);
    sphm_observation found{};
    emulated::memory_limit() = 1000;
    ASSERT_EQ(sphm_muscle_glance(gpu.handle, nullptr, &found, nullptr), SPHM_OK);
    emulated::memory_limit() = SIZE_MAX;
    expect_same(on_the_host(gpu).observation, found);
    steps(gpu, 1);
}

// On the CPU a glance shows the present.
TEST(DeviceLook, IsThePresentOnTheCpu) {
    Muscle cpu(solid());
    sphm_observation glanced{}, observed{};
    sphm_particles particles{};
    for (int k = 0; k < 2; ++k) {
        steps(cpu, 10);
        ASSERT_EQ(sphm_muscle_glance(cpu.handle, &particles, &glanced, nullptr), SPHM_OK);
        ASSERT_EQ(sphm_muscle_observe(cpu.handle, &observed, nullptr), SPHM_OK);
        EXPECT_EQ(memcmp(&glanced, &observed, sizeof observed), 0);
        EXPECT_EQ(particles.count, cpu.count());
        EXPECT_EQ(sphm_muscle_glance_time(cpu.handle), sphm_muscle_time(cpu.handle));
    }
}

} // namespace
