/* The two sweeps of the solid tissue; see solid_sweeps.h for what they read and write, doc/solid.md for the
 * equations. */
#include "cpu/solid_sweeps.h"

#include <string.h>

#include "cpu/parallel.h"
#include "cpu/solid_material.h"

#ifdef __AVX512F__
#include <immintrin.h>
#endif

/* Vectors across components, or across 16 particles. The compiler splits them where the machine's are
 * narrower. */
typedef sphm_real vector4 __attribute__((vector_size(4 * sizeof(sphm_real))));
typedef sphm_real vector16 __attribute__((vector_size(16 * sizeof(sphm_real))));

enum { LANES = SPHM_SOLID_BATCH };

static inline vector16 load16(const sphm_real *from) {
    return *(const vector16 *)__builtin_assume_aligned(from, 16 * sizeof(sphm_real));
}

static inline void store16(sphm_real *to, vector16 value) {
    *(vector16 *)__builtin_assume_aligned(to, 16 * sizeof(sphm_real)) = value;
}

/* SHUFFLE(a, b, 16 lane numbers): 0 ... 15 are those of a, 16 ... 31 those of b. gcc learned clang's name for
 * it with version 12 only. */
#ifdef __clang__
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#ifdef SPH_MUSCLE_DOUBLE
typedef int64_t lanes16 __attribute__((vector_size(16 * sizeof(int64_t))));
#else
typedef int32_t lanes16 __attribute__((vector_size(16 * sizeof(int32_t))));
#endif
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (lanes16){__VA_ARGS__})
#endif

/* The last lane of each quarter, four times. */
#define SPREAD(v) SHUFFLE(v, v, 3, 3, 3, 3, 7, 7, 7, 7, 11, 11, 11, 11, 15, 15, 15, 15)

/* Four numbers, four times. Compilers make a detour over the stack of what is one load. */
static inline vector16 repeat4(const sphm_real *from) {
#if defined(__AVX512F__) && !defined(SPH_MUSCLE_DOUBLE)
    return (vector16)_mm512_broadcast_f32x4(_mm_load_ps(from));
#else
    const vector4 v = *(const vector4 *)__builtin_assume_aligned(from, sizeof v);
    const vector4 quarters[4] = {v, v, v, v};
    vector16 whole;
    memcpy(&whole, quarters, sizeof whole);
    return whole;
#endif
}

/* displacement[4 * c + d]: the sum over the row of (u_j - u_i)_d w X_c. velocity[4 * c + d]: the sum of
 * (v_j)_d w X_c, without v_i, whose share is known beforehand (displacements are too near to each other for
 * that). Even and odd pairs apart, to keep enough additions in flight; the order of the sum is fixed. */
static inline void sum_deformation(const sphm_solid_lines *lines, size_t slot, vector16 *displacement,
                                   vector16 *velocity) {
    const sphm_solid_pair *pair = lines->pair + lines->row_start[slot],
                          *end = lines->pair + lines->row_start[slot + 1];
    const sphm_real *wide = lines->wide;
    const vector16 own = load16(wide + SPHM_STRESS_LINE * slot);
    vector16 u0 = {0}, u1 = {0}, v0 = {0}, v1 = {0};
    for (; pair < end; pair += 2) {
        const sphm_real *line0 = wide + SPHM_STRESS_LINE * (size_t)pair[0].slot,
                        *line1 = wide + SPHM_STRESS_LINE * (size_t)pair[1].slot;
        const vector16 jump0 = load16(line0) - own, jump1 = load16(line1) - own;
        const vector16 wX0 = SPREAD(jump0) * pair[0].weight, wX1 = SPREAD(jump1) * pair[1].weight;
        u0 += jump0 * wX0;
        u1 += jump1 * wX1;
        v0 += repeat4(line0 + 12) * wX0;
        v1 += repeat4(line1 + 12) * wX1;
    }
    *displacement = u0 + u1;
    *velocity = v0 + v1;
}

/* Some particles' sums and what comes out of them, component by component, so that the material is evaluated
 * for many particles at a time. */
typedef struct stress_batch {
    sphm_real displacement[16][LANES], velocity[16][LANES]; /* sums over the row */
    sphm_real own[16][LANES];                               /* `wide` lines */
    sphm_real stress[16][LANES];                            /* `stress` lines */
    sphm_real fibre[3][LANES], activation[LANES], fibre_rate[LANES], relative_volume[LANES];
    sphm_real modulus[LANES], J[LANES], pressure[LANES];
} stress_batch;

/* One of four rounds of a 16 x 16 transposition: swaps blocks of s x s. */
#define KEEP_LOW(s, k) (((k) & (s)) ? 16 + ((k) ^ (s)) : (k))
#define KEEP_HIGH(s, k) (((k) & (s)) ? 16 + (k) : ((k) ^ (s)))
#define PICK(which, s, a, b)                                                                                 \
    SHUFFLE(a, b, which(s, 0), which(s, 1), which(s, 2), which(s, 3), which(s, 4), which(s, 5), which(s, 6), \
            which(s, 7), which(s, 8), which(s, 9), which(s, 10), which(s, 11), which(s, 12), which(s, 13),   \
            which(s, 14), which(s, 15))
#define ROUND(s)                                                                                             \
    _Pragma("GCC unroll 16") for (int k = 0; k < 16; ++k) if (!(k & (s))) {                                  \
        const vector16 a = row[k], b = row[k | (s)];                                                         \
        row[k] = PICK(KEEP_LOW, s, a, b);                                                                    \
        row[k | (s)] = PICK(KEEP_HIGH, s, a, b);                                                             \
    }

static inline __attribute__((always_inline)) void transpose(vector16 row[16]) {
    ROUND(1)
    ROUND(2)
    ROUND(4)
    ROUND(8)
}

/* 16 lines side by side become columns `at` ... `at` + 15 of `to`. */
static inline void lines_to_lanes(const sphm_real *lines, sphm_real to[16][LANES], size_t at) {
    vector16 row[16];
#pragma GCC unroll 16
    for (int k = 0; k < 16; ++k)
        row[k] = load16(lines + 16 * k);
    transpose(row);
#pragma GCC unroll 16
    for (int k = 0; k < 16; ++k)
        store16(to[k] + at, row[k]);
}

static inline void lanes_to_lines(sphm_real from[16][LANES], size_t at, sphm_real *lines) {
    vector16 row[16];
#pragma GCC unroll 16
    for (int k = 0; k < 16; ++k)
        row[k] = load16(from[k] + at);
    transpose(row);
#pragma GCC unroll 16
    for (int k = 0; k < 16; ++k)
        store16(lines + 16 * k, row[k]);
}

/* Lanes beyond the last particle keep what the previous batch left there: finite, and never stored. */
static void gather_batch(const sphm_solid_field *field, const sphm_solid_lines *lines, size_t begin,
                         size_t end, stress_batch *b) {
    sphm_real sums[3][16 * 16] __attribute__((aligned(16 * sizeof(sphm_real))));
    for (size_t at = 0; begin + at < end; at += 16) {
        const size_t first = begin + at, n = end - first < 16 ? end - first : 16;
        if (n < 16)
            memset(sums, 0, sizeof sums);
        for (size_t k = 0; k < n; ++k) {
            vector16 displacement, velocity;
            sum_deformation(lines, first + k, &displacement, &velocity);
            store16(sums[0] + 16 * k, displacement);
            store16(sums[1] + 16 * k, velocity);
        }
        memcpy(sums[2], lines->wide + SPHM_STRESS_LINE * first, n * 16 * sizeof(sphm_real));
        lines_to_lanes(sums[0], b->displacement, at);
        lines_to_lanes(sums[1], b->velocity, at);
        lines_to_lanes(sums[2], b->own, at);
    }
    const size_t bytes = (end - begin) * sizeof(sphm_real);
    memcpy(b->fibre[0], field->fibre_x + begin, bytes);
    memcpy(b->fibre[1], field->fibre_y + begin, bytes);
    memcpy(b->fibre[2], field->fibre_z + begin, bytes);
    memcpy(b->activation, field->activation + begin, bytes);
    memcpy(b->relative_volume, field->relative_volume + begin, bytes);
    if (field->fibre_rate)
        memcpy(b->fibre_rate, field->fibre_rate + begin, bytes);
}

/* The material at one particle: from the sums over its row to its line. `constant` is its column. */
static inline __attribute__((always_inline)) void evaluate_particle(const sphm_solid_tissue *tissue,
                                                                    sphm_real rate_share,
                                                                    const sphm_real *constant, size_t stride,
                                                                    size_t i, stress_batch *b) {
    sphm_real sum[9], rate_sum[9], B[6], H[9], rate[9];
    sphm_solid_result result;
#pragma GCC unroll 6
    for (int d = 0; d < 6; ++d)
        B[d] = constant[(size_t)d * stride + i];
#pragma GCC unroll 3
    for (int c = 0; c < 3; ++c) {
        const sphm_real total = constant[(size_t)(6 + c) * stride + i];
#pragma GCC unroll 3
        for (int r = 0; r < 3; ++r) {
            sum[3 * c + r] = b->displacement[4 * c + r][i];
            rate_sum[3 * c + r] = b->velocity[4 * c + r][i] - b->own[12 + r][i] * total;
        }
    }
    sphm_solid_correct_sums(sum, B, H);
    sphm_solid_correct_sums(rate_sum, B, rate);
    const sphm_real f0[3] = {b->fibre[0][i], b->fibre[1][i], b->fibre[2][i]};
    sphm_solid_evaluate(tissue, H, rate, f0, b->activation[i], b->fibre_rate[i], rate_share,
                        b->relative_volume[i], B, &result);
    b->J[i] = result.J;
    b->pressure[i] = result.pressure_Pa;
    b->modulus[i] = result.modulus_Pa;
    b->fibre_rate[i] = result.fibre_rate;
#pragma GCC unroll 3
    for (int r = 0; r < 3; ++r) {
#pragma GCC unroll 3
        for (int c = 0; c < 3; ++c)
            b->stress[4 * c + r][i] = result.A[3 * r + c];
        b->stress[12 + r][i] =
            tissue->hourglass_Pa * (b->own[r][i] + tissue->hourglass_time_s * b->own[12 + r][i]);
        b->stress[4 * r + 3][i] = b->own[4 * r + 3][i];
    }
}

static void evaluate_batch(const sphm_solid_field *field, const sphm_solid_lines *lines, size_t begin,
                           stress_batch *b) {
    const sphm_solid_tissue tissue = sphm_solid_tissue_of(field);
    const sphm_real rate_share = field->rate_share;
    const sphm_real *constant = lines->constant + begin;
    const size_t stride = lines->stride;
#pragma omp simd
    for (size_t i = 0; i < LANES; ++i)
        evaluate_particle(&tissue, rate_share, constant, stride, i, b);
}

static void store_batch(const sphm_solid_field *field, sphm_solid_lines *lines, size_t begin, size_t end,
                        stress_batch *b) {
    const size_t n = end - begin;
    for (size_t at = 0; at < n; at += 16) {
        sphm_real *line = lines->stress + SPHM_STRESS_LINE * (begin + at);
        sphm_real last[16 * 16] __attribute__((aligned(16 * sizeof(sphm_real))));
        lanes_to_lines(b->stress, at, n - at < 16 ? last : line);
        if (n - at < 16)
            memcpy(line, last, (n - at) * 16 * sizeof(sphm_real));
    }
    if (field->fibre_rate)
        memcpy(field->fibre_rate + begin, b->fibre_rate, n * sizeof(sphm_real));
    sphm_real modulus = 0;
    int inverted = 0;
#pragma omp simd reduction(max : modulus) reduction(| : inverted)
    for (size_t i = 0; i < n; ++i) {
        field->density[begin + i] = field->density_kg_per_m3 / b->J[i];
        field->pressure[begin + i] = b->pressure[i];
        modulus = b->modulus[i] > modulus ? b->modulus[i] : modulus;
        inverted |= !(b->J[i] > 0);
    }
    double *stiffest = lines->block_modulus_Pa + begin / SPHM_BLOCK;
    int32_t *first = lines->block_inverted + begin / SPHM_BLOCK;
    *stiffest = (double)modulus > *stiffest ? (double)modulus : *stiffest;
    for (size_t i = 0; inverted && *first < 0 && i < n; ++i)
        if (!(b->J[i] > 0))
            *first = (int32_t)(begin + i);
}

static void widen_block(const sphm_solid_field *field, sphm_solid_lines *lines, size_t block) {
    for (size_t slot = sphm_block_begin(block); slot < sphm_block_end(block, lines->count); ++slot) {
        sphm_real *wide = lines->wide + SPHM_STRESS_LINE * slot;
#pragma GCC unroll 3
        for (int d = 0; d < 3; ++d) {
            wide[d] = wide[4 + d] = wide[8 + d] = field->shift[d][slot];
            wide[12 + d] = field->velocity[d][slot];
        }
    }
}

static void stress_block(const sphm_solid_field *field, sphm_solid_lines *lines, size_t block) {
    const size_t end = sphm_block_end(block, lines->count);
    stress_batch b __attribute__((aligned(16 * sizeof(sphm_real))));
    memset(&b, 0, sizeof b);
    lines->block_modulus_Pa[block] = 0;
    lines->block_inverted[block] = -1;
    for (size_t begin = sphm_block_begin(block); begin < end; begin += LANES) {
        const size_t batch_end = begin + LANES < end ? begin + LANES : end;
        gather_batch(field, lines, begin, batch_end, &b);
        evaluate_batch(field, lines, begin, &b);
        store_batch(field, lines, begin, batch_end, &b);
    }
}

void sphm_solid_stress_sweep(const sphm_solid_field *field, sphm_solid_lines *lines) {
    if (lines->columns.slice) {
        sphm_solid_columns_stress(field, lines);
        return;
    }
    const size_t blocks = sphm_block_count(lines->count);
#pragma omp parallel num_threads(field->threads)
    {
#pragma omp for schedule(static)
        for (size_t block = 0; block < blocks; ++block)
            widen_block(field, lines, block);
#pragma omp for schedule(static)
        for (size_t block = 0; block < blocks; ++block)
            stress_block(field, lines, block);
    }
}

void sphm_solid_deformation(const sphm_solid_lines *lines, size_t slot, sphm_real H[9], sphm_real rate[9]) {
    if (lines->columns.slice) {
        sphm_solid_columns_deformation(&lines->columns, slot, H, rate);
        return;
    }
    vector16 displacement, velocity;
    sphm_real sum[9], rate_sum[9], B[6];
    sum_deformation(lines, slot, &displacement, &velocity);
    for (size_t d = 0; d < 6; ++d)
        B[d] = lines->constant[d * lines->stride + slot];
    for (size_t c = 0; c < 3; ++c)
        for (size_t r = 0; r < 3; ++r) {
            sum[3 * c + r] = displacement[4 * c + r];
            rate_sum[3 * c + r] = velocity[4 * c + r] - lines->wide[SPHM_STRESS_LINE * slot + 12 + r] *
                                                            lines->constant[(6 + c) * lines->stride + slot];
        }
    sphm_solid_correct_sums(sum, B, H);
    sphm_solid_correct_sums(rate_sum, B, rate);
}

/* f_i/V = sum_j [(A_i + A_j) w X_ij + w k (u_j - u_i + tau (v_j - v_i))]: the line of j minus the line of i
 * with its matrix negated has X_ij in its last lanes, and 1 in the very last; w times those, each four times,
 * times the difference, then the sum of the four quarters. */
static inline vector4 sum_force(const sphm_solid_field *field, const sphm_solid_lines *lines, size_t slot) {
    const vector16 sign = {-1, -1, -1, 1, -1, -1, -1, 1, -1, -1, -1, 1, 1, 1, 1, 1};
    const vector16 one = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
    const sphm_solid_pair *pair = lines->pair + lines->row_start[slot],
                          *end = lines->pair + lines->row_start[slot + 1];
    const sphm_real *stress = lines->stress;
    const vector16 own = load16(stress + SPHM_STRESS_LINE * slot) * sign - one;
    vector16 even = {0}, odd = {0};
    for (; pair < end; pair += 2) {
        const vector16 line0 = load16(stress + SPHM_STRESS_LINE * (size_t)pair[0].slot) - own,
                       line1 = load16(stress + SPHM_STRESS_LINE * (size_t)pair[1].slot) - own;
        even += line0 * (SPREAD(line0) * pair[0].weight);
        odd += line1 * (SPREAD(line1) * pair[1].weight);
    }
    const vector16 sum = even + odd;
    vector4 quarter[4];
    memcpy(quarter, &sum, sizeof sum);
    return field->particle_volume_m3 * ((quarter[0] + quarter[1]) + (quarter[2] + quarter[3]));
}

void sphm_solid_force_sweep(const sphm_solid_field *field, sphm_solid_lines *lines) {
    if (lines->columns.slice) {
        sphm_solid_columns_force(field, lines);
        return;
    }
    const size_t blocks = sphm_block_count(lines->count);
#pragma omp parallel for num_threads(field->threads) schedule(static)
    for (size_t block = 0; block < blocks; ++block)
        for (size_t slot = sphm_block_begin(block); slot < sphm_block_end(block, lines->count); ++slot) {
            const vector4 force = sum_force(field, lines, slot);
            for (int d = 0; d < 3; ++d)
                lines->force[d][slot] = force[d];
        }
}
