/* Wrenches at the ends of a solid on a device: the stress is a sum, so the parts are differences of sums with
 * and without; the sums are the device's, the differences the host's. */
#include <math.h>
#include <string.h>

#include "core/end_blocks.h"
#include "cuda/solid_inside.h"

sphm_solid_hold sphm_solid_hold_now(const sphm_solid_backend *b, const sphm_end_drive *drive, int end) {
    sphm_solid_hold hold;
    hold.drive = *drive;
    hold.time_s = b->clock.time_s;
    hold.body = b->clock.ends[end];
    return hold;
}

static sphm_status sum_part(const sphm_solid_backend *b, int part, int place, int end,
                            const double pivot_m[3], sphm_context *context) {
    sphm_solid_call call;
    memset(&call, 0, sizeof call);
    call.with_activation = part > 0;
    call.with_damping = part > 1;
    call.end = end;
    call.part = place;
    memcpy(call.pivot_m, pivot_m, sizeof call.pivot_m);
    sphm_status status = SPHM_OK;
    for (int which = SPHM_SOLID_PART_STRAIN; which <= SPHM_SOLID_PART_SUM && status == SPHM_OK; ++which) {
        call.launch = which;
        status = b->ops->launch(b->device, &b->solid, &call, context);
    }
    return status;
}

sphm_status sphm_solid_sum_parts(const sphm_solid_backend *b, const sphm_solid_hold *hold, int end,
                                 int first_part, sphm_context *context) {
    sphm_end_state now;
    double pivot[3];
    sphm_status status = SPHM_OK;
    sphm_end_frame_state(&b->model->ends[end], &hold->drive, hold->time_s, &hold->body, &now);
    for (int d = 0; d < 3; ++d)
        pivot[d] = now.position_m[d] - b->model->frame_m[d];
    for (int part = 0; part < SPHM_SOLID_PARTS && status == SPHM_OK; ++part)
        status = sum_part(b, part, first_part + part, end, pivot, context);
    return status;
}

static void add_partials(const double *part_sum, int part, double force[3], double moment[3]) {
    const double *sum = part_sum + (size_t)part * 6 * SPHM_SOLID_PARTIALS;
    memset(force, 0, 3 * sizeof *force);
    memset(moment, 0, 3 * sizeof *moment);
    for (size_t t = 0; t < SPHM_SOLID_PARTIALS; ++t, sum += 6)
        for (int d = 0; d < 3; ++d) {
            force[d] += sum[d];
            moment[d] += sum[3 + d];
        }
}

void sphm_solid_add_parts(const sphm_solid_backend *b, const sphm_solid_hold *hold, int end,
                          const double *part_sum, sphm_wrench *w) {
    double elastic_N[3], elastic_Nm[3];
    add_partials(part_sum, 0, w->passive_N, w->passive_Nm);
    add_partials(part_sum, 1, elastic_N, elastic_Nm);
    add_partials(part_sum, 2, w->force_N, w->moment_Nm);
    for (int d = 0; d < 3; ++d) {
        w->active_N[d] = elastic_N[d] - w->passive_N[d];
        w->active_Nm[d] = elastic_Nm[d] - w->passive_Nm[d];
        w->damping_N[d] = w->force_N[d] - elastic_N[d];
        w->damping_Nm[d] = w->moment_Nm[d] - elastic_Nm[d];
    }
    sphm_end_put_tendon_between(&b->model->ends[end], &hold->drive, hold->time_s, &hold->body, w);
}

void sphm_solid_wrench(sphm_backend *backend, const sphm_end_drive *drive, int end, sphm_wrench *w) {
    sphm_solid_backend *b = (sphm_solid_backend *)backend;
    const sphm_solid_hold hold = sphm_solid_hold_now(b, drive, end);
    sphm_status status = b->failed ? SPHM_FAILED_BACKEND : SPHM_OK;
    if (status == SPHM_OK)
        status = sphm_solid_sum_parts(b, &hold, end, 0, NULL);
    if (status == SPHM_OK)
        status = b->ops->download(b->device, b->host.part_sum, b->solid.part_sum,
                                  SPHM_SOLID_PART_NUMBERS * sizeof(double), NULL);
    if (status == SPHM_OK)
        status = b->ops->wait(b->device, NULL);
    if (status == SPHM_OK) {
        sphm_solid_add_parts(b, &hold, end, b->host.part_sum, w);
        return;
    }
    b->failed = 1;
    for (size_t d = 0; d < sizeof *w / sizeof(double); ++d)
        ((double *)w)[d] = NAN;
}
