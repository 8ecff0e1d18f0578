// YAML configuration files: what is read, what is refused and where the message points.
#include "files.h"
#include "sph_muscle/io.h"

#include <cstring>

namespace {

struct Yaml : testing::Test {
    TemporaryFolder folder;
    sphm_parameters p = sphm_parameters_default();
    sphm_context context{};

    void SetUp() override {
        if (!sphm_io_has_yaml())
            GTEST_SKIP() << "built without libyaml";
    }
    sphm_status Load(const std::string &text) {
        WriteFile(folder / "a.yaml", text);
        return sphm_io_load_parameters((folder / "a.yaml").c_str(), &p, &context);
    }
    void Read(const std::string &text) { EXPECT_EQ(Load(text), SPHM_OK) << context.message; }
    // `place` is LINE:COLUMN, empty where there is none.
    void Refused(const std::string &text, sphm_status status, const std::string &place,
                 std::initializer_list<const char *> parts) {
        sphm_parameters before = p;
        EXPECT_EQ(Load(text), status) << text << "\n" << context.message;
        EXPECT_EQ(std::memcmp(&before, &p, sizeof p), 0) << "parameters changed by " << text;
        std::string start = (folder / "a.yaml") + ":" + (place.empty() ? "" : place + ":");
        EXPECT_EQ(std::string(context.message).rfind(start, 0), 0u)
            << start << " not before: " << context.message;
        for (const char *part : parts)
            EXPECT_NE(std::strstr(context.message, part), nullptr) << part << " in: " << context.message;
    }
};

TEST_F(Yaml, ReadsEveryKind) {
    Read("# a comment\n"
         "preset: bar\n"
         "particles: 4944  # another\n"
         "density: 1.1e3\n"
         "paper_units: true\n"
         "gravity: [0, 0, -9.81]\n"
         "electrode_centre:\n  - 0.1\n  - 0\n  - 0\n"
         "origin: auto\n"
         "frame_id: \"a b\"\n");
    EXPECT_EQ(p.preset, SPHM_PRESET_BAR);
    EXPECT_EQ(p.particles, 4944);
    EXPECT_EQ(p.density, 1100);
    EXPECT_EQ(p.paper_units, 1);
    EXPECT_EQ(p.gravity[2], -9.81);
    EXPECT_EQ(p.electrode_centre[0], 0.1);
    EXPECT_EQ(p.origin[0], SPHM_AUTO);
    EXPECT_STREQ(p.frame_id, "a b");
}

TEST_F(Yaml, KeepsWhatTheFileDoesNotName) {
    p.density = 1000;
    Read("particles: 100\n");
    EXPECT_EQ(p.density, 1000);
    Read("");
    Read("# only a comment\n");
    Read("---\n...\n");
    EXPECT_EQ(p.particles, 100);
}

TEST_F(Yaml, StimulusMayBeAList) {
    Read("stimulus: 0.5:1.5:8000\n");
    EXPECT_STREQ(p.stimulus, "0.5:1.5:8000");
    Read("stimulus:\n  - 0:1:8000\n  - \"2:3:4000:both\"\n");
    EXPECT_STREQ(p.stimulus, "0:1:8000; 2:3:4000:both");
    Read("stimulus: []\n");
    EXPECT_STREQ(p.stimulus, "");
    Refused("stimulus:\n  - {start: 0}\n", SPHM_REFUSED_PARAMETER, "2:5", {"nested map"});
}

TEST_F(Yaml, RelativePathsStartAtTheFile) {
    Read("mesh: sub/a.stl\nfibre_file: ../f.txt\n");
    EXPECT_EQ(p.mesh, folder / "sub/a.stl");
    EXPECT_EQ(p.fibre_file, folder / "../f.txt");
    Read("mesh: /tmp/a.stl\n");
    EXPECT_STREQ(p.mesh, "/tmp/a.stl");
    Read("mesh: package://robot/a.stl\n");
    EXPECT_STREQ(p.mesh, "package://robot/a.stl");
    Read("mesh:\n");
    EXPECT_STREQ(p.mesh, "");
    Read("mesh: ~\n");
    EXPECT_STREQ(p.mesh, "");
}

TEST_F(Yaml, RefusalsPointAtTheLine) {
    const sphm_status parameter = SPHM_REFUSED_PARAMETER;
    Refused("particles: 100\nvoltage: 3\n", parameter, "2:1", {"unknown parameter 'voltage'"});
    Refused("viscosty: 3\n", parameter, "1:1", {"did you mean 'viscosity'"});
    Refused("particles: 100\ndensity: 5\n", parameter, "2:10",
            {"'density'", "'5'", "from 100 to 20000 kg/m3"});
    Refused("density: .nan\n", parameter, "1:10", {"'density'", ".nan"});
    Refused("density: .inf\n", parameter, "1:10", {".inf"});
    Refused("density:\n", parameter, "1:9", {"'density'"});
    Refused("particles: many\n", parameter, "1:12", {"many"});
    Refused("density: {value: 1112}\n", parameter, "1:10", {"'density' is a nested map"});
    Refused("density: [1, 2, 3]\n", parameter, "1:10", {"'density' is a list"});
    Refused("muscle:\n  density: 1112\n", parameter, "1:1", {"unknown parameter 'muscle'"});
    Refused("gravity: [0, 0]\n", parameter, "1:10", {"'gravity'", "[0, 0]"});
    Refused("gravity: [0, 0, [1]]\n", parameter, "1:17", {"list"});
    Refused("[a, b]: 3\n", parameter, "1:1", {"a key is a list"});
    Refused("density: 1000\nparticles: 100\ndensity: 1100\n", parameter, "3:1",
            {"'density' is given twice", "line 1"});
    Refused("frame_id: \"a\\0b\"\n", parameter, "1:11", {"zero byte"});
    Refused("mesh: " + std::string(2000, 'x') + "\n", parameter, "1:7", {"'mesh'", "1023"});
    Refused("mesh: " + std::string(1020, 'x') + "\n", parameter, "1:7", {"folder", "1023"});
}

TEST_F(Yaml, RefusesWhatIsNotOneMapping) {
    Refused("just text\n", SPHM_REFUSED_FILE, "1:1", {"a single value", "name: value"});
    Refused("- a\n- b\n", SPHM_REFUSED_FILE, "1:1", {"a list"});
    Refused("density: 1000\n  particles: 3\n", SPHM_REFUSED_FILE, "2:12", {"not YAML"});
    Refused("density: [1, 2\n", SPHM_REFUSED_FILE, "2:1", {"not YAML"});
    Refused("\tdensity: 1000\n", SPHM_REFUSED_FILE, "1:1", {"not YAML"});
    Refused("density: \"1000\n", SPHM_REFUSED_FILE, "2:1", {"not YAML"});
    Refused("density: 1000\n---\nparticles: 3\n", SPHM_REFUSED_FILE, "3:1", {"second document"});
    Refused("density: 1000\nframe_id: \xff\xfe\n", SPHM_REFUSED_FILE, "", {"UTF-8"});
}

TEST_F(Yaml, RefusesMissingFiles) {
    std::string missing = folder / "missing.yaml";
    EXPECT_EQ(sphm_io_load_parameters(missing.c_str(), &p, &context), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(context.message, missing.c_str()), nullptr);
    EXPECT_NE(std::strstr(context.message, "No such file"), nullptr);
    EXPECT_EQ(sphm_io_load_parameters(folder.path.c_str(), &p, &context), SPHM_REFUSED_FILE) << "a folder";
    EXPECT_EQ(sphm_io_load_parameters(nullptr, &p, &context), SPHM_REFUSED_ARGUMENT);
}

TEST_F(Yaml, NothingIsNeededOfTheContext) {
    WriteFile(folder / "a.yaml", "voltage: 3\n");
    EXPECT_EQ(sphm_io_load_parameters((folder / "a.yaml").c_str(), &p, nullptr), SPHM_REFUSED_PARAMETER);
}

// What was saved is what is read, in every byte, for values that are awkward to write.
TEST_F(Yaml, SavedParametersReadBack) {
    auto set = [&](const char *name, const char *value) {
        ASSERT_EQ(sphm_parameters_set(&p, name, value, &context), SPHM_OK) << context.message;
    };
    set("density", "1111.1111111111111");
    set("belly_length", "1e-4");
    set("gravity", "[1e-7, 0.1, -9.81]");
    set("fibres", "laplace");
    set("paper_units", "true");
    set("frame_id", "quo\"te \\ # : tab\t \xc3\xa4");
    set("mesh", (folder / "m.stl").c_str());
    WriteFile(folder / "m.stl", "");
    ASSERT_EQ(sphm_io_save_parameters(&p, (folder / "saved.yaml").c_str(), &context), SPHM_OK)
        << context.message;
    sphm_parameters back = sphm_parameters_default();
    ASSERT_EQ(sphm_io_load_parameters((folder / "saved.yaml").c_str(), &back, &context), SPHM_OK)
        << context.message;
    EXPECT_EQ(std::memcmp(&back, &p, sizeof p), 0);
    EXPECT_NE(ReadFile(folder / "saved.yaml").find("[1.0e-07, 0.1, -9.81]"), std::string::npos);
}

TEST_F(Yaml, SavingSaysWhatFails) {
    EXPECT_EQ(sphm_io_save_parameters(&p, (folder / "no/such.yaml").c_str(), &context), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(context.message, "no/such.yaml"), nullptr);
    EXPECT_EQ(sphm_io_save_parameters(&p, "/dev/full", &context), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(context.message, "No space"), nullptr) << context.message;
}

} // namespace
