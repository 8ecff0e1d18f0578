/* The launches of a look. */
#ifndef SPHM_CUDA_LOOK_LAUNCH_H
#define SPHM_CUDA_LOOK_LAUNCH_H

#include "cuda/runtime.h"

#include "cuda/look_layout.h"

/* Before the first launch: sphm_load_kernels(). */
sphm_status sphm_cuda_load_look(sphm_context *context);
/* Puts one launch, SPHM_LOOK_..., on the stream. */
sphm_status sphm_cuda_launch_look(cudaStream_t stream, const sphm_look_device *look, int launch,
                                  sphm_context *context);

#endif
