/* Counting sort of the particles into cells; see grid.h. Reads positions and ids, writes the grid only. */
#include "cpu/grid.h"

#include <stdlib.h>
#include <string.h>

#include "core/context.h"

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

/* Lays the grid over the box, with cells at least `edge` wide. */
static void lay_out(sphm_grid *grid, const sphm_real *const position[3], size_t count, double edge) {
    double lower[3], upper[3];
    find_box(position, count, lower, upper);
    sphm_cells_lay_out(&grid->cells, lower, upper, count, edge);
}

sphm_status sphm_grid_sort(sphm_grid *grid, const sphm_real *x, const sphm_real *y, const sphm_real *z,
                           const int32_t *id, size_t count, double edge, sphm_context *context) {
    const sphm_real *const position[3] = {x, y, z};
    sphm_status status = reserve_particles(grid, count, context);
    if (status != SPHM_OK)
        return status;
    lay_out(grid, position, count, edge);
    const sphm_cells *cells = &grid->cells;
    status = reserve_cells(grid, cells->count, context);
    if (status != SPHM_OK)
        return status;

    /* Cells by id, so that the pass below meets the particles in the order of their ids. */
    memset(grid->start, 0, (cells->count + 1) * sizeof *grid->start);
    const sphm_real *slow = position[cells->axis[0]], *middle = position[cells->axis[1]],
                    *fast = position[cells->axis[2]];
    for (size_t slot = 0; slot < count; ++slot) {
        const int32_t cell = sphm_cells_index(cells, sphm_cells_coordinate(cells, 0, (double)slow[slot]),
                                              sphm_cells_coordinate(cells, 1, (double)middle[slot]),
                                              sphm_cells_coordinate(cells, 2, (double)fast[slot]));
        grid->cell[id[slot]] = cell;
        ++grid->start[cell + 1];
    }
    for (size_t cell = 0; cell < cells->count; ++cell)
        grid->start[cell + 1] += grid->start[cell];

    /* Each id takes the next slot of its cell. */
    for (size_t particle = 0; particle < count; ++particle)
        grid->cell[particle] = grid->start[grid->cell[particle]]++;
    for (size_t cell = cells->count; cell > 0; --cell)
        grid->start[cell] = grid->start[cell - 1];
    grid->start[0] = 0;
    for (size_t slot = 0; slot < count; ++slot)
        grid->order[grid->cell[id[slot]]] = (int32_t)slot;
    return SPHM_OK;
}
