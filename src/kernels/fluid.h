/* The viscous fluid at a point and between two points (eqs 9-15, 20-23). */
#ifndef SPHM_KERNELS_FLUID_H
#define SPHM_KERNELS_FLUID_H

#include "kernels/smoothing.h"

typedef struct sphm_fluid_constants {
    int coupling;                       /* SPHM_COUPLING_... */
    sphm_real support_radius_m;         /* h */
    sphm_real mass_kg;                  /* of a particle */
    sphm_real density_kg_per_m3;        /* of the tissue */
    sphm_real stiffness_m2_per_s2;      /* k */
    sphm_real electrical_Pa_per_mV;     /* kappa */
    sphm_real resting_mV;               /* Vr */
    sphm_real fibre_tension_Pa;         /* T at full activation */
    sphm_real tension_slope;            /* of T over the stretch of a pair */
    sphm_real viscosity_Pa_s;           /* mu */
    sphm_real xsph_time_s;              /* tau */
    sphm_real fibre_steering;           /* beta */
    sphm_real shape_matching_rad_per_s; /* omega */
    sphm_real shape_matching_floor;     /* l_i */
    sphm_real pair_matching_Pa;         /* shear modulus of the pair clusters */
    sphm_real gravity_m_per_s2[3];
} sphm_fluid_constants;

/* Pressure without its electrical part (12): each particle against its own rest density. */
SPHM_FN sphm_real sphm_fluid_pressure(const sphm_fluid_constants *c, sphm_real density,
                                      sphm_real rest_density) {
    return c->stiffness_m2_per_s2 * (density - rest_density);
}

/* Electrical pressure, kappa max(0, Vm - Vr); 0 with the other coupling. */
SPHM_FN sphm_real sphm_fluid_electrical_pressure(const sphm_fluid_constants *c, sphm_real potential_mV) {
    const sphm_real excess = potential_mV - c->resting_mV;
    return excess > 0 ? c->electrical_Pa_per_mV * excess : 0;
}

/* k_i of (23), a rate: (omega dt)^2 within [floor, 1]. */
SPHM_FN double sphm_shape_matching_coefficient(const sphm_fluid_constants *c, double step_s) {
    const double turned = (double)c->shape_matching_rad_per_s * step_s;
    const double k =
        turned * turned > (double)c->shape_matching_floor ? turned * turned : (double)c->shape_matching_floor;
    return k < 1 ? k : 1;
}

/* Stiffness of a pair of rest neighbours a distance r apart at rest, in the manner of eq 23 with clusters of
 * two particles: the goal positions of a pair lie along its present direction, at its rest distance. A sum of
 * such pulls w(r) (|x| - r) is an isotropic elastic solid with both Lame constants equal to
 *     G = kappa/30  int w r2 dV   (bond-based peridynamics; Silling, J. Mech. Phys. Solids 48 (2000) 175).
 * With w = (1 - q)^2/q and lengths in units of h the integral is 4 pi int (1-q)^2 q3 dq = 4 pi/60, so that
 * kappa = 450 G/pi for V_i V_j in units of h6. */
#define SPHM_PAIR_STIFFNESS (450 / SPHM_PI)

/* Fibre tension T f f, as pulls along the present direction of pairs of rest neighbours that depend on the
 * angle between the pair and the fibre at rest, c = cos: V_i V_j (T_i + T_j) C w(r) (5 c2 - 1). The mean of
 * c2 n n over all directions is (2 f f + 1)/15, that of n n is 1/3: the -1 leaves nothing but f f. C follows
 * from the stress of pairwise forces, 1/2 int s r n n dV, with int (1-q)^2 dV = 4 pi/30: a quarter of the
 * factor of the spiky gradient.
 *
 * Pulls follow the fibres as they turn, act along the line between two particles (so angular momentum is
 * conserved), and do not depend on how far apart the pair is now. The usual pair form with the present grad W
 * pulls ever harder at what is nearer: neighbours clump along the fibres (tensile instability, growth rate
 * about T/mu). The rest shape's grad W with a fixed direction does not clump, but lacks the stiffness of a
 * tight string: the matrix between the fibres is compressed and a long belly buckles. Both were tried. */
#define SPHM_TENSION_STIFFNESS 0.25

/* With a slope s the part along the fibres follows the pair's stretch, 5 c2 (1 + s (|x|/r - 1)) - 1, as the
 * force of real fibres below their optimum does: springs between the pairs whose longitudinal modulus is
 * 3/2 T 5 s <c6> = 15/14 s T. Without it nothing but pair matching ends the shortening of fibres that end at
 * the surface, and above some T/G of 3 their particles fall together. With s > 1 they push when shorter than
 * 1 - 1/s, which keeps them apart in fine fillings too. The -1 does not follow: that would have given the
 * energy T/2 |F f|2, but pairs across the fibres lost stiffness and fell together (tried). */
#define SPHM_TENSION_MODULUS (15.0 / 14)

SPHM_FN sphm_real sphm_fibre_pull(sphm_real cosine, sphm_real slope, sphm_real stretch) {
    return 5 * cosine * cosine * (1 + slope * (stretch - 1)) - 1;
}

/* Fibre steering: v <- |v| normalise(v/|v| + beta sign(v.f) f). Turns a velocity towards the fibre's line,
 * never adds speed; a velocity of 0 stays 0. Without branches and arrays, for the sake of vectorisation. */
SPHM_FN void sphm_fibre_steer(sphm_real beta, sphm_real fx, sphm_real fy, sphm_real fz, sphm_real *vx,
                              sphm_real *vy, sphm_real *vz) {
    const sphm_real x = *vx, y = *vy, z = *vz;
    const sphm_real speed2 = x * x + y * y + z * z;
    const int moving = speed2 > (sphm_real)1e-30;
    const sphm_real inverse = sphm_inverse_sqrt(moving ? speed2 : 1), speed = speed2 * inverse;
    const sphm_real along = x * fx + y * fy + z * fz;
    const sphm_real turn = along > 0 ? beta : along < 0 ? -beta : 0;
    const sphm_real tx = x * inverse + turn * fx, ty = y * inverse + turn * fy, tz = z * inverse + turn * fz;
    const sphm_real scale = speed * sphm_inverse_sqrt(tx * tx + ty * ty + tz * tz + SPHM_TINY);
    *vx = moving ? tx * scale : x;
    *vy = moving ? ty * scale : y;
    *vz = moving ? tz * scale : z;
}

#endif
