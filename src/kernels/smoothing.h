/* Smoothing kernels (eqs 13-15), in units of the support radius h: with q = r/h
 *     poly6      W = 315/(64 pi h3) (1 - q2)^3
 *     spiky      grad W = -45/(pi h4) (1 - q)^2/q  x/h,   from W = 15/(pi h3) (1 - q)^3
 *     viscosity  lap W = 45/(pi h5) (1 - q)
 * and 0 from q = 1 on. Functions here take q or q2 and return the part without the dimension; the factors are
 * the ..._factor functions. So single precision neither overflows nor loses digits, whatever the unit, and
 * sweeps scale once a particle, not once a pair. (The cubic spline of eq 26 is in kernels/diffusion.h.)
 * Mueller, Charypar and Gross, SCA 2003; Desbrun and Gascuel, EGCAS 1996. */
#ifndef SPHM_KERNELS_SMOOTHING_H
#define SPHM_KERNELS_SMOOTHING_H

#include <math.h>
#include <string.h>

#include "kernels/qualifiers.h"

#define SPHM_PI 3.14159265358979323846

/* 1/sqrt(x) for normal x > 0, within 2 units in the last place. In single precision by three Newton steps
 * from the well-known integer guess: eight-odd cycles for 16 of them, where sqrt and a division take 35, and
 * the same bits on every processor, which approximate reciprocal instructions do not give. */
SPHM_FN sphm_real sphm_inverse_sqrt(sphm_real x) {
#ifdef SPH_MUSCLE_DOUBLE
    return 1 / sqrt(x);
#elif defined(__CUDA_ARCH__)
    return rsqrtf(x);
#else
    int32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = 0x5f375a86 - (bits >> 1);
    float y;
    memcpy(&y, &bits, sizeof y);
    const float half = 0.5f * x;
    y = y * (1.5f - half * y * y);
    y = y * (1.5f - half * y * y);
    y = y * (1.5f - half * y * y);
    return y;
#endif
}

/* Added to q2 under the root, so that coinciding particles do not divide by zero. */
#define SPHM_TINY ((sphm_real)1e-18)

/* (1 - q2)^3 */
SPHM_FN sphm_real sphm_poly6(sphm_real q2) {
    const sphm_real t = q2 < 1 ? 1 - q2 : 0;
    return t * t * t;
}

/* (1 - q)^2/q, the length of -grad W over that of x/h. */
SPHM_FN sphm_real sphm_spiky_gradient(sphm_real q, sphm_real inverse_q) {
    const sphm_real t = q < 1 ? 1 - q : 0;
    return t * t * inverse_q;
}

/* 1 - q */
SPHM_FN sphm_real sphm_viscosity_laplacian(sphm_real q) {
    return q < 1 ? 1 - q : 0;
}

SPHM_FN double sphm_poly6_factor(double h) {
    return 315 / (64 * SPHM_PI * h * h * h);
}
SPHM_FN double sphm_spiky_factor(double h) {
    return 45 / (SPHM_PI * h * h * h * h);
}
SPHM_FN double sphm_viscosity_factor(double h) {
    return 45 / (SPHM_PI * h * h * h * h * h);
}

#endif
