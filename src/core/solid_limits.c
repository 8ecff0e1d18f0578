/* Time-step limits of the solid tissue; equations in doc/solid.md, "Time". */
#include "core/solid_limits.h"

#include <math.h>

#include "kernels/end_block.h"

/* Leap-frog with a frequency w and a damping rate c (force -m w^2 u - m c v, the velocity half a step old).
 */
static double stable_step(double w2, double c) {
    return (sqrt(c * c + 4 * w2) - c) / w2;
}

/* w^2 and c are sums over u, each term bounded by its eigenvalue: the stiffest particle times that of |grad
 * u|^2, the hourglass forces, and what (div u)^2 may exceed |grad u|^2 by. The last takes motions that have
 * next to no hourglass; all others have c to the full. */
sphm_time_step_limits sphm_solid_limits(const sphm_model *model, const sphm_gradient *gradient,
                                        double stiffest_Pa) {
    const sphm_parameters *p = &model->parameters;
    const double density = p->density * p->mass_scaling;
    const double eigenvalue = gradient->gradient_eigenvalue, hourglass = gradient->hourglass_eigenvalue;
    const double excess = fmax(0, gradient->divergence_eigenvalue - eigenvalue);
    double w2 = (stiffest_Pa * eigenvalue + p->hourglass_stiffness * hourglass) / density;
    for (int end = 0; end < SPHM_END_COUNT; ++end)
        w2 += sphm_end_block_frequency2(&model->ends[end]);
    const double bulk_w2 = w2 + p->bulk_modulus * excess / density;
    const double bulk_c = p->tissue_viscosity * 2 * eigenvalue / density;
    const double c = bulk_c + (p->hourglass_stiffness > 0 ? p->tissue_viscosity * hourglass / density : 0);
    sphm_time_step_limits l;
    l.courant = l.diffusion = l.shape_matching = INFINITY;
    l.acoustic = SPHM_SOLID_STEP_SHARE * 2 / sqrt(bulk_w2);
    l.viscous = c > 0 ? SPHM_SOLID_STEP_SHARE * 2 / c : INFINITY;
    l.smallest = SPHM_SOLID_STEP_SHARE * fmin(stable_step(w2, c), stable_step(bulk_w2, bulk_c));
    return l;
}
