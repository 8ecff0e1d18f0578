/* The __global__ functions around the threads of look_threads.h. None of them needs another thread of its
 * launch, so each is nothing but an index. */
#include "cuda/look_launch.h"

#include "cuda/check.h"
#include "cuda/look_threads.h"

namespace {

constexpr int look_block_threads = 64; /* the sums keep 100 numbers a thread */

template <int launch> __global__ void __launch_bounds__(look_block_threads) look(sphm_look_device d) {
    const size_t thread = (size_t)blockIdx.x * look_block_threads + threadIdx.x;
    if (thread < sphm_look_threads(&d, launch))
        sphm_look_run_thread(&d, launch, thread);
}

template <int launch> sphm_status put(cudaStream_t stream, const sphm_look_device &d, sphm_context *context) {
    const size_t threads = sphm_look_threads(&d, launch);
    const unsigned blocks = (unsigned)((threads + look_block_threads - 1) / look_block_threads);
    SPHM_LAUNCH(look<launch>, blocks, look_block_threads, stream, d);
    return sphm_cuda_check_launch(cudaGetLastError(), "a look", context);
}

} // namespace

sphm_status sphm_cuda_load_look(sphm_context *context) {
    return sphm_cuda_check(sphm_load_kernels(look<SPHM_LOOK_SHAPE>, look<SPHM_LOOK_ADD_SHAPE>,
                                             look<SPHM_LOOK_FIND_SHAPE>, look<SPHM_LOOK_PACK>,
                                             look<SPHM_LOOK_FIELD>, look<SPHM_LOOK_ADD_FIELD>),
                           "load the kernels of looks", context);
}

sphm_status sphm_cuda_launch_look(cudaStream_t stream, const sphm_look_device *look, int launch,
                                  sphm_context *context) {
    switch (launch) {
    case SPHM_LOOK_SHAPE:
        return put<SPHM_LOOK_SHAPE>(stream, *look, context);
    case SPHM_LOOK_ADD_SHAPE:
        return put<SPHM_LOOK_ADD_SHAPE>(stream, *look, context);
    case SPHM_LOOK_FIND_SHAPE:
        return put<SPHM_LOOK_FIND_SHAPE>(stream, *look, context);
    case SPHM_LOOK_PACK:
        return put<SPHM_LOOK_PACK>(stream, *look, context);
    case SPHM_LOOK_FIELD:
        return put<SPHM_LOOK_FIELD>(stream, *look, context);
    default:
        return put<SPHM_LOOK_ADD_FIELD>(stream, *look, context);
    }
}
