// Snapshots: a restored muscle continues bit for bit; what is damaged or foreign is refused and changes
// nothing.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>
#include <vector>

#include "core/bytes.h"
#include "sph_muscle/muscle.h"

namespace {

using Bytes = std::vector<unsigned char>;

// A folder that goes away with the test.
struct Folder {
    Folder() {
        char name[] = "/tmp/sphm_snapshot_XXXXXX";
        path = mkdtemp(name);
    }
    ~Folder() {
        const std::string command = "chmod -R u+w '" + path + "'; rm -rf '" + path + "'";
        if (std::system(command.c_str()) != 0)
            std::perror("rm");
    }
    std::string file(const char *name) const { return path + "/" + name; }
    std::string path;
};

Bytes read(const std::string &path) {
    std::ifstream in(path, std::ios::binary);
    return Bytes(std::istreambuf_iterator<char>(in), {});
}

void write(const std::string &path, const Bytes &bytes) {
    std::ofstream out(path, std::ios::binary);
    out.write(reinterpret_cast<const char *>(bytes.data()), std::streamsize(bytes.size()));
}

// Makes the checksum right again, as a forger would.
void seal(Bytes &bytes) {
    const uint64_t hash = sphm_hash_bytes(SPHM_HASH_START, bytes.data(), bytes.size() - 8);
    for (size_t i = 0; i < 8; ++i)
        bytes[bytes.size() - 8 + i] = (unsigned char)(hash >> (8 * i));
}

using Settings = std::vector<std::pair<const char *, const char *>>;

struct Muscle {
    explicit Muscle(const Settings &settings = {}) {
        sphm_parameters p = sphm_parameters_default();
        EXPECT_EQ(sphm_parameters_set(&p, "threads", "1", &context), SPHM_OK);
        EXPECT_EQ(sphm_parameters_set(&p, "preset", "bar", &context), SPHM_OK);
        EXPECT_EQ(sphm_parameters_set(&p, "belly_length", "0.06", &context), SPHM_OK);
        EXPECT_EQ(sphm_parameters_set(&p, "belly_width", "0.012", &context), SPHM_OK);
        EXPECT_EQ(sphm_parameters_set(&p, "belly_thickness", "0.012", &context), SPHM_OK);
        EXPECT_EQ(sphm_parameters_set(&p, "particles", "320", &context), SPHM_OK);
        for (const auto &setting : settings)
            EXPECT_EQ(sphm_parameters_set(&p, setting.first, setting.second, &context), SPHM_OK)
                << context.message;
        EXPECT_EQ(sphm_muscle_create(&p, nullptr, &muscle, &context), SPHM_OK) << context.message;
    }
    ~Muscle() { sphm_muscle_destroy(muscle); }
    Muscle(const Muscle &) = delete;
    Muscle &operator=(const Muscle &) = delete;

    void advance(double duration_s) {
        ASSERT_EQ(sphm_muscle_advance(muscle, duration_s, &context), SPHM_OK) << context.message;
    }
    sphm_status save(const std::string &path) { return sphm_muscle_save(muscle, path.c_str(), &context); }
    sphm_status load(const std::string &path) { return sphm_muscle_load(muscle, path.c_str(), &context); }
    uint64_t hash() { return sphm_muscle_hash(muscle); }
    // Everything that can pull, at different times.
    void drive() {
        const double point[3] = {0, 0, 0}, force[3] = {0.02, 0.05, 0};
        ASSERT_EQ(sphm_muscle_stimulate(muscle, "belly", 8000, 0.015, &context), SPHM_OK) << context.message;
        ASSERT_EQ(sphm_muscle_schedule(muscle, "0.018:0.03:8000:origin:200:0.002", &context), SPHM_OK)
            << context.message;
        ASSERT_EQ(sphm_muscle_apply_force(muscle, point, force, 0.01, 0.02, &context), SPHM_OK)
            << context.message;
    }

    sphm_context context{};
    sphm_muscle *muscle = nullptr;
};

// Loading must fail, say `word` and leave the muscle as it is.
void expect_refused(Muscle &muscle, const std::string &path, const char *word) {
    const uint64_t before = muscle.hash();
    const double time = sphm_muscle_time(muscle.muscle),
                 stimulus = sphm_muscle_stimulus(muscle.muscle, nullptr);
    ASSERT_EQ(muscle.load(path), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(muscle.context.message, word), nullptr) << muscle.context.message;
    EXPECT_EQ(muscle.hash(), before);
    EXPECT_EQ(sphm_muscle_time(muscle.muscle), time);
    EXPECT_EQ(sphm_muscle_stimulus(muscle.muscle, nullptr), stimulus);
}

TEST(Snapshot, ARestoredMuscleContinuesBitForBit) {
    Folder folder;
    const std::string file = folder.file("a.snapshot");
    Muscle one(Settings{{"threads", "1"}}), two(Settings{{"threads", "2"}}),
        fresh(Settings{{"threads", "1"}});
    one.drive();
    two.drive();
    const uint64_t at_rest = one.hash();
    one.advance(0.01);
    two.advance(0.01);
    EXPECT_NE(one.hash(), at_rest);
    EXPECT_EQ(one.hash(), two.hash()) << "threads";

    const uint64_t saved = one.hash();
    ASSERT_EQ(one.save(file), SPHM_OK) << one.context.message;
    EXPECT_EQ(one.hash(), saved) << "saving changes nothing";
    one.advance(0.02);

    for (Muscle *other : {&two, &fresh}) {
        other->advance(0.007); // somewhere else, with other neighbours
        ASSERT_EQ(other->load(file), SPHM_OK) << other->context.message;
        EXPECT_EQ(other->hash(), saved);
        EXPECT_DOUBLE_EQ(sphm_muscle_time(other->muscle), 0.01);
        EXPECT_EQ(sphm_muscle_stimulus(other->muscle, "belly"), 8000);
        other->advance(0.02);
        EXPECT_EQ(other->hash(), one.hash());
        EXPECT_EQ(sphm_muscle_steps(other->muscle), sphm_muscle_steps(one.muscle));
    }
    sphm_observation a, b;
    ASSERT_EQ(sphm_muscle_observe(one.muscle, &a, nullptr), SPHM_OK);
    ASSERT_EQ(sphm_muscle_observe(two.muscle, &b, nullptr), SPHM_OK);
    EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0);
    EXPECT_GT(a.displacement_mean_m, 0);
}

TEST(Snapshot, SavingDoesNotDisturbTheMuscle) {
    Folder folder;
    Muscle quiet, saving;
    quiet.drive();
    saving.drive();
    for (int i = 0; i < 5; ++i) {
        quiet.advance(0.003);
        saving.advance(0.003);
        ASSERT_EQ(saving.save(folder.file("b.snapshot")), SPHM_OK);
        ASSERT_EQ(saving.hash(), quiet.hash());
    }
}

TEST(Snapshot, ReplacesAnOlderFileAndLeavesNoOther) {
    Folder folder;
    Muscle muscle;
    ASSERT_EQ(muscle.save(folder.file("c.snapshot")), SPHM_OK);
    const Bytes first = read(folder.file("c.snapshot"));
    muscle.advance(0.001);
    ASSERT_EQ(muscle.save(folder.file("c.snapshot")), SPHM_OK);
    const Bytes second = read(folder.file("c.snapshot"));
    EXPECT_EQ(first.size(), second.size());
    EXPECT_NE(first, second);
    const std::string count = "test $(ls '" + folder.path + "' | wc -l) -eq 1";
    EXPECT_EQ(std::system(count.c_str()), 0);
}

TEST(Snapshot, RefusesTruncatedAndFlippedFiles) {
    Folder folder;
    const std::string file = folder.file("d.snapshot"), bad = folder.file("bad.snapshot");
    Muscle muscle;
    muscle.drive();
    muscle.advance(0.005);
    ASSERT_EQ(muscle.save(file), SPHM_OK);
    const Bytes whole = read(file);
    ASSERT_GT(whole.size(), 320u * 14 * 4);
    muscle.advance(0.003);
    for (size_t size = 0; size < whole.size(); size += 97) {
        write(bad, Bytes(whole.begin(), whole.begin() + std::ptrdiff_t(size)));
        expect_refused(muscle, bad, "snapshot");
        if (HasFatalFailure())
            return;
    }
    for (size_t at = 0; at < whole.size(); at += 101) {
        Bytes flipped = whole;
        flipped[at] ^= (unsigned char)(1u << (at % 8));
        write(bad, flipped);
        expect_refused(muscle, bad, "snapshot");
        if (HasFatalFailure())
            return;
    }
    EXPECT_EQ(muscle.load(file), SPHM_OK) << "the whole file still is one: " << muscle.context.message;
}

TEST(Snapshot, SurvivesForgedFiles) {
    // With a checksum that is right: nothing may be trusted for being whole. Most of these are refused; one
    // that loads must only have changed a value.
    Folder folder;
    const std::string file = folder.file("e.snapshot"), bad = folder.file("bad.snapshot");
    Muscle muscle;
    muscle.drive();
    ASSERT_EQ(muscle.save(file), SPHM_OK);
    const Bytes whole = read(file);
    int refused = 0, loaded = 0;
    for (size_t at = 8; at + 8 < whole.size(); at += at < 3000 || at + 1200 > whole.size() ? 7 : 1511) {
        Bytes forged = whole;
        forged[at] ^= 0x80;
        seal(forged);
        write(bad, forged);
        const sphm_status status = muscle.load(bad);
        ASSERT_TRUE(status == SPHM_OK || status == SPHM_REFUSED_FILE || status == SPHM_REFUSED_ARGUMENT)
            << muscle.context.message;
        ++(status == SPHM_OK ? loaded : refused);
    }
    EXPECT_GT(refused, 100);
    EXPECT_GT(loaded, 0);
    for (size_t size = 20; size + 8 < whole.size(); size += 997) {
        Bytes cut(whole.begin(), whole.begin() + std::ptrdiff_t(size + 8));
        seal(cut);
        write(bad, cut);
        ASSERT_EQ(muscle.load(bad), SPHM_REFUSED_FILE);
    }
}

TEST(Snapshot, RefusesAnotherMuscleNamingTheDifference) {
    Folder folder;
    const std::string file = folder.file("f.snapshot");
    Muscle muscle;
    const struct {
        const char *parameter, *value, *word;
    } differences[] = {{"particles", "500", "particles"},
                       {"stiffness", "90", "stiffness"},
                       {"viscosity", "14", "viscosity 14 there, 15 here"},
                       {"attachment_fraction", "0.2", "attachments"},
                       {"density", "1000", "particle mass"},
                       {"jitter", "0.1", "rest positions"},
                       {"pennation_angle", "10", "fibre"},
                       {"coupling", "pressure", "coupling"},
                       {"gravity", "[0, 0, -9.81]", "gravity"},
                       {"electrode", "origin", "electrode"}};
    for (const auto &difference : differences) {
        Settings settings = {{difference.parameter, difference.value}};
        if (std::string(difference.parameter) == "pennation_angle")
            settings.push_back({"fibres", "pennate"});
        Muscle other(settings);
        ASSERT_EQ(other.save(file), SPHM_OK);
        SCOPED_TRACE(difference.parameter);
        expect_refused(muscle, file, difference.word);
    }
    Muscle threads(Settings{{"threads", "2"}, {"rate", "30"}});
    ASSERT_EQ(threads.save(file), SPHM_OK);
    EXPECT_EQ(muscle.load(file), SPHM_OK)
        << "neither changes what a step computes: " << muscle.context.message;
}

TEST(Snapshot, RefusesOtherVersionsAndOtherFiles) {
    Folder folder;
    const std::string file = folder.file("g.snapshot");
    Muscle muscle;
    ASSERT_EQ(muscle.save(file), SPHM_OK);
    Bytes bytes = read(file);
    bytes[8] = 1;
    seal(bytes);
    write(file, bytes);
    expect_refused(muscle, file, "version 1");
    bytes[0] = 'X';
    seal(bytes);
    write(file, bytes);
    expect_refused(muscle, file, "not a snapshot");
    write(file, {});
    expect_refused(muscle, file, "not a snapshot");
    expect_refused(muscle, folder.file("missing"), "No such file");
    expect_refused(muscle, folder.path, "not a regular file");
    ASSERT_EQ(mkfifo(folder.file("pipe").c_str(), 0600), 0);
    expect_refused(muscle, folder.file("pipe"), "not a regular file");
    EXPECT_EQ(sphm_muscle_load(muscle.muscle, "", nullptr), SPHM_REFUSED_ARGUMENT);
    EXPECT_EQ(sphm_muscle_load(muscle.muscle, nullptr, nullptr), SPHM_REFUSED_ARGUMENT);
}

TEST(Snapshot, RefusesFoldersItCannotWriteTo) {
    Folder folder;
    Muscle muscle;
    EXPECT_EQ(muscle.save(folder.file("missing/h.snapshot")), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(muscle.context.message, "missing/h.snapshot"), nullptr) << muscle.context.message;
    ASSERT_EQ(mkdir(folder.file("taken").c_str(), 0700), 0);
    EXPECT_EQ(muscle.save(folder.file("taken")), SPHM_REFUSED_FILE) << "a folder has that name";
    EXPECT_EQ(muscle.save(""), SPHM_REFUSED_ARGUMENT);
    const std::string count = "test $(ls '" + folder.path + "' | wc -l) -eq 1";
    EXPECT_EQ(std::system(count.c_str()), 0) << "temporary files were left";
    if (geteuid() == 0)
        GTEST_SKIP() << "root may write everywhere";
    ASSERT_EQ(chmod(folder.path.c_str(), 0500), 0);
    EXPECT_EQ(muscle.save(folder.file("i.snapshot")), SPHM_REFUSED_FILE);
}

TEST(Bytes, AreLittleEndianAndHashedAsPublished) {
    // FNV-1a of "" and of "foobar", from the authors' test suite.
    EXPECT_EQ(sphm_hash_bytes(SPHM_HASH_START, "", 0), 0xcbf29ce484222325u);
    EXPECT_EQ(sphm_hash_bytes(SPHM_HASH_START, "foobar", 6), 0x85944171f73967e8u);
    sphm_writer writer{};
    sphm_write_u32(&writer, 0x01020304);
    sphm_write_double(&writer, -2.5);
    sphm_write_text(&writer, "ab");
    ASSERT_EQ(writer.size, 18u);
    EXPECT_EQ(writer.data[0], 4);
    EXPECT_EQ(writer.data[11], 0xc0) << "sign and exponent come last";
    sphm_reader reader = {writer.data, writer.size, 0, 0};
    char text[3];
    EXPECT_EQ(sphm_read_u32(&reader), 0x01020304u);
    EXPECT_EQ(sphm_read_double(&reader), -2.5);
    sphm_read_text(&reader, text, sizeof text);
    EXPECT_STREQ(text, "ab");
    EXPECT_EQ(reader.short_of, 0);
    EXPECT_EQ(sphm_read_u32(&reader), 0u);
    EXPECT_EQ(reader.short_of, 1);
    std::free(writer.data);
}

} // namespace
