/* Neighbour rows from the cell grid: count, lay out, fill. Reads positions, writes rows. Both passes run over
 * blocks in parallel; each row depends on nothing but the grid, so rows are the same for any thread count. */
#include "cpu/neighbours.h"

#ifdef __AVX512F__
#include <immintrin.h>
#endif
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "cpu/parallel.h"

typedef struct search {
    const sphm_grid *grid;
    const sphm_real *x, *y, *z;
    const sphm_real *position[3]; /* along the grid's axes */
    sphm_real radius_squared;
    int reach; /* cells to look at on either side */
} search;

void sphm_neighbours_free(sphm_neighbours *rows) {
    free(rows->row_start);
    free(rows->row_count);
    free(rows->slot);
    memset(rows, 0, sizeof *rows);
}

static int cell_of(const search *s, int d, size_t slot) {
    return sphm_cells_coordinate(&s->grid->cells, d, (double)s->position[d][slot]);
}

#if defined(__AVX512F__) && !defined(SPH_MUSCLE_DOUBLE)

/* Which of the slots begin ... begin + 15, but before end, are within the radius, the particle itself too. */
static inline __mmask16 near_sixteen(const search *s, __m512 xi, __m512 yi, __m512 zi, int32_t begin,
                                     int32_t end) {
    const __mmask16 some = end - begin < 16 ? (__mmask16)((1u << (end - begin)) - 1) : (__mmask16)0xffff;
    const __m512 dx = _mm512_sub_ps(xi, _mm512_maskz_loadu_ps(some, s->x + begin));
    const __m512 dy = _mm512_sub_ps(yi, _mm512_maskz_loadu_ps(some, s->y + begin));
    const __m512 dz = _mm512_sub_ps(zi, _mm512_maskz_loadu_ps(some, s->z + begin));
    const __m512 r2 = _mm512_fmadd_ps(dx, dx, _mm512_fmadd_ps(dy, dy, _mm512_mul_ps(dz, dz)));
    return _mm512_mask_cmp_ps_mask(some, r2, _mm512_set1_ps(s->radius_squared), _CMP_LE_OQ);
}

/* Appends to `row` the slots begin ... end - 1 within the radius. */
static int32_t *append_run(const search *s, size_t slot, int32_t begin, int32_t end, int32_t *row) {
    const __m512 xi = _mm512_set1_ps(s->x[slot]), yi = _mm512_set1_ps(s->y[slot]),
                 zi = _mm512_set1_ps(s->z[slot]);
    const __m512i ascending = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const __m512i own = _mm512_set1_epi32((int32_t)slot);
    for (int32_t j = begin; j < end; j += 16) {
        const __m512i slots = _mm512_add_epi32(_mm512_set1_epi32(j), ascending);
        const __mmask16 near = _mm512_mask_cmpneq_epi32_mask(near_sixteen(s, xi, yi, zi, j, end), slots, own);
        _mm512_mask_compressstoreu_epi32(row, near, slots);
        row += __builtin_popcount(near);
    }
    return row;
}

static int32_t count_run(const search *s, size_t slot, int32_t begin, int32_t end) {
    const __m512 xi = _mm512_set1_ps(s->x[slot]), yi = _mm512_set1_ps(s->y[slot]),
                 zi = _mm512_set1_ps(s->z[slot]);
    int32_t count = 0;
    for (int32_t j = begin; j < end; j += 16)
        count += __builtin_popcount(near_sixteen(s, xi, yi, zi, j, end));
    return count;
}

#else

/* Appends to `row` the slots begin ... end - 1 within the radius, without branches: the write position moves
 * on only past slots that count. */
static int32_t *append_run(const search *s, size_t slot, int32_t begin, int32_t end, int32_t *row) {
    const sphm_real xi = s->x[slot], yi = s->y[slot], zi = s->z[slot];
    for (int32_t j = begin; j < end; ++j) {
        const sphm_real dx = xi - s->x[j], dy = yi - s->y[j], dz = zi - s->z[j];
        const int near = dx * dx + dy * dy + dz * dz <= s->radius_squared;
        *row = j;
        row += near & (j != (int32_t)slot);
    }
    return row;
}

static int32_t count_run(const search *s, size_t slot, int32_t begin, int32_t end) {
    const sphm_real xi = s->x[slot], yi = s->y[slot], zi = s->z[slot];
    int32_t count = 0;
    for (int32_t j = begin; j < end; ++j) {
        const sphm_real dx = xi - s->x[j], dy = yi - s->y[j], dz = zi - s->z[j];
        count += dx * dx + dy * dy + dz * dz <= s->radius_squared;
    }
    return count;
}

#endif

/* Visits the runs of slots around a particle in ascending order; cells of a line along the fast axis are one
 * run. With row == NULL counts, itself included; else appends and returns how many. */
static int32_t visit(const search *s, size_t slot, int32_t *row) {
    const sphm_cells *cells = &s->grid->cells;
    const int slow = cell_of(s, 0, slot), middle = cell_of(s, 1, slot), fast = cell_of(s, 2, slot);
    const int fast_low = sphm_cells_clamp(cells, 2, fast - s->reach),
              fast_high = sphm_cells_clamp(cells, 2, fast + s->reach);
    int32_t count = 0;
    int32_t *end = row;
    for (int a = sphm_cells_clamp(cells, 0, slow - s->reach);
         a <= sphm_cells_clamp(cells, 0, slow + s->reach); ++a)
        for (int b = sphm_cells_clamp(cells, 1, middle - s->reach);
             b <= sphm_cells_clamp(cells, 1, middle + s->reach); ++b) {
            const int32_t first = s->grid->start[sphm_cells_index(cells, a, b, fast_low)];
            const int32_t last = s->grid->start[sphm_cells_index(cells, a, b, fast_high) + 1];
            if (row)
                end = append_run(s, slot, first, last, end);
            else
                count += count_run(s, slot, first, last);
        }
    return row ? (int32_t)(end - row) : count;
}

static sphm_status reserve_rows(sphm_neighbours *rows, size_t count, sphm_context *context) {
    if (rows->row_start && rows->count == count)
        return SPHM_OK;
    sphm_neighbours_free(rows);
    rows->row_start = (size_t *)malloc((count + 1) * sizeof *rows->row_start);
    rows->row_count = (int32_t *)malloc(count * sizeof *rows->row_count);
    if (!rows->row_start || !rows->row_count) {
        sphm_neighbours_free(rows);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the neighbour rows of %zu particles",
                         count);
    }
    rows->count = count;
    return SPHM_OK;
}

/* Rows start on a cache line. */
static sphm_status reserve_slots(sphm_neighbours *rows, size_t slots, sphm_context *context) {
    if (slots <= rows->capacity)
        return SPHM_OK;
    const size_t wanted = slots + slots / 32; /* the muscle deforms: leave room */
    const size_t capacity = (wanted + SPHM_ROW_ALIGN - 1) / SPHM_ROW_ALIGN * SPHM_ROW_ALIGN;
    free(rows->slot);
    rows->slot = (int32_t *)aligned_alloc(64, capacity * sizeof *rows->slot);
    rows->capacity = rows->slot ? capacity : 0;
    if (!rows->slot)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu neighbour pairs", capacity);
    return SPHM_OK;
}

static void count_rows(sphm_neighbours *rows, const search *s, int threads) {
    const size_t blocks = sphm_block_count(rows->count);
    (void)threads;
#pragma omp parallel for num_threads(threads) schedule(static)
    for (size_t block = 0; block < blocks; ++block)
        for (size_t slot = sphm_block_begin(block); slot < sphm_block_end(block, rows->count); ++slot)
            rows->row_count[slot] = visit(s, slot, NULL) - 1;
}

/* append_run() may write one slot past a full row. Inside a block the next row, filled later by the same
 * thread, mends that; the last row of a block gets room for it, as its successor belongs to another thread.
 */
static size_t lay_out_rows(sphm_neighbours *rows) {
    size_t next = 0;
    for (size_t slot = 0; slot < rows->count; ++slot) {
        const size_t spare = (slot + 1) % SPHM_BLOCK == 0 || slot + 1 == rows->count;
        const size_t length = (size_t)rows->row_count[slot] + spare;
        rows->row_start[slot] = next;
        next += (length + SPHM_ROW_ALIGN - 1) / SPHM_ROW_ALIGN * SPHM_ROW_ALIGN;
    }
    rows->row_start[rows->count] = next;
    return next;
}

static void fill_rows(sphm_neighbours *rows, const search *s, int threads) {
    const size_t blocks = sphm_block_count(rows->count);
    (void)threads;
#pragma omp parallel for num_threads(threads) schedule(static)
    for (size_t block = 0; block < blocks; ++block) {
        const size_t begin = sphm_block_begin(block), end = sphm_block_end(block, rows->count);
        for (size_t slot = begin; slot < end; ++slot) {
            int32_t *row = rows->slot + rows->row_start[slot];
            (void)visit(s, slot, row);
            int32_t *brim = rows->slot + rows->row_start[slot + 1];
            for (int32_t *pad = row + rows->row_count[slot]; pad < brim; ++pad)
                *pad = (int32_t)slot;
        }
    }
}

sphm_status sphm_neighbours_build(sphm_neighbours *rows, const sphm_grid *grid, const sphm_real *x,
                                  const sphm_real *y, const sphm_real *z, size_t count, double radius_m,
                                  int threads, sphm_context *context) {
    const sphm_real *const position[3] = {x, y, z};
    search s;
    s.grid = grid;
    s.x = x;
    s.y = y;
    s.z = z;
    for (int d = 0; d < 3; ++d)
        s.position[d] = position[grid->cells.axis[d]];
    s.radius_squared = (sphm_real)(radius_m * radius_m);
    s.reach = sphm_cells_reach(&grid->cells, radius_m);

    sphm_status status = reserve_rows(rows, count, context);
    if (status != SPHM_OK)
        return status;
    count_rows(rows, &s, threads);
    status = reserve_slots(rows, lay_out_rows(rows), context);
    if (status != SPHM_OK)
        return status;
    fill_rows(rows, &s, threads);
    return SPHM_OK;
}

static int compare_slots(const void *a, const void *b) {
    const int32_t p = *(const int32_t *)a, q = *(const int32_t *)b;
    return (p > q) - (p < q);
}

static void fill_reordered(const sphm_neighbours *from, const int32_t *order, const int32_t *renamed,
                           sphm_neighbours *to) {
    size_t next = 0;
    for (size_t slot = 0; slot < to->count; ++slot) {
        const int32_t *old = from->slot + from->row_start[order[slot]];
        const int32_t count = from->row_count[order[slot]];
        int32_t *row = to->slot + next;
        to->row_start[slot] = next;
        to->row_count[slot] = count;
        next += ((size_t)count + SPHM_ROW_ALIGN - 1) / SPHM_ROW_ALIGN * SPHM_ROW_ALIGN;
        for (int32_t k = 0; k < count; ++k)
            row[k] = renamed[old[k]];
        qsort(row, (size_t)count, sizeof *row, compare_slots);
        for (int32_t *pad = row + count; pad < to->slot + next; ++pad)
            *pad = (int32_t)slot;
    }
    to->row_start[to->count] = next;
}

sphm_status sphm_neighbours_reorder(sphm_neighbours *rows, const int32_t *order, sphm_context *context) {
    sphm_neighbours reordered;
    memset(&reordered, 0, sizeof reordered);
    int32_t *renamed = (int32_t *)malloc((rows->count + 1) * sizeof *renamed);
    sphm_status status = renamed ? reserve_rows(&reordered, rows->count, context)
                                 : sphm_fail(context, SPHM_REFUSED_MEMORY,
                                             "no memory to sort the rows of %zu particles", rows->count);
    if (status == SPHM_OK)
        status = reserve_slots(&reordered, rows->row_start[rows->count], context);
    if (status == SPHM_OK) {
        for (size_t slot = 0; slot < rows->count; ++slot)
            renamed[order[slot]] = (int32_t)slot;
        fill_reordered(rows, order, renamed, &reordered);
        sphm_neighbours_free(rows);
        *rows = reordered;
    } else {
        sphm_neighbours_free(&reordered);
    }
    free(renamed);
    return status;
}

size_t sphm_neighbours_count_within(const sphm_neighbours *rows, const sphm_real *x, const sphm_real *y,
                                    const sphm_real *z, double radius_m) {
    const sphm_real radius_squared = (sphm_real)(radius_m * radius_m);
    size_t pairs = 0;
    for (size_t slot = 0; slot < rows->count; ++slot) {
        const int32_t *row = rows->slot + rows->row_start[slot];
        for (int32_t k = 0; k < rows->row_count[slot]; ++k) {
            const int32_t j = row[k];
            const sphm_real dx = x[slot] - x[j], dy = y[slot] - y[j], dz = z[slot] - z[j];
            pairs += dx * dx + dy * dy + dz * dz <= radius_squared;
        }
    }
    return pairs;
}
