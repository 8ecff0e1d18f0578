/* The launches of the fluid tissue. */
#ifndef SPHM_CUDA_FLUID_LAUNCH_H
#define SPHM_CUDA_FLUID_LAUNCH_H

#include "cuda/runtime.h"

#include "cuda/fluid_layout.h"

/* Before the first launch: sphm_load_kernels(). */
sphm_status sphm_cuda_load_fluid(sphm_context *context);
/* Puts one launch on the stream. */
sphm_status sphm_cuda_launch_fluid(cudaStream_t stream, const sphm_fluid_device *fluid,
                                   const sphm_fluid_call *call, sphm_context *context);

#endif
