/* Time-step limits of the solid tissue; equations in doc/solid.md, "Time". */
#include "core/solid_limits.h"

#include <math.h>

#include "kernels/end_block.h"

/* Leap-frog with a frequency w and a damping rate c (force -m w^2 u - m c v, the velocity half a step old) is
 * stable up to dt = (sqrt(c^2 + 4 w^2) - c)/w^2. w^2 is bounded by the stiffest particle times the largest
 * eigenvalue of the gradients, plus the hourglass forces'. */
sphm_time_step_limits sphm_solid_limits(const sphm_model *model, const sphm_gradient *gradient,
                                        double stiffest_Pa) {
    const sphm_parameters *p = &model->parameters;
    const double density = p->density * p->mass_scaling;
    const double eigenvalue = gradient->gradient_eigenvalue, hourglass = gradient->hourglass_eigenvalue;
    double w2 = (stiffest_Pa * eigenvalue + p->hourglass_stiffness * hourglass) / density;
    for (int end = 0; end < SPHM_END_COUNT; ++end)
        w2 += sphm_end_block_frequency2(&model->ends[end]);
    const double c =
        p->tissue_viscosity * (2 * eigenvalue + (p->hourglass_stiffness > 0 ? hourglass : 0)) / density;
    sphm_time_step_limits l;
    l.courant = l.diffusion = l.shape_matching = INFINITY;
    l.acoustic = SPHM_SOLID_STEP_SHARE * 2 / sqrt(w2);
    l.viscous = c > 0 ? SPHM_SOLID_STEP_SHARE * 2 / c : INFINITY;
    l.smallest = SPHM_SOLID_STEP_SHARE * (sqrt(c * c + 4 * w2) - c) / w2;
    return l;
}
