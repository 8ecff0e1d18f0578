/* Filling a closed-ish surface with particles on a lattice. */
#ifndef SPHM_CORE_FILLING_H
#define SPHM_CORE_FILLING_H

#include "core/winding.h"
#include "sph_muscle/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The count asked for is met within this share. */
#define SPHM_COUNT_TOLERANCE 0.01

/* Cubes of a fine filling, about: a mesh's line of action and the sections of one with holes are found on
 * them. Two scanned muscles take 1.1 and 1.4 s of one core; 100,000 cubes take 1.7 and 2.2 s, for a line 0.1
 * and 2.7 mm longer; 30,000 miss a thin tail of one of them (387 of 441 mm). */
#define SPHM_FINE_CUBES 60000

/* What to fill and how. `frame` holds the lattice's directions in its rows (orthonormal). */
typedef struct sphm_filling_task {
    const sphm_surface *surface;
    const sphm_winding *winding;
    double volume_m3;
    double frame[3][3];
    /* Places along frame[0], m. A layer of the lattice lies SPHM_CLAMP_DEPTH layers inside each of them;
     * cells are then a little longer or shorter in this direction. Equal: a cubic lattice anywhere. */
    double sections_m[2];
    int64_t particles; /* asked for */
    int64_t threads;   /* 0: all; no influence on the result */
} sphm_filling_task;

typedef struct sphm_filling {
    size_t count;
    double spacing_m;    /* cube root of a cell's volume */
    double step_m[3][3]; /* from a site to the next one in the lattice's directions, a row each */
    double *positions;   /* [3 * count] */
    uint8_t *outer;      /* [count], 1 where one of the six lattice neighbours is missing */
    size_t strays;       /* lattice sites inside, but apart from the rest, left out */
} sphm_filling;

/* A lattice whose spacing is such that the count is met. Refuses (SPHM_REFUSED_GEOMETRY) a count that no
 * spacing and no offset of the lattice meets, naming the nearest one found. */
sphm_status sphm_filling_create(const sphm_filling_task *task, sphm_filling *filling, sphm_context *context);
/* About SPHM_FINE_CUBES cubes: what is found on them is the shape's, however many particles it is filled
 * with. Reads neither task->particles nor the sections. Refuses (SPHM_REFUSED_GEOMETRY) a surface that no
 * cube lies in. */
sphm_status sphm_filling_create_fine(const sphm_filling_task *task, sphm_filling *filling,
                                     sphm_context *context);
/* A box centred on the origin, along x, y, z, filled by nx ny nz particles in the middles of equal cells. */
sphm_status sphm_filling_create_bar(const double side_m[3], int64_t particles, sphm_filling *filling,
                                    sphm_context *context);
/* Moves every particle by up to `jitter` spacings in each direction of x, y, z; where that would lead out of
 * the surface the particle is moved otherwise or not at all. */
void sphm_filling_jitter(sphm_filling *filling, const sphm_winding *winding, double jitter, uint64_t seed,
                         int64_t threads);
void sphm_filling_free(sphm_filling *filling);

#ifdef __cplusplus
}
#endif
#endif
