/* Sections that cut a share of the volume off, against closed forms. */
#include <gtest/gtest.h>

#include "core/section.h"
#include "shapes.h"

namespace {

sphm_cut_body closed(const shapes::Surface &s) {
    return {&s.surface, nullptr, 0, 0};
}

/* Off the origin, and off it along the direction, too. */
TEST(Section, CutsACubeAcrossAnEdge) {
    const shapes::Surface cube = shapes::cube(0.01, 0.3, -0.2, 0.1);
    const double x[3] = {1, 0, 0}, back[3] = {-1, 0, 0};
    double at[2];
    const sphm_cut_body body = closed(cube);
    sphm_end_sections(&body, x, 0.1, at);
    EXPECT_NEAR(at[0], 0.292, 1e-12);
    EXPECT_NEAR(at[1], 0.308, 1e-12);
    EXPECT_NEAR(sphm_share_below(&body, x, 0.305), 0.75, 1e-12);
    sphm_end_sections(&body, back, 0.25, at);
    EXPECT_NEAR(at[0], -0.305, 1e-12);
    EXPECT_NEAR(at[1], -0.295, 1e-12);
}

/* Along the space diagonal the part below the section is a corner with the volume s^3/6, s = x + y + z from
 * the corner on. */
TEST(Section, CutsACubeAcrossACorner) {
    const double half = 0.01, d = 1 / std::sqrt(3.0), diagonal[3] = {d, d, d};
    const shapes::Surface cube = shapes::cube(half);
    const sphm_cut_body body = closed(cube);
    for (double s : {0.004, 0.011, 0.0199}) {
        const double share = s * s * s / 6 / 8e-6;
        EXPECT_NEAR(sphm_share_below(&body, diagonal, (s - 3 * half) * d), share, 1e-12);
        double at[2];
        sphm_end_sections(&body, diagonal, share, at);
        EXPECT_NEAR(at[0], (s - 3 * half) * d, 1e-12);
        EXPECT_NEAR(at[1], (3 * half - s) * d, 1e-12);
    }
}

/* Five cells in four layers, two of them in the last. */
TEST(Section, CutsCellsAboutPoints) {
    const std::vector<double> points = {0, 0, 0, 1, 5, 0, 2, 0, 7, 3, 0, 0, 3, 1, 1};
    const sphm_cut_body body = {nullptr, points.data(), points.size() / 3, 1};
    const double x[3] = {1, 0, 0};
    EXPECT_NEAR(sphm_share_below(&body, x, -0.5), 0, 1e-12);
    EXPECT_NEAR(sphm_share_below(&body, x, 0.75), 0.25, 1e-12);
    EXPECT_NEAR(sphm_share_below(&body, x, 3), 0.8, 1e-12);
    double at[2];
    sphm_end_sections(&body, x, 0.1, at);
    EXPECT_NEAR(at[0], 0, 1e-12);
    EXPECT_NEAR(at[1], 3.25, 1e-12);
}

} // namespace
