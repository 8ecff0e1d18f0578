// Random stimulation and end motion: nothing becomes non-finite, no particle goes through its neighbour, the
// energy stays bounded. A second in the suite; a minute by
//
//   SPH_MUSCLE_ROBUSTNESS_S=20 SPH_MUSCLE_ROBUSTNESS_FILE=/tmp/robust.snapshot ./robustness_test
//
// three times: the file keeps the state in between. What is commanded when is a function of the time alone.
#include "solid_muscles.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

using namespace solid;

// Uniform in 0 ... 1 by number and purpose (splitmix64).
double uniform(uint64_t number, uint64_t purpose) {
    uint64_t z = number * 0x9e3779b97f4a7c15u + purpose * 0xd1b54a32d192ed03u + 1;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return double((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
}

// One period: a new place of the insertion within 10 % of the length of its rest place, turned by up to 0.2
// rad, at 0.5 m/s at most (a cubic's peak is 1.5 times its mean); and a new activation or stimulus.
constexpr double period_s = 0.2, fastest_m_per_s = 0.5;

void command(const Muscle &muscle, uint64_t k) {
    const sphm_body *body = sphm_muscle_body(muscle.get());
    sphm_context context{};
    const sphm_end_pose now = end_pose(muscle, SPHM_END_INSERTION);
    sphm_end_pose pose{};
    double distance = 0;
    for (int d = 0; d < 3; ++d) {
        const double share = 0.0577 * (2 * uniform(k, uint64_t(d)) - 1); // a cube in a ball of 10 %
        pose.position_m[d] = body->insertion_m[d] + share * body->length_m;
        pose.orientation[d] = 0.0577 * (2 * uniform(k, uint64_t(d) + 3) - 1);
        distance += std::pow(pose.position_m[d] - now.position_m[d], 2);
    }
    pose.orientation[3] = std::sqrt(1 - std::pow(pose.orientation[0], 2) - std::pow(pose.orientation[1], 2) -
                                    std::pow(pose.orientation[2], 2));
    distance = std::sqrt(distance);
    const double duration = std::fmin(period_s, std::fmax(0.05, 1.5 * distance / fastest_m_per_s));
    ASSERT_LE(1.5 * distance / duration, 1.0001 * fastest_m_per_s);
    ASSERT_EQ(sphm_muscle_set_end_pose(muscle.get(), SPHM_END_INSERTION, &pose, duration, &context), SPHM_OK)
        << context.message;
    if (uniform(k, 7) < 0.6) {
        ASSERT_EQ(sphm_muscle_activate(muscle.get(), uniform(k, 8), 0, &context), SPHM_OK) << context.message;
    } else {
        ASSERT_EQ(sphm_muscle_release_activation(muscle.get(), &context), SPHM_OK);
        ASSERT_EQ(sphm_muscle_stimulate(muscle.get(), "belly", 8000 * uniform(k, 9),
                                        0.15 * uniform(k, 10) + 0.01, &context),
                  SPHM_OK)
            << context.message;
    }
}

double kinetic_energy(const Muscle &muscle) {
    const sphm_state *s = sphm_muscle_state(muscle.get());
    double sum = 0;
    for (size_t i = 0; i < s->count; ++i) {
        const double v[3] = {double(s->vx[i]), double(s->vy[i]), double(s->vz[i])};
        sum += muscle->model.particle_mass_kg / 2 * double(s->relative_volume[i]) *
               (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    }
    return sum;
}

TEST(Robustness, RandomStimulationAndMotion) {
    const char *seconds = std::getenv("SPH_MUSCLE_ROBUSTNESS_S"),
               *file = std::getenv("SPH_MUSCLE_ROBUSTNESS_FILE");
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.particles = seconds ? 2231 : 500;
    p.threads = 1;
    const Muscle muscle = make(p);
    sphm_context context{};
    std::FILE *there = file ? std::fopen(file, "rb") : nullptr;
    if (there) {
        std::fclose(there);
        ASSERT_EQ(sphm_muscle_load(muscle.get(), file, &context), SPHM_OK) << context.message;
    }
    const double from = sphm_muscle_time(muscle.get()), until = from + (seconds ? std::atof(seconds) : 1);
    double smallest_J = 10, largest_J = 0, energy_J = 0, force_N = 0;
    for (uint64_t k = uint64_t(from / period_s + 0.5); double(k) * period_s < until - 1e-6; ++k) {
        command(muscle, k);
        double period_J = 10;
        for (int part = 0; part < 20; ++part) {
            ASSERT_EQ(sphm_muscle_advance(muscle.get(), period_s / 20, &context), SPHM_OK) << context.message;
            const sphm_state *s = sphm_muscle_state(muscle.get());
            for (size_t i = 0; i < s->count; ++i) {
                const double J = p.density / double(s->density[i]);
                period_J = std::fmin(period_J, J);
                largest_J = std::fmax(largest_J, J);
            }
            energy_J = std::fmax(energy_J, kinetic_energy(muscle));
        }
        smallest_J = std::fmin(smallest_J, period_J);
        const sphm_observation o = observe(muscle);
        force_N = std::fmax(force_N, std::fabs(o.force_N));
        EXPECT_EQ(o.nonfinite, 0u);
        EXPECT_GT(period_J, 0.2) << "at " << o.time_s << " s";
        if (seconds && k % 5 == 4)
            std::printf("%7.2f s: J %.3f ... %.3f, kinetic energy at most %.4g J, force %.4g N\n", o.time_s,
                        smallest_J, largest_J, energy_J, o.force_N);
        std::fflush(stdout);
    }
    // The whole muscle at the ends' fastest, eight times over.
    EXPECT_LT(energy_J, 8 * 0.5 * p.density * sphm_muscle_body(muscle.get())->volume_m3 * 0.25);
    EXPECT_GT(force_N, 1);
    if (file) {
        ASSERT_EQ(sphm_muscle_save(muscle.get(), file, &context), SPHM_OK) << context.message;
    }
}

// A particle that is pressed flat asks for ever shorter steps: it is a failure, not a call that never
// returns.
TEST(Robustness, ACollapseStopsTheMuscle) {
    sphm_parameters p = bar();
    p.hourglass_stiffness = 0;
    const Muscle muscle = make(p);
    sphm_context context{};
    const sphm_body *body = sphm_muscle_body(muscle.get());
    double middle[3];
    for (int d = 0; d < 3; ++d)
        middle[d] = (body->origin_m[d] + body->insertion_m[d]) / 2;
    const double force[3] = {40, 0, 0};
    ASSERT_EQ(sphm_muscle_apply_force(muscle.get(), middle, force, 0.004, 0, &context), SPHM_OK);
    EXPECT_EQ(sphm_muscle_advance(muscle.get(), 0.1, &context), SPHM_FAILED_NONFINITE);
    EXPECT_NE(std::string(context.message).find("compressed or stretched"), std::string::npos)
        << context.message;
    ASSERT_EQ(sphm_muscle_reset(muscle.get(), &context), SPHM_OK);
    proceed(muscle, 0.001);
}

// Nothing is held and nothing damps: the particles at the tips, which see least of their surroundings, are
// free to ring.
TEST(Robustness, FreeTissueWithoutViscosityKeepsItsEnergy) {
    for (const double hourglass_Pa : {0.0, 1e4}) {
        sphm_parameters p = sphm_parameters_default();
        p.preset = SPHM_PRESET_BELLY;
        p.particles = 500;
        p.threads = 1;
        p.attachment_fraction = 0;
        p.tissue_viscosity = 0;
        p.hourglass_stiffness = hourglass_Pa;
        const Muscle muscle = make(p);
        const double middle[3] = {0, 0, 0}, pull_N[3] = {0, 0.1, 0.05};
        sphm_context context{};
        ASSERT_EQ(sphm_muscle_apply_force(muscle.get(), middle, pull_N, 0.01, 0.002, &context), SPHM_OK);
        proceed(muscle, 0.002);
        const double given_J = kinetic_energy(muscle);
        for (int k = 0; k < 30; ++k) {
            ASSERT_EQ(sphm_muscle_step(muscle.get(), 100, &context), SPHM_OK) << context.message;
            EXPECT_LT(kinetic_energy(muscle), 1.05 * given_J) << sphm_muscle_steps(muscle.get());
        }
        EXPECT_GT(kinetic_energy(muscle), 0.1 * given_J);
    }
}

} // namespace
