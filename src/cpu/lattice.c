/* Finding the lattice in a filling; see lattice.h. */
#include "cpu/lattice.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/vec3.h"

/* Positions may be this share of a spacing off their site: the directions come from two neighbours' rounded
 * positions and are extrapolated over the muscle. */
#define TOLERANCE 0.02
/* Directions count as independent when their triple product is above this share of their lengths'. */
#define INDEPENDENT 0.1

void sphm_lattice_free(sphm_lattice *lattice) {
    free(lattice->site);
    memset(lattice, 0, sizeof *lattice);
}

static void subtract(const sphm_real *const position[3], size_t from, size_t to, double difference[3]) {
    for (int d = 0; d < 3; ++d)
        difference[d] = (double)position[d][to] - (double)position[d][from];
}

static int independent(const double e[3][3], int known, const double v[3]) {
    double normal[3];
    if (known == 0)
        return sphm_norm3(v) > 0;
    sphm_cross3(e[0], known == 1 ? v : e[1], normal);
    if (known == 1)
        return sphm_norm3(normal) > INDEPENDENT * sphm_norm3(e[0]) * sphm_norm3(v);
    return fabs(sphm_dot3(normal, v)) > INDEPENDENT * sphm_norm3(normal) * sphm_norm3(v);
}

/* The three shortest independent differences to neighbours of the particle that has the most. */
static int find_directions(const sphm_neighbours *rows, const sphm_real *const position[3], size_t *origin,
                           double e[3][3]) {
    *origin = 0;
    for (size_t slot = 1; slot < rows->count; ++slot)
        if (rows->row_count[slot] > rows->row_count[*origin])
            *origin = slot;
    const int32_t *row = rows->slot + rows->row_start[*origin];
    for (int known = 0; known < 3; ++known) {
        double shortest = INFINITY;
        for (int32_t k = 0; k < rows->row_count[*origin]; ++k) {
            double v[3];
            subtract(position, *origin, (size_t)row[k], v);
            if (sphm_norm3(v) < shortest * (1 - 1e-3) && independent((const double(*)[3])e, known, v)) {
                shortest = sphm_norm3(v);
                memcpy(e[known], v, sizeof v);
            }
        }
        if (!(shortest < INFINITY))
            return 0;
    }
    return 1;
}

/* Rows of the inverse of the matrix with columns e: site = inverse . (X - origin). */
static void invert_directions(const double e[3][3], double inverse[3][3]) {
    for (int d = 0; d < 3; ++d)
        sphm_cross3(e[(d + 1) % 3], e[(d + 2) % 3], inverse[d]);
    const double volume = sphm_dot3(e[0], inverse[0]);
    for (int d = 0; d < 9; ++d)
        inverse[d / 3][d % 3] /= volume;
}

/* Returns whether every particle is on a site. */
static int assign_sites(sphm_lattice *lattice, const sphm_real *const position[3], size_t origin,
                        const double inverse[3][3]) {
    for (size_t slot = 0; slot < lattice->count; ++slot) {
        double X[3];
        subtract(position, origin, slot, X);
        for (int d = 0; d < 3; ++d) {
            const double place = sphm_dot3(inverse[d], X), site = nearbyint(place);
            if (!(fabs(place - site) < TOLERANCE))
                return 0;
            lattice->site[3 * slot + (size_t)d] = (int32_t)site;
        }
    }
    return 1;
}

/* The direction with the most sites first, the one with the fewest in the middle: rows that are neighbours
 * across it are then near in memory. */
static void rank_directions(sphm_lattice *lattice) {
    int32_t low[3] = {INT32_MAX, INT32_MAX, INT32_MAX}, high[3] = {INT32_MIN, INT32_MIN, INT32_MIN};
    for (size_t k = 0; k < 3 * lattice->count; ++k) {
        const int32_t site = lattice->site[k];
        low[k % 3] = site < low[k % 3] ? site : low[k % 3];
        high[k % 3] = site > high[k % 3] ? site : high[k % 3];
    }
    int most = 0, fewest = 2;
    for (int d = 0; d < 3; ++d) {
        most = high[d] - low[d] > high[most] - low[most] ? d : most;
        fewest = high[d] - low[d] < high[fewest] - low[fewest] ? d : fewest;
    }
    if (most == fewest)
        return;
    for (size_t slot = 0; slot < lattice->count; ++slot) {
        int32_t *site = lattice->site + 3 * slot;
        const int32_t ranked[3] = {site[most], site[fewest], site[3 - most - fewest]};
        memcpy(site, ranked, sizeof ranked);
    }
}

sphm_status sphm_lattice_find(sphm_lattice *lattice, const sphm_neighbours *rows,
                              const sphm_real *const position[3], sphm_context *context) {
    double e[3][3], inverse[3][3];
    size_t origin;
    memset(lattice, 0, sizeof *lattice);
    lattice->count = rows->count;
    if (rows->count == 0 || !find_directions(rows, position, &origin, e))
        return SPHM_OK;
    lattice->site = (int32_t *)malloc(3 * rows->count * sizeof *lattice->site);
    if (!lattice->site)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the lattice sites of %zu particles",
                         rows->count);
    invert_directions((const double(*)[3])e, inverse);
    if (!assign_sites(lattice, position, origin, (const double(*)[3])inverse)) {
        sphm_lattice_free(lattice);
        return SPHM_OK;
    }
    double extent = 0;
    for (size_t slot = 0; slot < rows->count; ++slot)
        for (int d = 0; d < 3; ++d)
            extent = fmax(extent, fabs((double)position[d][slot]));
    lattice->rounding = (sizeof(sphm_real) == 4 ? FLT_EPSILON : DBL_EPSILON) * extent / sphm_norm3(e[0]);
    rank_directions(lattice);
    return SPHM_OK;
}

typedef struct place {
    int32_t site[3], slot;
} place;

static int compare_places(const void *a, const void *b) {
    const place *p = (const place *)a, *q = (const place *)b;
    for (int d = 2; d >= 0; --d)
        if (p->site[d] != q->site[d])
            return p->site[d] < q->site[d] ? -1 : 1;
    return (p->slot > q->slot) - (p->slot < q->slot);
}

sphm_status sphm_lattice_order(const sphm_lattice *lattice, int32_t *order, sphm_context *context) {
    place *places = (place *)malloc((lattice->count + 1) * sizeof *places);
    if (!places)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to sort %zu particles", lattice->count);
    for (size_t slot = 0; slot < lattice->count; ++slot) {
        memcpy(places[slot].site, lattice->site + 3 * slot, sizeof places[slot].site);
        places[slot].slot = (int32_t)slot;
    }
    qsort(places, lattice->count, sizeof *places, compare_places);
    for (size_t slot = 0; slot < lattice->count; ++slot)
        order[slot] = places[slot].slot;
    free(places);
    return SPHM_OK;
}

void sphm_lattice_permute(sphm_lattice *lattice, const int32_t *order, int32_t *scratch) {
    memcpy(scratch, lattice->site, 3 * lattice->count * sizeof *scratch);
    for (size_t slot = 0; slot < lattice->count; ++slot)
        memcpy(lattice->site + 3 * slot, scratch + 3 * order[slot], 3 * sizeof *scratch);
}
