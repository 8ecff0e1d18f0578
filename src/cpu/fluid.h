/* The two neighbour sweeps of the fluid on the CPU.
 *
 * Positions do not change between XSPH (22) and the forces, and the summed density depends on positions only;
 * so XSPH and density share one sweep, which the paper does in two. */
#ifndef SPHM_CPU_FLUID_H
#define SPHM_CPU_FLUID_H

#include "core/neighbours.h"
#include "core/state.h"
#include "cpu/row.h"
#include "kernels/fluid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What sweeps read of the neighbours, in slot order, lengths in units of h. The velocity sweep reads the one
 * array and writes the other, so that the pressure of a block can follow while others are still at it. */
typedef struct sphm_fluid_packs {
    /* first: x y z, density of the last step; second: predicted and shape-matched velocity, unused */
    sphm_twin *predicted;
    /* moving.first: x y z, pressure; moving.second: velocity after XSPH, 1/density; third: rest position,
     * fibre tension where fibres are parallel; fourth: fibre times the root of its tension, unused (read
     * only where fibres are not parallel) */
    sphm_quad *smoothed;
    int oblique; /* fibres are not parallel */
} sphm_fluid_packs;

/* XSPH and density: reads packs predicted; writes density of the state and, of packs smoothed, the position
 * and the velocity. */
void sphm_fluid_sweep_velocity(const sphm_fluid_constants *constants, const sphm_neighbours *rows,
                               sphm_fluid_packs *packs, sphm_state *state, double step_s, size_t begin,
                               size_t end);
/* Pressure (12) with its electrical part, and what the force sweep reads of a particle. */
void sphm_fluid_set_pressure(const sphm_fluid_constants *constants, sphm_fluid_packs *packs,
                             sphm_state *state, size_t begin, size_t end);
/* Pressure (10), viscosity (11), pair matching and fibre tension: writes the acceleration of the state. */
void sphm_fluid_sweep_forces(const sphm_fluid_constants *constants, const sphm_neighbours *rows,
                             const sphm_fluid_packs *packs, sphm_state *state, size_t begin, size_t end);

#ifdef __cplusplus
}
#endif
#endif
