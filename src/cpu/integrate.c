/* Leap-frog (8), fibre steering, attachments; and the watch over what came out of a step. Reads pack smoothed
 * and the acceleration; writes position and velocity. */
#include <math.h>

#include "core/fluid_watch.h"
#include "cpu/backend.h"
#include "cpu/parallel.h"

/* Largest move since the rows were built, largest speed, and whether all is finite: a NaN or an infinity
 * makes x - x differ from 0. The arrays are named first: read through `s`, gcc gathered the pointers
 * themselves, one for each lane, and the sweep took eight times as long. */
static void watch_block(const sphm_state *s, size_t begin, size_t end, sphm_block_result *result) {
    const sphm_real *x = s->x, *y = s->y, *z = s->z, *vx = s->vx, *vy = s->vy, *vz = s->vz;
    const sphm_real *listed_x = s->listed_x, *listed_y = s->listed_y, *listed_z = s->listed_z;
    const sphm_real *density = s->density, *pressure = s->pressure, *potential = s->membrane_potential,
                    *recovery = s->recovery, *activation = s->activation;
    sphm_real moved2 = 0, speed2 = 0;
    int nonfinite = 0;
#pragma omp simd reduction(max : moved2, speed2) reduction(| : nonfinite)
    for (size_t i = begin; i < end; ++i) {
        const sphm_real dx = x[i] - listed_x[i], dy = y[i] - listed_y[i], dz = z[i] - listed_z[i];
        const sphm_real m = dx * dx + dy * dy + dz * dz;
        const sphm_real v = vx[i] * vx[i] + vy[i] * vy[i] + vz[i] * vz[i];
        const sphm_real sum = m + v + density[i] + pressure[i] + potential[i] + recovery[i] + activation[i];
        nonfinite |= !(sum - sum == 0);
        moved2 = m > moved2 ? m : moved2;
        speed2 = v > speed2 ? v : speed2;
    }
    result->moved2 = (double)moved2;
    result->speed2 = (double)speed2;
    result->nonfinite = nonfinite;
}

static int collect(sphm_backend *b) {
    double moved2 = 0, speed2 = 0;
    int nonfinite = 0;
    for (size_t block = 0; block < b->blocks; ++block) {
        moved2 = fmax(moved2, b->results[block].moved2);
        speed2 = fmax(speed2, b->results[block].speed2);
        nonfinite |= b->results[block].nonfinite;
    }
    b->speed_max_m_per_s = sqrt(speed2);
    b->rows_stale = moved2 > 0.25 * b->skin_m * b->skin_m;
    return !nonfinite;
}

static void kick_block(sphm_state *s, const sphm_quad *packs, sphm_real step, size_t begin, size_t end) {
#pragma omp simd
    for (size_t i = begin; i < end; ++i) {
        const sphm_pack w = packs[i].moving.second;
        const sphm_real vx = w.x + step * s->ax[i], vy = w.y + step * s->ay[i], vz = w.z + step * s->az[i];
        const int free = s->attachment[i] == SPHM_FREE;
        s->vx[i] = free ? vx : 0;
        s->vy[i] = free ? vy : 0;
        s->vz[i] = free ? vz : 0;
    }
}

static void steer_block(sphm_state *s, const double rotation[9], sphm_real beta, size_t begin, size_t end) {
    sphm_real r[9];
    for (int k = 0; k < 9; ++k)
        r[k] = (sphm_real)rotation[k];
#pragma omp simd
    for (size_t i = begin; i < end; ++i) {
        const sphm_real x = s->fibre_x[i], y = s->fibre_y[i], z = s->fibre_z[i];
        sphm_fluid_steer(beta, r, x, y, z, &s->vx[i], &s->vy[i], &s->vz[i]);
    }
}

static void drift_block(sphm_state *s, sphm_real step, size_t begin, size_t end) {
#pragma omp simd
    for (size_t i = begin; i < end; ++i) {
        s->x[i] += step * s->vx[i];
        s->y[i] += step * s->vy[i];
        s->z[i] += step * s->vz[i];
    }
}

static void move_block(sphm_backend *b, sphm_real step, size_t begin, size_t end) {
    const sphm_real beta = b->model->fluid.fibre_steering;
    kick_block(&b->state, b->packs.smoothed, step, begin, end);
    if (beta > 0)
        steer_block(&b->state, b->motion.rotation, beta, begin, end);
    drift_block(&b->state, step, begin, end);
}

int sphm_cpu_integrate(sphm_backend *b, double step_s) {
    const size_t count = b->state.count;
#pragma omp parallel for num_threads(b->threads) schedule(static)
    for (size_t block = 0; block < b->blocks; ++block) {
        const size_t begin = sphm_block_begin(block), end = sphm_block_end(block, count);
        move_block(b, (sphm_real)step_s, begin, end);
        watch_block(&b->state, begin, end, &b->results[block]);
    }
    return collect(b);
}

void sphm_cpu_measure_motion(sphm_backend *b) {
    for (size_t block = 0; block < b->blocks; ++block)
        watch_block(&b->state, sphm_block_begin(block), sphm_block_end(block, b->state.count),
                    &b->results[block]);
    (void)collect(b);
}

static int bad_stage(const sphm_backend *b, size_t i) {
    const sphm_state *s = &b->state;
    const sphm_twin *p = &b->packs.predicted[i], *after = &b->packs.smoothed[i].moving;
    const sphm_fluid_outcome o = {{p->first.x, p->first.y, p->first.z},
                                  {p->second.x, p->second.y, p->second.z},
                                  {after->second.x, after->second.y, after->second.z},
                                  s->density[i],
                                  s->pressure[i],
                                  after->second.w,
                                  {s->ax[i], s->ay[i], s->az[i]},
                                  {s->membrane_potential[i], s->recovery[i], s->activation[i]},
                                  {s->vx[i], s->vy[i], s->vz[i]},
                                  {s->x[i], s->y[i], s->z[i]}};
    return sphm_fluid_bad_stage(&o);
}

void sphm_cpu_name_nonfinite(const sphm_backend *b, char *text, size_t size) {
    int stage = SPHM_FLUID_FINITE;
    int32_t particle = -1;
    size_t bad = 0;
    for (size_t i = 0; i < b->state.count; ++i) {
        const int found = bad_stage(b, i);
        if (found == SPHM_FLUID_FINITE)
            continue;
        ++bad;
        const int32_t id = b->state.id[i];
        if (found < stage || (found == stage && id < particle)) {
            stage = found;
            particle = id;
        }
    }
    sphm_fluid_describe_nonfinite(particle, stage, b->state.time_s, b->state.steps, bad, text, size);
}
