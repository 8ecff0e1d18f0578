/* sph_muscle_ceilings: what a device can do at most, as one JSON object on one line, to hold what the back
 * end achieves against: bytes moved from memory and from the level-2 cache, single and double precision
 * arithmetic, and what a launch within a graph, one that is waited for, and a barrier of the whole grid cost.
 *
 * Exit status: 0 measured, 1 a call failed, 77 no device answers (and why). Needs CUDA's runtime only. */
#include <cooperative_groups.h>
#include <cuda_runtime.h>

#include <cstdio>
#include <cstdlib>

namespace {

enum { THREADS = 256, FUSED = 1024, CHAINS = 8, REPEAT = 5, NODES = 200, BARRIERS = 500 };

void check(cudaError_t error, const char *what) {
    if (error == cudaSuccess)
        return;
    fprintf(stderr, "sph_muscle_ceilings: cannot %s: %s\n", what, cudaGetErrorString(error));
    exit(1);
}

/* Loads go past the level-1 cache, which would keep what a thread loads again. */
__global__ void __launch_bounds__(THREADS) copy(const float4 *from, float4 *to, size_t count, int times) {
    const size_t stride = (size_t)gridDim.x * THREADS;
    for (int t = 0; t < times; ++t)
        for (size_t i = (size_t)blockIdx.x * THREADS + threadIdx.x; i < count; i += stride)
            to[i] = __ldcg(&from[i]);
}

/* CHAINS independent chains of fused multiply-adds; the sum is stored so that they are not thrown away. */
template <class Real> __global__ void __launch_bounds__(THREADS) fuse(Real *out, Real a, Real b, int times) {
    Real x[CHAINS];
    for (int c = 0; c < CHAINS; ++c)
        x[c] = (Real)(threadIdx.x + c);
    for (int t = 0; t < times; ++t)
#pragma unroll
        for (int c = 0; c < CHAINS; ++c)
            x[c] = x[c] * a + b;
    Real sum = 0;
    for (int c = 0; c < CHAINS; ++c)
        sum += x[c];
    out[(size_t)blockIdx.x * THREADS + threadIdx.x] = sum;
}

__global__ void nothing() {}

__global__ void barriers(int times) {
    for (int t = 0; t < times; ++t)
        cooperative_groups::this_grid().sync();
}

struct timer {
    cudaEvent_t begin, end;
    cudaStream_t stream;
    /* Seconds that the quickest of a few runs takes; the first one warms up. */
    template <class Work> double best(Work work) const {
        float best_ms = 0, ms = 0;
        for (int k = 0; k <= REPEAT; ++k) {
            check(cudaEventRecord(begin, stream), "record an event");
            work();
            check(cudaGetLastError(), "launch");
            check(cudaEventRecord(end, stream), "record an event");
            check(cudaEventSynchronize(end), "finish");
            check(cudaEventElapsedTime(&ms, begin, end), "time");
            if (k == 1 || (k > 1 && ms < best_ms))
                best_ms = ms;
        }
        return 1e-3 * (double)best_ms;
    }
};

/* GB/s, reading and writing counted, of a copy between two halves of `bytes`. */
double copy_GB_per_s(const timer &t, const cudaDeviceProp &p, char *memory, size_t bytes, int times) {
    const size_t count = bytes / 2 / sizeof(float4);
    float4 *from = (float4 *)memory, *to = from + count;
    const int blocks = p.multiProcessorCount * 8;
    const double s = t.best([&] { copy<<<blocks, THREADS, 0, t.stream>>>(from, to, count, times); });
    return 2e-9 * (double)(count * sizeof(float4)) * times / s;
}

template <class Real> double fused_GFLOP_per_s(const timer &t, const cudaDeviceProp &p, char *memory) {
    const int blocks = p.multiProcessorCount * 8;
    const double s = t.best([&] {
        fuse<Real><<<blocks, THREADS, 0, t.stream>>>((Real *)memory, (Real)0.999, (Real)1e-3, FUSED);
    });
    return 2e-9 * (double)blocks * THREADS * FUSED * CHAINS / s;
}

/* A launch of empty blocks within a graph: one, or as many as a sweep has where it fills the device. */
double graph_node_us(const timer &t, unsigned blocks, unsigned threads) {
    cudaGraph_t graph = NULL;
    cudaGraphExec_t exec = NULL;
    check(cudaStreamBeginCapture(t.stream, cudaStreamCaptureModeThreadLocal), "record launches");
    for (int k = 0; k < NODES; ++k)
        nothing<<<blocks, threads, 0, t.stream>>>();
    check(cudaStreamEndCapture(t.stream, &graph), "keep launches");
    check(cudaGraphInstantiateWithFlags(&exec, graph, 0), "make a graph");
    const double s = t.best([&] { check(cudaGraphLaunch(exec, t.stream), "launch a graph"); });
    check(cudaGraphExecDestroy(exec), "destroy a graph");
    check(cudaGraphDestroy(graph), "destroy a graph");
    return 1e6 * s / NODES;
}

/* What an empty launch between two events takes: part of every time of a launch that is timed alone. */
double launch_alone_us(const timer &t) {
    return 1e6 * t.best([&] { nothing<<<1, 32, 0, t.stream>>>(); });
}

/* 0 where the device has no barrier of the whole grid. One block a multiprocessor. */
double grid_barrier_us(const timer &t, const cudaDeviceProp &p) {
    int cooperative = 0, device = 0, times = BARRIERS;
    check(cudaGetDevice(&device), "say which device is current");
    check(cudaDeviceGetAttribute(&cooperative, cudaDevAttrCooperativeLaunch, device), "describe the device");
    if (!cooperative)
        return 0;
    void *arguments[] = {&times};
    const double s = t.best([&] {
        check(cudaLaunchCooperativeKernel((const void *)barriers, dim3((unsigned)p.multiProcessorCount),
                                          dim3(THREADS), arguments, 0, t.stream),
              "launch a cooperative kernel");
    });
    return 1e6 * s / BARRIERS;
}

int is_there() {
    int devices = 0;
    const cudaError_t error = cudaGetDeviceCount(&devices);
    if (error == cudaSuccess && devices > 0)
        return 1;
    fprintf(stderr, "skipped: no CUDA device answers: %s\n",
            error == cudaSuccess ? "there is none" : cudaGetErrorString(error));
    return 0;
}

} // namespace

int main() {
    if (!is_there())
        return 77;
    timer t;
    cudaDeviceProp p;
    size_t available = 0, total = 0;
    char *memory = NULL;
    check(cudaGetDeviceProperties(&p, 0), "describe the device");
    check(cudaStreamCreateWithFlags(&t.stream, cudaStreamNonBlocking), "make a stream");
    check(cudaEventCreate(&t.begin), "make an event");
    check(cudaEventCreate(&t.end), "make an event");
    check(cudaMemGetInfo(&available, &total), "say how much memory is free");
    const size_t most = (size_t)2 << 30, large = available / 2 < most ? available / 2 : most;
    const size_t cached = (size_t)p.l2CacheSize / 4; /* with room to spare: the cache is divided in parts */
    check(cudaMalloc((void **)&memory, large), "allocate memory");
    check(cudaMemset(memory, 0x3c, large), "fill memory"); /* no zeros: they may move faster */
    check(cudaDeviceSynchronize(), "fill memory");
    const double memory_GB = copy_GB_per_s(t, p, memory, large, 1);
    const double cache_GB = copy_GB_per_s(t, p, memory, cached, 200);
    const double single = fused_GFLOP_per_s<float>(t, p, memory),
                 dual = fused_GFLOP_per_s<double>(t, p, memory);
    const double node_us = graph_node_us(t, 1, 32),
                 full_us = graph_node_us(t, (unsigned)p.multiProcessorCount * 4, THREADS),
                 alone_us = launch_alone_us(t), barrier_us = grid_barrier_us(t, p);
    printf("{\"device\": \"%s\", \"multiprocessors\": %d, \"l2_bytes\": %d, \"memory_bytes\": %zu, "
           "\"memory_GB_per_s\": %.6g, \"l2_GB_per_s\": %.6g, \"single_GFLOP_per_s\": %.6g, "
           "\"double_GFLOP_per_s\": %.6g, \"graph_node_us\": %.4g, \"full_graph_node_us\": %.4g, "
           "\"launch_alone_us\": %.4g, \"grid_barrier_us\": %.4g}\n",
           p.name, p.multiProcessorCount, p.l2CacheSize, total, memory_GB, cache_GB, single, dual, node_us,
           full_us, alone_us, barrier_us);
    check(cudaFree(memory), "free memory");
    return 0;
}
