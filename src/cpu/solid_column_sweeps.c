/* The sweeps over columns; see solid_columns.h for the idea, solid_sweeps.h for what they read and write. */
#include <string.h>

#include "cpu/parallel.h"
#include "cpu/row.h"
#include "cpu/solid_columns.h"
#include "cpu/solid_sweeps.h"
#include "kernels/solid_line.h"

enum { LANES = SPHM_LANES };

/* Vectors at any address, and parts of them
 * ------------------------------------------------------------------
 */

/* gcc takes a memcpy() of one over the stack now and then. */
typedef sphm_real loose_lanes __attribute__((vector_size(LANES * sizeof(sphm_real)), aligned(4), may_alias));

SPHM_INLINE sphm_lanes load(const sphm_real *from) {
    return *(const loose_lanes *)from;
}

SPHM_INLINE sphm_lanes load_aligned(const sphm_real *from) {
    return *(const sphm_lanes *)__builtin_assume_aligned(from, sizeof(sphm_lanes));
}

SPHM_INLINE sphm_lanes repeat(sphm_real value) {
    return value - (sphm_lanes){0};
}

#if defined(__AVX512F__) && !defined(SPH_MUSCLE_DOUBLE)

typedef __mmask16 some;

SPHM_INLINE some some_of(uint16_t lanes) {
    return lanes;
}
SPHM_INLINE sphm_lanes load_some(const sphm_real *from, some lanes) {
    return (sphm_lanes)_mm512_maskz_loadu_ps(lanes, from);
}
SPHM_INLINE void store_some(sphm_real *to, sphm_lanes value, some lanes) {
    _mm512_mask_storeu_ps(to, lanes, (__m512)value);
}
/* a - b, or 0 */
SPHM_INLINE sphm_lanes subtract_some(sphm_lanes a, sphm_lanes b, some lanes) {
    return (sphm_lanes)_mm512_maskz_sub_ps(lanes, (__m512)a, (__m512)b);
}
/* sum + a b, or sum */
SPHM_INLINE sphm_lanes add_some(sphm_lanes sum, sphm_lanes a, sphm_lanes b, some lanes) {
    return (sphm_lanes)_mm512_mask3_fmadd_ps((__m512)a, (__m512)b, (__m512)sum, lanes);
}

#else

typedef sphm_lane_mask some;

SPHM_INLINE some some_of(uint16_t lanes) {
    const sphm_lane_mask bit = {1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768};
    return (bit & lanes) != 0;
}
SPHM_INLINE sphm_lanes choose(sphm_lanes a, some lanes) {
    return (sphm_lanes)((sphm_lane_mask)a & lanes);
}
SPHM_INLINE sphm_lanes load_some(const sphm_real *from, some lanes) {
    sphm_lanes v = {0};
    for (int k = 0; k < LANES; ++k)
        if (lanes[k])
            v[k] = from[k];
    return v;
}
SPHM_INLINE void store_some(sphm_real *to, sphm_lanes value, some lanes) {
    for (int k = 0; k < LANES; ++k)
        if (lanes[k])
            to[k] = value[k];
}
SPHM_INLINE sphm_lanes subtract_some(sphm_lanes a, sphm_lanes b, some lanes) {
    return choose(a - b, lanes);
}
SPHM_INLINE sphm_lanes add_some(sphm_lanes sum, sphm_lanes a, sphm_lanes b, some lanes) {
    return sum + choose(a, lanes) * b;
}

#endif

SPHM_INLINE uint16_t first_lanes(int32_t count) {
    return (uint16_t)((1u << count) - 1);
}

/* Stress sweep
 * -----------------------------------------------------------------------------------------------
 */

/* sum[3 * c + d]: of (u_j - u_i)_d w X_c over the neighbours; then the same of v. */
typedef struct deformation_sums {
    sphm_lanes sum[18];
} deformation_sums;

SPHM_INLINE void sum_deformation(const sphm_solid_columns *columns, const sphm_solid_slice *slice,
                                 deformation_sums *out) {
    sphm_lanes sum[18];
    _Pragma("GCC unroll 18") for (int k = 0; k < 18; ++k) sum[k] = repeat(0);
    const sphm_solid_twin *twin = columns->twin + slice[0].twin, *last = columns->twin + slice[1].twin;
    const sphm_solid_single *single = columns->single + slice[0].single,
                            *end = columns->single + slice[1].single;
    for (; twin < last; ++twin) {
        const sphm_real *weight = columns->weight + twin->weight;
        const sphm_lanes x = repeat(weight[0]), y = repeat(weight[1]), z = repeat(weight[2]);
        _Pragma("GCC unroll 6") for (int d = 0; d < 6; ++d) {
            const sphm_lanes jump =
                load(columns->motion[d] + twin->ahead) - load(columns->motion[d] + twin->behind);
            const int at = d < 3 ? d : d + 6;
            sum[at] += jump * x;
            sum[at + 3] += jump * y;
            sum[at + 6] += jump * z;
        }
    }
    for (; single < end; ++single) {
        const sphm_real *weight = columns->weight + 4 * single->weight;
        const sphm_lanes x = repeat(weight[0]), y = repeat(weight[1]), z = repeat(weight[2]);
        const some lanes = some_of(single->lanes);
        _Pragma("GCC unroll 6") for (int d = 0; d < 6; ++d) {
            const sphm_lanes jump = subtract_some(load(columns->motion[d] + single->from),
                                                  load(columns->motion[d] + slice->slot), lanes);
            const int at = d < 3 ? d : d + 6;
            sum[at] += jump * x;
            sum[at + 3] += jump * y;
            sum[at + 6] += jump * z;
        }
    }
    _Pragma("GCC unroll 18") for (int k = 0; k < 18; ++k) out->sum[k] = sum[k];
}

/* What goes into the material of a slice, and what comes out of it, lane by lane. */
typedef struct slice_material {
    sphm_real sum[18][LANES], constant[6][LANES], fibre[3][LANES], activation[LANES], fibre_rate[LANES];
    sphm_real A[9][LANES], J[LANES], pressure[LANES], modulus[LANES];
} slice_material;

/* H = S B of a symmetric B, with column c of S in sum[3 * c]. */
SPHM_INLINE void correct(const sphm_real sum[9], const sphm_real B[6], sphm_real H[9]) {
    _Pragma("GCC unroll 3") for (int r = 0; r < 3; ++r) {
        const sphm_real x = sum[r], y = sum[3 + r], z = sum[6 + r];
        H[3 * r] = x * B[0] + y * B[1] + z * B[2];
        H[3 * r + 1] = x * B[1] + y * B[3] + z * B[4];
        H[3 * r + 2] = x * B[2] + y * B[4] + z * B[5];
    }
}

static sphm_solid_tissue tissue_of(const sphm_solid_field *field) {
    sphm_solid_tissue t;
    t.constants = field->constants;
    t.viscosity_Pa_s = field->viscosity_Pa_s;
    t.hourglass_Pa = field->hourglass_Pa;
    t.hourglass_time_s = field->hourglass_time_s;
    t.density_kg_per_m3 = field->density_kg_per_m3;
    return t;
}

/* A function of its own: with these arrays in the loop's body gcc 12 does not vectorise it. */
SPHM_INLINE void evaluate_lane(const sphm_solid_tissue *tissue, sphm_real rate_share, slice_material *m,
                               int i) {
    sphm_real sum[18], B[6], H[9], rate[9];
    sphm_solid_result result;
    _Pragma("GCC unroll 18") for (int k = 0; k < 18; ++k) sum[k] = m->sum[k][i];
    _Pragma("GCC unroll 6") for (int k = 0; k < 6; ++k) B[k] = m->constant[k][i];
    const sphm_real f0[3] = {m->fibre[0][i], m->fibre[1][i], m->fibre[2][i]};
    correct(sum, B, H);
    correct(sum + 9, B, rate);
    sphm_solid_evaluate(tissue, H, rate, f0, m->activation[i], m->fibre_rate[i], rate_share, B, &result);
    _Pragma("GCC unroll 9") for (int k = 0; k < 9; ++k) m->A[k][i] = result.A[k];
    m->J[i] = result.J;
    m->pressure[i] = result.pressure_Pa;
    m->modulus[i] = result.modulus_Pa;
    m->fibre_rate[i] = result.fibre_rate;
}

static void evaluate(const sphm_solid_tissue *tissue, sphm_real rate_share, slice_material *m) {
    const sphm_solid_tissue t = *tissue;
#pragma omp simd
    for (int i = 0; i < LANES; ++i)
        evaluate_lane(&t, rate_share, m, i);
}

static void gather(const sphm_solid_field *field, const sphm_solid_columns *columns,
                   const sphm_solid_slice *slice, slice_material *m) {
    const some lanes = some_of(first_lanes(slice->count));
    const size_t slot = (size_t)slice->slot;
    sum_deformation(columns, slice, (deformation_sums *)m->sum);
    const sphm_real *fibre[3] = {field->fibre_x, field->fibre_y, field->fibre_z};
    for (int k = 0; k < 6; ++k)
        *(sphm_lanes *)m->constant[k] = load(columns->constant[k] + slot);
    for (int d = 0; d < 3; ++d)
        *(sphm_lanes *)m->fibre[d] = load_some(fibre[d] + slot, lanes);
    *(sphm_lanes *)m->activation = load_some(field->activation + slot, lanes);
    if (field->fibre_rate)
        *(sphm_lanes *)m->fibre_rate = load_some(field->fibre_rate + slot, lanes);
}

static void scatter(const sphm_solid_field *field, const sphm_solid_columns *columns,
                    const sphm_solid_slice *slice, const slice_material *m) {
    const some lanes = some_of(first_lanes(slice->count));
    const size_t slot = (size_t)slice->slot;
    const sphm_lanes J = load_aligned(m->J);
    for (int k = 0; k < 9; ++k)
        store_some(columns->stress[k] + slot, load_aligned(m->A[k]), lanes);
    for (int d = 0; d < 3; ++d)
        store_some(columns->stress[9 + d] + slot,
                   field->hourglass_Pa * (load(columns->motion[d] + slot) +
                                          field->hourglass_time_s * load(columns->motion[3 + d] + slot)),
                   lanes);
    store_some(field->density + slot, field->density_kg_per_m3 / J, lanes);
    store_some(field->pressure + slot, load_aligned(m->pressure), lanes);
    if (field->fibre_rate)
        store_some(field->fibre_rate + slot, load_aligned(m->fibre_rate), lanes);
}

static void note_extremes(const sphm_solid_slice *slice, const slice_material *m, double *stiffest,
                          int32_t *inverted) {
    sphm_real modulus = 0;
    int bad = 0;
    for (int i = 0; i < slice->count; ++i) {
        modulus = m->modulus[i] > modulus ? m->modulus[i] : modulus;
        bad |= !(m->J[i] > 0);
    }
    *stiffest = (double)modulus > *stiffest ? (double)modulus : *stiffest;
    for (int i = 0; bad && *inverted < 0 && i < slice->count; ++i)
        if (!(m->J[i] > 0))
            *inverted = slice->slot + i;
}

static void stress_chunk(const sphm_solid_field *field, sphm_solid_lines *lines, size_t chunk) {
    const sphm_solid_columns *columns = &lines->columns;
    const sphm_solid_tissue tissue = tissue_of(field);
    slice_material m __attribute__((aligned(64)));
    memset(m.fibre_rate, 0, sizeof m.fibre_rate);
    double stiffest = 0;
    int32_t inverted = -1;
    const size_t begin = chunk * SPHM_SOLID_CHUNK, end = begin + SPHM_SOLID_CHUNK;
    for (size_t s = begin; s < end && s < columns->slices; ++s) {
        const sphm_solid_slice *slice = &columns->slice[s];
        gather(field, columns, slice, &m);
        evaluate(&tissue, field->rate_share, &m);
        scatter(field, columns, slice, &m);
        note_extremes(slice, &m, &stiffest, &inverted);
    }
    lines->block_modulus_Pa[chunk] = stiffest;
    lines->block_inverted[chunk] = inverted;
}

/* A copy, because it has room at the ends. */
static void copy_motion(const sphm_solid_field *field, const sphm_solid_columns *columns, size_t begin,
                        size_t end) {
    for (int d = 0; d < 3; ++d) {
        memcpy(columns->motion[d] + begin, field->shift[d] + begin, (end - begin) * sizeof(sphm_real));
        memcpy(columns->motion[3 + d] + begin, field->velocity[d] + begin, (end - begin) * sizeof(sphm_real));
    }
}

void sphm_solid_columns_stress(const sphm_solid_field *field, sphm_solid_lines *lines) {
    const size_t blocks = sphm_block_count(lines->count);
#pragma omp parallel num_threads(field->threads)
    {
#pragma omp for schedule(static)
        for (size_t block = 0; block < blocks; ++block)
            copy_motion(field, &lines->columns, sphm_block_begin(block), sphm_block_end(block, lines->count));
#pragma omp for schedule(static)
        for (size_t chunk = 0; chunk < lines->blocks; ++chunk)
            stress_chunk(field, lines, chunk);
    }
}

void sphm_solid_columns_deformation(const sphm_solid_columns *columns, size_t slot, sphm_real H[9],
                                    sphm_real rate[9]) {
    const sphm_solid_slice *slice = columns->slice;
    while ((size_t)(slice->slot + slice->count) <= slot)
        ++slice;
    deformation_sums sums;
    sphm_real sum[18], B[6];
    sum_deformation(columns, slice, &sums);
    for (int k = 0; k < 18; ++k)
        sum[k] = sums.sum[k][slot - (size_t)slice->slot];
    for (int k = 0; k < 6; ++k)
        B[k] = columns->constant[k][slot];
    correct(sum, B, H);
    correct(sum + 9, B, rate);
}

/* Force sweep
 * ------------------------------------------------------------------------------------------------
 */

/* f_i/V = sum_j [(A_i + A_j) w X_ij + w (q_j - q_i)], q = k (u + tau v). Of twins A_i cancels; over the
 * singles its factor is known beforehand. force[3 * c + d] has the part of w X_c, force[9 + d] that of q. */
SPHM_INLINE void sum_force(const sphm_solid_columns *columns, const sphm_solid_slice *slice,
                           sphm_lanes force[3]) {
    sphm_lanes sum[12], twice[3];
    _Pragma("GCC unroll 12") for (int k = 0; k < 12; ++k) sum[k] = repeat(0);
    _Pragma("GCC unroll 3") for (int d = 0; d < 3; ++d) twice[d] =
        2 * load(columns->stress[9 + d] + slice->slot);
    const sphm_solid_twin *twin = columns->twin + slice[0].twin, *last = columns->twin + slice[1].twin;
    const sphm_solid_single *single = columns->single + slice[0].single,
                            *end = columns->single + slice[1].single;
    for (; twin < last; ++twin) {
        const sphm_real *weight = columns->weight + twin->weight;
        const int32_t ahead = twin->ahead, behind = twin->behind;
        _Pragma("GCC unroll 9") for (int k = 0; k < 9; ++k) {
            const sphm_lanes jump = load(columns->stress[k] + ahead) - load(columns->stress[k] + behind);
            sum[k] += jump * repeat(weight[k % 3]);
        }
        const sphm_lanes w = repeat(weight[3]);
        _Pragma("GCC unroll 3") for (int d = 0; d < 3; ++d) {
            const sphm_real *q = columns->stress[9 + d];
            sum[9 + d] += ((load(q + ahead) - twice[d]) + load(q + behind)) * w;
        }
    }
    for (; single < end; ++single) {
        const sphm_real *weight = columns->weight + 4 * single->weight;
        const some lanes = some_of(single->lanes);
        _Pragma("GCC unroll 9") for (int k = 0; k < 9; ++k) sum[k] =
            add_some(sum[k], load(columns->stress[k] + single->from), repeat(weight[k % 3]), lanes);
        const sphm_lanes w = repeat(weight[3]);
        _Pragma("GCC unroll 3") for (int d = 0; d < 3; ++d) {
            const sphm_real *q = columns->stress[9 + d];
            sum[9 + d] += subtract_some(load(q + single->from), load(q + slice->slot), lanes) * w;
        }
    }
    _Pragma("GCC unroll 3") for (int d = 0; d < 3; ++d) {
        sphm_lanes f = sum[9 + d];
        _Pragma("GCC unroll 3") for (int c = 0; c < 3; ++c) f +=
            sum[3 * d + c] +
            load(columns->stress[3 * d + c] + slice->slot) * load(columns->constant[6 + c] + slice->slot);
        force[d] = f;
    }
}

void sphm_solid_columns_force(const sphm_solid_field *field, sphm_solid_lines *lines) {
    const sphm_solid_columns *columns = &lines->columns;
#pragma omp parallel for num_threads(field->threads) schedule(static)
    for (size_t s = 0; s < columns->slices; ++s) {
        const sphm_solid_slice *slice = &columns->slice[s];
        const some lanes = some_of(first_lanes(slice->count));
        sphm_lanes force[3];
        sum_force(columns, slice, force);
        for (int d = 0; d < 3; ++d)
            store_some(lines->force[d] + slice->slot, field->particle_volume_m3 * force[d], lanes);
    }
}
