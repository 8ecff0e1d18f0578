/* The changing part of a muscle: particle arrays in cell order (state_arrays.inc), time, and what drives it.
 * The constant part is the model (model.h). */
#ifndef SPHM_CORE_STATE_H
#define SPHM_CORE_STATE_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_state {
    size_t count;    /* particles */
    size_t capacity; /* length of every array: count rounded up to a multiple of 16; the tail is zero */
    double time_s;
    uint64_t steps;
#define ARRAY(type, name, role, unit, meaning) type *name;
#include "core/state_arrays.inc"
#undef ARRAY
} sphm_state;

#ifdef __cplusplus
}
#endif
#endif
