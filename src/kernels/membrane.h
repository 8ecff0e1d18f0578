/* The membrane at a point: FitzHugh-Nagumo in its original form (section 3.6, eqs 24-27, Table 1).
 *
 *   u        = (Vm - Vr)/(Vp - Vr),  a = (Vth - Vr)/(Vp - Vr)
 *   Iion     = C1 u (u - a)(u - 1) + C2 w          uA/mm2
 *   dVm/dt   = (Iext - Iion)/Cm                    mV/ms (the diffusion is in kernels/diffusion.h)
 *   dw/dt    = b (u - d w)                         1/ms
 *
 * FitzHugh, Biophys. J. 1 (1961) 445; Nagumo et al., Proc. IRE 50 (1962) 2061. The form of Rogers and
 * McCulloch (C2 u w) is not offered: with the constants of Table 1 it rests at -22 mV for ever. */
#ifndef SPHM_KERNELS_MEMBRANE_H
#define SPHM_KERNELS_MEMBRANE_H

#include "kernels/qualifiers.h"

/* mm, ms, mV, uA, uF; made by sphm_membrane_constants_from() in core/membrane_constants.c. */
typedef struct sphm_membrane_constants {
    sphm_real resting_mV, plateau_mV, threshold_mV;
    sphm_real threshold_fraction;     /* a = (Vth - Vr)/(Vp - Vr) */
    sphm_real inverse_range_per_mV;   /* 1/(Vp - Vr) */
    sphm_real capacitance_uF_per_mm2; /* Cm */
    sphm_real excitation_uA_per_mm2;  /* C1 */
    sphm_real decay_uA_per_mm2;       /* C2 */
    sphm_real recovery_rate_per_ms;   /* b */
    sphm_real recovery_decay;         /* d */
    sphm_real diffusion_mm2_per_ms;   /* D along the fibre */
    sphm_real anisotropy_ratio;       /* D along over across */
    sphm_real reaction_step_ms;       /* longest sub-step */
    sphm_real activation_ms, deactivation_ms;
} sphm_membrane_constants;

/* What drives one particle: a current, and the range in which an electrode holds its potential. Unbounded
 * where nothing drives. */
typedef struct sphm_membrane_drive {
    sphm_real current_uA_per_mm2, lower_mV, upper_mV;
} sphm_membrane_drive;

/* How far below rest a driven electrode may pull the potential. 8000 uA/mm2, the paper's current, is some
 * 2e7 times the threshold and would drive Vm to kilovolts within one step. */
#define SPHM_ELECTRODE_UNDERSHOOT_MV 10

SPHM_FN sphm_real sphm_membrane_clamp(sphm_real value, sphm_real lower, sphm_real upper) {
    const sphm_real above = value > lower ? value : lower;
    return above < upper ? above : upper;
}

/* dVm/dt without diffusion, mV/ms. */
SPHM_FN sphm_real sphm_membrane_rate(const sphm_membrane_constants *c, sphm_real u, sphm_real w,
                                     sphm_real current_uA_per_mm2) {
    const sphm_real ionic =
        c->excitation_uA_per_mm2 * u * (u - c->threshold_fraction) * (u - 1) + c->decay_uA_per_mm2 * w;
    return (current_uA_per_mm2 - ionic) / c->capacitance_uF_per_mm2;
}

/* One step of Heun's method (second order), the potential kept between the bounds in both stages. The
 * paper's forward Euler (eq 27) needs steps some ten times shorter for the same wave speed. */
SPHM_FN void sphm_membrane_advance(const sphm_membrane_constants *c, sphm_membrane_drive drive,
                                   sphm_real step_ms, sphm_real *potential_mV, sphm_real *recovery) {
    const sphm_real v0 = *potential_mV, w0 = *recovery;
    const sphm_real u0 = (v0 - c->resting_mV) * c->inverse_range_per_mV;
    const sphm_real v_rate0 = sphm_membrane_rate(c, u0, w0, drive.current_uA_per_mm2);
    const sphm_real w_rate0 = c->recovery_rate_per_ms * (u0 - c->recovery_decay * w0);

    const sphm_real v1 = sphm_membrane_clamp(v0 + step_ms * v_rate0, drive.lower_mV, drive.upper_mV);
    const sphm_real w1 = w0 + step_ms * w_rate0;
    const sphm_real u1 = (v1 - c->resting_mV) * c->inverse_range_per_mV;
    const sphm_real v_rate1 = sphm_membrane_rate(c, u1, w1, drive.current_uA_per_mm2);
    const sphm_real w_rate1 = c->recovery_rate_per_ms * (u1 - c->recovery_decay * w1);

    const sphm_real half = step_ms * (sphm_real)0.5;
    *potential_mV = sphm_membrane_clamp(v0 + half * (v_rate0 + v_rate1), drive.lower_mV, drive.upper_mV);
    *recovery = w0 + half * (w_rate0 + w_rate1);
}

/* The activation an unchanging potential leads to: max(0, (Vm - Vth)/(Vp - Vth)), at most 1. That of a
 * potential which is not finite is NaN, where the clamp alone would make it 0: what goes wrong in the
 * membrane reaches the tissue, whose watch stops the muscle. */
SPHM_FN sphm_real sphm_activation_target(const sphm_membrane_constants *c, sphm_real potential_mV) {
    return sphm_membrane_clamp((potential_mV - c->threshold_mV) / (c->plateau_mV - c->threshold_mV), 0, 1) +
           potential_mV * 0;
}

/* First-order filter towards the target. rise and fall are 1 - exp(-dt/tau) of the two time constants, so
 * that the exponential is met exactly whatever the step. */
SPHM_FN sphm_real sphm_activation_filter(sphm_real activation, sphm_real target, sphm_real rise,
                                         sphm_real fall) {
    const sphm_real gap = target - activation;
    return activation + gap * (gap > 0 ? rise : fall);
}

#endif
