/* Builds the neighbour rows (core/neighbours.h) from a sorted grid. */
#ifndef SPHM_CPU_NEIGHBOURS_H
#define SPHM_CPU_NEIGHBOURS_H

#include "core/neighbours.h"
#include "cpu/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

void sphm_neighbours_free(sphm_neighbours *rows); /* a zeroed struct is fine */
/* Fills `rows` with all pairs at most radius_m apart. x, y, z are in the slot order that `grid` sorted them
 * into. Grows the arrays where they are too short. */
sphm_status sphm_neighbours_build(sphm_neighbours *rows, const sphm_grid *grid, const sphm_real *x,
                                  const sphm_real *y, const sphm_real *z, size_t count, double radius_m,
                                  int threads, sphm_context *context);
/* Pairs at most radius_m apart, counted from both sides. */
size_t sphm_neighbours_count_within(const sphm_neighbours *rows, const sphm_real *x, const sphm_real *y,
                                    const sphm_real *z, double radius_m);

/* Renames the slots: the new slot s is the old slot order[s]. */
sphm_status sphm_neighbours_reorder(sphm_neighbours *rows, const int32_t *order, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
