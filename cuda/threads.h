/* What threads of both tissues use. Compiled by nvcc, which runs one thread each, and by the tests, which run
 * them one after the other. */
#ifndef SPHM_CUDA_THREADS_H
#define SPHM_CUDA_THREADS_H

#include "core/membrane_schedule.h"
#include "cuda/membrane_plan.h"

/* Threads that share a row; divides SPHM_ROW_ALIGN. */
#define SPHM_DEVICE_LANES 8

/* Integer, so that the order does not matter. */
SPHM_FN void sphm_count_up(uint32_t *counter) {
#ifdef __CUDA_ARCH__
    atomicAdd(counter, 1u);
#else
    ++*counter;
#endif
}

SPHM_FN void sphm_add_up(uint64_t *sum, uint64_t value) {
#ifdef __CUDA_ARCH__
    atomicAdd((unsigned long long *)sum, (unsigned long long)value);
#else
    *sum += value;
#endif
}

SPHM_FN void sphm_keep_smallest(uint64_t *smallest, uint64_t value) {
#ifdef __CUDA_ARCH__
    atomicMin((unsigned long long *)smallest, (unsigned long long)value);
#else
    *smallest = value < *smallest ? value : *smallest;
#endif
}

SPHM_FN void sphm_keep_smallest32(uint32_t *smallest, uint32_t value) {
#ifdef __CUDA_ARCH__
    atomicMin(smallest, value);
#else
    *smallest = value < *smallest ? value : *smallest;
#endif
}

/* Four numbers at a time, 16 bytes: lines and pairs are aligned to that. */
SPHM_FN void sphm_load4(const sphm_real *from, sphm_real to[4]) {
#if defined(__CUDA_ARCH__) && !defined(SPH_MUSCLE_DOUBLE)
    const float4 four = *(const float4 *)from;
    to[0] = four.x;
    to[1] = four.y;
    to[2] = four.z;
    to[3] = four.w;
#else
    for (int c = 0; c < 4; ++c)
        to[c] = from[c];
#endif
}

SPHM_FN void sphm_store4(sphm_real *to, const sphm_real from[4]) {
#if defined(__CUDA_ARCH__) && !defined(SPH_MUSCLE_DOUBLE)
    *(float4 *)to = make_float4(from[0], from[1], from[2], from[3]);
#else
    for (int c = 0; c < 4; ++c)
        to[c] = from[c];
#endif
}

/* The cell model of a particle with these electrode bits, over step_ms. */
SPHM_FN void sphm_thread_react(const sphm_membrane_constants *membrane, const sphm_membrane_table *table,
                               int electrodes, sphm_real step_ms, sphm_real *potential, sphm_real *recovery) {
    const int mask = electrodes & (SPHM_ELECTRODE_MASKS - 1);
    sphm_membrane_drive drive;
    drive.current_uA_per_mm2 = table->current[mask];
    drive.lower_mV = table->lower[mask];
    drive.upper_mV = table->upper[mask];
    sphm_membrane_advance(membrane, drive, step_ms, potential, recovery);
}

/* Buffer that diffusion sweep `substep` (0, 1, ...) reads; it writes the other one. */
SPHM_FN int sphm_spread_source(const sphm_membrane_plan *p, int substep) {
    return (p->buffer + substep) & 1;
}

/* What the cell model takes after diffusion sweep `substep`. */
SPHM_FN sphm_real sphm_spread_reaction_ms(const sphm_membrane_plan *p, int substep) {
    return substep + 1 < p->substeps ? p->between_ms : p->last_ms;
}

#endif
