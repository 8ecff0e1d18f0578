/* CUDA's runtime, and the one thing about a launch that is no C++. A test puts its own in their place and
 * runs the kernels on the host (test/cuda_shim.h). */
#ifndef SPHM_CUDA_RUNTIME_H
#define SPHM_CUDA_RUNTIME_H

#ifdef __CUDACC__
#include <cuda_runtime.h>
#define SPHM_LAUNCH(kernel, blocks, threads, stream, ...) kernel<<<blocks, threads, 0, stream>>>(__VA_ARGS__)
#define SPHM_UNROLL _Pragma("unroll")
#endif

#endif
