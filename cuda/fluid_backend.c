/* The fluid tissue on a device: creation, looking, limits. Memory is in
 * fluid_memory.c, steps are in fluid_submit.c. */
#include "cuda/fluid_backend.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/fluid_watch.h"
#include "cuda/fluid_inside.h"

static sphm_fluid_backend *inside(sphm_backend *backend) {
    return (sphm_fluid_backend *)backend;
}
static const sphm_fluid_backend *look_inside(const sphm_backend *backend) {
    return (const sphm_fluid_backend *)backend;
}

/* Creation
 * -------------------------------------------------------------------------------------------------
 */

static void destroy(sphm_backend *backend) {
    sphm_fluid_backend *b = inside(backend);
    if (!b)
        return;
    sphm_look_destroy(b->look);
    b->ops->close(b->device);
    sphm_fluid_free(b);
    free(b);
}

/* The first launches are made here: a device that cannot run them is refused.
 */
static sphm_status build(sphm_fluid_backend *b, sphm_context *context) {
    sphm_status status = b->ops->open(&b->device, context);
    if (status != SPHM_OK)
        return status;
    sphm_fluid_set_constants(b);
    status = sphm_fluid_allocate(b, context);
    if (status != SPHM_OK)
        return status;
    sphm_model_rest_state(b->model, &b->state);
    status = sphm_fluid_upload_state(b, context);
    if (status == SPHM_OK)
        status = sphm_fluid_build_rows(b, 0, context);
    return status == SPHM_OK ? sphm_fluid_measure_rest(b, context) : status;
}

sphm_status sphm_device_fluid_create(const sphm_device_ops *ops, const sphm_model *model,
                                     sphm_backend **backend, sphm_context *context) {
    *backend = NULL;
    sphm_fluid_backend *b = (sphm_fluid_backend *)calloc(1, sizeof *b);
    if (!b)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for the CUDA back end");
    b->model = model;
    b->ops = ops;
    const sphm_status status = build(b, context);
    if (status != SPHM_OK) {
        destroy((sphm_backend *)b);
        return status;
    }
    *backend = (sphm_backend *)b;
    return SPHM_OK;
}

/* Looking
 * --------------------------------------------------------------------------------------------------
 */

static void show_nothing(sphm_state *s) {
    sphm_real *const all[] = {s->x,        s->y,        s->z,        s->vx,        s->vy,
                              s->vz,       s->density,  s->pressure, s->recovery,  s->membrane_potential,
                              s->listed_x, s->listed_y, s->listed_z, s->activation};
    for (size_t a = 0; a < sizeof all / sizeof *all; ++a)
        for (size_t i = 0; i < s->count; ++i)
            all[a][i] = (sphm_real)NAN;
}

/* What cannot be had any more is shown as NaN, never as something older. */
static void look(sphm_fluid_backend *b) {
    if (b->seen)
        return;
    if (b->failed || sphm_fluid_download_state(b, NULL) != SPHM_OK) {
        b->failed = 1;
        show_nothing(&b->state);
    }
    b->seen = 1;
}

static const sphm_state *view(sphm_backend *backend) {
    look(inside(backend));
    return &inside(backend)->state;
}

static const sphm_state *clock_of(const sphm_backend *backend) {
    return &look_inside(backend)->state;
}

/* Slots in the order of ids, as on the CPU, and then those of the listed
 * positions: the same slots, and the same sums, as in the muscle that the state
 * was taken from. */
static sphm_status restore(sphm_backend *backend, const sphm_state *from, sphm_context *context) {
    sphm_fluid_backend *b = inside(backend);
    sphm_state *s = &b->state;
    const size_t n = s->count;
    look(b);
    if (b->failed) /* and what is seen stays NaN */
        return sphm_fail(context, SPHM_FAILED_BACKEND, "the device has failed before; reset the muscle");
    int32_t *slot_of = b->slots;
    for (size_t slot = 0; slot < n; ++slot)
        slot_of[s->id[slot]] = (int32_t)slot;
    sphm_state_permute(s, slot_of, b->scratch);
    sphm_status status = sphm_state_load_by_id(from, s, b->slots, context);
    if (status != SPHM_OK)
        return status;
    b->seen = 0;
    status = sphm_fluid_upload_state(b, context);
    if (status == SPHM_OK)
        status = sphm_fluid_build_rows(b, 0, context);
    b->failed = status != SPHM_OK;
    return b->failed ? SPHM_FAILED_BACKEND : SPHM_OK;
}

static sphm_time_step_limits limits(const sphm_backend *backend) {
    const sphm_fluid_backend *b = look_inside(backend);
    return sphm_fluid_limits(b->model, b->speed_m_per_s, b->rest_density_min);
}

const char *const sphm_fluid_launch_names[SPHM_FLUID_LAUNCHES] = {
    "list",   "box",    "lay_out", "bin",     "sort",     "starts", "reorder", "settle",
    "count",  "scan",   "fill",    "correct", "weigh",    "sum",    "rigid",   "predict",
    "smooth", "spread", "force",   "report",  "set_rest", "within", "snapshot"};

static sphm_timing timing(const sphm_backend *backend) {
    const sphm_fluid_backend *b = look_inside(backend);
    const double *launch_s = b->ops->launch_times(b->device);
    sphm_timing t = b->timing;
    sphm_device_report_launches(&t, launch_s, b->launch_s, sphm_fluid_launch_names, SPHM_FLUID_LAUNCHES);
    if (launch_s) { /* pressure and half of the cell model are part of smooth, the other half of force */
        double s[SPHM_FLUID_LAUNCHES];
        t.neighbours_s = 0;
        for (int k = 0; k < SPHM_FLUID_LAUNCHES; ++k) {
            s[k] = launch_s[k] - b->launch_s[k];
            t.neighbours_s += k < SPHM_FLUID_SUM ? s[k] : 0;
        }
        t.intermediate_velocity_s =
            s[SPHM_FLUID_SUM] + s[SPHM_FLUID_RIGID] + s[SPHM_FLUID_PREDICT] + s[SPHM_FLUID_SMOOTH];
        t.forces_s = s[SPHM_FLUID_FORCE];
        t.diffusion_s = s[SPHM_FLUID_SPREAD];
    }
    t.memory_bytes = sizeof *b + sphm_state_bytes(b->state.count) + b->device_bytes + b->host_bytes +
                     b->rows_bytes + 2 * b->state.count * sizeof *b->slots +
                     b->state.capacity * SPHM_STATE_ELEMENT_SIZE;
    if (b->look)
        t.memory_bytes += b->look->device_bytes + b->look->host_bytes;
    return t;
}

static void reset_timing(sphm_backend *backend) {
    sphm_fluid_backend *b = inside(backend);
    const double neighbours = b->timing.neighbours_per_particle;
    memset(&b->timing, 0, sizeof b->timing);
    b->timing.neighbours_per_particle = neighbours;
    if (b->ops->launch_times(b->device))
        memcpy(b->launch_s, b->ops->launch_times(b->device), sizeof b->launch_s);
}

static const char *device(const sphm_backend *backend) {
    return look_inside(backend)->ops->name(look_inside(backend)->device);
}

const sphm_backend_ops sphm_device_fluid_backend = {
    "cuda",  NULL,     destroy,          sphm_fluid_step, view,
    restore, limits,   timing,           reset_timing,    device,
    NULL,    clock_of, SPHM_FLUID_STEPS, sphm_fluid_look, sphm_fluid_looked};
