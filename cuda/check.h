/* Every call of CUDA's and every launch is checked, in release builds too, and becomes a status and a
 * sentence. */
#ifndef SPHM_CUDA_CHECK_H
#define SPHM_CUDA_CHECK_H

#include <cstdio>

#include "cuda/runtime.h"

#include "core/context.h"

/* SPHM_OK, or SPHM_FAILED_BACKEND (out of memory: SPHM_REFUSED_MEMORY). `what` completes "CUDA could not
 * ...". */
inline sphm_status sphm_cuda_check(cudaError_t error, const char *what, sphm_context *context) {
    if (error == cudaSuccess)
        return SPHM_OK;
    (void)cudaGetLastError(); /* or an error that passes is reported again by the next launch */
    return sphm_fail(context, error == cudaErrorMemoryAllocation ? SPHM_REFUSED_MEMORY : SPHM_FAILED_BACKEND,
                     "CUDA could not %s: %s", what, cudaGetErrorString(error));
}

/* The same of a launch of that kind. */
inline sphm_status sphm_cuda_check_launch(cudaError_t error, const char *kind, sphm_context *context) {
    char what[64];
    if (error == cudaSuccess)
        return SPHM_OK;
    snprintf(what, sizeof what, "launch %s", kind);
    return sphm_cuda_check(error, what, context);
}

#endif
