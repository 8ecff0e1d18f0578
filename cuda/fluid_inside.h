/* Inside the device's back end of the fluid tissue: what its files share. */
#ifndef SPHM_CUDA_FLUID_INSIDE_H
#define SPHM_CUDA_FLUID_INSIDE_H

#include "cuda/fluid_backend.h"
#include "cuda/look.h"
#include "cuda/memory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a run of steps leads on from one to the next. */
typedef struct sphm_fluid_clock {
    double time_s, diffusion_due_s;
    uint64_t steps;
    int buffer; /* of the potential */
} sphm_fluid_clock;

typedef struct sphm_fluid_backend {
    const sphm_model *model;
    const sphm_device_ops *ops;
    sphm_device *device;
    sphm_fluid_device fluid;
    sphm_fluid_submission *submission; /* page-locked, as the report is */
    sphm_fluid_report *report;
    void *rows; /* memory of neighbour and weight */
    size_t device_bytes, host_bytes, rows_bytes;

    sphm_state state; /* what is seen: brought up to date by look() */
    int32_t *slots;   /* [2 * count], scratch */
    void *scratch;    /* [capacity * SPHM_STATE_ELEMENT_SIZE], for
                         sphm_state_permute() */

    sphm_fluid_clock clock;
    int seen;   /* the arrays of `state` are up to date */
    int kept;   /* diffusions a step that the launches have which the device has
                   kept; 0: none */
    int failed; /* the device does not work any more */
    int stale;  /* a particle has moved too far for the rows */
    double speed_m_per_s;
    double stable_step_ms, rest_stable_step_ms; /* of the diffusion, now and on the rest shape */
    double rest_density_min;
    sphm_look *look;                      /* made when somebody first looks */
    double launch_s[SPHM_FLUID_LAUNCHES]; /* where the launches are timed: at the
                                             last reset_timing() */
    sphm_timing timing;
} sphm_fluid_backend;

/* fluid_memory.c
 * -----------------------------------------------------------------------------------------
 */

void sphm_fluid_set_constants(sphm_fluid_backend *b);
/* All but the rows, on both sides. */
sphm_status sphm_fluid_allocate(sphm_fluid_backend *b, sphm_context *context);
void sphm_fluid_free(sphm_fluid_backend *b); /* the host's */
/* Rows for `entries` pairs and some more, in place of those there are. */
sphm_status sphm_fluid_reserve_rows(sphm_fluid_backend *b, uint64_t entries, sphm_context *context);
/* What is seen, in its slots, to the device and back. The potential goes to
 * buffer 0. */
sphm_status sphm_fluid_upload_state(sphm_fluid_backend *b, sphm_context *context);
sphm_status sphm_fluid_download_state(sphm_fluid_backend *b, sphm_context *context);

/* fluid_look.c
 * -------------------------------------------------------------------------------------------
 */

/* The look() and looked() of sphm_backend_ops. */
sphm_status sphm_fluid_look(sphm_backend *backend, const sphm_observer *observer, int particles,
                            const sphm_end_drive *insertion, sphm_context *context);
sphm_status sphm_fluid_looked(sphm_backend *backend, int wait, int *finished, sphm_looked *looked,
                              sphm_context *context);

/* fluid_submit.c
 * -----------------------------------------------------------------------------------------
 */

sphm_status sphm_fluid_launch(const sphm_fluid_backend *b, int which, int step, int substep,
                              sphm_context *context);
/* Sorts, and builds rows and weights from the listed positions, which are the
 * present ones first if `list`. */
sphm_status sphm_fluid_build_rows(sphm_fluid_backend *b, int list, sphm_context *context);
/* On the rest shape: measures each particle's density, which is its rest
 * density from then on. */
sphm_status sphm_fluid_measure_rest(sphm_fluid_backend *b, sphm_context *context);
/* The step() of sphm_backend_ops. */
sphm_status sphm_fluid_step(sphm_backend *backend, size_t count, double time_step_s, const sphm_drive *drive,
                            sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
