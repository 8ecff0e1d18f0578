// The CUDA back end of the fluid tissue on an emulated device: layout, launches, sort, submissions and
// operations of the real one, with the same threads, against the CPU back end. What only a device can show is
// in bench/parity.c.

#include "close.h"
#include "emulated_muscle.h"

#include <cmath>

#include "core/muscle.h"

namespace {

Muscle::Settings fluid(const Muscle::Settings &more = {}) {
    Muscle::Settings settings = {{"tissue", "fluid"}, {"particles", "500"}, {"time_step", "1e-4"}};
    settings.insert(settings.end(), more.begin(), more.end());
    return settings;
}

// Largest difference of every array, as a share of the scale of that array: of velocities and pressures the
// largest magnitude (the three components together), of positions how far particles have moved, else what the
// quantity ranges over. And what single precision does: two units in the last place of the largest position,
// the quarter of one a step as a velocity, for stiff pairs follow it, and four of the density in the
// pressure.
void expect_close(const Muscle &cpu, const Muscle &gpu, double tolerance) {
    const auto a = arrays_by_id(cpu), b = arrays_by_id(gpu);
    std::map<std::string, double> scale = {
        {"density", 1112}, {"membrane_potential", 100}, {"recovery", 1}, {"activation", 1}};
    double fastest = 1e-30, moved = 1e-4; // m/s, m
    for (const char *name : {"vx", "vy", "vz"})
        fastest = std::fmax(fastest, largest_magnitude(a.at(name)));
    const sphm_body *body = sphm_muscle_body(cpu.handle);
    for (size_t i = 0; i < cpu.count(); ++i)
        for (size_t d = 0; d < 3; ++d) {
            const char *const names[3] = {"x", "y", "z"};
            const double rest = body->positions[3 * i + d] - cpu.handle->model.frame_m[d];
            moved = std::fmax(moved, std::fabs(a.at(names[d])[i] - rest));
        }
    for (const char *name : {"vx", "vy", "vz"})
        scale[name] = fastest;
    for (const char *name : {"x", "y", "z", "listed_x", "listed_y", "listed_z"})
        scale[name] = moved;
    scale["pressure"] = std::fmax(1e-30, largest_magnitude(a.at("pressure")));
    const double ulp = 7.45e-9; // m, of positions of 0.0625 to 0.125 m
    std::map<std::string, double> rounding = {{"pressure", 100 * 4 * 1.22e-4}}; // k, ulps of the density
    for (const char *name : {"x", "y", "z", "listed_x", "listed_y", "listed_z"})
        rounding[name] = 2 * ulp;
    for (const char *name : {"vx", "vy", "vz"})
        rounding[name] = ulp / 4 / 1e-4;
    for (const auto &entry : a) {
        const double unit = scale.count(entry.first) ? scale[entry.first] : 0; // 0: equal to the bit
        const double worst = largest_difference(entry.second, b.at(entry.first));
        const double floor = rounding.count(entry.first) ? rounding[entry.first] : 0;
        EXPECT_LE(worst, tolerance * unit + floor) << entry.first << ", scale " << unit;
        if (unit > 0 && getenv("SPHM_SHOW"))
            printf("%20s %.2e of %.3g\n", entry.first.c_str(), worst / unit, unit);
    }
    EXPECT_NEAR(cpu.state().time_s, gpu.state().time_s, 1e-15);
    EXPECT_EQ(cpu.state().steps, gpu.state().steps);
    EXPECT_NEAR(cpu.state().diffusion_due_s, gpu.state().diffusion_due_s, 1e-15);
    EXPECT_EQ(sphm_muscle_timing(cpu.handle).neighbour_rebuilds,
              sphm_muscle_timing(gpu.handle).neighbour_rebuilds);
}

void run(Muscle &muscle, size_t steps) {
    ASSERT_EQ(sphm_muscle_advance(muscle.handle, 1e-4 * double(steps), &muscle.context), SPHM_OK)
        << muscle.context.message;
}

TEST(EmulatedFluid, IsTheCpuAtRestAndStaysThere) {
    for (const char *laplacian : {"corrected", "brookshaw", "paper"}) {
        const Muscle::Settings settings = fluid({{"laplacian", laplacian}, {"anisotropy_ratio", "3"}});
        Muscle cpu(settings);
        Emulated gpu(settings);
        const auto before = arrays_by_id(gpu);
        expect_close(cpu, gpu, 1e-6);
        EXPECT_EQ(largest_magnitude(before.at("pressure")), 0);
        const sphm_time_step_limits a = sphm_muscle_time_step_limits(cpu.handle),
                                    b = sphm_muscle_time_step_limits(gpu.handle);
        EXPECT_NEAR(b.smallest, a.smallest, 1e-6 * a.smallest);
        EXPECT_EQ(b.acoustic, a.acoustic);
        EXPECT_EQ(b.courant, INFINITY);
        EXPECT_EQ(b.shape_matching, a.shape_matching);
        EXPECT_GT(sphm_muscle_timing(gpu.handle).neighbours_per_particle, 20);
        EXPECT_EQ(sphm_muscle_timing(gpu.handle).neighbours_per_particle,
                  sphm_muscle_timing(cpu.handle).neighbours_per_particle);
        run(gpu, 40);
        const auto after = arrays_by_id(gpu);
        for (const char *name : {"x", "y", "z", "vx", "vy", "vz", "density", "pressure", "activation"})
            EXPECT_EQ(after.at(name), before.at(name)) << name << " changed at rest";
        EXPECT_EQ(gpu.state().steps, 40u);
    }
}

// Stimulated, so that the wave, the diffusion's waiting, the electrodes and the tension all take part, and
// the rows are built anew many times. Rounding differs (order of the row sums, reciprocals and roots) and a
// contracting muscle amplifies it.
TEST(EmulatedFluid, FollowsTheCpuFor500Steps) {
    Muscle cpu(fluid());
    Emulated gpu(fluid());
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)})
        ASSERT_EQ(sphm_muscle_stimulate(muscle->handle, "both", 8000, 0, nullptr), SPHM_OK);
    emulated::submissions_played() = 0;
    run(cpu, 500);
    run(gpu, 500);
    EXPECT_GE(emulated::submissions_played(), 5);
    EXPECT_GE(sphm_muscle_timing(gpu.handle).neighbour_rebuilds, 3u);
    expect_close(cpu, gpu, 2e-5);
}

// Everything that acts on a muscle at once, with the other coupling and fibres that are not parallel.
TEST(EmulatedFluid, FollowsTheCpuUnderEveryCommand) {
    const std::vector<Muscle::Settings> all = {
        fluid({{"gravity", "[0.3, 0, -9.81]"},
               {"fibre_steering", "0.3"},
               {"anisotropy_ratio", "4"},
               {"fibres", "laplace"},
               {"laplacian", "brookshaw"}}),
        fluid({{"coupling", "pressure"}, {"laplacian", "paper"}, {"shape_matching_floor", "0.001"}}),
        fluid({{"coupling", "pressure"}, {"pair_matching", "0"}, {"cell_size", "0.006"}}),
        fluid({{"fibres", "pennate"},
               {"pennation_angle", "15"},
               {"tension_slope", "1"},
               {"xsph_time", "0.001"}}),
    };
    for (const Muscle::Settings &settings : all) {
        SCOPED_TRACE(settings.back().first);
        Muscle cpu(settings);
        Emulated gpu(settings);
        for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
            ASSERT_EQ(muscle->status, SPHM_OK) << muscle->context.message;
            sphm_muscle *m = muscle->handle;
            const sphm_body *body = sphm_muscle_body(m);
            ASSERT_EQ(sphm_muscle_stimulate(m, "belly", 8000, 5e-3, nullptr), SPHM_OK);
            run(*muscle, 70);
            const double force[3] = {0, 1, 2};
            double middle[3];
            for (int d = 0; d < 3; ++d)
                middle[d] = (body->origin_m[d] + body->insertion_m[d]) / 2;
            ASSERT_EQ(sphm_muscle_apply_force(m, middle, force, 0.02, 2e-3, nullptr), SPHM_OK);
            run(*muscle, 80);
        }
        expect_close(cpu, gpu, 2e-5);
    }
}

// Several diffusions a step: the launches that other tests do not need.
TEST(EmulatedFluid, DividesTheMembrane) {
    const Muscle::Settings settings = fluid({{"reaction_step", "0.02"}, {"conduction_velocity", "4"}});
    Muscle cpu(settings);
    Emulated gpu(settings);
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        ASSERT_EQ(sphm_muscle_stimulate(muscle->handle, "insertion", 8000, 0, nullptr), SPHM_OK);
        run(*muscle, 100);
        EXPECT_EQ(sphm_muscle_steps(muscle->handle), 100u);
    }
    expect_close(cpu, gpu, 2e-5);
}

// The same bits whatever order the threads come in, and however many steps a submission has.
TEST(EmulatedFluid, DoesNotDependOnOrderOrSubmission) {
    uint64_t hashes[3];
    for (int variant = 0; variant < 3; ++variant) {
        emulated::backwards() = variant == 1;
        Emulated gpu(fluid());
        sphm_drive drive{};
        drive.driven[SPHM_ELECTRODE_BELLY] = 1;
        drive.current_uA_per_mm2[SPHM_ELECTRODE_BELLY] = 8000;
        drive.force_count = 1;
        drive.forces[0].radius_m = 0.05;
        drive.forces[0].force_N[1] = 5;
        const size_t at_a_time = variant == 2 ? 1 : 75;
        for (size_t done = 0; done < 150; done += at_a_time)
            ASSERT_EQ(gpu.handle->ops->step(gpu.handle->backend, at_a_time, 1e-4, &drive, &gpu.context),
                      SPHM_OK)
                << gpu.context.message;
        emulated::backwards() = false;
        hashes[variant] = sphm_muscle_hash(gpu.handle);
        EXPECT_EQ(sphm_muscle_steps(gpu.handle), 150u);
        EXPECT_GE(sphm_muscle_timing(gpu.handle).neighbour_rebuilds, 1u);
    }
    EXPECT_EQ(hashes[1], hashes[0]);
    EXPECT_EQ(hashes[2], hashes[0]);
}

// A state goes from one back end to the other and goes on there; and a restored one goes on to the bit, with
// other slots and rows behind it.
TEST(EmulatedFluid, TakesAStateFromTheCpuAndGivesItBack) {
    Muscle cpu(fluid());
    Emulated gpu(fluid()), twin(fluid());
    ASSERT_EQ(sphm_muscle_stimulate(cpu.handle, "belly", 8000, 0, nullptr), SPHM_OK);
    run(cpu, 133);
    ASSERT_GT(sphm_muscle_timing(cpu.handle).neighbour_rebuilds, 0u);
    ASSERT_EQ(sphm_muscle_restore(gpu.handle, &cpu.state(), &gpu.context), SPHM_OK) << gpu.context.message;
    EXPECT_EQ(sphm_muscle_hash(gpu.handle), sphm_muscle_hash(cpu.handle));
    run(gpu, 40);
    EXPECT_EQ(sphm_muscle_steps(gpu.handle), 173u);
    ASSERT_EQ(sphm_muscle_restore(twin.handle, &gpu.state(), &twin.context), SPHM_OK) << twin.context.message;
    EXPECT_EQ(sphm_muscle_hash(twin.handle), sphm_muscle_hash(gpu.handle));
    run(gpu, 60);
    run(twin, 60);
    EXPECT_EQ(sphm_muscle_hash(twin.handle), sphm_muscle_hash(gpu.handle));
    const uint64_t before = sphm_muscle_hash(gpu.handle);
    Muscle other({{"tissue", "fluid"}, {"particles", "300"}});
    EXPECT_EQ(sphm_muscle_restore(gpu.handle, &other.state(), &gpu.context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_hash(gpu.handle), before);
    // What was refused has not spoilt how it goes on.
    run(gpu, 10);
    run(twin, 10);
    EXPECT_EQ(sphm_muscle_hash(twin.handle), sphm_muscle_hash(gpu.handle));
}

// Thrown so hard that the Courant limit takes over: steps as short as on the CPU, and the same end.
TEST(EmulatedFluid, ShortensItsStepsWhereParticlesBecomeFast) {
    Muscle cpu(fluid());
    Emulated gpu(fluid());
    sphm_status status[2];
    int k = 0;
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        const sphm_body *body = sphm_muscle_body(muscle->handle);
        const double force[3] = {0, 0, 1e4};
        double middle[3];
        for (int d = 0; d < 3; ++d)
            middle[d] = (body->origin_m[d] + body->insertion_m[d]) / 2;
        ASSERT_EQ(sphm_muscle_apply_force(muscle->handle, middle, force, 0.03, 0, nullptr), SPHM_OK);
        status[k++] = sphm_muscle_advance(muscle->handle, 3e-3, &muscle->context);
        EXPECT_LT(sphm_muscle_time_step_limits(muscle->handle).courant, 1e-4);
        EXPECT_GT(sphm_muscle_steps(muscle->handle), 30u);
    }
    EXPECT_EQ(status[1], status[0]) << cpu.context.message << " / " << gpu.context.message;
    EXPECT_NEAR(double(sphm_muscle_steps(gpu.handle)), double(sphm_muscle_steps(cpu.handle)),
                0.1 * double(sphm_muscle_steps(cpu.handle)));
}

// The step that failed, and nothing after it: the same particle, stage, time and count as on the CPU, in the
// middle of a submission.
TEST(EmulatedFluid, StopsAtTheStepThatFails) {
    Muscle cpu(fluid());
    Emulated gpu(fluid());
    for (Muscle *muscle : {&cpu, static_cast<Muscle *>(&gpu)}) {
        sphm_drive drive{};
        ASSERT_EQ(muscle->handle->ops->step(muscle->handle->backend, 5, 1e-4, &drive, &muscle->context),
                  SPHM_OK);
        drive.force_count = 1;
        drive.forces[0].radius_m = 10;
        drive.forces[0].force_N[2] = 1e300;
        EXPECT_EQ(muscle->handle->ops->step(muscle->handle->backend, 40, 1e-4, &drive, &muscle->context),
                  SPHM_FAILED_NONFINITE);
    }
    EXPECT_NE(std::string(cpu.context.message).find("stage 'prediction"), std::string::npos)
        << cpu.context.message;
    EXPECT_STREQ(gpu.context.message, cpu.context.message);
    EXPECT_EQ(sphm_muscle_steps(gpu.handle), 6u);
    EXPECT_EQ(sphm_muscle_steps(cpu.handle), 6u);
}

// Particles that are pressed together need longer rows than there is memory for: they get it.
TEST(EmulatedFluid, MakesRoomForLongerRows) {
    Muscle cpu(fluid());
    Emulated gpu(fluid());
    sphm_state *s = const_cast<sphm_state *>(&cpu.state());
    for (sphm_real *x : {s->x, s->y, s->z, s->listed_x, s->listed_y, s->listed_z})
        for (size_t i = 0; i < s->count; ++i)
            x[i] *= sphm_real(0.8);
    const size_t before = sphm_muscle_timing(gpu.handle).memory_bytes;
    Muscle squeezed(fluid());
    ASSERT_EQ(sphm_muscle_restore(squeezed.handle, s, &squeezed.context), SPHM_OK);
    ASSERT_EQ(sphm_muscle_restore(gpu.handle, s, &gpu.context), SPHM_OK) << gpu.context.message;
    EXPECT_GT(sphm_muscle_timing(gpu.handle).memory_bytes, before);
    run(squeezed, 10);
    run(gpu, 10);
    expect_close(squeezed, gpu, 2e-5);
}

// Whatever request fails, the answer is a status and a sentence, and nothing old is shown as new.
TEST(EmulatedFluid, SurvivesADeviceThatFails) {
    Muscle made(fluid({{"particles", "60"}}));
    const sphm_model *model = &made.handle->model;
    const sphm_backend_ops *ops = emulated::fluid_ops();
    sphm_drive drive{};
    drive.force_count = 1;
    drive.forces[0].radius_m = 10;
    drive.forces[0].force_N[2] = 100; // soon the rows are out of date
    int failed_in[3] = {0, 0, 0};
    for (int allowed = 0;; ++allowed) {
        sphm_context context{};
        sphm_backend *backend = nullptr;
        int stage = 0;
        emulated::requests_left() = allowed;
        sphm_status status = ops->create(model, &backend, &context);
        if (status == SPHM_OK) {
            stage = 1;
            status = ops->step(backend, 40, 1e-4, &drive, &context);
        }
        if (status == SPHM_OK) {
            stage = 2;
            status = std::isnan(ops->view(backend)->x[0]) ? SPHM_FAILED_BACKEND : SPHM_OK;
        } else {
            EXPECT_EQ(status, SPHM_FAILED_BACKEND) << allowed;
            EXPECT_STREQ(context.message, "the emulated device has failed") << allowed;
        }
        if (status != SPHM_OK) {
            ++failed_in[stage];
            EXPECT_EQ(backend == nullptr, stage == 0) << allowed;
            if (backend) {
                EXPECT_EQ(ops->step(backend, 1, 1e-4, &drive, &context), SPHM_FAILED_BACKEND);
                EXPECT_TRUE(std::isnan(ops->view(backend)->x[0])) << allowed;
                EXPECT_EQ(ops->restore(backend, &made.state(), &context), SPHM_FAILED_BACKEND);
            }
        } else {
            EXPECT_GE(ops->timing(backend).neighbour_rebuilds, 1u);
        }
        emulated::requests_left() = -1;
        ops->destroy(backend);
        if (status == SPHM_OK)
            break;
        ASSERT_LT(allowed, 5000);
    }
    EXPECT_GT(failed_in[0], 60);
    EXPECT_GT(failed_in[1], 100);
    EXPECT_GT(failed_in[2], 10);
}

TEST(EmulatedFluid, RefusesWhatDoesNotFit) {
    Muscle made(fluid());
    sphm_context context{};
    sphm_backend *backend = nullptr;
    for (const size_t limit :
         {size_t(20000), size_t(200000)}) { // not the particles; the particles, not the rows
        emulated::memory_limit() = limit;
        EXPECT_EQ(emulated::create_fluid(&made.handle->model, &backend, &context), SPHM_REFUSED_MEMORY);
        EXPECT_EQ(backend, nullptr);
        EXPECT_EQ(std::string(context.message), std::to_string(limit) + " bytes are free");
    }
    emulated::memory_limit() = SIZE_MAX;
}

} // namespace
