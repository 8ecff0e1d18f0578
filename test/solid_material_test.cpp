// The solid material at a point against its own energy (differences), closed forms and symmetry.
#include "kernels/solid.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace {

constexpr bool kDouble = sizeof(sphm_real) == 8;

// Table 3 of the paper, with what it leaves out as FEM practice has it.
sphm_solid_constants table3(int coupling = SPHM_FIBRE_TRUE_STRETCH) {
    sphm_solid_constants c{};
    c.along_fibre_shear_Pa = 500;
    c.cross_fibre_shear_Pa = 500;
    c.bulk_Pa = 1e5;
    c.max_isometric_stress_Pa = 3e5;
    c.optimal_stretch = sphm_real(1.07);
    c.passive_linear_stretch = sphm_real(1.4);
    c.passive_coefficient = sphm_real(0.05);
    c.passive_exponent = sphm_real(6.6);
    c.fibre_coupling = coupling;
    return c;
}

// The energies again, written down independently from the definitions on Cbar, in long double.
long double matrix_energy(const long double F[9], const double f0[3], const sphm_solid_constants &c) {
    const long double J = F[0] * (F[4] * F[8] - F[5] * F[7]) - F[1] * (F[3] * F[8] - F[5] * F[6]) +
                          F[2] * (F[3] * F[7] - F[4] * F[6]);
    const long double s = powl(J, -2.0L / 3);
    long double C[9];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            C[3 * i + j] = 0;
            for (int k = 0; k < 3; ++k)
                C[3 * i + j] += s * F[3 * k + i] * F[3 * k + j];
        }
    long double I4 = 0, I5 = 0;
    for (int i = 0; i < 3; ++i) {
        const long double b = C[3 * i] * f0[0] + C[3 * i + 1] * f0[1] + C[3 * i + 2] * f0[2];
        I4 += b * f0[i];
        I5 += b * b;
    }
    const long double I1 = C[0] + C[4] + C[8];
    const long double x = (I1 * I4 - I5) / (2 * sqrtl(I4)), B2 = acoshl(x < 1 ? 1 : x);
    return c.along_fibre_shear_Pa * (I5 / (I4 * I4) - 1) + c.cross_fibre_shear_Pa * B2 * B2 +
           c.bulk_Pa / 2 * logl(J) * logl(J);
}

struct Sample {
    sphm_real F[9], f0[3];
    long double F_exact[9];
    double f0_exact[3];
};

Sample random_sample(std::mt19937 &random, double spread) {
    std::uniform_real_distribution<double> uniform(-spread, spread);
    Sample s;
    double length = 0;
    for (int i = 0; i < 3; ++i) {
        s.f0_exact[i] = uniform(random) + (i == 0 ? 1 : 0);
        length += s.f0_exact[i] * s.f0_exact[i];
    }
    for (int i = 0; i < 3; ++i)
        s.f0[i] = sphm_real(s.f0_exact[i] /= std::sqrt(length));
    for (int i = 0; i < 9; ++i) {
        s.F[i] = sphm_real((i % 4 == 0 ? 1 : 0) + uniform(random));
        s.F_exact[i] = s.F[i];
    }
    return s;
}

TEST(SolidMaterial, StressIsTheDerivativeOfTheEnergy) {
    std::mt19937 random(7);
    auto c = table3();
    c.max_isometric_stress_Pa = 0; // the matrix alone: the fibre law is not an energy of the true stretch
    for (int trial = 0; trial < 50; ++trial) {
        Sample s = random_sample(random, 0.25);
        sphm_real P[9];
        sphm_fibre_stress fibre;
        sphm_solid_stress(s.F, s.f0, 0, &c, P, &fibre);
        for (int i = 0; i < 9; ++i) {
            const long double h = 1e-5L;
            long double up[9], down[9];
            for (int k = 0; k < 9; ++k)
                up[k] = down[k] = s.F_exact[k];
            up[i] += h;
            down[i] -= h;
            const double expected =
                double((matrix_energy(up, s.f0_exact, c) - matrix_energy(down, s.f0_exact, c)) / (2 * h));
            EXPECT_NEAR(P[i], expected, kDouble ? 1e-3 : 1e5 * 2e-6) << "trial " << trial << " entry " << i;
        }
    }
}

TEST(SolidMaterial, CauchyStressIsSymmetricForBothFibreCouplings) {
    std::mt19937 random(11);
    for (int coupling : {SPHM_FIBRE_TRUE_STRETCH, SPHM_FIBRE_VOLUME_FREE}) {
        const auto c = table3(coupling);
        for (int trial = 0; trial < 50; ++trial) {
            Sample s = random_sample(random, 0.3);
            sphm_real P[9];
            sphm_fibre_stress fibre;
            sphm_solid_stress(s.F, s.f0, sphm_real(0.7), &c, P, &fibre);
            double tau[9] = {}, size = 0; // Kirchhoff stress P F^T
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    for (int k = 0; k < 3; ++k)
                        tau[3 * i + j] += double(P[3 * i + k]) * s.F[3 * j + k];
            for (double entry : tau)
                size = std::fmax(size, std::fabs(entry));
            const double bound = size * (kDouble ? 1e-12 : 4e-6);
            EXPECT_NEAR(tau[1], tau[3], bound);
            EXPECT_NEAR(tau[2], tau[6], bound);
            EXPECT_NEAR(tau[5], tau[7], bound);
        }
    }
}

TEST(SolidMaterial, RestAndRotationCarryNoStressWithoutFibreForce) {
    const auto c = table3();
    const double angle = 0.8;
    const sphm_real cosine = sphm_real(std::cos(angle)), sine = sphm_real(std::sin(angle));
    const sphm_real F[9] = {cosine, -sine, 0, sine, cosine, 0, 0, 0, 1}, f0[3] = {1, 0, 0};
    sphm_real P[9];
    sphm_fibre_stress fibre;
    EXPECT_NEAR(sphm_solid_stress(F, f0, 0, &c, P, &fibre), 1, 1e-6);
    for (double entry : P)
        EXPECT_NEAR(entry, 0, 1e5 * (kDouble ? 1e-14 : 3e-7));
}

TEST(SolidMaterial, UniaxialFibreStretchCarriesTheFibreLaw) {
    // Volume kept, fibre along x: along minus across = sigma_max (alpha f_a + f_p) r beyond the matrix.
    for (int coupling : {SPHM_FIBRE_TRUE_STRETCH, SPHM_FIBRE_VOLUME_FREE})
        for (double stretch : {0.7, 0.95, 1.07, 1.2, 1.45, 1.6})
            for (double alpha : {0.0, 0.5, 1.0}) {
                auto c = table3(coupling), matrix = c;
                matrix.max_isometric_stress_Pa = 0;
                const double side = 1 / std::sqrt(stretch);
                const sphm_real F[9] = {sphm_real(stretch), 0, 0, 0, sphm_real(side), 0, 0, 0,
                                        sphm_real(side)};
                const sphm_real f0[3] = {1, 0, 0};
                sphm_real P[9], without[9];
                sphm_fibre_stress fibre, ignored;
                sphm_solid_stress(F, f0, sphm_real(alpha), &c, P, &fibre);
                sphm_solid_stress(F, f0, sphm_real(alpha), &matrix, without, &ignored);
                const double r = stretch / 1.07;
                const double active = r <= 0.4 || r >= 1.6 ? 0
                                      : r < 0.6            ? 9 * (r - 0.4) * (r - 0.4)
                                      : r > 1.4            ? 9 * (r - 1.6) * (r - 1.6)
                                                           : 1 - 4 * (1 - r) * (1 - r);
                const double steep = 0.05 * std::exp(6.6 * 0.4);
                const double passive = r <= 1    ? 0
                                       : r < 1.4 ? 0.05 * (std::exp(6.6 * (r - 1)) - 1)
                                                 : steep - 0.05 + 6.6 * steep * (r - 1.4);
                const double cauchy = 3e5 * (alpha * active + passive) * r;
                const double along = (P[0] - without[0]) * stretch, across = (P[4] - without[4]) * side;
                const double bound = 3e5 * (kDouble ? 1e-7 : 3e-6);
                EXPECT_NEAR(along - across, cauchy, bound) << stretch << " " << alpha;
                if (coupling == SPHM_FIBRE_TRUE_STRETCH)
                    EXPECT_NEAR(across, 0, bound); // the stress stands along the fibre alone
                else
                    EXPECT_NEAR(along + 2 * across, 0, bound); // a deviator has no trace
            }
}

TEST(SolidMaterial, SeriesOfTheCrossFibreAngleMeetsTheClosedForm) {
    for (double e = 1e-6; e < 0.2; e *= 1.3) {
        const long double x = sphm_real(1 + e), root = sqrtl(x * x - 1);
        EXPECT_NEAR(double(sphm_solid_angle_over_sinh(sphm_real(x))), double(acoshl(x) / root), 4e-7) << e;
    }
}

// Largest eigenvalue of C^-1, by taking powers of it.
double largest_inverse(const Sample &s) {
    long double G[9], v[3] = {0.3L, 0.5L, 0.7L}, value = 0; // G = cof F: C^-1 = G^T G / J^2
    const long double *F = s.F_exact;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            G[3 * i + j] = F[3 * i1 + j1] * F[3 * i2 + j2] - F[3 * i1 + j2] * F[3 * i2 + j1];
        }
    const long double J = F[0] * G[0] + F[1] * G[1] + F[2] * G[2];
    for (int k = 0; k < 3000; ++k) {
        long double w[3] = {0, 0, 0}, next[3] = {0, 0, 0}, norm = 0;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                w[i] += G[3 * i + j] * v[j] / J;
        for (int i = 0; i < 3; ++i) {
            for (int j = 0; j < 3; ++j)
                next[i] += G[3 * j + i] * w[j] / J;
            norm += next[i] * next[i];
        }
        value = sqrtl(norm);
        for (int i = 0; i < 3; ++i)
            v[i] = next[i] / value;
    }
    return double(value);
}

double determinant(const Sample &s) {
    const long double *F = s.F_exact;
    return double(F[0] * (F[4] * F[8] - F[5] * F[7]) - F[1] * (F[3] * F[8] - F[5] * F[6]) +
                  F[2] * (F[3] * F[7] - F[4] * F[6]));
}

double thinning(const Sample &s) {
    sphm_real K[9];
    sphm_solid_cofactor(s.F, K);
    return double(sphm_solid_thinning(K, sphm_real(1 / determinant(s))));
}

TEST(SolidMaterial, ThinningBoundsHowMuchFasterGradientsVary) {
    std::mt19937 random(13);
    int trials = 0;
    while (trials < 200) {
        const Sample s = random_sample(random, 0.6);
        if (determinant(s) < 0.2)
            continue;
        ++trials;
        const double exact = largest_inverse(s), bound = thinning(s);
        EXPECT_GE(bound, exact * (1 - 1e-4));
        EXPECT_LE(bound, exact * (4.0 / 3 + 1e-4));
    }
    Sample shortened{}; // a fibre at 0.4, its volume kept
    for (int i = 0; i < 9; ++i)
        shortened.F_exact[i] = i == 0 ? 0.4L : i % 4 == 0 ? 1 / sqrtl(0.4L) : 0;
    for (int i = 0; i < 9; ++i)
        shortened.F[i] = sphm_real(shortened.F_exact[i]);
    EXPECT_NEAR(thinning(shortened), 1 / 0.16, 1e-4);
}

// Work of the viscous stress on the motion a N: at rest eta (|a|^2 + (a.N)^2), and never more than 2 eta
// |a|^2.
TEST(SolidMaterial, NoDeformationMakesAParticleMoreViscousThanAtRest) {
    std::mt19937 random(17);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const double eta = 20;
    int trials = 0;
    double most = 0;
    while (trials < 2000) {
        Sample s = random_sample(random, 0.6);
        const double J = determinant(s);
        if (J < 0.2)
            continue;
        ++trials;
        double a[3], N[3], aa = 0, NN = 0, aN = 0, work = 0, at_rest = 0;
        for (int i = 0; i < 3; ++i) {
            a[i] = uniform(random), N[i] = uniform(random);
            aa += a[i] * a[i], NN += N[i] * N[i], aN += a[i] * N[i];
        }
        const sphm_real identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        sphm_real rate[9], P[9] = {}, rest[9] = {};
        for (int i = 0; i < 9; ++i)
            rate[i] = sphm_real(a[i / 3] * N[i % 3]);
        sphm_solid_add_viscous_stress(s.F, rate, sphm_real(eta), sphm_real(1 / J), P);
        sphm_solid_add_viscous_stress(identity, rate, sphm_real(eta), 1, rest);
        for (int i = 0; i < 9; ++i)
            work += double(P[i]) * rate[i], at_rest += double(rest[i]) * rate[i];
        EXPECT_NEAR(at_rest, eta * (aa * NN + aN * aN), 1e-4 * eta * aa * NN);
        EXPECT_GE(work, 0);
        most = std::fmax(most, work / (2 * eta * aa * NN));
    }
    EXPECT_LE(most, 1 + 1e-4);
    EXPECT_GT(most, 0.8); // and some come near it
}

// Second difference of the matrix's energy along p N, unit vectors: the stiffness against a wave. Of fibres
// that are short and sheared at once it is a hundred times that at rest.
TEST(SolidMaterial, WaveModulusBoundsTheStiffnessOfTheMatrix) {
    std::mt19937 random(23);
    std::uniform_real_distribution<double> uniform(-1, 1);
    auto c = table3();
    c.max_isometric_stress_Pa = 0;
    double most = 0;
    int trials = 0;
    while (trials < 400) {
        Sample s = random_sample(random, 0.6);
        if (trials % 2) { // shortened to 0.15 ... 0.6, sheared by up to 4 along the fibre
            const double stretch = 0.375 + 0.225 * uniform(random), side = 1 / std::sqrt(stretch);
            const double F[9] = {stretch, 4 * uniform(random), 4 * uniform(random), 0, side, 0, 0, 0, side};
            for (int i = 0; i < 9; ++i)
                s.F_exact[i] = s.F[i] = sphm_real(F[i]);
            s.f0_exact[0] = s.f0[0] = 1;
            s.f0_exact[1] = s.f0[1] = s.f0_exact[2] = s.f0[2] = 0;
        }
        const double J = determinant(s);
        if (J < 0.3)
            continue;
        ++trials;
        sphm_real P[9];
        sphm_fibre_stress fibre;
        sphm_solid_stress(s.F, s.f0, 0, &c, P, &fibre);
        const double modulus = double(sphm_solid_wave_modulus(s.F, sphm_real(J), s.f0, &fibre, &c));
        for (int direction = 0; direction < 30; ++direction) {
            double p[3], N[3], pp = 0, NN = 0;
            for (int i = 0; i < 3; ++i) {
                p[i] = uniform(random), N[i] = direction % 3 ? uniform(random) : s.f0_exact[i];
                pp += p[i] * p[i], NN += N[i] * N[i];
            }
            long double up[9], down[9], h = 1e-4L / sqrtl(pp * NN);
            for (int i = 0; i < 9; ++i) {
                up[i] = s.F_exact[i] + h * p[i / 3] * N[i % 3];
                down[i] = s.F_exact[i] - h * p[i / 3] * N[i % 3];
            }
            const double stiffness =
                double((matrix_energy(up, s.f0_exact, c) - 2 * matrix_energy(s.F_exact, s.f0_exact, c) +
                        matrix_energy(down, s.f0_exact, c)) /
                       1e-8L);
            most = std::fmax(most, stiffness / modulus);
        }
    }
    EXPECT_LE(most, 1);
    EXPECT_GT(most, 0.5);
}

TEST(SolidMaterial, CompressiveFibreStiffnessActsBelowRestLengthOnly) {
    auto c = table3();
    c.passive_compressive_Pa = 1e4;
    EXPECT_NEAR(sphm_solid_fibre_stress(sphm_real(0.8), 0, &c).passive_Pa, -2000, 0.01);
    EXPECT_EQ(sphm_solid_fibre_stress(sphm_real(1.01), 0, &c).passive_Pa, 0);
}

TEST(SolidMaterial, AnInvertedParticleIsReported) {
    const auto c = table3();
    const sphm_real F[9] = {-1, 0, 0, 0, 1, 0, 0, 0, 1}, f0[3] = {1, 0, 0};
    sphm_real P[9];
    sphm_fibre_stress fibre;
    EXPECT_LT(sphm_solid_stress(F, f0, 0, &c, P, &fibre), 0);
    EXPECT_TRUE(std::isnan(P[0]));
}

} // namespace
