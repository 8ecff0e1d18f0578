/* Filling shapes with particles: counts, volumes, holes, and the whole rest shape of the presets. */
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "sph_muscle/geometry.h"

namespace {

struct Body {
    sphm_body body;
    sphm_context context;
    sphm_status status;
    explicit Body(const sphm_parameters &parameters, const sphm_surface *mesh = nullptr) {
        std::memset(&context, 0, sizeof context);
        status = sphm_body_create(&parameters, mesh, &body, &context);
    }
    ~Body() { sphm_body_free(&body); }
    Body(const Body &) = delete;
};

sphm_parameters bar_80_6_6(int64_t particles) {
    sphm_parameters p = sphm_parameters_default();
    p.preset = SPHM_PRESET_BAR;
    p.belly_length = 0.08;
    p.belly_width = p.belly_thickness = 0.006;
    p.particles = particles;
    return p;
}

TEST(Bar, IsTheCellCentredLattice) {
    const int64_t counts[2] = {2880, 360};
    const double spacings[2] = {0.001, 0.002};
    for (int c = 0; c < 2; c++) {
        Body made(bar_80_6_6(counts[c]));
        ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
        const sphm_body &b = made.body;
        ASSERT_EQ(b.count, (size_t)counts[c]);
        const double s = spacings[c];
        EXPECT_NEAR(b.spacing_m, s, 1e-12);
        const double corner[3] = {-0.04, -0.003, -0.003};
        for (size_t i = 0; i < b.count; i++)
            for (int k = 0; k < 3; k++) {
                double cell = (b.positions[3 * i + (size_t)k] - corner[k]) / s - 0.5;
                ASSERT_NEAR(cell, std::round(cell), 1e-9);
            }
        EXPECT_NEAR(b.positions[0], -0.04 + s / 2, 1e-12);
        EXPECT_NEAR(b.volume_m3, 0.08 * 0.006 * 0.006, 1e-15);
        EXPECT_NEAR(b.mid_radius_m, std::sqrt(0.006 * 0.006 / M_PI), 1e-9);
        EXPECT_NEAR(b.length_m, 0.08, 1e-12);
        EXPECT_EQ(b.axis[0], 1);
    }
}

TEST(Bar, IsAttachedByWholeLayers) {
    Body made(bar_80_6_6(2880));
    ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
    size_t attached[3] = {0, 0, 0}, region[3] = {0, 0, 0}, outer = 0;
    for (size_t i = 0; i < made.body.count; i++) {
        attached[made.body.attachment[i]]++;
        region[made.body.region[i]]++;
        outer += made.body.outer[i];
        EXPECT_EQ(made.body.fibres[3 * i], 1);
    }
    EXPECT_EQ(attached[SPHM_ATTACHED_ORIGIN], 288u);
    EXPECT_EQ(attached[SPHM_ATTACHED_INSERTION], 288u);
    EXPECT_EQ(region[SPHM_REGION_ORIGIN], 576u);
    EXPECT_EQ(region[SPHM_REGION_CENTRE], 1728u);
    EXPECT_EQ(region[SPHM_REGION_INSERTION], 576u);
    EXPECT_EQ(outer, 2880u - 78u * 4u * 4u);
}

TEST(Presets, MeetTheCountsOfThePaper) {
    const int64_t counts[4] = {2231, 4944, 9888, 18475};
    const int presets[3] = {SPHM_PRESET_TRICEPS_LONG_HEAD, SPHM_PRESET_VASTUS_LATERALIS, SPHM_PRESET_BELLY};
    for (int preset : presets)
        for (int64_t count : counts) {
            sphm_parameters p = sphm_parameters_default();
            p.preset = preset;
            p.particles = count;
            Body made(p);
            ASSERT_EQ(made.status, SPHM_OK) << made.context.message;
            EXPECT_NEAR((double)made.body.count, (double)count, 0.01 * (double)count);
            double filled = (double)made.body.count * std::pow(made.body.spacing_m, 3);
            EXPECT_NEAR(filled / made.body.volume_m3, 1, 0.04);
        }
}

TEST(Presets, RefuseACountThatCannotBeMet) {
    sphm_parameters p = bar_80_6_6(8);
    p.belly_length = 0.006;
    p.particles = 11;
    Body made(p);
    EXPECT_EQ(made.status, SPHM_REFUSED_GEOMETRY);
    EXPECT_NE(std::string(made.context.message).find("11"), std::string::npos) << made.context.message;
    EXPECT_EQ(made.body.positions, nullptr);
}

} // namespace
