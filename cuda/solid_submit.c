/* Submissions of the solid tissue: what is sent, launched and reported. What a step consists of is planned in
 * solid_plan.c, what a thread does is in solid_threads.h. */
#include <math.h>
#include <string.h>

#include "core/context.h"
#include "cpu/parallel.h"
#include "cuda/solid_inside.h"

/* Launches ----------------------------------------------------------------------------------------------- */

static sphm_status launch(const sphm_solid_backend *b, int which, int step, int substep,
                          sphm_context *context) {
    sphm_solid_call call;
    memset(&call, 0, sizeof call);
    call.launch = which;
    call.step = step;
    call.substep = substep;
    return b->ops->launch(b->device, &b->solid, &call, context);
}

/* Which launches a step of a submission takes: nothing else about it does. */
static int launches_of(const sphm_solid_submission *s, size_t steps) {
    int substeps = 1, ends = 0;
    for (size_t k = 0; k < steps; ++k) {
        substeps = s->plan[k].membrane.substeps > substeps ? s->plan[k].membrane.substeps : substeps;
        for (int end = 0; end < SPHM_END_COUNT; ++end)
            ends |= s->plan[k].ends[end].moved_by != SPHM_SOLID_FOLLOWS;
    }
    return 4 * substeps + 2 * ends + (s->pull_count > 0);
}

static sphm_status launch_step(const sphm_solid_backend *b, int launches, int step, sphm_context *context) {
    sphm_status status = SPHM_OK;
    if (launches & 1)
        status = launch(b, SPHM_SOLID_HITS, step, 0, context);
    for (int which = SPHM_SOLID_END_FORCE;
         (launches & 2) && which <= SPHM_SOLID_END_STEP && status == SPHM_OK; ++which)
        status = launch(b, which, step, 0, context);
    if (status == SPHM_OK)
        status = launch(b, SPHM_SOLID_MOVE, step, 0, context);
    for (int substep = 0; substep + 1 < launches / 4 && status == SPHM_OK; ++substep)
        status = launch(b, SPHM_SOLID_SPREAD, step, substep, context);
    return status == SPHM_OK ? launch(b, SPHM_SOLID_STRAIN, step, 0, context) : status;
}

static sphm_status launch_steps(const sphm_solid_backend *b, int launches, size_t steps,
                                sphm_context *context) {
    sphm_status status = SPHM_OK;
    for (size_t k = 0; k < steps && status == SPHM_OK; ++k)
        status = launch_step(b, launches, (int)k, context);
    return status == SPHM_OK ? launch(b, SPHM_SOLID_REPORT, 0, 0, context) : status;
}

/* A full submission's launches are kept from the first time. */
static sphm_status play_steps(sphm_solid_backend *b, int launches, sphm_context *context) {
    sphm_status status = SPHM_OK;
    if (b->kept != launches) {
        b->kept = -1;
        status = b->ops->record(b->device, context);
        if (status == SPHM_OK)
            status = launch_steps(b, launches, SPHM_SUBMISSION_STEPS, context);
        const sphm_status ended = b->ops->keep(b->device, status == SPHM_OK ? context : NULL);
        if (status == SPHM_OK)
            status = ended;
        if (status != SPHM_OK)
            return status;
        b->kept = launches;
    }
    return b->ops->play(b->device, context);
}

/* The same in one launch. */
static sphm_status launch_together(const sphm_solid_backend *b, int launches, size_t steps,
                                   sphm_context *context) {
    sphm_solid_call call;
    memset(&call, 0, sizeof call);
    call.launch = SPHM_SOLID_STEPS;
    call.launches = launches;
    call.step = (int)steps;
    const sphm_status status = b->ops->launch(b->device, &b->solid, &call, context);
    return status == SPHM_OK ? launch(b, SPHM_SOLID_REPORT, 0, 0, context) : status;
}

static sphm_status do_steps(sphm_solid_backend *b, int launches, size_t steps, sphm_context *context) {
    if (b->ops->together(b->device))
        return launch_together(b, launches, steps, context);
    return steps == SPHM_SUBMISSION_STEPS && !b->ops->launch_times(b->device)
               ? play_steps(b, launches, context)
               : launch_steps(b, launches, steps, context);
}

static void read_report(sphm_solid_backend *b) {
    b->modulus_Pa = 0;
    for (size_t t = 0; t < SPHM_SOLID_PARTIALS; ++t)
        b->modulus_Pa = fmax(b->modulus_Pa, (double)b->host.report->modulus_Pa[t]);
}

/* Sends the submission's drive and first `steps` plans, has them done, and waits for the report. */
static sphm_status run_submission(sphm_solid_backend *b, int launches, size_t steps, sphm_context *context) {
    const sphm_solid_host *h = &b->host;
    sphm_status status =
        b->ops->upload(b->device, b->solid.submission, h->submission,
                       offsetof(sphm_solid_submission, plan) + steps * sizeof *h->submission->plan, context);
    if (status == SPHM_OK)
        status = do_steps(b, launches, steps, context);
    if (status == SPHM_OK)
        status = b->ops->download(b->device, h->report, b->solid.report, sizeof *h->report, context);
    if (status == SPHM_OK)
        status = b->ops->wait(b->device, context);
    if (status == SPHM_OK)
        read_report(b);
    b->failed = status != SPHM_OK;
    return status;
}

/* Puts what is seen on the device, with the stress that belongs to it. */
sphm_status sphm_solid_upload_state(sphm_solid_backend *b, sphm_context *context) {
    const sphm_state *s = &b->rest.state;
    const sphm_solid_device *d = &b->solid;
    sphm_real *motion = b->host.motion;
    for (size_t i = 0; i < s->count; ++i) {
        const sphm_real line[8] = {s->shift_x[i], s->shift_y[i], s->shift_z[i], 0,
                                   s->vx[i],      s->vy[i],      s->vz[i],      0};
        memcpy(motion + 8 * i, line, sizeof line);
    }
    sphm_solid_copier c = {b, SPHM_OK, context};
    sphm_solid_upload(&c, d->motion, motion, 8 * s->count, sizeof(sphm_real));
    sphm_solid_upload(&c, d->potential, s->membrane_potential, s->count, sizeof(sphm_real));
    sphm_solid_upload(&c, d->recovery, s->recovery, s->count, sizeof(sphm_real));
    sphm_solid_upload(&c, d->activation, s->activation, s->count, sizeof(sphm_real));
    sphm_solid_upload(&c, d->fibre_rate, s->fibre_rate, s->count, sizeof(sphm_real));
    sphm_solid_finish_copies(&c);
    b->failed = c.status != SPHM_OK;
    b->clock.time_s = s->time_s;
    b->clock.steps = s->steps;
    b->clock.diffusion_due_s = s->diffusion_due_s;
    memcpy(b->clock.ends, s->ends, sizeof b->clock.ends);
    b->clock.buffer = 0;
    if (c.status != SPHM_OK)
        return c.status;
    memset(b->host.submission, 0, sizeof *b->host.submission);
    b->host.submission->failure = SPHM_SOLID_FINE;
    sphm_solid_plan_nothing(&b->host.submission->plan[0], 0);
    sphm_status status =
        b->ops->upload(b->device, d->submission, b->host.submission, sizeof *b->host.submission, context);
    if (status == SPHM_OK)
        status = launch(b, SPHM_SOLID_STRAIN, 0, 0, context);
    if (status == SPHM_OK)
        status = launch(b, SPHM_SOLID_REPORT, 0, 0, context);
    if (status == SPHM_OK)
        status = b->ops->download(b->device, b->host.report, d->report, sizeof *b->host.report, context);
    if (status == SPHM_OK)
        status = b->ops->wait(b->device, context);
    if (status == SPHM_OK)
        read_report(b);
    b->failed = status != SPHM_OK;
    b->seen = 0; /* density and pressure are new */
    return status;
}

/* Steps -------------------------------------------------------------------------------------------------- */

static sphm_status name_failure(const sphm_solid_backend *b, const sphm_solid_clock *after,
                                sphm_context *context) {
    const uint64_t failure = b->host.report->failure;
    const int not_finite = (int)(failure >> 32 & 1);
    return sphm_fail(context, SPHM_FAILED_NONFINITE, "particle %d is %s at %g s (%s, step %llu)",
                     (int)b->rest.state.id[failure & UINT32_MAX],
                     not_finite ? "not finite" : "turned inside out", after->time_s,
                     not_finite ? "integration" : "stress sweep", (unsigned long long)after->steps);
}

/* Up to SPHM_SUBMISSION_STEPS steps. */
static sphm_status submit(sphm_solid_backend *b, size_t steps, double step_s, const sphm_drive *drive,
                          sphm_context *context) {
    sphm_solid_submission *s = b->host.submission;
    sphm_solid_clock after[SPHM_SUBMISSION_STEPS];
    sphm_solid_plan_drive(s, b->model, drive, &b->clock);
    for (size_t k = 0; k < steps; ++k) {
        after[k] = k ? after[k - 1] : b->clock;
        sphm_solid_plan_step(&s->plan[k], b->model, drive, b->rest.diffusion.stable_step_ms, step_s,
                             &after[k]);
    }
    const double start = sphm_wall_clock_s();
    const sphm_status status = run_submission(b, launches_of(s, steps), steps, context);
    b->timing.total_s += sphm_wall_clock_s() - start;
    b->seen = 0;
    if (status != SPHM_OK)
        return status;
    const uint64_t failure = b->host.report->failure;
    const size_t last = failure == SPHM_SOLID_FINE ? steps - 1 : (size_t)(failure >> 33);
    b->clock = after[last];
    for (int end = 0; end < SPHM_END_COUNT; ++end)
        if (s->plan[0].ends[end].moved_by != SPHM_SOLID_FOLLOWS)
            b->clock.ends[end] = b->host.report->ends[end];
    b->timing.steps += last + 1;
    return failure == SPHM_SOLID_FINE ? SPHM_OK : name_failure(b, &b->clock, context);
}

static void show_clock(sphm_solid_backend *b) {
    b->rest.state.time_s = b->clock.time_s;
    b->rest.state.steps = b->clock.steps;
    b->rest.state.diffusion_due_s = b->clock.diffusion_due_s;
    memcpy(b->rest.state.ends, b->clock.ends, sizeof b->clock.ends);
}

sphm_status sphm_solid_step(sphm_backend *backend, size_t count, double time_step_s, const sphm_drive *drive,
                            sphm_context *context) {
    sphm_solid_backend *b = (sphm_solid_backend *)backend;
    sphm_status status =
        b->failed ? sphm_fail(context, SPHM_FAILED_BACKEND, "the device has failed before") : SPHM_OK;
    for (size_t done = 0; done < count && status == SPHM_OK;) {
        const size_t steps = count - done < SPHM_SUBMISSION_STEPS ? count - done : SPHM_SUBMISSION_STEPS;
        status = submit(b, steps, time_step_s, drive, context);
        done += steps;
    }
    show_clock(b);
    return status;
}
