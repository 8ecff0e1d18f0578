// Where the solid tissue is held: some way beyond the section that the attached share asks for, so that it
// deforms as if clamped in that section.
#include "shapes.h"
#include "solid_muscles.h"

#include <limits>

namespace {

// Along x, in layers: from the section (into the free part) to the last held particle of an end.
double inside(const sphm_body &body, int end) {
    const int attached = end ? SPHM_ATTACHED_INSERTION : SPHM_ATTACHED_ORIGIN;
    double last = -std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < body.count; ++i)
        if (body.attachment[i] == attached) {
            double along = 0;
            for (size_t k = 0; k < 3; ++k)
                along += body.positions[3 * i + k] * body.axis[k];
            last = std::fmax(last, end ? body.clamp_m[1] - along : along - body.clamp_m[0]);
        }
    return last / body.layer_m;
}

size_t held(const sphm_body &body, int attached) {
    size_t number = 0;
    for (size_t i = 0; i < body.count; ++i)
        number += body.attachment[i] == attached;
    return number;
}

sphm_parameters belly(int64_t particles) {
    sphm_parameters p = sphm_parameters_default();
    p.tissue = SPHM_TISSUE_SOLID;
    p.preset = SPHM_PRESET_BELLY;
    p.particles = particles;
    return p;
}

TEST(Clamp, LiesBehindTheLastLayerThatIsHeld) {
    for (int64_t particles : {500, 2231, 4944, 18475}) {
        const shapes::Body made(belly(particles));
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        EXPECT_NEAR(made.body.clamp_m[0], -0.0576, 1e-4);
        EXPECT_NEAR(made.body.clamp_m[1], 0.0576, 1e-4);
        for (int end = 0; end < 2; ++end)
            EXPECT_NEAR(inside(made.body, end), SPHM_CLAMP_DEPTH, 1e-6);
        EXPECT_EQ(held(made.body, SPHM_ATTACHED_ORIGIN), held(made.body, SPHM_ATTACHED_INSERTION));
    }
}

TEST(Clamp, TurnsWithTheLineOfAction) {
    sphm_parameters p = belly(2231);
    p.origin[0] = 0.1;
    p.insertion[0] = -0.1;
    p.origin[1] = p.origin[2] = p.insertion[1] = p.insertion[2] = 0;
    const shapes::Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    for (int end = 0; end < 2; ++end)
        EXPECT_NEAR(inside(made.body, end), SPHM_CLAMP_DEPTH, 1e-6);
    // Over a line that crosses the layers the last held particles are spread over the layer inside.
    p.origin[1] = 0.02;
    const shapes::Body tilted(p);
    ASSERT_EQ(tilted.status, SPHM_OK) << tilted.context.message;
    EXPECT_GT(held(tilted.body, SPHM_FREE), 0.6 * 2231);
    for (int end = 0; end < 2; ++end) {
        EXPECT_GT(inside(tilted.body, end), SPHM_CLAMP_DEPTH + 0.2);
        EXPECT_LT(inside(tilted.body, end), SPHM_CLAMP_DEPTH + 0.5);
    }
}

TEST(Clamp, IsTheSameWithJitter) {
    sphm_parameters p = belly(2231);
    const shapes::Body lattice(p);
    p.jitter = 0.2;
    const shapes::Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    ASSERT_EQ(made.body.count, lattice.body.count);
    for (size_t i = 0; i < made.body.count; ++i)
        ASSERT_EQ(made.body.attachment[i], lattice.body.attachment[i]) << i;
}

// Layers of 3 mm from -30 mm on, in whole cells: the last one held is the nearest to where it should be, up
// to half a layer before or behind (0.28 and 0.29: 5.6 and 5.8 layers off), alike at both ends.
TEST(Clamp, OfABarIsAsNearAsItsLayersAllow) {
    const struct {
        double share;
        size_t layers;
    } cases[] = {{0.25, 6}, {0.26, 6}, {0.27, 6}, {0.28, 6}, {0.29, 7}, {0.125, 3}, {0.01, 1}, {0.45, 10}};
    for (const auto &c : cases) {
        sphm_parameters p = solid::bar();
        p.attachment_fraction = c.share;
        const shapes::Body made(p);
        if (c.layers == 10) { // of 20: nothing is left
            EXPECT_EQ(made.status, SPHM_REFUSED_GEOMETRY);
            EXPECT_NE(std::string(made.context.message).find("attachment_fraction: 0.45"), std::string::npos)
                << made.context.message;
            continue;
        }
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        EXPECT_NEAR(made.body.layer_m, 0.003, 1e-12);
        EXPECT_NEAR(made.body.clamp_m[1], 0.03 - c.share * 0.06, 1e-12);
        EXPECT_EQ(held(made.body, SPHM_ATTACHED_ORIGIN), 25 * c.layers) << c.share;
        EXPECT_EQ(held(made.body, SPHM_ATTACHED_INSERTION), 25 * c.layers) << c.share;
    }
}

TEST(Clamp, OfNothingIsNone) {
    sphm_parameters p = belly(500);
    p.attachment_fraction = 0;
    const shapes::Body made(p);
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    EXPECT_EQ(held(made.body, SPHM_FREE), made.body.count);
    EXPECT_EQ(made.body.clamp_m[0], made.body.clamp_m[1]);
}

// Stretched by a five-hundredth, a bar that has little but its fibres' passive stiffness pulls as the
// material does at that stretch of what is between the places where it is felt to be held: 11 layers and
// twice the depth. With a depth of half a layer it would be called 1.8 % too stiff.
TEST(Clamp, IsWhereABarIsFeltToBeHeld) {
    sphm_parameters p = solid::bar();
    p.optimal_fibre_stretch = 1;
    p.max_isometric_stress = 3e6;
    p.bulk_modulus = 1e3;
    p.hourglass_stiffness = 1e5; // a tenth of Young's modulus; the place depends on it a little
    const solid::Muscle muscle = solid::make(p);
    const double length = (11 + 2 * SPHM_CLAMP_DEPTH) * 0.003, stretch = 1.002;
    solid::hold_at(muscle, SPHM_END_INSERTION, 0.03 + (stretch - 1) * length, 0.02);
    solid::proceed(muscle, 0.2);
    const double expected = p.max_isometric_stress * p.passive_coefficient *
                            (std::exp(p.passive_exponent * (stretch - 1)) - 1) * stretch * solid::bar_area;
    EXPECT_NEAR(-solid::wrench(muscle, SPHM_END_INSERTION).force_N[0], expected, 0.01 * expected);
}

} // namespace
