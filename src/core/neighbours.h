/* Neighbour lists: for every particle slot the slots within the support radius plus a skin, in rows.
 * Rows are in ascending slot order, never contain the particle itself, and are padded to a multiple of
 * SPHM_ROW_ALIGN with the particle's own slot (distance 0: every kernel gradient and every difference
 * vanishes there, so sweeps need no remainder loop; sums of W must add the self term elsewhere). */
#ifndef SPHM_CORE_NEIGHBOURS_H
#define SPHM_CORE_NEIGHBOURS_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPHM_ROW_ALIGN 16

typedef struct sphm_neighbours {
    size_t count;       /* particles */
    size_t *row_start;  /* [count + 1], multiples of SPHM_ROW_ALIGN */
    int32_t *row_count; /* [count], real neighbours in the row, before the padding */
    int32_t *slot;      /* [row_start[count]] */
    size_t capacity;    /* of slot */
} sphm_neighbours;

#ifdef __cplusplus
}
#endif
#endif
