/* The two sweeps of the solid tissue over the rest neighbours, and the lines of memory they share. On a
 * lattice they go over columns instead (solid_columns.h), which take a fraction of the time.
 *
 *   stress sweep   reads the motion, activation; writes `wide`, `stress`, density and pressure
 *   force sweep    reads `stress`; writes `force`
 *
 * Lines are per particle and interleaved, so that a pair costs one load of a whole line and the arithmetic
 * runs across the components of a matrix instead of across particles: no gathers. What a pair needs beside
 * the two lines is its weight: X_ij comes with the lines, in lanes that would be padding. Storing w X_ij for
 * every pair (20 bytes a pair instead of 8) saves an operation a pair, but then the sweeps wait for memory.
 */
#ifndef SPHM_CPU_SOLID_SWEEPS_H
#define SPHM_CPU_SOLID_SWEEPS_H

#include "core/gradient.h"
#include "cpu/solid_columns.h"
#include "kernels/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPHM_STRESS_LINE 16
/* Particles whose material is evaluated together: their matrices stay in the first-level cache. */
#define SPHM_SOLID_BATCH 64
/* Slices of columns that a thread takes at a time. */
#define SPHM_SOLID_CHUNK 4

/* A neighbour: its slot, and the pair weight w_ij (1/m2). */
typedef struct sphm_solid_pair {
    int32_t slot;
    sphm_real weight;
} sphm_solid_pair;

typedef struct sphm_solid_lines {
    size_t count;
    size_t blocks;              /* of block_modulus_Pa and block_inverted */
    sphm_solid_columns columns; /* in use where columns.slice is there; then there are no rows and no lines */
    size_t stride;              /* count, rounded up to whole batches of the stress sweep */
    size_t pairs;
    size_t *row_start;     /* [count + 1], even; rows are padded with the particle itself, weight 0 */
    sphm_solid_pair *pair; /* [pairs] */
    /* [9 * stride]: B (xx, xy, xz, yy, yz, zz), then sum_j w_ij X_ij, component by component */
    sphm_real *constant;
    sphm_real *wide; /* [16 * count]: u, X, u, Y, u, Z, v, 0, with the rest position X, Y, Z */
    /* [16 * count]: the three columns of A = q P B - k/2 (H + tau Hdot), each x, y, z, with H = F - 1, and
     * after them X, Y, Z; then k (u + tau v), 0. k: hourglass stiffness, tau: hourglass damping time. */
    sphm_real *stress;
    sphm_real *force[3];      /* [count] each, x, y, z: N */
    double *block_modulus_Pa; /* [blocks]: stiffest particle of each */
    int32_t *block_inverted;  /* [blocks]: first slot with J <= 0, or -1 */
} sphm_solid_lines;

typedef struct sphm_solid_field {
    const sphm_real *fibre_x, *fibre_y, *fibre_z, *activation; /* [count] */
    const sphm_real *relative_volume;                          /* [count] */
    const sphm_real *shift[3], *velocity[3]; /* [count] each, x, y, z: displacement (m), velocity (m/s) */
    sphm_real *density, *pressure;           /* [count], kg/m3 and Pa; written by the stress sweep */
    /* [count], 1/s, or NULL without force-velocity: the filtered rate of the fibres' stretch. The stress
     * sweep moves it this share of the way to the present rate before it uses it. */
    sphm_real *fibre_rate;
    sphm_real rate_share;
    sphm_solid_constants constants;
    sphm_real viscosity_Pa_s, hourglass_Pa, hourglass_time_s, particle_volume_m3, density_kg_per_m3;
    int threads;
} sphm_solid_field;

/* Columns where `lattice` (or NULL) has sites, in the order of which the slots then are, and columns pay.
 * Else lines of particles at rest at x, y, z (slot order). Nothing is borrowed. */
sphm_status sphm_solid_lines_create(sphm_solid_lines *lines, const sphm_neighbours *rows,
                                    const sphm_gradient *gradient, const sphm_real *x, const sphm_real *y,
                                    const sphm_real *z, const sphm_lattice *lattice, sphm_context *context);
void sphm_solid_lines_free(sphm_solid_lines *lines); /* a zeroed struct is fine */

void sphm_solid_stress_sweep(const sphm_solid_field *field, sphm_solid_lines *lines);
void sphm_solid_force_sweep(const sphm_solid_field *field, sphm_solid_lines *lines);

size_t sphm_solid_lines_bytes(const sphm_solid_lines *lines);

/* F - 1 and its rate at one particle, row by row, at the last stress sweep. */
void sphm_solid_deformation(const sphm_solid_lines *lines, size_t slot, sphm_real H[9], sphm_real rate[9]);

#ifdef __cplusplus
}
#endif
#endif
