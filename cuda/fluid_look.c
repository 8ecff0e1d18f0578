/* Looks at a fluid on a device (look.h): what is put on the stream of its steps, and what is read of what has
 * come home. */
#include <string.h>

#include "core/context.h"
#include "cuda/fluid_inside.h"

static sphm_status snapshot(const sphm_fluid_backend *b, sphm_context *context) {
    sphm_fluid_call call;
    memset(&call, 0, sizeof call);
    call.launch = SPHM_FLUID_SNAPSHOT;
    call.line = sphm_look_lines(b->look);
    call.buffer = b->clock.buffer;
    return b->ops->launch_fluid(b->device, &b->fluid, &call, context);
}

/* A fluid has no wrench: nothing rides along. */
sphm_status sphm_fluid_look(sphm_backend *backend, const sphm_observer *observer, int particles,
                            const sphm_end_drive *insertion, sphm_context *context) {
    sphm_fluid_backend *b = (sphm_fluid_backend *)backend;
    (void)insertion;
    if (b->failed)
        return sphm_fail(context, SPHM_FAILED_BACKEND, "the device has failed before");
    sphm_status status = SPHM_OK;
    if (!b->look)
        status = sphm_look_create(&b->look, b->ops, b->device, observer, 0, context);
    if (status != SPHM_OK)
        return status;
    status = snapshot(b, context);
    if (status == SPHM_OK)
        status = sphm_look_begin(b->look, particles, NULL, context);
    b->failed = status != SPHM_OK;
    return status;
}

sphm_status sphm_fluid_looked(sphm_backend *backend, int wait, int *finished, sphm_looked *looked,
                              sphm_context *context) {
    sphm_fluid_backend *b = (sphm_fluid_backend *)backend;
    sphm_status status;
    *finished = sphm_look_finish(b->look, wait, looked, &status, context) != NULL;
    b->failed = b->failed || status != SPHM_OK;
    return status;
}
