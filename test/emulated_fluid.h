// The launches of the fluid on the emulated device: the threads of cuda/fluid_threads.h and cuda/fluid_rows.h
// one after the other, and the standard library's sort in the place of CUB's.
#ifndef SPHM_TEST_EMULATED_FLUID_H
#define SPHM_TEST_EMULATED_FLUID_H

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <vector>

#include "cuda/fluid_rows.h"

namespace emulated {

inline bool &backwards();

// Threads 0 ... count - 1, in either order.
template <class Thread> void for_threads(size_t count, Thread thread) {
    for (size_t k = 0; k < count; ++k)
        thread(backwards() ? count - 1 - k : k);
}

// As reduce() of cuda/fluid_launch.cu: the threads of a block, added up 128, 64, ... 1 apart.
template <size_t numbers, class Thread, class Add>
void reduce(const sphm_fluid_device &d, double start, Thread thread, Add add, double *out) {
    const size_t blocks = static_cast<size_t>(d.partials);
    for_threads(blocks, [&](size_t block) {
        static std::vector<double> all(SPHM_FLUID_BLOCK * numbers);
        std::fill(all.begin(), all.end(), start);
        for_threads(SPHM_FLUID_BLOCK, [&](size_t t) {
            thread(block * SPHM_FLUID_BLOCK + t, blocks * SPHM_FLUID_BLOCK, &all[numbers * t]);
        });
        for (size_t apart = SPHM_FLUID_BLOCK / 2; apart > 0; apart /= 2)
            for (size_t k = 0; k < apart * numbers; ++k)
                all[k] = add(all[k], all[k + apart * numbers]);
        std::copy_n(all.begin(), numbers, out + numbers * block);
    });
}

inline void sort(const sphm_fluid_device &d) {
    std::vector<int32_t> places(d.count);
    std::iota(places.begin(), places.end(), 0);
    std::stable_sort(places.begin(), places.end(), [&](int32_t a, int32_t b) { return d.key[a] < d.key[b]; });
    for (size_t k = 0; k < d.count; ++k) {
        if (d.key[places[k]] >> d.key_bits)
            abort(); // the library would not look at these bits
        d.sorted_key[k] = d.key[places[k]];
        d.order[k] = d.value[places[k]];
    }
}

inline void run_rebuild(const sphm_fluid_device &d, int which) {
    const auto larger = [](double a, double b) { return a > b ? a : b; };
    switch (which) {
    case SPHM_FLUID_LIST:
        return for_threads(d.count, [&](size_t i) { sphm_fluid_list_thread(&d, i); });
    case SPHM_FLUID_BOX:
        return reduce<6>(
            d, -HUGE_VAL,
            [&](size_t t, size_t threads, double *s) { sphm_fluid_box_thread(&d, t, threads, s); }, larger,
            d.extremes);
    case SPHM_FLUID_LAY_OUT:
        return sphm_fluid_lay_out_thread(&d);
    case SPHM_FLUID_BIN:
        return for_threads(d.count, [&](size_t i) { sphm_fluid_bin_thread(&d, i); });
    case SPHM_FLUID_SORT:
        return sort(d);
    case SPHM_FLUID_STARTS:
        return for_threads(sphm_cells_most(d.count) + 1, [&](size_t c) { sphm_fluid_starts_thread(&d, c); });
    case SPHM_FLUID_REORDER:
        return for_threads(d.count, [&](size_t i) { sphm_fluid_reorder_thread(&d, i); });
    case SPHM_FLUID_SETTLE:
        return for_threads(d.count, [&](size_t i) { sphm_fluid_settle_thread(&d, i); });
    case SPHM_FLUID_COUNT:
        return for_threads(d.count + 1, [&](size_t i) { sphm_fluid_count_thread(&d, i); });
    case SPHM_FLUID_SCAN:
        d.row_start[0] = 0;
        for (size_t i = 0; i < d.count; ++i)
            d.row_start[i + 1] = d.row_start[i] + d.row_length[i];
        return;
    default:
        break;
    }
    if (!sphm_fluid_rows_fit(&d))
        return;
    if (which == SPHM_FLUID_FILL)
        return for_threads(d.count, [&](size_t i) { sphm_fluid_fill_thread(&d, i); });
    for_threads(d.count, [&](size_t i) {
        sphm_real sum[SPHM_MOMENT_COUNT];
        if (which == SPHM_FLUID_CORRECT) {
            gather<SPHM_MOMENT_COUNT>(
                [&](int lane, sphm_real *s) { sphm_fluid_correct_lane(&d, i, lane, s); }, sum);
            sphm_fluid_correct_finish(&d, i, sum);
        } else {
            gather<1>([&](int lane, sphm_real *s) { sphm_fluid_weigh_lane(&d, i, lane, s); }, sum);
            sphm_fluid_weigh_finish(&d, i, sum);
        }
    });
}

inline void run_report(const sphm_fluid_device &d, int which) {
    const auto larger = [](double a, double b) { return a > b ? a : b; };
    if (which == SPHM_FLUID_REPORT)
        reduce<3>(
            d, 0, [&](size_t t, size_t threads, double *s) { sphm_fluid_report_thread(&d, t, threads, s); },
            larger, &d.report->largest[0][0]);
    else if (which == SPHM_FLUID_WITHIN)
        for_threads(d.count, [&](size_t i) { sphm_fluid_within_thread(&d, i); });
    else
        for_threads(d.count, [&](size_t i) { sphm_fluid_set_rest_thread(&d, i); });
}

inline void run_fluid_particle(const sphm_fluid_device &d, const sphm_fluid_call &call, size_t i) {
    const sphm_fluid_plan *p = &d.submission->plan[call.step];
    sphm_real sum[4];
    switch (call.launch) {
    case SPHM_FLUID_PREDICT:
        return sphm_fluid_predict_thread(&d, call.step, i);
    case SPHM_FLUID_SMOOTH:
        gather<4>([&](int lane, sphm_real *s) { sphm_fluid_smooth_lane(&d, i, lane, s); }, sum);
        return sphm_fluid_smooth_finish(&d, p, i, sum);
    case SPHM_FLUID_SPREAD:
        if (call.substep + 1 >= p->membrane.substeps)
            return;
        gather<1>([&](int lane, sphm_real *s) { sphm_fluid_spread_lane(&d, p, call.substep, i, lane, s); },
                  sum);
        (void)sphm_fluid_spread_finish(&d, p, call.substep, i, sum);
        return;
    case SPHM_FLUID_FORCE:
        gather<4>(
            [&](int lane, sphm_real *s) {
                sphm_fluid_force_lane(&d, d.kind, i, lane, s);
                if (p->membrane.substeps > 0)
                    sphm_fluid_spread_lane(&d, p, p->membrane.substeps - 1, i, lane, s + 3);
            },
            sum);
        return sphm_fluid_force_finish(&d, p, call.step, i, sum);
    default:
        abort();
    }
}

inline void run_fluid(const sphm_fluid_device &d, const sphm_fluid_call &call) {
    if (call.launch < SPHM_FLUID_SUM)
        return run_rebuild(d, call.launch);
    if (call.launch == SPHM_FLUID_SNAPSHOT)
        return for_threads(d.count, [&](size_t i) { sphm_fluid_snapshot_thread(&d, &call, i); });
    if (call.launch > SPHM_FLUID_FORCE)
        return run_report(d, call.launch);
    if (sphm_fluid_has_ended(&d, call.step))
        return;
    if (call.launch == SPHM_FLUID_SUM) {
        reduce<SPHM_MOMENT_SUMS>(
            d, 0,
            [&](size_t t, size_t threads, double *s) { sphm_fluid_sum_thread(&d, call.step, t, threads, s); },
            [](double a, double b) { return a + b; }, d.moment);
    } else if (call.launch == SPHM_FLUID_RIGID) {
        for_threads(SPHM_MOMENT_SUMS,
                    [&](size_t t) { sphm_fluid_rigid_thread(&d, d.moment, static_cast<int>(t)); });
        sphm_fluid_rigid_finish(&d);
    } else {
        for_threads(d.count, [&](size_t i) { run_fluid_particle(d, call, i); });
    }
}

} // namespace emulated

#endif
