/* The two sweeps of the solid tissue over the rest neighbours, and the lines of memory they share.
 *
 *   stress sweep   reads `motion`, activation; writes `stress`, density and pressure
 *   force sweep    reads `stress`; writes `force`
 *
 * Lines are per particle and interleaved, so that a pair costs one or two contiguous loads of whole lines and
 * the arithmetic runs across the components of a matrix instead of across particles: no gathers. */
#ifndef SPHM_CPU_SOLID_SWEEPS_H
#define SPHM_CPU_SOLID_SWEEPS_H

#include "core/gradient.h"
#include "kernels/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPHM_MOTION_LINE 8
#define SPHM_STRESS_LINE 16

typedef struct sphm_solid_lines {
    size_t count;
    sphm_real *motion; /* [8 * count]: displacement (m), 0, velocity (m/s), 0 */
    /* [16 * count]: the three columns of A = P B - k/2 (H + tau Hdot), each x, y, z, 0, with H = F - 1; then
     * k (u + tau v), 0. k: hourglass stiffness, tau: hourglass damping time. */
    sphm_real *stress;
    sphm_real *force;         /* [4 * count]: N, 0 */
    double *block_modulus_Pa; /* [blocks]: stiffest particle of each block */
    int32_t *block_inverted;  /* [blocks]: first slot with J <= 0, or -1 */
} sphm_solid_lines;

typedef struct sphm_solid_field {
    const sphm_neighbours *rows;
    const sphm_gradient *gradient;
    const sphm_real *fibre_x, *fibre_y, *fibre_z, *activation; /* [count] */
    sphm_real *density, *pressure; /* [count], kg/m3 and Pa; written by the stress sweep */
    sphm_solid_constants constants;
    sphm_real viscosity_Pa_s, hourglass_Pa, hourglass_time_s, particle_volume_m3, density_kg_per_m3;
    int threads;
} sphm_solid_field;

sphm_status sphm_solid_lines_create(sphm_solid_lines *lines, size_t count, sphm_context *context);
void sphm_solid_lines_free(sphm_solid_lines *lines); /* a zeroed struct is fine */

void sphm_solid_stress_sweep(const sphm_solid_field *field, sphm_solid_lines *lines);
void sphm_solid_force_sweep(const sphm_solid_field *field, sphm_solid_lines *lines);

/* F - 1 and its rate at one particle, row by row. */
void sphm_solid_deformation(const sphm_solid_field *field, const sphm_solid_lines *lines, size_t slot,
                            sphm_real H[9], sphm_real rate[9]);

#ifdef __cplusplus
}
#endif
#endif
