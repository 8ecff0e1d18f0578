// Smoothing kernels and the fluid at a point, against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "kernels/fluid.h"

namespace {

// int over the ball of radius h of f(r/h), midpoint rule.
double integrate(double h, const std::function<double(double)> &f) {
    const int n = 20000;
    double sum = 0;
    for (int i = 0; i < n; ++i) {
        const double q = (i + 0.5) / n;
        sum += f(q) * 4 * SPHM_PI * q * q;
    }
    return sum * h * h * h / n;
}

TEST(Kernels, InverseSquareRootIsExactToRounding) {
    for (double x = 1e-18; x < 1e18; x *= 1.37) {
        const double y = static_cast<double>(sphm_inverse_sqrt(static_cast<sphm_real>(x)));
        EXPECT_NEAR(y * std::sqrt(static_cast<double>(static_cast<sphm_real>(x))), 1, 3e-7) << x;
    }
}

TEST(Kernels, Poly6IntegratesToOne) {
    for (double h : {0.0053, 0.02, 1.0})
        EXPECT_NEAR(integrate(h,
                              [h](double q) {
                                  return sphm_poly6_factor(h) *
                                         static_cast<double>(sphm_poly6(static_cast<sphm_real>(q * q)));
                              }),
                    1, 1e-5);
}

// W(r) = -int_r^h W' integrates to one: int W dV = -int W' r/3 dV. And its mean gradient is a pure
// divergence.
TEST(Kernels, SpikyGradientBelongsToAKernelThatIntegratesToOne) {
    const double h = 0.013;
    EXPECT_NEAR(integrate(h,
                          [h](double q) {
                              const auto inverse = static_cast<sphm_real>(1 / q);
                              const double slope = sphm_spiky_factor(h) * q *
                                                   static_cast<double>(sphm_spiky_gradient(
                                                       static_cast<sphm_real>(q), inverse));
                              return slope * q * h / 3;
                          }),
                1, 1e-5);
}

// For a kernel that vanishes at h with its slope, int lap W r^2 dV = 6 int W dV.
TEST(Kernels, ViscosityLaplacianBelongsToAKernelThatIntegratesToOne) {
    const double h = 0.004;
    EXPECT_NEAR(integrate(h,
                          [h](double q) {
                              const double laplacian =
                                  sphm_viscosity_factor(h) *
                                  static_cast<double>(sphm_viscosity_laplacian(static_cast<sphm_real>(q)));
                              return laplacian * q * q * h * h / 6;
                          }),
                1, 1e-5);
}

TEST(Kernels, VanishFromTheSupportRadiusOn) {
    for (sphm_real q : {sphm_real(1), sphm_real(1.02), sphm_real(7)}) {
        EXPECT_EQ(sphm_poly6(q * q), 0);
        EXPECT_EQ(sphm_spiky_gradient(q, 1 / q), 0);
        EXPECT_EQ(sphm_viscosity_laplacian(q), 0);
    }
}

// Stress of pairwise pulls, 1/2 int s r n n dV, with the weights of the sweep: T f f and nothing else.
TEST(Kernels, FibrePullsAddUpToTensionAlongTheFibreOnly) {
    const double h = 1;
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    double along = 0, across = 0;
    const int rays = 400000;
    for (int i = 0; i < rays; ++i) {
        double n[3] = {normal(random), normal(random), normal(random)};
        const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        const double pull = static_cast<double>(sphm_fibre_pull(static_cast<sphm_real>(n[0] / length), 1, 1));
        along += pull * n[0] * n[0] / (length * length) / rays;
        across += pull * n[1] * n[1] / (length * length) / rays;
    }
    const double radial = integrate(h, [](double q) {
        return q * static_cast<double>(
                       sphm_spiky_gradient(static_cast<sphm_real>(q), static_cast<sphm_real>(1 / q)));
    });
    const double strength = 2 * sphm_spiky_factor(h) * SPHM_TENSION_STIFFNESS; // T_i + T_j = 2
    EXPECT_NEAR(0.5 * strength * radial * along, 1, 0.01);
    EXPECT_NEAR(0.5 * strength * radial * across, 0, 0.01);
}

// Half as long, fibres pull half as strongly with a slope of 1; what pushes across stays.
TEST(Kernels, TheSlopeWeakensPullsAlongShortenedFibresOnly) {
    EXPECT_FLOAT_EQ(float(sphm_fibre_pull(1, 0, sphm_real(0.5))), 4);
    EXPECT_FLOAT_EQ(float(sphm_fibre_pull(1, 1, sphm_real(0.5))), 1.5);
    EXPECT_FLOAT_EQ(float(sphm_fibre_pull(0, 1, sphm_real(0.5))), -1);
}

// Second moment of the pulls' change along the fibre, with the weights of the test above.
TEST(Kernels, TheSlopeAddsItsModulusAlongTheFibre) {
    double modulus = 0;
    const int slices = 2000;
    for (int i = 0; i < slices; ++i) {
        const double c = (i + 0.5) / slices;   // even in the cosine
        const auto pull = [c](double strain) { // of a pair in tissue stretched along the fibre
            return double(sphm_fibre_pull(sphm_real(c), 1, sphm_real(1 + strain * c * c)));
        };
        modulus += 1.5 * (pull(0.1) - pull(0)) / 0.1 * c * c / slices;
    }
    EXPECT_NEAR(modulus, SPHM_TENSION_MODULUS, 1e-4);
}

TEST(Kernels, PairStiffnessGivesTheShearModulus) {
    const double moment = integrate(1, [](double q) {
        return q * q *
               static_cast<double>(
                   sphm_spiky_gradient(static_cast<sphm_real>(q), static_cast<sphm_real>(1 / q)));
    });
    EXPECT_NEAR(SPHM_PAIR_STIFFNESS * moment / 30, 1, 1e-5);
}

TEST(Kernels, SteeringTurnsButNeverAddsSpeed) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> unit(-1, 1);
    for (int i = 0; i < 1000; ++i) {
        sphm_real v[3], f[3] = {sphm_real(0.6), 0, sphm_real(0.8)};
        for (sphm_real &c : v)
            c = static_cast<sphm_real>(unit(random));
        const sphm_real before = v[0] * f[0] + v[1] * f[1] + v[2] * f[2];
        const double speed = std::sqrt(double(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
        sphm_fibre_steer(1, f[0], f[1], f[2], &v[0], &v[1], &v[2]);
        const sphm_real after = v[0] * f[0] + v[1] * f[1] + v[2] * f[2];
        EXPECT_NEAR(std::sqrt(double(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])), speed, 2e-6);
        EXPECT_GE(after * before, 0);
        EXPECT_GE(std::abs(after), std::abs(before) - sphm_real(1e-6));
    }
    sphm_real still[3] = {0, 0, 0}, f[3] = {1, 0, 0};
    sphm_fibre_steer(1, f[0], f[1], f[2], &still[0], &still[1], &still[2]);
    EXPECT_EQ(still[0], 0);
}

TEST(Kernels, ShapeMatchingIsARateWithinItsBounds) {
    sphm_fluid_constants c{};
    c.shape_matching_rad_per_s = 50;
    EXPECT_NEAR(sphm_shape_matching_coefficient(&c, 1e-3), 2.5e-3, 1e-9);
    EXPECT_EQ(sphm_shape_matching_coefficient(&c, 1), 1);
    c.shape_matching_floor = sphm_real(0.25);
    EXPECT_EQ(sphm_shape_matching_coefficient(&c, 1e-3), 0.25);
}

} // namespace
