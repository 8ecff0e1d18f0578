// Commands and schedules of the electrodes: who wins, when the drive changes, and what is refused.
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <string>

#include "core/stimulus.h"

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr int kBelly = SPHM_ELECTRODE_BELLY, kOrigin = SPHM_ELECTRODE_ORIGIN;

class Stimulus : public ::testing::Test {
  protected:
    void SetUp() override { create(""); }
    void TearDown() override { sphm_stimulus_free(&stimulus); }
    void create(const char *schedule) {
        sphm_stimulus_free(&stimulus);
        parameters = sphm_parameters_default();
        snprintf(parameters.stimulus, sizeof parameters.stimulus, "%s", schedule);
        ASSERT_EQ(sphm_stimulus_create(&stimulus, &parameters, &context), SPHM_OK) << context.message;
    }
    void add(const char *schedule, double now_s = 0) {
        ASSERT_EQ(sphm_stimulus_schedule(&stimulus, now_s, schedule, &context), SPHM_OK) << context.message;
    }
    void command(const char *electrode, double now_s, double current, double duration_s) {
        ASSERT_EQ(sphm_stimulus_command(&stimulus, now_s, electrode, current, duration_s, &context), SPHM_OK)
            << context.message;
    }
    double at(double time_s, int electrode = kBelly) {
        return sphm_stimulus_current(&stimulus, electrode, time_s);
    }
    double next(double time_s) { return sphm_stimulus_next_change(&stimulus, time_s); }
    // The schedule must be refused, with a message that holds both texts.
    void refuse(const char *schedule, const char *entry, const char *field) {
        const size_t before = stimulus.count;
        EXPECT_EQ(sphm_stimulus_schedule(&stimulus, 0, schedule, &context), SPHM_REFUSED_ARGUMENT)
            << schedule;
        EXPECT_NE(std::string(context.message).find(entry), std::string::npos) << context.message;
        EXPECT_NE(std::string(context.message).find(field), std::string::npos) << context.message;
        EXPECT_EQ(stimulus.count, before) << "a refused schedule leaves nothing behind";
        EXPECT_EQ(sphm_stimulus_check(schedule, nullptr), SPHM_REFUSED_ARGUMENT);
    }
    sphm_parameters parameters{};
    sphm_stimulus stimulus{};
    sphm_context context{};
};

TEST_F(Stimulus, EntryDrivesFromStartToEnd) {
    add("0.5:1.5:8000");
    EXPECT_EQ(at(0.4), 0);
    EXPECT_EQ(at(0.5), 8000);
    EXPECT_EQ(at(1.4999), 8000);
    EXPECT_EQ(at(1.5), 0);
    EXPECT_EQ(at(1.0, kOrigin), 0);
    EXPECT_EQ(next(0), 0.5);
    EXPECT_EQ(next(0.5), 1.5);
    EXPECT_EQ(next(1.5), kNever);
}

TEST_F(Stimulus, TimesThatMissAChangeByRoundingCountAsThere) {
    add("0.5:1.5:8000");
    EXPECT_EQ(at(0.5 - 1e-12), 8000);
    EXPECT_EQ(next(0.5 - 1e-12), 1.5);
    EXPECT_EQ(at(1.5 - 1e-12), 0);
}

TEST_F(Stimulus, LaterEntryWinsWhereTwoOverlap) {
    add("0:10:100; 2:3:200 ;4:5:0;");
    EXPECT_EQ(at(1), 100);
    EXPECT_EQ(at(2.5), 200);
    EXPECT_EQ(at(3.5), 100);
    EXPECT_EQ(at(4.5), 0);
    EXPECT_EQ(at(6), 100);
}

TEST_F(Stimulus, ElectrodesAreIndependent) {
    add("0:1:1:origin; 0:1:2:insertion;0:1:3:both; 0:1:4:sphere");
    EXPECT_EQ(at(0.5, kOrigin), 1);
    EXPECT_EQ(at(0.5, SPHM_ELECTRODE_INSERTION), 2);
    EXPECT_EQ(at(0.5, SPHM_ELECTRODE_BOTH), 3);
    EXPECT_EQ(at(0.5, SPHM_ELECTRODE_SPHERE), 4);
    EXPECT_EQ(at(0.5, kBelly), 0);
    sphm_drive drive{};
    drive.force_count = 3;
    sphm_stimulus_drive(&stimulus, 0.5, &drive);
    EXPECT_EQ(drive.driven[kBelly], 0);
    EXPECT_EQ(drive.driven[kOrigin], 1);
    EXPECT_EQ(drive.current_uA_per_mm2[SPHM_ELECTRODE_BOTH], 3);
    EXPECT_EQ(drive.force_count, 3u);
}

TEST_F(Stimulus, EntriesWithoutAnElectrodeTakeTheDefaultOne) {
    parameters.electrode = kOrigin;
    sphm_stimulus_free(&stimulus);
    ASSERT_EQ(sphm_stimulus_create(&stimulus, &parameters, &context), SPHM_OK);
    add("0:1:5");
    command(nullptr, 2, 6, 1);
    EXPECT_EQ(at(0.5, kOrigin), 5);
    EXPECT_EQ(at(2.5, kOrigin), 6);
}

TEST_F(Stimulus, PulseTrain) {
    add("1:2:8000:belly:50:0.002");
    int on = 0, changes = 0;
    for (int k = 0; k < 20000; k++)
        on += at(0.9 + (k + 0.5) * 1e-4) != 0;
    EXPECT_EQ(on, 50 * 20) << "50 pulses of 2 ms";
    for (double t = 0; std::isfinite(next(t)); changes++) {
        const double after = next(t);
        ASSERT_GT(after, t);
        EXPECT_NE(at(after), changes == 100 ? 8000 : at((t + after) / 2)) << "at " << after;
        t = after;
    }
    EXPECT_EQ(changes, 101) << "50 pulses on and off, and the end of the entry";
}

TEST_F(Stimulus, PulsesOfAwkwardRatesNeverStallTheClock) {
    add("0.1:30:1:belly:33.3:0.0007; 0:30:1:origin:7.7:0.1");
    size_t changes = 0;
    for (double t = 0; std::isfinite(t); t = next(t))
        changes++;
    EXPECT_LT(changes, 2u * (1000 + 232) + 10);
    EXPECT_GT(changes, 2u * 995 + 400);
}

TEST_F(Stimulus, CommandWinsOverTheSchedule) {
    add("0:10:100");
    command("belly", 2, 0, 0);
    EXPECT_EQ(at(2), 0);
    EXPECT_EQ(at(9), 0);
    command("belly", 3, 500, 1);
    EXPECT_EQ(at(3.5), 500);
    EXPECT_EQ(next(3.5), 4);
    EXPECT_EQ(at(4.5), 100) << "a timed command takes the place of the held one, then the schedule is heard";
}

TEST_F(Stimulus, LastCommandWinsAndOthersKeepRunning) {
    command("belly", 0, 100, 0);
    command("origin", 0, 7, 0);
    command("belly", 1, 200, 0);
    EXPECT_EQ(at(1), 200);
    EXPECT_EQ(at(1, kOrigin), 7);
    EXPECT_EQ(next(1), kNever);
}

TEST_F(Stimulus, ScheduleThatArrivesAfterACommandIsHeard) {
    command("belly", 0, 0, 0);
    add("1:2:8000", 0.5);
    EXPECT_EQ(at(0.7), 0);
    EXPECT_EQ(at(1.5), 8000);
    EXPECT_EQ(at(2.5), 0);
    command("belly", 1.6, 30, 0);
    EXPECT_EQ(at(1.7), 30);
}

TEST_F(Stimulus, EndMayBeInfinite) {
    add("1:inf:3");
    EXPECT_EQ(at(1e9), 3);
    EXPECT_EQ(next(1), kNever);
}

TEST_F(Stimulus, ResetStartsTheScheduleOfTheParametersAgain) {
    create("0:1:10");
    add("0:1:20");
    command("belly", 0, 30, 0);
    ASSERT_EQ(sphm_stimulus_reset(&stimulus, &parameters, &context), SPHM_OK);
    EXPECT_EQ(at(0.5), 10);
}

TEST_F(Stimulus, EntriesThatAreOverAreForgotten) {
    for (int k = 0; k < 10000; k++) {
        const std::string entry = std::to_string(k) + ":" + std::to_string(k + 2) + ":1";
        add(entry.c_str(), k);
    }
    EXPECT_LE(stimulus.count, 4u);
    EXPECT_EQ(at(10000), 1);
}

TEST_F(Stimulus, BadCommandsAreRefusedAndChangeNothing) {
    command("belly", 0, 100, 0);
    const double nan = std::nan("");
    const auto refused = [&](const char *electrode, double current, double duration, const char *named) {
        EXPECT_EQ(sphm_stimulus_command(&stimulus, 1, electrode, current, duration, &context),
                  SPHM_REFUSED_ARGUMENT);
        EXPECT_NE(std::string(context.message).find(named), std::string::npos) << context.message;
        EXPECT_EQ(at(1), 100);
        EXPECT_EQ(sphm_stimulus_command(&stimulus, 1, electrode, current, duration, nullptr),
                  SPHM_REFUSED_ARGUMENT);
    };
    refused("belly", nan, 0, "stimulus is nan");
    refused("belly", kNever, 0, "stimulus is inf");
    refused("belly", -kNever, 0, "stimulus is -inf");
    refused("belly", 1, -1, "duration is -1");
    refused("belly", 1, nan, "duration is nan");
    refused("belly", 1, kNever, "duration is inf");
    refused("thigh", 1, 0, "thigh");
    refused("", 1, 0, "unknown electrode \"\"");
}

TEST_F(Stimulus, MalformedSchedulesAreRefusedByEntryAndField) {
    refuse("1:2", "entry 1 \"1:2\"", "2 fields");
    refuse("0:1:5; 1:2:3:belly:20", "entry 2", "5 fields");
    refuse("0:1:5:belly:20:0.01:9", "entry 1", "7 fields");
    refuse("x:1:5", "entry 1", "START is \"x\"");
    refuse("-1:1:5", "entry 1", "START is \"-1\"");
    refuse("nan:1:5", "entry 1", "START is \"nan\"");
    refuse("inf:inf:5", "entry 1", "START is \"inf\"");
    refuse("0:1:5;0:1:5;2:1:5", "entry 3", "END is \"1\"");
    refuse("1:1:5", "entry 1", "END is \"1\"");
    refuse("0:1:nan", "entry 1", "CURRENT is \"nan\"");
    refuse("0:1:inf", "entry 1", "CURRENT is \"inf\"");
    refuse("0:1:", "entry 1", "CURRENT is \"\"");
    refuse("0:1:8000uA", "entry 1", "CURRENT is \"8000uA\"");
    refuse("0:1:5:thigh", "entry 1", "ELECTRODE is \"thigh\"");
    refuse("0:1:5:belly:0:0.01", "entry 1", "RATE_HZ is \"0\"");
    refuse("0:1:5:belly:-3:0.01", "entry 1", "RATE_HZ is \"-3\"");
    refuse("0:1:5:belly:20:0", "entry 1", "PULSE_S is \"0\"");
    refuse("0:1:5:belly:20:0.05", "entry 1", "PULSE_S is \"0.05\"");
    refuse(std::string(500, '7').c_str(), "entry 1", "1 fields");
    EXPECT_EQ(sphm_stimulus_schedule(&stimulus, 0, nullptr, &context), SPHM_REFUSED_ARGUMENT);
}

TEST_F(Stimulus, EmptySchedulesAreFine) {
    add("");
    add(" ; ;\n");
    EXPECT_EQ(stimulus.count, 0u);
}

} // namespace
