/* Points in the cells of a regular grid. Used by fibres, for isolated particles, fibre stretch and skin. */
#include "core/point_grid.h"
#include "core/context.h"
#include "core/vec3.h"

#include <stdlib.h>
#include <string.h>

#define CELLS_PER_POINT 4

static int64_t cell_coordinate(const sphm_point_grid *g, double x, int axis) {
    double at = floor((x - g->lower[axis]) / g->cell);
    return at < 0 ? 0 : at >= (double)g->n[axis] ? g->n[axis] - 1 : (int64_t)at;
}

static size_t cell_number(const sphm_point_grid *g, int64_t i, int64_t j, int64_t k) {
    return (size_t)((k * g->n[1] + j) * g->n[0] + i);
}

static size_t cell_of(const sphm_point_grid *g, const double x[3]) {
    return cell_number(g, cell_coordinate(g, x[0], 0), cell_coordinate(g, x[1], 1),
                       cell_coordinate(g, x[2], 2));
}

static void choose_cells(sphm_point_grid *g, double cell) {
    double upper[3];
    for (size_t k = 0; k < 3; k++) {
        g->lower[k] = INFINITY;
        upper[k] = -INFINITY;
        for (size_t p = 0; p < g->count; p++) {
            g->lower[k] = fmin(g->lower[k], g->points[3 * p + k]);
            upper[k] = fmax(upper[k], g->points[3 * p + k]);
        }
    }
    double most = CELLS_PER_POINT * (double)g->count + 8, product;
    for (g->cell = cell;; g->cell *= 1.3) {
        product = 1;
        for (int k = 0; k < 3; k++)
            product *= floor((upper[k] - g->lower[k]) / g->cell) + 1;
        if (product <= most)
            break;
    }
    for (int k = 0; k < 3; k++)
        g->n[k] = (int64_t)floor((upper[k] - g->lower[k]) / g->cell) + 1;
}

sphm_status sphm_point_grid_create(const double *points, size_t count, double cell, sphm_point_grid *grid,
                                   sphm_context *context) {
    memset(grid, 0, sizeof *grid);
    if (count == 0 || count > INT32_MAX || !(cell > 0))
        return sphm_fail(
            context, SPHM_REFUSED_ARGUMENT,
            "a grid of %zu points in cells of %g m cannot be made; 1 to %d points and a cell above 0 "
            "can",
            count, cell, INT32_MAX);
    grid->points = points;
    grid->count = count;
    choose_cells(grid, cell);
    size_t cells = (size_t)(grid->n[0] * grid->n[1] * grid->n[2]);
    grid->start = calloc(cells + 2, sizeof *grid->start);
    grid->order = malloc(count * sizeof *grid->order);
    if (!grid->start || !grid->order) {
        sphm_point_grid_free(grid);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a grid of %zu points", count);
    }
    /* Counting sort; counts are stored two cells on, so that the second pass leaves starts in place. */
    for (size_t p = 0; p < count; p++)
        grid->start[cell_of(grid, &points[3 * p]) + 2]++;
    for (size_t c = 2; c < cells + 2; c++)
        grid->start[c] += grid->start[c - 1];
    for (size_t p = 0; p < count; p++)
        grid->order[grid->start[cell_of(grid, &points[3 * p]) + 1]++] = (int32_t)p;
    return SPHM_OK;
}

void sphm_point_grid_free(sphm_point_grid *grid) {
    free(grid->start);
    free(grid->order);
    memset(grid, 0, sizeof *grid);
}

size_t sphm_point_grid_within(const sphm_point_grid *g, const double x[3], double radius, int32_t *found,
                              size_t capacity) {
    int64_t low[3], high[3];
    size_t count = 0;
    for (int k = 0; k < 3; k++) {
        low[k] = cell_coordinate(g, x[k] - radius, k);
        high[k] = cell_coordinate(g, x[k] + radius, k);
    }
    for (int64_t k = low[2]; k <= high[2]; k++)
        for (int64_t j = low[1]; j <= high[1]; j++) {
            size_t end = g->start[cell_number(g, high[0], j, k) + 1];
            for (size_t at = g->start[cell_number(g, low[0], j, k)]; at < end; at++) {
                int32_t p = g->order[at];
                if (!(sphm_distance_squared3(x, &g->points[3 * (size_t)p]) < radius * radius))
                    continue;
                if (count < capacity)
                    found[count] = p;
                count++;
            }
        }
    return count;
}

typedef struct nearest {
    size_t point;
    double distance_squared;
} nearest;

static void search_cell(const sphm_point_grid *g, const double x[3], size_t cell, nearest *best) {
    for (size_t at = g->start[cell]; at < g->start[cell + 1]; at++) {
        size_t p = (size_t)g->order[at];
        double d = sphm_distance_squared3(x, &g->points[3 * p]);
        if (d < best->distance_squared || (d == best->distance_squared && p < best->point)) {
            best->distance_squared = d;
            best->point = p;
        }
    }
}

/* Cells whose distance from the middle cell is `ring` in the largest-coordinate sense. */
static void search_ring(const sphm_point_grid *g, const double x[3], const int64_t middle[3], int64_t ring,
                        nearest *best) {
    for (int64_t k = middle[2] - ring; k <= middle[2] + ring; k++)
        for (int64_t j = middle[1] - ring; j <= middle[1] + ring; j++) {
            if (k < 0 || k >= g->n[2] || j < 0 || j >= g->n[1])
                continue;
            int whole = llabs(k - middle[2]) == ring || llabs(j - middle[1]) == ring;
            for (int64_t i = middle[0] - ring; i <= middle[0] + ring; i += whole || ring == 0 ? 1 : 2 * ring)
                if (i >= 0 && i < g->n[0])
                    search_cell(g, x, cell_number(g, i, j, k), best);
        }
}

/* Rings of cells outwards. Beyond ring r nothing is nearer than r cells to the point of the grid's box
 * nearest to x, and, since the box is convex, nothing nearer to x than the hypotenuse of that and the gap to
 * the box. */
size_t sphm_point_grid_nearest(const sphm_point_grid *g, const double x[3]) {
    int64_t middle[3], rings = 0;
    double gap_squared = 0;
    for (int k = 0; k < 3; k++) {
        middle[k] = cell_coordinate(g, x[k], k);
        double upper = g->lower[k] + (double)g->n[k] * g->cell;
        double gap = x[k] < g->lower[k] ? g->lower[k] - x[k] : x[k] > upper ? x[k] - upper : 0;
        gap_squared += gap * gap;
        rings = g->n[k] > rings ? g->n[k] : rings;
    }
    nearest best = {0, INFINITY};
    for (int64_t ring = 0; ring < rings; ring++) {
        search_ring(g, x, middle, ring, &best);
        double reach = (double)ring * g->cell;
        if (best.distance_squared < gap_squared + reach * reach)
            break;
    }
    return best.point;
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
        first[a] = cell_coordinate(grid, place[a] - radius, a);
        last[a] = cell_coordinate(grid, place[a] + radius, a);
    }
    size_t have = 0;
    for (int64_t z = first[2]; z <= last[2]; ++z)
        for (int64_t y = first[1]; y <= last[1]; ++y) {
            const size_t row = (size_t)((z * grid->n[1] + y) * grid->n[0]);
            for (size_t n = grid->start[row + (size_t)first[0]]; n < grid->start[row + (size_t)last[0] + 1];
                 ++n) {
                const double *p = grid->points + 3 * (size_t)grid->order[n];
                const double x = p[0] - place[0], y2 = p[1] - place[1], z2 = p[2] - place[2];
                const double distance = x * x + y2 * y2 + z2 * z2;
                if (distance <= radius * radius && (have < wanted || distance <= squared[have - 1]))
                    have = insert(grid->order[n], distance, wanted, have, found, squared);
            }
        }
    return have;
}

size_t sphm_point_grid_closest(const sphm_point_grid *grid, const double place[3], double radius,
                               size_t wanted, int32_t *found, double *squared) {
    if (wanted == 0 || grid->count == 0)
        return 0;
    /* Grow the sphere until it holds enough: then nothing outside it can be nearer. */
    double farthest = 0;
    for (int a = 0; a < 3; ++a) {
        const double extent = (double)grid->n[a] * grid->cell;
        farthest += fabs(place[a] - grid->lower[a]) + extent;
    }
    for (double reach = grid->cell;; reach *= 1.5) {
        const double within = reach < radius ? reach : radius;
        const size_t have = nearest_within(grid, place, within, wanted, found, squared);
        if (have == wanted || within >= radius || !(within < farthest))
            return have;
    }
}
