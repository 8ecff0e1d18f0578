/* Threads of the CPU back end. Every loop over particles is cut into blocks of SPHM_BLOCK particles,
 * whatever the number of threads; a sum over particles is one partial sum a block, added up serially in
 * double. So results are bitwise the same for any number of threads. */
#ifndef SPHM_CPU_PARALLEL_H
#define SPHM_CPU_PARALLEL_H

#include <time.h>

#include "core/threads.h"
#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A power of two above SPHM_ROW_ALIGN: blocks begin on a cache line in every array. */
#define SPHM_BLOCK 256

static inline size_t sphm_block_count(size_t count) {
    return (count + SPHM_BLOCK - 1) / SPHM_BLOCK;
}
static inline size_t sphm_block_begin(size_t block) {
    return block * SPHM_BLOCK;
}
static inline size_t sphm_block_end(size_t block, size_t count) {
    const size_t end = (block + 1) * SPHM_BLOCK;
    return end < count ? end : count;
}

static inline double sphm_wall_clock_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

#ifdef __cplusplus
}
#endif
#endif
