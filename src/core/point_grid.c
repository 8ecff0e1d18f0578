/* Counting sort of points into cells, and the search for the nearest ones. */
#include "core/point_grid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"

static int64_t cell_of(const sphm_point_grid *grid, int axis, double value) {
    const double cell = floor((value - grid->lower[axis]) / grid->cell);
    if (!(cell > 0))
        return 0;
    return cell < (double)grid->cells[axis] ? (int64_t)cell : grid->cells[axis] - 1;
}

static size_t cell_index(const sphm_point_grid *grid, const double point[3]) {
    const int64_t x = cell_of(grid, 0, point[0]), y = cell_of(grid, 1, point[1]),
                  z = cell_of(grid, 2, point[2]);
    return (size_t)((z * grid->cells[1] + y) * grid->cells[0] + x);
}

/* Sets lower, cell and cells; returns the number of cells. */
static size_t lay_out(sphm_point_grid *grid, double cell) {
    double upper[3] = {0, 0, 0};
    for (size_t i = 0; i < grid->count; ++i)
        for (int a = 0; a < 3; ++a) {
            const double value = grid->points[3 * i + a];
            if (i == 0 || value < grid->lower[a])
                grid->lower[a] = value;
            if (i == 0 || value > upper[a])
                upper[a] = value;
        }
    const double most = 8.0 * (double)grid->count + 64;
    for (grid->cell = cell;; grid->cell *= 2) {
        double cells = 1;
        for (int a = 0; a < 3; ++a)
            cells *= floor((upper[a] - grid->lower[a]) / grid->cell) + 1;
        if (cells <= most)
            break;
    }
    size_t cells = 1;
    for (int a = 0; a < 3; ++a) {
        grid->cells[a] = (int64_t)floor((upper[a] - grid->lower[a]) / grid->cell) + 1;
        cells *= (size_t)grid->cells[a];
    }
    return cells;
}

sphm_status sphm_point_grid_create(const double *points, size_t count, double cell, sphm_point_grid *grid,
                                   sphm_context *context) {
    memset(grid, 0, sizeof *grid);
    grid->points = points;
    grid->count = count;
    const size_t cells = lay_out(grid, cell);
    grid->start = calloc(cells + 2, sizeof *grid->start);
    grid->point = malloc((count ? count : 1) * sizeof *grid->point);
    if (!grid->start || !grid->point) {
        sphm_point_grid_free(grid);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a grid of %zu points", count);
    }
    /* start[c + 2] counts cell c, then becomes its beginning at c + 1, then moves to c while points are
     * placed. */
    for (size_t i = 0; i < count; ++i)
        ++grid->start[cell_index(grid, points + 3 * i) + 2];
    for (size_t c = 2; c < cells + 2; ++c)
        grid->start[c] += grid->start[c - 1];
    for (size_t i = 0; i < count; ++i)
        grid->point[grid->start[cell_index(grid, points + 3 * i) + 1]++] = (int32_t)i;
    return SPHM_OK;
}

void sphm_point_grid_free(sphm_point_grid *grid) {
    free(grid->start);
    free(grid->point);
    memset(grid, 0, sizeof *grid);
}

/* Puts a candidate in its place among the `have` best ones; returns the new number of them. */
static size_t insert(int32_t point, double distance, size_t wanted, size_t have, int32_t *found,
                     double *squared) {
    size_t place = have;
    while (place > 0 &&
           (squared[place - 1] > distance || (squared[place - 1] == distance && found[place - 1] > point)))
        --place;
    if (place >= wanted)
        return have;
    const size_t last = have < wanted ? have : wanted - 1;
    memmove(found + place + 1, found + place, (last - place) * sizeof *found);
    memmove(squared + place + 1, squared + place, (last - place) * sizeof *squared);
    found[place] = point;
    squared[place] = distance;
    return last + 1;
}

/* The nearest ones among the points within `radius`. */
static size_t nearest_within(const sphm_point_grid *grid, const double place[3], double radius, size_t wanted,
                             int32_t *found, double *squared) {
    int64_t first[3], last[3];
    for (int a = 0; a < 3; ++a) {
        first[a] = cell_of(grid, a, place[a] - radius);
        last[a] = cell_of(grid, a, place[a] + radius);
    }
    size_t have = 0;
    for (int64_t z = first[2]; z <= last[2]; ++z)
        for (int64_t y = first[1]; y <= last[1]; ++y) {
            const size_t row = (size_t)((z * grid->cells[1] + y) * grid->cells[0]);
            for (int32_t n = grid->start[row + (size_t)first[0]]; n < grid->start[row + (size_t)last[0] + 1];
                 ++n) {
                const double *p = grid->points + 3 * (size_t)grid->point[n];
                const double x = p[0] - place[0], y2 = p[1] - place[1], z2 = p[2] - place[2];
                const double distance = x * x + y2 * y2 + z2 * z2;
                if (distance <= radius * radius && (have < wanted || distance <= squared[have - 1]))
                    have = insert(grid->point[n], distance, wanted, have, found, squared);
            }
        }
    return have;
}

size_t sphm_point_grid_nearest(const sphm_point_grid *grid, const double place[3], double radius,
                               size_t wanted, int32_t *found, double *squared) {
    if (wanted == 0 || grid->count == 0)
        return 0;
    /* Grow the sphere until it holds enough: then nothing outside it can be nearer. */
    double farthest = 0;
    for (int a = 0; a < 3; ++a) {
        const double extent = (double)grid->cells[a] * grid->cell;
        farthest += fabs(place[a] - grid->lower[a]) + extent;
    }
    for (double reach = grid->cell;; reach *= 1.5) {
        const double within = reach < radius ? reach : radius;
        const size_t have = nearest_within(grid, place, within, wanted, found, squared);
        if (have == wanted || within >= radius || within >= farthest)
            return have;
    }
}
