/* The __global__ functions around the threads of fluid_threads.h and fluid_rows.h. */
#include "cuda/fluid_launch.h"

#include "cuda/check.h"
#include "cuda/fluid_rows.h"
#include "cuda/gather.h"
#include "cuda/sort.h"

namespace sphm_fluid_launches {

using namespace sphm_grid_of_threads;
static_assert(block_threads == SPHM_FLUID_BLOCK, "blocks of a reduction");

struct plus {
    __device__ double operator()(double a, double b) const { return a + b; }
};
struct larger {
    __device__ double operator()(double a, double b) const { return a > b ? a : b; }
};

/* Every thread adds its particles with thread(thread, threads, sum), from `start`; out[numbers * block] gets
 * what the threads of a block have, added up 128, 64, ... 1 apart. */
template <int numbers, class Thread, class Add>
__device__ void reduce(double start, Thread thread, Add add, double *out) {
    __shared__ double all[block_threads][numbers];
    const int own = (int)threadIdx.x;
    double sum[numbers];
    for (int k = 0; k < numbers; ++k)
        sum[k] = start;
    thread((size_t)blockIdx.x * block_threads + threadIdx.x, (size_t)gridDim.x * block_threads, sum);
    for (int k = 0; k < numbers; ++k)
        all[own][k] = sum[k];
    __syncthreads();
    for (int apart = block_threads / 2; apart > 0; apart /= 2) {
        for (int k = 0; k < numbers && own < apart; ++k)
            all[own][k] = add(all[own][k], all[own + apart][k]);
        __syncthreads();
    }
    if (own < numbers)
        out[(size_t)numbers * blockIdx.x + threadIdx.x] = all[0][own];
}

static __device__ size_t global_thread() {
    return (size_t)blockIdx.x * block_threads + threadIdx.x;
}

/* Rows anew ------------------------------------------------------------------------------------------------
 */

static __global__ void __launch_bounds__(block_threads) list(sphm_fluid_device d) {
    if (global_thread() < d.count)
        sphm_fluid_list_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) box(sphm_fluid_device d) {
    reduce<6>(
        -HUGE_VAL,
        [&](size_t thread, size_t threads, double *sum) { sphm_fluid_box_thread(&d, thread, threads, sum); },
        larger(), d.extremes);
}

static __global__ void lay_out(sphm_fluid_device d) {
    sphm_fluid_lay_out_thread(&d);
}

static __global__ void __launch_bounds__(block_threads) bin(sphm_fluid_device d) {
    if (global_thread() < d.count)
        sphm_fluid_bin_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) starts(sphm_fluid_device d) {
    sphm_fluid_starts_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) reorder(sphm_fluid_device d) {
    if (global_thread() < d.count)
        sphm_fluid_reorder_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) settle(sphm_fluid_device d) {
    if (global_thread() < d.count)
        sphm_fluid_settle_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) count(sphm_fluid_device d) {
    if (global_thread() <= d.count)
        sphm_fluid_count_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) fill(sphm_fluid_device d) {
    if (global_thread() < d.count && sphm_fluid_rows_fit(&d))
        sphm_fluid_fill_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) correct(sphm_fluid_device d) {
    if (!sphm_fluid_rows_fit(&d))
        return;
    gather<SPHM_MOMENT_COUNT>(
        d.count, itself(),
        [&](size_t i, int lane, sphm_real *sum) { sphm_fluid_correct_lane(&d, i, lane, sum); },
        [&](size_t i, const sphm_real *sum) { sphm_fluid_correct_finish(&d, i, sum); });
}

static __global__ void __launch_bounds__(block_threads) weigh(sphm_fluid_device d) {
    if (!sphm_fluid_rows_fit(&d))
        return;
    gather<1>(
        d.count, itself(),
        [&](size_t i, int lane, sphm_real *sum) { sphm_fluid_weigh_lane(&d, i, lane, sum); },
        [&](size_t i, const sphm_real *sum) { sphm_fluid_weigh_finish(&d, i, sum); });
}

/* A step ---------------------------------------------------------------------------------------------------
 */

static __global__ void __launch_bounds__(block_threads) sum(sphm_fluid_device d, int step) {
    if (sphm_fluid_has_ended(&d, step)) /* all threads alike: this step only adds ends of its own */
        return;
    reduce<SPHM_MOMENT_SUMS>(
        0,
        [&](size_t thread, size_t threads, double *sums) {
            sphm_fluid_sum_thread(&d, step, thread, threads, sums);
        },
        plus(), d.moment);
}

/* One block, whose threads fetch all there is to add up at once: whoever adds would wait for it piece by
 * piece. */
static __global__ void __launch_bounds__(block_threads) rigid(sphm_fluid_device d, int step) {
    __shared__ double moment[SPHM_MOMENT_SUMS * SPHM_FLUID_PARTIALS];
    if (sphm_fluid_has_ended(&d, step))
        return;
    for (int k = (int)threadIdx.x; k < SPHM_MOMENT_SUMS * d.partials; k += block_threads)
        moment[k] = d.moment[k];
    __syncthreads();
    if (threadIdx.x < SPHM_MOMENT_SUMS)
        sphm_fluid_rigid_thread(&d, moment, (int)threadIdx.x);
    __syncthreads();
    if (threadIdx.x == 0)
        sphm_fluid_rigid_finish(&d);
}

static __global__ void __launch_bounds__(block_threads) predict(sphm_fluid_device d, int step) {
    if (global_thread() < d.count && !sphm_fluid_has_ended(&d, step))
        sphm_fluid_predict_thread(&d, step, global_thread());
}

static __global__ void __launch_bounds__(block_threads) smooth(sphm_fluid_device d, int step) {
    if (sphm_fluid_has_ended(&d, step))
        return;
    const sphm_fluid_plan *p = &d.submission->plan[step];
    gather<4>(
        d.count, itself(),
        [&](size_t i, int lane, sphm_real *sums) { sphm_fluid_smooth_lane(&d, i, lane, sums); },
        [&](size_t i, const sphm_real *sums) { sphm_fluid_smooth_finish(&d, p, i, sums); });
}

static __global__ void __launch_bounds__(block_threads) spread(sphm_fluid_device d, int step, int substep) {
    const sphm_fluid_plan *p = &d.submission->plan[step];
    if (sphm_fluid_has_ended(&d, step) || substep + 1 >= p->membrane.substeps)
        return;
    gather<1>(
        d.count, itself(),
        [&](size_t i, int lane, sphm_real *sums) { sphm_fluid_spread_lane(&d, p, substep, i, lane, sums); },
        [&](size_t i, const sphm_real *sums) { (void)sphm_fluid_spread_finish(&d, p, substep, i, sums); });
}

template <int kind>
static __global__ void __launch_bounds__(block_threads) force(sphm_fluid_device d, int step) {
    if (sphm_fluid_has_ended(&d, step))
        return;
    const sphm_fluid_plan *p = &d.submission->plan[step];
    gather<4>(
        d.count, itself(),
        [&](size_t i, int lane, sphm_real *sums) {
            sphm_fluid_force_lane(&d, kind, i, lane, sums);
            if (p->membrane.substeps > 0)
                sphm_fluid_spread_lane(&d, p, p->membrane.substeps - 1, i, lane, sums + 3);
        },
        [&](size_t i, const sphm_real *sums) { sphm_fluid_force_finish(&d, p, step, i, sums); });
}

/* For the host ---------------------------------------------------------------------------------------------
 */

static __global__ void __launch_bounds__(block_threads) report(sphm_fluid_device d) {
    reduce<3>(
        0,
        [&](size_t thread, size_t threads, double *sums) {
            sphm_fluid_report_thread(&d, thread, threads, sums);
        },
        larger(), &d.report->largest[0][0]);
}

static __global__ void __launch_bounds__(block_threads) set_rest(sphm_fluid_device d) {
    if (global_thread() < d.count)
        sphm_fluid_set_rest_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) within(sphm_fluid_device d) {
    if (global_thread() < d.count)
        sphm_fluid_within_thread(&d, global_thread());
}

static __global__ void __launch_bounds__(block_threads) snapshot(sphm_fluid_device d, sphm_fluid_call call) {
    if (global_thread() < d.count)
        sphm_fluid_snapshot_thread(&d, &call, global_thread());
}

/* Launches -------------------------------------------------------------------------------------------------
 */

static void launch_force(cudaStream_t stream, unsigned rows, const sphm_fluid_device &d, int step) {
    if (d.kind == SPHM_FORCE_FLUID_ONLY)
        SPHM_LAUNCH(force<SPHM_FORCE_FLUID_ONLY>, rows, block_threads, stream, d, step);
    else if (d.kind == SPHM_FORCE_PARALLEL_FIBRES)
        SPHM_LAUNCH(force<SPHM_FORCE_PARALLEL_FIBRES>, rows, block_threads, stream, d, step);
    else
        SPHM_LAUNCH(force<SPHM_FORCE_OBLIQUE_FIBRES>, rows, block_threads, stream, d, step);
}

/* Rows anew; 0 where it is another launch. */
static int launch_rebuild(cudaStream_t stream, const sphm_fluid_device &d, int which) {
    const unsigned particles = blocks_of(d.count, block_threads), rows = blocks_of(d.count, block_particles);
    switch (which) {
    case SPHM_FLUID_LIST:
        SPHM_LAUNCH(list, particles, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_BOX:
        SPHM_LAUNCH(box, (unsigned)d.partials, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_LAY_OUT:
        SPHM_LAUNCH(lay_out, 1, 1, stream, d);
        return 1;
    case SPHM_FLUID_BIN:
        SPHM_LAUNCH(bin, particles, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_STARTS:
        SPHM_LAUNCH(starts, blocks_of(sphm_cells_most(d.count) + 1, block_threads), block_threads, stream, d);
        return 1;
    case SPHM_FLUID_REORDER:
        SPHM_LAUNCH(reorder, particles, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_SETTLE:
        SPHM_LAUNCH(settle, particles, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_COUNT:
        SPHM_LAUNCH(count, blocks_of(d.count + 1, block_threads), block_threads, stream, d);
        return 1;
    case SPHM_FLUID_FILL:
        SPHM_LAUNCH(fill, particles, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_CORRECT:
        SPHM_LAUNCH(correct, rows, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_WEIGH:
        SPHM_LAUNCH(weigh, rows, block_threads, stream, d);
        return 1;
    default:
        return 0;
    }
}

/* A step, or what the host asks for; 0 where there is no such launch. */
static int launch_step(cudaStream_t stream, const sphm_fluid_device &d, const sphm_fluid_call &call) {
    const unsigned particles = blocks_of(d.count, block_threads), rows = blocks_of(d.count, block_particles);
    switch (call.launch) {
    case SPHM_FLUID_SUM:
        SPHM_LAUNCH(sum, (unsigned)d.partials, block_threads, stream, d, call.step);
        return 1;
    case SPHM_FLUID_RIGID:
        SPHM_LAUNCH(rigid, 1, block_threads, stream, d, call.step);
        return 1;
    case SPHM_FLUID_PREDICT:
        SPHM_LAUNCH(predict, particles, block_threads, stream, d, call.step);
        return 1;
    case SPHM_FLUID_SMOOTH:
        SPHM_LAUNCH(smooth, rows, block_threads, stream, d, call.step);
        return 1;
    case SPHM_FLUID_SPREAD:
        SPHM_LAUNCH(spread, rows, block_threads, stream, d, call.step, call.substep);
        return 1;
    case SPHM_FLUID_FORCE:
        launch_force(stream, rows, d, call.step);
        return 1;
    case SPHM_FLUID_REPORT:
        SPHM_LAUNCH(report, (unsigned)d.partials, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_SET_REST:
        SPHM_LAUNCH(set_rest, particles, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_WITHIN:
        SPHM_LAUNCH(within, particles, block_threads, stream, d);
        return 1;
    case SPHM_FLUID_SNAPSHOT:
        SPHM_LAUNCH(snapshot, particles, block_threads, stream, d, call);
        return 1;
    default:
        return 0;
    }
}

} // namespace sphm_fluid_launches

sphm_status sphm_cuda_load_fluid(sphm_context *context) {
    using namespace sphm_fluid_launches;
    return sphm_cuda_check(sphm_load_kernels(list, box, lay_out, bin, starts, reorder, settle, count, fill,
                                             correct, weigh, sum, rigid, predict, smooth, spread,
                                             force<SPHM_FORCE_FLUID_ONLY>, force<SPHM_FORCE_PARALLEL_FIBRES>,
                                             force<SPHM_FORCE_OBLIQUE_FIBRES>, report, set_rest, within,
                                             snapshot),
                           "load the kernels of the fluid", context);
}

sphm_status sphm_cuda_launch_fluid(cudaStream_t stream, const sphm_fluid_device *d,
                                   const sphm_fluid_call *call, sphm_context *context) {
    if (call->launch == SPHM_FLUID_SORT)
        return sphm_cuda_sort(stream, d, context);
    if (call->launch == SPHM_FLUID_SCAN)
        return sphm_cuda_scan(stream, d, context);
    using namespace sphm_fluid_launches;
    if (!launch_rebuild(stream, *d, call->launch) && !launch_step(stream, *d, *call))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "launch %d does not exist", call->launch);
    return sphm_cuda_check_launch(cudaGetLastError(), sphm_fluid_launch_names[call->launch], context);
}
