/* Allocation, copy and reordering of the particle arrays, generated from state_arrays.inc. */
#include "core/state.h"

#include <stdlib.h>
#include <string.h>

#include "core/context.h"

#define ALIGNMENT 64
#define BLOCK 16

static size_t capacity_for(size_t count) {
    return (count + BLOCK - 1) / BLOCK * BLOCK;
}

/* Capacities are multiples of 16 elements, so a byte array may end between two cache lines. */
static size_t padded_bytes(size_t bytes) {
    return (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
}

size_t sphm_state_bytes(size_t count) {
    const size_t capacity = capacity_for(count);
    size_t bytes = 0;
#define ARRAY(type, name, role, unit, meaning) bytes += padded_bytes(capacity * sizeof(type));
#include "core/state_arrays.inc"
#undef ARRAY
    return bytes;
}

static void *allocate_zeroed(size_t bytes) {
    void *memory = aligned_alloc(ALIGNMENT, padded_bytes(bytes));
    if (memory)
        memset(memory, 0, padded_bytes(bytes));
    return memory;
}

sphm_status sphm_state_create(sphm_state *state, size_t count, sphm_context *context) {
    memset(state, 0, sizeof *state);
    state->count = count;
    state->capacity = capacity_for(count);
    int complete = 1;
#define ARRAY(type, name, role, unit, meaning)                                                               \
    _Static_assert(sizeof(type) <= SPHM_STATE_ELEMENT_SIZE, "raise SPHM_STATE_ELEMENT_SIZE");                \
    state->name = (type *)allocate_zeroed(state->capacity * sizeof(type));                                   \
    complete = complete && state->name;
#include "core/state_arrays.inc"
#undef ARRAY
    if (!complete) {
        sphm_state_free(state);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the state of %zu particles (%zu bytes)",
                         count, sphm_state_bytes(count));
    }
    for (size_t slot = 0; slot < count; ++slot)
        state->id[slot] = (int32_t)slot;
    return SPHM_OK;
}

void sphm_state_free(sphm_state *state) {
#define ARRAY(type, name, role, unit, meaning) free(state->name);
#include "core/state_arrays.inc"
#undef ARRAY
    memset(state, 0, sizeof *state);
}

void sphm_state_copy_scalars(const sphm_state *from, sphm_state *to) {
    to->time_s = from->time_s;
    to->steps = from->steps;
    to->diffusion_due_s = from->diffusion_due_s;
    memcpy(to->ends, from->ends, sizeof to->ends);
}

void sphm_state_copy(const sphm_state *from, sphm_state *to) {
    sphm_state_copy_scalars(from, to);
#define ARRAY(type, name, role, unit, meaning) memcpy(to->name, from->name, from->count * sizeof(type));
#include "core/state_arrays.inc"
#undef ARRAY
}

void sphm_state_permute(sphm_state *state, const int32_t *order, void *scratch) {
    const size_t count = state->count;
#define ARRAY(type, name, role, unit, meaning)                                                               \
    {                                                                                                        \
        type *old = (type *)scratch;                                                                         \
        memcpy(old, state->name, count * sizeof(type));                                                      \
        for (size_t slot = 0; slot < count; ++slot)                                                          \
            state->name[slot] = old[order[slot]];                                                            \
    }
#include "core/state_arrays.inc"
#undef ARRAY
}

/* slots[id] = the slot of particle id, or a refusal. */
static sphm_status find_slots(const sphm_state *from, int32_t *slots, sphm_context *context) {
    for (size_t id = 0; id < from->count; ++id)
        slots[id] = -1;
    for (size_t slot = 0; slot < from->count; ++slot) {
        const int32_t id = from->id[slot];
        if (id < 0 || (size_t)id >= from->count || slots[id] >= 0)
            return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                             "particle id %d in slot %zu; ids must be 0 ... %zu, each once", id, slot,
                             from->count - 1);
        slots[id] = (int32_t)slot;
    }
    return SPHM_OK;
}

/* Everything but the REST and SCRATCH arrays, into the slots of `to` as they are. */
static void load(const sphm_state *from, sphm_state *to, const int32_t *slots) {
    enum { STATE = 1, REST = 0, SCRATCH = 0 };
    sphm_state_copy_scalars(from, to);
#define ARRAY(type, name, role, unit, meaning)                                                               \
    if (role)                                                                                                \
        for (size_t slot = 0; slot < to->count; ++slot)                                                      \
            to->name[slot] = from->name[slots[to->id[slot]]];
#include "core/state_arrays.inc"
#undef ARRAY
}

static sphm_status prepare_load(const sphm_state *from, const sphm_state *to, int32_t *slots,
                                sphm_context *context) {
    if (from->count != to->count)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "the state has %zu particles; the muscle has %zu",
                         from->count, to->count);
    return find_slots(from, slots, context);
}

sphm_status sphm_state_load_by_id(const sphm_state *from, sphm_state *to, int32_t *slots,
                                  sphm_context *context) {
    const sphm_status status = prepare_load(from, to, slots, context);
    if (status != SPHM_OK)
        return status;
    for (size_t id = 0; id < to->count; ++id)
        to->id[id] = (int32_t)id;
    load(from, to, slots);
    return SPHM_OK;
}

sphm_status sphm_state_load_in_slots(const sphm_state *from, sphm_state *to, int32_t *slots,
                                     sphm_context *context) {
    const sphm_status status = prepare_load(from, to, slots, context);
    if (status == SPHM_OK)
        load(from, to, slots);
    return status;
}
