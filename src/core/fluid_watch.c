/* See fluid_watch.h. */
#include "core/fluid_watch.h"

#include <math.h>
#include <stdio.h>

#include "core/context.h"
#include "kernels/fluid_motion.h"

/* A diffusion that needs shorter sub-steps than this share of those at rest is a state that ran away; the
 * same share as for the speed in muscle.c. It also bounds what one step may take. */
#define RUNAWAY_SHARE 0.01

sphm_time_step_limits sphm_fluid_limits(const sphm_model *model, double speed_m_per_s,
                                        double rest_density_min) {
    const sphm_fluid_constants *c = &model->fluid;
    const double h = (double)c->support_radius_m;
    /* Sound: pressure, the longitudinal waves of the pair clusters with modulus 3 G, and what fibres at full
     * activation add to it where their tension grows with their length. */
    const double elastic_Pa = 3 * (double)c->pair_matching_Pa +
                              SPHM_TENSION_MODULUS * (double)c->tension_slope * (double)c->fibre_tension_Pa;
    const double sound = sqrt((double)c->stiffness_m2_per_s2 + elastic_Pa / (double)c->density_kg_per_m3);
    sphm_time_step_limits l;
    l.courant = speed_m_per_s > 0 ? SPHM_FLUID_COURANT * model->body.spacing_m / speed_m_per_s : INFINITY;
    l.acoustic = 0.4 * h / sound;
    l.viscous =
        c->viscosity_Pa_s > 0 ? 0.06 * h * h * rest_density_min / (double)c->viscosity_Pa_s : INFINITY;
    l.diffusion = INFINITY; /* the membrane divides a step as its diffusion needs it */
    l.shape_matching = c->shape_matching_rad_per_s > 0 ? 1 / (double)c->shape_matching_rad_per_s : INFINITY;
    l.smallest = fmin(fmin(l.courant, l.acoustic), fmin(l.viscous, l.shape_matching));
    return l;
}

sphm_status sphm_fluid_refuse_clumps(double stable_step_ms, double rest_stable_step_ms, double time_s,
                                     sphm_context *context) {
    if (stable_step_ms >= RUNAWAY_SHARE * rest_stable_step_ms)
        return SPHM_OK;
    return sphm_fail(context, SPHM_FAILED_NONFINITE,
                     "the state ran away at %.6g s: particles are so close to one another that the diffusion "
                     "may take sub-steps of %.3g ms only instead of %.3g ms",
                     time_s, stable_step_ms, rest_stable_step_ms);
}

void sphm_fluid_describe_nonfinite(int32_t particle, int stage, double time_s, uint64_t steps, size_t bad,
                                   char *text, size_t size) {
    static const char *const stages[SPHM_FLUID_FINITE + 1] = {"position", "prediction and shape matching",
                                                              "XSPH",     "density",
                                                              "pressure", "forces",
                                                              "membrane", "integration",
                                                              "unknown"};
    snprintf(text, size, "particle %d in stage '%s' at %.6g s (step %llu), %zu particles in all",
             (int)particle, stages[stage], time_s, (unsigned long long)steps, bad);
}

int sphm_fluid_fibres_are_parallel(const sphm_body *body) {
    for (size_t i = 1; i < body->count; ++i)
        for (size_t d = 0; d < 3; ++d)
            if ((sphm_real)body->fibres[3 * i + d] != (sphm_real)body->fibres[d])
                return 0;
    return 1;
}
