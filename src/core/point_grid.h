/* Points sorted into the cells of a regular grid: who is near a place? For the geometry stage, in double;
 * the particles of a running muscle have neighbour lists of their own (neighbours.h). */
#ifndef SPHM_CORE_POINT_GRID_H
#define SPHM_CORE_POINT_GRID_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_point_grid {
    const double *points; /* borrowed */
    size_t count;
    double lower[3], cell;
    int64_t n[3];
    size_t *start;  /* [n[0] n[1] n[2] + 1], into order */
    int32_t *order; /* [count], points by cell, ascending within one */
} sphm_point_grid;

/* `cell` is enlarged where it would take more cells than four a point. */
sphm_status sphm_point_grid_create(const double *points, size_t count, double cell, sphm_point_grid *grid,
                                   sphm_context *context);
void sphm_point_grid_free(sphm_point_grid *grid);

/* Stores up to `capacity` points nearer to x than `radius` and returns how many there are. */
size_t sphm_point_grid_within(const sphm_point_grid *grid, const double x[3], double radius, int32_t *found,
                              size_t capacity);
/* The nearest point, the first one of equals. The grid must not be empty. */
size_t sphm_point_grid_nearest(const sphm_point_grid *grid, const double x[3]);
/* The `wanted` points closest to x within `radius` (may be infinite), closest first, equal distances by
 * number. Fills `found` and `squared` (distances squared), both [wanted]; returns how many there are. */
size_t sphm_point_grid_closest(const sphm_point_grid *grid, const double x[3], double radius, size_t wanted,
                               int32_t *found, double *squared);

#ifdef __cplusplus
}
#endif
#endif
