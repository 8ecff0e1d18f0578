/* See sort.h. CUB's radix sort is stable, and both give the same bits every time: all numbers are integers.
 */
#include "cuda/sort.h"

#ifdef __CUDACC__
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#endif

#include "cuda/check.h"

namespace {

/* With scratch NULL only says how many bytes it takes. */
cudaError_t sort(void *scratch, size_t *bytes, const sphm_fluid_device &d, cudaStream_t stream) {
    return cub::DeviceRadixSort::SortPairs(scratch, *bytes, d.key, d.sorted_key, d.value, d.order,
                                           (int)d.count, 0, d.key_bits, stream);
}

cudaError_t scan(void *scratch, size_t *bytes, const sphm_fluid_device &d, cudaStream_t stream) {
    return cub::DeviceScan::ExclusiveSum(scratch, *bytes, d.row_length, d.row_start, (int)(d.count + 1),
                                         stream);
}

} // namespace

sphm_status sphm_cuda_scratch(const sphm_fluid_device *d, size_t *bytes, sphm_context *context) {
    size_t scan_bytes = 0;
    cudaError_t error = sort(NULL, bytes, *d, 0);
    if (error == cudaSuccess)
        error = scan(NULL, &scan_bytes, *d, 0);
    *bytes = scan_bytes > *bytes ? scan_bytes : *bytes;
    return sphm_cuda_check(error, "prepare the sort", context);
}

sphm_status sphm_cuda_sort(cudaStream_t stream, const sphm_fluid_device *d, sphm_context *context) {
    size_t bytes = d->scratch_bytes;
    return sphm_cuda_check(sort(d->scratch, &bytes, *d, stream), "sort particles", context);
}

sphm_status sphm_cuda_scan(cudaStream_t stream, const sphm_fluid_device *d, sphm_context *context) {
    size_t bytes = d->scratch_bytes;
    return sphm_cuda_check(scan(d->scratch, &bytes, *d, stream), "lay out the rows", context);
}
