// The parameter table: defaults, reading and printing, refusals, rules between parameters.
#include "core/number.h"
#include "sph_muscle/parameters.h"

#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>

namespace {

struct Parameters : testing::Test {
    sphm_parameters p = sphm_parameters_default();
    sphm_context context{};

    void Refused(const char *name, const char *value, std::initializer_list<const char *> parts) {
        sphm_parameters before = p;
        EXPECT_EQ(sphm_parameters_set(&p, name, value, &context), SPHM_REFUSED_PARAMETER)
            << name << " = " << value;
        EXPECT_EQ(std::memcmp(&before, &p, sizeof p), 0) << name;
        for (const char *part : parts)
            EXPECT_NE(std::strstr(context.message, part), nullptr) << part << " in: " << context.message;
    }
    void Set(const char *name, const char *value) {
        EXPECT_EQ(sphm_parameters_set(&p, name, value, &context), SPHM_OK) << context.message;
    }
    std::string Get(const char *name) {
        char text[SPHM_TEXT_SIZE] = "";
        EXPECT_EQ(sphm_parameters_get(&p, name, text, sizeof text, &context), SPHM_OK) << context.message;
        return text;
    }
    void CheckRefused(const char *part) {
        EXPECT_EQ(sphm_parameters_check(&p, &context), SPHM_REFUSED_PARAMETER);
        EXPECT_NE(std::strstr(context.message, part), nullptr) << part << " in: " << context.message;
    }
};

TEST_F(Parameters, DefaultsAreTheListAndValid) {
    EXPECT_EQ(sphm_parameters_check(&p, &context), SPHM_OK) << context.message;
    EXPECT_EQ(p.particles, 2231);
    EXPECT_EQ(p.density, 1112);
    EXPECT_EQ(p.resting_potential, -85);
    EXPECT_EQ(p.preset, SPHM_PRESET_TRICEPS_LONG_HEAD);
    EXPECT_STREQ(p.frame_id, "muscle");
    EXPECT_GE(p.origin[2], SPHM_AUTO);
    EXPECT_EQ(p.gravity[2], 0);
}

TEST_F(Parameters, TableDescribesEveryField) {
    ASSERT_GT(sphm_parameter_count(), 50u);
    EXPECT_EQ(sphm_parameter_row(sphm_parameter_count()), nullptr);
    EXPECT_EQ(sphm_parameter_find("no_such"), nullptr);
    EXPECT_EQ(sphm_parameter_find(nullptr), nullptr);
    for (size_t i = 0; i < sphm_parameter_count(); i++) {
        const sphm_parameter_info *row = sphm_parameter_row(i);
        EXPECT_EQ(sphm_parameter_find(row->name), row);
        EXPECT_STRNE(row->group, "") << row->name;
        EXPECT_STRNE(row->help, "") << row->name;
        EXPECT_EQ(row->choices != nullptr, row->kind == SPHM_KIND_CHOICE) << row->name;
    }
    const sphm_parameter_info *viscosity = sphm_parameter_find("viscosity");
    ASSERT_NE(viscosity, nullptr);
    EXPECT_STREQ(viscosity->unit, "Pa s");
    EXPECT_STREQ(viscosity->group, "Fluid tissue");
    EXPECT_EQ(viscosity->maximum, 1e4);
    EXPECT_EQ(viscosity->offset, offsetof(sphm_parameters, viscosity));
}

// Setting every parameter to the default as the table writes it changes nothing.
TEST_F(Parameters, DefaultTextsReadBackToTheDefaults) {
    sphm_parameters defaults = p;
    for (size_t i = 0; i < sphm_parameter_count(); i++)
        Set(sphm_parameter_row(i)->name, sphm_parameter_row(i)->default_text);
    EXPECT_EQ(std::memcmp(&defaults, &p, sizeof p), 0);
}

TEST_F(Parameters, EveryKindIsReadAndPrinted) {
    Set("viscosity", " 2.5e1 ");
    EXPECT_EQ(p.viscosity, 25);
    EXPECT_EQ(Get("viscosity"), "25");
    Set("particles", "1e5");
    EXPECT_EQ(p.particles, 100000);
    EXPECT_EQ(Get("particles"), "100000");
    Set("paper_units", "Yes");
    EXPECT_EQ(p.paper_units, 1);
    EXPECT_EQ(Get("paper_units"), "true");
    Set("coupling", "pressure");
    EXPECT_EQ(p.coupling, SPHM_COUPLING_PRESSURE);
    EXPECT_EQ(Get("coupling"), "pressure");
    Set("mesh", "/a b/c,d.stl");
    EXPECT_EQ(Get("mesh"), "/a b/c,d.stl");
    Set("gravity", "[0, 0.5,-9.81]");
    EXPECT_EQ(p.gravity[2], -9.81);
    EXPECT_EQ(Get("gravity"), "[0, 0.5, -9.81]");
    EXPECT_EQ(Get("origin"), "auto");
    Set("origin", "[0.1, 0, 0]");
    EXPECT_EQ(Get("origin"), "[0.1, 0, 0]");
    Set("origin", "auto");
    EXPECT_EQ(p.origin[0], SPHM_AUTO);
}

TEST_F(Parameters, RefusalsNameNameValueAndRange) {
    Refused("density", "5", {"density", "5", "100", "20000", "kg/m3"});
    Refused("density", "nan", {"density", "nan", "100"});
    Refused("density", "inf", {"density", "inf"});
    Refused("density", "1e999", {"density", "1e999"});
    Refused("density", "0x500", {"density", "0x500"});
    Refused("density", "1112 kg", {"density", "1112 kg"});
    Refused("density", "1,112", {"density", "1,112"});
    Refused("density", "", {"density", "''"});
    Refused("density", "1e", {"density", "1e"});
    Refused("particles", "0", {"particles", "'0'", "whole number", "from 8 to"});
    Refused("particles", "2231.5", {"particles", "2231.5", "whole"});
    Refused("paper_units", "maybe", {"paper_units", "maybe", "true or false"});
    Refused("preset", "biceps", {"preset", "biceps", "triceps_long_head, vastus_lateralis, belly, bar"});
    Refused("preset", "bell", {"preset", "bell"});
    Refused("preset", "belly|bar", {"preset"});
    Refused("gravity", "[0, 0]", {"gravity", "[0, 0]", "[x, y, z]", "-1000"});
    Refused("gravity", "[0, 0, 0, 0]", {"gravity"});
    Refused("gravity", "[0, 0, 1e4]", {"gravity", "1e4"});
    Refused("gravity", "auto", {"gravity", "auto"});
    Refused("origin", "[auto, 0, 0]", {"origin", "auto or [x, y, z]"});
    Refused("mesh", std::string(SPHM_TEXT_SIZE, 'x').c_str(), {"mesh", "1023"});
    Set("mesh", std::string(SPHM_TEXT_SIZE - 1, 'x').c_str());
}

TEST_F(Parameters, UnknownNamesGetTheNearestOne) {
    Refused("partciles", "100", {"'partciles'", "did you mean 'particles'"});
    Refused("Density", "100", {"'density'"});
    Refused("viscosty", "1", {"'viscosity'"});
    Refused("smoothing", "2.5", {"'smoothing_ratio'"});
    Refused("belly_lenght", "0.2", {"'belly_length'"});
    Refused("frobnicate", "1", {"'frobnicate'", "none has a similar name"});
    Refused("", "1", {"unknown parameter ''"});
    Refused(std::string(500, 'q').c_str(), "1", {"unknown parameter"});
    EXPECT_EQ(std::strstr(context.message, "did you mean"), nullptr);
}

TEST_F(Parameters, WrongCallsAreRefused) {
    sphm_parameters zeroed;
    std::memset(&zeroed, 0, sizeof zeroed);
    char text[4];
    EXPECT_EQ(sphm_parameters_set(&zeroed, "density", "1000", &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_NE(std::strstr(context.message, "sphm_parameters_default"), nullptr);
    EXPECT_EQ(sphm_parameters_check(&zeroed, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_parameters_check(nullptr, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_parameters_set(&p, nullptr, "1", &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_parameters_set(&p, "density", nullptr, nullptr), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_parameters_get(&p, "nothing", text, sizeof text, &context), SPHM_REFUSED_PARAMETER);
    EXPECT_EQ(sphm_parameters_get(&p, "density", text, sizeof text, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_NE(std::strstr(context.message, "5 bytes"), nullptr) << context.message;
}

TEST_F(Parameters, CheckSeesWhatWasWrittenIntoTheStruct) {
    p.density = std::numeric_limits<double>::quiet_NaN();
    CheckRefused("density");
    p = sphm_parameters_default();
    p.gravity[1] = std::numeric_limits<double>::infinity();
    CheckRefused("gravity");
    p = sphm_parameters_default();
    p.origin[1] = 0; // half automatic
    CheckRefused("origin");
    p = sphm_parameters_default();
    p.preset = 99;
    CheckRefused("preset");
    p = sphm_parameters_default();
    p.preset = -1;
    CheckRefused("preset");
    p = sphm_parameters_default();
    p.particles = 0;
    CheckRefused("particles");
    p = sphm_parameters_default();
    std::memset(p.mesh, 'x', sizeof p.mesh);
    CheckRefused("mesh");
}

TEST_F(Parameters, RulesBetweenParameters) {
    Set("threshold_potential", "-90");
    CheckRefused("rise in this order");
    p = sphm_parameters_default();
    Set("plateau_potential", "-50");
    Set("threshold_potential", "-40");
    CheckRefused("plateau_potential -50 mV");
    p = sphm_parameters_default();
    Set("fibres", "file");
    CheckRefused("fibre_file is empty");
    p = sphm_parameters_default();
    Set("time_step", "1e-300");
    CheckRefused("time_step is 1e-300 s; it must be 0 (automatic) or at least 1e-09 s");
    p = sphm_parameters_default();
    Set("smoothing_ratio", "1.5");
    CheckRefused("smoothing_ratio is 1.5; it must be 0 (what suits the tissue) or in 2 ... 3");
    p = sphm_parameters_default();
    Set("origin", "[1, 2, 3]");
    Set("insertion", "[1, 2, 3]");
    CheckRefused("[1, 2, 3]");
    p = sphm_parameters_default();
    Set("conduction_velocity", "4");
    EXPECT_EQ(sphm_parameters_check(&p, &context), SPHM_OK);
    Set("threshold_potential", "-30");
    CheckRefused("-35 mV");
    p = sphm_parameters_default();
    Set("conduction_velocity", "4");
    Set("excitation_rate", "0");
    CheckRefused("excitation_rate");
    p = sphm_parameters_default();
    Set("surface_field_min", "1");
    CheckRefused("surface_field_max");
}

TEST_F(Parameters, DoubtfulSettingsAreWarnedAbout) {
    std::string said;
    context.user = &said;
    context.log = [](sphm_log_level, const char *text, void *user) {
        *static_cast<std::string *>(user) += text;
    };
    EXPECT_EQ(sphm_parameters_check(&p, &context), SPHM_OK);
    EXPECT_EQ(said, "");
    Set("pennation_angle", "12");
    EXPECT_EQ(sphm_parameters_check(&p, &context), SPHM_OK);
    EXPECT_NE(said.find("pennation_angle is ignored"), std::string::npos);
    said.clear();
    Set("pennation_angle", "0");
    Set("jitter", "0.1");
    EXPECT_EQ(sphm_parameters_check(&p, &context), SPHM_OK);
    EXPECT_NE(said.find("jitter is 0.1: active solid tissue"), std::string::npos) << said;
    said.clear();
    Set("tissue", "fluid");
    EXPECT_EQ(sphm_parameters_check(&p, &context), SPHM_OK);
    EXPECT_EQ(said, "");
}

// Every double survives printing and reading; random bit patterns reach all exponents.
TEST(Number, RoundTrips) {
    std::mt19937_64 random(7);
    char text[SPHM_NUMBER_SIZE];
    for (int i = 0; i < 20000; i++) {
        uint64_t bits = random();
        double value, back = 0;
        std::memcpy(&value, &bits, sizeof value);
        if (!std::isfinite(value))
            continue;
        sphm_number_print(value, text);
        ASSERT_TRUE(sphm_number_parse(text, &back)) << text;
        ASSERT_EQ(back, value) << text;
    }
    sphm_number_print(0.1, text);
    EXPECT_STREQ(text, "0.1");
    sphm_number_print(1.0 / 3, text);
    EXPECT_STREQ(text, "0.3333333333333333");
}

// Machines without a locale that writes a comma cannot show the fault this guards against.
TEST(Number, DoesNotFollowTheLocale) {
    const char *comma = nullptr;
    for (const char *name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE"})
        if (!comma)
            comma = std::setlocale(LC_NUMERIC, name);
    if (!comma)
        GTEST_SKIP() << "no locale with a decimal comma is installed";
    char text[SPHM_NUMBER_SIZE];
    double value = 0;
    sphm_number_print(0.5, text);
    bool read = sphm_number_parse("0.25", &value);
    std::setlocale(LC_NUMERIC, "C");
    EXPECT_STREQ(text, "0.5");
    EXPECT_TRUE(read);
    EXPECT_EQ(value, 0.25);
}

} // namespace
