/* Submissions of the fluid tissue: rows anew, steps, and what is reported. What
 * a thread does is in fluid_threads.h and fluid_rows.h. */
#include <math.h>
#include <string.h>

#include "core/context.h"
#include "core/fluid_watch.h"
#include "cpu/parallel.h"
#include "cuda/fluid_inside.h"

sphm_status sphm_fluid_launch(const sphm_fluid_backend *b, int which, int step, int substep,
                              sphm_context *context) {
    sphm_fluid_call call;
    memset(&call, 0, sizeof call);
    call.launch = which;
    call.step = step;
    call.substep = substep;
    return b->ops->launch_fluid(b->device, &b->fluid, &call, context);
}

static sphm_status launch_all(const sphm_fluid_backend *b, const int *which, size_t count,
                              sphm_context *context) {
    sphm_status status = SPHM_OK;
    for (size_t k = 0; k < count && status == SPHM_OK; ++k)
        status = sphm_fluid_launch(b, which[k], 0, 0, context);
    return status;
}

static void read_report(sphm_fluid_backend *b) {
    double largest[3] = {0, 0, 0};
    for (int block = 0; block < b->fluid.partials; ++block)
        for (int k = 0; k < 3; ++k)
            largest[k] = fmax(largest[k], b->report->largest[block][k]);
    b->stable_step_ms = largest[0] > 0 ? 2 / largest[0] : INFINITY;
    b->stale = largest[1] > b->fluid.stale_m2;
    b->speed_m_per_s = sqrt(largest[2]);
}

/* Waits for everything launched before. */
static sphm_status fetch_report(sphm_fluid_backend *b, sphm_context *context) {
    sphm_status status = sphm_fluid_launch(b, SPHM_FLUID_REPORT, 0, 0, context);
    if (status == SPHM_OK)
        status = b->ops->download(b->device, b->report, b->fluid.report, sizeof *b->report, context);
    if (status == SPHM_OK)
        status = b->ops->wait(b->device, context);
    if (status == SPHM_OK)
        read_report(b);
    return status;
}

/* Rows
 * -----------------------------------------------------------------------------------------------------
 */

static sphm_status fill_rows(sphm_fluid_backend *b, sphm_context *context) {
    static const int fill[] = {SPHM_FLUID_FILL, SPHM_FLUID_CORRECT, SPHM_FLUID_WEIGH};
    const sphm_status status = launch_all(b, fill, sizeof fill / sizeof *fill, context);
    return status == SPHM_OK ? fetch_report(b, context) : status;
}

/* The only wait is for the report, which the schedule of the diffusion's
 * sub-steps hangs on. How long the rows get is known then, too: should they not
 * fit, which takes a muscle that lost an eighth of its volume or more, they get
 * more memory and are filled again. */
sphm_status sphm_fluid_build_rows(sphm_fluid_backend *b, int list, sphm_context *context) {
    static const int sort[] = {SPHM_FLUID_BOX,    SPHM_FLUID_LAY_OUT, SPHM_FLUID_BIN,
                               SPHM_FLUID_SORT,   SPHM_FLUID_STARTS,  SPHM_FLUID_REORDER,
                               SPHM_FLUID_SETTLE, SPHM_FLUID_COUNT,   SPHM_FLUID_SCAN};
    sphm_status status = list ? sphm_fluid_launch(b, SPHM_FLUID_LIST, 0, 0, context) : SPHM_OK;
    if (status == SPHM_OK)
        status = launch_all(b, sort, sizeof sort / sizeof *sort, context);
    if (status == SPHM_OK)
        status = fill_rows(b, context);
    if (status == SPHM_OK && b->report->entries > b->fluid.capacity) {
        status = sphm_fluid_reserve_rows(b, b->report->entries, context);
        if (status == SPHM_OK)
            status = fill_rows(b, context);
    }
    b->seen = 0;
    return status;
}

/* Steps
 * ----------------------------------------------------------------------------------------------------
 */

/* What does not change within a submission, with nothing failed and nobody hit
 * yet. */
static void plan_drive(sphm_fluid_backend *b, const sphm_drive *drive) {
    sphm_fluid_submission *s = b->submission;
    memset(s, 0, sizeof *s);
    s->failure = SPHM_FLUID_FINE;
    s->end = UINT32_MAX;
    s->electrodes = sphm_membrane_tabulate(&b->model->membrane, drive);
    s->pull_count = (uint32_t)drive->force_count;
    for (size_t f = 0; f < drive->force_count; ++f) {
        const sphm_point_force *force = &drive->forces[f];
        s->pulls[f] = sphm_point_pull_at(force->point_m, force->radius_m, b->model->frame_m);
        memcpy(s->force_N[f], force->force_N, sizeof s->force_N[f]);
    }
}

/* Speed above which the next step must be shorter; a step may be as long as the limit but for rounding. */
static double fastest(const sphm_fluid_backend *b, double step_s) {
    return SPHM_FLUID_COURANT * b->model->body.spacing_m / step_s * (1 + 1e-6);
}

static void plan_step(const sphm_fluid_backend *b, double step_s, sphm_fluid_plan *plan,
                      sphm_fluid_clock *clock) {
    const sphm_fluid_constants *c = &b->model->fluid;
    plan->step = (sphm_real)step_s;
    plan->pull = 2 * b->fluid.unit * sphm_smooth_mixing(c, step_s);
    plan->fastest2 = fastest(b, step_s) * fastest(b, step_s);
    plan->prediction = sphm_prediction_of(c, step_s);
    sphm_membrane_plan_step(&plan->membrane, &b->model->membrane, b->stable_step_ms, step_s,
                            &clock->diffusion_due_s, &clock->buffer);
    clock->time_s += step_s;
    ++clock->steps;
}

/* Launches of a step where none has more than `substeps` diffusions: nothing
 * else about it changes them. */
static sphm_status launch_step(const sphm_fluid_backend *b, int substeps, int step, sphm_context *context) {
    sphm_status status = SPHM_OK;
    for (int which = SPHM_FLUID_SUM; which <= SPHM_FLUID_SMOOTH && status == SPHM_OK; ++which)
        status = sphm_fluid_launch(b, which, step, 0, context);
    for (int substep = 0; substep + 1 < substeps && status == SPHM_OK; ++substep)
        status = sphm_fluid_launch(b, SPHM_FLUID_SPREAD, step, substep, context);
    return status == SPHM_OK ? sphm_fluid_launch(b, SPHM_FLUID_FORCE, step, 0, context) : status;
}

static sphm_status launch_steps(const sphm_fluid_backend *b, int substeps, size_t steps,
                                sphm_context *context) {
    sphm_status status = SPHM_OK;
    for (size_t k = 0; k < steps && status == SPHM_OK; ++k)
        status = launch_step(b, substeps, (int)k, context);
    return status;
}

/* A full submission's launches are kept from the first time. */
static sphm_status play_steps(sphm_fluid_backend *b, int substeps, sphm_context *context) {
    sphm_status status = SPHM_OK;
    if (b->kept != substeps) {
        b->kept = 0;
        status = b->ops->record(b->device, context);
        if (status == SPHM_OK)
            status = launch_steps(b, substeps, SPHM_FLUID_STEPS, context);
        const sphm_status ended = b->ops->keep(b->device, status == SPHM_OK ? context : NULL);
        if (status == SPHM_OK)
            status = ended;
        if (status != SPHM_OK)
            return status;
        b->kept = substeps;
    }
    return b->ops->play(b->device, context);
}

/* Sends the submission's drive and first `steps` plans. */
static sphm_status upload_submission(const sphm_fluid_backend *b, size_t steps, sphm_context *context) {
    return b->ops->upload(b->device, b->fluid.submission, b->submission,
                          offsetof(sphm_fluid_submission, plan) + steps * sizeof *b->submission->plan,
                          context);
}

static sphm_status run_submission(sphm_fluid_backend *b, size_t steps, sphm_context *context) {
    int substeps = 1;
    for (size_t k = 0; k < steps; ++k) {
        const int of_step = b->submission->plan[k].membrane.substeps;
        substeps = of_step > substeps ? of_step : substeps;
    }
    sphm_status status = upload_submission(b, steps, context);
    if (status == SPHM_OK)
        status = steps == SPHM_FLUID_STEPS && !b->ops->launch_times(b->device)
                     ? play_steps(b, substeps, context)
                     : launch_steps(b, substeps, steps, context);
    return status == SPHM_OK ? fetch_report(b, context) : status;
}

static sphm_status name_failure(const sphm_fluid_backend *b, sphm_context *context) {
    const uint64_t failure = b->report->failure;
    const int stage = (int)(failure >> 32 & 0xff);
    char what[160];
    sphm_fluid_describe_nonfinite(stage == SPHM_FLUID_FINITE ? -1 : (int32_t)(failure & UINT32_MAX), stage,
                                  b->clock.time_s, b->clock.steps, b->report->bad, what, sizeof what);
    return sphm_fail(context, SPHM_FAILED_NONFINITE, "the state became non-finite: %s", what);
}

/* Up to SPHM_FLUID_STEPS steps; *taken of them, at least one, before the rows
 * or the step need another look.
 */
static sphm_status submit(sphm_fluid_backend *b, size_t steps, double step_s, const sphm_drive *drive,
                          size_t *taken, sphm_context *context) {
    sphm_fluid_clock after[SPHM_FLUID_STEPS];
    plan_drive(b, drive);
    for (size_t k = 0; k < steps; ++k) {
        after[k] = k ? after[k - 1] : b->clock;
        plan_step(b, step_s, &b->submission->plan[k], &after[k]);
    }
    *taken = steps;
    b->seen = 0;
    const sphm_status status = run_submission(b, steps, context);
    if (status != SPHM_OK)
        return status;
    const uint64_t failure = b->report->failure;
    const size_t last = failure != SPHM_FLUID_FINE ? (size_t)(failure >> 40) : b->report->end;
    *taken = last < steps ? last + 1 : steps;
    b->clock = after[*taken - 1];
    b->timing.steps += *taken;
    return failure == SPHM_FLUID_FINE ? SPHM_OK : name_failure(b, context);
}

static sphm_status refresh_rows(sphm_fluid_backend *b, sphm_context *context) {
    if (b->stale) {
        const double start = sphm_wall_clock_s();
        const sphm_status status = sphm_fluid_build_rows(b, 1, context);
        if (status != SPHM_OK)
            return status == SPHM_REFUSED_MEMORY
                       ? sphm_fail(context, SPHM_FAILED_BACKEND, "no memory for the neighbour rows at %g s",
                                   b->clock.time_s)
                       : status;
        b->timing.neighbours_s += sphm_wall_clock_s() - start;
        ++b->timing.neighbour_rebuilds;
    }
    return sphm_fluid_refuse_clumps(b->stable_step_ms, b->rest_stable_step_ms, b->clock.time_s, context);
}

static void show_clock(sphm_fluid_backend *b) {
    b->state.time_s = b->clock.time_s;
    b->state.steps = b->clock.steps;
    b->state.diffusion_due_s = b->clock.diffusion_due_s;
}

/* Fewer steps than asked for where the particles have become too fast for them.
 */
sphm_status sphm_fluid_step(sphm_backend *backend, size_t count, double time_step_s, const sphm_drive *drive,
                            sphm_context *context) {
    sphm_fluid_backend *b = (sphm_fluid_backend *)backend;
    if (b->failed)
        return sphm_fail(context, SPHM_FAILED_BACKEND, "the device has failed before");
    const double start = sphm_wall_clock_s();
    sphm_status status = SPHM_OK;
    for (size_t done = 0; done < count && status == SPHM_OK;) {
        const size_t left = count - done, steps = left < SPHM_FLUID_STEPS ? left : SPHM_FLUID_STEPS;
        size_t taken = 0;
        status = refresh_rows(b, context);
        if (status == SPHM_OK)
            status = submit(b, steps, time_step_s, drive, &taken, context);
        done += taken;
        if (b->speed_m_per_s > fastest(b, time_step_s))
            break;
    }
    b->failed = status == SPHM_FAILED_BACKEND;
    b->timing.total_s += sphm_wall_clock_s() - start;
    show_clock(b);
    return status;
}

/* The rest shape
 * -------------------------------------------------------------------------------------------
 */

/* Smoothed twice: the second time against the rest density that the first one
 * gave, for the pressure. The plan is of a step that moves nothing. */
sphm_status sphm_fluid_measure_rest(sphm_fluid_backend *b, sphm_context *context) {
    static const int rest[] = {SPHM_FLUID_SUM,      SPHM_FLUID_RIGID,  SPHM_FLUID_PREDICT, SPHM_FLUID_SMOOTH,
                               SPHM_FLUID_SET_REST, SPHM_FLUID_SMOOTH, SPHM_FLUID_WITHIN};
    sphm_state *s = &b->state;
    sphm_drive none;
    memset(&none, 0, sizeof none);
    plan_drive(b, &none);
    b->submission->plan[0].step = 1;
    b->submission->plan[0].membrane.buffer = b->clock.buffer;
    sphm_status status = upload_submission(b, 1, context);
    if (status == SPHM_OK)
        status = launch_all(b, rest, sizeof rest / sizeof *rest, context);
    if (status == SPHM_OK)
        status = fetch_report(b, context);
    if (status == SPHM_OK)
        status = sphm_fluid_download_state(b, context);
    if (status != SPHM_OK)
        return status;
    double smallest = INFINITY;
    for (size_t i = 0; i < s->count; ++i) {
        s->rest_density[i] = s->density[i];
        smallest = fmin(smallest, (double)s->density[i]);
    }
    b->rest_density_min = smallest;
    b->rest_stable_step_ms = b->stable_step_ms;
    b->timing.neighbours_per_particle = (double)b->report->within / (double)s->count;
    b->seen = 1;
    return SPHM_OK;
}
