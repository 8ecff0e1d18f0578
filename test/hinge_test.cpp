// The joint of the arm against closed forms.
#include "node/hinge.h"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using sph_muscle::Hinge;

// rate = torque/damping (1 - exp(-damping t/I)); Euler's error is of the order of dt damping/(2 I) = 0.1 %.
TEST(Hinge, ApproachesItsTerminalSpeed) {
    Hinge hinge;
    hinge.inertia_kg_m2 = 0.05;
    hinge.damping_Nm_s = 0.5;
    for (int tick = 0; tick < 1000; ++tick)
        hinge.advance(2.0, 2e-4);
    EXPECT_NEAR(hinge.rate_rad_per_s, 4 * (1 - std::exp(-0.2 * 0.5 / 0.05)), 4e-3);
}

// A spring of 20 Nm/rad on 0.05 kg m2 swings with 20 rad/s; at 250 Hz for a minute it neither grows nor
// decays.
TEST(Hinge, KeepsTheEnergyOfASpring) {
    Hinge hinge;
    hinge.inertia_kg_m2 = 0.05;
    hinge.angle_rad = 0.3;
    double last = 0, highest = 0, crossed_s = 0;
    int crossings = 0;
    for (int tick = 0; tick < 15000; ++tick) {
        last = hinge.angle_rad;
        hinge.advance(-20 * hinge.angle_rad, 0.004);
        if (last < 0 && hinge.angle_rad >= 0) {
            ++crossings;
            crossed_s = tick * 0.004;
        }
        if (tick >= 14000)
            highest = std::fmax(highest, hinge.angle_rad);
    }
    EXPECT_NEAR(highest, 0.3, 0.01);
    EXPECT_NEAR(crossed_s / (crossings - 0.25), 2 * std::acos(-1.0) / 20, 5e-4);
}

TEST(Hinge, RestsAtItsStopsAndLeavesThem) {
    Hinge hinge;
    hinge.lower_rad = 0.1;
    hinge.upper_rad = 2;
    hinge.angle_rad = 1;
    for (int tick = 0; tick < 1000; ++tick)
        hinge.advance(50, 0.004);
    EXPECT_EQ(hinge.angle_rad, 2);
    EXPECT_EQ(hinge.rate_rad_per_s, 0);
    hinge.advance(-1, 0.004);
    EXPECT_LT(hinge.angle_rad, 2);
    EXPECT_NEAR(hinge.rate_rad_per_s, -0.004, 1e-12);
}

TEST(Hinge, IsStableWithAnyFriction) {
    Hinge hinge;
    hinge.inertia_kg_m2 = 1e-3;
    hinge.damping_Nm_s = 1e3;
    for (int tick = 0; tick < 100; ++tick)
        hinge.advance(1, 0.01);
    EXPECT_NEAR(hinge.rate_rad_per_s, 1e-3, 1e-9);
}

} // namespace
