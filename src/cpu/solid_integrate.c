/* Integration of the solid tissue; see solid_integrate.h. Every particle is moved as if it were free, axis by
 * axis, for that is a loop over arrays; the attached ones are then put where their end is. */
#include "cpu/solid_integrate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "cpu/parallel.h"
#include "cpu/solid_ends.h"

void sphm_solid_attached_free(sphm_solid_attached *attached) {
    free(attached->slot);
    free(attached->start);
    memset(attached, 0, sizeof *attached);
}

sphm_status sphm_solid_attached_create(sphm_solid_attached *attached, const sphm_state *state,
                                       sphm_context *context) {
    const size_t blocks = sphm_block_count(state->count);
    memset(attached, 0, sizeof *attached);
    attached->slot = (int32_t *)malloc((state->count + 1) * sizeof *attached->slot);
    attached->start = (size_t *)malloc((blocks + 1) * sizeof *attached->start);
    if (!attached->slot || !attached->start) {
        sphm_solid_attached_free(attached);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to list the attached of %zu particles",
                         state->count);
    }
    for (size_t block = 0; block < blocks; ++block) {
        attached->start[block] = attached->count;
        for (size_t i = sphm_block_begin(block); i < sphm_block_end(block, state->count); ++i)
            if (state->attachment[i] != SPHM_FREE)
                attached->slot[attached->count++] = (int32_t)i;
    }
    attached->start[blocks] = attached->count;
    return SPHM_OK;
}

/* Where the state keeps an axis of the motion. */
typedef struct axis_arrays {
    sphm_real *shift, *position, *velocity;
    const sphm_real *rest, *force;
} axis_arrays;

static void find_arrays(const sphm_state *s, sphm_real *const force[3], axis_arrays axis[3]) {
    const axis_arrays found[3] = {{s->shift_x, s->x, s->vx, s->rest_x, force[0]},
                                  {s->shift_y, s->y, s->vy, s->rest_y, force[1]},
                                  {s->shift_z, s->z, s->vz, s->rest_z, force[2]}};
    memcpy(axis, found, sizeof found);
}

static sphm_solid_mover mover_of(const sphm_model *model, double step_s) {
    const sphm_parameters *p = &model->parameters;
    sphm_solid_mover m;
    m.kick = (sphm_real)(step_s / (model->particle_mass_kg * p->mass_scaling));
    m.keep = (sphm_real)exp(-p->velocity_damping * step_s);
    m.step = (sphm_real)step_s;
    for (int d = 0; d < 3; ++d)
        m.gravity[d] = (sphm_real)(step_s * p->gravity[d] / p->mass_scaling);
    return m;
}

static void move_free(const sphm_solid_mover *mover, const sphm_real *relative_volume,
                      const axis_arrays axis[3], size_t begin, size_t end) {
    const sphm_solid_mover m = *mover;
    for (int d = 0; d < 3; ++d) {
        const axis_arrays a = axis[d];
        const sphm_real gravity = m.gravity[d];
#pragma omp simd
        for (size_t i = begin; i < end; ++i) {
            sphm_real shift = a.shift[i], velocity = a.velocity[i];
            sphm_solid_move_along(&m, m.kick / relative_volume[i], gravity, a.force[i], &shift, &velocity);
            a.shift[i] = shift;
            a.velocity[i] = velocity;
            a.position[i] = a.rest[i] + shift;
        }
    }
}

static void carry_attached(const sphm_state *s, const axis_arrays axis[3],
                           const sphm_end_frame ends[SPHM_END_COUNT], const int32_t *slot,
                           const int32_t *end) {
    for (; slot < end; ++slot) {
        const size_t i = (size_t)*slot;
        const double rest[3] = {(double)s->rest_x[i], (double)s->rest_y[i], (double)s->rest_z[i]};
        sphm_real motion[8];
        sphm_end_carry(&ends[s->attachment[i] == SPHM_ATTACHED_ORIGIN ? SPHM_END_ORIGIN : SPHM_END_INSERTION],
                       rest, motion);
        for (int d = 0; d < 3; ++d) {
            axis[d].shift[i] = motion[d];
            axis[d].velocity[i] = motion[4 + d];
            axis[d].position[i] = axis[d].rest[i] + motion[d];
        }
    }
}

/* The first slot whose motion is not finite, or -1. */
static int32_t first_nonfinite(const axis_arrays axis[3], size_t begin, size_t end) {
    sphm_real zero = 0; /* unless something is not finite */
    for (int d = 0; d < 3; ++d) {
        const axis_arrays a = axis[d];
#pragma omp simd reduction(+ : zero)
        for (size_t i = begin; i < end; ++i)
            zero += a.shift[i] * 0 + a.velocity[i] * 0;
    }
    if (zero == 0)
        return -1;
    for (size_t i = begin; i < end; ++i)
        for (int d = 0; d < 3; ++d)
            if (!isfinite(axis[d].shift[i]) || !isfinite(axis[d].velocity[i]))
                return (int32_t)i;
    return -1;
}

void sphm_solid_integrate(const sphm_model *model, sphm_state *state, sphm_real *const force[3],
                          const sphm_solid_attached *attached, const sphm_drive *drive, double step_s,
                          int threads, int32_t *block_nonfinite) {
#ifndef _OPENMP
    (void)threads;
#endif
    const sphm_solid_mover mover = mover_of(model, step_s);
    axis_arrays axis[3];
    sphm_end_frame ends[SPHM_END_COUNT];
    find_arrays(state, force, axis);
    for (int end = 0; end < SPHM_END_COUNT; ++end)
        ends[end] = sphm_solid_move_end(model, state, force, &drive->ends[end], end, step_s);
    const size_t blocks = sphm_block_count(state->count);
#pragma omp parallel for num_threads(threads) schedule(static)
    for (size_t block = 0; block < blocks; ++block) {
        const size_t begin = sphm_block_begin(block), end = sphm_block_end(block, state->count);
        move_free(&mover, state->relative_volume, axis, begin, end);
        carry_attached(state, axis, ends, attached->slot + attached->start[block],
                       attached->slot + attached->start[block + 1]);
        block_nonfinite[block] = first_nonfinite(axis, begin, end);
    }
}
