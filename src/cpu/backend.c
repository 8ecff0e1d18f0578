/* The CPU back end: memory, the order of a step, and how long each part took. */
#include "cpu/backend.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/fluid_watch.h"
#include "cpu/membrane.h"
#include "cpu/parallel.h"

/* Memory and creation ------------------------------------------------------------------------------------ */

static void destroy(sphm_backend *b) {
    if (!b)
        return;
    sphm_state_free(&b->state);
    sphm_grid_free(&b->grid);
    sphm_neighbours_free(&b->rows);
    sphm_diffusion_free(&b->diffusion);
    free(b->packs.predicted);
    free(b->packs.smoothed);
    free(b->results);
    free(b);
}

static void *allocate_packs(size_t capacity, size_t size) {
    const size_t bytes = capacity * size; /* capacity is a multiple of 16 */
    void *packs = aligned_alloc(64, bytes);
    if (packs)
        memset(packs, 0, bytes);
    return packs;
}

static sphm_status allocate(sphm_backend *b, sphm_context *context) {
    const sphm_model *model = b->model;
    const sphm_status status = sphm_state_create(&b->state, model->body.count, context);
    if (status != SPHM_OK)
        return status;
    const size_t capacity = b->state.capacity;
    b->packs.oblique = model->fluid.fibre_tension_Pa > 0 && !sphm_fluid_fibres_are_parallel(&model->body);
    b->blocks = sphm_block_count(b->state.count);
    b->results = (sphm_block_result *)calloc(b->blocks, sizeof *b->results);
    b->packs.predicted = (sphm_twin *)allocate_packs(capacity, sizeof(sphm_twin));
    b->packs.smoothed = (sphm_quad *)allocate_packs(capacity, sizeof(sphm_quad));
    if (!b->results || !b->packs.predicted || !b->packs.smoothed)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the sweeps over %zu particles",
                         b->state.count);
    return SPHM_OK;
}

/* The rest density is what the density sweep sums on the rest shape, to the bit: at rest the pressure is 0.
 */
static void measure_rest_density(sphm_backend *b) {
    sphm_state *s = &b->state;
    sphm_drive none;
    memset(&none, 0, sizeof none);
    sphm_cpu_predict(b, 1, &none);
    sphm_fluid_sweep_velocity(&b->model->fluid, &b->rows, &b->packs, s, 1, 0, s->count);
    double smallest = INFINITY;
    for (size_t i = 0; i < s->count; ++i) {
        s->rest_density[i] = s->density[i];
        smallest = fmin(smallest, (double)s->density[i]);
    }
    b->rest_density_min = smallest;
    b->rest_diffusion_ms = b->diffusion.stable_step_ms;
    b->timing.neighbours_per_particle =
        (double)sphm_neighbours_count_within(&b->rows, s->x, s->y, s->z, b->model->body.support_radius_m) /
        (double)s->count;
}

static sphm_status create(const sphm_model *model, sphm_backend **backend, sphm_context *context) {
    *backend = NULL;
    sphm_backend *b = (sphm_backend *)calloc(1, sizeof *b);
    if (!b)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the CPU back end");
    b->model = model;
    b->threads = sphm_team_size(model->parameters.threads);
    b->skin_m = SPHM_FLUID_SKIN * model->body.support_radius_m;
    snprintf(b->device, sizeof b->device, "cpu, %d thread%s", b->threads, b->threads == 1 ? "" : "s");
    sphm_status status = allocate(b, context);
    if (status == SPHM_OK) {
        sphm_model_rest_state(model, &b->state);
        status = sphm_cpu_build_rows(b, context);
    }
    if (status != SPHM_OK) {
        destroy(b);
        return status;
    }
    measure_rest_density(b);
    *backend = b;
    return SPHM_OK;
}

/* A step ------------------------------------------------------------------------------------------------- */

/* Adds the time since *since to *sum, and starts anew. */
static void clock_lap(double *since, double *sum) {
    const double now = sphm_wall_clock_s();
    *sum += now - *since;
    *since = now;
}

typedef enum sweep { SWEEP_VELOCITY, SWEEP_PRESSURE, SWEEP_FORCES } sweep;

static void run_sweep(sphm_backend *b, sweep which, double step_s) {
    const sphm_fluid_constants *c = &b->model->fluid;
    sphm_state *s = &b->state;
#pragma omp parallel for num_threads(b->threads) schedule(static)
    for (size_t block = 0; block < b->blocks; ++block) {
        const size_t begin = sphm_block_begin(block), end = sphm_block_end(block, s->count);
        if (which == SWEEP_VELOCITY)
            sphm_fluid_sweep_velocity(c, &b->rows, &b->packs, s, step_s, begin, end);
        else if (which == SWEEP_PRESSURE)
            sphm_fluid_set_pressure(c, &b->packs, s, begin, end);
        else
            sphm_fluid_sweep_forces(c, &b->rows, &b->packs, s, begin, end);
    }
}

/* Everything up to the forces sees the same positions. */
static sphm_status step_once(sphm_backend *b, double step_s, const sphm_drive *drive, sphm_context *context) {
    sphm_timing *t = &b->timing;
    const double start = sphm_wall_clock_s();
    double lap = start;

    const sphm_status status = sphm_cpu_refresh_rows(b, context);
    if (status != SPHM_OK)
        return sphm_fail(context, SPHM_FAILED_BACKEND, "no memory for the neighbour rows at %g s",
                         b->state.time_s);
    if (sphm_fluid_refuse_clumps(b->diffusion.stable_step_ms, b->rest_diffusion_ms, b->state.time_s,
                                 context) != SPHM_OK)
        return SPHM_FAILED_NONFINITE;
    clock_lap(&lap, &t->neighbours_s);
    sphm_cpu_predict(b, step_s, drive);
    run_sweep(b, SWEEP_VELOCITY, step_s);
    clock_lap(&lap, &t->intermediate_velocity_s);
    run_sweep(b, SWEEP_PRESSURE, step_s);
    clock_lap(&lap, &t->density_pressure_s);
    run_sweep(b, SWEEP_FORCES, step_s);
    clock_lap(&lap, &t->forces_s);
    sphm_cpu_membrane_step(&b->state, &b->rows, &b->diffusion, &b->model->membrane, drive, step_s, b->threads,
                           t);
    lap = sphm_wall_clock_s();
    const int finite = sphm_cpu_integrate(b, step_s);
    clock_lap(&lap, &t->integration_s);

    b->state.time_s += step_s;
    ++b->state.steps;
    ++t->steps;
    t->total_s += lap - start;
    if (!finite) {
        char what[160];
        sphm_cpu_name_nonfinite(b, what, sizeof what);
        return sphm_fail(context, SPHM_FAILED_NONFINITE, "the state became non-finite: %s", what);
    }
    return SPHM_OK;
}

static sphm_status step(sphm_backend *b, size_t count, double time_step_s, const sphm_drive *drive,
                        sphm_context *context) {
    for (size_t k = 0; k < count; ++k) {
        const sphm_status status = step_once(b, time_step_s, drive, context);
        if (status != SPHM_OK)
            return status;
    }
    return SPHM_OK;
}

/* State, limits, timing ---------------------------------------------------------------------------------- */

static const sphm_state *view(sphm_backend *b) {
    return &b->state;
}

static const sphm_state *clock_of(const sphm_backend *b) {
    return &b->state;
}

/* Puts the slots into the order of ids, loads, and builds the rows that belong to the loaded state. */
static sphm_status restore(sphm_backend *b, const sphm_state *from, sphm_context *context) {
    sphm_state *s = &b->state;
    int32_t *slots = (int32_t *)malloc(s->count * sizeof *slots);
    if (!slots)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to restore %zu particles", s->count);
    for (size_t slot = 0; slot < s->count; ++slot)
        slots[s->id[slot]] = (int32_t)slot;
    sphm_state_permute(s, slots, b->packs.predicted);
    sphm_status status = sphm_state_load_by_id(from, s, slots, context);
    free(slots);
    /* The old state is gone: what has no rows can neither go on nor go back. */
    if (sphm_cpu_build_rows(b, context) != SPHM_OK)
        status = SPHM_FAILED_BACKEND;
    sphm_cpu_measure_motion(b);
    return status;
}

static sphm_time_step_limits limits(const sphm_backend *b) {
    return sphm_fluid_limits(b->model, b->speed_max_m_per_s, b->rest_density_min);
}

static size_t memory_bytes(const sphm_backend *b) {
    return sizeof *b + sphm_state_bytes(b->state.count) +
           b->state.capacity * (sizeof(sphm_twin) + sizeof(sphm_quad)) + b->blocks * sizeof *b->results +
           (b->grid.capacity + 1 + 2 * b->grid.particles) * sizeof(int32_t) +
           b->rows.capacity * sizeof(int32_t) + (b->rows.count + 1) * sizeof(size_t) +
           b->rows.count * sizeof(int32_t) + b->diffusion.capacity * sizeof(sphm_real) +
           SPHM_DIFFUSION_SCRATCH * b->diffusion.particles * sizeof(sphm_real);
}

static sphm_timing timing(const sphm_backend *b) {
    sphm_timing t = b->timing;
    t.memory_bytes = memory_bytes(b);
    return t;
}

static void reset_timing(sphm_backend *b) {
    const double neighbours = b->timing.neighbours_per_particle;
    memset(&b->timing, 0, sizeof b->timing);
    b->timing.neighbours_per_particle = neighbours;
}

static const char *device(const sphm_backend *b) {
    return b->device;
}

const sphm_backend_ops sphm_cpu_backend = {"cpu",   create,   destroy, step,         view,
                                           restore, limits,   timing,  reset_timing, device,
                                           NULL,    clock_of, 1,       NULL,         NULL};
