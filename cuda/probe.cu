/* Is there a device that this library can compute on? */
#include "cuda/runtime.h"

#include "core/backend.h"
#include "core/context.h"

extern "C" sphm_status sphm_cuda_probe(sphm_context *context) {
    int driver = 0, devices = 0;
    if (cudaDriverGetVersion(&driver) != cudaSuccess || driver == 0) {
        (void)cudaGetLastError();
        return sphm_fail(context, SPHM_REFUSED_UNSUPPORTED, "no CUDA driver is installed");
    }
    const cudaError_t error = cudaGetDeviceCount(&devices);
    if (error != cudaSuccess) {
        (void)cudaGetLastError(); /* or the next call reports it again */
        return sphm_fail(context, SPHM_REFUSED_UNSUPPORTED, "no CUDA device answers: %s",
                         cudaGetErrorString(error));
    }
    if (devices == 0)
        return sphm_fail(context, SPHM_REFUSED_UNSUPPORTED, "there is no CUDA device");
    return SPHM_OK;
}
