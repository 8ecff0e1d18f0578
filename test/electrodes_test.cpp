// Electrode masks on a row of particles, and the names.
#include <cmath>
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "core/electrodes.h"

namespace {

// 100 particles along x, 1 mm apart, a hundredth of the tissue each.
class Electrodes : public ::testing::Test {
  protected:
    Electrodes() : positions(300), fraction(100), mask(100) {
        for (size_t i = 0; i < 100; i++) {
            positions[3 * i] = 1e-3 * (double(i) + 0.5);
            fraction[i] = (double(i) + 0.5) / 100;
        }
        body.count = 100;
        body.positions = positions.data();
        body.axial_fraction = fraction.data();
        body.upper_m[0] = 0.1;
        context.log = [](sphm_log_level, const char *text, void *user) {
            *static_cast<std::string *>(user) = text;
        };
        context.user = &logged;
    }
    sphm_status mark() { return sphm_electrodes_mark(&parameters, &body, mask.data(), &context); }
    std::vector<int> members(int electrode) const {
        std::vector<int> list;
        for (int i = 0; i < 100; i++)
            if (mask[size_t(i)] >> electrode & 1)
                list.push_back(i);
        return list;
    }
    std::vector<double> positions, fraction;
    std::vector<uint8_t> mask;
    sphm_body body{};
    sphm_parameters parameters = sphm_parameters_default();
    sphm_context context{};
    std::string logged;
};

TEST_F(Electrodes, Names) {
    const char *const names[] = {"belly", "origin", "insertion", "both", "sphere"};
    for (int e = 0; e < SPHM_ELECTRODE_COUNT; e++) {
        EXPECT_STREQ(sphm_electrode_name(e), names[e]);
        EXPECT_EQ(sphm_electrode_find(names[e]), e);
    }
    EXPECT_EQ(sphm_electrode_name(-1), nullptr);
    EXPECT_EQ(sphm_electrode_name(SPHM_ELECTRODE_COUNT), nullptr);
    for (const char *wrong : {"", "Belly", "bell", "bellyy"})
        EXPECT_EQ(sphm_electrode_find(wrong), -1);
    EXPECT_EQ(sphm_electrode_find(nullptr), -1);
    // They are the choices of the parameter, in its order.
    std::string choices;
    for (const char *name : names)
        choices += (choices.empty() ? "" : "|") + std::string(name);
    EXPECT_EQ(choices, sphm_parameter_find("electrode")->choices);
}

TEST_F(Electrodes, BellyAndEnds) {
    ASSERT_EQ(mark(), SPHM_OK);
    EXPECT_EQ(members(SPHM_ELECTRODE_BELLY).size(), 100u);
    const std::vector<int> origin = members(SPHM_ELECTRODE_ORIGIN),
                           insertion = members(SPHM_ELECTRODE_INSERTION);
    ASSERT_EQ(origin.size(), 10u);
    EXPECT_EQ(origin.back(), 9);
    ASSERT_EQ(insertion.size(), 10u);
    EXPECT_EQ(insertion.front(), 90);
    EXPECT_EQ(members(SPHM_ELECTRODE_BOTH).size(), 20u);
}

TEST_F(Electrodes, SphereIsInTheMiddleByDefault) {
    parameters.electrode_radius = 0.0031;
    ASSERT_EQ(mark(), SPHM_OK);
    const std::vector<int> sphere = members(SPHM_ELECTRODE_SPHERE);
    ASSERT_EQ(sphere.size(), 6u);
    EXPECT_EQ(sphere.front(), 47);
    EXPECT_EQ(sphere.back(), 52);
}

TEST_F(Electrodes, SphereWhereItIsPut) {
    parameters.electrode_centre[0] = 0.0205;
    parameters.electrode_centre[1] = parameters.electrode_centre[2] = 0;
    parameters.electrode_radius = 0.0011;
    ASSERT_EQ(mark(), SPHM_OK);
    EXPECT_EQ(members(SPHM_ELECTRODE_SPHERE), (std::vector<int>{19, 20, 21}));
    EXPECT_EQ(logged, "");
}

TEST_F(Electrodes, EmptySphereIsRefusedOnlyWhereItIsTheDefault) {
    parameters.electrode_centre[0] = 1;
    parameters.electrode_centre[1] = parameters.electrode_centre[2] = 0;
    EXPECT_EQ(mark(), SPHM_OK);
    EXPECT_NE(logged.find("electrode_centre 1 0 0 m"), std::string::npos) << logged;
    parameters.electrode = SPHM_ELECTRODE_SPHERE;
    EXPECT_EQ(mark(), SPHM_REFUSED_PARAMETER);
    EXPECT_NE(std::string(context.message).find("electrode_radius 0.01 m"), std::string::npos)
        << context.message;
    EXPECT_NE(std::string(context.message).find("0.9005 m from its centre"), std::string::npos)
        << context.message;
}

} // namespace
