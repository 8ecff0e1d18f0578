/* Vectors of three doubles and the symmetric 3x3 eigenproblem, for the geometry stage. */
#ifndef SPHM_CORE_VEC3_H
#define SPHM_CORE_VEC3_H

#include <math.h>

#include "kernels/vector.h"

#ifdef __cplusplus
extern "C" {
#endif

static inline double sphm_norm3(const double a[3]) {
    return sqrt(sphm_dot3(a, a));
}

static inline void sphm_subtract3(const double a[3], const double b[3], double out[3]) {
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

/* Makes a unit vector; returns the length it had. A vector of length 0 is left alone. */
static inline double sphm_normalise3(double a[3]) {
    double length = sphm_norm3(a);
    if (length > 0)
        for (int k = 0; k < 3; k++)
            a[k] /= length;
    return length;
}

static inline double sphm_distance_squared3(const double a[3], const double b[3]) {
    double d[3];
    sphm_subtract3(a, b, d);
    return sphm_dot3(d, d);
}

/* Eigenvalues, largest first, and unit eigenvectors (rows of `vectors`, a right-handed frame) of a symmetric
 * matrix, by cyclic Jacobi rotations. A diagonal matrix keeps the coordinate axes, so shapes that lie along
 * them are not turned. */
void sphm_eigen_symmetric3(double matrix[3][3], double values[3], double vectors[3][3]);
/* Solves the symmetric system by the adjugate. Returns 0 (and leaves x) where it is singular. */
int sphm_solve_symmetric3(double matrix[3][3], const double right[3], double x[3]);

#ifdef __cplusplus
}
#endif
#endif
