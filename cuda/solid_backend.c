/* The solid tissue on a device: memory, submissions, looking. What a step consists of is planned in
 * solid_plan.c, what a thread does is in solid_threads.h. */
#include "cuda/solid_backend.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/end_blocks.h"
#include "cpu/parallel.h"
#include "cuda/solid_plan.h"
#include "cuda/solid_rest.h"

/* As on the CPU: share of the largest stable step that is taken. The limits are read after every submission,
 * and the fibres stiffen in between. */
#define STEP_SHARE 0.8
#define ALIGNMENT 256
enum { PARTS = 3 }; /* passive, elastic, all */

/* Page-locked memory of the host. */
typedef struct host_side {
    sphm_solid_submission *submission;
    sphm_solid_report *report;
    double *part_sum; /* [PARTS * 6 * SPHM_SOLID_PARTIALS] */
    sphm_real *motion, *potential, *recovery, *activation, *fibre_rate, *density, *pressure;
} host_side;

typedef struct solid_backend {
    const sphm_model *model;
    const sphm_device_ops *ops;
    sphm_device *device;
    sphm_solid_device solid;
    host_side host;
    sphm_solid_rest rest; /* its state is what is seen: brought up to date by look() */
    sphm_solid_clock clock;
    int seen;   /* the arrays of rest.state are up to date */
    int kept;   /* which launches the device has kept, as launches_of(); -1: none */
    int failed; /* the device does not work any more */
    double modulus_Pa;
    size_t device_bytes, host_bytes;
    double launch_s[SPHM_SOLID_LAUNCHES]; /* where the launches are timed: at the last reset_timing() */
    sphm_timing timing;
} solid_backend;

static solid_backend *inside(sphm_backend *backend) {
    return (solid_backend *)backend;
}
static const solid_backend *look_inside(const sphm_backend *backend) {
    return (const solid_backend *)backend;
}

/* Memory ------------------------------------------------------------------------------------------------- */

/* The next `bytes` of `memory` (NULL: only counted in *used). */
static void *cut(char *memory, size_t bytes, size_t *used) {
    char *piece = memory ? memory + *used : NULL;
    *used += (bytes / ALIGNMENT + 1) * ALIGNMENT;
    return piece;
}

static size_t cut_device(sphm_solid_device *d, size_t n, size_t pairs, size_t held, char *memory) {
    size_t used = 0;
#define ARRAY(type, name, elements, meaning) d->name = (type *)cut(memory, (elements) * sizeof(type), &used);
#include "cuda/solid_arrays.inc"
#undef ARRAY
    return used;
}

static size_t cut_host(host_side *h, size_t n, char *memory) {
    size_t used = 0;
    h->submission = (sphm_solid_submission *)cut(memory, sizeof *h->submission, &used);
    h->report = (sphm_solid_report *)cut(memory, sizeof *h->report, &used);
    h->part_sum = (double *)cut(memory, PARTS * 6 * SPHM_SOLID_PARTIALS * sizeof(double), &used);
    h->motion = (sphm_real *)cut(memory, 8 * n * sizeof(sphm_real), &used);
    h->potential = (sphm_real *)cut(memory, n * sizeof(sphm_real), &used);
    h->recovery = (sphm_real *)cut(memory, n * sizeof(sphm_real), &used);
    h->activation = (sphm_real *)cut(memory, n * sizeof(sphm_real), &used);
    h->fibre_rate = (sphm_real *)cut(memory, n * sizeof(sphm_real), &used);
    h->density = (sphm_real *)cut(memory, n * sizeof(sphm_real), &used);
    h->pressure = (sphm_real *)cut(memory, n * sizeof(sphm_real), &used);
    return used;
}

static sphm_status allocate(solid_backend *b, sphm_context *context) {
    const sphm_state *s = &b->rest.state;
    const size_t n = s->count, pairs = b->rest.rows.row_start[n];
    for (size_t i = 0; i < n; ++i)
        if (s->attachment[i] != SPHM_FREE)
            ++b->solid.held_count[s->attachment[i] == SPHM_ATTACHED_ORIGIN ? SPHM_END_ORIGIN
                                                                           : SPHM_END_INSERTION];
    const size_t held = b->solid.held_count[SPHM_END_ORIGIN] + b->solid.held_count[SPHM_END_INSERTION];
    b->device_bytes = cut_device(&b->solid, n, pairs, held, NULL);
    b->host_bytes = cut_host(&b->host, n, NULL);
    void *on_device = NULL, *on_host = NULL;
    sphm_status status = b->ops->allocate(b->device, b->device_bytes, &on_device, context);
    if (status == SPHM_OK)
        status = b->ops->allocate_host(b->device, b->host_bytes, &on_host, context);
    if (status != SPHM_OK)
        return status;
    (void)cut_device(&b->solid, n, pairs, held, (char *)on_device);
    (void)cut_host(&b->host, n, (char *)on_host);
    return SPHM_OK;
}

/* Copies in one direction until one fails. */
typedef struct copier {
    const solid_backend *b;
    sphm_status status;
    sphm_context *context;
} copier;

static void upload(copier *c, void *to, const void *from, size_t elements, size_t size) {
    if (c->status == SPHM_OK)
        c->status = c->b->ops->upload(c->b->device, to, from, elements * size, c->context);
}

static void download(copier *c, void *to, const void *from, size_t elements, size_t size) {
    if (c->status == SPHM_OK)
        c->status = c->b->ops->download(c->b->device, to, from, elements * size, c->context);
}

static void finish_copies(copier *c) {
    if (c->status == SPHM_OK)
        c->status = c->b->ops->wait(c->b->device, c->context);
}

/* Creation ----------------------------------------------------------------------------------------------- */

/* Attached slots, the origin's first. */
static void list_held(const solid_backend *b, int32_t *held) {
    const sphm_state *s = &b->rest.state;
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        const uint8_t attached = end == SPHM_END_ORIGIN ? SPHM_ATTACHED_ORIGIN : SPHM_ATTACHED_INSERTION;
        for (size_t i = 0; i < s->count; ++i)
            if (s->attachment[i] == attached)
                *held++ = (int32_t)i;
    }
}

static sphm_status upload_rest(const solid_backend *b, sphm_context *context) {
    const sphm_solid_device *d = &b->solid;
    const sphm_state *s = &b->rest.state;
    const sphm_neighbours *rows = &b->rest.rows;
    const size_t n = s->count, pairs = rows->row_start[n];
    const size_t held = d->held_count[SPHM_END_ORIGIN] + d->held_count[SPHM_END_INSERTION];
    const sphm_real *const rest[3] = {s->rest_x, s->rest_y, s->rest_z};
    const sphm_real *const fibre[3] = {s->fibre_x, s->fibre_y, s->fibre_z};
    _Static_assert(sizeof *rows->row_start == sizeof *d->row_start, "row_start is 64 bits wide");
    sphm_real *columns = (sphm_real *)malloc(6 * n * sizeof *columns);
    int32_t *slots = (int32_t *)malloc((held + 1) * sizeof *slots);
    copier c = {b, SPHM_OK, context};
    if (!columns || !slots)
        c.status = sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to prepare %zu particles", n);
    if (c.status == SPHM_OK) {
        for (size_t i = 0; i < n; ++i)
            for (size_t k = 0; k < 6; ++k)
                columns[k * n + i] = b->rest.gradient.correction[6 * i + k];
        list_held(b, slots);
    }
    upload(&c, d->row_start, rows->row_start, n + 1, sizeof *rows->row_start);
    upload(&c, d->row_count, rows->row_count, n, sizeof *rows->row_count);
    upload(&c, d->neighbour, rows->slot, pairs, sizeof *rows->slot);
    upload(&c, d->pair, b->rest.gradient.pair, 4 * pairs, sizeof(sphm_real));
    upload(&c, d->weight, b->rest.diffusion.weight, pairs, sizeof(sphm_real));
    upload(&c, d->correction, columns, 6 * n, sizeof(sphm_real));
    for (size_t a = 0; a < 3; ++a) {
        upload(&c, d->rest + a * n, rest[a], n, sizeof(sphm_real));
        upload(&c, d->fibre + a * n, fibre[a], n, sizeof(sphm_real));
    }
    upload(&c, d->attachment, s->attachment, n, 1);
    upload(&c, d->electrodes, s->electrodes, n, 1);
    upload(&c, d->held, slots, held, sizeof *slots);
    finish_copies(&c);
    free(columns);
    free(slots);
    return c.status;
}

static void set_constants(solid_backend *b) {
    const sphm_parameters *p = &b->model->parameters;
    sphm_solid_device *d = &b->solid;
    d->count = b->rest.state.count;
    d->tissue.constants = b->model->solid;
    d->tissue.viscosity_Pa_s = (sphm_real)p->tissue_viscosity;
    d->tissue.hourglass_Pa = (sphm_real)p->hourglass_stiffness;
    d->tissue.hourglass_time_s =
        (sphm_real)(p->hourglass_stiffness > 0 ? p->tissue_viscosity / p->hourglass_stiffness : 0);
    d->tissue.density_kg_per_m3 = (sphm_real)p->density;
    d->membrane = b->model->membrane;
    d->particle_volume_m3 = (sphm_real)b->model->particle_volume_m3;
    memcpy(d->frame_m, b->model->frame_m, sizeof d->frame_m);
    memcpy(d->gravity_m_per_s2, p->gravity, sizeof d->gravity_m_per_s2);
    memcpy(d->blocks, b->model->ends, sizeof d->blocks);
}

/* Launches ----------------------------------------------------------------------------------------------- */

static sphm_status launch(const solid_backend *b, int which, int step, int substep, sphm_context *context) {
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
        substeps = s->plan[k].substeps > substeps ? s->plan[k].substeps : substeps;
        for (int end = 0; end < SPHM_END_COUNT; ++end)
            ends |= s->plan[k].ends[end].moved_by != SPHM_SOLID_FOLLOWS;
    }
    return 4 * substeps + 2 * ends + (s->pull_count > 0);
}

static sphm_status launch_step(const solid_backend *b, int launches, int step, sphm_context *context) {
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

static sphm_status launch_steps(const solid_backend *b, int launches, size_t steps, sphm_context *context) {
    sphm_status status = SPHM_OK;
    for (size_t k = 0; k < steps && status == SPHM_OK; ++k)
        status = launch_step(b, launches, (int)k, context);
    return status == SPHM_OK ? launch(b, SPHM_SOLID_REPORT, 0, 0, context) : status;
}

/* A full submission's launches are kept from the first time. */
static sphm_status play_steps(solid_backend *b, int launches, sphm_context *context) {
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

static void read_report(solid_backend *b) {
    b->modulus_Pa = 0;
    for (size_t t = 0; t < SPHM_SOLID_PARTIALS; ++t)
        b->modulus_Pa = fmax(b->modulus_Pa, (double)b->host.report->modulus_Pa[t]);
}

/* Sends the submission's drive and first `steps` plans, has them done, and waits for the report. */
static sphm_status run_submission(solid_backend *b, int launches, size_t steps, sphm_context *context) {
    const host_side *h = &b->host;
    sphm_status status =
        b->ops->upload(b->device, b->solid.submission, h->submission,
                       offsetof(sphm_solid_submission, plan) + steps * sizeof *h->submission->plan, context);
    if (status == SPHM_OK)
        status = steps == SPHM_SUBMISSION_STEPS && !b->ops->launch_times(b->device)
                     ? play_steps(b, launches, context)
                     : launch_steps(b, launches, steps, context);
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
static sphm_status upload_state(solid_backend *b, sphm_context *context) {
    const sphm_state *s = &b->rest.state;
    const sphm_solid_device *d = &b->solid;
    sphm_real *motion = b->host.motion;
    for (size_t i = 0; i < s->count; ++i) {
        const sphm_real line[8] = {s->shift_x[i], s->shift_y[i], s->shift_z[i], 0,
                                   s->vx[i],      s->vy[i],      s->vz[i],      0};
        memcpy(motion + 8 * i, line, sizeof line);
    }
    copier c = {b, SPHM_OK, context};
    upload(&c, d->motion, motion, 8 * s->count, sizeof(sphm_real));
    upload(&c, d->potential, s->membrane_potential, s->count, sizeof(sphm_real));
    upload(&c, d->recovery, s->recovery, s->count, sizeof(sphm_real));
    upload(&c, d->activation, s->activation, s->count, sizeof(sphm_real));
    upload(&c, d->fibre_rate, s->fibre_rate, s->count, sizeof(sphm_real));
    finish_copies(&c);
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

/* Creation, continued ------------------------------------------------------------------------------------ */

static void destroy(sphm_backend *backend) {
    solid_backend *b = inside(backend);
    if (!b)
        return;
    b->ops->close(b->device);
    sphm_solid_rest_free(&b->rest);
    free(b);
}

/* The first launches are made here: a device that cannot run them is refused. */
static sphm_status build(solid_backend *b, sphm_context *context) {
    sphm_status status = b->ops->open(&b->device, context);
    if (status == SPHM_OK)
        status = sphm_solid_rest_create(&b->rest, b->model, context);
    if (status == SPHM_OK)
        status = allocate(b, context);
    if (status != SPHM_OK)
        return status;
    set_constants(b);
    status = upload_rest(b, context);
    if (status != SPHM_OK)
        return status;
    sphm_solid_rest_drop_arrays(&b->rest);
    b->timing.neighbours_per_particle = b->rest.gradient.neighbours_per_particle;
    return upload_state(b, context);
}

sphm_status sphm_device_solid_create(const sphm_device_ops *ops, const sphm_model *model,
                                     sphm_backend **backend, sphm_context *context) {
    *backend = NULL;
    solid_backend *b = (solid_backend *)calloc(1, sizeof *b);
    if (!b)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the CUDA back end");
    b->model = model;
    b->ops = ops;
    b->kept = -1;
    const sphm_status status = build(b, context);
    if (status != SPHM_OK) {
        destroy((sphm_backend *)b);
        return status;
    }
    *backend = (sphm_backend *)b;
    return SPHM_OK;
}

/* Steps -------------------------------------------------------------------------------------------------- */

static sphm_status name_failure(const solid_backend *b, const sphm_solid_clock *after,
                                sphm_context *context) {
    const uint64_t failure = b->host.report->failure;
    const int not_finite = (int)(failure >> 32 & 1);
    return sphm_fail(context, SPHM_FAILED_NONFINITE, "particle %d is %s at %g s (%s, step %llu)",
                     (int)b->rest.state.id[failure & UINT32_MAX],
                     not_finite ? "not finite" : "turned inside out", after->time_s,
                     not_finite ? "integration" : "stress sweep", (unsigned long long)after->steps);
}

/* Up to SPHM_SUBMISSION_STEPS steps. */
static sphm_status submit(solid_backend *b, size_t steps, double step_s, const sphm_drive *drive,
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

static void show_clock(solid_backend *b) {
    b->rest.state.time_s = b->clock.time_s;
    b->rest.state.steps = b->clock.steps;
    b->rest.state.diffusion_due_s = b->clock.diffusion_due_s;
    memcpy(b->rest.state.ends, b->clock.ends, sizeof b->clock.ends);
}

static sphm_status step(sphm_backend *backend, size_t count, double time_step_s, const sphm_drive *drive,
                        sphm_context *context) {
    solid_backend *b = inside(backend);
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

/* Looking ------------------------------------------------------------------------------------------------ */

static void show_nothing(sphm_state *s) {
    sphm_real *const all[] = {s->x,       s->y,        s->z,        s->vx,         s->vy,
                              s->vz,      s->shift_x,  s->shift_y,  s->shift_z,    s->membrane_potential,
                              s->density, s->pressure, s->recovery, s->activation, s->fibre_rate};
    for (size_t a = 0; a < sizeof all / sizeof *all; ++a)
        for (size_t i = 0; i < s->count; ++i)
            all[a][i] = (sphm_real)NAN;
}

static void show_motion(sphm_state *s, const sphm_real *motion) {
    for (size_t i = 0; i < s->count; ++i, motion += 8) {
        s->shift_x[i] = motion[0];
        s->shift_y[i] = motion[1];
        s->shift_z[i] = motion[2];
        s->x[i] = s->rest_x[i] + motion[0];
        s->y[i] = s->rest_y[i] + motion[1];
        s->z[i] = s->rest_z[i] + motion[2];
        s->vx[i] = motion[4];
        s->vy[i] = motion[5];
        s->vz[i] = motion[6];
    }
}

/* What cannot be had any more is shown as NaN, never as something older. */
static void look(solid_backend *b) {
    if (b->seen)
        return;
    const sphm_solid_device *d = &b->solid;
    const host_side *h = &b->host;
    sphm_state *s = &b->rest.state;
    const size_t n = s->count, bytes = n * sizeof(sphm_real);
    copier c = {b, b->failed ? SPHM_FAILED_BACKEND : SPHM_OK, NULL};
    download(&c, h->motion, d->motion, 8 * n, sizeof(sphm_real));
    download(&c, h->potential, d->potential + (size_t)b->clock.buffer * n, n, sizeof(sphm_real));
    download(&c, h->recovery, d->recovery, n, sizeof(sphm_real));
    download(&c, h->activation, d->activation, n, sizeof(sphm_real));
    download(&c, h->fibre_rate, d->fibre_rate, n, sizeof(sphm_real));
    download(&c, h->density, d->density, n, sizeof(sphm_real));
    download(&c, h->pressure, d->pressure, n, sizeof(sphm_real));
    finish_copies(&c);
    b->failed = c.status != SPHM_OK;
    b->seen = 1;
    if (b->failed) {
        show_nothing(s);
        return;
    }
    show_motion(s, h->motion);
    memcpy(s->membrane_potential, h->potential, bytes);
    memcpy(s->recovery, h->recovery, bytes);
    memcpy(s->activation, h->activation, bytes);
    memcpy(s->fibre_rate, h->fibre_rate, bytes);
    memcpy(s->density, h->density, bytes);
    memcpy(s->pressure, h->pressure, bytes);
}

static const sphm_state *view(sphm_backend *backend) {
    look(inside(backend));
    return &inside(backend)->rest.state;
}

static const sphm_state *clock_of(const sphm_backend *backend) {
    return &look_inside(backend)->rest.state;
}

static sphm_status restore(sphm_backend *backend, const sphm_state *from, sphm_context *context) {
    solid_backend *b = inside(backend);
    sphm_state *s = &b->rest.state;
    int32_t *slots = (int32_t *)malloc(s->count * sizeof *slots);
    if (!slots)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to restore %zu particles", s->count);
    look(b); /* what is not loaded stays as it is now */
    sphm_status status = sphm_state_load_in_slots(from, s, slots, context);
    free(slots);
    if (status != SPHM_OK)
        return status;
    if (b->failed)
        return sphm_fail(context, SPHM_FAILED_BACKEND, "the device has failed before; reset the muscle");
    return upload_state(b, context);
}

/* As src/cpu/solid_backend.c. */
static sphm_time_step_limits limits(const sphm_backend *backend) {
    const solid_backend *b = look_inside(backend);
    const sphm_parameters *p = &b->model->parameters;
    const double density = p->density * p->mass_scaling;
    const double eigenvalue = b->rest.gradient.gradient_eigenvalue,
                 hourglass = b->rest.gradient.hourglass_eigenvalue;
    double w2 = (b->modulus_Pa * eigenvalue + p->hourglass_stiffness * hourglass) / density;
    for (int end = 0; end < SPHM_END_COUNT; ++end)
        w2 += sphm_end_block_frequency2(&b->model->ends[end]);
    const double c =
        p->tissue_viscosity * (2 * eigenvalue + (p->hourglass_stiffness > 0 ? hourglass : 0)) / density;
    sphm_time_step_limits l;
    l.courant = l.diffusion = l.shape_matching = INFINITY;
    l.acoustic = STEP_SHARE * 2 / sqrt(w2);
    l.viscous = c > 0 ? STEP_SHARE * 2 / c : INFINITY;
    l.smallest = STEP_SHARE * (sqrt(c * c + 4 * w2) - c) / w2;
    return l;
}

static sphm_timing timing(const sphm_backend *backend) {
    const solid_backend *b = look_inside(backend);
    const double *launch_s = b->ops->launch_times(b->device);
    sphm_timing t = b->timing;
    if (launch_s) {
        t.forces_s = launch_s[SPHM_SOLID_MOVE] - b->launch_s[SPHM_SOLID_MOVE];
        t.density_pressure_s = launch_s[SPHM_SOLID_STRAIN] - b->launch_s[SPHM_SOLID_STRAIN];
        t.diffusion_s = launch_s[SPHM_SOLID_SPREAD] - b->launch_s[SPHM_SOLID_SPREAD];
    }
    t.memory_bytes = sizeof *b + sphm_state_bytes(b->rest.state.count) + b->device_bytes + b->host_bytes;
    return t;
}

static void reset_timing(sphm_backend *backend) {
    solid_backend *b = inside(backend);
    memset(&b->timing, 0, sizeof b->timing);
    b->timing.neighbours_per_particle = b->rest.gradient.neighbours_per_particle;
    if (b->ops->launch_times(b->device))
        memcpy(b->launch_s, b->ops->launch_times(b->device), sizeof b->launch_s);
}

static const char *device(const sphm_backend *backend) {
    return look_inside(backend)->ops->name(look_inside(backend)->device);
}

/* Wrench ------------------------------------------------------------------------------------------------- */

/* Has part `part` of the wrench summed, into its place in host.part_sum. */
static sphm_status sum_part(solid_backend *b, int part, int end, const double pivot_m[3]) {
    sphm_solid_call call;
    memset(&call, 0, sizeof call);
    call.with_activation = part > 0;
    call.with_damping = part > 1;
    call.end = end;
    memcpy(call.pivot_m, pivot_m, sizeof call.pivot_m);
    sphm_status status = SPHM_OK;
    for (int which = SPHM_SOLID_PART_STRAIN; which <= SPHM_SOLID_PART_SUM && status == SPHM_OK; ++which) {
        call.launch = which;
        status = b->ops->launch(b->device, &b->solid, &call, NULL);
    }
    const size_t count = 6 * SPHM_SOLID_PARTIALS;
    return status == SPHM_OK ? b->ops->download(b->device, b->host.part_sum + (size_t)part * count,
                                                b->solid.part_sum, count * sizeof(double), NULL)
                             : status;
}

static void add_partials(const solid_backend *b, int part, double force[3], double moment[3]) {
    const double *sum = b->host.part_sum + (size_t)part * 6 * SPHM_SOLID_PARTIALS;
    memset(force, 0, 3 * sizeof *force);
    memset(moment, 0, 3 * sizeof *moment);
    for (size_t t = 0; t < SPHM_SOLID_PARTIALS; ++t, sum += 6)
        for (int d = 0; d < 3; ++d) {
            force[d] += sum[d];
            moment[d] += sum[3 + d];
        }
}

/* The stress is a sum, so the parts are differences of sums with and without. */
static void wrench(sphm_backend *backend, const sphm_end_drive *drive, int end, sphm_wrench *w) {
    solid_backend *b = inside(backend);
    const sphm_end_block *block = &b->model->ends[end];
    sphm_end_state now;
    double pivot[3], elastic_N[3], elastic_Nm[3];
    sphm_end_frame_state(block, drive, b->clock.time_s, &b->clock.ends[end], &now);
    for (int d = 0; d < 3; ++d)
        pivot[d] = now.position_m[d] - b->model->frame_m[d];
    sphm_status status = b->failed ? SPHM_FAILED_BACKEND : SPHM_OK;
    for (int part = 0; part < PARTS && status == SPHM_OK; ++part)
        status = sum_part(b, part, end, pivot);
    if (status == SPHM_OK)
        status = b->ops->wait(b->device, NULL);
    if (status != SPHM_OK) {
        b->failed = 1;
        for (size_t d = 0; d < sizeof *w / sizeof(double); ++d)
            ((double *)w)[d] = NAN;
        return;
    }
    add_partials(b, 0, w->passive_N, w->passive_Nm);
    add_partials(b, 1, elastic_N, elastic_Nm);
    add_partials(b, 2, w->force_N, w->moment_Nm);
    for (int d = 0; d < 3; ++d) {
        w->active_N[d] = elastic_N[d] - w->passive_N[d];
        w->active_Nm[d] = elastic_Nm[d] - w->passive_Nm[d];
        w->damping_N[d] = w->force_N[d] - elastic_N[d];
        w->damping_Nm[d] = w->moment_Nm[d] - elastic_Nm[d];
    }
    sphm_end_put_tendon_between(block, drive, b->clock.time_s, &b->clock.ends[end], w);
}

const sphm_backend_ops sphm_device_solid_backend = {"cuda",
                                                    NULL,
                                                    destroy,
                                                    step,
                                                    view,
                                                    restore,
                                                    limits,
                                                    timing,
                                                    reset_timing,
                                                    device,
                                                    wrench,
                                                    clock_of,
                                                    SPHM_SUBMISSION_STEPS};
