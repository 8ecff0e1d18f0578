/* Shape matching of the whole muscle: the best rigid motion (Mueller et al., SIGGRAPH 2005). All particles
 * weigh the same, so sums need no masses. Reads positions and rest positions. */
#include <string.h>

#include "cpu/backend.h"
#include "cpu/parallel.h"
#include "kernels/vector.h"

static void sum_block(const sphm_state *s, size_t begin, size_t end, sphm_block_result *result) {
    double moment[9] = {0}, sum[3] = {0}, rest_sum[3] = {0};
    for (size_t i = begin; i < end; ++i) {
        const double x[3] = {(double)s->x[i], (double)s->y[i], (double)s->z[i]};
        const double r[3] = {(double)s->rest_x[i], (double)s->rest_y[i], (double)s->rest_z[i]};
        for (int a = 0; a < 3; ++a) {
            sum[a] += x[a];
            rest_sum[a] += r[a];
            for (int c = 0; c < 3; ++c)
                moment[3 * a + c] += x[a] * r[c];
        }
    }
    memcpy(result->moment, moment, sizeof moment);
    memcpy(result->sum, sum, sizeof sum);
    memcpy(result->rest_sum, rest_sum, sizeof rest_sum);
}

/* Adds up the blocks. On the rest shape the moment is symmetric to the bit, so that the rotation is exactly
 * the identity and nothing moves. */
void sphm_cpu_find_rigid_motion(sphm_backend *b) {
    const size_t count = b->state.count;
#pragma omp parallel for num_threads(b->threads) schedule(static)
    for (size_t block = 0; block < b->blocks; ++block)
        sum_block(&b->state, sphm_block_begin(block), sphm_block_end(block, count), &b->results[block]);

    double moment[9] = {0};
    sphm_rigid_motion *motion = &b->motion;
    memset(motion, 0, sizeof *motion);
    for (size_t block = 0; block < b->blocks; ++block) {
        const sphm_block_result *result = &b->results[block];
        for (int k = 0; k < 9; ++k)
            moment[k] += result->moment[k];
        for (int d = 0; d < 3; ++d) {
            motion->centre[d] += result->sum[d];
            motion->rest_centre[d] += result->rest_sum[d];
        }
    }
    for (int a = 0; a < 3; ++a)
        for (int c = 0; c < 3; ++c)
            moment[3 * a + c] -= motion->centre[a] * motion->rest_centre[c] / (double)count;
    for (int d = 0; d < 3; ++d) {
        motion->centre[d] /= (double)count;
        motion->rest_centre[d] /= (double)count;
    }
    sphm_best_rotation(moment, motion->rotation);
}
