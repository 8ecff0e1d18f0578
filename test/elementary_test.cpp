// Branch-free elementary functions against libm.
#include "kernels/elementary.h"

#include <cmath>

#include <gtest/gtest.h>

namespace {

constexpr double kUnit = sizeof(sphm_real) == 8 ? 2.3e-16 : 1.2e-7; // one unit in the last place, relative

TEST(Elementary, LogarithmIsAccurateEverywhereAndNearOne) {
    for (double x = 1e-30; x < 1e30; x *= 1.37) {
        const double rounded = double(sphm_real(x)), exact = std::log(rounded);
        EXPECT_NEAR(double(sphm_ln(sphm_real(x))), exact, 3 * kUnit * std::fabs(exact)) << x;
    }
    for (double e = -0.3; e < 0.4; e += 0.00037) {
        const double rounded = double(sphm_real(1 + e)), exact = std::log(rounded);
        EXPECT_NEAR(double(sphm_ln(sphm_real(1 + e))), exact, 3 * kUnit * std::fabs(exact)) << e;
    }
    EXPECT_EQ(sphm_ln(1), 0);
}

TEST(Elementary, ExponentialIsAccurateAndSaturates) {
    for (double x = -80; x < 80; x += 0.0371) {
        const double exact = std::exp(double(sphm_real(x)));
        EXPECT_NEAR(double(sphm_exp(sphm_real(x))), exact, 3 * kUnit * exact) << x;
    }
    EXPECT_EQ(sphm_exp(0), 1);
    EXPECT_TRUE(std::isfinite(sphm_exp(sphm_real(1e30))));
    EXPECT_GT(sphm_exp(sphm_real(1e30)), 1e30);
    EXPECT_LT(sphm_exp(sphm_real(-1e30)), 1e-30);
    EXPECT_GE(sphm_exp(sphm_real(-1e30)), 0);
}

} // namespace
