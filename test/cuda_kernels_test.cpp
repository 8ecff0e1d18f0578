// The .cu files themselves, compiled for the host: kernels, launches and the use of CUDA's runtime, on a shim
// of it (cuda_shim.h). cuda_solid_test.cpp proves what a thread does; this proves that the kernels do it, for
// the right particles, and that whatever call fails ends in a status, with everything freed.

#include "cuda_shim.h"
#include "emulated_device.h"
#include "muscles.h"

#define sphm_cuda_fluid_backend shim_fluid_backend // the library may have the real ones
#define sphm_cuda_solid_backend shim_solid_backend
#include "cuda/device.cu"
#include "cuda/fluid_launch.cu"
#include "cuda/look_launch.cu"
#include "cuda/solid_launch.cu"
#include "cuda/sort.cu"

#include <cmath>

namespace {

// Not a multiple of 32, so that the last block has idle lanes.
Muscle::Settings settings() {
    return {{"tissue", "solid"}, {"particles", "70"}, {"smoothing_ratio", "2.2"}};
}

void use(Muscle &muscle, const sphm_backend_ops *ops) {
    muscle.handle->ops->destroy(muscle.handle->backend);
    muscle.handle->backend = nullptr;
    muscle.handle->ops = ops;
    ASSERT_EQ(ops->create(&muscle.handle->model, &muscle.handle->backend, &muscle.context), SPHM_OK)
        << muscle.context.message;
}

// Everything that launches something: forces, ends of both kinds, several diffusions a step, wrenches.
void exercise(Muscle &muscle, std::vector<double> *numbers) {
    sphm_backend *backend = muscle.handle->backend;
    const sphm_backend_ops *ops = muscle.handle->ops;
    sphm_drive drive{};
    memcpy(drive.ends, muscle.handle->solid.ends, sizeof drive.ends);
    drive.driven[SPHM_ELECTRODE_ORIGIN] = 1;
    drive.current_uA_per_mm2[SPHM_ELECTRODE_ORIGIN] = 8000;
    ASSERT_EQ(ops->step(backend, 35, 2e-5, &drive, &muscle.context), SPHM_OK) << muscle.context.message;
    drive.force_count = 1;
    drive.forces[0].radius_m = 0.5;
    drive.forces[0].force_N[1] = 1;
    drive.ends[SPHM_END_INSERTION].condition = SPHM_END_LOADED;
    drive.ends[SPHM_END_INSERTION].load_N[0] = 1;
    ASSERT_EQ(ops->step(backend, 3, 2e-5, &drive, &muscle.context), SPHM_OK) << muscle.context.message;
    drive.force_count = 0;
    ASSERT_EQ(ops->step(backend, 2, 5e-4, &drive, &muscle.context), SPHM_OK) << muscle.context.message;
    *numbers = muscle.values();
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        sphm_wrench w{};
        ops->wrench(backend, &drive.ends[end], end, &w);
        numbers->insert(numbers->end(), w.force_N, w.force_N + 6);
        const double *body = ops->clock(backend)->ends[end].shift_m;
        numbers->insert(numbers->end(), body, body + sizeof(sphm_end_body) / sizeof(double));
    }
    numbers->push_back(ops->limits(backend).smallest);
}

// The same threads, the same sums: the same bits as the emulated device. Whatever order blocks and threads
// run in.
TEST(CudaKernels, DoWhatTheThreadsDo) {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the address sanitizer does not follow fibers";
#endif
    const Muscle::Settings heavy = {{"mass_scaling", "1000"}, {"reaction_step", "0.2"}};
    Muscle::Settings all = settings();
    all.insert(all.end(), heavy.begin(), heavy.end());
    std::vector<double> expected, found;
    Muscle emulated_one(all);
    use(emulated_one, emulated::backend_ops());
    exercise(emulated_one, &expected);
    ASSERT_NE(emulated_one.count() % 32, 0u);
    for (const bool backwards : {false, true}) {
        Muscle shimmed(all);
        use(shimmed, shim_solid_backend());
        shim::backwards() = backwards;
        shim::now.played = 0;
        exercise(shimmed, &found);
        shim::backwards() = false;
        EXPECT_EQ(shim::now.played, 1);
        EXPECT_STREQ(shimmed.handle->ops->device(shimmed.handle->backend), "cuda: Shim (sm_90)");
        ASSERT_EQ(found.size(), expected.size());
        for (size_t k = 0; k < found.size(); ++k)
            ASSERT_EQ(found[k], expected[k]) << "number " << k << ", backwards " << backwards;
    }
    EXPECT_EQ(shim::now.device.size() + shim::now.host.size(), 0u);
    EXPECT_EQ(shim::now.streams, 0);
    EXPECT_EQ(shim::now.graphs, 0);
    EXPECT_EQ(shim::now.events, 0);
}

// Many steps in one launch, whose blocks wait for each other after every phase: the same bits as launch by
// launch. Three blocks' worth of particles are shared by two.
TEST(CudaKernels, DoTheSameTogether) {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the address sanitizer does not follow fibers";
#endif
    Muscle::Settings all = settings();
    all.insert(all.end(), {{"mass_scaling", "1000"}, {"reaction_step", "0.2"}});
    std::vector<double> expected, found;
    Muscle emulated_one(all);
    use(emulated_one, emulated::backend_ops());
    exercise(emulated_one, &expected);
    ASSERT_GT(emulated_one.count(), 64u);
    for (const bool backwards : {false, true}) {
        Muscle shimmed(all);
        setenv("SPH_MUSCLE_PERSISTENT", "1", 1);
        use(shimmed, shim_solid_backend());
        unsetenv("SPH_MUSCLE_PERSISTENT");
        shim::backwards() = backwards;
        shim::now.played = shim::now.together = 0;
        exercise(shimmed, &found);
        shim::backwards() = false;
        EXPECT_EQ(shim::now.played, 0);
        EXPECT_EQ(shim::now.together, 4); // 35 steps are two submissions, 3 and 2 one each
        ASSERT_EQ(found.size(), expected.size());
        for (size_t k = 0; k < found.size(); ++k)
            ASSERT_EQ(found[k], expected[k]) << "number " << k << ", backwards " << backwards;
    }
}

// The launches of a look, on their second stream, and the events between the two: the same bits as the
// emulated device, also when the look is finished only after further steps.
TEST(CudaKernels, LookAsTheThreadsDo) {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the address sanitizer does not follow fibers";
#endif
    std::vector<float> fields[3];
    sphm_observation observations[3];
    for (int variant = 0; variant < 3; ++variant) {
        Muscle muscle(settings());
        use(muscle, variant == 0 ? emulated::backend_ops() : shim_solid_backend());
        ++muscle.handle->changes;
        ASSERT_EQ(sphm_muscle_stimulate(muscle.handle, "origin", 8000, 0, nullptr), SPHM_OK);
        muscle.advance(2e-4);
        sphm_particles p{};
        sphm_observation &o = observations[variant];
        ASSERT_EQ(sphm_muscle_glance(muscle.handle, &p, &o, nullptr), SPHM_OK);
        EXPECT_LT(o.time_s, 2.1e-4);
        muscle.advance(2e-4);
        shim::now.not_ready = variant == 2 ? 3 : 0;
        ASSERT_EQ(sphm_muscle_glance(muscle.handle, &p, &o, nullptr), SPHM_OK); // begins the second look
        muscle.advance(2e-4);
        for (; variant == 2 && shim::now.not_ready > 0;) {
            ASSERT_EQ(sphm_muscle_glance(muscle.handle, &p, &o, nullptr), SPHM_OK);
            EXPECT_LT(o.time_s, 2.1e-4); // still the first
        }
        ASSERT_EQ(sphm_muscle_glance(muscle.handle, &p, &o, nullptr), SPHM_OK);
        EXPECT_NEAR(o.time_s, 4e-4, 1e-9);
        fields[variant].assign(p.position_m, p.position_m + SPHM_LOOK_FIELDS * p.count);
    }
    for (int variant = 1; variant < 3; ++variant) {
        EXPECT_EQ(memcmp(&observations[variant], &observations[0], sizeof observations[0]), 0) << variant;
        EXPECT_EQ(fields[variant], fields[0]) << variant;
    }
    EXPECT_GT(observations[0].displacement_mean_m, 0);
}

// The fluid's: rows anew, forces, several diffusions a step, steps in full submissions and less.
void exercise_fluid(Muscle &muscle, std::vector<double> *numbers) {
    sphm_backend *backend = muscle.handle->backend;
    const sphm_backend_ops *ops = muscle.handle->ops;
    sphm_drive drive{};
    drive.driven[SPHM_ELECTRODE_ORIGIN] = 1;
    drive.current_uA_per_mm2[SPHM_ELECTRODE_ORIGIN] = 8000;
    ASSERT_EQ(ops->step(backend, 33, 2e-4, &drive, &muscle.context), SPHM_OK) << muscle.context.message;
    drive.force_count = 1;
    drive.forces[0].radius_m = 0.05;
    drive.forces[0].force_N[1] = 20;
    ASSERT_EQ(ops->step(backend, 12, 2e-4, &drive, &muscle.context), SPHM_OK) << muscle.context.message;
    EXPECT_GE(ops->timing(backend).neighbour_rebuilds, 1u);
    *numbers = muscle.values();
    numbers->push_back(ops->limits(backend).smallest);
    numbers->push_back(ops->limits(backend).courant);
    numbers->push_back(ops->timing(backend).neighbours_per_particle);
    // As the device packs them, on its second stream.
    sphm_particles p{};
    ++muscle.handle->changes;
    ASSERT_EQ(sphm_muscle_particles(muscle.handle, &p, nullptr), SPHM_OK);
    ASSERT_EQ(muscle.handle->looks.there, 1);
    numbers->insert(numbers->end(), p.position_m, p.position_m + SPHM_LOOK_FIELDS * p.count);
}

// All three kinds of forces; more than one block in a reduction, and a last one with idle lanes.
TEST(CudaKernels, DoWhatTheThreadsOfTheFluidDo) {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the address sanitizer does not follow fibers";
#endif
    const std::vector<Muscle::Settings> kinds = {
        {{"particles", "300"}, {"reaction_step", "0.05"}},
        {{"particles", "70"}, {"fibres", "laplace"}, {"anisotropy_ratio", "3"}, {"fibre_steering", "0.2"}},
        {{"particles", "70"}, {"coupling", "pressure"}, {"pair_matching", "0"}, {"fibre_tension", "0"}}};
    for (Muscle::Settings all : kinds) {
        all.insert(all.begin(), {{"tissue", "fluid"}, {"smoothing_ratio", "2.2"}});
        std::vector<double> expected, found;
        Muscle emulated_one(all);
        use(emulated_one, emulated::fluid_ops());
        exercise_fluid(emulated_one, &expected);
        ASSERT_NE(emulated_one.count() % 32, 0u);
        for (const bool backwards : {false, true}) {
            Muscle shimmed(all);
            shim::backwards() = backwards;
            use(shimmed, shim_fluid_backend());
            shim::now.played = 0;
            exercise_fluid(shimmed, &found);
            shim::backwards() = false;
            EXPECT_GE(shim::now.played, 1);
            ASSERT_EQ(found.size(), expected.size());
            for (size_t k = 0; k < found.size(); ++k)
                ASSERT_EQ(found[k], expected[k]) << "number " << k << ", backwards " << backwards;
        }
    }
    EXPECT_EQ(shim::now.device.size() + shim::now.host.size(), 0u);
    EXPECT_EQ(shim::now.streams, 0);
    EXPECT_EQ(shim::now.graphs, 0);
}

// Every call of the runtime and of CUB fails once, at creation, in a step and when rows are built anew.
TEST(CudaKernels, EveryCallOfTheFluidIsChecked) {
    Muscle made({{"tissue", "fluid"}, {"particles", "12"}, {"smoothing_ratio", "3"}});
    const sphm_backend_ops *ops = shim_fluid_backend();
    sphm_drive drive{};
    shim::dry() = true;
    int failed_at_creation = 0, failed_in_step = 0, failed_at_restoration = 0;
    bool all_answered = false;
    for (int allowed = 0; !all_answered; ++allowed) {
        sphm_context context{};
        sphm_backend *backend = nullptr;
        shim::now.calls_left = allowed;
        sphm_status status = ops->create(&made.handle->model, &backend, &context);
        if (status != SPHM_OK) {
            ++failed_at_creation;
            EXPECT_EQ(backend, nullptr);
        } else {
            status = ops->step(backend, 32, 2e-5, &drive, &context);
            // No launch has written a report: it is all zeros, which reads as a failure of the first step.
            if (status == SPHM_FAILED_NONFINITE) {
                status = ops->restore(backend, &made.state(), &context);
                all_answered = status == SPHM_OK;
                failed_at_restoration += !all_answered;
            } else {
                ++failed_in_step;
            }
        }
        if (!all_answered) {
            const std::string message = context.message;
            EXPECT_EQ(status, SPHM_FAILED_BACKEND) << allowed;
            // Restoring looks at what there is first.
            if (message != "the device has failed before; reset the muscle") {
                EXPECT_NE(message.find("CUDA could not "), std::string::npos) << allowed << message;
                EXPECT_NE(message.find("made to fail"), std::string::npos) << allowed << message;
            }
            if (backend) {
                EXPECT_TRUE(std::isnan(ops->view(backend)->x[0])) << allowed;
            }
        }
        shim::now.calls_left = -1;
        ops->destroy(backend);
        EXPECT_EQ(shim::now.device.size() + shim::now.host.size(), 0u) << allowed;
        EXPECT_EQ(shim::now.streams, 0) << allowed;
        EXPECT_EQ(shim::now.graphs, 0) << allowed;
        ASSERT_LT(allowed, 2000);
    }
    shim::dry() = false;
    EXPECT_GT(failed_at_creation, 80);
    EXPECT_GT(failed_in_step, 160);
    EXPECT_GT(failed_at_restoration, 30);
}

// While one muscle waits for its submission, another one on the same device submits, computes and looks,
// kernel by kernel in turn with the first: both have the bits that they have alone. (The shim knows no call
// that waits for the whole device, and the default stream is refused.)
TEST(CudaKernels, TwoMusclesTakeTurns) {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the address sanitizer does not follow fibers";
#endif
    const char *const currents[2] = {"origin", "insertion"};
    std::vector<double> values[2][2];
    sphm_observation observations[2][2];
    for (int together = 0; together < 2; ++together) {
        Muscle first(settings()), second(settings());
        Muscle *const muscles[2] = {&first, &second};
        for (int m = 0; m < 2; ++m) {
            use(*muscles[m], shim_solid_backend());
            ASSERT_EQ(sphm_muscle_stimulate(muscles[m]->handle, currents[m], 8000, 0, nullptr), SPHM_OK);
        }
        const auto go = [&](int m) {
            sphm_particles p{};
            muscles[m]->advance(1e-4);
            ASSERT_EQ(sphm_muscle_glance(muscles[m]->handle, &p, &observations[together][m], nullptr),
                      SPHM_OK);
            muscles[m]->advance(1e-4);
        };
        int met = 0;
        if (together) {
            shim::now.in_turns = true;
            shim::now.while_waiting = [&] {
                for (shim_stream *each : shim::now.all_streams)
                    met += !each->queue.empty();
                go(1);
            };
        } else
            go(1);
        go(0);
        shim::now.in_turns = false;
        EXPECT_EQ(met, together); // the first one's work was waiting when the second one began
        EXPECT_FALSE(shim::now.while_waiting);
        for (int m = 0; m < 2; ++m)
            values[together][m] = muscles[m]->values();
    }
    EXPECT_NE(values[0][0], values[0][1]);
    for (int m = 0; m < 2; ++m) {
        EXPECT_EQ(values[1][m], values[0][m]) << m;
        EXPECT_EQ(memcmp(&observations[1][m], &observations[0][m], sizeof observations[0][0]), 0) << m;
    }
}

// Every call of the runtime fails once, at creation and in a step.
TEST(CudaKernels, EveryCallIsChecked) {
    Muscle made({{"tissue", "solid"}, {"particles", "12"}, {"smoothing_ratio", "3"}});
    const sphm_backend_ops *ops = shim_solid_backend();
    sphm_drive drive{};
    memcpy(drive.ends, made.handle->solid.ends, sizeof drive.ends);
    shim::dry() = true;
    int failed_at_creation = 0, failed_in_step = 0;
    bool all_answered = false;
    for (int allowed = 0; !all_answered; ++allowed) {
        sphm_context context{};
        sphm_backend *backend = nullptr;
        shim::now.calls_left = allowed;
        sphm_status status = ops->create(&made.handle->model, &backend, &context);
        if (status != SPHM_OK) {
            ++failed_at_creation;
            EXPECT_EQ(backend, nullptr);
        } else {
            status = ops->step(backend, 33, 2e-5, &drive, &context);
            // No launch has written a report: it is all zeros, which reads as a failure of the first step.
            all_answered = status == SPHM_FAILED_NONFINITE;
            failed_in_step += !all_answered;
        }
        if (!all_answered) {
            EXPECT_EQ(status, SPHM_FAILED_BACKEND) << allowed;
            EXPECT_NE(std::string(context.message).find("CUDA could not "), std::string::npos) << allowed;
            EXPECT_NE(std::string(context.message).find("made to fail"), std::string::npos) << allowed;
            if (backend) {
                EXPECT_TRUE(std::isnan(ops->view(backend)->x[0])) << allowed;
            }
        }
        shim::now.calls_left = -1;
        ops->destroy(backend);
        EXPECT_EQ(shim::now.device.size() + shim::now.host.size(), 0u) << allowed;
        EXPECT_EQ(shim::now.streams, 0) << allowed;
        EXPECT_EQ(shim::now.graphs, 0) << allowed;
        ASSERT_LT(allowed, 1000);
    }
    shim::dry() = false;
    EXPECT_GT(failed_at_creation, 40);
    EXPECT_GT(failed_in_step, 130);
}

// Launches one by one, each with its time: the same steps.
TEST(CudaKernels, TimesItsLaunches) {
    Muscle made({{"tissue", "solid"}, {"particles", "12"}, {"smoothing_ratio", "3"}});
    sphm_drive drive{};
    memcpy(drive.ends, made.handle->solid.ends, sizeof drive.ends);
    shim::dry() = true;
    setenv("SPH_MUSCLE_TIME_LAUNCHES", "1", 1);
    use(made, shim_solid_backend());
    unsetenv("SPH_MUSCLE_TIME_LAUNCHES");
    const sphm_backend_ops *ops = made.handle->ops;
    ops->reset_timing(made.handle->backend);
    shim::now.played = 0;
    (void)ops->step(made.handle->backend, 32, 2e-5, &drive, nullptr); // nothing runs, so nothing is reported
    const sphm_timing timing = ops->timing(made.handle->backend);
    shim::dry() = false;
    EXPECT_EQ(shim::now.played, 0);
    EXPECT_EQ(shim::now.events, 4);            // two of them are for looks
    EXPECT_NEAR(timing.forces_s, 0.032, 1e-9); // a launch takes the shim a millisecond
    EXPECT_NEAR(timing.density_pressure_s, 0.032, 1e-9);
    EXPECT_EQ(timing.diffusion_s, 0);
    ASSERT_EQ(timing.launch_kinds, SPHM_SOLID_LAUNCHES);
    for (size_t k = 0; k < timing.launch_kinds; ++k) {
        const std::string name = timing.launch_name[k];
        const bool taken = name == "move" || name == "strain";
        EXPECT_NEAR(timing.launch_s[k], taken ? 0.032 : name == "report" ? 0.001 : 0, 1e-9) << name;
    }
}

TEST(CudaKernels, SaysHowMuchMemoryIsMissing) {
    Muscle made(settings());
    sphm_context context{};
    sphm_backend *backend = nullptr;
    shim::now.free_bytes = 1000;
    EXPECT_EQ(shim_solid_backend()->create(&made.handle->model, &backend, &context), SPHM_REFUSED_MEMORY);
    shim::now.free_bytes = size_t(1) << 30;
    EXPECT_EQ(backend, nullptr);
    EXPECT_NE(std::string(context.message).find("has 0 MiB of 0 MiB free, and 1 MiB are needed"),
              std::string::npos)
        << context.message;
}

} // namespace
