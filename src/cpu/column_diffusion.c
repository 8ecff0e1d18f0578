/* Diffusion over columns; see column_diffusion.h. */
#include "cpu/column_diffusion.h"

#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "cpu/parallel.h"
#include "cpu/slice_lanes.h"

enum { LANES = SPHM_LANES, ROOM = 2 * SPHM_LANES };

void sphm_column_diffusion_free(sphm_column_diffusion *d) {
    free(d->weight);
    free(d->memory);
    memset(d, 0, sizeof *d);
}

/* Where a slice's weights begin, in columns. */
static size_t first_column(const sphm_solid_slice *slice) {
    return 2 * slice->twin + slice->single;
}

static size_t weight_count(const sphm_solid_columns *columns) {
    return LANES * first_column(&columns->slice[columns->slices]);
}

size_t sphm_column_diffusion_bytes(const sphm_column_diffusion *d) {
    return d->columns ? (weight_count(d->columns) + d->columns->count + 2 * ROOM) * sizeof(sphm_real) : 0;
}

/* The weight of the neighbour `to` in the row of `slot`: rows are in ascending order. */
static sphm_real weight_of(const sphm_neighbours *rows, const sphm_diffusion *diffusion, size_t slot,
                           int32_t to) {
    size_t low = rows->row_start[slot], high = low + (size_t)rows->row_count[slot];
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (rows->slot[middle] <= to)
            low = middle;
        else
            high = middle;
    }
    return diffusion->weight[low];
}

static void fill_column(const sphm_solid_slice *slice, int32_t from, uint16_t lanes,
                        const sphm_neighbours *rows, const sphm_diffusion *diffusion, sphm_real *weight) {
    for (int32_t lane = 0; lane < LANES; ++lane)
        weight[lane] =
            lanes >> lane & 1 ? weight_of(rows, diffusion, (size_t)(slice->slot + lane), from + lane) : 0;
}

static void fill_slice(const sphm_solid_columns *columns, const sphm_solid_slice *slice,
                       const sphm_neighbours *rows, const sphm_diffusion *diffusion, sphm_real *weight) {
    const uint16_t all = sphm_first_lanes(slice->count);
    for (size_t k = slice[0].twin; k < slice[1].twin; ++k, weight += 2 * LANES) {
        fill_column(slice, columns->twin[k].ahead, all, rows, diffusion, weight);
        fill_column(slice, columns->twin[k].behind, all, rows, diffusion, weight + LANES);
    }
    for (size_t k = slice[0].single; k < slice[1].single; ++k, weight += LANES)
        fill_column(slice, columns->single[k].from, columns->single[k].lanes, rows, diffusion, weight);
}

sphm_status sphm_column_diffusion_create(sphm_column_diffusion *d, const sphm_solid_columns *columns,
                                         const sphm_neighbours *rows, const sphm_diffusion *diffusion,
                                         sphm_context *context) {
    const size_t weights = weight_count(columns) * sizeof(sphm_real),
                 length = (columns->count + 2 * ROOM) * sizeof(sphm_real);
    memset(d, 0, sizeof *d);
    d->weight = (sphm_real *)aligned_alloc(128, (weights + 128) / 128 * 128);
    d->memory = (sphm_real *)calloc(1, length);
    if (!d->weight || !d->memory) {
        sphm_column_diffusion_free(d);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the diffusion of %zu particles",
                         columns->count);
    }
    d->columns = columns;
    d->potential = d->memory + ROOM;
    for (size_t s = 0; s < columns->slices; ++s)
        fill_slice(columns, &columns->slice[s], rows, diffusion,
                   d->weight + LANES * first_column(&columns->slice[s]));
    return SPHM_OK;
}

/* sum_j weight_ij (potential_j - potential_i). Differences, not sum w V - V sum w, so that a uniform
 * potential stays uniform to the bit. */
SPHM_INLINE sphm_lanes flow(const sphm_column_diffusion *d, const sphm_solid_slice *slice, sphm_lanes own) {
    const sphm_solid_columns *columns = d->columns;
    const sphm_real *weight = d->weight + LANES * first_column(slice), *potential = d->potential;
    sphm_lanes ahead = {0}, behind = {0};
    const sphm_solid_twin *twin = columns->twin + slice[0].twin, *last = columns->twin + slice[1].twin;
    for (; twin < last; ++twin, weight += 2 * LANES) {
        ahead += (sphm_lanes_load(potential + twin->ahead) - own) * sphm_lanes_load_aligned(weight);
        behind += (sphm_lanes_load(potential + twin->behind) - own) * sphm_lanes_load_aligned(weight + LANES);
    }
    const sphm_solid_single *single = columns->single + slice[0].single,
                            *end = columns->single + slice[1].single;
    for (; end - single >= 2; single += 2, weight += 2 * LANES) {
        ahead += (sphm_lanes_load(potential + single[0].from) - own) * sphm_lanes_load_aligned(weight);
        behind +=
            (sphm_lanes_load(potential + single[1].from) - own) * sphm_lanes_load_aligned(weight + LANES);
    }
    if (single < end)
        ahead += (sphm_lanes_load(potential + single->from) - own) * sphm_lanes_load_aligned(weight);
    return ahead + behind;
}

void sphm_column_diffusion_sweep(const sphm_column_diffusion *d, sphm_state *state, double step_ms,
                                 int threads) {
#ifndef _OPENMP
    (void)threads;
#endif
    const sphm_real step = (sphm_real)step_ms;
    const size_t slices = d->columns->slices;
#pragma omp parallel num_threads(threads)
    {
#pragma omp for schedule(static)
        for (size_t b = 0; b < sphm_block_count(state->count); ++b) {
            const size_t begin = sphm_block_begin(b), end = sphm_block_end(b, state->count);
            memcpy(d->potential + begin, state->membrane_potential + begin,
                   (end - begin) * sizeof(sphm_real));
        }
#pragma omp for schedule(static)
        for (size_t s = 0; s < slices; ++s) {
            const sphm_solid_slice *slice = &d->columns->slice[s];
            const sphm_lanes own = sphm_lanes_load(d->potential + slice->slot);
            sphm_lanes_store_some(state->membrane_next + slice->slot, own + step * flow(d, slice, own),
                                  sphm_some_of(sphm_first_lanes(slice->count)));
        }
    }
}
