/* From a particle's deformation to what its neighbours read of it (doc/solid.md):
 *     A = q P B - k/2 (H + tau Hdot),   H = F - 1
 * with P the whole stress, viscosity included, q the particle's rest volume over the mean, B the particle's
 * gradient correction, k and tau the stiffness and damping time of the hourglass control. */
#ifndef SPHM_KERNELS_SOLID_LINE_H
#define SPHM_KERNELS_SOLID_LINE_H

#include "kernels/solid.h"

typedef struct sphm_solid_tissue {
    sphm_solid_constants constants;
    sphm_real viscosity_Pa_s, hourglass_Pa, hourglass_time_s, density_kg_per_m3;
} sphm_solid_tissue;

typedef struct sphm_solid_result {
    sphm_real A[9], J, pressure_Pa, modulus_Pa;
    sphm_real fibre_rate; /* of the stretch, filtered, 1/s */
} sphm_solid_result;

/* `fibre_rate`: the filtered rate before, which goes `rate_share` of the way to the present one. `b`: B as
 * xx, xy, xz, yy, yz, zz. */
SPHM_FN void sphm_solid_evaluate(const sphm_solid_tissue *t, const sphm_real H[9], const sphm_real rate[9],
                                 const sphm_real f0[3], sphm_real activation, sphm_real fibre_rate,
                                 sphm_real rate_share, sphm_real relative_volume, const sphm_real b[6],
                                 sphm_solid_result *result) {
    sphm_real F[9], P[9];
    sphm_fibre_stress fibre;
    for (int d = 0; d < 9; ++d)
        F[d] = H[d] + (sphm_real)(d % 4 == 0);
    result->fibre_rate = fibre_rate + rate_share * (sphm_solid_stretch_rate(F, rate, f0) - fibre_rate);
    const sphm_real pulling = activation * sphm_solid_force_velocity(result->fibre_rate, &t->constants);
    const sphm_real J = sphm_solid_stress(F, f0, pulling, &t->constants, P, &fibre);
    sphm_solid_add_viscous_stress(F, rate, t->viscosity_Pa_s, 1 / J, P);
    sphm_real trace = 0; /* of P F^T = J sigma */
    for (int d = 0; d < 9; ++d)
        trace += P[d] * F[d];
    result->J = J;
    result->pressure_Pa = trace / (-3 * J) + t->constants.surface_Pa; /* of the tissue proper */
    result->modulus_Pa = sphm_solid_wave_modulus(F, J, f0, &fibre, &t->constants) +
                         t->constants.rate_stiffness_Pa * activation;
    for (int d = 0; d < 9; ++d)
        P[d] *= relative_volume;
    const sphm_real half_k = t->hourglass_Pa / 2, tau = t->hourglass_time_s;
    for (int r = 0; r < 9; r += 3) {
        result->A[r] = P[r] * b[0] + P[r + 1] * b[1] + P[r + 2] * b[2] - half_k * (H[r] + tau * rate[r]);
        result->A[r + 1] =
            P[r] * b[1] + P[r + 1] * b[3] + P[r + 2] * b[4] - half_k * (H[r + 1] + tau * rate[r + 1]);
        result->A[r + 2] =
            P[r] * b[2] + P[r + 1] * b[4] + P[r + 2] * b[5] - half_k * (H[r + 2] + tau * rate[r + 2]);
    }
}

#endif
