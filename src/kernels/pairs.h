/* What a neighbour adds to a particle's sums (pairs.inc), one neighbour at a time; and the factors that do
 * not depend on the neighbour. */
#ifndef SPHM_KERNELS_PAIRS_H
#define SPHM_KERNELS_PAIRS_H

#include "kernels/fluid.h"
#include "kernels/pack.h"

/* Factors of the forces that do not depend on the particle. */
typedef struct sphm_force_factors {
    sphm_real pressure, viscosity, tension, slope, pair;
} sphm_force_factors;

/* What of a particle its own force needs. */
typedef struct sphm_force_own {
    sphm_pack p, v, r, tension, fibre; /* as the neighbours' */
    sphm_real pressure, viscosity;     /* factors over its density */
} sphm_force_own;

/* Without rest shape, with parallel fibres, with fibres that differ. */
enum { SPHM_FORCE_FLUID_ONLY, SPHM_FORCE_PARALLEL_FIBRES, SPHM_FORCE_OBLIQUE_FIBRES };

SPHM_FN int sphm_force_kind(const sphm_fluid_constants *c, int oblique) {
    if (!(c->pair_matching_Pa > 0) && !(c->fibre_tension_Pa > 0))
        return SPHM_FORCE_FLUID_ONLY;
    return oblique ? SPHM_FORCE_OBLIQUE_FIBRES : SPHM_FORCE_PARALLEL_FIBRES;
}

SPHM_FN sphm_force_factors sphm_force_factors_of(const sphm_fluid_constants *c) {
    const double h = (double)c->support_radius_m, m = (double)c->mass_kg;
    const double volume = m / (double)c->density_kg_per_m3;
    sphm_force_factors f;
    f.pressure = (sphm_real)(m * sphm_spiky_factor(h));
    f.viscosity = (sphm_real)((double)c->viscosity_Pa_s * m * sphm_viscosity_factor(h));
    f.tension = (sphm_real)((double)f.pressure * SPHM_TENSION_STIFFNESS);
    f.slope = c->tension_slope;
    f.pair = (sphm_real)((double)c->pair_matching_Pa * SPHM_PAIR_STIFFNESS * volume * volume /
                         (m * h * h * h * h));
    return f;
}

/* m W(0): what sums of W over W(0) are multiplied by. */
SPHM_FN sphm_real sphm_smooth_unit(const sphm_fluid_constants *c) {
    return (sphm_real)((double)c->mass_kg * sphm_poly6_factor((double)c->support_radius_m));
}

/* epsilon of (22) */
SPHM_FN sphm_real sphm_smooth_mixing(const sphm_fluid_constants *c, double step_s) {
    return (sphm_real)(-expm1(-step_s / (double)c->xsph_time_s));
}

#define NUMBER sphm_real
#define PACK sphm_pack
#define NAMED(name) name
#define POSITIVE(a) ((a) > 0 ? (a) : 0)
#define INVERSE(a) (1 / (a))
#define INVERSE_SQRT(a) sphm_inverse_sqrt(a)
#include "kernels/pairs.inc"

#endif
