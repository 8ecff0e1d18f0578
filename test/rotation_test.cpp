// The best rotation of a moment matrix: exact for rotated shapes, proper for every matrix.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "kernels/vector.h"

namespace {

struct Matrix {
    double m[9];
};

Matrix rotation(double angle, double x, double y, double z) {
    const double length = std::sqrt(x * x + y * y + z * z), c = std::cos(angle), s = std::sin(angle);
    x /= length, y /= length, z /= length;
    return {{c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s, y * x * (1 - c) + z * s,
             c + y * y * (1 - c), y * z * (1 - c) - x * s, z * x * (1 - c) - y * s, z * y * (1 - c) + x * s,
             c + z * z * (1 - c)}};
}

Matrix product(const Matrix &a, const Matrix &b) {
    Matrix out{};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k)
                out.m[3 * i + j] += a.m[3 * i + k] * b.m[3 * k + j];
    return out;
}

Matrix transposed(const Matrix &a) {
    Matrix out;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            out.m[3 * i + j] = a.m[3 * j + i];
    return out;
}

double determinant(const Matrix &a) {
    const double *m = a.m;
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
}

double distance(const Matrix &a, const Matrix &b) {
    double worst = 0;
    for (int i = 0; i < 9; ++i)
        worst = std::fmax(worst, std::fabs(a.m[i] - b.m[i]));
    return worst;
}

Matrix best(const Matrix &a) {
    Matrix r;
    sphm_best_rotation(a.m, r.m);
    return r;
}

void expect_proper(const Matrix &r) {
    EXPECT_LT(distance(product(r, transposed(r)), {{1, 0, 0, 0, 1, 0, 0, 0, 1}}), 1e-14);
    EXPECT_NEAR(determinant(r), 1, 1e-14);
}

TEST(Rotation, IsFoundBehindAnySymmetricPositiveStretch) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> u(-1, 1);
    for (int trial = 0; trial < 500; ++trial) {
        const Matrix r = rotation(3.14 * u(random), u(random), u(random), u(random) + 1e-3);
        const Matrix q = rotation(3 * u(random), u(random), u(random), u(random) + 1e-3);
        const double scale = std::pow(10, 6 * u(random));
        const Matrix d = {{scale, 0, 0, 0, scale * (0.02 + 0.01 * u(random)), 0, 0, 0, scale * 0.03}};
        const Matrix a = product(r, product(product(q, d), transposed(q)));
        EXPECT_LT(distance(best(a), r), 1e-13);
    }
}

TEST(Rotation, OfASymmetricPositiveMatrixIsExactlyTheIdentity) {
    const Matrix r = best({{3, 0.3, -0.2, 0.3, 0.5, 0.1, -0.2, 0.1, 0.4}});
    EXPECT_EQ(distance(r, {{1, 0, 0, 0, 1, 0, 0, 0, 1}}), 0);
}

TEST(Rotation, OfAFlatShapeIsUnique) {
    const Matrix r = rotation(2.2, 1, -2, 0.5);
    const Matrix flat = {{2, 0.1, 0, 0.1, 1, 0, 0, 0, 0}};
    EXPECT_LT(distance(best(product(r, flat)), r), 1e-13);
}

TEST(Rotation, OfAThreadIsTheSmallestOne) {
    // A thread along x turned about z: turning about itself is free, and is not done.
    const Matrix r = rotation(1.1, 0, 0, 1);
    EXPECT_LT(distance(best(product(r, {{1, 0, 0, 0, 0, 0, 0, 0, 0}})), r), 1e-12);
}

TEST(Rotation, IsProperForMirroredEmptyAndRandomMatrices) {
    expect_proper(best({{1, 0, 0, 0, 1, 0, 0, 0, -1}}));
    expect_proper(best({{-1, 0, 0, 0, -1, 0, 0, 0, -1}}));
    expect_proper(best({{-1, 0, 0, 0, -1, 0, 0, 0, 1}})); // half a turn about z
    EXPECT_EQ(distance(best({{0, 0, 0, 0, 0, 0, 0, 0, 0}}), {{1, 0, 0, 0, 1, 0, 0, 0, 1}}), 0);
    std::mt19937 random(2);
    std::normal_distribution<double> u;
    for (int trial = 0; trial < 500; ++trial) {
        Matrix a;
        for (double &value : a.m)
            value = u(random);
        expect_proper(best(a));
    }
}

TEST(Rotation, EndsForNonfiniteMatrices) {
    const Matrix r = best({{NAN, 0, 0, 0, 1, 0, 0, INFINITY, 1}});
    (void)r; // nothing to promise but that it returns
}

} // namespace
