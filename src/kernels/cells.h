/* The cells of the neighbour search: cubes over the box of all particles, numbered with its longest side
 * slowest. */
#ifndef SPHM_KERNELS_CELLS_H
#define SPHM_KERNELS_CELLS_H

#include <math.h>

#include "kernels/qualifiers.h"

#define SPHM_CELLS_PER_PARTICLE 8

/* The most cells there are over `count` particles. */
SPHM_FN size_t sphm_cells_most(size_t count) {
    return SPHM_CELLS_PER_PARTICLE * count + 64;
}

typedef struct sphm_cells {
    size_t count;
    int axis[3];     /* slow, middle and fast axis: a permutation of 0, 1, 2 */
    int size[3];     /* cells along these axes */
    double lower[3]; /* of the box, along these axes */
    double edge;     /* of a cell; at least what was asked for */
} sphm_cells;

/* Longest side first; equal sides keep their order. */
SPHM_FN void sphm_cells_rank_axes(const double extent[3], int axis[3]) {
    axis[0] = 0;
    axis[1] = 1;
    axis[2] = 2;
    for (int pass = 0; pass < 2; ++pass)
        for (int i = 0; i < 2; ++i)
            if (extent[axis[i + 1]] > extent[axis[i]]) {
                const int swap = axis[i];
                axis[i] = axis[i + 1];
                axis[i + 1] = swap;
            }
}

/* The number of cells for an edge, as a double because it may not fit an integer. */
SPHM_FN double sphm_cells_for(const double extent[3], double edge) {
    double cells = 1;
    for (int d = 0; d < 3; ++d)
        cells *= floor(extent[d] / edge) + 1;
    return cells;
}

/* Lays the cells over the box of `count` particles, at least `edge` wide and no more than
 * sphm_cells_most(count). */
SPHM_FN void sphm_cells_lay_out(sphm_cells *cells, const double lower[3], const double upper[3], size_t count,
                                double edge) {
    double extent[3];
    for (int d = 0; d < 3; ++d)
        extent[d] = upper[d] - lower[d];
    sphm_cells_rank_axes(extent, cells->axis);
    while (sphm_cells_for(extent, edge) > (double)sphm_cells_most(count))
        edge *= 1.25;
    cells->edge = edge;
    cells->count = 1;
    for (int d = 0; d < 3; ++d) {
        cells->lower[d] = lower[cells->axis[d]];
        cells->size[d] = (int)floor(extent[cells->axis[d]] / edge) + 1;
        cells->count *= (size_t)cells->size[d];
    }
}

SPHM_FN int sphm_cells_clamp(const sphm_cells *cells, int d, int index) {
    return index < 0 ? 0 : index < cells->size[d] ? index : cells->size[d] - 1;
}

/* Along axis d of the cells. */
SPHM_FN int sphm_cells_coordinate(const sphm_cells *cells, int d, double position) {
    return sphm_cells_clamp(cells, d, (int)((position - cells->lower[d]) / cells->edge));
}

SPHM_FN int32_t sphm_cells_index(const sphm_cells *cells, int slow, int middle, int fast) {
    return (slow * cells->size[1] + middle) * cells->size[2] + fast;
}

/* How many cells on either side may hold neighbours. */
SPHM_FN int sphm_cells_reach(const sphm_cells *cells, double radius) {
    return (int)ceil(radius / cells->edge);
}

#endif
