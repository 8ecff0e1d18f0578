/* Memory of the solid tissue on both sides, and what the rest shape fixes of it. */
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "cuda/memory.h"
#include "cuda/solid_inside.h"

static size_t cut_device(sphm_solid_device *d, size_t n, size_t pairs, size_t held, char *memory) {
    size_t used = 0;
#define ARRAY(type, name, elements, meaning)                                                                 \
    d->name = (type *)sphm_cut(memory, (elements) * sizeof(type), &used);
#include "cuda/solid_arrays.inc"
#undef ARRAY
    return used;
}

static size_t cut_host(sphm_solid_host *h, size_t n, char *memory) {
    size_t used = 0;
    h->submission = (sphm_solid_submission *)sphm_cut(memory, sizeof *h->submission, &used);
    h->report = (sphm_solid_report *)sphm_cut(memory, sizeof *h->report, &used);
    h->part_sum = (double *)sphm_cut(memory, SPHM_SOLID_PART_NUMBERS * sizeof(double), &used);
    h->motion = (sphm_real *)sphm_cut(memory, 8 * n * sizeof(sphm_real), &used);
    h->potential = (sphm_real *)sphm_cut(memory, n * sizeof(sphm_real), &used);
    h->recovery = (sphm_real *)sphm_cut(memory, n * sizeof(sphm_real), &used);
    h->activation = (sphm_real *)sphm_cut(memory, n * sizeof(sphm_real), &used);
    h->fibre_rate = (sphm_real *)sphm_cut(memory, n * sizeof(sphm_real), &used);
    h->density = (sphm_real *)sphm_cut(memory, n * sizeof(sphm_real), &used);
    h->pressure = (sphm_real *)sphm_cut(memory, n * sizeof(sphm_real), &used);
    return used;
}

sphm_status sphm_solid_allocate(sphm_solid_backend *b, sphm_context *context) {
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

void sphm_solid_upload(sphm_solid_copier *c, void *to, const void *from, size_t elements, size_t size) {
    if (c->status == SPHM_OK)
        c->status = c->b->ops->upload(c->b->device, to, from, elements * size, c->context);
}

void sphm_solid_download(sphm_solid_copier *c, void *to, const void *from, size_t elements, size_t size) {
    if (c->status == SPHM_OK)
        c->status = c->b->ops->download(c->b->device, to, from, elements * size, c->context);
}

void sphm_solid_finish_copies(sphm_solid_copier *c) {
    if (c->status == SPHM_OK)
        c->status = c->b->ops->wait(c->b->device, c->context);
}

static void list_held(const sphm_solid_backend *b, int32_t *held) {
    const sphm_state *s = &b->rest.state;
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        const uint8_t attached = end == SPHM_END_ORIGIN ? SPHM_ATTACHED_ORIGIN : SPHM_ATTACHED_INSERTION;
        for (size_t i = 0; i < s->count; ++i)
            if (s->attachment[i] == attached)
                *held++ = (int32_t)i;
    }
}

sphm_status sphm_solid_upload_rest(const sphm_solid_backend *b, sphm_context *context) {
    const sphm_solid_device *d = &b->solid;
    const sphm_state *s = &b->rest.state;
    const sphm_neighbours *rows = &b->rest.rows;
    const size_t n = s->count, pairs = rows->row_start[n];
    const size_t held = d->held_count[SPHM_END_ORIGIN] + d->held_count[SPHM_END_INSERTION];
    const sphm_real *const fibre[3] = {s->fibre_x, s->fibre_y, s->fibre_z};
    _Static_assert(sizeof *rows->row_start == sizeof *d->row_start, "row_start is 64 bits wide");
    sphm_real *columns = (sphm_real *)malloc(6 * n * sizeof *columns);
    sphm_real *rest = (sphm_real *)malloc(4 * n * sizeof *rest);
    sphm_real *pair = (sphm_real *)malloc((pairs + 1) * sizeof *pair);
    int32_t *slots = (int32_t *)malloc((held + 1) * sizeof *slots);
    sphm_solid_copier c = {b, SPHM_OK, context};
    if (!columns || !rest || !pair || !slots)
        c.status = sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory to prepare %zu particles", n);
    if (c.status == SPHM_OK) {
        for (size_t i = 0; i < n; ++i)
            for (size_t k = 0; k < 6; ++k)
                columns[k * n + i] = b->rest.gradient.correction[6 * i + k];
        for (size_t i = 0; i < n; ++i) {
            const sphm_real line[4] = {s->rest_x[i], s->rest_y[i], s->rest_z[i], 0};
            memcpy(rest + 4 * i, line, sizeof line);
        }
        for (size_t k = 0; k < pairs; ++k)
            pair[k] = b->rest.gradient.pair[4 * k + 3];
        list_held(b, slots);
    }
    sphm_solid_upload(&c, d->row_start, rows->row_start, n + 1, sizeof *rows->row_start);
    sphm_solid_upload(&c, d->row_count, rows->row_count, n, sizeof *rows->row_count);
    sphm_solid_upload(&c, d->neighbour, rows->slot, pairs, sizeof *rows->slot);
    sphm_solid_upload(&c, d->pair, pair, pairs, sizeof(sphm_real));
    sphm_solid_upload(&c, d->rest, rest, 4 * n, sizeof(sphm_real));
    sphm_solid_upload(&c, d->weight, b->rest.diffusion.weight, pairs, sizeof(sphm_real));
    sphm_solid_upload(&c, d->correction, columns, 6 * n, sizeof(sphm_real));
    for (size_t a = 0; a < 3; ++a)
        sphm_solid_upload(&c, d->fibre + a * n, fibre[a], n, sizeof(sphm_real));
    sphm_solid_upload(&c, d->relative_volume, s->relative_volume, n, sizeof(sphm_real));
    sphm_solid_upload(&c, d->attachment, s->attachment, n, 1);
    sphm_solid_upload(&c, d->electrodes, s->electrodes, n, 1);
    sphm_solid_upload(&c, d->id, s->id, n, sizeof *d->id);
    sphm_solid_upload(&c, d->held, slots, held, sizeof *slots);
    sphm_solid_finish_copies(&c);
    free(columns);
    free(rest);
    free(pair);
    free(slots);
    return c.status;
}

void sphm_solid_set_constants(sphm_solid_backend *b) {
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
