/* What a back end must do. It owns loops, memory and launches; the physics is in src/kernels. */
#ifndef SPHM_CORE_BACKEND_H
#define SPHM_CORE_BACKEND_H

#include "core/drive.h"
#include "core/model.h"
#include "core/state.h"
#include "kernels/look.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_backend sphm_backend;
struct sphm_observer;

/* A finished look at a state, by the back end that has it. */
typedef struct sphm_looked {
    sphm_look_shape shape;
    sphm_field_sums sums;
    const float
        *fields; /* [SPHM_LOOK_FIELDS * count] by id, as sphm_look_pack() has it; NULL: not asked for */
    const sphm_real *place_m; /* [3 * count] by id, relative to model->frame_m; NULL as well */
    sphm_wrench wrench;       /* at the insertion; solid */
} sphm_looked;

typedef struct sphm_backend_ops {
    const char *name;
    /* `model` is borrowed and outlives the back end. The new back end holds the rest state. */
    sphm_status (*create)(const sphm_model *model, sphm_backend **backend, sphm_context *context);
    void (*destroy)(sphm_backend *backend);
    /* Takes `count` steps of at most time_step_s under `drive`, or fewer, but one at least, where on the way
     * the limits become too short for them. Returns SPHM_FAILED_NONFINITE, with particle
     * and stage in the message, when a value stops being finite. */
    sphm_status (*step)(sphm_backend *backend, size_t count, double time_step_s, const sphm_drive *drive,
                        sphm_context *context);
    /* The state, on the host and up to date; valid until the next call. */
    const sphm_state *(*view)(sphm_backend *backend);
    /* Replaces STATE arrays, time and step count by those of `state` (in any slot order). */
    sphm_status (*restore)(sphm_backend *backend, const sphm_state *state, sphm_context *context);
    /* Limits on the next step, given the present velocities. */
    sphm_time_step_limits (*limits)(const sphm_backend *backend);
    sphm_timing (*timing)(const sphm_backend *backend);
    void (*reset_timing)(sphm_backend *backend);
    const char *(*device)(const sphm_backend *backend);
    /* Wrench at an end (SPHM_END_...) that is driven so, in the present state. NULL where the tissue has
     * none. */
    void (*wrench)(sphm_backend *backend, const sphm_end_drive *drive, int end, sphm_wrench *wrench);
    /* time_s, steps, diffusion_due_s and ends of the state, at no cost; its arrays may be those of an earlier
     * view. */
    const sphm_state *(*clock)(const sphm_backend *backend);
    /* Most steps that step() is given at a time: the limits are looked at between. 1 on the CPU: the Courant
     * limit follows the velocities, and a force may throw the particles anywhere within one step. Sixteen
     * were tried: each further step on a scattered muscle took seconds, for particles that nearly coincide
     * ask the diffusion for ten thousands of sub-steps. */
    size_t steps_at_a_time;
    /* Begins a look at the present state; the steps that follow do not wait for it. None may be under way.
     * `observer` is prepared (sphm_observer_prepare) and outlives the back end; `insertion` is how that end
     * is driven. NULL: nothing would be gained, view() is what there is to look at. */
    sphm_status (*look)(sphm_backend *backend, const struct sphm_observer *observer, int particles,
                        const sphm_end_drive *insertion, sphm_context *context);
    /* Whether the look has finished, and what it has found: its arrays are valid until the second look()
     * after it. Waits for it where it is told to. */
    sphm_status (*looked)(sphm_backend *backend, int wait, int *finished, sphm_looked *looked,
                          sphm_context *context);
} sphm_backend_ops;

/* The back ends that were built. src/core/choose_backend.h picks one. */
extern const sphm_backend_ops sphm_cpu_backend, sphm_cpu_solid_backend;
#ifdef SPHM_WITH_CUDA
/* SPHM_OK when a device answers; else SPHM_REFUSED_UNSUPPORTED and a message that says why none does. */
sphm_status sphm_cuda_probe(sphm_context *context);
const sphm_backend_ops *sphm_cuda_fluid_backend(void);
const sphm_backend_ops *sphm_cuda_solid_backend(void);
#endif

#ifdef __cplusplus
}
#endif
#endif
