/* Making columns from neighbour rows; see solid_columns.h. */
#include "cpu/solid_columns.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"

#define LANES 16
/* Room at both ends of an array: a lane reaches LANES - 1 slots too far, and the last vector as many more. */
#define ROOM (2 * LANES)
/* Offsets beyond this many sites: not the lattice one would want to have columns of. */
#define REACH 8
#define SIDE (2 * REACH + 1)
#define CELLS (SIDE * SIDE * SIDE)
/* Pairs' weights may be off their offset's mean by this many times the rounding of a position. */
#define TOLERANCE 16
/* Fewer pairs a column than this: rows are faster. */
#define LEAST_PAIRS 4

void sphm_solid_columns_free(sphm_solid_columns *columns) {
    free(columns->slice);
    free(columns->twin);
    free(columns->single);
    free(columns->weight);
    free(columns->memory);
    memset(columns, 0, sizeof *columns);
}

static size_t room_for(size_t count) {
    return (count + 2 * ROOM + LANES - 1) / LANES * LANES;
}

size_t sphm_solid_columns_bytes(const sphm_solid_columns *columns) {
    if (!columns->slice)
        return 0;
    return (columns->slices + 1) * sizeof *columns->slice + columns->twins * sizeof *columns->twin +
           columns->singles * sizeof *columns->single +
           (4 * columns->offsets + 27 * room_for(columns->count)) * sizeof(sphm_real);
}

/* Weights by offset ----------------------------------------------------------------------------------------
 */

/* The offset of a pair as a cell of a cube, or -1. Opposite offsets are in opposite cells. */
static int cell_of(const sphm_lattice *lattice, size_t from, size_t to) {
    int cell = 0;
    for (int d = 2; d >= 0; --d) {
        const int step = lattice->site[3 * to + (size_t)d] - lattice->site[3 * from + (size_t)d];
        if (step < -REACH || step > REACH)
            return -1;
        cell = SIDE * cell + step + REACH;
    }
    return cell;
}

typedef struct offset_table {
    double sum[CELLS][4];
    size_t pairs[CELLS];
    int number[CELLS]; /* of the weights, or -1 */
    int count;
} offset_table;

/* Means over all pairs of an offset and, mirrored, of its opposite. Returns whether all are near it. */
static int average_weights(offset_table *table, const sphm_neighbours *rows, const sphm_gradient *gradient,
                           const sphm_lattice *lattice) {
    double largest[2] = {0, 0};
    for (int pass = 0; pass < 2; ++pass) {
        for (size_t slot = 0; slot < rows->count; ++slot)
            for (int32_t k = 0; k < rows->row_count[slot]; ++k) {
                const size_t at = rows->row_start[slot] + (size_t)k;
                const int cell = cell_of(lattice, slot, (size_t)rows->slot[at]);
                if (cell < 0)
                    return 0;
                const int opposite = CELLS - 1 - cell;
                table->pairs[cell] += pass == 0;
                for (int d = 0; d < 4; ++d) {
                    const double value = (double)gradient->pair[4 * at + (size_t)d];
                    if (pass == 0) {
                        table->sum[cell][d] += value / 2;
                        table->sum[opposite][d] += (d == 3 ? value : -value) / 2;
                        largest[d == 3] = fmax(largest[d == 3], fabs(value));
                    } else if (!(fabs(value - table->sum[cell][d]) <=
                                 TOLERANCE * lattice->rounding * largest[d == 3])) {
                        return 0;
                    }
                }
            }
        for (int cell = 0; cell < CELLS && pass == 0; ++cell)
            for (int d = 0; d < 4 && table->pairs[cell]; ++d)
                table->sum[cell][d] /= (double)table->pairs[cell];
    }
    return 1;
}

static int number_offsets(offset_table *table, sphm_solid_columns *columns) {
    for (int cell = 0; cell < CELLS; ++cell)
        table->number[cell] = table->pairs[cell] ? table->count++ : -1;
    columns->offsets = (size_t)table->count;
    columns->weight = (sphm_real *)malloc((4 * columns->offsets + 1) * sizeof(sphm_real));
    if (!columns->weight)
        return 0;
    for (int cell = 0; cell < CELLS; ++cell)
        for (int d = 0; d < 4 && table->number[cell] >= 0; ++d)
            columns->weight[4 * table->number[cell] + d] = (sphm_real)table->sum[cell][d];
    return 1;
}

/* Slices and their columns ---------------------------------------------------------------------------------
 */

/* Runs of neighbouring sites, cut after 16. */
static int cut_slices(sphm_solid_columns *columns, const sphm_lattice *lattice) {
    columns->slice = (sphm_solid_slice *)calloc(columns->count + 1, sizeof *columns->slice);
    if (!columns->slice)
        return 0;
    sphm_solid_slice *slice = NULL;
    for (size_t slot = 0; slot < columns->count; ++slot) {
        const int32_t *site = lattice->site + 3 * slot;
        const int goes_on = slot > 0 && site[0] == site[-3] + 1 && site[1] == site[-2] && site[2] == site[-1];
        if (!goes_on || slice->count == LANES) {
            slice = &columns->slice[columns->slices++];
            slice->slot = (int32_t)slot;
        }
        ++slice->count;
    }
    return 1;
}

/* A column in the making. */
typedef struct column {
    int32_t cell, from;
    uint16_t lanes;
} column;

static int compare_columns(const void *a, const void *b) {
    const column *p = (const column *)a, *q = (const column *)b;
    if (p->cell != q->cell)
        return p->cell < q->cell ? -1 : 1;
    return (p->from > q->from) - (p->from < q->from);
}

/* All columns of a slice, by offset. Returns how many. */
static size_t collect(const sphm_solid_slice *slice, const sphm_neighbours *rows, const sphm_lattice *lattice,
                      column *found) {
    size_t entries = 0, count = 0;
    for (int32_t lane = 0; lane < slice->count; ++lane) {
        const size_t slot = (size_t)(slice->slot + lane);
        const int32_t *row = rows->slot + rows->row_start[slot];
        for (int32_t k = 0; k < rows->row_count[slot]; ++k) {
            found[entries].cell = cell_of(lattice, slot, (size_t)row[k]);
            found[entries].from = row[k] - lane;
            found[entries++].lanes = (uint16_t)(1u << lane);
        }
    }
    qsort(found, entries, sizeof *found, compare_columns);
    for (size_t k = 0; k < entries; ++k)
        if (count && compare_columns(&found[k], &found[count - 1]) == 0)
            found[count - 1].lanes |= found[k].lanes;
        else
            found[count++] = found[k];
    return count;
}

/* The column of the opposite offset, if it and `c` both have all the slice's lanes. */
static const column *twin_of(const column *c, const column *found, size_t count, uint16_t all) {
    column wanted;
    wanted.cell = CELLS - 1 - c->cell;
    for (size_t k = 0; k < count && c->lanes == all; ++k)
        if (found[k].cell == wanted.cell && found[k].lanes == all)
            return &found[k];
    return NULL;
}

/* Writes the slice's columns where it says they begin, or only counts them. */
static void divide(sphm_solid_columns *columns, sphm_solid_slice *slice, const offset_table *table,
                   const column *found, size_t count, int write) {
    const uint16_t all = (uint16_t)((1u << slice->count) - 1);
    size_t twins = 0, singles = 0;
    for (size_t k = 0; k < count; ++k) {
        const column *c = &found[k], *other = twin_of(c, found, count, all);
        if (other && c->cell > other->cell)
            continue; /* its twin has it */
        if (other && write) {
            sphm_solid_twin *twin = &columns->twin[slice->twin + twins];
            twin->ahead = c->from;
            twin->behind = other->from;
            twin->weight = 4 * table->number[c->cell];
        } else if (write) {
            sphm_solid_single *single = &columns->single[slice->single + singles];
            single->from = c->from;
            single->lanes = c->lanes;
            single->weight = (uint16_t)table->number[c->cell];
        }
        twins += other != NULL;
        singles += other == NULL;
    }
    if (!write) { /* turned into starts when all are counted */
        slice->twin = twins;
        slice->single = singles;
    }
}

/* Twice over all slices: to count and to write. */
static int fill_columns(sphm_solid_columns *columns, const offset_table *table, const sphm_neighbours *rows,
                        const sphm_lattice *lattice) {
    size_t longest = 1;
    for (size_t slot = 0; slot < rows->count; ++slot)
        longest = (size_t)rows->row_count[slot] > longest ? (size_t)rows->row_count[slot] : longest;
    column *found = (column *)malloc(LANES * longest * sizeof *found);
    for (int write = 0; write < 2 && found; ++write) {
        for (size_t s = 0; s < columns->slices; ++s) {
            const size_t count = collect(&columns->slice[s], rows, lattice, found);
            divide(columns, &columns->slice[s], table, found, count, write);
        }
        for (size_t s = 0; s <= columns->slices && !write; ++s) {
            sphm_solid_slice *slice = &columns->slice[s];
            const size_t twins = slice->twin, singles = slice->single;
            slice->twin = columns->twins;
            slice->single = columns->singles;
            columns->twins += s < columns->slices ? twins : 0;
            columns->singles += s < columns->slices ? singles : 0;
        }
        if (!write) {
            columns->twin = (sphm_solid_twin *)malloc((columns->twins + 1) * sizeof *columns->twin);
            columns->single = (sphm_solid_single *)malloc((columns->singles + 1) * sizeof *columns->single);
            if (!columns->twin || !columns->single)
                break;
        }
    }
    const int done = found && columns->twin && columns->single;
    free(found);
    return done;
}

/* Arrays ---------------------------------------------------------------------------------------------------
 */

static int allocate_arrays(sphm_solid_columns *columns) {
    const size_t length = room_for(columns->count), bytes = 27 * length * sizeof(sphm_real);
    columns->memory = (sphm_real *)aligned_alloc(64, (bytes + 63) / 64 * 64);
    if (!columns->memory)
        return 0;
    memset(columns->memory, 0, bytes);
    sphm_real *next = columns->memory + ROOM;
    for (int k = 0; k < 6; ++k, next += length)
        columns->motion[k] = next;
    for (int k = 0; k < 12; ++k, next += length)
        columns->stress[k] = next;
    for (int k = 0; k < 9; ++k, next += length)
        columns->constant[k] = next;
    return 1;
}

static void fill_constants(sphm_solid_columns *columns, const sphm_gradient *gradient) {
    for (size_t slot = 0; slot < columns->count; ++slot)
        for (size_t k = 0; k < 6; ++k)
            columns->constant[k][slot] = gradient->correction[6 * slot + k];
    for (size_t s = 0; s < columns->slices; ++s)
        for (int32_t lane = 0; lane < columns->slice[s].count; ++lane)
            for (size_t k = 0; k < 3; ++k) {
                double sum = 0;
                for (size_t c = columns->slice[s].single; c < columns->slice[s + 1].single; ++c)
                    if (columns->single[c].lanes >> lane & 1)
                        sum += (double)columns->weight[4 * columns->single[c].weight + k];
                columns->constant[6 + k][columns->slice[s].slot + lane] = (sphm_real)sum;
            }
}

static int pays(const sphm_solid_columns *columns) {
    return columns->pairs >= LEAST_PAIRS * (2 * columns->twins + columns->singles);
}

sphm_status sphm_solid_columns_create(sphm_solid_columns *columns, const sphm_neighbours *rows,
                                      const sphm_gradient *gradient, const sphm_lattice *lattice,
                                      sphm_context *context) {
    memset(columns, 0, sizeof *columns);
    if (!lattice->site)
        return SPHM_OK;
    columns->count = rows->count;
    for (size_t slot = 0; slot < rows->count; ++slot)
        columns->pairs += (size_t)rows->row_count[slot];
    offset_table *table = (offset_table *)calloc(1, sizeof *table);
    int done = table != NULL;
    if (done && !average_weights(table, rows, gradient, lattice)) {
        free(table);
        sphm_solid_columns_free(columns);
        return SPHM_OK;
    }
    done = done && number_offsets(table, columns) && cut_slices(columns, lattice) &&
           fill_columns(columns, table, rows, lattice);
    free(table);
    if (done && !pays(columns)) {
        sphm_solid_columns_free(columns);
        return SPHM_OK;
    }
    if (!done || !allocate_arrays(columns)) {
        sphm_solid_columns_free(columns);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the columns of %zu particles",
                         rows->count);
    }
    fill_constants(columns, gradient);
    return SPHM_OK;
}
