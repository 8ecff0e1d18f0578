/* What one thread of each launch does that sorts the particles of the fluid
 * into cells and builds their rows and diffusion weights, from the listed
 * positions. The sort and the scan are the library's (cuda/sort.cu). The order
 * of slots is a function of listed positions and ids only: by cell, then by id;
 * rows are in ascending order of slots. */
#ifndef SPHM_CUDA_FLUID_ROWS_H
#define SPHM_CUDA_FLUID_ROWS_H

#include "cuda/fluid_threads.h"
#include "kernels/diffusion.h"

SPHM_FN void sphm_fluid_list_thread(const sphm_fluid_device *d, size_t i) {
    for (size_t a = 0; a < 3; ++a)
        d->listed[a * d->count + i] = d->position[a * d->count + i];
}

/* Cells
 * ----------------------------------------------------------------------------------------------------
 */

/* Largest x y z, -x -y -z, starting from what is there. */
SPHM_FN void sphm_fluid_box_thread(const sphm_fluid_device *d, size_t thread, size_t threads,
                                   double extremes[6]) {
    for (size_t i = thread; i < d->count; i += threads)
        for (size_t a = 0; a < 3; ++a) {
            const double x = (double)d->listed[a * d->count + i];
            extremes[a] = x > extremes[a] ? x : extremes[a];
            extremes[3 + a] = -x > extremes[3 + a] ? -x : extremes[3 + a];
        }
}

SPHM_FN void sphm_fluid_lay_out_thread(const sphm_fluid_device *d) {
    double lower[3], upper[3];
    for (int a = 0; a < 3; ++a) {
        double above = d->extremes[a], below = d->extremes[3 + a];
        for (int block = 1; block < d->partials; ++block) {
            const double *of_block = d->extremes + 6 * block;
            above = of_block[a] > above ? of_block[a] : above;
            below = of_block[3 + a] > below ? of_block[3 + a] : below;
        }
        upper[a] = above;
        lower[a] = -below;
    }
    sphm_cells_lay_out(d->cells, lower, upper, d->count, d->edge_m);
}

/* Where a particle is along the axes of the cells. */
SPHM_FN void sphm_fluid_cell_of(const sphm_fluid_device *d, size_t i, int at[3]) {
    const sphm_cells *cells = d->cells;
    for (int k = 0; k < 3; ++k)
        at[k] = sphm_cells_coordinate(cells, k, (double)d->listed[(size_t)cells->axis[k] * d->count + i]);
}

/* By id, so that a stable sort by cell leaves the particles of a cell in the
 * order of their ids. */
SPHM_FN void sphm_fluid_bin_thread(const sphm_fluid_device *d, size_t i) {
    int at[3];
    sphm_fluid_cell_of(d, i, at);
    d->key[d->id[i]] = (uint32_t)sphm_cells_index(d->cells, at[0], at[1], at[2]);
    d->value[d->id[i]] = (int32_t)i;
}

/* Thread 0 ... cells: how many keys are smaller. (A particle that writes the
 * starts of all empty cells before its own was the alternative; it is a long
 * loop where the box is mostly empty.) */
SPHM_FN void sphm_fluid_starts_thread(const sphm_fluid_device *d, size_t cell) {
    if (cell > d->cells->count)
        return;
    size_t begin = 0, end = d->count;
    while (begin < end) {
        const size_t middle = (begin + end) / 2;
        if ((size_t)d->sorted_key[middle] < cell)
            begin = middle + 1;
        else
            end = middle;
    }
    d->cell_start[cell] = (int32_t)begin;
}

/* Everything that belongs to a particle, to its new slot; by way of a second
 * copy, for others are still read.
 */
SPHM_FN void sphm_fluid_reorder_thread(const sphm_fluid_device *d, size_t i) {
    const size_t from = (size_t)d->order[i];
#define ARRAY(type, name, elements, meaning)
#define SORTED(type, name, numbers, meaning)                                                                 \
    for (size_t c = 0; c < numbers; ++c)                                                                     \
        d->spare_##name[c * d->count + i] = d->name[c * d->count + from];
#include "cuda/fluid_arrays.inc"
}

SPHM_FN void sphm_fluid_settle_thread(const sphm_fluid_device *d, size_t i) {
#define ARRAY(type, name, elements, meaning)
#define SORTED(type, name, numbers, meaning)                                                                 \
    for (size_t c = 0; c < numbers; ++c)                                                                     \
        d->name[c * d->count + i] = d->spare_##name[c * d->count + i];
#include "cuda/fluid_arrays.inc"
}

/* Rows
 * -----------------------------------------------------------------------------------------------------
 */

/* Visits the runs of slots around a particle in ascending order: cells of a
 * line along the fast axis are one run. Returns how many slots are within the
 * radius, but for its own, and writes them to `row` unless that is NULL. */
SPHM_FN uint32_t sphm_fluid_visit(const sphm_fluid_device *d, size_t i, int32_t *row) {
    const sphm_cells *cells = d->cells;
    const sphm_real radius2 = (sphm_real)(d->radius_m * d->radius_m);
    const int reach = sphm_cells_reach(cells, d->radius_m);
    sphm_real x[3], other[3];
    int at[3];
    uint32_t count = 0;
    sphm_load3(d->listed, d->count, i, x);
    sphm_fluid_cell_of(d, i, at);
    const int first_fast = sphm_cells_clamp(cells, 2, at[2] - reach),
              last_fast = sphm_cells_clamp(cells, 2, at[2] + reach);
    for (int a = sphm_cells_clamp(cells, 0, at[0] - reach); a <= sphm_cells_clamp(cells, 0, at[0] + reach);
         ++a)
        for (int b = sphm_cells_clamp(cells, 1, at[1] - reach);
             b <= sphm_cells_clamp(cells, 1, at[1] + reach); ++b) {
            const int32_t end = d->cell_start[sphm_cells_index(cells, a, b, last_fast) + 1];
            for (int32_t j = d->cell_start[sphm_cells_index(cells, a, b, first_fast)]; j < end; ++j) {
                sphm_load3(d->listed, d->count, (size_t)j, other);
                const sphm_real dx = x[0] - other[0], dy = x[1] - other[1], dz = x[2] - other[2];
                if (dx * dx + dy * dy + dz * dz <= radius2 && (size_t)j != i) {
                    if (row)
                        row[count] = j;
                    ++count;
                }
            }
        }
    return count;
}

/* Thread 0 ... count: the last one closes the list of lengths. Rows begin on a
 * 32-byte sector. */
SPHM_FN void sphm_fluid_count_thread(const sphm_fluid_device *d, size_t i) {
    if (i == d->count) {
        d->row_length[i] = 0;
        return;
    }
    d->row_count[i] = sphm_fluid_visit(d, i, NULL);
    d->row_length[i] =
        ((uint64_t)d->row_count[i] + SPHM_DEVICE_LANES - 1) / SPHM_DEVICE_LANES * SPHM_DEVICE_LANES;
}

/* There is memory for the rows: else the host sees to it, and has the launches
 * from here on repeated. */
SPHM_FN int sphm_fluid_rows_fit(const sphm_fluid_device *d) {
    return d->row_start[d->count] <= d->capacity;
}

/* The position is for the weights. */
SPHM_FN void sphm_fluid_fill_thread(const sphm_fluid_device *d, size_t i) {
    sphm_real x[3];
    sphm_load3(d->listed, d->count, i, x);
    sphm_store_pack(&d->predicted[i].first,
                    sphm_pack_of(x[0] * d->inverse_h, x[1] * d->inverse_h, x[2] * d->inverse_h, 0));
    (void)sphm_fluid_visit(d, i, d->neighbour + d->row_start[i]);
}

/* Diffusion weights
 * ----------------------------------------------------------------------------------------
 */

SPHM_FN void sphm_fluid_correct_lane(const sphm_fluid_device *d, size_t i, int lane,
                                     sphm_real sum[SPHM_MOMENT_COUNT]) {
    const uint64_t begin = d->row_start[i], end = begin + d->row_count[i];
    const sphm_pack own = sphm_load_pack(&d->predicted[i].first);
    sphm_moments m = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    for (uint64_t k = begin + (uint64_t)lane; k < end && d->laplacian == SPHM_LAPLACIAN_CORRECTED;
         k += SPHM_DEVICE_LANES)
        sphm_moments_pair(own, sphm_load_pack(&d->predicted[d->neighbour[k]].first), &m);
    const sphm_real all[SPHM_MOMENT_COUNT] = {m.xxxx, m.yyyy, m.zzzz, m.xxyy, m.xxzz, m.yyzz, m.xxxy, m.xxxz,
                                              m.xxyz, m.xyyy, m.xyyz, m.xyzz, m.xzzz, m.yyyz, m.yzzz};
    for (int k = 0; k < SPHM_MOMENT_COUNT; ++k)
        sum[k] += all[k];
}

SPHM_FN void sphm_fluid_correct_finish(const sphm_fluid_device *d, size_t i,
                                       const sphm_real sum[SPHM_MOMENT_COUNT]) {
    double tensor[6], moment[SPHM_MOMENT_COUNT];
    sphm_real b[6], fibre[3] = {0, 0, 0};
    if (d->along != d->across)
        sphm_load3(d->fibre, d->count, i, fibre);
    sphm_diffusion_tensor(d->along, d->across, (double)fibre[0], (double)fibre[1], (double)fibre[2], tensor);
    for (int k = 0; k < SPHM_MOMENT_COUNT; ++k)
        moment[k] = (double)sum[k] * (double)d->pair_factor;
    if (d->laplacian == SPHM_LAPLACIAN_CORRECTED)
        (void)sphm_diffusion_correct(moment, tensor, b);
    else
        sphm_diffusion_bulk_form(tensor, 1, b);
    sphm_store_pack(&d->correction[i].first, sphm_pack_of(b[0], b[1], b[2], b[3]));
    sphm_store_pack(&d->correction[i].second, sphm_pack_of(b[4], b[5], 0, 0));
}

/* Writes the weights of its entries; sum: of the positive ones. */
SPHM_FN void sphm_fluid_weigh_lane(const sphm_fluid_device *d, size_t i, int lane, sphm_real sum[1]) {
    const uint64_t begin = d->row_start[i], end = begin + d->row_count[i];
    const sphm_pack own = sphm_load_pack(&d->predicted[i].first);
    const sphm_pack b = sphm_load_pack(&d->correction[i].first),
                    rest = sphm_load_pack(&d->correction[i].second);
    const sphm_real half_factor = d->pair_factor * (sphm_real)0.5;
    for (uint64_t k = begin + (uint64_t)lane; k < end; k += SPHM_DEVICE_LANES) {
        const size_t j = (size_t)d->neighbour[k];
        const sphm_pack other = sphm_load_pack(&d->correction[j].first),
                        other_rest = sphm_load_pack(&d->correction[j].second);
        const sphm_real w = sphm_weight_pair(d->laplacian == SPHM_LAPLACIAN_PAPER, half_factor, own, b,
                                             sphm_load_pack(&d->predicted[j].first), other,
                                             rest.x + other_rest.x, rest.y + other_rest.y);
        d->weight[k] = w;
        sum[0] += w > 0 ? w : 0;
    }
}

/* As row_bound() of src/core/diffusion.c. */
SPHM_FN void sphm_fluid_weigh_finish(const sphm_fluid_device *d, size_t i, const sphm_real sum[1]) {
    d->bound[i] = 2 * sum[0];
}

#endif
