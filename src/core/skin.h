/* The surface carried by particles: weights fixed on the rest shape, applied to any present shape. */
#ifndef SPHM_CORE_SKIN_H
#define SPHM_CORE_SKIN_H

#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SPHM_SKIN_NEIGHBOURS = 24 };

typedef struct sphm_skin_weights {
    size_t vertex_count;
    int32_t *particle; /* [24 * vertex_count], ids */
    float *carry; /* [24 * vertex_count], c_k: sum c_k = 1, sum c_k X_k = X_v where the neighbours allow it */
    float *blend; /* [24 * vertex_count], positive, sum 1: for fields */
    float *rest_m; /* [3 * vertex_count], X_v - sum c_k X_k: rounding, or what the neighbours leave open */
    size_t degenerate; /* vertices whose neighbours span no volume */
} sphm_skin_weights;

/* `vertices_m` and `particles_m` are rest positions in one frame; both counts at least 1. On refusal the
 * weights are left zeroed. */
sphm_status sphm_skin_weights_create(const double *vertices_m, size_t vertex_count, const double *particles_m,
                                     size_t particle_count, double spacing_m, int threads,
                                     sphm_skin_weights *weights, sphm_context *context);
void sphm_skin_weights_free(sphm_skin_weights *weights);

/* vertices = offset + sum c_k x_k + rotation rest, from positions [3 * particles] by id. */
void sphm_skin_carry(const sphm_skin_weights *weights, const sphm_real *positions_m, const double rotation[9],
                     const double offset_m[3], int threads, float *vertices_m);
/* out = sum b_k field_k */
void sphm_skin_blend(const sphm_skin_weights *weights, const float *field, int threads, float *out);

#ifdef __cplusplus
}
#endif
#endif
