/* Inside the device's back end of the solid tissue: what its files share. */
#ifndef SPHM_CUDA_SOLID_INSIDE_H
#define SPHM_CUDA_SOLID_INSIDE_H

#include "cuda/look.h"
#include "cuda/solid_backend.h"
#include "cuda/solid_plan.h"
#include "cuda/solid_rest.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Page-locked memory of the host. */
typedef struct sphm_solid_host {
    sphm_solid_submission *submission;
    sphm_solid_report *report;
    double *part_sum; /* [SPHM_SOLID_PART_NUMBERS] */
    sphm_real *motion, *potential, *recovery, *activation, *fibre_rate, *density, *pressure;
} sphm_solid_host;

/* What a wrench takes beside the sums: how the end is driven, when, and where it is then. */
typedef struct sphm_solid_hold {
    sphm_end_drive drive;
    double time_s;
    sphm_end_body body;
} sphm_solid_hold;

typedef struct sphm_solid_backend {
    const sphm_model *model;
    const sphm_device_ops *ops;
    sphm_device *device;
    sphm_solid_device solid;
    sphm_solid_host host;
    sphm_solid_rest rest; /* its state is what is seen: brought up to date by look() */
    sphm_solid_clock clock;
    int seen;   /* the arrays of rest.state are up to date */
    int kept;   /* which launches the device has kept, as launches_of(); -1: none */
    int failed; /* the device does not work any more */
    double modulus_Pa;
    sphm_look *look;         /* made when somebody first looks */
    sphm_solid_hold looking; /* of the insertion, when the look under way began */
    size_t device_bytes, host_bytes;
    double launch_s[SPHM_SOLID_LAUNCHES]; /* where the launches are timed: at the last reset_timing() */
    sphm_timing timing;
} sphm_solid_backend;

/* solid_memory.c ----------------------------------------------------------------------------------------- */

/* Copies in one direction until one fails. */
typedef struct sphm_solid_copier {
    const sphm_solid_backend *b;
    sphm_status status;
    sphm_context *context;
} sphm_solid_copier;

void sphm_solid_upload(sphm_solid_copier *c, void *to, const void *from, size_t elements, size_t size);
void sphm_solid_download(sphm_solid_copier *c, void *to, const void *from, size_t elements, size_t size);
void sphm_solid_finish_copies(sphm_solid_copier *c);

/* Memory on both sides, for the rest shape that is there. */
sphm_status sphm_solid_allocate(sphm_solid_backend *b, sphm_context *context);
void sphm_solid_set_constants(sphm_solid_backend *b);
/* What the rest shape fixes. */
sphm_status sphm_solid_upload_rest(const sphm_solid_backend *b, sphm_context *context);

/* solid_wrench.c ----------------------------------------------------------------------------------------- */

/* The wrench() of sphm_backend_ops. */
void sphm_solid_wrench(sphm_backend *backend, const sphm_end_drive *drive, int end, sphm_wrench *wrench);
/* Has the parts of the wrench at `end` summed, into part_sum from place first_part on. */
sphm_status sphm_solid_sum_parts(const sphm_solid_backend *b, const sphm_solid_hold *hold, int end,
                                 int first_part, sphm_context *context);
/* From the sums [SPHM_SOLID_PART_NUMBERS], on the host. */
void sphm_solid_add_parts(const sphm_solid_backend *b, const sphm_solid_hold *hold, int end,
                          const double *part_sum, sphm_wrench *wrench);
sphm_solid_hold sphm_solid_hold_now(const sphm_solid_backend *b, const sphm_end_drive *drive, int end);

/* solid_look.c ------------------------------------------------------------------------------------------- */

/* The look() and looked() of sphm_backend_ops. */
sphm_status sphm_solid_look(sphm_backend *backend, const sphm_observer *observer, int particles,
                            const sphm_end_drive *insertion, sphm_context *context);
sphm_status sphm_solid_looked(sphm_backend *backend, int wait, int *finished, sphm_looked *looked,
                              sphm_context *context);

/* solid_submit.c ----------------------------------------------------------------------------------------- */

/* Puts what is seen on the device, with the stress that belongs to it. */
sphm_status sphm_solid_upload_state(sphm_solid_backend *b, sphm_context *context);
/* The step() of sphm_backend_ops. */
sphm_status sphm_solid_step(sphm_backend *backend, size_t count, double time_step_s, const sphm_drive *drive,
                            sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
