/* The constant part of a muscle: parameters, rest shape, derived constants. Built once, then read only. */
#ifndef SPHM_CORE_MODEL_H
#define SPHM_CORE_MODEL_H

#include "core/state.h"
#include "kernels/fluid.h"
#include "kernels/membrane.h"
#include "kernels/solid.h"
#include "sph_muscle/muscle.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_model {
    sphm_parameters parameters;
    sphm_body body;
    double frame_m[3];       /* state positions are relative to it: middle of the bounding box */
    double particle_mass_kg; /* mean, as the volume; of the fluid all are equal */
    double particle_volume_m3;
    uint8_t *electrodes;              /* [count], bit e: in electrode e */
    sphm_membrane_constants membrane; /* kernels/membrane.h */
    sphm_fluid_constants fluid;       /* kernels/fluid.h */
    sphm_solid_constants solid;       /* kernels/solid.h */
    sphm_end_block ends[2];           /* kernels/end_block.h: origin, insertion */
} sphm_model;

/* Checks the parameters, builds the body from `mesh` (NULL: the preset) and derives the constants. On a
 * refusal `model` is zeroed. */
sphm_status sphm_model_create(sphm_model *model, const sphm_parameters *parameters, const sphm_surface *mesh,
                              sphm_context *context);
void sphm_model_free(sphm_model *model);
/* Fills a state that was just created with the rest shape and the rest potential, in the order of ids;
 * rest_density is left to the tissue. */
void sphm_model_rest_state(const sphm_model *model, sphm_state *s);

#ifdef __cplusplus
}
#endif
#endif
