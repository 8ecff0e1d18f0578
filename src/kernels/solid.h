/* The solid tissue at a point: transversely isotropic, nearly incompressible muscle (Blemker and Delp 2005;
 * the paper's section 3.11 and Table 3), as a map from the deformation gradient F to the first
 * Piola-Kirchhoff stress P.
 *
 * Symbols: C = F^T F, J = det F, f0 the rest fibre (unit), lambda = |F f0|, f = F f0/lambda, and on the
 * volume-free Fbar = J^(-1/3) F:  I1 = tr C, I4 = f0.C f0 = lambda^2, I5 = f0.C^2 f0.
 *
 *   along-fibre shear  W1 = G1 B1^2,  B1^2 = I5/I4^2 - 1                (free of J as it stands)
 *   cross-fibre shear  W2 = G2 B2^2,  cosh B2 = (I1 I4 - I5)/(2 sqrt(I4)) on Cbar
 *   volume             W3 = K/2 (ln J)^2
 *   fibre              Cauchy stress sigma_max (alpha f_active(r) + f_passive(r)) r along f,
 *                      r = lambda/lambda_ofl
 *
 * The fibre term acts on the true stretch (default: the whole stress s f f is added) or on the volume-free
 * one (r from Fbar, and only the deviator of s f f, as in Blemker-Delp and FEBio), which with Table 3's soft
 * K inflates an active muscle. Arrays are row major, F[3 * i + j] = dx_i/dX_j. */
#ifndef SPHM_KERNELS_SOLID_H
#define SPHM_KERNELS_SOLID_H

#include "kernels/elementary.h"
#include "sph_muscle/parameters.h"

typedef struct sphm_solid_constants {
    sphm_real along_fibre_shear_Pa;    /* G1 */
    sphm_real cross_fibre_shear_Pa;    /* G2 */
    sphm_real bulk_Pa;                 /* K */
    sphm_real max_isometric_stress_Pa; /* sigma_max */
    sphm_real optimal_stretch;         /* lambda_ofl */
    sphm_real passive_linear_stretch;  /* lambda*, of r: the passive curve is linear beyond */
    sphm_real passive_coefficient;     /* P1 */
    sphm_real passive_exponent;        /* P2 */
    sphm_real passive_compressive_Pa;  /* stiffness of a fibre below its rest length; 0 in Table 3 */
    sphm_real surface_Pa;              /* pressure of the surroundings */
    /* Force-velocity: 1/(lambda_ofl times the greatest shortening speed), 0: off; 1 over Hill's curvature;
     * what fast lengthening adds; and what its filtered rate adds to a fibre's stiffness at full activation.
     */
    sphm_real inverse_speed_s, inverse_curvature, eccentric_gain, rate_stiffness_Pa;
    int fibre_coupling; /* SPHM_FIBRE_... */
} sphm_solid_constants;

/* Everything below is free of branches, so that a loop over particles vectorises: what looks like a choice is
 * a select. */
SPHM_FN sphm_real sphm_solid_clip(sphm_real value, sphm_real lower, sphm_real upper) {
    const sphm_real above = value > lower ? value : lower;
    return above < upper ? above : upper;
}

SPHM_FN sphm_real sphm_solid_magnitude(sphm_real value) {
    return value < 0 ? -value : value;
}

/* Normalised active force-length curve of r = lambda/lambda_ofl, symmetric about r = 1: 1 - 4 d^2 up to
 * d = |r - 1| = 0.4, 9 (0.6 - d)^2 up to 0.6, then zero. */
SPHM_FN sphm_real sphm_solid_active_curve(sphm_real r) {
    const sphm_real d = sphm_solid_magnitude(r - 1), rest = sphm_solid_clip((sphm_real)0.6 - d, 0, 1);
    return d < (sphm_real)0.4 ? 1 - 4 * d * d : 9 * rest * rest;
}

/* Its slope without the sign. */
SPHM_FN sphm_real sphm_solid_active_steepness(sphm_real r) {
    const sphm_real d = sphm_solid_magnitude(r - 1), rest = sphm_solid_clip((sphm_real)0.6 - d, 0, 1);
    return d < (sphm_real)0.4 ? 8 * d : 18 * rest;
}

/* Normalised passive force-length curve of r, and its slope: exponential above 1, its tangent beyond
 * r = lambda*. */
SPHM_FN sphm_real sphm_solid_passive_curve(sphm_real r, const sphm_solid_constants *c, sphm_real *slope) {
    const sphm_real end = c->passive_linear_stretch, clipped = sphm_solid_clip(r, 1, end);
    const sphm_real growth = sphm_exp(c->passive_exponent * (clipped - 1));
    const sphm_real steepness = c->passive_coefficient * c->passive_exponent * growth;
    *slope = r > 1 ? steepness : 0;
    return c->passive_coefficient * (growth - 1) + steepness * (r > end ? r - end : 0);
}

/* Rate of the stretch, 1/s: d lambda/dt = f.(Fdot f0). */
SPHM_FN sphm_real sphm_solid_stretch_rate(const sphm_real F[9], const sphm_real rate[9],
                                          const sphm_real f0[3]) {
    sphm_real square = 0, power = 0;
    for (int i = 0; i < 3; ++i) {
        const sphm_real a = F[3 * i] * f0[0] + F[3 * i + 1] * f0[1] + F[3 * i + 2] * f0[2];
        square += a * a;
        power += a * (rate[3 * i] * f0[0] + rate[3 * i + 1] * f0[1] + rate[3 * i + 2] * f0[2]);
    }
    return power / sphm_sqrt(square);
}

/* Active force over the isometric one at a stretch rate. V: shortening speed over its maximum.
 *   0 <= V <= 1    (1 - V)/(1 + V/k)                              Hill, Proc. R. Soc. B 126 (1938) 136
 *   V < 0          1 + g v/(v + c), v = -V, c = g/(1 + 1/k)       same slope at V = 0, 1 + g in the limit
 * and 0 beyond V = 1. Explicitly this would be a viscosity of 1.5e5 Pa s; the rate is therefore a filtered
 * one (rate_filter), which makes it a stiffness in series. */
SPHM_FN sphm_real sphm_solid_force_velocity(sphm_real stretch_rate, const sphm_solid_constants *c) {
    const sphm_real v = stretch_rate * c->inverse_speed_s;
    const sphm_real V = sphm_solid_clip(-v, 0, 1), longer = v > 0 ? v : 0;
    const sphm_real corner = c->eccentric_gain / (1 + c->inverse_curvature);
    const sphm_real shortening = (1 - V) / (1 + V * c->inverse_curvature);
    const sphm_real lengthening = 1 + c->eccentric_gain * longer / (longer + corner);
    return v > 0 ? lengthening : shortening;
}

/* What a fibre does at a stretch: Cauchy stresses along it. */
typedef struct sphm_fibre_stress {
    sphm_real stretch;    /* lambda (or its volume-free part, where the fibre term acts on that) */
    sphm_real active_Pa;  /* sigma_max alpha f_active(r) r */
    sphm_real passive_Pa; /* sigma_max f_passive(r) r, and the compressive stiffness below rest length */
    sphm_real tangent_Pa; /* slope of force over rest area against stretch, each part without its sign */
} sphm_fibre_stress;

SPHM_FN sphm_fibre_stress sphm_solid_fibre_stress(sphm_real stretch, sphm_real activation,
                                                  const sphm_solid_constants *c) {
    sphm_fibre_stress s;
    sphm_real passive_slope;
    const sphm_real r = stretch / c->optimal_stretch, scale = c->max_isometric_stress_Pa * r;
    const sphm_real compressed = stretch < 1 ? 1 - stretch : 0;
    s.stretch = stretch;
    s.active_Pa = scale * activation * sphm_solid_active_curve(r);
    s.passive_Pa =
        scale * sphm_solid_passive_curve(r, c, &passive_slope) - c->passive_compressive_Pa * compressed;
    s.tangent_Pa = c->max_isometric_stress_Pa / (c->optimal_stretch * c->optimal_stretch) *
                       (activation * sphm_solid_active_steepness(r) + passive_slope) +
                   (stretch < 1 ? c->passive_compressive_Pa / (stretch * stretch) : 0);
    return s;
}

/* B2 / sinh B2 of x = cosh B2, which is even and smooth at x = 1: the series to the fourth order in x - 1
 * keeps its digits where acosh(x)/sqrt(x^2 - 1) would divide rounding by rounding. Its next term is
 * below 1e-7 for x - 1 < 0.05; rounding may put x a little under 1, which the series allows. */
SPHM_FN sphm_real sphm_solid_angle_over_sinh(sphm_real x) {
    const sphm_real e = x - 1, far = e > (sphm_real)0.05 ? e : (sphm_real)0.05;
    const sphm_real series =
        1 + e * ((sphm_real)(-1.0 / 3) +
                 e * ((sphm_real)(2.0 / 15) + e * ((sphm_real)(-2.0 / 35) + e * (sphm_real)(8.0 / 315))));
    const sphm_real root = sphm_sqrt(far * (far + 2));
    const sphm_real closed = sphm_ln(1 + far + root) / root;
    return e > (sphm_real)0.05 ? closed : series;
}

/* Cofactor matrix: J F^-T. */
SPHM_FN void sphm_solid_cofactor(const sphm_real F[9], sphm_real K[9]) {
    K[0] = F[4] * F[8] - F[5] * F[7];
    K[1] = F[5] * F[6] - F[3] * F[8];
    K[2] = F[3] * F[7] - F[4] * F[6];
    K[3] = F[2] * F[7] - F[1] * F[8];
    K[4] = F[0] * F[8] - F[2] * F[6];
    K[5] = F[1] * F[6] - F[0] * F[7];
    K[6] = F[1] * F[5] - F[2] * F[4];
    K[7] = F[2] * F[3] - F[0] * F[5];
    K[8] = F[0] * F[4] - F[1] * F[3];
}

/* P(F) of the whole material. The pressure of the surroundings is in it, as p cof F: the derivative of
 * p times the volume. Summed with the particles' gradients that is a follower pressure on the whole
 * surface which leaves both momenta of a free muscle alone, and needs no surface normals; where the tissue
 * is in balance with it the Cauchy stress of the tissue proper is -p. (The other way, area vectors from
 * the rest gradient of 1 turned by cof F, presses on the outermost particles alone, which nothing but the
 * hourglass force holds.) `fibre` receives the fibre's part apart. Returns J; for J <= 0 the particle is
 * inverted, P is all NaN, and whoever watches for non-finite values stops there. */
SPHM_FN sphm_real sphm_solid_stress(const sphm_real F[9], const sphm_real f0[3], sphm_real activation,
                                    const sphm_solid_constants *c, sphm_real P[9], sphm_fibre_stress *fibre) {
    sphm_real K[9];
    sphm_solid_cofactor(F, K);
    const sphm_real J = F[0] * K[0] + F[1] * K[1] + F[2] * K[2];
    const sphm_real inverse_J = J > 0 ? 1 / J : (sphm_real)NAN;

    /* a = F f0, b = C f0 = F^T a, d = F b, and the invariants of C. */
    sphm_real a[3], b[3], d[3];
    for (int i = 0; i < 3; ++i)
        a[i] = F[3 * i] * f0[0] + F[3 * i + 1] * f0[1] + F[3 * i + 2] * f0[2];
    for (int j = 0; j < 3; ++j)
        b[j] = F[j] * a[0] + F[3 + j] * a[1] + F[6 + j] * a[2];
    for (int i = 0; i < 3; ++i)
        d[i] = F[3 * i] * b[0] + F[3 * i + 1] * b[1] + F[3 * i + 2] * b[2];
    sphm_real I1 = 0;
    for (int i = 0; i < 9; ++i)
        I1 += F[i] * F[i];
    const sphm_real I4 = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
    const sphm_real I5 = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];
    const sphm_real inverse_I4 = 1 / I4, stretch = sphm_sqrt(I4);

    /* W1 does not change under C -> s C, so the true invariants serve:
     *   dW1/dF = G1 (dI5/I4^2 - 2 I5 dI4/I4^3),  dI4 = 2 a f0,  dI5 = 2 (a b + d f0). */
    const sphm_real along = 2 * c->along_fibre_shear_Pa * inverse_I4 * inverse_I4;

    /* W2: x of Cbar is y/J with y = (I1 I4 - I5)/(2 sqrt(I4)) of C, so dx/dF = dy/dF / J - x F^-T, and
     * dW2/dx = 2 G2 B2/sinh B2. */
    const sphm_real half_root = (sphm_real)0.5 / stretch, cross = I1 * I4 - I5;
    const sphm_real x = cross * half_root * inverse_J;
    const sphm_real slope = 2 * c->cross_fibre_shear_Pa * sphm_solid_angle_over_sinh(x);
    const sphm_real y = slope * inverse_J * half_root;

    /* Fibre: P = J s F^-T-transformed f f = J s/lambda^2 a f0 on the true stretch; on the volume-free one the
     * energy gives Cauchy dev(s f f)/J, so P = s (a f0/lambda^2 - F^-T/3). */
    const int volume_free = c->fibre_coupling == SPHM_FIBRE_VOLUME_FREE;
    const sphm_real log_J = sphm_ln(J), shrink = volume_free ? sphm_exp(log_J * (sphm_real)(-1.0 / 3)) : 1;
    *fibre = sphm_solid_fibre_stress(stretch * shrink, activation, c);
    const sphm_real s = fibre->active_Pa + fibre->passive_Pa;
    const sphm_real tension = (volume_free ? s : J * s) * inverse_I4;
    const sphm_real spherical =
        (c->bulk_Pa * log_J - slope * x - (volume_free ? s * (sphm_real)(1.0 / 3) : 0)) * inverse_J +
        c->surface_Pa;

    /* Collect what multiplies a f0, a b, d f0, F and the cofactors. */
    const sphm_real a_f0 = tension - 2 * along * I5 * inverse_I4 + y * (2 * I1 - cross * inverse_I4);
    const sphm_real a_b = along - 2 * y, of_F = 2 * y * I4;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            P[3 * i + j] = a[i] * (a_f0 * f0[j] + a_b * b[j]) + a_b * d[i] * f0[j] + of_F * F[3 * i + j] +
                           spherical * K[3 * i + j];
    return J;
}

/* How much faster than at rest gradients can vary on the deformed shape, squared: a bound of the largest
 * eigenvalue of C^-1 = F^-1 F^-T, of which `K` is the cofactor matrix J F^-T. For a symmetric 3x3 matrix A
 * with trace t and deviator A', no eigenvalue is above t/3 + sqrt(2/3) |A'|, which is exact where the two
 * smaller ones are equal (a fibre that shortens), and 1.3 times too much at worst where the two larger ones
 * are. */
SPHM_FN sphm_real sphm_solid_thinning(const sphm_real K[9], sphm_real inverse_J) {
    sphm_real diagonal[3], mean = 0, square = 0;
    for (int j = 0; j < 3; ++j) {
        diagonal[j] = K[j] * K[j] + K[3 + j] * K[3 + j] + K[6 + j] * K[6 + j];
        mean += diagonal[j] / 3;
    }
    for (int j = 0; j < 3; ++j) {
        const int k = (j + 1) % 3;
        const sphm_real off = K[j] * K[k] + K[3 + j] * K[3 + k] + K[6 + j] * K[6 + k];
        square += (diagonal[j] - mean) * (diagonal[j] - mean) + 2 * off * off;
    }
    return (mean + sphm_sqrt(square * (sphm_real)(2.0 / 3))) * inverse_J * inverse_J;
}

/* Adds the viscous (Kelvin-Voigt) part, Cauchy stress 2 eta D with D the symmetric part of L = Fdot F^-1:
 * P = J sigma F^-T = 2 eta D K, K the cofactor matrix. Objective, and it only ever dissipates: P : Fdot =
 * 2 eta J D : D. `inverse_J` is 1/det F.
 *
 * Seen from the rest shape, where the step limit is, it is J |F^-T|^2 times as viscous as there. A particle
 * half as thick as at rest would have to be followed with a quarter of the step, and where it is not it flips
 * to and fro. So eta falls where that factor exceeds 1: no particle is more viscous than at rest. (Limits
 * that follow the worst particle take three to five times as many steps.) */
SPHM_FN void sphm_solid_add_viscous_stress(const sphm_real F[9], const sphm_real rate[9],
                                           sphm_real viscosity_Pa_s, sphm_real inverse_J, sphm_real P[9]) {
    sphm_real K[9], D[9];
    sphm_solid_cofactor(F, K);
    const sphm_real excess = sphm_solid_thinning(K, inverse_J) / inverse_J;
    const sphm_real scale = viscosity_Pa_s * inverse_J / (excess > 1 ? excess : 1);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const sphm_real l_ij =
                rate[3 * i] * K[3 * j] + rate[3 * i + 1] * K[3 * j + 1] + rate[3 * i + 2] * K[3 * j + 2];
            const sphm_real l_ji =
                rate[3 * j] * K[3 * i] + rate[3 * j + 1] * K[3 * i + 1] + rate[3 * j + 2] * K[3 * i + 2];
            D[3 * i + j] = scale * (l_ij + l_ji); /* 2 eta D */
        }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            P[3 * i + j] += D[3 * i] * K[j] + D[3 * i + 1] * K[3 + j] + D[3 * i + 2] * K[6 + j];
}

/* An upper estimate of the stiffness of the tissue against a plane wave, Pa: rho c^2 <= this for every
 * direction. With n the deformed unit normal, the volume term gives K (1 + |ln J|) |F^-T|^2 at most, the
 * cross-fibre shear a few G2 |F^-T|^2 (small beside K: counted fivefold). W1 = G1 |s|^2 with s =
 * F_a^T F f0/lambda^2, F_a what F does across the fibre; a wave changes s by at most
 * sqrt(1/lambda^2 + |F_a|^2/lambda^4), which makes fibres that are short and sheared at once very stiff, and
 * the part with s'' is below as much again. The fibre itself gives its tangent, and its tension as a string
 * has it. */
SPHM_FN sphm_real sphm_solid_wave_modulus(const sphm_real F[9], sphm_real J, const sphm_real f0[3],
                                          const sphm_fibre_stress *fibre, const sphm_solid_constants *c) {
    sphm_real K[9], along = 0, all = 0;
    sphm_solid_cofactor(F, K);
    for (int i = 0; i < 3; ++i) {
        const sphm_real a = F[3 * i] * f0[0] + F[3 * i + 1] * f0[1] + F[3 * i + 2] * f0[2];
        along += a * a;
        all += F[3 * i] * F[3 * i] + F[3 * i + 1] * F[3 * i + 1] + F[3 * i + 2] * F[3 * i + 2];
    }
    const sphm_real inverse = 1 / along, thinning = sphm_solid_thinning(K, 1 / J);
    const sphm_real matrix =
        c->bulk_Pa * (1 + sphm_solid_magnitude(sphm_ln(J))) + 5 * c->cross_fibre_shear_Pa;
    const sphm_real along_fibre = 4 * c->along_fibre_shear_Pa * inverse * (1 + (all - along) * inverse);
    const sphm_real tension = sphm_solid_magnitude(fibre->active_Pa + fibre->passive_Pa);
    return matrix * (thinning > 1 ? thinning : 1) + along_fibre +
           J * (fibre->tangent_Pa + tension / (fibre->stretch * fibre->stretch));
}

#endif
