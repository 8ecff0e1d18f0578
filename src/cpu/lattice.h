/* The lattice that particles were filled in on, found again from their positions, and the slot order that
 * follows it: neighbours at the same offset then lie at the same distance in memory, row by row. */
#ifndef SPHM_CPU_LATTICE_H
#define SPHM_CPU_LATTICE_H

#include "core/neighbours.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_lattice {
    size_t count;
    int32_t *site;   /* [3 * count], by slot; the first number runs along the most sites. NULL: no lattice */
    double rounding; /* of a position, as a share of the spacing */
} sphm_lattice;

/* `rows` are those of particles at `position` (x, y, z; slot order). Sites are found from one particle's
 * nearest neighbours: any three directions will do, at any angle. Positions that do not fit them (jitter) are
 * no error: `site` is then NULL. */
sphm_status sphm_lattice_find(sphm_lattice *lattice, const sphm_neighbours *rows,
                              const sphm_real *const position[3], sphm_context *context);
void sphm_lattice_free(sphm_lattice *lattice); /* a zeroed struct is fine */

/* order[new slot] = old slot: along the rows of the lattice, which has sites. */
sphm_status sphm_lattice_order(const sphm_lattice *lattice, int32_t *order, sphm_context *context);
/* Puts the sites into that order. `scratch`: 3 * count. */
void sphm_lattice_permute(sphm_lattice *lattice, const int32_t *order, int32_t *scratch);

#ifdef __cplusplus
}
#endif
#endif
