/* The two sweeps of the solid tissue; see solid_sweeps.h for what they read and write, doc/solid.md for the
 * equations. */
#include "cpu/solid_sweeps.h"

#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "cpu/parallel.h"

/* Vectors across components. The compiler splits them where the machine's are narrower. */
typedef sphm_real vector8 __attribute__((vector_size(8 * sizeof(sphm_real))));
typedef sphm_real vector16 __attribute__((vector_size(16 * sizeof(sphm_real))));
#ifdef SPH_MUSCLE_DOUBLE
typedef int64_t lanes16 __attribute__((vector_size(16 * sizeof(int64_t))));
#else
typedef int32_t lanes16 __attribute__((vector_size(16 * sizeof(int32_t))));
#endif

static void *allocate(size_t elements, size_t size) {
    const size_t bytes = (elements * size + 127) / 128 * 128;
    void *memory = aligned_alloc(128, bytes ? bytes : 128);
    if (memory)
        memset(memory, 0, bytes);
    return memory;
}

sphm_status sphm_solid_lines_create(sphm_solid_lines *lines, size_t count, sphm_context *context) {
    const size_t blocks = sphm_block_count(count);
    memset(lines, 0, sizeof *lines);
    lines->count = count;
    lines->motion = (sphm_real *)allocate(SPHM_MOTION_LINE * count, sizeof(sphm_real));
    lines->stress = (sphm_real *)allocate(SPHM_STRESS_LINE * count, sizeof(sphm_real));
    lines->force = (sphm_real *)allocate(4 * count, sizeof(sphm_real));
    lines->block_modulus_Pa = (double *)allocate(blocks, sizeof(double));
    lines->block_inverted = (int32_t *)allocate(blocks, sizeof(int32_t));
    if (lines->motion && lines->stress && lines->force && lines->block_modulus_Pa && lines->block_inverted)
        return SPHM_OK;
    sphm_solid_lines_free(lines);
    return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the solid tissue of %zu particles", count);
}

void sphm_solid_lines_free(sphm_solid_lines *lines) {
    free(lines->motion);
    free(lines->stress);
    free(lines->force);
    free(lines->block_modulus_Pa);
    free(lines->block_inverted);
    memset(lines, 0, sizeof *lines);
}

static inline vector8 load8(const sphm_real *from) {
    return *(const vector8 *)__builtin_assume_aligned(from, 8 * sizeof(sphm_real));
}

static inline vector16 load16(const sphm_real *from) {
    return *(const vector16 *)__builtin_assume_aligned(from, 16 * sizeof(sphm_real));
}

/* sums[4 * q + d] of q = u, v: the sum over the row of (q_j - q_i)_d w X_c, in sums[c]. Four pairs at a time,
 * even and odd ones apart, to keep enough additions in flight; the order of the sum is fixed. */
static inline void sum_deformation(const sphm_solid_field *field, const sphm_solid_lines *lines, size_t slot,
                                   vector8 sums[3]) {
    const size_t begin = field->rows->row_start[slot];
    const size_t last = begin + (((size_t)field->rows->row_count[slot] + 3) & ~(size_t)3);
    const int32_t *neighbour = field->rows->slot;
    const sphm_real *pair = field->gradient->pair, *motion = lines->motion;
    const vector8 own = load8(motion + SPHM_MOTION_LINE * slot);
    vector8 sum[2][3];
    memset(sum, 0, sizeof sum);
    for (size_t k = begin; k < last; k += 4) {
        const sphm_real *w = pair + 4 * k;
        for (int p = 0; p < 4; ++p, w += 4) {
            const vector8 difference =
                load8(motion + SPHM_MOTION_LINE * (size_t)neighbour[k + (size_t)p]) - own;
            sum[p & 1][0] += difference * w[0];
            sum[p & 1][1] += difference * w[1];
            sum[p & 1][2] += difference * w[2];
        }
    }
    for (int c = 0; c < 3; ++c)
        sums[c] = sum[0][c] + sum[1][c];
}

/* H = S B of a symmetric B, with S in the columns `sums`. */
static inline void correct_deformation(const vector8 sums[3], const sphm_real b[6], sphm_real H[9],
                                       sphm_real rate[9]) {
    const vector8 columns[3] = {sums[0] * b[0] + sums[1] * b[1] + sums[2] * b[2],
                                sums[0] * b[1] + sums[1] * b[3] + sums[2] * b[4],
                                sums[0] * b[2] + sums[1] * b[4] + sums[2] * b[5]};
    for (int i = 0; i < 3; ++i)
        for (int c = 0; c < 3; ++c) {
            H[3 * i + c] = columns[c][i];
            rate[3 * i + c] = columns[c][4 + i];
        }
}

void sphm_solid_deformation(const sphm_solid_field *field, const sphm_solid_lines *lines, size_t slot,
                            sphm_real H[9], sphm_real rate[9]) {
    vector8 sums[3];
    sum_deformation(field, lines, slot, sums);
    correct_deformation(sums, field->gradient->correction + 6 * slot, H, rate);
}

/* Some particles' deformation gradients and what comes out of them, component by component, so that the
 * material is evaluated for many particles at a time. Small enough to stay in the first-level cache. */
#define LANES 64
typedef struct stress_block {
    sphm_real H[9][LANES], rate[9][LANES], A[9][LANES];
    sphm_real fibre[3][LANES], activation[LANES], correction[6][LANES];
    sphm_real modulus[LANES], J[LANES], pressure[LANES];
} stress_block;

/* Lanes beyond the last particle keep what the previous batch left there: finite, and never stored. */
static void gather_block(const sphm_solid_field *field, const sphm_solid_lines *lines, size_t begin,
                         size_t end, stress_block *b) {
    for (size_t slot = begin; slot < end; ++slot) {
        const size_t i = slot - begin;
        sphm_real H[9], rate[9];
        sphm_solid_deformation(field, lines, slot, H, rate);
        for (int d = 0; d < 9; ++d) {
            b->H[d][i] = H[d];
            b->rate[d][i] = rate[d];
        }
        for (int d = 0; d < 6; ++d)
            b->correction[d][i] = field->gradient->correction[6 * slot + (size_t)d];
    }
    const size_t bytes = (end - begin) * sizeof(sphm_real);
    memcpy(b->fibre[0], field->fibre_x + begin, bytes);
    memcpy(b->fibre[1], field->fibre_y + begin, bytes);
    memcpy(b->fibre[2], field->fibre_z + begin, bytes);
    memcpy(b->activation, field->activation + begin, bytes);
}

/* The material at one particle: from H and its rate to A. */
static inline __attribute__((always_inline)) void evaluate_particle(const sphm_solid_field *field,
                                                                    const sphm_solid_constants *constants,
                                                                    size_t i, stress_block *b) {
    const sphm_real half_k = field->hourglass_Pa / 2, tau = field->hourglass_time_s;
    sphm_real F[9], rate[9], P[9];
    sphm_fibre_stress fibre;
#pragma GCC unroll 9
    for (int d = 0; d < 9; ++d) {
        F[d] = b->H[d][i] + (sphm_real)(d % 4 == 0);
        rate[d] = b->rate[d][i];
    }
    const sphm_real f0[3] = {b->fibre[0][i], b->fibre[1][i], b->fibre[2][i]};
    const sphm_real J = sphm_solid_stress(F, f0, b->activation[i], constants, P, &fibre);
    sphm_solid_add_viscous_stress(F, rate, f0, field->viscosity_Pa_s, 1 / J, P);
    sphm_real trace = 0; /* of P F^T = J sigma */
#pragma GCC unroll 9
    for (int d = 0; d < 9; ++d)
        trace += P[d] * F[d];
    b->J[i] = J;
    b->pressure[i] = trace / (-3 * J);
    b->modulus[i] = sphm_solid_wave_modulus(F, J, &fibre, constants);
    const sphm_real xx = b->correction[0][i], xy = b->correction[1][i], xz = b->correction[2][i],
                    yy = b->correction[3][i], yz = b->correction[4][i], zz = b->correction[5][i];
#pragma GCC unroll 3
    for (int r = 0; r < 9; r += 3) {
        b->A[r][i] = P[r] * xx + P[r + 1] * xy + P[r + 2] * xz - half_k * (b->H[r][i] + tau * rate[r]);
        b->A[r + 1][i] =
            P[r] * xy + P[r + 1] * yy + P[r + 2] * yz - half_k * (b->H[r + 1][i] + tau * rate[r + 1]);
        b->A[r + 2][i] =
            P[r] * xz + P[r + 1] * yz + P[r + 2] * zz - half_k * (b->H[r + 2][i] + tau * rate[r + 2]);
    }
}

static void evaluate_block(const sphm_solid_field *field, stress_block *b) {
    const sphm_solid_constants constants = field->constants;
    const sphm_solid_field local = *field;
#pragma omp simd
    for (size_t i = 0; i < LANES; ++i)
        evaluate_particle(&local, &constants, i, b);
}

static void store_block(const sphm_solid_field *field, sphm_solid_lines *lines, size_t begin, size_t end,
                        const stress_block *b) {
    const sphm_real k = field->hourglass_Pa, tau = field->hourglass_time_s;
    double *modulus = lines->block_modulus_Pa + begin / SPHM_BLOCK;
    int32_t *inverted = lines->block_inverted + begin / SPHM_BLOCK;
    for (size_t slot = begin; slot < end; ++slot) {
        const size_t i = slot - begin;
        sphm_real *line = lines->stress + SPHM_STRESS_LINE * slot;
        const sphm_real *motion = lines->motion + SPHM_MOTION_LINE * slot;
        for (int c = 0; c < 3; ++c)
            for (int r = 0; r < 3; ++r)
                line[4 * c + r] = b->A[3 * r + c][i];
        for (int r = 0; r < 3; ++r)
            line[12 + r] = k * (motion[r] + tau * motion[4 + r]);
        field->density[slot] = field->density_kg_per_m3 / b->J[i];
        field->pressure[slot] = b->pressure[i];
        *modulus = (double)b->modulus[i] > *modulus ? (double)b->modulus[i] : *modulus;
        if (*inverted < 0 && !(b->J[i] > 0))
            *inverted = (int32_t)slot;
    }
}

void sphm_solid_stress_sweep(const sphm_solid_field *field, sphm_solid_lines *lines) {
    const size_t blocks = sphm_block_count(lines->count);
#pragma omp parallel for num_threads(field->threads) schedule(static)
    for (size_t block = 0; block < blocks; ++block) {
        const size_t end = sphm_block_end(block, lines->count);
        stress_block b;
        memset(&b, 0, sizeof b);
        lines->block_modulus_Pa[block] = 0;
        lines->block_inverted[block] = -1;
        for (size_t begin = sphm_block_begin(block); begin < end; begin += LANES) {
            const size_t batch_end = begin + LANES < end ? begin + LANES : end;
            gather_block(field, lines, begin, batch_end, &b);
            evaluate_block(field, &b);
            store_block(field, lines, begin, batch_end, &b);
        }
    }
}

/* w X, w Y, w Z, w of pair p of four, each four times. */
#ifdef __clang__
#define SPREAD(w, p)                                                                                         \
    __builtin_shufflevector(w, w, 4 * p, 4 * p, 4 * p, 4 * p, 4 * p + 1, 4 * p + 1, 4 * p + 1, 4 * p + 1,    \
                            4 * p + 2, 4 * p + 2, 4 * p + 2, 4 * p + 2, 4 * p + 3, 4 * p + 3, 4 * p + 3,     \
                            4 * p + 3)
#else
#define SPREAD(w, p)                                                                                         \
    __builtin_shuffle(w, (lanes16){4 * p, 4 * p, 4 * p, 4 * p, 4 * p + 1, 4 * p + 1, 4 * p + 1, 4 * p + 1,   \
                                   4 * p + 2, 4 * p + 2, 4 * p + 2, 4 * p + 2, 4 * p + 3, 4 * p + 3,         \
                                   4 * p + 3, 4 * p + 3})
#endif

/* f_i/V = sum_j [(A_i + A_j) w X_ij + w k (u_j - u_i + tau (v_j - v_i))]: the line of j minus the line of i
 * with its matrix negated, times the pair's four numbers, then the sum of the four quarters. */
static inline void sum_force(const sphm_solid_field *field, const sphm_solid_lines *lines, size_t slot,
                             sphm_real force[4]) {
    const size_t begin = field->rows->row_start[slot];
    const size_t last = begin + (((size_t)field->rows->row_count[slot] + 3) & ~(size_t)3);
    const int32_t *neighbour = field->rows->slot;
    const sphm_real *pair = field->gradient->pair, *stress = lines->stress;
    const vector16 sign = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 1, 1, 1, 1};
    const vector16 own = load16(stress + SPHM_STRESS_LINE * slot) * sign;
    vector16 even, odd;
    memset(&even, 0, sizeof even);
    memset(&odd, 0, sizeof odd);
    for (size_t k = begin; k < last; k += 4) {
        const vector16 w = load16(pair + 4 * k);
        const int32_t *j = neighbour + k;
        even += (load16(stress + SPHM_STRESS_LINE * (size_t)j[0]) - own) * SPREAD(w, 0);
        odd += (load16(stress + SPHM_STRESS_LINE * (size_t)j[1]) - own) * SPREAD(w, 1);
        even += (load16(stress + SPHM_STRESS_LINE * (size_t)j[2]) - own) * SPREAD(w, 2);
        odd += (load16(stress + SPHM_STRESS_LINE * (size_t)j[3]) - own) * SPREAD(w, 3);
    }
    const vector16 sum = even + odd;
    for (int d = 0; d < 4; ++d)
        force[d] = field->particle_volume_m3 * ((sum[d] + sum[4 + d]) + (sum[8 + d] + sum[12 + d]));
}

void sphm_solid_force_sweep(const sphm_solid_field *field, sphm_solid_lines *lines) {
    const size_t blocks = sphm_block_count(lines->count);
#pragma omp parallel for num_threads(field->threads) schedule(static)
    for (size_t block = 0; block < blocks; ++block)
        for (size_t slot = sphm_block_begin(block); slot < sphm_block_end(block, lines->count); ++slot)
            sum_force(field, lines, slot, lines->force + 4 * slot);
}
