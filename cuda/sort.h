/* Sort and scan of the fluid's rows, by CUB. */
#ifndef SPHM_CUDA_SORT_H
#define SPHM_CUDA_SORT_H

#include "cuda/runtime.h"

#include "cuda/fluid_layout.h"

/* Bytes that the two need of d->scratch, for d->count particles and cells of
 * d->key_bits bits. */
sphm_status sphm_cuda_scratch(const sphm_fluid_device *d, size_t *bytes, sphm_context *context);
/* key, value -> sorted_key, order: by key, and by place where keys are equal.
 */
sphm_status sphm_cuda_sort(cudaStream_t stream, const sphm_fluid_device *d, sphm_context *context);
/* row_length -> row_start: the sum of those before. */
sphm_status sphm_cuda_scan(cudaStream_t stream, const sphm_fluid_device *d, sphm_context *context);

#endif
