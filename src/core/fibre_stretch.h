/* Stretch along the fibre from the local deformation gradient, as weights on the rest neighbours. */
#ifndef SPHM_CORE_FIBRE_STRETCH_H
#define SPHM_CORE_FIBRE_STRETCH_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_fibre_weights {
    size_t count;      /* particles */
    size_t *row_start; /* [count + 1]; an empty row: no stretch can be told, it counts as 1 */
    int32_t *particle; /* [row_start[count]], ids */
    float *weight;     /* [row_start[count]], c_j, 1/m */
} sphm_fibre_weights;

/* `rest_m` and `fibres` are [3 * count] by id. On refusal the weights are left zeroed. */
sphm_status sphm_fibre_weights_create(const double *rest_m, const double *fibres, size_t count,
                                      double spacing_m, sphm_fibre_weights *weights, sphm_context *context);
void sphm_fibre_weights_free(sphm_fibre_weights *weights);

/* stretch[id] = current over rest length along the fibre, from positions [3 * count] by id. */
void sphm_fibre_stretch(const sphm_fibre_weights *weights, const sphm_real *positions_m, int threads,
                        float *stretch);

#ifdef __cplusplus
}
#endif
#endif
