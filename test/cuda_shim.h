// What the .cu files need of CUDA, on the host: threads of a block are fibers that run in turns from one
// synchronisation to the next, memory and streams are the host's. So block and thread indices, shuffles,
// shared memory, copies and graphs of the CUDA back end are executed as they are written, without a GPU.
//
// Checked beside: a shuffle needs all 32 lanes at the same shuffle, a barrier all threads that still run;
// shared memory begins as rubbish; what a copy reads or writes lies within one allocation; every call can be
// made to fail.
#ifndef SPHM_TEST_CUDA_SHIM_H
#define SPHM_TEST_CUDA_SHIM_H

#include <ucontext.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <set>
#include <vector>

#include "sph_muscle/types.h"

#define __global__
#define __device__
#define __host__
#define __shared__ static
#define __launch_bounds__(threads)
#define SPHM_UNROLL

struct shim_index {
    unsigned x = 0;
};
inline shim_index blockIdx, threadIdx, gridDim;

namespace shim {

// MOST_TOGETHER: blocks that are there at once where they wait for each other.
enum { WARP = 32, MOST_THREADS = 256, MOST_TOGETHER = 2, STACK = 256 * 1024 };
enum sync_kind { NONE, SHUFFLE, BARRIER, GRID };

struct fiber {
    ucontext_t context;
    std::unique_ptr<char[]> stack{new char[STACK]};
    bool done = false;
    sync_kind waits_at = NONE;
    unsigned syncs = 0; // how many it has come to
};

inline std::vector<fiber> all_fibers(MOST_TOGETHER *MOST_THREADS);
inline fiber *fibers = all_fibers.data(); // of the block that runs
inline ucontext_t scheduler;
inline unsigned running;
inline std::function<void()> body;
inline sphm_real lanes[2][MOST_THREADS];

[[noreturn]] inline void die(const char *what) {
    fprintf(stderr, "cuda shim: %s (block %u, thread %u)\n", what, blockIdx.x, running);
    abort();
}

inline void come_to(sync_kind kind) {
    fiber &f = fibers[running];
    f.waits_at = kind;
    ++f.syncs;
    swapcontext(&f.context, &scheduler);
}

inline void run_fiber() {
    body();
    fibers[running].done = true;
    fibers[running].waits_at = NONE;
}

// Everybody who still runs has come to a synchronisation, and to the same one.
inline void check(unsigned threads) {
    for (unsigned t = 0; t < threads; ++t) {
        const fiber &f = fibers[t];
        running = t;
        if (f.done)
            continue;
        for (unsigned other = t / WARP * WARP; other < (t / WARP + 1) * WARP && f.waits_at == SHUFFLE;
             ++other)
            if (other >= threads || fibers[other].done || fibers[other].syncs != f.syncs)
                die("a lane is missing from a shuffle");
        for (unsigned other = 0; other < threads && f.waits_at == BARRIER; ++other)
            if (!fibers[other].done && fibers[other].waits_at != BARRIER)
                die("a thread is missing from a barrier");
    }
}

// Apart from its loop, whose counter a second return of getcontext could spoil as far as the compiler knows.
__attribute__((noinline)) inline void prepare(fiber &f) {
    f.done = false;
    f.syncs = 0;
    getcontext(&f.context);
    f.context.uc_stack.ss_sp = f.stack.get();
    f.context.uc_stack.ss_size = STACK;
    f.context.uc_link = &scheduler;
    makecontext(&f.context, run_fiber, 0);
}

// Until every thread of the block has ended or waits for the grid.
inline void run_block(unsigned threads, bool backwards) {
    for (bool going = true; going;) {
        going = false;
        for (unsigned k = 0; k < threads; ++k) {
            const unsigned t = backwards ? threads - 1 - k : k;
            if (fibers[t].done || fibers[t].waits_at == GRID)
                continue;
            running = t;
            threadIdx.x = t;
            swapcontext(&scheduler, &fibers[t].context);
            going = going || !fibers[t].done;
        }
        check(threads);
    }
}

inline bool &backwards() {
    static bool last_first = false;
    return last_first;
}

// Launches do nothing: for tests that are about the runtime's calls.
inline bool &dry() {
    static bool nothing_runs = false;
    return nothing_runs;
}

inline void run_grid(unsigned blocks, unsigned threads, std::function<void()> kernel) {
    body = std::move(kernel);
    gridDim.x = blocks;
    for (unsigned b = 0; b < blocks && !dry(); ++b) {
        blockIdx.x = backwards() ? blocks - 1 - b : b;
        for (unsigned t = 0; t < threads; ++t)
            prepare(fibers[t]);
        run_block(threads, backwards());
        for (unsigned t = 0; t < threads; ++t)
            if (!fibers[t].done)
                die("a barrier of the grid in a launch whose blocks are not there at once");
    }
}

// Blocks that wait for each other: one after the other, from one barrier of the grid to the next. What a
// block has in shared memory does not survive such a barrier here, for all blocks have the same.
inline void run_grid_together(unsigned blocks, unsigned threads, std::function<void()> kernel) {
    body = std::move(kernel);
    gridDim.x = blocks;
    for (unsigned k = 0; k < blocks * threads; ++k)
        prepare(all_fibers[k]);
    for (bool going = !dry(); going;) {
        unsigned ended = 0, waiting = 0;
        for (unsigned b = 0; b < blocks; ++b) {
            blockIdx.x = backwards() ? blocks - 1 - b : b;
            fibers = all_fibers.data() + blockIdx.x * threads;
            run_block(threads, backwards());
            for (unsigned t = 0; t < threads; ++t)
                ++(fibers[t].done ? ended : waiting);
        }
        if (ended && waiting)
            die("a thread is missing from a barrier of the grid");
        for (fiber &f : all_fibers)
            f.waits_at = NONE;
        going = waiting > 0;
    }
    fibers = all_fibers.data();
}

} // namespace shim

inline void __syncthreads() {
    shim::come_to(shim::BARRIER);
}

inline void SPHM_GRID_BARRIER() {
    shim::come_to(shim::GRID);
}

// Two buffers: who is first at the next shuffle must not overwrite what others still have to read.
inline sphm_real __shfl_xor_sync(unsigned, sphm_real value, int apart) {
    const unsigned t = threadIdx.x, buffer = shim::fibers[t].syncs & 1;
    shim::lanes[buffer][t] = value;
    shim::come_to(shim::SHUFFLE);
    return shim::lanes[buffer][t ^ static_cast<unsigned>(apart)];
}

// The runtime ----------------------------------------------------------------------------------------------

enum cudaError_t { cudaSuccess, cudaErrorMemoryAllocation, cudaErrorNotReady, cudaErrorUnknown };
enum cudaMemcpyKind { cudaMemcpyHostToDevice, cudaMemcpyDeviceToHost };
enum { cudaStreamNonBlocking = 1, cudaHostAllocDefault = 0, cudaStreamCaptureModeThreadLocal = 1 };
enum { cudaEventDisableTiming = 2 };
struct cudaDeviceProp {
    char name[256];
    int major, minor;
};
using shim_work = std::vector<std::function<void()>>;
// Work waits until somebody waits for it: for this stream, or for one that waits for an event of it.
struct shim_stream {
    std::deque<std::function<void()>> queue;
    shim_work captured;
    bool capturing = false;
    void run_one() {
        const std::function<void()> work = std::move(queue.front());
        queue.pop_front();
        work();
    }
};
using cudaStream_t = shim_stream *;
using cudaGraph_t = shim_work *;
using cudaGraphExec_t = shim_work *;

namespace shim {

struct runtime {
    int calls_left = -1; // until a call fails; -1: none does
    cudaError_t error = cudaErrorUnknown, last = cudaSuccess;
    size_t free_bytes = size_t(1) << 30;
    std::map<char *, size_t> device, host; // allocations
    int streams = 0, graphs = 0, events = 0, played = 0, together = 0, clock_ms = 0;
    int not_ready = 0;                   // answers of that kind still to come from cudaEventQuery
    std::function<void()> while_waiting; // done once, when a stream is next waited for
    std::vector<shim_stream *> all_streams;
    bool in_turns = false; // while one stream is waited for, all of them go on, a work each
};
inline runtime now;

// A device that has failed stays so.
inline cudaError_t call() {
    if (now.calls_left < 0 || now.calls_left-- > 0)
        return cudaSuccess;
    now.calls_left = 0;
    return now.error;
}

inline bool within(const std::map<char *, size_t> &memory, const void *from, size_t bytes) {
    auto next = memory.upper_bound(static_cast<char *>(const_cast<void *>(from)));
    if (next == memory.begin())
        return false;
    --next;
    return static_cast<const char *>(from) + bytes <= next->first + next->second;
}

inline cudaError_t enqueue(cudaStream_t stream, std::function<void()> work) {
    if (!stream)
        die("the default stream, for which all others would wait");
    const cudaError_t error = call();
    if (error == cudaSuccess && stream->capturing)
        stream->captured.push_back(std::move(work));
    else if (error == cudaSuccess)
        stream->queue.push_back(std::move(work));
    return error;
}

inline std::set<const void *> loaded; // kernels

template <class Kernel, class... Arguments>
void launch(Kernel kernel, unsigned blocks, unsigned threads, cudaStream_t stream, Arguments... arguments) {
    if (blocks == 0 || threads == 0 || threads > MOST_THREADS)
        die("a launch without blocks, or of too many threads");
    if (stream && stream->capturing && loaded.count(reinterpret_cast<const void *>(kernel)) == 0)
        die("a kernel that would have to be loaded while launches are recorded");
    now.last = enqueue(stream, [=] { run_grid(blocks, threads, [=] { kernel(arguments...); }); });
}

} // namespace shim

#define SPHM_LAUNCH(kernel, blocks, threads, stream, ...)                                                    \
    shim::launch(kernel, blocks, threads, stream, __VA_ARGS__)

template <class... Arguments>
cudaError_t sphm_launch_together(void (*kernel)(Arguments...), unsigned most, unsigned threads,
                                 cudaStream_t stream, Arguments... arguments) {
    const unsigned blocks = most < shim::MOST_TOGETHER ? most : unsigned(shim::MOST_TOGETHER);
    ++shim::now.together;
    return shim::enqueue(stream,
                         [=] { shim::run_grid_together(blocks, threads, [=] { kernel(arguments...); }); });
}

inline const char *cudaGetErrorString(cudaError_t) {
    return "made to fail";
}
inline cudaError_t cudaGetLastError() {
    const cudaError_t last = shim::now.last;
    shim::now.last = cudaSuccess;
    return last;
}
inline cudaError_t cudaGetDevice(int *device) {
    *device = 0;
    return shim::call();
}
inline cudaError_t cudaSetDevice(int) {
    return shim::call();
}
inline cudaError_t cudaGetDeviceProperties(cudaDeviceProp *properties, int) {
    *properties = {"Shim", 9, 0};
    return shim::call();
}
struct cudaFuncAttributes {
    int numRegs;
};
template <class Kernel> cudaError_t cudaFuncGetAttributes(cudaFuncAttributes *attributes, Kernel *kernel) {
    attributes->numRegs = 0;
    shim::loaded.insert(reinterpret_cast<const void *>(kernel));
    return shim::call();
}
inline cudaError_t cudaDeviceGetStreamPriorityRange(int *least, int *greatest) {
    *least = 0;
    *greatest = -1;
    return shim::call();
}
inline cudaError_t cudaStreamCreateWithPriority(cudaStream_t *stream, unsigned, int) {
    const cudaError_t error = shim::call();
    if (error == cudaSuccess) {
        *stream = new shim_stream;
        shim::now.all_streams.push_back(*stream);
        ++shim::now.streams;
    }
    return error;
}
inline cudaError_t cudaStreamSynchronize(cudaStream_t stream) {
    const cudaError_t error = shim::call();
    if (shim::now.while_waiting) {
        const std::function<void()> other = std::move(shim::now.while_waiting);
        shim::now.while_waiting = nullptr;
        other();
    }
    while (error == cudaSuccess && !stream->queue.empty()) {
        for (shim_stream *each : shim::now.all_streams)
            if (shim::now.in_turns && each != stream && !each->queue.empty())
                each->run_one();
        if (!stream->queue.empty()) // an event may have been waited for
            stream->run_one();
    }
    stream->queue.clear();
    return error;
}
inline cudaError_t cudaStreamDestroy(cudaStream_t stream) {
    std::vector<shim_stream *> &all = shim::now.all_streams;
    all.erase(std::remove(all.begin(), all.end(), stream), all.end());
    delete stream;
    --shim::now.streams;
    return shim::call();
}
// A clock that stands still but for a millisecond a record.
struct shim_event {
    int at = 0, recorded = 0, reached = 0;
    shim_stream *stream = nullptr;
    void wait_for(int record) const {
        while (reached < record) {
            if (stream->queue.empty())
                shim::die("an event is waited for that never comes");
            stream->run_one();
        }
    }
};
using cudaEvent_t = shim_event *;
inline cudaError_t cudaEventCreateWithFlags(cudaEvent_t *event, unsigned) {
    const cudaError_t error = shim::call();
    if (error == cudaSuccess) {
        *event = new shim_event;
        ++shim::now.events;
    }
    return error;
}
inline cudaError_t cudaEventCreate(cudaEvent_t *event) {
    return cudaEventCreateWithFlags(event, 0);
}
inline cudaError_t cudaEventDestroy(cudaEvent_t event) {
    delete event;
    --shim::now.events;
    return shim::call();
}
inline cudaError_t cudaEventRecord(cudaEvent_t event, cudaStream_t stream) {
    const int record = ++event->recorded;
    event->stream = stream;
    return shim::enqueue(stream, [=] {
        event->at = ++shim::now.clock_ms;
        event->reached = record;
    });
}
inline cudaError_t cudaStreamWaitEvent(cudaStream_t stream, cudaEvent_t event, unsigned) {
    const int record = event->recorded;
    return shim::enqueue(stream, [=] { event->wait_for(record); });
}
inline cudaError_t cudaEventSynchronize(cudaEvent_t event) {
    const cudaError_t error = shim::call();
    if (error == cudaSuccess)
        event->wait_for(event->recorded);
    return error;
}
inline cudaError_t cudaEventQuery(cudaEvent_t event) {
    const cudaError_t error = shim::call();
    if (error != cudaSuccess)
        return error;
    if (shim::now.not_ready > 0) {
        --shim::now.not_ready;
        return cudaErrorNotReady;
    }
    event->wait_for(event->recorded);
    return cudaSuccess;
}
inline cudaError_t cudaEventElapsedTime(float *elapsed_ms, cudaEvent_t begin, cudaEvent_t end) {
    *elapsed_ms = static_cast<float>(end->at - begin->at);
    return shim::call();
}
inline cudaError_t cudaMemGetInfo(size_t *free_bytes, size_t *total) {
    *free_bytes = *total = shim::now.free_bytes;
    return shim::call();
}
inline cudaError_t shim_allocate(std::map<char *, size_t> &memory, void **made, size_t bytes) {
    const cudaError_t error = shim::call();
    if (error != cudaSuccess)
        return error;
    if (bytes > shim::now.free_bytes)
        return cudaErrorMemoryAllocation;
    *made = aligned_alloc(256, (bytes + 255) / 256 * 256);
    memset(*made, 0xff, bytes); // NaN
    memory[static_cast<char *>(*made)] = bytes;
    return cudaSuccess;
}
inline cudaError_t cudaMalloc(void **made, size_t bytes) {
    return shim_allocate(shim::now.device, made, bytes);
}
inline cudaError_t cudaHostAlloc(void **made, size_t bytes, unsigned) {
    return shim_allocate(shim::now.host, made, bytes);
}
inline cudaError_t cudaFree(void *memory) {
    shim::now.device.erase(static_cast<char *>(memory));
    free(memory);
    return shim::call();
}
inline cudaError_t cudaFreeHost(void *memory) {
    shim::now.host.erase(static_cast<char *>(memory));
    free(memory);
    return shim::call();
}
inline cudaError_t cudaMemsetAsync(void *to, int value, size_t bytes, cudaStream_t stream) {
    if (!shim::within(shim::now.device, to, bytes))
        shim::die("memset outside of what was allocated");
    return shim::enqueue(stream, [=] { memset(to, value, bytes); });
}
// From memory that is not page-locked a copy takes what is there now.
inline cudaError_t cudaMemcpyAsync(void *to, const void *from, size_t bytes, cudaMemcpyKind kind,
                                   cudaStream_t stream) {
    if (!shim::within(shim::now.device, kind == cudaMemcpyHostToDevice ? to : from, bytes))
        shim::die("a copy outside of what was allocated");
    if (kind == cudaMemcpyDeviceToHost || shim::within(shim::now.host, from, bytes))
        return shim::enqueue(stream, [=] { memcpy(to, from, bytes); });
    const std::vector<char> kept(static_cast<const char *>(from), static_cast<const char *>(from) + bytes);
    return shim::enqueue(stream, [=] { memcpy(to, kept.data(), bytes); });
}
inline cudaError_t cudaStreamBeginCapture(cudaStream_t stream, int) {
    const cudaError_t error = shim::call();
    stream->capturing = error == cudaSuccess;
    stream->captured.clear();
    return error;
}
inline cudaError_t cudaStreamEndCapture(cudaStream_t stream, cudaGraph_t *graph) {
    const bool was_capturing = stream->capturing;
    stream->capturing = false;
    const cudaError_t error = was_capturing ? shim::call() : cudaErrorUnknown;
    if (error == cudaSuccess) {
        *graph = new shim_work(stream->captured);
        ++shim::now.graphs;
    }
    return error;
}
inline cudaError_t cudaGraphInstantiateWithFlags(cudaGraphExec_t *made, cudaGraph_t graph, unsigned) {
    const cudaError_t error = shim::call();
    if (error == cudaSuccess) {
        *made = new shim_work(*graph);
        ++shim::now.graphs;
    }
    return error;
}
inline cudaError_t shim_destroy_graph(shim_work *graph) {
    delete graph;
    --shim::now.graphs;
    return shim::call();
}
inline cudaError_t cudaGraphDestroy(cudaGraph_t graph) {
    return shim_destroy_graph(graph);
}
inline cudaError_t cudaGraphExecDestroy(cudaGraphExec_t graph) {
    return shim_destroy_graph(graph);
}
inline cudaError_t cudaGraphLaunch(cudaGraphExec_t graph, cudaStream_t stream) {
    const cudaError_t error = shim::call();
    if (error == cudaSuccess) {
        ++shim::now.played;
        stream->queue.insert(stream->queue.end(), graph->begin(), graph->end());
    }
    return error;
}

// What of CUB is used. A first call without memory says how much is needed.
namespace cub {
struct DeviceRadixSort {
    template <class Key, class Value>
    static cudaError_t SortPairs(void *scratch, size_t &bytes, const Key *keys, Key *sorted,
                                 const Value *values, Value *order, int count, int first_bit, int end_bit,
                                 cudaStream_t stream) {
        if (!scratch) {
            bytes = static_cast<size_t>(count);
            return shim::call();
        }
        if (bytes < static_cast<size_t>(count) || first_bit != 0)
            shim::die("scratch memory is too short, or bits are left out");
        const cudaError_t error = shim::enqueue(stream, [=] {
            std::vector<int> places(shim::dry() ? 0 : static_cast<size_t>(count));
            std::iota(places.begin(), places.end(), 0);
            std::stable_sort(places.begin(), places.end(), [&](int a, int b) { return keys[a] < keys[b]; });
            for (size_t k = 0; k < places.size(); ++k) {
                if (keys[places[k]] >> end_bit)
                    shim::die("a key has more bits than are looked at");
                sorted[k] = keys[places[k]];
                order[k] = values[places[k]];
            }
        });
        return error;
    }
};
struct DeviceScan {
    template <class Number>
    static cudaError_t ExclusiveSum(void *scratch, size_t &bytes, const Number *from, Number *to, int count,
                                    cudaStream_t stream) {
        if (!scratch) {
            bytes = 1;
            return shim::call();
        }
        return shim::enqueue(stream, [=] {
            Number sum = 0;
            for (int k = 0; k < count && !shim::dry(); ++k) {
                to[k] = sum;
                sum += from[k];
            }
        });
    }
};
} // namespace cub

#endif
