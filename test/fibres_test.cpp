/* Fibre directions: turned, from a file, and along the Laplace field. */
#include <gtest/gtest.h>

#include <cstdio>

#include "core/vec3.h"
#include "shapes.h"

namespace {

using shapes::Body;

sphm_parameters bar(int fibres) {
    sphm_parameters p = sphm_parameters_default();
    p.preset = SPHM_PRESET_BAR;
    p.belly_length = 0.08;
    p.belly_width = p.belly_thickness = 0.012;
    p.particles = 1440;
    p.fibres = fibres;
    return p;
}

/* A file in the folder of the test that removes itself. */
struct TextFile {
    std::string path;
    explicit TextFile(const std::string &text) : path(testing::TempDir() + "sphm_fibres_test.txt") {
        FILE *file = std::fopen(path.c_str(), "w");
        EXPECT_NE(file, nullptr);
        std::fputs(text.c_str(), file);
        std::fclose(file);
    }
    ~TextFile() { std::remove(path.c_str()); }
};

std::string refusal(const std::string &text) {
    TextFile file(text);
    sphm_parameters p = bar(SPHM_FIBRES_FILE);
    std::snprintf(p.fibre_file, sizeof p.fibre_file, "%s", file.path.c_str());
    Body made(p);
    EXPECT_EQ(made.status, SPHM_REFUSED_FILE);
    EXPECT_EQ(made.body.positions, nullptr);
    return made.context.message;
}

TEST(Fibres, PennateTurnsInTheBroadPlane) {
    sphm_parameters p = sphm_parameters_default();
    p.fibres = SPHM_FIBRES_PENNATE;
    p.pennation_angle = 30;
    Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    const double *f = made.body.fibres;
    EXPECT_NEAR(f[0], std::cos(M_PI / 6), 1e-6);
    EXPECT_NEAR(f[1], std::sin(M_PI / 6), 1e-6); /* y is the preset's widest direction */
    EXPECT_NEAR(f[2], 0, 1e-6);
}

TEST(Fibres, LaplaceOfABarIsItsAxis) {
    Body made(bar(SPHM_FIBRES_LAPLACE));
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    for (size_t i = 0; i < made.body.count; i++)
        ASSERT_GT(made.body.fibres[3 * i], std::cos(0.01 * M_PI / 180)) << i;
    EXPECT_EQ(made.log, "");
}

/* The centreline of a belly is z = bow sin(pi s): fibres on it should have its slope, the sooner the slimmer.
 */
TEST(Fibres, LaplaceFollowsTheBow) {
    sphm_parameters p = sphm_parameters_default();
    p.preset = SPHM_PRESET_BELLY;
    p.belly_width = p.belly_thickness = 0.03;
    p.belly_end_radius = 0.0149;
    p.belly_bow = 0.03;
    p.particles = 4000;
    p.fibres = SPHM_FIBRES_LAPLACE;
    Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    double worst = 0, length = 0.2;
    size_t seen = 0;
    for (size_t i = 0; i < made.body.count; i++) {
        const double *x = &made.body.positions[3 * i], *f = &made.body.fibres[3 * i];
        EXPECT_NEAR(sphm_norm3(f), 1, 1e-12);
        double s = x[0] / length + 0.5, z = x[2] - 0.03 * std::sin(M_PI * s);
        if (s < 0.15 || s > 0.85 || std::hypot(x[1], z) > 0.008)
            continue;
        double slope = 0.03 * M_PI / length * std::cos(M_PI * s); /* up to 25 degrees */
        worst = std::fmax(worst, std::fabs(std::atan2(f[2], f[0]) - std::atan(slope)));
        seen++;
    }
    EXPECT_GT(seen, 200u);
    EXPECT_LT(worst * 180 / M_PI, 5);
}

TEST(Fibres, FileGivesTheNearestDirection) {
    TextFile file("# two halves\n-0.02 0 0  2 0 0\n\n0.02 0 0  0 0 -3 # down\n");
    sphm_parameters p = bar(SPHM_FIBRES_FILE);
    std::snprintf(p.fibre_file, sizeof p.fibre_file, "%s", file.path.c_str());
    Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    for (size_t i = 0; i < made.body.count; i++) {
        bool left = made.body.positions[3 * i] < 0;
        ASSERT_EQ(made.body.fibres[3 * i], left ? 1 : 0);
        ASSERT_EQ(made.body.fibres[3 * i + 2], left ? 0 : -1);
    }
}

/* Against a search through all points, which differ from each other by direction. */
TEST(Fibres, FileSearchMissesNoPoint) {
    std::string text;
    std::vector<double> points;
    uint32_t seed = 1;
    for (int i = 0; i < 400; i++) {
        char line[200];
        double x[3];
        for (double &c : x)
            c = ((seed = seed * 1664525u + 1013904223u) >> 8) / 16777216.0 - 0.5;
        x[0] *= i % 2 ? 0.2 : 0.005; /* crowded in the middle, and beyond the bar */
        x[1] *= 0.02;
        x[2] *= 0.02;
        std::snprintf(line, sizeof line, "%.17g %.17g %.17g %.17g %.17g 1\n", x[0], x[1], x[2], 0.01 * i,
                      0.5);
        text += line;
        points.insert(points.end(), x, x + 3);
    }
    TextFile file(text);
    sphm_parameters p = bar(SPHM_FIBRES_FILE);
    std::snprintf(p.fibre_file, sizeof p.fibre_file, "%s", file.path.c_str());
    Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    for (size_t i = 0; i < made.body.count; i++) {
        int best = 0;
        for (int k = 1; k < 400; k++)
            if (sphm_distance_squared3(&points[3 * (size_t)k], &made.body.positions[3 * i]) <
                sphm_distance_squared3(&points[3 * (size_t)best], &made.body.positions[3 * i]))
                best = k;
        ASSERT_NEAR(made.body.fibres[3 * i] / made.body.fibres[3 * i + 2], 0.01 * best, 1e-9) << i;
    }
}

TEST(Fibres, FileErrorsNameTheLine) {
    EXPECT_NE(refusal("0 0 0 1 0 0\n0 0 x 1 0 0\n").find("line 2: 'x'"), std::string::npos);
    EXPECT_NE(refusal("# c\n0 0 0 1 0\n").find("line 2 has 5 numbers"), std::string::npos);
    EXPECT_NE(refusal("0 0 0 1 0 0 7\n").find("line 1 has 7 numbers"), std::string::npos);
    EXPECT_NE(refusal("0 0 0 0 0 0\n").find("line 1: the direction is 0"), std::string::npos);
    EXPECT_NE(refusal("0 0 0 nan 0 0\n").find("line 1: 'nan'"), std::string::npos);
    EXPECT_NE(refusal("# nothing\n").find("no fibres"), std::string::npos);
    EXPECT_NE(refusal(std::string(3000, ' ')).find("line 1 is longer"), std::string::npos);
    sphm_parameters p = bar(SPHM_FIBRES_FILE);
    std::snprintf(p.fibre_file, sizeof p.fibre_file, "/nowhere/fibres.txt");
    Body made(p);
    EXPECT_EQ(made.status, SPHM_REFUSED_FILE);
    EXPECT_NE(std::string(made.context.message).find("/nowhere/fibres.txt"), std::string::npos);
}

} // namespace
