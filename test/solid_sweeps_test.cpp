// The sweeps of the solid tissue: patch test, rigid motions, momentum, energy, closed forms of a block.
#include "solid_scene.h"

#include <algorithm>
#include <memory>

#include <gtest/gtest.h>

namespace {

using solid::Scene;
using solid::Vector;

constexpr double kSpacing = 0.003;
constexpr bool kDouble = sizeof(sphm_real) == 8;

double size(const Vector &v) {
    return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}
double distance(const Vector &a, const Vector &b) {
    return size({a[0] - b[0], a[1] - b[1], a[2] - b[2]});
}

struct Filling {
    const char *name;
    double jitter;
    bool columns, uneven; // relative volumes
};
void PrintTo(const Filling &f, std::ostream *out) {
    *out << f.name;
}

class OnFilling : public testing::TestWithParam<Filling> {
  protected:
    const std::vector<Vector> points = solid::block({0.045, 0.03, 0.021}, kSpacing, GetParam().jitter);
    Scene scene{points,
                kSpacing,
                kSpacing *kSpacing *kSpacing,
                2.2,
                1,
                GetParam().columns,
                GetParam().uneven ? solid::uneven_volumes(points.size()) : std::vector<double>{}};
};
INSTANTIATE_TEST_SUITE_P(, OnFilling,
                         testing::Values(Filling{"lattice", 0, true, false},
                                         Filling{"lattice in rows", 0, false, false},
                                         Filling{"jittered", 0.25, true, false},
                                         Filling{"uneven lattice", 0, true, true},
                                         Filling{"uneven lattice in rows", 0, false, true},
                                         Filling{"uneven and jittered", 0.25, true, true}));

TEST_P(OnFilling, WeightsHaveAUnitMomentInside) {
    const double reach = 2.2 * kSpacing + 2 * 0.25 * kSpacing, size[3] = {0.045, 0.03, 0.021};
    double sum = 0, worst = 0;
    size_t inside = 0;
    for (size_t slot = 0; slot < scene.count; ++slot) {
        bool in = true;
        for (int d = 0; d < 3; ++d)
            in = in && std::fabs(double(scene.rest[d][slot])) < size[d] / 2 - reach;
        if (!in)
            continue;
        double moment = 0;
        for (size_t k = scene.rows.row_start[slot]; k < scene.rows.row_start[slot + 1]; ++k)
            for (int d = 0; d < 3; ++d)
                moment += double(scene.gradient.pair[4 * k + size_t(d)]) *
                          (double(scene.rest[d][size_t(scene.rows.slot[k])]) - double(scene.rest[d][slot])) /
                          3;
        sum += moment;
        worst = std::fmax(worst, std::fabs(moment - 1));
        ++inside;
    }
    ASSERT_GT(inside, 30u);
    if (GetParam().jitter == 0) {
        EXPECT_LT(worst, 1e-5);
    }
    EXPECT_NEAR(sum / double(inside), 1, 0.05);
}

TEST_P(OnFilling, AffineMotionGivesItsGradientExactlyBoundaryIncluded) {
    const double A[9] = {1.2, 0.3, -0.1, -0.2, 0.7, 0.15, 0.05, -0.25, 1.4};
    const double L[9] = {3, -1, 2, 0.5, -4, 1, 2, 2, 1};
    scene.prescribe(A, {0.01, -0.02, 0.005}, L);
    scene.sweep();
    double worst = 0, worst_rate = 0;
    for (size_t slot = 0; slot < scene.count; ++slot) {
        sphm_real H[9], rate[9];
        sphm_solid_deformation(&scene.lines, slot, H, rate);
        for (int d = 0; d < 9; ++d) {
            worst = std::fmax(worst, std::fabs(H[d] + (d % 4 == 0) - A[d]));
            worst_rate = std::fmax(worst_rate, std::fabs(rate[d] - L[d]));
        }
    }
    EXPECT_LT(worst, kDouble ? 1e-13 : 1e-5);
    EXPECT_LT(worst_rate, kDouble ? 1e-12 : 4e-5); // the same share of its largest entry, 4/s
    EXPECT_EQ(scene.gradient.regularised, 0u);
    EXPECT_EQ(scene.gradient.isolated, 0u);
}

// A block that is turned by 140 degrees and carried away feels nothing but rounding: compared with the force
// that a stretch of one per cent gives.
TEST_P(OnFilling, RigidMotionGivesNoForce) {
    scene.field.hourglass_Pa = 1e5;
    scene.field.viscosity_Pa_s = 20;
    scene.field.hourglass_time_s = sphm_real(1e-3);
    const double stretch[9] = {1.01, 0, 0, 0, 1, 0, 0, 0, 1};
    scene.prescribe(stretch, {0, 0, 0});
    scene.sweep();
    double scale = 0, largest = 0;
    for (size_t slot = 0; slot < scene.count; ++slot)
        for (int d = 0; d < 3; ++d)
            scale = std::fmax(scale, std::fabs(scene.force(slot)[d]));

    const double axis[3] = {2 / 7.0, 3 / 7.0, 6 / 7.0}, c = std::cos(2.44), s = std::sin(2.44);
    double R[9], spin[9];
    const double cross[9] = {0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            R[3 * i + j] = c * (i == j) + (1 - c) * axis[i] * axis[j] + s * cross[3 * i + j];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            spin[3 * i + j] = 0;
            for (int k = 0; k < 3; ++k)
                spin[3 * i + j] += 10 * cross[3 * i + k] * R[3 * k + j];
        }
    scene.prescribe(R, {0.03, 0.01, -0.02}, spin);
    scene.sweep();
    for (size_t slot = 0; slot < scene.count; ++slot)
        for (int d = 0; d < 3; ++d)
            largest = std::fmax(largest, std::fabs(scene.force(slot)[d]));
    EXPECT_GT(scale, 1e-3);
    EXPECT_LT(largest, scale * (kDouble ? 1e-10 : 1e-3));
}

// An affine state is free of hourglass force: switching it on changes nothing but rounding.
TEST_P(OnFilling, HourglassForceVanishesForAffineMotion) {
    const double A[9] = {1.2, 0.3, -0.1, -0.2, 0.7, 0.15, 0.05, -0.25, 1.4};
    scene.prescribe(A, {0, 0, 0});
    scene.field.constants = sphm_solid_constants{}; // no material
    scene.field.constants.optimal_stretch = 1;
    scene.field.hourglass_Pa = 1e5;
    scene.sweep();
    double largest = 0;
    for (size_t slot = 0; slot < scene.count; ++slot)
        for (int d = 0; d < 3; ++d)
            largest = std::fmax(largest, std::fabs(scene.force(slot)[d]));
    EXPECT_LT(largest, 1e5 * kSpacing * kSpacing * (kDouble ? 1e-13 : 1e-5));

    // It does resist what the gradients do not see: one particle moved against its neighbours.
    size_t middle = 0;
    for (size_t slot = 0; slot < scene.count; ++slot)
        if (distance(scene.rest_at(slot), {0, 0, 0}) < distance(scene.rest_at(middle), {0, 0, 0}))
            middle = slot;
    scene.motion(middle)[1] += sphm_real(0.1 * kSpacing);
    scene.sweep();
    EXPECT_LT(scene.force(middle)[1], -1e5 * kSpacing * kSpacing * 0.05);
}

struct Momenta {
    Vector linear{}, angular{};
};

Momenta momenta(Scene &scene) {
    Momenta m;
    for (size_t slot = 0; slot < scene.count; ++slot) {
        double x[3], p[3];
        for (int d = 0; d < 3; ++d) {
            x[d] = double(scene.rest[d][slot]) + scene.motion(slot)[d];
            p[d] = scene.mass_of(slot) * scene.motion(slot)[4 + d];
            m.linear[d] += p[d];
        }
        for (int d = 0; d < 3; ++d)
            m.angular[d] += x[(d + 1) % 3] * p[(d + 2) % 3] - x[(d + 2) % 3] * p[(d + 1) % 3];
    }
    return m;
}

// A free block, thrown, spinning, twisting and contracting all over.
void throw_it(Scene &scene) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> uniform(-0.02, 0.02);
    const double one[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, L[9] = {4, -8, 3, 9, -2, 5, 1, -3, -3};
    scene.prescribe(one, {0, 0, 0}, L);
    for (size_t slot = 0; slot < scene.count; ++slot)
        for (int d = 0; d < 3; ++d)
            scene.motion(slot)[4 + d] += sphm_real(uniform(random) + (d == 0 ? 0.1 : -0.05));
    std::fill(scene.activation.begin(), scene.activation.end(), sphm_real(0.005));
    scene.field.hourglass_Pa = 3e4;
}

TEST_P(OnFilling, FreeTissueKeepsItsMomenta) {
    throw_it(scene);
    const Momenta before = momenta(scene);
    scene.sweep();
    const double dt = 0.3 * scene.stable_step();
    for (int i = 0; i < 200; ++i)
        scene.step(dt);
    const Momenta after = momenta(scene);
    EXPECT_LT(distance(before.linear, after.linear), 1e-5 * size(before.linear));
    EXPECT_LT(distance(before.angular, after.angular), 1e-4 * size(before.angular));
}

// With damping too. The hourglass damping is exact in linear momentum; in angular momentum to the square of
// the hourglass deformation (doc/solid.md).
TEST_P(OnFilling, FreeDampedTissueKeepsItsMomenta) {
    throw_it(scene);
    scene.field.viscosity_Pa_s = 20;
    scene.field.hourglass_time_s = sphm_real(20 / 3e4);
    const Momenta before = momenta(scene);
    scene.sweep();
    const double dt = 0.3 * scene.stable_step();
    for (int i = 0; i < 200; ++i)
        scene.step(dt);
    const Momenta after = momenta(scene);
    EXPECT_LT(distance(before.linear, after.linear), 1e-5 * size(before.linear));
    EXPECT_LT(distance(before.angular, after.angular), 1e-3 * size(before.angular));
}

// The force is the adjoint of the gradient: its power is that of the stress in the volume of every particle.
TEST_P(OnFilling, PowerIsThatOfTheStress) {
    throw_it(scene);
    scene.field.hourglass_Pa = 0;
    for (size_t slot = 0; slot < scene.count; ++slot)
        for (int d = 0; d < 3; ++d)
            scene.motion(slot)[d] = sphm_real(0.1 * kSpacing * std::sin(200 * scene.rest[(d + 1) % 3][slot]));
    scene.sweep();
    double of_forces = 0, of_stress = 0, scale = 0;
    for (size_t slot = 0; slot < scene.count; ++slot) {
        sphm_real P[9], rate[9];
        scene.stress(slot, P, rate);
        for (int d = 0; d < 9; ++d) {
            const double power =
                scene.volume * double(scene.relative_volume[slot]) * double(P[d]) * double(rate[d]);
            of_stress += power;
            scale += std::fabs(power);
        }
        for (int d = 0; d < 3; ++d)
            of_forces += double(scene.force(slot)[d]) * double(scene.motion(slot)[4 + d]);
    }
    EXPECT_GT(std::fabs(of_stress), 0.01 * scale);
    EXPECT_NEAR(of_forces, -of_stress, (kDouble ? 1e-12 : 1e-5) * scale);
}

// The quadratic forms of which the gradient's eigenvalues are the largest, as whole matrices and by the
// formulas of gradient.h, against the particles' masses: the root of the mass is on either side.
struct Forms {
    size_t n;
    std::vector<double> gradient, hourglass; // [n * n]
    std::vector<double> divergence;          // [3n * 3n], of x, y, z of the first particle, of the second ...
};

std::array<double, 9> inverse(const std::array<double, 9> &m) {
    std::array<double, 9> adjugate{};
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
            adjugate[3 * j + i] = m[3 * ((i + 1) % 3) + (j + 1) % 3] * m[3 * ((i + 2) % 3) + (j + 2) % 3] -
                                  m[3 * ((i + 1) % 3) + (j + 2) % 3] * m[3 * ((i + 2) % 3) + (j + 1) % 3];
    const double determinant = m[0] * adjugate[0] + m[1] * adjugate[3] + m[2] * adjugate[6];
    for (double &a : adjugate)
        a /= determinant;
    return adjugate;
}

double bare_weight(const Vector &X) {
    const double q = 1 - size(X) / (2.2 * kSpacing);
    return q > 0 ? q * q * q * q : 0;
}

double unit_moment() {
    double sum = 0;
    for (int i = -3; i <= 3; ++i)
        for (int j = -3; j <= 3; ++j)
            for (int k = -3; k <= 3; ++k) {
                const Vector X = {i * kSpacing, j * kSpacing, k * kSpacing};
                sum += X[0] * X[0] * bare_weight(X);
            }
    return sum;
}

void add_square(const std::vector<double> &row, double factor, std::vector<double> &form) {
    for (size_t a = 0; a < row.size(); ++a)
        for (size_t b = 0; row[a] != 0 && b < row.size(); ++b)
            form[a * row.size() + b] += factor * row[a] * row[b];
}

Forms forms_of(const Scene &scene) {
    const size_t n = scene.count;
    Forms forms{n, std::vector<double>(n * n), std::vector<double>(n * n), std::vector<double>(9 * n * n)};
    const double unit = unit_moment();
    const auto between = [&](size_t i, size_t j) {
        const Vector a = scene.rest_at(i), b = scene.rest_at(j);
        return Vector{b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    };
    for (size_t i = 0; i < n; ++i) {
        std::array<double, 9> M{};
        std::vector<double> gradient[3], divergence(3 * n), jump(n);
        for (size_t j = 0; j < n; ++j)
            for (size_t d = 0; d < 9; ++d) {
                const Vector X = between(i, j);
                M[d] += bare_weight(X) / unit * X[d / 3] * X[d % 3];
            }
        const std::array<double, 9> B = inverse(M);
        for (size_t d = 0; d < 3; ++d) {
            gradient[d].assign(n, 0);
            for (size_t j = 0; j < n; ++j) {
                const Vector X = between(i, j);
                const double g =
                    bare_weight(X) / unit * (B[3 * d] * X[0] + B[3 * d + 1] * X[1] + B[3 * d + 2] * X[2]);
                gradient[d][j] += g;
                gradient[d][i] -= g;
            }
            add_square(gradient[d], double(scene.relative_volume[i]), forms.gradient);
            for (size_t j = 0; j < n; ++j)
                divergence[3 * j + d] = gradient[d][j];
        }
        add_square(divergence, double(scene.relative_volume[i]), forms.divergence);
        for (size_t j = 0; j < n; ++j) {
            const Vector X = between(i, j);
            if (j == i || bare_weight(X) == 0)
                continue;
            for (size_t k = 0; k < n; ++k)
                jump[k] = -(gradient[0][k] * X[0] + gradient[1][k] * X[1] + gradient[2][k] * X[2]) - (k == i);
            jump[j] += 1;
            add_square(jump, bare_weight(X) / unit / 2, forms.hourglass);
        }
    }
    for (size_t a = 0; a < n; ++a)
        for (size_t b = 0; b < n; ++b) {
            const double mass =
                std::sqrt(double(scene.relative_volume[a]) * double(scene.relative_volume[b]));
            forms.gradient[a * n + b] /= mass;
            forms.hourglass[a * n + b] /= mass;
            for (size_t d = 0; d < 9; ++d)
                forms.divergence[(3 * a + d / 3) * 3 * n + 3 * b + d % 3] /= mass;
        }
    return forms;
}

double largest_eigenvalue(const std::vector<double> &form, size_t n, int iterations) {
    std::mt19937 random(23);
    std::normal_distribution<double> normal;
    std::vector<double> v(n), next(n);
    for (double &x : v)
        x = normal(random);
    double eigenvalue = 0;
    for (int i = 0; i < iterations; ++i) {
        double square = 0;
        for (size_t a = 0; a < n; ++a) {
            next[a] = 0;
            for (size_t b = 0; b < n; ++b)
                next[a] += form[a * n + b] * v[b];
            square += next[a] * next[a];
        }
        eigenvalue = std::sqrt(square);
        for (size_t a = 0; a < n; ++a)
            v[a] = next[a] / eigenvalue;
    }
    return eigenvalue;
}

std::unique_ptr<Scene> small(double jitter) {
    const std::vector<Vector> points = solid::block({0.018, 0.015, 0.021}, kSpacing, jitter);
    return std::make_unique<Scene>(points, kSpacing, std::pow(kSpacing, 3), 2.2, 1, true,
                                   solid::uneven_volumes(points.size()));
}

struct Eigenvalues {
    double gradient, divergence, hourglass;
};
Eigenvalues eigenvalues_of(const Forms &forms) {
    return {largest_eigenvalue(forms.gradient, forms.n, 3000),
            largest_eigenvalue(forms.divergence, 3 * forms.n, 600),
            largest_eigenvalue(forms.hourglass, forms.n, 3000)};
}

// The step limits stand on them: never below the exact ones.
TEST(UnevenSolid, EigenvaluesAreThoseOfTheForms) {
    for (const double jitter : {0.0, 0.25}) {
        const auto made = small(jitter);
        const sphm_gradient &found = made->gradient;
        const Eigenvalues exact = eigenvalues_of(forms_of(*made));
        EXPECT_GE(found.gradient_eigenvalue, exact.gradient);
        EXPECT_LE(found.gradient_eigenvalue, 1.0501 * exact.gradient);
        EXPECT_GE(found.divergence_eigenvalue, exact.divergence);
        EXPECT_LE(found.divergence_eigenvalue, 1.0501 * exact.divergence);
        EXPECT_GE(found.hourglass_eigenvalue, exact.hourglass);
        EXPECT_LE(found.hourglass_eigenvalue, 1.0501 * exact.hourglass);
        EXPECT_GT(exact.divergence, 1.3 * exact.gradient); // corners
    }
}

// (div u)^2 + s (2 |grad u|^2 + hourglass) is what bulk and viscosity do to a step, s = 2 eta/(dt K). Its
// largest eigenvalue is at most the larger of l_G + s (2 l_G + l_H) and l_D + 2 s l_G, on which the step
// limit stands (doc/solid.md, "Time"). It is convex in s, and l_D at s = 0, so that it need not be seen but
// where the two are equal.
TEST(UnevenSolid, DivergencesBeyondGradientsHaveNextToNoHourglass) {
    for (const double jitter : {0.0, 0.25}) {
        const auto made = small(jitter);
        Forms forms = forms_of(*made);
        const Eigenvalues l = eigenvalues_of(forms);
        const size_t n = forms.n;
        const double s = (l.divergence - l.gradient) / l.hourglass;
        for (size_t a = 0; a < n; ++a)
            for (size_t b = 0; b < n; ++b)
                for (size_t d = 0; d < 3; ++d)
                    forms.divergence[(3 * a + d) * 3 * n + 3 * b + d] +=
                        s * (2 * forms.gradient[a * n + b] + forms.hourglass[a * n + b]);
        const double both = largest_eigenvalue(forms.divergence, 3 * n, 600),
                     bound = l.divergence + 2 * s * l.gradient;
        EXPECT_LT(both, bound);
        EXPECT_GT(both, 0.8 * bound);
    }
}

// How many times its first kinetic energy free tissue has at most, in 3000 steps of this share of the limit.
double growth(double hourglass_Pa, double viscosity_Pa_s, bool material, double share) {
    const auto made = small(0);
    Scene &scene = *made;
    std::mt19937 random(11);
    std::uniform_real_distribution<double> uniform(-1e-3, 1e-3);
    for (size_t slot = 0; slot < scene.count; ++slot)
        for (int d = 4; d < 7; ++d)
            scene.motion(slot)[d] = sphm_real(uniform(random));
    if (!material) {
        scene.field.constants = sphm_solid_constants{};
        scene.field.constants.optimal_stretch = 1;
    }
    scene.field.hourglass_Pa = sphm_real(hourglass_Pa);
    scene.field.viscosity_Pa_s = sphm_real(viscosity_Pa_s);
    scene.field.hourglass_time_s = sphm_real(hourglass_Pa > 0 ? viscosity_Pa_s / hourglass_Pa : 0);
    const double first = scene.kinetic_energy();
    double most = first;
    scene.sweep();
    for (int i = 0; i < 3000 && most < 1e6 * first; ++i) {
        scene.step(share * scene.stable_step());
        const double energy = scene.kinetic_energy();
        most = std::isfinite(energy) ? std::fmax(most, energy) : INFINITY;
    }
    return most / first;
}

// Each term by itself, and all together, where the limit is not sharp: their largest eigenvalues are those of
// different motions.
TEST(UnevenSolid, StepLimitHoldsAndIsNear) {
    EXPECT_LT(growth(1e4, 0, false, 0.99), 2);
    EXPECT_GT(growth(1e4, 0, false, 1.04), 1e4);
    EXPECT_LT(growth(0, 0, true, 0.99), 2);
    EXPECT_GT(growth(0, 0, true, 1.08), 1e4);
    for (const double viscosity_Pa_s : {0.0, 2.0, 5.0, 20.0}) {
        EXPECT_LT(growth(0, viscosity_Pa_s, true, 0.99), 2) << viscosity_Pa_s;
        EXPECT_GT(growth(0, viscosity_Pa_s, true, 1.4), 1e4) << viscosity_Pa_s;
        EXPECT_LT(growth(1e4, viscosity_Pa_s, true, 0.99), 2) << viscosity_Pa_s;
        EXPECT_GT(growth(1e4, viscosity_Pa_s, true, 1.6), 1e4) << viscosity_Pa_s;
    }
}

// So that the default viscosity has the step it had without the bulk's excess.
TEST(UnevenSolid, ViscosityCoversWhatTheBulkExceedsGradientsBy) {
    const auto made = small(0);
    Scene &scene = *made;
    scene.field.hourglass_Pa = sphm_real(1e4);
    scene.sweep();
    const auto step = [&](double viscosity_Pa_s) {
        scene.field.viscosity_Pa_s = sphm_real(viscosity_Pa_s);
        return scene.stable_step();
    };
    const double undamped = step(0), damped = step(20);
    scene.gradient.divergence_eigenvalue = scene.gradient.gradient_eigenvalue;
    EXPECT_LT(undamped, 0.9 * step(0));
    EXPECT_EQ(damped, step(20));
}

// A block on rollers: stretched to `along` in x, and to `across` in y or free there, free in z. The uniform
// state is the solution, so stretches and force must be those of the material at a point.
struct Stretched {
    double F[3];    // measured amid the block
    double force_N; // on the rollers at +x
};

Stretched pull(double along, double across, double activation, int coupling) {
    Scene scene(solid::block({0.045, 0.027, 0.015}, kSpacing), kSpacing, kSpacing * kSpacing * kSpacing);
    scene.field.constants = solid::table3(coupling);
    scene.field.hourglass_Pa = 3e4;
    scene.field.viscosity_Pa_s = 20;
    scene.field.hourglass_time_s = sphm_real(20 / 3e4);
    std::fill(scene.activation.begin(), scene.activation.end(), sphm_real(activation));
    const double end[2] = {0.0225 - 3.1 * kSpacing, 0.0135 - 3.1 * kSpacing};
    for (int i = 0; i < 2500; ++i) {
        scene.sweep();
        const double dt = 0.8 * scene.stable_step(), keep = std::exp(-150 * dt);
        for (size_t slot = 0; slot < scene.count; ++slot)
            for (int d = 0; d < 3; ++d) {
                const Scene::Motion m = scene.motion(slot);
                const double X = scene.rest[d][slot], stretch = d == 0 ? along : across;
                if (d < 2 && stretch > 0 && std::fabs(X) > end[d]) {
                    m[d] = sphm_real((stretch - 1) * X);
                    continue;
                }
                m[4 + d] = sphm_real(keep * m[4 + d] + dt * scene.force(slot)[d] / scene.mass_of(slot));
                m[d] += sphm_real(dt) * m[4 + d];
            }
    }
    Stretched s{};
    for (size_t slot = 0; slot < scene.count; ++slot)
        if (scene.rest[0][slot] > end[0])
            s.force_N -= scene.force(slot)[0];
    size_t middle = 0;
    for (size_t slot = 0; slot < scene.count; ++slot)
        if (std::hypot(scene.rest[0][slot], scene.rest[1][slot], scene.rest[2][slot]) < kSpacing / 2)
            middle = slot;
    sphm_real H[9], rate[9];
    sphm_solid_deformation(&scene.lines, middle, H, rate);
    for (int d = 0; d < 3; ++d)
        s.F[d] = 1 + H[4 * d];
    return s;
}

// The same by the material alone: free sides found by bisection on their stress, one inside the other.
double free_side(const std::function<double(double)> &stress) {
    double low = 0.3, high = 3;
    for (int i = 0; i < 60; ++i)
        (stress((low + high) / 2) > 0 ? high : low) = (low + high) / 2;
    return (low + high) / 2;
}

double nominal(const sphm_solid_constants &c, double activation, const Vector &stretch, int d) {
    const sphm_real F[9] = {sphm_real(stretch[0]), 0, 0, 0, sphm_real(stretch[1]), 0, 0, 0,
                            sphm_real(stretch[2])};
    const sphm_real f0[3] = {1, 0, 0};
    sphm_real P[9];
    sphm_fibre_stress fibre;
    sphm_solid_stress(F, f0, sphm_real(activation), &c, P, &fibre);
    return P[4 * d];
}

void expect_closed_form(double along, double across, double activation, int coupling) {
    const sphm_solid_constants c = solid::table3(coupling);
    const auto z_of = [&](double y) {
        return free_side([&](double z) { return nominal(c, activation, {along, y, z}, 2); });
    };
    const double y = across > 0 ? across : free_side([&](double side) {
        return nominal(c, activation, {along, side, z_of(side)}, 1);
    });
    const double z = z_of(y), P = nominal(c, activation, {along, y, z}, 0), area = 0.027 * 0.015;
    const Stretched s = pull(along, across, activation, coupling);
    EXPECT_NEAR(s.F[0], along, 0.002);
    EXPECT_NEAR(s.F[1], y, 0.004);
    EXPECT_NEAR(s.F[2], z, 0.004);
    EXPECT_NEAR(s.force_N, P * area, 0.01 * std::fabs(P * area));
}

TEST(SolidBlock, UniaxialStretchMeetsTheClosedForm) {
    expect_closed_form(1.2, 0, 0, SPHM_FIBRE_TRUE_STRETCH);
    expect_closed_form(1.2, 0, 0.2, SPHM_FIBRE_TRUE_STRETCH);
    expect_closed_form(1.2, 0, 0.2, SPHM_FIBRE_VOLUME_FREE);
}

TEST(SolidBlock, BiaxialStretchMeetsTheClosedForm) {
    expect_closed_form(1.15, 1.1, 0, SPHM_FIBRE_TRUE_STRETCH);
    expect_closed_form(1.1, 0.9, 0.1, SPHM_FIBRE_TRUE_STRETCH);
}

} // namespace
