/* Integration of the solid tissue: a step of every particle, by its force or with its end. */
#ifndef SPHM_CPU_SOLID_INTEGRATE_H
#define SPHM_CPU_SOLID_INTEGRATE_H

#include "core/drive.h"
#include "core/model.h"
#include "core/state.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The attached particles, in slot order. */
typedef struct sphm_solid_attached {
    size_t count;
    int32_t *slot; /* [count] */
    size_t *start; /* [blocks + 1]: the first of each block */
} sphm_solid_attached;

sphm_status sphm_solid_attached_create(sphm_solid_attached *attached, const sphm_state *state,
                                       sphm_context *context);
void sphm_solid_attached_free(sphm_solid_attached *attached); /* a zeroed struct is fine */

/* Moves ends and particles (shift, position, velocity) by step_s under `force` (N; x, y, z, [count] each).
 * block_nonfinite [blocks] receives the first slot of each block that is not finite, or -1. */
void sphm_solid_integrate(const sphm_model *model, sphm_state *state, sphm_real *const force[3],
                          const sphm_solid_attached *attached, const sphm_drive *drive, double step_s,
                          int threads, int32_t *block_nonfinite);

#ifdef __cplusplus
}
#endif
#endif
