/* The material at a particle, as both kinds of sweeps evaluate it: what comes before sphm_solid_evaluate().
 */
#ifndef SPHM_CPU_SOLID_MATERIAL_H
#define SPHM_CPU_SOLID_MATERIAL_H

#include "cpu/row.h"
#include "cpu/solid_sweeps.h"
#include "kernels/solid_line.h"

/* H = S B of a symmetric B, with column c of S in sum[3 * c]. */
SPHM_INLINE void sphm_solid_correct_sums(const sphm_real sum[9], const sphm_real B[6], sphm_real H[9]) {
    _Pragma("GCC unroll 3") for (int r = 0; r < 3; ++r) {
        const sphm_real x = sum[r], y = sum[3 + r], z = sum[6 + r];
        H[3 * r] = x * B[0] + y * B[1] + z * B[2];
        H[3 * r + 1] = x * B[1] + y * B[3] + z * B[4];
        H[3 * r + 2] = x * B[2] + y * B[4] + z * B[5];
    }
}

SPHM_INLINE sphm_solid_tissue sphm_solid_tissue_of(const sphm_solid_field *field) {
    sphm_solid_tissue t;
    t.constants = field->constants;
    t.viscosity_Pa_s = field->viscosity_Pa_s;
    t.hourglass_Pa = field->hourglass_Pa;
    t.hourglass_time_s = field->hourglass_time_s;
    t.density_kg_per_m3 = field->density_kg_per_m3;
    return t;
}

#endif
