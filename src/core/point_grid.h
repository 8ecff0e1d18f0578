/* Points in the cells of a grid, to find the ones near a place. Used on rest shapes, once; the step has its
 * own cell order (src/cpu). */
#ifndef SPHM_CORE_POINT_GRID_H
#define SPHM_CORE_POINT_GRID_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_point_grid {
    const double *points; /* [3 * count], borrowed */
    size_t count;
    double lower[3], cell;
    int64_t cells[3];
    int32_t *start; /* [cells + 1] */
    int32_t *point; /* [count], point numbers, cell by cell, ascending within a cell */
} sphm_point_grid;

/* `points` must be finite and outlive the grid. `cell` > 0 is lengthened where the box would take more than
 * a few cells per point. On refusal the grid is left zeroed. */
sphm_status sphm_point_grid_create(const double *points, size_t count, double cell, sphm_point_grid *grid,
                                   sphm_context *context);
void sphm_point_grid_free(sphm_point_grid *grid);

/* The `wanted` points nearest to `place` within `radius`, nearest first, equal distances by number. Fills
 * `found` and `squared` (distances squared), both [wanted]; returns how many there are. */
size_t sphm_point_grid_nearest(const sphm_point_grid *grid, const double place[3], double radius,
                               size_t wanted, int32_t *found, double *squared);

#ifdef __cplusplus
}
#endif
#endif
