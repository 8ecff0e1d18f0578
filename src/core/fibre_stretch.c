/* Stretch along the fibre: reads positions by id, writes one number a particle.
 *
 * The deformation gradient that fits the neighbours of particle i best (weighted least squares) is
 *     F = (sum w (x_j - x_i)(X_j - X_i)^T) M^-1,   M = sum w (X_j - X_i)(X_j - X_i)^T,
 * and the stretch of the unit rest fibre f is |F f|. Since f and M belong to the rest shape,
 *     F f = sum c_j (x_j - x_i),   c_j = w_j (X_j - X_i) . M^-1 f,
 * so that a number per neighbour, computed once, is all that is kept. Exact for every affine motion.
 *
 * The neighbours are those within two spacings (26 in a cubic lattice), whatever the support radius: a
 * derivative gets no better from further ones, and costs more. */
#include "core/fibre_stretch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/point_grid.h"
#include "kernels/look.h"

enum { MOST_NEIGHBOURS = 64 }; /* in the lattice 26; jitter may bring a few more */

/* g = M^-1 f, or 0 where the neighbours leave a direction open. */
static int solve(const double m[9], const double f[3], double g[3]) {
    double a[4][4] = {{0}}, v[4][4];
    const double trace = m[0] + m[4] + m[8];
    if (!(trace > 0))
        return 0;
    for (int i = 0; i < 9; ++i)
        a[i / 3][i % 3] = m[i] / trace;
    sphm_symmetric_eigen(a, v, 3);
    g[0] = g[1] = g[2] = 0;
    for (int e = 0; e < 3; ++e) {
        if (!(a[e][e] > 0.01)) /* of the trace: three neighbours at right angles have 0.33 each */
            return 0;
        const double along = (v[0][e] * f[0] + v[1][e] * f[1] + v[2][e] * f[2]) / (a[e][e] * trace);
        for (int i = 0; i < 3; ++i)
            g[i] += along * v[i][e];
    }
    return 1;
}

/* Neighbours and weights of one particle; returns how many. */
static size_t weigh(const sphm_point_grid *grid, const double *fibre, size_t i, double reach,
                    int32_t *particle, double *weight) {
    const double *rest = grid->points;
    double squared[MOST_NEIGHBOURS], m[9] = {0}, g[3];
    const size_t found =
        sphm_point_grid_closest(grid, rest + 3 * i, reach, MOST_NEIGHBOURS, particle, squared);
    for (size_t n = 0; n < found; ++n) {
        const double q = 1 - squared[n] / (reach * reach);
        weight[n] = q * q;
        for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
                m[3 * a + b] += weight[n] * (rest[3 * particle[n] + a] - rest[3 * i + a]) *
                                (rest[3 * particle[n] + b] - rest[3 * i + b]);
    }
    if (!solve(m, fibre, g))
        return 0;
    size_t kept = 0;
    for (size_t n = 0; n < found; ++n) {
        const size_t j = (size_t)particle[n];
        const double edge[3] = {rest[3 * j] - rest[3 * i], rest[3 * j + 1] - rest[3 * i + 1],
                                rest[3 * j + 2] - rest[3 * i + 2]};
        const double c = weight[n] * sphm_dot3(edge, g);
        if (j == i || weight[n] < 1e-9)
            continue;
        particle[kept] = (int32_t)j;
        weight[kept++] = c;
    }
    return kept;
}

/* Appends a row, growing the arrays. */
static int append(sphm_fibre_weights *weights, size_t *capacity, size_t i, size_t kept,
                  const int32_t *particle, const double *weight) {
    const size_t start = weights->row_start[i];
    if (start + kept > *capacity) {
        const size_t wanted = 2 * *capacity + kept;
        int32_t *particles = realloc(weights->particle, wanted * sizeof *particles);
        if (particles)
            weights->particle = particles;
        float *values = realloc(weights->weight, wanted * sizeof *values);
        if (values)
            weights->weight = values;
        if (!particles || !values)
            return 0;
        *capacity = wanted;
    }
    for (size_t n = 0; n < kept; ++n) {
        weights->particle[start + n] = particle[n];
        weights->weight[start + n] = (float)weight[n];
    }
    weights->row_start[i + 1] = start + kept;
    return 1;
}

sphm_status sphm_fibre_weights_create(const double *rest_m, const double *fibres, size_t count,
                                      double spacing_m, sphm_fibre_weights *weights, sphm_context *context) {
    memset(weights, 0, sizeof *weights);
    sphm_point_grid grid;
    const sphm_status status = sphm_point_grid_create(rest_m, count, spacing_m, &grid, context);
    if (status != SPHM_OK)
        return status;
    size_t capacity = 27 * count;
    weights->count = count;
    weights->row_start = calloc(count + 1, sizeof *weights->row_start);
    weights->particle = malloc((capacity + 1) * sizeof *weights->particle);
    weights->weight = malloc((capacity + 1) * sizeof *weights->weight);
    int enough = weights->row_start && weights->particle && weights->weight;
    for (size_t i = 0; i < count && enough; ++i) {
        int32_t particle[MOST_NEIGHBOURS];
        double weight[MOST_NEIGHBOURS];
        const size_t kept = weigh(&grid, fibres + 3 * i, i, 2 * spacing_m, particle, weight);
        enough = append(weights, &capacity, i, kept, particle, weight);
    }
    sphm_point_grid_free(&grid);
    if (!enough) {
        sphm_fibre_weights_free(weights);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the fibre stretch of %zu particles",
                         count);
    }
    return SPHM_OK;
}

void sphm_fibre_weights_free(sphm_fibre_weights *weights) {
    free(weights->row_start);
    free(weights->particle);
    free(weights->weight);
    memset(weights, 0, sizeof *weights);
}

void sphm_fibre_stretch(const sphm_fibre_weights *weights, const sphm_real *positions_m, int threads,
                        float *stretch) {
    (void)threads;
#pragma omp parallel for schedule(static) num_threads(threads)
    for (size_t i = 0; i < weights->count; ++i) {
        const size_t begin = weights->row_start[i];
        stretch[i] = sphm_look_stretch(positions_m, 3, i, weights->particle + begin, weights->weight + begin,
                                       weights->row_start[i + 1] - begin);
    }
}
