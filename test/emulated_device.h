// A device that is the host: memory is malloc's, launches run the threads of cuda/solid_threads.h one after
// the other. What is asked for is done late, at wait(), like on a device with a stream, so that code which
// reads a copy too early, or changes what a launch still needs, fails here too.
#ifndef SPHM_TEST_EMULATED_DEVICE_H
#define SPHM_TEST_EMULATED_DEVICE_H

#include <cstdlib>
#include <cstring>
#include <functional>
#include <vector>

#include "core/context.h"
#include "cuda/fluid_backend.h"
#include "cuda/look_threads.h"
#include "cuda/solid_backend.h"
#include "cuda/solid_threads.h"

namespace emulated {

// What a sphm_device * points to here.
struct device {
    std::vector<void *> memory;
    std::vector<std::function<void()>> queue, kept;
    bool recording = false;
    // The second stream: what it was given, and how much of the first it comes after.
    std::vector<std::function<void()>> looks;
    size_t done = 0, looks_after = 0;
};
inline device *inside(sphm_device *d) {
    return reinterpret_cast<device *>(d);
}

// What tests set: the next request that fails, and how much memory there is.
inline int &requests_left() {
    static int left = -1; // -1: none fails
    return left;
}
inline size_t &memory_limit() {
    static size_t limit = SIZE_MAX;
    return limit;
}
// Threads come in any order on a device.
inline bool &backwards() {
    static bool last_first = false;
    return last_first;
}
// How often one has to ask before a look is finished; it is made when it is asked for the last time.
inline int &patience() {
    static int polls = 0;
    return polls;
}
inline int &submissions_played() {
    static int played = 0;
    return played;
}

inline sphm_status request(sphm_context *context) {
    if (requests_left() < 0 || requests_left()-- > 0)
        return SPHM_OK;
    requests_left() = 0; // a device that has failed stays so
    return sphm_fail(context, SPHM_FAILED_BACKEND, "the emulated device has failed");
}

// The lanes of a row, added up as the shuffles do.
template <size_t numbers, class Lane> void gather(Lane lane, sphm_real sum[numbers]) {
    sphm_real all[SPHM_DEVICE_LANES][numbers] = {};
    for (int l = 0; l < SPHM_DEVICE_LANES; ++l)
        lane(l, all[l]);
    for (int apart = SPHM_DEVICE_LANES / 2; apart > 0; apart /= 2) {
        sphm_real next[SPHM_DEVICE_LANES][numbers];
        for (int l = 0; l < SPHM_DEVICE_LANES; ++l)
            for (size_t k = 0; k < numbers; ++k)
                next[l][k] = all[l][k] + all[l ^ apart][k];
        memcpy(all, next, sizeof all);
    }
    memcpy(sum, all[0], numbers * sizeof *sum);
}

} // namespace emulated

#include "emulated_fluid.h"

namespace emulated {

inline void run_particle(const sphm_solid_device &d, const sphm_solid_call &call, size_t i) {
    const sphm_solid_plan *p = &d.submission->plan[call.step];
    sphm_real sum[19];
    switch (call.launch) {
    case SPHM_SOLID_HITS:
        sphm_solid_hits(&d, call.step, i);
        break;
    case SPHM_SOLID_MOVE:
        gather<3>([&](int lane, sphm_real *s) { sphm_solid_force_lane(&d, d.stress, i, lane, s); }, sum);
        sphm_solid_move_finish(&d, p, call.step, i, sum);
        break;
    case SPHM_SOLID_SPREAD:
        if (call.substep + 1 >= p->membrane.substeps)
            break;
        gather<1>([&](int lane, sphm_real *s) { sphm_solid_spread_lane(&d, p, call.substep, i, lane, s); },
                  sum);
        (void)sphm_solid_spread_finish(&d, p, call.substep, i, sum);
        break;
    case SPHM_SOLID_STRAIN:
        gather<19>(
            [&](int lane, sphm_real *s) {
                sphm_solid_strain_lane(&d, i, lane, s);
                if (p->membrane.substeps > 0)
                    sphm_solid_spread_lane(&d, p, p->membrane.substeps - 1, i, lane, s + 18);
            },
            sum);
        sphm_solid_strain_finish(&d, p, call.step, i, sum);
        break;
    case SPHM_SOLID_PART_STRAIN:
        gather<18>([&](int lane, sphm_real *s) { sphm_solid_strain_lane(&d, i, lane, s); }, sum);
        sphm_solid_part_strain_finish(&d, &call, i, sum);
        break;
    default:
        abort();
    }
}

inline void run(const sphm_solid_device &d, const sphm_solid_call &call) {
    const size_t first = sphm_solid_first_held(&d, call.end);
    switch (call.launch) {
    case SPHM_SOLID_REPORT:
        for (size_t t = 0; t < SPHM_SOLID_PARTIALS; ++t)
            sphm_solid_report_thread(&d, t);
        break;
    case SPHM_SOLID_PART_FORCE:
        for (size_t index = first; index < first + d.held_count[call.end]; ++index) {
            const size_t i = static_cast<size_t>(d.held[index]);
            sphm_real sum[3];
            gather<3>([&](int lane, sphm_real *s) { sphm_solid_force_lane(&d, d.part_stress, i, lane, s); },
                      sum);
            sphm_solid_part_force_finish(&d, index, sum);
        }
        break;
    case SPHM_SOLID_END_FORCE:
        if (sphm_solid_has_failed(&d, call.step))
            break;
        for (size_t index = 0; index < d.held_count[0] + d.held_count[1]; ++index) {
            const size_t i = static_cast<size_t>(d.held[index]);
            sphm_real sum[3];
            gather<3>([&](int lane, sphm_real *s) { sphm_solid_force_lane(&d, d.stress, i, lane, s); }, sum);
            sphm_solid_end_force_finish(&d, call.step, index, sum);
        }
        break;
    case SPHM_SOLID_END_SUM:
        for (size_t t = 0; t < 2 * SPHM_SOLID_END_PARTIALS; ++t)
            sphm_solid_end_sum_thread(&d, t);
        break;
    case SPHM_SOLID_END_STEP:
        for (int end = 0; end < SPHM_END_COUNT && !sphm_solid_has_failed(&d, call.step); ++end)
            sphm_solid_end_step_thread(&d, &d.submission->plan[call.step], d.end_sum, end);
        break;
    case SPHM_SOLID_PART_SUM:
        for (size_t t = 0; t < SPHM_SOLID_PARTIALS; ++t)
            sphm_solid_part_sum_thread(&d, &call, t);
        break;
    case SPHM_SOLID_SNAPSHOT:
        for (size_t i = 0; i < d.count; ++i)
            sphm_solid_snapshot_thread(&d, &call, i);
        break;
    default: {
        const bool part = call.launch == SPHM_SOLID_PART_STRAIN;
        if (!part && sphm_solid_has_failed(&d, call.step))
            return;
        for (size_t k = 0; k < d.count; ++k)
            run_particle(d, call, backwards() ? d.count - 1 - k : k);
    }
    }
}

inline sphm_status open(sphm_device **opened, sphm_context *context) {
    *opened = nullptr;
    const sphm_status status = request(context);
    if (status == SPHM_OK)
        *opened = reinterpret_cast<sphm_device *>(new device);
    return status;
}
inline void close(sphm_device *handle) {
    if (!handle)
        return;
    device *closed = inside(handle);
    for (void *memory : closed->memory)
        free(memory);
    delete closed;
}
inline const char *name(const sphm_device *) {
    return "emulated";
}
inline sphm_status allocate(sphm_device *handle, size_t bytes, void **memory, sphm_context *context) {
    const sphm_status status = request(context);
    if (status != SPHM_OK)
        return status;
    if (bytes > memory_limit())
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "%zu bytes are free", memory_limit());
    *memory = aligned_alloc(256, (bytes + 255) / 256 * 256);
    memset(*memory, 0, bytes);
    inside(handle)->memory.push_back(*memory);
    return SPHM_OK;
}
inline sphm_status enqueue(sphm_device *handle, sphm_context *context, std::function<void()> work) {
    const sphm_status status = request(context);
    if (status == SPHM_OK)
        (inside(handle)->recording ? inside(handle)->kept : inside(handle)->queue).push_back(std::move(work));
    return status;
}
inline sphm_status upload(sphm_device *handle, void *to, const void *from, size_t bytes,
                          sphm_context *context) {
    return enqueue(handle, context, [=] { memcpy(to, from, bytes); });
}
inline sphm_status download(sphm_device *handle, void *to, const void *from, size_t bytes,
                            sphm_context *context) {
    return enqueue(handle, context, [=] { memcpy(to, from, bytes); });
}
inline sphm_status launch(sphm_device *handle, const sphm_solid_device *solid, const sphm_solid_call *call,
                          sphm_context *context) {
    const sphm_solid_device d = *solid;
    const sphm_solid_call c = *call;
    return enqueue(handle, context, [=] { run(d, c); });
}
inline sphm_status launch_fluid(sphm_device *handle, const sphm_fluid_device *fluid,
                                const sphm_fluid_call *call, sphm_context *context) {
    const sphm_fluid_device d = *fluid;
    const sphm_fluid_call c = *call;
    return enqueue(handle, context, [=] { run_fluid(d, c); });
}
inline sphm_status fluid_scratch(sphm_device *, const sphm_fluid_device *, size_t *bytes,
                                 sphm_context *context) {
    *bytes = 1;
    return request(context);
}
inline sphm_status record(sphm_device *handle, sphm_context *context) {
    inside(handle)->kept.clear();
    inside(handle)->recording = true;
    return request(context);
}
inline sphm_status keep(sphm_device *handle, sphm_context *context) {
    inside(handle)->recording = false;
    return request(context);
}
inline sphm_status play(sphm_device *handle, sphm_context *context) {
    ++submissions_played();
    const sphm_status status = request(context);
    if (status == SPHM_OK)
        inside(handle)->queue.insert(inside(handle)->queue.end(), inside(handle)->kept.begin(),
                                     inside(handle)->kept.end());
    return status;
}
inline const double *launch_times(const sphm_device *) {
    return nullptr;
}
// Works of the first stream, until `end` have been done.
inline void work_off(device *d, size_t end) {
    for (; d->done < end; ++d->done)
        d->queue[d->done]();
}
inline void release(sphm_device *handle, void *memory) {
    std::vector<void *> &all = inside(handle)->memory;
    work_off(inside(handle), inside(handle)->queue.size());
    all.erase(std::find(all.begin(), all.end(), memory));
    free(memory);
}
inline sphm_status wait(sphm_device *handle, sphm_context *context) {
    const sphm_status status = request(context);
    device *d = inside(handle);
    if (status == SPHM_OK)
        work_off(d, d->queue.size());
    d->queue.clear();
    d->done = d->looks_after = 0;
    return status;
}

inline sphm_status look_after(sphm_device *handle, sphm_context *context) {
    inside(handle)->looks_after = inside(handle)->queue.size();
    return request(context);
}
inline sphm_status enqueue_look(sphm_device *handle, sphm_context *context, std::function<void()> work) {
    const sphm_status status = request(context);
    if (status == SPHM_OK)
        inside(handle)->looks.push_back(std::move(work));
    return status;
}
inline sphm_status launch_look(sphm_device *handle, const sphm_look_device *look, int launch,
                               sphm_context *context) {
    const sphm_look_device d = *look;
    return enqueue_look(handle, context, [=] {
        const size_t threads = sphm_look_threads(&d, launch);
        for (size_t t = 0; t < threads; ++t)
            sphm_look_run_thread(&d, launch, backwards() ? threads - 1 - t : t);
    });
}
inline sphm_status bring(sphm_device *handle, void *to, const void *from, size_t bytes,
                         sphm_context *context) {
    return enqueue_look(handle, context, [=] { memcpy(to, from, bytes); });
}
inline sphm_status mark(sphm_device *, sphm_context *context) {
    return request(context);
}
inline sphm_status marked(sphm_device *handle, int wait, int *finished, sphm_context *context) {
    const sphm_status status = request(context);
    device *d = inside(handle);
    *finished = status == SPHM_OK && (wait || patience() == 0);
    patience() -= patience() > 0;
    if (!*finished)
        return status;
    work_off(d, d->looks_after);
    for (const auto &work : d->looks)
        work();
    d->looks.clear();
    return status;
}

// One launch for many steps is what the shim runs; here they are launched one by one.
inline int together(const sphm_device *) {
    return 0;
}

inline const sphm_device_ops device_ops = {
    open,       close,        name,          allocate, allocate, release, upload,       download,
    launch,     launch_fluid, fluid_scratch, record,   keep,     play,    launch_times, wait,
    look_after, launch_look,  bring,         mark,     marked,   together};

inline sphm_status create(const sphm_model *model, sphm_backend **backend, sphm_context *context) {
    return sphm_device_solid_create(&device_ops, model, backend, context);
}

inline sphm_status create_fluid(const sphm_model *model, sphm_backend **backend, sphm_context *context) {
    return sphm_device_fluid_create(&device_ops, model, backend, context);
}

// The back ends on the emulated device.
inline const sphm_backend_ops *fluid_ops() {
    static const sphm_backend_ops ops = [] {
        sphm_backend_ops o = sphm_device_fluid_backend;
        o.create = create_fluid;
        return o;
    }();
    return &ops;
}
inline const sphm_backend_ops *backend_ops() {
    static const sphm_backend_ops ops = [] {
        sphm_backend_ops o = sphm_device_solid_backend;
        o.create = create;
        return o;
    }();
    return &ops;
}

} // namespace emulated

#endif
