/* How many threads a parallel region gets. */
#ifndef SPHM_CORE_THREADS_H
#define SPHM_CORE_THREADS_H

#include <stdint.h>

#ifdef _OPENMP
#include <omp.h>
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Of particles, where a loop over them is short: below this the hand-over between threads costs more than
 * they save. */
#define SPHM_SERIAL_BELOW 5000

/* The parameter `threads`: 0 is all there are. */
static inline int sphm_team_size(int64_t threads) {
#ifdef _OPENMP
    return threads > 0 ? (int)threads : omp_get_max_threads();
#else
    (void)threads;
    return 1;
#endif
}

#ifdef __cplusplus
}
#endif
#endif
