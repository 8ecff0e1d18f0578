// Force-velocity: Hill's hyperbola at a point, and of a fibre bar that shortens and lengthens at constant
// speed.
#include "solid_muscles.h"

namespace {

using namespace solid;

constexpr double rate_filter_s = 0.01;

// Longer than bar(), so that tissue amid it feels nothing of the clamps, beside which it cannot thicken.
sphm_parameters hill_bar() {
    sphm_parameters p = bar();
    p.belly_length = 0.12;
    p.particles = 1000;
    p.attachment_fraction = 0.1;
    p.force_velocity = SPHM_FORCE_VELOCITY_HILL;
    p.shortening_speed_max = 4;
    p.rate_filter = rate_filter_s;
    p.velocity_damping = 20;
    p.passive_coefficient = p.passive_compressive_stiffness = 0; // active forces only
    return p;
}

// Written anew: V = shortening speed over its maximum.
double hill(double V, double curvature, double plateau) {
    if (V > 1)
        return 0;
    if (V >= 0)
        return (1 - V) / (1 + V / curvature);
    const double corner = (plateau - 1) / (1 + 1 / curvature);
    return 1 + (plateau - 1) * -V / (-V + corner);
}

TEST(ForceVelocity, CurveAtAPoint) {
    const Muscle muscle = make(hill_bar());
    const sphm_solid_constants &c = muscle->model.solid;
    for (double V : {-10.0, -1.0, -0.1, 0.0, 0.1, 0.3, 0.7, 0.99, 1.5})
        EXPECT_NEAR(sphm_solid_force_velocity(sphm_real(-V * 4 * 1.07), &c), hill(V, 0.25, 1.4), 1e-5) << V;
    sphm_solid_constants off = c;
    off.inverse_speed_s = 0;
    EXPECT_EQ(sphm_solid_force_velocity(-3, &off), 1);
}

// Stretch of the fibres amid a bar and its rate, 1/s.
void look_amid(const Muscle &muscle, double *stretch, double *rate) {
    const sphm_body *body = sphm_muscle_body(muscle.get());
    sphm_particles particles{};
    EXPECT_EQ(sphm_muscle_particles(muscle.get(), &particles, nullptr), SPHM_OK);
    double count = 0, xv = 0, xx = 0;
    *stretch = 0;
    for (size_t i = 0; i < particles.count; ++i) {
        const double x = body->positions[3 * i];
        if (std::fabs(x) > 0.008)
            continue;
        *stretch += particles.fibre_stretch[i];
        xv += x * particles.velocity_m_per_s[3 * i];
        xx += x * x;
        ++count;
    }
    *stretch /= count;
    *rate = xv / xx;
}

// The force at a moment over what the fibre law gives at that stretch without motion, amid the bar, where it
// is all active (at the ends, whose wrench it is, pressure takes a part of it). The filtered rate is the one
// a filter's time ago, for it changes slowly. The speed is that of the free part over its rest length.
double force_ratio(double shortening_per_s, double *V) {
    const Muscle muscle = make(hill_bar());
    const sphm_body *body = sphm_muscle_body(muscle.get());
    const double free = body->clamp_m[1] - body->clamp_m[0], speed_m_per_s = shortening_per_s * free;
    const double start = body->insertion_m[0] + free * 0.07; // about to lambda_ofl; the stretch is measured
    hold_at(muscle, SPHM_END_INSERTION, start + speed_m_per_s * 0.03, 0.05);
    EXPECT_EQ(sphm_muscle_activate(muscle.get(), 1, 0, nullptr), SPHM_OK);
    proceed(muscle, 0.15);
    sphm_end_pose pose = end_pose(muscle, SPHM_END_INSERTION);
    pose.position_m[0] -= speed_m_per_s * 0.08;
    pose.velocity_m_per_s[0] = -speed_m_per_s;
    EXPECT_EQ(sphm_muscle_set_end_pose(muscle.get(), SPHM_END_INSERTION, &pose, 0.08, nullptr), SPHM_OK);
    proceed(muscle, 0.06 - rate_filter_s);
    double stretch = 0, rate = 0, now = 0;
    look_amid(muscle, &stretch, &rate);
    *V = -rate / (4 * 1.07);
    proceed(muscle, rate_filter_s);
    look_amid(muscle, &stretch, &now);
    const double d = std::fabs(stretch / 1.07 - 1);
    EXPECT_LT(d, 0.3);
    const double still = 3e5 * (1 - 4 * d * d) / 1.07 * bar_area; // sigma_max f lambda/lambda_ofl over lambda
    return -wrench(muscle, SPHM_END_INSERTION).force_N[0] / still;
}

TEST(ForceVelocity, BarFollowsHillsHyperbola) {
    for (double speed : {0.0, 1.0 / 3, 2.0 / 3, 1.0, -2.0 / 3}) {
        double V = 0;
        const double ratio = force_ratio(speed, &V), mean = speed / (4 * 1.07);
        // Tissue beside the clamps cannot thicken and moves less, so that amid the bar it is faster than on
        // the mean: 1.23 to 1.30 times where it shortens, 1.44 times where it lengthens.
        if (speed == 0) {
            EXPECT_LT(std::fabs(V), 0.005);
        } else {
            EXPECT_GT(V / mean, 1.1) << speed;
            EXPECT_LT(V / mean, 1.5) << speed;
        }
        EXPECT_NEAR(ratio, hill(V, 0.25, 1.4), 0.05 * hill(V, 0.25, 1.4)) << speed;
    }
}

TEST(ForceVelocity, SnapshotContinuesBitForBit) {
    const std::string path = testing::TempDir() + "force_velocity_test.snapshot";
    const Muscle first = make(hill_bar()), second = make(hill_bar());
    load(first, SPHM_END_INSERTION, 1);
    ASSERT_EQ(sphm_muscle_activate(first.get(), 0.5, 0, nullptr), SPHM_OK);
    proceed(first, 0.01);
    ASSERT_EQ(sphm_muscle_save(first.get(), path.c_str(), nullptr), SPHM_OK);
    ASSERT_EQ(sphm_muscle_load(second.get(), path.c_str(), nullptr), SPHM_OK);
    std::remove(path.c_str());
    (void)wrench(second, 0); // looking changes nothing
    proceed(first, 0.01);
    proceed(second, 0.01);
    EXPECT_EQ(sphm_muscle_hash(first.get()), sphm_muscle_hash(second.get()));
}

} // namespace
