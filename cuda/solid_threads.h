/* What one thread of each launch of the solid tissue does; see doc/cuda.md for the order of the launches.
 * Compiled by nvcc, which runs one thread each, and by the tests, which run them one after the other.
 *
 * Rows are shared by SPHM_DEVICE_LANES lanes: a _lane function adds the entries of one lane to `sum`; the
 * caller adds the lanes up (lanes 4, 2, 1 apart) and hands the whole to the _finish function of the particle.
 */
#ifndef SPHM_CUDA_SOLID_THREADS_H
#define SPHM_CUDA_SOLID_THREADS_H

#include "cuda/solid_layout.h"
#include "cuda/threads.h"

/* A step before this one has failed: the state stays as that step left it. */
SPHM_FN int sphm_solid_has_failed(const sphm_solid_device *d, int step) {
    return d->submission->failure >> 33 < (uint64_t)step;
}

SPHM_FN void sphm_solid_fail(const sphm_solid_device *d, int step, int not_finite, size_t slot) {
    sphm_keep_smallest(&d->submission->failure,
                       (uint64_t)step << 33 | (uint64_t)not_finite << 32 | (uint64_t)slot);
}

/* External forces ------------------------------------------------------------------------------------------
 */

SPHM_FN int sphm_solid_within(const sphm_solid_device *d, const sphm_solid_pull *pull, size_t i) {
    double square = 0;
    for (int a = 0; a < 3; ++a) {
        const sphm_real x = d->rest[4 * i + (size_t)a] + d->motion[8 * i + (size_t)a];
        const double away = (double)x - pull->centre_m[a];
        square += away * away;
    }
    return square <= pull->radius_m * pull->radius_m;
}

SPHM_FN void sphm_solid_hits(const sphm_solid_device *d, int step, size_t i) {
    sphm_solid_submission *s = d->submission;
    for (uint32_t f = 0; f < s->pull_count; ++f)
        if (sphm_solid_within(d, &s->pulls[f], i))
            sphm_count_up(&s->hits[step][f]);
}

SPHM_FN void sphm_solid_add_pulls(const sphm_solid_device *d, int step, size_t i, sphm_real force[3]) {
    const sphm_solid_submission *s = d->submission;
    for (uint32_t f = 0; f < s->pull_count; ++f)
        if (sphm_solid_within(d, &s->pulls[f], i))
            for (int a = 0; a < 3; ++a)
                force[a] += (sphm_real)(s->pulls[f].force_N[a] / (double)s->hits[step][f]);
}

/* Membrane -------------------------------------------------------------------------------------------------
 */

/* The cell model over step_ms from potential v; writes the potential into `buffer`. */
SPHM_FN sphm_real sphm_solid_react(const sphm_solid_device *d, size_t i, sphm_real v, sphm_real step_ms,
                                   int buffer) {
    sphm_thread_react(&d->membrane, &d->submission->electrodes, d->electrodes[i], step_ms, &v,
                      &d->recovery[i]);
    d->potential[(size_t)buffer * d->count + i] = v;
    return v;
}

/* sum_j w_ij (V_j - V_i) */
SPHM_FN void sphm_solid_spread_lane(const sphm_solid_device *d, const sphm_solid_plan *p, int substep,
                                    size_t i, int lane, sphm_real sum[1]) {
    const sphm_real *v = d->potential + (size_t)sphm_spread_source(&p->membrane, substep) * d->count;
    const uint64_t begin = d->row_start[i], end = begin + (uint64_t)d->row_count[i];
    const sphm_real own = v[i];
    for (uint64_t k = begin + (uint64_t)lane; k < end; k += SPHM_DEVICE_LANES)
        sum[0] += d->weight[k] * (v[d->neighbour[k]] - own);
}

SPHM_FN sphm_real sphm_solid_spread_finish(const sphm_solid_device *d, const sphm_solid_plan *p, int substep,
                                           size_t i, const sphm_real sum[1]) {
    const int from = sphm_spread_source(&p->membrane, substep);
    const sphm_real v = d->potential[(size_t)from * d->count + i] + p->membrane.diffusion_ms * sum[0];
    return sphm_solid_react(d, i, v, sphm_spread_reaction_ms(&p->membrane, substep), 1 - from);
}

/* Force and motion -----------------------------------------------------------------------------------------
 */

/* f_i/V = sum_j [(A_i + A_j) w X_ij + w k (u_j - u_i + tau (v_j - v_i))] of the stress lines, which have X,
 * too. */
SPHM_FN void sphm_solid_force_lane(const sphm_solid_device *d, const sphm_real *stress, size_t i, int lane,
                                   sphm_real sum[3]) {
    const uint64_t begin = d->row_start[i], end = begin + (uint64_t)d->row_count[i];
    sphm_real own[16], other[16], wx[3];
    for (int c = 0; c < 16; c += 4)
        sphm_load4(stress + 16 * i + c, own + c);
    for (uint64_t k = begin + (uint64_t)lane; k < end; k += SPHM_DEVICE_LANES) {
        const sphm_real *line = stress + 16 * (size_t)d->neighbour[k];
        const sphm_real w = d->pair[k];
        for (int c = 0; c < 16; c += 4)
            sphm_load4(line + c, other + c);
        for (int c = 0; c < 3; ++c)
            wx[c] = w * (other[4 * c + 3] - own[4 * c + 3]);
        for (int a = 0; a < 3; ++a)
            sum[a] += (own[a] + other[a]) * wx[0] + (own[4 + a] + other[4 + a]) * wx[1] +
                      (own[8 + a] + other[8 + a]) * wx[2] + (other[12 + a] - own[12 + a]) * w;
    }
}

/* Ends -----------------------------------------------------------------------------------------------------
 */

/* Where the particles of an end begin in `held`. */
SPHM_FN size_t sphm_solid_first_held(const sphm_solid_device *d, int end) {
    return end == SPHM_END_ORIGIN ? 0 : d->held_count[SPHM_END_ORIGIN];
}

/* Force ([4 * index into held]) and its moment about `pivot` of the end's particles `thread`, `thread` +
 * threads, ... */
SPHM_FN void sphm_solid_sum_held(const sphm_solid_device *d, const sphm_real *held_force, int held_end,
                                 const double pivot[3], size_t thread, size_t threads, double sum[6]) {
    const size_t begin = sphm_solid_first_held(d, held_end), end = begin + d->held_count[held_end];
    for (int a = 0; a < 6; ++a)
        sum[a] = 0;
    for (size_t index = begin + thread; index < end; index += threads) {
        const size_t i = (size_t)d->held[index];
        double arm[3], force[3], moment[3];
        for (size_t a = 0; a < 3; ++a) {
            const sphm_real x = d->rest[4 * i + a] + d->motion[8 * i + a];
            arm[a] = (double)x - pivot[a];
            force[a] = (double)held_force[4 * index + a];
        }
        sphm_cross3(arm, force, moment);
        for (int a = 0; a < 3; ++a) {
            sum[a] += force[a];
            sum[3 + a] += moment[a];
        }
    }
}

/* Internal and external force on one attached particle; `sum` as for move. */
SPHM_FN void sphm_solid_end_force_finish(const sphm_solid_device *d, int step, size_t index,
                                         const sphm_real sum[3]) {
    sphm_real force[3];
    for (int a = 0; a < 3; ++a)
        force[a] = d->particle_volume_m3 * sum[a];
    sphm_solid_add_pulls(d, step, (size_t)d->held[index], force);
    for (size_t a = 0; a < 3; ++a)
        d->end_force[4 * index + a] = force[a];
}

/* Thread 0 ... 2 END_PARTIALS - 1: those of the origin, then those of the insertion. Moments are about the
 * block's centre. */
SPHM_FN void sphm_solid_end_sum_thread(const sphm_solid_device *d, size_t thread) {
    const int end = thread < SPHM_SOLID_END_PARTIALS ? SPHM_END_ORIGIN : SPHM_END_INSERTION;
    const sphm_end_body *body = &d->submission->ends[end];
    double centre[3];
    for (int a = 0; a < 3; ++a)
        centre[a] = d->blocks[end].centre_m[a] + body->shift_m[a] - d->frame_m[a];
    sphm_solid_sum_held(d, d->end_force, end, centre, thread % SPHM_SOLID_END_PARTIALS,
                        SPHM_SOLID_END_PARTIALS, d->end_sum + 6 * thread);
}

/* As move_block() of src/cpu/solid_ends.c. Thread: the end. `end_sum`: what d->end_sum has, from where it is
 * read quickly. */
SPHM_FN void sphm_solid_end_step_thread(const sphm_solid_device *d, sphm_solid_plan *p, const double *end_sum,
                                        int end) {
    sphm_solid_end *plan = &p->ends[end];
    sphm_end_body body = d->submission->ends[end];
    const sphm_end_block *block = &d->blocks[end];
    if (plan->moved_by == SPHM_SOLID_FOLLOWS || !(block->particles > 0))
        return;
    double sum[6] = {0, 0, 0, 0, 0, 0}, pull[3];
    const double *partial = end_sum + (size_t)end * 6 * SPHM_SOLID_END_PARTIALS;
    for (int t = 0; t < SPHM_SOLID_END_PARTIALS; ++t)
        for (int a = 0; a < 6; ++a)
            sum[a] += partial[6 * t + a];
    for (int a = 0; a < 3; ++a)
        pull[a] = plan->load_N[a];
    if (plan->tendon) {
        double spin[3], point[3], velocity[3];
        sphm_end_body_spin(block, body.rotation, body.momentum_Nms, spin);
        sphm_end_body_carry(block, &body, spin, block->point_m, point, velocity);
        for (int a = 0; a < 3; ++a)
            point[a] += block->point_m[a];
        sphm_end_tendon_force(block, point, plan->bone_m, pull);
    }
    if (plan->moved_by == SPHM_SOLID_SLIDES)
        sphm_end_body_slide(block, sum, pull, d->gravity_m_per_s2, p->step_s, p->keep, &body);
    else
        sphm_end_body_step(block, sum, sum + 3, pull, d->gravity_m_per_s2, p->step_s, p->keep, &body);
    d->submission->ends[end] = body;
    sphm_end_frame_of(block, &body, d->frame_m, &plan->frame);
}

SPHM_FN void sphm_solid_move_finish(const sphm_solid_device *d, const sphm_solid_plan *p, int step, size_t i,
                                    const sphm_real sum[3]) {
    sphm_real motion[8];
    sphm_load4(d->motion + 8 * i, motion);
    sphm_load4(d->motion + 8 * i + 4, motion + 4);
    if (d->attachment[i] == SPHM_FREE) {
        sphm_real force[3];
        for (int a = 0; a < 3; ++a)
            force[a] = d->particle_volume_m3 * sum[a];
        sphm_solid_add_pulls(d, step, i, force);
        sphm_solid_move(&p->mover, d->relative_volume[i], force, motion);
    } else {
        const int end = d->attachment[i] == SPHM_ATTACHED_ORIGIN ? SPHM_END_ORIGIN : SPHM_END_INSERTION;
        double rest[3];
        for (int a = 0; a < 3; ++a)
            rest[a] = (double)d->rest[4 * i + (size_t)a];
        sphm_end_carry(&p->ends[end].frame, rest, motion);
    }
    sphm_store4(d->motion + 8 * i, motion);
    sphm_store4(d->motion + 8 * i + 4, motion + 4);
    if (!sphm_motion_is_finite(motion))
        sphm_solid_fail(d, step, 1, i);
    if (!p->commanded)
        (void)sphm_solid_react(d, i, d->potential[(size_t)p->membrane.buffer * d->count + i],
                               p->membrane.first_ms, p->membrane.buffer);
}

/* Strain and stress ----------------------------------------------------------------------------------------
 */

/* sum[9 * q + 3 * a + c] of q = u, v: sum_j (q_j - q_i)_a w X_c; S in H = S B. */
SPHM_FN void sphm_solid_strain_lane(const sphm_solid_device *d, size_t i, int lane, sphm_real sum[18]) {
    const uint64_t begin = d->row_start[i], end = begin + (uint64_t)d->row_count[i];
    sphm_real own[8], other[8], own_rest[4], rest[4], wx[3];
    sphm_load4(d->rest + 4 * i, own_rest);
    sphm_load4(d->motion + 8 * i, own);
    sphm_load4(d->motion + 8 * i + 4, own + 4);
    for (uint64_t k = begin + (uint64_t)lane; k < end; k += SPHM_DEVICE_LANES) {
        const size_t j = (size_t)d->neighbour[k];
        const sphm_real *line = d->motion + 8 * j;
        const sphm_real w = d->pair[k];
        sphm_load4(d->rest + 4 * j, rest);
        sphm_load4(line, other);
        sphm_load4(line + 4, other + 4);
        for (int c = 0; c < 3; ++c)
            wx[c] = w * (rest[c] - own_rest[c]);
        for (int a = 0; a < 3; ++a) {
            const sphm_real u = other[a] - own[a], v = other[4 + a] - own[4 + a];
            for (int c = 0; c < 3; ++c) {
                sum[3 * a + c] += u * wx[c];
                sum[9 + 3 * a + c] += v * wx[c];
            }
        }
    }
}

/* The rows of S times the symmetric B. */
SPHM_FN void sphm_solid_correct(const sphm_real S[9], const sphm_real b[6], sphm_real H[9]) {
    for (int r = 0; r < 9; r += 3) {
        H[r] = S[r] * b[0] + S[r + 1] * b[1] + S[r + 2] * b[2];
        H[r + 1] = S[r] * b[1] + S[r + 1] * b[3] + S[r + 2] * b[4];
        H[r + 2] = S[r] * b[2] + S[r + 1] * b[4] + S[r + 2] * b[5];
    }
}

/* The material at one particle; writes its line into `stress`. */
SPHM_FN void sphm_solid_evaluate_particle(const sphm_solid_device *d, const sphm_solid_tissue *tissue,
                                          sphm_real activation, sphm_real rate_share, size_t i,
                                          const sphm_real sum[18], sphm_real *stress,
                                          sphm_solid_result *result) {
    sphm_real H[9], rate[9], f0[3], b[6];
    for (int c = 0; c < 6; ++c)
        b[c] = d->correction[(size_t)c * d->count + i];
    for (int a = 0; a < 3; ++a)
        f0[a] = d->fibre[(size_t)a * d->count + i];
    sphm_solid_correct(sum, b, H);
    sphm_solid_correct(sum + 9, b, rate);
    sphm_solid_evaluate(tissue, H, rate, f0, activation, d->fibre_rate[i], rate_share, d->relative_volume[i],
                        b, result);
    sphm_real line[4], rest[4], motion[8];
    sphm_load4(d->rest + 4 * i, rest);
    sphm_load4(d->motion + 8 * i, motion);
    sphm_load4(d->motion + 8 * i + 4, motion + 4);
    for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r)
            line[r] = result->A[3 * r + c];
        line[3] = rest[c];
        sphm_store4(stress + 16 * i + 4 * c, line);
    }
    for (int r = 0; r < 3; ++r)
        line[r] = tissue->hourglass_Pa * (motion[r] + tissue->hourglass_time_s * motion[4 + r]);
    line[3] = 0;
    sphm_store4(stress + 16 * i + 12, line);
}

/* The last cell sweep, where diffusion has come before it, and the activation. */
SPHM_FN sphm_real sphm_solid_activate(const sphm_solid_device *d, const sphm_solid_plan *p, size_t i,
                                      const sphm_real diffusion[1]) {
    sphm_real target = p->target;
    if (!p->commanded) {
        const sphm_real v = p->membrane.substeps > 0
                                ? sphm_solid_spread_finish(d, p, p->membrane.substeps - 1, i, diffusion)
                                : d->potential[(size_t)p->membrane.buffer * d->count + i];
        target = sphm_activation_target(&d->membrane, v);
    }
    return d->activation[i] =
               sphm_activation_filter(d->activation[i], target, p->membrane.rise, p->membrane.fall);
}

/* sum[18]: the diffusion. */
SPHM_FN void sphm_solid_strain_finish(const sphm_solid_device *d, const sphm_solid_plan *p, int step,
                                      size_t i, const sphm_real sum[19]) {
    sphm_solid_result result;
    const sphm_real activation = sphm_solid_activate(d, p, i, sum + 18);
    sphm_solid_evaluate_particle(d, &d->tissue, activation, p->rate_share, i, sum, d->stress, &result);
    d->fibre_rate[i] = result.fibre_rate;
    d->density[i] = d->tissue.density_kg_per_m3 / result.J;
    d->pressure[i] = result.pressure_Pa;
    d->modulus[i] = result.modulus_Pa;
    if (!(result.J > 0))
        sphm_solid_fail(d, step, 0, i);
}

/* After a submission; thread 0 ... SPHM_SOLID_PARTIALS - 1. */
SPHM_FN void sphm_solid_report_thread(const sphm_solid_device *d, size_t thread) {
    sphm_real largest = 0;
    for (size_t i = thread; i < d->count; i += SPHM_SOLID_PARTIALS)
        largest = d->modulus[i] > largest ? d->modulus[i] : largest;
    d->report->modulus_Pa[thread] = largest;
    if (thread == 0)
        d->report->failure = d->submission->failure;
    if (thread < SPHM_END_COUNT)
        d->report->ends[thread] = d->submission->ends[thread];
}

/* Wrenches: parts of the stress on spare arrays; looking changes nothing -----------------------------------
 */

SPHM_FN void sphm_solid_part_strain_finish(const sphm_solid_device *d, const sphm_solid_call *call, size_t i,
                                           const sphm_real sum[18]) {
    sphm_solid_result result;
    sphm_solid_tissue tissue = d->tissue;
    if (!call->with_damping)
        tissue.viscosity_Pa_s = tissue.hourglass_time_s = 0;
    const sphm_real activation = call->with_activation ? d->activation[i] : 0;
    sphm_solid_evaluate_particle(d, &tissue, activation, 0, i, sum, d->part_stress, &result);
}

SPHM_FN void sphm_solid_part_force_finish(const sphm_solid_device *d, size_t index, const sphm_real sum[3]) {
    for (size_t a = 0; a < 3; ++a)
        d->part_force[4 * index + a] = d->particle_volume_m3 * sum[a];
}

SPHM_FN void sphm_solid_part_sum_thread(const sphm_solid_device *d, const sphm_solid_call *call,
                                        size_t thread) {
    sphm_solid_sum_held(d, d->part_force, call->end, call->pivot_m, thread, SPHM_SOLID_PARTIALS,
                        d->part_sum + 6 * ((size_t)call->part * SPHM_SOLID_PARTIALS + thread));
}

/* Looks ----------------------------------------------------------------------------------------------------
 */

/* Particle i as it is now, for a look (cuda/look.h). */
SPHM_FN void sphm_solid_snapshot_thread(const sphm_solid_device *d, const sphm_solid_call *call, size_t i) {
    sphm_look_particle *p = &call->line[d->id[i]];
    const sphm_real *motion = d->motion + 8 * i;
    for (size_t a = 0; a < 3; ++a) {
        p->place_m[a] = d->rest[4 * i + a] + motion[a];
        p->velocity_m_per_s[a] = motion[4 + a];
    }
    p->density_kg_per_m3 = d->density[i];
    p->pressure_Pa = d->pressure[i];
    p->potential_mV = d->potential[(size_t)call->buffer * d->count + i];
    p->recovery = d->recovery[i];
    p->activation = d->activation[i];
    p->unused = 0;
}

#endif
