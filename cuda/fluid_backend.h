/* The fluid tissue on a device: sphm_backend_ops on top of sphm_device_ops
 * (doc/cuda.md). */
#ifndef SPHM_CUDA_FLUID_BACKEND_H
#define SPHM_CUDA_FLUID_BACKEND_H

#include "core/backend.h"
#include "cuda/device.h"

#ifdef __cplusplus
extern "C" {
#endif

/* All of the operations but create(). */
extern const sphm_backend_ops sphm_device_fluid_backend;
sphm_status sphm_device_fluid_create(const sphm_device_ops *ops, const sphm_model *model,
                                     sphm_backend **backend, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
