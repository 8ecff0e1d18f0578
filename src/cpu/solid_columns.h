/* The sweeps of the solid tissue on a lattice, across particles.
 *
 * On a lattice every neighbour at the same offset has the same weights w and w X, and in an order along the
 * lattice's rows 16 particles side by side find them in 16 slots side by side. So slots are cut into slices
 * of up to 16 of one row, and a slice has, instead of 16 rows of neighbours, columns: one load a value and 16
 * neighbours, without indices or weights of their own. Most columns are in pairs, at opposite offsets and for
 * the whole slice (twins): their weights w X differ by the sign only, so the difference of the two serves
 * both. Near the surface, where one is missing for some lanes, single columns have a lane mask.
 *
 * Arrays have room on both sides for lanes that reach beyond the first and the last particle. */
#ifndef SPHM_CPU_SOLID_COLUMNS_H
#define SPHM_CPU_SOLID_COLUMNS_H

#include "core/gradient.h"
#include "cpu/lattice.h"

#ifdef __cplusplus
extern "C" {
#endif

struct sphm_solid_field;
struct sphm_solid_lines;

/* First slots of two columns, and 4 times the number of the first one's weights. */
typedef struct sphm_solid_twin {
    int32_t ahead, behind, weight;
} sphm_solid_twin;

typedef struct sphm_solid_single {
    int32_t from;           /* slot of lane 0, whether it takes part or not; may be negative */
    uint16_t lanes, weight; /* bits of those that take part; number of the weights */
} sphm_solid_single;

typedef struct sphm_solid_slice {
    int32_t slot, count; /* its first particle and how many, at most 16 */
    size_t twin, single; /* the first of each; they end where the next slice's begin */
} sphm_solid_slice;

typedef struct sphm_solid_columns {
    size_t count, slices, twins, singles, offsets, pairs;
    sphm_solid_slice *slice; /* [slices + 1] */
    sphm_solid_twin *twin;
    sphm_solid_single *single;
    sphm_real *weight; /* [4 * offsets]: w X, w Y, w Z (1/m), w (1/m2) */
    /* [count] each: u x, y, z (m), v x, y, z (m/s) */
    sphm_real *motion[6];
    /* [count] each: A row by row, then k (u + tau v); see kernels/solid_line.h */
    sphm_real *stress[12];
    /* [count] each: B (xx, xy, xz, yy, yz, zz), then the sum of w X over the single columns */
    sphm_real *constant[9];
    sphm_real *memory;
} sphm_solid_columns;

/* Columns of particles in the order of sphm_lattice_order(). Where the filling is no lattice after all, or
 * columns would be so short that rows are faster, `columns` is left zeroed: no error. */
sphm_status sphm_solid_columns_create(sphm_solid_columns *columns, const sphm_neighbours *rows,
                                      const sphm_gradient *gradient, const sphm_lattice *lattice,
                                      sphm_context *context);
void sphm_solid_columns_free(sphm_solid_columns *columns); /* a zeroed struct is fine */
size_t sphm_solid_columns_bytes(const sphm_solid_columns *columns);

/* The sweeps of solid_sweeps.h. */
void sphm_solid_columns_stress(const struct sphm_solid_field *field, struct sphm_solid_lines *lines);
void sphm_solid_columns_force(const struct sphm_solid_field *field, struct sphm_solid_lines *lines);
void sphm_solid_columns_deformation(const sphm_solid_columns *columns, size_t slot, sphm_real H[9],
                                    sphm_real rate[9]);

#ifdef __cplusplus
}
#endif
#endif
