/* What the solid tissue is made of on the rest shape: slots, rows, gradients, diffusion weights. Made on the
 * host by the CPU back end's code, then uploaded; only numbers are kept. */
#ifndef SPHM_CUDA_SOLID_REST_H
#define SPHM_CUDA_SOLID_REST_H

#include "core/diffusion.h"
#include "core/gradient.h"
#include "core/model.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_solid_rest {
    sphm_state state; /* at rest, in slot order */
    sphm_neighbours rows;
    sphm_gradient gradient;
    sphm_diffusion diffusion;
} sphm_solid_rest;

/* On anything but SPHM_OK `rest` is zeroed. */
sphm_status sphm_solid_rest_create(sphm_solid_rest *rest, const sphm_model *model, sphm_context *context);
/* Frees rows, gradients and weights; the numbers beside the arrays stay. */
void sphm_solid_rest_drop_arrays(sphm_solid_rest *rest);
void sphm_solid_rest_free(sphm_solid_rest *rest); /* a zeroed struct is fine */

#ifdef __cplusplus
}
#endif
#endif
