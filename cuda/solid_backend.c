/* The solid tissue on a device: creation, the state on the host, limits. Memory is in solid_memory.c, steps
 * are in solid_submit.c, wrenches and looks in files of their name. */
#include "cuda/solid_backend.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/solid_limits.h"
#include "cuda/solid_inside.h"

static sphm_solid_backend *inside(sphm_backend *backend) {
    return (sphm_solid_backend *)backend;
}
static const sphm_solid_backend *look_inside(const sphm_backend *backend) {
    return (const sphm_solid_backend *)backend;
}

/* Creation ---------------------------------------------------------------------------------------------- */

static void destroy(sphm_backend *backend) {
    sphm_solid_backend *b = inside(backend);
    if (!b)
        return;
    sphm_look_destroy(b->look);
    b->ops->close(b->device);
    sphm_solid_rest_free(&b->rest);
    free(b);
}

/* The first launches are made here: a device that cannot run them is refused. */
static sphm_status build(sphm_solid_backend *b, sphm_context *context) {
    sphm_status status = b->ops->open(&b->device, context);
    if (status == SPHM_OK)
        status = sphm_solid_rest_create(&b->rest, b->model, context);
    if (status == SPHM_OK)
        status = sphm_solid_allocate(b, context);
    if (status != SPHM_OK)
        return status;
    sphm_solid_set_constants(b);
    status = sphm_solid_upload_rest(b, context);
    if (status != SPHM_OK)
        return status;
    sphm_solid_rest_drop_arrays(&b->rest);
    b->timing.neighbours_per_particle = b->rest.gradient.neighbours_per_particle;
    return sphm_solid_upload_state(b, context);
}

sphm_status sphm_device_solid_create(const sphm_device_ops *ops, const sphm_model *model,
                                     sphm_backend **backend, sphm_context *context) {
    *backend = NULL;
    sphm_solid_backend *b = (sphm_solid_backend *)calloc(1, sizeof *b);
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
static void look(sphm_solid_backend *b) {
    if (b->seen)
        return;
    const sphm_solid_device *d = &b->solid;
    const sphm_solid_host *h = &b->host;
    sphm_state *s = &b->rest.state;
    const size_t n = s->count, bytes = n * sizeof(sphm_real);
    sphm_solid_copier c = {b, b->failed ? SPHM_FAILED_BACKEND : SPHM_OK, NULL};
    sphm_solid_download(&c, h->motion, d->motion, 8 * n, sizeof(sphm_real));
    sphm_solid_download(&c, h->potential, d->potential + (size_t)b->clock.buffer * n, n, sizeof(sphm_real));
    sphm_solid_download(&c, h->recovery, d->recovery, n, sizeof(sphm_real));
    sphm_solid_download(&c, h->activation, d->activation, n, sizeof(sphm_real));
    sphm_solid_download(&c, h->fibre_rate, d->fibre_rate, n, sizeof(sphm_real));
    sphm_solid_download(&c, h->density, d->density, n, sizeof(sphm_real));
    sphm_solid_download(&c, h->pressure, d->pressure, n, sizeof(sphm_real));
    sphm_solid_finish_copies(&c);
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
    sphm_solid_backend *b = inside(backend);
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
    return sphm_solid_upload_state(b, context);
}

static sphm_time_step_limits limits(const sphm_backend *backend) {
    const sphm_solid_backend *b = look_inside(backend);
    return sphm_solid_limits(b->model, &b->rest.gradient, b->modulus_Pa);
}

const char *const sphm_solid_launch_names[SPHM_SOLID_LAUNCHES] = {
    "hits",   "end_force",   "end_sum",    "end_step", "move",     "spread", "strain",
    "report", "part_strain", "part_force", "part_sum", "snapshot", "steps"};

static sphm_timing timing(const sphm_backend *backend) {
    const sphm_solid_backend *b = look_inside(backend);
    const double *launch_s = b->ops->launch_times(b->device);
    sphm_timing t = b->timing;
    sphm_device_report_launches(&t, launch_s, b->launch_s, sphm_solid_launch_names, SPHM_SOLID_LAUNCHES);
    if (launch_s) {
        t.forces_s = launch_s[SPHM_SOLID_MOVE] - b->launch_s[SPHM_SOLID_MOVE];
        t.density_pressure_s = launch_s[SPHM_SOLID_STRAIN] - b->launch_s[SPHM_SOLID_STRAIN];
        t.diffusion_s = launch_s[SPHM_SOLID_SPREAD] - b->launch_s[SPHM_SOLID_SPREAD];
    }
    t.memory_bytes = sizeof *b + sphm_state_bytes(b->rest.state.count) + b->device_bytes + b->host_bytes;
    if (b->look)
        t.memory_bytes += b->look->device_bytes + b->look->host_bytes;
    return t;
}

static void reset_timing(sphm_backend *backend) {
    sphm_solid_backend *b = inside(backend);
    memset(&b->timing, 0, sizeof b->timing);
    b->timing.neighbours_per_particle = b->rest.gradient.neighbours_per_particle;
    if (b->ops->launch_times(b->device))
        memcpy(b->launch_s, b->ops->launch_times(b->device), sizeof b->launch_s);
}

static const char *device(const sphm_backend *backend) {
    return look_inside(backend)->ops->name(look_inside(backend)->device);
}

const sphm_backend_ops sphm_device_solid_backend = {"cuda",
                                                    NULL,
                                                    destroy,
                                                    sphm_solid_step,
                                                    view,
                                                    restore,
                                                    limits,
                                                    timing,
                                                    reset_timing,
                                                    device,
                                                    sphm_solid_wrench,
                                                    clock_of,
                                                    SPHM_SUBMISSION_STEPS,
                                                    sphm_solid_look,
                                                    sphm_solid_looked};
