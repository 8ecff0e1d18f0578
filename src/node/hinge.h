// One rotating joint: inertia, viscous friction, two stops.
//
//   I d(rate)/dt = torque - damping rate,   d(angle)/dt = rate
//
// Semi-implicit Euler with the friction taken implicitly: stable for any friction, and for a spring of
// stiffness k as long as k dt^2 < 4 I. At a stop the joint is at rest until the torque leads away from it.
#ifndef SPH_MUSCLE_NODE_HINGE_H
#define SPH_MUSCLE_NODE_HINGE_H

#include <algorithm>

namespace sph_muscle {

struct Hinge {
    double inertia_kg_m2 = 1, damping_Nm_s = 0;
    double lower_rad = -1e9, upper_rad = 1e9;
    double angle_rad = 0, rate_rad_per_s = 0;

    void advance(double torque_Nm, double time_s) {
        rate_rad_per_s = (rate_rad_per_s + time_s * torque_Nm / inertia_kg_m2) /
                         (1 + time_s * damping_Nm_s / inertia_kg_m2);
        const double free = angle_rad + time_s * rate_rad_per_s;
        angle_rad = std::min(upper_rad, std::max(lower_rad, free));
        if (angle_rad != free)
            rate_rad_per_s = 0;
    }
};

} // namespace sph_muscle
#endif
