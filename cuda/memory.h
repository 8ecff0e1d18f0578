/* One allocation cut into arrays, and copies that stop at the first one that
 * fails. */
#ifndef SPHM_CUDA_MEMORY_H
#define SPHM_CUDA_MEMORY_H

#include "cuda/device.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPHM_CUT_ALIGNMENT 256

/* The next `bytes` of `memory` (NULL: only counted in *used). */
static inline void *sphm_cut(char *memory, size_t bytes, size_t *used) {
    char *piece = memory ? memory + *used : NULL;
    *used += (bytes / SPHM_CUT_ALIGNMENT + 1) * SPHM_CUT_ALIGNMENT;
    return piece;
}

typedef struct sphm_copier {
    const sphm_device_ops *ops;
    sphm_device *device;
    sphm_status status;
    sphm_context *context;
} sphm_copier;

static inline void sphm_copy_up(sphm_copier *c, void *to, const void *from, size_t bytes) {
    if (c->status == SPHM_OK && bytes > 0)
        c->status = c->ops->upload(c->device, to, from, bytes, c->context);
}

static inline void sphm_copy_down(sphm_copier *c, void *to, const void *from, size_t bytes) {
    if (c->status == SPHM_OK && bytes > 0)
        c->status = c->ops->download(c->device, to, from, bytes, c->context);
}

static inline void sphm_copy_wait(sphm_copier *c) {
    if (c->status == SPHM_OK)
        c->status = c->ops->wait(c->device, c->context);
}

#ifdef __cplusplus
}
#endif
#endif
