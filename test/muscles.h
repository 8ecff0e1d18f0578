// Small muscles for tests, of the paper's tissue unless they ask for the other, and their state by particle
// id.
#ifndef SPHM_TEST_MUSCLES_H
#define SPHM_TEST_MUSCLES_H

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "core/muscle.h"

struct Muscle {
    sphm_muscle *handle = nullptr;
    sphm_context context{};
    sphm_status status = SPHM_OK;
    std::string warnings;

    using Settings = std::vector<std::pair<const char *, const char *>>;

    explicit Muscle(const Settings &settings = {}) {
        context.log = [](sphm_log_level level, const char *text, void *user) {
            if (level == SPHM_LOG_WARNING)
                static_cast<Muscle *>(user)->warnings += std::string(text) + "\n";
        };
        context.user = this;
        sphm_parameters parameters = sphm_parameters_default();
        set(parameters, "tissue", "fluid");
        set(parameters, "particles", "400");
        set(parameters, "threads", "1");
        set(parameters, "backend", "cpu"); // tests look inside it
        for (const auto &setting : settings)
            set(parameters, setting.first, setting.second);
        status = sphm_muscle_create(&parameters, nullptr, &handle, &context);
    }
    Muscle(const Muscle &) = delete;
    ~Muscle() { sphm_muscle_destroy(handle); }

    void set(sphm_parameters &parameters, const char *name, const char *value) {
        EXPECT_EQ(sphm_parameters_set(&parameters, name, value, &context), SPHM_OK) << context.message;
    }
    const sphm_state &state() const { return *sphm_muscle_state(handle); }
    size_t count() const { return state().count; }
    void advance(double seconds) {
        ASSERT_EQ(sphm_muscle_advance(handle, seconds, &context), SPHM_OK) << context.message;
    }
    void stimulate(double current) {
        ASSERT_EQ(sphm_muscle_stimulate(handle, nullptr, current, 0, &context), SPHM_OK) << context.message;
    }
    // Every STATE value but the slot order, by id: what a hash covers.
    std::vector<double> values() const {
        enum { STATE = 1, REST = 0, SCRATCH = 0 };
        const sphm_state &s = state();
        std::vector<double> all;
#define ARRAY(type, name, role, unit, meaning)                                                               \
    if (role) {                                                                                              \
        std::vector<double> one(s.count);                                                                    \
        for (size_t slot = 0; slot < s.count; ++slot)                                                        \
            one[static_cast<size_t>(s.id[slot])] = static_cast<double>(s.name[slot]);                        \
        all.insert(all.end(), one.begin(), one.end());                                                       \
    }
#include "core/state_arrays.inc"
#undef ARRAY
        all.push_back(s.time_s);
        return all;
    }
};

#endif
