/* The cell grid of the neighbour search, and the order in which it puts particles into slots.
 *
 * Cells are cubes, numbered with the longest side of the box slowest, so that the particles a sweep touches
 * around a slot stay within a few cross-sections of the muscle (and in the cache). The order is a pure
 * function of positions and ids: by cell, then by id. A muscle restored from a snapshot therefore finds the
 * same slots again, and sums in the same order. */
#ifndef SPHM_CPU_GRID_H
#define SPHM_CPU_GRID_H

#include "kernels/cells.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_grid {
    size_t particles; /* capacity of `cell` and `order` */
    size_t capacity;  /* of `start`, in cells */
    sphm_cells cells;
    int32_t *start; /* [cells.count + 1], first slot of each cell */
    int32_t *cell;  /* [particles], scratch: cell by id */
    int32_t *order; /* [particles], the slot each new slot is taken from */
} sphm_grid;

/* A zeroed grid is an empty one. */
void sphm_grid_free(sphm_grid *grid);
/* Sorts: fills `start` and `order` for particles at x, y, z (finite) with ids id[0 ... count - 1], each of
 * 0 ... count - 1 once. The edge grows beyond `edge` where the box would need more than 8 cells a particle.
 */
sphm_status sphm_grid_sort(sphm_grid *grid, const sphm_real *x, const sphm_real *y, const sphm_real *z,
                           const int32_t *id, size_t count, double edge, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
