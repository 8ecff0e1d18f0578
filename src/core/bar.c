/* Filling a box exactly, and jitter. Writes sphm_filling. */
#include "core/context.h"
#include "core/filling.h"
#include "core/threads.h"
#include "core/vec3.h"

#include <stdlib.h>
#include <string.h>

/* Cells longer than this in one direction than in another are no lattice for SPH. */
#define MOST_ANISOTROPY 1.5
#define JITTER_DRAWS 8

/* How uneven the cells of a box cut into n are: longest over shortest edge. */
static double anisotropy(const double side[3], const int64_t n[3]) {
    double longest = 0, shortest = INFINITY;
    for (int k = 0; k < 3; k++) {
        double edge = side[k] / (double)n[k];
        longest = fmax(longest, edge);
        shortest = fmin(shortest, edge);
    }
    return longest / shortest;
}

/* The division with a count within tolerance whose cells are nearest to cubes; among equals, the nearest
 * count. Only divisions of the two shorter sides near the cubic one can win, and the third follows. */
static int choose_division(const double side[3], int64_t particles, int64_t best[3], int64_t *nearest) {
    double spacing = cbrt(side[0] * side[1] * side[2] / (double)particles), least = INFINITY, off = INFINITY;
    int longest = side[0] >= side[1] && side[0] >= side[2] ? 0 : side[1] >= side[2] ? 1 : 2;
    int u = (longest + 1) % 3, v = (longest + 2) % 3;
    int64_t n[3], reach_u = (int64_t)(side[u] / spacing * MOST_ANISOTROPY) + 2,
                  reach_v = (int64_t)(side[v] / spacing * MOST_ANISOTROPY) + 2;
    double nearest_off = INFINITY;
    for (n[u] = 1; n[u] <= reach_u; n[u]++)
        for (n[v] = 1; n[v] <= reach_v; n[v]++) {
            n[longest] = (particles + n[u] * n[v] / 2) / (n[u] * n[v]);
            if (n[longest] < 1)
                continue;
            int64_t count = n[0] * n[1] * n[2];
            double uneven = anisotropy(side, n),
                   misses = fabs((double)(count - particles)) / (double)particles;
            if (uneven > MOST_ANISOTROPY)
                continue;
            if (misses < nearest_off) {
                nearest_off = misses;
                *nearest = count;
            }
            if (misses > SPHM_COUNT_TOLERANCE)
                continue;
            if (uneven < least - 1e-9 || (uneven < least + 1e-9 && misses < off)) {
                least = uneven;
                off = misses;
                memcpy(best, n, sizeof n);
            }
        }
    return least < INFINITY;
}

sphm_status sphm_filling_create_bar(const double side_m[3], int64_t particles, sphm_filling *filling,
                                    sphm_context *context) {
    int64_t n[3] = {0, 0, 0}, nearest = 0;
    memset(filling, 0, sizeof *filling);
    if (!choose_division(side_m, particles, n, &nearest))
        return sphm_fail(
            context, SPHM_REFUSED_GEOMETRY,
            "particles: %lld cannot be met within %g %% by equal cells in a bar of %g x %g x %g m; "
            "the nearest filling has %lld particles",
            (long long)particles, 100 * SPHM_COUNT_TOLERANCE, side_m[0], side_m[1], side_m[2],
            (long long)nearest);
    size_t count = (size_t)(n[0] * n[1] * n[2]), p = 0;
    filling->positions = malloc(3 * count * sizeof *filling->positions);
    filling->outer = malloc(count);
    if (!filling->positions || !filling->outer) {
        sphm_filling_free(filling);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu particles", count);
    }
    int64_t at[3];
    for (at[2] = 0; at[2] < n[2]; at[2]++)
        for (at[1] = 0; at[1] < n[1]; at[1]++)
            for (at[0] = 0; at[0] < n[0]; at[0]++, p++) {
                filling->outer[p] = 0;
                for (int k = 0; k < 3; k++) {
                    filling->positions[3 * p + (size_t)k] =
                        side_m[k] * (((double)at[k] + 0.5) / (double)n[k] - 0.5);
                    filling->outer[p] |= at[k] == 0 || at[k] == n[k] - 1;
                }
            }
    filling->count = count;
    filling->spacing_m = cbrt(side_m[0] * side_m[1] * side_m[2] / (double)count);
    for (int k = 0; k < 3; k++)
        filling->step_m[k][k] = side_m[k] / (double)n[k];
    return SPHM_OK;
}

/* splitmix64 (Steele, Lea, Flood 2014): a number that depends on its argument only, so that a particle's
 * jitter does not depend on how many were drawn before it. */
static double uniform(uint64_t key) {
    key += 0x9e3779b97f4a7c15u;
    key = (key ^ (key >> 30)) * 0xbf58476d1ce4e5b9u;
    key = (key ^ (key >> 27)) * 0x94d049bb133111ebu;
    return 2 * ((double)((key ^ (key >> 31)) >> 11) * 0x1p-53) - 1;
}

void sphm_filling_jitter(sphm_filling *filling, const sphm_winding *winding, double jitter, uint64_t seed,
                         int64_t threads) {
    double reach = jitter * filling->spacing_m;
    const int64_t count = (int64_t)filling->count;
#pragma omp parallel for schedule(static) num_threads(sphm_team_size(threads))
    for (int64_t p = 0; p < count; p++) {
        double *x = &filling->positions[3 * p], moved[3];
        for (uint64_t draw = 0; draw < JITTER_DRAWS; draw++) {
            for (uint64_t k = 0; k < 3; k++)
                moved[k] =
                    x[k] + reach * uniform((seed << 40) ^ ((uint64_t)p * 3 * JITTER_DRAWS + 3 * draw + k));
            if (sphm_winding_number(winding, moved) > 0.5) {
                memcpy(x, moved, sizeof moved);
                break;
            }
        }
    }
}
