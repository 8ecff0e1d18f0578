/* What one thread of each launch of a step of the fluid does, and of what
 * reports to the host; those that build the rows are in fluid_rows.h.
 * doc/cuda.md has the order of the launches. Compiled by nvcc, which runs one
 * thread each, and by the tests, which run them one after the other.
 *
 * Rows are shared by SPHM_DEVICE_LANES lanes: a _lane function adds the entries
 * of one lane to `sum`; the caller adds the lanes up (lanes 4, 2, 1 apart) and
 * hands the whole to the _finish function of the particle. Sums over all
 * particles: a _thread function adds every `threads`-th particle to `sum`; the
 * caller adds up the threads of a block (128, 64, ... 1 apart) and leaves one
 * sum a block. */
#ifndef SPHM_CUDA_FLUID_THREADS_H
#define SPHM_CUDA_FLUID_THREADS_H

#include "cuda/fluid_layout.h"
#include "cuda/threads.h"

SPHM_FN sphm_pack sphm_pack_of(sphm_real x, sphm_real y, sphm_real z, sphm_real w) {
    sphm_pack pack;
    pack.x = x;
    pack.y = y;
    pack.z = z;
    pack.w = w;
    return pack;
}

/* 16 bytes at a time, which packs are aligned to. */
SPHM_FN sphm_pack sphm_load_pack(const sphm_pack *from) {
#if defined(__CUDA_ARCH__) && !defined(SPH_MUSCLE_DOUBLE)
    const float4 four = *(const float4 *)from;
    return sphm_pack_of(four.x, four.y, four.z, four.w);
#else
    return *from;
#endif
}

SPHM_FN void sphm_store_pack(sphm_pack *to, sphm_pack pack) {
#if defined(__CUDA_ARCH__) && !defined(SPH_MUSCLE_DOUBLE)
    *(float4 *)to = make_float4(pack.x, pack.y, pack.z, pack.w);
#else
    *to = pack;
#endif
}

SPHM_FN void sphm_load3(const sphm_real *from, size_t count, size_t i, sphm_real to[3]) {
    for (size_t a = 0; a < 3; ++a)
        to[a] = from[a * count + i];
}

/* A step before this one has failed or was the last: the state stays as that
 * step left it. All threads of a launch see the same, for they only add
 * failures and ends of their own step. */
SPHM_FN int sphm_fluid_has_ended(const sphm_fluid_device *d, int step) {
    return d->submission->failure >> 40 < (uint64_t)step || d->submission->end < (uint32_t)step;
}

/* Shape matching
 * -------------------------------------------------------------------------------------------
 */

/* Counts the particles within reach of point forces, too. */
SPHM_FN void sphm_fluid_sum_thread(const sphm_fluid_device *d, int step, size_t thread, size_t threads,
                                   double sum[SPHM_MOMENT_SUMS]) {
    sphm_fluid_submission *s = d->submission;
    for (size_t i = thread; i < d->count; i += threads) {
        sphm_real x[3], rest[3];
        double wide_x[3], wide_rest[3];
        sphm_load3(d->position, d->count, i, x);
        sphm_load3(d->rest, d->count, i, rest);
        for (int a = 0; a < 3; ++a) {
            wide_x[a] = (double)x[a];
            wide_rest[a] = (double)rest[a];
        }
        sphm_rigid_add(wide_x, wide_rest, sum);
        for (uint32_t f = 0; f < s->pull_count; ++f)
            if (sphm_point_pull_reaches(&s->pulls[f], x))
                sphm_count_up(&s->hits[step][f]);
    }
}

/* Thread 0 ... SPHM_MOMENT_SUMS - 1, then, when all have done it, the _finish. `moment`: what d->moment has,
 * from where it is read quickly. */
SPHM_FN void sphm_fluid_rigid_thread(const sphm_fluid_device *d, const double *moment, int thread) {
    double sum = 0;
    for (int block = 0; block < d->partials; ++block)
        sum += moment[SPHM_MOMENT_SUMS * block + thread];
    d->rigid->sums[thread] = sum;
}

SPHM_FN void sphm_fluid_rigid_finish(const sphm_fluid_device *d) {
    sphm_rigid_motion motion;
    sphm_rigid_find(d->rigid->sums, (double)d->count, &motion);
    d->rigid->goal = sphm_goal_of(&motion);
    for (int k = 0; k < 9; ++k)
        d->rigid->rotation[k] = (sphm_real)motion.rotation[k];
}

/* Prediction
 * -----------------------------------------------------------------------------------------------
 */

SPHM_FN void sphm_fluid_predict_thread(const sphm_fluid_device *d, int step, size_t i) {
    const sphm_fluid_submission *s = d->submission;
    const sphm_fluid_plan *p = &s->plan[step];
    sphm_real x[3], v[3], rest[3], u[3];
    sphm_load3(d->position, d->count, i, x);
    sphm_load3(d->velocity, d->count, i, v);
    sphm_load3(d->rest, d->count, i, rest);
    sphm_fluid_predict(&p->prediction, &d->rigid->goal, x, v, rest, u);
    for (uint32_t f = 0; f < s->pull_count; ++f)
        if (sphm_point_pull_reaches(&s->pulls[f], x)) {
            const double share_kg = (double)s->hits[step][f] * d->mass_kg;
            for (int a = 0; a < 3; ++a)
                u[a] += p->step * (sphm_real)(s->force_N[f][a] / share_kg);
        }
    const int free = d->attachment[i] == SPHM_FREE;
    sphm_twin *line = &d->predicted[i];
    sphm_store_pack(&line->first, sphm_pack_of(x[0] * d->inverse_h, x[1] * d->inverse_h, x[2] * d->inverse_h,
                                               d->density[i]));
    sphm_store_pack(&line->second, sphm_pack_of(free ? u[0] : 0, free ? u[1] : 0, free ? u[2] : 0, 0));
}

/* XSPH, density, pressure
 * ----------------------------------------------------------------------------------
 */

/* sum: XSPH x y z, density */
SPHM_FN void sphm_fluid_smooth_lane(const sphm_fluid_device *d, size_t i, int lane, sphm_real sum[4]) {
    const uint64_t begin = d->row_start[i], end = begin + d->row_count[i];
    const sphm_pack pi = sphm_load_pack(&d->predicted[i].first), vi = sphm_load_pack(&d->predicted[i].second);
    sphm_pack mixed = sphm_pack_of(0, 0, 0, 0);
    for (uint64_t k = begin + (uint64_t)lane; k < end; k += SPHM_DEVICE_LANES) {
        const sphm_twin *other = &d->predicted[d->neighbour[k]];
        const sphm_pack p = sphm_load_pack(&other->first), v = sphm_load_pack(&other->second);
        sum[3] += sphm_smooth_pair(pi, vi, p, v, &mixed);
    }
    sum[0] += mixed.x;
    sum[1] += mixed.y;
    sum[2] += mixed.z;
}

/* The cell model over step_ms from potential v; writes the potential into
 * `buffer`. */
SPHM_FN sphm_real sphm_fluid_react(const sphm_fluid_device *d, size_t i, sphm_real v, sphm_real step_ms,
                                   int buffer) {
    sphm_thread_react(&d->membrane, &d->submission->electrodes, d->electrodes[i], step_ms, &v,
                      &d->recovery[i]);
    d->potential[(size_t)buffer * d->count + i] = v;
    return v;
}

/* The first cell sweep comes last: pressure and tension are those of the
 * potential before it. */
SPHM_FN void sphm_fluid_smooth_finish(const sphm_fluid_device *d, const sphm_fluid_plan *p, size_t i,
                                      const sphm_real sum[4]) {
    const sphm_fluid_constants *c = &d->fluid;
    const sphm_pack place = sphm_load_pack(&d->predicted[i].first),
                    u = sphm_load_pack(&d->predicted[i].second);
    const sphm_real potential = d->potential[(size_t)p->membrane.buffer * d->count + i];
    const sphm_real density = d->unit * (1 + sum[3]);
    const sphm_real pressure =
        sphm_fluid_pressure(c, density, d->rest_density[i]) + sphm_fluid_electrical_pressure(c, potential);
    const sphm_real tension = c->fibre_tension_Pa * d->activation[i] * d->tension_unit;
    const sphm_real root = tension > 0 ? tension * sphm_inverse_sqrt(tension) : 0;
    sphm_real rest[3], fibre[3];
    sphm_load3(d->rest, d->count, i, rest);
    sphm_load3(d->fibre, d->count, i, fibre);
    sphm_quad *line = &d->smoothed[i];
    sphm_store_pack(&line->moving.first, sphm_pack_of(place.x, place.y, place.z, pressure));
    sphm_store_pack(&line->moving.second, sphm_pack_of(u.x + p->pull * sum[0], u.y + p->pull * sum[1],
                                                       u.z + p->pull * sum[2], 1 / density));
    sphm_store_pack(&line->third, sphm_pack_of(rest[0] * d->inverse_h, rest[1] * d->inverse_h,
                                               rest[2] * d->inverse_h, tension));
    if (d->kind == SPHM_FORCE_OBLIQUE_FIBRES)
        sphm_store_pack(&line->fourth, sphm_pack_of(root * fibre[0], root * fibre[1], root * fibre[2], 0));
    d->density[i] = density;
    d->pressure[i] = pressure;
    (void)sphm_fluid_react(d, i, potential, p->membrane.first_ms, p->membrane.buffer);
}

/* Diffusion
 * ------------------------------------------------------------------------------------------------
 */

/* sum_j w_ij (V_j - V_i) */
SPHM_FN void sphm_fluid_spread_lane(const sphm_fluid_device *d, const sphm_fluid_plan *p, int substep,
                                    size_t i, int lane, sphm_real sum[1]) {
    const sphm_real *v = d->potential + (size_t)sphm_spread_source(&p->membrane, substep) * d->count;
    const uint64_t begin = d->row_start[i], end = begin + d->row_count[i];
    const sphm_real own = v[i];
    for (uint64_t k = begin + (uint64_t)lane; k < end; k += SPHM_DEVICE_LANES)
        sum[0] += d->weight[k] * (v[d->neighbour[k]] - own);
}

SPHM_FN sphm_real sphm_fluid_spread_finish(const sphm_fluid_device *d, const sphm_fluid_plan *p, int substep,
                                           size_t i, const sphm_real sum[1]) {
    const int from = sphm_spread_source(&p->membrane, substep);
    const sphm_real v = d->potential[(size_t)from * d->count + i] + p->membrane.diffusion_ms * sum[0];
    return sphm_fluid_react(d, i, v, sphm_spread_reaction_ms(&p->membrane, substep), 1 - from);
}

/* The last cell sweep, where diffusion has come before it, and the activation.
 */
SPHM_FN sphm_real sphm_fluid_activate(const sphm_fluid_device *d, const sphm_fluid_plan *p, size_t i,
                                      const sphm_real diffusion[1]) {
    const sphm_membrane_plan *m = &p->membrane;
    const sphm_real v = m->substeps > 0 ? sphm_fluid_spread_finish(d, p, m->substeps - 1, i, diffusion)
                                        : d->potential[(size_t)m->buffer * d->count + i];
    d->activation[i] =
        sphm_activation_filter(d->activation[i], sphm_activation_target(&d->membrane, v), m->rise, m->fall);
    return v;
}

/* Forces and motion
 * ----------------------------------------------------------------------------------------
 */

SPHM_FN void sphm_fluid_force_lane(const sphm_fluid_device *d, const int kind, size_t i, int lane,
                                   sphm_real sum[3]) {
    const uint64_t begin = d->row_start[i], end = begin + d->row_count[i];
    const sphm_quad *line = &d->smoothed[i];
    sphm_real fibre[3];
    sphm_load3(d->fibre, d->count, i, fibre);
    sphm_force_own own;
    own.p = sphm_load_pack(&line->moving.first);
    own.v = sphm_load_pack(&line->moving.second);
    own.r = sphm_load_pack(&line->third);
    own.tension =
        kind == SPHM_FORCE_OBLIQUE_FIBRES ? sphm_load_pack(&line->fourth) : sphm_pack_of(0, 0, 0, 0);
    own.fibre = sphm_pack_of(fibre[0], fibre[1], fibre[2], 0);
    own.pressure = d->factors.pressure * own.v.w;
    own.viscosity = d->factors.viscosity * own.v.w;
    sphm_pack rest = own.r, tension = own.tension, force = sphm_pack_of(0, 0, 0, 0);
    for (uint64_t k = begin + (uint64_t)lane; k < end; k += SPHM_DEVICE_LANES) {
        const sphm_quad *other = &d->smoothed[d->neighbour[k]];
        const sphm_pack p = sphm_load_pack(&other->moving.first), v = sphm_load_pack(&other->moving.second);
        if (kind != SPHM_FORCE_FLUID_ONLY)
            rest = sphm_load_pack(&other->third);
        if (kind == SPHM_FORCE_OBLIQUE_FIBRES)
            tension = sphm_load_pack(&other->fourth);
        sphm_force_pair(kind, d->factors, own, p, v, rest, tension, &force);
    }
    sum[0] += force.x;
    sum[1] += force.y;
    sum[2] += force.z;
}

/* Ends the submission with this step where the rows are out of date after it,
 * or it was as long as no further one may be; or notes the failure. */
SPHM_FN void sphm_fluid_watch(const sphm_fluid_device *d, const sphm_fluid_plan *p, int step, size_t i,
                              const sphm_fluid_outcome *o) {
    sphm_fluid_submission *s = d->submission;
    const sphm_real *x = o->moved, *v = o->velocity;
    sphm_real listed[3];
    sphm_load3(d->listed, d->count, i, listed);
    const sphm_real away[3] = {x[0] - listed[0], x[1] - listed[1], x[2] - listed[2]};
    const sphm_real moved2 = away[0] * away[0] + away[1] * away[1] + away[2] * away[2];
    const sphm_real speed2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    const sphm_real sum =
        moved2 + speed2 + o->density + o->pressure + o->membrane[0] + o->membrane[1] + o->membrane[2];
    const int stage = sphm_fluid_bad_stage(o);
    if (stage != SPHM_FLUID_FINITE)
        sphm_count_up(&s->bad);
    if (stage != SPHM_FLUID_FINITE || !(sum - sum == 0))
        sphm_keep_smallest(&s->failure, (uint64_t)step << 40 | (uint64_t)stage << 32 | (uint32_t)d->id[i]);
    if ((double)moved2 > d->stale_m2 || (double)speed2 > p->fastest2)
        sphm_keep_smallest32(&s->end, (uint32_t)step);
}

/* sum: acceleration, diffusion. Leap-frog (8), fibre steering, attachments. */
SPHM_FN void sphm_fluid_force_finish(const sphm_fluid_device *d, const sphm_fluid_plan *p, int step, size_t i,
                                     const sphm_real sum[4]) {
    const sphm_pack place = sphm_load_pack(&d->predicted[i].first),
                    predicted = sphm_load_pack(&d->predicted[i].second);
    const sphm_pack smoothed = sphm_load_pack(&d->smoothed[i].moving.second);
    const sphm_real u[3] = {smoothed.x, smoothed.y, smoothed.z};
    const int free = d->attachment[i] == SPHM_FREE;
    sphm_real x[3], v[3], fibre[3];
    sphm_load3(d->position, d->count, i, x);
    for (int a = 0; a < 3; ++a)
        v[a] = free ? u[a] + p->step * sum[a] : 0;
    if (d->fluid.fibre_steering > 0) {
        sphm_load3(d->fibre, d->count, i, fibre);
        sphm_fluid_steer(d->fluid.fibre_steering, d->rigid->rotation, fibre[0], fibre[1], fibre[2], &v[0],
                         &v[1], &v[2]);
    }
    sphm_fluid_outcome o = {{place.x, place.y, place.z},
                            {predicted.x, predicted.y, predicted.z},
                            {smoothed.x, smoothed.y, smoothed.z},
                            d->density[i],
                            d->pressure[i],
                            smoothed.w,
                            {sum[0], sum[1], sum[2]},
                            {0, 0, 0},
                            {v[0], v[1], v[2]},
                            {0, 0, 0}};
    for (size_t a = 0; a < 3; ++a) {
        o.moved[a] = x[a] + p->step * v[a];
        d->velocity[a * d->count + i] = v[a];
        d->position[a * d->count + i] = o.moved[a];
    }
    o.membrane[0] = sphm_fluid_activate(d, p, i, sum + 3);
    o.membrane[1] = d->recovery[i];
    o.membrane[2] = d->activation[i];
    sphm_fluid_watch(d, p, step, i, &o);
}

/* For the host
 * ---------------------------------------------------------------------------------------------
 */

/* The largest of the diffusion's bounds, moves and speeds, the last two
 * squared. */
SPHM_FN void sphm_fluid_report_thread(const sphm_fluid_device *d, size_t thread, size_t threads,
                                      double largest[3]) {
    for (size_t i = thread; i < d->count; i += threads) {
        sphm_real x[3], v[3], listed[3], moved2 = 0, speed2 = 0;
        sphm_load3(d->position, d->count, i, x);
        sphm_load3(d->velocity, d->count, i, v);
        sphm_load3(d->listed, d->count, i, listed);
        for (int a = 0; a < 3; ++a) {
            const sphm_real away = x[a] - listed[a];
            moved2 += away * away;
            speed2 += v[a] * v[a];
        }
        const double all[3] = {(double)d->bound[i], (double)moved2, (double)speed2};
        for (int k = 0; k < 3; ++k)
            largest[k] = all[k] > largest[k] ? all[k] : largest[k];
    }
    if (thread == 0) {
        d->report->failure = d->submission->failure;
        d->report->end = d->submission->end;
        d->report->bad = d->submission->bad;
        d->report->entries = d->row_start[d->count];
    }
}

SPHM_FN void sphm_fluid_set_rest_thread(const sphm_fluid_device *d, size_t i) {
    d->rest_density[i] = d->density[i];
}

/* Pairs of particle i within h. */
SPHM_FN void sphm_fluid_within_thread(const sphm_fluid_device *d, size_t i) {
    const double h = (double)d->fluid.support_radius_m;
    const sphm_real radius2 = (sphm_real)(h * h);
    sphm_real x[3], other[3];
    uint64_t pairs = 0;
    sphm_load3(d->listed, d->count, i, x);
    for (uint64_t k = d->row_start[i]; k < d->row_start[i] + d->row_count[i]; ++k) {
        sphm_load3(d->listed, d->count, (size_t)d->neighbour[k], other);
        const sphm_real dx = x[0] - other[0], dy = x[1] - other[1], dz = x[2] - other[2];
        pairs += dx * dx + dy * dy + dz * dz <= radius2;
    }
    sphm_add_up(&d->report->within, pairs);
}

/* Looks
 * -------------------------------------------------------------------------------------------
 */

/* Particle i as it is now, for a look (cuda/look.h). */
SPHM_FN void sphm_fluid_snapshot_thread(const sphm_fluid_device *d, const sphm_fluid_call *call, size_t i) {
    sphm_look_particle *p = &call->line[d->id[i]];
    sphm_load3(d->position, d->count, i, p->place_m);
    sphm_load3(d->velocity, d->count, i, p->velocity_m_per_s);
    p->density_kg_per_m3 = d->density[i];
    p->pressure_Pa = d->pressure[i];
    p->potential_mV = d->potential[(size_t)call->buffer * d->count + i];
    p->recovery = d->recovery[i];
    p->activation = d->activation[i];
    p->unused = 0;
}

#endif
