/* The membrane sweep on the CPU (eqs 24, 25, 27).
 *
 * One sub-step of dt is split symmetrically (Strang, SIAM J. Numer. Anal. 5 (1968) 506): half a step of the
 * cell model, diffusion over dt by forward Euler, half a step of the cell model. The halves of neighbouring
 * sub-steps are joined, so that n sub-steps cost n gathers over the pairs and n + 1 cell sweeps. Beside the
 * gather the cell sweep costs next to nothing.
 *
 * A muscle's mechanics asks for steps down to a quarter of what the membrane needs. Then the cell model, and
 * with it the electrodes, takes every step; the diffusion waits until one more step would be too long for it,
 * and catches up in the middle of a step. How much is due is part of the state. What is seen between lacks
 * the diffusion of less than one sub-step, an error of the same order as the splitting's. */
#include "cpu/membrane.h"
#include "core/membrane_schedule.h"
#include "cpu/parallel.h"
#include "cpu/row.h"

#include <math.h>
#include <string.h>

/* Cell model over step_ms for the slots begin ... end: `from` and recovery -> membrane_potential, recovery.
 */
static void react(sphm_state *s, const sphm_membrane_constants *constants, const sphm_membrane_table *table,
                  const sphm_real *from, sphm_real step_ms, size_t begin, size_t end) {
    const sphm_membrane_constants c = *constants;
    sphm_real *potential = s->membrane_potential, *recovery = s->recovery;
    const uint8_t *electrodes = s->electrodes;
    if (!table->anything) {
        sphm_membrane_drive none;
        none.current_uA_per_mm2 = 0;
        none.lower_mV = -(sphm_real)INFINITY;
        none.upper_mV = (sphm_real)INFINITY;
#pragma omp simd
        for (size_t i = begin; i < end; i++) {
            sphm_real v = from[i], w = recovery[i];
            sphm_membrane_advance(&c, none, step_ms, &v, &w);
            potential[i] = v;
            recovery[i] = w;
        }
        return;
    }
#pragma omp simd
    for (size_t i = begin; i < end; i++) {
        const int mask = electrodes[i] & (SPHM_ELECTRODE_MASKS - 1);
        sphm_membrane_drive drive;
        drive.current_uA_per_mm2 = table->current[mask];
        drive.lower_mV = table->lower[mask];
        drive.upper_mV = table->upper[mask];
        sphm_real v = from[i], w = recovery[i];
        sphm_membrane_advance(&c, drive, step_ms, &v, &w);
        potential[i] = v;
        recovery[i] = w;
    }
}

/* sum_j w_ij (potential_j - potential_i), before the 16 lanes are added up. Differences, not sum w V - V sum
 * w, so that a uniform potential stays uniform to the bit. */
SPHM_INLINE sphm_lanes flow(const sphm_neighbours *n, const sphm_real *weight, const sphm_real *potential,
                            size_t i) {
    sphm_lanes sum = {0};
    const size_t end = n->row_start[i + 1];
    for (size_t k = n->row_start[i]; k < end; k += SPHM_LANES) {
        sphm_lanes w;
        memcpy(&w, weight + k, sizeof w);
        sum += w * (sphm_row_gather(potential, n->slot + k) - potential[i]);
    }
    return sum;
}

/* membrane_next = potential + dt flow. Four rows at a time, because their lanes are added up together. */
static void diffuse(sphm_state *s, const sphm_neighbours *n, const sphm_real *weight, sphm_real step_ms,
                    size_t begin, size_t end) {
    const sphm_real *potential = s->membrane_potential;
    const sphm_lanes none = {0};
    for (size_t i = begin; i < end; i += 4) {
        const size_t rows = end - i < 4 ? end - i : 4;
        const sphm_pack sums = sphm_lanes_sums(flow(n, weight, potential, i),
                                               rows > 1 ? flow(n, weight, potential, i + 1) : none,
                                               rows > 2 ? flow(n, weight, potential, i + 2) : none,
                                               rows > 3 ? flow(n, weight, potential, i + 3) : none);
        const sphm_real sum[4] = {sums.x, sums.y, sums.z, sums.w};
        for (size_t r = 0; r < rows; ++r)
            s->membrane_next[i + r] = potential[i + r] + step_ms * sum[r];
    }
}

static void filter_activation(sphm_state *s, const sphm_membrane_constants *constants, double step_ms,
                              size_t begin, size_t end) {
    const sphm_membrane_constants c = *constants;
    const sphm_real rise = (sphm_real)-expm1(-step_ms / (double)c.activation_ms);
    const sphm_real fall = (sphm_real)-expm1(-step_ms / (double)c.deactivation_ms);
    const sphm_real *potential = s->membrane_potential;
    sphm_real *activation = s->activation;
#pragma omp simd
    for (size_t i = begin; i < end; i++)
        activation[i] =
            sphm_activation_filter(activation[i], sphm_activation_target(&c, potential[i]), rise, fall);
}

size_t sphm_membrane_substeps(const sphm_membrane_constants *constants, const sphm_diffusion *diffusion,
                              double step_ms) {
    return sphm_membrane_count_substeps(constants, diffusion->stable_step_ms, step_ms);
}

/* One cell sweep over all particles; the last one of a step also filters the activation over step_ms. */
static void react_all(sphm_state *s, const sphm_membrane_constants *c, const sphm_membrane_table *table,
                      const sphm_real *from, double reaction_ms, double step_ms, int last, int threads) {
#ifndef _OPENMP
    (void)threads;
#endif
#pragma omp parallel for schedule(static) num_threads(threads)
    for (size_t b = 0; b < sphm_block_count(s->count); b++) {
        const size_t begin = sphm_block_begin(b), end = sphm_block_end(b, s->count);
        react(s, c, table, from, (sphm_real)reaction_ms, begin, end);
        if (last)
            filter_activation(s, c, step_ms, begin, end);
    }
}

/* What diffuses: rows with their weights, or columns. */
typedef struct diffuser {
    const sphm_neighbours *rows;
    const sphm_real *weight;
    const sphm_column_diffusion *columns;
} diffuser;

static void diffuse_all(sphm_state *s, const diffuser *d, double step_ms, int threads) {
    if (d->columns) {
        sphm_column_diffusion_sweep(d->columns, s, step_ms, threads);
        return;
    }
#ifndef _OPENMP
    (void)threads;
#endif
#pragma omp parallel for schedule(static) num_threads(threads)
    for (size_t b = 0; b < sphm_block_count(s->count); b++)
        diffuse(s, d->rows, d->weight, (sphm_real)step_ms, sphm_block_begin(b), sphm_block_end(b, s->count));
}

static void advance(sphm_state *state, const diffuser *diffusion, double stable_step_ms,
                    const sphm_membrane_constants *constants, const sphm_drive *drive, double step_s,
                    int threads, sphm_timing *timing) {
    const double step_ms = step_s * 1e3;
    const sphm_membrane_schedule schedule =
        sphm_membrane_schedule_step(constants, stable_step_ms, state->diffusion_due_s, step_s);
    const size_t substeps = schedule.substeps;
    const double dt = schedule.reaction_ms;
    const sphm_membrane_table table = sphm_membrane_tabulate(constants, drive);
    double before = sphm_wall_clock_s(), cell_s = 0, diffusion_s = 0;

    const sphm_real *from = state->membrane_potential;
    for (size_t k = 0; k <= substeps; k++) {
        const int last = k == substeps;
        const int half = substeps && (k == 0 || last);
        react_all(state, constants, &table, from, half ? dt / 2 : dt, step_ms, last, threads);
        const double between = sphm_wall_clock_s();
        cell_s += between - before;
        if (last)
            break;
        diffuse_all(state, diffusion, schedule.diffusion_ms, threads);
        from = state->membrane_next;
        before = sphm_wall_clock_s();
        diffusion_s += before - between;
    }
    state->diffusion_due_s = schedule.due_s;
    if (timing) {
        timing->cell_model_s += cell_s;
        timing->diffusion_s += diffusion_s;
    }
}

void sphm_cpu_membrane_step(sphm_state *state, const sphm_neighbours *neighbours,
                            const sphm_diffusion *diffusion, const sphm_membrane_constants *constants,
                            const sphm_drive *drive, double step_s, int threads, sphm_timing *timing) {
    const diffuser d = {neighbours, diffusion->weight, NULL};
    advance(state, &d, diffusion->stable_step_ms, constants, drive, step_s, threads, timing);
}

void sphm_cpu_membrane_step_columns(sphm_state *state, const sphm_column_diffusion *columns,
                                    double stable_step_ms, const sphm_membrane_constants *constants,
                                    const sphm_drive *drive, double step_s, int threads,
                                    sphm_timing *timing) {
    const diffuser d = {NULL, NULL, columns};
    advance(state, &d, stable_step_ms, constants, drive, step_s, threads, timing);
}

sphm_status sphm_cpu_build_diffusion(sphm_diffusion *diffusion, const sphm_neighbours *rows,
                                     const sphm_model *model, const sphm_state *state, int threads,
                                     sphm_context *context) {
    sphm_diffusion_input input;
    memset(&input, 0, sizeof input);
    input.laplacian = model->parameters.laplacian;
    input.support_radius_m = model->body.support_radius_m;
    input.particle_volume_m3 = model->particle_volume_m3;
    input.diffusion_mm2_per_ms = (double)model->membrane.diffusion_mm2_per_ms;
    input.anisotropy_ratio = (double)model->membrane.anisotropy_ratio;
    input.x = state->listed_x;
    input.y = state->listed_y;
    input.z = state->listed_z;
    input.fibre_x = state->fibre_x;
    input.fibre_y = state->fibre_y;
    input.fibre_z = state->fibre_z;
    return sphm_diffusion_build(diffusion, rows, &input, threads, context);
}
