// The CSV time series: names, values, every quantity in its own column, failing disks.
#include "files.h"
#include "sph_muscle/io.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <sstream>
#include <vector>

namespace {

std::vector<std::string> Split(const std::string &line) {
    std::vector<std::string> fields;
    std::stringstream stream(line);
    for (std::string field; std::getline(stream, field, ',');)
        fields.push_back(field);
    return fields;
}

struct Csv : testing::Test {
    TemporaryFolder folder;
    sphm_context context{};
    sphm_timeseries *series = nullptr;
};

TEST_F(Csv, EveryQuantityHasANamedColumn) {
    std::string path = folder / "t.csv";
    ASSERT_EQ(sphm_io_timeseries_open(path.c_str(), &series, &context), SPHM_OK) << context.message;
    // All doubles of the struct differ, so that a swapped or repeated column shows.
    sphm_observation o;
    std::memset(&o, 0, sizeof o);
    double *values = reinterpret_cast<double *>(&o);
    for (size_t i = 0; i < offsetof(sphm_observation, nonfinite) / sizeof(double); i++)
        values[i] = 0.125 * static_cast<double>(i + 1);
    o.nonfinite = 1000;
    ASSERT_EQ(sphm_io_timeseries_write(series, &o, 0.0625, &context), SPHM_OK) << context.message;
    std::string text = ReadFile(path); // before closing: every line is flushed
    ASSERT_EQ(sphm_io_timeseries_close(series, &context), SPHM_OK);

    std::stringstream lines(text);
    std::string header, row, rest;
    ASSERT_TRUE(std::getline(lines, header));
    ASSERT_TRUE(std::getline(lines, row));
    EXPECT_FALSE(std::getline(lines, rest));
    std::vector<std::string> names = Split(header), fields = Split(row);
    ASSERT_EQ(names.size(), fields.size());
    EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size()) << "a name twice";
    EXPECT_EQ(std::set<std::string>(fields.begin(), fields.end()).size(), fields.size()) << "a value twice";
    auto field = [&](const char *name) {
        for (size_t i = 0; i < names.size(); i++)
            if (names[i] == name)
                return std::stod(fields[i]);
        ADD_FAILURE() << "no column " << name << " in " << header;
        return std::numeric_limits<double>::quiet_NaN();
    };
    EXPECT_EQ(field("time_s"), o.time_s);
    EXPECT_EQ(field("stimulus_uA_per_mm2"), o.stimulus_uA_per_mm2);
    EXPECT_EQ(field("membrane_potential_insertion_mV"), o.membrane_potential_region_mV[2]);
    EXPECT_EQ(field("displacement_centre_yz_m"), o.displacement_plane_m[1][1]);
    EXPECT_EQ(field("pressure_origin_Pa"), o.pressure_region_Pa[0]);
    EXPECT_EQ(field("volume_ratio"), o.volume_ratio);
    EXPECT_EQ(field("nonfinite_particles"), 1000);
    EXPECT_EQ(field("real_time_factor"), 0.0625);
}

TEST_F(Csv, KeepsTenDigitsAndWritesNonfiniteNumbers) {
    std::string path = folder / "t.csv";
    ASSERT_EQ(sphm_io_timeseries_open(path.c_str(), &series, &context), SPHM_OK);
    sphm_observation o;
    std::memset(&o, 0, sizeof o);
    o.time_s = 3600.000001;
    o.activation = std::numeric_limits<double>::quiet_NaN();
    o.bulge = -std::numeric_limits<double>::infinity();
    ASSERT_EQ(sphm_io_timeseries_write(series, &o, 1, &context), SPHM_OK);
    ASSERT_EQ(sphm_io_timeseries_close(series, &context), SPHM_OK);
    std::string text = ReadFile(path);
    EXPECT_NE(text.find("\n3600.000001,0,nan,"), std::string::npos) << text;
    EXPECT_NE(text.find(",-inf,"), std::string::npos) << text;
}

TEST_F(Csv, SaysWhenItCannotWrite) {
    EXPECT_EQ(sphm_io_timeseries_open((folder / "no/t.csv").c_str(), &series, &context), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(context.message, "no/t.csv"), nullptr);
    EXPECT_EQ(series, nullptr);
    EXPECT_EQ(sphm_io_timeseries_open("/dev/full", &series, &context), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(context.message, "No space"), nullptr) << context.message;
    EXPECT_EQ(sphm_io_timeseries_write(nullptr, nullptr, 1, &context), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_io_timeseries_close(nullptr, &context), SPHM_OK);
}

} // namespace
