/* From parameters to the constants of the solid tissue's kernels. */
#include "core/solid_constants.h"

sphm_solid_constants sphm_solid_constants_from(const sphm_parameters *p) {
    sphm_solid_constants c;
    c.along_fibre_shear_Pa = (sphm_real)p->along_fibre_shear;
    c.cross_fibre_shear_Pa = (sphm_real)p->cross_fibre_shear;
    c.bulk_Pa = (sphm_real)p->bulk_modulus;
    c.max_isometric_stress_Pa = (sphm_real)p->max_isometric_stress;
    c.optimal_stretch = (sphm_real)p->optimal_fibre_stretch;
    c.passive_linear_stretch = (sphm_real)p->passive_linear_stretch;
    c.passive_coefficient = (sphm_real)p->passive_coefficient;
    c.passive_exponent = (sphm_real)p->passive_exponent;
    c.passive_compressive_Pa = (sphm_real)p->passive_compressive_stiffness;
    c.surface_Pa = (sphm_real)p->surface_pressure;
    c.fibre_coupling = p->fibre_coupling;
    const int hill = p->force_velocity == SPHM_FORCE_VELOCITY_HILL;
    const double speed = p->optimal_fibre_stretch * p->shortening_speed_max;
    c.inverse_speed_s = (sphm_real)(hill ? 1 / speed : 0);
    c.inverse_curvature = (sphm_real)(1 / p->hill_curvature);
    c.eccentric_gain = (sphm_real)(p->eccentric_force - 1);
    /* d/d(rate) of the active stress at rate 0, where it is steepest, over the filter's time. */
    c.rate_stiffness_Pa =
        (sphm_real)(hill ? p->max_isometric_stress * (1 + 1 / p->hill_curvature) / (speed * p->rate_filter)
                         : 0);
    return c;
}
