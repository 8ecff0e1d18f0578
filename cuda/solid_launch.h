/* The launches of the solid tissue. */
#ifndef SPHM_CUDA_SOLID_LAUNCH_H
#define SPHM_CUDA_SOLID_LAUNCH_H

#include "cuda/runtime.h"

#include "cuda/solid_layout.h"

/* Before the first launch: sphm_load_kernels(). */
sphm_status sphm_cuda_load_solid(sphm_context *context);
/* Puts one launch on the stream. */
sphm_status sphm_cuda_launch_solid(cudaStream_t stream, const sphm_solid_device *solid,
                                   const sphm_solid_call *call, sphm_context *context);

#endif
