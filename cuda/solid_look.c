/* Looks at a solid on a device (look.h): what is put on the stream of its steps, and what is read of what has
 * come home. */
#include <string.h>

#include "core/context.h"
#include "cuda/solid_inside.h"

static sphm_status snapshot(const sphm_solid_backend *b, sphm_context *context) {
    sphm_solid_call call;
    memset(&call, 0, sizeof call);
    call.launch = SPHM_SOLID_SNAPSHOT;
    call.line = sphm_look_lines(b->look);
    call.buffer = b->clock.buffer;
    return b->ops->launch(b->device, &b->solid, &call, context);
}

/* The wrench at the insertion rides along: its nine launches read what the next step changes, so they stay on
 * the stream of the steps, but nobody waits for them. */
sphm_status sphm_solid_look(sphm_backend *backend, const sphm_observer *observer, int particles,
                            const sphm_end_drive *insertion, sphm_context *context) {
    sphm_solid_backend *b = (sphm_solid_backend *)backend;
    if (b->failed)
        return sphm_fail(context, SPHM_FAILED_BACKEND, "the device has failed before");
    sphm_status status = SPHM_OK;
    if (!b->look)
        status = sphm_look_create(&b->look, b->ops, b->device, observer, SPHM_SOLID_PART_NUMBERS, context);
    if (status != SPHM_OK)
        return status;
    b->looking = sphm_solid_hold_now(b, insertion, SPHM_END_INSERTION);
    status = snapshot(b, context);
    if (status == SPHM_OK)
        status = sphm_solid_sum_parts(b, &b->looking, SPHM_END_INSERTION, SPHM_SOLID_PARTS, context);
    if (status == SPHM_OK)
        status = sphm_look_begin(b->look, particles, b->solid.part_sum + SPHM_SOLID_PART_NUMBERS, context);
    b->failed = status != SPHM_OK;
    return status;
}

sphm_status sphm_solid_looked(sphm_backend *backend, int wait, int *finished, sphm_looked *looked,
                              sphm_context *context) {
    sphm_solid_backend *b = (sphm_solid_backend *)backend;
    sphm_status status;
    const sphm_look_home *home = sphm_look_finish(b->look, wait, looked, &status, context);
    *finished = home != NULL;
    b->failed = b->failed || status != SPHM_OK;
    if (home)
        sphm_solid_add_parts(b, &b->looking, SPHM_END_INSERTION, home->extra, &looked->wrench);
    return status;
}
