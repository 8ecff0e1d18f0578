/* See look.h. */
#include "cuda/look.h"

#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "cuda/memory.h"

static size_t cut_device(sphm_look_device *d, size_t n, size_t pairs, char *memory) {
    size_t used = 0;
#define ARRAY(type, name, elements, meaning)                                                                 \
    d->name = (type *)sphm_cut(memory, (elements) * sizeof(type), &used);
#include "cuda/look_arrays.inc"
#undef ARRAY
    return used;
}

static size_t cut_home(sphm_look *look, char *memory) {
    const size_t n = look->on_device.count;
    size_t used = 0;
    for (int k = 0; k < 2; ++k) {
        sphm_look_home *h = &look->home[k];
        h->result = (sphm_look_result *)sphm_cut(memory, sizeof *h->result, &used);
        h->extra = (double *)sphm_cut(memory, look->extra_count * sizeof *h->extra, &used);
        h->fields = (float *)sphm_cut(memory, SPHM_LOOK_FIELDS * n * sizeof *h->fields, &used);
        h->place = (sphm_real *)sphm_cut(memory, 3 * n * sizeof *h->place, &used);
    }
    return used;
}

static sphm_status upload_rest(const sphm_look *look, const sphm_observer *o, sphm_context *context) {
    const sphm_look_device *d = &look->on_device;
    const sphm_fibre_weights *f = &o->fibre;
    const size_t n = d->count, pairs = f->row_start[n];
    _Static_assert(sizeof *f->row_start == sizeof *d->fibre_start, "row_start is 64 bits wide");
    const struct {
        void *to;
        const void *from;
        size_t bytes;
    } all[] = {{d->rest, o->rest_m, 3 * n * sizeof *d->rest},
               {d->role, o->role, n * sizeof *d->role},
               {d->fibre_start, f->row_start, (n + 1) * sizeof *d->fibre_start},
               {d->fibre_particle, f->particle, pairs * sizeof *d->fibre_particle},
               {d->fibre_weight, f->weight, pairs * sizeof *d->fibre_weight}};
    sphm_status status = SPHM_OK;
    for (size_t k = 0; k < sizeof all / sizeof *all && status == SPHM_OK; ++k)
        status = look->ops->upload(look->device, all[k].to, all[k].from, all[k].bytes, context);
    /* The sources are not page-locked, and on another stream the looks begin. */
    return status == SPHM_OK ? look->ops->wait(look->device, context) : status;
}

static sphm_status fill(sphm_look *look, const sphm_observer *observer, sphm_context *context) {
    const size_t n = observer->count, pairs = observer->fibre.row_start[n];
    look->on_device.count = n;
    look->on_device.constants = observer->look;
    look->device_bytes = cut_device(&look->on_device, n, pairs, NULL);
    look->host_bytes = cut_home(look, NULL);
    void *on_device = NULL, *on_host = NULL;
    sphm_status status = look->ops->allocate(look->device, look->device_bytes, &on_device, context);
    if (status == SPHM_OK)
        status = look->ops->allocate_host(look->device, look->host_bytes, &on_host, context);
    if (status != SPHM_OK)
        return status;
    (void)cut_device(&look->on_device, n, pairs, (char *)on_device);
    (void)cut_home(look, (char *)on_host);
    return upload_rest(look, observer, context);
}

sphm_status sphm_look_create(sphm_look **made, const sphm_device_ops *ops, sphm_device *device,
                             const sphm_observer *observer, size_t extra_count, sphm_context *context) {
    *made = NULL;
    sphm_look *look = (sphm_look *)calloc(1, sizeof *look);
    if (!look)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to look at %zu particles", observer->count);
    look->ops = ops;
    look->device = device;
    look->extra_count = extra_count;
    const sphm_status status = fill(look, observer, context);
    if (status != SPHM_OK) {
        free(look);
        return status;
    }
    *made = look;
    return SPHM_OK;
}

void sphm_look_destroy(sphm_look *look) {
    free(look);
}

sphm_look_particle *sphm_look_lines(const sphm_look *look) {
    return look->on_device.line;
}

sphm_status sphm_look_begin(sphm_look *look, int particles, const double *extra, sphm_context *context) {
    const sphm_device_ops *ops = look->ops;
    const sphm_look_device *d = &look->on_device;
    sphm_look_home *h = &look->home[!look->front];
    sphm_status status = ops->look_after(look->device, context);
    for (int launch = 0; launch < SPHM_LOOK_LAUNCHES && status == SPHM_OK; ++launch)
        status = ops->launch_look(look->device, d, launch, context);
    if (status == SPHM_OK)
        status = ops->bring(look->device, h->result, d->result, sizeof *h->result, context);
    if (status == SPHM_OK && look->extra_count)
        status = ops->bring(look->device, h->extra, extra, look->extra_count * sizeof *extra, context);
    if (status == SPHM_OK && particles)
        status = ops->bring(look->device, h->fields, d->fields,
                            SPHM_LOOK_FIELDS * d->count * sizeof *h->fields, context);
    if (status == SPHM_OK && particles)
        status = ops->bring(look->device, h->place, d->place, 3 * d->count * sizeof *h->place, context);
    if (status == SPHM_OK)
        status = ops->mark(look->device, context);
    h->particles = particles;
    look->under_way = status == SPHM_OK;
    return status;
}

const sphm_look_home *sphm_look_finish(sphm_look *look, int wait, sphm_looked *looked, sphm_status *status,
                                       sphm_context *context) {
    int finished = 0;
    *status = SPHM_OK;
    if (!look || !look->under_way)
        return NULL;
    *status = look->ops->marked(look->device, wait, &finished, context);
    if (*status != SPHM_OK || !finished)
        return NULL;
    look->under_way = 0;
    look->front = !look->front;
    const sphm_look_home *home = &look->home[look->front];
    looked->shape = home->result->shape;
    looked->sums = home->result->field_sums;
    looked->fields = home->particles ? home->fields : NULL;
    looked->place_m = home->particles ? home->place : NULL;
    return home;
}
