/* Diffusion between two points: the weight of a pair, and the correction at a particle that the weights are
 * made with (section 3.6, eqs 25 and 26, and what they leave open).
 *
 * div(D grad V)_i = sum_j w_ij (V_j - V_i),   w_ij = g(r) n.((B_i + B_j)/2) n
 *   n = (x_j - x_i)/r, g(r) = -2 Vol W'(r)/r     (Brookshaw, Proc. ASA 6 (1985) 207)
 *                   or g(r) = Vol W''(r)         (the paper, eq 26)
 * with the cubic spline W of support h, q = 2 r/h:
 *   -2 W'/r = 48/(pi h5) ((2-q)+^2 - 4 (1-q)+^2)/q,   W'' = 48/(pi h5) ((2-q)+ - 4 (1-q)+).
 * Taylor expansion: the weights give div(D grad V) when half the sum of w x x over the neighbours is D. In
 * the bulk B = (5 D - tr(D) 1)/2 does it for Brookshaw's g, in the mean over all directions (Espanol and
 * Revenga, Phys. Rev. E 67 (2003) 026705). At a free surface half of the sum is missing, and on any lattice
 * it is off by the quadrature. The corrected form solves for the symmetric B_i that makes it exact, six
 * equations for six unknowns. The mean over the pair keeps w_ij = w_ji, so charge is conserved.
 *
 * Lengths here are in units of h, so that all quantities are of order one: x^ = x/h, g^ = g h2, D^ = D/h2. */
#ifndef SPHM_KERNELS_DIFFUSION_H
#define SPHM_KERNELS_DIFFUSION_H

#include "kernels/qualifiers.h"

#include <math.h>

SPHM_FN sphm_real sphm_square_root(sphm_real x) {
#ifdef SPH_MUSCLE_DOUBLE
    return sqrt(x);
#else
    return sqrtf(x);
#endif
}

/* 48/pi, the common factor of both g^ once Vol/h3 is taken out. */
#define SPHM_PAIR_FACTOR ((sphm_real)15.278874536821951)

/* The factor of both g^. */
SPHM_FN sphm_real sphm_pair_factor(double volume_m3, double h) {
    return SPHM_PAIR_FACTOR * (sphm_real)(volume_m3 / (h * h * h));
}

/* D^ of D in mm2/ms: 1/ms. */
SPHM_FN double sphm_diffusion_in_h(double mm2_per_ms, double h) {
    return mm2_per_ms / (h * 1e3 * (h * 1e3));
}

/* g^ over SPHM_PAIR_FACTOR Vol/h3 at r^2/h^2, Brookshaw's form; 0 at distance 0 (the padding of the rows) and
 * from h on. inverse_r is 1/r^, or anything finite at distance 0. */
SPHM_FN sphm_real sphm_pair_gradient(sphm_real r, sphm_real inverse_r) {
    const sphm_real q = 2 * r;
    const sphm_real outer = q < 2 ? 2 - q : 0;
    const sphm_real inner = q < 1 ? 1 - q : 0;
    const sphm_real value = (outer * outer - 4 * inner * inner) * (sphm_real)0.5 * inverse_r;
    return r > 0 ? value : 0;
}

/* The same for the bare second derivative of eq 26. */
SPHM_FN sphm_real sphm_pair_second_derivative(sphm_real r) {
    const sphm_real q = 2 * r;
    const sphm_real outer = q < 2 ? 2 - q : 0;
    const sphm_real inner = q < 1 ? 1 - q : 0;
    return r > 0 ? outer - 4 * inner : 0;
}

/* x.B x. Scalars, because an array of six keeps gcc from vectorising the loop over the pairs. */
SPHM_FN sphm_real sphm_quadratic_form(sphm_real bxx, sphm_real byy, sphm_real bzz, sphm_real bxy,
                                      sphm_real bxz, sphm_real byz, sphm_real x, sphm_real y, sphm_real z) {
    return bxx * x * x + byy * y * y + bzz * z * z + 2 * (bxy * x * y + bxz * x * z + byz * y * z);
}

/* Diffusion tensor across 1 + (along - across) f f, as xx yy zz xy xz yz. */
SPHM_FN void sphm_diffusion_tensor(double along, double across, double fx, double fy, double fz,
                                   double tensor[6]) {
    const double extra = along - across;
    tensor[0] = across + extra * fx * fx;
    tensor[1] = across + extra * fy * fy;
    tensor[2] = across + extra * fz * fz;
    tensor[3] = extra * fx * fy;
    tensor[4] = extra * fx * fz;
    tensor[5] = extra * fy * fz;
}

/* B = scale (5 D - tr(D) 1)/2: right in the bulk with scale 1. */
SPHM_FN void sphm_diffusion_bulk_form(const double tensor[6], double scale, sphm_real b[6]) {
    const double trace = tensor[0] + tensor[1] + tensor[2];
    for (int k = 0; k < 6; k++)
        b[k] = (sphm_real)(scale * 0.5 * (5 * tensor[k] - (k < 3 ? trace : 0)));
}

/* Fourth moments of a neighbourhood: sum of g^ x^ x^ x^ x^/r^2 over the neighbours. The six equations are
 * M b = D with M half the Gram matrix of (xx yy zz xy xz yz) and b = (Bxx Byy Bzz 2Bxy 2Bxz 2Byz). */
enum {
    SPHM_M_XXXX,
    SPHM_M_YYYY,
    SPHM_M_ZZZZ,
    SPHM_M_XXYY,
    SPHM_M_XXZZ,
    SPHM_M_YYZZ,
    SPHM_M_XXXY,
    SPHM_M_XXXZ,
    SPHM_M_XXYZ,
    SPHM_M_XYYY,
    SPHM_M_XYYZ,
    SPHM_M_XYZZ,
    SPHM_M_XZZZ,
    SPHM_M_YYYZ,
    SPHM_M_YZZZ,
    SPHM_MOMENT_COUNT
};

/* Smallest pivot, relative to the trace of the second moment, at which the six equations still count as
 * regular. In the bulk the pivots are 0.06 ... 0.2. */
#define SPHM_SMALLEST_PIVOT 2e-3

/* Cholesky factorisation and solution of M b = D, M symmetric and never indefinite since g^ >= 0. Returns 0,
 * with b undefined, where a pivot falls below `smallest`. */
SPHM_FN int sphm_solve_six(double m[6][6], const double right[6], double smallest, double b[6]) {
    for (int j = 0; j < 6; j++) {
        double pivot = m[j][j];
        for (int k = 0; k < j; k++)
            pivot -= m[j][k] * m[j][k];
        if (!(pivot > smallest))
            return 0;
        const double inverse = 1 / sqrt(pivot);
        m[j][j] = inverse; /* the diagonal holds the inverse of the factor's */
        for (int i = j + 1; i < 6; i++) {
            double sum = m[i][j];
            for (int k = 0; k < j; k++)
                sum -= m[i][k] * m[j][k];
            m[i][j] = sum * inverse;
        }
    }
    for (int i = 0; i < 6; i++) {
        double sum = right[i];
        for (int k = 0; k < i; k++)
            sum -= m[i][k] * b[k];
        b[i] = sum * m[i][i];
    }
    for (int i = 5; i >= 0; i--) {
        double sum = b[i];
        for (int k = i + 1; k < 6; k++)
            sum -= m[k][i] * b[k];
        b[i] = sum * m[i][i];
    }
    return 1;
}

/* The correction of one particle from its fourth moments and its diffusion tensor (D^, 1/ms). Returns 1, or 0
 * where the six equations are singular and the bulk form, scaled so that the trace is right, stands in. */
SPHM_FN int sphm_diffusion_correct(const double s[SPHM_MOMENT_COUNT], const double tensor[6],
                                   sphm_real b[6]) {
    double m[6][6] = {
        {s[SPHM_M_XXXX], 0, 0, 0, 0, 0},
        {s[SPHM_M_XXYY], s[SPHM_M_YYYY], 0, 0, 0, 0},
        {s[SPHM_M_XXZZ], s[SPHM_M_YYZZ], s[SPHM_M_ZZZZ], 0, 0, 0},
        {s[SPHM_M_XXXY], s[SPHM_M_XYYY], s[SPHM_M_XYZZ], s[SPHM_M_XXYY], 0, 0},
        {s[SPHM_M_XXXZ], s[SPHM_M_XYYZ], s[SPHM_M_XZZZ], s[SPHM_M_XXYZ], s[SPHM_M_XXZZ], 0},
        {s[SPHM_M_XXYZ], s[SPHM_M_YYYZ], s[SPHM_M_YZZZ], s[SPHM_M_XYYZ], s[SPHM_M_XYZZ], s[SPHM_M_YYZZ]}};
    for (int i = 0; i < 6; i++)
        for (int j = 0; j <= i; j++)
            m[i][j] *= 0.5;
    /* Trace of half the second moment: 3 times its mean diagonal element. */
    const double second = 0.5 * (s[SPHM_M_XXXX] + s[SPHM_M_YYYY] + s[SPHM_M_ZZZZ] +
                                 2 * (s[SPHM_M_XXYY] + s[SPHM_M_XXZZ] + s[SPHM_M_YYZZ]));
    double solution[6];
    if (second > 0 && sphm_solve_six(m, tensor, SPHM_SMALLEST_PIVOT * second, solution)) {
        for (int k = 0; k < 6; k++)
            b[k] = (sphm_real)(k < 3 ? solution[k] : 0.5 * solution[k]);
        return 1;
    }
    sphm_diffusion_bulk_form(tensor, second > 0 ? 3 / second : 0, b);
    return 0;
}

#endif
