/* Counting sort of the particles into cells; see grid.h. Reads positions and ids, writes the grid only. */
#include "cpu/grid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"

#define CELLS_PER_PARTICLE 8

void sphm_grid_free(sphm_grid *grid) {
    free(grid->start);
    free(grid->cell);
    free(grid->order);
    memset(grid, 0, sizeof *grid);
}

static sphm_status reserve_particles(sphm_grid *grid, size_t count, sphm_context *context) {
    if (count <= grid->particles)
        return SPHM_OK;
    free(grid->cell);
    free(grid->order);
    grid->particles = 0;
    grid->cell = (int32_t *)malloc(count * sizeof *grid->cell);
    grid->order = (int32_t *)malloc(count * sizeof *grid->order);
    if (!grid->cell || !grid->order)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to sort %zu particles into cells", count);
    grid->particles = count;
    return SPHM_OK;
}

static sphm_status reserve_cells(sphm_grid *grid, size_t cells, sphm_context *context) {
    if (cells <= grid->capacity)
        return SPHM_OK;
    const size_t capacity = cells + cells / 8; /* the muscle bulges: leave room */
    free(grid->start);
    grid->capacity = 0;
    grid->start = (int32_t *)malloc((capacity + 1) * sizeof *grid->start);
    if (!grid->start)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu cells", capacity);
    grid->capacity = capacity;
    return SPHM_OK;
}

static void find_box(const sphm_real *const position[3], size_t count, double lower[3], double upper[3]) {
    for (int d = 0; d < 3; ++d) {
        lower[d] = upper[d] = (double)position[d][0];
        for (size_t i = 1; i < count; ++i) {
            const double value = (double)position[d][i];
            lower[d] = value < lower[d] ? value : lower[d];
            upper[d] = value > upper[d] ? value : upper[d];
        }
    }
}

/* Longest side first; equal sides keep their order. */
static void rank_axes(const double extent[3], int axis[3]) {
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
static double cells_for(const double extent[3], double edge) {
    double cells = 1;
    for (int d = 0; d < 3; ++d)
        cells *= floor(extent[d] / edge) + 1;
    return cells;
}

/* Lays the grid over the box, with cells at least `edge` wide. */
static void lay_out(sphm_grid *grid, const sphm_real *const position[3], size_t count, double edge) {
    double lower[3], upper[3], extent[3];
    find_box(position, count, lower, upper);
    for (int d = 0; d < 3; ++d)
        extent[d] = upper[d] - lower[d];
    rank_axes(extent, grid->axis);
    while (cells_for(extent, edge) > (double)CELLS_PER_PARTICLE * (double)count + 64)
        edge *= 1.25;
    grid->edge = edge;
    grid->cells = 1;
    for (int d = 0; d < 3; ++d) {
        grid->lower[d] = lower[grid->axis[d]];
        grid->size[d] = (int)floor(extent[grid->axis[d]] / edge) + 1;
        grid->cells *= (size_t)grid->size[d];
    }
}

static int coordinate(const sphm_grid *grid, int d, double position) {
    const int index = (int)((position - grid->lower[d]) / grid->edge);
    return index < 0 ? 0 : index < grid->size[d] ? index : grid->size[d] - 1;
}

sphm_status sphm_grid_sort(sphm_grid *grid, const sphm_real *x, const sphm_real *y, const sphm_real *z,
                           const int32_t *id, size_t count, double edge, sphm_context *context) {
    const sphm_real *const position[3] = {x, y, z};
    sphm_status status = reserve_particles(grid, count, context);
    if (status != SPHM_OK)
        return status;
    lay_out(grid, position, count, edge);
    status = reserve_cells(grid, grid->cells, context);
    if (status != SPHM_OK)
        return status;

    /* Cells by id, so that the pass below meets the particles in the order of their ids. */
    memset(grid->start, 0, (grid->cells + 1) * sizeof *grid->start);
    const sphm_real *slow = position[grid->axis[0]], *middle = position[grid->axis[1]],
                    *fast = position[grid->axis[2]];
    for (size_t slot = 0; slot < count; ++slot) {
        const int32_t cell = (coordinate(grid, 0, (double)slow[slot]) * grid->size[1] +
                              coordinate(grid, 1, (double)middle[slot])) *
                                 grid->size[2] +
                             coordinate(grid, 2, (double)fast[slot]);
        grid->cell[id[slot]] = cell;
        ++grid->start[cell + 1];
    }
    for (size_t cell = 0; cell < grid->cells; ++cell)
        grid->start[cell + 1] += grid->start[cell];

    /* Each id takes the next slot of its cell. */
    for (size_t particle = 0; particle < count; ++particle)
        grid->cell[particle] = grid->start[grid->cell[particle]]++;
    for (size_t cell = grid->cells; cell > 0; --cell)
        grid->start[cell] = grid->start[cell - 1];
    grid->start[0] = 0;
    for (size_t slot = 0; slot < count; ++slot)
        grid->order[grid->cell[id[slot]]] = (int32_t)slot;
    return SPHM_OK;
}
