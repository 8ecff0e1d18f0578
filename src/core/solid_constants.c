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
    c.fibre_coupling = p->fibre_coupling;
    return c;
}
