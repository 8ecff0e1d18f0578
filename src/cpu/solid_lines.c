/* Memory of the solid sweeps; see solid_sweeps.h. */
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "cpu/parallel.h"
#include "cpu/solid_sweeps.h"

static void *allocate(size_t elements, size_t size) {
    const size_t bytes = (elements * size + 127) / 128 * 128;
    void *memory = aligned_alloc(128, bytes ? bytes : 128);
    if (memory)
        memset(memory, 0, bytes);
    return memory;
}

static size_t even(int32_t count) {
    return ((size_t)count + 1) & ~(size_t)1;
}

static int allocate_shared(sphm_solid_lines *lines) {
    for (int d = 0; d < 3; ++d)
        lines->force[d] = (sphm_real *)allocate(lines->count, sizeof(sphm_real));
    lines->block_modulus_Pa = (double *)allocate(lines->blocks, sizeof(double));
    lines->block_inverted = (int32_t *)allocate(lines->blocks, sizeof(int32_t));
    return lines->force[0] && lines->force[1] && lines->force[2] && lines->block_modulus_Pa &&
           lines->block_inverted;
}

static int allocate_lines(sphm_solid_lines *lines) {
    const size_t n = lines->count;
    lines->row_start = (size_t *)allocate(n + 1, sizeof *lines->row_start);
    lines->pair = (sphm_solid_pair *)allocate(lines->pairs, sizeof *lines->pair);
    lines->constant = (sphm_real *)allocate(9 * lines->stride, sizeof(sphm_real));
    lines->wide = (sphm_real *)allocate(SPHM_STRESS_LINE * n, sizeof(sphm_real));
    lines->stress = (sphm_real *)allocate(SPHM_STRESS_LINE * n, sizeof(sphm_real));
    return lines->row_start && lines->pair && lines->constant && lines->wide && lines->stress;
}

static void fill_row(sphm_solid_lines *lines, const sphm_neighbours *rows, const sphm_gradient *gradient,
                     size_t slot) {
    const size_t from = rows->row_start[slot], count = (size_t)rows->row_count[slot];
    sphm_solid_pair *row = lines->pair + lines->row_start[slot];
    double sum[3] = {0, 0, 0};
    for (size_t k = 0; k < even(rows->row_count[slot]); ++k) {
        row[k].slot = k < count ? rows->slot[from + k] : (int32_t)slot;
        row[k].weight = k < count ? gradient->pair[4 * (from + k) + 3] : 0;
        for (size_t d = 0; d < 3 && k < count; ++d)
            sum[d] += (double)gradient->pair[4 * (from + k) + d];
    }
    for (size_t d = 0; d < 6; ++d)
        lines->constant[d * lines->stride + slot] = gradient->correction[6 * slot + d];
    for (size_t d = 0; d < 3; ++d)
        lines->constant[(6 + d) * lines->stride + slot] = (sphm_real)sum[d];
}

static int create_lines(sphm_solid_lines *lines, const sphm_neighbours *rows, const sphm_gradient *gradient,
                        const sphm_real *const rest[3]) {
    const size_t n = rows->count;
    lines->stride = (n + SPHM_SOLID_BATCH - 1) / SPHM_SOLID_BATCH * SPHM_SOLID_BATCH;
    lines->blocks = sphm_block_count(n);
    for (size_t slot = 0; slot < n; ++slot)
        lines->pairs += even(rows->row_count[slot]);
    if (!allocate_lines(lines))
        return 0;
    for (size_t slot = 0; slot < n; ++slot) {
        lines->row_start[slot + 1] = lines->row_start[slot] + even(rows->row_count[slot]);
        fill_row(lines, rows, gradient, slot);
        for (size_t d = 0; d < 3; ++d)
            lines->wide[SPHM_STRESS_LINE * slot + 4 * d + 3] = rest[d][slot];
    }
    return 1;
}

sphm_status sphm_solid_lines_create(sphm_solid_lines *lines, const sphm_neighbours *rows,
                                    const sphm_gradient *gradient, const sphm_real *x, const sphm_real *y,
                                    const sphm_real *z, const sphm_lattice *lattice, sphm_context *context) {
    const sphm_real *const rest[3] = {x, y, z};
    memset(lines, 0, sizeof *lines);
    lines->count = rows->count;
    if (lattice) {
        const sphm_status status =
            sphm_solid_columns_create(&lines->columns, rows, gradient, lattice, context);
        if (status != SPHM_OK)
            return status;
    }
    int done = 1;
    if (lines->columns.slice)
        lines->blocks = (lines->columns.slices + SPHM_SOLID_CHUNK - 1) / SPHM_SOLID_CHUNK;
    else
        done = create_lines(lines, rows, gradient, rest);
    if (!done || !allocate_shared(lines)) {
        sphm_solid_lines_free(lines);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the solid tissue of %zu particles",
                         rows->count);
    }
    return SPHM_OK;
}

void sphm_solid_lines_free(sphm_solid_lines *lines) {
    sphm_solid_columns_free(&lines->columns);
    free(lines->row_start);
    free(lines->pair);
    free(lines->constant);
    free(lines->wide);
    free(lines->stress);
    for (int d = 0; d < 3; ++d)
        free(lines->force[d]);
    free(lines->block_modulus_Pa);
    free(lines->block_inverted);
    memset(lines, 0, sizeof *lines);
}

size_t sphm_solid_lines_bytes(const sphm_solid_lines *lines) {
    size_t bytes = 3 * lines->count * sizeof(sphm_real) + lines->blocks * (sizeof(double) + sizeof(int32_t)) +
                   sphm_solid_columns_bytes(&lines->columns);
    if (lines->pair)
        bytes += (9 * lines->stride + 2 * SPHM_STRESS_LINE * lines->count) * sizeof(sphm_real) +
                 lines->pairs * sizeof(sphm_solid_pair) + (lines->count + 1) * sizeof(size_t);
    return bytes;
}
