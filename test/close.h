// Two muscles, array by array and by particle id.
#ifndef SPHM_TEST_CLOSE_H
#define SPHM_TEST_CLOSE_H

#include "muscles.h"

#include <cmath>
#include <map>

// By id, one vector an array.
inline std::map<std::string, std::vector<double>> arrays_by_id(const Muscle &muscle) {
    enum { STATE = 1, REST = 0, SCRATCH = 0 };
    std::map<std::string, std::vector<double>> all;
    const sphm_state &s = muscle.state();
#define ARRAY(type, name, role, unit, meaning)                                                               \
    if (role) {                                                                                              \
        std::vector<double> &one = all[#name];                                                               \
        one.resize(s.count);                                                                                 \
        for (size_t slot = 0; slot < s.count; ++slot)                                                        \
            one[static_cast<size_t>(s.id[slot])] = static_cast<double>(s.name[slot]);                        \
    }
#include "core/state_arrays.inc"
#undef ARRAY
    return all;
}

inline double largest_difference(const std::vector<double> &a, const std::vector<double> &b) {
    double worst = 0;
    for (size_t i = 0; i < a.size(); ++i)
        worst = std::isfinite(b[i]) ? std::fmax(worst, std::fabs(a[i] - b[i])) : INFINITY;
    return worst;
}

inline double largest_magnitude(const std::vector<double> &a) {
    return largest_difference(a, std::vector<double>(a.size()));
}

#endif
