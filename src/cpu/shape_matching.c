/* Shape matching of the whole muscle: the best rigid motion. Reads positions and rest positions. */
#include <string.h>

#include "cpu/backend.h"
#include "cpu/parallel.h"

static void sum_block(const sphm_state *s, size_t begin, size_t end, double result[SPHM_MOMENT_SUMS]) {
    double sums[SPHM_MOMENT_SUMS] = {0};
    for (size_t i = begin; i < end; ++i) {
        const double x[3] = {(double)s->x[i], (double)s->y[i], (double)s->z[i]};
        const double rest[3] = {(double)s->rest_x[i], (double)s->rest_y[i], (double)s->rest_z[i]};
        sphm_rigid_add(x, rest, sums);
    }
    memcpy(result, sums, sizeof sums);
}

/* Adds up the blocks. */
void sphm_cpu_find_rigid_motion(sphm_backend *b) {
    const size_t count = b->state.count;
#pragma omp parallel for num_threads(b->threads) schedule(static)
    for (size_t block = 0; block < b->blocks; ++block)
        sum_block(&b->state, sphm_block_begin(block), sphm_block_end(block, count), b->results[block].sums);

    double sums[SPHM_MOMENT_SUMS] = {0};
    for (size_t block = 0; block < b->blocks; ++block)
        for (int k = 0; k < SPHM_MOMENT_SUMS; ++k)
            sums[k] += b->results[block].sums[k];
    sphm_rigid_find(sums, (double)count, &b->motion);
}
