// The CUDA back end of the solid tissue on an emulated device: layout, launches, submissions and operations
// of the real one, with the same threads, against the CPU back end. What only a device can show is in
// cuda/parity.c.

#include "emulated_muscle.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/muscle.h"

namespace {

// By id, one vector an array.
std::map<std::string, std::vector<double>> arrays(const Muscle &muscle) {
    enum { STATE = 1, REST = 0, SCRATCH = 0 };
    std::map<std::string, std::vector<double>> all;
    const sphm_state &s = muscle.state();
#define ARRAY(type, name, role, unit, meaning)                                                               \
    if (role) {                                                                                              \
        std::vector<double> &one = all[#name];                                                               \
        one.resize(s.count);                                                                                 \
        for (size_t slot = 0; slot < s.count; ++slot)                                                        \
            one[static_cast<size_t>(s.id[slot])] = static_cast<double>(s.name[slot]);                        \
    }
#include "core/state_arrays.inc"
#undef ARRAY
    return all;
}

// Largest difference of every array, as a share of the scale of that array: of displacements, velocities and
// pressures the largest magnitude (the three components together), else what the quantity ranges over.
void expect_close(const Muscle &cpu, const Muscle &gpu, double tolerance) {
    const auto a = arrays(cpu), b = arrays(gpu);
    std::map<std::string, double> scale = {
        {"density", 1112}, {"membrane_potential", 100}, {"recovery", 1}, {"activation", 1}};
    const auto range = [&](const std::vector<std::string> &names) {
        double largest = 1e-30;
        for (const auto &name : names)
            for (double value : a.at(name))
                largest = std::fmax(largest, std::fabs(value));
        for (const auto &name : names)
            scale[name] = largest;
    };
    range({"shift_x", "shift_y", "shift_z"});
    range({"vx", "vy", "vz"});
    range({"pressure"});
    range({"fibre_rate"});
    range({"x", "y", "z"});
    for (const auto &entry : a) {
        const auto &other = b.at(entry.first);
        const double unit = scale.count(entry.first) ? scale[entry.first] : 0; // 0: equal to the bit
        double worst = 0;
        for (size_t i = 0; i < other.size(); ++i) {
            ASSERT_TRUE(std::isfinite(other[i])) << entry.first << " of particle " << i;
            worst = std::fmax(worst, std::fabs(other[i] - entry.second[i]));
        }
        EXPECT_LE(worst, tolerance * unit) << entry.first << ", scale " << unit;
        if (unit > 0 && getenv("SPHM_SHOW"))
            printf("%20s %.2e\n", entry.first.c_str(), worst / unit);
    }
    EXPECT_NEAR(cpu.state().time_s, gpu.state().time_s,
                1e-15); // what is left is divided more often on the CPU
    EXPECT_EQ(cpu.state().steps, gpu.state().steps);
    EXPECT_NEAR(cpu.state().diffusion_due_s, gpu.state().diffusion_due_s, 1e-15);
}

void run(Muscle &muscle, size_t steps) {
    ASSERT_EQ(sphm_muscle_advance(muscle.handle, 2e-5 * double(steps), &muscle.context), SPHM_OK)
        << muscle.context.message;
}

TEST(EmulatedSolid, IsTheCpuAtRest) {
    Muscle cpu(solid());
    Emulated gpu(solid());
    const sphm_real *volume = cpu.state().relative_volume; // uneven, so that all of these tests have them so
    EXPECT_LT(*std::min_element(volume, volume + cpu.count()), 0.7);
    EXPECT_GT(*std::max_element(volume, volume + cpu.count()), 1.3);
    expect_close(cpu, gpu, 1e-6);
    const sphm_time_step_limits a = sphm_muscle_time_step_limits(cpu.handle),
                                b = sphm_muscle_time_step_limits(gpu.handle);
    EXPECT_NEAR(b.smallest, a.smallest, 1e-6 * a.smallest);
    EXPECT_NEAR(b.acoustic, a.acoustic, 1e-6 * a.acoustic);
    EXPECT_EQ(b.viscous, a.viscous);
    EXPECT_GT(sphm_muscle_timing(gpu.handle).neighbours_per_particle, 20);
    EXPECT_EQ(sphm_muscle_timing(gpu.handle).neighbours_per_particle,
              sphm_muscle_timing(cpu.handle).neighbours_per_particle);
}

// Stimulated ends, so that the wave, the diffusion's waiting and the electrodes all take part. Rounding
// differs (order of the row sums, fused operations) and a contracting muscle amplifies it little by little.
TEST(EmulatedSolid, FollowsTheCpuFor500Steps) {
    Muscle cpu(solid());
    Emulated gpu(solid());
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)})
        ASSERT_EQ(sphm_muscle_stimulate(muscle->handle, "both", 8000, 0, nullptr), SPHM_OK);
    emulated::submissions_played() = 0;
    run(cpu, 500);
    run(gpu, 500);
    EXPECT_GE(emulated::submissions_played(), 12);
    expect_close(cpu, gpu, 2e-5);
}

// The start-up phase needs nothing of a back end that others do not: pre-stretch settles to the same forces.
TEST(EmulatedSolid, StartsUpAsTheCpuDoes) {
    const Muscle::Settings settings = solid({{"initial_stretch", "1.05"}});
    Muscle cpu(settings);
    Emulated gpu(settings);
    sphm_wrench wrenches[2];
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        EXPECT_FALSE(sphm_muscle_ready(muscle->handle));
        ASSERT_EQ(sphm_muscle_start_up(muscle->handle, 10, nullptr), SPHM_OK);
        EXPECT_TRUE(sphm_muscle_ready(muscle->handle));
        EXPECT_EQ(sphm_muscle_time(muscle->handle), 0);
        sphm_wrench *w = &wrenches[muscle != &cpu];
        ASSERT_EQ(sphm_muscle_wrench(muscle->handle, SPHM_END_INSERTION, w, nullptr), SPHM_OK);
    }
    EXPECT_LT(wrenches[0].force_N[0], -0.1);
    EXPECT_NEAR(wrenches[1].force_N[0], wrenches[0].force_N[0], -0.01 * wrenches[0].force_N[0]);
}

// Everything that acts on a muscle at once.
TEST(EmulatedSolid, FollowsTheCpuUnderEveryCommand) {
    const Muscle::Settings settings = solid({{"gravity", "[0.3, 0, -9.81]"},
                                             {"settle_time", "0"},
                                             {"velocity_damping", "20"},
                                             {"mass_scaling", "2"},
                                             {"anisotropy_ratio", "4"},
                                             {"fibres", "pennate"},
                                             {"pennation_angle", "15"},
                                             {"force_velocity", "hill"},
                                             {"surface_pressure", "200"}});
    Muscle cpu(settings);
    Emulated gpu(settings);
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        sphm_muscle *m = muscle->handle;
        const sphm_body *body = sphm_muscle_body(m);
        ASSERT_EQ(sphm_muscle_stimulate(m, "origin", 8000, 1e-3, nullptr), SPHM_OK);
        run(*muscle, 100);
        const double force[3] = {0, 1, 2};
        double middle[3];
        for (int d = 0; d < 3; ++d)
            middle[d] = (body->origin_m[d] + body->insertion_m[d]) / 2;
        ASSERT_EQ(sphm_muscle_apply_force(m, middle, force, 0.02, 2e-3, nullptr), SPHM_OK);
        run(*muscle, 60);
        ASSERT_EQ(sphm_muscle_activate(m, 0.4, 4e-3, nullptr), SPHM_OK);
        sphm_end_pose pose{};
        memcpy(pose.position_m, body->insertion_m, sizeof pose.position_m);
        pose.position_m[0] -= 1e-3;
        pose.orientation[2] = std::sin(0.02);
        pose.orientation[3] = std::cos(0.02);
        ASSERT_EQ(sphm_muscle_set_end_pose(m, SPHM_END_INSERTION, &pose, 3e-3, &muscle->context), SPHM_OK)
            << muscle->context.message;
        run(*muscle, 340);
    }
    expect_close(cpu, gpu, 2e-5);
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        sphm_wrench a{}, b{};
        const uint64_t before = sphm_muscle_hash(gpu.handle);
        ASSERT_EQ(sphm_muscle_wrench(cpu.handle, end, &a, nullptr), SPHM_OK);
        ASSERT_EQ(sphm_muscle_wrench(gpu.handle, end, &b, nullptr), SPHM_OK);
        EXPECT_EQ(sphm_muscle_hash(gpu.handle), before) << "looking changed something";
        const double *of_cpu = reinterpret_cast<const double *>(&a),
                     *of_gpu = reinterpret_cast<const double *>(&b);
        double newton = 0, newton_metre = 0; // scales
        for (int d = 0; d < 3; ++d) {
            newton = std::fmax(newton, std::fabs(a.force_N[d]));
            newton_metre = std::fmax(newton_metre, std::fabs(a.moment_Nm[d]));
        }
        EXPECT_GT(newton, 1e-3);
        for (size_t k = 0; k < sizeof a / sizeof(double); ++k) {
            const bool moment = (k >= 3 && k < 6) || k >= 15;
            EXPECT_NEAR(of_gpu[k], of_cpu[k], 1e-4 * (moment ? newton_metre : newton)) << "number " << k;
        }
    }
}

void expect_same_end(const Muscle &cpu, const Muscle &gpu, int end, double tolerance) {
    const sphm_end_body &a = cpu.state().ends[end], &b = gpu.state().ends[end];
    const auto near = [&](const double *x, const double *y, int n, const char *what) {
        double largest = 0, worst = 0;
        for (int k = 0; k < n; ++k) {
            largest = std::fmax(largest, std::fabs(x[k]));
            worst = std::fmax(worst, std::fabs(x[k] - y[k]));
        }
        EXPECT_LE(worst, tolerance * largest) << what << " of end " << end;
    };
    near(a.shift_m, b.shift_m, 3, "shift");
    near(a.rotation, b.rotation, 9, "rotation");
    near(a.velocity_m_per_s, b.velocity_m_per_s, 3, "velocity");
    near(a.momentum_Nms, b.momentum_Nms, 3, "momentum");
}

// Ends that forces move: one hangs on a load and then slides, the other on a bone that moves, through a
// tendon.
TEST(EmulatedSolid, FollowsTheCpuWithEndsThatForcesMove) {
    const Muscle::Settings settings = solid({{"gravity", "[0, 0, -9.81]"},
                                             {"settle_time", "0"},
                                             {"tendon_ends", "origin"},
                                             {"tendon_stiffness", "2e4"},
                                             {"tendon_slack_length", "0.05"}});
    Muscle cpu(settings);
    Emulated gpu(settings);
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        sphm_muscle *m = muscle->handle;
        const sphm_end_block &block = m->model.ends[SPHM_END_ORIGIN];
        const sphm_body *body = sphm_muscle_body(m);
        double bone[3];
        for (int d = 0; d < 3; ++d)
            bone[d] = block.point_m[d] + block.axis[d] * (block.tendon_slack_m + 1e-3);
        sphm_end_motion_rest(&m->solid.ends[SPHM_END_ORIGIN].motion, bone);
        const double load[3] = {2, 0.5, 0.1};
        ASSERT_EQ(sphm_muscle_set_end_load(m, SPHM_END_INSERTION, load, &muscle->context), SPHM_OK);
        ASSERT_EQ(sphm_muscle_activate(m, 0.2, 0, nullptr), SPHM_OK);
        run(*muscle, 150);
        ASSERT_EQ(sphm_muscle_slide_end(m, SPHM_END_INSERTION, 1, &muscle->context), SPHM_OK);
        sphm_end_pose pose{};
        for (int d = 0; d < 3; ++d) // away from the muscle and aside: a slack tendon would show nothing
            pose.position_m[d] = bone[d] + 1e-3 * block.axis[d] + (d ? 5e-4 : 0);
        pose.orientation[3] = 1;
        ASSERT_EQ(sphm_muscle_set_end_pose(m, SPHM_END_ORIGIN, &pose, 2e-3, &muscle->context), SPHM_OK)
            << muscle->context.message;
        const double force[3] = {1, 0, 1};
        ASSERT_EQ(sphm_muscle_apply_force(m, body->insertion_m, force, 0.02, 1e-3, nullptr), SPHM_OK);
        run(*muscle, 150);
        EXPECT_GT(std::fabs(muscle->state().ends[SPHM_END_INSERTION].shift_m[0]), 1e-5);
        EXPECT_GT(std::fabs(muscle->state().ends[SPHM_END_ORIGIN].shift_m[0]), 1e-5);
    }
    expect_close(cpu, gpu, 2e-5);
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        expect_same_end(cpu, gpu, end, 2e-5);
        sphm_wrench a{}, b{};
        ASSERT_EQ(sphm_muscle_wrench(cpu.handle, end, &a, nullptr), SPHM_OK);
        ASSERT_EQ(sphm_muscle_wrench(gpu.handle, end, &b, nullptr), SPHM_OK);
        const double scale = std::fabs(a.force_N[0]);
        EXPECT_GT(scale, 0.1);
        for (int d = 0; d < 3; ++d)
            EXPECT_NEAR(b.force_N[d], a.force_N[d], 1e-4 * scale) << end << d;
    }
    // The blocks are part of what goes from one back end to the other.
    ASSERT_EQ(sphm_muscle_restore(gpu.handle, &cpu.state(), &gpu.context), SPHM_OK);
    run(cpu, 40);
    run(gpu, 40);
    expect_close(cpu, gpu, 2e-5);
    expect_same_end(cpu, gpu, SPHM_END_INSERTION, 2e-5);
}

// Several diffusions a step: the launches that other tests do not need. A long step is allowed by heavy
// particles.
TEST(EmulatedSolid, DividesTheMembrane) {
    const Muscle::Settings settings = solid({{"reaction_step", "0.01"},
                                             {"time_step", "5e-5"},
                                             {"conduction_velocity", "4"},
                                             {"mass_scaling", "10"}});
    Muscle cpu(settings);
    Emulated gpu(settings);
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        ASSERT_EQ(sphm_muscle_stimulate(muscle->handle, "insertion", 8000, 0, nullptr), SPHM_OK);
        run(*muscle, 250);
        EXPECT_EQ(sphm_muscle_steps(muscle->handle), 100u);
    }
    expect_close(cpu, gpu, 2e-5);
}

// The same bits whatever order the threads come in, and however many steps a submission has.
TEST(EmulatedSolid, DoesNotDependOnOrderOrSubmission) {
    uint64_t hashes[3];
    for (int variant = 0; variant < 3; ++variant) {
        Emulated gpu(solid());
        ASSERT_EQ(sphm_muscle_stimulate(gpu.handle, "origin", 8000, 0, nullptr), SPHM_OK);
        ASSERT_EQ(sphm_muscle_activate(gpu.handle, 0.2, 1e-3, nullptr), SPHM_OK);
        emulated::backwards() = variant == 1;
        sphm_drive drive{};
        drive.driven[SPHM_ELECTRODE_ORIGIN] = 1;
        drive.current_uA_per_mm2[SPHM_ELECTRODE_ORIGIN] = 8000;
        memcpy(drive.ends, gpu.handle->solid.ends, sizeof drive.ends);
        const size_t at_a_time = variant == 2 ? 1 : 70; // 70: two full submissions and the rest
        for (size_t done = 0; done < 70; done += at_a_time)
            ASSERT_EQ(gpu.handle->ops->step(gpu.handle->backend, at_a_time, 2e-5, &drive, nullptr), SPHM_OK);
        emulated::backwards() = false;
        hashes[variant] = sphm_muscle_hash(gpu.handle);
        EXPECT_EQ(sphm_muscle_steps(gpu.handle), 70u);
    }
    EXPECT_EQ(hashes[1], hashes[0]);
    EXPECT_EQ(hashes[2], hashes[0]);
}

// With the step the limits allow, which changes as the muscle stiffens, and a drive that could not be harder.
TEST(EmulatedSolid, StaysStableWithTheAutomaticStep) {
    const Muscle::Settings settings = {{"tissue", "solid"}, {"particles", "500"}};
    Muscle cpu(settings);
    Emulated gpu(settings);
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        ASSERT_EQ(sphm_muscle_activate(muscle->handle, 1, 0, nullptr), SPHM_OK);
        muscle->advance(0.02);
    }
    sphm_wrench a{}, b{};
    ASSERT_EQ(sphm_muscle_wrench(cpu.handle, SPHM_END_INSERTION, &a, nullptr), SPHM_OK);
    ASSERT_EQ(sphm_muscle_wrench(gpu.handle, SPHM_END_INSERTION, &b, nullptr), SPHM_OK);
    EXPECT_GT(std::fabs(a.force_N[0]), 50);
    EXPECT_NEAR(b.force_N[0], a.force_N[0], 0.01 * std::fabs(a.force_N[0]));
}

// A state goes from one back end to the other and goes on there; and back to the bit.
TEST(EmulatedSolid, TakesAStateFromTheCpuAndGivesItBack) {
    Muscle cpu(solid());
    Emulated gpu(solid()), twin(solid());
    ASSERT_EQ(sphm_muscle_stimulate(cpu.handle, "origin", 8000, 0, nullptr), SPHM_OK);
    run(cpu, 33); // the diffusion waits just now
    ASSERT_GT(cpu.state().diffusion_due_s, 0);
    ASSERT_EQ(sphm_muscle_restore(gpu.handle, &cpu.state(), &gpu.context), SPHM_OK) << gpu.context.message;
    expect_close(cpu, gpu, 1e-5);
    run(gpu, 40);
    EXPECT_EQ(sphm_muscle_steps(gpu.handle), 73u);
    ASSERT_EQ(sphm_muscle_restore(twin.handle, &gpu.state(), &twin.context), SPHM_OK) << twin.context.message;
    EXPECT_EQ(sphm_muscle_hash(twin.handle), sphm_muscle_hash(gpu.handle));
    run(gpu, 40);
    run(twin, 40);
    EXPECT_EQ(sphm_muscle_hash(twin.handle), sphm_muscle_hash(gpu.handle));
    const uint64_t before = sphm_muscle_hash(gpu.handle);
    Muscle other({{"tissue", "solid"}, {"particles", "300"}});
    EXPECT_EQ(sphm_muscle_restore(gpu.handle, &other.state(), &gpu.context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_hash(gpu.handle), before);
}

// The step that failed, and nothing after it: the same time and state as on the CPU, in the middle of a
// submission. Several particles turn in that step; which one is named follows the slots, which differ.
TEST(EmulatedSolid, StopsAtTheStepThatFails) {
    Muscle cpu(solid());
    Emulated gpu(solid());
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        sphm_drive drive{};
        memcpy(drive.ends, muscle->handle->solid.ends, sizeof drive.ends);
        drive.force_count = 1;
        const sphm_body *body = sphm_muscle_body(muscle->handle);
        drive.forces[0].radius_m = 0.03;
        drive.forces[0].force_N[2] = 4000;
        for (int d = 0; d < 3; ++d)
            drive.forces[0].point_m[d] = (body->origin_m[d] + body->insertion_m[d]) / 2;
        EXPECT_EQ(muscle->handle->ops->step(muscle->handle->backend, 100, 2e-5, &drive, &muscle->context),
                  SPHM_FAILED_NONFINITE);
    }
    EXPECT_NE(std::string(cpu.context.message).find("turned inside out"), std::string::npos)
        << cpu.context.message;
    const auto after_particle = [](const Muscle &muscle) {
        const std::string message = muscle.context.message;
        return message.substr(std::min(message.find(" is turned"), message.size()));
    };
    EXPECT_EQ(after_particle(gpu), after_particle(cpu));
    EXPECT_GT(sphm_muscle_steps(gpu.handle), 1u);
    EXPECT_LT(sphm_muscle_steps(gpu.handle), 100u);
    EXPECT_NE(sphm_muscle_steps(gpu.handle) % SPHM_SUBMISSION_STEPS, 0u);
    EXPECT_EQ(sphm_muscle_steps(gpu.handle), sphm_muscle_steps(cpu.handle));
    const auto a = arrays(cpu), b = arrays(gpu);
    for (const char *name : {"shift_z", "vz"}) {
        double largest = 0, worst = 0;
        for (size_t i = 0; i < a.at(name).size(); ++i) {
            largest = std::fmax(largest, std::fabs(a.at(name)[i]));
            worst = std::fmax(worst, std::fabs(b.at(name)[i] - a.at(name)[i]));
        }
        EXPECT_LE(worst, 1e-3 * largest) << name;
    }
}

// Whatever request fails, the answer is a status and a sentence, and nothing old is shown as new.
TEST(EmulatedSolid, SurvivesADeviceThatFails) {
    Muscle made(solid({{"particles", "60"}}));
    const sphm_model *model = &made.handle->model;
    const sphm_backend_ops *ops = emulated::backend_ops();
    sphm_drive drive{};
    memcpy(drive.ends, made.handle->solid.ends, sizeof drive.ends);
    int failed_in[4] = {0, 0, 0, 0};
    for (int allowed = 0;; ++allowed) {
        sphm_context context{};
        sphm_backend *backend = nullptr;
        sphm_wrench wrench{};
        int stage = 0;
        emulated::requests_left() = allowed;
        sphm_status status = ops->create(model, &backend, &context);
        if (status == SPHM_OK) {
            stage = 1;
            status = ops->step(backend, 33, 2e-5, &drive, &context);
        }
        bool nan_seen = false;
        if (status == SPHM_OK) {
            stage = 2;
            nan_seen = std::isnan(ops->view(backend)->x[0]);
            stage = nan_seen ? 2 : 3;
            ops->wrench(backend, &drive.ends[0], 0, &wrench);
            nan_seen = nan_seen || std::isnan(wrench.force_N[0]);
            status = nan_seen ? SPHM_FAILED_BACKEND : SPHM_OK;
        } else {
            EXPECT_EQ(status, SPHM_FAILED_BACKEND) << allowed;
            EXPECT_STREQ(context.message, "the emulated device has failed") << allowed;
        }
        if (status != SPHM_OK) {
            ++failed_in[stage];
            EXPECT_EQ(backend == nullptr, stage == 0) << allowed;
            if (backend) {
                EXPECT_EQ(ops->step(backend, 1, 2e-5, &drive, &context), SPHM_FAILED_BACKEND);
                // What was seen before the device failed is still true.
                EXPECT_EQ(std::isnan(ops->view(backend)->x[0]), stage < 3) << allowed;
                EXPECT_EQ(ops->restore(backend, &made.state(), &context), SPHM_FAILED_BACKEND);
            }
        }
        emulated::requests_left() = -1;
        ops->destroy(backend);
        if (status == SPHM_OK)
            break;
    }
    EXPECT_GT(failed_in[0], 20);
    EXPECT_GT(failed_in[1], 60); // every launch that is recorded, every copy
    EXPECT_EQ(failed_in[2], 8);
    EXPECT_EQ(failed_in[3], 11);
}

TEST(EmulatedSolid, RefusesWhatDoesNotFit) {
    Muscle made(solid());
    sphm_context context{};
    sphm_backend *backend = nullptr;
    emulated::memory_limit() = 100000;
    EXPECT_EQ(emulated::create(&made.handle->model, &backend, &context), SPHM_REFUSED_MEMORY);
    emulated::memory_limit() = SIZE_MAX;
    EXPECT_EQ(backend, nullptr);
    EXPECT_STREQ(context.message, "100000 bytes are free");
}

} // namespace
