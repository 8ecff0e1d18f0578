/* A look at a muscle on a device: the sums of an observation and the particles of a message, of the state at
 * one moment, made beside the steps that follow it.
 *
 * The tissue's own launch puts the state, by particle id, into lines() on the stream of the steps; that is
 * all the steps wait for. Sums, displacements and packing follow on a second stream, and so do the copies
 * into page-locked memory, of which there are two sets: one is filled while the other is being read. */
#ifndef SPHM_CUDA_LOOK_H
#define SPHM_CUDA_LOOK_H

#include "core/backend.h"
#include "core/observer.h"
#include "cuda/device.h"
#include "cuda/look_layout.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One set of page-locked memory. */
typedef struct sphm_look_home {
    sphm_look_result *result;
    double *extra;    /* what the tissue wants to have brought along */
    float *fields;    /* [SPHM_LOOK_FIELDS * count] */
    sphm_real *place; /* [3 * count] */
    int particles;    /* the last two were asked for */
} sphm_look_home;

typedef struct sphm_look {
    const sphm_device_ops *ops;
    sphm_device *device;
    sphm_look_device on_device;
    sphm_look_home home[2];
    size_t extra_count, device_bytes, host_bytes;
    int front;     /* the set that may be read */
    int under_way; /* the other one is being filled */
} sphm_look;

/* Memory for looks at the muscle of `observer`, whose fibre weights are there (sphm_observer_prepare). Freed
 * with the device, but for the struct. extra_count: numbers that are brought along. SPHM_REFUSED_MEMORY
 * leaves the device as it was, but for memory it may have given. */
sphm_status sphm_look_create(sphm_look **look, const sphm_device_ops *ops, sphm_device *device,
                             const sphm_observer *observer, size_t extra_count, sphm_context *context);
void sphm_look_destroy(sphm_look *look); /* before the device is closed; NULL is fine */

/* Device memory that the tissue's launch fills, [count] by id. None may be under way. */
sphm_look_particle *sphm_look_lines(const sphm_look *look);
/* Everything after that launch. `extra`: device memory. */
sphm_status sphm_look_begin(sphm_look *look, int particles, const double *extra, sphm_context *context);
/* What has come home, when it has, or after waiting for it, and in `looked` what both tissues have of it;
 * NULL: not yet, nothing is under way (`look` may be NULL), or, with a status, the device has failed. Valid
 * until the second sphm_look_begin() after it. */
const sphm_look_home *sphm_look_finish(sphm_look *look, int wait, sphm_looked *looked, sphm_status *status,
                                       sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
