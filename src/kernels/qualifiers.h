/* Physics at a point is written once and compiled by the C compiler and by nvcc. SPHM_FN is the only
 * difference. Stay where C11 and CUDA C++ agree: no compound literals, designated initialisers, VLAs or
 * `restrict`; parameters come in plain structs both sides include. */
#ifndef SPHM_KERNELS_QUALIFIERS_H
#define SPHM_KERNELS_QUALIFIERS_H

#include "sph_muscle/types.h"

#ifdef __CUDACC__
#define SPHM_FN static __host__ __device__ __forceinline__
#else
#define SPHM_FN static inline __attribute__((always_inline, unused))
#endif

#endif
