/* The sweeps over columns; see solid_columns.h for the idea, solid_sweeps.h for what they read and write. */
#include <string.h>

#include "cpu/parallel.h"
#include "cpu/slice_lanes.h"
#include "cpu/solid_columns.h"
#include "cpu/solid_material.h"

enum { LANES = SPHM_LANES };

/* Stress sweep ------------------------------------------------------------------------------------------ */

/* sum[3 * c + d]: of (u_j - u_i)_d w X_c over the neighbours; then the same of v. */
typedef struct deformation_sums {
    sphm_lanes sum[18];
} deformation_sums;

SPHM_INLINE void sum_deformation(const sphm_solid_columns *columns, const sphm_solid_slice *slice,
                                 deformation_sums *out) {
    sphm_lanes sum[18];
    _Pragma("GCC unroll 18") for (int k = 0; k < 18; ++k) sum[k] = sphm_lanes_repeat(0);
    const sphm_solid_twin *twin = columns->twin + slice[0].twin, *last = columns->twin + slice[1].twin;
    const sphm_solid_single *single = columns->single + slice[0].single,
                            *end = columns->single + slice[1].single;
    for (; twin < last; ++twin) {
        const sphm_real *weight = columns->weight + twin->weight;
        const sphm_lanes x = sphm_lanes_repeat(weight[0]), y = sphm_lanes_repeat(weight[1]),
                         z = sphm_lanes_repeat(weight[2]);
        _Pragma("GCC unroll 6") for (int d = 0; d < 6; ++d) {
            const sphm_lanes jump = sphm_lanes_load(columns->motion[d] + twin->ahead) -
                                    sphm_lanes_load(columns->motion[d] + twin->behind);
            const int at = d < 3 ? d : d + 6;
            sum[at] += jump * x;
            sum[at + 3] += jump * y;
            sum[at + 6] += jump * z;
        }
    }
    for (; single < end; ++single) {
        const sphm_real *weight = columns->weight + 4 * single->weight;
        const sphm_lanes x = sphm_lanes_repeat(weight[0]), y = sphm_lanes_repeat(weight[1]),
                         z = sphm_lanes_repeat(weight[2]);
        const sphm_some lanes = sphm_some_of(single->lanes);
        _Pragma("GCC unroll 6") for (int d = 0; d < 6; ++d) {
            const sphm_lanes jump =
                sphm_lanes_subtract_some(sphm_lanes_load(columns->motion[d] + single->from),
                                         sphm_lanes_load(columns->motion[d] + slice->slot), lanes);
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
    sphm_real sum[18][LANES], constant[6][LANES], fibre[3][LANES], activation[LANES], fibre_rate[LANES],
        relative_volume[LANES];
    sphm_real A[9][LANES], J[LANES], pressure[LANES], modulus[LANES];
} slice_material;

/* A function of its own: with these arrays in the loop's body gcc 12 does not vectorise it. */
SPHM_INLINE void evaluate_lane(const sphm_solid_tissue *tissue, sphm_real rate_share, slice_material *m,
                               int i) {
    sphm_real sum[18], B[6], H[9], rate[9];
    sphm_solid_result result;
    _Pragma("GCC unroll 18") for (int k = 0; k < 18; ++k) sum[k] = m->sum[k][i];
    _Pragma("GCC unroll 6") for (int k = 0; k < 6; ++k) B[k] = m->constant[k][i];
    const sphm_real f0[3] = {m->fibre[0][i], m->fibre[1][i], m->fibre[2][i]};
    sphm_solid_correct_sums(sum, B, H);
    sphm_solid_correct_sums(sum + 9, B, rate);
    sphm_solid_evaluate(tissue, H, rate, f0, m->activation[i], m->fibre_rate[i], rate_share,
                        m->relative_volume[i], B, &result);
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
    const sphm_some lanes = sphm_some_of(sphm_first_lanes(slice->count));
    const size_t slot = (size_t)slice->slot;
    sum_deformation(columns, slice, (deformation_sums *)m->sum);
    const sphm_real *fibre[3] = {field->fibre_x, field->fibre_y, field->fibre_z};
    for (int k = 0; k < 6; ++k)
        *(sphm_lanes *)m->constant[k] = sphm_lanes_load(columns->constant[k] + slot);
    for (int d = 0; d < 3; ++d)
        *(sphm_lanes *)m->fibre[d] = sphm_lanes_load_some(fibre[d] + slot, lanes);
    *(sphm_lanes *)m->activation = sphm_lanes_load_some(field->activation + slot, lanes);
    *(sphm_lanes *)m->relative_volume = sphm_lanes_load_some(field->relative_volume + slot, lanes);
    if (field->fibre_rate)
        *(sphm_lanes *)m->fibre_rate = sphm_lanes_load_some(field->fibre_rate + slot, lanes);
}

static void scatter(const sphm_solid_field *field, const sphm_solid_columns *columns,
                    const sphm_solid_slice *slice, const slice_material *m) {
    const sphm_some lanes = sphm_some_of(sphm_first_lanes(slice->count));
    const size_t slot = (size_t)slice->slot;
    const sphm_lanes J = sphm_lanes_load_aligned(m->J);
    for (int k = 0; k < 9; ++k)
        sphm_lanes_store_some(columns->stress[k] + slot, sphm_lanes_load_aligned(m->A[k]), lanes);
    for (int d = 0; d < 3; ++d)
        sphm_lanes_store_some(columns->stress[9 + d] + slot,
                              field->hourglass_Pa *
                                  (sphm_lanes_load(columns->motion[d] + slot) +
                                   field->hourglass_time_s * sphm_lanes_load(columns->motion[3 + d] + slot)),
                              lanes);
    sphm_lanes_store_some(field->density + slot, field->density_kg_per_m3 / J, lanes);
    sphm_lanes_store_some(field->pressure + slot, sphm_lanes_load_aligned(m->pressure), lanes);
    if (field->fibre_rate)
        sphm_lanes_store_some(field->fibre_rate + slot, sphm_lanes_load_aligned(m->fibre_rate), lanes);
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
    const sphm_solid_tissue tissue = sphm_solid_tissue_of(field);
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
    sphm_solid_correct_sums(sum, B, H);
    sphm_solid_correct_sums(sum + 9, B, rate);
}

/* Force sweep ------------------------------------------------------------------------------------------- */

/* Component d of f_i/V = sum_j [(A_i + A_j) w X_ij + w (q_j - q_i)], q = k (u + tau v). Of twins A_i cancels;
 * over the singles its factor is known beforehand. The sums of w X, w Y, w Z, w are kept apart: more
 * additions in flight. */
SPHM_INLINE sphm_lanes sum_force(const sphm_solid_columns *columns, const sphm_solid_slice *slice, int d) {
    const sphm_real *x = columns->stress[3 * d], *y = columns->stress[3 * d + 1],
                    *z = columns->stress[3 * d + 2], *q = columns->stress[9 + d];
    const sphm_lanes own = sphm_lanes_load(q + slice->slot), twice = 2 * own;
    sphm_lanes sum_x = {0}, sum_y = {0}, sum_z = {0}, sum_q = {0};
    const sphm_solid_twin *twin = columns->twin + slice[0].twin, *last = columns->twin + slice[1].twin;
    for (; twin < last; ++twin) {
        const sphm_real *weight = columns->weight + twin->weight;
        const int32_t ahead = twin->ahead, behind = twin->behind;
        sum_x += (sphm_lanes_load(x + ahead) - sphm_lanes_load(x + behind)) * sphm_lanes_repeat(weight[0]);
        sum_y += (sphm_lanes_load(y + ahead) - sphm_lanes_load(y + behind)) * sphm_lanes_repeat(weight[1]);
        sum_z += (sphm_lanes_load(z + ahead) - sphm_lanes_load(z + behind)) * sphm_lanes_repeat(weight[2]);
        sum_q += ((sphm_lanes_load(q + ahead) - twice) + sphm_lanes_load(q + behind)) *
                 sphm_lanes_repeat(weight[3]);
    }
    const sphm_solid_single *single = columns->single + slice[0].single,
                            *end = columns->single + slice[1].single;
    for (; single < end; ++single) {
        const sphm_real *weight = columns->weight + 4 * single->weight;
        const sphm_some lanes = sphm_some_of(single->lanes);
        const int32_t from = single->from;
        sum_x = sphm_lanes_add_some(sum_x, sphm_lanes_load(x + from), sphm_lanes_repeat(weight[0]), lanes);
        sum_y = sphm_lanes_add_some(sum_y, sphm_lanes_load(y + from), sphm_lanes_repeat(weight[1]), lanes);
        sum_z = sphm_lanes_add_some(sum_z, sphm_lanes_load(z + from), sphm_lanes_repeat(weight[2]), lanes);
        sum_q +=
            sphm_lanes_subtract_some(sphm_lanes_load(q + from), own, lanes) * sphm_lanes_repeat(weight[3]);
    }
    sum_x += sphm_lanes_load(x + slice->slot) * sphm_lanes_load(columns->constant[6] + slice->slot);
    sum_y += sphm_lanes_load(y + slice->slot) * sphm_lanes_load(columns->constant[7] + slice->slot);
    sum_z += sphm_lanes_load(z + slice->slot) * sphm_lanes_load(columns->constant[8] + slice->slot);
    return (sum_x + sum_y) + (sum_z + sum_q);
}

/* One component after the other: what a row's neighbours have of one stays in the first-level cache until the
 * next row, what they have of all three would not. */
void sphm_solid_columns_force(const sphm_solid_field *field, sphm_solid_lines *lines) {
    const sphm_solid_columns *columns = &lines->columns;
#pragma omp parallel num_threads(field->threads)
    for (int d = 0; d < 3; ++d) {
#pragma omp for schedule(static) nowait
        for (size_t s = 0; s < columns->slices; ++s) {
            const sphm_solid_slice *slice = &columns->slice[s];
            sphm_lanes_store_some(lines->force[d] + slice->slot,
                                  field->particle_volume_m3 * sum_force(columns, slice, d),
                                  sphm_some_of(sphm_first_lanes(slice->count)));
        }
    }
}
