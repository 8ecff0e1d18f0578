/* CUDA's runtime, and what of launches is no C++ or needs more of the runtime than a call. A test puts its
 * own in their place and runs the kernels on the host (test/cuda_shim.h). */
#ifndef SPHM_CUDA_RUNTIME_H
#define SPHM_CUDA_RUNTIME_H

#ifdef __CUDACC__
#include <cooperative_groups.h>
#include <cuda_runtime.h>
#define SPHM_LAUNCH(kernel, blocks, threads, stream, ...) kernel<<<blocks, threads, 0, stream>>>(__VA_ARGS__)
#define SPHM_UNROLL _Pragma("unroll")
#define SPHM_GRID_BARRIER() cooperative_groups::this_grid().sync()

/* All blocks at once, so that they can wait for each other: as many as fit, but no more than `most`. */
template <class... Arguments>
cudaError_t sphm_launch_together(void (*kernel)(Arguments...), unsigned most, unsigned threads,
                                 cudaStream_t stream, Arguments... arguments) {
    int each = 0, multiprocessors = 0, device = 0;
    cudaError_t error = cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, (int)threads, 0);
    if (error == cudaSuccess)
        error = cudaGetDevice(&device);
    if (error == cudaSuccess)
        error = cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device);
    const unsigned fit = (unsigned)(each * multiprocessors);
    void *all[] = {&arguments...};
    return error == cudaSuccess
               ? cudaLaunchCooperativeKernel((const void *)kernel, dim3(most < fit ? most : fit),
                                             dim3(threads), all, 0, stream)
               : error;
}
#endif

/* Loads kernels, which otherwise happens at the first launch of each: that may be a recorded one, and loading
 * may have to wait for the device, which nothing may while launches are recorded. */
template <class... Kernels> cudaError_t sphm_load_kernels(Kernels... kernels) {
    cudaFuncAttributes attributes;
    cudaError_t error = cudaSuccess;
    ((error = error == cudaSuccess ? cudaFuncGetAttributes(&attributes, kernels) : error), ...);
    return error;
}

#endif
