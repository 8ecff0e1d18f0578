/* Membrane constants from the parameters, and the conduction_velocity preset. */
#include "core/membrane_constants.h"

#include <math.h>

/* 10-90 % width of the front u = 1/(1 + exp(x sqrt(k/(2D)))): 2 ln 9 = 4.394 lengths sqrt(2D/k). */
static const double front_factor = 4.3944491546724388;
static const double front_spacings = 4;
/* Excitation rate at which an action potential of Table 1's shape lasts about 6 ms: 30 times Table 1's. */
static const double fast_rate_per_ms = 30 * 0.175;

/* c1 = C1/(Cm (Vp - Vr)), the rate of u' = -c1 u (u - a)(u - 1), 1/ms. */
static double excitation_rate_per_ms(const sphm_parameters *p) {
    return p->excitation_rate / (p->membrane_capacitance * (p->plateau_potential - p->resting_potential));
}

/* D = sigma/(chi Cm), sigma = sigma_i sigma_e/(sigma_i + sigma_e) (eq 19). mS/uF is 1/ms. */
static double diffusion_mm2_per_ms(const sphm_parameters *p) {
    const double sigma =
        p->sigma_intracellular * p->sigma_extracellular / (p->sigma_intracellular + p->sigma_extracellular);
    return sigma / (p->surface_to_volume * p->membrane_capacitance);
}

/* Speed of the wave with recovery over that without. Recovery rises in the tail of the front already and
 * holds it back: with Table 1 by a fifth, so it cannot be left out. There is no closed form; the wave is run
 * along a line in units of sqrt(D/k) and 1/k,
 *   u' = u_xx - u (u - a)(u - 1) - (C2/C1) w,   w' = (b/k)(u - d w),
 * where D and k have dropped out, so one answer holds for every speed. 10 ms. The grid is 1/15 of the front
 * and costs 0.2 %. Returns 1 if no wave arrives. */
static double recovery_slowdown(double a, double decay_ratio, double recovery_ratio, double d) {
    enum { CELLS = 360, FIRST = 150, LAST = 270 };
    const double spacing = 0.4, step = 0.05, longest = 2000;
    double u[CELLS], w[CELLS], rate[CELLS], first = 0;
    for (int i = 0; i < CELLS; i++) {
        u[i] = 1 / (1 + exp((i * spacing - 10) / sqrt(2)));
        w[i] = 0;
    }
    for (double time = 0; time < longest; time += step) {
        if (first == 0 && u[FIRST] > 0.5)
            first = time;
        if (u[LAST] > 0.5)
            return (LAST - FIRST) * spacing / (time - first) / ((1 - 2 * a) / sqrt(2));
        for (int i = 0; i < CELLS; i++) {
            const double left = u[i > 0 ? i - 1 : i], right = u[i < CELLS - 1 ? i + 1 : i];
            rate[i] = (left - 2 * u[i] + right) / (spacing * spacing) - u[i] * (u[i] - a) * (u[i] - 1) -
                      decay_ratio * w[i];
        }
        for (int i = 0; i < CELLS; i++) {
            w[i] += step * recovery_ratio * (u[i] - d * w[i]);
            u[i] += step * rate[i];
        }
    }
    return 1;
}

/* D and a factor on all rates such that the wave runs at the wanted speed c and its front spans at least four
 * spacings. With the speed c0 = c/slowdown that the wave would have without recovery, and the width L,
 *   c0 = (1 - 2a) sqrt(k D/2), L = 4.39 sqrt(2D/k):   k = 2 * 4.39 c0/((1 - 2a) L), D = c0 L/(4.39 (1 - 2a)).
 * L is not made shorter than what gives k = fast_rate_per_ms, or fine particles would have action potentials
 * of less than a millisecond. C1, C2 and b take the same factor: the phase plane keeps its shape and only
 * time is compressed; C1 alone would leave the potential latched at its upper fixed point. */
static void scale_to_speed(sphm_membrane_constants *c, const sphm_parameters *p, double spacing_mm) {
    const double a = (double)c->threshold_fraction, rate_before = excitation_rate_per_ms(p);
    if (a >= 0.5 || rate_before <= 0)
        return; /* such a membrane carries no forward wave at any speed */
    const double slowdown = recovery_slowdown(a, p->excitation_decay / p->excitation_rate,
                                              p->recovery_rate / rate_before, p->recovery_decay);
    const double speed = p->conduction_velocity / slowdown; /* m/s is mm/ms */
    const double shortest = 2 * front_factor * speed / ((1 - 2 * a) * fast_rate_per_ms);
    const double width = fmax(front_spacings * spacing_mm, shortest);
    const double rate = 2 * front_factor * speed / ((1 - 2 * a) * width);
    const double factor = rate / rate_before;
    c->diffusion_mm2_per_ms = (sphm_real)(speed * width / (front_factor * (1 - 2 * a)));
    c->excitation_uA_per_mm2 = (sphm_real)(p->excitation_rate * factor);
    c->decay_uA_per_mm2 = (sphm_real)(p->excitation_decay * factor);
    c->recovery_rate_per_ms = (sphm_real)(p->recovery_rate * factor);
}

sphm_membrane_constants sphm_membrane_constants_from(const sphm_parameters *p, double spacing_m) {
    const double range = p->plateau_potential - p->resting_potential;
    sphm_membrane_constants c;
    c.resting_mV = (sphm_real)p->resting_potential;
    c.plateau_mV = (sphm_real)p->plateau_potential;
    c.threshold_mV = (sphm_real)p->threshold_potential;
    c.threshold_fraction = (sphm_real)((p->threshold_potential - p->resting_potential) / range);
    c.inverse_range_per_mV = (sphm_real)(1 / range);
    c.capacitance_uF_per_mm2 = (sphm_real)p->membrane_capacitance;
    c.excitation_uA_per_mm2 = (sphm_real)p->excitation_rate;
    c.decay_uA_per_mm2 = (sphm_real)p->excitation_decay;
    c.recovery_rate_per_ms = (sphm_real)p->recovery_rate;
    c.recovery_decay = (sphm_real)p->recovery_decay;
    c.diffusion_mm2_per_ms = (sphm_real)diffusion_mm2_per_ms(p);
    c.anisotropy_ratio = (sphm_real)p->anisotropy_ratio;
    c.reaction_step_ms = (sphm_real)p->reaction_step;
    c.activation_ms = (sphm_real)(p->activation_time * 1e3);
    c.deactivation_ms = (sphm_real)(p->deactivation_time * 1e3);
    if (p->conduction_velocity > 0)
        scale_to_speed(&c, p, spacing_m * 1e3);
    return c;
}

static double rate_of(const sphm_membrane_constants *c) {
    return (double)c->excitation_uA_per_mm2 * (double)c->inverse_range_per_mV /
           (double)c->capacitance_uF_per_mm2;
}

double sphm_membrane_wave_speed_mm_per_ms(const sphm_membrane_constants *c) {
    return sqrt((double)c->diffusion_mm2_per_ms * rate_of(c) / 2) * (1 - 2 * (double)c->threshold_fraction);
}

double sphm_membrane_front_width_mm(const sphm_membrane_constants *c) {
    return front_factor * sqrt(2 * (double)c->diffusion_mm2_per_ms / rate_of(c));
}
