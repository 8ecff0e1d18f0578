/* The changing part of a muscle: particle arrays in cell order (state_arrays.inc), time, and what drives it.
 * The constant part is the model (model.h). */
#ifndef SPHM_CORE_STATE_H
#define SPHM_CORE_STATE_H

#include "kernels/end_block.h"
#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sphm_state {
    size_t count;    /* particles */
    size_t capacity; /* length of every array: count rounded up to a multiple of 16; the tail is zero */
    double time_s;
    uint64_t steps;
    double diffusion_due_s; /* by how much the diffusion of the potential lags behind time_s; membrane */
    sphm_end_body ends[2];  /* the attached particles as rigid blocks, origin and insertion; integrate (solid)
                             */
#define ARRAY(type, name, role, unit, meaning) type *name;
#include "core/state_arrays.inc"
#undef ARRAY
} sphm_state;

/* The largest sizeof of any array's element: what one scratch array for sphm_state_permute() needs. */
#define SPHM_STATE_ELEMENT_SIZE 8

/* Allocates every array (64-byte aligned, zeroed, ids 0 ... count - 1). On a refusal `state` is zeroed. */
sphm_status sphm_state_create(sphm_state *state, size_t count, sphm_context *context);
void sphm_state_free(sphm_state *state); /* a zeroed state is fine */
/* Copies time, steps, diffusion_due_s, the ends and every array. Both have the same count. */
void sphm_state_copy_scalars(const sphm_state *from, sphm_state *to); /* all but the arrays */
void sphm_state_copy(const sphm_state *from, sphm_state *to);
/* Reorders every array: the new slot s gets what was in slot order[s]. `scratch` holds capacity elements of
 * SPHM_STATE_ELEMENT_SIZE bytes. */
void sphm_state_permute(sphm_state *state, const int32_t *order, void *scratch);
/* Writes the STATE arrays of `from`, whatever its slot order, into `to` in slots 0, 1, ... by particle id,
 * with time, steps, diffusion_due_s and the ends. REST arrays of `to` must be by id already.
 * SPHM_REFUSED_ARGUMENT, with `to` unchanged, when the ids of `from` are not a permutation. `slots` is
 * scratch of count elements. */
sphm_status sphm_state_load_by_id(const sphm_state *from, sphm_state *to, int32_t *slots,
                                  sphm_context *context);
/* The same into the slots of `to` as they are. */
sphm_status sphm_state_load_in_slots(const sphm_state *from, sphm_state *to, int32_t *slots,
                                     sphm_context *context);
/* FNV-1a of the time, of diffusion_due_s, of the ends and of every STATE array by particle id, as
 * little-endian bytes (snapshot.c); 0 without memory. */
uint64_t sphm_state_hash(const sphm_state *state);
/* Bytes that sphm_state_create() allocates for `count` particles. */
size_t sphm_state_bytes(size_t count);

#ifdef __cplusplus
}
#endif
#endif
