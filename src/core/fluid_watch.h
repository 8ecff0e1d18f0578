/* What every back end of the fluid watches: how long a step may be, when rows are out of date, which states
 * have run away, and how a state that is not finite is described. */
#ifndef SPHM_CORE_FLUID_WATCH_H
#define SPHM_CORE_FLUID_WATCH_H

#include "core/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Skin of the neighbour rows over h; rows are valid until a particle moved half of it. A step moves particles
 * by some thousandths of h at most, so that rows last for tens of steps; each hundredth costs 3 % more pairs
 * and memory. */
#define SPHM_FLUID_SKIN 0.03

/* Spacings that a particle may go in a step (9). */
#define SPHM_FLUID_COURANT 0.4

/* speed: of the fastest particle. rest_density_min: the smallest summed density of the rest shape. */
sphm_time_step_limits sphm_fluid_limits(const sphm_model *model, double speed_m_per_s,
                                        double rest_density_min);
/* Particles that nearly coincide make the diffusion's weights, and with them the number of sub-steps, as
 * large as one likes: SPHM_FAILED_NONFINITE where sub-steps must be far shorter than on the rest shape. */
sphm_status sphm_fluid_refuse_clumps(double stable_step_ms, double rest_stable_step_ms, double time_s,
                                     sphm_context *context);
/* "particle 12 in stage 'forces' at ...". stage: of sphm_fluid_bad_stage(), the first that was not finite,
 * and of its particles the first by id (-1: none is known). bad: particles that are not finite. */
void sphm_fluid_describe_nonfinite(int32_t particle, int stage, double time_s, uint64_t steps, size_t bad,
                                   char *text, size_t size);
int sphm_fluid_fibres_are_parallel(const sphm_body *body);

#ifdef __cplusplus
}
#endif
#endif
