/* The __global__ functions around the threads of solid_threads.h. */
#include "cuda/solid_launch.h"

#include "cuda/check.h"
#include "cuda/gather.h"
#include "cuda/solid_threads.h"

namespace {

using namespace sphm_grid_of_threads;

/* What one block does of each phase of a step. */

__device__ void hits_of(const sphm_solid_device &d, int step, size_t block) {
    const size_t i = block * block_threads + threadIdx.x;
    if (i < d.count && !sphm_solid_has_failed(&d, step))
        sphm_solid_hits(&d, step, i);
}

__device__ void end_force_of(const sphm_solid_device &d, int step, size_t block) {
    if (sphm_solid_has_failed(&d, step))
        return;
    gather_of<3>(
        block, d.held_count[SPHM_END_ORIGIN] + d.held_count[SPHM_END_INSERTION],
        [&](size_t item) { return (size_t)d.held[item]; },
        [&](size_t i, int lane, sphm_real *sum) { sphm_solid_force_lane(&d, d.stress, i, lane, sum); },
        [&](size_t item, const sphm_real *sum) { sphm_solid_end_force_finish(&d, step, item, sum); });
}

__device__ void end_sum_of(const sphm_solid_device &d, size_t block) {
    const size_t thread = block * block_threads + threadIdx.x;
    if (thread < 2 * SPHM_SOLID_END_PARTIALS)
        sphm_solid_end_sum_thread(&d, thread);
}

__device__ void end_step_of(const sphm_solid_device &d, int step, const double *end_sum) {
    if (threadIdx.x < SPHM_END_COUNT && !sphm_solid_has_failed(&d, step))
        sphm_solid_end_step_thread(&d, &d.submission->plan[step], end_sum, (int)threadIdx.x);
}

__device__ void move_of(const sphm_solid_device &d, int step, size_t block) {
    if (sphm_solid_has_failed(&d, step)) /* all threads alike: this step only adds failures of its own */
        return;
    const sphm_solid_plan *p = &d.submission->plan[step];
    gather_of<3>(
        block, d.count, itself(),
        [&](size_t i, int lane, sphm_real *sum) { sphm_solid_force_lane(&d, d.stress, i, lane, sum); },
        [&](size_t i, const sphm_real *sum) { sphm_solid_move_finish(&d, p, step, i, sum); });
}

__device__ void spread_of(const sphm_solid_device &d, int step, int substep, size_t block) {
    const sphm_solid_plan *p = &d.submission->plan[step];
    if (sphm_solid_has_failed(&d, step) || substep + 1 >= p->membrane.substeps)
        return;
    gather_of<1>(
        block, d.count, itself(),
        [&](size_t i, int lane, sphm_real *sum) { sphm_solid_spread_lane(&d, p, substep, i, lane, sum); },
        [&](size_t i, const sphm_real *sum) { (void)sphm_solid_spread_finish(&d, p, substep, i, sum); });
}

__device__ void strain_of(const sphm_solid_device &d, int step, size_t block) {
    if (sphm_solid_has_failed(&d, step))
        return;
    const sphm_solid_plan *p = &d.submission->plan[step];
    gather_of<19>(
        block, d.count, itself(),
        [&](size_t i, int lane, sphm_real *sum) {
            sphm_solid_strain_lane(&d, i, lane, sum);
            if (p->membrane.substeps > 0)
                sphm_solid_spread_lane(&d, p, p->membrane.substeps - 1, i, lane, sum + 18);
        },
        [&](size_t i, const sphm_real *sum) { sphm_solid_strain_finish(&d, p, step, i, sum); });
}

/* A phase a launch. */

__global__ void __launch_bounds__(block_threads) hits(sphm_solid_device d, int step) {
    hits_of(d, step, blockIdx.x);
}
__global__ void __launch_bounds__(block_threads) end_force(sphm_solid_device d, int step) {
    end_force_of(d, step, blockIdx.x);
}
__global__ void __launch_bounds__(block_threads) end_sum(sphm_solid_device d) {
    end_sum_of(d, blockIdx.x);
}
/* One block, whose threads fetch all there is to add up at once: the two that add would wait for it piece by
 * piece. */
__global__ void __launch_bounds__(block_threads) end_step(sphm_solid_device d, int step) {
    __shared__ double end_sum[2 * 6 * SPHM_SOLID_END_PARTIALS];
    for (int k = (int)threadIdx.x; k < 2 * 6 * SPHM_SOLID_END_PARTIALS; k += block_threads)
        end_sum[k] = d.end_sum[k];
    __syncthreads();
    end_step_of(d, step, end_sum);
}
__global__ void __launch_bounds__(block_threads) move(sphm_solid_device d, int step) {
    move_of(d, step, blockIdx.x);
}
__global__ void __launch_bounds__(block_threads) spread(sphm_solid_device d, int step, int substep) {
    spread_of(d, step, substep, blockIdx.x);
}
__global__ void __launch_bounds__(block_threads) strain(sphm_solid_device d, int step) {
    strain_of(d, step, blockIdx.x);
}

/* All blocks take their shares of a phase, and wait for each other. */
template <class Phase> __device__ void share(size_t blocks, Phase phase) {
    for (size_t block = blockIdx.x; block < blocks; block += gridDim.x) {
        phase(block);
        __syncthreads(); /* or the next share writes over sums that the first warp still reads */
    }
    SPHM_GRID_BARRIER();
}

/* Many steps a launch, as solid_submit.c's launch_step() has them, which says what the bits of `launches`
 * mean. */
__global__ void __launch_bounds__(block_threads) steps(sphm_solid_device d, int launches, int count) {
    const size_t held = d.held_count[SPHM_END_ORIGIN] + d.held_count[SPHM_END_INSERTION];
    const size_t rows = blocks_of(d.count, block_particles);
    for (int step = 0; step < count; ++step) {
        if (launches & 1)
            share(blocks_of(d.count, block_threads), [&](size_t block) { hits_of(d, step, block); });
        if (launches & 2) {
            share(blocks_of(held, block_particles), [&](size_t block) { end_force_of(d, step, block); });
            share(blocks_of(2 * SPHM_SOLID_END_PARTIALS, block_threads),
                  [&](size_t block) { end_sum_of(d, block); });
            share(1, [&](size_t) { end_step_of(d, step, d.end_sum); });
        }
        share(rows, [&](size_t block) { move_of(d, step, block); });
        for (int substep = 0; substep + 1 < launches / 4; ++substep)
            share(rows, [&](size_t block) { spread_of(d, step, substep, block); });
        share(rows, [&](size_t block) { strain_of(d, step, block); });
    }
}

__global__ void __launch_bounds__(block_threads) report(sphm_solid_device d) {
    const size_t thread = (size_t)blockIdx.x * block_threads + threadIdx.x;
    if (thread < SPHM_SOLID_PARTIALS)
        sphm_solid_report_thread(&d, thread);
}

__global__ void __launch_bounds__(block_threads) part_strain(sphm_solid_device d, sphm_solid_call call) {
    gather<18>(
        d.count, itself(),
        [&](size_t i, int lane, sphm_real *sum) { sphm_solid_strain_lane(&d, i, lane, sum); },
        [&](size_t i, const sphm_real *sum) { sphm_solid_part_strain_finish(&d, &call, i, sum); });
}

__global__ void __launch_bounds__(block_threads) part_force(sphm_solid_device d, sphm_solid_call call) {
    const size_t first = sphm_solid_first_held(&d, call.end);
    gather<3>(
        d.held_count[call.end], [&](size_t item) { return (size_t)d.held[first + item]; },
        [&](size_t i, int lane, sphm_real *sum) { sphm_solid_force_lane(&d, d.part_stress, i, lane, sum); },
        [&](size_t item, const sphm_real *sum) { sphm_solid_part_force_finish(&d, first + item, sum); });
}

__global__ void __launch_bounds__(block_threads) part_sum(sphm_solid_device d, sphm_solid_call call) {
    const size_t thread = (size_t)blockIdx.x * block_threads + threadIdx.x;
    if (thread < SPHM_SOLID_PARTIALS)
        sphm_solid_part_sum_thread(&d, &call, thread);
}

__global__ void __launch_bounds__(block_threads) snapshot(sphm_solid_device d, sphm_solid_call call) {
    const size_t i = (size_t)blockIdx.x * block_threads + threadIdx.x;
    if (i < d.count)
        sphm_solid_snapshot_thread(&d, &call, i);
}

} // namespace

sphm_status sphm_cuda_load_solid(sphm_context *context) {
    return sphm_cuda_check(sphm_load_kernels(hits, end_force, end_sum, end_step, move, spread, strain, steps,
                                             report, part_strain, part_force, part_sum, snapshot),
                           "load the kernels of the solid", context);
}

sphm_status sphm_cuda_launch_solid(cudaStream_t stream, const sphm_solid_device *solid,
                                   const sphm_solid_call *call, sphm_context *context) {
    const sphm_solid_device &d = *solid;
    const unsigned rows = blocks_of(d.count, block_particles), particles = blocks_of(d.count, block_threads),
                   partials = blocks_of(SPHM_SOLID_PARTIALS, block_threads);
    const size_t held = d.held_count[SPHM_END_ORIGIN] + d.held_count[SPHM_END_INSERTION];
    switch (call->launch) {
    case SPHM_SOLID_HITS:
        SPHM_LAUNCH(hits, particles, block_threads, stream, d, call->step);
        break;
    case SPHM_SOLID_END_FORCE:
        if (held == 0)
            return SPHM_OK;
        SPHM_LAUNCH(end_force, blocks_of(held, block_particles), block_threads, stream, d, call->step);
        break;
    case SPHM_SOLID_END_SUM:
        SPHM_LAUNCH(end_sum, blocks_of(2 * SPHM_SOLID_END_PARTIALS, block_threads), block_threads, stream, d);
        break;
    case SPHM_SOLID_END_STEP:
        SPHM_LAUNCH(end_step, 1, block_threads, stream, d, call->step);
        break;
    case SPHM_SOLID_MOVE:
        SPHM_LAUNCH(move, rows, block_threads, stream, d, call->step);
        break;
    case SPHM_SOLID_SPREAD:
        SPHM_LAUNCH(spread, rows, block_threads, stream, d, call->step, call->substep);
        break;
    case SPHM_SOLID_STRAIN:
        SPHM_LAUNCH(strain, rows, block_threads, stream, d, call->step);
        break;
    case SPHM_SOLID_REPORT:
        SPHM_LAUNCH(report, partials, block_threads, stream, d);
        break;
    case SPHM_SOLID_PART_STRAIN:
        SPHM_LAUNCH(part_strain, rows, block_threads, stream, d, *call);
        break;
    case SPHM_SOLID_PART_FORCE:
        if (d.held_count[call->end] == 0)
            return SPHM_OK;
        SPHM_LAUNCH(part_force, blocks_of(d.held_count[call->end], block_particles), block_threads, stream, d,
                    *call);
        break;
    case SPHM_SOLID_PART_SUM:
        SPHM_LAUNCH(part_sum, partials, block_threads, stream, d, *call);
        break;
    case SPHM_SOLID_SNAPSHOT:
        SPHM_LAUNCH(snapshot, particles, block_threads, stream, d, *call);
        break;
    case SPHM_SOLID_STEPS:
        return sphm_cuda_check_launch(
            sphm_launch_together(steps, rows, block_threads, stream, d, call->launches, call->step),
            sphm_solid_launch_names[call->launch], context);
    default:
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "launch %d does not exist", call->launch);
    }
    return sphm_cuda_check_launch(cudaGetLastError(), sphm_solid_launch_names[call->launch], context);
}
