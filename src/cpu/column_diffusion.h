/* The diffusion sweep over the columns of the solid tissue (solid_columns.h): the weights of neighbour rows,
 * put where 16 particles find theirs side by side. A pair costs its weight and a share of a load, instead of
 * weight, index and a gathered value. Near the surface, where corrections differ, weights do too, so that
 * each pair keeps its own. */
#ifndef SPHM_CPU_COLUMN_DIFFUSION_H
#define SPHM_CPU_COLUMN_DIFFUSION_H

#include "core/diffusion.h"
#include "core/state.h"
#include "cpu/solid_columns.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_column_diffusion {
    const sphm_solid_columns *columns; /* borrowed; NULL: not in use */
    /* [16 a column]: those of a slice follow each other, of each of its twins the one ahead and the one
     * behind, then of its singles; 0 in lanes that take no part. 1/ms */
    sphm_real *weight;
    sphm_real *potential; /* [count], with room on both sides; a copy, mV */
    sphm_real *memory;
} sphm_column_diffusion;

/* Of `diffusion`, whose weights are parallel to rows->slot. */
sphm_status sphm_column_diffusion_create(sphm_column_diffusion *columns_of, const sphm_solid_columns *columns,
                                         const sphm_neighbours *rows, const sphm_diffusion *diffusion,
                                         sphm_context *context);
void sphm_column_diffusion_free(sphm_column_diffusion *d); /* a zeroed struct is fine */
size_t sphm_column_diffusion_bytes(const sphm_column_diffusion *d);

/* membrane_next = membrane_potential + step_ms sum_j weight_ij (potential_j - potential_i) */
void sphm_column_diffusion_sweep(const sphm_column_diffusion *d, sphm_state *state, double step_ms,
                                 int threads);

#ifdef __cplusplus
}
#endif
#endif
