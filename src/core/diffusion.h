/* Diffusion of the membrane potential: one weight per neighbour pair, so that
 *     dVm_i/dt = sum_j weight_ij (Vm_j - Vm_i)
 * is div(D grad Vm) with no flux through the surface. Reads positions, fibres and neighbour rows; built once
 * after each rebuild of the lists and used by every sweep until the next one. */
#ifndef SPHM_CORE_DIFFUSION_H
#define SPHM_CORE_DIFFUSION_H

#include "core/neighbours.h"
#include "sph_muscle/parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What the weights are made from. The arrays are borrowed for the call, in slot order, [count]. */
typedef struct sphm_diffusion_input {
    int laplacian;           /* SPHM_LAPLACIAN_... */
    double support_radius_m; /* h: pairs farther apart get weight 0 */
    double particle_volume_m3;
    double diffusion_mm2_per_ms;                  /* D along the fibre */
    double anisotropy_ratio;                      /* D along over across */
    const sphm_real *x, *y, *z;                   /* m */
    const sphm_real *fibre_x, *fibre_y, *fibre_z; /* unit vectors; read only where the ratio is not 1 */
} sphm_diffusion_input;

/* Values a particle in the scratch array. */
#define SPHM_DIFFUSION_SCRATCH 10

typedef struct sphm_diffusion {
    sphm_real *weight;     /* parallel to neighbours->slot, 1/ms; symmetric to the bit; 0 in the padding */
    size_t capacity;       /* of weight */
    sphm_real *scratch;    /* [SPHM_DIFFUSION_SCRATCH * particles], of the build */
    size_t particles;      /* capacity of scratch, in particles */
    double stable_step_ms; /* forward Euler is stable up to here (infinite without neighbours) */
    size_t fallbacks;      /* particles where the six equations were singular and the scalar form stands in */
    size_t negative;       /* pairs with a negative weight (counted from both sides) */
} sphm_diffusion;

/* A zeroed struct is an empty one. Builds the weights anew with `threads` threads (at least 1; the result is
 * bitwise the same for any number); grows the arrays where they are too short. On anything but SPHM_OK (out
 * of memory) the old weights are gone. */
sphm_status sphm_diffusion_build(sphm_diffusion *diffusion, const sphm_neighbours *neighbours,
                                 const sphm_diffusion_input *input, int threads, sphm_context *context);
void sphm_diffusion_free(sphm_diffusion *diffusion);

#ifdef __cplusplus
}
#endif
#endif
