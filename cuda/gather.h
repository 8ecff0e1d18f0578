/* Threads of a launch: indices, the sum over the lanes of a row, which warp finishes.
 *
 * A block of 256 threads sums the rows of 32 particles, eight lanes each. The sums meet in shared memory, and
 * the first warp finishes all 32 particles together: finished by one lane in eight, the material, which is as
 * much arithmetic as the row, would run at an eighth of the width. */
#ifndef SPHM_CUDA_GATHER_H
#define SPHM_CUDA_GATHER_H

#include "cuda/runtime.h"

#include "cuda/threads.h"

namespace sphm_grid_of_threads {

constexpr int block_threads = 256;
constexpr int block_particles = block_threads / SPHM_DEVICE_LANES;
static_assert(block_particles == 32, "one warp finishes");

/* Every lane of a row ends with the same sum: the same pairs are added in the same order. */
template <int numbers> __device__ void add_lanes(sphm_real (&sum)[numbers]) {
    SPHM_UNROLL
    for (int apart = SPHM_DEVICE_LANES / 2; apart > 0; apart /= 2) {
        SPHM_UNROLL
        for (int k = 0; k < numbers; ++k)
            sum[k] += __shfl_xor_sync(0xffffffffu, sum[k], apart);
    }
}

/* Sums the rows of the particles of block `block` with lane(particle, lane, sum) and hands them to
 * finish(particle, sum). `count` items; `particle_of` gives an item's particle. */
template <int numbers, class ParticleOf, class Lane, class Finish>
__device__ void gather_of(size_t block, size_t count, ParticleOf particle_of, Lane lane, Finish finish) {
    __shared__ sphm_real sums[block_particles][numbers + 1 - numbers % 2]; /* odd: no bank twice in a warp */
    const size_t first = block * block_particles;
    const int mine = (int)threadIdx.x / SPHM_DEVICE_LANES, own_lane = (int)threadIdx.x % SPHM_DEVICE_LANES;
    sphm_real sum[numbers] = {};
    if (first + mine < count)
        lane(particle_of(first + mine), own_lane, sum);
    add_lanes(sum);
    if (own_lane == 0)
        for (int k = 0; k < numbers; ++k)
            sums[mine][k] = sum[k];
    __syncthreads();
    if (threadIdx.x >= block_particles || first + threadIdx.x >= count)
        return;
    for (int k = 0; k < numbers; ++k)
        sum[k] = sums[threadIdx.x][k];
    finish(first + threadIdx.x, sum);
}

/* The same, a block of the launch each. */
template <int numbers, class ParticleOf, class Lane, class Finish>
__device__ void gather(size_t count, ParticleOf particle_of, Lane lane, Finish finish) {
    gather_of<numbers>(blockIdx.x, count, particle_of, lane, finish);
}

struct itself {
    __device__ size_t operator()(size_t item) const { return item; }
};

inline __host__ __device__ unsigned blocks_of(size_t items, int items_per_block) {
    return (unsigned)((items + (size_t)items_per_block - 1) / (size_t)items_per_block);
}

} // namespace sphm_grid_of_threads

#endif
