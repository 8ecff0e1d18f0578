/* What the back end asks of a device. cuda/device.cu answers with CUDA's runtime; the tests answer on the
 * host, with the same threads in a loop, so that everything but device.cu and the launches can be tested
 * without a GPU.
 *
 * A device belongs to one back end and has a stream: what is asked for is done in that order, and later. A
 * second stream is for looking at what the first has computed (cuda/look.h), beside what the first does next.
 * All fallible functions leave a message that says what failed; after a SPHM_FAILED_BACKEND nothing works any
 * more but close(). */
#ifndef SPHM_CUDA_DEVICE_H
#define SPHM_CUDA_DEVICE_H

#include "cuda/fluid_layout.h"
#include "cuda/look_layout.h"
#include "cuda/solid_layout.h"
#include "sph_muscle/muscle.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_device sphm_device;

typedef struct sphm_device_ops {
    sphm_status (*open)(sphm_device **device, sphm_context *context);
    /* Waits, and frees all memory. NULL is fine. */
    void (*close)(sphm_device *device);
    /* e.g. "cuda: NVIDIA H200" */
    const char *(*name)(const sphm_device *device);

    /* Device memory, and page-locked memory of the host; zeroed, aligned to 256 bytes, freed by close().
     * SPHM_REFUSED_MEMORY names what is free. */
    sphm_status (*allocate)(sphm_device *device, size_t bytes, void **memory, sphm_context *context);
    sphm_status (*allocate_host)(sphm_device *device, size_t bytes, void **memory, sphm_context *context);

    /* Waits, and frees device memory before close() does. */
    void (*release)(sphm_device *device, void *memory);

    /* Copies. Page-locked host memory must not be touched before wait() has returned. */
    sphm_status (*upload)(sphm_device *device, void *to, const void *from, size_t bytes,
                          sphm_context *context);
    sphm_status (*download)(sphm_device *device, void *to, const void *from, size_t bytes,
                            sphm_context *context);
    sphm_status (*launch)(sphm_device *device, const sphm_solid_device *solid, const sphm_solid_call *call,
                          sphm_context *context);
    sphm_status (*launch_fluid)(sphm_device *device, const sphm_fluid_device *fluid,
                                const sphm_fluid_call *call, sphm_context *context);
    /* Bytes that the fluid's sort needs for fluid->count particles and cells of fluid->key_bits bits. */
    sphm_status (*fluid_scratch)(sphm_device *device, const sphm_fluid_device *fluid, size_t *bytes,
                                 sphm_context *context);
    /* What is launched between record() and keep() is kept instead of done; play() does it, any number of
     * times, with one submission. keep() replaces what was kept before. */
    sphm_status (*record)(sphm_device *device, sphm_context *context);
    sphm_status (*keep)(sphm_device *device, sphm_context *context);
    sphm_status (*play)(sphm_device *device, sphm_context *context);
    /* NULL, or [SPHM_SOLID_LAUNCHES] or [SPHM_FLUID_LAUNCHES] seconds that each kind of launch has taken: a
     * device that was opened to time its launches waits for each of them, and is given none to keep. */
    const double *(*launch_times)(const sphm_device *device);
    /* Until the first stream has done everything; reports what failed on the way. */
    sphm_status (*wait)(sphm_device *device, sphm_context *context);

    /* The second stream: what it is given from now on begins when the first has done what it was given
     * before. The first never waits for the second. */
    sphm_status (*look_after)(sphm_device *device, sphm_context *context);
    sphm_status (*launch_look)(sphm_device *device, const sphm_look_device *look, int launch,
                               sphm_context *context);
    /* As download(). */
    sphm_status (*bring)(sphm_device *device, void *to, const void *from, size_t bytes,
                         sphm_context *context);
    /* Marks what the second stream has been given so far; has it been done, or, waiting for it, did it fail?
     */
    sphm_status (*mark)(sphm_device *device, sphm_context *context);
    sphm_status (*marked)(sphm_device *device, int wait, int *done, sphm_context *context);

    /* Whether many steps of the solid are to be one launch, whose blocks wait for each other, and not a
     * graph.
     */
    int (*together)(const sphm_device *device);
} sphm_device_ops;

/* The times of launches that a device has (NULL: it has none) but for those `before`, for whoever asks. */
static inline void sphm_device_report_launches(sphm_timing *timing, const double *launch_s,
                                               const double *before_s, const char *const *names,
                                               size_t kinds) {
    timing->launch_kinds = launch_s ? kinds : 0;
    for (size_t k = 0; k < timing->launch_kinds; ++k) {
        timing->launch_name[k] = names[k];
        timing->launch_s[k] = launch_s[k] - before_s[k];
    }
}

#ifdef __cplusplus
}
#endif
#endif
