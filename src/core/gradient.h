/* Gradients on the rest shape: what the solid tissue needs to know of a particle's neighbours, fixed at
 * creation.
 *
 *     w_ij = c (1 - R/h)^4              pair weight, 1/m2, symmetric
 *
 *     B_i  = (sum_j w_ij X_ij X_ij^T)^-1
 *
 *     grad phi_i = sum_j w_ij (phi_j - phi_i) B_i X_ij
 *
 * with X_ij = X_j - X_i, R = |X_ij| < h = radius_m, and c such that sum_j w_ij X_ij X_ij^T = 1 inside a cubic
 * lattice. B is the first-order correction (Bonet and Lok 1999; Randles, Libersky 1996): the gradient
 * is exact for a linear phi at every particle that has four or more neighbours that do not lie in a plane,
 * boundary included, on any arrangement. */
#ifndef SPHM_CORE_GRADIENT_H
#define SPHM_CORE_GRADIENT_H

#include "core/neighbours.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_gradient {
    size_t count;
    sphm_real *pair;       /* [4 * rows->row_start[count]]: w X, w Y, w Z (1/m), w (1/m2); 0 in the padding */
    sphm_real *correction; /* [6 * count], B: xx, xy, xz, yy, yz, zz */
    /* Largest eigenvalues over the particles, 1/m2, that bound every frequency of the tissue: of the sum of
     * q |grad phi|^2, q a particle's relative volume, which is that of q |grad u|^2 of a vector field u; of
     * the sum of q (div u)^2, up to twice as large at corners, where gradients are one-sided and their
     * adjoints are not; and of the hourglass energy's sum of w |phi_j - phi_i - grad phi_i . X_ij|^2 / 2. */
    double gradient_eigenvalue, divergence_eigenvalue, hourglass_eigenvalue;
    double neighbours_per_particle; /* mean */
    size_t
        regularised; /* particles whose neighbours lie (nearly) in a plane: their gradient misses the rest */
    size_t isolated; /* particles without a neighbour: no gradient, no force */
} sphm_gradient;

void sphm_gradient_free(sphm_gradient *gradient); /* a zeroed one is fine */
/* `rows` holds all pairs within radius_m at the rest positions x, y, z (slot order). volume_m3: mean of a
 * particle; relative_volume [count]: of each over it. `threads`: 0 is all there are; no bit depends on it. On
 * anything but SPHM_OK `gradient` is zeroed. */
sphm_status sphm_gradient_create(sphm_gradient *gradient, const sphm_neighbours *rows, const sphm_real *x,
                                 const sphm_real *y, const sphm_real *z, const sphm_real *relative_volume,
                                 double radius_m, double volume_m3, int threads, sphm_context *context);
/* The same of the same particles in another slot order; the eigenvalues stay. They are estimates that depend
 * a little on the order, and time steps on them: back ends estimate in one order and sweep in their own. */
sphm_status sphm_gradient_rebuild(sphm_gradient *gradient, const sphm_neighbours *rows, const sphm_real *x,
                                  const sphm_real *y, const sphm_real *z, double radius_m, double volume_m3,
                                  int threads, sphm_context *context);

#ifdef __cplusplus
}
#endif
#endif
